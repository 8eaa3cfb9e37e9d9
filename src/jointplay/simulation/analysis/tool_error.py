"""Error of the tool: its difference from the ideal mechanism's, at all times and at stops.

Pure functions of results. They work on records, between which peaks are found by the recorded
velocities; `replay` goes down to single steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from jointplay.base.errors import JointplayError, require_finite, require_known
from jointplay.model.frames import carried
from jointplay.model.mechanism import frame_index
from jointplay.simulation.analysis.twins import TOOL_MOTIONS, has_play, is_twin
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import AXES, Result

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

RATES = {"tool_position": "tool_velocity", "tool_orientation": "tool_angular_velocity"}
"""Which history says how fast another changes."""
COMPONENTS = (*AXES, "total")
"""Columns of accuracies and spectra: x, y, z, and all three together."""


def deviation(
    result: Result, ideal: Result, of: str = "tool_position", relative_to: str | None = None
) -> xr.DataArray:
    """Difference of the tool's motion from the ideal robot's at the same time.

    Where the two were not recorded at the same times, the ideal motion is interpolated: by cubics
    through its recorded positions and velocities, by cubic splines through its orientations and
    angular velocities.

    Args:
        result: the run.
        ideal: the ideal robot's run of the same work; see `is_twin`, `twin`.
        of: ``tool_position`` [m], ``tool_velocity`` [m/s], ``tool_orientation`` (the rotation
            vector that turns the ideal tool into the tool, world axes [rad]) or
            ``tool_angular_velocity`` [rad/s].
        relative_to: link or frame, whose motion does not count then: the tool's motion is that
            which is seen from it, in its axes, in each of the two runs. None: the world.

    Returns:
        (time, axis), for the time that both runs cover; with how fast it changes as coordinate
        `rate`, if it is a position or an orientation and velocities were recorded.

    Raises:
        JointplayError: `ideal` is not the result's twin.
        MissingName: no such link or frame.
    """
    if not is_twin(result, ideal):
        reason = (
            f"has clearance in {', '.join(ideal.joints)}"
            if ideal.joints
            else "has gears with play"
            if has_play(ideal)
            else "moves another robot, or otherwise"
        )
        raise JointplayError(
            f"the reference {reason}; take an ideal run of the same robot, motion, drive and "
            "gravity, such as analysis.twin(result)"
        )
    if relative_to is None:
        return difference(result, ideal, of)
    error = difference(seen_from(result, relative_to), seen_from(ideal, relative_to), of)
    error.attrs["long_name"] = f"{of.replace('_', ' ')} - reference, axes of {relative_to}"
    return error


def seen_from(result: Result, body: str) -> Result:
    """The same run with the tool's motion seen from a body (link or frame), in its axes."""
    mechanism = result.simulation.mechanism
    model = mechanism.model
    base, tool = (
        mechanism.tree.motion(result.q, result.v, carried(model, index))
        for index in (frame_index(model, body, "body"), mechanism.tool_frame)
    )
    if not len(result.time):
        return result
    turn = rotations(base.orientation).inv()
    arm = tool.tool[:, :3] - base.tool[:, :3]
    speed = tool.tool[:, 3:] - base.tool[:, 3:] - np.cross(base.spin, arm)
    orientation = (turn * rotations(tool.orientation)).as_quat(scalar_first=True)
    values = (turn.apply(arm), turn.apply(speed), orientation, turn.apply(tool.spin - base.spin))
    dataset = result.dataset
    for name, history in zip(TOOL_MOTIONS, values, strict=True):
        if name in dataset:
            dataset = dataset.assign({name: dataset[name].copy(data=history)})
    return Result(dataset)


def difference(result: Result, ideal: Result, of: str = "tool_position") -> xr.DataArray:
    """The same between any two runs; see `deviation`."""
    require_known("tool motion", of, TOOL_MOTIONS)
    error = Reference(ideal).difference(result.dataset, of)
    error.attrs["judge_from"] = result.judge_from
    return error


class Reference:
    """The motion of a tool from which another's is told, at any time that its run covers.

    What is between its records is interpolated, see `deviation`.

    Attributes:
        until: the last time that it covers [s].
    """

    def __init__(self, run: Result) -> None:
        self._run = run
        last = float(run.time[-1])
        # Times that are multiples of another step differ in their last bits.
        self._rounding = 1e-9 * max(last, 1e-3)
        self.until = last + self._rounding
        self._between: dict[str, Callable[[np.ndarray], Any]] = {}

    def difference(self, dataset: xr.Dataset, of: str) -> xr.DataArray:
        """Of the histories of another run, or of a part of it; see `deviation`."""
        ours = dataset[of].sel(time=dataset["time"].values <= self.until)
        time, run = ours["time"].values, self._run
        if len(run.time) >= len(time) and np.allclose(
            run.time[: len(time)], time, 0.0, self._rounding
        ):
            reference = run[of].values[: len(time)]
        elif len(run.time) < 2:
            raise JointplayError(f"the reference has {len(run.time)} record; it needs at least 2")
        else:
            if of not in self._between:
                self._between[of] = _between(run, of)
            reference = self._between[of](time)
        error: xr.DataArray
        if of == "tool_orientation":
            turns = _turns(ours.values, reference)
            along = {"time": time, "axis": dataset["axis"].values}
            error = xr.DataArray(turns, along, ("time", "axis"), of)
        else:
            error = ours - reference
        pace = RATES.get(of)
        if pace is not None and pace in dataset and pace in run.dataset:
            rate = self.difference(dataset, pace).values
            if of == "tool_orientation":  # of a rotation vector, to first order in it
                twice = 2.0 * dataset[pace].values[: len(time)] - rate
                rate = rate - 0.5 * np.cross(error.values, twice)
            error = error.assign_coords(rate=(("time", "axis"), rate))
        error.attrs = {
            "units": "rad" if of == "tool_orientation" else ours.attrs["units"],
            "long_name": f"{of.replace('_', ' ')} - reference, world axes",
        }
        return error


def rotations(quaternions: np.ndarray) -> Rotation:
    """Orientations that are recorded with the scalar first, (n, 4); refused if they are none."""
    from scipy.spatial.transform import Rotation  # takes long to import

    size = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(size < 0.5)
    if wrong.size:
        raise JointplayError(
            f"record {wrong[0] + 1} has no orientation of the tool: its quaternion has the length "
            f"{size[wrong[0]]:g}; the run went wrong, or its records have changed since"
        )
    return Rotation.from_quat(quaternions, scalar_first=True)


def _turns(ours: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Rotation vectors that turn a reference into ours, both as they are recorded, (n, 3)."""
    return np.asarray((rotations(ours) * rotations(reference).inv()).as_rotvec())


def _between(ideal: Result, of: str) -> Callable[[np.ndarray], Any]:
    from scipy.interpolate import CubicHermiteSpline, CubicSpline  # takes long to import
    from scipy.spatial.transform import RotationSpline

    if of == "tool_orientation":
        curve = RotationSpline(ideal.time, rotations(ideal[of].values))
        return lambda time: curve(time).as_quat(scalar_first=True)
    if of == "tool_angular_velocity":
        return CubicSpline(ideal.time, ideal[of].values)  # type: ignore[no-any-return]
    path = CubicHermiteSpline(
        ideal.time, ideal["tool_position"].values, ideal["tool_velocity"].values
    )
    return path if of == "tool_position" else path.derivative()  # type: ignore[no-any-return]


@dataclass(frozen=True)
class ErrorStatistics:
    """Tool error over a run along x, y, z and in all [m], arrays of shape (4,).

    The total's mean, RMS and peak are those of the distance from the ideal tool.
    """

    mean: np.ndarray
    rms: np.ndarray
    peak: np.ndarray
    """Largest magnitude, also between records if the error has its `rate`."""


def time_weights(time: np.ndarray) -> np.ndarray:
    """Weights of records in a mean over time, (n,): what is between them is linear."""
    if len(time) < 2:
        return np.ones(len(time))
    half = 0.5 * np.diff(time) / (time[-1] - time[0])
    return np.asarray(np.append(half, 0.0) + np.append(0.0, half))


def rms_in_time(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Root mean square over time of values (n,) or (n, k)."""
    return np.sqrt(time_weights(time) @ np.square(values))


def tops(time: np.ndarray, sizes: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest of a size since the record before each record, and that with its error added, (n,).

    Cubics through the sizes and their rates at records tell it where it grows at one and shrinks
    at the next, at most up to where their tangents meet. A rate that jumps between, as by an
    impact, by D in the interval h, makes that wrong by at most D h / 8; the curvatures of
    neighbouring cubics then jump by 2 D / h more at its end than at its begin.
    """
    top, most = sizes.copy(), sizes.copy()
    step, rise = np.diff(time), np.diff(sizes)
    begin, end = step * rates[:-1], step * rates[1:]
    square, cube = 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise
    jump = np.full(len(sizes), np.nan)
    starts, ends = 2.0 * square / step**2, (2.0 * square + 6.0 * cube) / step**2
    jump[1:-1] = starts[1:] - ends[:-1]  # of the curvature, where a cubic ends and the next begins
    at = np.flatnonzero((begin > 0.0) & (end < 0.0))
    begin, end, low, rise = begin[at], end[at], sizes[at], rise[at]
    square, cube = square[at], cube[at]
    root = np.sqrt(np.maximum(square**2 - 3.0 * cube * begin, 0.0))
    x = begin / np.maximum(root - square, begin)  # of the cubic's peak, 0 to 1
    cubic = low + x * (begin + x * (square + x * cube))
    meet = (rise - end) / (begin - end)
    bound = np.where((meet >= 0.0) & (meet <= 1.0), low + begin * meet, cubic)
    top[at + 1] = np.maximum(top[at + 1], np.minimum(cubic, bound))
    kink = step[at] ** 2 * np.abs(jump[at + 1] - jump[at]) / 16.0
    most[at + 1] = top[at + 1] + np.nan_to_num(kink)
    return top, most


def growth(vectors: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """How fast vectors grow that change at these rates, both (n, 3), as (n,)."""
    sizes = np.linalg.norm(vectors, axis=1)
    along = np.einsum("ij,ij->i", vectors, rates)
    return np.divide(along, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)


def _with_total(vectors: np.ndarray) -> np.ndarray:
    return np.column_stack([vectors, np.linalg.norm(vectors, axis=1)])


def error_statistics(error: xr.DataArray, start: float | None = None) -> ErrorStatistics:
    """Mean, RMS and peak of the tool's `deviation` from the time `start` [s] on.

    None: from when on the run is judged, `Result.judge_from`.
    """
    begin = error.attrs.get("judge_from", 0.0) if start is None else start
    start = require_finite("start", begin, "s")
    judged = error.sel(time=error["time"] >= start)
    if not len(judged):
        raise JointplayError(
            f"no records from {start:g} s on; the run ends at {float(error['time'][-1]):g} s"
        )
    time, values = judged["time"].values, _with_total(judged.values)
    sizes = np.abs(values)
    if "rate" in judged.coords:
        rate = judged["rate"].values
        rates = np.column_stack([np.sign(judged.values) * rate, growth(judged.values, rate)])
        largest = [tops(time, *column)[0].max() for column in zip(sizes.T, rates.T, strict=True)]
    else:
        largest = list(sizes.max(axis=0))
    return ErrorStatistics(
        time_weights(time) @ values, rms_in_time(time, values), np.array(largest)
    )


@dataclass(frozen=True)
class Stop:
    """An instant, or an interval, at which the reference motion reaches a waypoint."""

    start: float
    """Arrival [s]."""
    end: float
    """Departure [s]; later than the arrival if the reference dwells."""
    at_rest: bool
    """Whether the reference stands still there."""

    @property
    def kind(self) -> str:
        """``dwell``, ``stop`` (rest without a pause) or ``pass``."""
        return "dwell" if self.end > self.start else "stop" if self.at_rest else "pass"


_OSCILLATION = 3e-3
"""Speed at a waypoint at which the reference rests, at most, relative to that of the way there or
on; 2e-3 was found at lines of ten points, the coarsest."""


_RESTS = 0.1
"""Acceleration at a sample at which a spline rests, at most, relative to its largest: judged. A
sine turns round with all of it, motion from rest to rest ends with none."""


def stops(motion: Motion, end: float) -> list[Stop]:
    """Waypoints of the reference motion up to the time `end` [s], pauses joined into dwells.

    A tool picks and places while the reference dwells: what its error is at the end of a dwell is
    what the process gets.
    """
    end = require_finite("end", end, "s")
    times, positions = motion.waypoints
    speed = np.abs(motion(times)[1]).max(axis=1)
    between = np.linspace(times[:-1], times[1:], 7, axis=1)
    fastest = np.abs(motion(between.ravel())[1]).max(axis=1).reshape(between.shape).max(axis=1)
    limit = 1e-9 * np.abs(motion(np.linspace(times[0], times[-1], 1001))[1]).max()
    # A spline through the points of a line oscillates a little at the line's ends.
    beside = _OSCILLATION * np.maximum(np.append(fastest, 0.0), np.insert(fastest, 0, 0.0))
    around = np.maximum(beside[:-1], beside[1:])
    # Of the waypoints as given: the curve's own values differ by rounding.
    same = (np.abs(np.diff(positions, axis=0)) <= 1e-12).all(axis=1)
    still = same & (fastest <= np.maximum(limit, around))
    resting = speed <= np.maximum(limit, beside)
    if motion.interpolation == "spline" and motion.given is None:
        # Where samples turn round, they do not rest.
        pull = np.abs(motion(times)[2]).max(axis=1)
        resting &= pull <= _RESTS * pull.max()
    waypoints: list[Stop] = []
    for index, time in enumerate(times):
        if waypoints and still[index - 1]:
            waypoints[-1] = Stop(waypoints[-1].start, float(time), True)
        else:
            waypoints.append(Stop(float(time), float(time), bool(resting[index])))
    if end > times[-1]:
        waypoints[-1] = Stop(waypoints[-1].start, end, True)
    tolerance = 1e-9 * max(end, 1.0)
    return [
        Stop(stop.start, min(stop.end, end), stop.at_rest)
        for stop in waypoints
        if stop.start <= end + tolerance
    ]


def error_at(error: xr.DataArray, time: float) -> np.ndarray:
    """Tool error along x, y, z and in all at the record nearest to `time` [s]: (4,) [m]."""
    time = require_finite("time", time, "s")
    return _with_total(error.sel(time=[time], method="nearest").values)[0]
