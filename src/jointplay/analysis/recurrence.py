"""Recurrence plots: when a motion comes back to where it has been.

J.-P. Eckmann, S. Oliffson Kamphorst, D. Ruelle, Recurrence plots of dynamical systems, Europhys.
Lett. 4 (1987) 973-977; measures: N. Marwan et al., Phys. Rep. 438 (2007) 237-329, eqs 44, 47.
"""

from __future__ import annotations

import numpy as np

from jointplay.errors import JointplayError

MOST = 4000
"""Most points of a plot: its matrix has their square."""


def recurrence(points: np.ndarray, threshold: float = 0.1) -> np.ndarray:
    """Which pairs of points are near each other, shape (n, n), boolean.

    Args:
        points: at even intervals, shape (n,) or (n, d); each column is divided by its standard
            deviation first, unless it does not vary.
        threshold: largest distance of near points, relative to the largest of all distances.

    Raises:
        JointplayError: more than `MOST` points, fewer than 2, or no positive threshold.
    """
    points = np.asarray(points, float)
    points = points.reshape(len(points), -1)
    if not 2 <= len(points) <= MOST:
        raise JointplayError(f"a recurrence plot takes 2 to {MOST} points, got {len(points)}")
    if not threshold > 0.0:
        raise JointplayError(f"the threshold must be positive, got {threshold:g}")
    spread = points.std(axis=0)
    scaled = points / np.where(spread > 0.0, spread, 1.0)
    apart = np.sqrt(sum((column[:, None] - column) ** 2 for column in scaled.T))
    near: np.ndarray = apart <= threshold * apart.max()
    return near


def rate(near: np.ndarray) -> float:
    """Share of the pairs of different points that are near."""
    n = len(near)
    return float((near.sum() - np.trace(near)) / (n * (n - 1)))


def determinism(near: np.ndarray, shortest: int = 2) -> float:
    """Share of the near points that lie on diagonals of at least `shortest` points.

    1 for periodic motion, low for noise; chaos lies between. The main diagonal does not count.
    """
    counted = aligned = 0
    for offset in range(1, len(near)):
        line = np.concatenate([[0], np.diagonal(near, offset).astype(int), [0]])
        ends = np.flatnonzero(np.diff(line))
        lengths = ends[1::2] - ends[::2]
        counted += int(lengths.sum())
        aligned += int(lengths[lengths >= shortest].sum())
    return aligned / counted if counted else 0.0
