"""A joint turned by its servo through a gear with play, alone: two inertias, some 30 ns a step.

The same servo as `simulation.loads.drive.Servo` and the same teeth as `model.gear.Gear`, for one
joint whose neighbours stand, where thousands of runs are wanted. Friction is dry with Stribeck's
excess, of both inertias, by the impulse that stops them at most (no speed below which it is
smoothed). tests/estimate/test_wiggle.py compares it with `Simulation`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.simulation.loads.drive import Servo

STEP_S, _OF_A_SWING = 1e-4, 0.2
"""Of the integration, at most [s], and by the angular frequency of the teeth's spring."""
RECORD_S = 1e-3
"""Interval of goals and of records [s]."""


@dataclass(frozen=True)
class ServoJoint:
    """All of a joint with its servo; SI, referred to the joint."""

    rotor_inertia: float
    link_inertia: float
    play: float
    stiffness: float
    damping: float
    friction: float
    """Dry, of the motor [N m]."""
    excess: float
    """Static beyond dry friction, of the motor, relative."""
    stribeck_speed: float
    viscous: float
    link_friction: float
    """Dry, of the link [N m]."""
    load: float
    stall: float
    """`Servo.stall` [N m/V]."""
    braking: float
    """`Servo.braking` [N m s/rad]."""
    voltage: float
    p_gain: float
    d_gain: float
    band: float
    resolution: float
    period: float
    """Of the servo's samples [s]; 0: continuous."""
    on_motor: float
    """1 if the encoder is on the motor, 0 if on the link."""

    @classmethod
    def of(
        cls, servo: Servo, rotor_inertia: float, link_inertia: float, *, play: float,
        stiffness: float, damping: float = 0.0, link_friction: float = 0.0, load: float = 0.0,
    ) -> ServoJoint:  # fmt: skip
        """A joint with such a servo and a gear of such play, stiffness and damping."""
        return cls(
            rotor_inertia, link_inertia, play, stiffness, damping, servo.friction, 0.0, 0.1,
            servo.viscous, link_friction, load, servo.stall, servo.braking, servo.voltage,
            servo.p_gain, servo.d_gain, servo.band, servo.resolution, servo.period or 0.0,
            float(servo.encoder == "motor"),
        )  # fmt: skip

    def move(self, goal: np.ndarray, start: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Angles of motor and link [rad] at the times of the goals.

        Args:
            goal: a goal each `RECORD_S` [rad], held until the next.
            start: where the link begins between the flanks, from -1 to 1; all begins at rest at
                the first goal.
        """
        out = np.empty((2, len(goal)))
        numbers = np.array(list(vars(self).values()), dtype=float)
        run(numbers, np.ascontiguousarray(goal, dtype=float), float(start), out)
        return out[0], out[1]


@compiled
def limit(goal: np.ndarray, most: float, out: np.ndarray) -> float:
    """Fill `out` with goals as firmware passes them on whose acceleration [rad/s^2] is limited."""
    at, speed, change = goal[0], 0.0, most * RECORD_S
    for i in range(len(goal)):
        away = goal[i] - at
        wanted = math.copysign(min(math.sqrt(2.0 * most * abs(away)), abs(away) / RECORD_S), away)
        speed += min(max(wanted - speed, -change), change)
        at += speed * RECORD_S
        out[i] = at
    return 0.0


@compiled
def run(p: np.ndarray, goal: np.ndarray, start: float, out: np.ndarray) -> float:
    """Fill `out` (2, n) with the angles of motor and link; numbers as in `ServoJoint`."""
    rotor, link, half, k, c = p[0], p[1], 0.5 * p[2], p[3], p[4]
    dry, excess, stribeck, viscous, link_dry, load = p[5], p[6], p[7], p[8], p[9], p[10]
    stall, braking, most, gain, slope, band = p[11], p[12], p[13], p[14], p[15], p[16]
    count, period, on_motor = p[17], p[18], p[19] > 0.5
    swing = math.sqrt(k * (1.0 / rotor + 1.0 / link))
    steps = int(RECORD_S / min(STEP_S, _OF_A_SWING / swing)) + 1
    dt = RECORD_S / steps
    motor, turned, speed, own = goal[0], goal[0] + start * half, 0.0, 0.0
    left, volts, wanted = 0.0, 0.0, 0.0
    for i in range(len(goal)):
        out[0, i] = motor
        out[1, i] = turned
        if i > 0:
            wanted = (goal[i] - goal[i - 1]) / RECORD_S
        for _ in range(steps):
            left -= dt
            if left < 0.5 * dt:
                left += period
                read = motor if on_motor else turned
                if count > 0.0:
                    read = math.floor(read / count + 0.5) * count
                error = goal[i] - read
                volts = 0.0
                if error > band:
                    volts = gain * (error - band)
                elif error < -band:
                    volts = gain * (error + band)
                if slope > 0.0:
                    volts += slope * (wanted - (speed if on_motor else own))
                volts = min(max(volts, -most), most)
            if period == 0.0:
                left = 0.0
            twist, rate, torque = motor - turned, speed - own, 0.0
            if twist > half:
                torque = max(k * (twist - half) + c * rate, 0.0)
            elif twist < -half:
                torque = min(k * (twist + half) + c * rate, 0.0)
            over = speed / stribeck
            most_dry = dry * (1.0 + excess / (1.0 + over * over))
            free = speed + dt / rotor * (stall * volts - torque - (braking + viscous) * speed)
            speed = math.copysign(max(abs(free) - dt / rotor * most_dry, 0.0), free)
            free = own + dt / link * (torque - load)
            own = math.copysign(max(abs(free) - dt / link * link_dry, 0.0), free)
            motor += dt * speed
            turned += dt * own
    return 0.0
