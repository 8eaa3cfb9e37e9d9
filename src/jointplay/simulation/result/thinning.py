"""Thinning: fewer records of a result, whose peaks cover the records left out."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import xarray as xr

_LARGEST, _SMALLEST, _STRONGEST = "normal_force_peak", "gap_min", "joint_force_peak"
"""Variables that cover the time since the last record: combined by the largest number, the smallest
number, or the longest vector."""
_AT_ONCE = 1 << 15
"""Number of records of a variable that are read at once, about."""
LARGE_FILE = 10_000_000
"""Size from which files are thinned for summaries; smaller ones are read whole [bytes]."""
SUMMARY_RECORDS = 50_000
"""Number of records of a long run that are read for its summary and figures, about."""


def thin(dataset: xr.Dataset, every: int, only: Collection[str] | None = None) -> xr.Dataset:
    """Each n-th record of a dataset and the last one, read a piece of a variable at a time.

    Variables that cover the time since the last record (``*_peak``, ``gap_min``) cover that since
    the last one kept. `only`: histories that are wanted, beside all that do not depend on time;
    None: all.
    """
    count = dataset.sizes["time"]
    rows = np.unique(np.append(np.arange(0, count, every), max(count - 1, 0)))[:count]
    begin = np.append(0, rows[:-1] + 1)[:count]
    wanted = [
        name
        for name, history in dataset.data_vars.items()
        if only is None or name in only or "time" not in history.dims
    ]
    read = {
        name: _read(str(name), dataset.variables[name], rows, begin, int(every))
        for name in (*wanted, *dataset.coords)
    }
    return xr.Dataset(
        {name: read[name] for name in wanted},
        {name: read[name] for name in dataset.coords},
        dict(dataset.attrs),
    )


def _read(
    name: str, variable: xr.Variable, rows: np.ndarray, begin: np.ndarray, every: int
) -> xr.Variable:
    """The records `rows` of a variable, each combined with those from its `begin` on."""
    if "time" not in variable.dims:
        return variable.copy(data=variable.values)
    shape = [len(rows) if dim == "time" else size for dim, size in variable.sizes.items()]
    values = np.empty(shape, variable.dtype)
    along = variable.get_axis_num("time")
    at_once = max(_AT_ONCE // every, 1)
    for first in range(0, len(rows), at_once):
        batch = slice(first, first + at_once)
        start, end = int(begin[batch][0]), int(rows[batch][-1]) + 1
        block = np.moveaxis(variable.isel(time=slice(start, end)).values, along, 0)
        part = _reduced(name, block, rows[batch] - start, begin[batch] - start)
        np.moveaxis(values, along, 0)[batch] = part
    return xr.Variable(variable.dims, values, variable.attrs)


def _reduced(name: str, block: np.ndarray, rows: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """The records `rows` of a piece of a variable, or combinations of those from `begin` on."""
    if name == _LARGEST:
        return np.asarray(np.fmax.reduceat(block, begin, axis=0))
    if name == _SMALLEST:
        return np.asarray(np.fmin.reduceat(block, begin, axis=0))
    if name != _STRONGEST:
        return block[rows]
    size = np.linalg.norm(block, axis=2)  # of vectors (n, joints, 3)
    longest = np.empty((len(begin), *block.shape[1:]))
    for i, (first, end) in enumerate(zip(begin, [*begin[1:], len(block)], strict=True)):
        at = first + size[first:end].argmax(axis=0)
        longest[i] = block[at, np.arange(block.shape[1])]
    return longest
