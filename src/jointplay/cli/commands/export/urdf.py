"""`jointplay export urdf`: a URDF whose joints have play, for other simulators.

Write a URDF in which each named revolute joint is replaced by the virtual link: three translations
x, y, z of the journal in its bearing, then yaw, pitch and roll. Yaw keeps the joint's name, limits,
friction and transmission. Everything else in the file stays as it is.

Limits let the journal move about twice its clearance, and the inner ring of a rolling bearing as
far as it is free; the bearings themselves (round, elastic, with friction) cannot be described in a
URDF: docs/robots.md.
"""

import argparse
import re
from pathlib import Path

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.cli.commands import inputs
from jointplay.cli.commands.inputs import scenario_of
from jointplay.cli.options import Parser


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", "joints with clearance", required=True)
    add = parser.add_argument
    add("--out", metavar="FILE", required=True, help="URDF file to write")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.bridges.urdf import to_urdf

    out = Path(options.out)
    files.check_new(out)
    mechanism = scenario_of(options, moves=False).mechanism(options.case)
    if not mechanism.clearance:
        raise JointplayError("no joint has clearance: name one with --joint NAME")
    text = to_urdf(mechanism)
    files.write(out, text)
    for name, joint in mechanism.clearance.items():
        main = joint.drive_coordinate
        parts = [f"{name} ({x})" if x == main else f"{name}.{x}" for x in joint.freedoms]
        print(f"{name}: {', '.join(parts)}")
    moved = out.parent.resolve() != mechanism.description.path.parent.resolve()
    if moved and re.search(r'<mesh[^>]*filename="(?!\w+://|/)', text):
        print("note: mesh paths are relative to the old file; put the new file in the same folder")
    print(f"written: {out}")
    return 0
