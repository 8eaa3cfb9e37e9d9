"""The URDF's limits of joints: position, speed and effort.

A motion beyond a position limit is refused. Speeds and efforts beyond theirs are reported, with
joint, time and value: those of the reference before the run, those of the run in its audit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.model.urdf import JointEntry
    from jointplay.simulation.motion.reference import Motion

LIMITS = ("report", "cut", "ignore")
"""Treatments of the limits: ``cut`` also cuts efforts to them, ``ignore`` checks nothing."""
INTERVAL_S = 1e-3
"""Interval at which a reference is compared with the limits [s]."""
MARGIN = 1e-6
"""Excess over a limit that counts as rounding [rad or m; speeds and efforts: relative]."""
_SIZES = {"speed": ("a speed", ("rad/s", "m/s")), "effort": ("an effort", ("N m", "N"))}
"""Nouns for messages, and units for revolute and prismatic joints, by the limit's name."""


def bounds(mechanism: Mechanism) -> dict[str, float]:
    """Largest effort of each joint that has one in the URDF [N m or N]."""
    entries = mechanism.description.joints
    efforts = {name: entries[name].effort for name in mechanism.joints if name in entries}
    return {name: effort for name, effort in efforts.items() if effort is not None}


def check_motion(mechanism: Mechanism, motion: Motion, joints: Sequence[str]) -> list[str]:
    """Compare a reference with the limits; returns speeds beyond them, a line each.

    Raises:
        JointplayError: a position beyond its limit.
    """
    times = np.linspace(0.0, motion.duration, max(round(motion.duration / INTERVAL_S), 1) + 1)
    position, velocity, _ = motion(times)
    lines = []
    for name in joints:
        entry, k = mechanism.description.joints[name], motion.joints.index(name)
        place = _position_beyond(entry, times, position[:, k])
        if place is not None:
            raise JointplayError(
                f"the motion takes joint {name!r} to {place}; change it, or set limits = ignore"
            )
        text = _size_beyond(entry, "speed", times, velocity[:, k])
        lines += [f"the motion asks joint {name!r} for {text}"] if text else []
    return lines


def beyond(
    mechanism: Mechanism, times: np.ndarray, q: np.ndarray, v: np.ndarray, effort: np.ndarray
) -> tuple[str, ...]:
    """Where a run went beyond the limits: a line for each joint and quantity that did.

    Args:
        mechanism: the mechanism with its limits.
        times: times of the records (n,) [s].
        q, v: coordinates and velocities (n, nv).
        effort: efforts of drives and controllers on the coordinates (n, nv).
    """
    lines = []
    for name, entry, position, sizes in _histories(mechanism, q, v, effort):
        place = _position_beyond(entry, times, position) if len(times) else None
        lines += [f"joint {name!r} was at {place}"] if place else []
        for quantity, values in sizes.items():
            text = _size_beyond(entry, quantity, times, values) if len(times) else None
            lines += [f"joint {name!r} had {text}"] if text else []
    return tuple(lines)


def worst(mechanism: Mechanism, q: np.ndarray, v: np.ndarray, effort: np.ndarray) -> np.ndarray:
    """Indices of a few records, ascending, for which `beyond` returns the same as for all."""
    rows = {0}
    for _, entry, position, sizes in _histories(mechanism, q, v, effort):
        rows |= {int(np.argmax(position)), int(np.argmin(position))}
        for quantity, values in sizes.items():
            limit = getattr(entry, quantity)
            if limit is not None:
                size = np.abs(values)
                over = size > limit * (1.0 + MARGIN)
                rows |= {int(np.argmax(size)), int(np.argmax(over))}
    return np.array(sorted(rows))


def _histories(
    mechanism: Mechanism, q: np.ndarray, v: np.ndarray, effort: np.ndarray
) -> Iterator[tuple[str, JointEntry, np.ndarray, dict[str, np.ndarray]]]:
    """Name, entry and position of each joint, and its speed and effort by the limit's name."""
    for name in mechanism.joints:
        entry = mechanism.description.joints.get(name)
        if entry is not None:
            at, motor = mechanism.coordinate(name), mechanism.motor(name)
            yield name, entry, q[:, at], {"speed": v[:, at], "effort": effort[:, motor]}


def _position_beyond(entry: JointEntry, times: np.ndarray, values: np.ndarray) -> str | None:
    """The position furthest beyond its limits, in words; None if none is."""
    if entry.lower is None or entry.upper is None:
        return None
    over = np.maximum(entry.lower - values, values - entry.upper)
    at = int(np.argmax(over))
    if not over[at] > MARGIN:
        return None
    unit = "m" if entry.slides else "rad"
    return (
        f"{values[at]:.6g} {unit} at t = {times[at]:.4g} s, beyond its limits "
        f"{entry.lower:g} to {entry.upper:g} {unit}"
    )


def _size_beyond(entry: JointEntry, kind: str, times: np.ndarray, values: np.ndarray) -> str | None:
    """The largest value beyond its limit, when, and when that began, in words; None if none is."""
    limit = getattr(entry, kind)
    if limit is None:
        return None
    sizes = np.abs(values)
    at = int(np.argmax(sizes))
    if not sizes[at] > limit * (1.0 + MARGIN):
        return None
    first = times[int(np.argmax(sizes > limit * (1.0 + MARGIN)))]
    noun, units = _SIZES[kind]
    unit = units[entry.slides]
    return (
        f"{noun} of {values[at]:.4g} {unit} at t = {times[at]:.4g} s, beyond its limit of "
        f"{limit:g} {unit} (first at {first:.4g} s)"
    )
