"""`jointplay wear`: how many cycles a clearance takes to grow."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.base import files
from jointplay.base.signals import INTERRUPTED
from jointplay.cli.commands import add_option, add_shared
from jointplay.cli.commands.inputs import add_inputs, explain, simulation_of


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "wear",
        help="estimate how many cycles it takes a clearance to grow",
        description="Estimate how many cycles of a scenario wear the bore of a joint by a given "
        "depth: Archard's law, extrapolated over blocks of equal cycles; the bore's "
        "shape is updated between blocks. The joint needs a wear_rate in the "
        "scenario. One run is one cycle.",
        lazy=explain,
    )
    add_cycles(parser, blocks=10, runs=1)
    add_option(parser, "--joint NAME", "the joint whose wear is estimated", required=True)
    add_option(parser, "--growth LENGTH", "growth of its clearance", required=True)
    add_option(parser, "--out CSV", "file for the cycles and depths after each block")


def add_cycles(parser: Any, blocks: int, runs: int) -> None:
    """Add what commands take that extrapolate wear over blocks of cycles of a scenario."""
    add_inputs(parser, ("robot",), needed=True)
    add_option(parser, "--blocks N", "blocks of cycles", blocks)
    add_option(
        parser, "--runs N", "runs per block, perturbed at the start if there are several", runs
    )
    add_option(parser, "--cycles-per-run X", "cycles in one run", 1.0)
    add_shared(parser, "--jobs", "--quiet")


def cycles(options: argparse.Namespace) -> dict[str, Any]:
    """What the options of `add_cycles` say of the extrapolation."""
    names = ("blocks", "runs", "cycles_per_run", "jobs")
    return {name: getattr(options, name) for name in names} | {"progress": not options.quiet}


def run(options: argparse.Namespace) -> int:
    """Estimate, print, write."""
    from jointplay.study.wear import wear

    if options.out:
        files.check_new(options.out)
    simulation = simulation_of(options)
    life = wear(simulation, options.joint, options.growth, **cycles(options))
    print("  cycles      deepest [um]  mean [um]")
    for number, deepest, mean in zip(life.cycles, life.deepest, life.mean, strict=True):
        print(f"  {number:<10.4g}  {1e6 * deepest:<12.4g}  {1e6 * mean:.4g}")
    print(life)
    if options.out:
        files.write(options.out, life.table.csv())
        print(f"profiles in {options.out}")
    return 0 if life.reached else INTERRUPTED
