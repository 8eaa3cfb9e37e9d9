"""Which causes of errors predict best what a fit has not seen, by more than chance."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol, TypeVar

import numpy as np

CHANCE = 0.1
"""Probability of chance below which a gain counts, one-sided."""
LEAST_GAIN = 0.01
"""Part by which held-back errors must shrink at least (RMS)."""
RARER_SIGN = 0.05
"""Part of the poses in which a joint must be loaded the other way, or its play cannot be told."""

Gain = tuple[bool, float, float]
"""Whether errors shrink by more than chance; the mean reduction; what it had to exceed."""


class Model(Protocol):
    """A set of causes, fitted."""

    @property
    def loss(self) -> np.ndarray:
        """Squared weighted errors of held-back rows, shape (n,)."""


def improves(before: np.ndarray, after: np.ndarray, units: np.ndarray) -> Gain:
    """Whether losses of held-back rows shrink by more than chance.

    The mean of the differences over independent units (rows, points, groups) must exceed the
    one-sided 90 % quantile of Student's t times its standard error, and the root of the mean loss
    must shrink by one per cent.

    Args:
        before, after: squared weighted errors of the rows, shape (n,).
        units: number of the unit of each row, shape (n,).
    """
    from scipy.stats import t

    names = np.unique(units)
    gains = np.array([np.mean(before[units == u] - after[units == u]) for u in names])
    m = len(gains)
    margin = np.inf if m < 2 else t.ppf(1.0 - CHANCE, m - 1) * gains.std(ddof=1) / np.sqrt(m)
    smaller = np.sqrt(after.mean()) < (1.0 - LEAST_GAIN) * np.sqrt(before.mean())
    return bool(gains.mean() > margin and smaller), float(gains.mean()), float(margin)


M = TypeVar("M", bound=Model)
T = TypeVar("T")


def grown(
    now: M,
    candidates: Iterable[T],
    extended: Callable[[M, T], M | None],
    units: np.ndarray,
    tried: Callable[[M, T, Gain, bool], None],
) -> M:
    """A model with causes added, the best first, as long as one is better than chance.

    Args:
        now: where it begins.
        candidates: causes that may be added.
        extended: the model with one more, fitted; None where that cannot be.
        units: see `improves`.
        tried: told of each model that was tried, with its cause, its gain, and whether it is kept;
            the kept one last.
    """
    left = list(candidates)
    while True:
        made = [(model, one) for one in left if (model := extended(now, one)) is not None]
        found = [(*one, improves(now.loss, one[0].loss, units)) for one in made]
        better = [one for one in found if one[2][0]]
        best = min(better, key=lambda one: float(one[0].loss.mean()), default=None)
        for one in found:
            if one is not best:
                tried(*one, False)
        if best is None:
            return now
        tried(*best, True)
        now = best[0]
        left.remove(best[1])


def one_sided(side: np.ndarray) -> str:
    """Why a load on these sides, negative or positive (n,), tells nothing of play; empty if it can
    tell."""
    rarer = int(min((side > 0).sum(), (side < 0).sum()))
    if rarer >= max(RARER_SIGN * len(side), 2.0):
        return ""
    times = "never" if not rarer else f"in only {rarer} of {len(side)} poses"
    return f"its load is on the other side {times}"
