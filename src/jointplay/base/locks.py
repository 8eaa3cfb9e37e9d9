"""Advisory locks of files and folders, held until the descriptor closes or its process ends."""

import errno
import os
import tempfile
import time
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


_LOOK_S = 0.02
"""Interval at which a waiting process tries to get a lock [s]."""


def lock(descriptor: int) -> None:
    """Lock an open file, or fail at once.

    Raises:
        BlockingIOError: another process holds the lock.
        OSError: a file system without locks.
    """
    if fcntl:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return
    import msvcrt

    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    except PermissionError as error:
        raise BlockingIOError(errno.EAGAIN, "another process holds the lock") from error


def acquired(descriptor: int, within_s: float) -> bool:
    """Lock an open file as soon as it is free; False if it is not within a time [s].

    On a file system without locks there is nothing to wait for.
    """
    until = time.monotonic() + within_s
    while True:
        try:
            lock(descriptor)
        except BlockingIOError:
            if time.monotonic() > until:
                return False
            time.sleep(_LOOK_S)
            continue
        except OSError:  # no locks
            pass
        return True


def opened(folder: Path) -> int:
    """Open a descriptor by which to lock a folder: its own, or on Windows that of a proxy file."""
    if fcntl:
        return os.open(folder, os.O_RDONLY)
    from hashlib import sha256

    name = sha256(str(folder.resolve()).encode()).hexdigest()[:32]
    return os.open(Path(tempfile.gettempdir()) / f"jointplay-{name}.lock", os.O_RDWR | os.O_CREAT)
