"""`jointplay study uncertainty`: quantiles, Sobol indices and convergence of a sweep's samples.

Evaluate a measure over the samples of a sweep: mean, standard deviation and quantiles with 95 %
confidence intervals, how many runs were enough, and, for a saltelli design, what causes the
variance (Sobol indices).

    STORE  folder of jointplay study sweep
    MEASURE  measure, such as tool_error_rms_total
    --precision X  relative half width of the confidence interval that is precise enough (default
        0.05)
    --out FILE  picture of the convergence
"""

import argparse
from pathlib import Path


def run(options: argparse.Namespace) -> int:
    from jointplay.base import files

    out = files.check_picture(options.out) if options.out else None
    from jointplay.show.plots.sweep import draw_convergence  # what comes now takes long to import
    from jointplay.study import open_sweep
    from jointplay.study.sweep_table import uncertainty

    dataset = open_sweep(Path(options.store)).dataset()
    print(uncertainty(dataset, options.measure, options.precision))
    if out is not None:
        files.picture(out, draw_convergence(dataset, options.measure, options.precision))
        print(out)
    return 0
