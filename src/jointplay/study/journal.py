"""What has been finished, line by line, on disk before anyone is told: the memory of a sweep.

Each line has a checksum. A process that is killed leaves at most one line torn, the last; a full
disk likewise, and it is cut off. A line that has changed since is passed over: its case runs again.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from jointplay.core.errors import JointplayError
from jointplay.core.files import cannot_write, is_file, is_folder

JOURNAL = "journal"
"""Name of the journal within the store."""

SYNC_S = 1.0
"""What a power failure can take is no older than this [s]."""


def is_there(store: Path, go_on: bool) -> bool:
    """Whether the store is there already.

    Args:
        store: its folder.
        go_on: whether it may be.

    Raises:
        JointplayError: it is and may not be, or the folder has other things in it.
    """
    there = is_file(store / "zarr.json")
    if there and not go_on:
        raise JointplayError(
            f"{str(store)!r} exists; continue it with --resume, or choose another name"
        )
    if not there and is_folder(store) and any(map(_other, store.iterdir())):
        raise JointplayError(
            f"{str(store)!r} is a folder that holds other files; choose another name"
        )
    return there


def _other(one: Path) -> bool:
    """Whether it is something that no sweep left in its folder."""
    return not (one.name.endswith(".partial") or one.name in (JOURNAL, "state", "error"))


def line(entry: Any) -> bytes:
    """An entry as a line with its checksum."""
    text = json.dumps(entry, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def entries(content: bytes) -> Iterator[tuple[Any, int]]:
    """Entries of a journal that are whole, and where each ends; what they say is not judged."""
    at = 0
    while (end := content.find(b"\n", at)) >= 0:
        checksum, _, text = content[at:end].partition(b" ")
        if checksum == b"%08x" % zlib.crc32(text):
            try:
                yield json.loads(text), end + 1
            except (ValueError, RecursionError):  # no entry of ours
                yield None, end + 1
        at = end + 1


class Journal:
    """A file of entries that grows at its end.

    Args:
        path: the file; made if it is not there.
    """

    def __init__(self, path: Path) -> None:
        """Read what is there, and cut off what is torn."""
        self.path = path
        self.found: list[Any] = []
        self._end = 0
        try:
            # Not appended to: it is cut where it ends. Closed twice, it closes no one else's file.
            self._file = open(path, "r+b" if path.exists() else "x+b", buffering=0)  # noqa: SIM115
            for entry, self._end in entries(path.read_bytes()):
                self.found.append(entry)
            self._file.truncate(self._end)
        except OSError as error:
            raise cannot_write(path, error) from None

    def add(self, entry: Any) -> None:
        """Write an entry; it survives this process, and after `sync` the machine.

        Raises:
            JointplayError: the disk is full, or gone; the journal is as it was.
        """
        data = line(entry)
        try:
            done = 0
            while done < len(data):
                done += os.pwrite(self._file.fileno(), data[done:], self._end + done)
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self._end)
            raise cannot_write(self.path, error) from None
        self._end += len(data)

    def sync(self) -> None:
        """Have all entries survive a power failure."""
        with suppress(OSError):
            os.fsync(self._file.fileno())

    def clear(self) -> None:
        """Forget all entries, which are safe elsewhere."""
        with suppress(OSError):
            self._file.truncate(0)
            os.fsync(self._file.fileno())
        self._end = 0
        self.found = []

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()
