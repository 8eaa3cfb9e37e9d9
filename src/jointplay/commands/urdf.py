"""`jointplay urdf`: write a URDF with play in some of its joints, for other simulators."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

from jointplay.commands import add_unphysical
from jointplay.core import files


def add(commands: Any) -> None:
    """Add the command to the subparsers."""
    parser = commands.add_parser(
        "urdf",
        usage="jointplay urdf --urdf FILE --joint NAME [--joint NAME] [options] --out FILE",
        help="write a URDF whose joints have play, for other simulators",
        description="Write a URDF in which each named revolute joint is replaced by the virtual "
        "link: three translations x, y, z of the journal in its bearing, then yaw, pitch and roll. "
        "Yaw keeps the joint's name, limits, friction and transmission. Everything else in the "
        "file stays as it is.",
        epilog="Limits let the journal move about twice its clearance; bearings themselves (round, "
        "elastic, with friction) cannot be said in a URDF: docs/robots.md.",
    )
    parser.add_argument(
        "--urdf", metavar="FILE", required=True, help="a file, or example-robot-data:NAME"
    )
    parser.add_argument(
        "--joint",
        metavar="NAME",
        action="append",
        required=True,
        help="revolute joint that has clearance (repeatable)",
    )
    for flag, default, text in (
        ("--radial", 2e-4, "radial clearance C_r [m]"),
        ("--axial", 2e-4, "axial clearance C_a [m]"),
        ("--bearing-radius", 10e-3, "R_i [m]"),
        ("--bearing-length", 40e-3, "L_i [m]"),
    ):
        parser.add_argument(
            flag, type=float, metavar="X", default=default, help=f"{text} (default {default:g})"
        )
    add_unphysical(parser)
    parser.add_argument("--out", metavar="FILE", required=True, help="the URDF to write")


def run(options: argparse.Namespace) -> int:
    """Write the URDF and say what is in it."""
    from jointplay.joints import RevoluteClearance
    from jointplay.mechanism.export import to_urdf
    from jointplay.mechanism.mechanism import Mechanism
    from jointplay.mechanism.robots import resolve

    out = Path(options.out)
    files.check_new(out)
    bearing = RevoluteClearance(
        bearing_radius=options.bearing_radius,
        bearing_length=options.bearing_length,
        radial_clearance=options.radial,
        axial_clearance=options.axial,
    )
    mechanism = Mechanism(
        resolve(options.urdf),
        dict.fromkeys(options.joint, bearing),
        allow_unphysical=options.allow_unphysical,
    )
    text = to_urdf(mechanism)
    files.write(out, text)
    for joint in options.joint:
        print(f"{joint}: {', '.join(f'{joint}.{part}' for part in 'xyz')}, {joint} (yaw), ", end="")
        print(f"{joint}.pitch, {joint}.roll")
    moved = out.parent.resolve() != mechanism.description.path.parent.resolve()
    if moved and re.search(r'<mesh[^>]*filename="(?!\w+://|/)', text):
        print("note: mesh paths are relative to the old file; put the new one beside it")
    print(f"written: {out}")
    return 0
