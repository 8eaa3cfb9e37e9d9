"""The ideal robot, and how the worn one approaches it."""

import numpy as np
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
