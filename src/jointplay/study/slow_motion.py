"""One joint under its servo as stiff differential equations, for motion too slow to be stepped.

While friction holds or creeps and an integral winds up, minutes pass between slips of milliseconds.
A solver whose steps follow the error takes each such phase in a few: implicit ones where the
equations are stiff. The equations are those of the engine: the kernel's `gear` and `drive`.
Not in them are sampling and the kinematic error of a gear; a reading in counts changes from one to
the next within `EDGE` of a count, and the solver follows it there.
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
"""Part of a count in which a reading changes: with it a swing of 98 s between two counts has the
period of an integration with steps, with 1e-3 one of 119 s."""

RELATIVE, ABSOLUTE = 1e-7, (1e-10, 1e-10, 1e-9, 1e-9, 1e-8, 1e-11, 1e-11, 1e-11)
"""Error of a step, of the states that `_rates` names: periods come to four digits."""

STEPS = 300_000
"""Of the solver, 20 s: 100 periods of what needs as many as any of 100 machines drawn afresh."""

SAMPLES = 12_000
"""At which a motion is judged."""


def slow_motion(
    axis: Axis, start: float, play: bool, longest: float, first: float, later: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Times (n,) and positions of link and motor (2, n), ever longer, from a start aside.

    Args:
        axis: under a servo.
        start: how far link and motor begin aside [rad or m].
        play: whether the gear has its play.
        longest: until when; not so far if the solver needs more than `STEPS` [s].
        first, later: time of the first answer [s], and by how much later each next one is.
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
    """Friction at a speed and a bend of its bristles, and the rate of that bend."""
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
    """Rates of link and motor, their speeds, the integral, their bristles and the gear's torque of
    hysteresis; `half` the play of the gear [rad or m].
    """
    gear, servo = axis.gear, axis.drive
    assert isinstance(servo, Servo)
    curve, loss, (grip, bend) = gear.curve(), gear.losses, gear.bristles
    slopes, ends = curve.slopes.tolist(), [*curve.twists.tolist(), math.inf]
    on_link, on_motor = _friction(axis.friction), _friction(servo.with_friction(JointFriction()))
    voltage, limit = servo.voltage, math.inf if servo.effort is None else servo.effort

    def rates(time: float, state: np.ndarray) -> tuple[float, ...]:
        link, motor, v, w, integral, link_bend, motor_bend, hysteresis = state.tolist()
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
