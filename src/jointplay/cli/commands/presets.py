"""`jointplay presets`: what is publicly known of robots' joints, and classes to choose from."""

from __future__ import annotations

import argparse
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the subparsers."""
    parser = commands.add_parser(
        "presets",
        help="list what is publicly known of robots' joints, with the origin of each number",
        description="List presets: bearings, gears and servos of robots as far as they are "
        "publicly known, and classes for robots of which nothing is. Each number says whether it "
        "was seen in a public source, estimated from one, or assumed.",
        epilog="Use one with --preset: jointplay run so101 --preset",
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="one preset")


def run(options: argparse.Namespace) -> int:
    """Print all presets, or one."""
    from jointplay.scenario.presets import preset, presets

    names = presets() if options.name is None else [options.name]
    print("\n".join(str(preset(name)) for name in names))
    return 0
