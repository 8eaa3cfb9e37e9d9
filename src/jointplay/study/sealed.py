"""A folder of Zarr arrays in which every piece is sealed, and how it is read.

A store can come from anywhere, and Zarr does what it says: metadata of Zarr 2 name filters that run
code, those of Zarr 3 codecs of any package, and a chunk may be a link to any file. So we read it
without zarr: metadata that say something else than ours do (`Array`) are refused, and chunks are
files of the store, of the size that they must have.

A seal is a hash of what is sealed, of its place and of the store that it was written to. Chunks
have it behind their data, where Zstandard has room for what unpacking skips: any reader of Zarr
passes over it. The store's own ``zarr.json``, which has it as an attribute, lists all arrays and
chunks (`Contents`) and has a copy; each is replaced at once, and last, so that what it says has
been written. The metadata of each array beside its chunks are for other readers of Zarr.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import xarray as xr
from numcodecs import VLenUTF8, Zstd
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from jointplay.base.errors import JointplayError, damaged

FORMAT = 4
"""Version of the format of stores."""
METADATA, COPY = "zarr.json", "copy.json"
"""Files with the store's own metadata, and with their copy."""
PARTIAL = ".partial"
"""Ending of a file that is being written, or that a killed process left."""
MOST_BYTES, MOST_CHUNK_BYTES = 1 << 28, 1 << 32
"""Size of a file with metadata, and of a chunk, at most [bytes]."""
MOST_TEXT_BYTES = 1 << 16
"""Texts in a chunk, at most on average [bytes]."""
TYPES: dict[str, tuple[int, Any]] = {
    "bool": (1, False), "int8": (1, 0), "int64": (8, 0), "float64": (8, "NaN"), "string": (8, ""),
}  # fmt: skip
"""Types of arrays: size of a value in memory [bytes], and what stands where nothing is written."""
WORDS = ("units", "long_name", "origin")
"""Attributes of arrays."""
ABOUT: dict[str, Any] = {
    "jointplay_sweep": int, "store": str, "case": str | None, "sampling": str, "sampled": list,
    "inputs": dict, "versions": dict, "identity": dict, "sizes": dict, "title": str,
    "scenario": str, "scenario_file": str, "sweep": str,
}  # fmt: skip
"""Attributes of a store: its format, its own number, and what it is of."""
CHUNKS, SEAL = "chunks", "seal"
"""Attributes of its metadata: the chunks of each array, and their seal."""
CHANGED = "does not match its seal (changed since it was written, or written elsewhere)"
_ZSTD = b"\x28\xb5\x2f\xfd"
"""How a frame of Zstandard begins (RFC 8878)."""
_SKIPPED = b"\x50\x2a\x4d\x18\x20\x00\x00\x00"
"""How a frame begins that unpacking skips (the same, section 3.1.2), of 32 bytes: a seal."""
_SEAL_BYTES = len(_SKIPPED) + 32
_CHUNK = re.compile(r"\d+(/\d+)*")
_PACKED, _TEXTS = Zstd(level=0, checksum=True), VLenUTF8()

Index = tuple[int, ...]


class Foreign(ValueError):
    """What is whole, and not such as we write."""


def seal(store: Any, place: str, content: bytes) -> bytes:
    """SHA-256 of a file's content, of its place in the store, and of the store's own number."""
    return hashlib.sha256(f"{store}/{place}\n".encode() + content).digest()


# ---- What a store has: the declared schema, which it is made by and checked against --------------


@dataclass(frozen=True)
class Array:
    """An array of a store. All else that its metadata say is the same for every array.

    Attributes:
        dtype: one of `TYPES`.
        dims: names of its dimensions, as `array_name` has them.
        shape, chunks: sizes of it and of its chunks.
        attributes: `WORDS`.

    Raises:
        ValueError: it is none that a store can have.
    """

    dtype: str
    dims: tuple[str, ...]
    shape: Index
    chunks: Index
    attributes: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.dtype not in TYPES:
            raise ValueError(f"the type {self.dtype!r:.60} is none of {', '.join(TYPES)}")
        sizes = len(self.shape) == len(self.chunks) == len(self.dims) == len({*self.dims}) > 0
        whole = all(type(k) is int and k >= 0 for k in self.shape)
        if not (sizes and whole and all(type(k) is int and k > 0 for k in self.chunks)):
            raise ValueError(f"the shape {self.shape!r:.60} in chunks {self.chunks!r:.60}")
        if math.prod(self.chunks) * TYPES[self.dtype][0] > MOST_CHUNK_BYTES:
            raise ValueError(f"chunks {self.chunks!r} are larger than {MOST_CHUNK_BYTES} bytes")
        texts = (*self.dims, *self.attributes.values())
        if not (self.attributes.keys() <= {*WORDS} and all(isinstance(x, str) for x in texts)):
            raise ValueError(
                f"the dimensions {self.dims!r:.60}, attributes {self.attributes!r:.120}"
            )

    def empty(self, shape: Index) -> np.ndarray:
        """Values of its type, of which none has been written."""
        if self.dtype == "string":
            return np.full(shape, "", object)
        return np.full(shape, np.asarray(TYPES[self.dtype][1], self.dtype))

    @property
    def metadata(self) -> dict[str, Any]:
        size, fill = TYPES[self.dtype]
        encoded: dict[str, Any] = {"name": "vlen-utf8" if self.dtype == "string" else "bytes"}
        if self.dtype != "string" and size > 1:
            encoded["configuration"] = {"endian": "little"}
        packed = {"name": "zstd", "configuration": {"level": 0, "checksum": True}}
        grid = {"name": "regular", "configuration": {"chunk_shape": list(self.chunks)}}
        return {
            "zarr_format": 3,
            "node_type": "array",
            "data_type": self.dtype,
            "dimension_names": list(self.dims),
            "shape": list(self.shape),
            "chunk_grid": grid,
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "codecs": [encoded, packed],
            "fill_value": fill,
            "storage_transformers": [],
            "attributes": dict(self.attributes),
        }

    @classmethod
    def read(cls, found: Any) -> Array:
        """The array that metadata describe.

        Raises:
            ValueError: they say something that ours do not.
        """
        try:
            chunks = found["chunk_grid"]["configuration"]["chunk_shape"]
            dims, shape, chunks = map(tuple, (found["dimension_names"], found["shape"], chunks))
            array = cls(found["data_type"], dims, shape, chunks, found["attributes"])
        except (KeyError, TypeError, AttributeError):
            raise ValueError("no metadata of an array") from None
        _same(found, array.metadata)
        return array


@dataclass
class Contents:
    """What a store has, by its own metadata.

    Attributes:
        folder: of the store.
        attributes: `ABOUT`.
        arrays: by their folders.
        chunks: names of those that have been written, by folder.
    """

    folder: Path
    attributes: dict[str, Any]
    arrays: dict[str, Array] = field(default_factory=dict)
    chunks: dict[str, set[str]] = field(default_factory=dict)

    @property
    def store(self) -> str:
        return str(self.attributes["store"])

    @property
    def metadata(self) -> dict[str, Any]:
        listed = {name: sorted(chunks) for name, chunks in self.chunks.items()}
        arrays = {name: array.metadata for name, array in self.arrays.items()}
        whole = {"kind": "inline", "must_understand": False, "metadata": arrays}
        return {
            "zarr_format": 3,
            "node_type": "group",
            "attributes": {**self.attributes, CHUNKS: listed},
            "consolidated_metadata": whole,
        }

    @property
    def file(self) -> bytes:
        """The file with the metadata of the whole, sealed."""
        found = self.metadata
        mark = seal(self.store, METADATA, encoded(found)).hex()
        return encoded(found | {"attributes": found["attributes"] | {SEAL: mark}})

    def kind(self, name: str, none: str = "") -> str:
        """What an array is, or `none` if there is none of that name.

        Returns:
            ``coordinate`` for values of the cases' dimensions, ``measure`` for a number of each
            case, ``cases`` for what else is kept of them, ``labels`` for what histories have along
            their own dimensions.
        """
        dims = tuple(map(array_name, self.attributes["sizes"]))
        if name in dims or name in map(array_name, self.attributes["sampled"]):
            return "coordinate"
        array = self.arrays.get(name)
        if array is None:
            return none
        if array.dims == dims and array.dtype == "float64":
            return "measure"
        return "cases" if array.dims[: len(dims)] == dims else "labels"

    @classmethod
    def read(cls, folder: Path, name: str = METADATA) -> Contents:
        """What the store in a folder has, by its metadata or their `COPY`.

        Raises:
            OSError: it cannot be read.
            Foreign: it is whole, but none of ours: why.
            ValueError: its metadata are damaged: why.
        """
        content = read_file(folder, name, MOST_BYTES)
        try:
            found = json.loads(content)
            attributes = found["attributes"]
            mark, other = attributes.pop(SEAL, None), attributes.get("jointplay_sweep")
        except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
            raise ValueError("no metadata of Zarr 3") from None
        whole = mark == seal(attributes.get("store"), METADATA, encoded(found)).hex()
        if (whole or mark is None) and other not in (None, FORMAT):
            raise Foreign(f"it has format {other!r:.60}, not {FORMAT}")
        if not whole:
            raise ValueError("it has no seal" if mark is None else CHANGED)
        try:
            return cls._read(folder, found)
        except ValueError as error:
            raise Foreign(str(error)) from None
        except (KeyError, TypeError, AttributeError):
            raise Foreign("its metadata are no sweep's") from None

    @classmethod
    def _read(cls, folder: Path, found: Mapping[str, Any]) -> Contents:
        """The same of metadata whose seal has been verified."""
        attributes = dict(found["attributes"])
        chunks = attributes.pop(CHUNKS)
        for name in {**ABOUT, **attributes}:
            if not isinstance(attributes.get(name, ...), ABOUT.get(name, ())):
                raise ValueError(f"its attribute {name!r:.60} is {attributes.get(name)!r:.60}")
        contents = cls(folder, attributes)
        for name, array in found["consolidated_metadata"]["metadata"].items():
            if not name or name.startswith(".") or "/" in name or "\0" in name:
                raise ValueError(f"an array is called {name!r}")
            try:
                contents.arrays[name] = Array.read(array)
            except ValueError as error:
                raise ValueError(f"array {name!r}: {error}") from None
        for name, listed in chunks.items():
            if name not in contents.arrays or not all(map(_CHUNK.fullmatch, listed)):
                raise ValueError(f"the chunks of {name!r:.60} are {listed!r:.60}")
            contents.chunks[name] = set(listed)
        sizes = {array_name(name): size for name, size in attributes["sizes"].items()}
        state = contents.arrays["state"]
        if dict(zip(state.dims, state.shape, strict=True)) != sizes:
            raise ValueError("its states are not over its dimensions")
        _same(found, contents.metadata)
        return contents

    # ---- Its chunks

    def read_chunk(self, name: str, chunk: str) -> bytes:
        """A chunk as it was written, without its seal.

        Raises:
            FileNotFoundError: there is none.
            ValueError: it is damaged, or not what its array's chunks are: why.
        """
        key = f"{name}/c/{chunk}"
        content = read_file(self.folder, key, MOST_CHUNK_BYTES)
        data, mark = content[:-_SEAL_BYTES], content[-_SEAL_BYTES:]
        if mark != _SKIPPED + seal(self.store, key, data):
            raise ValueError(CHANGED)
        array = self.arrays[name]
        cells, size = math.prod(array.chunks), _unpacked(data)
        if size is None:
            raise ValueError("its uncompressed size is missing")
        if array.dtype != "string" and size != (whole := cells * TYPES[array.dtype][0]):
            raise ValueError(f"it unpacks to {size} bytes, not to {whole}")
        if array.dtype == "string" and size > (most := cells * MOST_TEXT_BYTES):
            raise ValueError(f"it unpacks to {size} bytes, more than {most}")
        return data

    def load(self, name: str, chunk: Index) -> np.ndarray:
        """Values of a chunk, of which there may be none.

        Raises:
            JointplayError: it is damaged, or gone; with what becomes of it if the sweep goes on.
        """
        array, place = self.arrays[name], "/".join(map(str, chunk))
        try:
            data = _PACKED.decode(self.read_chunk(name, place))
            if array.dtype == "string":
                return np.asarray(_TEXTS.decode(data), object).reshape(array.chunks)
            dtype = np.dtype(array.dtype).newbyteorder("<")
            return np.frombuffer(data, dtype).reshape(array.chunks).copy()
        except (FileNotFoundError, NotADirectoryError):
            if place not in self.chunks.get(name, ()):
                return array.empty(array.chunks)
            reason = "it is gone"
        except (OSError, RuntimeError, ValueError) as error:
            reason = _reason(error)
        fates = {"labels": "runs all cases again", "coordinate": "writes it again"}
        fate = fates.get(self.kind(name), "runs the cases of that chunk again")
        text = f"chunk {place.replace('/', '.')} of array {name!r}: {reason}; --resume {fate}"
        raise damaged(self.folder, "sweep", text)

    def save(self, name: str, chunk: Index, block: np.ndarray) -> None:
        """Write values of a chunk, its seal behind them; of empty ones alone none is kept."""
        array, place = self.arrays[name], "/".join(map(str, chunk))
        if np.isnan(block).all() if array.dtype == "float64" else not any(block.flat):
            self.delete(name, place)
            return
        plain = _TEXTS.encode(block) if array.dtype == "string" else block.tobytes()
        content, key = _PACKED.encode(plain), f"{name}/c/{place}"
        write_whole(self.folder / key, content + _SKIPPED + seal(self.store, key, content))
        self.chunks.setdefault(name, set()).add(place)

    def delete(self, name: str, chunk: str) -> None:
        """Delete a chunk, which from now on need not be there."""
        self.chunks.get(name, set()).discard(chunk)
        (self.folder / name / "c" / chunk).unlink(missing_ok=True)

    def values(self, name: str, part: Sequence[slice] = ()) -> np.ndarray:
        """Values of an array, or of a part of it, its slices without steps; see `load`."""
        array = self.arrays[name]
        part = part or whole(array.shape)
        found = array.empty(tuple(one.stop - one.start for one in part))
        for chunk, place, inside in pieces(part, array.chunks):
            found[place] = self.load(name, chunk)[inside]
        return found

    def write(self, name: str, given: np.ndarray) -> None:
        """Write all values of an array."""
        array = self.arrays[name]
        for chunk, place, inside in pieces(whole(array.shape), array.chunks):
            block = array.empty(array.chunks)
            block[inside] = given[place]
            self.save(name, chunk, block)

    def survey(self) -> Iterator[tuple[str, str]]:
        """What is damaged or gone: names of arrays and of their chunks."""
        for name in self.arrays:
            begin = self.folder / name / "c"
            there = (one for one in begin.rglob("*") if one.is_symlink() or not one.is_dir())
            found = {one.relative_to(begin).as_posix() for one in there if one.suffix != PARTIAL}
            yield from ((name, chunk) for chunk in self.chunks.get(name, set()) - found)
            for chunk in found:
                try:
                    self.read_chunk(name, chunk)
                except (OSError, ValueError):
                    yield name, chunk


def encoded(content: Any) -> bytes:
    """Content as JSON, in the one form that is sealed; the order of keys counts."""
    return json.dumps(content, separators=(",", ":")).encode()


def _same(found: Mapping[str, Any], ours: Mapping[str, Any]) -> None:
    other = [key for key in {**ours, **found} if found.get(key, ...) != ours.get(key, ...)]
    if other:
        shown = ", ".join(f"{key} {found.get(key)!r:.120}" for key in other)
        raise ValueError(f"it has, unlike ours, {shown}")


def array_name(name: str) -> str:
    """The folder of an array: its name, with characters that paths or Zarr take otherwise as %XX.

    `plain_name` is its inverse. Zarr keeps names that begin with ``_`` to itself.
    """
    return "".join(
        c if c.isalnum() or c in "- " or (c == "_" and k) else _escaped(c)
        for k, c in enumerate(name)
    )


def _escaped(text: str) -> str:
    return "".join(f"%{byte:02X}" for byte in text.encode())


def plain_name(folder: str) -> str:
    """The name of the array in a folder of a store."""
    return unquote(folder)


# ---- Read as a dataset --------------------------------------------------------------------------


class _Lazy(BackendArray):
    """An array of a store, of which parts are read when they are looked at."""

    def __init__(self, contents: Contents, name: str) -> None:
        self.contents, self.name = contents, name
        array = contents.arrays[name]
        self.shape, self.dtype = array.shape, array.empty(()).dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        basic = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, basic, self._read)

    def _read(self, key: tuple[int | slice, ...]) -> np.ndarray:
        part, inner = [], []
        for one, size in zip(key, self.shape, strict=True):
            at = range(size)[one] if isinstance(one, slice) else range(int(one), int(one) + 1)
            part.append(slice(min(at, default=0), max(at, default=-1) + 1))
            inner.append(slice(None, None, at.step) if isinstance(one, slice) else 0)
        return self.contents.values(self.name, part)[tuple(inner)]


class Reader(BackendEntrypoint):
    """How xarray reads a store.

    Raises:
        JointplayError: what is asked for is damaged or foreign; it is named.
    """

    def open_dataset(
        self, filename_or_obj: Any, *, drop_variables: str | Iterable[str] | None = None
    ) -> xr.Dataset:
        contents = contents_of(folder := Path(filename_or_obj))
        try:
            variables = {
                plain_name(name): xr.Variable(
                    tuple(map(plain_name, array.dims)),
                    indexing.LazilyIndexedArray(_Lazy(contents, name)),
                    dict(array.attributes),
                )
                for name, array in contents.arrays.items()
            }
            attributes = {k: v for k, v in contents.attributes.items() if k != "store"}
            coordinates = {*attributes["sizes"], *attributes["sampled"]} & variables.keys()
            return xr.Dataset(variables, attrs=attributes).set_coords(coordinates)
        except JointplayError:
            raise
        except Exception as error:  # noqa: BLE001 - of arrays that do not fit each other
            raise damaged(folder, "sweep", error) from None


# ---- What is in its files ----------------------------------------------------------------------


def whole(shape: Index) -> tuple[slice, ...]:
    """All of an array of this shape."""
    return tuple(slice(0, size) for size in shape)


def pieces(
    part: Sequence[slice], chunks: Index
) -> Iterator[tuple[Index, tuple[slice, ...], tuple[slice, ...]]]:
    """Chunks that a part of an array is in; where each is in the part, and that in the chunk."""
    both = list(zip(part, chunks, strict=True))
    for chunk in product(*(range(one.start // n, -(-one.stop // n)) for one, n in both)):
        ends = [
            (max(k * n, one.start), min((k + 1) * n, one.stop), one.start, k * n)
            for k, (one, n) in zip(chunk, both, strict=True)
        ]
        place = tuple(slice(low - begin, high - begin) for low, high, begin, _ in ends)
        yield chunk, place, tuple(slice(low - begin, high - begin) for low, high, _, begin in ends)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file of a store whole or not at all; on disk it is after `os.sync`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + PARTIAL)
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink()
        raise


def contents_of(folder: Path, copy: bool = False) -> Contents:
    """What the store in a folder has, by its metadata, or with `copy` by their copy if need be.

    Raises:
        JointplayError: they are damaged, or foreign, of which no damage makes ours: why.
    """
    try:
        return Contents.read(folder)
    except Foreign as error:
        reason, fate = str(error), ""
    except (OSError, ValueError) as error:
        reason, fate = _reason(error), "; --resume writes them again"
        if copy:
            with suppress(OSError, ValueError):
                return Contents.read(folder, COPY)
            fate = ", and so has their copy; choose another name"
    raise damaged(folder, "sweep", f"metadata of the whole: {reason}{fate}")


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _unpacked(content: bytes) -> int | None:
    """Bytes to which a frame of Zstandard says that it unpacks; None if it does not say.

    No more are ever unpacked: numcodecs makes room for so many.
    """
    if content[:4] != _ZSTD or len(content) < 10:
        return None
    about = content[4]
    single = bool(about & 0x20)
    width = (1 if single else 0, 2, 4, 8)[about >> 6]
    begin = 5 + (not single) + (0, 1, 2, 4)[about & 3]
    if not width:
        return None
    return int.from_bytes(content[begin : begin + width], "little") + (256 if width == 2 else 0)


def read_file(folder: Path, key: str, most: int) -> bytes:
    """A file of the store.

    Raises:
        FileNotFoundError: there is none.
        ValueError: it is another kind of thing, leads out of the store, or is too large.
    """
    path = folder / key
    found = path.lstat()
    whole = os.path.realpath(folder)
    if not stat.S_ISREG(found.st_mode) or os.path.realpath(path) != str(Path(whole) / key):
        raise ValueError("no file of the store")
    if found.st_size > most:
        raise ValueError(f"{found.st_size} bytes are more than {most}")
    return path.read_bytes()
