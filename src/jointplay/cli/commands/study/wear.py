"""`jointplay study wear`: how many cycles it takes a clearance to grow.

Estimate how many cycles of a scenario wear a joint by a given depth (--growth), or how worn its
bore and journal are after so many (--cycles): Archard's law, extrapolated over blocks of equal
cycles; the shape is updated between blocks. The joint needs a clearance and a wear_rate of its
bore, a journal_wear_rate, or both, here or in the scenario: --set
joints.NAME.radial_clearance="0.05 mm" --set joints.NAME.wear_rate="1e-5 mm^3/(N*m)". One run is one
cycle of the motion; BLOCKS x RUNS of them are simulated, one block after the other.
Begin with --blocks 1. docs/wear.md explains the numbers.
"""

import argparse

from jointplay.base import files
from jointplay.base.signals import INTERRUPTED
from jointplay.base.tables import Column, Table
from jointplay.cli.commands import given, inputs, print_answer
from jointplay.cli.commands.inputs import simulation_of
from jointplay.cli.options import LENGTH, Parser


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", required=True)
    add = parser.add_argument
    add("--blocks", metavar="N", type=int, default=10, help="blocks of cycles")
    add("--runs", metavar="N", type=int, default=1, help="runs per block, perturbed at the start "
        "if there are several")
    add("--cycles-per-run", metavar="X", type=float, default=1, help="cycles in one run")
    add("--joint", metavar="NAME[=LENGTH]", nargs=1, required=True, help="the joint whose wear is "
        "estimated, optionally with its radial clearance")
    asked = parser.add_mutually_exclusive_group(required=True)
    asked.add_argument("--growth", **LENGTH, help="growth of its clearance")
    asked.add_argument("--cycles", metavar="N", type=float, help="cycles done")
    add("--out", metavar="CSV", help="file for the cycles and depths after each block")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.study.wear import wear

    if options.out:
        files.check_new(options.out)
    ((joint, clearance),) = inputs.named_joints(options).items()
    options.joint = options.joint if clearance else []  # else the scenario's clearance counts
    simulation, assumed = simulation_of(options)
    life = wear(
        simulation,
        joint,
        options.growth,
        **given(options, "cycles", "blocks", "runs", "cycles_per_run", "jobs"),
        progress=not options.quiet,
    )
    columns = [Column("cycles", life.cycles)]
    names = ("deepest", "mean", *(("bore", "journal") if life.both_wear else ()))
    columns += [Column(name, getattr(life, name), "m", fine=True) for name in names]
    print_answer(f"{life}{assumed}", Table(columns), (), options)
    if options.out:
        files.write(options.out, life.table.csv())
        print(f"profiles in {options.out}")
    return 0 if life.reached else INTERRUPTED
