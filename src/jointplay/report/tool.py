"""Errors of the tool over the run and at its stops, and its vibration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jointplay import analysis
from jointplay.errors import JointplayError
from jointplay.report.cases import Case
from jointplay.report.html import Cell, Html, bullets, joined, markup, paragraph, table
from jointplay.report.naming import dark


def stops(case: Case) -> list[analysis.Stop]:
    """Stops of the reference motion, as far as the run came."""
    assert case.error is not None
    try:
        motion = case.result.simulation.motion
    except JointplayError:
        return []
    if motion is None:
        return []
    return analysis.stops(motion, float(case.error["time"][-1]))


def accuracies(cases: Sequence[Case], start: float) -> Html:
    """Tool error per axis over the run, and at the stops of the reference motion."""
    judged = [case for case in cases if case.error is not None]
    if not judged:
        return paragraph("No case has a tool error: none has play, or none has a reference.")
    rows: list[list[Cell]] = []
    for case in judged:
        assert case.error is not None
        accuracy = analysis.accuracy(case.error, min(start, float(case.error["time"][-1])))
        for k, axis in enumerate(analysis.COMPONENTS):
            values = (accuracy.mean, accuracy.rms, accuracy.peak)
            rows.append([dark(case), axis, *(1e3 * float(value[k]) for value in values)])
    whole = table(
        ["case", "axis", "mean [mm]", "RMS [mm]", "peak [mm]"],
        rows,
        "Tool position less the ideal mechanism's at the same time, world axes; total: the "
        "distance",
        left=2,
    )
    rows = []
    for case in judged:
        assert case.error is not None
        for stop in stops(case):
            moments = [("arrival", stop.start)]
            if stop.kind == "dwell":
                moments.append(("end of dwell", stop.end))
            for what, moment in moments:
                error = 1e3 * analysis.error_at(case.error, moment)
                strong = what == "end of dwell"
                cells: list[Cell] = [stop.kind, what, f"{moment:.4g}"]
                cells += [float(value) for value in error]
                rows.append([dark(case), *(_strong(cell) if strong else cell for cell in cells)])
    if not rows:
        return whole
    at_stops = table(
        ["case", "reference", "moment", "time [s]", "x [mm]", "y [mm]", "z [mm]", "total [mm]"],
        rows,
        "Tool error at the waypoints of the reference motion. The tool picks and places while the "
        "reference dwells: the end of a dwell (bold) is what the process gets",
        left=3,
        name="stops",
    )
    return joined([whole, at_stops])


def _strong(cell: Cell) -> Html:
    return markup("<strong>{}</strong>", cell)


def spectra(cases: Sequence[Case], start: float) -> Html:
    """How the spectra were made, and what they sum up to."""
    rows: list[list[Cell]] = []
    made: list[str] = []
    for case in cases:
        try:
            density = analysis.spectrum(case.result, start=start)
        except JointplayError as error:
            made.append(f"{case.label}: no spectrum, {error}.")
            continue
        frequency = density["frequency"].values
        width = float(frequency[1] - frequency[0])
        values = density.values
        rms = np.sqrt(values[1:].sum(axis=0) * width)
        above = frequency >= 20.0
        strongest = frequency[above][values[above].argmax(axis=0)] if above.any() else [None] * 4
        rows.append(
            [
                dark(case),
                *(float(value) for value in rms),
                *(None if value is None else float(value) for value in strongest[:3]),
                density.attrs["sampling_frequency_hz"] / 1e3,
                density.attrs["window_s"],
                density.attrs["windows"],
            ]
        )
    head = [
        "case",
        *(f"RMS {axis} [m/s²]" for axis in analysis.COMPONENTS),
        *(f"strongest above 20 Hz, {axis} [Hz]" for axis in "xyz"),
        "sampled at [kHz]",
        "window [s]",
        "windows",
    ]
    note = (
        "Power spectral density of the tool's acceleration, world axes, by Welch's method: "
        "one-sided, Hann windows that overlap by half, each less its mean. The acceleration is the "
        "mean one of each record interval (difference of recorded velocities), which lowers the "
        "density towards the Nyquist frequency, by 59 % there."
    )
    parts = [table(head, rows)] if rows else []
    return joined([*parts, paragraph(note), bullets(made)])
