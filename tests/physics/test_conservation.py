"""Momentum and rigid motion: the contact is internal, so it acts on the pair as a whole not at all.

Sliders that carry body one leave the pair free to fly; nothing is driven, there is no gravity.
"""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, release, still
from hypothesis import given, settings
from hypothesis import strategies as st

import jointplay as jp
from jointplay.physics.kernel import Command, Status

PLAY = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
SLIDERS = (
    '<link name="a"/><link name="b"/>',
    body("one", 3.0, "0.02 0 0.1"),
    joint("sx", "base", "a", "prismatic", "1 0 0"),
    joint("sy", "a", "b", "prismatic", "0 1 0"),
    joint("sz", "b", "one", "prismatic", "0 0 1"),
)
SKEW = {"at": "0.1 0 0.05", "rpy": "0.3 -0.2 0.5", "axis": "0.6 0 0.8"}


def flying(path, worn, velocity, *, journals=1.0, **options):
    """A run of the undriven robot at `path`; `velocity` of the first coordinates, then journals."""
    robot = jp.Mechanism(path, dict.fromkeys(worn, PLAY), gravity=(0, 0, 0))
    options = {"duration": 0.02, "step": 4e-6, "integrator": "rk4"} | options
    motion = still(robot, options["duration"])
    drive = jp.loads.ComputedTorque(bandwidth=1.0)
    run = release(jp.Run(jp.Simulation(robot, motion, drive, **options)))
    run.workspace.v[: len(velocity)] = velocity
    random = np.random.default_rng(0)
    for name in worn:
        at = robot.virtual_link(name)
        spread = journals * np.array([0.2, 0.2, 0.2, 2.0, 1.0, 1.0])
        run.workspace.v[at : at + 6] = spread * random.uniform(-1.0, 1.0, 6)
    return robot, run


def momenta(robot, result):
    """Linear momentum and angular momentum about the world's origin, for every record."""
    found = []
    for q, v in zip(result["q"].values, result["v"].values, strict=True):
        h = pin.computeCentroidalMomentum(robot.model, robot.data, q, v)
        centre = pin.centerOfMass(robot.model, robot.data, q)
        found.append([h.linear, h.angular + np.cross(centre, h.linear)])
    return np.array(found).transpose(1, 0, 2)


def drift(values):
    return np.abs(values - values[0]).max() / np.linalg.norm(values[0])


@pytest.mark.parametrize("worn", [["pin"], ["pin", "pin2"]])
def test_momentum_of_tumbling_bodies_survives_impacts(urdf, worn):
    path = urdf(
        *SLIDERS,
        body("two", 2.0, "0.1 0.05 -0.1"),
        body("three", 1.0, "0.05 0 0.1"),
        joint("pin", "one", "two", **SKEW),
        joint("pin2", "two", "three", at="0.2 0 0", axis="0 1 0"),
    )
    robot, run = flying(path, worn, [0.1, -0.2, 0.05])
    result = run.finish()
    assert result.audit.impacts > 5 * len(worn)
    assert drift(momenta(robot, result)[0]) < 1e-8


@pytest.mark.parametrize("axis", ["0 0 1", "0.6 0 0.8"])
def test_angular_momentum_about_a_free_hinge_survives_impacts(urdf, axis):
    path = urdf(
        body("one", 3.0, "0.2 0 0.1"),
        body("two", 2.0, "0.1 0.05 -0.1"),
        joint("hinge", "base", "one", axis=axis),
        joint("pin", "one", "two", **SKEW),
    )
    drifts = []
    for step in (4e-6, 2e-6):
        robot, run = flying(path, ["pin"], [0.5], step=step)
        result = run.finish()
        assert result.audit.impacts > 5
        drifts.append(drift(momenta(robot, result)[1] @ np.array(axis.split(), float)))
    assert drifts[0] < 1e-7
    assert drifts[1] < drifts[0] / 8.0


def momentum_rate(run):
    """Rate of the momentum over the contact force, at the run's state."""
    workspace, robot = run.workspace, run.mechanism
    assert workspace.execute(Command.BEGIN) == Status.COMPLETED
    q, v, tau = workspace.q, workspace.v, workspace.tau.copy()
    assert not tau[:3].any()
    force = np.linalg.norm(tau[3:6])
    a = pin.aba(robot.model, robot.data, q, v, tau)
    rate = pin.computeCentroidalMomentumTimeVariation(robot.model, robot.data, q, v, a).linear
    return np.linalg.norm(rate) / force, force


def pressed(path, pose, speed):
    _, run = flying(path, ["pin"], speed[:3])
    run.workspace.q[3:] = pose
    run.workspace.v[3:] = speed[3:]
    return run


place, turn, rate = st.floats(-2.2e-4, 2.2e-4), st.floats(-1e-2, 1e-2), st.floats(-1.0, 1.0)


@pytest.fixture
def tumbler(urdf):
    return urdf(*SLIDERS, body("two", 2.0, "0.1 0.05 -0.1"), joint("pin", "one", "two", **SKEW))


@settings(max_examples=25)
@given(place, st.floats(2.01e-4, 2.2e-4), place, turn, turn, st.tuples(*[rate] * 9))
def test_contact_forces_leave_the_momentum_alone_in_any_state(
    tmp_path_factory, x, y, z, pitch, roll, speed
):
    path = tmp_path_factory.mktemp("r") / "robot.urdf"
    elements = (*SLIDERS, body("two", 2.0, "0.1 0.05 -0.1"), joint("pin", "one", "two", **SKEW))
    path.write_text(f'<robot name="r"><link name="base"/>{"".join(elements)}</robot>')
    error, force = momentum_rate(pressed(path, [x, y, z, 0.3, pitch, roll], np.array(speed)))
    assert force > 1.0
    assert error * force < 1e-8 * max(force, 1e3)


def test_internal_forces_do_no_work_in_rigid_motion(urdf):
    """A pair pressed together and swung rigidly: kinetic energy stands still, however it turns."""
    path = urdf(
        body("one", 3.0, "0.2 0 0.1"),
        body("two", 2.0, "0.1 0.05 -0.1"),
        joint("hinge", "base", "one", axis="0 1 0"),
        joint("pin", "one", "two", **SKEW),
    )
    robot, run = flying(path, ["pin"], [5.0], journals=0.0)
    run.workspace.q[1:] = [1.5e-4, 1.7e-4, 2.1e-4, 0.4, 3e-3, -2e-3]
    assert run.workspace.execute(Command.BEGIN) == Status.COMPLETED
    q, v, tau = run.workspace.q, run.workspace.v, run.workspace.tau
    force = np.linalg.norm(tau[1:4])
    assert force > 100.0
    a = pin.aba(robot.model, robot.data, q, v, tau)
    h = 1e-6
    ahead, behind = (
        pin.computeKineticEnergy(robot.model, robot.data, q + s * h * v, v + s * h * a)
        for s in (1.0, -1.0)
    )
    speed = 5.0 * 0.1  # of the contact, some 0.1 m from the hinge
    assert abs(ahead - behind) / (2.0 * h) < 1e-6 * force * speed


def test_pair_carried_along_moves_as_one_at_rest(tumbler):
    """Galilean invariance: the same impacts at any constant speed of the whole."""
    journals = []
    for carried in (0.0, 1.0):
        _, run = flying(tumbler, ["pin"], carried * np.array([3.0, -2.0, 1.0]), duration=5e-3)
        journals.append(run.finish())
    assert journals[0].audit.impacts > 2
    still_, moving = (result["q"].values[:, 3:] for result in journals)
    assert np.abs(still_ - moving).max() < 1e-9
