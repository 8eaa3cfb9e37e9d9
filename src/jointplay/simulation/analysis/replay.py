"""Replay: a run repeated, with every step recorded in some windows, to see single impacts.

Equal simulations give equal bits, so that full resolution costs no memory: the run is repeated, and
only the windows asked for are kept in full.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from jointplay.base.errors import JointplayError, require_whole
from jointplay.simulation.analysis import Contacts, contacts
from jointplay.simulation.prepare import CHUNK
from jointplay.simulation.result.histories import histories
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.variables import Phase, contact_names
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation

WINDOW_STEPS = 600
"""Largest number of steps recorded around an impact."""
MARGIN_STEPS = 60
"""Number of steps shown before and after an impact."""


@dataclass(frozen=True)
class Replay:
    """A repeated run: histories within the windows, and statistics of all contacts."""

    windows: tuple[xr.Dataset, ...]
    """Variables of a result in each window, with a record for every step."""
    statistics: xr.Dataset
    """Exact statistics by joint and contact: `onsets`, `ended`, `shortest_steps`, `under_resolved`,
    and `impulse` [N s]."""
    faithful: bool
    """Whether the records of the result came out again, bit for bit."""


def largest_impacts(result: Result, number: int) -> list[tuple[Contacts, int]]:
    """The contacts with the largest peak forces, no two in the same `window`, largest first.

    Each is given as the contacts of its place, and its index among them.
    """
    number = require_whole("number", number)
    step = result.audit.step
    ranked = sorted(
        ((place.peak[i], place, i) for place in contacts(result) for i in range(len(place.peak))),
        key=lambda item: -item[0],
    )
    chosen: list[tuple[Contacts, int]] = []
    for _, place, i in ranked:
        if len(chosen) == number:
            break
        apart = (abs(place.peak_time[i] - p.peak_time[k]) for p, k in chosen)
        if all(distance > WINDOW_STEPS * step for distance in apart):
            chosen.append((place, i))
    return chosen


def window(place: Contacts, index: int, step: float) -> tuple[float, float]:
    """Start and end [s] of a window of up to `WINDOW_STEPS` around one of the contacts.

    It has the whole contact if that fits; else it begins with the contact if its peak fits, and
    lies around the peak if not.
    """
    margin = MARGIN_STEPS * step
    start = float(place.start[index]) - margin
    end = float(place.start[index] + place.duration[index]) + 2.0 * margin
    longest = WINDOW_STEPS * step
    peak = float(place.peak_time[index])
    if end - start > longest:
        if peak > start + longest - margin:
            start = peak - 0.5 * longest
        end = start + longest
    return start, end


def replay(result: Result, windows: Sequence[tuple[float, float]]) -> Replay:
    """Repeat the run of `result`, up to its end, and record every step within the `windows`.

    `windows`: start and end of each [s]; what lies outside the run is left out.

    Raises:
        JointplayError: the simulation cannot be built again, or the run is empty.
    """
    simulation = result.simulation
    step = simulation.step
    if len(result.time) < 2:
        raise JointplayError(f"a run with {len(result.time)} records cannot be repeated")
    recorded = np.rint(result.time / step).astype(int)
    steps = int(recorded[-1])
    spans = [(max(0, round(a / step)), min(steps, round(b / step))) for a, b in windows]
    run = Run(simulation)
    workspace = run.workspace
    workspace.record_windows([(a, b) for a, b in spans if a <= b])
    workspace.reserve_records(len(workspace.record) + sum(max(0, b - a + 1) for a, b in spans))
    for moment in run.steps(CHUNK * step):  # in the stretches of any run
        if moment.step > steps:
            break
    again = histories(run, workspace.status, phases=_phases(run, simulation)).dataset
    indices = np.rint(again["time"].values / step).astype(int)
    same = again["q"].values[np.isin(indices, recorded)]
    return Replay(
        tuple(again.isel(time=(indices >= a) & (indices <= b)) for a, b in spans),
        _statistics(run) if result.joints else xr.Dataset(),
        bool(np.array_equal(same, result["q"].values)),
    )


def _phases(run: Run, simulation: Simulation) -> list[Phase]:
    """The run's phases, with their rows among the records of a replay, which are more."""
    moments = (t for load in simulation.payloads for t in (load.pick, load.release))
    at = sorted(round(t / simulation.step) for t in moments if t is not None)
    recorded = np.rint(run.workspace.recorded("time") / simulation.step).astype(int)
    first, *others = run.phases
    rows = np.searchsorted(recorded, at[: len(others)])
    moved = [replace(phase, row=int(row)) for phase, row in zip(others, rows, strict=True)]
    return [first, *moved]


def _statistics(run: Run) -> xr.Dataset:
    """Counts and impulses by joint and contact; NaN where there is no such contact."""
    joints, names = run.mechanism.clearance, contact_names(run.mechanism)
    statistics = ("onsets", "ended", "shortest_steps", "under_resolved", "impulse")
    tables = {name: np.full((len(joints), len(names)), np.nan) for name in statistics}
    counted = run.workspace.contact_statistics()
    for j, joint in enumerate(joints.values()):
        at = [names.index(contact) for contact in joint.contacts]
        for name, values in tables.items():
            values[j, at] = counted[name][j, : len(at)]
    return xr.Dataset(
        {name: (("joint", "contact"), values) for name, values in tables.items()},
        {"joint": list(joints), "contact": names},
    )


@dataclass(frozen=True)
class Impact:
    """One contact followed step by step."""

    joint: str
    contact: str
    start: float
    """Time of the last step before it [s]; NaN if it began before the window."""
    steps: int
    complete: bool
    """Whether it began and ended within the window."""
    peak_force: float
    """Largest normal force [N]."""
    penetration: float
    """Largest penetration [m]."""
    approach_speed: float
    """Rate at which the gap closed in the last step before contact [m/s]; NaN if not seen."""
    separation_speed: float
    """Rate at which the gap opened in the first step after it [m/s]; NaN if not seen."""


def follow(window: xr.Dataset, joint: str, contact: str) -> Impact:
    """Follow the contact with the window's largest normal force at one place, step by step."""
    at = {"joint": joint, "contact": contact}
    time = window["time"].values
    gap, force = window["gap"].sel(at).values, window["normal_force"].sel(at).values
    closed = gap < 0.0
    top = int(force.argmax())
    first = last = top
    while first > 0 and closed[first - 1]:
        first -= 1
    while last < len(gap) - 1 and closed[last + 1]:
        last += 1
    began, ended = first > 0, last < len(gap) - 1
    rate = np.diff(gap) / np.diff(time)
    return Impact(
        joint,
        contact,
        float(time[first - 1]) if began else float("nan"),
        last - first + 1,
        began and ended,
        float(force[top]),
        float(-gap[first : last + 1].min()),
        float(-rate[first - 1]) if began else float("nan"),
        float(rate[last]) if ended else float("nan"),
    )
