"""Figures of sweeps: lines with confidence bands, heat maps, convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from jointplay.base.errors import JointplayError, MissingName
from jointplay.show.plots.chart import Axis, Chart, Curve, Map, Panel, Rule
from jointplay.show.plots.palette import COLOURS
from jointplay.simulation.analysis.uncertainty import convergence, enough, interval_estimate
from jointplay.study.sweep_plan import SAMPLE
from jointplay.study.sweep_table import coordinate_text, label, measured, samples_of, scale, select

MOST_LINES = 12  # most lines of a chart (judged)


def chart(
    dataset: xr.Dataset,
    x: str,
    y: str,
    hue: str | None = None,
    z: str | None = None,
    only: Mapping[str, str] | None = None,
) -> Chart:
    """A measure of a sweep over one dimension, or as a heat map over two.

    Lines are means over all other dimensions, with the 95 % confidence band of the mean. Over a
    sampled quantity, each run is a point.

    Args:
        dataset: the sweep's data.
        x: dimension, or sampled quantity.
        y: the measure; for a heat map a dimension.
        hue: dimension with a line for each of its values.
        z: the measure of a heat map.
        only: values of dimensions; the nearest cases are taken.

    Raises:
        JointplayError: no such dimension, measure or value; nothing to draw.
    """
    dataset = select(dataset, only or {})
    if z is not None:
        if hue is not None:
            raise JointplayError("a heat map (z) has no hue; leave one of them out")
        return _heat_map(dataset, x, y, z)
    values = measured(dataset, y)
    if not np.isfinite(values.values).any():
        raise JointplayError(f"no case has a value of {y}")
    sampled = list(dataset.attrs["sampled"])
    dims = [str(d) for d in values.dims]
    if x not in (*dims, *sampled):
        raise MissingName("dimension", x, [*dims, *sampled])
    if hue is not None and (hue not in dims or hue == x):
        raise MissingName("dimension for hue", hue, [d for d in dims if d != x])
    groups: list[int | None] = [None] if hue is None else list(range(values.sizes[hue]))
    if len(groups) > MOST_LINES:
        raise JointplayError(
            f"hue {hue} has {len(groups)} values; at most {MOST_LINES} can be drawn"
        )
    marks = []
    # Values in a geometric series get a logarithmic axis.
    ratios = np.empty(0)
    if x in dims and _is_number(dataset, x) and (dataset[x].values > 0.0).all():
        ratios = dataset[x].values[1:] / dataset[x].values[:-1]
    geometric = len(ratios) >= 3 and np.ptp(ratios) < 1e-6 * ratios.mean() and ratios[0] > 1.05
    across = Axis(label(dataset, x), log=bool(geometric))
    for number, k in enumerate(groups):
        part = values if k is None else values.isel({hue: k})
        if not np.isfinite(part.values).any():  # none of its cases ran to its end
            continue
        text = "" if k is None or hue is None else coordinate_text(dataset, hue, k)
        look: dict[str, Any] = {"name": text, "colour": COLOURS[number % len(COLOURS)]}
        if x in sampled:
            marks.append(_points(dataset, part, x, y, look))
            continue
        look["line"] = "-" if number < len(COLOURS) else "--"
        marks.append(_line(dataset, part, x, y, look))
    if x in dims and not _is_number(dataset, x):
        across = Axis(label(dataset, x), rows=_texts(dataset, x))
    title = label(dataset, hue) if hue is not None else ""
    legend = "best" if hue is not None else ""
    panel = Panel(across, Axis(label(dataset, y)), marks, legend=legend, legend_title=title)
    return Chart([[panel]], (6.0, 3.8))


def _is_number(dataset: xr.Dataset, name: str) -> bool:
    return name in dataset.coords and dataset[name].dtype.kind in "fi"


def _texts(dataset: xr.Dataset, name: str) -> list[str]:
    return [coordinate_text(dataset, name, k) for k in range(dataset.sizes[name])]


def _line(dataset: xr.Dataset, part: xr.DataArray, x: str, y: str, look: dict[str, Any]) -> Curve:
    """Means of the measure `y` at each value of the dimension `x`, with their confidence band."""
    table = part.transpose(x, ...).values.reshape(part.sizes[x], -1)
    estimates = [interval_estimate(row) for row in table]
    at: np.ndarray = np.arange(len(estimates))
    if _is_number(dataset, x):
        at = dataset[x].values * scale(dataset, x)[0]
    order = np.argsort(at)
    known = [estimates[k] for k in order]
    return _band(at[order], known, scale(dataset, y)[0], {**look, "marker": "o"})


def _band(at: np.ndarray, estimates: Sequence[Any], factor: float, look: dict[str, Any]) -> Curve:
    """Estimates as a line, with their confidence intervals as a band where these are known."""
    middle, low, high = (
        factor
        * np.array([(estimate.value, estimate.low, estimate.high) for estimate in estimates]).T
    )
    return Curve(at, middle, low=low, high=high, **look)


def _points(dataset: xr.Dataset, part: xr.DataArray, x: str, y: str, look: dict[str, Any]) -> Curve:
    """The measure `y` of each run over its sampled quantity `x`."""
    table = scale(dataset, y)[0] * part.transpose(SAMPLE, ...).values
    table = table.reshape(part.sizes[SAMPLE], -1)
    at = np.repeat(dataset[x].values[:, None], table.shape[1], axis=1) * scale(dataset, x)[0]
    return Curve(at.ravel(), table.ravel(), line="", marker="o", size=2.5, opacity=0.6, **look)


def _heat_map(dataset: xr.Dataset, x: str, y: str, z: str) -> Chart:
    values = measured(dataset, z)
    for name in (x, y):
        if name not in values.dims:
            raise MissingName("dimension", name, [str(d) for d in values.dims])
    if x == y:
        raise JointplayError(f"x and y are both {x}; a heat map needs two dimensions")
    rest = [d for d in values.dims if d not in (x, y)]
    table = scale(dataset, z)[0] * values.mean(rest, skipna=True).transpose(y, x).values
    if not np.isfinite(table).any():
        raise JointplayError(f"no case has a value of {z}")
    across, up = (Axis(label(dataset, name), rows=_texts(dataset, name)) for name in (x, y))
    panel = Panel(across, up, [Map(table, Axis(label(dataset, z)), written=True)])
    return Chart([[panel]], (6.0, 4.4))


def convergence_chart(dataset: xr.Dataset, measure: str, precision: float) -> Chart:
    """Mean and 95 % quantile of a measure over the number of runs, and how many runs suffice for a
    relative `precision`."""
    values = samples_of(dataset, measure)
    marks: list[Curve | Rule] = []
    for colour, (name, probability, text) in zip(
        COLOURS, (("mean", 0.5, "mean"), ("quantile", 0.95, "95 % quantile")), strict=False
    ):
        estimates = convergence(values, name, probability)
        runs = np.array([estimate.runs for estimate in estimates])
        look_of = {"colour": colour, "name": text}
        marks.append(_band(runs, estimates, scale(dataset, measure)[0], look_of))
        done = enough(estimates, precision)
        if done is not None:
            legend = f"{text}: {done} runs give {100 * precision:g} %"
            marks.append(Rule(done, "x", legend, colour, ":", 0.9))
    across, up = Axis("runs", log=True), Axis(label(dataset, measure))
    return Chart([[Panel(across, up, marks, legend="best")]], (6.0, 3.8))
