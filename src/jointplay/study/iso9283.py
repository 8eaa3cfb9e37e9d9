"""Figures of ISO 9283:1998 from simulated cycles.

Manipulating industrial robots: performance criteria and related test methods. Of the standard only
its pages of contents were seen (numbers and titles of the clauses, public previews); formulas,
conditions and numbers of cycles are from memory and from works about it. docs/iso9283.md defines
each figure; `TITLES` has the clauses. Exchangeability (7.7), path accuracy on reorientation (8.4),
path velocity (8.6) and what follows are not calculated.

Figures with a, b, c are of components in world axes of the rotation vector that turns the commanded
tool into the attained one: rotations by play are so small that the order in which the standard
would count angles does not matter.

What differs from a test of a robot: each cycle is a run of its own, whose journals begin displaced
at random; and the command pose is where the ideal mechanism under the same drives is, so that only
play counts, not the drives' lag, calibration, heat or the measurement.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import stats

from jointplay.base.errors import JointplayError, require_a, require_positive
from jointplay.base.tables import Table, aligned
from jointplay.base.units import readable
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.analysis.tool_error import Stop, rotations, stops
from jointplay.simulation.analysis.twins import ideal_simulation
from jointplay.simulation.analysis.uncertainty import IntervalEstimate
from jointplay.simulation.motion.cartesian import cartesian_path
from jointplay.simulation.motion.reference import GOES_ON, Motion
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.courses import MOST_RUNS, Trace, at_speed, errors, loaded, seeded, traces
from jointplay.study.wear import all_wearing, wear_blocks, with_worn

TITLES = {
    "AP": ("7.2.1", "pose accuracy"),
    "RP": ("7.2.2", "pose repeatability"),
    "vAP": ("7.2.3", "multi-directional pose accuracy variation"),
    "AD": ("7.3", "distance accuracy"),
    "RD": ("7.3", "distance repeatability"),
    "t": ("7.4", "position stabilization time"),
    "OV": ("7.5", "position overshoot"),
    "dAP": ("7.6", "drift of pose accuracy"),
    "dRP": ("7.6", "drift of pose repeatability"),
    "AT": ("8.2", "path accuracy"),
    "RT": ("8.3", "path repeatability"),
    "CR": ("8.5", "cornering round-off error"),
    "CO": ("8.5", "cornering overshoot"),
}
"""Clause and title of the figures, by their symbols without suffix."""
CONFIDENCE = 0.95
RESAMPLES = 999
"""Resamples of the bootstrap."""
LEAST_CYCLES = 3
"""With fewer, nothing can be said of the scatter."""
LONGEST_DRIFT_S = 3.2e9
"""Longest time over which wear is extrapolated: a hundred years [s]."""
DRIFT_CYCLES = 10
"""Cycles at each time at which a drift is looked at."""
DRIFT_TIMES = 4
"""How often it is looked at after the start."""
PATH_POINTS = 100
"""Most points along the path at which AT and RT are calculated."""
_MOVING = 0.02
"""Part of its greatest speed above which the commanded tool is on a path."""
_OTHER_WAY = math.radians(1.0)
"""From this angle on, two approaches have different directions [rad]."""
_CORNER = math.radians(15.0)
"""From this angle on a turn is a corner, up to as much short of a reversal [rad]."""
_SHORTEST_M = 1e-3
"""Way before and after a corner below which it is none [m]."""
_NEAR = 0.05
"""Part of the way before and after a corner that tells the direction."""
Figures = Mapping[str, IntervalEstimate]
"""Figures by symbol [m]; those with the suffix a, b or c are rotations about x, y and z [rad]."""
Statistic = Callable[[np.ndarray], np.ndarray]
"""Of points (..., cycles, m, 3)."""


def pose_accuracy(points: np.ndarray) -> np.ndarray:
    """Distance of the barycentre of the cycles from the command pose, at m points.

    Args:
        points: attained less commanded, shape (..., cycles, m, 3) [m].

    Returns:
        shape (..., m) [m].
    """
    return np.asarray(np.linalg.norm(points.mean(axis=-3), axis=-1))


def repeatability(points: np.ndarray) -> np.ndarray:
    """mean(l) + 3 S_l, l being distances from the barycentre; shapes as in `pose_accuracy`."""
    distance = np.linalg.norm(points - points.mean(axis=-3, keepdims=True), axis=-1)
    return np.asarray(distance.mean(axis=-2) + 3.0 * distance.std(axis=-2, ddof=1))


def variation(points: np.ndarray) -> np.ndarray:
    """Largest distance between the barycentres of m approaches, shape (...) [m]."""
    centre = points.mean(axis=-3)
    apart = centre[..., :, None, :] - centre[..., None, :, :]
    return np.asarray(np.linalg.norm(apart, axis=-1).max(axis=(-2, -1)))


def largest(statistic: Statistic) -> Statistic:
    """The statistic's largest value over the points."""
    return lambda points: np.asarray(statistic(points).max(axis=-1))


def bootstrap(points: np.ndarray, statistic: Statistic) -> IntervalEstimate:
    """A statistic over the cycles, with its interval by the bias-corrected bootstrap (BCa)."""
    value = float(statistic(points))

    def resampled(index: np.ndarray, axis: int = -1) -> np.ndarray:
        return statistic(points[index.astype(int)])

    for method in ("BCa", "percentile"):  # the first fails where all cycles are alike
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            interval = stats.bootstrap(
                (np.arange(len(points)),),
                resampled,
                n_resamples=RESAMPLES,
                batch=100,
                vectorized=True,
                confidence_level=CONFIDENCE,
                method=method,
                random_state=np.random.default_rng(0),
            ).confidence_interval
        if np.isfinite(interval.low) and np.isfinite(interval.high):
            return IntervalEstimate(value, float(interval.low), float(interval.high), len(points))
    return IntervalEstimate(value, math.nan, math.nan, len(points))


def _mean(values: np.ndarray) -> np.ndarray:
    return np.asarray(values.mean(axis=-1))


def _scatter(values: np.ndarray) -> np.ndarray:
    return np.asarray(3.0 * values.std(axis=-1, ddof=1))


def _largest_mean(turns: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(turns.mean(axis=-2)).max(axis=-1))


def _largest_scatter(turns: np.ndarray) -> np.ndarray:
    return np.asarray(3.0 * turns.std(axis=-2, ddof=1).max(axis=-1))


def _orientation(kind: str, turns: np.ndarray | None) -> Figures:
    """AP_a to RP_c of rotations (cycles, 3), AT_a to RT_c of those at points (cycles, m, 3)."""
    if turns is None or not turns.size:
        return {}
    both = (_mean, _scatter) if turns.ndim == 2 else (_largest_mean, _largest_scatter)
    return {
        f"{letter}{kind}_{angle}": bootstrap(turns[..., axis], statistic)
        for letter, statistic in zip("AR", both, strict=True)
        for axis, angle in enumerate("abc")
    }


def turns_of(runs: Sequence[Trace], ideal: Trace) -> np.ndarray | None:
    """Rotations of the tool from where it was to be, (cycles, records, 3) [rad].

    None if the orientation was not recorded.
    """
    recorded = [run.orientation for run in runs if run.orientation is not None]
    if ideal.orientation is None or len(recorded) < len(runs):
        return None
    back = rotations(ideal.orientation).inv()
    return np.stack([(rotations(one) * back).as_rotvec() for one in recorded])


def _single(value: float, runs: int) -> IntervalEstimate:
    return IntervalEstimate(float(value), math.nan, math.nan, runs)


@dataclass(frozen=True)
class Group:
    """Figures of one thing: a pose, two of them, a corner, the path."""

    head: str
    """What of, in words."""
    figures: Figures
    times: tuple[float, ...] = ()
    """When the tool is looked at: ends of stops, a corner [s]."""
    note: str = ""

    def __str__(self) -> str:
        """Figures as text [mm, mrad, ms]."""
        rows = []
        for symbol, one in self.figures.items():
            kind, _, suffix = symbol.partition("_")
            title, unit = "" if suffix in tuple("xyzabc") else TITLES[kind][1], _unit(symbol)
            sign = "+-" if kind == "RD" or (unit == "rad" and kind.startswith("R")) else ""
            known = math.isfinite(one.low)
            words = one.text(1e3, f"m{unit}") if known else f"{1e3 * one.value:.4g} m{unit}"
            rows.append((symbol, title, sign + words))
        lines = [*aligned(rows), *([self.note] if self.note else [])]
        return "\n".join([f"{self.head}:", *(f"  {line}" for line in lines)])

    @property
    def rows(self) -> list[tuple]:
        """Figures as rows of the table: symbol, clause, time, value, interval, unit."""
        at = " ".join(f"{time:.6g}" for time in self.times)
        return [
            (symbol, TITLES[symbol.partition("_")[0]][0], at, one.value, one.low, one.high,
             _unit(symbol))
            for symbol, one in self.figures.items()
        ]  # fmt: skip


_ANSWERS = {
    "AP_p": "stops off its place by at most",
    "RP_l": "repeats a stop to",
    "AT_p": "leaves its path by at most",
}
"""What figures say in a sentence."""


def _unit(symbol: str) -> str:
    kind, _, suffix = symbol.partition("_")
    return "s" if kind == "t" else "rad" if suffix in ("a", "b", "c") else "m"


@dataclass(frozen=True)
class Cycles:
    """How many cycles the figures of each kind are taken from: the standard's numbers."""

    pose: int = 30
    """AP, RP, vAP, AD, RD."""
    path: int = 10
    """AT, RT."""
    settling: int = 3
    """Stabilization time and overshoot."""
    cornering: int = 3
    """CR, CO."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            least = LEAST_CYCLES if one.name in ("pose", "path") else 1
            if isinstance(value, int) and value > MOST_RUNS:
                raise JointplayError(f"at most {MOST_RUNS} cycles, got {one.name} = {value}")
            if not isinstance(value, int) or value < least:
                raise JointplayError(
                    f"at least {least} cycles are needed{' to tell scatter' * (least > 1)}, got "
                    f"{one.name} = {value!r} (ISO 9283: {one.default})"
                )

    @classmethod
    def up_to(cls, most: int) -> Cycles:
        """The standard's numbers, but `most` for poses, and at most as many for the others."""
        return cls(most, min(cls.path, most), min(cls.settling, most), min(cls.cornering, most))

    @property
    def most(self) -> int:
        return max(self.pose, self.path, self.settling, self.cornering)

    @property
    def fewer(self) -> list[str]:
        """Kinds with fewer cycles than the standard asks for, and how many it asks for."""
        low = [f for f in fields(self) if getattr(self, f.name) < f.default]
        return [f"{one.default} for {one.name}" for one in low]

    def __str__(self) -> str:
        return (
            f"{self.pose} for poses and distances, {self.path} for the path, {self.settling} for "
            f"stabilization and overshoot, {self.cornering} for corners"
        )


@dataclass(frozen=True)
class Pose(Group):
    """Figures of one stop: AP_p; AP_x to AP_z with sign; RP_l; AP_a to RP_c; of its settling.

    Attributes:
        command: where the ideal mechanism's tool is, world axes, shape (3,) [m].
        attained: where the tool is in each cycle, less `command`, shape (cycles, 3) [m].
    """

    command: np.ndarray = field(default_factory=lambda: np.zeros(3))
    attained: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))


def drift(times: Sequence[float] | np.ndarray, attained: np.ndarray) -> tuple[Figures, np.ndarray]:
    """Drift of the pose characteristics of one command pose (7.6), measured or simulated.

    Args:
        times: of the groups of cycles, increasing, shape (k,), k >= 2 [s].
        attained: attained less commanded position, shape (k, cycles, 3) [m].

    Returns:
        dAP_p, dRP_l, dAP_x, dAP_y, dAP_z over the whole time; and AP_p, RP_l, AP_x, AP_y, AP_z at
        each time, shape (k, 5) [m].

    Raises:
        JointplayError: shapes that do not fit, too few cycles, times that do not increase.
    """
    moments, points = np.asarray(times, float), np.asarray(attained, float)
    if moments.ndim != 1 or len(moments) < 2 or (np.diff(moments) <= 0.0).any():
        raise JointplayError("a drift needs at least two increasing times")
    if points.ndim != 3 or len(points) != len(moments) or points.shape[2] != 3:
        raise JointplayError(
            f"attained poses must have the shape ({len(moments)}, cycles, 3), got {points.shape}"
        )
    if points.shape[1] < LEAST_CYCLES:
        raise JointplayError(f"at least {LEAST_CYCLES} cycles are needed, got {points.shape[1]}")
    both = [statistic(points[:, :, None]) for statistic in (pose_accuracy, repeatability)]
    courses = np.hstack([*both, points.mean(axis=1)])
    names = ("dAP_p", "dRP_l", "dAP_x", "dAP_y", "dAP_z")
    changes = zip(names, np.abs(courses[-1] - courses[0]), strict=True)
    return {name: _single(change, len(moments)) for name, change in changes}, courses


@dataclass(frozen=True)
class Iso9283:
    """Figures of perturbed cycles. Statistical, of simulated runs."""

    cycles: Cycles
    poses: tuple[Pose, ...]
    groups: tuple[Group, ...]
    """Of poses approached from different directions (vAP_p); the path (AT, RT); distances between
    each stop and the next, and the two that are farthest apart (AD with sign, RD); corners (CR and
    CO, the largest of the cycles); drifts of the poses if asked for."""
    path_times: np.ndarray
    """Points of the path, shape (m,) [s]."""
    path_accuracy: np.ndarray
    """Accuracy at each of them, shape (m,) [m]."""
    path_repeatability: np.ndarray
    """Repeatability at each, shape (m,) [m]."""
    since: float
    """Nothing before is judged [s]."""
    interval: float
    """Between two records, by which times are known [s]."""
    drifting: str = "not looked at"
    """What drifts, or why nothing does, in words."""
    conditions: str = ""
    """Load, speed and poses that the cycles were run with (clauses 6.6 to 6.8)."""
    speed: float | None = None
    """Part of the speed that counts as rated."""

    def having(self, symbol: str) -> list[Group]:
        return [one for one in (*self.poses, *self.groups) if symbol in one.figures]

    @property
    def path(self) -> Figures:
        """Figures of the path; none if the tool describes none after `since`."""
        return next((one.figures for one in self.having("AT_p")), {})

    @property
    def validity(self) -> str:
        few = self.cycles.fewer
        asks = f"; the standard asks for {', '.join(few)}" if few else ""
        return (
            f"statistical, from {self.cycles.most} simulated cycles with perturbed starts "
            f"({self.cycles}){asks}; "
            f"[{100 * CONFIDENCE:g} % confidence by bootstrap over the cycles]; times to "
            f"{1e3 * self.interval:.3g} ms; against the ideal mechanism under the same drives; "
            "numerical error not included (jointplay run --certify)"
        )

    @property
    def sentence(self) -> str:
        parts = []
        for symbol, words in _ANSWERS.items():
            if having := self.having(symbol):
                worst = max(having, key=lambda one: abs(one.figures[symbol].value))
                size = readable(abs(worst.figures[symbol].value), "m", 3)
                kind = symbol.partition("_")[0]
                parts.append(f"{words} {size} ({kind}, {worst.head.partition(',')[0]})")
        return f"The tool {', '.join(parts)}" if parts else "The tool neither stops nor moves"

    @property
    def brief(self) -> Table:
        """A row for each pose, distance and the path: how accurate and how repeatable."""
        rows = []
        for accuracy, repeatability in (("AP_p", "RP_l"), ("AD_p", "RD_p"), ("AT_p", "RT_p")):
            for one in self.having(accuracy):
                sizes = (one.figures[name].value for name in (accuracy, repeatability))
                rows.append((one.head, f"{accuracy[:2]}, {repeatability[:2]}", *sizes))
        heads = (("of", ""), ("figures", ""), ("accuracy", "m"), ("repeatability", "m"))
        return Table.of(heads, rows)

    def __str__(self) -> str:
        """All figures as text [mm, mrad]."""
        lines = [f"conditions: {self.conditions}"] if self.conditions else []
        lines += map(str, (*self.poses, *self.groups))
        if not self.poses:
            lines.append(f"no stop from {self.since:g} s on: no pose figures")
        elif not self.having("vAP_p"):
            lines.append("vAP_p: no pose is approached from two directions")
        if not self.having("CR"):
            lines.append("CR, CO: the command path has no corner")
        return "\n".join([*lines, f"drift: {self.drifting}", self.validity])

    @property
    def table(self) -> Table:
        """A row for each figure, lengths in m, angles in rad, times in s."""
        rows = [row for one in (*self.poses, *self.groups) for row in one.rows]
        for kind, number in vars(self.cycles).items():
            rows.append((f"cycles_{kind}", "6.9", "", number, "", "", ""))
        if self.speed is not None:
            rows.append(("speed", "6.7", "", self.speed, "", "", ""))
        words = ("figure", "clause", "time", "value", "low", "high", "unit")
        return Table.of([(word, "s" if word == "time" else "") for word in words], rows)


def iso9283(
    simulation: Simulation,
    cycles: int | Cycles = Cycles(),
    *,
    band: float | None = None,
    speed: float = 1.0,
    load: float = 0.0,
    drift_time: float | None = None,
    poses: str = "poses: the stops of the motion",
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> Iso9283:
    """Run perturbed cycles, and calculate their figures.

    Args:
        simulation: one cycle of the machine; some joint or gear has play.
        cycles: how many for figures of each kind; a number is that for poses, see `Cycles.up_to`.
            Seeds are 1, 2, ... (or from the simulation's own seed on).
        band: limit band of the stabilization time [m]; None: the pose repeatability.
        speed: part of the motion's speed at which it is run.
        load: mass at the tool besides the simulation's own payloads [kg].
        drift_time: over which the drift by wear is calculated [s]; None: it is not.
        poses: where the stops are, in words.
        jobs, keep, progress: see `traces`.

    Raises:
        JointplayError: too few cycles, no motion, no play, a drift though nothing wears, or a run
            that fails.
    """
    require_a("simulation", simulation, "Simulation")
    counts = cycles if isinstance(cycles, Cycles) else Cycles.up_to(cycles)
    check(simulation, speed, load)
    words = (
        f"load: {_load_words(simulation, load)}; speed: {100 * speed:g} % of the motion's; {poses}"
    )
    simulation = loaded(at_speed(simulation, speed), load)
    wears = what_drifts(simulation)
    if drift_time is not None:
        if require_positive("time of the drift", drift_time, "s") > LONGEST_DRIFT_S:
            most = f"{LONGEST_DRIFT_S:g} s (100 years)"
            raise JointplayError(f"time of the drift must be at most {most}, got {drift_time:g} s")
        if not all_wearing(simulation):
            raise JointplayError(f"drift: {wears}")

    def run(group: Sequence[Simulation]) -> list[Trace]:
        return traces(group, jobs=jobs, keep=keep, progress=progress, what="cycles")

    assert simulation.motion is not None
    ideal, *courses = run([ideal_simulation(simulation), *seeded(simulation, counts.most)])
    since = simulation.judged_from
    found = figures(courses, ideal, simulation.motion, since, band=band, cycles=counts)
    found = replace(found, drifting=wears, conditions=words, speed=speed)
    if drift_time is None:
        return found
    parts = []
    for number, worn in enumerate(_worn(simulation, drift_time)):
        again = courses[:DRIFT_CYCLES] if number == 0 else []
        again += run(seeded(worn, DRIFT_CYCLES)[len(again) :])
        parts.append(errors(again, ideal))
    times = np.linspace(0.0, drift_time, DRIFT_TIMES + 1)
    drifts = []
    for pose in found.poses:
        at = int(np.abs(ideal.time - pose.times[0]).argmin())
        head = f"drift of the pose at t = {pose.times[0]:.4g} s over {drift_time / 3600:.3g} h"
        changes, _ = drift(times, np.stack([part[:, at] for part in parts]))
        drifts.append(Group(head, changes, pose.times))
    return replace(
        found,
        groups=(*found.groups, *drifts),
        drifting=f"{wears}, extrapolated from {DRIFT_TIMES} blocks of equal cycles",
    )


def what_drifts(simulation: Simulation) -> str:
    """What changes with time in a model, in words."""
    names = ", ".join(map(repr, all_wearing(simulation)))
    if not names:
        return "nothing in this model drifts: no joint has a wear_rate, and there is no heat"
    return f"by the wear of {names} only; there is no heat"


def _worn(simulation: Simulation, time: float) -> list[Simulation]:
    """The machine at `DRIFT_TIMES` + 1 equally spaced times, its bores worn by all cycles before.

    Each block's wear is that of one run with the bores as the block finds them.
    """
    assert simulation.motion is not None
    cycle = simulation.motion.duration if simulation.duration is None else simulation.duration
    blocks, whole = wear_blocks(simulation, lambda *_: time / DRIFT_TIMES / cycle, DRIFT_TIMES)
    if not whole:
        raise KeyboardInterrupt
    return [simulation, *(with_worn(simulation, block.worn) for block in blocks)]


def _load_words(simulation: Simulation, load: float) -> str:
    parts = [f"{one.mass:g} kg at {one.frame!r} as given" for one in simulation.payloads]
    if load:
        parts.append(f"{load:g} kg at {simulation.mechanism.tool!r} (taken for 100 %)")
    return ", ".join(parts) or "none (the rated load is not known)"


def check(simulation: Simulation, speed: float = 1.0, load: float = 0.0) -> None:
    """Raise a JointplayError on what has no such figures, or cannot be run so."""
    if simulation.motion is None:
        raise JointplayError("ISO 9283 evaluates a motion, but this simulation has none")
    if not (simulation.mechanism.clearance or simulation.mechanism.gears):
        raise JointplayError("no joint or gear has play: every cycle would be the same")
    joints = simulation.mechanism.clearance.values()
    if all(getattr(joint, "ideal", False) for joint in joints):
        raise JointplayError(
            "no joint has clearance: there are no journals that seeds could displace"
        )
    Run(loaded(at_speed(simulation, speed), load))


def cube_poses(centre: Sequence[float] | np.ndarray, edge: float) -> np.ndarray:
    """The five positions of the test in a cube with edges along the world's axes (6.8).

    P1 is the cube's centre; P2 to P5 lie on the diagonals of a rectangle that a diagonal plane cuts
    out of it, a tenth of their length from their ends. The plane is that through the two edges
    along y at low x and z and at high x and z; the standard has four to choose from.

    Args:
        centre: of the cube, world axes, shape (3,) [m].
        edge: its length [m].

    Returns:
        P1 to P5, shape (5, 3) [m].

    Raises:
        JointplayError: an edge that is not positive, a centre that is no place.
    """
    middle = np.asarray(centre, float)
    if middle.shape != (3,) or not np.isfinite(middle).all():
        raise JointplayError(f"the cube's centre must be three numbers [m], got {centre!r}")
    corners = np.array([[0, 0, 0], [1, -1, 1], [1, 1, 1], [-1, 1, -1], [-1, -1, -1.0]])
    return np.asarray(middle + 0.4 * require_positive("edge of the cube", edge, "m") * corners)


def cube_motion(
    mechanism: Mechanism,
    centre: Sequence[float] | np.ndarray,
    edge: float,
    *,
    dwell: float = 0.5,
    start: dict[str, float] | None = None,
) -> Motion:
    """From P1 through P5, P4, P3, P2 back to P1, at rest at each, as fast as the URDF allows.

    Every way is a quintic in the joints; the fastest of them reaches the limit of its speed.

    Args:
        mechanism: its tool is led, its orientation left free; in loops, the joints nearest to the
            base are driven.
        centre, edge: see `cube_poses`.
        dwell: rest at each pose [s].
        start: see `cartesian_motion`.

    Raises:
        JointplayError: a pose out of reach, a joint that moves and has no limit of speed; loops
            that the driven joints alone would assemble otherwise.
    """
    require_positive("dwell", dwell, "s")
    order = [0, 4, 3, 2, 1, 0]
    places = cube_poses(centre, edge)[order]
    path = cartesian_path(mechanism, np.arange(len(order), dtype=float), places, start=start)
    if path.start:
        raise JointplayError(
            "the loops can be assembled in several ways, and the driven joints "
            f"({', '.join(path.motion.joints)}) begin in another than the cube needs: give a "
            "scenario with [start] and a motion instead of a cube"
        )
    found = path.motion
    q = np.array(found.positions)
    q[-1] = q[0]  # the same pose in the same configuration
    most = np.zeros(len(found.joints))
    for k, name in enumerate(found.joints):
        limit = mechanism.description.joints[name].speed
        if np.ptp(q[:, k]) > 0.0 and limit is None:
            raise JointplayError(
                f"joint {name!r} has no speed limit in the URDF: give a motion instead of a cube"
            )
        most[k] = limit or math.inf
    times, rows = [0.0, dwell], [q[0], q[0]]
    for before, after in pairwise(q):
        # A rest-to-rest quintic's largest speed is 15/8 of its mean one.
        lasts = max(float((15.0 / 8.0 * np.abs(after - before) / most).max()), 1e-3)
        times += [times[-1] + lasts, times[-1] + lasts + dwell]
        rows += [after, after]
    return Motion(found.joints, times, np.array(rows))


def figures(
    runs: Sequence[Trace],
    ideal: Trace,
    motion: Motion,
    since: float = 0.0,
    *,
    band: float | None = None,
    cycles: Cycles | None = None,
) -> Iso9283:
    """Figures of cycles that have been run, or measured.

    Args:
        runs: the tool's course in each cycle, at the same times as `ideal`.
        ideal: where the tool was to be.
        motion: of the joints; it tells the stops.
        since: nothing before is judged [s].
        band: see `iso9283`.
        cycles: how many of them, from the first on, figures of each kind are taken from; None: the
            standard's numbers as far as there are as many, and all for poses.

    Raises:
        JointplayError: too few cycles, or records at other times.
    """
    counts = Cycles.up_to(len(runs)) if cycles is None else cycles
    if len(runs) < counts.most:
        raise JointplayError(f"{counts.most} cycles are requested, but there are only {len(runs)}")
    if band is not None:
        require_positive("limit band", band, "m")
    time = ideal.time
    error, turns = errors(runs, ideal), turns_of(runs, ideal)
    stopping = motion.interpolation not in GOES_ON
    waypoints = stops(motion, float(time[-1])) if stopping else []
    halts = [one for one in waypoints if one.at_rest and one.end >= since and one.end > 0.0]
    poses: list[Pose] = []
    for number, stop in enumerate(halts, 1):
        at = int(np.abs(time - stop.end).argmin())
        attained = error[: counts.pose, at : at + 1]
        found = {
            "AP_p": bootstrap(attained, largest(pose_accuracy)),
            **{f"AP_{axis}": bootstrap(attained[:, 0, k], _mean) for k, axis in enumerate("xyz")},
            "RP_l": bootstrap(attained, largest(repeatability)),
            **_orientation("P", None if turns is None else turns[: counts.pose, at]),
        }
        leave = max([0.0, *(other.end for other in halts if other.end < stop.start)])
        limit = found["RP_l"].value if band is None else band
        settled, note = _settling(runs[: counts.settling], time, leave, stop, limit)
        head = f"pose {number} (t = {time[at]:.4g} s), {counts.pose} cycles"
        moment = (float(time[at]),)
        poses.append(
            Pose(head, {**found, **settled}, moment, note, ideal.position[at], attained[:, 0])
        )
    points = _path(ideal, since)
    across = _across(error[: counts.path, points], ideal.velocity[points])
    path = []
    if len(points):
        found = {"AT_p": bootstrap(across, largest(pose_accuracy))}
        found["RT_p"] = bootstrap(across, largest(repeatability))
        found |= _orientation("T", None if turns is None else turns[: counts.path, points])
        path.append(Group(f"path, {counts.path} cycles", found))
    corners = _corners(runs[: counts.cornering], ideal, waypoints, since)
    return Iso9283(
        counts,
        tuple(poses),
        (*_variations(poses, motion), *path, *_distances(poses), *corners),
        time[points],
        pose_accuracy(across),
        repeatability(across),
        since,
        float(np.median(np.diff(time))),
    )


def _settling(
    runs: Sequence[Trace], time: np.ndarray, leave: float, stop: Stop, band: float
) -> tuple[Figures, str]:
    dwell = time[(time >= stop.start) & (time <= stop.end)]
    if len(dwell) < 3:
        return {}, "stabilization, overshoot: the motion does not dwell here"
    inside = (time >= leave) & (time <= stop.end)
    moments, half = time[inside], 0.5 * (dwell[0] + dwell[-1])
    took, beyond, missed = [0.0] * len(runs), [0.0] * len(runs), 0
    for number, run in enumerate(runs):
        course = run.position[inside]
        distance = np.linalg.norm(course - course[-1], axis=1)
        outside = np.flatnonzero(distance > band)
        if not len(outside):  # never left: nothing to settle
            continue
        first = outside[0] + int((distance[outside[0] :] <= band).argmax())
        last = max(outside[-1] + 1, first)
        took[number] = float(moments[last] - moments[first])
        farthest = float(distance[first:].max())
        beyond[number] = farthest if farthest > band else 0.0
        missed += int(moments[last] > half)
    words = f"limit band {1e3 * band:.4g} mm"
    if missed:
        return {}, (
            f"stabilization, overshoot: still outside the {words} at half of the dwell in {missed} "
            f"of {len(runs)} cycles: a longer dwell is needed"
        )
    longest = f"longest {1e3 * max(took):.4g} ms"
    note = f"stabilization time: mean ({longest}, {words}); overshoot: the largest"
    both = {"t_stabilization": float(np.mean(took)), "OV": max(beyond)}
    return {symbol: _single(x, len(runs)) for symbol, x in both.items()}, note


def _path(ideal: Trace, since: float) -> np.ndarray:
    """Records evenly along the way of the commanded tool while it moves, shape (m,)."""
    speed = np.linalg.norm(ideal.velocity, axis=1)
    usable = np.flatnonzero((speed > _MOVING * speed.max()) & (ideal.time >= since))
    if not len(usable):
        return usable
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(ideal.time))])
    wanted = np.linspace(way[usable[0]], way[usable[-1]], PATH_POINTS)
    nearest = np.abs(way[usable][None] - wanted[:, None]).argmin(axis=1)
    return np.unique(usable[nearest])


def _across(error: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Part of errors (cycles, m, 3) across the commanded direction (m, 3)."""
    way = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    part = np.einsum("cmi,mi->cm", error, way)
    return np.asarray(error - part[..., None] * way)


def _variations(poses: Sequence[Pose], motion: Motion) -> Iterator[Group]:
    """Stops at one place that are approached from different directions, judged together."""
    places: dict[tuple[float, ...], list[tuple[Pose, np.ndarray]]] = {}
    for pose in poses:
        here = motion(np.array(pose.times))[0][0]
        earlier = [
            row
            for time, row in zip(motion.times, motion.positions, strict=True)
            if time < pose.times[0] and not np.allclose(row, here, 0.0, 1e-9)
        ]
        if earlier:
            way = here - earlier[-1]
            key = tuple(np.round(here, 8))
            places.setdefault(key, []).append((pose, way / np.linalg.norm(way)))
    for group in places.values():
        first = group[0][1]
        if any(float(first @ way) < math.cos(_OTHER_WAY) for _, way in group[1:]):
            together = np.stack([pose.attained for pose, _ in group], axis=1)
            times = tuple(pose.times[0] for pose, _ in group)
            head = (
                f"one pose from different directions (t = {', '.join(f'{t:.4g}' for t in times)} s)"
            )
            yield Group(head, {"vAP_p": bootstrap(together, variation)}, times)


def _distances(poses: Sequence[Pose]) -> Iterator[Group]:
    """Of each stop and the next, and of the two that are farthest apart."""
    if len(poses) < 2:
        return
    places = np.array([pose.command for pose in poses])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    first, second = sorted(map(int, np.unravel_index(apart.argmax(), apart.shape)))
    for a, b in dict.fromkeys([*pairwise(range(len(poses))), (first, second)]):
        if apart[a, b] <= _SHORTEST_M:
            continue
        one, other = poses[a], poses[b]
        command = other.command - one.command
        between = command + other.attained - one.attained  # (cycles, 3)
        excess = {"p": np.linalg.norm(between, axis=1) - apart[a, b]}
        excess |= {axis: between[:, k] - command[k] for k, axis in enumerate("xyz")}
        found = {
            f"{letter}D_{suffix}": bootstrap(values, statistic)
            for suffix, values in excess.items()
            for letter, statistic in (("A", _mean), ("R", _scatter))
        }
        start, end = *one.times, *other.times
        head = f"distance from t = {start:.4g} s to {end:.4g} s, {1e3 * apart[a, b]:.6g} mm"
        yield Group(head, found, (start, end))


def _corners(
    runs: Sequence[Trace], ideal: Trace, waypoints: Sequence[Stop], since: float
) -> Iterator[Group]:
    """Waypoints at which the commanded tool changes its direction, and how the cycles take them."""
    for before, here, after in zip(waypoints, waypoints[1:], waypoints[2:], strict=False):
        if here.start < since:
            continue
        first = (ideal.time >= before.end) & (ideal.time <= here.start)
        second = (ideal.time >= here.end) & (ideal.time <= after.start)
        way_in, way_out = _thinned(ideal.position[first]), _thinned(ideal.position[second])
        if way_in is None or way_out is None:
            continue
        corner, come, go = way_in[-1], _heading(way_in[::-1]), _heading(way_out)
        angle = math.acos(min(max(float(-come @ go), -1.0), 1.0))
        if not _CORNER <= angle <= math.pi - _CORNER:
            continue
        on = -come + float(come @ go) * go  # whither the way in leads on, across the way out
        on /= np.linalg.norm(on)
        begin, end = 0.5 * (before.end + here.start), 0.5 * (here.end + after.start)
        near = (ideal.time >= begin) & (ideal.time <= end)
        sizes: dict[str, list[float]] = {"CR": [], "CO": []}
        for run in runs:
            sizes["CR"].append(np.linalg.norm(run.position[near] - corner, axis=1).min())
            off = _off(run.position[second], way_out)
            sizes["CO"].append(np.linalg.norm(off[off @ on > 0.0], axis=1).max(initial=0.0))
        how = "the command rests" if here.at_rest else "the command passes"
        head = f"corner of {math.degrees(angle):.3g} deg (t = {here.start:.4g} s, {how})"
        found = {symbol: _single(max(several), len(runs)) for symbol, several in sizes.items()}
        yield Group(head, found, (here.start,))


def _thinned(way: np.ndarray) -> np.ndarray | None:
    """About `PATH_POINTS` points evenly along a way (n, 3); None if it leads nowhere."""
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    run = np.concatenate([[0.0], np.cumsum(steps)])
    if len(way) < 2 or run[-1] < _SHORTEST_M:
        return None
    moved = np.concatenate([[True], steps > 0.0])
    wanted = np.linspace(0.0, run[-1], PATH_POINTS + 1)
    return np.stack([np.interp(wanted, run[moved], way[moved, axis]) for axis in range(3)], axis=1)


def _heading(way: np.ndarray) -> np.ndarray:
    """Direction in which a thinned way begins, shape (3,)."""
    ahead = way[round(_NEAR * PATH_POINTS)] - way[0]
    return np.asarray(ahead / np.linalg.norm(ahead))


def _off(points: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Part of the distance of points (n, 3) from the nearest piece of a way across it, (n, 3)."""
    step = np.diff(way, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    middles = 0.5 * (way[1:] + way[:-1])
    nearest = np.array([np.linalg.norm(middles - point, axis=1).argmin() for point in points])
    off = points - way[nearest]
    return np.asarray(off - np.einsum("ij,ij->i", off, step[nearest])[:, None] * step[nearest])
