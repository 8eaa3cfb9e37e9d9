"""Untrusted HDF5 files: examined by a process of their own before this one reads them.

HDF5 obeys a file: it takes numbers from other files that it names (external storage, external
links, virtual datasets), loads filters, and crashes or hangs on files made for that. So another
process reads all of it first. Anything stored otherwise than results are is refused before a number
is read, by a process that at that time cannot open any file; a crash, full memory or an endless
loop happens there.

The process runs `serve`. It must start quickly, so this module imports little else of jointplay.
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
"""Processor time allowed for reading a file, besides 1 s per megabyte [s]."""

_FILTERS = {1: "deflate", 2: "shuffle", 3: "fletcher32"}
"""HDF5 filters that are allowed."""

_MOST_PACKED = 1100
"""Largest compression ratio that is believed; deflate reaches 1032 at most."""

_SMALL = 1 << 20
"""Size up to which a dataset may claim more than it stores [bytes]."""

_AT_ONCE = 1 << 23
"""Size of the portions in which datasets are read [bytes]."""

_REFUSED = 3
"""Exit status of the process that has found something forbidden in a file."""


@contextmanager
def examined(path: Path) -> Iterator[None]:
    """Have another process examine an HDF5 file while the block runs, then wait for its verdict.

    Raises:
        JointplayError: the file is damaged, or has something that no result has; the message names
            it.
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
    """A file has something that no result has."""


def serve(path: str) -> None:
    """Examine a file; exits with 0, or with `_REFUSED` and the reason on standard output."""
    import h5netcdf
    import h5py

    codecs.lookup("ascii")  # h5py needs it, and could not load it while files are `closed`
    try:
        with h5py.File(path, "r") as file:
            with confined.closed():
                _check(h5py, file)
            with h5netcdf.File(file, "r") as opened:
                _read(opened)
    except Exception as error:  # noqa: BLE001 - HDF5 may raise anything
        sys.stdout.write(" ".join(str(error).split()) or type(error).__name__)
        sys.stdout.flush()
        os._exit(_REFUSED)
    os._exit(0)


def _check(h5py: Any, file: Any) -> None:
    """Raise unless all numbers and texts are stored in the file itself, as results have them."""
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
    """Raise unless attributes are numbers or text, or link datasets to their dimensions."""
    pairs = {"DIMENSION_LIST", "REFERENCE_LIST"}
    for label in owner.attrs:
        kind = owner.attrs.get_id(label).dtype
        inner = [h5py.check_vlen_dtype(kind) or kind] if not kind.names else [kind[0], kind[1]]
        refers = label in pairs and h5py.check_ref_dtype(inner[0]) is h5py.Reference
        if not (_plain(h5py, kind) or (refers and all(_plain(h5py, n) for n in inner[1:]))):
            name = owner.name.lstrip("/") or "/"
            raise _Refused(f"the attribute {label!r} of {name!r} holds neither numbers nor text")


def _plain(h5py: Any, kind: Any) -> bool:
    """Whether a type is one of numpy's numbers, or text."""
    numbers = kind.kind in "iuf" and kind.itemsize <= 8
    return numbers or h5py.check_string_dtype(kind) is not None


def _read(opened: Any) -> None:
    """Read everything in a file, in portions, so that damage shows."""
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
