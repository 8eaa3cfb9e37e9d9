"""What a report is about: results with their ideal references and their impacts step by step."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from jointplay.base.errors import JointplayError
from jointplay.base.tables import counted
from jointplay.show.plots.figures import coloured
from jointplay.show.reports.html import Html, markup, note
from jointplay.simulation import analysis
from jointplay.simulation.analysis.replay import (
    Impact,
    Replay,
    follow,
    largest_impacts,
    replay,
    window,
)
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.variables import contact_names

Say = Callable[[str], None]


@dataclass(eq=False)
class Case:
    """One result of a report."""

    label: str
    result: Result
    colour: str
    ideal: Result | None = None  # what its tool is measured against; itself for an ideal run
    error: xr.DataArray | None = None
    """The tool's deviation from `ideal` (time, axis) [m]; None for an ideal run."""
    turn: xr.DataArray | None = None  # the same of its orientation [rad]
    replay: Replay | None = None
    impacts: list[Impact] = field(default_factory=list)
    """The largest ones, step by step, one for each window of the replay."""
    notes: list[Html] = field(default_factory=list)
    """What the reader must know of how this case was evaluated."""

    @property
    def joints(self) -> list[str]:
        return self.result.joints

    @property
    def duration(self) -> float:
        """Time of the last record [s]."""
        return float(self.result.time[-1])

    def detailed(self) -> Result:
        """The records, and instead of them every step where the run was replayed.

        There held peaks and smallest gaps are those of the single step.
        """
        if self.replay is None or not self.replay.windows:
            return self.result
        kept = np.ones(len(self.result.time), bool)
        parts = []
        held = {"joint_force": "joint_force_peak", "normal_force": "normal_force_peak"}
        held["gap"] = "gap_min"
        for part in self.replay.windows:
            time = part["time"].values
            kept &= (self.result.time < time[0]) | (self.result.time > time[-1])
            parts.append(part.assign({peak: part[name] for name, peak in held.items()}))
        parts.append(self.result.dataset.isel(time=kept))
        merged = xr.concat(parts[::-1], "time", data_vars="minimal", combine_attrs="override")
        merged = merged.sortby("time")
        _, first = np.unique(merged["time"].values, return_index=True)
        return Result(merged.isel(time=first))


def build(results: Mapping[str, Result], say: Say) -> list[Case]:
    """Find or simulate the ideal references."""
    cases = [Case(label, result, colour) for label, result, colour in coloured(results)]
    given = [case for case in cases if not analysis.has_play(case.result)]
    made: dict[str, Result] = {}
    for case in cases:
        if case in given:
            case.ideal = case.result
            continue
        twins = (
            other
            for other in given
            if analysis.is_twin(case.result, other.result) and len(other.result.time) > 1
        )
        try:
            if (twin := next(twins, None)) is not None:
                case.ideal = twin.result
                case.notes.append(note("given-twin", repr(twin.label)))
            else:
                key = json.dumps([analysis.task(case.result), case.duration], sort_keys=True)
                if key not in made:
                    say(f"simulating the ideal mechanism that {case.label!r} is measured against")
                    made[key] = analysis.twin(case.result)
                case.ideal = made[key]
                case.notes.append(note("made-twin"))
            case.error = analysis.deviation(case.result, case.ideal)
            case.turn = analysis.deviation(case.result, case.ideal, "tool_orientation")
            simulation = case.result.simulation
            drives = simulation.drive
            each = drives.values() if isinstance(drives, Mapping) else [drives]
            if simulation.motion is None or not any(drive.follows for drive in each):
                case.notes.append(note("free"))
            if float(case.error["time"][-1]) < case.duration:
                case.notes.append(note("short-twin", f"{float(case.error['time'][-1]):g}"))
        except JointplayError as error:
            case.ideal = case.error = case.turn = None
            case.notes.append(note("no-twin", str(error)))
    return cases


def follow_impacts(cases: Iterable[Case], number: int, say: Say) -> None:
    """Repeat the runs, and keep the largest impacts of each step by step."""
    for case in cases if number else ():
        if not case.joints:
            continue
        chosen = largest_impacts(case.result, number)
        if not chosen:
            case.notes.append(note("no-contact"))
            continue
        step, what = case.result.audit.step, counted(len(chosen), "largest impact")
        say(f"repeating {case.label!r}, for its {what} step by step")
        try:
            mechanism = case.result.simulation.mechanism
            if contact_names(mechanism) != [str(name) for name in case.result["contact"].values]:
                raise JointplayError("its contacts do not match its inputs")
            repetition = replay(case.result, [window(place, i, step) for place, i in chosen])
        except JointplayError as error:
            case.notes.append(note("no-repetition", str(error)))
            say(f"{case.label!r} cannot be repeated: {error}")
            continue
        if not repetition.faithful:
            versions = case.result.dataset.attrs.get("versions", "unknown")
            case.notes.append(note("unfaithful", versions))
            continue
        case.replay = repetition
        case.impacts = [
            follow(part, place.joint, place.contact)
            for part, (place, _) in zip(repetition.windows, chosen, strict=True)
        ]


# How cases and their parts are named, and from when on they are judged.


def inside_bearings(cases: Sequence[Case]) -> tuple[str, str, str]:
    """What moves in the bearings: the section on it, the title of its orbits, a word for it."""
    rolls = {analysis.rolls(case.result, joint) for case in cases for joint in case.joints}
    if rolls == {True}:
        return "Inner rings", "Inner ring's centre in the outer ring", "inner ring"
    if rolls == {True, False}:
        return "Journals and inner rings", "Centre in the bearing", "journal or inner ring"
    return "Journal", "Journal centre in its bearing", "journal"


def dark(case: Case) -> Html:
    """The case's name with a swatch of its colour."""
    return markup('<span class="case" style="--c:{}">{}</span>', case.colour, case.label)


def settled(cases: Sequence[Case]) -> float:
    """From when on statistics are taken [s]: not while journals fall into their bearings."""
    latest = max(case.result.judge_from for case in cases)
    return latest if min(case.duration for case in cases) > latest else 0.0


def since(start: float) -> str:
    """What a caption says of the time that is judged."""
    return f"; from {start:g} s on" if start else ""


def place_of(case: Case, joint: str, contact: str) -> Html:
    """The case and one of a joint's contacts."""
    return markup("{}, {}, {}", dark(case), joint, contact.replace("_", " "))
