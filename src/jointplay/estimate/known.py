"""When a value counts as known: the criteria by which a play is established, and their numbers.

A fit gives each unknown a value and a 95 % interval (`least_squares.Fit.half_width`). Whether this
is enough to call the value known (`Estimate.known`) is decided by one of these criteria:

- Recordings of a machine that is expected to have the play (`identify`): `narrow`, half of the
  interval is at most half of the value (`LARGEST_SHARE`). So for all unknowns of recordings, and
  the compliance that a dial gauge tells.
- Dial gauges, moves back and forth, static poses and pairs of encoders, by which a joint may turn
  out to have no play: `excludes_zero`, the whole interval lies above zero; else its upper end is
  stated as a bound. Of poses and encoders, play must also predict held-back poses better than
  chance: `improves`, by `CHANCE` and `LEAST_GAIN`.
- All other coefficients of static poses, which have priors: `outweighs_prior`.

What meets its criterion is withdrawn where something else could feign it: friction that holds a
journal (`reasons._held_by_friction`), gravity that holds teeth to one side
(`gauge.identify_gauged`, `lost_motion.identify_lost_motion`), moves that are too short
(`lost_motion`). A change between two measurements (`changes`) is stated with any finite interval.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from jointplay.estimate.unknowns import Unknown

LARGEST_SHARE = 0.5
"""Largest half width of an interval, as a part of the value, with which `identify` calls the value
known: judged, a choice of what is worth reporting. Wider intervals are not refined."""
SMALL_SHARE = 0.25
"""Part of an unknown's scale as which smaller values count in `LARGEST_SHARE`, so that a play near
zero can be known, too: judged. With 0.5, 5 more values are told of 153 machines of
benchmarks/truth/identify.py: the interval of one misses the truth, another is twice the truth."""
CHANCE = 0.1
"""Probability of chance below which a gain of predictions counts, one-sided: judged. On 59 random
robots (benchmarks/truth/calibrate.py) with 0.05 or 0.2 one play more or less is told,
none where there is none, and as many intervals hold."""
LEAST_GAIN = 0.01
"""Part by which held-back errors must shrink at least (RMS): judged. With thousands of poses any
cause is beyond chance; on 59 random robots between 0 and 0.02 only more or fewer offsets are told,
and all intervals hold alike."""


def widest(unknown: Unknown, value: float) -> float:
    """Largest half width of an interval about `value` that is `narrow` [SI]."""
    return LARGEST_SHARE * max(abs(value), SMALL_SHARE * unknown.scale)


def narrow(unknown: Unknown, value: float, half_width: float) -> bool:
    """Whether an interval is narrow enough for its value to be known."""
    return bool(half_width <= widest(unknown, value))


def excludes_zero(low: float) -> bool:
    """Whether an interval from `low` on shows that there is play at all."""
    return bool(low > 0.0)


def outweighs_prior(gained: float) -> bool:
    """Whether a measurement says more of an unknown than was assumed before.

    By the part of the prior's variance that it took away. Variances add inversely, 1 / posterior =
    1 / prior + information, so that with more than half the information exceeds the prior's.
    """
    return gained > 0.5


class Gain(NamedTuple):
    """What one model predicts better than another, of held-back rows."""

    counts: bool
    """Whether errors shrink by more than chance."""
    mean: float
    """Mean reduction of the squared weighted error."""
    margin: float
    """What the mean had to exceed."""


def improves(before: np.ndarray, after: np.ndarray, units: np.ndarray) -> Gain:
    """Whether losses of held-back rows shrink by more than chance.

    The mean of the differences over independent units (rows, points, groups) must exceed the
    one-sided quantile of Student's t (`CHANCE`) times its standard error, and the root of the mean
    loss must shrink by `LEAST_GAIN`.

    Args:
        before, after: squared weighted errors of the rows, shape (n,).
        units: number of the unit of each row, shape (n,).
    """
    names = np.unique(units)
    gains = np.array([np.mean(before[units == u] - after[units == u]) for u in names])
    m = len(gains)
    margin = np.inf if m < 2 else student.ppf(1.0 - CHANCE, m - 1) * gains.std(ddof=1) / np.sqrt(m)
    smaller = np.sqrt(after.mean()) < (1.0 - LEAST_GAIN) * np.sqrt(before.mean())
    return Gain(bool(gains.mean() > margin and smaller), float(gains.mean()), float(margin))
