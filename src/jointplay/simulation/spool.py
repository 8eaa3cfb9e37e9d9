"""Records of a run on disk, one after the other as they are made.

A plain file of numbers: what a killed process has left can be cut to what a checkpoint knows of.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from jointplay.errors import JointplayError
from jointplay.host.files import cannot_write
from jointplay.result.auditor import PORTION
from jointplay.result.records import Records

PORTION_BYTES = 2 << 20
"""Records that are in memory at once when histories are made of them [bytes]."""


class Spool:
    """A file of records.

    Args:
        path: the file; what it holds beyond `rows` is cut off.
        columns: numbers of a record.
        rows: records that it holds, of an earlier process.

    Raises:
        JointplayError: it cannot be written, or holds fewer records.
    """

    def __init__(self, path: Path, columns: int, rows: int = 0) -> None:
        """Open the file."""
        self.path, self._columns, self.rows = path, columns, rows
        size = rows * columns * 8
        try:
            self._file = path.open("r+b" if rows else "w+b")
            length = self._file.seek(0, os.SEEK_END)
            if length >= size:
                self._file.truncate(size)
                self._file.seek(size)
        except (OSError, ValueError) as error:
            raise cannot_write(path, error) from None
        if length < size:
            self._file.close()
            raise JointplayError(
                f"{str(path)!r} lacks records of the run: it holds {length} bytes, not {size}"
            )

    def take(self, records: np.ndarray) -> None:
        """Append records, shape (n, columns).

        Raises:
            JointplayError: they cannot be written; the file is as it was.
        """
        try:
            self._file.write(np.ascontiguousarray(records).data)
            self._file.flush()
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self.rows * self._columns * 8)
            raise cannot_write(self.path, error) from None
        self.rows += len(records)

    def sync(self) -> None:
        """Have all records survive a power failure."""
        with suppress(OSError):
            os.fsync(self._file.fileno())

    def portions(self, fields: Mapping[str, slice], width: int) -> Iterator[Records]:
        """All records in order, a portion in memory at a time.

        Args:
            fields, width: see `Records`.
        """
        rows = max(PORTION_BYTES // (8 * self._columns) // PORTION, 1) * PORTION
        with self.path.open("rb") as file:
            for first in range(0, self.rows, rows):
                count = min(rows, self.rows - first)
                numbers = np.fromfile(file, np.float64, count * self._columns)
                yield Records(numbers.reshape(count, self._columns), fields, width, first)

    def close(self) -> None:
        """Let go of the file."""
        with suppress(OSError):
            self._file.close()

    def remove(self) -> None:
        """Delete the file."""
        self.close()
        self.path.unlink(missing_ok=True)
