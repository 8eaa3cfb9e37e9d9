"""Linkages as one draws them: points, the links that share them, sliders.

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

`linkage_tree` makes a URDF and loops of a linkage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from jointplay.base.errors import JointplayError, require_known, within
from jointplay.base.schema import Described, OptionalQuantity, check, check_fields, choice, quantity
from jointplay.model.beams import section
from jointplay.physics.joints.base import Material
from jointplay.physics.joints.materials import material

PIN, SLIDE, BALL = "continuous", "prismatic", "floating"
"""Kinds of joint of a linkage, by the words of a URDF."""
GROUND = "ground"
"""Name of the link that stands still."""
DRAWN = "linkage"
"""Path of the URDF that is made of a linkage, for which there is no file."""
PLANES = {"vertical": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), "horizontal": np.eye(3)}
"""Axes of a drawing in the world: x to the right, and y up or, seen from above, away."""

_APART_M = 1e-9
"""Distance below which two points are one (judged: a thousandth of the smallest clearance)."""


@dataclass(frozen=True)
class LinkageLink(Described):
    """A rigid link through points, its mass spread evenly along the lines between them.

    Through three points or more the lines are closed. They are round rods with the area of the
    section or, where a mass is given, of steel and as thick as that demands: that adds r^2/4 to the
    L^2/12 of a thin rod, much for a short heavy crank. A link at a single point, such as a slider,
    is a cube.

    Raises:
        JointplayError: no points, neither mass nor section, a number that cannot be.
    """

    points: tuple[str, ...]
    """Names of the points that the link joins."""
    mass: OptionalQuantity = quantity("kg", default=None, above=0.0)
    """Mass; if not given, that of the section."""
    centre: tuple[float, ...] | None = quantity("m", default=None)
    """Centre of mass in the drawing; if not given, that of the lines."""
    inertia: OptionalQuantity = quantity("kg*m^2", default=None, above=0.0)
    """Moment of inertia about the centre of mass and the normal of the plane, or the largest
    principal moment in a spatial linkage; if not given, that of the lines."""
    section: str | None = None
    """Section: ``"tube 20x2 mm"``, ``"rod 8 mm"``, ``"box 30x20x2 mm"`` or ``"bar 20x5 mm"``."""
    material: Material = field(default_factory=lambda: material("carbon-steel"))
    """Material of the section, with a density."""

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
        if self.mass is not None and self.section is not None:
            raise JointplayError("give a mass or a section, not both", ("section",))
        if self.mass is None and (self.section is None or len(self.points) == 1):
            way = "a mass" if len(self.points) == 1 else "a mass, or a section"
            raise JointplayError(f"a link needs {way}", ("mass",))


@dataclass(frozen=True)
class LinkageSlider(Described):
    """A joint in which a link slides straight, without turning, on the ground or another link."""

    link: str
    """The link that slides."""
    along: tuple[float, ...] = quantity("")
    """Direction of sliding in the drawing."""
    on: str = GROUND
    """The link on which it slides."""

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "along", tuple(self.along))
        if not np.any(self.along):
            raise JointplayError("along has no direction", ("along",))


class Edge(NamedTuple):
    """A joint between two links of a linkage."""

    name: str
    kind: str
    """`PIN`, `SLIDE` or `BALL`."""
    bearing: str
    journal: str
    point: str
    axis: np.ndarray
    """Direction of turning or sliding, in the drawing."""


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
    """Places of the points by name: two coordinates each, or three in a spatial linkage."""
    ground: tuple[str, ...]
    """Points that stand still."""
    links: dict[str, LinkageLink]
    """Links by name."""
    sliders: dict[str, LinkageSlider] = field(default_factory=dict)
    """Joints that slide, by name."""
    axes: dict[str, list[float]] = quantity("", default_factory=dict)
    """Directions of the pins of a spatial linkage, by point; z if not given."""
    balls: tuple[str, ...] = ()
    """Points of a spatial linkage with a ball instead of a pin."""
    output: str = ""
    """Link or point whose error is reported. If not given: the last of the links that turn or slide
    on the ground, where there are several; else the last point that belongs to one link alone."""
    plane: str = choice("plane", list(PLANES), default="vertical")
    """Plane of a planar linkage's drawing: ``vertical`` (y up, against gravity) or ``horizontal``;
    a spatial linkage has its z up."""

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
            if np.linalg.norm(self.place(first) - self.place(second)) < _APART_M:
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
        for name, axis in self.axes.items():
            if not np.any(self.vector(axis, "axes", name)):
                raise JointplayError("an axis without a direction", ("axes", name))
        used = {point for link in self.links.values() for point in link.points}
        idle = next((point for point in self.points if point not in used), None)
        if idle is not None:
            raise JointplayError(f"no link has the point {idle!r}", ("points", idle))
        for name, link in self.links.items():
            if name == GROUND:
                raise JointplayError(
                    "the ground is no link; its points are `ground`", ("links", name)
                )
            for point in link.points:
                require_known("point", point, self.points, where=("links", name, "points"))
            self.vector(link.centre or self.points[link.points[0]], "links", name, "centre")
        for name, slider in self.sliders.items():
            require_known("link", slider.link, self.links, where=("sliders", name, "link"))
            require_known("link", slider.on, [GROUND, *self.links], where=("sliders", name, "on"))
            self.vector(slider.along, "sliders", name, "along")
        if self.output:
            require_known("output", self.output, [*self.links, *self.carried], where=("output",))
        if not self.ground and all(slider.on != GROUND for slider in self.sliders.values()):
            raise JointplayError("nothing stands still: name a point that does", ("ground",))
        names = [edge.name for edge in self.edges]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise JointplayError(f"two joints are called {twice!r}", ("sliders", twice))

    @property
    def spatial(self) -> bool:
        return any(len(place) == 3 for place in self.points.values())

    def vector(self, components: Sequence[float], *where: str) -> np.ndarray:
        """A vector of the drawing with three components, from two (planar) or three (spatial)."""
        count = 3 if self.spatial else 2
        if len(components) != count:
            raise JointplayError(f"give {count} components, got {list(components)}", where)
        return np.array([*components, 0.0][:3])

    def place(self, point: str) -> np.ndarray:
        return self.vector(self.points[point], "points", point)

    @property
    def carried(self) -> dict[str, str]:
        """Points that move, which become frames of the tree, and the first link with each."""
        frames = {}
        for point in self.points:
            links = [name for name, link in self.links.items() if point in link.points]
            if links and point not in (*self.ground, *self.links, GROUND):
                frames[point] = links[0]
        return frames

    @property
    def traced(self) -> list[str]:
        """Points that one link of several points has for itself, such as a coupler point."""
        shared = [point for link in self.links.values() for point in link.points]
        return [
            point
            for point, link in self.carried.items()
            if shared.count(point) == 1 and len(self.links[link].points) > 1
        ]

    @property
    def tool_reason(self) -> str:
        """Why `tool` is that frame; empty if `output` names it."""
        return "" if self.output else "the linkage names no output"

    @property
    def tool(self) -> str:
        """Name of the frame whose motion is reported; see `output`."""
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
                name, SLIDE, slider.on, slider.link, self.links[slider.link].points[0],
                self.vector(slider.along),
            )
            for name, slider in self.sliders.items()
        ]  # fmt: skip
        for point in self.points:
            carrier, *others = [
                *([GROUND] if point in self.ground else []),
                *(name for name, link in self.links.items() if point in link.points),
            ]
            axis = self.vector(self.axes[point], "axes", point) if point in self.axes else (0, 0, 1)
            for link in others:
                joints.append(
                    Edge(
                        point if len(others) == 1 else f"{point}_{link}",
                        BALL if point in self.balls else PIN,
                        carrier, link, point, np.array(axis, float),
                    )
                )  # fmt: skip
        return joints

    @property
    def size(self) -> float:
        """Largest extent of the drawing [m]; 1 m if it has a single point."""
        places = np.array([self.place(point) for point in self.points])
        return float(np.ptp(places, axis=0).max()) or 1.0

    def lines(self, link: LinkageLink) -> list[tuple[np.ndarray, np.ndarray]]:
        """Lines of a link from point to point, closed if it has three or more."""
        places = [self.place(point) for point in link.points]
        return list(pairwise(places + places[:1] * (len(places) > 2)))
