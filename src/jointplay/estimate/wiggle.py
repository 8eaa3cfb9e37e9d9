"""Play of a joint from what its own servo reports while it is wiggled.

`wiggle_goal` is the motion, a `ServoLog` what was recorded, `Known` what is known of the joint
beforehand. `play_of` answers with a band or a bound, or says why the log cannot tell. With the
encoder on the output, features of the log that ignore phase go through a small regression, trained
on a broad family of simulated joints (benchmarks/truth/wiggle.py --train); with the encoder on the
motor, the two-inertia joint of `servo_joint` is fitted with each of a series of plays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jointplay.estimate.unknowns import Estimate
from jointplay.simulation.loads.drive import Servo

TRIANGLES = ((3.0, 40.0, 3), (3.0, 20.0, 2), (2.0, 8.0, 1), (1.0, 8.0, 2), (0.4, 4.0, 2))
"""Amplitude [deg], speed [deg/s] and number of each series of triangles."""
SQUARES = (1.0, 100.0, 0.3, 3)
"""Amplitude [deg], speed [deg/s], rest at each side [s] and number of the squares that follow."""


@dataclass(frozen=True)
class Known:
    """What is known of one joint; SI, referred to the joint."""

    servo: Servo
    """With the side of its encoder and its gains; friction and viscous need not be right."""
    rotor_inertia: float
    """Of the motor behind the gear [kg m^2]."""
    link_inertia: float
    """About the joint, the others held [kg m^2]."""
    load: float = 0.0
    """Gravity's torque on the joint in the pose [N m]."""


@dataclass(frozen=True)
class ServoLog:
    """What one joint's servo reported during a wiggle, arrays of one length."""

    joint: str
    time: np.ndarray
    """Increasing [s]."""
    goal: np.ndarray
    """As it was sent [rad]."""
    position: np.ndarray
    """As the encoder reads it, referred to the joint [rad]."""
    others: np.ndarray | None = None
    """Largest motion of the other joints at each time [rad]; None: not recorded."""


def wiggle_goal() -> tuple[np.ndarray, np.ndarray]:
    """The motion about the pose: times [s] and goals [rad] of its corners, straight between.

    Triangles of 3 deg and less at several speeds, then small squares; it begins and ends at zero.
    """
    time, goal = [0.0], [0.0]

    def to(where: float, speed: float) -> None:
        time.append(time[-1] + abs(where - goal[-1]) / speed)
        goal.append(where)

    for amplitude, speed, number in TRIANGLES:
        for _ in range(number):
            to(amplitude, speed)
            to(-amplitude, speed)
        to(0.0, speed)
    amplitude, speed, rest, number = SQUARES
    for where in number * (amplitude, -amplitude):
        to(where, speed)
        time.append(time[-1] + rest)
        goal.append(where)
    to(0.0, speed)
    time.append(time[-1] + rest)
    goal.append(0.0)
    return np.array(time), np.radians(goal)


def play_of(log: ServoLog, known: Known) -> Estimate:
    """The play of a joint's gear by a log of its wiggle [rad].

    Its interval is a band in tenths of a degree, rounded outward; one without low end is an upper
    bound (not `found`); and there is a reason where the log cannot tell.
    """
    raise NotImplementedError
