"""Fewer records of a result, without losing what lay between them."""

from __future__ import annotations

import numpy as np

from jointplay.errors import JointplayError
from jointplay.result.result import Result

_LARGEST, _SMALLEST, _STRONGEST = ("normal_force_peak",), ("gap_min",), ("joint_force_peak",)
"""Variables that cover the time since the last record, by how two of them make one."""


def thinned(result: Result, every: int) -> Result:
    """Each n-th record and the last one.

    What covers the time since the last record (``*_peak``, ``gap_min``) covers that since the last
    one kept.

    Args:
        result: with all its records; it is not changed.
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
    dataset = result.dataset.isel(time=kept)
    for names, reduce in ((_LARGEST, np.fmax), (_SMALLEST, np.fmin)):
        for name in names:
            if name in dataset:
                values = reduce.reduceat(result[name].values, begin, axis=0)
                dataset[name] = dataset[name].copy(data=values)
    for name in _STRONGEST:
        if name in dataset:
            dataset[name] = dataset[name].copy(data=_strongest(result[name].values, begin))
    return Result(dataset, result.trust)


def _strongest(vectors: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """Of vectors (n, joints, 3) the longest in each stretch that begins at `begin`."""
    size = np.linalg.norm(vectors, axis=2)
    found = np.empty((len(begin), *vectors.shape[1:]))
    for i, (first, end) in enumerate(zip(begin, [*begin[1:], len(vectors)], strict=True)):
        at = first + size[first:end].argmax(axis=0)
        found[i] = vectors[at, np.arange(vectors.shape[1])]
    return found
