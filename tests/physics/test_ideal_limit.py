"""The ideal robot, and how the worn one approaches it."""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint

import jointplay as jp

MOTION = jp.Motion(["a", "b"], [0.0, 0.2], [[0.0, 0.0], [0.5, -0.8]])


def arm(urdf, clearance=None, axis="0 0 1", gravity=(0, 0, 0)):
    path = urdf(
        body("one", 3.0, "0.15 0 0"),
        body("two", 2.0, "0.1 0 0"),
        '<link name="tool"/>',
        joint("a", "base", "one", axis=axis),
        joint("b", "one", "two", axis=axis, at="0.3 0 0"),
        joint("flange", "two", "tool", "fixed", at="0.2 0 0"),
    )
    worn = {}
    if clearance:
        worn["b"] = jp.RevoluteClearance(
            radial_clearance=clearance, axial_clearance=clearance, friction=jp.contact.Ambrosio(0.0)
        )
    return jp.Mechanism(path, worn, gravity=gravity)


@pytest.mark.parametrize("gravity", [(0, 0, 0), (0, 0, -9.81)])
def test_tool_error_is_proportional_to_the_clearance(urdf, gravity):
    """Without friction, which takes its torque R_j mu F from the drive at any clearance."""
    ideal = jp.simulate(arm(urdf, gravity=gravity), MOTION)["tool_position"].values
    clearances = np.array([1e-3, 2e-4, 4e-5])
    errors = []
    for clearance in clearances:
        worn = jp.simulate(arm(urdf, clearance, gravity=gravity), MOTION)
        errors.append(np.linalg.norm(worn["tool_position"].values - ideal, axis=1).max())
    slope = np.polyfit(np.log(clearances), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.05)
    # Shift by C_r and C_a, and tilt 2 C_r/L_j at the tool's reach of 0.2 m.
    assert (errors < clearances * (np.sqrt(2.0) + 1.1 * 0.2 * 2.0 / 38e-3)).all()


def test_reactions_of_the_ideal_robot_are_newtons(urdf):
    """Force at each joint = mass beyond it times (acceleration of its centre - gravity)."""
    robot = arm(urdf, axis="0 0.6 0.8", gravity=(1.0, 2.0, -9.81))
    losses = {"a": jp.loads.JointFriction(3.0, 1.0), "b": jp.loads.JointFriction(1.0, 0.5)}
    result = jp.simulate(robot, MOTION, joint_friction=losses, integrator="rk4", record_every=1)
    centres = []
    for q in result["q"].values:
        pin.forwardKinematics(robot.model, robot.data, q)
        bodies = [robot.data.oMi[i].act(robot.model.inertias[i].lever) for i in (1, 2)]
        centres.append(bodies)
    centres, dt = np.array(centres), 1e-5
    every = 5  # a wider difference, for less round-off
    h = every * dt
    accelerations = (
        centres[2 * every :] - 2.0 * centres[every:-every] + centres[: -2 * every]
    ) / h**2
    forces = np.array([3.0, 2.0])[:, None] * (accelerations - robot.gravity)
    expected = np.stack([forces.sum(axis=1), forces[:, 1]], axis=1)
    found = result["reaction_force"].values[every:-every]
    assert np.ptp(expected, axis=0).max() > 20.0
    assert np.abs(found - expected).max() < 0.1
