"""Runs of any length in bounded memory: their records go to disk while they run.

The result file is made of them at the end, portion by portion. Until then they are plain numbers:
a NetCDF file that its process was killed over cannot be read any more.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from jointplay.core import files
from jointplay.core.errors import JointplayError
from jointplay.kernel.workspace import Workspace
from jointplay.result.audit import PORTION
from jointplay.result.variables import Records
from jointplay.simulation.working_files import RECORDS

# Records of a run on disk, one after the other as they are made.
#
# A plain file of numbers behind one line that says whose it is: what a killed process has left
# can be cut to what a checkpoint knows of, and no other file is ever taken for it.


PORTION_BYTES = 2 << 20
"""Records that are in memory at once when histories are made of them [bytes]."""


class Spool:
    """A file of records.

    Args:
        path: the file; what it holds beyond `rows` is cut off. Another run's records are replaced.
        columns: numbers of a record.
        rows: records that it holds, of an earlier process.
        name: of the run, if it was begun by an earlier process.

    Attributes:
        name: of the run; no other has it.

    Raises:
        JointplayError: the file is not of this kind, or of another run than `name`; it cannot be
            written, or holds fewer records.
    """

    def __init__(self, path: Path, columns: int, rows: int = 0, name: str | None = None) -> None:
        """Open the file."""
        self.path, self._columns, self.rows = path, columns, rows
        self.name = name or secrets.token_hex(8)
        self._head = head = RECORDS + self.name.encode() + b"\n"
        size = len(head) + rows * columns * 8
        files.check_own(path, RECORDS, "file of records")
        if name is not None and files.is_file(path) and not files.begins(path, head):
            raise JointplayError(f"{str(path)!r} holds records of another run")
        if not files.begins(path, head) and not rows:
            # Gets its name with the mark in it: a file without is never one of ours.
            files.write(path, head, overwrite=files.begins(path, RECORDS), announced=False)
        try:
            self._file = path.open("r+b")
            length = self._file.seek(0, os.SEEK_END)
            if length >= size:
                self._file.truncate(size)
                self._file.seek(size)
        except (OSError, ValueError) as error:
            raise files.cannot_write(path, error) from None
        if length < size:
            self._file.close()
            raise JointplayError(
                f"{str(path)!r} is missing records of the run: it holds {length} bytes instead of "
                f"{size}"
            )

    def append(self, records: np.ndarray) -> None:
        """Append records, shape (n, columns).

        Raises:
            JointplayError: they cannot be written; the file is as it was.
        """
        try:
            self._file.write(np.ascontiguousarray(records).data)
            self._file.flush()
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(len(self._head) + self.rows * self._columns * 8)
            raise files.cannot_write(self.path, error) from None
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
        self._file.seek(len(self._head))
        for first in range(0, self.rows, rows):
            count = min(rows, self.rows - first)
            numbers = np.fromfile(self._file, np.float64, count * self._columns)
            yield Records(numbers.reshape(count, self._columns), fields, width, first)

    def close(self) -> None:
        """Let go of the file."""
        with suppress(OSError):
            self._file.close()

    def remove(self) -> None:
        """Delete the file."""
        self.close()
        files.remove_own(self.path, self._head)


MOST_BYTES = 32 << 20
"""A run whose records take more has them on disk, if it may [bytes]."""

RECORD_BYTES = 4 << 20
"""Of such a run so much is in memory [bytes]."""


class DiskRecords:
    """Where a run's records go when memory has no more room for them.

    Args:
        path: a file for them; it is made when the first ones go there.
        workspace: of the run.
        records: that the whole run makes.
        most: records of a stretch, at most.

    Attributes:
        path: as given.
        name: of the run in its file of records, if an earlier process has begun it.

    Raises:
        JointplayError: another file than one of records is there.
    """

    def __init__(self, path: Path, workspace: Workspace, records: int, most: int) -> None:
        """Make room in memory for some."""
        files.check_own(path, RECORDS, "file of records")
        self.path, self._workspace, self._most = path, workspace, most
        self.name: str | None = None
        self._spool: Spool | None = None
        size = workspace.record.strides[0]
        room = max(RECORD_BYTES // size, 2 * most)
        self.before_writing: Callable[[], None] | None = None
        """Called before records go to disk."""
        self.needed = records * size > MOST_BYTES and records > room
        """Whether the run makes more than memory is to hold."""
        workspace.reserve_records(room if self.needed else records)

    def before_stretch(self) -> None:
        """Make room for the records of a stretch."""
        w = self._workspace
        if self.needed and int(w.run["rows"][0]) - w.rows < self._most:
            self.write_to_disk()

    def write_to_disk(self, sync: bool = False) -> Spool:
        """Put all records on disk; `sync`: so that they survive a power failure.

        Raises:
            JointplayError: they cannot be written.
        """
        w = self._workspace
        if self._spool is None:
            self._spool = Spool(self.path, w.record.shape[1], w.kept_elsewhere, self.name)
        if w.rows > w.kept_elsewhere:
            if self.before_writing is not None:
                self.before_writing()
            self._spool.append(w.record[: w.rows - w.kept_elsewhere])
            w.release_records()
        if sync:
            self._spool.sync()
        return self._spool

    def remove(self) -> None:
        """Delete the records on disk."""
        if self._spool is not None:
            self._spool.remove()
        self._spool = None
