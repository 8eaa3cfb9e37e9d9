"""`jointplay check`: check a scenario file, or a robot with options, without running it.

Check a scenario without running it: its keys, values and units, the robot, and whether every case
can start. Prints how the file was understood, and draws the mechanism at the start of the first
case with clearance. All input options of jointplay run are accepted too.

    [FILE | ROBOT]
    --case NAME ...  run only this case of FILE
    --schema  print the JSON schema of scenario files instead: saved as scenario.schema.json beside
        a scenario whose first line is `#:schema scenario.schema.json`, it gives editors with Taplo
        (Even Better TOML) completion, explanations and checks
    --picture PNG  picture of the mechanism (default: beside FILE, as .png)
    --no-picture  do not draw a picture
"""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.cli.commands.inputs import scenario_of
from jointplay.model.robots import PREFIXES

MARK = "jointplay check"
"""In the PNG's metadata: a picture that this command may replace."""


def run(options: argparse.Namespace) -> int:
    if options.schema:
        from jointplay.scenario.schema import schema

        json.dump(schema(), sys.stdout, indent=1, ensure_ascii=False)
        print()
        return 0
    if options.place is None:
        raise JointplayError("the argument FILE | ROBOT is missing: what is to be checked")
    if options.picture and options.no_picture:
        raise JointplayError("give one of --picture and --no-picture")
    scenario = scenario_of(options)
    place = None if options.no_picture else _place(options, scenario)
    from jointplay.scenario.summary import summary  # what comes now takes long to import

    runs = {case: scenario.ready_run(case) for case in options.case or scenario.cases}
    lines = [summary(scenario, runs), *(f"  {line}" for line in scenario.assumptions)]
    if scenario.sweep:
        from jointplay.study import plan_of
        from jointplay.study.sweeps import probe

        made = plan_of(scenario)
        probe(made)
        lines.append(f"sweep: {made.summary}")
    if place is not None:
        lines.append(_draw(*place, scenario.title, runs))
    print("\n".join(lines))
    return 0


def _place(options: argparse.Namespace, scenario: Any) -> tuple[Path, bool]:
    """Where to draw, and whether a picture there is replaced."""
    beside = scenario.path.with_suffix(".png")
    # Nothing is drawn into packages.
    if options.place.startswith(PREFIXES) or str(beside).startswith(PREFIXES):
        beside = Path(beside.name.rpartition(":")[2])
    path = Path(options.picture or beside)
    # What an earlier check drew is of no value once the scenario has changed.
    replaced = options.picture is None and files.holds(path, MARK)
    try:
        if not replaced:
            files.check_picture(path)
    except JointplayError as error:
        other = "--picture PNG chooses another, --no-picture none"
        raise JointplayError(f"{error} ({other})") from None
    return path, replaced


def _draw(path: Path, replaced: bool, title: str, runs: Mapping[str, Any]) -> str:
    from jointplay.show.picture import picture

    first = next(iter(runs.values()))
    shown = next((run for run in runs.values() if run.mechanism.clearance), first)
    figure = picture(shown.mechanism, shown.workspace.q, title=title)
    files.picture(path, figure, mark=MARK)
    return f"picture: {path}{' (replaced)' if replaced else ''}"
