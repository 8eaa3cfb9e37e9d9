"""Zarr as stores of sweeps have it: plain arrays of Zarr 3, each piece with its checksum.

A store can come from anywhere, and Zarr does what it says: metadata of Zarr 2 name filters that run
code, those of Zarr 3 codecs of any package, and a chunk may be a link to any file. So zarr sees a
store only through `SealedStore`, which serves metadata that are ours by a list, and chunks that are
files of the store. What has changed since it was written is found by its checksum: of a chunk
CRC-32C, its last codec, of metadata SHA-256, an attribute. Both are also of the place, so that what
was copied from another one is found: a chunk names it behind its data, where Zstandard has room for
what unpacking skips, and any reader of Zarr passes over it. A chunk that is gone is found by the
list of those that were there when the sweep was last ended (`WRITTEN`), and one that would unpack
to another size than its array's chunks have is not unpacked.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import google_crc32c
from zarr.abc.store import ByteRequest
from zarr.codecs import Crc32cCodec, ZstdCodec
from zarr.core.buffer import Buffer, BufferPrototype, default_buffer_prototype
from zarr.storage import LocalStore

from jointplay.core.errors import JointplayError

SEAL = "jointplay_sha256"
"""Attribute with the checksum of the metadata that it stands in."""

METADATA = "zarr.json"
"""Name of the files with metadata."""

ROOT = ""
"""In place of an array's name: the metadata of the whole store."""

WRITTEN = "chunks"
"""Attribute of a store: names of the chunks of each array when the sweep was last ended."""

COMPRESSORS = (ZstdCodec(level=0, checksum=False), Crc32cCodec())
"""What the chunks of all arrays go through last."""

MOST_BYTES = 1 << 28
"""Size of a file with metadata, at most [bytes]."""

MOST_CHUNK_BYTES = 1 << 32
"""Size of a chunk, at most [bytes]."""

MOST_TEXT_BYTES = 1 << 16
"""Texts in a chunk, at most on average [bytes]."""

_ZSTD = b"\x28\xb5\x2f\xfd"
"""How a frame of Zstandard begins (RFC 8878)."""

_SKIPPED = b"\x50\x2a\x4d\x18"
"""How a frame begins that unpacking skips (the same, section 3.1.2)."""

_TYPES = {"bool": 1, "int8": 1, "int64": 8, "float64": 8, "string": 8}
"""Types of arrays, and their sizes in memory [bytes]."""

_CHUNK = re.compile(r"\d+(/\d+)*")
"""What a chunk is called."""

_ARRAY = {
    "shape", "data_type", "chunk_grid", "chunk_key_encoding", "fill_value", "codecs", "attributes",
    "dimension_names", "zarr_format", "node_type", "storage_transformers",
}  # fmt: skip

PARTIAL = ".partial"
"""Ending of a chunk that zarr is writing, or that a killed process left."""

BEGUN = "jointplay_sweep_begun"
"""Attribute of a store that is being made: if its maker is killed, it may be made anew."""

_ABOUT = {
    "jointplay_sweep": int, "case": str | None, "sampling": str, "sampled": list, "inputs": dict,
    "versions": dict, "identity": dict, "sizes": dict, "title": str, "scenario": str,
    "scenario_file": str, "sweep": str, BEGUN: int, WRITTEN: dict,
}  # fmt: skip
"""Attributes of a store."""

CHANGED = "does not match its checksum (changed since it was written)"
GONE = "it is gone"
ELSEWHERE = "it was written in another place"


class Foreign(ValueError):
    """Metadata are whole, and not such as we write."""


class SealedStore(LocalStore):
    """The folder of a sweep as zarr may see it.

    Raises:
        JointplayError: what is asked for is damaged or foreign; it is named, with what becomes of
            it if the sweep goes on.
    """

    async def get(
        self,
        key: str,
        prototype: BufferPrototype | None = None,
        byte_range: ByteRequest | None = None,
    ) -> Buffer | None:
        """A chunk, or metadata without their checksum; None for everything else."""
        return self.get_sync(key, prototype=prototype, byte_range=byte_range)

    def get_sync(
        self,
        key: str,
        *,
        prototype: BufferPrototype | None = None,
        byte_range: ByteRequest | None = None,
    ) -> Buffer | None:
        """The same."""
        if byte_range is not None:
            raise NotImplementedError("parts of chunks have no checksum")
        name, _, what = key.rpartition("/c/") if "/c/" in key else key.rpartition("/")
        if "/" in name or not (what == METADATA or f"{name}/c/{what}" == key):
            return None
        try:
            if what == METADATA:
                content = json.dumps(metadata(self.root, name)).encode()
            else:
                content = _file(self.root, key, MOST_CHUNK_BYTES)
                _check_chunk(content, key, _array(self.root, name))
        except (FileNotFoundError, NotADirectoryError):
            if what == METADATA or not self.read_only:  # writers have looked with `survey`
                return None
            if what not in stored_chunks(self.root).get(name, ()):
                return None
            raise self._damaged(name, what, ValueError(GONE)) from None
        except (OSError, ValueError) as error:
            raise self._damaged(name, None if what == METADATA else what, error) from None
        return (prototype or default_buffer_prototype()).buffer.from_bytes(content)

    async def get_partial_values(
        self,
        prototype: BufferPrototype,
        key_ranges: Iterable[tuple[str, ByteRequest | None]],
    ) -> list[Buffer | None]:
        """The same of several."""
        return [self.get_sync(key, prototype=prototype, byte_range=r) for key, r in key_ranges]

    async def set(self, key: str, value: Buffer) -> None:
        """Write a chunk, or metadata with their checksum."""
        await super().set(key, _sealed(key, value))

    async def set_if_not_exists(self, key: str, value: Buffer) -> None:
        """The same, unless it is there."""
        await super().set_if_not_exists(key, _sealed(key, value))

    def set_sync(self, key: str, value: Buffer) -> None:
        """The same as `set`."""
        super().set_sync(key, _sealed(key, value))

    def _damaged(self, name: str, chunk: str | None, error: Exception) -> JointplayError:
        """What to say of an array's chunk or metadata, and what becomes of it."""
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        place = f"array {name!r}" if name else "the whole"
        if chunk is None:  # no damage makes foreign metadata of ours
            fate = "" if isinstance(error, Foreign) else "; --resume writes them again"
            return damaged(self.root, f"metadata of {place}: {reason}{fate}")
        what = "cases"
        with suppress(OSError, ValueError, KeyError):
            root = metadata(self.root, ROOT)
            arrays = root["consolidated_metadata"]["metadata"]
            what = kind(name, arrays[name], root["attributes"])
        after = {
            "cases": "runs the cases of that chunk again",
            "labels": "runs all cases again",
            "coordinate": "writes it again",
        }[what]
        dotted = chunk.replace("/", ".")
        return damaged(self.root, f"chunk {dotted} of {place}: {reason}; --resume {after}")


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


def damaged(path: Path, words: str) -> JointplayError:
    """What to say of a store that is damaged."""
    return JointplayError(f"{str(path)!r} is damaged or not a sweep: {words}")


def kind(name: str, array: Mapping[str, Any], attributes: Mapping[str, Any]) -> str:
    """What an array is.

    Returns:
        ``coordinate`` for values of the sweep's dimensions, ``cases`` for what is kept of the
        cases, ``labels`` for what histories have along their own dimensions.
    """
    dims = [array_name(one) for one in attributes["sizes"]]
    if name in dims or name in map(array_name, attributes["sampled"]):
        return "coordinate"
    return "cases" if array["dimension_names"][: len(dims)] == dims else "labels"


def metadata(root: Path, name: str) -> dict[str, Any]:
    """Metadata of an array, or of the store (`ROOT`).

    Raises:
        FileNotFoundError: there are none.
        Foreign: they are whole, but not ours: why.
        ValueError: they are damaged: why.
    """
    content = _file(root, f"{name}/{METADATA}" if name else METADATA, MOST_BYTES)
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        raise ValueError("no JSON") from None
    if not isinstance(found, dict) or not isinstance(found.get("attributes"), dict):
        raise ValueError("no metadata of Zarr 3")
    given = found["attributes"].pop(SEAL, None)
    if given is None:
        raise ValueError(f"no checksum ({SEAL})")
    if given != _checksum(found, name):
        raise ValueError(CHANGED)
    try:
        if name:
            _check_array(found)
        else:
            _check_root(found)
    except ValueError as error:
        raise Foreign(str(error)) from None
    return found


def write_metadata(content: Mapping[str, Any], name: str) -> bytes:
    """Metadata of an array, or of the store (`ROOT`), as a file, with their checksum."""
    found = json.loads(json.dumps(content))
    found["attributes"].pop(SEAL, None)
    found["attributes"][SEAL] = _checksum(found, name)
    return json.dumps(found, indent=2).encode()


def survey(root: Path) -> Iterator[tuple[str, str | None]]:
    """What is damaged in a store: names of arrays (or `ROOT`), each with a chunk's key, or None for
    its metadata.
    """
    known = stored_chunks(root)
    names = sorted({one.name for one in root.iterdir() if one.is_dir()} | known.keys())
    for name in (ROOT, *names):
        try:
            metadata(root, name)
        except FileNotFoundError:  # there was no room to make it, unless it has or had chunks
            there = (root / name).iterdir() if name not in known else ()
            if name in (ROOT, *known) or any(one.suffix != PARTIAL for one in there):
                yield name, None
        except (OSError, ValueError):
            yield name, None
    for name in names:
        found = set(chunks(root, name))
        yield from ((name, f"{name}/c/{chunk}") for chunk in known.get(name, set()) - found)
        for chunk in found:
            key = f"{name}/c/{chunk}"
            try:
                _check_chunk(_file(root, key, MOST_CHUNK_BYTES), key, _array(root, name))
            except (OSError, ValueError):
                yield name, key


def chunks(root: Path, name: str) -> Iterator[str]:
    """Names of the chunks of an array that are there."""
    begin = root / name / "c"
    for folder, _, found in os.walk(begin):
        for chunk in found:
            if not chunk.endswith(PARTIAL):
                yield (Path(folder) / chunk).relative_to(begin).as_posix()


def stored_chunks(root: Path) -> dict[str, set[str]]:
    """Chunks that were there when the sweep was last ended, by array; empty if nothing tells."""
    return _whole(root)[0]


def _array(root: Path, name: str) -> dict[str, Any] | None:
    """Metadata of an array by those of the whole, which readers have, else by its own."""
    found = _whole(root)[1].get(name)
    if found is None:
        with suppress(OSError, ValueError):
            found = metadata(root, name)
    return found


def _whole(root: Path) -> tuple[dict[str, set[str]], dict[str, dict[str, Any]]]:
    """Chunks at the end of the sweep and metadata, by array; empty if they are damaged."""
    try:
        found = (root / METADATA).lstat()
        return _read_whole(root, (found.st_ino, found.st_mtime_ns, found.st_size))
    except (OSError, ValueError):
        return {}, {}


@lru_cache(maxsize=4)
def _read_whole(
    root: Path, _: tuple[int, ...]
) -> tuple[dict[str, set[str]], dict[str, dict[str, Any]]]:
    """The same of a file that looks so: it is asked for with each chunk."""
    found = metadata(root, ROOT)
    listed = found["attributes"].get(WRITTEN, {})
    arrays = (found.get("consolidated_metadata") or {}).get("metadata", {})
    return {name: set(chunks) for name, chunks in listed.items()}, arrays


def _file(root: Path, key: str, most: int) -> bytes:
    """A file of the store.

    Raises:
        FileNotFoundError: there is none.
        ValueError: it is another kind of thing, leads out of the store, or is too large.
    """
    path = root / key
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode) or os.path.realpath(path) != str(
        Path(os.path.realpath(root)) / key
    ):
        raise ValueError("no file of the store")
    if found.st_size > most:
        raise ValueError(f"{found.st_size} bytes are more than {most}")
    return path.read_bytes()


def _check_chunk(content: bytes, key: str, array: Mapping[str, Any] | None) -> None:
    """Refuse a chunk that has changed, is not of its array's size, or was written elsewhere.

    Raises:
        ValueError: why.
    """
    if google_crc32c.value(content[:-4]) != int.from_bytes(content[-4:], "little"):
        raise ValueError(CHANGED)
    if array is not None:
        _check_size(content, array)
    if not content[:-4].endswith(_place(key)):
        raise ValueError(ELSEWHERE)


def _check_size(content: bytes, array: Mapping[str, Any]) -> None:
    """Refuse a chunk that would unpack to another size than its array's chunks have.

    Raises:
        ValueError: why.
    """
    cells = math.prod(array["chunk_grid"]["configuration"]["chunk_shape"])
    kind, size = array["data_type"], _unpacked(content)
    if size is None:
        raise ValueError("its uncompressed size is missing")
    if kind != "string" and size != cells * _TYPES[kind]:
        raise ValueError(f"it unpacks to {size} bytes, not to {cells * _TYPES[kind]}")
    if kind == "string" and size > (most := cells * MOST_TEXT_BYTES):
        raise ValueError(f"it unpacks to {size} bytes, more than {most}")


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


def _place(key: str) -> bytes:
    """What a chunk has behind its data: a frame that is skipped, with the chunk's place."""
    place = key.encode()
    return _SKIPPED + len(place).to_bytes(4, "little") + place


def _sealed(key: str, value: Buffer) -> Buffer:
    """Content for a file with its checksum, which is also of its place."""
    content = value.to_bytes()
    name, _, what = key.rpartition("/")
    if what == METADATA:
        content = write_metadata(json.loads(content), name)
    else:
        content = content[:-4] + _place(key)
        content += google_crc32c.value(content).to_bytes(4, "little")
    return default_buffer_prototype().buffer.from_bytes(content)


def _checksum(content: Any, name: str) -> str:
    """SHA-256 of the metadata of an array, or of the store (`ROOT`)."""
    text = json.dumps([name, content], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _check_root(found: Mapping[str, Any]) -> None:
    """Refuse metadata of a store that we do not write.

    Raises:
        ValueError: what is foreign.
    """
    _check_keys(found, {"attributes", "zarr_format", "node_type", "consolidated_metadata"})
    _check_fixed(found, {"zarr_format": 3, "node_type": "group"})
    for name, value in found["attributes"].items():
        if name not in _ABOUT or not isinstance(value, _ABOUT[name]):
            raise ValueError(f"the attribute {name!r} is foreign")
    for name, listed in found["attributes"].get(WRITTEN, {}).items():
        _check_name(name)
        if not isinstance(listed, list) or not all(map(_CHUNK.fullmatch, map(str, listed))):
            raise ValueError(f"the chunks of {name!r} are {listed!r:.60}")
    whole = found.get("consolidated_metadata")
    if whole is None:  # it is being made
        return
    if not isinstance(whole, dict) or not isinstance(whole.get("metadata"), dict):
        raise ValueError("invalid consolidated metadata")
    _check_keys(whole, {"kind", "must_understand", "metadata"})
    for name, array in whole["metadata"].items():
        _check_name(name)
        try:
            _check_array(array)
        except ValueError as error:
            raise ValueError(f"array {name!r}: {error}") from None


def _check_name(name: str) -> None:
    """Refuse names of arrays that lead elsewhere."""
    if not name or name.startswith(".") or "/" in name or "\0" in name:
        raise ValueError(f"an array is called {name!r}")


def _check_array(found: Any) -> None:
    """Refuse metadata of an array that we do not write.

    Raises:
        ValueError: what is foreign.
    """
    if not isinstance(found, dict):
        raise ValueError("no metadata")
    _check_fixed(found, {"zarr_format": 3, "node_type": "array"})
    _check_keys(found, _ARRAY)
    if set(found) != _ARRAY:
        raise ValueError(f"it has no {', no '.join(sorted(_ARRAY - set(found)))}")
    kind, shape, names = found["data_type"], found["shape"], found["dimension_names"]
    if not isinstance(kind, str) or kind not in _TYPES:
        raise ValueError(f"the type {kind!r} is none of {', '.join(_TYPES)}")
    _check_codecs(kind, found["codecs"])
    try:
        chunks = found["chunk_grid"]["configuration"]["chunk_shape"]
    except (TypeError, KeyError):
        chunks = None
    fixed = {
        "storage_transformers": [],
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunks}},
    }
    _check_fixed(found, fixed)
    if not (_sizes(shape, 0) and _sizes(chunks, 1) and len(shape) == len(chunks) > 0):
        raise ValueError(f"the shape {shape!r} in chunks {chunks!r}")
    if math.prod(chunks) * _TYPES[kind] > MOST_CHUNK_BYTES:
        raise ValueError(f"chunks {chunks!r} are larger than {MOST_CHUNK_BYTES} bytes")
    if not (
        isinstance(names, list)
        and len(names) == len(shape)
        and all(isinstance(n, str) for n in names)
    ):
        raise ValueError(f"the dimensions {names!r}")
    if not isinstance(found["fill_value"], str | int | float):
        raise ValueError(f"the fill value {found['fill_value']!r}")
    attributes = found["attributes"]
    if not isinstance(attributes, dict) or not all(
        name in ("units", "long_name", "origin", "sweep") and isinstance(v, str)
        for name, v in attributes.items()
    ):
        raise ValueError(f"the attributes {attributes!r}")


def _check_codecs(kind: str, codecs: Any) -> None:
    """Refuse codecs other than ours: metadata name codecs, and zarr runs what they name."""
    first: dict[str, Any] = {"name": "bytes"}
    if kind == "string":
        first = {"name": "vlen-utf8"}
    elif _TYPES[kind] > 1:
        first["configuration"] = {"endian": "little"}
    try:
        given = [one | {"configuration": one.get("configuration") or {}} for one in codecs]
        shown = ", ".join(str(one["name"])[:40] for one in given)
    except (TypeError, KeyError, AttributeError):
        given, shown = [], repr(codecs)[:60]
    ours = [{"configuration": {}, **one} for one in (first, *map(_described, COMPRESSORS))]
    if given != ours:
        words = ", ".join(one["name"] for one in ours)
        raise ValueError(f"its codecs ({shown}) are not ours ({words})")


def _described(codec: Any) -> dict[str, Any]:
    """A codec as metadata name it."""
    described: dict[str, Any] = codec.to_dict()
    return described


def _check_fixed(found: Mapping[str, Any], ours: Mapping[str, Any]) -> None:
    """Refuse other values of keys than ours."""
    for key, value in ours.items():
        given = found.get(key)
        if type(given) is not type(value) or given != value:
            raise ValueError(f"{key} is {given!r:.60}, not {value!r}")


def _check_keys(found: Mapping[str, Any], known: set[str]) -> None:
    """Refuse keys that we do not write."""
    foreign = sorted(set(found) - known)
    if foreign:
        raise ValueError(f"unknown keys: {', '.join(foreign)[:60]}")


def _sizes(given: Any, least: int) -> bool:
    """Whether it is a list of whole numbers."""
    return isinstance(given, list) and all(type(n) is int and n >= least for n in given)
