"""Datasets as NetCDF files, sealed by a checksum that shows whether they are complete.

HDF5 ends the process if it closes a file on a full disk, and a file with a flipped bit can keep it
busy for ever. So it writes to memory only, and the bytes then go to disk like those of any file
(`files.write`). Behind them stands a line with their SHA-256, which NetCDF readers do not see; a
file that has changed since is not given to HDF5. Anyone can compute a checksum, so that another
process reads each file first (`hdf5.examined`).

A file that is too large for memory is written portion by portion (`GrowingDataset`).
"""

from __future__ import annotations

import hashlib
import io
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from jointplay.base import files
from jointplay.base.confined import MEMORY_SHARE, memory
from jointplay.base.errors import JointplayError, damaged
from jointplay.base.files import system_errors
from jointplay.base.hdf5 import examined

if TYPE_CHECKING:
    import xarray as xr

SEAL = b"\njointplay sha256 "
"""Mark between a file's content and its checksum, which with a newline ends the file."""
CHUNK = 4096
"""Number of records that are compressed together."""
INDEX_BYTES = 1 << 18
"""Memory for the index of the chunks, however many there are [bytes]."""

_UNSEALED = "it does not end with its checksum (cut short, or written by another program)"

_CHANGED = "its checksum does not match (cut short, or changed since)"

_PIECE = 1 << 20
"""Bytes that are read at once for a checksum."""

_SEALED = len(SEAL) + 64 + 1
"""Bytes of the seal: mark, checksum, newline."""


def pack(dataset: xr.Dataset) -> bytes:
    """The file that holds `dataset`, compressed and sealed."""
    return seal(_netcdf(dataset, compression(dataset)))


def _netcdf(
    dataset: xr.Dataset, encoding: Mapping[str, Mapping[str, Any]], growing: Sequence[str] = ()
) -> bytes:
    """The file that holds `dataset`, some of whose dimensions may be `growing`.

    It is the file of `Dataset.to_netcdf`, which would take a quarter of a second longer, to import
    dask's schedulers, where they are installed, and ask whether one is at work.
    """
    from xarray.backends import H5NetCDFStore

    content = io.BytesIO()
    store = H5NetCDFStore.open(content, mode="w", lock=False)
    try:
        dataset.dump_to_store(store, encoding=encoding, unlimited_dims=growing)
    finally:
        store.close()
    return content.getvalue()


def compression(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Compression of the variables, by name."""
    return {
        str(name): {"zlib": True, "complevel": 1, "shuffle": True}
        for name, variable in dataset.data_vars.items()
        if variable.dtype.kind in "fi"
    }


def seal(content: bytes) -> bytes:
    """`content` with its checksum behind it."""
    return content + SEAL + hashlib.sha256(content).hexdigest().encode() + b"\n"


def seal_of(content: bytes) -> str:
    """The checksum that a sealed file ends with."""
    return content[len(SEAL) - _SEALED : -1].decode()


def checksum(path: Path) -> str:
    """The checksum that a file ends with.

    Raises:
        JointplayError: it does not match the content, or there is none.
    """
    with _verified(path) as (file, size):
        file.seek(size)
        return seal_of(file.read())


def digest(file: BinaryIO, size: float = math.inf) -> bytes:
    """Checksum of `file` from its present position on, of `size` bytes or to its end."""
    checksum = hashlib.sha256()
    for piece in _pieces(file, size):
        checksum.update(piece)
    return checksum.hexdigest().encode()


def _pieces(file: BinaryIO, size: float) -> Iterator[bytes]:
    """Content of `file` from its present position on, of `size` bytes or to its end."""
    while size > 0 and (piece := file.read(int(min(_PIECE, size)))):
        yield piece
        size -= len(piece)


@contextmanager
def _verified(path: Path) -> Iterator[tuple[BinaryIO, int]]:
    """Open a file that is unchanged since it was sealed; yields it with the size of its content.

    Raises:
        JointplayError: it cannot be read, is damaged, or has no checksum.
    """
    with system_errors(f"cannot read {str(path)!r}"), path.open("rb") as file:
        size = file.seek(0, os.SEEK_END) - _SEALED
        file.seek(max(size, 0))
        sealed = file.read()
        file.seek(0)
        if size < 0 or not sealed.startswith(SEAL):
            raise damaged(path, "result", _UNSEALED)
        if sealed != SEAL + digest(file, size) + b"\n":
            raise damaged(path, "result", _CHANGED)
        file.seek(0)
        yield file, size


def open_lazily(path: Path, indexed: bool = True) -> xr.Dataset:
    """Open a file that `pack` or `GrowingDataset` made, to be read when values are needed.

    All of it is read once, for its checksum. `indexed`: whether its times are read too, to find
    records by them.

    Raises:
        JointplayError: damaged, without checksum, or no NetCDF file.
    """
    with _verified(path):
        pass
    with _examined(path) as xr:
        return xr.open_dataset(path, engine="h5netcdf", cache=False, create_default_indexes=indexed)


def load(path: Path) -> xr.Dataset:
    """Read a file that `pack` or `GrowingDataset` made.

    Raises:
        JointplayError: damaged, without checksum, or larger than this machine's memory.
    """
    with _verified(path) as (file, size):
        body = file.read(size)
    with _examined(path) as xr, xr.open_dataset(io.BytesIO(body), engine="h5netcdf") as dataset:
        largest = MEMORY_SHARE * memory()
        if dataset.nbytes > largest:  # a small file can claim to hold any size
            raise JointplayError(
                f"{str(path)!r} holds {dataset.nbytes / 1e9:.3g} GB, more than the "
                f"{largest / 1e9:.3g} GB that this machine has for it"
            )
        return dataset.load()


@contextmanager
def _examined(path: Path) -> Iterator[ModuleType]:
    """Import xarray while another process reads the file first; HDF5's errors mean damage."""
    try:
        with examined(path):  # the other process reads meanwhile
            import xarray as xr
        yield xr
    except JointplayError:
        raise
    except Exception as error:  # noqa: BLE001 - HDF5 raises whatever it stumbles over
        raise damaged(path, "result", error) from None


# Files written portion by portion, with the same content and seal as those of `pack`.


class GrowingDataset:
    """A dataset in a file, to which records are appended; `OSError` if there is no room for them.

    Args:
        file: an empty file, to be written and read.
        first: the first records, and all variables that do not depend on time.
    """

    def __init__(self, file: BinaryIO, first: xr.Dataset) -> None:
        import h5py

        self._file = file
        encoding = compression(first)
        for name, variable in first.variables.items():
            if variable.dims[:1] == ("time",):
                sizes = (CHUNK, *variable.shape[1:])
                encoding.setdefault(str(name), {})["chunksizes"] = sizes
        file.write(_netcdf(first, encoding, growing=["time"]))
        file.flush()
        self._rows = first.sizes["time"]
        self._disk = _CheckedFile(file)
        self._h5 = h5py.File(self._disk, "r+")
        known = self._h5.id.get_mdc_config()
        known.set_initial_size, known.initial_size = True, INDEX_BYTES
        known.min_size, known.max_size = INDEX_BYTES, INDEX_BYTES
        self._h5.id.set_mdc_config(known)

    def append(self, records: xr.Dataset) -> None:
        end = self._rows + records.sizes["time"]
        for name, variable in records.variables.items():
            if variable.dims[:1] == ("time",):
                dataset = self._h5[str(name)]
                dataset.resize(end, axis=0)
                dataset[self._rows : end] = variable.values
        self._rows = end
        self._disk.check()

    def finish(self, attributes: Mapping[str, Any], totals: Mapping[str, xr.DataArray]) -> None:
        """Write the dataset's attributes, the values of the `totals` at the end, and the seal."""
        import h5netcdf

        for name, variable in totals.items():
            self._h5[name][...] = variable.values
        with h5netcdf.File(self._h5, "r+") as dataset:
            dataset.attrs.update(attributes)
        self.close()
        self._disk.check()
        _seal_file(self._file)

    def close(self) -> None:
        self._h5.close()


def add(path: Path, attributes: Mapping[str, Any], histories: Iterable[xr.Dataset] = ()) -> None:
    """Add attributes to a file that `pack` or `GrowingDataset` made, and histories by portions.

    Raises:
        JointplayError: it cannot be read or written, or is damaged; it is then unchanged.
    """
    import h5netcdf
    import h5py

    with files.writing(path, overwrite=True) as file:
        with _verified(path) as (sealed_file, size):
            for piece in _pieces(sealed_file, size):
                file.write(piece)
            file.seek(0)
            # The copy is checked again, lest damage on the way get a seal of its own.
            if sealed_file.read() != SEAL + digest(file) + b"\n":
                raise damaged(path, "result", _CHANGED)
        file.flush()
        disk = _CheckedFile(file)
        with h5py.File(disk, "r+") as inner, h5netcdf.File(inner, "r+") as dataset:
            dataset.attrs.update(attributes)
            begin = 0
            for portion in histories:
                end = begin + portion.sizes["time"]
                for name, variable in portion.data_vars.items():
                    if not begin:
                        _create(dataset, str(name), variable)
                    dataset[name][begin:end] = variable.values
                begin = end
        disk.check()
        _seal_file(file)


def _create(dataset: Any, name: str, variable: xr.DataArray) -> None:
    """Make room for a history in a file, compressed as by `compression`."""
    sizes = [dataset.dimensions[str(dimension)].size for dimension in variable.dims]
    variable_on_disk = dataset.create_variable(
        name, variable.dims, variable.dtype, fillvalue=np.nan,
        chunks=(min(CHUNK, sizes[0]), *sizes[1:]), compression="gzip", compression_opts=1,
        shuffle=True,
    )  # fmt: skip
    variable_on_disk.attrs.update(variable.attrs)


def _seal_file(file: BinaryIO) -> None:
    file.flush()
    file.seek(0)
    sealed = digest(file)
    file.seek(0, io.SEEK_END)
    file.write(SEAL + sealed + b"\n")


class _CheckedFile(io.RawIOBase):
    """A file that accepts whatever HDF5 writes, and reports afterwards what failed.

    HDF5 ends the process if a file cannot be closed because the disk is full.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._inner = file
        self._error: OSError | None = None

    def check(self) -> None:
        self._try(self._inner.flush)
        if self._error is not None:
            raise self._error

    def _try(self, function: Any, *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except OSError as error:
            self._error = self._error or error
            return None

    def readinto(self, buffer: Any) -> int:
        count = self._try(self._inner.readinto, buffer)  # type: ignore[attr-defined]
        return len(buffer) if count is None else int(count)

    def write(self, content: Any) -> int:
        self._try(self._inner.write, content)
        return len(content)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        place = self._try(self._inner.seek, offset, whence)
        return offset if place is None else int(place)

    def truncate(self, size: int | None = None) -> int:
        self._try(self._inner.truncate, size)
        return size or 0

    def flush(self) -> None:
        if not self._inner.closed:  # as it may be when this is deleted
            self._try(self._inner.flush)
