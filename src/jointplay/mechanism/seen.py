"""What is seen of a mechanism: the URDF's visuals as surfaces on its links, with their colours.

`visuals` makes the same for Pinocchio, whose shapes know no colours of parts. Here meshes are read
by `meshes`, all parts of them; box, cylinder and ball are surfaces too; where a mesh is missing
capsules stand in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.errors import JointplayError
from jointplay.mechanism.declared import Declared
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.meshes import Colour, Part, Parts, parts_of, surface
from jointplay.mechanism.model import parse
from jointplay.mechanism.visuals import (
    THICKNESS,
    capsules,
    find_mesh,
    mesh_folders,
    places_of,
    reach_of,
)

TONES: tuple[Colour, ...] = ((0.79, 0.83, 0.87, 1.0), (0.66, 0.72, 0.79, 1.0))
"""Of links without colour, by turns, so that one can be told from the next."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Surfaces on a link."""

    link: str
    placement: np.ndarray
    """From the surfaces to the link's frame, their scale included (4, 4)."""
    parts: Parts
    colours: tuple[Colour, ...]
    """Of each part."""
    key: str
    """Shapes of one key have the same surfaces, if they are not colours that differ."""


@dataclass(frozen=True)
class Look:
    """All shapes of a mechanism.

    Attributes:
        shapes: in the order of the URDF.
        reach: size of the robot, the largest distance between two of its links' frames [m].
        missing: mesh files that were not found or not readable; stand-ins take their place.
    """

    shapes: list[Shape]
    reach: float
    missing: list[str] = field(default_factory=list)


def look(mechanism: Mechanism, folders: Sequence[str | Path] = ()) -> Look:
    """What is seen of `mechanism`, with or without clearance.

    Args:
        mechanism: what is looked at.
        folders: where else meshes may be.

    Raises:
        JointplayError: a given folder does not exist.
    """
    description = mechanism.description
    robot = Declared(description.text).pictured
    where = mesh_folders(mechanism, folders)
    source = parse(description)
    places = places_of(source)
    reach = reach_of(places)
    order = list(places)
    shapes: list[Shape] = []
    missing: list[str] = []
    bare = []
    for link in robot.links:
        tone = TONES[order.index(link.name) % len(TONES)]
        forms = []
        for visual in link.visuals:
            mesh = visual.geometry.mesh
            key, parts = _surfaces(visual.geometry, where, not description.stored)
            if not parts and mesh is not None:
                missing.append(mesh.filename or "")
                continue
            place = np.eye(4) if visual.origin is None else np.array(visual.origin)
            if mesh is not None and mesh.scale is not None:
                place = place @ np.diag([*np.broadcast_to(mesh.scale, 3), 1.0])
            given = _colour(visual.material, robot)
            colours = tuple(given or part.colour or tone for part in parts)
            forms.append(Shape(link.name, place, parts, colours, key))
        shapes += [shape for shape in forms if any(len(part.triangles) for part in shape.parts)]
        if link.visuals and not forms:
            bare.append(link.name)
    if not any(link.visuals for link in robot.links):
        bare = [link.name for link in robot.links]
    for name, placement, radius, length in capsules(
        description.text, places, bare, THICKNESS * reach
    ):
        part = _capsule(radius, length)
        tone = TONES[order.index(name) % len(TONES)]
        key = f"capsule {radius!r} {length!r}"
        shapes.append(Shape(name, placement.homogeneous, (part,), (tone,), key))
    return Look(shapes, reach, missing)


def _surfaces(geometry: Any, where: Sequence[Path], anywhere: bool) -> tuple[str, Parts]:
    """Key and surfaces of a visual's geometry; none where a mesh cannot be had."""
    if geometry.box is not None:
        x, y, z = (float(size) for size in geometry.box.size)
        return f"box {x!r} {y!r} {z!r}", (_box(x, y, z),)
    if geometry.cylinder is not None:
        radius, length = float(geometry.cylinder.radius), float(geometry.cylinder.length)
        return f"cylinder {radius!r} {length!r}", (_cylinder(radius, length),)
    if geometry.sphere is not None:
        radius = float(geometry.sphere.radius)
        return f"capsule {radius!r} 0.0", (_capsule(radius, 0.0),)
    path = find_mesh(geometry.mesh.filename or "", where, anywhere)
    if path is None:
        return "", ()
    try:
        return f"mesh {path}", parts_of(path)
    except JointplayError:  # one broken file must not stop the others
        return "", ()


def _colour(material: Any, robot: Any) -> Colour | None:
    """Colour that the URDF gives a visual, by itself or by a name."""
    if material is None:
        return None
    named = next((one for one in robot.materials if one.name == material.name), None)
    for one in (material, named):
        if one is not None and one.color is not None and one.color.rgba is not None:
            red, green, blue, opacity = (float(value) for value in one.color.rgba)
            return red, green, blue, opacity if opacity > 0.0 else 1.0
    return None


@lru_cache(maxsize=256)
def _box(x: float, y: float, z: float) -> Part:
    import trimesh

    mesh = trimesh.creation.box((x, y, z))
    return surface(mesh.vertices, mesh.faces)


@lru_cache(maxsize=256)
def _cylinder(radius: float, length: float) -> Part:
    import trimesh

    mesh = trimesh.creation.cylinder(radius, length, sections=48)
    return surface(mesh.vertices, mesh.faces)


@lru_cache(maxsize=256)
def _capsule(radius: float, length: float) -> Part:
    """A capsule about the middle of its axis z; a ball if it has no length."""
    import trimesh

    if length > 0.0:
        mesh = trimesh.creation.capsule(length, radius, count=[32, 32])
        mesh.vertices -= mesh.bounds.mean(axis=0)
    else:
        mesh = trimesh.creation.uv_sphere(radius, count=[24, 32])
    return surface(mesh.vertices, mesh.faces)
