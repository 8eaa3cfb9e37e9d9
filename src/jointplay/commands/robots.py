"""`jointplay robots`: the robots that are at hand, and their joints."""

from __future__ import annotations

import argparse
import textwrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jointplay.mechanism.robots import Survey


def add(commands: Any) -> None:
    """Add the command to the subparsers."""
    parser = commands.add_parser(
        "robots",
        help="list robots that are at hand, with their joints",
        description="List the robots of the package example-robot-data with their joints, and what "
        "stands against simulating them. Each is loaded to find out.",
        epilog="Use one wherever a URDF is expected: --urdf example-robot-data:NAME.",
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="one robot, in detail")
    parser.set_defaults(handler=run)


def run(options: argparse.Namespace) -> int:
    """Print all robots, arms first, or one."""
    from jointplay.mechanism import robots

    if options.name is not None:
        print(_detail(robots.survey(options.name)))
        return 0
    found = [robots.survey(name) for name in robots.names()]
    arms = [robot for robot in found if robot.serial]
    others = [robot for robot in found if not robot.serial]
    print("\n".join(["ARMS (revolute joints on one path)", *map(_entry, arms)]))
    print("\n".join(["OTHERS (the base is held fast)", *map(_entry, others)]))
    return 0


def _entry(found: Survey) -> str:
    lines = [found.name]
    for kind in dict.fromkeys(found.moving.values()):
        joints = [joint for joint, its in found.moving.items() if its == kind]
        lines.append(_wrapped(f"{len(joints)} {kind}: {', '.join(joints)}"))
    lines += [_wrapped(f"! {remark}") for remark in found.remarks]
    return "\n".join(lines)


def _wrapped(text: str) -> str:
    return textwrap.fill(
        text, 100, initial_indent="    ", subsequent_indent="      ", break_on_hyphens=False
    )


def _detail(found: Survey) -> str:
    lines = [f"{found.name}: {found.path}"]
    width = max(map(len, found.moving), default=0)
    lines += [f"    {joint:{width}}  {kind}" for joint, kind in found.moving.items()]
    lines += [_wrapped(f"! {remark}") for remark in found.remarks]
    if found.unphysical:
        allowed = " ".join(f"--allow-unphysical {link}" for link in found.unphysical)
        lines.append(f"    options: {allowed}")
    return "\n".join(lines)
