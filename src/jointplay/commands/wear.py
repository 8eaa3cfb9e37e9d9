"""`jointplay wear`: how many cycles a clearance takes to grow."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.commands import add_trust
from jointplay.errors import JointplayError

INTERRUPTED = 130


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "wear",
        help="estimate the cycles until a clearance has grown",
        description="Estimate how many cycles of a scenario wear the bore of a joint by a given "
        "depth: Archard's law, extrapolated over blocks of equal cycles between which the bore's "
        "shape is brought up to date. The joint needs a wear_rate in the scenario.",
    )
    parser.add_argument("file", metavar="FILE", help="scenario (TOML); one run is one cycle")
    parser.add_argument("--joint", required=True, help="the joint that is to wear")
    parser.add_argument(
        "--growth", required=True, metavar="LENGTH", help='growth of its clearance, "0.1 mm" or [m]'
    )
    parser.add_argument("--case", help="case of the scenario; may be left out if there is one")
    parser.add_argument("--blocks", type=int, default=10, metavar="N", help="default 10")
    parser.add_argument(
        "--runs",
        type=int,
        default=1,
        metavar="N",
        help="runs of each block, perturbed at the start, whose mean is taken (default 1)",
    )
    parser.add_argument(
        "--cycles-per-run", type=float, default=1.0, metavar="N", help="cycles in one run"
    )
    parser.add_argument("--out", metavar="CSV", help="write cycles and depths after each block")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    add_trust(parser)
    parser.set_defaults(handler=run)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def run(options: argparse.Namespace) -> int:
    """Estimate, print, write."""
    from jointplay.analysis.wear import wear_life
    from jointplay.host import files
    from jointplay.scenario import Scenario
    from jointplay.units import convert

    try:
        growth = float(convert(_number(options.growth), "m"))
    except ValueError as error:
        raise JointplayError(f"--growth: {error}") from None
    if options.out:
        files.check_new(options.out)
    life = wear_life(
        Scenario.load(options.file, options.trust).simulation(options.case),
        options.joint,
        growth,
        blocks=options.blocks,
        cycles_per_run=options.cycles_per_run,
        runs=options.runs,
        progress=not options.quiet,
    )
    print("  cycles      deepest [um]  mean [um]")
    for cycles, deepest, mean in zip(life.cycles, life.deepest, life.mean, strict=True):
        print(f"  {cycles:<10.4g}  {1e6 * deepest:<12.4g}  {1e6 * mean:.4g}")
    print(life)
    if options.out:
        life.save(options.out)
        print(f"profiles in {options.out}")
    return 0 if life.reached else INTERRUPTED
