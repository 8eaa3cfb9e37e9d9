"""Statistics of samples: estimates with confidence intervals, and how many runs are enough."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, require_share, require_whole
from jointplay.base.imports import extra
from jointplay.base.schema import Quantity, choice, one_of, quantity, read
from jointplay.base.tables import Column, Table

STATISTICS = ("mean", "quantile", "std")
CONFIDENCE = 0.95
"""Default level of confidence intervals."""
RESAMPLES = 400
"""Number of bootstrap samples for the confidence interval of a standard deviation."""


def standard_error(values: Any) -> float:
    """Standard error of the mean of independent values; NaN for fewer than two."""
    if len(values) < 2:
        return math.nan
    return float(np.std(values, ddof=1) / math.sqrt(len(values)))


@dataclass(frozen=True)
class IntervalEstimate:
    """An estimate from independent runs, with its confidence interval."""

    value: float
    low: float
    high: float
    runs: int

    @property
    def relative(self) -> float:
        """Half the width of the interval over the value; inf if the interval is not finite."""
        if not np.isfinite([self.low, self.high]).all() or self.value == 0.0:
            return float("inf") if self.high != self.low or self.value != 0.0 else 0.0
        return 0.5 * (self.high - self.low) / abs(self.value)

    @property
    def plus_minus(self) -> str | None:
        """The value ± half the interval's width, with two digits of that and at most four digits in
        all; None without a value.
        """
        half, value = 0.5 * (self.high - self.low), self.value
        if not math.isfinite(value):
            return None
        if not math.isfinite(half):
            return f"{value:.4g}"
        if half == 0.0 or value == 0.0:
            return f"{value:.4g}\u00a0±\u00a0{half:.2g}"
        last = max(math.floor(math.log10(half)) - 1, math.floor(math.log10(abs(value))) - 3)
        places, half = max(-last, 0), max(half, 10.0**last)
        return f"{round(value, -last):.{places}f}\u00a0±\u00a0{round(half, -last):.{places}f}"

    def text(self, scale: float, unit: str) -> str:
        """The value with its interval, in a `unit` that is `scale` times smaller."""
        return f"{scale * self.value:.4g} {unit} [{scale * self.low:.4g}, {scale * self.high:.4g}]"


@dataclass(frozen=True)
class Until:
    """The precision that ends a sweep."""

    measure: str
    precision: Quantity = quantity("")
    """Half the width of the confidence interval, relative to the value."""
    statistic: str = choice("statistic", STATISTICS, default="mean")
    probability: Quantity = quantity("", default=0.5)
    confidence: Quantity = quantity("", default=CONFIDENCE)
    most: int = 65536
    """Number of samples after which it ends in any case."""

    def __post_init__(self) -> None:
        for word in ("precision", "probability", "confidence"):
            require_share(word, getattr(self, word))
        require_whole("most", self.most, 2)

    def estimate(self, values: np.ndarray) -> IntervalEstimate:
        return interval_estimate(values, self.statistic, self.probability, self.confidence)

    def reached(self, values: np.ndarray) -> bool:
        return self.estimate(values).relative <= self.precision


def read_until(table: Any) -> Until:
    """Read the table `until` of a sweep."""
    try:
        until: Until = read(Until, table)
    except JointplayError as error:
        raise JointplayError(": ".join([*map(str, error.where), str(error)])) from None
    return until


def interval_estimate(
    values: np.ndarray,
    statistic: str = "mean",
    probability: float = 0.5,
    confidence: float = CONFIDENCE,
) -> IntervalEstimate:
    """Estimate a statistic of independent values, with its confidence interval.

    The mean's interval is Student's. The quantile's is between order statistics, free of the
    distribution (David, Nagaraja, Order Statistics, 2003, 7.1); it is infinite where there are too
    few values. The standard deviation's is by bootstrap, with fixed random numbers. For Sobol
    samples, which fill space more evenly than independent ones, intervals are wider than need be.

    Args:
        values: values of any shape; those that are not finite are left out.
        statistic: one of `STATISTICS`.
        probability: probability of the quantile.
        confidence: level of the interval.

    Raises:
        JointplayError: no such statistic, or a probability outside 0 to 1.
    """
    if statistic not in STATISTICS:
        raise JointplayError(one_of("statistic", statistic, STATISTICS))
    probability = require_share("probability", probability)
    confidence = require_share("confidence", confidence)
    x = np.sort(np.asarray(values, float).ravel())
    x = x[np.isfinite(x)]
    n = len(x)
    if n == 0:
        return IntervalEstimate(float("nan"), -np.inf, np.inf, 0)
    if statistic == "quantile":
        from scipy import stats

        # Ranks of the order statistics that enclose it; -1 or n where there are none.
        tail = (1.0 - confidence) / 2.0
        low = int(stats.binom.ppf(tail, n, probability)) - 1
        high = int(stats.binom.ppf(1.0 - tail, n, probability))
        below = float(x[low]) if low >= 0 else -np.inf
        above = float(x[high]) if high < n else np.inf
        return IntervalEstimate(float(np.quantile(x, probability)), below, above, n)
    if n < 2:
        return IntervalEstimate(float(x[0]) if statistic == "mean" else 0.0, -np.inf, np.inf, n)
    if statistic == "mean":
        from scipy import stats

        half = stats.t.ppf(0.5 + confidence / 2.0, n - 1) * x.std(ddof=1) / np.sqrt(n)
        return IntervalEstimate(float(x.mean()), float(x.mean() - half), float(x.mean() + half), n)
    rng = np.random.default_rng(0)
    deviations = [x[rng.integers(n, size=n)].std(ddof=1) for _ in range(RESAMPLES)]
    tail = (1.0 - confidence) / 2.0
    ends = np.quantile(deviations, [tail, 1.0 - tail])
    return IntervalEstimate(float(x.std(ddof=1)), float(ends[0]), float(ends[1]), n)


def convergence(
    values: np.ndarray, statistic: str = "mean", probability: float = 0.5, points: int = 40
) -> list[IntervalEstimate]:
    """Estimates from the first 2, ... up to all runs, at numbers in a geometric sequence."""
    x = np.asarray(values, float).ravel()
    if len(x) < 2:
        return [interval_estimate(x, statistic, probability)]
    counts = np.unique(np.geomspace(2, len(x), points).round().astype(int))
    return [interval_estimate(x[:count], statistic, probability) for count in counts]


def enough(history: list[IntervalEstimate], precision: float) -> int | None:
    """Number of runs from which on the relative precision was kept; None if it was not."""
    runs = None
    for estimate in history:
        if estimate.relative > precision:
            runs = None
        elif runs is None:
            runs = estimate.runs
    return runs


@dataclass(frozen=True)
class SobolIndices:
    """Shares of a measure's variance that d quantities cause, with 95 % confidence intervals."""

    names: tuple[str, ...]
    first: np.ndarray
    """First-order indices, of each quantity alone, shape (d,)."""
    first_confidence: np.ndarray
    """Half-widths of their intervals, shape (d,)."""
    total: np.ndarray
    """Total indices, of each quantity with its interactions, shape (d,)."""
    total_confidence: np.ndarray
    """Half-widths of their intervals, shape (d,)."""

    @property
    def table(self) -> Table:
        return Table(
            (
                Column("input", self.names),
                Column("first-order", self.first, digits=3, errors=self.first_confidence),
                Column("total", self.total, digits=3, errors=self.total_confidence),
            )
        )


def salib() -> Any:
    """SALib's module for Sobol indices."""
    with extra("sensitivity", "SALib"):
        return import_module("SALib.analyze.sobol")


def sobol_indices(values: np.ndarray, names: tuple[str, ...]) -> SobolIndices:
    """Sobol indices of values at the points of a saltelli design, with 95 % confidence.

    First-order and total indices are those of Saltelli et al. (2010), Comput. Phys. Commun. 181,
    259-270, as SALib computes them.

    Args:
        values: values at the design's points in order, shape (n (d + 2),).
        names: names of the d sampled quantities.

    Raises:
        JointplayError: SALib is not installed, or a value is missing.
    """
    sobol = salib()
    y = np.asarray(values, float).ravel()
    missing = int(np.count_nonzero(~np.isfinite(y)))
    if missing or len(y) % (len(names) + 2):
        raise JointplayError(
            f"{missing} of {len(y)} cases have no value: Sobol indices need every case of the "
            "design"
        )
    zero = np.zeros(len(names))
    if np.ptp(y) == 0.0:  # nothing varies, so nothing causes it
        return SobolIndices(names, zero, zero, zero, zero)
    problem = {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}
    with np.errstate(all="ignore"):
        indices = sobol.analyze(problem, y, calc_second_order=False, seed=1)  # SALib: 0 is none
    return SobolIndices(
        names, *(np.asarray(indices[key], float) for key in ("S1", "S1_conf", "ST", "ST_conf"))
    )
