"""`jointplay robots`: list the available robots and their joints.

List the robots of the package example-robot-data, their joints, and what prevents simulating them;
each is loaded to find out. For one robot, or any URDF: joints with their limits and mimic
relations, frames, the tool.

Use one wherever a URDF is expected: jointplay run NAME --joint JOINT.

    [NAME]  robot, or path of a URDF, to describe in detail
"""

from __future__ import annotations

import argparse
import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.model.survey import Survey
    from jointplay.model.urdf import Description


def run(options: argparse.Namespace) -> int:
    """Print all robots, arms first, or one."""
    from jointplay.model import robots
    from jointplay.model.survey import survey

    if options.name is not None:
        print(_detail(survey(options.name)))
        return 0
    surveys = [survey(name) for name in robots.robots()]
    arms = [robot for robot in surveys if robot.serial]
    others = [robot for robot in surveys if not robot.serial]
    print("\n".join(["ARMS (revolute joints on one path)", *map(_entry, arms)]))
    print(
        "\n".join(
            [
                "OTHERS (the base is held fast, unless it is run with --base free)",
                *map(_entry, others),
            ]
        )
    )
    return 0


def _entry(survey: Survey) -> str:
    lines = [survey.name]
    for kind in dict.fromkeys(survey.moving.values()):
        joints = [joint for joint, its in survey.moving.items() if its == kind]
        lines.append(_wrapped(f"{len(joints)} {kind}: {', '.join(joints)}"))
    lines += [_wrapped(f"! {remark}") for remark in survey.remarks]
    return "\n".join(lines)


def _wrapped(text: str) -> str:
    return textwrap.fill(
        text, 100, initial_indent="    ", subsequent_indent="      ", break_on_hyphens=False
    )


def _detail(survey: Survey) -> str:
    from jointplay.model.urdf import as_option

    lines = [f"{survey.name}: {survey.path}"]
    if survey.mechanism is None:
        lines += [f"    {joint}  {kind}" for joint, kind in survey.moving.items()]
    else:
        lines += _joints(survey, survey.mechanism.description) + _frames(survey.mechanism)
    remarks = list(survey.remarks)
    if survey.mechanism is not None and (held := survey.mechanism.description.held):
        remarks.insert(0, f"{held}; --base free lets go of it")
    if survey.bare:
        remarks.append(
            f"links without mass: {', '.join(survey.bare)}; their joints cannot have clearance "
            "until the URDF gives the links an <inertial>"
        )
    lines += [_wrapped(f"! {remark}") for remark in remarks]
    options = ["--allow-unphysical all"] if survey.unphysical else []
    options += [f"--fix {as_option(survey.massless)}"] if survey.massless else []
    lines += [f"    option: {one}" for one in options]
    return "\n".join(lines)


def _joints(survey: Survey, description: Description) -> list[str]:
    """A table of the moving joints, a line each."""
    rows = [("joint", "kind", "parent", "child", "position", "speed", "effort", "")]
    gears = description.declared.transmissions
    for name in survey.moving:
        entry = description.joints[name]
        unit, force = ("m", "N") if entry.slides else ("rad", "N m")
        position = "" if entry.lower is None else f"{entry.lower:.4g} to {entry.upper:.4g} {unit}"
        more = []
        if entry.mimic is not None:
            more.append(f"follows {entry.mimic.formula()}")
        if name in gears and gears[name].reduction is not None:
            more.append(f"geared {gears[name].reduction:g} : 1")
        rows.append(
            (
                name,
                entry.kind,
                entry.parent,
                entry.child,
                position,
                "" if entry.speed is None else f"{entry.speed:.4g} {unit}/s",
                "" if entry.effort is None else f"{entry.effort:.4g} {force}",
                "; ".join(more),
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "    " + "  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _frames(mechanism: Mechanism) -> list[str]:
    from jointplay.model.tool import choose_tool

    tool, reason = choose_tool(mechanism.description)
    return [
        _wrapped(f"frames: {', '.join(mechanism.description.links)}"),
        _wrapped(f"tool, if none is named: {tool} ({reason})"),
    ]
