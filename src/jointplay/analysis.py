"""What a result says about the machine: tool accuracy, contacts, shares of time, spectrum.

Pure functions of results. All of them work on records, so their resolution in time is the record
interval; `replay` goes down to single steps.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.interpolate import CubicHermiteSpline

from jointplay.errors import JointplayError, MissingName
from jointplay.geometry import Form, Mode
from jointplay.motion import Motion
from jointplay.result import AXES, Result

if TYPE_CHECKING:
    from jointplay.simulation import Simulation

COMPONENTS = (*AXES, "total")
"""Columns of accuracies and spectra: x, y, z, and all three together."""

_MAY_DIFFER = (
    *("mechanism", "duration", "step", "integrator", "macro_step", "tolerance"),
    *("record_every", "seed"),
)
"""Inputs in which a run and the ideal run that it is measured against may differ."""


def inputs(result: Result) -> dict[str, Any]:
    """The run's inputs as plain data, as `Simulation.describe` wrote them."""
    found: dict[str, Any] = json.loads(result.dataset.attrs["simulation"])
    return found


def clearance_inputs(result: Result) -> dict[str, dict[str, Any]]:
    """The stored inputs of the joints that have clearance, by name."""
    given = inputs(result)["mechanism"]["clearance"]
    return {name: given[name] for name in result.joints if name in given}


def clearance_outline(result: Result, joint: str) -> np.ndarray | None:
    """Closed line within which the journal's centre can move untilted, bearing x and y [m].

    Returns:
        (2, n): the clearance circle, or for a slider the rectangle of its clearances; None if the
        inputs tell neither.
    """
    given = clearance_inputs(result).get(joint, {})
    if given.get("radial_clearance") is not None:
        angle = np.linspace(0.0, 2.0 * np.pi, 361)
        circle: np.ndarray = given["radial_clearance"] * np.array([np.cos(angle), np.sin(angle)])
        return circle
    if given.get("clearance") is not None:
        x = float(given["clearance"])
        y = 0.0 if given.get("planar") else float(given.get("clearance_y") or x)
        return np.array([[x, x, -x, -x, x], [y, -y, -y, y, y]])
    return None


def places(result: Result, joint: str) -> list[str]:
    """Names of the contacts of `joint`; other joints' contacts hold no numbers there.

    Raises:
        MissingName: no such joint with clearance.
    """
    if joint not in result.joints:
        raise MissingName("clearance joint", joint, result.joints)
    gaps = result["gap"].sel(joint=joint)
    if not gaps.sizes["time"]:
        return [str(name) for name in gaps["contact"].values]
    has = ~np.isnan(gaps.values[0])
    return [str(name) for name in gaps["contact"].values[has]]


def task(result: Result) -> dict[str, Any]:
    """Inputs that a run must share with its ideal twin: mechanism, motion, drives, loads."""
    given = inputs(result)
    robot = {
        key: value for key, value in given["mechanism"].items() if key not in ("clearance", "gears")
    }
    return {key: value for key, value in given.items() if key not in _MAY_DIFFER} | {
        "mechanism": robot
    }


def has_play(result: Result) -> bool:
    """Whether a joint has clearance, or a gear play."""
    return bool(result.joints or inputs(result)["mechanism"].get("gears"))


def is_twin(result: Result, ideal: Result) -> bool:
    """Whether `ideal` has no play and is otherwise the same mechanism doing the same work."""
    return not has_play(ideal) and task(result) == task(ideal)


def twin(result: Result) -> Result:
    """The ideal mechanism doing the same work for the same time, simulated now.

    Where it has closed loops, by rk4, with which they drift least.

    Raises:
        JointplayError: the result's simulation cannot be built again, or its ideal mechanism
            cannot be simulated.
    """
    return ideal_simulation(result).run()


def ideal_simulation(result: Result) -> Simulation:
    """The simulation that `twin` runs."""
    simulation = result.simulation
    fixed: dict[str, Any] = {}
    if simulation.mechanism.loops:
        fixed = {"integrator": "rk4", "macro_step": None, "tolerance": None}
    return dataclasses.replace(
        simulation,
        mechanism=simulation.mechanism.ideal(),
        duration=float(result.time[-1]) or simulation.step,
        seed=None,
        **fixed,
    )


def deviation(result: Result, ideal: Result, of: str = "tool_position") -> xr.DataArray:
    """Difference of the tool's motion from the ideal robot's at the same time.

    Where the two were not recorded at the same times, the ideal motion is interpolated by cubics
    through its recorded positions and velocities.

    Args:
        result: the run.
        ideal: the ideal robot's run of the same work; see `is_twin`, `twin`.
        of: ``tool_position`` [m] or ``tool_velocity`` [m/s].

    Returns:
        (time, axis), for the time that both runs cover.

    Raises:
        JointplayError: `ideal` is not the result's twin.
    """
    if of not in ("tool_position", "tool_velocity"):
        raise MissingName("tool motion", of, ("tool_position", "tool_velocity"))
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
    # Times that are multiples of another step differ in their last bits.
    rounding = 1e-9 * max(float(ideal.time[-1]), 1e-3)
    ours = result[of].sel(time=result.time <= ideal.time[-1] + rounding)
    time = ours["time"].values
    if len(ideal.time) >= len(time) and np.allclose(ideal.time[: len(time)], time, 0.0, rounding):
        reference = ideal[of].values[: len(time)]
    elif len(ideal.time) < 2:
        raise JointplayError(f"the reference has {len(ideal.time)} record; it needs at least 2")
    else:
        path = CubicHermiteSpline(
            ideal.time, ideal["tool_position"].values, ideal["tool_velocity"].values
        )
        reference = path(time, nu=0 if of == "tool_position" else 1)
    difference: xr.DataArray = ours - reference
    difference.attrs = {
        "units": ours.attrs["units"],
        "long_name": f"{of.replace('_', ' ')} - ideal, world axes",
    }
    return difference


@dataclass(frozen=True)
class Accuracy:
    """Tool error over a run along x, y, z and in all [m], arrays of shape (4,).

    The total's mean, RMS and peak are those of the distance from the ideal tool.
    """

    mean: np.ndarray
    rms: np.ndarray
    peak: np.ndarray
    """Largest magnitude."""


def _with_total(vectors: np.ndarray) -> np.ndarray:
    return np.column_stack([vectors, np.linalg.norm(vectors, axis=1)])


def accuracy(error: xr.DataArray, start: float = 0.0) -> Accuracy:
    """Mean, RMS and peak of the tool's `deviation` from the time `start` [s] on.

    Raises:
        JointplayError: nothing was recorded from `start` on.
    """
    kept = error.sel(time=error["time"] >= start).values
    if not len(kept):
        raise JointplayError(
            f"no records from {start:g} s on; the run ends at {float(error['time'][-1]):g} s"
        )
    values = _with_total(kept)
    return Accuracy(
        values.mean(axis=0), np.sqrt((values**2).mean(axis=0)), np.abs(values).max(axis=0)
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


def stops(motion: Motion, end: float) -> list[Stop]:
    """Waypoints of the reference motion up to the time `end` [s], pauses joined into dwells.

    A tool picks and places while the reference dwells: what its error is at the end of a dwell is
    what the process gets.
    """
    times = motion.times
    position, velocity, _ = motion(times)
    fastest = np.abs(motion(np.linspace(times[0], times[-1], 1001))[1]).max()
    limit = 1e-9 * fastest

    def still(first: int) -> bool:
        inside = np.linspace(times[first], times[first + 1], 7)
        moved = position[first] != position[first + 1]
        return not moved.any() and bool((np.abs(motion(inside)[1]) <= limit).all())

    rest = (np.abs(velocity) <= limit).all(axis=1)
    found: list[Stop] = []
    for index, time in enumerate(times):
        if found and still(index - 1):
            found[-1] = Stop(found[-1].start, float(time), True)
        else:
            found.append(Stop(float(time), float(time), bool(rest[index])))
    if end > times[-1]:
        found[-1] = Stop(found[-1].start, end, True)
    tolerance = 1e-9 * max(end, 1.0)
    return [
        Stop(stop.start, min(stop.end, end), stop.at_rest)
        for stop in found
        if stop.start <= end + tolerance
    ]


def error_at(error: xr.DataArray, time: float) -> np.ndarray:
    """Tool error along x, y, z and in all at the record nearest to `time` [s]: (4,) [m]."""
    return _with_total(error.sel(time=[time], method="nearest").values)[0]


@dataclass(frozen=True)
class Contacts:
    """Contacts at one place of one joint, in the order in which they began.

    Records cannot tell contacts apart that follow each other within one record interval, nor time
    them better than to about one interval; peaks are exact.
    """

    joint: str
    contact: str
    start: np.ndarray
    """Record before the contact (n,) [s]."""
    duration: np.ndarray
    """Record intervals touched less one, the unbiased estimate; at least half an interval [s]."""
    peak: np.ndarray
    """Largest normal force (n,) [N]."""
    peak_time: np.ndarray
    """Record at which it was held (n,) [s]."""
    share: float
    """Fraction of the records with a normal force."""


def contacts(result: Result, start: float = 0.0) -> list[Contacts]:
    """Contacts of every place of every clearance joint that began from `start` [s] on.

    A contact lasts from the first to the last of consecutive records that hold a normal force.
    """
    time = result.time
    if not result.joints:
        return []
    later = np.diff(time, prepend=time[0])
    judged = time >= start
    found = []
    for joint in result.joints:
        for contact in places(result, joint):
            at = {"joint": joint, "contact": contact}
            force = result["normal_force_peak"].sel(at).values
            edges = np.diff(np.concatenate([[False], force > 0.0, [False]]).astype(int))
            first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
            kept = time[first] >= start
            first, last = first[kept], last[kept]
            top = [f + int(force[f : t + 1].argmax()) for f, t in zip(first, last, strict=True)]
            spacing = later[first]
            normal = result["normal_force"].sel(at).values[judged]
            found.append(
                Contacts(
                    joint,
                    contact,
                    time[first] - spacing,
                    np.maximum(time[last] - time[first], 0.5 * spacing),
                    force[top],
                    time[top],
                    float(np.mean(normal > 0.0)) if normal.size else 0.0,
                )
            )
    return found


def shares(result: Result, joint: str, of: str = "mode", start: float = 0.0) -> dict[str, float]:
    """Fractions of the time from `start` [s] on that `joint` spends in each mode or form.

    Args:
        result: a run with clearance.
        joint: its clearance joint.
        of: ``mode`` or ``form``.
        start: records before this are left out [s].

    Returns:
        By name, in the order of the enumeration; they sum to 1. Nothing for the forms of a joint
        that Figure 2 does not show.
    """
    if joint not in result.joints:
        raise MissingName("clearance joint", joint, result.joints)
    kinds: dict[str, Any] = {"mode": Mode, "form": Form}
    if of not in kinds:
        raise MissingName("state", of, kinds)
    values = result[of].sel(joint=joint).values[result.time >= start]
    if len(values) and values.min() < 0:
        return {}
    counts = np.bincount(values, minlength=len(kinds[of]))
    total = max(len(values), 1)
    return {member.name.lower(): float(counts[member] / total) for member in kinds[of]}


def spectrum(
    result: Result,
    ideal: Result | None = None,
    of: str = "acceleration",
    start: float = 0.0,
    segment: int = 4096,
) -> xr.DataArray:
    """Power spectral density of the tool's vibration by Welch's method.

    One-sided; Hann windows of `segment` samples that overlap by half, each less its mean. The
    acceleration is the mean one of each record interval h, (v[i+1] - v[i])/h: exact but for the
    running mean over h, which lowers the density by sinc^2(f h), 0.41 at the Nyquist frequency.

    P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Trans.
    Audio Electroacoust. 15 (1967) 70-73.

    Args:
        result: the run, recorded at even intervals.
        ideal: its ideal twin, whose motion is subtracted first; needed for ``deviation``.
        of: ``acceleration`` [(m/s^2)^2/Hz] or ``deviation`` [m^2/Hz].
        start: records before this are left out [s].
        segment: samples in a window; shorter if the run has fewer.

    Returns:
        (frequency, axis) with axis x, y, z, total (the sum), frequency in Hz; attributes
        `sampling_frequency_hz`, `window_s`, `windows`.

    Raises:
        JointplayError: too few even records.
    """
    from scipy.signal import welch

    if of not in ("acceleration", "deviation"):
        raise MissingName("spectrum", of, ("acceleration", "deviation"))
    if of == "deviation":
        if ideal is None:
            raise JointplayError("the spectrum of the deviation needs the ideal run: ideal=...")
        signal = deviation(result, ideal)
    elif ideal is not None:
        signal = deviation(result, ideal, "tool_velocity")
    else:
        signal = result["tool_velocity"]
    signal = signal.sel(time=signal["time"] >= start)
    time = signal["time"].values
    if len(time) > 2 and not np.isclose(time[-1] - time[-2], time[1] - time[0], rtol=1e-6):
        time = time[:-1]  # the last record is the end, wherever that falls
    values = signal.values[: len(time)]
    if len(time) > 1 and of == "acceleration":
        values = np.diff(values, axis=0) / np.diff(time)[:, None]
    if len(values) < 16:
        raise JointplayError(
            f"a spectrum needs at least 17 records from {start:g} s on, got {len(time)}"
        )
    interval = float(time[-1] - time[0]) / (len(time) - 1)
    length = min(segment, len(values))
    frequency, density = welch(
        values, fs=1.0 / interval, window="hann", nperseg=length, detrend="constant", axis=0
    )
    density = np.column_stack([density, density.sum(axis=1)])
    return xr.DataArray(
        density,
        {"frequency": ("frequency", frequency, {"units": "Hz"}), "axis": list(COMPONENTS)},
        ("frequency", "axis"),
        attrs={
            "units": "(m/s^2)^2/Hz" if of == "acceleration" else "m^2/Hz",
            "long_name": f"power spectral density of the tool's {of}"
            + (" from the ideal robot" if ideal is not None else ""),
            "sampling_frequency_hz": 1.0 / interval,
            "window_s": length * interval,
            "windows": 1 + (len(values) - length) // max(length - length // 2, 1),
        },
    )
