"""`jointplay check`: check a scenario file, or a robot with options, without running it.

Check a scenario without running it: its keys, values and units, the robot, and whether every case
can start. Prints how the file was understood, and draws the mechanism at the start of the first
case with clearance. For a robot alone (URDF, xacro, MJCF) it lists what the robot consists of, and
all that is impossible or doubtful, each with link, line and a correction to paste: an inertia is
that of the link's mesh at its mass. All input options of jointplay run are accepted too.

Example: jointplay check my.urdf --write fixed.urdf
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.cli.commands import inputs, print_json
from jointplay.cli.commands.inputs import is_scenario, of_journals, scenario_of
from jointplay.cli.options import FLAG, REPEATED, Parser
from jointplay.model.robots import PREFIXES

if TYPE_CHECKING:
    import numpy as np

    from jointplay.model.mechanism import Mechanism

MARK = "jointplay check"
"""Text in the PNG's metadata: a picture with it may be replaced."""


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    add = parser.add_argument
    add("--case", metavar="NAME", **REPEATED, help="check only this case of FILE")
    add("--schema", **FLAG, help="print the JSON schema of scenario files instead: saved as "
        "scenario.schema.json beside a scenario whose first line is `#:schema "
        "scenario.schema.json`, it gives editors with Taplo (Even Better TOML) completion, "
        "explanations and checks")
    picture = parser.add_mutually_exclusive_group().add_argument
    picture("--picture", metavar="PNG", help="picture of the mechanism (default: beside FILE, as "
        ".png)")
    picture("--no-picture", **FLAG, help="do not draw a picture")
    add("--write", metavar="URDF", help="write the corrected robot; not that of a scenario; xacro "
        "and MJCF become a URDF; nothing is overwritten")
    parser.share("--json")
# fmt: on


def run(options: argparse.Namespace) -> int:
    if options.schema:
        from jointplay.scenario.schema import schema

        json.dump(schema(), sys.stdout, indent=1, ensure_ascii=False)
        print()
        return 0
    if options.place is None:
        raise JointplayError("the argument FILE | ROBOT is missing: what is to be checked")
    # `bare`: only a robot is named, without play or a motion; then its file is diagnosed.
    asked = options.joint or options.gear or options.set or of_journals(options) or options.ideal
    named = options.preset is not None or options.motion is not None
    bare = not (is_scenario(options) or asked or named)
    if options.write and not bare:
        raise JointplayError("--write mends a robot's file: give one, without joints or a motion")
    findings: list[Any] = []
    if bare:
        from jointplay.model.doctor import diagnose
        from jointplay.model.xacro import read_arguments

        diagnosis = diagnose(options.place, read_arguments(options.xacro))
        findings = diagnosis.findings
        print(diagnosis.sentence, *findings, sep="\n")
        if options.write:
            path = Path(options.write)
            files.write(path, diagnosis.text(path))
            left = f", refused still: {diagnosis.refused}" if diagnosis.refused else ""
            print(f"written to {path}{left}")
        if diagnosis.impossible:
            if options.json:
                print_json(options, {"answer": diagnosis.sentence, "findings": findings})
            return 1
    scenario = scenario_of(options, moves=not bare)
    place = None if options.no_picture else _place(options, scenario)
    if bare:
        mechanism = scenario.mechanism()
        if not (mechanism.clearance or mechanism.gears):
            from jointplay.model.survey import described, survey

            text = str(survey(options.place, read_arguments(options.xacro)))
            if options.json:
                answer = {"answer": text.splitlines(), "findings": findings}
                print_json(options, answer | described(mechanism.description))
            print(text, *scenario.assumptions, sep="\n")
            if place is not None:
                from jointplay.accuracy.poses import middle

                q = mechanism.configuration(middle(mechanism))
                print(_drawn(*place, scenario.title, mechanism, q))
            return 0
        scenario = scenario_of(options)
    from jointplay.scenario.summary import summary  # what comes now takes long to import

    runs = {case: scenario.ready_run(case) for case in options.case or scenario.cases}
    if options.json:
        from jointplay.simulation.values import values

        cases = {
            case: {
                "simulation": run.simulation.describe(),
                "values": values(run.simulation, scenario.origins(case), merged=False),
            }
            for case, run in runs.items()
        }
        notes = [*scenario.assumptions, *scenario.notes]
        print_json(options, {"answer": scenario.title, "cases": cases, "notes": notes})
    lines = [summary(scenario, runs), *(f"  {line}" for line in scenario.assumptions)]
    if scenario.sweep:
        from jointplay.study import plan_of
        from jointplay.study.sweeps import probe

        plan = plan_of(scenario)
        probe(plan)
        lines.append(f"sweep: {plan.summary}")
    if place is not None:
        first = next(iter(runs.values()))
        shown = next((run for run in runs.values() if run.mechanism.clearance), first)
        lines.append(_drawn(*place, scenario.title, shown.mechanism, shown.workspace.q))
    print("\n".join(lines))
    return 0


def _place(options: argparse.Namespace, scenario: Any) -> tuple[Path, bool]:
    """Path of the picture, and whether it replaces an earlier one."""
    beside = scenario.path.with_suffix(".png")
    # A file in a package has its picture in the current folder.
    if options.place.startswith(PREFIXES) or str(beside).startswith(PREFIXES):
        beside = Path(beside.name.rpartition(":")[2])
    path = Path(options.picture or beside)
    # A picture by an earlier check is outdated once the scenario has changed.
    replaced = options.picture is None and files.holds(path, MARK)
    try:
        if not replaced:
            files.check_picture(path)
    except JointplayError as error:
        message = f"{error} (--picture PNG chooses another, --no-picture none)"
        raise JointplayError(message) from None
    return path, replaced


def _drawn(path: Path, replaced: bool, title: str, mechanism: Mechanism, q: np.ndarray) -> str:
    from jointplay.show.picture import picture

    figure = picture(mechanism, q, title=title)
    files.picture(path, figure, mark=MARK)
    return f"picture: {path}{' (replaced)' if replaced else ''}"
