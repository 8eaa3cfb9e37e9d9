"""Time histories packed for the page: small, exact to float32, unpacked by `page/report.js`."""

from __future__ import annotations

import base64
import gzip

import numpy as np

MAX_RECORDS = 40_000
"""More records than this are reduced to the smallest and the largest of each of a series of
intervals, so that no peak is lost."""


class Pack:
    """Arrays in one compressed block; each is known by its number.

    Values are float32 or uint32, differences of consecutive bit patterns, bytes of equal weight
    together: smooth histories shrink to a fraction.
    """

    def __init__(self) -> None:
        """An empty block."""
        self.chunks: list[bytes] = []
        self.layout: list[tuple[str, int]] = []

    def add(self, values: np.ndarray) -> int:
        """Store a one-dimensional array, unsigned integers as uint32, others as float32."""
        whole = values.dtype.kind == "u"
        packed = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        bits = packed.view("<u4")
        steps = np.diff(bits, prepend=np.zeros(1, "<u4"))
        self.chunks.append(steps.view(np.uint8).reshape(-1, 4).T.tobytes())
        self.layout.append(("u" if whole else "f", len(values)))
        return len(self.layout) - 1

    def block(self) -> str:
        """The compressed block in base64."""
        return base64.b64encode(gzip.compress(b"".join(self.chunks), 6, mtime=0)).decode()


class Thinning:
    """How the records of one case are reduced to at most `MAX_RECORDS`.

    Args:
        sparse: which points are records of which there may be too many; the others, recorded step
            by step, are all kept.
    """

    def __init__(self, sparse: np.ndarray) -> None:
        """Divide the records into intervals."""
        self._records = np.flatnonzero(sparse)
        many = len(self._records) > MAX_RECORDS
        self.size = -(-2 * len(self._records) // MAX_RECORDS) if many else 1
        """Records in an interval."""
        kept = self._records
        if many:
            kept = np.union1d(kept[:: self.size], kept[self.size // 2 :: self.size])
        self.kept = np.union1d(kept, np.flatnonzero(~sparse))
        """Indices of the points that stay."""

    def extremes(self, values: np.ndarray) -> np.ndarray:
        """Values at `kept`, those of an interval being its smallest and largest, in their order."""
        if self.size == 1:
            return values[self.kept]
        found = values.copy()
        size, half = self.size, self.size // 2
        whole = len(self._records) // size * size
        inside = self._records[:whole].reshape(-1, size)
        drawn = values[inside]
        both = np.sort(np.column_stack([drawn.argmin(axis=1), drawn.argmax(axis=1)]), axis=1)
        rows = np.arange(len(inside))
        for place, at in ((0, both[:, 0]), (half, both[:, 1])):
            found[inside[:, place]] = drawn[rows, at]
        rest = self._records[whole:]
        if len(rest):
            ends = (int(values[rest].argmin()), int(values[rest].argmax()))
            first, second = sorted(ends) if len(rest) > half else (ends[1], ends[1])
            pair = values[rest][[first, second]]
            found[rest[0]] = pair[0]
            if len(rest) > half:
                found[rest[half]] = pair[1]
        return found[self.kept]
