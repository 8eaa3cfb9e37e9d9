"""Spectrum of a recorded quantity."""

from __future__ import annotations

import numpy as np
import xarray as xr

from jointplay.base.errors import JointplayError, MissingName, require_finite, require_whole
from jointplay.simulation.analysis.tool_error import COMPONENTS, deviation
from jointplay.simulation.result.result import Result


class TooShort(JointplayError):
    """A run of too few records for a spectrum."""


def spectrum(
    result: Result,
    ideal: Result | None = None,
    of: str = "acceleration",
    start: float | None = None,
    segment: int = 4096,
) -> xr.DataArray:
    """Power spectral density of the tool's vibration by Welch's method.

    One-sided; Hann windows of `segment` samples that overlap by half, each less its mean. The
    acceleration is the mean one of each record interval h, (v[i+1] - v[i])/h: exact but for the
    running mean over h, which lowers the density by sinc^2(f h), 0.41 at the Nyquist frequency.

    P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Trans.
    Audio Electroacoust. 15 (1967) 70-73.

    Args:
        result: the run, recorded at even intervals.
        ideal: its ideal twin, whose motion is subtracted first; needed for ``deviation``.
        of: ``acceleration`` [(m/s^2)^2/Hz] or ``deviation`` [m^2/Hz].
        start: records before this are left out [s]; None: before the run is judged.
        segment: samples in a window; shorter if the run has fewer.

    Returns:
        (frequency, axis) with axis x, y, z, total (the sum), frequency in Hz; attributes
        `sampling_frequency_hz`, `window_s`, `windows`.

    Raises:
        JointplayError: too few even records.
    """
    from scipy.signal import welch

    if of not in ("acceleration", "deviation"):
        raise MissingName("spectrum", of, ("acceleration", "deviation"))
    if of == "deviation":
        if ideal is None:
            raise JointplayError("the spectrum of the deviation needs the ideal run: ideal=...")
        signal = deviation(result, ideal)
    elif ideal is not None:
        signal = deviation(result, ideal, "tool_velocity")
    else:
        signal = result["tool_velocity"]
    segment = require_whole("segment", segment, 2)
    start = result.judge_from if start is None else require_finite("start", start, "s")
    signal = signal.sel(time=signal["time"] >= start)
    time = signal["time"].values
    if len(time) > 2 and not np.isclose(time[-1] - time[-2], time[1] - time[0], rtol=1e-6):
        time = time[:-1]  # the last record is the end, wherever that falls
    values = signal.values[: len(time)]
    if len(time) > 1 and of == "acceleration":
        values = np.diff(values, axis=0) / np.diff(time)[:, None]
    if len(values) < 16:
        raise TooShort(f"a spectrum needs at least 17 records from {start:g} s on, got {len(time)}")
    interval = float(time[-1] - time[0]) / (len(time) - 1)
    length = min(segment, len(values))
    frequency, density = welch(
        values, fs=1.0 / interval, window="hann", nperseg=length, detrend="constant", axis=0
    )
    density = np.column_stack([density, density.sum(axis=1)])
    return xr.DataArray(
        density,
        {"frequency": ("frequency", frequency, {"units": "Hz"}), "axis": list(COMPONENTS)},
        ("frequency", "axis"),
        attrs={
            "units": "(m/s^2)^2/Hz" if of == "acceleration" else "m^2/Hz",
            "long_name": f"power spectral density of the tool's {of}"
            + (" from the ideal robot" if ideal is not None else ""),
            "sampling_frequency_hz": 1.0 / interval,
            "window_s": length * interval,
            "windows": 1 + (len(values) - length) // max(length - length // 2, 1),
        },
    )
