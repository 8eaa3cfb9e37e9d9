"""Time histories packed for the page: small, unpacked by `page/report.js`."""

from __future__ import annotations

import base64
import gzip

import numpy as np

MAX_RECORDS = 40_000
"""More records than this are reduced to the smallest and the largest of each of a series of
intervals, so that no peak is lost."""

EXACT = 23
"""Bits of a float32's mantissa."""


class Pack:
    """Arrays in one compressed block; each is known by its number.

    Values are float32 or uint32, differences of consecutive bit patterns, bytes of equal weight
    together: smooth histories shrink to a fraction.
    """

    def __init__(self) -> None:
        """An empty block."""
        self.chunks: list[bytes] = []
        self.layout: list[tuple[str, int]] = []

    def add(self, values: np.ndarray, bits: int = EXACT) -> int:
        """Store a one-dimensional array, unsigned integers as uint32, others as float32.

        Args:
            values: what to store.
            bits: of the mantissa that are kept, by rounding; the relative error is 2^-(bits + 1).
        """
        whole = values.dtype.kind == "u"
        packed = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        pattern = packed.view("<u4")
        if not whole and bits < EXACT:
            spare = EXACT - bits
            rounded = (pattern + np.uint32(1 << (spare - 1))) & ~np.uint32((1 << spare) - 1)
            pattern = np.where(np.isfinite(packed), rounded, pattern).astype("<u4")
        steps = np.diff(pattern, prepend=np.zeros(1, "<u4"))
        self.chunks.append(steps.view(np.uint8).reshape(-1, 4).T.tobytes())
        self.layout.append(("u" if whole else "f", len(values)))
        return len(self.layout) - 1

    def block(self) -> str:
        """The compressed block in base64."""
        return base64.b64encode(gzip.compress(b"".join(self.chunks), 6, mtime=0)).decode()


class Thinning:
    """How the records of one case are reduced to about `MAX_RECORDS`.

    Args:
        sparse: which points are records of which there may be too many; the others, recorded step
            by step, are all kept.
    """

    def __init__(self, sparse: np.ndarray) -> None:
        """Divide the records into intervals."""
        records = np.flatnonzero(sparse)
        self.size = max(1, -(-2 * len(records) // MAX_RECORDS))
        """Records in an interval; one: nothing is left out."""
        self._step_by_step = np.flatnonzero(~sparse)
        self._intervals = np.split(records, range(self.size, len(records), self.size))
        self.thins = self.size > 2
        """Whether anything is left out."""

    def kept(self, values: np.ndarray) -> np.ndarray:
        """Indices that stay of `values`: of each interval those of the smallest and the largest."""
        if not self.thins:
            return np.arange(len(values))
        indices = [self._step_by_step]
        for interval in self._intervals:
            inside = values[interval]
            indices.append(interval[[int(inside.argmin()), int(inside.argmax())]])
        return np.unique(np.concatenate(indices))
