"""Tool error: the difference of the tool's motion from the ideal mechanism's, and its statistics.

Functions of results, on their records; peaks between records are found by the recorded velocities
(`tops`). `replay` goes down to single steps.
"""

from __future__ import annotations

import copy
import json
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from jointplay.base.errors import (
    JointplayError,
    JointplayWarning,
    NothingHasPlay,
    require_finite,
    require_known,
)
from jointplay.model.frames import carried
from jointplay.model.mechanism import frame_index
from jointplay.simulation.analysis.twins import (
    TOOL_MOTIONS,
    has_play,
    ideal_simulation,
    is_twin,
    tool_motion,
)
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import AXES, COMPARED, Result
from jointplay.simulation.result.variables import HISTORIES, declared

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

RATES = {"tool_position": "tool_velocity", "tool_orientation": "tool_angular_velocity"}
"""The history that is the rate of another."""
COMPONENTS = (*AXES, "total")
"""Columns of accuracies and spectra: x, y, z, and the total."""


def deviation(result: Result, of: str = "tool_position") -> xr.DataArray:
    """Difference of the tool's motion from the ideal mechanism's at the same time.

    The ideal tool's histories are those in the result; if it has none, they are simulated.

    Args:
        result: the run.
        of: ``tool_position`` [m], ``tool_velocity`` [m/s], ``tool_orientation`` (the rotation
            vector that turns the ideal tool into the tool, world axes [rad]) or
            ``tool_angular_velocity`` [rad/s].

    Returns:
        Array (time, axis), over the time that both runs cover; with its rate of change as
        coordinate `rate`, for a position or an orientation if velocities were recorded.

    Raises:
        JointplayError: the result has no play, or its ideal mechanism cannot be simulated.
    """
    require_known("tool motion", of, TOOL_MOTIONS)
    find_tool_error(result)
    error = deviation_of(result.dataset, of)
    error.attrs["judge_from"] = result.judge_from
    return error


def deviation_of(dataset: xr.Dataset, of: str) -> xr.DataArray:
    """The `deviation` in histories that include those of the ideal tool."""
    ideal = {
        name: dataset[f"ideal_{name}"].values
        for name in (of, RATES.get(of, ""))
        if f"ideal_{name}" in dataset
    }
    known = np.isfinite(ideal[of]).all(axis=1) & np.isfinite(dataset[of].values).all(axis=1)
    if not known.all():
        dataset = dataset.isel(time=known)
        ideal = {name: values[known] for name, values in ideal.items()}
    return _error(dataset, ideal, of)


def difference(
    result: Result, other: Result, of: str = "tool_position", relative_to: str | None = None
) -> xr.DataArray:
    """Difference of the tool's motion from that in any other run; see `deviation`.

    Where the two were not recorded at the same times, the other motion is interpolated: by cubics
    through its recorded positions and velocities, by cubic splines through its orientations and
    angular velocities.

    Args:
        result, other: the two runs.
        of: see `deviation`.
        relative_to: link or frame from which the tool's motion is seen, in its axes, in each of the
            two runs, so that its own motion does not count. None: the world.

    Raises:
        MissingName: no such link or frame.
    """
    require_known("tool motion", of, TOOL_MOTIONS)
    if relative_to is not None:
        result, other = seen_from(result, relative_to), seen_from(other, relative_to)
    error = Reference(other).difference(result.dataset, of)
    error.attrs["judge_from"] = result.judge_from
    if relative_to is not None:
        error.attrs["long_name"] = f"{of.replace('_', ' ')} - reference, axes of {relative_to}"
    return error


def find_tool_error(result: Result, progress: bool = False) -> None:
    """Add the histories `COMPARED` to a result without them, by a run of its ideal mechanism.

    Raises:
        JointplayError: the result has no play, or its ideal mechanism cannot be simulated.
    """
    if "tool_error" in result.dataset:
        return
    if not has_play(result):
        raise NothingHasPlay(result.simulation.mechanism.joints)
    compare_tools(result, tool_motion(ideal_simulation(result), progress))


def has_tool_error(result: Result, progress: bool = False) -> bool:
    """Whether the tool error of a result is known, or can be found; then it is.

    Warns where the ideal mechanism cannot be simulated.
    """
    if "tool_error" in result.dataset:
        return True
    if not has_play(result) or len(result.time) < 2:
        return False
    try:
        find_tool_error(result, progress)
    except JointplayError as error:
        text = f"the tool error is unknown: the ideal mechanism cannot be simulated ({error})"
        warnings.warn(text, JointplayWarning, stacklevel=2)
        return False
    return True


def measured_against(result: Result, ideal: Result) -> Result:
    """A copy of a result with its tool error against a given run of the ideal mechanism.

    Raises:
        JointplayError: `ideal` is not the result's twin.
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
    measured = copy.copy(result)
    vars(measured).pop("tool_error", None)
    compare_tools(measured, ideal)
    return measured


def compare_tools(result: Result, ideal: Result) -> None:
    """Add the histories `COMPARED` to a result, against this run of its ideal mechanism."""
    result.dataset = compared(result.dataset, Reference(ideal))
    result.dataset.attrs |= ideal_forces(result, ideal)


def ideal_forces(result: Result, ideal: Result) -> dict[str, str]:
    """Attribute of a result with the largest force in each pin of the ideal linkage [N]."""
    if "reaction_force" not in ideal.dataset:
        return {}
    forces = ideal["reaction_force"].sel(time=ideal.time >= result.judge_from)
    largest = np.linalg.norm(forces.values, axis=2).max(axis=0, initial=0.0)
    by_joint = dict(zip(forces["moving_joint"].values.tolist(), largest.tolist(), strict=True))
    return {"ideal_forces": json.dumps(by_joint)}


def compared(dataset: xr.Dataset, ideal: Reference) -> xr.Dataset:
    """Histories with `COMPARED` added, NaN where the ideal mechanism's run has ended.

    Those of tool motions that are not among the histories are left out.
    """
    dataset = dataset.drop_vars(COMPARED, errors="ignore")
    time = dataset["time"].values
    histories = {f"ideal_{of}": ideal.at(of, time) for of in TOOL_MOTIONS if of in dataset}
    dataset = _with(dataset, histories)
    vector = dataset["tool_position"].values - histories["ideal_tool_position"]
    histories = {"tool_error": np.linalg.norm(vector, axis=1), "tool_error_vector": vector}
    if "tool_orientation" in dataset:
        turns = deviation_of(dataset, "tool_orientation")
        turn = np.full(len(time), np.nan)
        turn[np.isin(time, turns["time"].values)] = np.linalg.norm(turns.values, axis=1)
        histories["tool_turn"] = turn
    return _with(dataset, histories)


def _with(dataset: xr.Dataset, histories: Mapping[str, np.ndarray]) -> xr.Dataset:
    return dataset.assign(
        {
            name: (dims, values, {"units": unit, "long_name": text})
            for name, (dims, values, unit, text) in declared(histories).items()
        }
    )


def seen_from(result: Result, body: str) -> Result:
    """A result with the tool's motion as seen from a body (link or frame), in its axes."""
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


class Reference:
    """The motion of a tool, at any time of its run, as the reference for another's.

    Between records it is interpolated; see `difference`.

    Args:
        run: the run with the tool.
        prefix: ``ideal_`` for the tool of the ideal mechanism that the run was compared with.

    Attributes:
        until: the last time that it covers [s].
    """

    def __init__(self, run: Result, prefix: str = "") -> None:
        self._time = run.time
        self._motions = {
            of: run[f"{prefix}{of}"].values for of in TOOL_MOTIONS if f"{prefix}{of}" in run.dataset
        }
        if prefix:
            known = np.isfinite(self._motions["tool_position"]).all(axis=1)
            self._time = self._time[known]
            self._motions = {of: values[known] for of, values in self._motions.items()}
        last = float(self._time[-1])
        # Times that are multiples of another step differ in their last bits.
        self._rounding = 1e-9 * max(last, 1e-3)
        self.until = last + self._rounding
        self._curves: dict[str, Callable[[np.ndarray], Any]] = {}

    def at(self, of: str, time: np.ndarray) -> np.ndarray:
        """The tool motion `of` at these times, (n, 3 or 4); NaN after its end."""
        values = self._motions[of]
        motion = np.full((len(time), values.shape[1]), np.nan)
        covered = time[time <= self.until]
        begin = covered[0] - self._rounding if len(covered) else 0.0
        first = int(np.searchsorted(self._time, begin))
        rows = slice(first, first + len(covered))
        if len(values[rows]) == len(covered) and np.allclose(
            self._time[rows], covered, 0.0, self._rounding
        ):
            motion[: len(covered)] = values[rows]
        elif len(values) < 2:
            raise JointplayError(f"the reference has {len(values)} record; it needs at least 2")
        else:
            if of not in self._curves:
                self._curves[of] = _interpolation(self._time, self._motions, of)
            motion[: len(covered)] = self._curves[of](covered)
        return motion

    def difference(self, dataset: xr.Dataset, of: str) -> xr.DataArray:
        """Difference of the histories of another run, or of a part of it; see `difference`."""
        dataset = dataset.isel(time=dataset["time"].values <= self.until)
        time = dataset["time"].values
        names = (name for name in (of, RATES.get(of)) if name in self._motions)
        return _error(dataset, {name: self.at(name, time) for name in names}, of)


def ideal_tool(result: Result) -> Reference | None:
    """The motion of the ideal mechanism's tool; None if it can be neither read nor simulated."""
    return Reference(result, "ideal_") if has_tool_error(result) else None


def _error(dataset: xr.Dataset, ideal: Mapping[str, np.ndarray], of: str) -> xr.DataArray:
    """Histories less a reference's at the same times, with their `rate` where that is known."""
    ours = dataset[of]
    error: xr.DataArray
    if of == "tool_orientation":
        turns = turns_between(ideal[of], ours.values)
        along = {"time": dataset["time"].values, "axis": dataset["axis"].values}
        error = xr.DataArray(turns, along, ("time", "axis"), of)
    else:
        error = ours - ideal[of]
    pace = RATES.get(of, "")
    if pace in ideal and pace in dataset:
        rate = dataset[pace].values - ideal[pace]
        if of == "tool_orientation":  # of a rotation vector, to first order in it
            rate = rate - 0.5 * np.cross(error.values, 2.0 * dataset[pace].values - rate)
        error = error.assign_coords(rate=(("time", "axis"), rate))
    error.attrs = {
        "units": "rad" if of == "tool_orientation" else HISTORIES[of].unit,
        "long_name": f"{of.replace('_', ' ')} - reference, world axes",
    }
    return error


def turns_between(quaternions: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Rotation vectors that turn recorded quaternions into others, world axes, (n, 3) [rad].

    Quaternions (n, 4) have their scalar first; their length and sign do not matter. In NumPy, as
    SciPy takes longer to import than a short run takes.
    """
    _check_orientations(quaternions)
    _check_orientations(others)
    (a, u), (b, v) = ((q[:, :1], q[:, 1:]) for q in (quaternions, others))
    cosine = a * b + (u * v).sum(axis=1, keepdims=True)
    sine = a * v - b * u + np.cross(u, v)  # of half the angle, along the axis
    size = np.linalg.norm(sine, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(size, np.abs(cosine))
    turns: np.ndarray = np.copysign(angle, cosine) * sine / np.where(size > 0.0, size, 1.0)
    return turns


def rotations(quaternions: np.ndarray) -> Rotation:
    """Rotations of recorded quaternions (n, 4), scalar first; refused if they are no rotations."""
    from scipy.spatial.transform import Rotation  # takes long to import

    _check_orientations(quaternions)
    return Rotation.from_quat(quaternions, scalar_first=True)


def _check_orientations(quaternions: np.ndarray) -> None:
    size = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(size < 0.5)
    if wrong.size:
        raise JointplayError(
            f"record {wrong[0] + 1} has no orientation of the tool: its quaternion has the length "
            f"{size[wrong[0]]:g}; the run went wrong, or its records have changed since"
        )


def _interpolation(
    time: np.ndarray, motions: Mapping[str, np.ndarray], of: str
) -> Callable[[np.ndarray], Any]:
    """The tool motion `of` as a function of time; see `difference`."""
    from scipy.interpolate import CubicHermiteSpline, CubicSpline  # takes long to import
    from scipy.spatial.transform import RotationSpline

    if of == "tool_orientation":
        curve = RotationSpline(time, rotations(motions[of]))
        return lambda at: curve(at).as_quat(scalar_first=True)
    if of == "tool_angular_velocity":
        return CubicSpline(time, motions[of])  # type: ignore[no-any-return]
    path = CubicHermiteSpline(time, motions["tool_position"], motions["tool_velocity"])
    return path if of == "tool_position" else path.derivative()  # type: ignore[no-any-return]


@dataclass(frozen=True)
class ErrorStatistics:
    """Tool error over a run along x, y, z, and in total [m], arrays of shape (4,).

    The total is the distance from the ideal tool.
    """

    mean: np.ndarray
    rms: np.ndarray
    peak: np.ndarray
    """Largest magnitude, also between records if the error has its `rate`."""


def time_weights(time: np.ndarray) -> np.ndarray:
    """Weights of records in a mean over time, by the trapezium rule, (n,)."""
    if len(time) < 2:
        return np.ones(len(time))
    half = 0.5 * np.diff(time) / (time[-1] - time[0])
    return np.asarray(np.append(half, 0.0) + np.append(0.0, half))


def rms_in_time(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Root mean square over time of values (n,) or (n, k)."""
    return np.sqrt(time_weights(time) @ np.square(values))


def tops(time: np.ndarray, sizes: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest size in the interval before each record, and that plus its error, (n,) each.

    Where the size grows at one record and shrinks at the next, the peak between is that of the
    cubic through sizes and rates, but no higher than where the tangents meet. If the rate jumps by
    D within the interval h, as by an impact, that is wrong by at most D h / 8; the curvatures of
    neighbouring cubics then jump by 2 D / h more at the interval's end than at its begin.
    """
    top, most = sizes.copy(), sizes.copy()
    # Cubics low + x (begin + x (square + x cube)) in each interval, x from 0 to 1.
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
    """Rate at which the lengths of vectors (n, 3) grow that change at `rates` (n, 3): (n,)."""
    sizes = np.linalg.norm(vectors, axis=1)
    along = np.einsum("ij,ij->i", vectors, rates)
    return np.divide(along, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)


def _with_total(vectors: np.ndarray) -> np.ndarray:
    return np.column_stack([vectors, np.linalg.norm(vectors, axis=1)])


def error_statistics(error: xr.DataArray, start: float | None = None) -> ErrorStatistics:
    """Mean, RMS and peak of the tool's `deviation` from the time `start` [s] on.

    None: from `Result.judge_from` on.
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
    """An instant, or an interval, at which the reference motion is at a waypoint."""

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
"""Largest speed at a waypoint at which the reference counts as resting, relative to that on the way
there or on; 2e-3 was found at lines of ten points, the coarsest."""


_RESTS = 0.1
"""Largest acceleration at a sample at which a spline counts as resting, relative to the motion's
largest: judged. A sine turns round with all of it, motion from rest to rest ends with none."""


def stops(motion: Motion, end: float) -> list[Stop]:
    """Waypoints of the reference motion up to the time `end` [s], pauses joined into dwells.

    A tool picks and places while the reference dwells: its error at the end of a dwell is that of
    the process.
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
    # By the waypoints as given: the curve's own values differ by rounding.
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
    """Tool error along x, y, z, and in total at the record nearest to `time` [s]: (4,) [m]."""
    time = require_finite("time", time, "s")
    return _with_total(error.sel(time=[time], method="nearest").values)[0]
