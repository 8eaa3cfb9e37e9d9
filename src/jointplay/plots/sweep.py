"""Figures of sweeps: lines with confidence bands, heat maps, convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from jointplay.analysis.uncertainty import convergence, enough, estimate
from jointplay.core.errors import JointplayError, MissingName
from jointplay.plots.style import COLOURS, StyledFigure, listed, logarithmic, panels
from jointplay.study.plan import SAMPLE
from jointplay.study.table import coordinate_text, label, measured, samples_of, scale, select

MOST_LINES = 12


def draw(
    dataset: xr.Dataset,
    x: str,
    y: str,
    hue: str | None = None,
    z: str | None = None,
    only: Mapping[str, str] | None = None,
    look: str = "screen",
) -> StyledFigure:
    """A measure over a dimension of a sweep, or over two.

    Lines are means over all other dimensions, with the 95 % confidence band of the mean. Over a
    sampled quantity it is points.

    Args:
        dataset: of `open_sweep`.
        x: dimension, or sampled quantity.
        y: the measure; with `z` a dimension.
        hue: dimension with a line each.
        z: the measure of a heat map.
        only: values of dimensions, of which the nearest cases are taken.
        look: style of the figure.

    Raises:
        JointplayError: no such dimension, measure or value; nothing to draw.
    """
    dataset = select(dataset, only or {})
    if z is not None:
        if hue is not None:
            raise JointplayError("a heat map (z) has no hue; leave one of them out")
        return _heat_map(dataset, x, y, z, look)
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
    return _lines(dataset, x, y, hue, groups, look)


def _lines(
    dataset: xr.Dataset, x: str, y: str, hue: str | None, groups: list[int | None], look: str
) -> StyledFigure:
    """A line, or points, for each value of `hue`."""
    values, sampled = measured(dataset, y), list(dataset.attrs["sampled"])
    with panels(6.0, 3.8, look=look) as (figure, axes):
        for number, k in enumerate(groups):
            part = values if k is None else values.isel({hue: k})
            if not np.isfinite(part.values).any():  # none of its cases ran to its end
                continue
            text = None if k is None or hue is None else listed(coordinate_text(dataset, hue, k))
            options: dict[str, Any] = {"color": COLOURS[number % len(COLOURS)], "label": text}
            if number >= len(COLOURS):
                options["linestyle"] = "--"
            if x in sampled:
                options.pop("linestyle", None)
                _points(axes, dataset, part, x, y, options)
            else:
                _line(axes, dataset, part, x, y, options)
        axes.set_xlabel(label(dataset, x))
        axes.set_ylabel(label(dataset, y))
        _log_where_spaced_so(axes, dataset, x)
        if hue is not None:
            axes.legend(title=label(dataset, hue))
    return figure


def _log_where_spaced_so(axes: Any, dataset: xr.Dataset, x: str) -> None:
    """A logarithmic axis for values of equal ratios."""
    if x not in dataset.coords or x not in dataset.dims or dataset[x].dtype.kind not in "fi":
        return
    values = dataset[x].values.astype(float)
    if len(values) > 3 and (values > 0.0).all():
        ratios = values[1:] / values[:-1]
        if np.ptp(ratios) < 1e-6 * ratios.mean() and ratios[0] > 1.05:
            logarithmic(axes, "x")


def _line(
    axes: Any, dataset: xr.Dataset, part: xr.DataArray, x: str, y: str, options: dict[str, Any]
) -> None:
    """Mean and its confidence band at each value of a dimension."""
    factor = scale(dataset, y)[0]
    table = part.transpose(x, ...).values.reshape(part.sizes[x], -1)
    estimates = [estimate(row) for row in table]
    words = x not in dataset.coords or dataset[x].dtype.kind not in "fi"
    at = np.arange(len(estimates)) if words else dataset[x].values * scale(dataset, x)[0]
    if words:
        axes.set_xticks(at, [coordinate_text(dataset, x, k) for k in range(len(estimates))])
    order = np.argsort(at)
    _band(
        axes, at[order], [estimates[k] for k in order], factor, options | {"marker": "o", "ms": 3}
    )


def _band(
    axes: Any,
    at: np.ndarray,
    estimates: Sequence[Any],
    factor: float,
    options: dict[str, Any],
) -> None:
    """Values as a line, and their confidence intervals, where they are known, as a band."""
    middle, low, high = factor * np.array([(one.value, one.low, one.high) for one in estimates]).T
    axes.plot(at, middle, **options)
    known = np.isfinite(low) & np.isfinite(high)
    if known.any():
        axes.fill_between(at, low, high, where=known, color=options["color"], alpha=0.2, lw=0)


def _points(
    axes: Any, dataset: xr.Dataset, part: xr.DataArray, x: str, y: str, options: dict[str, Any]
) -> None:
    """Values over a sampled quantity."""
    table = part.transpose(SAMPLE, ...).values.reshape(part.sizes[SAMPLE], -1)
    at = np.repeat(dataset[x].values[:, None], table.shape[1], axis=1) * scale(dataset, x)[0]
    axes.plot(at.ravel(), table.ravel() * scale(dataset, y)[0], ".", ms=3, alpha=0.6, **options)


def _heat_map(dataset: xr.Dataset, x: str, y: str, z: str, look: str) -> StyledFigure:
    values = measured(dataset, z)
    for name in (x, y):
        if name not in values.dims:
            raise MissingName("dimension", name, [str(d) for d in values.dims])
    if x == y:
        raise JointplayError(f"x and y are both {x}; a heat map needs two dimensions")
    factor = scale(dataset, z)[0]
    rest = [d for d in values.dims if d not in (x, y)]
    table = factor * values.mean(rest, skipna=True).transpose(y, x).values
    if not np.isfinite(table).any():
        raise JointplayError(f"no case has a value of {z}")
    with panels(6.0, 4.4, look=look) as (figure, axes):
        image = axes.imshow(table, cmap="cividis", origin="lower", aspect="auto")
        axes.grid(False)
        for name, ticks in ((x, axes.set_xticks), (y, axes.set_yticks)):
            size = values.sizes[name]
            at = np.unique(np.linspace(0, size - 1, min(size, 9)).round().astype(int))
            ticks(at, [coordinate_text(dataset, name, k) for k in at])
        axes.set_xlabel(label(dataset, x))
        axes.set_ylabel(label(dataset, y))
        if table.size <= 120:
            middle = 0.5 * (np.nanmin(table) + np.nanmax(table))
            for (row, column), value in np.ndenumerate(table):
                if np.isfinite(value):
                    colour = "white" if value < middle else "black"
                    axes.text(column, row, f"{value:.3g}", ha="center", va="center",
                              color=colour, fontsize=7)  # fmt: skip
        figure.colorbar(image, label=label(dataset, z))
    return figure


def draw_convergence(
    dataset: xr.Dataset, measure: str, precision: float = 0.05, look: str = "screen"
) -> StyledFigure:
    """Mean and 95 % quantile of a measure after the first runs, up to all, and when it is enough.

    Raises:
        JointplayError: nothing is sampled, or no such measure.
    """
    values = samples_of(dataset, measure)
    factor = scale(dataset, measure)[0]
    with panels(6.0, 3.8, look=look) as (figure, axes):
        for number, (name, probability, text) in enumerate(
            (("mean", 0.5, "mean"), ("quantile", 0.95, "95 % quantile"))
        ):
            estimates = convergence(values, name, probability)
            runs, colour = np.array([one.runs for one in estimates]), COLOURS[number]
            _band(axes, runs, estimates, factor, {"color": colour, "label": text})
            done = enough(estimates, precision)
            if done is not None:
                axes.axvline(done, color=colour, ls=":",
                             label=f"{text}: {done} runs give {100 * precision:g} %")  # fmt: skip
        logarithmic(axes, "x")
        axes.set_xlabel("runs")
        axes.set_ylabel(label(dataset, measure))
        axes.legend()
    return figure
