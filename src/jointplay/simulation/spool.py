"""Runs of any length in bounded memory: their records go to disk, or to a function, meanwhile.

The result file is made of them at the end, portion by portion. Until then they are plain numbers
behind one line that says whose they are. They can be cut to what a checkpoint knows of, while a
NetCDF file whose process was killed cannot be read any more; and no other file is taken for them.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation.result.audit import PORTION
from jointplay.simulation.result.variables import Records
from jointplay.simulation.working_files import RECORDS

PORTION_BYTES = 2 << 20
"""Size of the records in memory at once when histories are made of them [bytes]."""
MOST_BYTES = 32 << 20
"""Size of a run's records beyond which they go elsewhere, if they may [bytes]."""
RECORD_BYTES = 4 << 20
"""Size of the records of such a run that are in memory [bytes]."""


class Overflow(ABC):
    """Where a run's records go when memory has no more room for them.

    Args:
        workspace: the run's.
        records: number of records of the whole run.
        most: largest number of records in a stretch.

    Attributes:
        before_writing: called before records go elsewhere.
        needed: whether the run makes more records than memory shall hold.
    """

    def __init__(self, workspace: Workspace, records: int, most: int) -> None:
        self._workspace, self._most = workspace, most
        size = workspace.record.strides[0]
        room = max(RECORD_BYTES // size, 2 * most)
        self.before_writing: Callable[[], None] = lambda: None
        self.bytes = records * size
        self.needed = self.bytes > MOST_BYTES and records > room
        workspace.reserve_records(room if self.needed else records)

    def before_stretch(self) -> None:
        """Make room for the records of the next stretch."""
        w = self._workspace
        if self.needed and int(w.run["rows"][0]) - w.rows < self._most:
            self.empty()

    def empty(self) -> None:
        """Move all records out of memory.

        Raises:
            JointplayError: they cannot be written.
        """
        w = self._workspace
        if w.rows > w.kept_elsewhere:
            self.before_writing()
            self._take(w.record[: w.rows - w.kept_elsewhere])
            w.release_records()

    @abstractmethod
    def _take(self, records: np.ndarray) -> None:
        """Keep a copy of records, shape (n, columns), which are overwritten afterwards."""


class DiskRecords(Overflow):
    """Records that go to a file of their own, which is made when the first ones go there.

    Attributes:
        name: unique name of the run in its file of records; None before there is one.
        rows: number of records in the file.

    Raises:
        JointplayError: the path has a file that is none of records.
    """

    def __init__(self, path: Path, workspace: Workspace, records: int, most: int) -> None:
        files.check_own(path, RECORDS, "file of records")
        self.path, self.rows = path, 0
        self.name: str | None = None
        self._file: BinaryIO | None = None
        super().__init__(workspace, records, most)

    def _opened(self) -> BinaryIO:
        """The file, cut to the records that the workspace counts; another run's are replaced.

        Raises:
            JointplayError: the file is not of this kind, or of another run; it cannot be written,
                or holds fewer records.
        """
        if self._file is not None:
            return self._file
        path, self.rows = self.path, self._workspace.kept_elsewhere
        name = self.name or os.urandom(8).hex()
        self._head = head = RECORDS + name.encode() + b"\n"
        size = len(head) + self.rows * self._workspace.record.strides[0]
        files.check_own(path, RECORDS, "file of records")
        if self.name and files.is_file(path) and not files.begins(path, head):
            raise JointplayError(f"{str(path)!r} holds records of another run")
        if not files.begins(path, head) and not self.rows:
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
            self.close()
            raise JointplayError(
                f"{str(path)!r} is missing records of the run: it holds {length} bytes instead of "
                f"{size}"
            )
        self.name = name
        return self._file

    def _take(self, records: np.ndarray) -> None:
        file = self._opened()
        try:
            file.write(np.ascontiguousarray(records).data)
            file.flush()
        except OSError as error:
            with suppress(OSError):
                file.truncate(len(self._head) + self.rows * records[0].nbytes)
            raise files.cannot_write(self.path, error) from None
        self.rows += len(records)

    def write_to_disk(self, sync: bool = False) -> None:
        """Move all records to disk; with `sync` they survive a power failure.

        Raises:
            JointplayError: they cannot be written.
        """
        file = self._opened()
        self.empty()
        if sync:
            with suppress(OSError):
                os.fsync(file.fileno())

    def portions(self) -> Iterator[Records]:
        """All records in order, a portion in memory at a time."""
        w, file = self._workspace, self._opened()
        columns = w.record.shape[1]
        rows = max(PORTION_BYTES // (8 * columns) // PORTION, 1) * PORTION
        file.seek(len(self._head))
        for first in range(0, self.rows, rows):
            count = min(rows, self.rows - first)
            numbers = np.fromfile(file, np.float64, count * columns)
            yield Records(numbers.reshape(count, columns), w.fields, first)

    def close(self) -> None:
        if self._file is not None:
            with suppress(OSError):
                self._file.close()
        self._file = None

    def remove(self) -> None:
        """Delete the records on disk."""
        if self._file is not None:
            self.close()
            files.remove_own(self.path, self._head)


class PassedRecords(Overflow):
    """Records that are passed to a function, in portions from multiples of `audit.PORTION` on."""

    def __init__(
        self, taker: Callable[[Records], None], workspace: Workspace, records: int, most: int
    ) -> None:
        self._taker, self._passed = taker, 0
        self._left = np.empty((0, workspace.record.shape[1]))
        super().__init__(workspace, records, most)

    def _take(self, records: np.ndarray) -> None:
        self._left = np.concatenate([self._left, records])
        self._pass(len(self._left) // PORTION * PORTION)

    def _pass(self, count: int) -> None:
        if count:
            records = Records(self._left[:count], self._workspace.fields, self._passed)
            self._left, self._passed = self._left[count:], self._passed + count
            self._taker(records)

    def finish(self) -> None:
        """Pass the rest; what never left memory is one portion."""
        self.before_writing()
        w = self._workspace
        self._left = np.concatenate([self._left, w.record[: w.rows - w.kept_elsewhere]])
        self._pass(len(self._left))
