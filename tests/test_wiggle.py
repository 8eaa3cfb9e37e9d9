"""Wiggle test: the two-inertia joint against `Simulation`, and what logs tell of play."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.estimate.servo_joint import RECORD_S, ServoJoint
from jointplay.simulation.loads import JointFriction, Servo

SERVO = Servo.of(
    "STS3215", voltage=7.4, p_gain=30.0, resolution=2.0 * np.pi / 4096.0, dead_band_counts=1.0
)
ROTOR, LINK, PLAY = 0.0284, 0.02, np.radians(0.6)


@pytest.mark.parametrize(
    "changes",
    [
        {"encoder": "link", "resolution": 0.0, "dead_band_counts": 0.0},
        {"encoder": "motor", "d_gain": 0.5},
        {"encoder": "motor", "period": 2e-3},
    ],
    ids=["output", "motor", "sampled"],
)
def test_two_inertias_move_as_in_the_full_simulation(urdf, changes):
    servo = replace(SERVO, **changes)
    disc = urdf(body("disc", 1.0, "0 0 0", LINK), joint("a", "base", "disc", "continuous"))
    gear = jp.Gear(play=PLAY, rotor_inertia=ROTOR, stiffness=120.0, damping=0.4)
    goals = np.radians([[0.0], [3.0], [-3.0], [3.0], [3.0]])
    motion = jp.Motion(["a"], [0.0, 0.12, 0.3, 0.5, 0.6], goals, interpolation="spline")
    mechanism = jp.Mechanism(disc, gears={"a": gear})
    losses = {"a": JointFriction(0.02)}
    result = jp.simulate(
        mechanism, motion, drive=servo, joint_friction=losses, step=1e-5, record_every=100,
        estimate=False,
    )  # fmt: skip
    numbers = {"play": PLAY, "stiffness": 120.0, "damping": 0.4, "link_friction": 0.02}
    now = np.arange(601) * RECORD_S
    goal = motion(np.minimum(now + 0.5 * RECORD_S, 0.6))[0][:, 0]  # held for a record
    own = ServoJoint.of(servo, ROTOR, LINK, **numbers).move(goal)
    for angle, at in zip(own, (mechanism.motor("a"), mechanism.coordinate("a")), strict=True):
        there = np.interp(now, result.time, result["q"].values[:, at])
        assert np.ptp(there) > np.radians(1.5)
        assert np.abs(angle - there).max() < 0.01 * np.ptp(there)
