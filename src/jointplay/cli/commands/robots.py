"""`jointplay robots`: the available robots, their joints, and what is known of their play.

List the robots of the package example-robot-data, their joints, and what prevents simulating them;
each is loaded to find out; and the names of those of robot_descriptions. For one robot, or any URDF
or xacro: joints with their limits and mimic relations, frames, the tool.

Use one wherever a URDF is expected: jointplay run NAME --joint JOINT.

With --presets: what is publicly known of the bearings, gears and servos of robots, and classes for
the other robots. Each number says whether it was seen in a public source, estimated from one, or
assumed. Use one with --preset: jointplay run so101 --preset
With a file of your own: what it still lacks to become part of jointplay.
"""

import argparse

from jointplay.base import streams
from jointplay.base.errors import JointplayError
from jointplay.base.tables import wrapped
from jointplay.cli.options import FLAG, Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("name", metavar="NAME", nargs="?", help="robot, or path of a URDF or xacro, to describe in "
        "detail; with --presets, a preset or file")
    parser.share("--xacro")
    add("--presets", **FLAG, help="list presets of joints, gears and drives instead")
# fmt: on


def run(options: argparse.Namespace) -> int:
    if options.presets:
        from jointplay.scenario.presets import LEFT_OUT, preset, presets

        for known in map(preset, presets() if options.name is None else [options.name]):
            print(known, *(f"    ! lacks: {line}" for line in known.lacks()), sep="\n")
        if options.name is None:
            print(*(f"{name}: no preset: {why}" for name, why in LEFT_OUT.items()), sep="\n")
        return 0
    if options.name is not None:
        from jointplay.model.survey import survey
        from jointplay.model.xacro import read_arguments

        print(survey(options.name, read_arguments(options.xacro)))
        return 0
    from jointplay.model import robot_descriptions, robots
    from jointplay.model.robot_list import listed

    try:
        names = robots.robots()
    except JointplayError as error:  # the package of most of them is not installed
        names = tuple(robots.OWN)
        streams.note(f"only the robots that ship are listed: {error}")
    print(listed(names))
    print("OTHERS OF robot_descriptions, which clones them one by one")
    print(wrapped(", ".join(robot_descriptions.names()) or "not installed"))
    return 0
