"""The report's block of parameters: every input of the runs, with motions, laws, robots in full."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.tables import Table
from jointplay.model.urdf import parse
from jointplay.scenario.summary import facts
from jointplay.show.reports.cases import Case, Runs
from jointplay.show.reports.html import markup
from jointplay.show.reports.parts import Fold, Grid, Part, Row
from jointplay.simulation import analysis
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.run import Run

_MOST_WAYPOINTS = 500  # rows of the table of waypoints (judged)


def parameters(runs: Runs) -> Iterator[Part]:
    """Every input of each case and where it comes from, its laws, the motion, the robot."""
    yield runs.by_case(_inputs, head="input", name="inputs", left=1 + len(runs.cases))
    if given := value_rows(runs, assumed=False):
        yield Fold("What is not assumed, and where it comes from", [Grid.of_rows(given)])
    # By summary and source, the cases and joints that use it, each once (a dict keeps the order).
    sources: dict[tuple[str, str], dict[str, None]] = {}
    for case in runs.cases:
        inputs = analysis.inputs(case.result)
        for joint, fields in analysis.clearance_inputs(case.result).items():
            for law in fields.values():  # the source of a user's own law is shown, and never run
                if isinstance(law, dict) and law.get("source"):
                    user = joint if case.alone else f"{case.label}, {joint}"
                    key = f"Law {law['function']}", str(law["source"])
                    sources.setdefault(key, {})[user] = None
        if urdf := inputs["mechanism"].get("urdf_text"):
            sources.setdefault(("Robot (URDF)", urdf), {})[case.label] = None
    motions: dict[str, list[Case]] = {}
    for case in runs.cases:
        motions.setdefault(json.dumps(analysis.inputs(case.result)["motion"]), []).append(case)
    for motion, cases in motions.items():
        if motion != "null":
            whose = f" of {', '.join(case.label for case in cases)}" if len(motions) > 1 else ""
            yield Fold(f"Waypoints{whose}", [_waypoints(motion, cases[0])])
    for (name, source), users in sources.items():
        of = "" if set(users) >= set(runs.recorded) else f" ({'; '.join(users)})"
        yield Fold(f"{name}{of}", [markup("<pre>{}</pre>", source)])


def value_rows(runs: Runs, assumed: bool) -> list[Row]:
    """A row for each value that was assumed (or given): its origin and the cases that use it."""
    users: dict[tuple[str, ...], list[Case]] = {}
    for case in runs.cases:
        for value in case.result.values:
            if value.assumed == assumed:
                users.setdefault((*value, value.effect), []).append(case)
    rows: list[Row] = []
    for (key, size, origin, source, effect), cases in users.items():
        by = source if assumed else f"{origin}: {source}"
        row = {"value": key, "is": size, "by": by, "another would change": effect}
        rows.append({**row, "of": runs.named(cases)})
    return rows


def _waypoints(description: str, case: Case) -> Grid:
    motion = Motion.from_description(json.loads(description))
    rows = np.column_stack(motion.waypoints).tolist()[:_MOST_WAYPOINTS]
    # Units come from the URDF's text: a mechanism with a user's own laws may not be buildable here.
    robot = analysis.inputs(case.result)["mechanism"]
    joints = parse(robot["urdf_text"], Path(robot["urdf"]), robot["allow_unphysical"]).joints
    names = [f"{n} [{joints[n].unit if n in joints else 'rad or m'}]" for n in motion.joints]
    return Grid.of_table(Table.of([(head, "") for head in ("time [s]", *names)], rows), 0)


def _inputs(case: Case) -> Row:
    versions = json.loads(case.result.dataset.attrs.get("versions", "{}"))
    made_with = {"made with": ", ".join(f"{name} {version}" for name, version in versions.items())}
    try:
        return facts(Run(case.result.simulation)) | made_with
    except JointplayError as error:  # for example a user's own law, which may not be imported
        return {"not shown": str(error)} | made_with
