"""Linkages given by points, compared with numbers of other programs.

Thirteen linkages of textbooks and test problems are drawn with `jp.Linkage`. Compared with each are
its output over the motion (closed forms), peak force of the loose pin if it were ideal and moment
or force of its drives (`plane_bodies`: absolute coordinates, Newton and Euler), the worst case of
its output with play (kinematics with the journal moved around its bore), and where it is short, a
run with play (`plane_bodies` with Hertz's contact, integrated by scipy; Exudyn's path of a journal,
recorded). Differences are relative to the largest value of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from common import Benchmark
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from truth.plane_bodies import GRAVITY, STEEL, Body, Plane
from truth.validation.data import read

import jointplay as jp
from jointplay.accuracy.poses import along_motion
from jointplay.base.progress import ProgressBar

YOUNG_PA, POISSON = 207e9, 0.3
PLAY_M, BORE_M = 1e-5, 8e-3
"""Radial clearance of budgets: small, for they are of the first order; radius of bores."""
STEPS = 4000
"""Of a run, 40 records."""
POSES = 9
"""At which worst cases are compared."""
QUICK = ("slider-crank", "four-bar", "RSSR")
WITH_PLAY = {"slider-crank": (1e-4, 0.01), "four-bar": (1e-4, 0.01)}
"""Radial clearance [m] and duration [s] of runs with play: the first impacts, before chaos."""
Places = Mapping[str, Any]


@dataclass(frozen=True)
class Drawing:
    """A plane linkage, what drives it [rad/s or m/s] for how long [s], and what is looked at."""

    points: Mapping[str, complex]
    ground: tuple[str, ...]
    links: Mapping[str, tuple[str, float]]
    """Points, a letter each, and mass [kg]."""
    drives: Mapping[str, float]
    duration: float
    loose: str
    """Pin with play."""
    output: str
    closed: Callable[[Places, np.ndarray], np.ndarray]
    """Output by the drawing's points and the positions of drives (n, drives): a place, or of a link
    on a pivot an angle."""
    sliders: Mapping[str, tuple[str, complex, str]] = field(default_factory=dict)
    """Link, direction, and the link on which it slides."""

    def linkage(self) -> jp.Linkage:
        return jp.Linkage(
            points={name: (z.real, z.imag) for name, z in self.points.items()},
            ground=self.ground,
            links={
                name: jp.LinkageLink(tuple(points), mass=mass)
                for name, (points, mass) in self.links.items()
            },
            sliders={
                name: jp.LinkageSlider(link, (along.real, along.imag), on)
                for name, (link, along, on) in self.sliders.items()
            },
            output=self.output,
        )

    def plane(self, cut: str = "") -> Plane:
        """The same as the reference has it, its joints found anew."""
        bodies = {
            name: Body.of_lines(mass, [self.points[point] for point in points])
            for name, (points, mass) in self.links.items()
        }
        pins = {}
        for point, place in self.points.items():
            there = [name for name, (points, _) in self.links.items() if point in points]
            first, *others = [None, *there] if point in self.ground else there
            for link in others:
                name = point if len(others) == 1 else f"{point}_{link}"
                pins[name] = (first, str(link), place)
        slides = {
            name: (None if on == "ground" else on, link, self.points[self.links[link][0][0]], along)
            for name, (link, along, on) in self.sliders.items()
        }
        return Plane(bodies, pins, slides, list(self.drives), cut)

    def motion(self) -> jp.Motion:
        ends = [[0.0] * len(self.drives), [s * self.duration for s in self.drives.values()]]
        return jp.Motion(list(self.drives), [0, self.duration], ends, "constant-speed")

    @property
    def turns(self) -> bool:
        """Whether the output is the angle of a link on a pivot."""
        points, _ = self.links.get(self.output, ("", 0.0))
        return any(point in self.ground for point in points)

    def seen(self, plane: Plane, q: np.ndarray) -> complex:
        """The output in the reference: an angle, or a place."""
        if self.turns:
            return complex(plane.frame(q, self.output)[1])
        if self.output in self.links:
            return plane.place(q, self.output, self.points[self.links[self.output][0][0]])
        link = next(n for n, (points, _) in self.links.items() if self.output in points)
        return plane.place(q, link, self.points[self.output])

    def driven(self, times: np.ndarray) -> np.ndarray:
        return np.outer(times, list(self.drives.values()))


def meet(points: Places, name: str, first: str, second: str, a: Any, b: Any) -> Any:
    """Where a point is that keeps its distances from two that are at `a` and `b` now."""
    one, two, point = points[first], points[second], points[name]
    side = np.sign(((point - one) / (two - one)).imag)
    near, far, apart = abs(point - one), abs(point - two), np.abs(b - a)
    along = (apart**2 + near**2 - far**2) / (2 * apart)
    return a + (b - a) / apart * (along + 1j * side * np.sqrt(near**2 - along**2))


def carried(points: Places, name: str, first: str, second: str, a: Any, b: Any) -> Any:
    """Where a point of a body is, two other points of which are at `a` and `b` now."""
    return a + (points[name] - points[first]) * (b - a) / (points[second] - points[first])


def turned(points: Places, name: str, about: str, angle: np.ndarray) -> np.ndarray:
    return points[about] + (points[name] - points[about]) * np.exp(1j * angle)


def angle_of(vector: np.ndarray, drawn: complex) -> np.ndarray:
    return np.unwrap(np.angle(vector / drawn))


def slider_crank(p: Places, driven: np.ndarray) -> np.ndarray:
    crank, rod, angle = abs(p["A"]), abs(p["B"] - p["A"]), driven[:, 0]
    return crank * np.cos(angle) + np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2) + 0j


def four_bar(p: Places, driven: np.ndarray) -> np.ndarray:
    tip = meet(p, "B", "A", "C", turned(p, "A", "O", driven[:, 0]), p["C"])
    return angle_of(tip - p["C"], p["B"] - p["C"])


def quick_return(p: Places, driven: np.ndarray) -> np.ndarray:
    """The lever points to the crank's pin; the rod reaches to the ram's line."""
    way = turned(p, "A", "O", driven[:, 0]) - p["C"]
    tip = p["C"] + (p["D"] - p["C"]) * way / np.abs(way) / np.exp(1j * np.angle(p["A"] - p["C"]))
    height = p["E"].imag - tip.imag
    return tip.real + np.sqrt(abs(p["E"] - p["D"]) ** 2 - height**2) + 1j * p["E"].imag


def scotch_yoke(p: Places, driven: np.ndarray) -> np.ndarray:
    return p["Y"] + abs(p["A"]) * (np.cos(driven[:, 0]) - 1)


def cylinder(p: Places, driven: np.ndarray) -> np.ndarray:
    return angle_of(turned(p, "A", "O", driven[:, 0]) - p["C"], p["A"] - p["C"])


def jansen(p: Places, driven: np.ndarray) -> np.ndarray:
    crank = turned(p, "A", "O", driven[:, 0])
    upper, lower = (meet(p, name, "A", "C", crank, p["C"]) for name in "BE")
    wing = carried(p, "D", "C", "B", p["C"], upper)
    knee = meet(p, "F", "D", "E", wing, lower)
    return carried(p, "G", "F", "E", knee, lower)


def pantograph(p: Places, driven: np.ndarray) -> np.ndarray:
    """The pen draws the tracer's way, larger by the ratio of the arms."""
    first = driven[:, 0]
    tracer = p["F"] + (p["A"] - p["F"]) * np.exp(1j * first)
    tracer += (p["E"] - p["A"]) * np.exp(1j * (first + driven[:, 1]))
    return p["F"] + (tracer - p["F"]) * abs(p["B"] - p["F"]) / abs(p["A"] - p["F"])


def five_bar(p: Places, driven: np.ndarray) -> np.ndarray:
    left, right = turned(p, "A", "O", driven[:, 0]), turned(p, "B", "C", driven[:, 1])
    return meet(p, "P", "A", "B", left, right)


def trammel(p: Places, driven: np.ndarray) -> np.ndarray:
    """An ellipse: the ends of the bar stay on two lines."""
    across = p["A"].real + driven[:, 0]
    up = np.sqrt(abs(p["B"] - p["A"]) ** 2 - across**2)
    share = abs(p["P"] - p["B"]) / abs(p["A"] - p["B"])
    return share * across + 1j * (1 - share) * up


def press(p: Places, driven: np.ndarray) -> np.ndarray:
    knee = meet(p, "K", "A", "C", turned(p, "A", "O", driven[:, 0]), p["C"])
    aside = knee.real - p["R"].real
    down = np.sqrt(abs(p["R"] - p["K"]) ** 2 - aside**2)
    return p["R"].real + 1j * (knee.imag - down)


def watt(p: Places, driven: np.ndarray) -> np.ndarray:
    tip = meet(p, "B", "A", "C", turned(p, "A", "O", driven[:, 0]), p["C"])
    arm = carried(p, "D", "C", "B", p["C"], tip)
    end = meet(p, "E", "D", "G", arm, p["G"])
    return angle_of(end - p["G"], p["E"] - p["G"])


def jansen_points() -> dict[str, complex]:
    """Jansen's eleven numbers (docs/gallery/jansen.urdf has their source), 2 mm a unit."""
    a, b, c, d, e, f, g, h, i, j, k, low, m = 2e-3 * np.array(
        [38, 41.5, 39.3, 40.1, 55.8, 39.4, 36.7, 65.7, 49, 50, 61.9, 7.8, 15]
    )

    def cross(one: complex, near: float, two: complex, far: float, side: int) -> complex:
        apart = abs(two - one)
        along = (apart**2 + near**2 - far**2) / (2 * apart)
        return one + (two - one) / apart * (along + side * 1j * math.sqrt(near**2 - along**2))

    points = {"O": 0j, "A": complex(m), "C": complex(-a, -low)}
    points["B"] = cross(points["A"], j, points["C"], b, -1)
    points["E"] = cross(points["A"], k, points["C"], c, 1)
    points["D"] = cross(points["B"], e, points["C"], d, -1)
    points["F"] = cross(points["D"], f, points["E"], g, -1)
    points["G"] = cross(points["F"], h, points["E"], i, -1)
    return points


DRAWINGS = {
    "slider-crank": Drawing(
        {"O": 0, "A": 0.05, "B": 0.17}, ("O",),
        {"crank": ("OA", 0.3), "rod": ("AB", 0.21), "slider": ("B", 0.14)},
        {"O": 20 * math.pi}, 0.1, "B", "slider", slider_crank, {"guide": ("slider", 1, "ground")},
    ),
    "four-bar": Drawing(
        {"O": 0, "A": 0.04, "B": 0.1 + 0.1j, "C": 0.15, "P": 0.06 + 0.09j}, ("O", "C"),
        {"crank": ("OA", 0.05), "coupler": ("ABP", 0.2), "rocker": ("BC", 0.15)},
        {"O": 10 * math.pi}, 0.2, "B", "rocker", four_bar,
    ),
    "quick-return": Drawing(
        {"O": 0, "A": 0.06, "C": -0.15j, "D": 0.07428 + 0.0357j, "E": 0.2 + 0.06j}, ("O", "C"),
        {"crank": ("OA", 0.5), "block": ("A", 0.1), "lever": ("CD", 0.8), "rod": ("DE", 0.3),
         "ram": ("E", 1.0)},
        {"O": 2 * math.pi}, 1.0, "D", "ram", quick_return,
        {"slot": ("block", 2 + 5j, "lever"), "guide": ("ram", 1, "ground")},
    ),
    "Scotch yoke": Drawing(
        {"O": 0, "A": 0.04, "Y": 0.1}, ("O",),
        {"crank": ("OA", 0.2), "block": ("A", 0.05), "yoke": ("Y", 0.6)},
        {"O": 4 * math.pi}, 0.5, "A", "yoke", scotch_yoke,
        {"slot": ("block", 1j, "yoke"), "guide": ("yoke", 1, "ground")},
    ),
    "oscillating cylinder": Drawing(
        {"O": 0, "A": 0.05, "R": 0.09 - 0.04j, "C": 0.2 - 0.15j}, ("O", "C"),
        {"crank": ("OA", 0.2), "rod": ("AR", 0.3), "cylinder": ("C", 0.8)},
        {"O": 4 * math.pi}, 0.5, "A", "cylinder", cylinder,
        {"bore": ("rod", 1 - 1j, "cylinder")},
    ),
    "Watt six-bar": Drawing(
        {"O": 0, "A": 0.04, "B": 0.1 + 0.1j, "C": 0.15, "D": 0.19 + 0.06j, "E": 0.28 + 0.09j,
         "G": 0.3}, ("O", "C", "G"),
        {"crank": ("OA", 0.05), "coupler": ("AB", 0.2), "rocker": ("BCD", 0.3), "rod": ("DE", 0.1),
         "swing": ("EG", 0.15)},
        {"O": 6 * math.pi}, 1 / 3, "E", "swing", watt,
    ),
    "Jansen leg": Drawing(
        jansen_points(), ("O", "C"),
        {"crank": ("OA", 0.05), "upper": ("AB", 0.05), "lower": ("AE", 0.06),
         "rocker": ("CBD", 0.08), "link": ("CE", 0.04), "coupler": ("DF", 0.04),
         "leg": ("EFG", 0.1)},
        {"O": 2 * math.pi}, 1.0, "F", "G", jansen,
    ),
    "pantograph": Drawing(
        {"F": 0, "A": 0.1j, "B": 0.25j, "E": 0.08 + 0.06j, "D": 0.08 + 0.21j,
         "P": 0.2 + 0.15j}, ("F",),
        {"arm": ("FAB", 0.2), "pen": ("BDP", 0.2), "short": ("AE", 0.1), "link": ("ED", 0.1)},
        {"F": -0.5, "A": 0.8}, 0.6, "D", "P", pantograph,
    ),
    "five-bar": Drawing(
        {"O": 0, "A": -0.08 + 0.1j, "P": 0.06 + 0.24j, "B": 0.2 + 0.1j, "C": 0.12},
        ("O", "C"),
        {"left": ("OA", 0.1), "right": ("CB", 0.1), "one": ("AP", 0.12), "other": ("PB", 0.12)},
        {"O": -1.5, "C": 1.0}, 0.5, "B", "P", five_bar,
    ),
    "elliptic trammel": Drawing(
        {"A": 0.16, "B": 0.12j, "P": 0.04 + 0.09j}, (),
        {"across": ("A", 0.2), "up": ("B", 0.2), "bar": ("APB", 0.3)},
        {"row": -0.5}, 0.6, "B", "P", trammel,
        {"row": ("across", 1, "ground"), "column": ("up", 1j, "ground")},
    ),
    "toggle press": Drawing(
        {"O": -0.3, "A": -0.26, "K": -0.05, "C": 0.2j, "R": -0.2j}, ("O", "C"),
        {"crank": ("OA", 0.3), "rod": ("AK", 0.4), "upper": ("KC", 0.4), "lower": ("KR", 0.4),
         "ram": ("R", 2.0)},
        {"O": 4 * math.pi}, 0.5, "R", "ram", press, {"guide": ("ram", 1j, "ground")},
    ),
}  # fmt: skip


@dataclass
class Compared:
    """Figures of a linkage: what, the package's, the other's and where that is from."""

    rows: list[dict[str, Any]] = field(default_factory=list)

    def add(self, what: str, ours: Any, theirs: Any, by: str, scale: float | None = None) -> None:
        """The largest difference over the largest of theirs, or over `scale`."""
        size = float(np.abs(theirs).max()) if scale is None else scale
        apart = float(np.abs(np.asarray(ours) - theirs).max()) / size
        self.rows.append({"what": what, "largest": size, "difference": apart, "by": by})


def output_of(result: jp.Result, turns: bool) -> np.ndarray:
    """Where the tool is in the drawing, or which way it points [rad]."""
    if turns:  # the drawing stands upright, a quarter turn about x
        w, _, _, z = result["tool_orientation"].values.T
        return np.unwrap(2.0 * np.arctan2(z, w), period=2.0 * np.pi)
    place = result["tool_position"].values
    return place[:, 0] + 1j * place[:, 2]


def ideal(drawing: Drawing, compared: Compared) -> None:
    """Output, the loose pin's force were it ideal, and what the drives give."""
    result = jp.simulate(
        jp.Mechanism(drawing.linkage()),
        drawing.motion(),
        drive={name: jp.loads.Prescribed() for name in drawing.drives},
        step=drawing.duration / STEPS,
        integrator="rk4",
        record_every=STEPS // 40,
        estimate=False,
    )
    driven = drawing.driven(result.time)
    found = drawing.closed(drawing.points, driven)
    ours = output_of(result, drawing.turns)
    spread = float(np.abs(found - found[0]).max())
    compared.add("output", ours - ours[0], found - found[0], "closed form", spread)
    plane, q = drawing.plane(), np.zeros(3 * len(drawing.links))
    held, effort = [], []
    for row in driven:
        q = plane.closed(q, row)
        forces = plane.balance(q, plane.speeds(q, list(drawing.drives.values())))[1]
        held.append(abs(plane.force(forces, drawing.loose)))
        effort.append(forces[plane.first_drive :])
    pins = result["reaction_force"].sel(moving_joint=drawing.loose).values
    compared.add("pin force", np.linalg.norm(pins, axis=1), np.array(held), "Newton-Euler")
    at = [result.simulation.mechanism.coordinate(name) for name in drawing.drives]
    compared.add("drives", result["drive"].values[:, at], np.array(effort), "Newton-Euler")


def farthest(drawing: Drawing, plane: Plane, q: np.ndarray, driven: np.ndarray) -> float:
    """How far the output is off where the loose pin's journal is anywhere on its bore."""
    centre = drawing.seen(plane, q)

    def less(way: float) -> float:
        aside = {drawing.loose: PLAY_M * np.exp(1j * way)}
        return -abs(drawing.seen(plane, plane.closed(q, driven, aside)) - centre)

    ways = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    best = min(ways, key=less)
    near = (best - ways[1], best + ways[1])
    return -float(minimize_scalar(less, bounds=near, method="bounded").fun)


def pin(clearance: float) -> jp.RevoluteClearance:
    """Elastic, without friction."""
    return jp.RevoluteClearance.planar(
        radial_clearance=clearance, bearing_radius=BORE_M, bearing_length=0.02, restitution=1.0,
        bearing_material=jp.Material(YOUNG_PA, POISSON),
        journal_material=jp.Material(YOUNG_PA, POISSON),
        normal=jp.contact.Hertz(), friction=jp.contact.Coulomb(0.0, 0.01),
    )  # fmt: skip


def worst_case(drawing: Drawing, compared: Compared, poses: int) -> None:
    mechanism = jp.Mechanism(drawing.linkage(), {drawing.loose: pin(PLAY_M)})
    q = along_motion(mechanism, drawing.motion(), poses)
    found = jp.budget(mechanism, q, driven=list(drawing.drives))
    plane, place, corners = drawing.plane(), np.zeros(3 * len(drawing.links)), []
    between = 8  # Newton's method starts near
    times = np.linspace(0.0, drawing.duration, between * (len(q) - 1) + 1)
    for k, row in enumerate(drawing.driven(times)):
        place = plane.closed(place, row)
        if k % between == 0:
            corners.append(farthest(drawing, plane, place, row))
    compared.add("worst case", found.worst, np.array(corners), "kinematics, journal on its bore")


def run_with_play(drawing: Drawing, compared: Compared, clearance: float, until: float) -> None:
    """Path and force of a journal that begins in the middle of its bore."""
    result = jp.simulate(
        jp.Mechanism(drawing.linkage(), {drawing.loose: pin(clearance)}),
        drawing.motion(),
        drive={name: jp.loads.Prescribed() for name in drawing.drives},
        step=2e-7, integrator="rk4", record_every=25, duration=until, start="centred",
        estimate=False,
    )  # fmt: skip
    compliance = 2 * (1 - POISSON**2) / YOUNG_PA
    stiffness = 4 / (3 * compliance) * math.sqrt(BORE_M * (BORE_M - clearance) / clearance)

    def contact(offset: complex) -> complex:
        depth = abs(offset) - clearance
        return -stiffness * max(depth, 0.0) ** 1.5 * offset / max(abs(offset), 1e-12)

    whole, plane = drawing.plane(), drawing.plane(drawing.loose)
    q = np.zeros(3 * len(drawing.links))
    v = whole.speeds(q, list(drawing.drives.values()))
    states = plane.runs(q, v, result.time, contact)
    bearing, journal, point = plane.pins[drawing.loose]
    offsets = np.array(
        [
            (plane.place(q, journal, point) - plane.place(q, bearing, point))
            for q in states[:, : len(q)]
        ]
    )
    x, y = result["journal_centre"].values[:, 0, :2].T
    compared.add("journal's distance", np.hypot(x, y), np.abs(offsets), "scipy, Hertz", clearance)
    force = np.array([abs(contact(offset)) for offset in offsets])
    ours = np.linalg.norm(result["joint_force"].values[:, 0], axis=1)
    compared.add("peak force", ours.max(), force.max(), "scipy, Hertz")


def exudyn(compared: Compared, until: float) -> None:
    """The slider-crank of the validation at 5000 rpm, drawn: Exudyn's own elastic contact."""
    clearance = 0.2e-3
    linkage = jp.Linkage(
        points={"O": (0, 0), "A": (0.05, 0), "B": (0.17, 0)},
        ground=["O"],
        links={
            "crank": jp.LinkageLink(["O", "A"], mass=0.3, inertia=1e-4),
            "rod": jp.LinkageLink(["A", "B"], mass=0.21, inertia=2.5e-4),
            "slider": jp.LinkageLink(["B"], mass=0.14),
        },
        sliders={"guide": jp.LinkageSlider("slider", (1, 0))},
    )
    joint = jp.RevoluteClearance.planar(
        radial_clearance=clearance, bearing_radius=0.01, bearing_length=0.02, restitution=1.0,
        friction=jp.contact.Coulomb(0.0, 0.01),
    )  # fmt: skip
    speed = 5000 * 2 * math.pi / 60
    result = jp.simulate(
        jp.Mechanism(linkage, {"B": joint}, gravity=(0, 0, 0)),
        jp.Motion(["O"], [0, 1e-2], [[0], [1e-2 * speed]], "constant-speed"),
        drive={"O": jp.loads.Prescribed()},
        step=1e-7, integrator="rk4", record_every=100, duration=until, start="centred",
        estimate=False,
    )  # fmt: skip
    data, _ = read("engines_slider_crank.csv")
    at = data["time"] <= result.time[-1] + 1e-12
    theirs = np.hypot(data["exudyn_x"], data["exudyn_y"])[at]
    path = result["journal_centre"].values[:, 0, :2]
    ours = np.interp(data["time"][at], result.time, np.hypot(*path.T) / clearance)
    compared.add("journal's distance", ours, theirs, "Exudyn, recorded", 1.0)


def spatial(compared: Compared, poses: int) -> None:
    """RSSR: the rod's length closes it; the crank's moment is the change of energy by its angle."""
    crank, axis, height, arm, speed = 0.03, 0.1, 0.12, 0.1, 4 * math.pi
    masses = {"crank": 0.1, "rod": 0.2, "rocker": 0.3}
    points = {"O": (0, 0, 0), "A": (crank, 0, 0), "B": (axis, arm, height), "C": (axis, 0, height)}
    linkage = jp.Linkage(
        points=points, ground=["O", "C"], balls=["A", "B"], axes={"C": (1, 0, 0)},
        links={n: jp.LinkageLink(e, mass=masses[n]) for n, e in
               {"crank": ("O", "A"), "rod": ("A", "B"), "rocker": ("B", "C")}.items()},
        output="rocker",
    )  # fmt: skip
    length = math.dist(points["A"], points["B"])

    def rocker(angle: np.ndarray, rod: float = length) -> np.ndarray:
        """y sin and z cos of the rocker's end: P cos + Q sin = R, near the drawing."""
        x, y = crank * np.cos(angle), crank * np.sin(angle)
        p, q = -2 * arm * y, 2 * arm * height + 0 * angle
        r = rod**2 - (axis - x) ** 2 - y**2 - height**2 - arm**2
        return np.arctan2(q, p) - np.arccos(r / np.hypot(p, q))

    motion = jp.Motion(["O"], [0, 0.5], [[0], [2 * math.pi]], "constant-speed")
    result = jp.simulate(
        jp.Mechanism(linkage), motion, drive={"O": jp.loads.Prescribed()}, step=0.5 / STEPS,
        integrator="rk4", record_every=STEPS // 40, estimate=False,
    )  # fmt: skip
    angle, model = speed * result.time, result.simulation.mechanism
    found = rocker(angle)
    ours = result["q"].values[:, model.coordinate("C")]
    compared.add("output", ours, found, "closed form", float(np.ptp(found)))

    h = 1e-4  # s, of differences of the fourth order

    def energy(time: np.ndarray) -> np.ndarray:
        def ends(at: np.ndarray) -> np.ndarray:
            turn, swing = speed * at, rocker(speed * at)
            still = np.zeros_like(at)
            near = crank * np.array([np.cos(turn), np.sin(turn), still])
            return np.array(
                [near, [axis + still, arm * np.cos(swing), height + arm * np.sin(swing)]]
            )

        def rate(at: np.ndarray) -> np.ndarray:
            return (8 * (ends(at + h) - ends(at - h)) - ends(at + 2 * h) + ends(at - 2 * h)) / (
                12 * h
            )

        (a, b), (va, vb) = ends(time), rate(time)
        thick = {
            n: masses[n] / (STEEL * size) / math.pi / 4
            for n, size in {"rod": length, "rocker": arm}.items()
        }
        along = np.sum((va - vb) ** 2, axis=0)
        rod = np.sum(va * va + va * vb + vb * vb, axis=0) / 3 + thick["rod"] * along / length**2
        swing = np.sum(vb * vb, axis=0) * (1 / 3 + thick["rocker"] / arm**2)
        kinetic = (masses["rod"] * rod + masses["rocker"] * swing) / 2
        up = masses["rod"] * (a[2] + b[2]) / 2 + masses["rocker"] * (b[2] + height) / 2
        return kinetic + GRAVITY * up

    t = result.time
    power = (8 * (energy(t + h) - energy(t - h)) - energy(t + 2 * h) + energy(t - 2 * h)) / (12 * h)
    ours = result["drive"].values[:, model.coordinate("O")]
    compared.add("drives", ours, power / speed, "energy by hand")
    ball = jp.SphericalClearance(radial_clearance=PLAY_M, bearing_radius=BORE_M)
    mechanism = jp.Mechanism(linkage, {"B": ball})
    q = along_motion(mechanism, motion, poses)
    budget = jp.budget(mechanism, q, driven=["O"])
    turn = np.linspace(0, 2 * math.pi, len(q))
    corners = [np.abs(rocker(turn, length + play) - rocker(turn)) for play in (PLAY_M, -PLAY_M)]
    compared.add("worst case", budget.worst, np.max(corners, axis=0), "closed form, rod longer")


def double_four_bar(compared: Compared) -> None:
    """Five rods of 1 m and 1 kg, as two squares in a row, swing freely from 45 deg."""
    lean = np.exp(0.75j * math.pi) * -1j  # of the three rockers, hanging at 1.25 pi
    points = {"O": 0j, "C": 1 + 0j, "G": 2 + 0j}
    points |= {top: points[foot] - 1j * lean for top, foot in zip("ABE", "OCG", strict=True)}
    rods = {"left": "OA", "middle": "CB", "right": "GE", "one": "AB", "other": "BE"}
    drawing = Drawing(
        points, ("O", "C", "G"), {name: (ends, 1.0) for name, ends in rods.items()}, {}, 1.0, "E",
        "right", four_bar,
    )  # fmt: skip
    result = jp.simulate(
        jp.Mechanism(drawing.linkage()), drive={"O": jp.loads.Free()}, duration=1.0,
        step=1 / STEPS, integrator="rk4", record_every=STEPS // 40, estimate=False,
    )  # fmt: skip
    begin = float(np.angle(points["A"]))
    # Three rods turn (1/3 kg m^2 each and half a metre), two move along with their ends.
    slim = 1 / 3 + 1 / (STEEL * 4 * math.pi)
    solved = solve_ivp(
        lambda _, s: [s[1], -3.5 * GRAVITY * np.cos(s[0]) / (3 * slim + 2)], (0, 1.0), [begin, 0.0],
        "DOP853", result.time, rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    swing, rate = solved.y
    ours = output_of(result, True)
    compared.add("output", ours - ours[0], swing - begin, "one pendulum, scipy")
    plane = drawing.plane()
    q, held = np.zeros(15), []
    for angle, turning in zip(swing, rate, strict=True):
        v = np.zeros(15)
        for k, (name, ends) in enumerate(rods.items()):
            now, about = angle - begin, points[ends[0]]
            foot = about if name in ("left", "middle", "right") else 0j
            if foot or name == "left":
                shift, spin = foot * (1 - np.exp(1j * now)), now
                change, w = -1j * turning * np.exp(1j * now) * foot, turning
            else:
                shift, spin, w = (points["A"]) * (np.exp(1j * now) - 1), 0.0, 0.0
                change = 1j * turning * np.exp(1j * now) * points["A"]
            q[3 * k : 3 * k + 3] = shift.real, shift.imag, spin
            v[3 * k : 3 * k + 3] = change.real, change.imag, w
        held.append(abs(plane.force(plane.balance(q, v)[1], "E")))
    pins = result["reaction_force"].sel(moving_joint="E").values
    compared.add("pin force", np.linalg.norm(pins, axis=1), np.array(held), "Newton-Euler")


def main() -> None:
    benchmark = Benchmark("linkages", __doc__, runs=0, only=("", "linkages with this in the name"))
    args = benchmark.parse()
    names = [*DRAWINGS, "RSSR", "double four-bar"]
    if args.quick:
        names = [name for name in names if name in QUICK]
    poses = 3 if args.quick else POSES
    rows = []
    for name in ProgressBar([n for n in names if args.only in n], "linkages", unit="linkage"):
        compared = Compared()
        if name == "RSSR":
            spatial(compared, poses)
        elif name == "double four-bar":
            double_four_bar(compared)
        else:
            ideal(DRAWINGS[name], compared)
            worst_case(DRAWINGS[name], compared, poses)
        if name == "slider-crank":
            exudyn(compared, 3e-4 if args.quick else 1e-3)
        if name in WITH_PLAY:
            clearance, until = WITH_PLAY[name]
            run_with_play(DRAWINGS[name], compared, clearance, until)
        rows += [{"linkage": name} | row for row in compared.rows]
    table = [
        [
            row["linkage"],
            row["what"],
            f"{row['largest']:.4g}",
            f"{row['difference']:.1e}",
            row["by"],
        ]
        for row in rows
    ]
    benchmark.finish(["linkage", "figure", "largest", "difference over largest", "by"], table, rows)
    worst = 100 * max(row["difference"] for row in rows)
    models = len({row["linkage"] for row in rows})
    print(f"models {models}, compared with others' numbers {len(rows)}, worst {worst:.2g} %")


if __name__ == "__main__":
    main()
