"""Workspace and play of the gallery's parallel robots, compared with published figures.

Writes the tables of docs/gallery/README.md.
"""

from __future__ import annotations

import math

import numpy as np
from common import command
from pictures.gallery import put

import jointplay as jp
from jointplay.accuracy import budget
from jointplay.base.tables import Table
from jointplay.simulation.motion import cartesian_motion, reachable

REPEATABILITY_MM = 0.1  # of an ABB IRB 360, as its data sheet has it
DIAMETER_MM = 1600.0  # of the working range of an IRB 360-1/1600, as its data sheet has it
PUBLISHED_ARMS = (
    ((0.0, 0.0, -0.9), (-20.5, -20.5, -20.5)),
    ((0.3, 0.5, -1.1), (47.5, -11.6, 21.4)),
)
"""Places of the tool [m] and angles of the arms [deg] in Williams, The Delta Parallel Robot."""
ROUND = 24  # points on a circle
FINE_M = 0.01  # to which the edge of a workspace is found


def mechanism(name: str, case: str = "ideal") -> jp.Mechanism:
    return jp.Scenario.load(f"jointplay:{name}.toml").simulation(case).mechanism


def circle(radius: float, height: float) -> np.ndarray:
    angles = np.linspace(0.0, 2.0 * math.pi, ROUND, endpoint=False)
    ones = np.ones(ROUND)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), height * ones])


def whole_circle(robot: jp.Mechanism, radius: float, height: float) -> bool:
    """Whether the tool can go to the circle from its middle, and all round it."""
    ways = [circle(part * radius, height) for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
    return bool(reachable(robot, np.concatenate(ways))[-ROUND:].all())


def edge(able: object, inside: float, outside: float) -> float:
    """Where between two values something can no longer be, by halving."""
    while abs(outside - inside) > FINE_M:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if able(middle) else (inside, middle)  # type: ignore[operator]
    return inside


def delta() -> list[tuple[str, ...]]:
    robot = mechanism("delta").ideal()
    rows: list[tuple[str, ...]] = [("figure", "published", "this model", "off by")]
    for place, angles in PUBLISHED_ARMS:
        found = np.rad2deg(cartesian_motion(robot, [0, 1], [place, place]).positions[0])
        off = np.abs(found - angles).max()
        at, wanted, got = (
            ", ".join(f"{x:.{digits}f}" for x in values)
            for values, digits in ((place, 1), (angles, 1), (found, 2))
        )
        rows.append((f"arms with the tool at ({at}) m [deg]", wanted, got, f"{off:.2f}"))
    radius = edge(lambda r: whole_circle(robot, r, -1.1), 0.5, 1.2)
    over = 100.0 * (2e3 * radius / DIAMETER_MM - 1.0)
    words, size = "diameter of the working range, at z = -1.1 m [mm]", f"{DIAMETER_MM:.0f}"
    rows.append((words, size, f"{2e3 * radius:.0f}", f"{over:+.0f} %"))
    half = 0.5e-3 * DIAMETER_MM
    high, low = (edge(lambda z: whole_circle(robot, half, z), -1.1, end) for end in (-0.7, -1.5))
    reached = f"{low:.2f} to {high:.2f}"
    rows.append((f"z between which {size} mm are reached [m]", "-", reached, "-"))
    places = np.array([(0, 0, -0.95), (0.4, 0, -1.1), (-0.4, 0.4, -1.1), (0, 0, -1.2)], float)
    motion = cartesian_motion(robot, np.arange(len(places)), places)
    loose = mechanism("delta", "0.02 mm")
    poses = [dict(zip(motion.joints, row, strict=True)) for row in motion.positions]
    worst = [1e3 * float(budget(loose, pose, driven=motion.joints).worst.max()) for pose in poses]
    words = "repeatability; worst case of 0.02 mm of play in six balls, at four poses [mm]"
    found = f"{min(worst):.3f} to {max(worst):.3f}"
    allowed = f"{0.02 * REPEATABILITY_MM / max(worst):.3f} mm of play alone would take all of it"
    return [*rows, (words, f"{REPEATABILITY_MM:g}", found, allowed)]


def three_rrr(coarse: int) -> list[tuple[str, ...]]:
    """The area by reach, and that of three overlapping rings, with the platform not turned.

    Points whose reach is asked are `coarse` times as far apart.
    """
    robot = mechanism("three_rrr").ideal()
    angles = np.array([math.pi / 2, math.pi * 7 / 6, -math.pi / 6])
    centres = 0.19 * np.column_stack([np.cos(angles), np.sin(angles)])

    def inside(points: np.ndarray) -> np.ndarray:
        away = np.linalg.norm(points[:, None] - centres, axis=2)
        return np.asarray(((away < 0.34) & (away > 0.02)).all(axis=1))

    fine = np.linspace(-0.3, 0.3, 3001)
    area = 0.0
    for y in fine:
        area += inside(np.column_stack([fine, np.full_like(fine, y)])).sum()
    area *= (fine[1] - fine[0]) ** 2
    grid = np.linspace(-0.2, 0.2, 40 // coarse + 1)
    points = np.array([[x, y, 0.0] for y in grid for x in grid])
    points = points[np.argsort(np.linalg.norm(points, axis=1), kind="stable")]
    turns = np.zeros((len(points), 3))
    found = int(reachable(robot, points, turns, progress=True).sum()) * (grid[1] - grid[0]) ** 2
    off = f"{100.0 * (found / area - 1.0):+.1f} %"
    words = "area of the workspace, platform not turned [cm²]"
    head = ("figure", "three rings", "this model", "off by")
    return [head, (words, f"{1e4 * area:.0f}", f"{1e4 * found:.0f}", off)]


def main() -> None:
    parser = command(__doc__, "one robot on a coarse grid; nothing is written")
    names = ("delta", "three_rrr")
    parser.add_argument("--only", nargs="*", choices=names, default=names)
    options = parser.parse_args()
    for name in ["three_rrr"] if options.quick else options.only:
        rows = delta() if name == "delta" else three_rrr(3 if options.quick else 1)
        table = Table.of_texts(rows).markdown()
        print(table, flush=True)
        if not options.quick:
            put(f"figures: {name}", table)
