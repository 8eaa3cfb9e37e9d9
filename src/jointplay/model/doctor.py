"""Diagnosis of a robot's file: all that is impossible or doubtful in it, and what would be right.

`diagnose` examines the URDF part by part (`_Patient`) and mends it on the way, as later parts need
sound earlier ones: right inertias need right meshes. A link's right inertia is that of its shapes
at its mass, spread evenly: of boxes, cylinders and balls, of closed meshes, and of the convex hull
of open ones. What cannot be known from the file, such as a torque, is told and not made up; a mass
that is missing becomes that of water in the shapes' volume, and is called so.
"""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple
from xml.parsers import expat

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, closest
from jointplay.base.files import read_text
from jointplay.base.tables import few
from jointplay.base.units import readable
from jointplay.model import meshes, urdf
from jointplay.model.elements import moments, origin_of, place_of, put, written
from jointplay.model.formats import says_more, urdf_text
from jointplay.model.inertias import impossible_inertias, inertia_faults, tensor_of
from jointplay.model.robots import source_of
from jointplay.model.visuals import collected_folders, find_mesh, folders_of, surface_of
from jointplay.model.vocabulary import BEYOND, numbers
from jointplay.model.xacro import Value

Element = ElementTree.Element

WATER = 1000.0
"""Density of a link whose mass is not known [kg/m^3]: twice that of printed plastic with hollows,
and that of aluminium with hollows (judged)."""
_DENSEST = 22600.0
"""Largest density of any material: osmium [kg/m^3]."""
_HUGE, _TINY = 20.0, 1e-3
"""Size of a link's meshes relative to the robot's above which, and below which, they are in another
unit: millimetres taken for metres give some hundreds, the other way a few thousandths."""
_LONGEST = 10.0
"""Size up to which a link's mesh may be in metres after all, as a crane's [m]."""
_ASIDE = 0.1
"""Distance, relative to a link's size, by which its centre of mass may lie outside its shapes, from
which motors are often left out."""
_BEYOND = 1.5
"""Factor by which an inertia may exceed that of the link's mass at its farthest corner."""
_LEAST = 1e-12
"""Least moment that is written [kg m^2]: MuJoCo refuses 1e-15, which a marker of 1e-9 kg has."""
_SURE = 100.0
"""Factor by which an inertia exceeds that at the farthest corner if it is in another unit: units
differ by a thousand or more, parts that are not drawn add less."""
_SLIGHT = 0.02
"""Inertia, relative to that of a link's shapes, below which it is a placeholder, such as 1e-6."""


class Finding(NamedTuple):
    """A fault in a robot's file, with its remedy."""

    line: int | None
    """Line of the robot's file; None if it is not written there, as elements that xacro makes."""
    where: str
    """Link or joint with the fault."""
    fault: str
    right: str
    """What would be right, in words; empty if nobody can know."""
    element: str = ""
    """The right element, to be pasted into the file; empty if there is none."""
    note: bool = False
    """Whether the robot can be read all the same."""
    doubt: bool = False
    """Whether the file may be right after all, so that `element` is not written into it."""

    def __str__(self) -> str:
        at = "" if self.line is None else f"line {self.line}, "
        head = f"{'note: ' * self.note}{at}{self.where}: {self.fault}"
        return "\n".join([head, *([f"  right: {self.right}"] * bool(self.right)),
                          *(f"    {row}" for row in self.element.splitlines())])  # fmt: skip


@dataclass
class Diagnosis:
    """All findings in a robot's file, and the mended URDF."""

    path: Path
    findings: list[Finding]
    root: Element
    """The mended URDF."""
    refused: str
    """Why the mended URDF is refused still; empty if it is not."""

    @property
    def impossible(self) -> list[Finding]:
        """Findings with which the robot cannot be read."""
        return [finding for finding in self.findings if not finding.note]

    @property
    def mended(self) -> int:
        """Number of findings that `root` has mended."""
        return sum(bool(finding.element) and not finding.doubt for finding in self.findings)

    @property
    def sentence(self) -> str:
        """The diagnosis in one line."""
        wrong, count = self.impossible, len(self.findings)
        if not count:
            return f"{self.path.name}: nothing impossible was found"
        places = few(list(dict.fromkeys(finding.where for finding in wrong)), 4)
        summary = f"{len(wrong)} impossible ({places})" if wrong else "nothing impossible"
        notes = f", {count - len(wrong)} doubtful" if count > len(wrong) else ""
        cure = f"; --write fixed.urdf mends {self.mended} of {count}" if self.mended else ""
        return f"{self.path.name}: {summary}{notes}{cure}"

    def text(self, path: Path) -> str:
        """Text of the mended URDF for a file at `path`, relative to which meshes are named."""
        folder, target = self.path.resolve().parent, path.resolve().parent
        for mesh in self.root.iter("mesh"):
            name = mesh.get("filename", "")
            if folder != target and "://" not in name and (folder / name).is_file():
                mesh.set("filename", os.path.relpath(folder / name, target))
        return '<?xml version="1.0"?>\n' + ElementTree.tostring(self.root, encoding="unicode")


def diagnose(place: str | Path, arguments: Mapping[str, Value] | None = None) -> Diagnosis:
    """Find all that is impossible or doubtful in a robot's file, named as for `robots.source_of`.

    Raises:
        JointplayError: the file cannot be read, or is no well-formed XML.
    """
    source = source_of(place)
    text = urdf_text(source, arguments or {})
    urdf.elements(text, source.path)
    for name, address in re.findall(r"xmlns:(\w+)=\"([^\"]*)\"", text):
        ElementTree.register_namespace(name, address)
    keep = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(text, keep)
    for beyond in root.findall(BEYOND):
        root.remove(beyond)
    patient = _Patient(source.path, text, root)
    comments = _without_comments(root)  # numbered by now; put back at the end
    findings = sorted(patient.findings(), key=lambda finding: (finding.note, finding.line or 0))
    refused = ""
    try:
        urdf.parse(ElementTree.tostring(root, encoding="unicode"), source.path)
    except JointplayError as error:
        refused = str(error)
        if not any(not finding.note and not finding.element for finding in findings):
            findings.insert(0, Finding(None, "the robot", refused, ""))
    for parent, comment, after in reversed(comments):
        children = list(parent)
        parent.insert(children.index(after) if after in children else len(children), comment)
    return Diagnosis(source.path, findings, root, refused)


def _without_comments(root: Element) -> list[tuple[Element, Element, Element | None]]:
    """Take comments out of a document.

    Returns:
        For each comment: the element it was in, the comment, and the element after it.
    """
    comments = []
    for parent in list(root.iter()):
        children: list[Element | None] = [*parent, None]
        for child, after in pairwise(children):
            if child is not None and child.tag is ElementTree.Comment:
                comments.append((parent, child, after))
                parent.remove(child)
    return comments


@dataclass
class _Patient:
    """A URDF under examination."""

    path: Path
    text: str
    """The URDF's text; of a xacro, the expanded one."""
    root: Element
    """The URDF's root element, mended on the way."""
    missing: list[str] = field(default_factory=list)
    """Meshes that were not found."""

    def __post_init__(self) -> None:
        self.links = self.root.findall("link")
        self.joints = self.root.findall("joint")
        self.folders = [*folders_of(self.path, self.text), *collected_folders()]
        self.original = read_text(self.path, "robot")
        self._lines = dict(zip(map(id, self.root.iter()), _lines(self.text), strict=False))
        self._same = self.original.count("\n") == self.text.count("\n")
        self.reach = self._reach()
        self.moved = {child.get("link") for j in self.joints if j.get("type") != "fixed"
                      for child in j.findall("child")}  # fmt: skip
        self.solids: dict[Element, _Solid | None] = {}

    def findings(self) -> Iterator[Finding]:
        """The findings, part by part; in this order, as right inertias need right meshes."""
        parts = (self.names, self.slips, self.scales, self.inertias, self.marks, self.lost)
        for part in parts:
            yield from part()

    def line(self, element: Element) -> int | None:
        """Line of an element in the robot's file; in a xacro, the first with its name, if any."""
        if self._same:
            return self._lines.get(id(element))
        return self._line_of(rf"name\s*=\s*[\"']{re.escape(element.get('name', ''))}[\"']")

    def _line_of(self, pattern: str) -> int | None:
        match = re.search(pattern, self.original)
        return None if match is None else 1 + self.original.count("\n", 0, match.start())

    def _reach(self) -> float:
        """Largest distance of a link from the base along joints' origins [m]."""
        above = {}
        for joint in self.joints:
            parent, child = joint.find("parent"), joint.find("child")
            if parent is not None and child is not None:
                place = _place(joint) or pin.SE3.Identity()
                size = float(np.linalg.norm(place.translation))
                above[child.get("link", "")] = parent.get("link", ""), size
        longest = 0.0
        for link in above:
            distance, seen = 0.0, set()
            while link in above and link not in seen:
                seen.add(link)
                link, size = above[link]
                distance += size
            longest = max(longest, distance)
        return longest

    # Parts of the robot and their findings.

    def names(self) -> Iterator[Finding]:
        """Names given twice."""
        for kind, elements in (("link", self.links), ("joint", self.joints)):
            seen: dict[str, Element] = {}
            for element in elements:
                name = element.get("name", "")
                first = seen.setdefault(name, element)
                if first is not element:
                    at = self.line(first)
                    fault = f"there is another, in line {at}" if at else "there is another"
                    right = "rename one of them, and what refers to it"
                    yield Finding(self.line(element), f"{kind} {name!r}", fault, right)

    def slips(self) -> Iterator[Finding]:
        """Elements that `urdf.parse` refuses by themselves; limits and masses are mended."""
        for top, why in urdf.slips(self.root):
            where = f"{top.tag} {top.get('name', '')!r}"
            limit, right, text = top.find("limit"), "", ""
            if "above the upper" in why and limit is not None and "exchange" in why:
                low, high = limit.get("lower", "0"), limit.get("upper", "0")
                limit.set("lower", high)
                limit.set("upper", low)
                right, text = "the other way round", _shown(limit)
            elif "limit" in why and "negative" in why and limit is not None:
                for key in ("effort", "velocity"):
                    limit.set(key, limit.get(key, "0").lstrip("-"))
                right, text = "positive, as it is a size", _shown(limit)
            elif "<mass>, where it is not read" in why and self._mass(top.find("inertial")):
                for mass in top.findall("mass"):
                    top.remove(mass)
                kept_masses = top.findall("inertial/mass")
                right, text = "leave it out, for it has one", _shown(kept_masses[0])
            yield Finding(self.line(top), where, why.removeprefix(f"{where} has ")
                          .removeprefix(f"{where}: "), right, text)  # fmt: skip

    def marks(self) -> Iterator[Finding]:
        """Joints that are read, but hardly as meant: missing leaders, long axes, zero limits."""
        names = [joint.get("name", "") for joint in self.joints]
        for joint in self.joints:
            where, line, kind = f"joint {joint.get('name')!r}", self.line(joint), joint.get("type")
            mimic, axis, limit = joint.find("mimic"), joint.find("axis"), joint.find("limit")
            if mimic is not None and (leader := mimic.get("joint", "")) not in names:
                right, text = "no joint has a name like it", ""
                if near := closest(leader, names):
                    mimic.set("joint", near.split('"')[1])
                    right, text = "the joint whose name is nearest", _shown(mimic)
                yield Finding(
                    line, where, f"mimics {leader!r}, which is no joint", right, text, True
                )
            if kind in urdf.NO_AXIS:
                if kind == "floating":
                    fault = "a floating joint cannot have play; --base free lets a base float"
                    yield Finding(line, where, fault, "", note=True)
                continue
            if axis is not None:
                try:
                    direction = np.array(numbers(axis, "xyz", where, 3, "1 0 0"))
                except JointplayError:
                    continue
                size = float(np.linalg.norm(direction))
                if size > urdf.SHORTEST_AXIS and abs(size - 1.0) > urdf.UNIT:
                    axis.set("xyz", written(direction / size))
                    fault = f"axis of length {size:.4g}; programs differ on whether it counts"
                    yield Finding(line, where, fault, "a unit vector", _shown(axis), True)
            none = [key for key in ("effort", "velocity")
                    if limit is not None and limit.get(key) in ("0", "0.0", "0.")]  # fmt: skip
            if none and not says_more(self.path):  # an MJCF has none that could be 0
                fault = (
                    f"limit {' and '.join(none)} 0: taken as unknown here, elsewhere it cannot move"
                )
                yield Finding(line, where, fault, "what its motor has", note=True)

    def scales(self) -> Iterator[Finding]:
        """Meshes in other units than metres."""
        for link in self.links:
            solid = self.solid(link)
            if solid is None or not solid.of_mesh:
                continue
            size = float(np.ptp(solid.bounds, axis=0).max())
            factor = 1.0
            # Too small is only what is of a sound size in the other unit.
            if size > max(_LONGEST, _HUGE * self.reach):
                factor = 1e-3
            elif self.reach and size < _TINY * self.reach and size * 1e3 > _TINY * self.reach * 30:
                factor = 1e3
            if factor == 1.0:
                continue
            for mesh in link.iter("mesh"):
                old = np.array([float(number) for number in mesh.get("scale", "1 1 1").split()])
                mesh.set("scale", written(factor * np.broadcast_to(old, 3)))
                shown = _shown(mesh)
            del self.solids[link]  # of the wrong size
            unit = "millimetres" if factor < 1.0 else "metres, scaled to millimetres"
            fault = (
                f"meshes of {readable(size, 'm', 3)} on a robot of {readable(self.reach, 'm', 3)}"
            )
            right = f"they are in {unit}"
            yield Finding(self.line(link), f"link {link.get('name')!r}", fault, right, shown, True)

    def inertias(self) -> Iterator[Finding]:
        """Links whose inertia no rigid body has, or that their shapes make unlikely."""
        alone = ElementTree.Element("robot")
        try:
            wrong = impossible_inertias(self.root)
        except (JointplayError, ValueError, KeyError, StopIteration, AttributeError):
            wrong = None  # where links form no tree, each is judged by itself
        for link in self.links:
            name, inertial = link.get("name", ""), link.find("inertial")
            alone[:] = [link]
            try:
                fault = inertia_faults(alone).get(name, "")
                matters = wrong is None or name in wrong
            except JointplayError as error:
                fault, matters = str(error), True
            mass = self._mass(inertial)
            if not fault and not mass and name in self.moved and not self._carries(name):
                fault, matters = "has no mass, and a joint moves it", False
            fault = fault.partition("; correct it")[0].removeprefix(f"link {name!r}")
            fault = fault.removeprefix(" has ").removeprefix(": ").strip()
            doubt = False
            if not fault and mass > 0.0:
                matters, (fault, doubt) = False, self._doubt(link, mass)
            if fault:
                target = deepcopy(link) if doubt else link
                right, text = self._right(target, abs(mass) if mass else None)
                where = f"link {name!r}"
                yield Finding(self.line(link), where, fault, right, text, not matters, doubt)

    def _carries(self, name: str) -> bool:
        """Whether a link, or any link fixed to it, has mass."""
        fixed = [
            (parent.get("link"), child.get("link"))
            for joint in self.joints
            if joint.get("type") == "fixed"
            for parent in joint.findall("parent")
            for child in joint.findall("child")
        ]
        united: set[str | None] = {name}
        while further := {child for parent, child in fixed if parent in united} - united:
            united |= further
        return any(
            self._mass(link.find("inertial")) for link in self.links if link.get("name") in united
        )

    def _mass(self, inertial: Element | None) -> float:
        """Mass that an <inertial> states [kg]; 0 if it states none."""
        try:
            text = "" if inertial is None else inertial.find("mass").get("value", "")  # type: ignore[union-attr]
            value = float(text)
        except (ValueError, AttributeError):
            return 0.0
        return value if np.isfinite(value) else 0.0

    def _doubt(self, link: Element, mass: float) -> tuple[str, bool]:
        """Fault of a possible inertia beside the link's shapes, in words; empty without one.

        And whether the shapes may be to blame: they often leave out motors.
        """
        solid, inertial = self.solid(link), link.find("inertial")
        if solid is None or inertial is None:
            return "", False
        (low, high), centre = solid.bounds, place_of(inertial).translation
        if solid.size < urdf.SHORTEST_AXIS:
            return "", False
        # The centre of mass, outside the shapes.
        if solid.is_beside(centre):
            less = centre / 1e3
            inside = np.all(less >= low) and np.all(less <= high)
            outside = np.linalg.norm(np.maximum(np.maximum(low - centre, centre - high), 0.0))
            return f"centre of mass {readable(float(outside), 'm', 3)} outside its shapes" + (
                ": written in millimetres?" if inside and np.abs(centre).max() > 1.0 else ""
            ), not inside
        tensor = tensor_of(inertial, f"link {link.get('name')!r}")
        principal = np.linalg.eigvalsh(tensor)
        # The inertia, beyond that of all mass in the farthest corner, or next to nothing.
        corners = np.abs(np.array([low, high]) - centre).max(axis=0)
        most = mass * float(corners @ corners)
        likely = np.linalg.eigvalsh(solid.at(mass).inertia)
        if principal[2] > _BEYOND * most:
            unit = _unit(float(np.median(principal / likely)))
            return (
                f"largest moment {principal[2]:.4g} kg m2; {mass:g} kg within its shapes have "
                f"{most:.3g} at most{unit}",
                principal[2] < _SURE * most,
            )
        if principal[2] < _SLIGHT * likely[2]:
            return (
                f"largest moment {principal[2]:.4g} kg m2, a placeholder? that of its shapes is "
                f"{likely[2]:.3g}{_unit(float(np.median(principal / likely)))}",
                True,
            )
        if mass > _DENSEST * solid.volume:
            fault = f"{mass:g} kg in {1e6 * solid.volume:.3g} cm3 are denser than any matter"
            return fault, True
        return "", False

    def _right(self, link: Element, mass: float | None) -> tuple[str, str]:
        """Give a link the inertia that it should have; this in words, and as an element."""
        solid, inertial = self.solid(link), link.find("inertial")
        place = None if inertial is None else _place(inertial)
        if solid is None:
            if mass is None:
                return "", ""
            radius = (3.0 * mass / (4.0 * np.pi * WATER)) ** (1.0 / 3.0)
            tensor = 0.4 * mass * radius**2 * np.eye(3)
            text = f"it has no shape; that of a ball of water of {mass:g} kg"
            return text, _put(link, mass, place or pin.SE3.Identity(), tensor)
        text = (
            f"that of {solid.label} at {mass:g} kg, spread evenly"
            if mass
            else (f"that of {solid.label} as heavy as water (weigh it)")
        )
        body = solid.at(mass or WATER * solid.volume)
        if place is None or solid.is_beside(place.translation):
            place = pin.SE3(np.eye(3), body.lever)
        tensor = place.rotation.T @ body.inertia @ place.rotation
        return text, _put(link, body.mass, place, tensor)

    def lost(self) -> Iterator[Finding]:
        """Meshes that are missing."""
        for link in self.links:
            self.solid(link)
        if names := list(dict.fromkeys(self.missing)):
            right = "beside the URDF, or in their package above it; .stl, .obj or .dae"
            fault = f"not found or not readable: {few(names, 3)}"
            yield Finding(self._line_of(re.escape(names[0])), "meshes", fault, right, "", True)

    # Shapes.

    def solid(self, link: Element) -> _Solid | None:
        """Solid of a link's visual shapes, or else of its collision shapes; None without any."""
        if link not in self.solids:
            kinds = (self._solid_of(link, kind) for kind in ("visual", "collision"))
            self.solids[link] = next(filter(None, kinds), None)
        return self.solids[link]

    def _solid_of(self, link: Element, kind: str) -> _Solid | None:
        """Solid of a link's shapes of one kind; shapes that cannot be read are left out."""
        bodies, corners, files = [], [], []
        for shape in link.findall(kind):
            geometry = shape.find("geometry")
            for element in () if geometry is None else geometry:
                try:
                    parts, file = self._parts(element)
                    place = place_of(shape).homogeneous
                except (JointplayError, ValueError, TypeError):
                    continue
                files += [file] * bool(file)
                for points, triangles in parts:
                    at = points @ place[:3, :3].T + place[:3, 3]
                    body = _evenly(at, triangles)
                    bodies += [body] * (body.mass > 0.0)
                    corners.append(at)
        if not bodies:
            return None
        surface = np.concatenate(corners)
        bounds = np.array([surface.min(axis=0), surface.max(axis=0)])
        label = (
            f"its {'meshes' if len(files) > 1 else 'mesh'} {few(files, 2)}"
            if files
            else (f"its {kind} shape")
        )
        total = bodies[0]
        for body in bodies[1:]:
            total = total + body
        return _Solid(total, bounds, label, bool(files))

    def _parts(self, shape: Element) -> tuple[list[tuple[np.ndarray, np.ndarray]], str]:
        """Points and triangles of a shape's surfaces; and the name of its mesh file, if any."""
        if shape.tag == "mesh":
            name = shape.get("filename", "")
            path = find_mesh(name, self.folders)
            try:
                if path is None:
                    raise JointplayError("not found")
                parts = meshes.parts_of(path)
            except JointplayError:
                self.missing.append(name)
                raise
            scale = np.array([float(number) for number in shape.get("scale", "1 1 1").split()])
            return [(part.points * scale, part.triangles) for part in parts], path.name
        sizes = [float(x) for key in urdf.SHAPES.get(shape.tag, ()) for x in
                 shape.get(key, "").split()]  # fmt: skip
        if shape.tag == "sphere":
            sizes.append(0.0)
        surface = surface_of(("capsule" if shape.tag == "sphere" else shape.tag, tuple(sizes)))
        return [(surface.points, surface.triangles)], ""


@dataclass(frozen=True)
class _Solid:
    """The shapes of a link, filled."""

    body: pin.Inertia
    """Inertia at density 1 in the link's frame."""
    bounds: np.ndarray
    """Least and largest corner (2, 3) [m]."""
    label: str
    """What the shapes are, in words."""
    of_mesh: bool
    """Whether a mesh is among the shapes."""

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return float(self.body.mass)

    @property
    def size(self) -> float:
        """Diagonal of the box around the shapes [m]."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    def is_beside(self, point: np.ndarray) -> bool:
        """Whether a point lies outside the shapes by more than `_ASIDE`."""
        (low, high), aside = self.bounds, _ASIDE * self.size
        return bool(np.any(point < low - aside) or np.any(point > high + aside))

    def at(self, mass: float) -> pin.Inertia:
        """Inertia at a mass [kg]."""
        part = mass / self.body.mass
        return pin.Inertia(mass, self.body.lever, part * self.body.inertia)


def _evenly(points: np.ndarray, triangles: np.ndarray) -> pin.Inertia:
    """Inertia at density 1 of a closed surface, or of an open one's convex hull; zero if flat."""
    import trimesh

    mesh = trimesh.Trimesh(points, triangles, process=False)
    try:
        if not mesh.is_watertight:
            mesh = mesh.convex_hull
        if mesh.volume < 0.0:  # mirrored
            mesh.invert()
        body = pin.Inertia(float(mesh.volume), mesh.center_mass, mesh.moment_inertia)
    except Exception:  # noqa: BLE001 - Qhull and trimesh raise whatever they like at flat ones
        return pin.Inertia.Zero()
    return body if body.mass > 0.0 and np.isfinite(body.inertia).all() else pin.Inertia.Zero()


def _place(element: Element) -> pin.SE3 | None:
    """Pose of an <inertial> or a joint; None if its origin is no pose."""
    try:
        return place_of(element)
    except (ValueError, TypeError):
        return None


def _unit(ratio: float) -> str:
    """A question in which unit an inertia is written that is `ratio` times that of the shapes."""
    for factor, unit in ((1e9, "g mm2"), (1e7, "g cm2"), (1e6, "kg mm2"), (1e4, "kg cm2"),
                         (1e3, "g m2"), (3417.0, "lb in2")):  # fmt: skip
        if 1.0 / 3.0 < ratio / factor < 3.0:
            return f": written in {unit}?"
    return ""


def _put(link: Element, mass: float, place: pin.SE3, tensor: np.ndarray) -> str:
    """Give a link an <inertial>, in place of its own; the element's text."""
    inertial = link.find("inertial")
    if inertial is None:
        inertial = Element("inertial")
        inertial.tail = link.text
        link.insert(0, inertial)
    text, tail = inertial.text, inertial.tail
    inertial.clear()
    inertial.text, inertial.tail = text, tail
    if not place.isIdentity(0.0):
        inertial.append(origin_of(place))
    low = float(np.linalg.eigvalsh(tensor)[0])
    tensor = tensor * max(1.0, _LEAST / low)
    put(inertial, "mass", value=f"{mass:.9g}")
    put(inertial, "inertia", **{key: float(f"{x:.6g}") for key, x in moments(tensor).items()})
    return _shown(inertial)


def _shown(element: Element) -> str:
    """Text of an element, indented, to be pasted."""
    plain = ElementTree.fromstring(ElementTree.tostring(element, encoding="unicode").strip())
    ElementTree.indent(plain)
    return ElementTree.tostring(plain, encoding="unicode").strip()


def _lines(text: str) -> list[int]:
    """Line in which each element begins, in order; comments inside the root count as elements."""
    lines: list[int] = []
    parser = expat.ParserCreate()

    def begin(*_: Any) -> None:
        lines.append(parser.CurrentLineNumber)

    parser.StartElementHandler = begin
    parser.CommentHandler = lambda _: begin() if lines else None
    parser.Parse(text, True)
    return lines
