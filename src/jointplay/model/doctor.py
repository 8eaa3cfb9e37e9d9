"""What is impossible or doubtful in a robot's file, all of it at once, and what would be right.

A link's right inertia is that of its shapes at its mass, spread evenly: of closed meshes as they
are, of open ones their convex hull, of boxes, cylinders and balls. What cannot be known from the
file, as a mass or a torque, is said, not made up; a mass that is missing is that of water in the
shapes' volume, and called so.
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
"""Density of a link of which no mass is known [kg/m^3]: printed plastic with hollows is half of it,
aluminium with hollows as much (judged)."""
_DENSEST = 22600.0
"""Of all that links are made of none is denser: osmium [kg/m^3]."""
_HUGE, _TINY = 20.0, 1e-3
"""Size of a link's meshes relative to the robot's from which, up to which, they are in other units:
of millimetres taken for metres it is some hundred, the other way a few thousandths of one."""
_LONGEST = 10.0
"""A link with a mesh of this size [m] may be in metres after all, of a crane."""
_ASIDE = 0.1
"""Part of its size by which a centre of mass may lie outside a link's shapes, which lack motors."""
_BEYOND = 1.5
"""Factor by which an inertia may exceed that of the link's mass at its farthest corner."""
_LEAST = 1e-12
"""Least moment that is written [kg m^2]: MuJoCo refuses 1e-15, which a marker of 1e-9 kg has."""
_SURE = 100.0
"""Factor by which it then is in another unit, not of parts that are not drawn: units differ by a
thousand or more."""
_SLIGHT = 0.02
"""Part of that of its shapes below which an inertia is a placeholder, as 1e-6 is."""


class Finding(NamedTuple):
    """Something that is not as it should be."""

    line: int | None
    """In the robot's file; None if it is not written there, as what xacro makes."""
    where: str
    """Link or joint."""
    fault: str
    right: str
    """What would be right, in words; empty if nobody can know."""
    element: str = ""
    """The element that says so, to be pasted; empty if there is none."""
    note: bool = False
    """Whether it refuses nothing."""
    doubt: bool = False
    """Whether the file may be right after all, so that `element` is not written into it."""

    def __str__(self) -> str:
        at = "" if self.line is None else f"line {self.line}, "
        head = f"{'note: ' * self.note}{at}{self.where}: {self.fault}"
        return "\n".join([head, *([f"  right: {self.right}"] * bool(self.right)),
                          *(f"    {row}" for row in self.element.splitlines())])  # fmt: skip


@dataclass
class Diagnosis:
    """All that was found in a robot's file."""

    path: Path
    findings: list[Finding]
    root: Element
    """The URDF with what is right in it."""
    refused: str
    """Why the URDF with that is refused still; empty if it is not."""

    @property
    def impossible(self) -> list[Finding]:
        return [finding for finding in self.findings if not finding.note]

    @property
    def mended(self) -> int:
        """Findings of which the right element is known."""
        return sum(bool(finding.element) and not finding.doubt for finding in self.findings)

    @property
    def sentence(self) -> str:
        wrong, count = self.impossible, len(self.findings)
        if not count:
            return f"{self.path.name}: nothing impossible was found"
        places = few(list(dict.fromkeys(finding.where for finding in wrong)), 4)
        summary = f"{len(wrong)} impossible ({places})" if wrong else "nothing impossible"
        notes = f", {count - len(wrong)} doubtful" if count > len(wrong) else ""
        cure = f"; --write fixed.urdf mends {self.mended} of {count}" if self.mended else ""
        return f"{self.path.name}: {summary}{notes}{cure}"

    def text(self, path: Path) -> str:
        """The mended URDF as a file at `path`: meshes that are named from the folder stay so."""
        folder, target = self.path.resolve().parent, path.resolve().parent
        for mesh in self.root.iter("mesh"):
            name = mesh.get("filename", "")
            if folder != target and "://" not in name and (folder / name).is_file():
                mesh.set("filename", os.path.relpath(folder / name, target))
        return '<?xml version="1.0"?>\n' + ElementTree.tostring(self.root, encoding="unicode")


def diagnose(place: str | Path, arguments: Mapping[str, Value] | None = None) -> Diagnosis:
    """Look for all that is impossible in a robot's file, named as for `robots.source_of`.

    Raises:
        JointplayError: it cannot be read, or is no well-formed XML.
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
    comments = _without_comments(root)
    findings = [finding for part in patient.parts() for finding in part]
    findings.sort(key=lambda finding: (finding.note, finding.line or 0))
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
    """Take comments out: of each the element it was in, itself, and what came after it."""
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
    path: Path
    text: str
    root: Element
    """Mended while it is looked at."""
    missing: list[str] = field(default_factory=list)
    """Meshes that are not found."""

    def __post_init__(self) -> None:
        self.links = self.root.findall("link")
        self.joints = self.root.findall("joint")
        self.folders = [*folders_of(self.path, self.text), *collected_folders()]
        self.original = read_text(self.path, "robot")
        self._lines = dict(zip(map(id, self.root.iter()), _lines(self.text), strict=False))
        self._same = self.original.count("\n") == self.text.count("\n")
        self.reach = self._reach()
        moved = {child.get("link") for j in self.joints if j.get("type") != "fixed"
                 for child in j.findall("child")}  # fmt: skip
        self.moved = moved
        self.solids: dict[Element, _Solid | None] = {}

    def parts(self) -> Iterator[Iterator[Finding]]:
        """All there is to find; in this order, as right inertias need right meshes."""
        yield from (self.names(), self.slips(), self.scales(), self.inertias())
        yield from (self.marks(), self.lost())

    def line(self, element: Element) -> int | None:
        if self._same:
            return self._lines.get(id(element))
        pattern = rf"name\s*=\s*[\"']{re.escape(element.get('name', ''))}[\"']"
        match = re.search(pattern, self.original)
        return None if match is None else 1 + self.original.count("\n", 0, match.start())

    def _reach(self) -> float:
        """Largest distance of a link from the base along joints' origins [m]."""
        above = {}
        for joint in self.joints:
            parent, child = joint.find("parent"), joint.find("child")
            if parent is not None and child is not None:
                try:
                    size = float(np.linalg.norm(place_of(joint).translation))
                except (ValueError, TypeError):
                    size = 0.0
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

    # Parts of the robot, each with what is found in it.

    def names(self) -> Iterator[Finding]:
        for kind, all_ in (("link", self.links), ("joint", self.joints)):
            seen: dict[str, Element] = {}
            for element in all_:
                name = element.get("name", "")
                first = seen.setdefault(name, element)
                if first is not element:
                    at = self.line(first)
                    fault = f"there is another, in line {at}" if at else "there is another"
                    right = "rename one of them, and what refers to it"
                    yield Finding(self.line(element), f"{kind} {name!r}", fault, right)

    def slips(self) -> Iterator[Finding]:
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
            elif "<mass>, where nobody" in why and self._mass(top.find("inertial")):
                for mass in top.findall("mass"):
                    top.remove(mass)
                kept_masses = top.findall("inertial/mass")
                right, text = "leave it out, for it has one", _shown(kept_masses[0])
            yield Finding(self.line(top), where, why.removeprefix(f"{where} has ")
                          .removeprefix(f"{where}: "), right, text)  # fmt: skip

    def marks(self) -> Iterator[Finding]:
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
                    fault = "floats: play cannot be in it; --base free lets a base float"
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
            del self.solids[link]
            unit = "millimetres" if factor < 1.0 else "metres, scaled to millimetres"
            fault = (
                f"meshes of {readable(size, 'm', 3)} on a robot of {readable(self.reach, 'm', 3)}"
            )
            right = f"they are in {unit}"
            yield Finding(self.line(link), f"link {link.get('name')!r}", fault, right, shown, True)

    def inertias(self) -> Iterator[Finding]:
        alone = ElementTree.Element("robot")
        try:
            wrong = impossible_inertias(self.root)
        except (JointplayError, ValueError, KeyError, StopIteration, AttributeError):
            wrong = None  # of a tree that is none every link is judged by itself
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
        """Whether a link that moves has mass by what is fixed to it."""
        by_name = {e.get("name", ""): e for e in self.links}
        new, seen = [name], {name}
        while new:
            link = by_name.get(new.pop())
            if link is not None and self._mass(link.find("inertial")):
                return True
            for joint in self.joints:
                parent, child = joint.find("parent"), joint.find("child")
                if joint.get("type") != "fixed" or parent is None or child is None:
                    continue
                if link is not None and parent.get("link") == link.get("name"):
                    new += {child.get("link", "")} - seen
                    seen.add(child.get("link", ""))
        return False

    def _mass(self, inertial: Element | None) -> float:
        try:
            text = "" if inertial is None else inertial.find("mass").get("value", "")  # type: ignore[union-attr]
            value = float(text)
        except (ValueError, AttributeError):
            return 0.0
        return value if np.isfinite(value) else 0.0

    def _doubt(self, link: Element, mass: float) -> tuple[str, bool]:
        """What a possible inertia is not, seen beside the link's shapes; empty if it is.

        And whether the shapes may be to blame: they often leave out motors.
        """
        solid, inertial = self.solid(link), link.find("inertial")
        if solid is None or inertial is None:
            return "", False
        low, high = solid.bounds
        size, centre = float(np.linalg.norm(high - low)), place_of(inertial).translation
        if size < urdf.SHORTEST_AXIS:
            return "", False
        if np.any(centre < low - _ASIDE * size) or np.any(centre > high + _ASIDE * size):
            less = centre / 1e3
            inside = np.all(less >= low) and np.all(less <= high)
            outside = np.linalg.norm(np.maximum(np.maximum(low - centre, centre - high), 0.0))
            return f"centre of mass {readable(float(outside), 'm', 3)} outside its shapes" + (
                ": written in millimetres?" if inside and np.abs(centre).max() > 1.0 else ""
            ), not inside
        tensor = tensor_of(inertial, f"link {link.get('name')!r}")
        principal = np.linalg.eigvalsh(tensor)
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
        """The inertia that a link should have, in words and as an element, which it gets."""
        solid, inertial = self.solid(link), link.find("inertial")
        if solid is None:
            return ("", "") if mass is None else self._ball(link, mass)
        text = (
            f"that of {solid.label} at {mass:g} kg, spread evenly"
            if mass
            else (f"that of {solid.label} as heavy as water (weigh it)")
        )
        body = solid.at(mass or WATER * solid.volume)
        place = None if inertial is None else _place(inertial)
        low, high = solid.bounds
        aside = _ASIDE * float(np.linalg.norm(high - low))
        if (
            place is None
            or np.any(place.translation < low - aside)
            or np.any(place.translation > high + aside)
        ):
            place = pin.SE3(np.eye(3), body.lever)
        tensor = place.rotation.T @ body.inertia @ place.rotation
        return text, _put(link, body.mass, place, tensor)

    def _ball(self, link: Element, mass: float) -> tuple[str, str]:
        """Of a link without shapes: a ball of water."""
        radius = (3.0 * mass / (4.0 * np.pi * WATER)) ** (1.0 / 3.0)
        inertial = link.find("inertial")
        place = (None if inertial is None else _place(inertial)) or pin.SE3.Identity()
        tensor = 0.4 * mass * radius**2 * np.eye(3)
        text = f"it has no shape; that of a ball of water of {mass:g} kg"
        return text, _put(link, mass, place, tensor)

    def lost(self) -> Iterator[Finding]:
        for link in self.links:
            self.solid(link)
        if names := list(dict.fromkeys(self.missing)):
            match = re.search(re.escape(names[0]), self.original)
            line = None if match is None else 1 + self.original.count("\n", 0, match.start())
            right = "beside the URDF, or in their package above it; .stl, .obj or .dae"
            fault = f"not found or not readable: {few(names, 3)}"
            yield Finding(line, "meshes", fault, right, "", True)

    # Shapes.

    def solid(self, link: Element) -> _Solid | None:
        """What a link's visuals make up, or else its collision shapes; None if there are none."""
        if link not in self.solids:
            kinds = (self._of(link, kind) for kind in ("visual", "collision"))
            self.solids[link] = next(filter(None, kinds), None)
        return self.solids[link]

    def _of(self, link: Element, kind: str) -> _Solid | None:
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
    """Shapes of a link, of density 1, in its frame."""

    body: pin.Inertia
    bounds: np.ndarray
    """Least and largest corner (2, 3) [m]."""
    label: str
    of_mesh: bool

    @property
    def volume(self) -> float:
        return float(self.body.mass)

    def at(self, mass: float) -> pin.Inertia:
        part = mass / self.body.mass
        return pin.Inertia(mass, self.body.lever, part * self.body.inertia)


def _evenly(points: np.ndarray, triangles: np.ndarray) -> pin.Inertia:
    """A closed surface filled with density 1; an open one's convex hull; of a flat one, nothing."""
    import trimesh

    mesh = trimesh.Trimesh(points, triangles, process=False)
    try:
        if not mesh.is_watertight:
            mesh = mesh.convex_hull
        if mesh.volume < 0.0:  # mirrored
            mesh.invert()
        body = pin.Inertia(float(mesh.volume), mesh.center_mass, mesh.moment_inertia)
    except Exception:  # noqa: BLE001 - Qhull and trimesh raise whatever they like of flat ones
        return pin.Inertia.Zero()
    return body if body.mass > 0.0 and np.isfinite(body.inertia).all() else pin.Inertia.Zero()


def _place(inertial: Element) -> pin.SE3 | None:
    try:
        return place_of(inertial)
    except (ValueError, TypeError):
        return None


def _unit(ratio: float) -> str:
    """In which unit an inertia may be written that is so many times that of the shapes."""
    for factor, unit in ((1e9, "g mm2"), (1e7, "g cm2"), (1e6, "kg mm2"), (1e4, "kg cm2"),
                         (1e3, "g m2"), (3417.0, "lb in2")):  # fmt: skip
        if 1.0 / 3.0 < ratio / factor < 3.0:
            return f": written in {unit}?"
    return ""


def _put(link: Element, mass: float, place: pin.SE3, tensor: np.ndarray) -> str:
    """Give a link this inertial, in place of its own; its text."""
    old = link.find("inertial")
    inertial = ElementTree.SubElement(link, "inertial") if old is None else old
    if old is None:
        link.remove(inertial)
        link.insert(0, inertial)
        inertial.tail = link.text
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
    """An element as one pastes it."""
    plain = ElementTree.fromstring(ElementTree.tostring(element, encoding="unicode").strip())
    ElementTree.indent(plain)
    return ElementTree.tostring(plain, encoding="unicode").strip()


def _lines(text: str) -> list[int]:
    """In which line each element begins, comments within the first among them, in their order."""
    lines: list[int] = []
    parser = expat.ParserCreate()

    def begin(*_: Any) -> None:
        lines.append(parser.CurrentLineNumber)

    parser.StartElementHandler = begin
    parser.CommentHandler = lambda _: begin() if lines else None
    parser.Parse(text, True)
    return lines
