"""`jointplay study uncertainty`: quantiles, Sobol indices and convergence of a sweep's samples.

Evaluate a measure over the samples of a sweep: mean, standard deviation and quantiles with 95 %
confidence intervals, how many runs were enough, and, for a saltelli design, what causes the
variance (Sobol indices).
"""

import argparse
from pathlib import Path

from jointplay.cli.options import Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("store", metavar="STORE", help="folder of jointplay study sweep")
    add("measure", metavar="MEASURE", help="measure, such as tool_error_rms_total")
    add("--precision", metavar="X", type=float, default=0.05, help="relative half width of the "
        "confidence interval that is precise enough")
    add("--out", metavar="FILE", help="picture of the convergence")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.base import files

    out = files.check_picture(options.out) if options.out else None
    from jointplay.show.plots.draw import draw  # what comes now takes long to import
    from jointplay.show.plots.sweep import convergence_chart
    from jointplay.study import open_sweep
    from jointplay.study.sweep_table import uncertainty

    dataset = open_sweep(Path(options.store)).dataset()
    print(uncertainty(dataset, options.measure, options.precision))
    if out is not None:
        files.picture(out, draw(convergence_chart(dataset, options.measure, options.precision)))
        print(out)
    return 0
