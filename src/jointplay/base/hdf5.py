"""HDF5 files of strangers, looked at by a process of their own before this one reads them.

HDF5 does what a file says: it takes numbers from other files that the file names (external
storage, external links, virtual datasets), loads filters, and crashes or hangs over what was made
to do that. So another process reads all of it first. What is stored otherwise than results are is
refused before a number is read, by a process that at that time cannot open any file; what crashes,
fills the memory or never ends does so there.

The process runs `serve`; it must start quickly, and so imports nothing else of jointplay.
"""

import codecs
import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jointplay.base import confined
from jointplay.base.errors import damaged

TIME_S = 60.0
"""Longest processor time that reading a file may take, and 1 s for each megabyte [s]."""

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
    allowed = TIME_S + path.stat().st_size / 1e6
    room = confined.MEMORY_SHARE * confined.memory()
    with confined.process(__name__, path, allowed, room) as process:
        yield
        output, _ = process.communicate()
    if process.returncode == _REFUSED:
        raise damaged(path, "result", output.decode("utf-8", "replace"))
    if process.returncode:
        raise damaged(path, "result", f"reading it {confined.ended(process, allowed)}")


class _Refused(Exception):
    """A file has what no result has."""


def serve(path: str) -> None:
    """Look at a file: ends with 0, or with `_REFUSED` and the reason on standard output."""
    import h5netcdf
    import h5py

    codecs.lookup("ascii")  # which h5py would open a file for
    try:
        with h5py.File(path, "r") as file:
            with confined.closed():
                _check(h5py, file)
            with h5netcdf.File(file, "r") as opened:
                _read(opened)
    except Exception as error:  # noqa: BLE001 - HDF5 raises whatever it stumbles over
        sys.stdout.write(" ".join(str(error).split()) or type(error).__name__)
        sys.stdout.flush()
        os._exit(_REFUSED)
    os._exit(0)


def _check(h5py: Any, file: Any) -> None:
    """Refuse what no result has: all of its numbers and texts are plainly in the file."""
    _check_attributes(h5py, file)
    for name in file:
        link = type(file.get(name, getlink=True)).__name__
        if link != "HardLink":
            kinds = {"SoftLink": "a soft link", "ExternalLink": "an external link"}
            raise _Refused(f"{name!r} is {kinds.get(link, 'a link of an unknown kind')}")
        dataset = file[name]
        if not isinstance(dataset, h5py.Dataset):
            raise _Refused(f"{name!r} is not a dataset")
        if dataset.external:
            raise _Refused(f"{name!r} is stored in another file (external storage)")
        if dataset.is_virtual:
            raise _Refused(f"{name!r} is a virtual dataset, of other files")
        filters = dataset.id.get_create_plist()
        for code in (filters.get_filter(number)[0] for number in range(filters.get_nfilters())):
            if code not in _FILTERS:
                known = ", ".join(_FILTERS.values())
                raise _Refused(f"{name!r} has the filter {code}; known are {known}")
        if not _plain(h5py, dataset.dtype):
            raise _Refused(f"{name!r} holds neither numbers nor text")
        if dataset.nbytes > _SMALL + _MOST_PACKED * dataset.id.get_storage_size():
            claimed = f"claims {dataset.nbytes:.3g} bytes, which the file does not hold"
            raise _Refused(f"{name!r} {claimed}")
        _check_attributes(h5py, dataset)


def _check_attributes(h5py: Any, owner: Any) -> None:
    pairs = {"DIMENSION_LIST", "REFERENCE_LIST"}  # these join datasets to their dimensions
    for label in owner.attrs:
        kind = owner.attrs.get_id(label).dtype
        inner = [h5py.check_vlen_dtype(kind) or kind] if not kind.names else [kind[0], kind[1]]
        refers = label in pairs and h5py.check_ref_dtype(inner[0]) is h5py.Reference
        if not (_plain(h5py, kind) or (refers and all(_plain(h5py, n) for n in inner[1:]))):
            name = owner.name.lstrip("/") or "/"
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
