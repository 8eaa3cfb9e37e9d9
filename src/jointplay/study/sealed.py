"""A folder of Zarr arrays in which every piece is sealed, and zarr's view of it.

A store can come from anywhere, and Zarr does what it says: metadata of Zarr 2 name filters that run
code, those of Zarr 3 codecs of any package, and a chunk may be a link to any file. So zarr sees a
store only through `SealedStore`: metadata that are made here of the few things in which arrays
differ (`Array`; a store that says anything else is refused), and chunks that are files of the
store.

A seal is a hash of what is sealed, of its place and of the store that it was written to; so what
has changed, was moved, or comes from another store is found. Chunks have it behind their data,
where Zstandard has room for what unpacking skips: any reader of Zarr passes over it. The store's
own ``zarr.json``, which has it as an attribute, lists all arrays and chunks (`Contents`) and has a
copy; each is replaced at once, and last, so that what it says has been written. The metadata of
each array beside its chunks are for other readers of Zarr. A chunk that would unpack to another
size than its array's chunks have is not unpacked.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import stat
from collections.abc import AsyncIterator, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from zarr.abc.store import ByteRequest, Store
from zarr.core.buffer import Buffer, BufferPrototype, default_buffer_prototype

from jointplay.base.errors import JointplayError, damaged

FORMAT = 4
"""Version of the format of stores."""

METADATA = "zarr.json"
"""Name of the files with metadata."""

COPY = "copy.json"
"""Name of the copy of the store's own metadata."""

PARTIAL = ".partial"
"""Ending of a file that is being written, or that a killed process left."""

MOST_BYTES = 1 << 28
"""Size of a file with metadata, at most [bytes]."""

MOST_CHUNK_BYTES = 1 << 32
"""Size of a chunk, at most [bytes]."""

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

CHUNKS = "chunks"
"""Attribute of a store that lists the chunks of each array."""

SEAL = "seal"
"""Attribute of metadata with their seal."""

CHANGED = "does not match its seal (changed since it was written, or written elsewhere)"

_ZSTD = b"\x28\xb5\x2f\xfd"
"""How a frame of Zstandard begins (RFC 8878)."""

_SKIPPED = b"\x50\x2a\x4d\x18\x20\x00\x00\x00"
"""How a frame begins that unpacking skips (the same, section 3.1.2), of 32 bytes: a seal."""

_SEAL_BYTES = len(_SKIPPED) + 32

_CHUNK = re.compile(r"\d+(/\d+)*")
"""What a chunk is called."""

Index = tuple[int, ...]


class Foreign(ValueError):
    """What is whole, and not such as we write."""


def seal(store: Any, place: str, content: bytes) -> bytes:
    """SHA-256 of a file's content, of its place in the store, and of the store's own number."""
    found = hashlib.sha256(f"{store}/{place}\n".encode())
    found.update(content)
    return found.digest()


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
        """Check what is given."""
        if not isinstance(self.dtype, str) or self.dtype not in TYPES:
            raise ValueError(f"the type {self.dtype!r:.60} is none of {', '.join(TYPES)}")
        sizes = len(self.shape) == len(self.chunks) == len(self.dims) > 0
        if not (sizes and _whole(self.shape, 0) and _whole(self.chunks, 1)):
            raise ValueError(f"the shape {self.shape!r:.60} in chunks {self.chunks!r:.60}")
        if math.prod(self.chunks) * TYPES[self.dtype][0] > MOST_CHUNK_BYTES:
            raise ValueError(f"chunks {self.chunks!r} are larger than {MOST_CHUNK_BYTES} bytes")
        if not all(isinstance(name, str) for name in self.dims):
            raise ValueError(f"the dimensions {self.dims!r:.60}")
        if not isinstance(self.attributes, Mapping) or not all(
            name in WORDS and isinstance(text, str) for name, text in self.attributes.items()
        ):
            raise ValueError(f"the attributes {self.attributes!r:.60}")

    @property
    def metadata(self) -> dict[str, Any]:
        """Metadata of Zarr 3."""
        size, fill = TYPES[self.dtype]
        encoded: dict[str, Any] = {"name": "vlen-utf8" if self.dtype == "string" else "bytes"}
        if self.dtype != "string" and size > 1:
            encoded["configuration"] = {"endian": "little"}
        return {
            "zarr_format": 3,
            "node_type": "array",
            "data_type": self.dtype,
            "dimension_names": list(self.dims),
            "shape": list(self.shape),
            "chunk_grid": {
                "name": "regular",
                "configuration": {"chunk_shape": list(self.chunks)},
            },
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "codecs": [
                encoded,
                {"name": "zstd", "configuration": {"level": 0, "checksum": True}},
            ],
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
        if not isinstance(found, dict):
            raise ValueError("no metadata")
        _same(found, {"zarr_format": 3, "node_type": "array"}, found.keys())
        try:
            chunks = found["chunk_grid"]["configuration"]["chunk_shape"]
            dims, shape, chunks = map(tuple, (found["dimension_names"], found["shape"], chunks))
            array = cls(found["data_type"], dims, shape, chunks, found["attributes"])
        except KeyError as error:
            raise ValueError(f"it has no {error}") from None
        except TypeError:
            raise ValueError("no metadata of an array") from None
        _same(found, array.metadata)
        return array


@dataclass
class Contents:
    """What a store has, by its own metadata.

    Attributes:
        attributes: `ABOUT`.
        arrays: by their folders.
        chunks: names of those that have been written, by folder.
    """

    attributes: dict[str, Any]
    arrays: dict[str, Array] = field(default_factory=dict)
    chunks: dict[str, set[str]] = field(default_factory=dict)

    @property
    def store(self) -> str:
        """The store's own number."""
        return str(self.attributes["store"])

    @property
    def metadata(self) -> dict[str, Any]:
        """Metadata of the whole, those of all arrays included."""
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

    def kind(self, name: str) -> str:
        """What an array is.

        Returns:
            ``coordinate`` for values of the cases' dimensions, ``measure`` for a number of each
            case, ``cases`` for what else is kept of them, ``labels`` for what histories have along
            their own dimensions.
        """
        dims = tuple(map(array_name, self.attributes["sizes"]))
        if name in dims or name in map(array_name, self.attributes["sampled"]):
            return "coordinate"
        array = self.arrays[name]
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
        try:
            found = json.loads(read_file(folder, name, MOST_BYTES))
        except RecursionError:
            raise ValueError("no JSON") from None
        except json.JSONDecodeError:
            raise ValueError("no JSON") from None
        if not isinstance(found, dict) or not isinstance(found.get("attributes"), dict):
            raise ValueError("no metadata of Zarr 3")
        attributes = found["attributes"]
        mark = attributes.pop(SEAL, None)
        if mark is None and (other := attributes.get("jointplay_sweep")) not in (None, FORMAT):
            raise Foreign(f"it has format {other!r:.60}, not {FORMAT}")
        if mark is None:
            raise ValueError("it has no seal")
        if mark != seal(attributes.get("store"), METADATA, encoded(found)).hex():
            raise ValueError(CHANGED)
        try:
            return cls._read(found)
        except ValueError as error:
            raise Foreign(str(error)) from None

    @classmethod
    def _read(cls, found: Mapping[str, Any]) -> Contents:
        """The same of metadata whose seal has been verified."""
        attributes = dict(found["attributes"])
        chunks = attributes.pop(CHUNKS, None)
        for name, kind in ABOUT.items():
            if name not in attributes or not isinstance(attributes[name], kind):
                raise ValueError(f"its attribute {name!r} is {attributes.get(name)!r:.60}")
        whole = found.get("consolidated_metadata")
        arrays = whole.get("metadata") if isinstance(whole, dict) else None
        if not isinstance(arrays, dict) or not isinstance(chunks, dict):
            raise ValueError("it lists no arrays")
        contents = cls(attributes)
        for name, array in arrays.items():
            if not name or name.startswith(".") or "/" in name or "\0" in name:
                raise ValueError(f"an array is called {name!r}")
            try:
                contents.arrays[name] = Array.read(array)
            except ValueError as error:
                raise ValueError(f"array {name!r}: {error}") from None
        for name, listed in chunks.items():
            if not isinstance(listed, list) or not all(map(_CHUNK.fullmatch, map(str, listed))):
                raise ValueError(f"the chunks of {name!r} are {listed!r:.60}")
            contents.chunks[name] = set(map(str, listed))
        sizes = {array_name(str(name)): size for name, size in attributes["sizes"].items()}
        state = contents.arrays.get("state")
        if state is None or dict(zip(state.dims, state.shape, strict=True)) != sizes:
            raise ValueError("its states are not over its dimensions")
        foreign = set(attributes) - set(ABOUT)
        if foreign or contents.chunks.keys() - contents.arrays.keys():
            raise ValueError(f"unknown: {', '.join(sorted(foreign)) or 'chunks of no array':.60}")
        _same(found, contents.metadata)
        return contents


def encoded(content: Any) -> bytes:
    """Content as JSON, in the one form that is sealed; the order of keys counts."""
    return json.dumps(content, separators=(",", ":")).encode()


def _same(found: Mapping[str, Any], ours: Mapping[str, Any], known: Iterable[str] = ()) -> None:
    """Refuse metadata that say something else than ours; keys of `known` may be more."""
    foreign = sorted(found.keys() - ours.keys() - set(known))
    if foreign:
        raise ValueError(f"unknown keys: {', '.join(foreign)[:60]}")
    for key, value in ours.items():
        if key not in found:
            raise ValueError(f"it has no {key}")
        given, mine = encoded(found[key]).decode(), encoded(value).decode()
        if given != mine:
            raise ValueError(f"{key} is {given:.160}, not {mine:.160}")


def _whole(sizes: Iterable[Any], least: int) -> bool:
    """Whether all are whole numbers, not below the least."""
    return all(type(size) is int and size >= least for size in sizes)


def array_name(name: str) -> str:
    """The folder of an array: its name, with characters that paths or Zarr take otherwise as %XX.

    `plain_name` is its inverse.
    """
    kept = "- " if name.startswith("_") else "_- "  # Zarr keeps names that begin so to itself
    return _escaped(name[:1], kept) + _escaped(name[1:], "_- ")


def plain_name(folder: str) -> str:
    """The name of the array in a folder of a store."""
    return unquote(folder)


def _escaped(text: str, kept: str) -> str:
    """Text with all as %XX but letters, digits and what is kept."""
    return "".join(
        c if c.isalnum() or c in kept else "".join(f"%{byte:02X}" for byte in c.encode())
        for c in text
    )


# ---- What is in its files ----------------------------------------------------------------------


class SealedStore(Store):
    """The folder of a store as zarr may see it.

    Args:
        folder: the store.
        contents: what it has; None reads it.

    Raises:
        JointplayError: what is asked for is damaged or foreign; it is named, with what becomes of
            it if the sweep goes on.
    """

    supports_writes = supports_deletes = True
    supports_listing = False

    def __init__(
        self, folder: Path, contents: Contents | None = None, *, read_only: bool = False
    ) -> None:
        """See the store as it is now."""
        super().__init__(read_only=read_only)
        self.folder = folder
        try:
            self.contents = Contents.read(folder) if contents is None else contents
        except (OSError, ValueError) as error:
            raise damaged_whole(folder, error) from None

    def __eq__(self, other: object) -> bool:
        """Whether both are of one folder."""
        return isinstance(other, SealedStore) and other.folder == self.folder

    def with_read_only(self, read_only: bool = False) -> SealedStore:
        """The same store, for reading or for writing."""
        return SealedStore(self.folder, self.contents, read_only=read_only)

    async def get(
        self,
        key: str,
        prototype: BufferPrototype | None = None,
        byte_range: ByteRequest | None = None,
    ) -> Buffer | None:
        """A chunk, or metadata; None for everything else."""
        if byte_range is not None:
            raise NotImplementedError("parts of chunks have no seal")
        arrays = self.contents.arrays
        name, _, chunk = key.partition("/c/")
        content: bytes | None = None
        if key == METADATA:
            content = encoded(self.contents.metadata)
        elif (folder := key.removesuffix(f"/{METADATA}")) in arrays:
            content = encoded(arrays[folder].metadata)
        elif chunk and name in arrays:
            content = self._chunk(name, chunk)
        if content is None:
            return None
        return (prototype or default_buffer_prototype()).buffer.from_bytes(content)

    def _chunk(self, name: str, chunk: str) -> bytes | None:
        """A chunk; None if none was written."""
        try:
            return read_chunk(self.folder, self.contents, name, chunk)
        except (FileNotFoundError, NotADirectoryError):
            # Writers have looked with `survey`.
            if not self.read_only or chunk not in self.contents.chunks.get(name, ()):
                return None
            reason = "it is gone"
        except (OSError, ValueError) as error:
            reason = _reason(error)
        fates = {"labels": "runs all cases again", "coordinate": "writes it again"}
        fate = fates.get(self.contents.kind(name), "runs the cases of that chunk again")
        place = f"chunk {chunk.replace('/', '.')} of array {name!r}"
        raise damaged(self.folder, "sweep", f"{place}: {reason}; --resume {fate}")

    async def get_partial_values(
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        """The same of several."""
        return [await self.get(key, prototype, given) for key, given in key_ranges]

    async def exists(self, key: str) -> bool:
        """Whether there is such a chunk, or such metadata."""
        return await self.get(key) is not None

    async def set(self, key: str, value: Buffer) -> None:
        """Write a chunk, its seal behind its data; from now on it must be there."""
        self._check_writable()
        name, _, chunk = key.partition("/c/")
        if not chunk:
            raise NotImplementedError("metadata are not zarr's to write")
        content = value.to_bytes()
        put(self.folder / key, content + _SKIPPED + seal(self.contents.store, key, content))
        self.contents.chunks.setdefault(name, set()).add(chunk)

    async def delete(self, key: str) -> None:
        """Delete a chunk in which nothing is left."""
        self._check_writable()
        name, _, chunk = key.partition("/c/")
        delete_chunk(self.folder, self.contents, name, chunk)

    def list(self) -> AsyncIterator[str]:
        """What there is, zarr knows by the metadata."""
        raise NotImplementedError

    list_prefix = list_dir = list  # type: ignore[assignment]


def put(path: Path, content: bytes) -> None:
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


def delete_chunk(folder: Path, contents: Contents, name: str, chunk: str) -> None:
    """Delete a chunk, which from now on need not be there."""
    contents.chunks.get(name, set()).discard(chunk)
    (folder / name / "c" / chunk).unlink(missing_ok=True)


def damaged_whole(path: Path, error: Exception) -> JointplayError:
    """What to say of a store whose metadata are damaged."""
    # No damage makes foreign metadata of ours.
    fate = "" if isinstance(error, Foreign) else "; --resume writes them again"
    return damaged(path, "sweep", f"metadata of the whole: {_reason(error)}{fate}")


def _reason(error: Exception) -> str:
    """Why something could not be read."""
    return getattr(error, "strerror", None) or str(error)


def survey(folder: Path, contents: Contents) -> Iterator[tuple[str, str]]:
    """What is damaged or gone in a store: names of arrays and of their chunks."""
    for name in contents.arrays:
        found = set(chunks(folder, name))
        yield from ((name, chunk) for chunk in contents.chunks.get(name, set()) - found)
        for chunk in found:
            try:
                read_chunk(folder, contents, name, chunk)
            except (OSError, ValueError):
                yield name, chunk


def chunks(folder: Path, name: str) -> Iterator[str]:
    """Names of the chunks of an array that are there."""
    begin = folder / name / "c"
    for inside, _, found in os.walk(begin):
        for chunk in found:
            if not chunk.endswith(PARTIAL):
                yield (Path(inside) / chunk).relative_to(begin).as_posix()


def read_chunk(folder: Path, contents: Contents, name: str, chunk: str) -> bytes:
    """A chunk as it was written, without its seal.

    Raises:
        FileNotFoundError: there is none.
        ValueError: it is damaged, or not what its array's chunks are: why.
    """
    key = f"{name}/c/{chunk}"
    content = read_file(folder, key, MOST_CHUNK_BYTES)
    data, mark = content[:-_SEAL_BYTES], content[-_SEAL_BYTES:]
    if mark != _SKIPPED + seal(contents.store, key, data):
        raise ValueError(CHANGED)
    array = contents.arrays[name]
    cells, size = math.prod(array.chunks), _unpacked(data)
    if size is None:
        raise ValueError("its uncompressed size is missing")
    if array.dtype != "string" and size != (whole := cells * TYPES[array.dtype][0]):
        raise ValueError(f"it unpacks to {size} bytes, not to {whole}")
    if array.dtype == "string" and size > (most := cells * MOST_TEXT_BYTES):
        raise ValueError(f"it unpacks to {size} bytes, more than {most}")
    return data


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
