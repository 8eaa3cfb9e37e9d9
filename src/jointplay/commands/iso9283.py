"""`jointplay iso9283`: accuracy and repeatability by the standard, from perturbed cycles."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from jointplay.commands import add_quiet
from jointplay.commands import run as run_command
from jointplay.commands.mechanism import quantity
from jointplay.core import streams
from jointplay.core.errors import JointplayError, require_positive

FILES = ("iso9283.csv", "poses.png", "path.png")
"""What is written into --out; at a part of the speed, its per cent stand before the dot."""
KINDS = {
    "pose": "poses and distances (default 30)",
    "path": "the path (default 10, at most --cycles)",
    "settling": "stabilization and overshoot (default 3)",
    "cornering": "corners (default 3)",
}
"""Kinds of figures that have their own number of cycles."""


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "iso9283",
        usage="jointplay iso9283 [FILE | ROBOT] [--cycles N] [--speed PERCENT] [--load MASS] "
        "[--cube EDGE --cube-centre X,Y,Z] [--drift TIME] [--out DIR] [options]",
        help="accuracy and repeatability as ISO 9283 names them, from perturbed cycles",
        description="Simulate the cycle of a scenario or robot many times, journals displaced at "
        "random at the start, and print pose accuracy AP and repeatability RP at each stop, "
        "distance accuracy AD and repeatability RD between stops, multi-directional variation vAP, "
        "stabilization time, overshoot, path accuracy AT and repeatability RT, cornering "
        "deviations CR and CO, and drift by wear, with confidence intervals. Options besides these "
        "are those of jointplay run. docs/decisions.md says what the figures mean.",
        epilog='Example: jointplay iso9283 ur5 --joint elbow_joint --radial "0.05 mm" '
        "--duration 2.2 --out ur5",
        lazy=run_command.explain,
    )
    group = parser.add_argument_group("cycles")
    for kind, words in KINDS.items():
        name = "--cycles" if kind == "pose" else f"--{kind}-cycles"
        group.add_argument(name, type=int, metavar="N", help=f"cycles for {words}")
    group.add_argument(
        "--speed",
        type=float,
        action="append",
        metavar="PERCENT",
        help="part of the motion's speed, taken for the rated one; can be repeated: the standard "
        "asks for 100, 50 and 10 (default 100)",
    )
    group.add_argument("--load", metavar="MASS", help="mass at the tool: the rated load, 100 %%")
    group.add_argument(
        "--cube", metavar="EDGE", help="go through the five poses in a cube of this edge instead"
    )
    group.add_argument("--cube-centre", metavar="X,Y,Z", help="centre of the cube, world axes [m]")
    group.add_argument(
        "--drift", metavar="TIME", help='drift by wear over this time (the standard: "8 h")'
    )
    group.add_argument(
        "--band", metavar="LENGTH", help="limit band of stabilization (default: the repeatability)"
    )
    group.add_argument(
        "--out",
        metavar="DIR",
        help="folder for the table, the figures and, while "
        "it runs, the cycles: given again, it goes on where it was interrupted",
    )
    groups = run_command.add_inputs(parser)
    add_quiet(groups["integration and output"])


def run(options: argparse.Namespace) -> int:
    """Run the cycles, print, draw."""
    from jointplay.core import files

    names = {percent: _names(percent) for percent in dict.fromkeys(options.speed or [100.0])}
    every = [name for some in names.values() for name in some]
    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, every)
    from jointplay.analysis.runs import check_numbers
    from jointplay.design.iso9283 import check, iso9283

    counts = _cycles(options)
    check_numbers(counts.most, options.jobs)
    for percent in names:
        require_positive("--speed", percent, "%")
    simulation, poses = _in_cube(options, simulation_of(options))
    band, load, drift = (
        None if text is None else require_positive(name, quantity(text, unit, name), unit)
        for name, text, unit in (
            ("--band", options.band, "m"),
            ("--load", options.load, "kg"),
            ("--drift", options.drift, "s"),
        )
    )
    for percent in names:
        check(simulation, percent / 100.0, load or 0.0)
    out = files.claim(options.out, every) if options.out else None
    streams.release()
    tool = f"tool: {simulation.mechanism.tool!r}\n"
    for percent, (table, drawn, along) in names.items():
        performance = iso9283(
            simulation,
            counts,
            band=band,
            speed=percent / 100.0,
            load=load or 0.0,
            drift_time=drift,
            poses=poses,
            jobs=options.jobs,
            keep=None if out is None else out / "cycles",
            progress=not options.quiet,
        )
        print(f"{tool}{performance}")
        tool = ""
        if out is not None:
            from jointplay.plots import design as plots

            files.write(out / table, performance.csv())
            written = [table]
            if performance.poses:
                files.picture(out / drawn, plots.poses(performance))
                written.append(drawn)
            if performance.path:
                files.picture(out / along, plots.path(performance))
                written.append(along)
            print(f"written to {options.out}: {', '.join(written)}; runs in {options.out}/cycles")
    return 0


def _names(percent: float) -> list[str]:
    part = "" if percent == 100.0 else f"_{percent:g}"
    return [name.replace(".", f"{part}.") for name in FILES]


def _cycles(options: argparse.Namespace) -> Any:
    """How many cycles are asked for; what is not given is the standard's, or fewer."""
    from jointplay.design.iso9283 import Cycles

    most = Cycles.pose if options.cycles is None else options.cycles
    others = {kind: getattr(options, f"{kind}_cycles") for kind in KINDS if kind != "pose"}
    given = {kind: number for kind, number in others.items() if number is not None}
    return replace(Cycles.up_to(most), **given)


def _in_cube(options: argparse.Namespace, simulation: Any) -> tuple[Any, str]:
    """The simulation, with the motion of the test if it is asked for; its poses in words."""
    if (options.cube is None) != (options.cube_centre is None):
        raise JointplayError("--cube EDGE and --cube-centre X,Y,Z go together")
    if options.cube is None:
        return simulation, "poses: the stops of the motion"
    from jointplay.design.iso9283 import cube_motion

    edge = quantity(options.cube, "m", "--cube")
    centre = [quantity(part, "m", "--cube-centre") for part in options.cube_centre.split(",")]
    motion = cube_motion(simulation.mechanism, centre, edge)
    at = ", ".join(f"{x:g}" for x in centre)
    words = f"poses: P1, P5, P4, P3, P2, P1 in a cube of {edge:g} m about ({at}) m"
    return replace(simulation, motion=motion, duration=None), words


def simulation_of(options: argparse.Namespace) -> Any:
    """The one simulation that the options of `jointplay run` describe.

    Raises:
        JointplayError: several cases, or what `jointplay run` would refuse.
    """
    jobs, options.jobs = options.jobs, None  # a scenario's option there, ours here
    scenario = run_command.scenario_of(options)
    options.jobs = jobs
    if len(options.case) > 1:
        raise JointplayError(f"one case at a time, got --case {', '.join(options.case)}")
    if not options.case and len(scenario.cases) > 1:
        raise JointplayError(f"choose a case with --case: {', '.join(scenario.cases)}")
    simulation = scenario.simulation(options.case[0] if options.case else None)
    scenario.ready_run(
        options.case[0] if options.case else None
    )  # says what cannot be, with its line
    streams.note(
        f"one cycle: {simulation.duration or simulation.motion.duration:g} s simulated"
        if simulation.motion is not None
        else "no motion"
    )
    return simulation
