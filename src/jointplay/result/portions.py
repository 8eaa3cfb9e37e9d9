"""A result file that is written portion by portion: memory holds one of them.

Its content is what `netcdf.pack` makes, and it is sealed in the same way.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any, BinaryIO

import h5netcdf
import h5py
import xarray as xr

from jointplay.result.netcdf import SEAL, compression, digest

CHUNK = 4096
"""Records that are compressed together."""

INDEX_BYTES = 1 << 18
"""So much of where the chunks are in the file is in memory, however many there are [bytes]."""


class GrowingDataset:
    """Dataset in a file, to which records are appended.

    Args:
        file: empty, to be written and read.
        first: the first records, and whatever does not depend on time.

    Raises:
        OSError: there is no room for it.
    """

    def __init__(self, file: BinaryIO, first: xr.Dataset) -> None:
        """Write the first records."""
        self._file = file
        encoding = compression(first)
        for name, variable in first.variables.items():
            if variable.dims[:1] == ("time",):
                sizes = (CHUNK, *variable.shape[1:])
                encoding.setdefault(str(name), {})["chunksizes"] = sizes
        content = first.to_netcdf(
            None, engine="h5netcdf", encoding=encoding, unlimited_dims=["time"]
        )
        file.write(content)
        file.flush()
        self._rows = first.sizes["time"]
        self._disk = _CheckedFile(file)
        self._h5 = h5py.File(self._disk, "r+")
        known = self._h5.id.get_mdc_config()
        known.set_initial_size, known.initial_size = True, INDEX_BYTES
        known.min_size, known.max_size = INDEX_BYTES, INDEX_BYTES
        self._h5.id.set_mdc_config(known)

    def append(self, records: xr.Dataset) -> None:
        """Append the next records.

        Raises:
            OSError: there is no room for them.
        """
        end = self._rows + records.sizes["time"]
        for name, variable in records.variables.items():
            if variable.dims[:1] == ("time",):
                dataset = self._h5[str(name)]
                dataset.resize(end, axis=0)
                dataset[self._rows : end] = variable.values
        self._rows = end
        self._disk.check()

    def finish(self, attributes: Mapping[str, Any], whole: Mapping[str, xr.DataArray]) -> None:
        """Write what is known at the end, and the seal.

        Args:
            attributes: of the dataset.
            whole: variables that are there, with their values at the end.

        Raises:
            OSError: there is no room for it.
        """
        for name, variable in whole.items():
            self._h5[name][...] = variable.values
        with h5netcdf.File(self._h5, "r+") as dataset:
            dataset.attrs.update(attributes)
        self.close()
        self._disk.check()
        self._file.flush()
        self._file.seek(0)
        sealed = digest(self._file)
        self._file.seek(0, io.SEEK_END)
        self._file.write(SEAL + sealed + b"\n")

    def close(self) -> None:
        """Let go of the file, finished or not."""
        self._h5.close()


class _CheckedFile(io.RawIOBase):
    """A file that takes all that HDF5 writes, and tells afterwards what it could not.

    HDF5 ends the process if a file cannot be closed because the disk is full.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._inner, self._error = file, None

    _error: OSError | None

    def check(self) -> None:
        """Raise what went wrong."""
        self._try(self._inner.flush)
        if self._error is not None:
            raise self._error

    def _try(self, function: Any, *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except OSError as error:
            self._error = self._error or error
            return None

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        got = self._try(self._inner.readinto, buffer)  # type: ignore[attr-defined]
        return len(buffer) if got is None else int(got)

    def write(self, content: Any) -> int:
        self._try(self._inner.write, content)
        return len(content)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        place = self._try(self._inner.seek, offset, whence)
        return offset if place is None else int(place)

    def tell(self) -> int:
        return int(self._try(self._inner.tell) or 0)

    def truncate(self, size: int | None = None) -> int:
        self._try(self._inner.truncate, size)
        return size or 0

    def flush(self) -> None:
        self._try(self._inner.flush)
