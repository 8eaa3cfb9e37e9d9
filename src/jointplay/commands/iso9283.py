"""`jointplay iso9283`: accuracy and repeatability by the standard, from perturbed cycles."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from jointplay.commands import run as run_command
from jointplay.commands.playing import quantity
from jointplay.errors import JointplayError

FILES = ("iso9283.csv", "poses.png", "path.png")


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "iso9283",
        usage="jointplay iso9283 [FILE | ROBOT] [--cycles N] [--jobs N] [--out DIR] [options]",
        help="accuracy and repeatability as ISO 9283 names them, from perturbed cycles",
        description="Simulate the cycle of a scenario or robot many times, journals displaced at "
        "random at the start, and print pose accuracy AP and repeatability RP at each stop, "
        "multi-directional variation vAP, stabilization time, overshoot, path accuracy AT and "
        "repeatability RT with confidence intervals. Options besides these are those of jointplay "
        "run. docs/decisions.md says what the figures mean.",
        epilog='Example: jointplay iso9283 ur5 --joint elbow_joint --radial "0.05 mm" '
        "--duration 2.2 --out ur5",
        lazy=run_command.explain,
    )
    group = parser.add_argument_group("cycles")
    group.add_argument("--cycles", type=int, default=30, metavar="N", help="default 30")
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
    groups["integration and output"].add_argument(
        "--quiet", action="store_true", help="show no progress"
    )
    parser.set_defaults(handler=run)


def run(options: argparse.Namespace) -> int:
    """Run the cycles, print, draw."""
    from jointplay.host import files

    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, FILES)
    from jointplay.analysis.iso9283 import check, iso9283

    simulation = simulation_of(options)
    check(simulation, options.cycles)
    band = None if options.band is None else quantity(options.band, "m", "--band")
    out = files.claim(options.out, FILES) if options.out else None
    jobs = options.jobs
    performance = iso9283(
        simulation,
        options.cycles,
        band=band,
        jobs=jobs,
        keep=None if out is None else out / "cycles",
        progress=not options.quiet,
    )
    print(f"tool: {simulation.mechanism.tool!r}")
    print(performance)
    if out is not None:
        from jointplay.plots import iso9283 as plots

        files.write(out / "iso9283.csv", performance.csv())
        names = ["iso9283.csv"]
        if performance.poses:
            plots.poses(performance).savefig(out / "poses.png")
            names.append("poses.png")
        if performance.at is not None:
            plots.path(performance).savefig(out / "path.png")
            names.append("path.png")
        print(f"written to {options.out}: {', '.join(names)}; runs in {options.out}/cycles")
    return 0


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
    scenario.prepare(
        options.case[0] if options.case else None
    )  # says what cannot be, with its line
    if not options.quiet:
        print(
            f"one cycle: {simulation.duration or simulation.motion.duration:g} s simulated"
            if simulation.motion is not None
            else "no motion",
            file=sys.stderr,
        )
    return simulation
