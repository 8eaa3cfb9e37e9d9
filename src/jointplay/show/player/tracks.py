"""From records to tracks: impacts are found, moments selected without losing one, tables packed."""

from __future__ import annotations

import zlib
from typing import Any, NamedTuple

import numpy as np

PROMINENCE = 0.05
"""Prominence from which a peak of the contact force is an impact, relative to the largest force."""
MOST_IMPACTS = 1000  # most impacts of a joint that the player offers, the strongest
BEFORE_S, AFTER_S = 1e-3, 5e-3
"""Time before and after an impact in which every record is kept, strongest impacts first [s]."""


class Impacts(NamedTuple):
    """Impacts of a joint, in the order of time."""

    records: np.ndarray  # number of each one's record, shape (n,)
    force: np.ndarray  # peak force of each, shape (n,) [N]


def impacts(force: np.ndarray) -> Impacts:
    """Peaks of a contact force, shape (n,) [N], that stand out by `PROMINENCE` of the largest.

    A journal that hits after free flight makes such a peak, and so does one that is knocked about
    without ever losing contact. The start of a run does not count.
    """
    largest = float(force.max(initial=0.0))
    if largest <= 0.0:
        return Impacts(np.zeros(0, int), np.zeros(0))
    # With a zero at each end, the last record may be a peak.
    at, prominence = peaks(np.concatenate([[0.0], force, [0.0]]))
    prominent = prominence >= PROMINENCE * largest
    at, prominence = at[prominent], prominence[prominent]
    strongest = np.sort(np.argsort(-prominence, kind="stable")[:MOST_IMPACTS])
    at = at[strongest] - 1
    at = at[at > 0]
    return Impacts(at, force[at])


def peaks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Peaks of a curve and their prominences, as by `scipy.signal.find_peaks`, whose import takes
    half as long as all of `jointplay play`.

    Returns:
        Index of the middle of each peak, and its prominence: the height above the higher one of the
        lowest points on its two sides, as far as the curve stays below the peak.
    """
    # Runs of equal values are one level each; a peak is a level higher than both neighbours.
    changes = np.concatenate([[True], values[1:] != values[:-1]])
    begin = np.flatnonzero(changes)
    level = values[begin]
    end = np.concatenate([begin[1:], [len(values)]]) - 1
    inner = np.arange(1, len(level) - 1)
    top = inner[(level[inner] > level[inner - 1]) & (level[inner] > level[inner + 1])]
    # The lowest point on each side, up to a higher peak: by a stack of higher peaks passed, each
    # with the lowest point before it; `valleys` are the lowest points between neighbouring peaks.
    low = np.empty((2, len(top)))
    valleys = np.minimum.reduceat(level, np.concatenate([[0], top])) if len(top) else level[:1]
    for side, order in enumerate((range(len(top)), range(len(top) - 1, -1, -1))):
        stack: list[tuple[float, float]] = []
        for k in order:
            deepest = float(valleys[k + side])
            while stack and stack[-1][0] <= level[top[k]]:
                deepest = min(deepest, stack.pop()[1])
            low[side, k] = deepest
            stack.append((float(level[top[k]]), deepest))
    return (begin[top] + end[top]) // 2, level[top] - low.max(axis=0)


def select_records(time: np.ndarray, hits: list[Impacts], budget: int) -> np.ndarray:
    """Numbers of the records to play, ascending: `budget` of them (at least 4), or all if they fit.

    First come the records of impacts, strongest first, up to a quarter of the budget; then all
    records around impacts, up to half; the rest are equally spaced, with the first and the last.
    """
    n = len(time)
    if n <= budget:
        return np.arange(n)
    kept = np.zeros(n, bool)
    records = np.concatenate([np.zeros(0, int), *(hit.records for hit in hits)])
    force = np.concatenate([np.zeros(0), *(hit.force for hit in hits)])
    order = records[np.argsort(-force, kind="stable")]
    kept[order[: budget // 4]] = True
    left = budget // 2 - int(kept.sum())
    for record in order:
        first = int(np.searchsorted(time, time[record] - BEFORE_S))
        end = int(np.searchsorted(time, time[record] + AFTER_S, side="right"))
        left -= end - first - int(kept[first:end].sum())
        if left < 0:
            break
        kept[first:end] = True
    grid = np.linspace(0.0, n - 1.0, max(budget - int(kept.sum()), 2))
    kept[np.round(grid).astype(int)] = True
    return np.flatnonzero(kept)


def strongest(values: np.ndarray, records: np.ndarray) -> np.ndarray:
    """For each kept record and each column of `values` (all, m), the number of the record of the
    largest value since the record kept before, shape (n, m)."""
    numbers = np.empty((len(records), values.shape[1]), int)
    begin = np.concatenate([[0], records[:-1] + 1])
    for i, (first, last) in enumerate(zip(begin, records, strict=True)):
        numbers[i] = first + (0 if first == last else values[first : last + 1].argmax(axis=0))
    return numbers


class Packer:
    """Packs tables of numbers into one compressed block, which `static/tracks.js` reads.

    Each column is rounded to multiples of its table's quantum, differenced along time and split
    into bytes of equal weight: most of them are then zero, which deflate makes short.
    """

    def __init__(self) -> None:
        self._places: dict[bytes, int] = {}  # in the block, of what was appended
        self._size = 0

    @property
    def block(self) -> bytes:
        """All that was appended, not compressed."""
        return b"".join(self._places)

    def raw(self, data: bytes) -> dict[str, Any]:
        """Append bytes unless the block has them already, and return their place for the reader."""
        if data not in self._places:
            self._places[data] = self._size
            self._size += len(data)
        return {"at": self._places[data], "bytes": len(data)}

    def integers(self, values: np.ndarray) -> dict[str, Any]:
        """Append numbers of 32 bits, split into bytes of equal weight."""
        return self.raw(values.view(np.uint8).reshape(-1, 4).T.tobytes())

    def table(self, values: np.ndarray, quantum: float) -> dict[str, Any]:
        """Append a table with a row for each moment, and return what the reader needs to decode it.

        Values (n,) or (n, columns) are rounded to `quantum`, or coarser if 32 bits are too few.
        """
        table = np.asarray(values, float).reshape(len(values), -1)
        largest = float(np.abs(table).max(initial=0.0))
        quantum = max(quantum, largest / 2**29)
        whole = np.round(table / quantum).astype(np.int64)
        change = np.diff(whole, axis=0, prepend=np.zeros((1, table.shape[1]), np.int64))
        # Zigzag: small numbers of either sign have their high bytes zero.
        zigzag = ((change << 1) ^ (change >> 63)).astype("<u4")
        entry = self.integers(np.ascontiguousarray(zigzag.T))
        return entry | {"rows": table.shape[0], "columns": table.shape[1], "quantum": quantum}

    def mesh(self, triangles: np.ndarray) -> dict[str, Any]:
        """Append the triangles of a surface whose points are in the order of their first use.

        A point's number is stored as its distance behind the next new point, which is mostly small.
        """
        used = triangles.reshape(-1).astype(np.int64)
        fresh = np.maximum.accumulate(np.concatenate([[-1], used[:-1]])) + 1
        return self.integers((fresh - used).astype("<u4")) | {"numbers": len(used)}

    def deflated(self) -> bytes:
        return zlib.compress(self.block, 6)
