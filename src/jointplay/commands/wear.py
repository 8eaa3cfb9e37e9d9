"""`jointplay wear`: how many cycles a clearance takes to grow."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.commands import add_case, add_jobs, add_quiet, add_trust
from jointplay.commands.mechanism import quantity
from jointplay.core.signals import INTERRUPTED


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "wear",
        help="estimate the cycles until a clearance has grown",
        description="Estimate how many cycles of a scenario wear the bore of a joint by a given "
        "depth: Archard's law, extrapolated over blocks of equal cycles between which the bore's "
        "shape is brought up to date. The joint needs a wear_rate in the scenario.",
    )
    add_cycles(parser, blocks=10, runs=1)
    parser.add_argument("--joint", required=True, help="the joint that is to wear")
    parser.add_argument(
        "--growth", required=True, metavar="LENGTH", help='growth of its clearance, "0.1 mm" or [m]'
    )
    parser.add_argument("--out", metavar="CSV", help="write cycles and depths after each block")


def add_cycles(parser: Any, blocks: int, runs: int) -> None:
    """Add what commands take that extrapolate wear over blocks of cycles of a scenario."""
    parser.add_argument("file", metavar="FILE", help="scenario (TOML); one run is one cycle")
    add_case(parser)
    parser.add_argument("--blocks", type=int, default=blocks, metavar="N", help=f"default {blocks}")
    parser.add_argument(
        "--runs",
        type=int,
        default=runs,
        metavar="N",
        help=f"runs of each block, perturbed at the start if there are several (default {runs})",
    )
    parser.add_argument(
        "--cycles-per-run", type=float, default=1.0, metavar="N", help="cycles in one run"
    )
    add_jobs(parser)
    add_quiet(parser)
    add_trust(parser)


def run(options: argparse.Namespace) -> int:
    """Estimate, print, write."""
    from jointplay.core import files
    from jointplay.design.wear import wear
    from jointplay.scenario import Scenario

    growth = quantity(options.growth, "m", "--growth")
    if options.out:
        files.check_new(options.out)
    life = wear(
        Scenario.load(options.file, options.trust).simulation(options.case),
        options.joint,
        growth,
        blocks=options.blocks,
        cycles_per_run=options.cycles_per_run,
        runs=options.runs,
        jobs=options.jobs,
        progress=not options.quiet,
    )
    print("  cycles      deepest [um]  mean [um]")
    for cycles, deepest, mean in zip(life.cycles, life.deepest, life.mean, strict=True):
        print(f"  {cycles:<10.4g}  {1e6 * deepest:<12.4g}  {1e6 * mean:.4g}")
    print(life)
    if options.out:
        files.write(options.out, life.csv())
        print(f"profiles in {options.out}")
    return 0 if life.reached else INTERRUPTED
