"""Atomic files, checked reading, claimed folders, and temporary folders that are cleaned up.

A file is written under a temporary name beside its own, synced, then renamed: it is complete or
absent. A process that is killed leaves at most ``.NAME.PID.part``, which blocks nothing and may be
deleted.
"""

from __future__ import annotations

import csv
import errno
import io
import os
import re
import shutil
import stat
import sys
import tempfile
import time
import weakref
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from jointplay.base import locks
from jointplay.base.errors import JointplayError

if TYPE_CHECKING:
    import numpy as np

written: list[Path] = []
"""Announced files that this process has written, in order, for messages after an interruption."""

_claimed: dict[Path, int] = {}
"""Folders that this process has claimed, each with the descriptor that holds its lock."""

_new_folders: list[Path] = []
"""Folders that this process has made to write into, in order."""

_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}
"""Error numbers of file systems without hard links."""

MARK = ".jointplay-owner"
"""Name of the file in each temporary folder that names its machine. The owner holds a lock on it,
which ends with the owner."""

ENDING_S = 1.0
"""Longest wait for a folder's lock [s]: the workers of a killed command hold it until they end."""

LEFT_S = 86400.0
"""Age from which temporary folders of dead owners are deleted [s] (judged: a day, so that none is
taken for old on a machine whose clock is off by a time zone)."""

_swept: set[str] = set()
"""Folders in which this process has already deleted such leftovers."""

MOST_TEXT = 256_000_000
"""Largest text file that is read: URDF, scenario, table [bytes] (judged: a motion of a million
rows of 100 bytes, and as much again)."""

_HDF5 = b"\x89HDF"
"""First bytes of results."""

_LONGEST_NAME = 100
"""Most bytes of a label in a file's name: file systems allow 255, endings included."""

PICTURES = {"png": "Software", "pdf": "Creator", "svg": "Creator"}
"""Formats of pictures, each with the entry of its metadata that names the program."""


@contextmanager
def system_errors(failure: str) -> Iterator[None]:
    """Turn errors of the system and of impossible file names into a `JointplayError`."""
    try:
        yield
    except JointplayError:
        raise
    except (OSError, ValueError) as error:
        raise JointplayError(f"{failure}: {getattr(error, 'strerror', None) or error}") from None


def write(
    path: str | Path, content: str | bytes, *, overwrite: bool = False, announced: bool = True
) -> Path:
    """Write a file as `writing` does; text in UTF-8, line ends unchanged."""
    with writing(path, overwrite=overwrite, announced=announced) as file:
        file.write(content.encode("utf-8") if isinstance(content, str) else content)
    return Path(path)


def picture(
    path: str | Path, figure: Any, *, overwrite: bool = False, mark: str = "", **options: Any
) -> Path:
    """Save a matplotlib figure to a file, whole or not at all; see `writing`.

    Args:
        path: the file, whose suffix selects the format, one of `PICTURES`.
        figure: object with matplotlib's `savefig`.
        overwrite: whether an existing file is replaced.
        mark: text for the picture's metadata; an existing picture that holds it is replaced.
        options: further arguments of `savefig`.
    """
    content = drawn(figure, _picture_format(Path(path)), mark, **options)
    return write_picture(path, content, overwrite=overwrite, mark=mark)


def drawn(figure: Any, kind: str, mark: str = "", **options: Any) -> bytes:
    """Render a matplotlib figure in one of the formats of `PICTURES`; see `picture`."""
    if mark:
        options["metadata"] = {PICTURES[kind]: mark}
    content = io.BytesIO()
    figure.savefig(content, format=kind, **options)
    return content.getvalue()


def write_picture(
    path: str | Path, content: bytes, *, overwrite: bool = False, mark: str = ""
) -> Path:
    """Write a picture from `drawn`, replacing one that holds the mark; see `picture`."""
    overwrite = overwrite or bool(mark and holds(Path(path), mark))
    return write(path, content, overwrite=overwrite)


def _picture_format(path: Path) -> str:
    kind = path.suffix.lower().removeprefix(".")
    if kind not in PICTURES:
        raise JointplayError(f"{path.name!r} must end in .{', .'.join(PICTURES)}: a picture")
    return kind


def check_picture(path: str | Path) -> Path:
    """Raise, before any work is done, unless a picture can be written there; see `check_new`."""
    path = check_new(path)
    _picture_format(path)
    return path


def holds(path: Path, mark: str) -> bool:
    """Whether a file exists and holds a mark, as a picture drawn by an earlier run does."""
    return is_file(path) and mark.encode() in path.read_bytes()


def begins(path: Path, mark: bytes) -> bool:
    """Whether a file exists and begins with a mark, as a working file of an earlier run does."""
    if not is_file(path):
        return False
    with path.open("rb") as file:
        return file.read(len(mark)) == mark


def check_own(path: Path, mark: bytes, noun: str) -> None:
    """Raise, before any work is done, if a foreign file lies where a working file is to be.

    Raises:
        JointplayError: a file is there that does not begin with `mark`, or cannot be read.
    """
    with system_errors(f"cannot write {str(path)!r}"):
        if not os.path.lexists(path) or begins(path, mark):
            return
    refusal = "one would be written there; move it, or choose another place for the results"
    raise JointplayError(f"{str(path)!r} is not a {noun} of jointplay, and {refusal}")


def remove_own(path: Path, mark: bytes) -> None:
    """Delete a working file; a file that does not begin with its mark stays."""
    with suppress(OSError):
        if begins(path, mark):
            path.unlink()


@contextmanager
def writing(
    path: str | Path, *, overwrite: bool = False, announced: bool = True
) -> Iterator[BinaryIO]:
    """Open a file to be written, and read, in the block; it gets its name once it is on disk.

    After a crash, a kill or a full disk it is complete or absent.

    Args:
        path: the file.
        overwrite: whether an existing file is replaced.
        announced: whether the user asked for it, and is told of it after an interruption.

    Raises:
        JointplayError: the file exists (and `overwrite` is false) or cannot be written.
    """
    path = Path(path)
    if not path.name:
        raise JointplayError(f"{str(path)!r} is a folder; name a file")
    part = path.with_name(f".{path.name[:40]}.{os.getpid()}-{os.urandom(4).hex()}.part")
    try:
        with system_errors(f"cannot write {str(path)!r}"):
            if not overwrite and os.path.lexists(path):
                raise exists(path)
            with part.open("w+b") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            if overwrite:
                part.replace(path)
            else:
                _name(part, path)
            _sync(path.parent)
    finally:
        with suppress(OSError, ValueError):
            part.unlink()
    if announced and path not in written:
        written.append(path)


def _name(part: Path, path: Path) -> None:
    """Give a finished file its name, which must be free."""
    try:
        os.link(part, path)  # fails if the name is taken; a rename would replace
    except OSError as error:
        if isinstance(error, FileExistsError) or os.path.lexists(path):
            raise exists(path) from None
        if error.errno not in _NO_LINKS:
            raise
        part.rename(path)


def _sync(folder: Path) -> None:
    """Sync a folder, so that new names in it survive a power failure, where the system can."""
    with suppress(OSError), ExitStack() as stack:
        descriptor = os.open(folder, os.O_RDONLY)
        stack.callback(os.close, descriptor)
        os.fsync(descriptor)


def exists(path: Path) -> JointplayError:
    """Error for a file that already exists."""
    return JointplayError(f"{str(path)!r} already exists; choose another name")


def cannot_write(path: Path, error: Exception) -> JointplayError:
    """Error for a file that cannot be written."""
    return JointplayError(f"cannot write {str(path)!r}: {getattr(error, 'strerror', '') or error}")


def temporary(noun: str = "files") -> tempfile.TemporaryDirectory[str]:
    """Make a temporary folder, named after `noun`, that is deleted with the block or the process.

    First, folders left by killed processes, marked as this user's and older than a day, are
    deleted.
    """
    place = tempfile.gettempdir()
    if place not in _swept:
        _swept.add(place)
        _sweep(Path(place))
    import socket  # takes long to import

    folder = tempfile.TemporaryDirectory(
        prefix=f"jointplay-{noun}-{os.getpid()}-", ignore_cleanup_errors=True
    )
    mark = Path(folder.name) / MARK
    mark.write_text(socket.gethostname(), encoding="utf-8")
    owner = os.open(mark, os.O_RDONLY)
    weakref.finalize(folder, os.close, owner)
    try:
        locks.lock(owner)
    except OSError:  # a file system without locks, where others would take this owner for dead
        mark.unlink()
    return folder


def _sweep(place: Path) -> None:
    """Delete old temporary folders of dead processes of this user and machine."""
    import socket  # takes long to import

    for folder in place.glob("jointplay-*"):
        with suppress(OSError, ValueError), ExitStack() as stack:
            mark = (folder / MARK).lstat()
            user = os.getuid() if hasattr(os, "getuid") else mark.st_uid  # Windows has none
            ours = mark.st_uid == folder.lstat().st_uid == user
            plain = stat.S_ISREG(mark.st_mode) and not folder.is_symlink()
            if not (ours and plain and time.time() - mark.st_mtime > LEFT_S):
                continue
            file = stack.enter_context((folder / MARK).open(encoding="utf-8"))
            locks.lock(file.fileno())  # fails while the owner lives
            if file.read() == socket.gethostname():
                shutil.rmtree(folder, ignore_errors=True)


def is_file(path: Path) -> bool:
    """Whether a file exists; False also for impossible names."""
    return os.path.isfile(path)


def cache_folder() -> Path:
    """Folder for cached results: ``JOINTPLAY_CACHE``, else in the user's cache."""
    default = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser(default)
    return Path(os.environ.get("JOINTPLAY_CACHE") or Path(user) / "jointplay")


def is_folder(path: Path) -> bool:
    """Whether a folder exists; False also for impossible names."""
    return os.path.isdir(path)


def require_file(path: Path, noun: str) -> None:
    """Raise unless a file exists at the path; the message names what is there instead."""
    if is_file(path):
        return
    kinds = {stat.S_IFDIR: "folder", stat.S_IFIFO: "pipe", stat.S_IFSOCK: "socket",
             stat.S_IFCHR: "device", stat.S_IFBLK: "device"}  # fmt: skip
    kind = None
    with suppress(OSError, ValueError):
        kind = kinds.get(stat.S_IFMT(path.stat().st_mode))
    raise JointplayError(f"no {noun} {str(path)!r}" + (f": it is a {kind}" if kind else ""))


def arrays(path: Path | BinaryIO) -> dict[str, np.ndarray]:
    """Read all arrays of an ``.npz`` file, given by name or open; none may hold objects.

    Raises:
        OSError: it cannot be read.
        ValueError: it is damaged, or another kind of file.
    """
    import numpy as np

    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except OSError:
        raise
    except Exception as error:  # noqa: BLE001
        # On damaged bytes zipfile, zlib and numpy may raise anything.
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None


def check_plain(path: Path, most: int) -> None:
    """Raise, before it is opened, unless a path is a plain file of at most `most` bytes.

    Raises:
        OSError: it cannot be examined.
        ValueError: it is no plain file, or larger.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is not a regular file")
    if status.st_size > most:
        size = f"{status.st_size / 1e6:.4g} MB"
        raise ValueError(f"it has {size}; at most {most / 1e6:g} MB are read")


def read_plain(path: Path, most: int) -> bytes:
    """Read a plain file of at most `most` bytes; raises as `check_plain` does."""
    check_plain(path, most)
    with path.open("rb") as file:
        data = file.read(most + 1)  # it may grow meanwhile, or not tell its size
    if len(data) > most:
        raise ValueError(f"it has more than {most / 1e6:g} MB")
    return data


def read_text(path: Path, noun: str, most: int = MOST_TEXT) -> str:
    """Read the UTF-8 text of a plain file of at most `most` bytes; `noun` names it in messages.

    Raises:
        JointplayError: it cannot be read, is no plain file, too large, or no UTF-8 text.
    """
    with system_errors(f"cannot read the {noun} {str(path)!r}"):
        content = read_plain(path, most)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        kinds = (kind for start, kind in _BEGINNINGS.items() if content.startswith(start))
        kind = next((f": it is {kind}" for kind in kinds), f" (UTF-8): {error}")
        raise JointplayError(f"cannot read the {noun} {str(path)!r}: it is no text{kind}") from None


_BEGINNINGS = {
    _HDF5: "a result",
    b"#ROSBAG V": "a bag of ROS 1; rosbags-convert --src IN.bag --dst OUT --dst-storage mcap "
    "--dst-typestore ros2_humble (pip install rosbags) makes an MCAP of it",
    b"SQLite format 3": "a database of SQLite, as bags of ROS 2 can be; rosbags-convert --src IN "
    "--dst OUT --dst-storage mcap (pip install rosbags) makes an MCAP of a bag",
    b"PK\x03\x04": "a ZIP archive, as spreadsheets are; save the table as CSV",
    b"\x93NUMPY": "an array of NumPy; numpy.savetxt writes a table",
    b"\x1f\x8b": "compressed by gzip; unpack it",
    b"\xff\xfe": "UTF-16; save it as UTF-8",
    b"MATLAB": "a file of MATLAB; writetable makes a CSV",
}
"""Kinds of files that are no text, by their first bytes, with advice."""


def csv_rows(path: Path, noun: str) -> list[tuple[int, list[str]]]:
    """Read the rows of a CSV file, the header first, each with the number of its line.

    Empty lines and those beginning with # are skipped; `noun` names the file in messages.

    Raises:
        JointplayError: it cannot be read or is empty, a quote is not closed, or a row has not as
            many cells as the header.
    """
    text = read_text(path, noun)
    rows: list[tuple[int, list[str]]] = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = next(csv.reader([line], strict=True))
        except csv.Error as error:
            raise JointplayError(f"{path}, line {number}: {error}") from None
        if rows and len(cells) != len(rows[0][1]):
            fault = f"{len(rows[0][1])} cells expected, got {len(cells)}"
            raise JointplayError(f"{path}, line {number}: {fault}")
        rows.append((number, cells))
    if not rows:
        raise JointplayError(f"the {noun} {str(path)!r} is empty")
    return rows


@cache
def shipped_table(module: str, name: str) -> dict[str, Any]:
    """Read ``data/NAME.toml`` beside a module, which is given by its ``__file__``."""
    import tomllib  # seldom needed

    with (Path(module).parent / "data" / f"{name}.toml").open("rb") as file:
        return tomllib.load(file)


def names_for(labels: Iterable[str], ending: str) -> list[str]:
    """Make a file name from each label, valid on every file system and distinct from the others."""
    names: list[str] = []
    for label in labels:
        stem = re.sub(r"[^\w.+-]+", "_", label).strip("._") or "unnamed"
        stem = stem.encode()[:_LONGEST_NAME].decode(errors="ignore")
        name, number = f"{stem}{ending}", 2
        while name.lower() in (earlier.lower() for earlier in names):
            name, number = f"{stem}_{number}{ending}", number + 1
        names.append(name)
    return names


def check_new(path: str | Path) -> Path:
    """Raise, before any work is done, unless a new file can be written at a path.

    Raises:
        JointplayError: it exists, or its folder does not, or cannot be written to.
    """
    path = Path(path)
    with system_errors(f"cannot write {str(path)!r}"):
        with suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()  # raises for impossible names
            raise exists(path)
        if not path.parent.is_dir():
            raise JointplayError(f"cannot write {str(path)!r}: no folder {str(path.parent)!r}")
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    return path


def refuse_present(folder: str | Path, names: Iterable[str]) -> None:
    """Raise, before any work is done, if a folder already holds one of the files."""
    for name in names:
        if os.path.lexists(Path(folder) / name):
            raise JointplayError(_present(Path(folder), name))


def claim(folder: str | Path, names: Iterable[str]) -> Path:
    """Make a folder if needed, and lock it for this process, so that `names` can be written there.

    The claim ends with the process, however that ends.

    Raises:
        JointplayError: the folder already holds one of the files, another process has claimed it,
            or it cannot be written to.
    """
    folder = Path(folder)
    with system_errors(f"cannot write to {str(folder)!r}"):
        make_folder(folder)
        if not folder.is_dir():
            raise JointplayError(f"{str(folder)!r} is a file; name a folder for the results")
        _lock(folder)
        refuse_present(folder, names)
        with tempfile.TemporaryFile(dir=folder):
            pass
    return folder


def _lock(folder: Path) -> None:
    """Hold an advisory lock on a folder until this process ends."""
    place = folder.resolve()
    if place in _claimed:
        return
    with ExitStack() as stack:
        descriptor = locks.opened(folder)
        stack.callback(os.close, descriptor)
        if not locks.acquired(descriptor, ENDING_S):
            raise JointplayError(
                f"another process is writing to {str(folder)!r}; choose another folder"
            )
        stack.pop_all()
        _claimed[place] = descriptor


def make_folder(folder: Path) -> None:
    """Make a folder for outputs and those above it, unless they exist.

    Raises:
        OSError: one cannot be made.
    """
    for level in [p for p in (*reversed(folder.parents), folder) if not p.exists()]:
        with suppress(FileExistsError):
            level.mkdir()
            _new_folders.append(level)


@contextmanager
def removing_empty_folders() -> Iterator[None]:
    """Remove, when the block ends, the folders of `make_folder` that are still empty."""
    try:
        yield
    finally:
        while _new_folders:
            with suppress(OSError):
                _new_folders.pop().rmdir()


def empty(folder: Path) -> None:
    """Delete everything in a folder; the folder stays, and so does a claim of it.

    Raises:
        OSError: something cannot be deleted.
    """
    for entry in folder.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        else:
            entry.unlink()


def release(folder: str | Path) -> None:
    """End a claim of this process."""
    descriptor = _claimed.pop(Path(folder).resolve(), None)
    if descriptor is not None:
        os.close(descriptor)


def _present(folder: Path, name: str) -> str:
    """Message for a file that is in the way: a result, or a broken one left by a killed run."""
    from jointplay.base import hdf5

    path = folder / name
    state = "empty" if is_file(path) and path.stat().st_size == 0 else ""
    if begins(path, _HDF5):
        try:
            with hdf5.examined(path):
                pass
        except JointplayError:
            state = "broken"
    if not state:
        return f"{str(folder)!r} already holds results ({name}); choose another folder"
    return (
        f"{str(path)!r} is {state}, left by a run that was killed or damaged since; delete it, or "
        "choose another folder"
    )
