"""HDF5 files of strangers, looked at by a process of their own before this one reads them.

HDF5 does what a file says: it takes numbers from other files that the file names (external
storage, external links, virtual datasets), loads filters, and crashes or hangs over what was made
to do that. So another process reads all of it first. What is stored otherwise than results are is
refused before a number is read, by a process that at that time cannot open any file; what crashes,
fills the memory or never ends does so there.

This file is also the program of that process, which must start quickly: it imports nothing of
jointplay.
"""

import math
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

try:
    import resource
except ImportError:  # Windows: the parent's time limit holds alone
    resource = None  # type: ignore[assignment]

TIME_S = 60.0
"""Longest processor time that reading a file may take, and 1 s for each megabyte [s]."""

WAITS = 20.0
"""Longest time on the clock, as a multiple: a busy machine is no reason to refuse a file."""

MEMORY_SHARE = 0.8
"""Part of this machine's memory that a file may fill."""

_FILTERS = {1: "deflate", 2: "shuffle", 3: "fletcher32"}
"""What the numbers of a file may have gone through."""

_MOST_PACKED = 1100
"""No chunk unpacks to more times its size: deflate gives 1032 at most."""

_SMALL = 1 << 20
"""Datasets up to this size may claim more than they store [bytes]."""

_AT_ONCE = 1 << 23
"""What is read at once [bytes]."""

_REFUSED = 3
"""Exit status of the process that has found what a file may not have."""


@contextmanager
def examined(path: Path) -> Iterator[None]:
    """Have another process read an HDF5 file while the block runs, and wait for what it says.

    Raises:
        JointplayError: the file is damaged, or has what no result has; the message says which.
    """
    from jointplay.base.errors import JointplayError, damaged

    allowed = TIME_S + path.stat().st_size / 1e6
    command = [sys.executable, "-P", __file__, str(path.absolute())]
    command += [str(math.ceil(allowed)), str(MEMORY_SHARE * memory())]
    try:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
    except OSError as error:
        reason = error.strerror or error
        raise JointplayError(
            f"{str(path)!r} is not read, because the process that would check it cannot be "
            f"started: {reason}"
        ) from None
    too_long = f"reading it did not end within {allowed:.0f} s of processor time"
    try:
        yield
        output, _ = process.communicate(timeout=WAITS * allowed)
    except subprocess.TimeoutExpired:
        waited = f"reading it did not end within {WAITS * allowed:.0f} s"
        raise damaged(path, "result", waited) from None
    finally:
        process.kill()
        process.communicate()
    if hasattr(signal, "SIGXCPU") and process.returncode == -signal.SIGXCPU:
        raise damaged(path, "result", too_long)
    if process.returncode:
        crashed = f"a process that read it crashed ({process.returncode})"
        refused = process.returncode == _REFUSED
        raise damaged(path, "result", output.decode("utf-8", "replace") if refused else crashed)


def memory() -> float:
    """Memory of this machine [bytes]; infinite if it does not tell."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return math.inf


class _Refused(Exception):
    """A file has what no result has."""


def _main(path: str, allowed: str, room: str) -> None:
    """Look at a file: ends with 0, or with `_REFUSED` and the reason on standard output."""
    if resource:
        resource.setrlimit(resource.RLIMIT_CPU, (int(allowed), int(allowed) + 5))
        signal.alarm(int(WAITS * int(allowed)) + 5)  # should the parent be no more
    import h5netcdf
    import h5py

    try:
        with h5py.File(path, "r") as file:
            with _confined(float(room)):
                _check(h5py, file)
            with h5netcdf.File(file, "r") as opened:
                _read(opened)
    except Exception as error:  # noqa: BLE001 - HDF5 raises whatever it stumbles over
        print(" ".join(str(error).split()) or type(error).__name__, flush=True)
        os._exit(_REFUSED)
    os._exit(0)


@contextmanager
def _confined(room: float) -> Iterator[None]:
    """Have this process take no more memory than there is; in the block it can open nothing."""
    if not resource:
        yield
        return
    if math.isfinite(room):
        with suppress(ValueError, OSError):  # a system that keeps no such limit
            resource.setrlimit(resource.RLIMIT_AS, (int(room), int(room)))
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def _check(h5py: Any, file: Any) -> None:
    root = file["/"].id
    _check_attributes(h5py, root, "/")
    for name in root:
        shown = name.decode("utf-8", "replace")
        kind = root.links.get_info(name).type
        if kind != h5py.h5l.TYPE_HARD:
            words = {h5py.h5l.TYPE_SOFT: "a soft link", h5py.h5l.TYPE_EXTERNAL: "an external link"}
            raise _Refused(f"{shown!r} is {words.get(kind, 'a link of an unknown kind')}")
        dataset = h5py.h5o.open(root, name)
        if not isinstance(dataset, h5py.h5d.DatasetID):
            raise _Refused(f"{shown!r} is not a dataset")
        _check_storage(h5py, dataset, shown)
        _check_attributes(h5py, dataset, shown)


def _check_storage(h5py: Any, dataset: Any, name: str) -> None:
    """Refuse a dataset whose numbers are not plainly in the file."""
    made = dataset.get_create_plist()
    if made.get_external_count():
        raise _Refused(f"{name!r} is stored in another file (external storage)")
    if made.get_layout() == h5py.h5d.VIRTUAL:
        raise _Refused(f"{name!r} is a virtual dataset, of other files")
    if made.get_layout() not in (h5py.h5d.COMPACT, h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED):
        raise _Refused(f"{name!r} has an unknown layout")
    for number in range(made.get_nfilters()):
        code = made.get_filter(number)[0]
        if code not in _FILTERS:
            known = ", ".join(_FILTERS.values())
            raise _Refused(f"{name!r} has the filter {code}; known are {known}")
    kind = dataset.get_type()
    if not _plain(h5py, kind):
        raise _Refused(f"{name!r} holds neither numbers nor text")
    claimed = math.prod(dataset.shape) * kind.get_size()
    if claimed > _SMALL + _MOST_PACKED * dataset.get_storage_size():
        raise _Refused(f"{name!r} claims {claimed:.3g} bytes, which the file does not hold")


def _check_attributes(h5py: Any, one: Any, name: str) -> None:
    for number in range(h5py.h5a.get_num_attrs(one)):
        attribute = h5py.h5a.open(one, index=number)
        label, kind = attribute.name.decode("utf-8", "replace"), attribute.get_type()
        if not (_plain(h5py, kind) or _list_of_dimensions(h5py, label, kind)):
            raise _Refused(f"the attribute {label!r} of {name!r} holds neither numbers nor text")


def _plain(h5py: Any, kind: Any) -> bool:
    """Whether it is a type of numbers that numpy has, or of text."""
    numbers = (h5py.h5t.INTEGER, h5py.h5t.FLOAT)
    if kind.committed():
        return False
    return kind.get_class() == h5py.h5t.STRING or (
        kind.get_class() in numbers and kind.get_size() in (1, 2, 4, 8)
    )


def _list_of_dimensions(h5py: Any, label: str, kind: Any) -> bool:
    """Whether it is one of the two lists that join datasets to their dimensions."""

    def leads_to_an_object(kind: Any) -> bool:
        return bool(kind.equal(h5py.h5t.STD_REF_OBJ))

    if kind.committed():
        return False
    if label == "DIMENSION_LIST" and kind.get_class() == h5py.h5t.VLEN:
        return leads_to_an_object(kind.get_super())
    if label == "REFERENCE_LIST" and kind.get_class() == h5py.h5t.COMPOUND:
        return (
            kind.get_nmembers() == 2
            and leads_to_an_object(kind.get_member_type(0))
            and kind.get_member_type(1).get_class() == h5py.h5t.INTEGER
        )
    return False


def _read(opened: Any) -> None:
    dict(opened.attrs)
    for variable in opened.variables.values():
        dict(variable.attrs)
        _ = variable.dimensions
        if not variable.shape:
            _ = variable[()]
            continue
        row = math.prod(variable.shape[1:]) * 8
        rows = max(_AT_ONCE // max(row, 1), 1)
        if variable.chunks:
            rows = max(rows // variable.chunks[0], 1) * variable.chunks[0]
        for first in range(0, variable.shape[0], rows):
            _ = variable[first : first + rows]


if __name__ == "__main__":
    _main(*sys.argv[1:])
