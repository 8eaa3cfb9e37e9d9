"""A motion that names some joints of a robot, made one of all: the others are held, or follow.

Joints that mimic others in the URDF follow them; the rest stand where they start. Where loops
close, what a motion does not name follows from the loops and is left alone.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.urdf import Mimic
from jointplay.motion.cartesian import joint_limits
from jointplay.motion.reference import Motion

_SINGLE = ("revolute", "continuous", "prismatic")
"""Kinds of joint whose one coordinate can be held."""


@dataclass(frozen=True)
class CompleteMotion:
    """A motion, and what was added to it."""

    motion: Motion
    held: Mapping[str, float]
    """Position of each joint that stands where it starts [rad or m]."""
    following: Mapping[str, Mimic]
    """What each joint follows that mimics another."""

    def notes(self) -> list[str]:
        """What was added in words, a line for each kind."""
        lines = []
        if self.held:
            places: dict[float, list[str]] = {}
            for name, position in self.held.items():
                places.setdefault(position, []).append(name)
            words = [f"{', '.join(names)} at {at:g}" for at, names in places.items()]
            lines.append(
                f"held because the motion does not name them: {'; '.join(words)} [rad or m]; set "
                'their position in [start], or release one with [drives] NAME = "free"'
            )
        if self.following:
            words = [f"{name} = {mimic.formula()}" for name, mimic in self.following.items()]
            lines.append(f"joints that mimic others follow: {', '.join(words)}")
        return lines


def complete_motion(
    mechanism: Mechanism,
    motion: Motion,
    start: Mapping[str, float] | None = None,
    alone: Collection[str] = (),
) -> CompleteMotion:
    """Add to `motion` the moving joints of an open tree that it does not name.

    Args:
        mechanism: with loops, nothing is added.
        motion: of some of its joints.
        start: where joints stand [rad or m]; the others at 0, or the limit next to it.
        alone: joints that are left as they are.
    """
    start = start or {}
    entries = mechanism.description.joints
    missing = [
        name
        for name in mechanism.joints
        if name not in motion.joints and name not in alone and entries[name].kind in _SINGLE
    ]
    if mechanism.loops or not missing:
        return CompleteMotion(motion, {}, {})
    low, high = joint_limits(mechanism, missing)
    nearest = dict(zip(missing, np.clip(0.0, low, high).tolist(), strict=True))
    held: dict[str, float] = {}
    columns = dict(zip(motion.joints, motion.positions.T, strict=True))
    following: dict[str, Mimic] = {}
    for name in missing:
        if not entries[name].mimics or name in start:
            held[name] = start.get(name, nearest[name])
            columns[name] = np.full(len(motion.times), held[name])
    for name in missing:
        if name not in held:
            _follow(mechanism, name, columns, following, len(motion.times))
    if len(columns) > len(motion.joints):
        table = np.array(list(columns.values())).T
        motion = Motion(list(columns), motion.times, table, motion.interpolation)
    return CompleteMotion(motion, held, following)


def _follow(
    mechanism: Mechanism,
    name: str,
    columns: dict[str, np.ndarray],
    following: dict[str, Mimic],
    count: int,
) -> None:
    """Add the positions of a joint that mimics another, after those of its leader.

    One whose leader moves freely, or under a torque, moves freely too.
    """
    mimic = mechanism.description.joints[name].mimic
    assert mimic is not None
    leader = mechanism.description.joints[mimic.leader]
    if mimic.leader not in mechanism.joints:  # it is fixed
        ahead = np.zeros(count)
    else:
        if mimic.leader not in columns and leader.mimics and leader.kind in _SINGLE:
            _follow(mechanism, mimic.leader, columns, following, count)
        if mimic.leader not in columns:
            return
        ahead = columns[mimic.leader]
    columns[name] = mimic.multiplier * ahead + mimic.offset
    following[name] = mimic
