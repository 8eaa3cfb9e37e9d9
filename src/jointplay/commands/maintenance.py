"""`jointplay maintenance`: cycles until wear makes the tool miss its tolerance."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.commands.mechanism import quantity
from jointplay.commands.wear import add_cycles
from jointplay.core.signals import INTERRUPTED


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "maintenance",
        help="estimate the cycles until wear makes the tool miss its tolerance",
        description="Estimate after how many cycles of a scenario the worn bores of its joints let "
        "the tool be off by more than a target (static worst case along the motion), and which "
        "joint's wear it is. Joints need a wear_rate in the scenario. docs/decisions.md says what "
        "the numbers mean.",
    )
    add_cycles(parser, blocks=5, runs=2)
    parser.add_argument(
        "--target", required=True, metavar="LENGTH", help='tolerance of the tool, "0.1 mm" or [m]'
    )
    parser.add_argument(
        "--wear-factor",
        type=float,
        default=3.0,
        metavar="X",
        help="factor within which wear rates are known, for the spread (default 3)",
    )
    parser.add_argument("--out", metavar="DIR", help="folder for maintenance.csv and the figure")


def run(options: argparse.Namespace) -> int:
    """Estimate, print, draw."""
    from jointplay.core import files
    from jointplay.scenario import Scenario

    target = quantity(options.target, "m", "--target")
    names = ["maintenance.csv", "maintenance.png"]
    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, names)
    from jointplay.design.maintenance import maintenance

    simulation = Scenario.load(options.file, options.trust).simulation(options.case)
    out = files.claim(options.out, names) if options.out else None
    estimate = maintenance(
        simulation,
        target,
        blocks=options.blocks,
        runs=options.runs,
        jobs=options.jobs,
        cycles_per_run=options.cycles_per_run,
        factor=options.wear_factor,
        progress=not options.quiet,
    )
    print(f"tool: {simulation.mechanism.tool!r}")
    print(estimate)
    if out is not None:
        from jointplay.plots.design import wear_course

        files.write(out / "maintenance.csv", estimate.csv())
        files.picture(out / "maintenance.png", wear_course(estimate))
        print(f"written to {options.out}: {', '.join(names)}")
    return 0 if estimate.reached else INTERRUPTED
