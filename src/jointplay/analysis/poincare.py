"""Poincare sections: a motion looked at once a turn, and how many turns it takes to repeat."""

from __future__ import annotations

import numpy as np

from jointplay.errors import JointplayError


def once_per_turn(values: np.ndarray, per_turn: int, phase: float = 0.25) -> np.ndarray:
    """Samples of a record, one a turn.

    Args:
        values: records at even intervals from the begin of a turn on, shape (n, ...).
        per_turn: records in a turn.
        phase: where in the turn, in [0, 1); to the nearest record.

    Raises:
        JointplayError: no such phase.
    """
    if not 0.0 <= phase < 1.0:
        raise JointplayError(f"phase must be in [0, 1) turns, got {phase:g}")
    return values[round(phase * per_turn) % per_turn :: per_turn]


def repeats_after(points: np.ndarray, tolerance: float, most: int | None = None) -> int | None:
    """The smallest number of turns after which all points of a section come again.

    1 for a motion of the drive's period, 2 after a period doubling, and so on.

    Args:
        points: one a turn, in order, shape (n,) or (n, d).
        tolerance: largest distance of points that count as the same, in units of `points`.
        most: longest period sought; None: a third of the points, so that each is seen three times.

    Returns:
        The period in turns; None if it is longer than `most`, or there is none (quasi-periodic and
        chaotic motion).
    """
    points = np.asarray(points, float)
    points = points.reshape(len(points), -1)
    longest = len(points) // 3 if most is None else min(most, len(points) - 1)
    for period in range(1, longest + 1):
        if np.linalg.norm(points[period:] - points[:-period], axis=1).max() <= tolerance:
            return period
    return None


def attractors(
    sections: list[np.ndarray], tolerance: float, most: int | None = None
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Tell motions apart by their sections: equal labels for those that end on the same orbit.

    Args:
        sections: for each motion its points once a turn, settled, shape (n, d).
        tolerance: largest distance of points that count as the same.
        most: see `repeats_after`.

    Returns:
        For each motion the index of its periodic orbit, -1 if it does not repeat itself; and the
        orbits, each of shape (period, d).
    """
    orbits: list[np.ndarray] = []
    labels = []
    for points in sections:
        period = repeats_after(points, tolerance, most)
        if period is None:
            labels.append(-1)
            continue
        orbit = points[-period:]
        same = (k for k, other in enumerate(orbits) if _same(orbit, other, tolerance))
        label = next(same, len(orbits))
        if label == len(orbits):
            orbits.append(orbit)
        labels.append(label)
    return np.array(labels, int), orbits


def _same(one: np.ndarray, other: np.ndarray, tolerance: float) -> bool:
    """Whether two orbits have the same points, whichever comes first."""
    if len(one) != len(other):
        return False
    apart = np.linalg.norm(one[:, None] - other[None], axis=2)
    # Each of the two may be off by the tolerance.
    return bool(max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= 2.0 * tolerance)
