"""A robot's shapes: the URDF's visuals, attached to the links of a mechanism's model.

Pinocchio's own `buildGeomFromUrdf` is not used: it knows the URDF's joints only, not virtual links,
and gives up when a single mesh is missing.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from jointplay import meshes
from jointplay.errors import JointplayError
from jointplay.mechanism import Mechanism
from jointplay.robots import share

GREY = (0.72, 0.74, 0.77, 1.0)
"""Colour of what has none in the URDF."""


@dataclass(frozen=True)
class Visuals:
    """What `visuals` found."""

    geometry: pin.GeometryModel
    """Valid for `mechanism.model`."""
    links: tuple[str, ...]
    """Link of each geometry object."""
    missing: tuple[tuple[str, str], ...]
    """Link and file name of each mesh that was not found or cannot be read."""


def visuals(mechanism: Mechanism, search: Sequence[str | Path] = ()) -> Visuals:
    """Load the visuals of all links.

    Each is attached to its link's frame, wherever the mechanism carries it.

    Args:
        mechanism: with or without clearance.
        search: folders in which meshes are looked for, before the URDF's own folder and those
            around it and the data of example-robot-data.
    """
    geometry = pin.GeometryModel()
    links: list[str] = []
    missing: list[tuple[str, str]] = []
    root = ElementTree.fromstring(mechanism.description.text)
    colours = {m.get("name"): c for m in root.iter("material") if (c := _colour(m)) is not None}
    folders = list(_folders(mechanism.description.path, search))
    model = mechanism.model
    for link in root.findall("link"):
        name = link.get("name", "")
        index = int(model.getFrameId(name, pin.FrameType.BODY))
        frame = model.frames[index]
        for number, visual in enumerate(link.findall("visual")):
            shape = _shape(visual, folders)
            if isinstance(shape, str):
                missing.append((name, shape))
                continue
            if shape is None:
                continue
            form, file, scale = shape
            material = visual.find("material")
            colour = None
            if material is not None:
                colour = _colour(material) or colours.get(material.get("name"))
            thing = pin.GeometryObject(
                f"{name}_{number}",
                int(frame.parentJoint),
                index,
                frame.placement * _origin(visual),
                form,
                file,
                scale,
                colour is not None,
                np.array(colour or GREY),
            )
            geometry.addGeometryObject(thing)
            links.append(name)
    return Visuals(geometry, tuple(links), tuple(missing))


def _colour(material: ElementTree.Element) -> tuple[float, ...] | None:
    colour = material.find("color")
    return None if colour is None else tuple(map(float, colour.get("rgba", "1 1 1 1").split()))


def _origin(element: ElementTree.Element) -> pin.SE3:
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = (np.array(origin.get(k, "0 0 0").split(), float) for k in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)


def _shape(
    visual: ElementTree.Element, folders: Sequence[Path]
) -> tuple[Any, str, np.ndarray] | str | None:
    """Form, file and scale; the file's name if it is missing; None for nothing known."""
    element = visual.find("geometry/*")
    one = np.ones(3)
    if element is None:
        return None

    def number(key: str) -> float:
        return float(element.get(key, "0"))

    match element.tag:
        case "box":
            return coal.Box(*map(float, element.get("size", "").split())), "BOX", one
        case "cylinder":
            return coal.Cylinder(number("radius"), number("length")), "CYLINDER", one
        case "capsule":
            return coal.Capsule(number("radius"), number("length")), "CAPSULE", one
        case "sphere":
            return coal.Sphere(number("radius")), "SPHERE", one
        case "mesh":
            name = element.get("filename", "")
            file = find_mesh(name, folders)
            scale = np.array(element.get("scale", "1 1 1").split(), float)
            form = None if file is None else _mesh(file, tuple(scale))
            return name if form is None else (form, str(file), scale)
    return None


@lru_cache(maxsize=256)
def _mesh(file: Path, scale: tuple[float, ...]) -> Any:
    """The mesh as coal needs it; None if it cannot be read."""
    try:
        corners = meshes.load(file).corners * np.array(scale)
    except JointplayError:
        return None
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(corners), 3 * len(corners))
    model.addVertices(corners.reshape(-1, 3))
    model.addTriangles(np.arange(3 * len(corners)).reshape(-1, 3))
    model.endModel()
    return model


def _folders(path: Path, search: Sequence[str | Path]) -> Iterator[Path]:
    yield from map(Path, search)
    yield from path.resolve().parents
    try:
        yield share()
        yield share().parent
    except JointplayError:
        pass


def find_mesh(name: str, folders: Sequence[Path]) -> Path | None:
    """File that a URDF's mesh `name` means, if it exists below one of `folders`.

    ``package://p/rest`` is looked for as p/rest in a folder, or as rest in a folder called p.
    """
    scheme, _, rest = name.rpartition("://")
    if scheme in ("file", "") and Path(rest).is_absolute():
        return Path(rest) if Path(rest).is_file() else None
    rest = rest.lstrip("/")
    package, _, inside = rest.partition("/")
    for folder in folders:
        candidates = [folder / rest]
        if scheme in ("package", "model") and folder.name == package:
            candidates.append(folder / inside)
        for candidate in candidates:
            if candidate.is_file():
                return candidate
    return None


def surface(thing: pin.GeometryObject) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of one of the objects of `visuals`, and their colours.

    Returns:
        Corners in the object's own frame, shape (n, 3, 3) [m], and red, green, blue, opacity of
        each, shape (n, 4): the URDF's, else the mesh file's; not a number where neither has any.
    """
    if isinstance(thing.geometry, coal.BVHModelBase):
        mesh = meshes.load(Path(thing.meshPath))
        corners, colours = mesh.corners * thing.meshScale, mesh.colours
    else:
        corners = tessellate(thing.geometry)
        colours = np.full((len(corners), 4), np.nan)
    if thing.overrideMaterial:
        colours = np.tile(thing.meshColor, (len(corners), 1))
    return corners, colours


def tessellate(form: Any, segments: int = 48) -> np.ndarray:
    """Surface of a form in its own frame, wound counterclockwise as seen from outside.

    Args:
        form: box, cylinder, capsule or sphere of coal.
        segments: around a circle.

    Returns:
        Corners, shape (triangles, 3, 3) [m].

    Raises:
        JointplayError: another form.
    """
    if isinstance(form, coal.Box):
        return _box(form.halfSide)
    if isinstance(form, coal.Cylinder):
        r, h = form.radius, form.halfLength
        return _turned([(0.0, -h), (r, -h), (r, h), (0.0, h)], segments)
    if isinstance(form, coal.Sphere | coal.Capsule):
        h = getattr(form, "halfLength", 0.0)
        angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
        lift = np.where(angles > 0, h, -h)
        profile = list(
            zip(form.radius * np.cos(angles), form.radius * np.sin(angles) + lift, strict=True)
        )
        return _turned(profile, segments)
    kind = re.sub(r"\W", "", type(form).__name__)
    raise JointplayError(f"a shape of the kind {kind} cannot be drawn")


def _box(half: np.ndarray) -> np.ndarray:
    faces = []
    for axis in range(3):
        u, v, w = (np.roll(np.eye(3), axis, axis=1)) * half
        for side in (1.0, -1.0):
            a, b, c, d = (
                side * w + s * u + t * v * side for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            )
            faces += [[a, b, c], [a, c, d]]
    return np.array(faces)


def _turned(profile: Sequence[tuple[float, float]], segments: int) -> np.ndarray:
    """Surface of revolution about z of a profile (r, z) that begins and ends on the axis."""
    phi = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    points = np.array(
        [
            [(r * c, r * s, z) for r, z in profile]
            for c, s in zip(np.cos(phi), np.sin(phi), strict=True)
        ]
    )
    a, b = points[:-1, :-1], points[1:, :-1]
    c, d = points[1:, 1:], points[:-1, 1:]
    found = np.concatenate([np.stack([a, b, c], -2), np.stack([a, c, d], -2)]).reshape(-1, 3, 3)
    size = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
    return found[size > 1e-12 * size.max()]
