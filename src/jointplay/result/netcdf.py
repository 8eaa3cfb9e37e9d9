"""Datasets as NetCDF files that can be trusted to be whole: made in memory, sealed by a checksum.

HDF5 ends the process if it closes a file on a full disk, and a file with a flipped bit can keep it
busy for ever. So it writes to memory only, and the bytes then go to disk like those of any file
(`files.write`). Behind them stands a line with their SHA-256: NetCDF readers do not see it, and
HDF5 is not shown anything that has changed since. Nor is it shown anything here that another
process has not read before (`hdf5.examined`): a stranger seals what he likes.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO

from jointplay.core.errors import JointplayError
from jointplay.core.files import system_errors
from jointplay.core.hdf5 import MEMORY_SHARE, damaged, examined, memory

if TYPE_CHECKING:
    import xarray as xr

SEAL = b"\njointplay sha256 "
"""What stands between a file's content and its checksum, which ends the file with a newline."""

_CHANGED = "its checksum does not match (cut short, or changed since)"

_PIECE = 1 << 20
"""Bytes that are read at once for a checksum."""

_SEALED = len(SEAL) + 64 + 1


def pack(dataset: xr.Dataset) -> bytes:
    """The file that holds `dataset`, compressed and sealed."""
    content = bytes(dataset.to_netcdf(None, engine="h5netcdf", encoding=compression(dataset)))
    return seal(content)


def compression(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """How the variables are compressed, by name."""
    return {
        str(name): {"zlib": True, "complevel": 1, "shuffle": True}
        for name, variable in dataset.data_vars.items()
        if variable.dtype.kind in "fi"
    }


def seal(content: bytes) -> bytes:
    """`content` with its checksum behind it."""
    return content + SEAL + hashlib.sha256(content).hexdigest().encode() + b"\n"


def digest(file: BinaryIO, size: int | None = None) -> bytes:
    """Checksum of what `file` holds from where it stands, of `size` bytes or to its end."""
    checksum, left = hashlib.sha256(), math.inf if size is None else size
    while left > 0 and (piece := file.read(int(min(_PIECE, left)))):
        checksum.update(piece)
        left -= len(piece)
    return checksum.hexdigest().encode()


def open_lazily(path: Path, indexed: bool = True) -> xr.Dataset:
    """A file that `pack` or `Growing` made, of which is read what is asked for.

    All of it is read once, for its checksum.

    Args:
        path: the file.
        indexed: whether its times are read too, to find records by them.

    Raises:
        JointplayError: damaged, without checksum, or no NetCDF file.
    """
    with system_errors(f"cannot read {str(path)!r}"), path.open("rb") as file:
        size = file.seek(0, os.SEEK_END) - _SEALED
        file.seek(max(size, 0))
        sealed = file.read()
        file.seek(0)
        if size < 0 or not sealed.startswith(SEAL):
            raise damaged(path, "it has no checksum, so that it must be loaded whole")
        if sealed != SEAL + digest(file, size) + b"\n":
            raise damaged(path, _CHANGED)
    with _examined(path) as xr:
        return xr.open_dataset(path, engine="h5netcdf", cache=False, create_default_indexes=indexed)


def load(path: Path) -> xr.Dataset:
    """Read a file that `pack` made, or another program.

    Raises:
        JointplayError: damaged, no NetCDF file, or larger than this machine's memory.
    """
    with system_errors(f"cannot read {str(path)!r}"):
        content = path.read_bytes()
    body, sealed = content[:-_SEALED], content[-_SEALED:]
    if sealed.startswith(SEAL):
        if sealed != seal(body)[-_SEALED:]:
            raise damaged(path, _CHANGED)
        content = body
    with (
        _examined(path) as xr,
        xr.open_dataset(io.BytesIO(content), engine="h5netcdf") as dataset,
    ):
        largest = MEMORY_SHARE * memory()
        if dataset.nbytes > largest:  # a small file can claim to hold any size
            raise JointplayError(
                f"{str(path)!r} holds {dataset.nbytes / 1e9:.3g} GB, more than the "
                f"{largest / 1e9:.3g} GB that this machine has for it"
            )
        return dataset.load()


@contextmanager
def _examined(path: Path) -> Iterator[ModuleType]:
    """Give xarray to the block once another process has read the file; what HDF5 raises is damage.

    Raises:
        JointplayError: naming the file.
    """
    try:
        with examined(path):  # meanwhile
            import xarray as xr
        yield xr
    except JointplayError:
        raise
    except Exception as error:  # HDF5 raises whatever it stumbles over
        raise damaged(path, error) from None
