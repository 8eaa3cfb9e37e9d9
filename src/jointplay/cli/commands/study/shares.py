"""`jointplay study shares`: each joint's share of the tool's error in simulated runs.

Dynamic error budget: simulate the play of each joint alone and of all together, and print each
joint's share of the tool's error and the interaction; with --sobol also how much of its variance
comes from clearances, friction, speed and payload. All input options of jointplay run are accepted
too. See docs/shares.md.

Example: jointplay study shares ur5 --joint elbow_joint --joint wrist_1_joint --jobs 2

    [FILE | ROBOT]
  shares:
    --runs N  perturbed runs of each variant (default 3)
    --sobol N  also compute Sobol indices from N (inputs + 2) runs, N a power of two (needs SALib)
    --spread X  factor by which clearances and friction vary, up or down (default 2)
    --slowest X  lowest share of the motion's speed (default 0.7)
    --payload MASS  largest payload at the tool, varied from zero (default 0)
    --out DIR  folder for the table, the figure and the runs, from which an interrupted command
        continues
    --jobs
    --detail
    --quiet
"""

import argparse
from dataclasses import replace
from typing import Any

from jointplay.base import streams
from jointplay.cli.commands import Outputs, print_answer
from jointplay.cli.commands.inputs import simulation_of


def run(options: argparse.Namespace) -> int:
    out = Outputs(options.out, ["shares.csv", "shares.png"])
    from jointplay.study.courses import check_numbers
    from jointplay.study.shares import check, sensitivity, shares

    check_numbers(options.runs, options.jobs)
    check(options.sobol, options.spread, options.slowest, options.payload)
    simulation = simulation_of(options)
    folder = out.claim()
    ensemble: dict[str, Any] = {
        "jobs": options.jobs,
        "keep": None if folder is None else folder / "runs",
        "progress": not options.quiet,
    }
    streams.release()
    budget = shares(simulation, options.runs, **ensemble)
    table = budget.table
    print_answer(budget.sentence, replace(table, notes=()), table.notes, options.detail)
    if options.out:
        from jointplay.show.plots.design import share_bars

        contents = {"shares.csv": budget.runs.csv(), "shares.png": share_bars(budget)}
        out.write(contents, f"; runs in {options.out}/runs")
    if options.sobol is not None:
        print(
            sensitivity(
                simulation,
                options.sobol,
                spread=options.spread,
                slowest=options.slowest,
                payload=options.payload,
                **ensemble,
            )
        )
    return 0
