"""Runs of any length in bounded memory: their records go to disk while they run.

The result file is made of them at the end, portion by portion. Until then they are plain numbers:
a NetCDF file that its process was killed over cannot be read any more.
"""

from __future__ import annotations

import os
import secrets
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.physics.kernel.layout import Quantity
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation.result.audit import PORTION
from jointplay.simulation.result.variables import Records
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
        with suppress(OSError):
            os.fsync(self._file.fileno())

    def portions(self, fields: Mapping[str, Quantity]) -> Iterator[Records]:
        """All records in order, a portion in memory at a time.

        Args:
            fields: see `Records`.
        """
        rows = max(PORTION_BYTES // (8 * self._columns) // PORTION, 1) * PORTION
        self._file.seek(len(self._head))
        for first in range(0, self.rows, rows):
            count = min(rows, self.rows - first)
            numbers = np.fromfile(self._file, np.float64, count * self._columns)
            yield Records(numbers.reshape(count, self._columns), fields, first)

    def close(self) -> None:
        with suppress(OSError):
            self._file.close()

    def remove(self) -> None:
        self.close()
        files.remove_own(self.path, self._head)


MOST_BYTES = 32 << 20
"""Records of a run that take more do not stay in memory, if they may go elsewhere [bytes]."""

RECORD_BYTES = 4 << 20
"""Of such a run so much is in memory [bytes]."""


class Overflow(ABC):
    """Where a run's records go when memory has no more room for them.

    Args:
        workspace: of the run.
        records: that the whole run makes.
        most: records of a stretch, at most.

    Attributes:
        before_writing: called before records go elsewhere.
        needed: whether the run makes more than memory is to hold.
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
        w = self._workspace
        if self.needed and int(w.run["rows"][0]) - w.rows < self._most:
            self.empty()

    def empty(self) -> None:
        """Take all records out of memory.

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
        """Keep records, shape (n, columns), which are gone afterwards."""


class DiskRecords(Overflow):
    """Records that go to a file.

    Args:
        path: a file for them; it is made when the first ones go there.
        workspace, records, most: see `Overflow`.

    Attributes:
        path: as given.
        name: of the run in its file of records, if an earlier process has begun it.

    Raises:
        JointplayError: another file than one of records is there.
    """

    def __init__(self, path: Path, workspace: Workspace, records: int, most: int) -> None:
        files.check_own(path, RECORDS, "file of records")
        self.path = path
        self.name: str | None = None
        self._spool: Spool | None = None
        super().__init__(workspace, records, most)

    def _take(self, records: np.ndarray) -> None:
        self._opened().append(records)

    def _opened(self) -> Spool:
        w = self._workspace
        if self._spool is None:
            self._spool = Spool(self.path, w.record.shape[1], w.kept_elsewhere, self.name)
        return self._spool

    def write_to_disk(self, sync: bool = False) -> Spool:
        """Put all records on disk; `sync`: so that they survive a power failure.

        Raises:
            JointplayError: they cannot be written.
        """
        spool = self._opened()
        self.empty()
        if sync:
            spool.sync()
        return spool

    def remove(self) -> None:
        if self._spool is not None:
            self._spool.remove()
        self._spool = None


class PassedRecords(Overflow):
    """Records that are passed to a function, in order, and then forgotten.

    Args:
        taker: is given portions that begin at multiples of `audit.PORTION`.
        workspace, records, most: see `Overflow`.
    """

    def __init__(
        self, taker: Callable[[Records], None], workspace: Workspace, records: int, most: int
    ) -> None:
        self._taker, self._passed = taker, 0
        self._left = np.empty((0, workspace.record.shape[1]))
        super().__init__(workspace, records, most)

    def _take(self, records: np.ndarray) -> None:
        self._left = np.concatenate([self._left, records]) if len(self._left) else records.copy()
        self._pass(len(self._left) // PORTION * PORTION)

    def _pass(self, count: int) -> None:
        if count:
            w = self._workspace
            given = Records(self._left[:count], w.fields, self._passed)
            self._left, self._passed = self._left[count:], self._passed + count
            self._taker(given)

    def finish(self) -> None:
        """Pass the rest; what never left memory is one portion."""
        self.before_writing()
        w = self._workspace
        rest = w.record[: w.rows - w.kept_elsewhere]
        self._left = np.concatenate([self._left, rest]) if len(self._left) else rest
        self._pass(len(self._left))
