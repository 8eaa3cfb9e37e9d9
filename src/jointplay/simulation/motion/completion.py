"""Completing a motion that names some joints of a robot: the others are held, or follow.

In an open tree, joints that mimic others in the URDF follow them, and the rest stand where they
start. In closed loops the other joints follow from the loops and are left alone; only joints that
mimic others, and that no loop determines, follow these by references of their own.
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
    """A completed motion, and which joints were added to it."""

    motion: Motion
    held: Mapping[str, float]
    """Position of each joint that stands where it starts [rad or m]."""
    following: Mapping[str, Mimic]
    """Joints that mimic others and follow them."""

    def notes(self) -> list[str]:
        """What was added, for the user, a line each."""
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
    """Add to `motion` the moving joints that it does not name.

    In an open tree these are all; in a mechanism with loops those that mimic others and that no
    loop determines (`followed_mimics`).

    Args:
        mechanism, motion: whose joints are added, and to what.
        start: positions where joints stand [rad or m]; the others stand at `JointEntry.neutral`.
        alone: joints that are not added.
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
    """Add the joints that mimic others and that no loop determines, to a motion with loops.

    Where a leader's motion follows from the loops, these are closed along the motion.
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
    except JointplayError:  # the run refuses it with a better message
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
    """The motion sampled at dense times, and positions of its joints and of all leaders there.

    It ends with the motion, also where that would go on. `columns`: positions of the motion's
    joints, and of those that follow them, at its times; q: where the search for the others begins.
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
    """Add positions of joints that mimic others to `columns` where their leaders are in them.

    Returns the joints added. One whose leader moves freely, or under a torque, moves freely too.
    """
    added: dict[str, Mimic] = {}
    for _ in mimics:  # a follower of a follower comes in a later round
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
