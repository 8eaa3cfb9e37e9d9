"""Tables of a sweep's measures over its grid, and statistics of its samples."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import islice
from typing import Any

import numpy as np
import xarray as xr

from jointplay.base.errors import (
    JointplayError,
    MissingName,
    require_a,
    require_known,
    require_share,
)
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Column, Table, counted
from jointplay.base.units import convert, handy
from jointplay.simulation.analysis.uncertainty import (
    IntervalEstimate,
    SobolIndices,
    convergence,
    enough,
    interval_estimate,
    sobol_indices,
)
from jointplay.study.measures import BEARING, USER
from jointplay.study.store import FAILED, NOT_RUN
from jointplay.study.sweep_plan import REPEAT, SAMPLE

HEADLINE = (
    ("tool_error_rms_total", "µm", 1e6),
    ("tool_error_peak_total", "µm", 1e6),
    ("tool_error_stops_total", "µm", 1e6),
    ("peak_force", "N", 1.0),
    ("impacts", "", 1.0),
    ("dissipated_energy", "J", 1.0),
)
"""Measures of the table, with the units and factors of their columns."""


def points(dataset: xr.Dataset, rows: int, cell: Callable[[IntervalEstimate], Any]) -> Table:
    """Table of the first points of the grid; `cell` makes the entries from the estimate of the mean
    over repeats and samples.
    """
    dims, over = grid(dataset)
    columns = columns_of(dataset)
    head = [*(label(dataset, d) for d in dims), *(_head(*c[:2]) for c in columns)]
    values = [
        factor * measured(dataset, name).transpose(*dims, *over).values
        for name, _, factor in columns
    ]
    lines = []
    for index in islice(np.ndindex(*(dataset.sizes[d] for d in dims)), rows):
        where = [coordinate_text(dataset, d, k) for d, k in zip(dims, index, strict=True)]
        estimates = (interval_estimate(np.ravel(array[index])) for array in values)
        lines.append([*where, *map(cell, estimates)])
    return Table.of([(t, "") for t in head], lines)


def grid(dataset: xr.Dataset) -> tuple[list[str], list[str]]:
    """Dimensions of the grid, and the dimensions (samples, repeats) that are averaged over."""
    dims, repeated = list(dataset.attrs["sizes"]), (SAMPLE, REPEAT)
    return [d for d in dims if d not in repeated], [d for d in dims if d in repeated]


def table(dataset: xr.Dataset, rows: int = 20) -> str:
    """Text with the means at each point of the grid, failed cases, and the cost of the sweep."""
    status = dataset["status"].values
    dims, over = grid(dataset)
    count = math.prod(dataset.sizes[d] for d in dims)
    text = str(points(dataset, rows, lambda estimate: _text(estimate.value)))
    if over and count:
        runs = counted(math.prod(dataset.sizes[d] for d in over), "run")
        text += f"\nmeans over {runs} of each point"
    if count > rows:
        text += f"\n{count - rows} more points in the store"
    failed = np.argwhere(status == FAILED)
    if len(failed):
        text += f"\n{len(failed)} of {status.size} cases failed; the first: "
        text += str(dataset["error"].values[tuple(failed[0])])
    cost = float(np.nansum(dataset["cost"].values)) if "cost" in dataset else 0.0
    return (
        f"{text}\n{int(np.count_nonzero(status != NOT_RUN))} cases, {cost:.3g} s of processor time"
    )


def varied_keys(dataset: xr.Dataset) -> set[str]:
    """Keys of the scenario that the axes change; an axis without a key is named like its key."""
    keys: set[str] = set()
    for name, axis in json.loads(dataset.attrs["sweep"])["axes"].items():
        table = axis if isinstance(axis, dict) else {}
        named = table.get("keys", table.get("key", name))
        if variants := table.get("variants"):
            named = [key for changes in variants.values() for key in changes]
        keys |= {named} if isinstance(named, str) else {*named}
    return keys


def columns_of(dataset: xr.Dataset) -> list[tuple[str, str, float]]:
    """Name, unit, and factor from SI to it, of the table's measures, the user's own last."""
    users = [
        (name, str(dataset[name].attrs.get("units", "")), 1.0)
        for name in _measures(dataset)
        if dataset[name].attrs.get("origin") == USER
    ]
    return [column for column in (*HEADLINE, *users) if column[0] in dataset]


def _measures(dataset: xr.Dataset) -> list[str]:
    dims = tuple(dataset.attrs["sizes"])
    return [str(n) for n, v in dataset.data_vars.items() if v.dims == dims and v.dtype.kind == "f"]


def measured(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A measure of the sweep.

    Raises:
        MissingName: there is none of the name.
        JointplayError: it is of a rolling bearing, and no case has one in that joint.
    """
    names = _measures(dataset)
    if name not in names:
        if any(name == base or name.startswith(f"{base}_") for base in BEARING):
            having = [base for base in names if base.startswith(tuple(BEARING))]
            raise JointplayError(
                f"no measure {name!r}: it is of rolling bearings; "
                + (f"this sweep has {', '.join(having)}" if having else "this sweep has none")
            )
        raise MissingName("measure", name, names)
    return dataset[name]


def scale(dataset: xr.Dataset, name: str) -> tuple[float, str]:
    """Factor and unit in which the values of a coordinate or measure are easy to read."""
    unit = str(dataset[name].attrs.get("units", "")).removesuffix("1") if name in dataset else ""
    if name not in dataset or dataset[name].dtype.kind not in "fi":
        return 1.0, ""
    values = np.abs(dataset[name].values.astype(float))
    size, symbol = handy(float(np.nanmax(values, initial=0.0)), unit)
    return 1.0 / size, symbol


def label(dataset: xr.Dataset, name: str) -> str:
    """Name and unit of a coordinate or measure."""
    return _head(name, scale(dataset, name)[1])


def _head(name: str, unit: str) -> str:
    text = name.replace("_", " ")
    return f"{text} [{unit}]" if unit and unit != "1" else text


def coordinate_text(dataset: xr.Dataset, name: str, index: int) -> str:
    """Text of a coordinate's value at an index, in the unit of `scale`."""
    if name not in dataset.coords:
        return str(index)
    value: Any = dataset[name].values[index]
    if isinstance(value, str):
        return value
    return _text(float(value) * scale(dataset, name)[0])


def _text(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{value:.4g}"


def select(dataset: xr.Dataset, only: Mapping[str, str]) -> xr.Dataset:
    """The part of a sweep at, or nearest to, given values of some dimensions.

    Raises:
        JointplayError: no such dimension or value.
    """
    for name, text in only.items():
        require_known("dimension", name, dataset.attrs["sizes"])
        labelled = name in dataset.coords
        coordinates = dataset[name].values if labelled else np.arange(dataset.sizes[name])
        if labelled and coordinates.dtype.kind in "fi":
            unit = str(dataset[name].attrs.get("units", ""))
            quantity: Any = text
            with suppress(ValueError):  # a plain number is in SI
                quantity, unit = float(text), ""
            try:
                index = int(np.abs(coordinates - float(convert(quantity, unit))).argmin())
            except ValueError as error:
                raise JointplayError(f"{name}: {error}") from None
        else:
            labels = [str(value) for value in coordinates]
            require_known(f"value of {name}:", text, labels)
            index = labels.index(text)
        dataset = dataset.isel({name: [index]})
    return dataset


# Statistics of a measure over the samples of a sweep.


QUANTILES = (0.05, 0.5, 0.95, 0.99)
"""Quantiles that `uncertainty` gives."""


def samples_of(dataset: xr.Dataset, measure: str) -> np.ndarray:
    """Independent values of a measure in the order of the samples.

    In a Saltelli design only the points of its two base samples are independent; repeats are
    averaged, as runs of the same point are not independent samples.

    Raises:
        JointplayError: no such measure; nothing is sampled; there is a grid besides the samples.
    """
    values = measured(dataset, measure)
    grid = [str(d) for d in values.dims if d not in (SAMPLE, REPEAT) and values.sizes[d] > 1]
    if grid:
        raise JointplayError(
            f"the sweep also has a grid ({', '.join(grid)}); select one point of it with "
            "jointplay.open_sweep(...).dataset().isel(...)"
        )
    if SAMPLE not in values.dims and REPEAT not in values.dims:
        raise JointplayError("this sweep has neither samples nor repeats")
    if SAMPLE in values.dims and REPEAT in values.dims:
        values = values.mean(REPEAT)
    flat = values.values.ravel()
    if dataset.attrs["sampling"] == "saltelli" and dataset.attrs["sampled"]:
        block = len(dataset.attrs["sampled"]) + 2
        return flat.reshape(-1, block)[:, [0, -1]].ravel()
    return flat


def indices_of(dataset: xr.Dataset, measure: str) -> SobolIndices | None:
    """Sobol indices of a measure; None if the design of the samples does not give them.

    Raises:
        JointplayError: a case has no value, or SALib is not installed.
    """
    if dataset.attrs["sampling"] != "saltelli" or not dataset.attrs["sampled"]:
        return None
    values = measured(dataset, measure)
    if REPEAT in values.dims:
        values = values.mean(REPEAT)
    return sobol_indices(values.values.ravel(), tuple(dataset.attrs["sampled"]))


@known_keywords
def uncertainty(dataset: xr.Dataset, measure: str, precision: float) -> str:
    """Text with a measure's mean, standard deviation, quantiles, how many runs would be enough, and
    Sobol indices.

    `precision` is the relative half width of the confidence interval that counts as enough.

    Raises:
        JointplayError: see `samples_of`.
    """
    require_a("dataset", dataset, "Dataset")
    precision = require_share("precision", precision)
    values = samples_of(dataset, measure)
    known = int(np.isfinite(values).sum())
    estimates = {name: interval_estimate(values, name) for name in ("mean", "std")}
    estimates |= {f"{100 * p:g} %": interval_estimate(values, "quantile", p) for p in QUANTILES}
    notes = []
    for label, name, probability in (("mean", "mean", 0.5), ("95 % quantile", "quantile", 0.95)):
        runs = enough(convergence(values, name, probability), precision)
        verdict = (
            f"{counted(runs, 'run was', 'runs were')} enough"
            if runs
            else f"{counted(known, 'run is', 'runs are')} not enough"
        )
        notes.append(f"{label} within {100 * precision:g} %: {verdict}")
    missing = f", {len(values) - known} without a value" if known < len(values) else ""
    unit, several = str(dataset[measure].attrs.get("units", "")), estimates.values()
    fine = unit == "m"  # only lengths are shown in finer units
    statistics = Table(
        (
            Column(f"{known} samples{missing}", list(estimates)),
            Column(measure, [estimate.value for estimate in several], unit, fine=fine, digits=4),
            Column("95 %: from", [estimate.low for estimate in several], unit, fine=fine, digits=4),
            Column("to", [estimate.high for estimate in several], unit, fine=fine, digits=4),
        ),
        notes=notes,
    )
    try:
        indices = indices_of(dataset, measure)
    except JointplayError as error:
        return f"{statistics}\nno Sobol indices: {error}"
    sobol = "" if indices is None else f"\nSobol indices, shares of the variance\n{indices.table}"
    return f"{statistics}{sobol}"
