"""Figures of ISO 9283:1998 from simulated cycles."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import stats

from jointplay.analysis.runs import MOST_RUNS, Trace, errors, traces
from jointplay.analysis.tool_error import Stop, stops
from jointplay.analysis.twins import ideal_simulation
from jointplay.analysis.uncertainty import IntervalEstimate
from jointplay.core.errors import JointplayError, require_positive
from jointplay.design.wear import all_wearing, depth_of, first_profile, with_worn
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.payload import Payload
from jointplay.motion.cartesian import cartesian_motion
from jointplay.motion.reference import GOES_ON, Motion
from jointplay.simulation.ensemble import run_to_the_end
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation


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


def settling(
    runs: Sequence[Trace],
    window: tuple[np.ndarray, np.ndarray, np.ndarray],
    time: np.ndarray,
    band: float,
) -> Settling | None:
    """How the tool comes to rest in the window (from leaving on, dwelling, until the end)."""
    after, dwelling, before = window
    if (dwelling & before).sum() < 3:
        return None
    inside = after & before
    moments = time[inside]
    half = 0.5 * (time[dwelling & before][0] + time[dwelling & before][-1])
    took, over, settled = [], [], 0
    for run in runs:
        course = run.position[inside]
        distance = np.linalg.norm(course - course[-1], axis=1)
        outside = np.flatnonzero(distance > band)
        if not len(outside):  # never left: nothing to settle
            took.append(0.0)
            over.append(0.0)
            settled += 1
            continue
        first = int(np.flatnonzero((distance <= band) & (np.arange(len(distance)) > outside[0]))[0])
        last = int(outside[-1]) + 1
        took.append(float(moments[max(last, first)] - moments[first]))
        beyond = distance[first:].max()
        over.append(float(beyond) if beyond > band else 0.0)
        settled += int(moments[max(last, first)] <= half)
    return Settling(band, float(np.mean(took)), max(took), max(over), settled)


def settling_words(how: Settling | None, cycles: int) -> list[str]:
    """What is printed of it."""
    if how is None:
        return ["  stabilization, overshoot: the motion does not dwell here"]
    band = f"limit band {1e3 * how.band:.4g} mm"
    if how.settled < cycles:
        return [
            f"  stabilization, overshoot: still outside the {band} at half of the dwell in "
            f"{cycles - how.settled} of {cycles} cycles: a longer dwell tells"
        ]
    return [
        f"  position stabilization time {1e3 * how.time:.4g} ms in the mean, longest "
        f"{1e3 * how.longest:.4g} ms ({band})",
        f"  OV    position overshoot  {1e3 * how.overshoot:.4g} mm, the largest",
    ]


# Accuracy and repeatability of points that cycles attain, and how well they are known.


CONFIDENCE = 0.95
RESAMPLES = 999
"""Resamples of the bootstrap."""


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


Statistic = Callable[[np.ndarray], np.ndarray]
"""Of points (..., cycles, m, 3)."""


def largest(statistic: Statistic) -> Statistic:
    """The statistic's largest value over the points."""
    return lambda points: np.asarray(statistic(points).max(axis=-1))


def along(points: np.ndarray, axis: int) -> IntervalEstimate:
    """Mean of the first point along an axis, and its interval."""
    return bootstrap(points, lambda some: np.asarray(some[..., 0, axis].mean(axis=-1)))


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


# Orientation figures of ISO 9283: the tool's rotations a, b, c about x, y, z in many cycles.
#
# - 7.2.1 AP_a = mean(a) - a_c, likewise b and c;
# - 7.2.2 RP_a = +-3 S_a, S_a being the standard deviation over the cycles with n - 1;
# - 8.2 AT_a = max |mean(a) - a_c| and 8.3 RT_a = max 3 S_a over the path.
#
# a, b, c are components in world axes of the rotation vector that turns the commanded tool into
# the attained one: rotations by play are so small that it does not matter in which order angles
# of the standard would be counted.


ANGLES = ("a", "b", "c")
"""Rotations about x, y and z."""
Three = tuple[IntervalEstimate, IntervalEstimate, IntervalEstimate]


@dataclass(frozen=True)
class Orientation:
    """How truly and how repeatably the tool is turned, about x, y and z [rad]."""

    accuracy: Three
    """AP_a, AP_b, AP_c with sign; along a path the largest size."""
    repeatability: Three
    """RP_a, RP_b, RP_c, each to be read as +-; along a path the largest."""

    def words(self, kind: str) -> list[str]:
        """Lines of text [mrad]; `kind` is P for a pose, T for a path."""
        lines = []
        for sort, sign, three in (("A", "", self.accuracy), ("R", "+-", self.repeatability)):
            for angle, one in zip(ANGLES, three, strict=True):
                name = f"{sort}{kind}_{angle}"
                lines.append(f"  {name:<24}  {sign}{one.words(1e3, 'mrad')}")
        return lines

    def rows(self, kind: str, clauses: tuple[str, str], time: str) -> list[str]:
        """Rows of the table of figures."""
        both = (("A", clauses[0], self.accuracy), ("R", clauses[1], self.repeatability))
        return [
            f"{sort}{kind}_{angle},{clause},{time},{one.value:.6g},{one.low:.6g},{one.high:.6g},rad"
            for sort, clause, three in both
            for angle, one in zip(ANGLES, three, strict=True)
        ]


def turns_of(runs: Sequence[Trace], ideal: Trace) -> np.ndarray | None:
    """Rotations of the tool from where it was to be, (cycles, records, 3) [rad].

    None if the orientation was not recorded.
    """
    from scipy.spatial.transform import Rotation

    if ideal.orientation is None:
        return None
    back = Rotation.from_quat(ideal.orientation[:, [1, 2, 3, 0]]).inv()
    found = []
    for run in runs:
        if run.orientation is None:
            return None
        found.append((Rotation.from_quat(run.orientation[:, [1, 2, 3, 0]]) * back).as_rotvec())
    return np.stack(found)


def at_pose(turns: np.ndarray | None) -> Orientation | None:
    """Figures of a pose: rotations (cycles, 3)."""
    if turns is None:
        return None

    def each(axis: int) -> tuple[IntervalEstimate, IntervalEstimate]:
        points = turns[:, axis]
        return (
            bootstrap(points, lambda some: np.asarray(some.mean(axis=-1))),
            bootstrap(points, lambda some: 3.0 * np.asarray(some.std(axis=-1, ddof=1))),
        )

    return _both([each(axis) for axis in range(3)])


def along_path(turns: np.ndarray | None) -> Orientation | None:
    """Figures of a path: rotations at its points (cycles, points, 3)."""
    if turns is None or not turns.shape[1]:
        return None

    def each(axis: int) -> tuple[IntervalEstimate, IntervalEstimate]:
        points = turns[:, :, axis]
        return (
            bootstrap(points, lambda some: np.abs(some.mean(axis=-2)).max(axis=-1)),
            bootstrap(points, lambda some: 3.0 * some.std(axis=-2, ddof=1).max(axis=-1)),
        )

    return _both([each(axis) for axis in range(3)])


def _both(pairs: list[tuple[IntervalEstimate, IntervalEstimate]]) -> Orientation:
    (a, ra), (b, rb), (c, rc) = pairs
    return Orientation((a, b, c), (ra, rb, rc))


# ISO 9283:1998, Manipulating industrial robots: performance criteria and related test methods.
# Names and symbols are those of its clauses. Seen of the standard were its pages of contents only
# (numbers and titles of the clauses, public previews); formulas, conditions and numbers of cycles
# are from memory and from works about it.
#
# - 7.2 pose accuracy AP_p, AP_x, AP_y, AP_z: distance of the barycentre of the attained poses from
#   the command pose; pose repeatability RP_l = mean(l) + 3 S_l, l being the distance of an attained
#   pose from the barycentre, S_l its standard deviation with n - 1; multi-directional pose accuracy
#   variation vAP_p: largest distance between the barycentres of the same command pose approached
#   from different directions;
# - 7.3 distance accuracy AD_p = mean(D) - D_c, D being the distance between two attained poses of
# one
#   cycle and D_c that between the command poses; distance repeatability RD_p = +-3 S_D; the same of
#   its components x, y, z;
# - 7.4 position stabilization time: from the first crossing into the limit band to when the tool
#   stays within it; the limit band is the pose repeatability, or what is given;
# - 7.5 position overshoot OV: largest distance from the attained pose after that crossing, zero
#   if the tool stays within the limit band;
# - 7.6 drift of pose characteristics: dAP_p = |AP_p at the start - AP_p after a time|, dRP_l
#   likewise: what wears changes them (`drift_by_wear`); nothing else in a model changes with time;
# - 8.2 path accuracy AT_p, 8.3 path repeatability RT_p: the same as AP and RP, in planes across the
#   command path, the largest over the path;
# - 8.5 cornering deviations at each corner of the command path: round-off error CR, the least
#   distance of the attained path from the corner; overshoot CO, the largest distance from the path
#   after the corner, on the side to which the way before it leads on;
# - the same of orientation, AP_a, AP_b, AP_c and their kin: below.
#
# Cycles (6.9): 30 for poses, distances and variation, 10 for the path, 3 for stabilization,
# overshoot and corners; drift over 8 h. Conditions: 100 % of the rated load (6.6), 100, 50 and 10
# % of the rated speed (6.7), five poses in a diagonal plane of the largest cube in the working
# space (6.8, `cube_motion`). Exchangeability (7.7), path accuracy on reorientation (8.4), path
# velocity (8.6) and what follows are not reckoned.
#
# What differs from a test of a robot: each cycle is a run of its own, whose journals begin
# displaced at random; and the command pose is where the ideal mechanism under the same drives is,
# so that only play counts, not the drives' lag, calibration, heat or the measurement.


LEAST_CYCLES = 3
"""With fewer, nothing can be said of the scatter."""
LONGEST_DRIFT_S = 3.2e9
"""Longest time over which wear is extrapolated: a hundred years [s]."""
DRIFT_CYCLES = 10
"""Cycles at each time at which a drift is looked at."""
DRIFT_TIMES = 4
"""How often it is looked at after the start."""
PATH_POINTS = 100
"""Points along the path at which AT and RT are reckoned, at most."""
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
        if not isinstance(most, int) or most < LEAST_CYCLES:
            raise JointplayError(
                f"at least {LEAST_CYCLES} cycles are needed to tell scatter, got {most!r} "
                f"(ISO 9283: {cls.pose})"
            )
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
class Pose:
    """Figures of one stop."""

    time: float
    """When the tool is looked at: the end of the stop [s]."""
    command: np.ndarray
    """Where the ideal mechanism's tool is, world axes, shape (3,) [m]."""
    attained: np.ndarray
    """Where the tool is in each cycle, less `command`, shape (cycles, 3) [m]."""
    ap: IntervalEstimate
    """AP_p [m]."""
    axes: tuple[IntervalEstimate, IntervalEstimate, IntervalEstimate]
    """AP_x, AP_y, AP_z, with sign [m]."""
    rp: IntervalEstimate
    """RP_l [m]."""
    settling: Settling | None
    """None where the motion goes on at once: there is nothing to settle in."""
    orientation: Orientation | None = None
    """AP_a to RP_c; None if the orientation is not known."""


@dataclass(frozen=True)
class Variation:
    """vAP of one command pose that is approached from different directions."""

    times: tuple[float, ...]
    """When it is attained [s]."""
    vap: IntervalEstimate
    """vAP_p [m]."""


@dataclass(frozen=True)
class Distance:
    """Figures of the distance between two stops."""

    times: tuple[float, float]
    """Ends of the stops [s]."""
    command: float
    """D_c, the distance of the command poses [m]."""
    ad: IntervalEstimate
    """AD_p, with sign [m]."""
    rd: IntervalEstimate
    """RD_p, to be read as +- [m]."""
    axes: tuple[tuple[IntervalEstimate, IntervalEstimate], ...]
    """AD and RD along x, y, z [m]."""


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
    def cr(self) -> float:
        """CR, the largest of the cycles [m]."""
        return float(self.rounding.max())

    @property
    def co(self) -> float:
        """CO, the largest of the cycles [m]."""
        return float(self.overshoot.max())


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
    def dap(self) -> float:
        """dAP_p over the whole time [m]."""
        return float(abs(self.ap[-1] - self.ap[0]))

    @property
    def drp(self) -> float:
        """dRP_l over the whole time [m]."""
        return float(abs(self.rp[-1] - self.rp[0]))

    @property
    def daxes(self) -> np.ndarray:
        """dAP_x, dAP_y, dAP_z, shape (3,) [m]."""
        return np.asarray(np.abs(self.axes[-1] - self.axes[0]))


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
        raise JointplayError("a drift needs two increasing times or more")
    if points.ndim != 3 or len(points) != len(moments) or points.shape[2] != 3:
        raise JointplayError(
            f"attained poses must have the shape ({len(moments)}, cycles, 3), got {points.shape}"
        )
    if points.shape[1] < LEAST_CYCLES:
        raise JointplayError(f"at least {LEAST_CYCLES} cycles are needed, got {points.shape[1]}")
    alone = points[:, :, None]
    return Drift(
        moments - moments[0],
        accuracy(alone)[:, 0],
        repeatability(alone)[:, 0],
        points.mean(axis=1),
    )


@dataclass(frozen=True)
class Iso9283:
    """Figures of perturbed cycles. Statistical, of simulated runs."""

    cycles: Cycles
    poses: tuple[Pose, ...]
    variations: tuple[Variation, ...]
    """None if no pose is approached from two directions."""
    at: IntervalEstimate | None
    """AT_p [m]; None if the tool describes no path after `since`."""
    rt: IntervalEstimate | None
    """RT_p [m]."""
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
    path_orientation: Orientation | None = None
    """AT_a to RT_c; None without a path, or if the orientation is not known."""
    distances: tuple[Distance, ...] = ()
    """Between each stop and the next, and between the two that are farthest apart."""
    corners: tuple[Corner, ...] = ()
    drifts: tuple[Drift, ...] = ()
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
        for number, pose in enumerate(self.poses, 1):
            lines.append(f"pose {number} (t = {pose.time:.4g} s), {self.cycles.pose} cycles:")
            lines.append(f"  AP_p  pose accuracy       {pose.ap.words(1e3, 'mm')}")
            for axis, one in zip("xyz", pose.axes, strict=True):
                lines.append(f"  AP_{axis}                      {one.words(1e3, 'mm')}")
            lines.append(f"  RP_l  pose repeatability  {pose.rp.words(1e3, 'mm')}")
            lines += [] if pose.orientation is None else pose.orientation.words("P")
            lines += settling_words(pose.settling, self.cycles.settling)
        for gap in self.distances:
            lines.append(
                f"distance from t = {gap.times[0]:.4g} s to {gap.times[1]:.4g} s, "
                f"{1e3 * gap.command:.6g} mm:"
            )
            lines.append(f"  AD_p  distance accuracy       {gap.ad.words(1e3, 'mm')}")
            lines.append(f"  RD_p  distance repeatability  +-{gap.rd.words(1e3, 'mm')}")
        for same in self.variations:
            at = ", ".join(f"{time:.4g}" for time in same.times)
            lines.append(
                f"vAP_p  multi-directional pose accuracy variation (t = {at} s) "
                f"{same.vap.words(1e3, 'mm')}"
            )
        if not self.poses:
            lines.append(f"no stop from {self.since:g} s on: no pose figures")
        elif not self.variations:
            lines.append("vAP_p: no pose is approached from two directions")
        if self.at is not None and self.rt is not None:
            lines.append(f"AT_p  path accuracy       {self.at.words(1e3, 'mm')}")
            lines.append(f"RT_p  path repeatability  {self.rt.words(1e3, 'mm')}")
        if self.path_orientation is not None:
            lines += self.path_orientation.words("T")
        for corner in self.corners:
            how = "the command rests" if corner.stop else "the command passes"
            lines.append(
                f"corner of {math.degrees(corner.angle):.3g} deg (t = {corner.time:.4g} s, {how}): "
                f"CR round-off error {1e3 * corner.cr:.4g} mm, "
                f"CO overshoot {1e3 * corner.co:.4g} mm"
            )
        if not self.corners:
            lines.append("CR, CO: the command path has no corner")
        for pose, course in zip(self.poses, self.drifts, strict=bool(self.drifts)):
            lines.append(
                f"drift of the pose at t = {pose.time:.4g} s over {course.times[-1] / 3600:.3g} h: "
                f"dAP_p {1e3 * course.dap:.4g} mm, dRP_l {1e3 * course.drp:.4g} mm"
            )
        lines.append(f"drift: {self.drifting}")
        return "\n".join([*lines, self.accuracy])

    def csv(self) -> str:
        """A row for each figure, lengths in m, angles in rad, times in s."""
        rows = ["figure,clause,time_s,value,low,high,unit"]

        def row(name: str, clause: str, time: str, one: IntervalEstimate) -> None:
            rows.append(f"{name},{clause},{time},{one.value:.6g},{one.low:.6g},{one.high:.6g},m")

        for pose in self.poses:
            time = f"{pose.time:.6g}"
            row("AP_p", "7.2.1", time, pose.ap)
            for axis, one in zip("xyz", pose.axes, strict=True):
                row(f"AP_{axis}", "7.2.1", time, one)
            row("RP_l", "7.2.2", time, pose.rp)
            if pose.orientation is not None:
                rows += pose.orientation.rows("P", ("7.2.1", "7.2.2"), time)
            if pose.settling is not None and pose.settling.settled == self.cycles.settling:
                rows.append(f"t_stabilization,7.4,{time},{pose.settling.time:.6g},,,s")
                rows.append(f"OV,7.5,{time},{pose.settling.overshoot:.6g},,,m")
        for one_pose in self.variations:
            times = " ".join(f"{time:.6g}" for time in one_pose.times)
            row("vAP_p", "7.2.3", times, one_pose.vap)
        if self.at is not None and self.rt is not None:
            row("AT_p", "8.2", "", self.at)
            row("RT_p", "8.3", "", self.rt)
        if self.path_orientation is not None:
            rows += self.path_orientation.rows("T", ("8.2", "8.3"), "")
        for gap in self.distances:
            times = " ".join(f"{time:.6g}" for time in gap.times)
            pairs = zip("pxyz", ((gap.ad, gap.rd), *gap.axes), strict=True)
            for axis, (ad, rd) in pairs:
                row(f"AD_{axis}", "7.3", times, ad)
                row(f"RD_{axis}", "7.3", times, rd)
        for corner in self.corners:
            rows.append(f"CR,8.5,{corner.time:.6g},{corner.cr:.6g},,,m")
            rows.append(f"CO,8.5,{corner.time:.6g},{corner.co:.6g},,,m")
        for pose, course in zip(self.poses, self.drifts, strict=bool(self.drifts)):
            names = ("dAP_p", "dRP_l", "dAP_x", "dAP_y", "dAP_z")
            values = zip(names, (course.dap, course.drp, *course.daxes), strict=True)
            rows += [f"{name},7.6,{pose.time:.6g},{value:.6g},,,m" for name, value in values]
        for kind in fields(self.cycles):
            rows.append(f"cycles_{kind.name},6.9,,{getattr(self.cycles, kind.name)},,,")
        if self.conditions is not None:
            rows.append(f"speed,6.7,,{self.conditions.speed:.6g},,,")
        return "\n".join([*rows, ""])


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
    """Run perturbed cycles, and reckon their figures.

    Args:
        simulation: one cycle of the machine; some joint or gear has play.
        cycles: how many for figures of each kind; a number is that for poses, see `Cycles.up_to`.
            Seeds are 1, 2, ... (or from the simulation's own seed on).
        band: limit band of the stabilization time [m]; None: the pose repeatability.
        speed: part of the motion's speed at which it is run.
        load: mass at the tool besides the simulation's own payloads [kg].
        drift_time: over which the drift by wear is reckoned [s]; None: it is not.
        poses: where the stops are, in words.
        jobs: processes; None takes one for each core.
        keep: folder in which runs are kept, so that an interrupted call can go on.
        progress: show a bar on standard error.

    Raises:
        JointplayError: too few cycles, no motion, no play, a drift though nothing wears, or a run
            that fails.
    """
    counts = cycles if isinstance(cycles, Cycles) else Cycles.up_to(cycles)
    check(simulation, speed, load)
    conditions = Conditions(_load_words(simulation, load), speed, poses)
    simulation = _at(simulation, speed, load)
    if drift_time is not None:
        require_positive("time of the drift", drift_time, "s")
        if drift_time > LONGEST_DRIFT_S:
            raise JointplayError(
                f"time of the drift must be at most {LONGEST_DRIFT_S:g} s (100 years), got "
                f"{drift_time:g} s"
            )
    if drift_time is not None and not all_wearing(simulation):
        raise JointplayError(f"drift: {what_drifts(simulation)}")

    def run(group: Sequence[Simulation]) -> list[Trace]:
        return traces(group, jobs=jobs, keep=keep, progress=progress, what="cycles")

    assert simulation.motion is not None
    since = simulation.judged_from
    ideal, *courses = run([ideal_simulation(simulation), *_perturbed(simulation, counts.most)])
    found = figures(courses, ideal, simulation.motion, since, band=band, cycles=counts)
    drifts: tuple[Drift, ...] = ()
    words = what_drifts(simulation)
    if drift_time is not None:
        groups = _worn(simulation, drift_time)
        parts = []
        for number, group in enumerate(groups):
            again = courses[:DRIFT_CYCLES] if number == 0 else []
            again += run(_perturbed(group, DRIFT_CYCLES)[len(again) :])
            parts.append(errors(again, ideal))
        times = np.linspace(0.0, drift_time, len(groups))
        at = [int(np.abs(ideal.time - pose.time).argmin()) for pose in found.poses]
        drifts = tuple(drift(times, np.stack([part[:, k] for part in parts])) for k in at)
        words += f", extrapolated from {DRIFT_TIMES} blocks of equal cycles"
    return replace(found, drifts=drifts, drifting=words, conditions=conditions)


def what_drifts(simulation: Simulation) -> str:
    """What changes with time in a model, in words."""
    names = ", ".join(map(repr, all_wearing(simulation)))
    if not names:
        return "nothing in this model drifts: no joint has a wear_rate, and there is no heat"
    return f"by the wear of {names} only; there is no heat"


def _perturbed(simulation: Simulation, number: int) -> list[Simulation]:
    first = 1 if simulation.seed is None else simulation.seed
    return [replace(simulation, seed=first + k) for k in range(number)]


def _worn(simulation: Simulation, time: float) -> list[Simulation]:
    """The machine at `DRIFT_TIMES` + 1 equally spaced times, its bores worn by all cycles before.

    Each block's wear is that of one run with the bores as the block finds them.
    """
    worn = {name: first_profile(one) for name, one in all_wearing(simulation).items()}
    cycle = simulation.duration
    if cycle is None:
        assert simulation.motion is not None
        cycle = simulation.motion.duration
    count = time / DRIFT_TIMES / cycle
    found = [simulation]
    for _ in range(DRIFT_TIMES):
        result = run_to_the_end(found[-1], "a cycle that wears")
        bores = all_wearing(found[-1])
        worn = {name: worn[name] + count * depth_of(bores[name], result, name) for name in worn}
        found.append(with_worn(simulation, worn))
    return found


def _at(simulation: Simulation, speed: float, load: float) -> Simulation:
    """The simulation at a part of its speed, with a mass at its tool."""
    if speed != 1.0:
        assert simulation.motion is not None
        lasts = None if simulation.duration is None else simulation.duration / speed
        simulation = replace(simulation, motion=simulation.motion.at_speed(speed), duration=lasts)
    if load:
        mass = Payload(simulation.mechanism.tool, load)
        simulation = replace(simulation, payloads=(*simulation.payloads, mass))
    return simulation


def _load_words(simulation: Simulation, load: float) -> str:
    parts = [f"{one.mass:g} kg at {one.frame!r} as given" for one in simulation.payloads]
    if load:
        parts.append(f"{load:g} kg at {simulation.mechanism.tool!r} (taken for 100 %)")
    return ", ".join(parts) or "none (the rated load is not known)"


def check(simulation: Simulation, speed: float = 1.0, load: float = 0.0) -> None:
    """Raise a JointplayError on what has no such figures, or cannot be run so."""
    if simulation.motion is None:
        raise JointplayError("ISO 9283 judges a motion, and this simulation has none")
    if not (simulation.mechanism.clearance or simulation.mechanism.gears):
        raise JointplayError("no joint or gear has play: every cycle would be the same")
    joints = simulation.mechanism.clearance.values()
    if all(getattr(joint, "ideal", False) for joint in joints):
        raise JointplayError("no joint has clearance: seeds displace journals, and there are none")
    Run(_at(simulation, speed, load))


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
        mechanism: a robot without loops; its tool is led, its orientation left free.
        centre, edge: see `cube_poses`.
        dwell: rest at each pose [s].
        start: see `cartesian_motion`.

    Raises:
        JointplayError: a pose out of reach, a joint that moves and has no limit of speed.
    """
    require_positive("dwell", dwell, "s")
    order = [0, 4, 3, 2, 1, 0]
    places = cube_poses(centre, edge)[order]
    found = cartesian_motion(mechanism, np.arange(len(order), dtype=float), places, start=start)
    q = np.array(found.positions)
    q[-1] = q[0]  # the same pose in the same configuration
    most = np.zeros(len(found.joints))
    for k, name in enumerate(found.joints):
        limit = mechanism.description.joints[name].speed
        if np.ptp(q[:, k]) > 0.0 and limit is None:
            raise JointplayError(
                f"joint {name!r} has no limit of speed in the URDF: give a motion instead of a cube"
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
        raise JointplayError(f"{counts.most} cycles are asked for, and there are {len(runs)}")
    if band is not None:
        require_positive("limit band", band, "m")
    time = ideal.time
    error = errors(runs, ideal)
    turns = turns_of(runs, ideal)
    waypoints = stops(motion, float(time[-1])) if _stops(motion) else []
    halts = [one for one in waypoints if one.at_rest and one.end >= since and one.end > 0.0]
    poses = []
    for stop in halts:
        at = int(np.abs(time - stop.end).argmin())
        attained = error[: counts.pose, at : at + 1]
        rp = bootstrap(attained, largest(repeatability))
        leave = max([0.0, *(other.end for other in halts if other.end < stop.start)])
        window = (time >= leave, time >= stop.start, time <= stop.end)
        poses.append(
            Pose(
                float(time[at]),
                ideal.position[at],
                attained[:, 0],
                bootstrap(attained, largest(accuracy)),
                (along(attained, 0), along(attained, 1), along(attained, 2)),
                rp,
                settling(runs[: counts.settling], window, time, rp.value if band is None else band),
                at_pose(None if turns is None else turns[: counts.pose, at]),
            )
        )
    points = _path(ideal, since)
    passed = error[: counts.path, points]
    across = _across(passed, ideal.velocity[points]) if len(points) else None
    return Iso9283(
        counts,
        tuple(poses),
        tuple(_variations(poses, motion)),
        None if across is None else bootstrap(across, largest(accuracy)),
        None if across is None else bootstrap(across, largest(repeatability)),
        time[points],
        np.zeros(0) if across is None else accuracy(across),
        np.zeros(0) if across is None else repeatability(across),
        since,
        float(np.median(np.diff(time))),
        along_path(None if turns is None else turns[: counts.path, points]),
        _distances(poses),
        _corners(runs[: counts.cornering], ideal, waypoints, since),
    )


def _stops(motion: Motion) -> bool:
    return motion.interpolation not in GOES_ON


def _path(ideal: Trace, since: float) -> np.ndarray:
    """Records evenly along the way of the commanded tool while it moves, shape (m,)."""
    speed = np.linalg.norm(ideal.velocity, axis=1)
    if speed.max() <= 0.0:
        return np.zeros(0, int)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(ideal.time))])
    usable = np.flatnonzero((speed > _MOVING * speed.max()) & (ideal.time >= since))
    if not len(usable):
        return usable
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
            variations.append(Variation(times, bootstrap(together, variation)))
    return variations


def _distances(poses: Sequence[Pose]) -> tuple[Distance, ...]:
    """Of each stop and the next, and of the two that are farthest apart."""
    if len(poses) < 2:
        return ()
    places = np.array([pose.command for pose in poses])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    first, second = sorted(map(int, np.unravel_index(apart.argmax(), apart.shape)))
    pairs = dict.fromkeys([*((k, k + 1) for k in range(len(poses) - 1)), (first, second)])
    return tuple(_distance(poses[a], poses[b]) for a, b in pairs if apart[a, b] > _SHORTEST_M)


def _distance(one: Pose, other: Pose) -> Distance:
    command = other.command - one.command
    far = float(np.linalg.norm(command))
    between = (command + other.attained - one.attained)[:, None]  # (cycles, 1, 3)

    def both(length: Statistic, wanted: float) -> tuple[IntervalEstimate, IntervalEstimate]:
        """AD and RD of lengths (..., cycles)."""
        return (
            bootstrap(between, lambda some: np.asarray(length(some).mean(axis=-1) - wanted)),
            bootstrap(between, lambda some: 3.0 * np.asarray(length(some).std(axis=-1, ddof=1))),
        )

    def along_axis(axis: int) -> tuple[IntervalEstimate, IntervalEstimate]:
        return both(lambda some: some[..., 0, axis], float(command[axis]))

    ad, rd = both(lambda some: np.asarray(np.linalg.norm(some[..., 0, :], axis=-1)), far)
    axes = tuple(along_axis(axis) for axis in range(3))
    return Distance((one.time, other.time), far, ad, rd, axes)


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
