"""Visual and collision shapes of a mechanism: those of the URDF, on the frames of its links.

A mechanism's own Pinocchio model has several joints in place of one with clearance, and turned
frames. Its link frames, however, are those of the URDF. Each shape therefore belongs to a link, by
name, and stands where that link's frame stands. `meshes` reads the meshes, all parts with their
colours; where a mesh is missing, capsules stand in.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlparse

import coal
import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.base.files import is_folder
from jointplay.model import packages
from jointplay.model.design import parse
from jointplay.model.loop import assemble
from jointplay.model.meshes import Colour, Parts, Surface, readable, surface

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism

TONES: tuple[Colour, ...] = ((0.79, 0.83, 0.87, 1.0), (0.66, 0.72, 0.79, 1.0))
"""Colours of links without one, in turn, so that a link can be told from the next."""
THICKNESS = 0.035
"""Radius of a stand-in, relative to the robot's reach."""
_PACKAGE = re.compile(r"package://([\w-]+)/")
_VIEW = (1.6, -1.6, 1.0)
"""Position of the camera from the robot's middle, relative to the robot's reach."""

Form = tuple[str, tuple[float, ...]]
"""Form of a shape: ``box`` and its sides; ``cylinder`` or ``capsule``, radius and length; ``mesh``
[m]."""


@dataclass(frozen=True, eq=False)
class LinkShape:
    """Surfaces of one shape on a link."""

    link: str
    frame: np.ndarray
    """Transform from the shape's frame to the link's (4, 4)."""
    scale: np.ndarray
    """Scale of a mesh along its axes (3,)."""
    form: Form
    file: str
    """File of a mesh; else empty."""
    parts: Parts
    colours: tuple[Colour, ...]
    """Colour of each part."""
    coloured: bool = False
    """Whether the URDF gives the colour."""
    stands_in: bool = False
    """Whether the shape stands in for one that is missing."""

    @property
    def placement(self) -> np.ndarray:
        """Transform from the surfaces' points to the link's frame, with their scale (4, 4)."""
        return self.frame @ np.diag([*self.scale, 1.0])


@dataclass(frozen=True)
class Look:
    """Shapes of a mechanism.

    Attributes:
        shapes: in the order of the URDF, stand-ins last.
        reach: size of the robot, the largest distance between two of its links' frames [m].
        missing: mesh files that were not found or not readable.
    """

    shapes: list[LinkShape]
    reach: float
    missing: list[str] = field(default_factory=list)


def look(
    mechanism: Mechanism, folders: Sequence[str | Path] = (), collisions: bool = False
) -> Look:
    """Shapes of `mechanism`; meshes may be in `folders`, too.

    With `collisions` they are the URDF's collision shapes, without stand-ins, instead of its
    visuals.

    Raises:
        JointplayError: a given folder does not exist.
    """
    description = mechanism.description
    robot = description.declared
    where = mesh_folders(mechanism, folders)
    # Poses of the links with all joints at zero give the robot's size, and those of stand-ins.
    source = parse(description)
    data = source.createData()
    pin.framesForwardKinematics(source, data, pin.neutral(source))
    places = {
        frame.name: data.oMf[index].copy()
        for index, frame in enumerate(source.frames)
        if frame.type == pin.FrameType.BODY
    }
    points = np.array([place.translation for place in places.values()])
    reach = float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
    seen = Look([], reach if reach > 1e-6 else 0.3)
    tones = {name: TONES[number % len(TONES)] for number, name in enumerate(places)}
    bare = []
    for link in robot.links:
        elements = link.collisions if collisions else link.visuals
        forms = []
        for element in elements:
            form, file, parts = _surfaces(element.geometry, where, not description.stored)
            mesh = element.geometry.mesh
            if not parts:
                seen.missing.append(mesh.filename or "")
                continue
            frame = np.eye(4) if element.origin is None else np.array(element.origin)
            scale = np.ones(3) if mesh is None or mesh.scale is None else mesh.scale
            scale = np.broadcast_to(np.asarray(scale, float), 3)
            declared = _colour(getattr(element, "material", None), robot)
            colours = tuple(declared or part.colour or tones[link.name] for part in parts)
            own_colour = declared is not None
            forms.append(LinkShape(link.name, frame, scale, form, file, parts, colours, own_colour))
        seen.shapes.extend(form for form in forms if any(len(p.triangles) for p in form.parts))
        if elements and not forms:
            bare.append(link.name)
    if collisions:
        return seen
    # Links whose visuals are all missing get stand-ins; all links do if the URDF has no visuals.
    if not any(link.visuals for link in robot.links):
        bare = [link.name for link in robot.links]
    for name, place, form in _stand_ins(mechanism, places, bare, THICKNESS * seen.reach):
        part, tone = surface_of(form), tones[name]
        seen.shapes.append(
            LinkShape(name, place, np.ones(3), form, "", (part,), (tone,), stands_in=True)
        )
    return seen


def geometry_model(mechanism: Mechanism, seen: Look) -> pin.GeometryModel:
    """Shapes of `mechanism` as Pinocchio's geometry for its model, an object for each."""
    geometry, counts = pin.GeometryModel(), dict.fromkeys(mechanism.description.links, 0)
    for shape in seen.shapes:
        index = mechanism.model.getFrameId(shape.link, pin.FrameType.BODY)
        frame = mechanism.model.frames[index]
        word = "stand_in_" if shape.stands_in else ""
        name = f"{shape.link}_{word}{counts[shape.link]}".replace("/", "_")  # meshcat's folders
        counts[shape.link] += 1
        body = pin.GeometryObject(
            name,
            frame.parentJoint,
            index,
            frame.placement * pin.SE3(shape.frame),
            _solid(shape),
            shape.file,
            shape.scale,
        )
        body.overrideMaterial = shape.coloured
        body.meshColor = np.array(shape.colours[0])
        geometry.addGeometryObject(body)
    return geometry


def visualizer(mechanism: Mechanism, folders: Sequence[str | Path], open_browser: bool) -> Any:
    """Pinocchio's MeshcatVisualizer with the mechanism loaded and shown, loops closed.

    Raises:
        JointplayError: a given folder does not exist, loops cannot be closed, or the server does
            not start.
    """
    from pinocchio.visualize import MeshcatVisualizer

    from jointplay.model import viewer

    seen = look(mechanism, folders)
    visuals = geometry_model(mechanism, seen)
    collisions = geometry_model(mechanism, look(mechanism, folders, collisions=True))
    for shape in (*visuals.geometryObjects, *collisions.geometryObjects):
        if Path(shape.meshPath).suffix.lower() == ".dae":
            # Meshcat shows one part of a Collada file; the surface read here has them all.
            shape.meshPath = ""
    shown = MeshcatVisualizer(mechanism.model, collisions, visuals)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # textures that meshcat cannot show
        shown.initViewer(viewer=viewer.visualizer(), open=open_browser)
        shown.loadViewerModel(mechanism.model.name or "mechanism")
    shown.display(assemble(mechanism, np.zeros(mechanism.model.nq), []))
    places = np.array([place.translation for place in shown.visual_data.oMg])
    centre = 0.5 * (places.min(axis=0) + places.max(axis=0))
    x, y, z = seen.reach * np.array(_VIEW)
    # Released versions of meshcat have no call for this; its camera's frame has y up.
    shown.viewer["/Cameras/default"].set_transform(pin.SE3(np.eye(3), centre).homogeneous)
    shown.viewer["/Cameras/default/rotated/<object>"].set_property("position", [x, z, -y])
    return shown


# Where mesh files are.


def mesh_folders(mechanism: Mechanism, further: Sequence[str | Path] = ()) -> list[Path]:
    """Folders in which meshes are looked for: `further`, the robot's own, example-robot-data's.

    A mechanism from a result has no folders of its own: what others wrote into a file must not
    choose among the files here.

    Raises:
        JointplayError: a given folder does not exist.
    """
    folders = [Path(folder) for folder in further]
    for folder in folders:
        if not is_folder(folder):
            raise JointplayError(f"no folder of meshes {str(folder)!r}")
    if not mechanism.description.stored:
        folders += folders_of(mechanism.description.path, mechanism.description.text)
    return [*folders, *collected_folders()]


def folders_of(path: Path, text: str) -> list[Path]:
    """Folders above a robot's file, and of the packages that its text names."""
    path = path.resolve()
    # package://name/meshes is beside name/urdf
    beside = (packages.find(name, path) for name in dict.fromkeys(_PACKAGE.findall(text)))
    return [Path.cwd(), *list(path.parents)[:4], *filter(None, beside)]


def collected_folders() -> list[Path]:
    """Folders of example-robot-data, if it is installed."""
    try:
        files = distribution("example-robot-data").files or []
    except PackageNotFoundError:
        files = []
    for file in files:
        parts = file.parts
        if "robots" in parts:
            robots = Path(str(file.locate())).parents[len(parts) - parts.index("robots") - 2]
            return [robots, robots.parent, robots.parent.parent]
    return []


def find_mesh(name: str, folders: Sequence[Path], anywhere: bool = True) -> Path | None:
    """File that a URDF's mesh `name` means, a path or a file:// or package:// address, or None.

    ``package://p/rest`` is looked for as ``folder/p/rest``, as ``folder/rest`` and, because folders
    are moved when robots are collected, with leading folders of ``rest`` left out. Unless
    `anywhere`, the file must lie inside the folders: no absolute path, and none that leads out.
    """
    with suppress(OSError, ValueError):  # a name that no file can have
        address = urlparse(name)
        path = Path(unquote(address.path).lstrip("/")) if address.scheme else Path(name)
        if address.scheme == "file" or (not address.scheme and path.is_absolute()):
            path = Path("/") / path
            allowed = anywhere or any(_inside(path, folder) for folder in folders)
            return path if allowed and path.is_file() else None
        parts = [(folder, part) for folder in folders for part in (address.netloc / path, path)]
        if address.scheme == "package":
            # A URDF of example-robot-data says package://example-robot-data/robots/...
            shorter = [Path(*path.parts[depth:]) for depth in range(1, len(path.parts) - 1)]
            parts += [(folder, part) for folder in folders for part in shorter]
        for folder, part in parts:
            if (folder / part).is_file() and (anywhere or _inside(folder / part, folder)):
                return (folder / part).resolve()
    return None


def _inside(path: Path, folder: Path) -> bool:
    """Whether `path` lies in `folder`, links followed."""
    return path.resolve().is_relative_to(folder.resolve())


# Surfaces and solids of a shape.


def _surfaces(geometry: Any, where: Sequence[Path], anywhere: bool) -> tuple[Form, str, Parts]:
    """Form, file and surfaces of a geometry; no surfaces where a mesh cannot be had."""
    if geometry.mesh is not None:
        path = find_mesh(geometry.mesh.filename or "", where, anywhere)
        parts = None if path is None else readable(path)
        return ("mesh", ()), str(path or ""), parts or ()
    if geometry.box is not None:
        x, y, z = (float(size) for size in geometry.box.size)
        form: Form = "box", (x, y, z)
    elif geometry.cylinder is not None:
        form = "cylinder", (float(geometry.cylinder.radius), float(geometry.cylinder.length))
    else:
        form = "capsule", (float(geometry.sphere.radius), 0.0)
    return form, "", (surface_of(form),)


@lru_cache(maxsize=256)
def surface_of(form: Form) -> Surface:
    """Surface of a box, cylinder or capsule about its middle; without length it is a ball."""
    import trimesh

    word, sizes = form
    if word == "box":
        mesh = trimesh.creation.box(sizes)
    elif word == "cylinder":
        mesh = trimesh.creation.cylinder(*sizes, sections=48)
    elif sizes[1] > 0.0:
        mesh = trimesh.creation.capsule(sizes[1], sizes[0], count=[32, 32])
        mesh.vertices -= mesh.bounds.mean(axis=0)
    else:
        mesh = trimesh.creation.uv_sphere(1.0, count=[24, 32])
        mesh.vertices *= sizes[0]  # trimesh would leave no triangle of a ball of a millimetre
    return surface(mesh.vertices, mesh.faces)


def _solid(shape: LinkShape) -> Any:
    """A shape as a body for coal; all parts of a mesh become one.

    coal's own loader (3.0.3) has the triangles of a file's second part use the points of the first.
    """
    word, sizes = shape.form
    if word == "box":
        return coal.Box(*sizes)
    if word == "cylinder":
        return coal.Cylinder(*sizes)
    if word == "capsule":
        return coal.Capsule(*sizes) if sizes[1] > 0.0 else coal.Sphere(sizes[0])
    points = np.concatenate([part.points for part in shape.parts]) * shape.scale
    first = np.cumsum([0, *(len(part.points) for part in shape.parts[:-1])])
    triangles = [part.triangles + n for part, n in zip(shape.parts, first, strict=True)]
    body = coal.BVHModelOBBRSS()
    body.beginModel(sum(map(len, triangles)), len(points))
    body.addVertices(points)
    body.addTriangles(np.concatenate(triangles))
    body.endModel()
    return body


def _colour(material: Any, robot: Any) -> Colour | None:
    """Colour that the URDF gives a shape, by itself or by the name of a material; or None."""
    if material is None:
        return None
    named = next((m for m in robot.materials if m.name == material.name), None)
    for m in (material, named):
        if m is not None and m.color is not None and m.color.rgba is not None:
            red, green, blue, opacity = (float(value) for value in m.color.rgba)
            return red, green, blue, opacity if opacity > 0.0 else 1.0
    return None


def _stand_ins(
    mechanism: Mechanism, places: dict[str, pin.SE3], links: Sequence[str], radius: float
) -> list[tuple[str, np.ndarray, Form]]:
    """Capsules and balls that stand in for the shapes of `links`.

    Each link gets a ball at its frame, and capsules from there to the links that it carries and to
    the ends of loops on it, or else to its centre of mass. `places`: poses of all links, joints at
    zero; `radius` [m].

    Returns:
        Link, pose of the middle in it, z along the capsule (4, 4), and form.
    """
    robot = mechanism.description.declared
    origins = {
        link.name: None if link.inertial is None else link.inertial.origin for link in robot.links
    }
    closing = [
        side
        for loop in mechanism.loops.values()
        for side in ((loop.bearing_link, loop.bearing), (loop.journal_link, loop.journal))
    ]
    rods: list[tuple[str, np.ndarray, Form]] = []
    for name in links:
        ends = [
            places[name].actInv(places[joint.child]).translation
            for joint in mechanism.description.joints.values()
            if joint.parent == name
        ]
        ends += [place.translation for link, place in closing if link == name]
        if not any(np.linalg.norm(end) > 1e-6 for end in ends) and origins[name] is not None:
            ends.append(np.array(origins[name])[:3, 3])
        rods.append((name, np.eye(4), ("capsule", (1.3 * radius, 0.0))))
        for end in ends:
            length = float(np.linalg.norm(end))
            if length > 1e-6:
                turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end / length)
                middle = pin.SE3(turn.toRotationMatrix(), end / 2.0)
                rods.append((name, middle.homogeneous, ("capsule", (radius, length))))
    return rods
