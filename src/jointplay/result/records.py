"""Records that a run left, whole or a portion of them, wherever they are kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Records:
    """Some consecutive records.

    `Workspace.recorded` says what their columns are.
    """

    rows_of: np.ndarray
    """A record each, shape (n, columns)."""
    fields: Mapping[str, slice]
    """Columns by name."""
    width: int
    """Places for contacts of each joint."""
    first: int = 0
    """Records of the run that come before."""

    @property
    def rows(self) -> int:
        """How many there are."""
        return len(self.rows_of)

    def recorded(self, name: str) -> np.ndarray:
        """Columns `name`, shape (n, width of it)."""
        return self.rows_of[:, self.fields[name]]

    def part(self, begin: int, end: int) -> Records:
        """Those from `begin` to `end`, counted from the first one here."""
        return Records(self.rows_of[begin:end], self.fields, self.width, self.first + begin)

    def parts(self, size: int) -> Iterator[Records]:
        """All of them, `size` at a time; at least one part."""
        for begin in range(0, max(self.rows, 1), size):
            yield self.part(begin, begin + size)
