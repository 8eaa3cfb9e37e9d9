"""The runs that a report compares: results, their ideal references, impacts step by step."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from jointplay.base.errors import JointplayError
from jointplay.base.tables import counted
from jointplay.show.plots import figures
from jointplay.show.reports.html import Html, markup
from jointplay.show.reports.parts import Grid, Row
from jointplay.simulation import analysis
from jointplay.simulation.analysis import replay as replays
from jointplay.simulation.analysis.parts import ToolError
from jointplay.simulation.analysis.tool_error import Reference, compared
from jointplay.simulation.result.result import COMPARED, Result
from jointplay.simulation.result.variables import contact_names

Say = Callable[[str], None]


@dataclass(eq=False)
class Case:
    """A run of a report, and what is evaluated of it."""

    label: str
    result: Result
    colour: str
    alone: bool = False  # whether it is the only case, so that nothing needs its label
    error: xr.DataArray | None = None
    """Tool position less the ideal mechanism's (time, axis) [m]; None for an ideal run."""
    turn: xr.DataArray | None = None
    """Rotation vector from the ideal tool to the tool (time, axis) [rad]; None likewise."""
    replay: replays.Replay | None = None
    impacts: list[replays.Impact] = field(default_factory=list)
    """The largest impacts step by step, one for each window of the replay."""
    notes: list[str] = field(default_factory=list)
    """Sentences on how this case was evaluated, for the report's assumptions."""

    def __html__(self) -> str:
        """The label beside a swatch of the case's colour."""
        pattern = '<span class="case" style="--c:{}">{}</span>'
        return "" if self.alone else markup(pattern, self.colour, self.label)

    @property
    def prefix(self) -> Html:
        """The label and a colon, to begin a sentence on this case; nothing if it is alone."""
        return Html("") if self.alone else markup("{}: ", self)

    @cached_property
    def stated_error(self) -> ToolError | None:
        """Tool error, if the run's first line restates it (`ToolError.is_restated`)."""
        if self.error is not None:
            with suppress(JointplayError):  # a law of the user's own that may not be imported
                error = self.result.tool_error
                return error if error.is_restated else None
        return None

    @property
    def duration(self) -> float:
        """Time of the last record [s]."""
        return float(self.result.time[-1])

    def detailed(self) -> Result:
        """The records, in the windows of the replay replaced by every step.

        There, peaks and smallest gaps, which records hold over their interval, are the step's own.
        """
        if self.replay is None or not self.replay.windows:
            return self.result
        outside = np.ones(len(self.result.time), bool)
        parts = []
        held = {"joint_force": "joint_force_peak", "normal_force": "normal_force_peak"}
        held["gap"] = "gap_min"
        for window in self.replay.windows:
            time = window["time"].values
            outside &= (self.result.time < time[0]) | (self.result.time > time[-1])
            parts.append(window.assign({peak: window[name] for name, peak in held.items()}))
        parts.append(self.result.dataset.drop_vars(COMPARED, errors="ignore").isel(time=outside))
        merged = xr.concat(parts[::-1], "time", data_vars="minimal", combine_attrs="override")
        _, once = np.unique(merged["time"].values, return_index=True)  # sorted; windows may overlap
        merged = merged.isel(time=once)
        if self.error is not None:
            merged = compared(merged, Reference(self.result, "ideal_"))
        return Result(merged)


@dataclass(eq=False)
class Runs:
    """The cases of a report, and the time from which on they are judged."""

    cases: list[Case]

    @property
    def start(self) -> float:
        """Time from which on statistics count [s], after journals settled; 0 in shorter runs."""
        latest = max(case.result.judge_from for case in self.cases)
        return latest if min(case.duration for case in self.cases) > latest else 0.0

    @property
    def since(self) -> str:
        """The end of a caption, which says from when on figures are judged."""
        return f"; figures from {self.start:g} s on" if self.start else ""

    @cached_property
    def recorded(self) -> dict[str, Result]:
        return {case.label: case.result for case in self.cases}

    @cached_property
    def detailed(self) -> dict[str, Result]:
        return {case.label: case.detailed() for case in self.cases}

    @property
    def judged(self) -> list[Case]:
        """Cases with a tool error."""
        return [case for case in self.cases if case.error is not None]

    @property
    def places(self) -> list[tuple[Case, str]]:
        """Each case and each of its joints with clearance."""
        return [(case, joint) for case in self.cases for joint in case.result.joints]

    def named(self, cases: Collection[Case]) -> Html:
        """The labels of some cases; nothing if these are all of them."""
        return Html("") if len(cases) == len(self.cases) else Html(", ").join(cases)

    def by_case(self, quantities: Callable[[Case], Row], head: str = "", **fields: Any) -> Grid:
        """A table with a column for each case."""
        return Grid.of_cases(head, self.cases, [*map(quantities, self.cases)], **fields)


def build(results: Mapping[str, Result], say: Say) -> list[Case]:
    """Make the cases, with tool errors against ideal runs among the results or simulated ones."""
    alone = len(results) == 1
    cases = [Case(*case, alone) for case in figures.coloured(results)]
    ideals = [case for case in cases if not analysis.has_play(case.result)]
    for case in (case for case in cases if case not in ideals):
        try:
            if "tool_error" not in case.result.dataset:
                _measure(case, ideals, say)
            case.error = analysis.deviation(case.result)
            case.turn = analysis.deviation(case.result, "tool_orientation")
            simulation = case.result.simulation
            drive = simulation.drive
            drives = drive.values() if isinstance(drive, Mapping) else [drive]
            if simulation.motion is None or not any(drive.follows for drive in drives):
                case.notes.append(
                    "No drive follows a reference: the ideal mechanism moves freely, so the tool's "
                    "difference from it is not a position error."
                )
            if (until := float(case.error["time"][-1])) < case.duration:
                case.notes.append(
                    f"The reference ends at {until:g} s; tool errors are those up to there."
                )
        except JointplayError as error:
            case.error = case.turn = None
            case.notes.append(f"No tool errors: the ideal mechanism cannot be simulated ({error}).")
    return cases


def _measure(case: Case, ideals: Iterable[Case], say: Say) -> None:
    """Add the tool error to a case's result, against one of the ideal cases or a simulated twin."""
    for ideal in ideals:
        if len(ideal.result.time) > 1 and analysis.is_twin(case.result, ideal.result):
            case.result = analysis.measured_against(case.result, ideal.result)
            case.notes.append(f"Tool errors are measured against {ideal.label!r}.")
            return
    say(f"simulating the ideal mechanism that {case.label!r} is measured against")
    analysis.find_tool_error(case.result)
    case.notes.append(
        "Tool errors are measured against the ideal mechanism, simulated for this report because "
        "no ideal run with the same inputs was given."
    )


def follow_impacts(cases: Iterable[Case], number: int, say: Say) -> None:
    """Repeat each run and record its largest impacts (`number` of them) at every step."""
    for case in cases if number else ():
        chosen = replays.largest_impacts(case.result, number) if case.result.joints else []
        if not chosen:
            continue
        step = case.result.audit.step
        say(f"repeating {case.label!r}, for its {counted(len(chosen), 'largest impact')}")
        try:
            mechanism = case.result.simulation.mechanism
            if contact_names(mechanism) != [str(name) for name in case.result["contact"].values]:
                raise JointplayError("its contacts do not match its inputs")
            repetition = replays.replay(
                case.result, [replays.window(place, i, step) for place, i in chosen]
            )
            if not repetition.faithful:
                versions = case.result.dataset.attrs.get("versions", "unknown")
                raise JointplayError(
                    f"repeated here, it does not match the stored one bit for bit (made with "
                    f"{versions}), and impacts magnify any difference"
                )
        except JointplayError as error:
            case.notes.append(f"No single steps: the run cannot be repeated ({error}).")
            say(f"{case.label!r} cannot be repeated: {error}")
            continue
        case.replay = repetition
        case.impacts = [
            replays.follow(part, place.joint, place.contact)
            for part, (place, _) in zip(repetition.windows, chosen, strict=True)
        ]
