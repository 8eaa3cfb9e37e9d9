"""What cases gave, line by line, on disk before anyone is told: the memory of a study.

Each line begins with a hash of it and of the store that it was written to. A process that is killed
leaves at most one line torn, the last; a full disk likewise, and it is cut off. A line that has
changed since, or is of another store, is passed over: its case runs again.
"""

from __future__ import annotations

import hashlib
import json
import os
from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError

JOURNAL = "journal"
"""Name of the journal within the store."""

DONE, FAILED = 1, 2
"""States of a case that has been run; 0: not yet."""

Index = tuple[int, ...]


def is_there(store: Path, go_on: bool) -> bool:
    """Whether the store is there already.

    Args:
        store: its folder.
        go_on: whether it may be.

    Raises:
        JointplayError: it is and may not be, or the folder has other things in it.
    """
    there = files.is_file(store / "zarr.json")
    if there and not go_on:
        raise JointplayError(
            f"{str(store)!r} exists; continue it with --resume, or choose another name"
        )
    if not there and files.is_folder(store):
        for one in store.iterdir():
            if not (one.name.startswith(".zarr.json.") and one.suffix == ".part"):  # of a kill
                raise JointplayError(
                    f"{str(store)!r} is a folder that holds other files; choose another name"
                )
    return there


@dataclass(frozen=True)
class Coordinate:
    """Values along a dimension of the cases: numbers in SI or texts, their unit and meaning."""

    dimension: str
    values: np.ndarray
    unit: str
    text: str


@dataclass(frozen=True)
class History:
    """A variable of a result over time.

    Attributes:
        labels: of each dimension, in their order: times [s], names.
        values: in SI, as many along each dimension as it has labels.
        unit, text: of the values: unit and meaning.
    """

    labels: Mapping[str, np.ndarray]
    values: np.ndarray
    unit: str = ""
    text: str = ""

    @classmethod
    def of(cls, variable: Any) -> History:
        """The same of a variable of `xarray`."""
        labels = {str(name): np.asarray(variable[name].values) for name in variable.dims}
        unit, text = (str(variable.attrs.get(word, "")) for word in ("units", "long_name"))
        return cls(labels, np.asarray(variable.values, float), unit, text)

    @property
    def plain(self) -> list[Any]:
        """It as JSON has it."""
        labels = {
            name: _packed(given) if given.dtype.kind == "f" else given.tolist()
            for name, given in self.labels.items()
        }
        return [labels, _packed(self.values), self.unit, self.text]

    @classmethod
    def read(cls, plain: Any) -> History:
        """The history that JSON has.

        Raises:
            ValueError: it is none.
        """
        try:
            given, values, unit, text = plain
            labels = {
                name: _unpacked(one) if isinstance(one, str) else np.array(one)
                for name, one in given.items()
            }
            found = _unpacked(values).reshape([len(one) for one in labels.values()])
        except (TypeError, AttributeError) as error:
            raise ValueError(str(error)) from None
        if not all(one.ndim == 1 and one.dtype.kind in "fiU" for one in labels.values()):
            raise ValueError("labels")
        if not isinstance(unit, str) or not isinstance(text, str):
            raise ValueError("unit")
        return cls(labels, found, unit, text)


def _packed(values: np.ndarray) -> str:
    """Numbers as text."""
    return b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode()


def _unpacked(text: Any) -> np.ndarray:
    """Numbers of a text.

    Raises:
        ValueError, TypeError: it is none of numbers.
    """
    return np.frombuffer(b64decode(text, validate=True), "<f8")


@dataclass(frozen=True)
class Outcome:
    """What a case gave: its state, measures by name, an error, histories by name."""

    index: Index
    state: int
    values: dict[str, float]
    error: str = ""
    histories: dict[str, History] = field(default_factory=dict)

    @property
    def entry(self) -> dict[str, Any]:
        """It as JSON has it."""
        entry = {"i": list(map(int, self.index)), "s": self.state, "v": self.values}
        if self.error:
            entry["e"] = self.error
        if self.histories:
            entry["h"] = {name: history.plain for name, history in self.histories.items()}
        return entry

    @classmethod
    def read(cls, entry: Any, shape: Index) -> Outcome | None:
        """The outcome that JSON has of a case of a study of this shape; None if it has none."""
        if not isinstance(entry, dict) or not entry.keys() <= {*"isveh"}:
            return None
        index, state, values, error, histories = (entry.get(key) for key in "isveh")
        if not isinstance(index, list) or len(index) != len(shape):
            return None
        if not all(type(k) is int and 0 <= k < size for k, size in zip(index, shape, strict=True)):
            return None
        if type(state) is not int or state not in (DONE, FAILED):
            return None
        if not isinstance(values, dict) or not all(
            n and type(v) is float for n, v in values.items()
        ):
            return None
        if not isinstance(error, str | None) or not isinstance(histories, dict | None):
            return None
        try:
            kept = {name: History.read(one) for name, one in (histories or {}).items()}
        except ValueError:
            return None
        return cls(tuple(index), state, values, error or "", kept)


def line(entry: Any, store: str) -> bytes:
    """An entry as a line of the journal of a store, which its own number says."""
    text = json.dumps(entry, separators=(",", ":")).encode()
    return b"%s %s\n" % (_hash(text, store), text)


def _hash(text: bytes, store: str) -> bytes:
    """What tells that a line is whole and of the store."""
    return hashlib.sha256(store.encode() + text).hexdigest()[:16].encode()


def entries(content: bytes, store: str) -> Iterator[tuple[Any, int]]:
    """Entries of a journal that are whole, and where each ends; what they say is not judged."""
    at = 0
    while (end := content.find(b"\n", at)) >= 0:
        mark, _, text = content[at:end].partition(b" ")
        if mark == _hash(text, store):
            try:
                yield json.loads(text), end + 1
            except (ValueError, RecursionError):  # no entry of ours
                yield None, end + 1
        at = end + 1


class Journal:
    """A file of entries that grows at its end.

    Args:
        path: the file; made if it is not there.
        store: the number of the store that it is of.

    Attributes:
        found: entries that were there.
        size: of the file [bytes].
    """

    def __init__(self, path: Path, store: str) -> None:
        """Read what is there, and cut off what is torn."""
        self.path = path
        self.store = store
        self.found: list[Any] = []
        self.size = 0
        try:
            # Not appended to: it is cut where it ends. Closed twice, it closes no one else's file.
            self._file = open(path, "r+b" if path.exists() else "x+b", buffering=0)  # noqa: SIM115
            for entry, self.size in entries(path.read_bytes(), store):
                self.found.append(entry)
            self._file.truncate(self.size)
        except OSError as error:
            raise files.cannot_write(path, error) from None

    def add(self, entry: Any) -> None:
        """Write an entry; it survives this process, and after `sync` the machine.

        Raises:
            JointplayError: the disk is full, or gone; the journal is as it was.
        """
        data = line(entry, self.store)
        try:
            done = 0
            while done < len(data):
                done += os.pwrite(self._file.fileno(), data[done:], self.size + done)
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self.size)
            raise files.cannot_write(self.path, error) from None
        self.size += len(data)

    def sync(self) -> None:
        """Have all entries survive a power failure."""
        with suppress(OSError):
            os.fsync(self._file.fileno())

    def clear(self) -> None:
        """Forget all entries, which are safe elsewhere."""
        with suppress(OSError):
            self._file.truncate(0)
            os.fsync(self._file.fileno())
        self.size = 0
        self.found = []

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()
