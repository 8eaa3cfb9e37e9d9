"""`jointplay robots`: the available robots, their joints, and what is known of their play.

List the robots of the package example-robot-data, their joints, and what prevents simulating them;
each is loaded to find out; and the names of those of robot_descriptions. For one robot, or any URDF
or xacro: joints with their limits and mimic relations, frames, the tool.

Use one wherever a URDF is expected: jointplay run NAME --joint JOINT.

With --presets: what is publicly known of the bearings, gears and servos of robots, and classes for
robots of which nothing is. Each number says whether it was seen in a public source, estimated from
one, or assumed. Use one with --preset: jointplay run so101 --preset
With a file of your own: what it still lacks to become part of jointplay.
"""

from __future__ import annotations

import argparse
import textwrap
from typing import TYPE_CHECKING, Any

from jointplay.base import streams
from jointplay.base.errors import JointplayError
from jointplay.base.tables import aligned
from jointplay.cli.commands.inputs import xacro_arguments
from jointplay.cli.options import FLAG, REPEATED, Parser

if TYPE_CHECKING:
    from jointplay.model.survey import Survey
    from jointplay.model.urdf import Description


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("name", metavar="NAME", nargs="?", help="robot, or path of a URDF or xacro, to describe in "
        "detail; with --presets, a preset or file")
    add("--xacro", metavar="NAME:=VALUE", **REPEATED, help="argument of a robot that is written in "
        "xacro")
    add("--presets", **FLAG, help="list presets of joints, gears and drives instead")
# fmt: on


def run(options: argparse.Namespace) -> int:
    if options.presets:
        from jointplay.scenario.presets import LEFT_OUT, preset, presets

        for one in map(preset, presets() if options.name is None else [options.name]):
            print(one, *(f"    ! lacks: {line}" for line in one.lacks()), sep="\n")
        if options.name is None:
            print(*(f"{name}: no preset: {why}" for name, why in LEFT_OUT.items()), sep="\n")
        return 0
    from jointplay.model import robot_descriptions, robots
    from jointplay.model.survey import survey

    if options.name is not None:
        print(detail(survey(options.name, xacro_arguments(options.xacro))))
        return 0
    try:
        surveys = [survey(robots.with_package(name)) for name in robots.robots()]
    except JointplayError as error:  # the package of most of them is not installed
        surveys = [survey(robots.with_package(name)) for name in robots.OWN]
        streams.note(f"only the robots that ship are listed: {error}")
    print("ARMS (revolute joints on one path)")
    print(*(_entry(robot) for robot in surveys if robot.serial), sep="\n")
    print("OTHERS (the base is held fast, unless it is run with --base free)")
    print(*(_entry(robot) for robot in surveys if not robot.serial), sep="\n")
    print("OTHERS OF robot_descriptions, which clones them one by one")
    print(_wrapped(", ".join(robot_descriptions.names()) or "not installed"))
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


def detail(survey: Survey) -> str:
    from jointplay.model.tool import choose_tool
    from jointplay.model.vocabulary import as_option

    lines = [f"{survey.name}: {survey.path}"]
    if survey.mechanism is None:
        lines += [f"    {joint}  {kind}" for joint, kind in survey.moving.items()]
    else:
        description = survey.mechanism.description
        tool, reason = choose_tool(description)
        lines += _joints(survey, description)
        lines.append(_wrapped(f"frames: {', '.join(description.links)}"))
        lines.append(_wrapped(f"tool, if none is named: {tool} ({reason})"))
        if description.held:
            lines.append(_wrapped(f"! {description.held}; --base free lets go of it"))
    remarks = list(survey.remarks)
    if survey.bare:
        remarks.append(
            f"links without mass: {', '.join(survey.bare)}; their joints cannot have clearance "
            "until the URDF gives the links an <inertial>; budgets need none"
        )
    lines += [_wrapped(f"! {remark}") for remark in remarks]
    options = ["--allow-unphysical all"] if survey.unphysical else []
    if survey.massless and len(survey.massless) < len(survey.moving):
        options.append(f"--fix {as_option(survey.massless)}")
    lines += [f"    option: {one}" for one in options]
    return "\n".join(lines)


def described(description: Description) -> dict[str, Any]:
    """Joints and links as data: limits in rad or m, speeds and efforts in SI."""
    keys = ("name", "kind", "parent", "child", "lower", "upper", "speed", "effort")
    joints = [description.joints[name] for name in description.moving]
    return {
        "joints": [{key: getattr(one, key) for key in keys} | {"unit": one.unit} for one in joints],
        "frames": list(description.links),
    }


def _joints(survey: Survey, description: Description) -> list[str]:
    rows = [("joint", "kind", "parent", "child", "position", "speed", "effort", "")]
    for name in survey.moving:
        entry = description.joints[name]
        unit, force = ("m", "N") if entry.slides else ("rad", "N m")
        position = "" if entry.lower is None else f"{entry.lower:.4g} to {entry.upper:.4g} {unit}"
        speed = "" if entry.speed is None else f"{entry.speed:.4g} {unit}/s"
        effort = "" if entry.effort is None else f"{entry.effort:.4g} {force}"
        more = [] if entry.mimic is None else [f"follows {entry.mimic.formula()}"]
        if name in description.reductions:
            more.append(f"geared {description.reductions[name]:g} : 1")
        words = (name, entry.kind, entry.parent, entry.child)
        rows.append((*words, position, speed, effort, "; ".join(more)))
    return [f"    {line}" for line in aligned(rows)]
