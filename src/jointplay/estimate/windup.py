"""Wind-up of a joint: how its link lags behind the motor, through play and compliance.

Dry friction on the joint holds the link until the teeth push harder, so that the lag depends on the
way there: the play operator of M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis
(1989), with the load's torque. It is followed along the whole path of the motor; a joint without
gear is one without play. The bristles of gears with hysteresis remember the twists they came by
(`kernel.gear`), so there the torque is followed, too.

Where a link lies is known once friction has let it slide; how it calms down at a stop is not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.model.gear import Curve

_FORGOTTEN = 0.05
"""Part of what bristles were bent by in the beginning that may be left where they count as known:
after three of their angles, exp(-3) (judged: with 0.02 fewer visits count in 6 of 53 machines with
parts of benchmarks/truth/identify.py; one value fewer is told)."""
_HALVINGS = int(np.finfo(float).nmant)
"""Bisections that find the twist of a gear with bristles: the bits of a number."""


class TwistLaw(NamedTuple):
    """Torque of a gear, or of a joint that winds up, by its twist."""

    half: float
    """Half of the play [rad]."""
    curve: Curve
    """Elastic torque over the twist beyond it."""
    grip: float = 0.0
    """Largest torque of bristles [N m]; none: no hysteresis."""
    bend: float = 1.0
    """Angle in which they let go [rad]."""


def wound_up(
    motor: np.ndarray,
    error: np.ndarray | float,
    hold: np.ndarray,
    dry: np.ndarray,
    stiction: float,
    law: TwistLaw,
    halts: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Follow a link along a path of its motor.

    Args:
        motor: the motor's positions at m points, shape (m,) [rad].
        error: the gear's kinematic error there, shape (m,) [rad].
        hold: torque that the load asks of the gear, shape (m,) [N m].
        dry: dynamic friction on the joint, shape (m,) [N m].
        stiction: static over dynamic friction.
        law: torque by the twist.
        halts: whether the machine comes to a stop there, shape (m,).

    Returns:
        Twist, link less motor [rad]; torque of the gear on the link [N m]; whether both are known;
        (m,) each.
    """
    angles, sure = np.empty(len(motor)), np.empty(len(motor), np.bool_)
    half, curve, grip, bend = law
    if grip > 0.0:
        torque = np.empty(len(motor))
        numbers = np.array([half, grip, bend]), *curve
        frictions = np.stack([dry, stiction * dry], axis=1)
        _follow_bristles(*numbers, motor + error, hold, frictions, halts, angles, torque, sure)
        return angles - motor, torque, sure
    # Ends between which the link stays while it slides up or down, and while it sticks.
    ends = ((dry, -1.0), (-dry, 1.0), (stiction * dry, -1.0), (-stiction * dry, 1.0))
    low, high, first, last = (
        motor + error + _twist(hold + held, half, curve, side) for held, side in ends
    )
    _follow(low, high, first, last, halts, angles, sure)
    twist = angles - motor
    off = twist - error
    return twist, -np.sign(off) * curve.torque(np.maximum(np.abs(off) - half, 0.0)), sure


def _twist(torque: np.ndarray, half: float, curve: Curve, middle: float) -> np.ndarray:
    """Link less motor while the teeth carry a torque; without one, the end `middle` of the play."""
    side = np.where(torque > 0.0, -1.0, np.where(torque < 0.0, 1.0, middle))
    return np.asarray(side * half - np.sign(torque) * curve.depth(np.abs(torque)))


@compiled
def _follow(
    low: np.ndarray,
    high: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    halts: np.ndarray,
    angles: np.ndarray,
    sure: np.ndarray,
) -> None:
    """Write angles of a link that friction holds, and whether they are known, (m,) each.

    Args:
        low, high: between which it lies while it slides up or down, (m,) [rad].
        first, last: beyond which it does not stick, (m,) [rad].
        halts: where the machine comes to a stop, (m,): how it calms down decides what friction then
            holds, until a push makes the link slide.
        angles, sure: what is written.
    """
    link, known, side = 0.5 * (low[0] + high[0]), False, 0
    for i in range(len(low)):
        known &= not halts[i]
        if link <= (low[i] if side > 0 else first[i]):
            link, known, side = low[i], True, 1
        elif link >= (high[i] if side < 0 else last[i]):
            link, known, side = high[i], True, -1
        elif low[i] < link < high[i]:
            side = 0
        angles[i], sure[i] = link, known


@compiled
def _follow_bristles(
    law: np.ndarray,
    slopes: np.ndarray,
    twists: np.ndarray,
    torques: np.ndarray,
    motor: np.ndarray,
    hold: np.ndarray,
    dry: np.ndarray,
    halts: np.ndarray,
    angles: np.ndarray,
    torque: np.ndarray,
    sure: np.ndarray,
) -> None:
    """Write angles as `_follow` does, and torques, of a gear whose bristles remember.

    Args:
        law: half of the play, largest torque of bristles, and the angle in which they let go.
        slopes, twists, torques: of a `Curve`.
        motor, hold: angle, with the gear's error [rad], and torque that the load asks of the gear
            [N m], (m,).
        dry: dynamic and static friction, (m, 2) [N m].
        halts: as of `_follow`.
        angles, torque, sure: what is written: of the link [rad], of the gear [N m], and whether
            they are known, (m,).
    """
    last = bent = 0.0
    memory, known, way = 1.0, False, 0
    link = motor[0]
    for i in range(len(motor)):
        known &= not halts[i]
        # If the link stays: does the torque exceed what load and friction hold?
        twist = motor[i] - link
        held, _ = _bristled(law, slopes, twists, torques, last, bent, twist)
        slides = 0
        if held >= hold[i] + (dry[i, 0] if way > 0 else dry[i, 1]):
            slides = 1
        elif held <= hold[i] - (dry[i, 0] if way < 0 else dry[i, 1]):
            slides = -1
        if slides != 0:
            # It slides to the twist at which the torque is that of load and dynamic friction.
            goal = hold[i] + slides * dry[i, 0]
            start, _ = _bristled(law, slopes, twists, torques, last, bent, last)
            side = 1.0 if goal > start else -1.0
            near, far = 0.0, math.pi  # no gear winds up by more
            for _ in range(_HALVINGS):
                middle = 0.5 * (near + far)
                reached, _ = _bristled(
                    law, slopes, twists, torques, last, bent, last + side * middle
                )
                if side * (reached - goal) < 0.0:
                    near = middle
                else:
                    far = middle
            twist, known, way = last + side * far, True, slides
            if dry[i, 0] == 0.0:
                way = 0
        elif abs(held - hold[i]) < dry[i, 0]:
            way = 0
        torque[i], bent = _bristled(law, slopes, twists, torques, last, bent, twist)
        memory *= math.exp(-abs(twist - last) / law[2])
        last, link = twist, motor[i] - twist
        angles[i], sure[i] = link, known and memory <= _FORGOTTEN


@compiled
def _bristled(
    law: np.ndarray,
    slopes: np.ndarray,
    twists: np.ndarray,
    torques: np.ndarray,
    last: float,
    bent: float,
    twist: float,
) -> tuple[float, float]:
    """Torque of a gear at a twist, and part of it of its bristles, from where they were before.

    The equations are those of `kernel.gear`.
    """
    depth, elastic = abs(twist) - law[0], 0.0
    if depth > 0.0:
        start = begin = 0.0
        k = 0
        while k < len(twists) and depth > twists[k]:
            start, begin = twists[k], torques[k]
            k += 1
        elastic = math.copysign(begin + slopes[k] * (depth - start), twist)
    limit = math.copysign(law[1], twist - last)
    bent = limit + (bent - limit) * math.exp(-abs(twist - last) / law[2])
    return elastic + bent, bent
