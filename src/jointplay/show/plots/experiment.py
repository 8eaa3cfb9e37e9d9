"""A run beside an experiment: measured points, the computed line, the band of an ensemble."""

from __future__ import annotations

from jointplay.estimate.experiment import BAND, ExperimentComparison
from jointplay.show.plots.chart import Area, Axis, Chart, Curve, Mark, Panel
from jointplay.show.plots.palette import BLUE

_DENSE = 200
"""Measured values beyond which they are drawn as a line: points would touch (judged)."""


def overlay(comparison: ExperimentComparison) -> Chart:
    """A panel for each measured column."""
    rows: list[list[Panel | None]] = []
    for curve in comparison.curves:
        dense = len(curve.times) > _DENSE
        marks: list[Mark] = []
        if curve.band is not None:
            name = f"{BAND[0]:g} to {BAND[1]:g} % of perturbed runs"
            marks.append(Area(curve.times, *curve.band, name, BLUE, opacity=0.25))
        marks += [
            Curve(curve.times, curve.computed, "computed", BLUE),
            Curve(
                curve.times, curve.measured, "measured", "black", "-" if dense else "",
                width=0.7, marker="" if dense else "o", order=3.0,
            ),
        ]  # fmt: skip
        rows.append([Panel(Axis("time", "s"), Axis(curve.name, curve.unit), marks)])
    shift = f"Measured times shifted by {comparison.shift:.4g} s." if comparison.shift else ""
    return Chart(rows, (7.0, 1.0 + 2.0 * len(rows)), note=shift, key=3, same_x=True)
