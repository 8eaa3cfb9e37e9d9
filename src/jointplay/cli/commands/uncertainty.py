"""`jointplay uncertainty STORE`: what samples of distributions say of a measure, and how surely."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from jointplay.cli.commands import add_option


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "uncertainty",
        help="quantiles, Sobol indices and convergence of a sweep's samples",
        description="Evaluate a measure over the samples of a sweep: mean, standard deviation "
        "and quantiles with 95 % confidence intervals, how many runs were enough, "
        "and, for a saltelli design, what causes the variance (Sobol indices).",
    )
    parser.add_argument("store", metavar="STORE", help="store of jointplay sweep")
    parser.add_argument(
        "measure", metavar="MEASURE", help=("measure, such as tool_error_rms_total")
    )
    add_option(
        parser,
        "--precision X",
        "relative half width of the confidence interval that is precise enough",
        0.05,
    )
    add_option(parser, "--out FILE", "picture of the convergence")


def run(options: argparse.Namespace) -> int:
    """Print the statements; draw how they converged."""
    from jointplay.base import files

    out = files.check_picture(options.out) if options.out else None
    from jointplay.show.plots.sweep import draw_convergence  # what comes now takes long to import
    from jointplay.study import open_sweep
    from jointplay.study.store import reading
    from jointplay.study.table import uncertainty

    dataset = open_sweep(Path(options.store))
    with reading(options.store):
        print(uncertainty(dataset, options.measure, options.precision))
    if out is not None:
        files.picture(out, draw_convergence(dataset, options.measure, options.precision))
        print(out)
    return 0
