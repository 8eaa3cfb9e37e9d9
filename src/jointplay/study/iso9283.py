"""Figures of ISO 9283:1998 from simulated cycles.

Manipulating industrial robots: performance criteria and related test methods. Of the standard only
its pages of contents were seen (numbers and titles of the clauses, public previews); formulas,
conditions and numbers of cycles are from memory and from works about it. `TITLES` has the clauses.

- AP_p: distance of the barycentre of the attained poses from the command pose; AP_x, AP_y, AP_z its
  components. RP_l = mean(l) + 3 S_l, l being the distance of an attained pose from the barycentre
  and S_l its standard deviation with n - 1. vAP_p: largest distance between the barycentres of one
  command pose approached from different directions. AD_p = mean(D) - D_c, D being the distance of
  two attained poses of one cycle and D_c that of the command poses; RD_p = +-3 S_D; the same of its
  components.
- AT_p, RT_p: the same as AP and RP in planes across the command path, the largest over the path.
- AP_a = mean(a) - a_c, RP_a = +-3 S_a, likewise of b and c; AT_a, RT_a: the largest sizes of these
  over the path. a, b, c are components in world axes of the rotation vector that turns the
  commanded tool into the attained one: rotations by play are so small that the order in which the
  standard would count angles does not matter.
- 7.4 position stabilization time: from the first crossing into the limit band (the pose
  repeatability, or what is given) to when the tool stays within it. 7.5 position overshoot OV:
  largest distance from the attained pose after that crossing, zero if the tool stays in the band.
- 7.6 drift: dAP_p = |AP_p at the start - AP_p after a time|, likewise the others: what wears
  changes them; nothing else in a model changes with time.
- 8.5 at each corner of the command path: round-off error CR, the least distance of the attained
  path from the corner; overshoot CO, the largest distance from the path after the corner, on the
  side to which the way before it leads on.

Cycles (6.9): 30 for poses, distances and variation, 10 for the path, 3 for stabilization, overshoot
and corners; drift over 8 h. Conditions: 100 % of the rated load (6.6), 100, 50 and 10 % of the
rated speed (6.7), five poses in a diagonal plane of the largest cube in the working space (6.8,
`cube_motion`). Exchangeability (7.7), path accuracy on reorientation (8.4), path velocity (8.6) and
what follows are not calculated.

What differs from a test of a robot: each cycle is a run of its own, whose journals begin displaced
at random; and the command pose is where the ideal mechanism under the same drives is, so that only
play counts, not the drives' lag, calibration, heat or the measurement.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import stats

from jointplay.base.errors import JointplayError, require_a, require_positive
from jointplay.base.tables import Table
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.analysis.tool_error import Stop, rotations, stops
from jointplay.simulation.analysis.twins import ideal_simulation
from jointplay.simulation.analysis.uncertainty import IntervalEstimate
from jointplay.simulation.motion.cartesian import cartesian_path
from jointplay.simulation.motion.reference import GOES_ON, Motion
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.courses import MOST_RUNS, Trace, at_speed, errors, loaded, seeded, traces
from jointplay.study.study import run_to_the_end
from jointplay.study.wear import all_wearing, first_profile, with_worn, worn_depths

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


def accuracy(points: np.ndarray) -> np.ndarray:
    """Distance of the barycentre of the cycles from the command pose, at m points.

    Args:
        points: attained less commanded, shape (..., cycles, m, 3) [m].

    Returns:
        shape (..., m) [m].
    """
    return np.asarray(np.linalg.norm(points.mean(axis=-3), axis=-1))


def repeatability(points: np.ndarray) -> np.ndarray:
    """mean(l) + 3 S_l, l being distances from the barycentre; shapes as in `accuracy`."""
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
    """A figure whose interval is not known."""
    return IntervalEstimate(float(value), math.nan, math.nan, runs)


def _unit(symbol: str) -> str:
    kind, _, suffix = symbol.partition("_")
    return "s" if kind == "t" else "rad" if suffix in ("a", "b", "c") else "m"


def _lines(figures: Figures) -> list[str]:
    """Figures as text [mm, mrad, ms]."""
    lines = []
    for symbol, one in figures.items():
        kind, _, suffix = symbol.partition("_")
        title = "" if suffix in tuple("xyzabc") else TITLES[kind][1]
        unit = _unit(symbol)
        sign = "+-" if kind == "RD" or (unit == "rad" and kind.startswith("R")) else ""
        known = math.isfinite(one.low)
        words = one.words(1e3, f"m{unit}") if known else f"{1e3 * one.value:.4g} m{unit}"
        lines.append(f"  {symbol:<5} {title:<27}  {sign}{words}")
    return lines


def _rows(figures: Figures, times: Sequence[float]) -> list[tuple]:
    """Figures as rows of the table."""
    at = " ".join(f"{time:.6g}" for time in times)
    rows = []
    for symbol, one in figures.items():
        values = (one.value, *((one.low, one.high) if math.isfinite(one.low) else ("", "")))
        rows.append((symbol, TITLES[symbol.partition("_")[0]][0], at, *values, _unit(symbol)))
    return rows


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
        """Check the numbers."""
        for one in fields(self):
            value = getattr(self, one.name)
            least = LEAST_CYCLES if one.name in ("pose", "path") else 1
            if isinstance(value, int) and value > MOST_RUNS:
                raise JointplayError(f"at most {MOST_RUNS} cycles, got {one.name} = {value}")
            if not isinstance(value, int) or value < least:
                why = " to tell scatter" if least > 1 else ""
                raise JointplayError(
                    f"at least {least} cycles are needed{why}, got {one.name} = {value!r} "
                    f"(ISO 9283: {one.default})"
                )

    @classmethod
    def up_to(cls, most: int) -> Cycles:
        """The standard's numbers, but `most` for poses, and at most as many for the others."""
        return cls(most, min(cls.path, most), min(cls.settling, most), min(cls.cornering, most))

    @property
    def most(self) -> int:
        """Runs that are needed."""
        return max(self.pose, self.path, self.settling, self.cornering)

    @property
    def fewer(self) -> list[str]:
        """Kinds with fewer cycles than the standard asks for, and how many it asks for."""
        low = [f for f in fields(self) if getattr(self, f.name) < f.default]
        return [f"{one.default} for {one.name}" for one in low]

    def __str__(self) -> str:
        """In one line."""
        return (
            f"{self.pose} for poses and distances, {self.path} for the path, {self.settling} for "
            f"stabilization and overshoot, {self.cornering} for corners"
        )


@dataclass(frozen=True)
class Conditions:
    """What the cycles were run with (clauses 6.6 to 6.8)."""

    load: str
    """Mass at the tool, in words."""
    speed: float
    """Part of the speed that counts as rated."""
    poses: str
    """Where the tool stops, in words."""

    def __str__(self) -> str:
        """In one line."""
        return f"load: {self.load}; speed: {100 * self.speed:g} % of the motion's; {self.poses}"


@dataclass(frozen=True)
class Settling:
    """How the tool comes to rest at a stop (clauses 7.4, 7.5), over the cycles."""

    band: float
    """Limit band [m]."""
    time: float
    """Position stabilization time, mean [s]."""
    longest: float
    """The longest [s]."""
    overshoot: float
    """Position overshoot OV, the largest [m]."""
    settled: int
    """Cycles in which the tool had settled before half of the dwell was over."""


@dataclass(frozen=True)
class Pose:
    """Figures of one stop."""

    time: float
    """When the tool is looked at: the end of the stop [s]."""
    command: np.ndarray
    """Where the ideal mechanism's tool is, world axes, shape (3,) [m]."""
    attained: np.ndarray
    """Where the tool is in each cycle, less `command`, shape (cycles, 3) [m]."""
    figures: Figures
    """AP_p; AP_x, AP_y, AP_z with sign; RP_l; AP_a to RP_c if the orientation is known."""
    settling: Settling | None
    """None where the motion goes on at once: there is nothing to settle in."""


@dataclass(frozen=True)
class Variation:
    """One command pose that is approached from different directions."""

    times: tuple[float, ...]
    """When it is attained [s]."""
    figures: Figures
    """vAP_p."""


@dataclass(frozen=True)
class Distance:
    """Figures of the distance between two stops."""

    times: tuple[float, float]
    """Ends of the stops [s]."""
    command: float
    """D_c, the distance of the command poses [m]."""
    figures: Figures
    """AD_p with sign, RD_p, and the same along x, y, z."""


@dataclass(frozen=True)
class Corner:
    """Cornering deviations at one corner of the command path."""

    time: float
    """When the command is at the corner [s]."""
    angle: float
    """By which the path turns there [rad]."""
    stop: bool
    """Whether the command rests there; else it passes."""
    rounding: np.ndarray
    """CR of each cycle, shape (cycles,) [m]."""
    overshoot: np.ndarray
    """CO of each cycle, shape (cycles,) [m]."""

    @property
    def figures(self) -> Figures:
        """CR and CO, the largest of the cycles."""
        both = {"CR": self.rounding, "CO": self.overshoot}
        return {symbol: _single(sizes.max(), len(sizes)) for symbol, sizes in both.items()}


@dataclass(frozen=True)
class Drift:
    """How the pose characteristics of one stop change with time."""

    times: np.ndarray
    """Since the start, the first 0, shape (k,) [s]."""
    ap: np.ndarray
    """AP_p at these times, shape (k,) [m]."""
    rp: np.ndarray
    """RP_l, shape (k,) [m]."""
    axes: np.ndarray
    """AP_x, AP_y, AP_z, with sign, shape (k, 3) [m]."""

    @property
    def figures(self) -> Figures:
        """dAP_p, dRP_l, dAP_x, dAP_y, dAP_z over the whole time."""
        courses = np.column_stack([self.ap, self.rp, self.axes])
        names = ("dAP_p", "dRP_l", "dAP_x", "dAP_y", "dAP_z")
        changes = np.abs(courses[-1] - courses[0])
        return {name: _single(x, len(courses)) for name, x in zip(names, changes, strict=True)}


def drift(times: Sequence[float] | np.ndarray, attained: np.ndarray) -> Drift:
    """Drift of the pose characteristics of one command pose (7.6), measured or simulated.

    Args:
        times: of the groups of cycles, increasing, shape (k,), k >= 2 [s].
        attained: attained less commanded position, shape (k, cycles, 3) [m].

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
    ap, rp = (statistic(points[:, :, None])[:, 0] for statistic in (accuracy, repeatability))
    return Drift(moments - moments[0], ap, rp, points.mean(axis=1))


@dataclass(frozen=True)
class Iso9283:
    """Figures of perturbed cycles. Statistical, of simulated runs."""

    cycles: Cycles
    poses: tuple[Pose, ...]
    variations: tuple[Variation, ...]
    """None if no pose is approached from two directions."""
    path: Figures
    """AT_p, RT_p, and AT_a to RT_c if the orientation is known; none if the tool describes no path
    after `since`."""
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
    distances: tuple[Distance, ...] = ()
    """Between each stop and the next, and between the two that are farthest apart."""
    corners: tuple[Corner, ...] = ()
    drifts: Sequence[Drift] = ()
    """Of each pose, if it was asked for; in the order of `poses`."""
    drifting: str = "not looked at"
    """What drifts, or why nothing does, in words."""
    conditions: Conditions | None = None

    @property
    def accuracy(self) -> str:
        """What the figures are, and how well they are known, one line."""
        few = self.cycles.fewer
        asks = f"; the standard asks for {', '.join(few)}" if few else ""
        return (
            f"statistical, from {self.cycles.most} simulated cycles with perturbed starts "
            f"({self.cycles}){asks}; "
            f"[{100 * CONFIDENCE:g} % confidence by bootstrap over the cycles]; times to "
            f"{1e3 * self.interval:.3g} ms; against the ideal mechanism under the same drives; "
            "numerical error not included (jointplay run --certify)"
        )

    def __str__(self) -> str:
        """All figures as text [mm, mrad]."""
        lines = [] if self.conditions is None else [f"conditions: {self.conditions}"]
        for head, _, found, note in self._groups():
            lines += [f"{head}:", *_lines(found), *([f"  {note}"] if note else [])]
        if not self.poses:
            lines.append(f"no stop from {self.since:g} s on: no pose figures")
        elif not self.variations:
            lines.append("vAP_p: no pose is approached from two directions")
        if not self.corners:
            lines.append("CR, CO: the command path has no corner")
        return "\n".join([*lines, f"drift: {self.drifting}", self.accuracy])

    @property
    def table(self) -> Table:
        """A row for each figure, lengths in m, angles in rad, times in s."""
        rows: list[tuple] = []
        for _, times, found, _ in self._groups():
            rows += _rows(found, times)
        for kind, number in vars(self.cycles).items():
            rows.append((f"cycles_{kind}", "6.9", "", number, "", "", ""))
        if self.conditions is not None:
            rows.append(("speed", "6.7", "", self.conditions.speed, "", "", ""))
        words = ("figure", "clause", "time", "value", "low", "high", "unit")
        return Table.of([(word, "s" if word == "time" else "") for word in words], rows)

    def _groups(self) -> Iterator[tuple[str, Sequence[float], Figures, str]]:
        """What figures are of, in words; when; the figures; and what else there is to say."""
        for number, pose in enumerate(self.poses, 1):
            head = f"pose {number} (t = {pose.time:.4g} s), {self.cycles.pose} cycles"
            settled, note = self._settled(pose.settling)
            yield head, (pose.time,), {**pose.figures, **settled}, note
        for same in self.variations:
            at = ", ".join(f"{time:.4g}" for time in same.times)
            yield f"one pose from different directions (t = {at} s)", same.times, same.figures, ""
        if self.path:
            yield f"path, {self.cycles.path} cycles", (), self.path, ""
        for gap in self.distances:
            first, second = gap.times
            distance = f"{1e3 * gap.command:.6g} mm"
            head = f"distance from t = {first:.4g} s to {second:.4g} s, {distance}"
            yield head, gap.times, gap.figures, ""
        for corner in self.corners:
            how = "the command rests" if corner.stop else "the command passes"
            turn = f"{math.degrees(corner.angle):.3g} deg"
            head = f"corner of {turn} (t = {corner.time:.4g} s, {how})"
            yield head, (corner.time,), corner.figures, ""
        for pose, course in zip(self.poses, self.drifts, strict=bool(self.drifts)):
            hours = course.times[-1] / 3600
            head = f"drift of the pose at t = {pose.time:.4g} s over {hours:.3g} h"
            yield head, (pose.time,), course.figures, ""

    def _settled(self, found: Settling | None) -> tuple[Figures, str]:
        """Figures of how the tool comes to rest, and words on them."""
        if found is None:
            return {}, "stabilization, overshoot: the motion does not dwell here"
        band, missed = f"limit band {1e3 * found.band:.4g} mm", self.cycles.settling - found.settled
        if missed:
            return {}, (
                f"stabilization, overshoot: still outside the {band} at half of the dwell in "
                f"{missed} of {self.cycles.settling} cycles: a longer dwell is needed"
            )
        longest = f"longest {1e3 * found.longest:.4g} ms"
        note = f"stabilization time: mean ({longest}, {band}); overshoot: the largest"
        both = {"t_stabilization": found.time, "OV": found.overshoot}
        return {symbol: _single(x, self.cycles.settling) for symbol, x in both.items()}, note


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
    conditions = Conditions(_load_words(simulation, load), speed, poses)
    simulation = loaded(at_speed(simulation, speed), load)
    wears = what_drifts(simulation)
    if drift_time is not None:
        if require_positive("time of the drift", drift_time, "s") > LONGEST_DRIFT_S:
            raise JointplayError(
                f"time of the drift must be at most {LONGEST_DRIFT_S:g} s (100 years), got "
                f"{drift_time:g} s"
            )
        if not all_wearing(simulation):
            raise JointplayError(f"drift: {wears}")

    def run(group: Sequence[Simulation]) -> list[Trace]:
        return traces(group, jobs=jobs, keep=keep, progress=progress, what="cycles")

    assert simulation.motion is not None
    ideal, *courses = run([ideal_simulation(simulation), *seeded(simulation, counts.most)])
    since = simulation.judged_from
    found = figures(courses, ideal, simulation.motion, since, band=band, cycles=counts)
    found = replace(found, drifting=wears, conditions=conditions)
    if drift_time is None:
        return found
    parts = []
    for number, worn in enumerate(_worn(simulation, drift_time)):
        again = courses[:DRIFT_CYCLES] if number == 0 else []
        again += run(seeded(worn, DRIFT_CYCLES)[len(again) :])
        parts.append(errors(again, ideal))
    times = np.linspace(0.0, drift_time, DRIFT_TIMES + 1)
    at = [int(np.abs(ideal.time - pose.time).argmin()) for pose in found.poses]
    return replace(
        found,
        drifts=[drift(times, np.stack([part[:, k] for part in parts])) for k in at],
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
    worn = {name: first_profile(one) for name, one in all_wearing(simulation).items()}
    assert simulation.motion is not None
    cycle = simulation.motion.duration if simulation.duration is None else simulation.duration
    count = time / DRIFT_TIMES / cycle
    found = [simulation]
    for _ in range(DRIFT_TIMES):
        depths = worn_depths(run_to_the_end(found[-1], "a cycle that wears"))
        worn = {name: worn[name] + count * depths[name] for name in worn}
        found.append(with_worn(simulation, worn))
    return found


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
    poses = []
    for stop in halts:
        at = int(np.abs(time - stop.end).argmin())
        attained = error[: counts.pose, at : at + 1]
        found = {
            "AP_p": bootstrap(attained, largest(accuracy)),
            **{f"AP_{axis}": bootstrap(attained[:, 0, k], _mean) for k, axis in enumerate("xyz")},
            "RP_l": bootstrap(attained, largest(repeatability)),
            **_orientation("P", None if turns is None else turns[: counts.pose, at]),
        }
        leave = max([0.0, *(other.end for other in halts if other.end < stop.start)])
        limit = found["RP_l"].value if band is None else band
        settling = _settling(runs[: counts.settling], time, leave, stop, limit)
        poses.append(Pose(float(time[at]), ideal.position[at], attained[:, 0], found, settling))
    points = _path(ideal, since)
    path: dict[str, IntervalEstimate] = {}
    across = _across(error[: counts.path, points], ideal.velocity[points])
    if len(points):
        path["AT_p"] = bootstrap(across, largest(accuracy))
        path["RT_p"] = bootstrap(across, largest(repeatability))
        path |= _orientation("T", None if turns is None else turns[: counts.path, points])
    return Iso9283(
        counts,
        tuple(poses),
        tuple(_variations(poses, motion)),
        path,
        time[points],
        accuracy(across),
        repeatability(across),
        since,
        float(np.median(np.diff(time))),
        _distances(poses),
        _corners(runs[: counts.cornering], ideal, waypoints, since),
    )


def _settling(
    runs: Sequence[Trace], time: np.ndarray, leave: float, stop: Stop, band: float
) -> Settling | None:
    """How the tool, which left the stop before at `leave` [s], comes to rest at this one."""
    dwell = time[(time >= stop.start) & (time <= stop.end)]
    if len(dwell) < 3:
        return None
    inside = (time >= leave) & (time <= stop.end)
    moments, half = time[inside], 0.5 * (dwell[0] + dwell[-1])
    took, beyond, settled = [], [], 0
    for run in runs:
        course = run.position[inside]
        distance = np.linalg.norm(course - course[-1], axis=1)
        outside = np.flatnonzero(distance > band)
        if not len(outside):  # never left: nothing to settle
            took.append(0.0)
            beyond.append(0.0)
            settled += 1
            continue
        first = outside[0] + int((distance[outside[0] :] <= band).argmax())
        last = max(outside[-1] + 1, first)
        took.append(float(moments[last] - moments[first]))
        farthest = float(distance[first:].max())
        beyond.append(farthest if farthest > band else 0.0)
        settled += int(moments[last] <= half)
    return Settling(band, float(np.mean(took)), max(took), max(beyond), settled)


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


def _variations(poses: Sequence[Pose], motion: Motion) -> list[Variation]:
    """Stops at one place that are approached from different directions, judged together."""
    places: dict[tuple[float, ...], list[tuple[Pose, np.ndarray]]] = {}
    for pose in poses:
        here = motion(np.array([pose.time]))[0][0]
        earlier = [
            row
            for time, row in zip(motion.times, motion.positions, strict=True)
            if time < pose.time and not np.allclose(row, here, 0.0, 1e-9)
        ]
        if earlier:
            way = here - earlier[-1]
            key = tuple(np.round(here, 8))
            places.setdefault(key, []).append((pose, way / np.linalg.norm(way)))
    variations = []
    for group in places.values():
        first = group[0][1]
        if any(float(first @ way) < math.cos(_OTHER_WAY) for _, way in group[1:]):
            together = np.stack([pose.attained for pose, _ in group], axis=1)
            times = tuple(pose.time for pose, _ in group)
            variations.append(Variation(times, {"vAP_p": bootstrap(together, variation)}))
    return variations


def _distances(poses: Sequence[Pose]) -> tuple[Distance, ...]:
    """Of each stop and the next, and of the two that are farthest apart."""
    if len(poses) < 2:
        return ()
    places = np.array([pose.command for pose in poses])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    first, second = sorted(map(int, np.unravel_index(apart.argmax(), apart.shape)))
    pairs = dict.fromkeys([*pairwise(range(len(poses))), (first, second)])
    return tuple(_distance(poses[a], poses[b]) for a, b in pairs if apart[a, b] > _SHORTEST_M)


def _distance(one: Pose, other: Pose) -> Distance:
    command = other.command - one.command
    far = float(np.linalg.norm(command))
    between = command + other.attained - one.attained  # (cycles, 3)
    excess = {"p": np.linalg.norm(between, axis=1) - far}
    excess |= {axis: between[:, k] - command[k] for k, axis in enumerate("xyz")}
    found = {
        f"{letter}D_{suffix}": bootstrap(values, statistic)
        for suffix, values in excess.items()
        for letter, statistic in (("A", _mean), ("R", _scatter))
    }
    return Distance((one.time, other.time), far, found)


def _corners(
    runs: Sequence[Trace], ideal: Trace, waypoints: Sequence[Stop], since: float
) -> tuple[Corner, ...]:
    """Waypoints at which the commanded tool changes its direction, and how the cycles take them."""
    found = []
    for before, here, after in zip(waypoints, waypoints[1:], waypoints[2:], strict=False):
        if here.start < since:
            continue
        first = (ideal.time >= before.end) & (ideal.time <= here.start)
        second = (ideal.time >= here.end) & (ideal.time <= after.start)
        way_in, way_out = _thinned(ideal.position[first]), _thinned(ideal.position[second])
        if way_in is None or way_out is None:
            continue
        corner, come = way_in[-1], _heading(way_in[::-1])
        go = _heading(way_out)
        angle = math.acos(min(max(float(-come @ go), -1.0), 1.0))
        if not _CORNER <= angle <= math.pi - _CORNER:
            continue
        on = -come + float(come @ go) * go  # whither the way in leads on, across the way out
        on /= np.linalg.norm(on)
        near = (ideal.time >= 0.5 * (before.end + here.start)) & (
            ideal.time <= 0.5 * (here.end + after.start)
        )
        rounding = [np.linalg.norm(run.position[near] - corner, axis=1).min() for run in runs]
        overshoot = []
        for run in runs:
            off = _off(run.position[second], way_out)
            outside = off[off @ on > 0.0]
            overshoot.append(float(np.linalg.norm(outside, axis=1).max(initial=0.0)))
        found.append(
            Corner(here.start, angle, here.at_rest, np.array(rounding), np.array(overshoot))
        )
    return tuple(found)


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
