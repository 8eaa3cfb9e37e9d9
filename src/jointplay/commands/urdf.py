"""`jointplay urdf`: write a URDF with play in some of its joints, for other simulators."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

from jointplay.commands import add_option, add_shared, name_and_value, quantity
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
        epilog="Limits let the journal move about twice its clearance, and the inner ring of a "
        "rolling bearing as far as it is free; the bearings themselves (round, elastic, with "
        "friction) cannot be described in a URDF: docs/robots.md.",
    )
    add_option(parser, "--urdf FILE", "path of a URDF, or example-robot-data:NAME", required=True)
    add_option(
        parser,
        "--joint NAME[=LENGTH|=BEARING]",
        "revolute joint to be given clearance, and optionally its radial clearance or the "
        'designation of its rolling bearing, such as elbow="6010/C3" (repeatable)',
        action="append",
        required=True,
    )
    add_option(parser, "--radial LENGTH", "radial clearance C_r", 2e-4)
    add_option(parser, "--axial LENGTH", "axial clearance C_a", 2e-4)
    add_option(parser, "--bearing-radius LENGTH", "R_i", 10e-3)
    add_option(parser, "--bearing-length LENGTH", "L_i", 40e-3)
    add_shared(parser, "--allow-unphysical")
    add_shared(parser, "--fix")
    add_option(parser, "--out FILE", "URDF file to write", required=True)


def run(options: argparse.Namespace) -> int:
    """Write the URDF and say what is in it."""
    from jointplay.core.schema import read as make
    from jointplay.joints import Clearance, RevoluteClearance
    from jointplay.joints.bearings import bearing_kind, is_designation
    from jointplay.mechanism.export import to_urdf
    from jointplay.mechanism.mechanism import Mechanism
    from jointplay.mechanism.robots import resolve
    from jointplay.mechanism.urdf import read

    out = Path(options.out)
    files.check_new(out)
    description = read(resolve(options.urdf), options.allow_unphysical)
    joints = {}
    for text in options.joint:
        name, value = name_and_value(text, description.joints, is_designation)
        if value is not None and (kind := bearing_kind(value)) is not None:
            joints[name] = make(Clearance, {"kind": kind, "designation": value})
            continue
        radial = options.radial if value is None else quantity(value, "m", f"--joint {name}")
        joints[name] = RevoluteClearance(
            bearing_radius=options.bearing_radius,
            bearing_length=options.bearing_length,
            radial_clearance=radial,
            axial_clearance=options.axial,
        )
    mechanism = Mechanism(
        description, joints, allow_unphysical=options.allow_unphysical, fix=options.fix
    )
    text = to_urdf(mechanism)
    files.write(out, text)
    for joint in joints:
        print(f"{joint}: {', '.join(f'{joint}.{part}' for part in 'xyz')}, {joint} (yaw), ", end="")
        print(f"{joint}.pitch, {joint}.roll")
    moved = out.parent.resolve() != mechanism.description.path.parent.resolve()
    if moved and re.search(r'<mesh[^>]*filename="(?!\w+://|/)', text):
        print("note: mesh paths are relative to the old file; put the new file in the same folder")
    print(f"written: {out}")
    return 0
