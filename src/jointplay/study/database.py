"""Files of SQLite with a row for each case, each row with its checksum, and a description.

Any tool can read the file: table ``cases`` has a row for each case, table ``about`` a JSON text,
twice. SQLite itself finds one flipped bit in ten, so each row has a checksum of its content and of
the file's random number; rows that do not match are not read.

Rows are only added, one at a time, each atomically. While the file is written there is a
write-ahead log beside it; if the process is killed nothing is lost, and after a power failure at
most what is younger than `SYNC_S`.

A stranger's file runs nothing and opens no other file: before a row is read its schema must be, to
the letter, what `Rows` makes, so there are no views, triggers or virtual tables; extensions are
off; and a rollback journal that names another file, which SQLite would delete, is refused.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import secrets
import sqlite3
import stat
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, damaged

FILE = "cases.sqlite"
"""Name of the file within the folder of a sweep."""
FORMAT = 5
"""Version of the format."""
KINDS = {"REAL": "float64", "INTEGER": "int64", "BOOLEAN": "bool", "TEXT": "object"}
"""Types of columns, and of the arrays that hold them."""
MOST_COLUMNS = 1990
"""Most columns: ten fewer than SQLite is built for by default."""
MOST_BYTES = 1 << 28
"""Most bytes of a text."""
AT_ONCE = 4096
"""Rows that are read together."""
SYNC_S = 1.0
"""Time between synchronisations with the disk: the most that a power failure can take [s]."""
LOCKED_S = 30.0
"""Time for which another program may hold the file before that is an error [s]."""
_SEAL_BYTES = 8
"""Length of a checksum: one change in 2⁶⁴ would go unnoticed."""
_SUPER = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
"""End of a rollback journal that names another file (SQLite's file format, section 3)."""
_OTHER_TYPE = ValueError, TypeError, OverflowError
"""Errors raised by a value that its column cannot have."""
_UNREADABLE = (sqlite3.Error, UnicodeDecodeError)
"""Errors raised by a damaged file; the second where SQLite's message quotes its bytes."""
_ABOUT = "CREATE TABLE about (content TEXT, checksum TEXT)"
"""Schema of the table of descriptions."""


@dataclass(frozen=True)
class Column:
    """A column of the table: its name, type (of `KINDS`), unit, meaning and origin."""

    name: str
    kind: str = "REAL"
    unit: str = ""
    text: str = ""
    origin: str = ""


def is_there(folder: Path, go_on: bool) -> bool:
    """Whether a folder has a sweep already.

    Raises:
        JointplayError: it has, and is not to be continued (`go_on`); or it holds other files.
    """
    present = files.is_file(folder / FILE)
    if present and not go_on:
        raise JointplayError(
            f"{str(folder)!r} exists; continue it with --resume, or choose another name"
        )
    if not present and files.is_folder(folder):
        for file in folder.iterdir():
            # A killed process may have left such a part.
            if not (file.name.startswith(f".{FILE}.") and file.suffix == ".part"):
                raise JointplayError(
                    f"{str(folder)!r} is a folder that holds other files; choose another name"
                )
    return present


def identifiers(columns: Sequence[Column]) -> list[str]:
    """Names of columns in SQL, quoted, and distinct without regard to case, as SQLite wants."""
    used, names = {"place", "checksum"}, []
    for column in columns:
        name, number = column.name, 1
        while name.lower() in used:
            number += 1
            name = f"{column.name} ({number})"
        used.add(name.lower())
        names.append('"{}"'.format(name.replace('"', '""')))
    return names


def _declared(columns: Sequence[Column]) -> list[str]:
    return [
        f"{name} {column.kind}" for name, column in zip(identifiers(columns), columns, strict=True)
    ]


def _cases(columns: Sequence[Column]) -> str:
    """Schema of the table of cases."""
    return f"CREATE TABLE cases ({', '.join(['place TEXT', 'checksum BLOB', *_declared(columns)])})"


class Rows:
    """A file of cases.

    A row has a place, a text that no other row has, and a value for each column; missing numbers
    (``REAL``) are NaN.

    Args:
        path: the file, which must exist; `make` creates it.
        write: whether it is written to, by this process alone.
        noun: what the file is called in messages.

    Attributes:
        about: description of the file, plain data.
        columns: columns of the table, without place and checksum.
        intact: whether all that has been read so far was undamaged.

    Raises:
        JointplayError: it cannot be read, is damaged, or is another kind of file.
    """

    def __init__(self, path: Path, write: bool = False, noun: str = "sweep") -> None:
        self.path, self._noun, self._write = path, noun, write
        self._synced = time.monotonic()
        self._open()

    @classmethod
    def make(
        cls, path: Path, about: Mapping[str, Any], columns: Sequence[Column], noun: str = "sweep"
    ) -> Rows:
        """Create a file without cases, and open it for writing."""
        content = _content({**about, "store": secrets.token_hex(16)}, columns)
        with closing(sqlite3.connect(":memory:", isolation_level=None)) as fresh:
            fresh.execute(_ABOUT)
            fresh.execute(_cases(columns))
            for _ in range(2):
                fresh.execute("INSERT INTO about VALUES (?, ?)", (content, _checksum(content)))
            files.write(path, fresh.serialize(), overwrite=True, announced=False)
        return cls(path, write=True, noun=noun)

    def _open(self) -> None:
        self._check_files()
        # A journal is left by a process that was killed while writing: SQLite then has to repair
        # the file, for which it must be open for writing.
        mode = "rw" if self._write or os.path.lexists(f"{self.path}-journal") else "ro"
        if not self._write and self._is_without_its_log():  # SQLite would make files beside it
            mode += "&immutable=1"
        self.intact = True
        with self._errors():
            self.connection = sqlite3.connect(
                f"{self.path.absolute().as_uri()}?mode={mode}", LOCKED_S, isolation_level=None,
                uri=True,
            )  # fmt: skip
            try:
                self.connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
                for pragma in ("trusted_schema=OFF", "cell_size_check=ON", "mmap_size=0"):
                    self.connection.execute(f"PRAGMA {pragma}")
                if not self._write:
                    self.connection.execute("PRAGMA query_only=ON")
                    self.connection.execute("BEGIN")  # one state of the file for all reading
                self._read_about()
                if self._write:
                    self.connection.execute("PRAGMA journal_mode=WAL")
                    self.connection.execute("PRAGMA synchronous=NORMAL")
            except BaseException:
                self.connection.close()
                raise

    def _check_files(self) -> None:
        """Raise a JointplayError if a file is not regular, or would have SQLite touch another."""
        for ending in ("", "-wal", "-shm", "-journal"):
            file = self.path.with_name(self.path.name + ending)
            with files.system_errors(f"cannot read {str(file)!r}"):
                if not os.path.lexists(file):
                    continue
                if not stat.S_ISREG(file.lstat().st_mode):
                    raise damaged(file, self._noun, "it is not a regular file")
                if ending == "-journal" and file.read_bytes().endswith(_SUPER):
                    raise damaged(file, self._noun, "it names another file")

    def _is_without_its_log(self) -> bool:
        """Whether the header says that a write-ahead log is in use, and there is none."""
        with files.system_errors(f"cannot read {str(self.path)!r}"), self.path.open("rb") as file:
            header = file.read(20)
        log = self.path.with_name(f"{self.path.name}-wal")
        return header[18:] == b"\2\2" and not os.path.lexists(log)

    def _read_about(self) -> None:
        """Read the description, from the first of its two copies that is intact."""
        # Nothing of a file is read before its schema is found to be that of `make`, first of the
        # description, then, with the columns that this declares, of the cases.
        execute = self.connection.execute
        schema = execute("SELECT type, sql FROM sqlite_master ORDER BY rowid").fetchmany(3)
        content = None
        for number in (1, 2):
            row = None
            with suppress(sqlite3.DatabaseError):
                row = execute(
                    "SELECT content, checksum FROM about WHERE rowid = ?", (number,)
                ).fetchone() if schema[:1] == [("table", _ABOUT)] else None  # fmt: skip
            if row and isinstance(row[0], str) and _checksum(row[0]) == row[1]:
                content = content or row[0]
            else:
                self.intact = False
        if content is None:
            raise damaged(self.path, self._noun, "its description does not match its checksum")
        try:
            self.about: dict[str, Any] = json.loads(content)
            declared = self.about.pop("columns")
            self.columns = [Column(*c) for c in declared]
            self._store = str(self.about["store"])
            version = self.about.pop("format")
            texts = [text for c in self.columns for text in astuple(c)]
            good = all(isinstance(text, str) and text.isprintable() for text in texts)
            good = good and all(c.kind in KINDS for c in self.columns)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise damaged(self.path, self._noun, error) from None
        if version != FORMAT:
            reason = f"it has the format {version!r:.20}; this version reads {FORMAT} only"
            raise damaged(self.path, self._noun, reason)
        if not good or schema[1:] != [("table", _cases(self.columns))]:
            raise damaged(self.path, self._noun, "its tables are not those of a sweep")

    # ---- Read -----------------------------------------------------------------------------------

    def blocks(self, most: int) -> Iterator[tuple[list[str], dict[str, np.ndarray]]]:
        """Yield the places of some rows at a time, and their values by column.

        Args:
            most: largest number of rows that the file can have.

        Raises:
            JointplayError: a row is damaged. If the file is open for writing, such rows are left
                out instead, and `intact` becomes false.
        """
        seen: set[str] = set()
        for rows in self._read(most):
            try:
                places, columns, good = self._checked(rows)
            except _OTHER_TYPE:  # a value of some row has another type: check row by row
                typed = [row for row in rows if self._is_good(row)]
                self._report_damage("a row has a value of another type")
                if not typed:
                    continue
                places, columns, good = self._checked(typed)
            indices = []
            for k, (place, is_good) in enumerate(zip(places, good, strict=True)):
                if is_good and place not in seen:
                    seen.add(place)
                    indices.append(k)
                    continue
                self._report_damage(
                    f"the row of case {place!r:.60} does not match its checksum, or is there twice"
                )
            if len(indices) == len(places):
                yield places, columns
            elif indices:
                some = {name: c[indices] for name, c in columns.items()}
                yield [places[k] for k in indices], some

    def _report_damage(self, reason: str) -> None:
        self.intact = False
        if not self._write:
            raise JointplayError(
                f"{damaged(self.path, self._noun, reason)}; --resume runs what is damaged again"
            )

    def _read(self, most: int) -> Iterator[list[Any]]:
        """Yield rows unchecked, some at a time; of a damaged file those that can be read singly."""
        names = ", ".join(["place", "checksum", *identifiers(self.columns)])
        count = 0
        try:
            cursor = self.connection.execute(f"SELECT {names} FROM cases")
            while rows := cursor.fetchmany(AT_ONCE):
                count += len(rows)
                yield rows
                if count > most:
                    raise sqlite3.DatabaseError(f"there are more than {most} cases")
        except _UNREADABLE as error:
            if isinstance(reported := self._explained(error), _Elsewhere):
                raise reported from None
            self._report_damage(str(error))
            one_row = f"SELECT {names} FROM cases WHERE rowid = ?"
            for number in range(1, most + 1):
                with suppress(sqlite3.DatabaseError):
                    if rows := self.connection.execute(one_row, (number,)).fetchall():
                        yield rows

    def _checked(self, rows: Sequence[Any]) -> tuple[list[str], dict[str, np.ndarray], list[bool]]:
        """Places of rows, their values by column, and whether each matches its checksum."""
        places, seals, *values_of = zip(*rows, strict=True)
        columns = {
            c.name: np.array(values, KINDS[c.kind])
            for c, values in zip(self.columns, values_of, strict=True)
        }
        right = self._seals(places, values_of, columns)
        return list(places), columns, [a == b for a, b in zip(seals, right, strict=True)]

    def _is_good(self, row: Any) -> bool:
        with suppress(*_OTHER_TYPE):
            return self._checked([row])[2][0]
        return False

    def _seals(
        self, places: Sequence[str], values: Sequence[Any], columns: Mapping[str, np.ndarray]
    ) -> list[bytes]:
        """Checksums of rows: of the file's number, texts and integers, then of real numbers.

        Real numbers behind the last that is not NaN are left out, so that columns added later
        change no checksum.
        """
        real = [columns[c.name] for c in self.columns if c.kind == "REAL"]
        numbers = np.array(real, "<f8").reshape(len(real), len(places)).T
        known = ~np.isnan(numbers)
        sizes = np.where(known, np.arange(8, 8 * len(real) + 8, 8), 0).max(axis=1, initial=0)
        data = memoryview(np.where(known, numbers + 0.0, np.nan).tobytes())  # -0.0 becomes 0.0
        plain = [x for c, x in zip(self.columns, values, strict=True) if c.kind != "REAL"]
        texts = zip(places, *([str(x) for x in c] for c in plain), strict=True)
        begun, begin, seals = hashlib.sha256(self._store.encode()), 0, []
        for text, size in zip(texts, sizes.tolist(), strict=True):
            seal = begun.copy()
            seal.update("\0".join(text).encode())
            seal.update(data[begin : begin + size])
            seals.append(seal.digest()[:_SEAL_BYTES])
            begin += 8 * len(real)
        return seals

    # ---- Write ----------------------------------------------------------------------------------

    def add(self, place: str, values: Mapping[str, Any]) -> None:
        """Add a row for existing columns: once this returns, it survives the end of the process.

        Raises:
            JointplayError: the disk is full; the rows before are kept.
        """
        row = [
            float(values.get(c.name, np.nan)) if c.kind == "REAL"
            else int(values[c.name]) if c.kind == "BOOLEAN"  # as it is read
            else values[c.name]
            for c in self.columns
        ]  # fmt: skip
        single = [[value] for value in row]
        columns = {
            c.name: np.array(value, KINDS[c.kind])
            for c, value in zip(self.columns, single, strict=True)
        }
        (seal,) = self._seals([place], single, columns)
        late = time.monotonic() - self._synced > SYNC_S
        with self._errors():
            if late:  # this row's synchronisation puts all rows before it on disk as well
                self.connection.execute("PRAGMA synchronous=FULL")
            sealed = (place, seal, *row)
            self.connection.execute(
                f"INSERT INTO cases VALUES ({', '.join('?' * len(sealed))})", sealed
            )
            if late:
                self.connection.execute("PRAGMA synchronous=NORMAL")
                self._synced = time.monotonic()

    def add_columns(self, columns: Sequence[Column]) -> None:
        """Add columns of numbers; rows so far have NaN there."""
        more = [*self.columns, *columns]
        with self._errors(), self._transaction():
            for declared in _declared(more)[len(self.columns) :]:
                self.connection.execute(f"ALTER TABLE cases ADD COLUMN {declared}")
            self._write_about(self.about, more)

    def set_about(self, about: Mapping[str, Any]) -> None:
        """Replace the description of the file, if it differs."""
        about = {**about, "store": self._store}
        if about != self.about:
            with self._errors(), self._transaction():
                self._write_about(about, self.columns)

    def _write_about(self, about: Mapping[str, Any], columns: Sequence[Column]) -> None:
        content = _content(about, columns)
        self.connection.execute("UPDATE about SET content = ?, checksum = ?",
                                (content, _checksum(content)))  # fmt: skip
        self.about, self.columns = dict(about), list(columns)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self.connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self.connection.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                self.connection.execute("ROLLBACK")
            raise

    def rebuild(
        self,
        about: Mapping[str, Any],
        columns: Sequence[Column],
        rows: Iterable[tuple[str, Mapping[str, Any]]],
    ) -> None:
        """Replace the file by one of these rows, which may be read from it meanwhile."""
        part = self.path.with_name(f".{self.path.name}.part")
        self._unlink(part)  # left by a process that was killed
        fresh = Rows.make(part, about, columns, self._noun)
        try:
            for place, values in rows:
                fresh.add(place, values)
        finally:
            fresh.close()
        with suppress(sqlite3.Error):
            self.connection.close()
        with files.system_errors(f"cannot write {str(self.path)!r}"):
            self._unlink(self.path, itself=False)
            part.replace(self.path)
        self._open()

    def _unlink(self, path: Path, itself: bool = True) -> None:
        for ending in ("-wal", "-shm", "-journal", *([""] if itself else [])):
            path.with_name(path.name + ending).unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file, which then holds everything, with no log beside it."""
        try:
            if self._write:
                with suppress(sqlite3.Error):  # the disk is full, or another program is reading it
                    self.connection.execute("PRAGMA journal_mode=DELETE")
        finally:
            with suppress(sqlite3.Error):
                self.connection.close()

    # ---- Errors of SQLite -----------------------------------------------------------------------

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except _UNREADABLE as error:
            raise self._explained(error) from None

    def _explained(self, error: Exception) -> JointplayError:
        name = getattr(error, "sqlite_errorname", "")
        if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
            return _Elsewhere(f"{str(self.path)!r} is locked by another program; close it there")
        if name.startswith("SQLITE_FULL"):
            full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return _Elsewhere(str(files.cannot_write(self.path, full)))
        if name.startswith(("SQLITE_IOERR", "SQLITE_CANTOPEN", "SQLITE_READONLY")):
            if not self._write:
                return _Elsewhere(f"cannot read {str(self.path)!r}: {error}")
            try:  # SQLite does not say why: writing something else tells
                with tempfile.TemporaryFile(dir=self.path.parent) as probe:
                    probe.write(bytes(1 << 16))
            except OSError as reason:
                return _Elsewhere(str(files.cannot_write(self.path, reason)))
            return _Elsewhere(str(files.cannot_write(self.path, error)))
        return damaged(self.path, self._noun, error)


class _Elsewhere(JointplayError):
    """An error whose cause is not the file's content."""


def _content(about: Mapping[str, Any], columns: Sequence[Column]) -> str:
    content = {**about, "format": FORMAT, "columns": [astuple(c) for c in columns]}
    return json.dumps(content, ensure_ascii=True)


def _checksum(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()
