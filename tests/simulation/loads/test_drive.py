"""Drives: gains, feed-forward, and the coordinate they act on."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint, release, still

from jointplay import (
    Gear,
    JointplayError,
    Mechanism,
    Motion,
    RevoluteClearance,
    Simulation,
    simulate,
)
from jointplay.paper import scara
from jointplay.physics.kernel import Status
from jointplay.scenario.robot import robot_scenario
from jointplay.simulation.analysis import twins
from jointplay.simulation.loads import ComputedTorque, JointFriction
from jointplay.simulation.run import Run

FLAT = {"gravity": (0.0, 0.0, 0.0)}


def two_links(urdf, axis="0 0 1", **options):
    path = urdf(
        body("one", 3.0, "0.15 0.02 0"),
        body("two", 2.0, "0.1 0 0.03"),
        joint("a", "base", "one", axis=axis),
        joint("b", "one", "two", axis=axis, at="0.3 0 0"),
    )
    return Mechanism(path, **options)


@pytest.mark.parametrize(("bandwidth", "ratio"), [(50.0, 1.0), (200.0, 0.3)])
def test_released_axis_answers_as_the_oscillator_of_its_gains(urdf, bandwidth, ratio):
    path = urdf(body("arm", 2.0, "0.1 0 0"), joint("a", "base", "arm"))
    mechanism = Mechanism(path, **FLAT)
    drive = ComputedTorque(bandwidth, ratio)
    run = Run(Simulation(mechanism, still(mechanism, 0.1), drive=drive, integrator="rk4"))
    run.workspace.q[0] = 0.01
    result = run.finish()
    root = bandwidth * np.sqrt(complex(ratio**2 - 1.0) or 1e-12)
    t = result.time
    decay = np.exp(-ratio * bandwidth * t)
    exact = 0.01 * decay * (np.cosh(root * t) + ratio * bandwidth / root * np.sinh(root * t)).real
    assert np.abs(result["q"].values[:, 0] - exact).max() < 1e-8


def test_feed_forward_holds_the_robot_against_gravity(urdf):
    mechanism = two_links(urdf, axis="0 1 0")
    result = simulate(mechanism, still(mechanism, 0.1))
    assert np.abs(result["q"].values).max() < 1e-12
    weights = -9.81 * np.array([3.0 * 0.15 + 2.0 * 0.4, 2.0 * 0.1])  # about y, x to the right
    assert result["drive"].values[-1] == pytest.approx(weights)


@pytest.mark.parametrize(
    ("integrator", "error"),
    [("semi-implicit-euler", 4e-6), pytest.param("rk4", 1e-7, marks=pytest.mark.thorough)],
)
def test_ideal_robot_tracks_its_reference(integrator, error):
    simulation = dataclasses.replace(scara(None), duration=1.5, integrator=integrator)
    result = simulation.run()
    reference, _, _ = simulation.motion(result.time)
    assert np.ptp(reference, axis=0).min() > 0.1  # every joint has moved
    assert np.abs(result["q"].values - reference).max() < error


def test_friction_of_the_joints_is_fed_forward(urdf):
    mechanism = two_links(urdf, **FLAT)
    motion = Motion(["a", "b"], [0.0, 0.3], [[0.0, 0.0], [0.5, -0.8]])
    losses = {"a": JointFriction(20.0, 3.0), "b": JointFriction(5.0, 1.0)}
    stiff, free = (simulate(mechanism, motion, joint_friction=f) for f in (losses, {}))
    reference, _, _ = motion(free.time)
    for result in (stiff, free):
        assert np.abs(result["q"].values - reference).max() < 1e-5
    # What the drives add is lost in the joints: q and its range are the same.
    exact = 20.0 * 0.5 + 5.0 * 0.8  # dry part; the viscous part is the integral of d v^2
    _, v, _ = motion(free.time)
    exact += np.trapezoid(v**2 @ [3.0, 1.0], free.time)
    assert stiff["joint_friction_loss"].values[-1] == pytest.approx(exact, rel=2e-3)


def test_drive_of_a_worn_joint_acts_on_its_yaw_alone(urdf):
    worn = {"b": RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)}
    mechanism = two_links(urdf, clearance=worn, **FLAT)
    motion = Motion(["b", "a"], [0.0, 0.1], [[0.0, 0.0], [0.2, -0.1]])  # any order of joints
    drive = simulate(mechanism, motion, duration=0.02)["drive"]
    ideal = simulate(mechanism.ideal(), motion, duration=0.02)["drive"]
    driven = [str(c) for c in drive["coordinate"].values if drive.sel(coordinate=c).values.any()]
    assert driven == ["a", "b.yaw"]
    assert drive.values[1, [0, 4]] == pytest.approx(ideal.values[1], rel=0.1)


@pytest.mark.parametrize(
    ("joints", "named"),
    [(["a", "b", "c"], "the motion names c;"), (["a", "c"], "the motion names c;")],
)
def test_motion_must_name_joints_that_move(urdf, joints, named):
    motion = Motion(joints, [0.0, 1.0], np.zeros((2, len(joints))))
    with pytest.raises(JointplayError) as caught:
        Run(Simulation(two_links(urdf), motion))
    assert str(caught.value).startswith(named)
    assert str(caught.value).endswith("the moving joints are: a, b")


@pytest.mark.parametrize("given", [{"bandwidth": -1.0}, {"damping_ratio": 1e308}])
def test_impossible_drives_are_refused(given):
    with pytest.raises(JointplayError):
        ComputedTorque(**given)


def test_joint_friction_comes_from_the_urdf_and_dissipates(urdf):
    entry = joint("pin", "base", "arm", at="0 0 0").replace(
        "</joint>", '<dynamics friction="0.3" damping="0.1"/></joint>'
    )
    mechanism = Mechanism(urdf(body("arm"), entry), gravity=(0, 0, 0))
    drive = ComputedTorque(bandwidth=1.0)
    run = release(Run(Simulation(mechanism, still(mechanism, 0.05), drive=drive, step=1e-5)))
    run.workspace.v[0] = 2.0
    result = run.finish()
    # I dw/dt = -0.3 - 0.1 w: w = (w0 + 3) exp(-10 t) - 3 with I = 0.01.
    exact = 5.0 * np.exp(-10.0 * result.time) - 3.0
    assert np.allclose(result["v"].values[:, 0], exact, atol=1e-3)
    lost = 0.5 * 0.01 * (2.0**2 - exact[-1] ** 2)
    assert result["joint_friction_loss"].values[-1] == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize(("rotor", "carried", "ratio"), [(0.95, 4.4, 1.0), (0.36, 0.09, 0.7)])
def test_a_drive_through_teeth_is_stable_up_to_what_their_damping_allows(rotor, carried, ratio):
    """By the roots of both masses' characteristic equation; half of it is taken."""
    stiffness = 4e4
    damping = 0.1 * np.sqrt(stiffness * rotor * carried / (rotor + carried))
    gear = Gear(play=1e-3, stiffness=stiffness, rotor_inertia=rotor, damping=damping)
    drive = ComputedTorque(damping_ratio=ratio, encoder="link")
    chosen = drive.through_teeth(carried, gear).bandwidth

    def growth(bandwidth):
        both, teeth = rotor + carried, [damping, stiffness]
        control = [1.0, 2.0 * ratio * bandwidth, bandwidth**2]
        inertial = [rotor * carried, 0.0, 0.0, 0.0, 0.0]
        return np.roots(np.polyadd(inertial, both * np.polymul(teeth, control))).real.max()

    assert growth(0.95 * 2.0 * chosen) < 0.0 < growth(1.2 * 2.0 * chosen)
    assert ComputedTorque(120.0, encoder="link").through_teeth(carried, gear).bandwidth == 120.0
    assert ComputedTorque().through_teeth(carried, gear).bandwidth is None
    assert drive.through_teeth(carried, replace(gear, damping=0.0)).bandwidth is None


@pytest.mark.parametrize(
    ("robot", "joint"), [("ar4", "joint_2"), ("so101", "shoulder_lift"), ("ur5", "elbow_joint")]
)
def test_an_encoder_behind_teeth_asks_for_no_bandwidth(robot, joint):
    """By the rules for gears and drives together; at 100 rad/s each of these swings up."""
    settings = [f"gears.{joint}.play=1 mrad", "drive.kind=computed-torque", "drive.encoder=link"]
    scenario = robot_scenario(robot, settings=[*settings, "integration.duration=1"])
    result = scenario.simulation().run(estimate=False, check_step=False)
    assert result.status == Status.COMPLETED
    assert result.tool_error.peak < 1e-3
    said = next(one for one in result.values if one.key == f"drives.{joint}.bandwidth")
    assert said.assumed
    assert said.source.startswith("rule drive bandwidth")
    assert f"drives of {said.value} by what their teeth allow, assumed" in result.summary()
    twin = twins.ideal_simulation(result)
    assert f"{twin.drive[joint].bandwidth:.3g} rad/s" == said.value
