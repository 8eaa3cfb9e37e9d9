"""Figures of ISO 9283:1998 from simulated cycles.

ISO 9283:1998, Manipulating industrial robots: performance criteria and related test methods. Names
and symbols are those of its clauses:

The clause numbers are given from memory of the standard, which was not at hand.

- 7.2.1 pose accuracy AP_p, AP_x, AP_y, AP_z: distance of the barycentre of the attained poses from
  the command pose;
- 7.2.2 pose repeatability RP_l = mean(l) + 3 S_l, l being the distance of an attained pose from the
  barycentre, S_l its standard deviation with n - 1;
- 7.2.3 multi-directional pose accuracy variation vAP_p: largest distance between the barycentres
  of the same command pose approached from different directions;
- 7.4 position stabilization time: from the first crossing into the limit band to when the tool
  stays within it; the limit band is the pose repeatability, or what is given;
- 7.5 position overshoot OV: largest distance from the attained pose after that crossing, zero
  if the tool stays within the limit band;
- 8.2 path accuracy AT_p, 8.3 path repeatability RT_p: the same as AP and RP, in planes across the
  command path, the largest over the path;
- the same of orientation, AP_a, AP_b, AP_c and their kin: `orientation_figures`.

What differs from a test of a robot: each cycle is a run of its own, whose journals begin displaced
at random; and the command pose is where the ideal mechanism under the same drives is, so that
only play counts, not the drives' lag, calibration, heat or the measurement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from jointplay.analysis.orientation_figures import Orientation, along_path, at_pose, turns_of
from jointplay.analysis.scatter import (
    CONFIDENCE,
    Estimate,
    accuracy,
    along,
    estimate,
    largest,
    repeatability,
    variation,
)
from jointplay.analysis.settling import Settling, settling, settling_words
from jointplay.analysis.tool_error import stops
from jointplay.analysis.traces import Trace, traces
from jointplay.errors import JointplayError, require_positive
from jointplay.motion.reference import GOES_ON, Motion
from jointplay.simulation.simulation import Simulation

CYCLES = 30
"""Cycles that the standard asks for (clause 6.9, number of cycles)."""
LEAST_CYCLES = 3
"""With fewer, nothing can be said of the scatter."""
PATH_POINTS = 100
"""Points along the path at which AT and RT are reckoned, at most."""
_MOVING = 0.02
"""Part of its greatest speed above which the commanded tool is on a path."""
_OTHER_WAY = math.radians(1.0)
"""From this angle on, two approaches have different directions [rad]."""


@dataclass(frozen=True)
class Pose:
    """Figures of one stop."""

    time: float
    """When the tool is looked at: the end of the stop [s]."""
    command: np.ndarray
    """Where the ideal mechanism's tool is, world axes, shape (3,) [m]."""
    attained: np.ndarray
    """Where the tool is in each cycle, less `command`, shape (cycles, 3) [m]."""
    ap: Estimate
    """AP_p [m]."""
    axes: tuple[Estimate, Estimate, Estimate]
    """AP_x, AP_y, AP_z, with sign [m]."""
    rp: Estimate
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
    vap: Estimate
    """vAP_p [m]."""


@dataclass(frozen=True)
class Iso9283:
    """Figures of perturbed cycles. Statistical, of simulated runs."""

    cycles: int
    poses: tuple[Pose, ...]
    variations: tuple[Variation, ...]
    """None if no pose is approached from two directions."""
    at: Estimate | None
    """AT_p [m]; None if the tool describes no path after `since`."""
    rt: Estimate | None
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

    @property
    def accuracy(self) -> str:
        """What the figures are, and how well they are known, one line."""
        few = f"; the standard asks for {CYCLES} cycles" if self.cycles < CYCLES else ""
        return (
            f"statistical, from {self.cycles} simulated cycles with perturbed starts{few}; "
            f"[{100 * CONFIDENCE:g} % confidence by bootstrap over the cycles]; times to "
            f"{1e3 * self.interval:.3g} ms; against the ideal mechanism under the same drives; "
            "numerical error not included (jointplay run --certify)"
        )

    def __str__(self) -> str:
        """All figures as text [mm, mrad]."""
        lines = []
        for number, pose in enumerate(self.poses, 1):
            lines.append(f"pose {number} (t = {pose.time:.4g} s), {self.cycles} cycles:")
            lines.append(f"  AP_p  pose accuracy       {pose.ap.words(1e3, 'mm')}")
            for axis, one in zip("xyz", pose.axes, strict=True):
                lines.append(f"  AP_{axis}                      {one.words(1e3, 'mm')}")
            lines.append(f"  RP_l  pose repeatability  {pose.rp.words(1e3, 'mm')}")
            lines += [] if pose.orientation is None else pose.orientation.words("P")
            lines += settling_words(pose.settling, self.cycles)
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
        return "\n".join([*lines, self.accuracy])

    def csv(self) -> str:
        """A row for each figure, lengths in m, angles in rad, times in s."""
        rows = ["figure,clause,time_s,value,low,high,unit"]

        def row(name: str, clause: str, time: str, one: Estimate) -> None:
            rows.append(f"{name},{clause},{time},{one.value:.6g},{one.low:.6g},{one.high:.6g},m")

        for pose in self.poses:
            time = f"{pose.time:.6g}"
            row("AP_p", "7.2.1", time, pose.ap)
            for axis, one in zip("xyz", pose.axes, strict=True):
                row(f"AP_{axis}", "7.2.1", time, one)
            row("RP_l", "7.2.2", time, pose.rp)
            if pose.orientation is not None:
                rows += pose.orientation.rows("P", ("7.2.1", "7.2.2"), time)
            if pose.settling is not None and pose.settling.settled == self.cycles:
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
        return "\n".join([*rows, ""])


def iso9283(
    simulation: Simulation,
    cycles: int = CYCLES,
    *,
    band: float | None = None,
    jobs: int | None = 1,
    keep: Path | None = None,
    progress: bool = False,
) -> Iso9283:
    """Run perturbed cycles, and reckon their figures.

    Args:
        simulation: one cycle of the machine; some joint or gear has play.
        cycles: how many, seeds 1, 2, ... (or from the simulation's own seed on).
        band: limit band of the stabilization time [m]; None: the pose repeatability.
        jobs: processes; None takes one for each core.
        keep: folder in which runs are kept, so that an interrupted call can go on.
        progress: show a bar on standard error.

    Raises:
        JointplayError: too few cycles, no motion, no play, or a run that fails.
    """
    check(simulation, cycles)
    first = 1 if simulation.seed is None else simulation.seed
    runs = [replace(simulation, seed=first + number) for number in range(cycles)]
    ideal = ideal_of(simulation)
    assert simulation.motion is not None
    all_of_them = traces([ideal, *runs], jobs=jobs, keep=keep, progress=progress, what="cycles")
    return figures(
        all_of_them[1:], all_of_them[0], simulation.motion, runs[0].judged_from, band=band
    )


def check(simulation: Simulation, cycles: int) -> None:
    """Raise a JointplayError on what has no such figures."""
    if not isinstance(cycles, int) or cycles < LEAST_CYCLES:
        raise JointplayError(
            f"at least {LEAST_CYCLES} cycles are needed to tell scatter, got {cycles!r} "
            f"(ISO 9283: {CYCLES})"
        )
    if simulation.motion is None:
        raise JointplayError("ISO 9283 judges a motion, and this simulation has none")
    if not (simulation.mechanism.clearance or simulation.mechanism.gears):
        raise JointplayError("no joint or gear has play: every cycle would be the same")
    joints = simulation.mechanism.clearance.values()
    if all(getattr(joint, "ideal", False) for joint in joints):
        raise JointplayError("no joint has clearance: seeds displace journals, and there are none")


def ideal_of(simulation: Simulation) -> Simulation:
    """The ideal mechanism that does the same work; see `analysis.twin`."""
    changes: dict[str, object] = {"start": None, "settle": None, "judge_from": None, "seed": None}
    if simulation.mechanism.loops:
        changes |= {"integrator": "rk4", "macro_step": None, "tolerance": None}
    own = [f"{name}." for name in simulation.mechanism.clearance]
    state = {
        name: at
        for name, at in simulation.state.items()
        if not any(name.startswith(prefix) for prefix in own)
    }
    return replace(
        simulation,
        mechanism=simulation.mechanism.ideal(),
        state=state,
        **changes,  # type: ignore[arg-type]
    )


def figures(
    runs: Sequence[Trace],
    ideal: Trace,
    motion: Motion,
    since: float = 0.0,
    *,
    band: float | None = None,
) -> Iso9283:
    """Figures of cycles that have been run, or measured.

    Args:
        runs: the tool's course in each cycle, at the same times as `ideal`.
        ideal: where the tool was to be.
        motion: of the joints; it tells the stops.
        since: nothing before is judged [s].
        band: see `iso9283`.

    Raises:
        JointplayError: too few cycles, or records at other times.
    """
    if len(runs) < LEAST_CYCLES:
        raise JointplayError(f"at least {LEAST_CYCLES} cycles are needed, got {len(runs)}")
    if band is not None:
        require_positive("limit band", band, "m")
    time = ideal.time
    for run in runs:
        if len(run.time) != len(time) or not np.allclose(
            run.time, time, 0.0, 1e-9 + 1e-9 * time[-1]
        ):
            raise JointplayError("the cycles were not recorded at the same times as the ideal one")
    error = np.stack([run.position - ideal.position for run in runs])
    turns = turns_of(runs, ideal)
    halts = [
        stop
        for stop in (stops(motion, float(time[-1])) if _stops(motion) else [])
        if stop.at_rest and stop.end >= since and stop.end > 0.0
    ]
    poses = []
    for stop in halts:
        at = int(np.abs(time - stop.end).argmin())
        attained = error[:, at : at + 1]
        rp = estimate(attained, largest(repeatability))
        leave = max([0.0, *(other.end for other in halts if other.end < stop.start)])
        window = (time >= leave, time >= stop.start, time <= stop.end)
        poses.append(
            Pose(
                float(time[at]),
                ideal.position[at],
                attained[:, 0],
                estimate(attained, largest(accuracy)),
                (along(attained, 0), along(attained, 1), along(attained, 2)),
                rp,
                settling(runs, window, time, rp.value if band is None else band),
                at_pose(None if turns is None else turns[:, at]),
            )
        )
    points = _path(ideal, since)
    across = _across(error[:, points], ideal.velocity[points]) if len(points) else None
    return Iso9283(
        len(runs),
        tuple(poses),
        tuple(_variations(poses, motion)),
        None if across is None else estimate(across, largest(accuracy)),
        None if across is None else estimate(across, largest(repeatability)),
        time[points],
        np.zeros(0) if across is None else accuracy(across),
        np.zeros(0) if across is None else repeatability(across),
        since,
        float(np.median(np.diff(time))),
        along_path(None if turns is None else turns[:, points]),
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
            variations.append(Variation(times, estimate(together, variation)))
    return variations
