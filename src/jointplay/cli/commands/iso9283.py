"""`jointplay iso9283`: accuracy and repeatability by the standard, from perturbed cycles."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from jointplay.base import streams
from jointplay.base.errors import JointplayError, require_non_negative, require_positive
from jointplay.cli.commands import Outputs, add_option, add_shared, given, quantity
from jointplay.cli.commands.inputs import add_inputs, explain, simulation_of

FILES = ("iso9283.csv", "poses.png", "path.png")
"""What is written into --out; at a part of the speed, its per cent stand before the dot."""
KINDS = {
    "path": "the path (default 10, at most --cycles)",
    "settling": "stabilization and overshoot (default 3)",
    "cornering": "corners (default 3)",
}
"""Kinds of figures that have their own number of cycles."""


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "iso9283",
        usage="jointplay iso9283 [FILE | ROBOT] [--cycles N] [--speed PERCENT] [--payload MASS] "
        "[--cube LENGTH --cube-centre X,Y,Z] [--drift-time TIME] [--out DIR] [options]",
        help="accuracy and repeatability as ISO 9283 names them, from perturbed cycles",
        description="Simulate the cycle of a scenario or robot many times, with journals "
        "displaced at random at the start, and print pose accuracy AP and "
        "repeatability RP at each stop, distance accuracy AD and repeatability RD "
        "between stops, multi-directional variation vAP, stabilization time, "
        "overshoot, path accuracy AT and repeatability RT, cornering deviations CR "
        "and CO, and drift by wear, with confidence intervals. All input options of "
        "jointplay run are accepted too. docs/decisions.md explains the figures.",
        epilog='Example: jointplay iso9283 ur5 --joint "elbow_joint=0.05 mm" '
        "--duration 2.2 --out ur5",
        lazy=explain,
    )
    group = parser.add_argument_group("cycles")
    add_option(group, "--cycles N", "cycles for poses and distances (default 30)")
    for kind, words in KINDS.items():
        add_option(group, f"--{kind}-cycles N", f"cycles for {words}")
    add_option(
        group,
        "--speed PERCENT",
        "percentage of the motion's speed, which is taken as the rated speed (repeatable; the "
        "standard asks for 100, 50 and 10) (default 100)",
        action="append",
    )
    add_option(group, "--payload MASS", "mass at the tool: the rated load, 100 %%")
    add_option(
        group, "--cube LENGTH", "visit the five poses in a cube with this edge length instead"
    )
    add_option(group, "--cube-centre X,Y,Z", "centre of the cube, world axes [m]")
    add_option(
        group,
        "--drift-time TIME",
        'compute the drift by wear over this time, "8 h" in the standard',
    )
    add_option(group, "--band LENGTH", "limit band of stabilization (default: the repeatability)")
    add_option(
        group,
        "--out DIR",
        "folder for the table, the figures and, during the run, finished cycles: with the same "
        "folder, an interrupted command continues",
    )
    add_shared(group, "--jobs", "--quiet")
    add_inputs(parser)


def run(options: argparse.Namespace) -> int:
    """Run the cycles, print, draw."""
    names = {percent: _names(percent) for percent in dict.fromkeys(options.speed or [100.0])}
    out = Outputs(options.out, [name for several in names.values() for name in several])
    from jointplay.study.courses import check_numbers
    from jointplay.study.iso9283 import check, iso9283

    counts = _cycles(options)
    check_numbers(counts.most, options.jobs)
    for percent in names:
        require_positive("--speed", percent, "%")
    for name, unit in (("band", "m"), ("drift_time", "s")):
        if getattr(options, name) is not None:
            require_positive(f"--{name.replace('_', '-')}", getattr(options, name), unit)
    require_non_negative("--payload", options.payload or 0.0, "kg")
    simulation, poses = _in_cube(options, simulation_of(options))
    load = options.payload or 0.0
    for percent in names:
        check(simulation, percent / 100.0, load)
    folder = out.claim()
    streams.release()
    print(f"tool: {simulation.mechanism.tool!r}")
    for percent, (table, drawn, along) in names.items():
        performance = iso9283(
            simulation,
            counts,
            band=options.band,
            speed=percent / 100.0,
            load=load,
            drift_time=options.drift_time,
            poses=poses,
            jobs=options.jobs,
            keep=None if folder is None else folder / "cycles",
            progress=not options.quiet,
        )
        print(performance)
        if options.out:
            from jointplay.show.plots import design as plots

            contents: dict[str, Any] = {table: performance.table.csv()}
            if performance.poses:
                contents[drawn] = plots.poses(performance)
            if performance.path:
                contents[along] = plots.path(performance)
            out.write(contents, f"; runs in {options.out}/cycles")
    return 0


def _names(percent: float) -> list[str]:
    """Names of the files at a part of the speed."""
    part = "" if percent == 100.0 else f"_{percent:g}"
    return [name.replace(".", f"{part}.") for name in FILES]


def _cycles(options: argparse.Namespace) -> Any:
    """How many cycles are asked for; what is not given is the standard's, or fewer."""
    from jointplay.study.iso9283 import Cycles

    most = Cycles.pose if options.cycles is None else options.cycles
    own = given(options, *(f"{kind}_cycles" for kind in KINDS))
    return replace(
        Cycles.up_to(most), **{name.removesuffix("_cycles"): n for name, n in own.items()}
    )


def _in_cube(options: argparse.Namespace, simulation: Any) -> tuple[Any, str]:
    """The simulation, with the motion of the test if it is asked for; its poses in words."""
    if (options.cube is None) != (options.cube_centre is None):
        raise JointplayError("--cube LENGTH and --cube-centre X,Y,Z go together")
    if options.cube is None:
        return simulation, "poses: the stops of the motion"
    from jointplay.study.iso9283 import cube_motion

    centre = [quantity(part, "m", "--cube-centre") for part in options.cube_centre.split(",")]
    motion = cube_motion(simulation.mechanism, centre, options.cube)
    at = ", ".join(f"{x:g}" for x in centre)
    words = f"poses: P1, P5, P4, P3, P2, P1 in a cube of {options.cube:g} m about ({at}) m"
    return replace(simulation, motion=motion, duration=None), words
