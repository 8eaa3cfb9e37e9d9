"""A store in one file: a line for each case, on disk before anyone is told.

A later process goes on with it. What has changed since it was written does not count: its case
runs again. See `journal` for what a kill or a full disk leaves.
"""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Hashable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.study.journal import Journal, entries
from jointplay.study.study import Memory

_OURS = "jointplay study"

Arrays = dict[str, np.ndarray]
"""What is kept of a case: numbers of any shape, by name."""


class Lines(Memory[Arrays]):
    """A store in one file.

    Args:
        path: the file; it is made, its folder too.
        about: all that what is found depends on, but for the keys of cases, as plain data.

    Raises:
        JointplayError: the file was made for something else, or is none of this kind; it cannot be
            written.
    """

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        """Read what is there, or begin the file."""
        super().__init__()
        self.kept = f"the runs so far are in {str(path)!r}; the same command continues"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            there = path.read_bytes() if path.exists() else b""
        except OSError as error:
            raise files.cannot_write(path, error) from None
        head = json.loads(json.dumps({"about": dict(about)}))
        first: Any
        first, _ = next(entries(there, _OURS), (None, 0)) if there else (head, 0)
        if there and not _is_head(first):
            raise JointplayError(f"{str(path)!r} is damaged, or no runs of jointplay; delete it")
        if first != head:
            raise JointplayError(
                f"{str(path)!r} was made for something "
                f"else{_difference(first['about'], head['about'])}; choose another folder"
            )
        self._journal = Journal(path, _OURS)
        if not self._journal.found:
            self._journal.add(head)
        for entry in self._journal.found[1:]:
            with suppress(ValueError, TypeError, AttributeError):  # none of ours: it does not count
                key, arrays = entry
                self[_hashable(key)] = {name: _unpacked(*one) for name, one in arrays.items()}

    def keep(self, key: Any, value: Arrays) -> None:
        """Keep what was found of a case, in memory and on disk at once.

        Raises:
            JointplayError: the file cannot be written.
        """
        self._journal.add([key, {name: _packed(one) for name, one in value.items()}])
        super().keep(key, value)

    def close(self) -> None:
        """Let go of the file."""
        self._journal.close()


def _is_head(entry: Any) -> bool:
    return isinstance(entry, dict) and isinstance(entry.get("about"), dict)


def _hashable(key: Any) -> Hashable:
    """A key as it was: JSON has lists for tuples."""
    return tuple(map(_hashable, key)) if isinstance(key, list) else key


def _packed(values: np.ndarray) -> tuple[str, tuple[int, ...], str]:
    """Numbers or text as JSON has them: type, shape, and bytes."""
    array = np.ascontiguousarray(values)
    return array.dtype.str, array.shape, b64encode(array.tobytes()).decode()


def _unpacked(kind: str, shape: list[int], text: str) -> np.ndarray:
    return np.frombuffer(b64decode(text), np.dtype(kind)).reshape(shape)


def _difference(there: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    """What differs, in words."""
    names = [name for name in {**there, **asked} if there.get(name) != asked.get(name)]
    return f" (another {', '.join(names)})" if names else ""
