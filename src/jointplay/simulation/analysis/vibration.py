"""Vibration of the tool as spectra, and rattle: how often loose joints strike, and how hard."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.lib.stride_tricks import sliding_window_view

from jointplay.base.errors import JointplayError, require_finite, require_known, require_whole
from jointplay.base.tables import counted
from jointplay.base.units import readable, rounded, typeset
from jointplay.simulation.analysis.tool_error import COMPONENTS, deviation, has_tool_error
from jointplay.simulation.result.result import Result


class TooShort(JointplayError):
    """A run of too few records for a spectrum."""


SPECTRA = {
    "acceleration": "(m/s^2)^2/Hz",
    "acceleration_error": "(m/s^2)^2/Hz",
    "deviation": "m^2/Hz",
}
"""Signals of which there are spectra, and the units of these."""


def spectrum(
    result: Result,
    of: str = "acceleration",
    start: float | None = None,
    segment: int = 4096,
) -> xr.DataArray:
    """Power spectral density of the tool's vibration by Welch's method.

    The density is one-sided; Hann windows of `segment` samples overlap by half, each less its mean.
    The acceleration is the mean of each record interval h, (v[i+1] - v[i])/h: exact but for the
    running mean over h, which lowers the density by sinc^2(f h), 0.41 at the Nyquist frequency.

    P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Trans.
    Audio Electroacoust. 15 (1967) 70-73.

    Args:
        result: the run, recorded at even intervals.
        of: ``acceleration`` [(m/s^2)^2/Hz], ``acceleration_error``, less that of the ideal tool, or
            ``deviation`` from the ideal tool [m^2/Hz].
        start: records before this are left out [s]; None: before the run is judged.
        segment: samples in a window; shorter if the run has fewer.

    Returns:
        Array (frequency, axis) with frequency in Hz and axis x, y, z, total (the sum); attributes
        `sampling_frequency_hz`, `window_s`, `windows`.

    Raises:
        JointplayError: too few even records.
    """
    require_known("spectrum", of, SPECTRA)
    if of == "acceleration":
        signal = result["tool_velocity"]
    else:
        signal = deviation(result, "tool_position" if of == "deviation" else "tool_velocity")
    segment = require_whole("segment", segment, 2)
    start = result.judge_from if start is None else require_finite("start", start, "s")
    signal = signal.sel(time=signal["time"] >= start)
    time = signal["time"].values
    if len(time) > 2 and not np.isclose(time[-1] - time[-2], time[1] - time[0], rtol=1e-6):
        time = time[:-1]  # the last record is the end, wherever that falls
    values = signal.values[: len(time)]
    if len(time) > 1 and of != "deviation":
        values = np.diff(values, axis=0) / np.diff(time)[:, None]
    if len(values) < 16:
        raise TooShort(f"a spectrum needs at least 17 records from {start:g} s on, got {len(time)}")
    interval = float(time[-1] - time[0]) / (len(time) - 1)
    length = min(segment, len(values))
    frequency, density = _welch(values, interval, length)
    density = np.column_stack([density, density.sum(axis=1)])
    return xr.DataArray(
        density,
        {"frequency": ("frequency", frequency, {"units": "Hz"}), "axis": list(COMPONENTS)},
        ("frequency", "axis"),
        attrs={
            "units": SPECTRA[of],
            "long_name": f"power spectral density of the tool's {of.replace('_', ' ')}"
            + ("" if of == "acceleration" else " against the ideal robot"),
            "sampling_frequency_hz": 1.0 / interval,
            "window_s": length * interval,
            "windows": 1 + (len(values) - length) // max(length - length // 2, 1),
        },
    )


def _welch(values: np.ndarray, interval: float, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and densities of columns (`scipy.signal`, which has it, takes long to import)."""
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    windows = sliding_window_view(values, length, axis=0)[:: length - length // 2]
    windows = windows - windows.mean(axis=-1, keepdims=True)
    power = np.abs(np.fft.rfft(windows * window)) ** 2
    density = power.mean(axis=0).T * interval / (window**2).sum()
    density[1 : (length + 1) // 2] *= 2.0  # one-sided: but for 0 and the Nyquist frequency
    return np.fft.rfftfreq(length, interval), density


BANDS_HZ = (100.0, 1000.0, 10e3)
"""Frequencies at which bands of the spectrum meet; the last ends at half the records' [Hz]."""


@dataclass(frozen=True)
class Band:
    """A band of the spectrum of the tool's acceleration."""

    low: float
    """Lower edge [Hz]."""
    high: float
    """Upper edge [Hz]."""
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
    """Impacts of a run and the vibration of its tool, from `start` on."""

    start: float
    """Time from which the run is judged [s]."""
    duration: float
    """Time from there to the end [s]."""
    impacts: int
    """Number of contacts that began, in all joints; each bounce of a journal counts."""
    lost: float
    """Energy lost normal to the surfaces, which impacts turn into sound and heat [J]."""
    bands: tuple[Band, ...]
    """Bands of the tool's acceleration."""
    turns: float | None = None
    """Turns of a crank at constant speed in that time; None where no single one turns."""
    against_ideal: bool = False
    """Whether the acceleration is that of the difference from the ideal twin, or of the motion."""

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

    @property
    def impacts_words(self) -> str:
        """Rate, energy and power of impacts, in words."""
        text = f"rattle: {counted(_three(self.rate), 'impact')} a second"
        if self.turns and self.impacts:
            text += f", {_three(self.impacts / self.turns)} a turn,"
        if self.impacts:
            text += f" of {rounded(self.energy, 'J', 3, fine=True)} each, {_three(self.power, 'W')}"
        return text

    def __str__(self) -> str:
        text = self.impacts_words
        if self.bands:
            parts = (f"{band.range} {_three(band.rms)}" for band in self.bands)
            quantity = (
                "RMS acceleration against the ideal" if self.against_ideal else "RMS acceleration"
            )
            text += f"; the tool's {quantity} [{typeset('m/s^2')}]: {', '.join(parts)}"
        return text


def rattle(result: Result) -> Rattle:
    """Impacts a second, their energy, and the tool's vibration in bands of frequency.

    All count from `Result.judge_from` on. The bands meet at `BANDS_HZ` and end at half the
    frequency of the records; each is the sum of the density of `spectrum`, less the motion of the
    ideal tool where that is known.

    Raises:
        JointplayError: a run without clearance, or of too few records.
    """
    if not result.joints:
        raise JointplayError("a run without clearance cannot rattle")
    start = result.judge_from
    time = result.time[result.time >= start]
    if len(time) < 2:
        raise JointplayError(f"fewer than two records from {start:g} s on")
    lost = result["normal_dissipation"].values[result.time >= start]
    against_ideal = has_tool_error(result)
    return Rattle(
        start,
        float(time[-1] - time[0]),
        result.audit.judged_impacts,
        float(lost[-1] - lost[0]),
        _bands(result, "acceleration_error" if against_ideal else "acceleration"),
        _turns(result, float(time[0]), float(time[-1])),
        against_ideal,
    )


def _turns(result: Result, begin: float, end: float) -> float | None:
    """Turns between two times [s] of a crank, the only joint of the motion, at constant speed."""
    motion, entries = result.simulation.motion, result.simulation.mechanism.description.joints
    if motion is None or motion.interpolation != "constant-speed" or len(motion.joints) != 1:
        return None
    entry = entries.get(motion.joints[0])
    if entry is None or entry.slides:
        return None
    first, last = motion(np.array([begin, end]))[0][:, 0]
    return abs(float(last - first)) / (2.0 * np.pi) or None


def _bands(result: Result, of: str) -> tuple[Band, ...]:
    try:
        density = spectrum(result, of).sel(axis="total")
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
    return readable(value, unit, 3)
