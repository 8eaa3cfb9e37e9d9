"""Accuracy and repeatability of points that cycles attain, and how well they are known."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

CONFIDENCE = 0.95
RESAMPLES = 999
"""Resamples of the bootstrap."""


@dataclass(frozen=True)
class Estimate:
    """A figure and its confidence interval by bootstrap over the cycles."""

    value: float
    low: float
    high: float

    def words(self, scale: float, unit: str) -> str:
        """The figure with its interval, in the unit that is `scale` times smaller."""
        return f"{scale * self.value:.4g} {unit} [{scale * self.low:.4g}, {scale * self.high:.4g}]"


def accuracy(points: np.ndarray) -> np.ndarray:
    """Distance of the barycentre of the cycles from the command pose, at m points.

    Args:
        points: attained less commanded, shape (..., cycles, m, 3) [m].

    Returns:
        shape (..., m) [m].
    """
    return np.asarray(np.linalg.norm(points.mean(axis=-3), axis=-1))


def repeatability(points: np.ndarray) -> np.ndarray:
    """mean(l) + 3 S_l, l being distances from the barycentre; shapes as in `accuracy`."""
    distance = np.linalg.norm(points - points.mean(axis=-3, keepdims=True), axis=-1)
    return np.asarray(distance.mean(axis=-2) + 3.0 * distance.std(axis=-2, ddof=1))


def variation(points: np.ndarray) -> np.ndarray:
    """Largest distance between the barycentres of m approaches, shape (...) [m]."""
    centre = points.mean(axis=-3)
    apart = centre[..., :, None, :] - centre[..., None, :, :]
    return np.asarray(np.linalg.norm(apart, axis=-1).max(axis=(-2, -1)))


Statistic = Callable[[np.ndarray], np.ndarray]
"""Of points (..., cycles, m, 3)."""


def largest(statistic: Statistic) -> Statistic:
    """The statistic's largest value over the points."""
    return lambda points: np.asarray(statistic(points).max(axis=-1))


def along(points: np.ndarray, axis: int) -> Estimate:
    """Mean of the first point along an axis, and its interval."""
    return estimate(points, lambda some: np.asarray(some[..., 0, axis].mean(axis=-1)))


def estimate(points: np.ndarray, statistic: Statistic) -> Estimate:
    """A statistic over the cycles, with its interval by the bias-corrected bootstrap (BCa)."""
    value = float(statistic(points))

    def resampled(index: np.ndarray, axis: int = -1) -> np.ndarray:
        return statistic(points[index.astype(int)])

    for method in ("BCa", "percentile"):  # the first fails where all cycles are alike
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            interval = stats.bootstrap(
                (np.arange(len(points)),),
                resampled,
                n_resamples=RESAMPLES,
                batch=100,
                vectorized=True,
                confidence_level=CONFIDENCE,
                method=method,
                random_state=np.random.default_rng(0),
            ).confidence_interval
        if np.isfinite(interval.low) and np.isfinite(interval.high):
            return Estimate(value, float(interval.low), float(interval.high))
    return Estimate(value, math.nan, math.nan)
