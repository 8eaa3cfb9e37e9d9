"""`jointplay maintenance`: cycles until wear makes the tool miss its tolerance."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.base.signals import INTERRUPTED
from jointplay.cli.commands import Outputs, add_option
from jointplay.cli.commands.inputs import explain, simulation_of
from jointplay.cli.commands.wear import add_cycles, cycles


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "maintenance",
        help="estimate how many cycles it takes until wear puts the tool out of tolerance",
        description="Estimate after how many cycles of a scenario wear of its bores lets the "
        "tool's error exceed a target (static worst case along the motion), and "
        "which joint's wear causes it. Joints need a wear_rate in the scenario. "
        "docs/decisions.md explains the numbers. One run is one cycle.",
        lazy=explain,
    )
    add_cycles(parser, blocks=5, runs=2)
    add_option(parser, "--target LENGTH", "tolerance of the tool", required=True)
    add_option(parser, "--wear-factor X", "factor within which wear rates are known", default=3.0)
    add_option(parser, "--out DIR", "folder for maintenance.csv and the figure")


def run(options: argparse.Namespace) -> int:
    """Estimate, print, draw."""
    out = Outputs(options.out, ["maintenance.csv", "maintenance.png"])
    from jointplay.study.maintenance import maintenance

    simulation = simulation_of(options)
    out.claim()
    estimate = maintenance(
        simulation, options.target, factor=options.wear_factor, **cycles(options)
    )
    print(f"tool: {simulation.mechanism.tool!r}\n{estimate}")
    if options.out:
        from jointplay.show.plots.design import wear_course

        out.write(
            {"maintenance.csv": estimate.table.csv(), "maintenance.png": wear_course(estimate)}
        )
    return 0 if estimate.reached else INTERRUPTED
