"""The blocks of a report on a sweep, in the order of the page, which has no scripts."""

from __future__ import annotations

import json
import math
import operator
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import xarray as xr

from jointplay.show.plots import sweep as plots
from jointplay.show.reports.html import markup, paragraph
from jointplay.show.reports.parts import (
    Beside,
    Block,
    Drawing,
    Fold,
    Grid,
    Part,
    Points,
    block,
    shortened,
)
from jointplay.study import sweep_table
from jointplay.study.store import DONE, FAILED, NOT_RUN
from jointplay.study.sweep_plan import SAMPLE

_ROWS, _FIRST = 20, 2  # points of the grid, and charts, that stand unfolded (judged)
_MOST_ROWS = 400  # most points of the grid, or failed cases, in a table (judged)
_VALUES = 8  # most values of the scenario beside the figures (judged)
_PRECISION = 0.05  # relative half width of a confidence interval that the page calls enough

BLOCKS: list[Block] = []


@block(BLOCKS, "At a glance", folded=False)
def glance(dataset: xr.Dataset) -> Iterator[Part]:
    """Range of each measure, with the points of its ends; how many cases ran; the first charts."""
    dims, over = sweep_table.grid(dataset)
    ranges: list[str] = []
    for name, unit, factor in sweep_table.columns_of(dataset):
        means = (factor * dataset[name]).mean([*over], skipna=True).transpose(*dims)
        if np.isfinite(means.values).any():
            ends = [_extreme(dataset, means, find, unit) for find in (np.nanargmin, np.nanargmax)]
            ranges.append(f"{_spoken(name)}: {' to '.join(dict.fromkeys(ends))}")
    yield from shortened(Points(ranges), "figure")
    status = dataset["status"].values
    counts: dict[str, Any] = {
        "cases": int(status.size),
        "done": int((status == DONE).sum()),
        "failed": int((status == FAILED).sum()),
        "not run": int((status == NOT_RUN).sum()),
        "processor time": (float(np.nansum(dataset.get("cost", 0.0))), "s"),
    }
    if "warnings" in dataset:
        counts["runs with warnings"] = int((dataset["warnings"].values > 0).sum())
    varied = tuple(f"{key}." for key in sweep_table.varied_keys(dataset))
    inputs = _inputs(dataset, False)
    fixed = [f"{key} {text}" for key, text in inputs if not f"{key}.".startswith(varied)]
    values: list[Part] = [markup("<h3>The same in all cases</h3>"), Points(fixed[:_VALUES])]
    yield Beside([[Grid.of_cases("", [""], [counts])], values])
    yield from [*_lines(dataset), *_samples(dataset)][:_FIRST]
    if _varied(dataset):
        intervals = "95 % confidence intervals of the mean over the runs of a point"
        yield paragraph(f"Means; the bands are {intervals}.")


def _extreme(
    dataset: xr.Dataset, means: xr.DataArray, find: Callable[[np.ndarray], Any], unit: str
) -> str:
    """The mean that `find` (nanargmin or nanargmax) selects, and its point of the grid, as text."""
    place = np.unravel_index(int(find(means.values)), means.shape)
    where = [
        f"{_spoken(d)} {sweep_table.coordinate_text(dataset, d, int(k))} "
        f"{sweep_table.scale(dataset, d)[1]}"
        for d, k in zip(map(str, means.dims), place, strict=True)
        if means.sizes[d] > 1
    ]
    at = f" (at {', '.join(map(str.rstrip, where))})" if where else ""
    return f"{float(means.values[place]):.4g} {unit.removesuffix('1')}".rstrip() + at


@block(BLOCKS, "Cases", folded=False)
def cases(dataset: xr.Dataset) -> Iterator[Part]:
    """Means with half the width of their confidence intervals, at each point of the grid."""
    dims, over = sweep_table.grid(dataset)
    value = operator.attrgetter("plus_minus" if over else "value")
    points = sweep_table.points(dataset, _MOST_ROWS, value)
    caption = ""
    if over:
        runs = math.prod(dataset.sizes[d] for d in over)
        caption = f"Means over {runs} runs of each point, ± half the 95 % confidence interval."
    yield from shortened(Grid.of_table(points, len(dims), caption=caption), "point", _ROWS)
    yield from _left_out(math.prod(dataset.sizes[d] for d in dims) - _MOST_ROWS, "points ")


def _left_out(number: int, noun: str = "") -> Iterator[Part]:
    """A note on rows that a table leaves out, if it does."""
    if number > 0:
        yield paragraph(f"{number} more {noun}are in the store.")


def _spoken(name: str) -> str:
    return name.replace("_", " ")


def _varied(dataset: xr.Dataset) -> list[str]:
    """The grid's dimensions with more than one value, the longest first."""
    dims = [d for d in sweep_table.grid(dataset)[0] if dataset.sizes[d] > 1]
    return sorted(dims, key=lambda d: -dataset.sizes[d])


def _known(dataset: xr.Dataset) -> dict[str, str]:
    """Measures that have values, and their names in words."""
    names = (name for name, _, _ in sweep_table.columns_of(dataset))
    return {n: _spoken(n) for n in names if np.isfinite(dataset[n].values).any()}


def _lines(dataset: xr.Dataset) -> Iterator[Drawing]:
    """Each measure over the two longest dimensions, a line for each value of a short one."""
    dims = _varied(dataset)
    for x in dims[:2]:
        few = (d for d in dims if d != x and dataset.sizes[d] <= plots.MOST_LINES)
        hue = next(few, None)
        for name, label in _known(dataset).items():
            yield Drawing(f"{label} over {_spoken(x)}", plots.chart(dataset, x, name, hue))


def _samples(dataset: xr.Dataset) -> Iterator[Drawing]:
    """Each measure over each sampled quantity, and its convergence, if nothing else is varied."""
    if not sweep_table.grid(dataset)[1] or _varied(dataset):
        return
    for name, label in _known(dataset).items():
        for x in dataset.attrs["sampled"]:
            yield Drawing(f"{label} over {_spoken(x)}", plots.chart(dataset, x, name))
        title = f"{label}: how it settles with the number of runs"
        yield Drawing(title, plots.convergence_chart(dataset, name, _PRECISION))


@block(BLOCKS, "Lines")
def lines(dataset: xr.Dataset) -> Iterator[Part]:
    """Each figure over what was varied."""
    yield from [*_lines(dataset)][_FIRST:]


@block(BLOCKS, "Heat maps")
def maps(dataset: xr.Dataset) -> Iterator[Part]:
    """Each figure over two things that were varied."""
    dims = _varied(dataset)
    for name, label in _known(dataset).items() if len(dims) > 1 else ():
        x, y, *_ = dims
        title = f"{label} over {_spoken(x)} and {_spoken(y)}"
        yield Drawing(title, plots.chart(dataset, x, y, z=name))


@block(BLOCKS, "Distributions")
def distributions(dataset: xr.Dataset) -> Iterator[Part]:
    """How each figure spreads, settles, and what it depends on."""
    if drawings := [*_samples(dataset)]:
        yield from drawings[_FIRST:]
        for name in _known(dataset):
            yield markup("<pre>{}</pre>", sweep_table.uncertainty(dataset, name, _PRECISION))


@block(BLOCKS, "Failed cases")
def failed(dataset: xr.Dataset) -> Iterator[Part]:
    """Which failed, and why."""
    places = np.argwhere(dataset["status"].values == FAILED)
    if not len(places):
        return
    dims, sampled = list(dataset.attrs["sizes"]), list(dataset.attrs["sampled"])
    errors = dataset["error"].values
    rows = []
    for place in places[:_MOST_ROWS]:
        at = dict(zip(dims, map(int, place), strict=True))
        row = [sweep_table.coordinate_text(dataset, d, k) for d, k in at.items()]
        for name in sampled:
            factor = sweep_table.scale(dataset, name)[0]
            row.append(f"{factor * float(dataset[name].values[at[SAMPLE]]):.4g}")
        rows.append([*row, str(errors[tuple(place)])])
    head = [*(sweep_table.label(dataset, d) for d in (*dims, *sampled)), "error"]
    yield Grid(head, rows, f"{len(places)} of {errors.size} cases", left=len(head))
    yield from _left_out(len(places) - len(rows))


@block(BLOCKS, "What was run")
def inputs(dataset: xr.Dataset) -> Iterator[Part]:
    """What was varied, and the scenario that each case changes."""
    yield Grid(["key", "value"], _inputs(dataset, True), left=2)
    scenario = Grid(["key", "value"], _inputs(dataset, False), left=2)
    yield Fold("The scenario that is changed", [scenario])


def _inputs(dataset: xr.Dataset, of_sweep: bool) -> list[tuple[str, str]]:
    """Keys and values of the scenario's table [sweep], or of all else, as the file has them."""
    inputs = []
    for key, text in dict(dataset.attrs["identity"]).items():
        with suppress(ValueError):
            value = json.loads(text)
            text = value if isinstance(value, str) else text
        if key.startswith("sweep.") == of_sweep:
            inputs.append((key, text))
    return inputs
