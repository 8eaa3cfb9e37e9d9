"""Values of which simulations have the same statistics as a measurement.

Runs of a machine with impacts part after a few of them, so that their traces cannot be compared;
their statistics can. S. N. Wood, Statistical inference for noisy nonlinear ecological dynamic
systems, Nature 466 (2010) 1102-1104: statistics s of runs with the values theta are taken as normal
about a mean mu(theta), here a quadratic, with one covariance; theta is where the measured ones are
most likely. How well that works is tried on the runs themselves, each in turn left out and played
the measurement: the errors make the interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc
from scipy.stats import t as student

CONFIDENCE = 0.95
_GRID = 2048
"""Values that are tried, over the range."""
_SHRINK = 0.1
"""Part of the covariance that is taken as diagonal, at least; more with few runs."""
_STRANGE = 2.0
"""Times the runs' own largest distance from which on a measurement is like none of them."""
_LEAST_SPREAD = 0.02
"""Scatter below which statistics (logarithms) are not taken to be known."""


@dataclass(frozen=True)
class Estimate:
    """p values by statistics of runs."""

    value: np.ndarray
    """Shape (p,)."""
    half_width: np.ndarray
    """Of the 95 % intervals, shape (p,)."""
    distance: float
    """Of the measured statistics from their means, relative to the largest of the runs' own."""
    oddest: int
    """The statistic that is farthest off."""

    @property
    def strange(self) -> bool:
        """Whether no value explains what was measured."""
        return self.distance > _STRANGE


def estimate(
    values: np.ndarray, statistics: np.ndarray, seen: np.ndarray, low: np.ndarray, high: np.ndarray
) -> Estimate:
    """The values whose runs have the statistics that were seen.

    Args:
        values: of n runs, shape (n, p).
        statistics: of the runs, finite, shape (n, d).
        seen: the measured ones, shape (d,).
        low: least values that can be, shape (p,).
        high: largest values, shape (p,).
    """
    grid = _grid(low, high)
    best, distance, odd = _likeliest(values, statistics, seen, grid)
    errors, distances = np.zeros(values.shape), np.zeros(len(values))
    for i in range(len(values)):
        others = np.arange(len(values)) != i
        found, distances[i], _ = _likeliest(values[others], statistics[others], statistics[i], grid)
        errors[i] = found - values[i]
    away = np.linalg.norm((values - best) / np.maximum(high - low, 1e-12), axis=1)
    near = np.argsort(away)[: max(len(values) // 2, 1)]
    spread = np.sqrt(np.maximum(np.mean(errors**2, axis=0), np.mean(errors[near] ** 2, axis=0)))
    freedom = max(len(values) - _terms(values.shape[1]), 1)
    half = spread * float(student.ppf(0.5 + CONFIDENCE / 2.0, freedom))
    limit = max(float(distances.max()), 1.0)
    return Estimate(best, half, distance / limit, odd)


def design(count: int, low: np.ndarray, high: np.ndarray, seed: int) -> np.ndarray:
    """Values for so many runs, spread evenly, shape (count, p)."""
    spread = qmc.LatinHypercube(len(low), rng=seed).random(count)
    return np.asarray(low + spread * (high - low))


def runs_needed(p: int) -> int:
    """Fewest runs of which p values can be told at all."""
    return 2 * _terms(p) + 4


def _terms(p: int) -> int:
    return 1 + p + p * (p + 1) // 2


def _grid(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    if len(low) == 1:
        return np.linspace(low[0], high[0], 401)[:, None]
    return np.asarray(low + qmc.Sobol(len(low), rng=0).random(_GRID) * (high - low))


def _basis(values: np.ndarray, centre: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Terms of the quadratic, shape (n, terms)."""
    x = (values - centre) / width
    columns = [np.ones(len(x)), *x.T]
    columns += [x[:, i] * x[:, k] for i in range(x.shape[1]) for k in range(i + 1)]
    return np.column_stack(columns)


def _likeliest(
    values: np.ndarray, statistics: np.ndarray, seen: np.ndarray, grid: np.ndarray
) -> tuple[np.ndarray, float, int]:
    """The best of the grid, its distance (mean square by statistic), the statistic farthest off."""
    centre, width = values.mean(axis=0), np.maximum(np.ptp(values, axis=0), 1e-12)
    terms = _basis(values, centre, width)
    slopes, *_ = np.linalg.lstsq(terms, statistics, rcond=None)
    left = statistics - terms @ slopes
    freedom = max(len(values) - terms.shape[1], 1)
    spread = np.maximum(np.sqrt(np.square(left).sum(axis=0) / freedom), _LEAST_SPREAD)
    correlation = (left / spread).T @ (left / spread) / freedom
    shrink = max(_SHRINK, statistics.shape[1] / (statistics.shape[1] + freedom))
    correlation = (1.0 - shrink) * correlation + shrink * np.eye(len(spread))
    off = (seen - _basis(grid, centre, width) @ slopes) / spread
    cost = np.einsum("gi,ij,gj->g", off, np.linalg.inv(correlation), off)
    best = int(cost.argmin())
    return grid[best], float(cost[best]) / len(seen), int(np.abs(off[best]).argmax())
