"""A linkage as one draws it: points, the links that share them, sliders; from that its tree.

linkage = jp.Linkage(
    points={"O": (0, 0), "A": ("50 mm", 0), "B": ("170 mm", 0)},
    ground=["O"],
    links={
        "crank": jp.LinkageLink(["O", "A"], mass=0.3),
        "rod": jp.LinkageLink(["A", "B"], mass=0.21),
        "slider": jp.LinkageLink(["B"], mass=0.14),
    },
    sliders={"guide": jp.LinkageSlider("slider", (1, 0))},
)
mechanism = jp.Mechanism(linkage, {"B": jp.RevoluteClearance.planar(radial_clearance=1e-4)})

Joints are the edges of a graph whose nodes are the links and the ground. A spanning tree of it
(Kruskal) becomes the URDF, what is left closes loops. Sliders come first into the tree, for an
ideal one cannot close a loop, then joints on the ground, among which are the drives; joints with
play come last, so that their loops are cut where only contact acts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, require_known, within
from jointplay.base.schema import Described, check, check_fields, choice, quantity
from jointplay.model import urdf
from jointplay.model.beams import section
from jointplay.model.elements import (
    Element,
    document,
    origin_of,
    put,
    put_fixed,
    put_inertial,
)
from jointplay.model.loop import Loop, Vector
from jointplay.physics.joints import SphericalClearance
from jointplay.physics.joints.base import Material
from jointplay.physics.joints.materials import material

GROUND = "ground"
"""The link that stands still."""
PLANES = {"vertical": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), "horizontal": np.eye(3)}
"""Axes of a drawing in the world: x to the right, and y up or, seen from above, away."""

_APART_M = 1e-9
"""Points that are nearer are one (judged: a thousandth of the smallest clearance)."""
_DIGITS = 15
"""Decimals of differences of places [m], so that 0.17 - 0.05 is 0.12."""
_LINE, _PIVOT = 0.02, 0.04
"""Radius of a link's lines, and of pivots on the ground, in pictures; of the drawing's size."""


@dataclass(frozen=True)
class LinkageLink(Described):
    """A rigid link through points, its mass spread evenly along the lines between them.

    Through three points or more the lines are closed. A link at a single point, such as a slider,
    is a cube. Where nobody says how thick it is, it is of steel, as thick as its mass demands; of
    planar motion that decides nothing.

    Raises:
        JointplayError: no points, neither mass nor section, a number that cannot be.
    """

    points: tuple[str, ...]
    """Names of the points that it joins."""
    mass: float | None = quantity("kg", default=None, above=0.0)
    """If not given, that of the section."""
    centre: tuple[float, ...] | None = quantity("m", default=None)
    """Of mass, in the drawing; if not given, that of the lines."""
    inertia: float | None = quantity("kg*m^2", default=None, above=0.0)
    """About the centre of mass and the normal of the plane, or of a spatial linkage the largest
    principal moment; if not given, that of the lines."""
    section: str | None = None
    """``"tube 20x2 mm"``, ``"rod 8 mm"``, ``"box 30x20x2 mm"`` or ``"bar 20x5 mm"``."""
    material: Material = field(default_factory=lambda: material("carbon-steel"))
    """Of the section, with a density."""

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "points", tuple(self.points))
        if not self.points or len({*self.points}) < len(self.points):
            names = ", ".join(self.points) or "none"
            raise JointplayError(f"a link has one or several points, got {names}", ("points",))
        if self.material.density is None:
            raise JointplayError("the material of a link needs a density", ("material",))
        if self.section is not None:
            section(self.section)
        if self.mass is None and (self.section is None or len(self.points) == 1):
            way = "a mass" if len(self.points) == 1 else "a mass, or a section"
            raise JointplayError(f"a link needs {way}", ("mass",))


@dataclass(frozen=True)
class LinkageSlider(Described):
    """A link slides along a line, on the ground or on another link, and does not turn on it."""

    link: str
    """The link that slides."""
    along: tuple[float, ...] = quantity("")
    """Direction in the drawing."""
    on: str = GROUND
    """The link on which it slides."""

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "along", tuple(self.along))
        if not np.any(self.along):
            raise JointplayError("along has no direction", ("along",))


class Edge(NamedTuple):
    """A joint between two links."""

    name: str
    kind: str
    """Of a URDF: continuous, prismatic, floating."""
    bearing: str
    journal: str
    point: str
    axis: np.ndarray
    """Of turning or sliding, in the drawing."""


class Tree(NamedTuple):
    """What a linkage is made of."""

    description: urdf.Description
    loops: dict[str, Loop]
    balls: dict[str, SphericalClearance]
    """Ideal ones, by joint."""


@dataclass(frozen=True, kw_only=True)
class Linkage(Described):
    """Points, links and sliders of a planar or spatial linkage, in a position where it is closed.

    Links that share a point have a pin there, called like the point; where three or more do, the
    first of them carries the others, whose pins are called POINT_LINK. Angles and places count from
    the position that is drawn.

    Raises:
        JointplayError: a name that does not exist, two points in one place, a link that nothing
            holds; `where` has the key.
    """

    points: dict[str, list[float]] = quantity("m")
    """Where they are: two coordinates each, or three of a spatial linkage."""
    ground: tuple[str, ...]
    """Points that stand still."""
    links: dict[str, LinkageLink]
    """Links by name."""
    sliders: dict[str, LinkageSlider] = field(default_factory=dict)
    """Joints that slide, by name."""
    axes: dict[str, list[float]] = quantity("", default_factory=dict)
    """Of a spatial linkage: directions of pins, by point; z if not given."""
    balls: tuple[str, ...] = ()
    """Of a spatial linkage: points with a ball instead of a pin."""
    output: str = ""
    """Link or point whose error is reported; if not given, the last of the links that turn or slide
    on the ground, where there are several, else the last point that one link has for itself."""
    plane: str = choice("plane", list(PLANES), default="vertical")
    """How the drawing of a planar linkage lies: ``vertical`` (y up, against gravity) or
    ``horizontal``; a spatial one has its z up."""

    def __post_init__(self) -> None:
        check_fields(self)
        for key, unit in (("points", "m"), ("axes", "")):
            table = {}
            for name, place in getattr(self, key).items():
                with within(key, name):
                    table[name] = check(list[float], list(place), (unit,))
            object.__setattr__(self, key, table)
        for key in ("ground", "balls"):
            object.__setattr__(self, key, tuple(getattr(self, key)))
        self._check_points()
        self._check_names()

    def _check_points(self) -> None:
        sizes = {len(place) for place in self.points.values()}
        if sizes - {2, 3} or len(sizes) != 1:
            raise JointplayError(
                "points have two coordinates each, or three each (spatial); got "
                + ", ".join(f"{name} {len(place)}" for name, place in self.points.items()),
                ("points",),
            )
        for first, second in combinations(self.points, 2):
            if np.linalg.norm(self._place(first) - self._place(second)) < _APART_M:
                raise JointplayError(
                    f"points {first!r} and {second!r} are in one place; links that meet there "
                    "share one point",
                    ("points", second),
                )

    def _check_names(self) -> None:
        for key in ("axes", "balls"):
            if getattr(self, key) and not self.spatial:
                raise JointplayError(
                    f"{key} are of a spatial linkage: give three coordinates", (key,)
                )
        for key in ("ground", "axes", "balls"):
            for name in getattr(self, key):
                require_known("point", name, self.points, where=(key,))
        for name, link in self.links.items():
            if name == GROUND:
                raise JointplayError(
                    "the ground is no link; its points are `ground`", ("links", name)
                )
            for point in link.points:
                require_known("point", point, self.points, where=("links", name, "points"))
            self._vector(link.centre or self.points[link.points[0]], "links", name, "centre")
        for name, slider in self.sliders.items():
            require_known("link", slider.link, self.links, where=("sliders", name, "link"))
            require_known("link", slider.on, [GROUND, *self.links], where=("sliders", name, "on"))
            self._vector(slider.along, "sliders", name, "along")
        if self.output:
            require_known("output", self.output, [*self.links, *self.traced], where=("output",))
        names = [edge.name for edge in self.edges]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise JointplayError(f"two joints are called {twice!r}", ("sliders", twice))

    @property
    def spatial(self) -> bool:
        return any(len(place) == 3 for place in self.points.values())

    def _vector(self, components: Sequence[float], *where: str) -> np.ndarray:
        """Three components of a drawing's two or three."""
        count = 3 if self.spatial else 2
        if len(components) != count:
            raise JointplayError(f"give {count} components, got {list(components)}", where)
        return np.array([*components, 0.0][:3])

    def _place(self, point: str) -> np.ndarray:
        return self._vector(self.points[point], "points", point)

    @property
    def traced(self) -> dict[str, str]:
        """Points of one link alone, at which nothing is hinged, with the link."""
        carriers = {
            point: [name for name, link in self.links.items() if point in link.points]
            for point in self.points
            if point not in (*self.ground, *self.links, GROUND)
        }
        sliders = {slider.link for slider in self.sliders.values()}
        return {
            point: names[0]
            for point, names in carriers.items()
            if len(names) == 1
            and not (names[0] in sliders and len(self.links[names[0]].points) == 1)
        }

    @property
    def tool(self) -> str:
        """Frame of the output."""
        if self.output:
            return self.output
        moved = (edge for edge in self.edges if edge.bearing == GROUND)
        grounded = {edge.journal for edge in moved}
        links = [name for name in self.links if name in grounded]
        if len(links) > 1:
            return links[-1]
        return [*self.links, *self.traced][-1]

    @property
    def edges(self) -> list[Edge]:
        """All joints: sliders, then pins and balls in the order of the points."""
        joints = [
            Edge(
                name, "prismatic", slider.on, slider.link, self.links[slider.link].points[0],
                self._vector(slider.along),
            )
            for name, slider in self.sliders.items()
        ]  # fmt: skip
        for point in self.points:
            carrier, *others = [
                *([GROUND] if point in self.ground else []),
                *(name for name, link in self.links.items() if point in link.points),
            ] or [GROUND]
            axis = (
                self._vector(self.axes[point], "axes", point) if point in self.axes else (0, 0, 1)
            )
            for link in others:
                joints.append(
                    Edge(
                        point if len(others) == 1 else f"{point}_{link}",
                        "floating" if point in self.balls else "continuous",
                        carrier, link, point, np.array(axis, float),
                    )
                )  # fmt: skip
        return joints

    def tree(self, play: Collection[str] = ()) -> Tree:
        """The URDF and the loops of the linkage.

        Args:
            play: names of joints with clearance, at which loops are cut if possible.

        Raises:
            JointplayError: links that nothing holds.
        """
        rank = {"prismatic": 0, "continuous": 2, "floating": 3}

        def order(edge: Edge) -> int:
            on_ground = edge.bearing == GROUND and edge.kind == "continuous"
            return (
                rank[edge.kind] - on_ground + 4 * (edge.name in play and edge.kind != "prismatic")
            )

        part = {name: name for name in (GROUND, *self.links)}
        held, loops = [], {}
        for edge in sorted(self.edges, key=order):
            group, joined = part[edge.bearing], part[edge.journal]
            if group == joined:
                loops[edge.name] = edge
                continue
            held.append(edge)
            part = {name: group if mine == joined else mine for name, mine in part.items()}
        loose = [name for name in self.links if part[name] != part[GROUND]]
        if loose:
            raise JointplayError(
                f"link {loose[0]!r} is not connected to the ground: it shares no point with a link "
                f"that is, and slides on none",
                ("links", loose[0]),
            )
        slides = next((edge for edge in loops.values() if edge.kind == "prismatic"), None)
        if slides is not None:
            raise JointplayError(
                f"slider {slides.name!r} closes a loop of sliders alone", ("sliders", slides.name)
            )
        origins = {GROUND: np.zeros(3)}
        root = _root(PLANES["horizontal" if self.spatial else self.plane])
        for edge in _from_ground(held):
            origins[edge.journal] = self._place(edge.point)
            joint = put(root, "joint", name=edge.name, type=edge.kind)
            place = self._place(edge.point) - origins[edge.bearing]
            joint.append(origin_of(pin.SE3(np.eye(3), place.round(_DIGITS))))
            put(joint, "parent", link=edge.bearing)
            put(joint, "child", link=edge.journal)
            if edge.kind == "prismatic":
                put(joint, "limit", lower=-self.size, upper=self.size, effort=0.0, velocity=0.0)
            put(joint, "axis", xyz=edge.axis / np.linalg.norm(edge.axis))
        for name, link in self.links.items():
            self._put_link(root, name, link, origins[name])
        self._put_points(root, origins)
        path = Path("linkage.urdf")
        balls = [edge.name for edge in self.edges if edge.kind == "floating"]
        return Tree(
            urdf.parse(document(root), path),
            {name: self._loop(edge, origins) for name, edge in loops.items()},
            {name: _IDEAL_BALL for name in balls if name not in play},
        )

    @property
    def size(self) -> float:
        """Largest extent of the drawing [m]; 1 m if it has a single point."""
        places = np.array([self._place(point) for point in self.points])
        return float(np.ptp(places, axis=0).max()) or 1.0

    def _loop(self, edge: Edge, origins: Mapping[str, np.ndarray]) -> Loop:
        place = self._place(edge.point)
        turned = np.eye(3)
        if edge.kind == "continuous":  # z along the axis
            turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), edge.axis).matrix()
        rpy = _vector_of(pin.rpy.matrixToRpy(turned))
        bearing, journal = (
            _vector_of((place - origins[link]).round(_DIGITS))
            for link in (edge.bearing, edge.journal)
        )
        return Loop(edge.bearing, edge.journal, bearing, rpy, journal, rpy)

    def _put_link(self, root: Element, name: str, link: LinkageLink, origin: np.ndarray) -> None:
        element = put(root, "link", name=name)
        body = self.inertia(name)
        put_inertial(element, pin.Inertia(body.mass, body.lever - origin, body.inertia))
        for start, end in self._lines(link):
            _put_line(element, start - origin, end - origin, _LINE * self.size)
        if len(link.points) == 1:
            picture = put(element, "visual")
            picture.append(origin_of(pin.SE3(np.eye(3), self._place(link.points[0]) - origin)))
            put(put(picture, "geometry"), "box", size=[2.0 * _PIVOT * self.size] * 3)

    def _put_points(self, root: Element, origins: Mapping[str, np.ndarray]) -> None:
        """Pivots on the ground in its picture; points of one link alone as frames to look at."""
        ground = next(link for link in root.findall("link") if link.get("name") == GROUND)
        for point in self.ground:
            picture = put(ground, "visual")
            picture.append(origin_of(pin.SE3(np.eye(3), self._place(point))))
            put(put(picture, "geometry"), "sphere", radius=_PIVOT * self.size)
        for point, link in self.traced.items():
            put(root, "link", name=point)
            at = pin.SE3(np.eye(3), (self._place(point) - origins[link]).round(_DIGITS))
            put_fixed(root, f"{point}_of_{link}", link, point, at)

    def _lines(self, link: LinkageLink) -> list[tuple[np.ndarray, np.ndarray]]:
        """From point to point, closed if there are three or more."""
        places = [self._place(point) for point in link.points]
        return list(pairwise(places + places[:1] * (len(places) > 2)))

    def inertia(self, link: str) -> pin.Inertia:
        """A link's mass, centre and moments, in the drawing's axes; see `LinkageLink`."""
        given = self.links[link]
        density = given.material.density
        assert density is not None
        lines = self._lines(given)
        length = sum(float(np.linalg.norm(end - start)) for start, end in lines)
        mass = given.mass or density * section(str(given.section)).area * length
        place = self._place(given.points[0])
        if not lines:
            side = (mass / density) ** (1.0 / 3.0)
            body = pin.Inertia(mass, place, mass * side**2 / 6.0 * np.eye(3))
        else:
            body = pin.Inertia.Zero()
            for start, end in lines:
                part = mass * float(np.linalg.norm(end - start)) / length
                body += _rod(part, start, end, mass / (density * length))
        centre = body.lever if given.centre is None else self._vector(given.centre)
        moments = body.inertia
        if given.inertia is not None:
            largest = np.linalg.eigvalsh(moments)[-1] if self.spatial else moments[2, 2]
            moments = moments * (given.inertia / largest)
        return pin.Inertia(mass, centre, moments)


_IDEAL_BALL = SphericalClearance(bearing_radius=0.01, radial_clearance=1e-4, ideal=True)
"""Its dimensions decide nothing."""


def _vector_of(values: np.ndarray) -> Vector:
    x, y, z = map(float, values)
    return x, y, z


def _root(axes: np.ndarray) -> Element:
    """A URDF with the ground, whose axes are the drawing's."""
    root = Element("robot", name="linkage")
    put(root, "link", name="world")
    put_fixed(root, "drawing", "world", GROUND, pin.SE3(axes, np.zeros(3)))
    put(root, "link", name=GROUND)
    return root


def _from_ground(joints: Sequence[Edge]) -> Iterator[Edge]:
    """The joints of a tree, each from the side of the ground, the nearest to it first."""
    reached, left = {GROUND}, list(joints)
    while left:
        edge = next(joint for joint in left if reached & {joint.bearing, joint.journal})
        left.remove(edge)
        if edge.bearing not in reached:
            axis = -edge.axis if edge.kind == "prismatic" else edge.axis
            edge = edge._replace(bearing=edge.journal, journal=edge.bearing, axis=axis)
        reached.add(edge.journal)
        yield edge


def _rod(mass: float, start: np.ndarray, end: np.ndarray, area: float) -> pin.Inertia:
    """A uniform round rod with this cross-section [m^2]."""
    line = end - start
    length = float(np.linalg.norm(line))
    along = np.outer(line, line) / length**2
    radius_squared = area / np.pi
    across = length**2 / 12.0 + radius_squared / 4.0
    moments = across * (np.eye(3) - along) + 0.5 * radius_squared * along
    return pin.Inertia(mass, 0.5 * (start + end), mass * moments)


def _put_line(link: Element, start: np.ndarray, end: np.ndarray, radius: float) -> None:
    line = end - start
    turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), line).matrix()
    picture = put(link, "visual")
    picture.append(origin_of(pin.SE3(turned, 0.5 * (start + end))))
    put(put(picture, "geometry"), "cylinder", radius=radius, length=float(np.linalg.norm(line)))
