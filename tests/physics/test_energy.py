"""Energy: what elastic contact keeps, what damping and friction take."""

import numpy as np
import pytest
from conftest import body, joint, release, still

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS

ELASTIC = {"normal": jp.contact.Hertz(), "restitution": 1.0, "friction": jp.contact.Ambrosio(0.0)}
TUMBLING = {
    "offset": (2e-5, 1e-5, 3e-5, 0.0, 1e-3, 2e-3),
    "velocity": (0.2, 0.13, -0.1, 0.0, 3.0, -2.0),
    "duration": 5e-3,
}


def test_energy_residual_through_impacts_falls_with_the_step(free_mass):
    """Multi-rate at its second order, Euler at its first.

    rk4 is far below both, but scatters with the phase of each onset.
    """
    steps = np.array([8e-6, 4e-6, 2e-6, 1e-6])
    multi, euler, rk4 = (
        np.array(
            [
                free_mass(**TUMBLING, **ELASTIC, integrator=name, step=step)
                .finish()
                .audit.energy_residual
                for step in steps
            ]
        )
        for name in ("multi-rate", "semi-implicit-euler", "rk4")
    )
    assert np.polyfit(np.log(steps), np.log(multi), 1)[0] == pytest.approx(2.0, abs=0.15)
    assert (multi < 0.05 * euler).all()
    assert euler[:-1] / euler[1:] == pytest.approx(2.0, abs=0.1)
    assert (rk4 < 1e-2 * euler).all()
    assert rk4[-1] < 0.1 * rk4[0]


SEAT = 5e-3
"""Radial clearance of a bearing wide enough to slide in [m]."""


@pytest.mark.parametrize("direction", [0.0, 2.2])
@pytest.mark.parametrize("mu", [0.1, 0.4])
def test_sliding_face_is_slowed_by_mu_times_its_weight(free_mass, direction, mu):
    """x = v t - mu g t^2/2. The centre of mass lies in the face, so nothing tips."""
    weight, speed, duration = 2.0 * 9.81, 0.1, 0.02
    sizes = {"radial_clearance": SEAT, "axial_clearance": 2e-4}
    bearing = jp.RevoluteClearance(**sizes)
    sunk = (weight / bearing.hertz_stiffness) ** (2.0 / 3.0)
    way = np.array([np.cos(direction), np.sin(direction)])
    result = free_mass(
        **sizes,
        normal=jp.contact.Hertz(),
        friction=jp.contact.Ambrosio(mu),
        com=f"0 0 {-bearing.lj / 2}",
        gravity=(0, 0, -9.81),
        offset=(0, 0, -bearing.ca - sunk, 0, 0, 0),
        velocity=(*(speed * way), 0, 0, 0, 0),
        duration=duration,
        step=2e-6,
        integrator="rk4",
        record_every=100,
    ).finish()
    t = result.time
    along = result["journal_centre"].values[:, 0, :2] @ way
    assert along == pytest.approx(speed * t - 0.5 * mu * 9.81 * t**2, abs=1e-9)
    path = along[-1]
    work = result["friction_dissipation"].values[-1]
    assert work == pytest.approx(mu * weight * path, rel=1e-3)
    force = result["joint_force"].values[50, 0]
    assert force == pytest.approx([*(-mu * weight * way), weight], rel=1e-3)


def test_drives_joint_friction_and_gravity_balance_in_a_moving_robot(urdf):
    """All terms at once, over a motion that ends where it began: losses equal the drives' work."""
    path = urdf(
        body("one", 3.0, "0.15 0 0"),
        body("two", 2.0, "0.1 0 0"),
        joint("a", "base", "one", axis="0 1 0"),
        joint("b", "one", "two", axis="0 1 0", at="0.3 0 0"),
    )
    worn = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
    robot = jp.Mechanism(path, {"b": worn})
    motion = jp.Motion(["a", "b"], [0.0, 0.15, 0.3], [[0.0, 0.0], [0.4, -0.5], [0.0, 0.0]])
    losses = {"a": jp.loads.JointFriction(1.0, 0.5)}
    result = jp.simulate(robot, motion, joint_friction=losses)
    last = {name: float(result[name][-1]) for name in result.dataset.data_vars if
            result[name].dims == ("time",)}  # fmt: skip
    taken = last["normal_dissipation"] + last["friction_dissipation"] + last["joint_friction_loss"]
    assert last["drive_work"] == pytest.approx(taken, rel=0.03)
    assert last["joint_friction_loss"] > 0.3
    assert result.audit.relative_energy_residual < 0.005


def test_release_switches_every_drive_off(urdf):
    path = urdf(body("one", 3.0, "0.15 0 0"), joint("a", "base", "one", axis="0 1 0"))
    robot = jp.Mechanism(path)
    result = release(jp.Run(jp.Simulation(robot, still(robot, 0.01)))).finish()
    assert not result["drive"].values.any()
    assert result["q"].values[-1, 0] > 1e-4  # it falls


@pytest.mark.parametrize("method", INTEGRATORS.values(), ids=INTEGRATORS.keys())
def test_energy_residual_of_smooth_motion_falls_at_the_integrators_order(urdf, method):
    path = urdf(
        body("one", 3.0, "0.2 0 -0.1", 0.05),
        body("two", 2.0, "0.1 0 -0.2", 0.02),
        joint("j1", "base", "one", axis="0 1 0"),
        joint("j2", "one", "two", axis="0 1 0", at="0.3 0 0"),
    )
    mechanism = jp.Mechanism(path)
    motion = still(mechanism, 0.32)
    drive = jp.loads.ComputedTorque(bandwidth=1.0)
    steps = np.array([2e-3, 1e-3, 5e-4])
    found = []
    for step in steps:
        simulation = jp.Simulation(
            mechanism, motion, drive, step=step, integrator=method.name, record_every=1
        )
        run = release(jp.Run(simulation))
        run.workspace.v[:] = [3.0, -5.0]
        found.append(run.finish().audit.energy_residual)
    assert np.polyfit(np.log(steps), np.log(found), 1)[0] == pytest.approx(method.order, abs=0.25)
