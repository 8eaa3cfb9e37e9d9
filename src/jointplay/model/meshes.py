"""Surfaces of mesh files, with the colour of each part; read once, then cached.

trimesh reads them, all parts of a Collada file included. Surfaces are kept in the user's cache by
the content of the file, so that a mesh is read again only when it has changed: Collada takes a
hundred times as long to read as numbers.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, JointplayWarning
from jointplay.base.units import NUMBER

FORMATS = (".dae", ".obj", ".stl")
"""Mesh files that are read."""

FOLDER = "meshes"
"""Name of the folder with meshes beside a file for a simulator."""

MOST_BYTES = 200_000_000
"""Largest mesh file that is read; those of robots have a few megabytes."""

_VERSION = b"jointplay surfaces 1"
"""Part of the key under which a surface is cached: to be changed with the way of reading."""
_MOST_KEPT = 1000
"""Most files in the cache; the older half goes when it is full."""
_WELD = 1e-6
"""Grid on which points are welded, relative to the size of the part."""

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0 to 1."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of one colour; points in the order in which triangles use them, none twice."""

    points: np.ndarray
    """Points (n, 3) [m]."""
    triangles: np.ndarray
    """Indices of each triangle's points (m, 3)."""
    colour: Colour | None = None
    """Colour in the file; None where it states none."""

    def corners(self) -> np.ndarray:
        """Corners of each triangle (m, 3, 3) [m]."""
        return self.points[self.triangles]


Parts = tuple[Surface, ...]


def write_meshes(folder: Path, meshes: Mapping[str, bytes]) -> None:
    """Write mesh files, by name, into `FOLDER` beside a robot's file in `folder`."""
    if meshes:
        files.make_folder(folder / FOLDER)
    for name, content in meshes.items():
        files.write(folder / FOLDER / name, content, overwrite=True)


def parts_of(path: Path) -> Parts:
    """All surfaces of a mesh file.

    Raises:
        JointplayError: the file is of another format, cannot be read, or has no triangle.
    """
    if path.suffix.lower() not in FORMATS:
        raise JointplayError(
            f"mesh {str(path)!r} is not a {', '.join(FORMATS)} file; other formats cannot be read"
        )
    try:
        data = files.read_plain(path, MOST_BYTES)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise JointplayError(f"cannot read {str(path)!r}: {reason}") from None
    return _parts(path, _key(path, data))


def readable(path: Path) -> Parts | None:
    """All surfaces of a mesh file; None, with a warning, if it cannot be read."""
    try:
        return parts_of(path)
    except JointplayError as error:
        warnings.warn(f"a mesh is not shown: {error}", JointplayWarning, stacklevel=2)
        return None


def _key(path: Path, data: bytes) -> str:
    """Hash of a mesh file, and of the files beside it from which a .obj takes colours."""
    digest = hashlib.sha256(_VERSION + path.suffix.lower().encode() + data)
    if path.suffix.lower() == ".obj":
        for name in re.findall(rb"(?m)^mtllib\s+(.+?)\s*$", data):
            with suppress(OSError, ValueError):
                digest.update(files.read_plain(path.parent / os.fsdecode(name), MOST_BYTES))
    return digest.hexdigest()


@lru_cache(maxsize=256)
def _parts(path: Path, key: str) -> Parts:
    """Surfaces from the cache, or from the file, which are then cached."""
    stored = files.cache_folder() / FOLDER / f"{key}.npz"
    with suppress(OSError, ValueError, LookupError):  # a damaged file is no file
        return _unpacked(stored)
    parts = _read(path)
    with suppress(OSError, RuntimeError, JointplayError):  # the cache cannot be written
        stored.parent.mkdir(parents=True, exist_ok=True)
        others = sorted(stored.parent.glob("*.npz"), key=lambda file: file.stat().st_mtime)
        for oldest in others[: _MOST_KEPT // 2] if len(others) >= _MOST_KEPT else ():
            oldest.unlink(missing_ok=True)
        files.write(stored, _packed(parts), overwrite=True, announced=False)
    return parts


def _packed(parts: Parts) -> bytes:
    arrays = {}
    for number, part in enumerate(parts):
        arrays[f"points{number}"] = part.points.astype(np.float32)
        arrays[f"triangles{number}"] = part.triangles.astype(np.uint32)
        arrays[f"colour{number}"] = np.array(part.colour or ())
    file = io.BytesIO()
    np.savez(file, **arrays)  # type: ignore[arg-type]
    return file.getvalue()


def _unpacked(path: Path) -> Parts:
    stored, parts = files.arrays(path), []
    for number in range(len(stored) // 3):
        colour = stored[f"colour{number}"]
        points = stored[f"points{number}"].astype(float)
        triangles = stored[f"triangles{number}"].astype(np.int64)
        if triangles.max() >= len(points):
            raise ValueError("damaged")
        parts.append(Surface(points, triangles, tuple(colour) if len(colour) else None))
    if not parts:
        raise ValueError("empty")
    return tuple(parts)


def _read(path: Path) -> Parts:
    """Surfaces that trimesh reads from a file [m]."""
    import trimesh

    class Beside(trimesh.resolvers.FilePathResolver):
        """Reader of materials and pictures that a mesh names, as careful as that of the mesh."""

        def get(self, name: str) -> bytes:
            return files.read_plain(Path(self.parent) / name.strip(), MOST_BYTES)

    try:
        data = io.BytesIO(files.read_plain(path, MOST_BYTES))
        kind = path.suffix.lower().removeprefix(".")
        scene: Any = trimesh.load_scene(data, file_type=kind, resolver=Beside(path))
        bodies = scene.dump()
        # Metres in a unit of the scene, which only Collada states, by a number or "meters".
        unit = next((g.metadata.get("units") for g in scene.geometry.values()), None) or "1"
        number = NUMBER.match(str(unit).split()[0])
        size = float(number[0]) if number else 1.0
    except Exception as error:  # noqa: BLE001 - trimesh and what it calls raise whatever they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise JointplayError(f"mesh {str(path)!r} cannot be read: {reason}") from None
    parts = []
    for body in bodies:
        triangles = np.asarray(getattr(body, "faces", ()))
        if len(triangles):
            part = surface(size * np.asarray(body.vertices), triangles, _colour(body))
            parts += [part] if len(part.triangles) else []
    if not parts:
        raise JointplayError(f"mesh {str(path)!r} has no triangle")
    return tuple(parts)


def _colour(body: Any) -> Colour | None:
    """Colour of a trimesh body, or the mean colour of a picture on it; None if it has neither."""
    looks = body.visual
    material = getattr(looks, "material", None)
    picture = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if picture is not None:
        red, green, blue = np.asarray(picture.convert("RGB")).reshape(-1, 3).mean(axis=0) / 255.0
        return float(red), float(green), float(blue), 1.0
    if material is not None:
        colour = np.asarray(material.main_color, float) / 255.0
    elif looks.defined:
        colour = np.asarray(looks.main_color, float) / 255.0
    else:
        return None
    red, green, blue, opacity = (float(value) for value in colour[:4])
    return red, green, blue, opacity if opacity > 0.0 else 1.0


def surface(points: np.ndarray, triangles: np.ndarray, colour: Colour | None = None) -> Surface:
    """A surface of `points` (n, 3) [m] and `triangles` (m, 3), with equal points welded.

    Points without a triangle, and triangles that welding makes lines, are left out.
    """
    used = np.asarray(points, float)[np.asarray(triangles, np.int64).reshape(-1)]
    if not len(used):
        return Surface(np.zeros((0, 3)), np.zeros((0, 3), np.int64), colour)
    grid = _WELD * float(np.ptp(used, axis=0).max()) or 1.0
    _, first, number = np.unique(
        np.round(used / grid).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    corners = number.reshape(-1, 3)
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    names, seen, order = np.unique(corners.reshape(-1), return_index=True, return_inverse=True)
    rank = np.empty(len(names), np.int64)
    rank[np.argsort(seen)] = np.arange(len(names))
    ordered = np.empty((len(names), 3))
    ordered[rank] = used[first[names]]
    return Surface(ordered, rank[order.reshape(-1)].reshape(-1, 3), colour)
