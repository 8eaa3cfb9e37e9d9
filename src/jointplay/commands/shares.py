"""`jointplay shares`: which joint brings about the tool's error in runs, and on what it depends."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.commands import add_quiet
from jointplay.commands import run as run_command
from jointplay.commands.iso9283 import simulation_of
from jointplay.commands.mechanism import quantity


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "shares",
        usage="jointplay shares [FILE | ROBOT] [--runs N] [--sobol N] [--jobs N] [options]",
        help="each joint's share of the tool's error in runs, and Sobol indices",
        description="Dynamic error budget: simulate the play of each joint alone and of all "
        "together, and print each joint's share of the tool's error and the interaction; with "
        "--sobol also how much of its variance comes from clearances, friction, speed and payload. "
        "Options besides these are those of jointplay run. See docs/decisions.md.",
        epilog="Example: jointplay shares ur5 --joint elbow_joint --joint wrist_1_joint --jobs 2",
        lazy=run_command.explain,
    )
    group = parser.add_argument_group("shares")
    group.add_argument(
        "--runs", type=int, default=3, metavar="N", help="perturbed runs of each (default 3)"
    )
    group.add_argument(
        "--sobol",
        type=int,
        metavar="N",
        help="also Sobol indices from N (inputs + 2) runs, N a power of two (needs SALib)",
    )
    group.add_argument(
        "--spread",
        type=float,
        default=2.0,
        metavar="X",
        help="clearances and friction vary by this factor both ways (default 2)",
    )
    group.add_argument(
        "--slowest",
        type=float,
        default=0.7,
        metavar="X",
        help="speed varies from this part of the motion's to the whole (default 0.7)",
    )
    group.add_argument("--payload", metavar="MASS", help='varies from none to "5 kg" at the tool')
    group.add_argument(
        "--out", metavar="DIR", help="folder for the table, the figure and, to go on, the runs"
    )
    groups = run_command.add_inputs(parser)
    add_quiet(groups["integration and output"])


def run(options: argparse.Namespace) -> int:
    """Run, print, draw."""
    from jointplay.core import files, streams

    names = ["shares.csv", "shares.png"]
    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, names)
    from jointplay.analysis.runs import check_numbers
    from jointplay.design.shares import check, sensitivity, shares

    payload = 0.0 if options.payload is None else quantity(options.payload, "kg", "--payload")
    check_numbers(options.runs, options.jobs)
    check(options.sobol, options.spread, options.slowest, payload)
    simulation = simulation_of(options)
    out = files.claim(options.out, names) if options.out else None
    kept = None if out is None else out / "runs"
    some: dict[str, Any] = {
        "jobs": options.jobs,
        "keep": kept,
        "progress": not options.quiet,
    }
    streams.release()
    budget = shares(simulation, options.runs, **some)
    print(f"tool: {simulation.mechanism.tool!r}")
    print(budget)
    if out is not None:
        from jointplay.plots.design import share_bars

        files.write(out / "shares.csv", budget.csv())
        files.picture(out / "shares.png", share_bars(budget))
        print(f"written to {options.out}: {', '.join(names)}; runs in {options.out}/runs")
    if options.sobol is not None:
        print(
            sensitivity(
                simulation,
                options.sobol,
                spread=options.spread,
                slowest=options.slowest,
                payload=payload,
                **some,
            )
        )
    return 0
