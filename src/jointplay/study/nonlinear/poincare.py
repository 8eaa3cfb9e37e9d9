"""Poincaré sections: a motion sampled once a turn, its period in turns, and its recurrence."""

from __future__ import annotations

import numpy as np

from jointplay.base.errors import (
    JointplayError,
    require_finite,
    require_non_negative,
    require_positive,
    require_whole,
)


def once_per_turn(values: np.ndarray, per_turn: int, phase: float = 0.25) -> np.ndarray:
    """Samples of a history, one a turn.

    Args:
        values: records at even intervals from the beginning of a turn on, shape (n, ...).
        per_turn: records in a turn.
        phase: phase of the samples in the turn, in [0, 1); rounded to the nearest record.

    Raises:
        JointplayError: a phase out of range.
    """
    per_turn = require_whole("per_turn", per_turn, 1)
    if not 0.0 <= require_finite("phase", phase, "") < 1.0:
        raise JointplayError(f"phase must be in [0, 1) turns, got {phase:g}")
    return values[round(phase * per_turn) % per_turn :: per_turn]


def repeats_after(points: np.ndarray, tolerance: float, most: int | None = None) -> int | None:
    """Period of a section: the smallest number of turns after which all its points repeat.

    It is 1 for a motion with the drive's period, 2 after a period doubling, and so on.

    Args:
        points: one point for each turn, in order, shape (n,) or (n, d).
        tolerance: largest distance of points that count as the same, in units of `points`.
        most: longest period sought; None: a third of the points, so that each is seen three times.

    Returns:
        The period in turns; None if it is longer than `most`, or there is none (quasi-periodic and
        chaotic motion).
    """
    tolerance = require_non_negative("tolerance", tolerance, "")
    most = None if most is None else require_whole("most", most, 1)
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
    """Assign motions to periodic orbits by their sections.

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
        matches = (k for k, earlier in enumerate(orbits) if _coincide(orbit, earlier, tolerance))
        label = next(matches, len(orbits))
        if label == len(orbits):
            orbits.append(orbit)
        labels.append(label)
    return np.array(labels, int), orbits


def _coincide(first: np.ndarray, second: np.ndarray, tolerance: float) -> bool:
    """Whether two orbits have the same points, in whatever order (Hausdorff distance)."""
    if len(first) != len(second):
        return False
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    # Each of the two may be off by the tolerance.
    return bool(max(distances.min(axis=0).max(), distances.min(axis=1).max()) <= 2.0 * tolerance)


# Recurrence plots: the times at which a motion comes back to where it has been.
#
# J.-P. Eckmann, S. Oliffson Kamphorst, D. Ruelle, Recurrence plots of dynamical systems,
# Europhys. Lett. 4 (1987) 973-977; measures: N. Marwan et al., Phys. Rep. 438 (2007) 237-329, eqs
# 44, 47.


MOST = 4000
"""Most points of a plot, whose matrix has the square of that."""


def recurrence(points: np.ndarray, threshold: float = 0.1) -> np.ndarray:
    """Recurrence matrix: whether each pair of points is near each other, (n, n), boolean.

    Args:
        points: points of the motion at even intervals, shape (n,) or (n, d); each column is first
            divided by its standard deviation, unless that is 0.
        threshold: largest distance of near points, relative to the largest of all distances.

    Raises:
        JointplayError: more than `MOST` points, fewer than 2, or no positive threshold.
    """
    points = np.asarray(points, float)
    points = points.reshape(len(points), -1)
    if not 2 <= len(points) <= MOST:
        raise JointplayError(f"a recurrence plot takes 2 to {MOST} points, got {len(points)}")
    threshold = require_positive("the threshold", threshold, "")
    spread = points.std(axis=0)
    scaled = points / np.where(spread > 0.0, spread, 1.0)
    distances = np.sqrt(sum((column[:, None] - column) ** 2 for column in scaled.T))
    near: np.ndarray = distances <= threshold * distances.max()
    return near


def rate(near: np.ndarray) -> float:
    """Recurrence rate: the share of the pairs of different points that are near."""
    n = len(near)
    return float((near.sum() - np.trace(near)) / (n * (n - 1)))


def determinism(near: np.ndarray, shortest: int = 2) -> float:
    """Determinism: the share of the near points that lie on diagonals of at least `shortest`.

    It is 1 for periodic motion and low for noise; chaos lies between. The main diagonal does not
    count.
    """
    shortest = require_whole("shortest", shortest, 1)
    near_points = aligned = 0
    for offset in range(1, len(near)):
        line = np.concatenate([[0], np.diagonal(near, offset).astype(int), [0]])
        bounds = np.flatnonzero(np.diff(line))
        lengths = bounds[1::2] - bounds[::2]
        near_points += int(lengths.sum())
        aligned += int(lengths[lengths >= shortest].sum())
    return aligned / near_points if near_points else 0.0
