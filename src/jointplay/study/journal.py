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
from collections.abc import Hashable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.study.study import Memory

JOURNAL = "journal"
"""Name of the journal within the store."""
DONE, FAILED = 1, 2
"""States of a case that has been run; 0: not yet."""

Index = tuple[int, ...]
Arrays = dict[str, np.ndarray]
"""What is kept of a case: numbers of any shape, by name."""


def is_there(store: Path, go_on: bool) -> bool:
    """Whether the store in a folder is there already.

    Raises:
        JointplayError: it is and may not be (`go_on`), or the folder has other things in it.
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
        labels = {str(name): np.asarray(variable[name].values) for name in variable.dims}
        texts = {name: one for name, one in labels.items() if one.dtype.kind in "OT"}
        labels |= {name: np.array(one.tolist(), str) for name, one in texts.items()}
        unit, text = (str(variable.attrs.get(word, "")) for word in ("units", "long_name"))
        return cls(labels, np.asarray(variable.values, float), unit, text)

    @property
    def plain(self) -> list[Any]:
        labels = {name: _packed(given) for name, given in self.labels.items()}
        return [labels, _packed(self.values), self.unit, self.text]

    @classmethod
    def read(cls, plain: Any) -> History:
        """The history that JSON has.

        Raises:
            ValueError: it is none.
        """
        try:
            given, values, unit, text = plain
            labels = {name: _unpacked(one) for name, one in given.items()}
            found = _unpacked(values).astype(float, casting="safe")
        except (TypeError, AttributeError) as error:
            raise ValueError(str(error)) from None
        good = all(one.ndim == 1 and one.dtype.kind in "fiU" for one in labels.values())
        if not good or found.shape != tuple(map(len, labels.values())):
            raise ValueError("labels")
        if not isinstance(unit, str) or not isinstance(text, str):
            raise ValueError("unit")
        return cls(labels, found, unit, text)


def _packed(values: np.ndarray) -> tuple[str, tuple[int, ...], str]:
    """Numbers or text as JSON has them: type, shape, and bytes."""
    array = np.ascontiguousarray(values)
    return array.dtype.str, array.shape, b64encode(array.tobytes()).decode()


def _unpacked(given: Any) -> np.ndarray:
    kind, shape, text = given
    return np.frombuffer(b64decode(text, validate=True), np.dtype(kind)).reshape(shape)


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
        entry = {"i": list(map(int, self.index)), "s": self.state, "v": self.values}
        if self.error:
            entry["e"] = self.error
        if self.histories:
            entry["h"] = {name: history.plain for name, history in self.histories.items()}
        return entry

    @classmethod
    def read(cls, entry: Any, shape: Index) -> Outcome | None:
        """The outcome that JSON has of a case of a study of this shape; None if it has none."""
        try:
            index, state, values = entry["i"], entry["s"], entry["v"]
            error, histories = entry.get("e", ""), entry.get("h", {})
            inside = [type(k) is int and 0 <= k < n for k, n in zip(index, shape, strict=True)]
            numbers = [name and type(x) is float for name, x in values.items()]
            good = all(inside) and all(numbers) and type(state) is int and state in (DONE, FAILED)
            if not (good and isinstance(error, str) and entry.keys() <= {*"isveh"}):
                return None
            kept = {name: History.read(one) for name, one in histories.items()}
        except (KeyError, TypeError, AttributeError, ValueError):
            return None
        return cls(tuple(index), state, values, error, kept)


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
    """A file of entries that grows at its end; what is torn there is cut off.

    Args:
        path: the file; made if it is not there.
        store: the number of the store that it is of.

    Attributes:
        found: entries that were there.
        size: of the file [bytes].
    """

    def __init__(self, path: Path, store: str) -> None:
        self.path, self.store = path, store
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
        self._file.close()


class Lines(Memory[Arrays]):
    """A store that is a journal alone, with which a later process goes on.

    Args:
        path: the file; it is made, its folder too.
        about: all that what is found depends on, but for the keys of cases, as plain data.

    Raises:
        JointplayError: the file was made for something else, or is none of this kind; it cannot be
            written.
    """

    _OURS = "jointplay study"

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        super().__init__()
        self.recovery = f"the runs so far are in {str(path)!r}; the same command continues"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            there = path.read_bytes() if path.exists() else b""
        except OSError as error:
            raise files.cannot_write(path, error) from None
        asked = json.loads(json.dumps(dict(about)))
        first, _ = next(entries(there, self._OURS), (None, 0))
        was = first.get("about") if isinstance(first, dict) else None
        was = was if there else asked
        if not isinstance(was, dict):
            raise JointplayError(f"{str(path)!r} is damaged, or no runs of jointplay; delete it")
        other = [name for name in {**was, **asked} if was.get(name) != asked.get(name)]
        if other:
            raise JointplayError(
                f"{str(path)!r} was made for something else (another {', '.join(other)}); choose "
                "another folder"
            )
        self._journal = Journal(path, self._OURS)
        if not self._journal.found:
            self._journal.add({"about": asked})
        for entry in self._journal.found[1:]:
            with suppress(ValueError, TypeError, AttributeError):  # none of ours: it does not count
                key, arrays = entry
                self[_hashable(key)] = {name: _unpacked(one) for name, one in arrays.items()}

    def keep(self, key: Any, value: Arrays) -> None:
        self._journal.add([key, {name: _packed(one) for name, one in value.items()}])
        super().keep(key, value)

    def close(self) -> None:
        self._journal.close()


def _hashable(key: Any) -> Hashable:
    """A key as it was: JSON has lists for tuples."""
    return tuple(map(_hashable, key)) if isinstance(key, list) else key
