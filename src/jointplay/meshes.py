"""Reading meshes: STL, COLLADA (.dae) and Wavefront (.obj), with the colours they carry.

Coal reads them too, but tells no colours, and mixes up the corners of COLLADA nodes that have
several materials (seen with coal 3.0.3 and the wrists of the UR5).
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pinocchio as pin

from jointplay.errors import JointplayError, MissingName

Element = ElementTree.Element


@dataclass(frozen=True)
class Mesh:
    """Triangles and their colours."""

    corners: np.ndarray
    """Shape (triangles, 3, 3), in the file's own unit but for COLLADA, which says it: m."""
    colours: np.ndarray
    """Red, green, blue, opacity from 0 to 1, shape (triangles, 4); not a number where unknown."""


@lru_cache(maxsize=256)
def load(path: Path) -> Mesh:
    """Read a mesh.

    Raises:
        JointplayError: it is missing, malformed or empty.
        MissingName: it is of another format.
    """
    readers = {".stl": _stl, ".dae": _dae, ".obj": _obj}
    kind = path.suffix.lower()
    if kind not in readers:
        raise MissingName("reader for the mesh", path.name, readers)
    try:
        corners, colours = readers[kind](path)
    except (OSError, ValueError, IndexError, KeyError, ElementTree.ParseError) as error:
        raise JointplayError(f"cannot read the mesh {str(path)!r}: {error}") from None
    if not len(corners) or not np.isfinite(corners).all():
        raise JointplayError(f"the mesh {str(path)!r} has no triangles")
    return Mesh(corners, colours)


def _colourless(count: int) -> np.ndarray:
    return np.full((count, 4), np.nan)


def _stl(path: Path) -> tuple[np.ndarray, np.ndarray]:
    data = path.read_bytes()
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + count * record.itemsize:  # text may begin with anything, even binary
        corners = np.frombuffer(data, record, offset=84)["corners"].astype(float)
    else:
        words = data.decode("ascii").split()
        at = [i for i, word in enumerate(words) if word == "vertex"]
        corners = np.array([words[i + 1 : i + 4] for i in at], float).reshape(-1, 3, 3)
    return corners, _colourless(len(corners))


def _obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    vertices, faces = [], []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        kind, *values = line.split() or [""]
        if kind == "v":
            vertices.append([float(x) for x in values[:3]])
        elif kind == "f":
            corner = [int(value.partition("/")[0]) for value in values]
            corner = [i - 1 if i > 0 else len(vertices) + i for i in corner]
            faces += [(corner[0], *corner[k : k + 2]) for k in range(1, len(corner) - 1)]
    corners = np.array(vertices).reshape(-1, 3)[np.array(faces, int).reshape(-1, 3)]
    return corners, _colourless(len(corners))


def _dae(path: Path) -> tuple[np.ndarray, np.ndarray]:
    root = ElementTree.parse(path).getroot()
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]  # versions differ by namespace only
    named = {f"#{e.get('id')}": e for e in root.iter() if e.get("id")}
    scene = root.find("scene/instance_visual_scene")
    tops = root.iterfind(".//visual_scene/node") if scene is None else named[_url(scene)]
    unit = root.find("asset/unit")
    scale = 1.0 if unit is None else float(unit.get("meter", "1"))
    # The axis that points up is not heeded: in URDFs, meshes are meant as their numbers stand.
    pieces = [piece for top in tops for piece in _node(top, np.diag([scale] * 3 + [1.0]), named)]
    corners, colours = zip(*pieces, strict=True) if pieces else ([np.zeros((0, 3, 3))], [])
    return np.concatenate(corners), np.concatenate(colours or [_colourless(0)])


def _url(element: Element) -> str:
    return element.get("url", "")


def _node(
    node: Element, above: np.ndarray, named: dict[str, Element]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Triangles of a node and those below it."""
    place = above
    for step in node:
        place = place @ _transform(step)
    for instance in node.iterfind("instance_geometry"):
        bound = {b.get("symbol"): b.get("target", "") for b in instance.iter("instance_material")}
        mesh = named[_url(instance)].find("mesh")
        for part in () if mesh is None else mesh:
            if part.tag in ("triangles", "polylist", "polygons") and part.find("input") is not None:
                corners = _triangles(part, named) @ place[:3, :3].T + place[:3, 3]
                colour = _colour(bound.get(part.get("material")), named)
                yield corners, np.tile(colour, (len(corners), 1))
    for below in node.iterfind("node"):
        yield from _node(below, place, named)
    for instance in node.iterfind("instance_node"):
        yield from _node(named[_url(instance)], place, named)


def _transform(step: Element) -> np.ndarray:
    place = np.eye(4)
    if step.tag == "matrix":
        return _numbers(step).reshape(4, 4)
    if step.tag == "translate":
        place[:3, 3] = _numbers(step)
    elif step.tag == "scale":
        place[:3, :3] = np.diag(_numbers(step))
    elif step.tag == "rotate":
        *axis, angle = _numbers(step)
        place[:3, :3] = pin.exp3(np.radians(angle) * np.array(axis) / np.linalg.norm(axis))
    return place


def _numbers(element: Element | None) -> np.ndarray:
    if element is None:
        raise ValueError("a COLLADA element is missing")
    return np.array((element.text or "").split(), float)


def _triangles(part: Element, named: dict[str, Element]) -> np.ndarray:
    inputs = {i.get("semantic"): i for i in part.findall("input")}
    width = 1 + max(int(i.get("offset", "0")) for i in inputs.values())
    vertices = named[inputs["VERTEX"].get("source", "")]
    source = next(i for i in vertices.findall("input") if i.get("semantic") == "POSITION")
    positions = _numbers(named[source.get("source", "")].find("float_array")).reshape(-1, 3)
    indices = [np.array((p.text or "").split(), int).reshape(-1, width) for p in part.findall("p")]
    corner = [p[:, int(inputs["VERTEX"].get("offset", "0"))] for p in indices]
    joined = np.concatenate(corner) if corner else np.zeros(0, int)
    counts = np.full(len(joined) // 3, 3)
    if part.tag == "polylist":
        counts = _numbers(part.find("vcount")).astype(int)
    elif part.tag == "polygons":
        counts = np.array([len(p) for p in corner])
    first = np.cumsum(counts) - counts
    fans = [
        np.stack([first, first + k, first + k + 1], axis=1)[counts > k + 1]
        for k in range(1, int(counts.max(initial=2)) - 1)
    ]
    return positions[joined[np.concatenate(fans)]] if fans else np.zeros((0, 3, 3))


def _colour(material: str | None, named: dict[str, Element]) -> np.ndarray:
    """Diffuse colour of a material; not a number if it has none or a picture."""
    unknown = np.full(4, np.nan)
    effect = named[material].find("instance_effect") if material in named else None
    if effect is None or _url(effect) not in named:
        return unknown
    colour = named[_url(effect)].find(".//diffuse/color")
    return unknown if colour is None else _numbers(colour)
