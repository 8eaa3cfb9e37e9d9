"""Figures of ISO 9283:1998 from simulated cycles.

Manipulating industrial robots: performance criteria and related test methods. Of the standard only
the public previews of its contents were seen (numbers and titles of the clauses); formulas,
conditions and numbers of cycles are from memory and from works about it. docs/iso9283.md defines
each figure; `TITLES` has the clauses. Other figures of the standard are not calculated.

Figures with a, b, c are components, in world axes, of the rotation vector that turns the commanded
tool into the attained one: rotations by play are so small that the order in which the standard
would count angles does not matter.

Two things differ from a test of a real robot. Each cycle is a run of its own, whose journals and
teeth begin displaced at random. And the command pose is where the ideal mechanism under the same
drives is, so that only play and the compliance that goes with it count, not the drives' lag,
calibration, heat or the measurement. Stops of arms with play in gears are reached in three ways
(`study.approaches`).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import chain, pairwise
from operator import itemgetter
from pathlib import Path

import numpy as np
from scipy import stats
from scipy.integrate import cumulative_trapezoid

from jointplay.base.errors import JointplayError, require_a, require_positive
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Table, aligned
from jointplay.base.units import readable
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.analysis.tool_error import stops, turns_between
from jointplay.simulation.analysis.twins import ideal_simulation
from jointplay.simulation.analysis.uncertainty import IntervalEstimate
from jointplay.simulation.motion.cartesian import cartesian_path
from jointplay.simulation.motion.reference import GOES_ON, Motion
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.approaches import ANY_SIDE, applies, planned
from jointplay.study.courses import MOST_RUNS, Trace, at_speed, errors, seeded, traces

TITLES = {
    "AP": ("7.2.1", "pose accuracy"),
    "RP": ("7.2.2", "pose repeatability"),
    "AT": ("8.2", "path accuracy"),
    "RT": ("8.3", "path repeatability"),
}
"""Clause and title of the figures, by their symbols without suffix."""
CONFIDENCE = 0.95
"""Confidence level of the intervals (a convention)."""
RESAMPLES = 999
"""Resamples of the bootstrap: with 9999 the bounds of an RP move by up to 2 % with 30 cycles, 8 %
with 10."""
LEAST_CYCLES = 3
"""Fewest cycles that say anything about the scatter."""
PATH_POINTS = 100
"""Most points along the path at which AT and RT are calculated (judged: where the error bends ten
times along a path they find its largest value 2 % too small, 1000 points 0.3 %)."""
NO_SCATTER = 1e-7
"""Scatter below which cycles count as alike [m]: no instrument shows it, and runs with another step
differ by more."""
_MOVING = 0.02
"""Fraction of its greatest speed above which the commanded tool is on a path (judged: below, it has
hardly a direction, and its error is that of a stop)."""
Figures = Mapping[str, IntervalEstimate]
"""Figures by symbol [m]; those with the suffix a, b or c are rotations about x, y and z [rad]."""
Statistic = Callable[[np.ndarray], np.ndarray]
"""Function of points (..., cycles, m, 3)."""


def pose_accuracy(points: np.ndarray) -> np.ndarray:
    """Distance of the cycles' barycentre from the command pose, at m points.

    Args:
        points: attained less commanded, shape (..., cycles, m, 3) [m].

    Returns:
        shape (..., m) [m].
    """
    return np.asarray(np.linalg.norm(points.mean(axis=-3), axis=-1))


def repeatability(points: np.ndarray) -> np.ndarray:
    """mean(l) + 3 S_l, l being distances from the barycentre, S_l their standard deviation; shapes
    as in `pose_accuracy`.
    """
    distance = np.linalg.norm(points - points.mean(axis=-3, keepdims=True), axis=-1)
    return np.asarray(distance.mean(axis=-2) + 3.0 * distance.std(axis=-2, ddof=1))


def largest(statistic: Statistic) -> Statistic:
    """The statistic that is the largest value of `statistic` over the points."""
    return lambda points: np.asarray(statistic(points).max(axis=-1))


def bootstrap(points: np.ndarray, statistic: Statistic) -> IntervalEstimate:
    """A statistic over the cycles with its confidence interval by the bootstrap: bias-corrected and
    accelerated (BCa), or by percentiles where that fails; NaN where both do.
    """
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
    """AP_a to RP_c from rotations (cycles, 3), AT_a to RT_c from those at points (cycles, m, 3).

    `kind` is the second letter, P or T.
    """
    if turns is None or not turns.size:
        return {}
    both = (_mean, _scatter) if turns.ndim == 2 else (_largest_mean, _largest_scatter)
    return {
        f"{letter}{kind}_{angle}": bootstrap(turns[..., axis], statistic)
        for letter, statistic in zip("AR", both, strict=True)
        for axis, angle in enumerate("abc")
    }


def turns_of(runs: Sequence[Trace], ideal: Trace) -> np.ndarray | None:
    """Rotation vectors from the ideal to the attained tool, (cycles, records, 3) [rad].

    None if the orientation was not recorded.
    """
    recorded = [run.orientation for run in runs if run.orientation is not None]
    if ideal.orientation is None or len(recorded) < len(runs):
        return None
    return np.stack([turns_between(ideal.orientation, orientation) for orientation in recorded])


_PHRASES = {
    "RP_l": "repeats a stop to",
    "AP_p": "stops off its place by at most",
    "AT_p": "leaves its path by at most",
}
"""Predicates of the sentence, by the symbol of the figure that they give."""


def _unit(symbol: str) -> str:
    return "rad" if symbol.partition("_")[2] in ("a", "b", "c") else "m"


def _text(head: str, figures: Figures) -> str:
    """Text that lists figures of a pose or of the path under a heading [mm, mrad]."""
    rows = []
    for symbol, estimate in figures.items():
        kind, _, suffix = symbol.partition("_")
        title, unit = "" if suffix in tuple("xyzabc") else TITLES[kind][1], _unit(symbol)
        sign = "+-" if unit == "rad" and kind.startswith("R") else ""
        rows.append((symbol, title, sign + estimate.text(1e3, f"m{unit}")))
    return "\n".join([f"{head}:", *(f"  {line}" for line in aligned(rows))])


def _rows(figures: Figures, time: str = "") -> list[tuple]:
    """Rows of the table for figures: symbol, clause, time, value, interval, unit."""
    return [
        (symbol, TITLES[symbol.partition("_")[0]][0], time, interval.value, interval.low,
         interval.high, _unit(symbol))
        for symbol, interval in figures.items()
    ]  # fmt: skip


@dataclass(frozen=True)
class Cycles:
    """Numbers of cycles from which the figures are taken; the defaults are the standard's."""

    pose: int = 30
    """Cycles for AP and RP."""
    path: int = 10
    """Cycles for AT and RT."""

    def __post_init__(self) -> None:
        for count in fields(self):
            value = getattr(self, count.name)
            if isinstance(value, int) and value > MOST_RUNS:
                raise JointplayError(f"at most {MOST_RUNS} cycles, got {count.name} = {value}")
            if not isinstance(value, int) or value < LEAST_CYCLES:
                raise JointplayError(
                    f"at least {LEAST_CYCLES} cycles are needed to tell scatter, got "
                    f"{count.name} = {value!r} (ISO 9283: {count.default})"
                )

    @classmethod
    def up_to(cls, poses: int) -> Cycles:
        """`poses` cycles for poses, and at most as many for the path, as the standard has it."""
        return cls(poses, min(cls.path, poses))

    @property
    def runs(self) -> int:
        return max(self.pose, self.path)

    @property
    def fewer(self) -> list[str]:
        """The standard's number of each kind that has fewer cycles, in words."""
        reduced = [kind for kind in fields(self) if getattr(self, kind.name) < kind.default]
        return [f"{kind.default} for {kind.name}" for kind in reduced]

    def __str__(self) -> str:
        return f"{self.pose} for poses, {self.path} for the path"


@dataclass(frozen=True)
class Pose:
    """The figures of one stop."""

    head: str
    """Number, time and cycles of the stop, its heading."""
    figures: Figures
    """AP_p; AP_x to AP_z with sign; RP_l; AP_a to RP_c."""
    time: float
    """Time at which the tool's pose is taken, the end of the stop [s]."""
    attained: np.ndarray
    """Position of the tool in each cycle less that of the ideal one, (cycles, 3) [m]."""


@dataclass(frozen=True)
class Iso9283:
    """Figures of perturbed cycles; statistical, from simulated runs."""

    cycles: Cycles
    poses: tuple[Pose, ...]
    path: Figures
    """AT_p, RT_p, AT_a to RT_c; empty if the tool describes no path after `since`."""
    path_times: np.ndarray
    """Times of the points of the path, shape (m,) [s]."""
    path_accuracy: np.ndarray
    """Accuracy at each point, shape (m,) [m]."""
    path_repeatability: np.ndarray
    """Repeatability at each point, shape (m,) [m]."""
    since: float
    """Time from which cycles are judged [s]."""
    conditions: str = ""
    """Load, speed and poses of the cycles (clauses 6.6 to 6.8)."""
    speed: float | None = None
    """Speed of the cycles as a fraction of the motion's, which counts as rated."""
    approaches: Mapping[str, tuple[Pose, ...]] = field(default_factory=dict)
    """Stops by the way in which they are reached (`approaches.APPROACHES`); `poses` are those
    reached from any side."""
    causes: tuple[str, ...] = ()
    """Notes on what differs from cycle to cycle, and on what is left out."""

    @property
    def _repeatability_phrase(self) -> str:
        """Predicate that says how well the tool comes back to the worst of its stops."""
        stops = chain(self.poses, *self.approaches.values())
        if all(stop.figures["RP_l"].value < NO_SCATTER for stop in stops):
            return "comes back to each stop alike: nothing differs there from cycle to cycle"
        worst = max(self.poses, key=lambda pose: pose.figures["RP_l"].value)
        k, sizes = self.poses.index(worst), dict[str, str]()
        for approach, poses in (self.approaches or {"": self.poses}).items():
            value = poses[k].figures["RP_l"].value
            sizes[approach] = readable(value, "m", 3) if value > NO_SCATTER else "0.1 µm"
        if not self.approaches:
            return f"repeats a stop to {sizes['']} (RP, {worst.head.partition(',')[0]})"
        ranges = ", ".join(f"{pose} {approach}" for approach, pose in sizes.items())
        return f"comes back to the same place within {ranges} (RP, {worst.head.partition(',')[0]})"

    @property
    def validity(self) -> str:
        reduced = self.cycles.fewer
        shortfall = f"; the standard asks for {', '.join(reduced)}" if reduced else ""
        return (
            f"statistical, from {self.cycles.runs} simulated cycles with perturbed starts "
            f"({self.cycles}){shortfall}; "
            f"[{100 * CONFIDENCE:g} % confidence by bootstrap over the cycles]; against the "
            "ideal mechanism under the same drives; numerical error not included (jointplay run "
            "--certify)"
        )

    @property
    def _parts(self) -> list[tuple[str, Figures, str]]:
        """Heading, figures and time of each pose and of the path."""
        poses = [(pose.head, pose.figures, f"{pose.time:.6g}") for pose in self.poses]
        path = [(f"path, {self.cycles.path} cycles", self.path, "")] if self.path else []
        return [*poses, *path]

    @property
    def sentence(self) -> str:
        parts = []
        for symbol, phrase in _PHRASES.items():
            errors = {head: f[symbol].value for head, f, _ in self._parts if symbol in f}
            if symbol == "RP_l" and errors:
                parts.append(self._repeatability_phrase)
            elif errors:
                head, worst = max(errors.items(), key=itemgetter(1))
                kind, place = symbol.partition("_")[0], head.partition(",")[0]
                if symbol == "AT_p" and worst < NO_SCATTER:
                    parts.append(f"never leaves its path ({kind}, which counts no error along it)")
                else:
                    parts.append(f"{phrase} {readable(worst, 'm', 3)} ({kind}, {place})")
        return f"The tool {', '.join(parts)}" if parts else "The tool neither stops nor moves"

    @property
    def brief(self) -> Table:
        """Table of accuracy and repeatability, with a row for each pose and for the path."""
        rows, columns = [], [approach for approach in self.approaches if approach != ANY_SIDE]
        for accuracy, repeatability in (("AP_p", "RP_l"), ("AT_p", "RT_p")):
            for k, (head, estimates, _) in enumerate(self._parts):
                if accuracy not in estimates:
                    continue
                stop = k < len(self.poses)
                reached = [self.approaches[name][k].figures if stop else {} for name in columns]
                scatters = [figures.get(repeatability) for figures in (estimates, *reached)]
                sizes = [x and (x.value if x.value > NO_SCATTER else 0.0) for x in scatters]
                kinds = f"{accuracy[:2]}, {repeatability[:2]}"
                rows.append((head, kinds, estimates[accuracy].value, *sizes))
        heads = [("of", ""), ("figures", ""), ("accuracy", "m"), ("repeatability", "m")]
        return Table.of([*heads, *((approach, "m") for approach in columns)], rows)

    def __str__(self) -> str:
        """Text with all figures [mm, mrad]."""
        lines = [f"conditions: {self.conditions}"] if self.conditions else []
        lines += [_text(head, estimates) for head, estimates, _ in self._parts]
        for approach, poses in self.approaches.items():
            if approach != ANY_SIDE:
                lines += [_text(f"{pose.head}, {approach}", pose.figures) for pose in poses]
        lines += self.causes
        if not self.poses:
            lines.append(f"no stop from {self.since:g} s on: no pose figures")
        return "\n".join([*lines, self.validity])

    @property
    def table(self) -> Table:
        """Table with a row for each figure, lengths in m, angles in rad."""
        rows = [row for _, estimates, time in self._parts for row in _rows(estimates, time)]
        for approach, poses in self.approaches.items():
            for pose in poses if approach != ANY_SIDE else ():
                figures = _rows(pose.figures, f"{pose.time:.6g}")
                rows += [(f"{symbol} {approach}", *values) for symbol, *values in figures]
        for kind, number in vars(self.cycles).items():
            rows.append((f"cycles_{kind}", "6.9", "", number, "", "", ""))
        if self.speed is not None:
            rows.append(("speed", "6.7", "", self.speed, "", "", ""))
        names = ("figure", "clause", "time", "value", "low", "high", "unit")
        return Table.of([(name, "s" if name == "time" else "") for name in names], rows)


@known_keywords
def iso9283(
    simulation: Simulation,
    cycles: int | Cycles = Cycles(),
    *,
    speed: float = 1.0,
    poses: str = "poses: the stops of the motion",
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> Iso9283:
    """Run perturbed cycles, and calculate their figures.

    Args:
        simulation: one cycle of the machine; some joint or gear must have play.
        cycles: numbers of cycles; one number is that for poses, see `Cycles.up_to`. Seeds are
            1, 2, ... (or from the simulation's own seed on).
        speed: fraction of the motion's speed at which it is run.
        poses: description of the stops, for the conditions.
        jobs, keep, progress: see `traces`.

    Raises:
        JointplayError: too few cycles, no motion, no play, or a run that fails.
    """
    require_a("simulation", simulation, "Simulation")
    counts = cycles if isinstance(cycles, Cycles) else Cycles.up_to(cycles)
    check(simulation, speed)
    loads = [f"{p.mass:g} kg at {p.frame!r} (taken for 100 %)" for p in simulation.payloads]
    load = ", ".join(loads) or "none (the rated load is not known)"
    conditions = f"load: {load}; speed: {100 * speed:g} % of the motion's; {poses}"
    simulation = at_speed(simulation, speed)
    assert simulation.motion is not None
    # With play in gears the stops have cycles of their own, for each approach; the user's cycles
    # then serve the path alone.
    geared = applies(simulation)
    path_cycles = replace(counts, pose=min(counts.pose, counts.path)) if geared else counts
    plans, causes, path_cycle = dict[str, list[Simulation]](), list[str](), simulation
    if geared:
        arm, plans, causes = planned(simulation, counts.pose)
        path_cycle = arm.rested()
    assert path_cycle.motion is not None
    runs = [ideal_simulation(path_cycle), *seeded(path_cycle, path_cycles.runs)]
    n = len(runs)
    if geared:
        runs += [ideal_simulation(arm.reference()), *chain(*plans.values())]
    # One study of all runs: the ideal path, cycles of the path, the ideal stops, cycles of stops.
    ideal, *courses = traces(runs, jobs=jobs, keep=keep, progress=progress, label="cycles")
    path_courses = courses[: n - 1]
    since = path_cycle.judged_from
    if since is None:
        since = max(float(course.judged_from) for course in path_courses)
    performance = figures(path_courses, ideal, path_cycle.motion, since, cycles=path_cycles)
    performance = replace(performance, conditions=conditions, speed=speed)
    if not geared:
        return performance
    reference, stop_courses = courses[n - 1], courses[n:]
    n = counts.pose
    approaches = {
        approach: _poses(stop_courses[k * n :][:n], reference, arm.stop_ends, n)
        for k, approach in enumerate(plans)
    }
    return replace(
        performance, cycles=counts, poses=approaches[ANY_SIDE], approaches=approaches,
        causes=tuple(causes),
    )  # fmt: skip


def check(simulation: Simulation, speed: float = 1.0) -> None:
    """Raise a JointplayError if a simulation has no such figures, or cannot be run."""
    if simulation.motion is None:
        raise JointplayError("ISO 9283 evaluates a motion, but this simulation has none")
    mechanism = simulation.mechanism
    loose = any(not getattr(joint, "ideal", False) for joint in mechanism.clearance.values())
    if not (loose or any(gear.play > 0.0 for gear in mechanism.gears.values())):
        raise JointplayError("no joint or gear has play: every cycle would be the same")
    Run(at_speed(simulation, speed))


def cube_poses(centre: Sequence[float] | np.ndarray, edge: float) -> np.ndarray:
    """The five test positions in a cube with edges along the world's axes (6.8).

    P1 is the cube's centre; P2 to P5 lie on the diagonals of the rectangle that a diagonal plane
    cuts out of it, a tenth of their length from their ends. The plane is that through the two edges
    along y at low x and z and at high x and z; the standard has four to choose from.

    Args:
        centre: centre of the cube, world axes, shape (3,) [m].
        edge: length of its edges [m].

    Returns:
        P1 to P5, shape (5, 3) [m].

    Raises:
        JointplayError: an edge that is not positive, a centre that is not three finite numbers.
    """
    middle = np.asarray(centre, float)
    if middle.shape != (3,) or not np.isfinite(middle).all():
        raise JointplayError(f"the cube's centre must be three numbers [m], got {centre!r}")
    corners = np.array([[0, 0, 0], [1, -1, 1], [1, 1, 1], [-1, 1, -1], [-1, -1, -1.0]])
    return np.asarray(middle + 0.4 * require_positive("edge of the cube", edge, "m") * corners)


def in_cube(simulation: Simulation, centre: Sequence[float], edge: float) -> tuple[Simulation, str]:
    """The simulation with the motion of `cube_motion`, and a note on its poses."""
    motion = cube_motion(simulation.mechanism, centre, edge)
    position = ", ".join(f"{x:g}" for x in centre)
    note = f"poses: P1, P5, P4, P3, P2, P1 in a cube of {edge:g} m about ({position}) m"
    return replace(simulation, motion=motion, duration=None), note


def cube_motion(
    mechanism: Mechanism,
    centre: Sequence[float] | np.ndarray,
    edge: float,
    *,
    dwell: float = 0.5,
    start: dict[str, float] | None = None,
) -> Motion:
    """Motion from P1 through P5, P4, P3, P2 back to P1 with a rest at each, as fast as allowed.

    Each move is a quintic in the joints, during which one joint reaches its speed limit (URDF).

    Args:
        mechanism: the mechanism; its tool is led to the poses, the orientation left free; in loops,
            the joints nearest to the base are driven.
        centre, edge: see `cube_poses`.
        dwell: rest at each pose [s].
        start: see `cartesian_motion`.

    Raises:
        JointplayError: a pose out of reach, a moving joint without a speed limit; loops that the
            driven joints alone would assemble otherwise.
    """
    require_positive("dwell", dwell, "s")
    order = [0, 4, 3, 2, 1, 0]
    points = cube_poses(centre, edge)[order]
    path = cartesian_path(mechanism, np.arange(len(order), dtype=float), points, start=start)
    if path.start:
        raise JointplayError(
            "the loops can be assembled in several ways, and the driven joints "
            f"({', '.join(path.motion.joints)}) begin in another than the cube needs: give a "
            "scenario with [start] and a motion instead of a cube"
        )
    motion = path.motion
    q = np.array(motion.positions)
    q[-1] = q[0]  # the same pose in the same configuration
    limits = np.zeros(len(motion.joints))
    for k, name in enumerate(motion.joints):
        limit = mechanism.description.joints[name].speed
        if np.ptp(q[:, k]) > 0.0 and limit is None:
            raise JointplayError(
                f"joint {name!r} has no speed limit in the URDF: give a motion instead of a cube"
            )
        limits[k] = limit or math.inf
    times, rows = [0.0, dwell], [q[0], q[0]]
    for before, after in pairwise(q):
        # A rest-to-rest quintic's largest speed is 15/8 of its mean one.
        duration = max(float((15.0 / 8.0 * np.abs(after - before) / limits).max()), 1e-3)
        times += [times[-1] + duration, times[-1] + duration + dwell]
        rows += [after, after]
    return Motion(motion.joints, times, np.array(rows), "rest-to-rest")


def figures(
    runs: Sequence[Trace],
    ideal: Trace,
    motion: Motion,
    since: float = 0.0,
    *,
    cycles: Cycles | None = None,
) -> Iso9283:
    """Figures of cycles that have been run, or measured.

    Args:
        runs: the tool's trajectory in each cycle, at the same times as `ideal`.
        ideal: the commanded trajectory of the tool.
        motion: motion of the joints, from which the stops are found.
        since: time from which cycles are judged [s].
        cycles: numbers of cycles, from the first on; None: all for poses, and for the path the
            standard's number, as far as there are as many.

    Raises:
        JointplayError: too few cycles, or records at other times than those of `ideal`.
    """
    counts = Cycles.up_to(len(runs)) if cycles is None else cycles
    if len(runs) < counts.runs:
        raise JointplayError(f"{counts.runs} cycles are requested, but there are only {len(runs)}")
    time = ideal.time
    error = errors(runs, ideal)
    turns = turns_of(runs, ideal)
    stopping = motion.interpolation not in GOES_ON
    waypoints = stops(motion, float(time[-1])) if stopping else []
    halts = [halt for halt in waypoints if halt.at_rest and halt.end >= since and halt.end > 0.0]
    ends = np.array([stop.end for stop in halts])
    points = _path(ideal, since)
    across = _across(error[: counts.path, points], ideal.velocity[points])
    path: Figures = {}
    if len(points):
        path = {
            "AT_p": bootstrap(across, largest(pose_accuracy)),
            "RT_p": bootstrap(across, largest(repeatability)),
            **_orientation("T", None if turns is None else turns[: counts.path, points]),
        }
    return Iso9283(
        counts,
        _poses(runs, ideal, ends, counts.pose),
        path,
        time[points],
        pose_accuracy(across),
        repeatability(across),
        since,
    )


def _poses(runs: Sequence[Trace], ideal: Trace, ends: np.ndarray, cycles: int) -> tuple[Pose, ...]:
    """Figures of the first `cycles` runs at the ends of stops [s]."""
    error, turns = errors(runs[:cycles], ideal), turns_of(runs[:cycles], ideal)
    poses = []
    for number, end in enumerate(ends, 1):
        record = int(np.abs(ideal.time - end).argmin())
        attained = error[:, record : record + 1]
        estimates = {
            "AP_p": bootstrap(attained, largest(pose_accuracy)),
            **{f"AP_{axis}": bootstrap(attained[:, 0, k], _mean) for k, axis in enumerate("xyz")},
            "RP_l": bootstrap(attained, largest(repeatability)),
            **_orientation("P", None if turns is None else turns[:, record]),
        }
        head = f"pose {number} (t = {ideal.time[record]:.4g} s), {cycles} cycles"
        poses.append(Pose(head, estimates, float(ideal.time[record]), attained[:, 0]))
    return tuple(poses)


def _path(ideal: Trace, since: float) -> np.ndarray:
    """Indices of records evenly along the commanded path, where the tool moves, shape (m,)."""
    speed = np.linalg.norm(ideal.velocity, axis=1)
    usable = np.flatnonzero((speed > _MOVING * speed.max()) & (ideal.time >= since))
    if not len(usable):
        return usable
    travel = cumulative_trapezoid(speed, ideal.time, initial=0.0)
    points = np.linspace(travel[usable[0]], travel[usable[-1]], PATH_POINTS)
    nearest = np.abs(travel[usable][None] - points[:, None]).argmin(axis=1)
    return np.unique(usable[nearest])


def _across(error: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Component of errors (cycles, m, 3) perpendicular to the commanded velocity (m, 3)."""
    direction = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    along = np.einsum("cmi,mi->cm", error, direction)
    return np.asarray(error - along[..., None] * direction)
