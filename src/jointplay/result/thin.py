"""Fewer records of a result, without losing what lay between them."""

from __future__ import annotations

import numpy as np
import xarray as xr

from jointplay.errors import JointplayError
from jointplay.result.result import Result

_LARGEST, _SMALLEST, _STRONGEST = ("normal_force_peak",), ("gap_min",), ("joint_force_peak",)
"""Variables that cover the time since the last record, by how two of them make one."""


_AT_ONCE = 1 << 15
"""Records that are read at once, about."""


def thinned(result: Result, every: int) -> Result:
    """Each n-th record and the last one.

    What covers the time since the last record (``*_peak``, ``gap_min``) covers that since the last
    one kept.

    Args:
        result: with all its records, in memory or opened lazily; it is not changed.
        every: n, at least 1.

    Raises:
        JointplayError: `every` is no whole number from 1 on.
    """
    if isinstance(every, bool) or not isinstance(every, int | np.integer) or every < 1:
        raise JointplayError(f"every must be a whole number from 1 on, got {every!r}")
    count = result.dataset.sizes["time"]
    if every == 1 or count < 2:
        return result
    kept = np.unique(np.append(np.arange(0, count, every), count - 1))
    begin = np.append(0, kept[:-1] + 1)
    at_once = max(_AT_ONCE // int(every), 1)
    parts = []
    for first in range(0, len(kept), at_once):
        here = slice(first, first + at_once)
        start, end = int(begin[here][0]), int(kept[here][-1]) + 1
        block = result.dataset.isel(time=slice(start, end)).load()
        parts.append(_reduced(block, kept[here] - start, begin[here] - start))
    over_time = [name for name, values in result.dataset.items() if "time" in values.dims]
    dataset = xr.concat(parts, "time", data_vars=over_time) if len(parts) > 1 else parts[0]
    dataset.attrs = dict(result.dataset.attrs)
    return Result(dataset, result.trust)


def _reduced(block: xr.Dataset, kept: np.ndarray, begin: np.ndarray) -> xr.Dataset:
    """The records `kept`, each with what happened from the one at `begin` on."""
    dataset = block.isel(time=kept)
    for names, reduce in ((_LARGEST, np.fmax), (_SMALLEST, np.fmin)):
        for name in names:
            if name in dataset:
                values = reduce.reduceat(block[name].values, begin, axis=0)
                dataset[name] = dataset[name].copy(data=values)
    for name in _STRONGEST:
        if name in dataset:
            dataset[name] = dataset[name].copy(data=_strongest(block[name].values, begin))
    return dataset


def _strongest(vectors: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """Of vectors (n, joints, 3) the longest in each stretch that begins at `begin`."""
    size = np.linalg.norm(vectors, axis=2)
    longest = np.empty((len(begin), *vectors.shape[1:]))
    for i, (first, end) in enumerate(zip(begin, [*begin[1:], len(vectors)], strict=True)):
        at = first + size[first:end].argmax(axis=0)
        longest[i] = vectors[at, np.arange(vectors.shape[1])]
    return longest
