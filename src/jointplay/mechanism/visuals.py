"""What a mechanism looks like: the URDF's visuals, re-attached to the links of any model of it.

A mechanism builds its own Pinocchio model, in which a joint with clearance is several joints and
its frame is turned. Its link frames, however, are those of the URDF. Each visual therefore belongs
to a link, by name, and stands where that link's frame stands.
"""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import coal
import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError
from jointplay.core.files import is_folder, temporary
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.meshes import FORMATS, Colour, Parts, Surface, parts_of, readable, surface
from jointplay.mechanism.model import parse
from jointplay.mechanism.urdf import Declared

_VIEW = (1.6, -1.6, 1.0)
"""Where the camera stands, from the robot's middle, relative to the robot's reach."""
_GREY = np.array([0.62, 0.64, 0.67, 1.0])
THICKNESS = 0.035
"""Radius of a stand-in, relative to the robot's reach."""


@dataclass
class Visuals:
    """Shapes of a mechanism.

    Attributes:
        geometry: `pin.GeometryModel`, valid for the mechanism's model.
        links: link that carries each geometry object, in their order.
        missing: mesh files that were not found or not readable; stand-ins take their place.
        reach: size of the robot, the largest distance between two of its links' frames [m].
    """

    geometry: pin.GeometryModel
    links: list[str]
    reach: float
    missing: list[str] = field(default_factory=list)


def mesh_folders(mechanism: Mechanism, given: Sequence[str | Path] = ()) -> list[Path]:
    """Where meshes are looked for: `given`, the URDF's own folders, example-robot-data's.

    A mechanism from a result has no folders of its own: what others wrote into a file must not
    choose among the files here.

    Raises:
        JointplayError: a given folder does not exist.
    """
    folders = [Path(folder) for folder in given]
    for folder in folders:
        if not is_folder(folder):
            raise JointplayError(f"no folder of meshes {str(folder)!r}")
    if not mechanism.description.stored:
        # package://name/meshes beside name/urdf
        folders += [Path.cwd(), *list(mechanism.description.path.resolve().parents)[:4]]
    try:
        files = distribution("example-robot-data").files or []
    except PackageNotFoundError:
        files = []
    for file in files:
        parts = file.parts
        if "robots" in parts:
            robots = Path(str(file.locate())).parents[len(parts) - parts.index("robots") - 2]
            folders += [robots, robots.parent, robots.parent.parent]
            break
    return folders


def find_mesh(name: str, folders: Sequence[Path], anywhere: bool = True) -> Path | None:
    """File that a URDF's mesh `name` means: a path, a file:// or a package:// address.

    ``package://p/rest`` is looked for as ``folder/p/rest``, as ``folder/rest`` and, because
    folders are moved when robots are collected, as ``folder/*/rest``.

    Args:
        name: as the URDF has it.
        folders: where it may be.
        anywhere: whether it may also lie outside them: an absolute path, or one that leads out.
    """
    try:
        return _find(name, folders, anywhere)
    except (OSError, ValueError):  # a name that no file can have
        return None


def _find(name: str, folders: Sequence[Path], anywhere: bool) -> Path | None:
    address = urlparse(name)
    path = Path(unquote(address.path).lstrip("/")) if address.scheme else Path(name)
    if address.scheme == "file" or (not address.scheme and path.is_absolute()):
        path = Path("/") / path
        allowed = anywhere or any(_inside(path, folder) for folder in folders)
        return path if allowed and path.is_file() else None
    candidates = [
        (folder, folder / part)
        for folder in folders
        for part in (Path(address.netloc) / path, path)
    ]
    if address.scheme == "package":
        # A URDF of example-robot-data says package://example-robot-data/robots/...
        candidates += [
            (folder, folder / Path(*path.parts[depth:]))
            for folder in folders
            for depth in range(1, len(path.parts) - 1)
        ]
    for folder, candidate in candidates:
        if candidate.is_file() and (anywhere or _inside(candidate, folder)):
            return candidate.resolve()
    return None


def _inside(path: Path, folder: Path) -> bool:
    """Whether `path` lies in `folder`, links followed."""
    return path.resolve().is_relative_to(folder.resolve())


def visuals(mechanism: Mechanism, folders: Sequence[str | Path] = ()) -> Visuals:
    """Shapes of `mechanism`, meshes included.

    Raises:
        JointplayError: a given folder does not exist.
    """
    source = parse(mechanism.description)
    where = mesh_folders(mechanism, folders)
    root = ElementTree.fromstring(mechanism.description.text)
    missing, bare = _set_meshes(root, "visual", where, mechanism.description.stored)
    if root.find("link/visual") is None:
        bare = [link.get("name", "") for link in root.findall("link")]
    places = places_of(source)
    reach = reach_of(places)
    geometry, links = _carried(mechanism, source, root, pin.GeometryType.VISUAL)
    text = mechanism.description.text
    for name, placement, radius, length in capsules(text, places, bare, THICKNESS * reach):
        body = coal.Capsule(radius, length) if length > 0.0 else coal.Sphere(radius)
        shape = pin.GeometryObject(
            f"{name}_stand_in_{len(links)}", 0, 0, pin.SE3.Identity(), body, "", np.ones(3)
        )
        shape.meshColor = _GREY
        _attach(geometry, mechanism.model, shape, name, placement)
        links.append(name)
    return Visuals(geometry, links, reach, missing)


def collisions(mechanism: Mechanism, folders: Sequence[str | Path] = ()) -> Visuals:
    """The URDF's collision shapes, with no pairs of them chosen and no stand-ins.

    Raises:
        JointplayError: a given folder does not exist.
    """
    source = parse(mechanism.description)
    root = ElementTree.fromstring(mechanism.description.text)
    where = mesh_folders(mechanism, folders)
    missing, _ = _set_meshes(root, "collision", where, mechanism.description.stored)
    geometry, links = _carried(mechanism, source, root, pin.GeometryType.COLLISION)
    return Visuals(geometry, links, reach_of(places_of(source)), missing)


def visualizer(mechanism: Mechanism, folders: Sequence[str | Path], open_browser: bool) -> Any:
    """Pinocchio's MeshcatVisualizer with the mechanism loaded and shown, loops closed.

    Raises:
        JointplayError: a given folder does not exist, loops cannot be closed, or the server does
            not start.
    """
    from pinocchio.visualize import MeshcatVisualizer

    from jointplay.mechanism import viewer
    from jointplay.mechanism.loop import assemble

    look, shapes = visuals(mechanism, folders), collisions(mechanism, folders)
    for shape in (*look.geometry.geometryObjects, *shapes.geometry.geometryObjects):
        if Path(shape.meshPath).suffix.lower() == ".dae":
            # Meshcat shows one part of a Collada file; the surface read here has them all.
            shape.meshPath = ""
            shape.meshColor = shape.meshColor if shape.overrideMaterial else _GREY
    made = MeshcatVisualizer(mechanism.model, shapes.geometry, look.geometry)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # textures that meshcat cannot show
        made.initViewer(viewer=viewer.visualizer(), open=open_browser)
        made.loadViewerModel(mechanism.model.name or "mechanism")
    made.display(assemble(mechanism, np.zeros(mechanism.model.nq), []))
    places = np.array([made.visual_data.oMg[k].translation for k in range(len(look.links))])
    centre = 0.5 * (places.min(axis=0) + places.max(axis=0))
    x, y, z = look.reach * np.array(_VIEW)
    # Released versions of meshcat have no call for this; its camera's frame has y up.
    made.viewer["/Cameras/default"].set_transform(pin.SE3(np.eye(3), centre).homogeneous)
    made.viewer["/Cameras/default/rotated/<object>"].set_property("position", [x, z, -y])
    return made


def _set_meshes(
    root: ElementTree.Element, tag: str, where: Sequence[Path], stored: bool
) -> tuple[list[str], list[str]]:
    """Name the files of the meshes of all elements `tag`; those not found go.

    Returns:
        What was not found, and the links that are left without shape by that.
    """
    missing: list[str] = []
    bare: list[str] = []
    for link in root.findall("link"):
        shapes = link.findall(tag)
        for shape in shapes:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            file = find_mesh(name, where, anywhere=not stored)
            if file is None or file.suffix.lower() not in FORMATS or not readable(file):
                link.remove(shape)
                missing.append(name)
            else:
                mesh.set("filename", str(file))
        if shapes and link.find(tag) is None:
            bare.append(link.get("name", ""))
    return missing, bare


def _carried(
    mechanism: Mechanism, source: pin.Model, root: ElementTree.Element, kind: pin.GeometryType
) -> tuple[pin.GeometryModel, list[str]]:
    """The URDF's shapes on the links of the mechanism's own model, and these links."""
    with temporary("urdf") as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(ElementTree.tostring(root, encoding="unicode"), encoding="utf-8")
        original = pin.buildGeomFromUrdf(source, str(file), kind)
    geometry, links = pin.GeometryModel(), []
    for shape in original.geometryObjects:
        if Path(shape.meshPath).is_file():
            shape.geometry = _solid(parts_of(Path(shape.meshPath)), np.array(shape.meshScale))
        frame = source.frames[shape.parentFrame]
        _attach(
            geometry, mechanism.model, shape, frame.name, frame.placement.actInv(shape.placement)
        )
        links.append(frame.name)
    return geometry, links


def _solid(parts: Parts, scale: np.ndarray) -> Any:
    """All parts of a mesh as one body of coal's.

    coal's own loader (3.0.3) has the triangles of a file's second part use the points of the first.
    """
    points = np.concatenate([part.points for part in parts]) * scale
    before = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    triangles = np.concatenate(
        [part.triangles + first for part, first in zip(parts, before, strict=True)]
    )
    made = coal.BVHModelOBBRSS()
    made.beginModel(len(triangles), len(points))
    made.addVertices(points)
    made.addTriangles(triangles)
    made.endModel()
    return made


def _attach(
    geometry: pin.GeometryModel,
    model: pin.Model,
    shape: pin.GeometryObject,
    link: str,
    placement: pin.SE3,
) -> None:
    index = model.getFrameId(link, pin.FrameType.BODY)
    frame = model.frames[index]
    shape.name = shape.name.replace("/", "_")  # a slash opens a folder in meshcat
    shape.parentJoint, shape.parentFrame = frame.parentJoint, index
    shape.placement = frame.placement * placement
    geometry.addGeometryObject(shape)


def places_of(source: pin.Model) -> dict[str, pin.SE3]:
    """World placement of every link, all joints at zero."""
    data = source.createData()
    pin.framesForwardKinematics(source, data, pin.neutral(source))
    return {
        frame.name: data.oMf[index].copy()
        for index, frame in enumerate(source.frames)
        if frame.type == pin.FrameType.BODY
    }


def reach_of(places: dict[str, pin.SE3]) -> float:
    """Size of a robot: the largest distance between two of its links' frames [m]."""
    points = np.array([place.translation for place in places.values()])
    spread = np.linalg.norm(points[:, None] - points[None], axis=2).max()
    return float(spread) if spread > 1e-6 else 0.3


def capsules(
    text: str, places: dict[str, pin.SE3], links: Sequence[str], radius: float
) -> list[tuple[str, pin.SE3, float, float]]:
    """Capsules from each of `links` to the links that it carries, or to its centre of mass.

    Args:
        text: of the URDF.
        places: of all links' frames, at zero.
        links: that have a stand-in.
        radius: of the capsules [m].

    Returns:
        For each: link, place of its middle there (z along it), radius and length [m]; of a ball at
        the link's frame the length is 0.
    """
    root = ElementTree.fromstring(text)
    rods: list[tuple[str, pin.SE3, float, float]] = []
    inertials = {link.get("name"): link.find("inertial") for link in root.findall("link")}
    for name in links:
        place = places[name]
        ends = []
        for joint in root.findall("joint"):
            parent, child = joint.find("parent"), joint.find("child")
            if parent is not None and child is not None and parent.get("link") == name:
                ends.append(place.actInv(places[child.get("link", "")]).translation)
        inertial = inertials.get(name)
        if not any(np.linalg.norm(end) > 1e-6 for end in ends) and inertial is not None:
            origin = inertial.find("origin")
            text = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
            ends.append(np.array([float(value) for value in text.split()]))
        rods.append((name, pin.SE3.Identity(), 1.3 * radius, 0.0))
        for end in ends:
            length = float(np.linalg.norm(end))
            if length > 1e-6:
                turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end / length)
                middle = pin.SE3(turn.toRotationMatrix(), end / 2.0)
                rods.append((name, middle, radius, length))
    return rods


# What is seen of a mechanism: the URDF's visuals as surfaces on its links, with their colours.
#
# `visuals` makes the same for Pinocchio, whose shapes know no colours of parts. Here meshes are
# read by `meshes`, all parts of them; box, cylinder and ball are surfaces too; where a mesh is
# missing capsules stand in.


TONES: tuple[Colour, ...] = ((0.79, 0.83, 0.87, 1.0), (0.66, 0.72, 0.79, 1.0))
"""Of links without colour, by turns, so that one can be told from the next."""


@dataclass(frozen=True, eq=False)
class LinkShape:
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

    shapes: list[LinkShape]
    reach: float
    missing: list[str] = field(default_factory=list)


def look(mechanism: Mechanism, folders: Sequence[str | Path] = ()) -> Look:
    """What is seen of `mechanism`, with or without clearance.

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
    shapes: list[LinkShape] = []
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
            forms.append(LinkShape(link.name, place, parts, colours, key))
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
        shapes.append(LinkShape(name, placement.homogeneous, (part,), (tone,), key))
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
    parts = readable(path)
    return (f"mesh {path}", parts) if parts else ("", ())


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
def _box(x: float, y: float, z: float) -> Surface:
    import trimesh

    mesh = trimesh.creation.box((x, y, z))
    return surface(mesh.vertices, mesh.faces)


@lru_cache(maxsize=256)
def _cylinder(radius: float, length: float) -> Surface:
    import trimesh

    mesh = trimesh.creation.cylinder(radius, length, sections=48)
    return surface(mesh.vertices, mesh.faces)


@lru_cache(maxsize=256)
def _capsule(radius: float, length: float) -> Surface:
    """A capsule about the middle of its axis z; a ball if it has no length."""
    import trimesh

    if length > 0.0:
        mesh = trimesh.creation.capsule(length, radius, count=[32, 32])
        mesh.vertices -= mesh.bounds.mean(axis=0)
    else:
        mesh = trimesh.creation.uv_sphere(radius, count=[24, 32])
    return surface(mesh.vertices, mesh.faces)
