"""Restitution from flights: those of a bouncing journal grow shorter by it.

Under a constant load the flight after an impact that leaves with the speed v lasts 2 v / a, and
the next begins with e v: the intervals between impacts are a geometric series with the ratio e,
whatever mass and load are (A. D. Bernstein, American Journal of Physics 45 (1977) 41-44, for
balls), and so are the impacts' impulses. Where both do not agree the load was not constant, or
several places hit in turn, and nothing is told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import bootstrap
from scipy.stats import t as student

from jointplay.analysis.identify.impacts import Channel, Impacts, impacts

FEWEST_RATIOS = 4
"""Ratios of successive flights from which on restitution is stated."""
SHORTEST = 6.0
"""Records that a flight must last."""
_STEADY = 0.15
"""Largest change of the ratio from flight to flight within a sequence."""
_GROWN = 1.3
"""Times the impulse before that one of the same sequence has at most, for noise."""
_LEAST_FLIGHTS = 3
_SCATTER = 0.2
"""Largest standard deviation of the ratios' logarithms."""
_LEAST_SHARE = 0.5
"""Part of the impacts that must belong to sequences that die away steadily."""
_AGREE = 0.1
"""By how much the ratio of impulses may differ from that of flights, besides their scatter."""
_MODEL = 0.02
"""Part of the value by which the load of flights in a machine is not constant."""
_RESAMPLES = 999
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Told:
    """A restitution by flights, or why it cannot be told."""

    value: float
    half_width: float
    """Of the 95 % interval."""
    ratios: int
    """Of successive flights, which it is the mean of."""
    reason: str
    """Empty if it is told."""


@dataclass(frozen=True)
class Sequence:
    """Impacts that die away steadily."""

    flights: np.ndarray
    """Intervals between them, shape (n,) [s]."""
    impulses: np.ndarray
    """Of the impacts, shape (n + 1,)."""


def flights(channel: Channel) -> Told:
    """Restitution by the impacts of one joint in a channel."""
    found = impacts(channel)
    rate = 1.0 / channel.interval
    if not len(found):
        return _untold(
            0,
            f"no impact stands out of the noise ({channel.noise:.2g} a record); let the load turn "
            "round suddenly, or take a quieter sensor",
        )
    made = sequences(found, channel.interval)
    ratios = np.array([np.log(one.flights[1:] / one.flights[:-1]) for one in made], object)
    logarithms = np.concatenate([*ratios, np.zeros(0)]).astype(float)
    number = len(logarithms)
    if number < FEWEST_RATIOS:
        return _untold(number, _too_few(found, number, rate))
    inside = sum(len(one.impulses) for one in made)
    if inside < _LEAST_SHARE * len(found):
        return _untold(
            number,
            f"only {inside} of {len(found)} impacts are bounces that die away steadily: several "
            "places hit in turn, or the load changes; --restitution compares with simulations",
        )
    scatter = float(logarithms.std(ddof=1))
    if scatter > _SCATTER:
        return _untold(
            number,
            f"ratios of successive flights scatter by {100 * scatter:.0f} %: several "
            "places hit in turn, or the load changes; --restitution compares with simulations",
        )
    middle, half = _mean([np.asarray(one, float) for one in ratios])
    half = float(np.hypot(half, _timing(made, channel.interval)))
    impulse, other = _mean([np.log(one.impulses[1:] / one.impulses[:-1]) for one in made])
    value = float(np.exp(middle))
    if abs(impulse - middle) > np.hypot(half, other) + np.log1p(_AGREE):
        return _untold(
            number,
            f"flights grow shorter by {value:.3g}, impulses smaller by {np.exp(impulse):.3g}: the "
            "load is not constant while the journal flies; --restitution compares with simulations",
        )
    if value >= 1.0:
        return _untold(number, "impacts do not die away")
    return Told(value, value * float(np.hypot(half, _MODEL)), number, "")


def _untold(number: int, reason: str) -> Told:
    return Told(np.nan, np.inf, number, reason)


def _too_few(found: Impacts, number: int, rate: float) -> str:
    gaps = np.diff(found.time)
    short = f"{len(found)} impacts give {number} ratios of successive flights, {FEWEST_RATIOS} are "
    short += "needed; "
    if len(gaps) and np.median(gaps) * rate < 2.0 * SHORTEST:
        faster = 4.0 * SHORTEST / float(np.median(gaps))
        return short + f"at {rate:.4g} records a second flights are not resolved: {faster:.2g} may"
    return short + "let the load turn round more often"


def _mean(groups: list[np.ndarray]) -> tuple[float, float]:
    """Mean of logarithms by sequence, and half of its 95 % interval.

    The wider of Student's over all and the bootstrap (BCa) over sequences: flights of one sequence
    share impacts.
    """
    every = np.concatenate(groups)
    middle = float(every.mean())
    error = float(every.std(ddof=1)) / np.sqrt(len(every))
    half = error * float(student.ppf(0.5 + CONFIDENCE / 2.0, len(every) - 1))
    sums = np.array([group.sum() for group in groups])
    counts = np.array([float(len(group)) for group in groups])
    if len(groups) >= FEWEST_RATIOS and np.ptp(sums / counts) > 0.0:
        interval = bootstrap(
            (sums, counts),
            lambda total, number, axis=-1: total.sum(axis=axis) / number.sum(axis=axis),
            paired=True,
            n_resamples=_RESAMPLES,
            confidence_level=CONFIDENCE,
            rng=np.random.default_rng(0),
        ).confidence_interval
        ends = np.array([interval.low, interval.high])
        if np.isfinite(ends).all():
            half = max(half, float(np.abs(ends - middle).max()))
    return middle, half


def _timing(made: list[Sequence], interval: float) -> float:
    """Half of the 95 % interval of the mean logarithm by the times' own error.

    Impacts are timed to an interval's uniform share; of a sequence only its ends count.
    """
    error = interval / np.sqrt(12.0)
    steps = sum(len(one.flights) - 1 for one in made)
    square = sum((error / one.flights[0]) ** 2 + (error / one.flights[-1]) ** 2 for one in made)
    return float(1.96 * np.sqrt(2.0 * square) / steps)


def sequences(found: Impacts, interval: float) -> list[Sequence]:
    """Each sequence of impacts that dies away steadily, `interval` [s] being between records."""
    gaps, impulses = np.diff(found.time), found.impulse
    made: list[Sequence] = []
    first = 0
    while first < len(gaps):
        last = first + 1
        while last < len(gaps) and _goes_on(
            gaps[first : last + 1], impulses[first : last + 2], interval
        ):
            last += 1
        if last - first >= _LEAST_FLIGHTS:
            made.append(Sequence(gaps[first:last], impulses[first : last + 1]))
            first = last
        else:
            first += 1
    return made


def _goes_on(gaps: np.ndarray, impulses: np.ndarray, interval: float) -> bool:
    """Whether the last of the intervals (at least two) goes on as those before."""
    if gaps[-1] < SHORTEST * interval or not gaps[-1] < gaps[-2]:
        return False
    if (impulses[1:] > _GROWN * impulses[:-1]).any():
        return False  # a new drop
    return len(gaps) < 3 or bool(abs(gaps[-1] / gaps[-2] - gaps[-2] / gaps[-3]) <= _STEADY)
