"""Files that are there whole or not at all: written beside their name, synced, then renamed.

A process that is killed leaves at most ``.NAME.PID.part``, which blocks nothing and may be deleted.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from jointplay.errors import JointplayError

written: list[Path] = []
"""Files that this process has written, in order: what a message may truly say is kept."""

_claimed: dict[Path, int] = {}
"""Folders that this process writes to, each with the descriptor that holds its lock."""

_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}
"""What file systems without hard links say."""


_HDF5 = b"\x89HDF"
"""How results begin."""


def write(path: str | Path, content: str | bytes, *, overwrite: bool = False) -> Path:
    """Write a file whole: after a crash, a kill or a full disk it is there complete, or not at all.

    Args:
        path: the file; its folder exists.
        content: text is written as UTF-8, line ends as they are.
        overwrite: whether a file of that name is replaced.

    Raises:
        JointplayError: the file exists (and `overwrite` is false) or cannot be written.
    """
    with writing(path, overwrite=overwrite) as file:
        file.write(content.encode("utf-8") if isinstance(content, str) else content)
    return Path(path)


@contextmanager
def writing(path: str | Path, *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """A file to be written, and read, in the block; it gets its name when all is on disk.

    Args:
        path: the file; its folder exists.
        overwrite: whether a file of that name is replaced.

    Raises:
        JointplayError: the file exists (and `overwrite` is false) or cannot be written.
    """
    path = Path(path)
    if not path.name:
        raise JointplayError(f"{str(path)!r} is a folder; name a file")
    part = path.with_name(f".{path.name[:40]}.{os.getpid()}-{secrets.token_hex(4)}.part")
    try:
        if not overwrite and os.path.lexists(path):
            raise FileExistsError
        with part.open("w+b") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        if overwrite:
            part.replace(path)
        else:
            _name(part, path)
        _sync(path.parent)
    except JointplayError:
        raise
    except FileExistsError:
        raise exists(path) from None
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        raise cannot_write(path, error) from None
    finally:
        with suppress(OSError, ValueError):
            part.unlink()
    if path not in written:
        written.append(path)


def _name(part: Path, path: Path) -> None:
    """Give the finished file its name, unless another has it."""
    try:
        os.link(part, path)  # fails if the name is taken, which a rename does not
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        if os.path.lexists(path):
            raise FileExistsError from None
        part.rename(path)


def _sync(folder: Path) -> None:
    """Have the new name survive a power failure, where the system can do that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def exists(path: Path) -> JointplayError:
    """What to say of a file that is there already."""
    return JointplayError(f"{str(path)!r} exists; choose another name")


def cannot_write(path: Path, error: Exception) -> JointplayError:
    """What to say of a file that cannot be written."""
    reason = getattr(error, "strerror", None) or error
    return JointplayError(f"cannot write {str(path)!r}: {reason}")


def is_file(path: Path) -> bool:
    """Whether there is such a file; False also for names that none can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Whether there is such a folder; False also for names that none can have."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def check_new(path: str | Path) -> Path:
    """Refuse a file that cannot be written anew, before any work is done.

    Raises:
        JointplayError: it exists, or its folder does not or cannot be written to.
    """
    path = Path(path)
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()  # which refuses names that no file can have
            raise exists(path)
        if not path.parent.is_dir():
            raise JointplayError(f"cannot write {str(path)!r}: no folder {str(path.parent)!r}")
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except (OSError, ValueError) as error:
        if isinstance(error, JointplayError):
            raise
        raise cannot_write(path, error) from None
    return path


def refuse_present(folder: str | Path, names: Iterable[str]) -> None:
    """Refuse a folder that holds one of the files already, before any work is done.

    Raises:
        JointplayError: it does.
    """
    for name in names:
        if os.path.lexists(Path(folder) / name):
            raise JointplayError(_present(Path(folder), name))


def claim(folder: str | Path, names: Iterable[str]) -> Path:
    """Make `folder`, sure that `names` can be written there, nothing is overwritten, and no one
    else writes there: of two processes with one folder the second learns it here.

    The claim ends with the process, however it ends.

    Raises:
        JointplayError: the folder holds one of the files already, another process has claimed it,
            or it cannot be written to.
    """
    folder = Path(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileExistsError):
            folder.mkdir()
        if not folder.is_dir():
            raise JointplayError(f"{str(folder)!r} is a file; name a folder for the results")
        _lock(folder)
        refuse_present(folder, names)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        if isinstance(error, JointplayError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise JointplayError(f"cannot write to {str(folder)!r}: {reason}") from None
    return folder


def _lock(folder: Path) -> None:
    """Hold an advisory lock on the folder itself until this process ends."""
    try:
        import fcntl
    except ImportError:  # not on this system
        return
    place = folder.resolve()
    if place in _claimed:
        return
    descriptor = os.open(folder, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise JointplayError(
            f"another process is writing to {str(folder)!r}; name another folder"
        ) from None
    except OSError:  # a file system that locks no folders
        os.close(descriptor)
        return
    _claimed[place] = descriptor


def empty(folder: Path) -> None:
    """Delete all that is in a folder, which stays, and so does a claim of it.

    Raises:
        OSError: something cannot be deleted.
    """
    for one in folder.iterdir():
        if one.is_dir() and not one.is_symlink():
            shutil.rmtree(one)
        else:
            one.unlink()


def release(folder: str | Path) -> None:
    """End a claim of this process."""
    descriptor = _claimed.pop(Path(folder).resolve(), None)
    if descriptor is not None:
        os.close(descriptor)


def _present(folder: Path, name: str) -> str:
    """What to say of a file that is in the way: whether it is whole, or the rest of a run."""
    path = folder / name
    what = ""
    if is_file(path):
        with path.open("rb") as file:
            begin = file.read(len(_HDF5))
        if not begin:
            what = "empty"
        elif begin == _HDF5 and not _loads(path):
            what = "broken"
    if what:
        return (
            f"{str(path)!r} is {what}, left by a run that was killed or damaged since; delete it, "
            "or name another folder"
        )
    return f"{str(folder)!r} already holds results ({name}); name another folder"


def _loads(path: Path) -> bool:
    """Whether it is whole as far as HDF5 and the marks of a result go."""
    import h5py

    try:
        with h5py.File(path) as file:
            return "audit" in file.attrs and "status" in file.attrs
    except (OSError, RuntimeError, KeyError):
        return False
