"""Impacts in records: when they are, how hard, and numbers that say what a whole measurement has.

An accelerometer shows an impact as a spike of few records, a force between bearing and journal as a
pulse out of nothing. Neither needs to be calibrated: only times and ratios count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import find_peaks

from jointplay.analysis.identify.reading import Measurement

IMPACT_KINDS = ("acceleration", "reaction")
"""Signals that show impacts."""
_ABOVE = 10.0
"""Standard deviations of the records above which there is an impact."""
_PART = 0.005
"""Part of the largest impact's that an impact must reach."""
WINDOW = 31
"""Records whose median a spike stands out of."""
_APART = 3
"""Records between two impacts."""
_REACH = 2
"""Records to either side that belong to an impact."""
_STRETCH, _CALM = 64, 0.35
"""Records of a stretch, and the part of them that is calm for sure."""
_LOW = 0.945
"""That quantile of the medians of stretches of pure noise, relative to their mean."""
_DROWNED = 5.0
"""Standard deviations of the records below which the statistics see nothing."""
_NORMAL = 0.6745
"""Median of |x| for normal x of standard deviation one."""
BINS = 5
"""Parts of a measurement whose activity is told each by itself."""


@dataclass(frozen=True)
class Channel:
    """A signal in which impacts show."""

    joint: str
    """Whose impacts; empty for an accelerometer, which feels all."""
    time: np.ndarray
    """Shape (n,) [s]."""
    size: np.ndarray
    """By how much records stand out, at least zero, shape (n,) [m/s^2 or N]."""
    noise: float
    """Standard deviation of `size` where nothing hits."""

    @property
    def interval(self) -> float:
        """Between records [s]."""
        return float(np.median(np.diff(self.time)))


@dataclass(frozen=True)
class Impacts:
    """n impacts in a channel."""

    time: np.ndarray
    """Centres, shape (n,) [s]."""
    impulse: np.ndarray
    """Sum over the records of each, in the channel's unit, shape (n,)."""
    peak: np.ndarray
    """Largest record of each, shape (n,)."""

    def __len__(self) -> int:
        """How many there are."""
        return len(self.time)


def channels(measured: Measurement) -> tuple[Channel, ...]:
    """The accelerometer as one channel, and each force between bearing and journal."""
    made = []
    axes = measured.has("acceleration")
    if axes:
        table = np.column_stack([measured.signals["acceleration", axis] for axis in axes])
        made.append(_channel("", measured, table, spiky=True))
    for joint in measured.has("reaction"):
        table = measured.signals["reaction", joint][:, None]
        made.append(_channel(joint, measured, table, spiky=False))
    return tuple(one for one in made if one is not None)


def _channel(joint: str, measured: Measurement, table: np.ndarray, spiky: bool) -> Channel | None:
    good = np.isfinite(table).all(axis=1)
    time, table = measured.time[good], table[good]
    if len(time) <= WINDOW:
        return None
    given = measured.noise.get("reaction" if joint else "acceleration")
    noise = record_noise(table) if given is None else given
    if spiky:
        table = table - median_filter(table, size=(WINDOW, 1), mode="nearest")
    size = np.linalg.norm(table, axis=1)
    return Channel(joint, time, size, max(float(noise), 1e-9 * float(size.max(initial=1.0))))


def record_noise(table: np.ndarray) -> float:
    """Standard deviation of a record of signals (n, axes), by their calmest stretches.

    Third differences take out what changes smoothly; impacts and ringing are elsewhere.
    """
    bends = np.abs(np.diff(table, 3, axis=0)) / np.sqrt(20.0)
    if len(bends) < _STRETCH:
        return float(np.median(bends, axis=0).max(initial=0.0) / _NORMAL) if len(bends) else 0.0
    count = len(bends) // _STRETCH
    medians = np.median(bends[: count * _STRETCH].reshape(count, _STRETCH, -1), axis=1)
    return float(np.quantile(medians, _CALM, axis=0).max() / _NORMAL / _LOW)


def impacts(channel: Channel) -> Impacts:
    """Impacts in a channel, in order."""
    size = channel.size
    limit = max(_ABOVE * channel.noise, _PART * float(size.max(initial=0.0)))
    framed = np.concatenate([[0.0], size, [0.0]])
    at, _ = find_peaks(framed, height=limit, prominence=limit, distance=_APART)
    at = at - 1
    times, impulses = np.zeros(len(at)), np.zeros(len(at))
    for k, i in enumerate(at):
        near = slice(max(i - _REACH, 0), i + _REACH + 1)
        weight = size[near]
        times[k] = np.average(channel.time[near], weights=weight)
        impulses[k] = weight.sum()
    return Impacts(times, impulses, size[at])


def summary(channel: Channel) -> dict[str, float]:
    """Statistics of a measurement's impacts, by name; nan where there are too few.

    How strong the activity is (RMS and quantiles of the records, whole and in parts of the time),
    how many impacts, how far apart, and how the intervals between them shrink. Logarithms, so that
    their scatter is about normal.
    """
    size = np.hypot(channel.size, _DROWNED * channel.noise)
    found = impacts(channel)
    numbers = {"RMS": _log_rms(size)}
    for share in (50, 90, 99):
        numbers[f"{share} % quantile"] = float(np.log(np.percentile(size, share)))
    for number, part in enumerate(np.array_split(size, BINS), 1):
        numbers[f"RMS in part {number} of {BINS}"] = _log_rms(part)
    numbers["number of impacts"] = float(np.log1p(len(found)))
    gaps = np.diff(found.time)
    numbers["intervals, mean"] = float(np.log(gaps).mean()) if len(gaps) else np.nan
    numbers["intervals, spread"] = float(np.log(gaps).std()) if len(gaps) > 1 else np.nan
    ratios = gaps[1:] / gaps[:-1]
    shrinking = ratios[ratios < 1.0]
    numbers["ratio of intervals"] = float(np.log(shrinking).mean()) if len(shrinking) else np.nan
    return numbers


def _log_rms(size: np.ndarray) -> float:
    return float(0.5 * np.log(np.mean(size**2)))
