"""Files that are there whole or not at all: written beside their name, synced, then renamed.

A process that is killed leaves at most ``.NAME.PID.part``, which blocks nothing and may be deleted.
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
"""Files that this process has written, in order: what a message may truly say is kept."""

_claimed: dict[Path, int] = {}
"""Folders that this process writes to, each with the descriptor that holds its lock."""

_new_folders: list[Path] = []
"""Folders that this process has made to write into, in order."""

_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}
"""What file systems without hard links say."""

MARK = ".jointplay-owner"
"""Name of the file in a temporary folder of ours that says of which machine it is; its owner holds
a lock on it, which ends with the owner."""

ENDING_S = 1.0
"""How long a folder's lock is waited for [s]: a killed command's workers hold it until they end."""

LEFT_S = 86400.0
"""Temporary folders whose owner is dead are deleted when they are older [s] (judged: a
day, so that none of a machine whose clock is off by a time zone is taken for dead)."""

_swept: set[str] = set()
"""Places in which this process has looked for them."""

MOST_TEXT = 256_000_000
"""Size of a text that is read: URDF, scenario, table [bytes] (judged: a motion of a million
rows of 100 bytes, and as much again)."""

_HDF5 = b"\x89HDF"
"""How results begin."""

_LONGEST_NAME = 100
"""Bytes of a file's name that are taken of a label: file systems take 255 with endings."""

PICTURES = {"png": "Software", "pdf": "Creator", "svg": "Creator"}
"""Formats of pictures, each with the entry of its metadata that names the program."""


@contextmanager
def system_errors(failure: str) -> Iterator[None]:
    """Say of errors of the system, and of names that no file can have, what could not be done."""
    try:
        yield
    except JointplayError:
        raise
    except (OSError, ValueError) as error:
        raise JointplayError(f"{failure}: {getattr(error, 'strerror', None) or error}") from None


def write(
    path: str | Path, content: str | bytes, *, overwrite: bool = False, announced: bool = True
) -> Path:
    """Write a file as `writing` does; text as UTF-8, line ends as they are."""
    with writing(path, overwrite=overwrite, announced=announced) as file:
        file.write(content.encode("utf-8") if isinstance(content, str) else content)
    return Path(path)


def picture(
    path: str | Path, figure: Any, *, overwrite: bool = False, mark: str = "", **options: Any
) -> Path:
    """Draw a matplotlib figure into a file, whole or not at all; see `writing`.

    Args:
        path: the file; its suffix says the format, one of `PICTURES`.
        figure: what has matplotlib's `savefig`, with these `options`.
        overwrite: whether a file of that name is replaced.
        mark: stands in the picture's metadata; a picture that holds it is replaced.
    """
    content = drawn(figure, _picture_format(Path(path)), mark, **options)
    return write_picture(path, content, overwrite=overwrite, mark=mark)


def drawn(figure: Any, kind: str, mark: str = "", **options: Any) -> bytes:
    """A matplotlib figure in one of the formats of `PICTURES`; see `picture`."""
    if mark:
        options["metadata"] = {PICTURES[kind]: mark}
    content = io.BytesIO()
    figure.savefig(content, format=kind, **options)
    return content.getvalue()


def write_picture(
    path: str | Path, content: bytes, *, overwrite: bool = False, mark: str = ""
) -> Path:
    """Write what was `drawn`, in place of a picture that holds the mark; see `picture`."""
    overwrite = overwrite or bool(mark and holds(Path(path), mark))
    return write(path, content, overwrite=overwrite)


def _picture_format(path: Path) -> str:
    kind = path.suffix.lower().removeprefix(".")
    if kind not in PICTURES:
        raise JointplayError(f"{path.name!r} must end in .{', .'.join(PICTURES)}: a picture")
    return kind


def check_picture(path: str | Path) -> Path:
    """Refuse a picture that cannot be drawn anew, before any work is done, as `check_new` does."""
    path = check_new(path)
    _picture_format(path)
    return path


def holds(path: Path, mark: str) -> bool:
    """Whether there is a file that holds a mark: a picture drawn by an earlier run."""
    return is_file(path) and mark.encode() in path.read_bytes()


def begins(path: Path, mark: bytes) -> bool:
    """Whether there is a file that begins with a mark: a working file of an earlier run."""
    if not is_file(path):
        return False
    with path.open("rb") as file:
        return file.read(len(mark)) == mark


def check_own(path: Path, mark: bytes, noun: str) -> None:
    """Refuse a working file in whose place another file is, before any work is done.

    Raises:
        JointplayError: a file is there that does not begin with `mark`, or cannot be read.
    """
    with system_errors(f"cannot write {str(path)!r}"):
        if not os.path.lexists(path) or begins(path, mark):
            return
    refusal = "one would be written there; move it, or choose another place for the results"
    raise JointplayError(f"{str(path)!r} is not a {noun} of jointplay, and {refusal}")


def remove_own(path: Path, mark: bytes) -> None:
    """Delete a working file, if it is one: other files of that name stay."""
    with suppress(OSError):
        if begins(path, mark):
            path.unlink()


@contextmanager
def writing(
    path: str | Path, *, overwrite: bool = False, announced: bool = True
) -> Iterator[BinaryIO]:
    """A file to be written, and read, in the block; it gets its name when all is on disk.

    After a crash, a kill or a full disk it is there complete, or not at all.

    An announced one the user asked for, and is told of after an interruption.

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
    try:
        os.link(part, path)  # fails if the name is taken, which a rename does not
    except OSError as error:
        if isinstance(error, FileExistsError) or os.path.lexists(path):
            raise exists(path) from None
        if error.errno not in _NO_LINKS:
            raise
        part.rename(path)


def _sync(folder: Path) -> None:
    """Have the new name survive a power failure, where the system can do that."""
    with suppress(OSError), ExitStack() as stack:
        descriptor = os.open(folder, os.O_RDONLY)
        stack.callback(os.close, descriptor)
        os.fsync(descriptor)


def exists(path: Path) -> JointplayError:
    """What to say of a file that is there already."""
    return JointplayError(f"{str(path)!r} already exists; choose another name")


def cannot_write(path: Path, error: Exception) -> JointplayError:
    """What to say of a file that cannot be written."""
    return JointplayError(f"cannot write {str(path)!r}: {getattr(error, 'strerror', '') or error}")


def temporary(noun: str = "files") -> tempfile.TemporaryDirectory[str]:
    """A folder, named after `noun`, that goes with the block or with this process.

    Those of processes that were killed, marked as ours and older than a day, are deleted first.
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
    except OSError:  # a file system without locks: nothing there would say that this one lives
        mark.unlink()
    return folder


def _sweep(place: Path) -> None:
    """Delete the temporary folders of dead processes."""
    import socket  # takes long to import

    for folder in place.glob("jointplay-*"):
        with suppress(OSError, ValueError), ExitStack() as stack:
            mark = (folder / MARK).lstat()
            user = os.getuid() if hasattr(os, "getuid") else mark.st_uid  # Windows keeps none
            ours = mark.st_uid == folder.lstat().st_uid == user
            plain = stat.S_ISREG(mark.st_mode) and not folder.is_symlink()
            if not (ours and plain and time.time() - mark.st_mtime > LEFT_S):
                continue
            file = stack.enter_context((folder / MARK).open(encoding="utf-8"))
            locks.lock(file.fileno())  # fails while the owner lives
            if file.read() == socket.gethostname():
                shutil.rmtree(folder, ignore_errors=True)


def is_file(path: Path) -> bool:
    """Whether there is such a file; False also for names that none can have."""
    return os.path.isfile(path)


def cache_folder() -> Path:
    """Where what takes long to find is kept: ``JOINTPLAY_CACHE``, else in the user's cache."""
    default = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser(default)
    return Path(os.environ.get("JOINTPLAY_CACHE") or Path(user) / "jointplay")


def is_folder(path: Path) -> bool:
    """Whether there is such a folder; False also for names that none can have."""
    return os.path.isdir(path)


def require_file(path: Path, noun: str) -> None:
    """Refuse what is no file to be read: there is nothing, or another kind of thing."""
    if is_file(path):
        return
    kinds = {stat.S_IFDIR: "folder", stat.S_IFIFO: "pipe", stat.S_IFSOCK: "socket",
             stat.S_IFCHR: "device", stat.S_IFBLK: "device"}  # fmt: skip
    kind = None
    with suppress(OSError, ValueError):
        kind = kinds.get(stat.S_IFMT(path.stat().st_mode))
    raise JointplayError(f"no {noun} {str(path)!r}" + (f": it is a {kind}" if kind else ""))


def arrays(path: Path | BinaryIO) -> dict[str, np.ndarray]:
    """All arrays of an ``.npz`` file, by its name or open, none of which may hold objects.

    Raises:
        OSError, ValueError: it cannot be read; it is damaged, or another kind of file.
    """
    import numpy as np

    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except OSError:
        raise
    except Exception as error:  # noqa: BLE001
        # zipfile, zlib and numpy raise whatever damaged bytes make them do
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None


def check_plain(path: Path, most: int) -> None:
    """Refuse what is no plain file of at most `most` bytes, before it is opened.

    Raises:
        OSError, ValueError: it cannot be looked at; it is of another kind, or larger.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is not a regular file")
    if status.st_size > most:
        size = f"{status.st_size / 1e6:.4g} MB"
        raise ValueError(f"it has {size}; at most {most / 1e6:g} MB are read")


def read_plain(path: Path, most: int) -> bytes:
    """What a plain file says, as `check_plain`: devices, pipes and giants are not opened."""
    check_plain(path, most)
    with path.open("rb") as file:
        data = file.read(most + 1)  # what grows meanwhile, or says nothing of its size
    if len(data) > most:
        raise ValueError(f"it has more than {most / 1e6:g} MB")
    return data


def read_text(path: Path, noun: str, most: int = MOST_TEXT) -> str:
    """The UTF-8 text of a plain file of at most `most` bytes; `noun` it is, for messages.

    Raises:
        JointplayError: it cannot be read, is another kind of thing, larger, or other text.
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
    b"PK\x03\x04": "a ZIP archive, as spreadsheets are; save the table as CSV",
    b"\x93NUMPY": "an array of NumPy; numpy.savetxt writes a table",
    b"\x1f\x8b": "compressed by gzip; unpack it",
    b"\xff\xfe": "UTF-16; save it as UTF-8",
    b"MATLAB": "a file of MATLAB; writetable makes a CSV",
}
"""What files are that are no text, by their first bytes."""


def csv_rows(path: Path, noun: str) -> list[tuple[int, list[str]]]:
    """Rows of a CSV file, each with the number of its line; lines beginning with # are comments.

    A row is a line, the first the header; `noun` the file is, for messages.

    Raises:
        JointplayError: it cannot be read, is empty, a quote is not closed, or a row has not as many
            cells as the header.
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
    """What the file ``data/NAME.toml`` beside a module, given by its own file, says."""
    import tomllib  # seldom needed

    with (Path(module).parent / "data" / f"{name}.toml").open("rb") as file:
        return tomllib.load(file)


def names_for(labels: Iterable[str], ending: str) -> list[str]:
    """A file's name for each label: itself, but for what some file system does not take.

    None names a folder or another one's file, whatever the labels are.
    """
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
    """Refuse a file that cannot be written anew, before any work is done.

    Raises:
        JointplayError: it exists, or its folder does not or cannot be written to.
    """
    path = Path(path)
    with system_errors(f"cannot write {str(path)!r}"):
        with suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()  # which refuses names that no file can have
            raise exists(path)
        if not path.parent.is_dir():
            raise JointplayError(f"cannot write {str(path)!r}: no folder {str(path.parent)!r}")
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    return path


def refuse_present(folder: str | Path, names: Iterable[str]) -> None:
    """Refuse a folder that holds one of the files already, before any work is done."""
    for name in names:
        if os.path.lexists(Path(folder) / name):
            raise JointplayError(_present(Path(folder), name))


def claim(folder: str | Path, names: Iterable[str]) -> Path:
    """Make `folder`, sure that `names` can be written there and that no other process writes there.

    The claim ends with the process, however it ends.

    Raises:
        JointplayError: the folder holds one of the files already, another process has claimed it,
            or it cannot be written to.
    """
    folder = Path(folder)
    with system_errors(f"cannot write to {str(folder)!r}"):
        for level in [p for p in (*reversed(folder.parents), folder) if not p.exists()]:
            with suppress(FileExistsError):
                level.mkdir()
                _new_folders.append(level)
        if not folder.is_dir():
            raise JointplayError(f"{str(folder)!r} is a file; name a folder for the results")
        _lock(folder)
        refuse_present(folder, names)
        with tempfile.TemporaryFile(dir=folder):
            pass
    return folder


def _lock(folder: Path) -> None:
    """Hold an advisory lock on the folder itself until this process ends."""
    place = folder.resolve()
    if place in _claimed:
        return
    with ExitStack() as stack:
        descriptor = locks.opened(folder)
        stack.callback(os.close, descriptor)
        until = time.monotonic() + ENDING_S
        while True:
            try:
                locks.lock(descriptor)
                break
            except BlockingIOError:
                if time.monotonic() > until:
                    text = f"another process is writing to {str(folder)!r}; choose another folder"
                    raise JointplayError(text) from None
                time.sleep(0.02)
            except OSError:  # a file system that locks no folders
                return
        stack.pop_all()
        _claimed[place] = descriptor


def remove_made_folders() -> None:
    """Remove the folders that `claim` has made, as far as nothing is in them."""
    while _new_folders:
        with suppress(OSError):
            _new_folders.pop().rmdir()


def empty(folder: Path) -> None:
    """Delete all that is in a folder, which stays, and so does a claim of it.

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
    """What to say of a file that is in the way: whether it is whole, or the rest of a run."""
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
