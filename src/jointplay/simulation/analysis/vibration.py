"""Rattle: how often loose joints strike, how hard, and what the tool shakes at."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.units import readable
from jointplay.simulation.analysis.spectra import TooShort, spectrum
from jointplay.simulation.result.result import Result

BANDS_HZ = (100.0, 1000.0, 10e3)
"""Where the bands of the spectrum meet; the last one ends where the records do [Hz]."""


@dataclass(frozen=True)
class Band:
    """A band of the spectrum of the tool's acceleration."""

    low: float
    """[Hz]."""
    high: float
    """[Hz]."""
    rms: float
    """Root mean square of the acceleration within the band [m/s^2]."""

    @property
    def range(self) -> str:
        low, high = (
            f"{edge:g} Hz" if edge < 1000.0 else f"{edge / 1000.0:g} kHz"
            for edge in (self.low, self.high)
        )
        return f"{low} to {high}" if self.low > 0.0 else f"below {high}"


@dataclass(frozen=True)
class Rattle:
    """What the contacts of a run come to, from `start` on."""

    start: float
    """[s]."""
    duration: float
    """[s]."""
    impacts: int
    """Contacts that began, of all joints; a journal that bounces counts with each bounce."""
    lost: float
    """Energy lost normal to the surfaces, which impacts turn into sound and heat [J]."""
    bands: tuple[Band, ...]
    against_ideal: bool = False
    """Whether it is that of the difference from the ideal twin, or that of the whole motion."""

    @property
    def rate(self) -> float:
        """Impacts a second [1/s]."""
        return self.impacts / self.duration

    @property
    def energy(self) -> float:
        """Mean energy lost in an impact [J]; 0 without impacts."""
        return self.lost / self.impacts if self.impacts else 0.0

    @property
    def power(self) -> float:
        """Mean power lost in impacts [W]."""
        return self.lost / self.duration

    def __str__(self) -> str:
        words = f"rattle: {_three(self.rate)} impacts a second"
        if self.impacts:
            words += f" of {_three(self.energy, 'J')} each, {_three(self.power, 'W')}"
        if self.bands:
            parts = (f"{one.range} {_three(one.rms)}" for one in self.bands)
            what = (
                "RMS acceleration against the ideal" if self.against_ideal else "RMS acceleration"
            )
            words += f"; the tool's {what} [m/s^2]: {', '.join(parts)}"
        return words


def rattle(result: Result, ideal: Result | None = None) -> Rattle:
    """Impacts a second, their energy, and the tool's vibration in bands of frequency.

    All from when on the run is judged. The bands meet at `BANDS_HZ` and end at half the frequency
    of the records; each is the sum of the density that `spectrum` finds. The motion of the ideal
    twin, if it is given, is subtracted before the spectrum is taken.

    Raises:
        JointplayError: a run without clearance, or of too few records.
    """
    if not result.joints:
        raise JointplayError("a run without clearance cannot rattle")
    start = result.judge_from
    time = result.time[result.time >= start]
    if len(time) < 2:
        raise JointplayError(f"fewer than two records from {start:g} s on")
    impacts = result.audit.judged_impacts
    lost = result["normal_dissipation"].values[result.time >= start]
    return Rattle(
        start,
        float(time[-1] - time[0]),
        result.audit.impacts if impacts is None else impacts,
        float(lost[-1] - lost[0]),
        _bands(result, ideal),
        ideal is not None,
    )


def _bands(result: Result, ideal: Result | None) -> tuple[Band, ...]:
    try:
        density = spectrum(result, ideal).sel(axis="total")
    except TooShort:
        return ()
    frequency = density["frequency"].values
    width = float(frequency[1] - frequency[0])
    last = float(frequency[-1])
    edges = [0.0, *(edge for edge in BANDS_HZ if edge < last), last]
    bands = []
    for low, high in pairwise(edges):
        inside = (frequency >= low) & ((frequency < high) | (high == last))
        bands.append(Band(low, high, float(np.sqrt(width * density.values[inside].sum()))))
    return tuple(bands)


def _three(value: float, unit: str = "") -> str:
    return readable(float(f"{value:.3g}"), unit)
