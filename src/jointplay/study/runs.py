"""A study's store in a file, from which a later process resumes."""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Hashable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.files import system_errors
from jointplay.study.database import Column, Rows
from jointplay.study.study import Memory

Arrays = dict[str, np.ndarray]
"""The values kept of a run: arrays of numbers or text, by name."""
MOST_RUNS = 1_000_000
"""Most runs at a time."""
_VALUES = "found"
_KIND = "file of runs"


class Runs(Memory[Arrays]):
    """A store that is a file of `Rows`.

    Args:
        path: the file; it is created if it is absent, its folder too.
        about: plain data on which all values depend, beside the keys of cases.

    Raises:
        JointplayError: the file was made with another `about`, is damaged, or cannot be written.
    """

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        super().__init__()
        self.recovery = f"the runs so far are in {str(path)!r}; the same command continues"
        inputs = {"inputs": json.loads(json.dumps(dict(about)))}
        with system_errors(f"cannot write {str(path)!r}"):
            files.make_folder(path.parent)
            present = path.exists() and path.stat().st_size > 0
        if not present:
            self._rows = Rows.make(path, inputs, [Column(_VALUES, "TEXT")], _KIND)
            return
        try:
            self._rows = Rows(path, write=True, noun=_KIND)
        except JointplayError as error:
            raise JointplayError(f"{error}; delete it, or choose another folder") from None
        try:
            self._load(inputs["inputs"])
        except BaseException:
            self._rows.close()
            raise

    def _load(self, inputs: Mapping[str, Any]) -> None:
        """Read the runs that the file has, and rebuild it without damaged rows, if it has any."""
        stored = self._rows.about.get("inputs")
        if not isinstance(stored, dict) or [c.name for c in self._rows.columns] != [_VALUES]:
            raise JointplayError(f"{str(self._rows.path)!r} is not a {_KIND}; delete it")
        changed = [name for name in {**stored, **inputs} if stored.get(name) != inputs.get(name)]
        if changed:
            raise JointplayError(
                f"{str(self._rows.path)!r} was made for something else (another "
                f"{', '.join(changed)}); choose another folder"
            )
        good = []
        for places, values in self._rows.blocks(MOST_RUNS):
            for place, text in zip(places, values[_VALUES], strict=True):
                with suppress(ValueError, TypeError, AttributeError):  # unreadable: run it again
                    arrays = {name: _unpacked(column) for name, column in json.loads(text).items()}
                    self[_hashable(json.loads(place))] = arrays
                    good.append((place, {_VALUES: text}))
        if not self._rows.intact:
            self._rows.rebuild({"inputs": inputs}, self._rows.columns, good)

    def keep(self, key: Any, value: Arrays) -> None:
        packed = {name: _packed(array) for name, array in value.items()}
        self._rows.add(json.dumps(key), {_VALUES: json.dumps(packed)})
        super().keep(key, value)
        if self._rows.path not in files.written:  # so that an interruption names the file
            files.written.append(self._rows.path)

    def close(self) -> None:
        """Close the file, and delete it if it holds no runs."""
        self._rows.close()
        if not self:
            self._rows.path.unlink(missing_ok=True)


@contextmanager
def store_in(path: Path | None) -> Iterator[Memory[Arrays]]:
    """Store of runs: the file `path`, whose runs are not made again; None: memory."""
    if path is None:
        yield Memory[Arrays]()
        return
    with closing(Runs(path, {})) as store:
        yield store


def _packed(values: np.ndarray) -> tuple[str, tuple[int, ...], str]:
    """An array for JSON: type, shape, and bytes in base64."""
    return values.dtype.str, values.shape, b64encode(values.tobytes()).decode()


def _unpacked(packed: Any) -> np.ndarray:
    kind, shape, text = packed
    return np.frombuffer(b64decode(text, validate=True), np.dtype(kind)).reshape(shape)


def _hashable(key: Any) -> Hashable:
    """A key as it was before JSON turned its tuples into lists."""
    return tuple(map(_hashable, key)) if isinstance(key, list) else key
