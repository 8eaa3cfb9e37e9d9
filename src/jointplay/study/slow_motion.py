"""Slow motion of one joint under its servo, by a solver of stiff differential equations.

While friction holds or creeps and an integral winds up, minutes pass between slips of milliseconds:
too long for the engine's fixed steps. A solver that adapts its steps to the error takes each such
phase in a few steps, implicit ones where the equations are stiff. The equations are those of the
engine, of the kernel's `gear` and `drive`, without sampling and without a gear's kinematic error; a
reading in counts changes from one count to the next within `EDGE` of a count, continuously.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import LSODA
from scipy.interpolate import CubicHermiteSpline

from jointplay.physics.kernel import JOINT_FRICTION_SPEED
from jointplay.simulation.loads import JointFriction, Servo

if TYPE_CHECKING:
    from jointplay.study.released import Axis

EDGE = 1e-4
"""Part of a count over which a reading changes to the next: with it a swing of 98 s between two
counts has the period that integration with fixed steps gives, with 1e-3 one of 119 s."""

RELATIVE, ABSOLUTE = 1e-7, (1e-10, 1e-10, 1e-9, 1e-9, 1e-8, 1e-11, 1e-11, 1e-11)
"""Tolerances of a step, the absolute ones of the states that `_rates` names: periods come out to
four digits."""

STEPS = 300_000
"""Most steps of the solver, 20 s of computing: 100 periods of the machine that needs most, of 100
drawn at random."""

SAMPLES = 12_000
"""Number of evenly spaced samples at which a motion is judged."""


def slow_motion(
    axis: Axis, start: float, play: bool, longest: float, first: float, later: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the motion so far, at ever later times: times (n,), positions of link and motor (2, n).

    Args:
        axis: a joint under a servo.
        start: distance from the goal at which link and motor begin [rad or m].
        play: whether the gear has its play.
        longest: end of the motion [s]; it ends before if the solver needs more than `STEPS`.
        first, later: time of the first motion yielded [s], and the factor to each next one.
    """
    solver = LSODA(
        _rates(axis, 0.5 * axis.gear.play if play else 0.0), 0.0, [start] * 2 + [0.0] * 6,
        longest, rtol=RELATIVE, atol=ABSOLUTE,
    )  # fmt: skip
    times, states, next_time = [0.0], [solver.y[:4].copy()], min(first, longest)
    for _ in range(STEPS):
        solver.step()
        if solver.status == "failed":
            return
        times.append(solver.t)
        states.append(solver.y[:4].copy())
        if solver.t >= next_time or solver.status == "finished":
            time = np.linspace(0.0, solver.t, SAMPLES)
            q, v = np.split(np.array(states), 2, axis=1)
            yield time, CubicHermiteSpline(times, q, v)(time).T
            if solver.status == "finished":
                return
            next_time *= later


def _friction(losses: JointFriction) -> Callable[[float, float], tuple[float, float]]:
    """Function of speed and bristle deflection that returns friction and rate of that deflection.

    Without presliding friction is a smoothed function of speed alone, and the rate is 0.
    """
    coulomb, excess, presliding = losses.coulomb, losses.excess, losses.presliding
    stiffness = (coulomb + excess) / presliding if presliding else 0.0

    def friction(speed: float, bend: float) -> tuple[float, float]:
        ratio = speed / losses.stribeck_speed
        dry = coulomb + excess * math.exp(-min(ratio * ratio, 700.0))
        if not stiffness:
            return dry * math.tanh(speed / JOINT_FRICTION_SPEED) + losses.viscous * speed, 0.0
        rate = speed - abs(speed) * stiffness * bend / dry
        return stiffness * bend + losses.presliding_damping * rate + losses.viscous * speed, rate

    return friction


def _rates(axis: Axis, half: float) -> Callable[[float, np.ndarray], tuple[float, ...]]:
    """Right-hand side of the equations, a function of time and state.

    State: position of link and motor, their speeds, the integral term [V], the bristle deflections
    of link and motor, and the gear's hysteresis torque; `half` is half the gear's play [rad or m].
    """
    gear, servo = axis.gear, axis.drive
    assert isinstance(servo, Servo)
    curve, loss, (grip, bend) = gear.curve(), gear.losses, gear.bristles
    slopes, ends = curve.slopes.tolist(), [*curve.twists.tolist(), math.inf]
    on_link, on_motor = _friction(axis.friction), _friction(servo.with_friction(JointFriction()))
    voltage, limit = servo.voltage, math.inf if servo.effort is None else servo.effort

    def rates(time: float, state: np.ndarray) -> tuple[float, ...]:
        link, motor, v, w, integral, link_bend, motor_bend, hysteresis = state.tolist()
        # Teeth: a piecewise linear stiffness beyond the play, and damping that never pulls.
        twist, rate = motor - link, w - v
        depth, elastic, teeth = abs(twist) - half, 0.0, 0.0
        if depth > 0.0:
            begin = 0.0
            for slope, end in zip(slopes, ends, strict=True):
                elastic += slope * max(min(depth, end) - begin, 0.0)
                begin = end
            side = math.copysign(1.0, twist)
            elastic *= side
            teeth = side * max(side * elastic + gear.damping * side * rate, 0.0)
        torque, tooth_torque = teeth + hysteresis, elastic + hysteresis
        # Servo: reading in counts, dead band, PID in volts with anti-windup, limit of the supply.
        read, speed = (link, v) if servo.encoder == "link" else (motor, w)
        if servo.resolution:
            count = read / servo.resolution + 0.5
            steps = math.floor(count)
            read = servo.resolution * (steps - max(1.0 - (count - steps) / EDGE, 0.0))
        error = -math.copysign(max(abs(read) - servo.band, 0.0), read)
        integral = min(max(integral, -voltage), voltage)
        command = servo.p_gain * error + integral - servo.d_gain * speed
        effort = servo.stall * min(max(command, -voltage), voltage) - servo.braking * w
        rise = servo.i_gain * error
        rise = 0.0 if abs(integral) >= voltage and rise * integral > 0.0 else rise
        # Friction of both bodies, and the gear's losses, which grow with the torque of its teeth.
        link_friction, link_rate = on_link(v, link_bend)
        motor_friction, motor_rate = on_motor(w, motor_bend)
        share = loss.driving if tooth_torque * w > 0.0 else loss.driven
        dry = loss.running + share * abs(tooth_torque)
        motor_friction += dry * math.tanh(w / JOINT_FRICTION_SPEED) + loss.viscous * w
        return (
            v, w, (torque + axis.load - link_friction) / axis.inertia,
            (min(max(effort, -limit), limit) - motor_friction - torque) / gear.rotor_inertia,
            rise, link_rate, motor_rate, grip / bend * rate - abs(rate) / bend * hysteresis,
        )  # fmt: skip

    return rates
