"""A motion that names some joints of a robot, made one of all: the others are held, or follow.

Joints that mimic others in the URDF follow them; the rest stand where they start. Where loops
close, what a motion does not name follows from the loops and is left alone; only joints that mimic
others, and that no loop determines, follow these there too.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.model.closed_loops import ClosedLoops, followed_mimics
from jointplay.model.loop import assemble
from jointplay.model.mechanism import Mechanism
from jointplay.model.urdf import Mimic
from jointplay.simulation.motion.cartesian import SAMPLE_S
from jointplay.simulation.motion.reference import Motion

_SINGLE = ("revolute", "continuous", "prismatic")
"""Kinds of joint whose one coordinate can be held."""


@dataclass(frozen=True)
class CompleteMotion:
    """A motion, and what was added to it."""

    motion: Motion
    held: Mapping[str, float]
    """Position of each joint that stands where it starts [rad or m]."""
    following: Mapping[str, Mimic]

    def notes(self) -> list[str]:
        lines = []
        if self.held:
            places: dict[float, list[str]] = {}
            for name, position in self.held.items():
                places.setdefault(position, []).append(name)
            parts = [f"{', '.join(names)} at {at:g}" for at, names in places.items()]
            lines.append(
                f"held because the motion does not name them: {'; '.join(parts)} [rad or m]; set "
                'their position in [start], or release one with [drives] NAME = "free"'
            )
        if self.following:
            parts = [f"{name} = {mimic.formula()}" for name, mimic in self.following.items()]
            lines.append(
                "joints that mimic others follow their references, by drives of their own: "
                + ", ".join(parts)
            )
        return lines


def complete_motion(
    mechanism: Mechanism,
    motion: Motion,
    start: Mapping[str, float] | None = None,
    alone: Collection[str] = (),
) -> CompleteMotion:
    """Add to `motion` the moving joints that it does not name: all of an open tree, of a mechanism
    with loops those that mimic others and that no loop determines (`followed_mimics`).

    Args:
        start: where joints stand [rad or m]; the others as `JointEntry.neutral`.
        alone: joints that are left as they are.
    """
    start = start or {}
    entries = mechanism.description.joints
    missing = [
        name
        for name in mechanism.joints
        if name not in motion.joints and name not in alone and entries[name].kind in _SINGLE
    ]
    if mechanism.loops:
        return _beside_loops(mechanism, motion, start, missing)
    if not missing:
        return CompleteMotion(motion, {}, {})
    held: dict[str, float] = {}
    columns = dict(zip(motion.joints, motion.positions.T, strict=True))
    mimics: dict[str, Mimic] = {}
    for name in missing:
        mimic = entries[name].mimic
        if mimic is None or name in start:
            held[name] = start.get(name, entries[name].neutral)
            columns[name] = np.full(len(motion.times), held[name])
        else:
            mimics[name] = mimic
    following = _follow(mechanism, mimics, columns, len(motion.times))
    if len(columns) > len(motion.joints):
        table = np.array(list(columns.values())).T
        motion = Motion(list(columns), motion.times, table, motion.interpolation, motion.given)
    return CompleteMotion(motion, held, following)


def _beside_loops(
    mechanism: Mechanism, motion: Motion, start: Mapping[str, float], missing: Sequence[str]
) -> CompleteMotion:
    """Add the joints that mimic others where loops determine neither; where the leader follows from
    the loops, these are closed along the motion.
    """
    if not any(mechanism.description.joints[name].mimic for name in missing):
        return CompleteMotion(motion, {}, {})
    ideal = mechanism.ideal()
    q = np.zeros(ideal.model.nq)
    begins = dict(zip(motion.joints, motion(np.zeros(1))[0][0], strict=True))
    held = [name for name in {**start, **begins} if name in ideal.coordinates]
    at = [ideal.coordinates.index(name) for name in held]
    q[at] = [{**start, **begins}[name] for name in held]
    alone = [*start, *motion.joints, *(name for name in ideal.joints if name not in missing)]
    try:
        mimics = followed_mimics(ideal, assemble(ideal, q, at), alone)
    except JointplayError:  # the run says it with more words
        return CompleteMotion(motion, {}, {})
    columns = dict(zip(motion.joints, motion.positions.T, strict=True))
    following = _follow(ideal, mimics, columns, len(motion.times))
    if len(following) < len(mimics):
        motion, columns = _with_leaders(ideal, motion, columns, q)
        following |= _follow(ideal, mimics, columns, len(motion.times))
    names = [*motion.joints, *following]
    table = np.array([columns[name] for name in names]).T
    complete = Motion(names, motion.times, table, motion.interpolation, motion.given)
    return CompleteMotion(complete, {}, following)


def _with_leaders(
    ideal: Mechanism, motion: Motion, columns: Mapping[str, np.ndarray], q: np.ndarray
) -> tuple[Motion, dict[str, np.ndarray]]:
    """The motion at dense times, and where its joints and those that others mimic are then.

    It ends with the motion, also where that would go on. `columns`: positions of the joints of the
    motion, and of what follows them, at its times; q: where the others are searched for.
    """
    known = Motion(
        list(columns), motion.times, np.array([*columns.values()]).T, motion.interpolation
    )
    count = max(math.ceil((motion.times[-1] - motion.times[0]) / SAMPLE_S), 10) + 1
    times = np.linspace(motion.times[0], motion.times[-1], count)
    places = known(times)[0]
    at = [ideal.coordinate(name) for name in known.joints]
    begin = q.copy()
    begin[at] = places[0]
    begin = assemble(ideal, begin, at)
    rows = np.tile(begin, (count, 1))
    rows[:, at] = places
    closed = ClosedLoops(ideal, begin, known.joints).closed(rows, begin)
    leaders = {entry.mimic.leader for entry in ideal.description.joints.values() if entry.mimic}
    positions = {
        name: closed[:, ideal.coordinates.index(name)]
        for name in ideal.joints
        if name in columns or (name in leaders and name in ideal.coordinates)
    }
    waypoints = motion.waypoints[0]
    return Motion(motion.joints, times, motion(times)[0], "spline", waypoints), positions


def _follow(
    mechanism: Mechanism, mimics: Mapping[str, Mimic], columns: dict[str, np.ndarray], count: int
) -> dict[str, Mimic]:
    """Add the positions of joints that mimic others to `columns`, after those of their leaders;
    returns what was added. One whose leader moves freely, or under a torque, moves freely too.
    """
    added: dict[str, Mimic] = {}
    for _ in mimics:  # those that follow a follower come after it
        for name, mimic in mimics.items():
            if name in columns:
                continue
            ahead = columns.get(mimic.leader)
            if mimic.leader not in mechanism.joints:  # it is fixed
                ahead = np.zeros(count)
            if ahead is not None:
                columns[name] = mimic.multiplier * ahead + mimic.offset
                added[name] = mimic
    return added
