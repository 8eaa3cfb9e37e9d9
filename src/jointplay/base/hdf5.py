"""HDF5 files of strangers, looked at by a process of their own before this one reads them.

HDF5 does what a file says: it takes numbers from other files that the file names (external
storage, external links, virtual datasets), loads filters, and crashes or hangs over what was made
to do that. So another process reads all of it first. What is stored otherwise than results are is
refused before a number is read, by a process that at that time cannot open any file; what crashes,
fills the memory or never ends does so there.

This file is also the program of that process, which must start quickly: it imports nothing of
jointplay.
"""

import codecs
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

    codecs.lookup("ascii")  # which h5py would open a file for
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
    """Refuse what no result has: all of its numbers and texts are plainly in the file."""
    _check_attributes(h5py, file)
    for name in file:
        link = type(file.get(name, getlink=True)).__name__
        if link != "HardLink":
            words = {"SoftLink": "a soft link", "ExternalLink": "an external link"}
            raise _Refused(f"{name!r} is {words.get(link, 'a link of an unknown kind')}")
        dataset = file[name]
        if not isinstance(dataset, h5py.Dataset):
            raise _Refused(f"{name!r} is not a dataset")
        if dataset.external:
            raise _Refused(f"{name!r} is stored in another file (external storage)")
        if dataset.is_virtual:
            raise _Refused(f"{name!r} is a virtual dataset, of other files")
        made = dataset.id.get_create_plist()
        for code in (made.get_filter(number)[0] for number in range(made.get_nfilters())):
            if code not in _FILTERS:
                known = ", ".join(_FILTERS.values())
                raise _Refused(f"{name!r} has the filter {code}; known are {known}")
        if not _plain(h5py, dataset.dtype):
            raise _Refused(f"{name!r} holds neither numbers nor text")
        if dataset.nbytes > _SMALL + _MOST_PACKED * dataset.id.get_storage_size():
            claimed = f"claims {dataset.nbytes:.3g} bytes, which the file does not hold"
            raise _Refused(f"{name!r} {claimed}")
        _check_attributes(h5py, dataset)


def _check_attributes(h5py: Any, one: Any) -> None:
    pairs = {"DIMENSION_LIST", "REFERENCE_LIST"}  # these join datasets to their dimensions
    for label in one.attrs:
        kind = one.attrs.get_id(label).dtype
        inner = [h5py.check_vlen_dtype(kind) or kind] if not kind.names else [kind[0], kind[1]]
        refers = label in pairs and h5py.check_ref_dtype(inner[0]) is h5py.Reference
        if not (_plain(h5py, kind) or (refers and all(_plain(h5py, n) for n in inner[1:]))):
            name = one.name.lstrip("/") or "/"
            raise _Refused(f"the attribute {label!r} of {name!r} holds neither numbers nor text")


def _plain(h5py: Any, kind: Any) -> bool:
    """Whether it is a type of numbers that numpy has, or of text."""
    numbers = kind.kind in "iuf" and kind.itemsize <= 8
    return numbers or h5py.check_string_dtype(kind) is not None


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
