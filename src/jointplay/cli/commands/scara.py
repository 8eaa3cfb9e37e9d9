"""`jointplay scara`: run the study of the SCARA arm: three cases, figures, claims.

Simulate the SCARA assembly robot of Wang et al. (2023) ideal, with 0.2 mm and with 0.5 mm of radial
and axial clearance in joint B; give the headline figures with their numerical errors, and beside
them those of explicit integration with a fixed step; draw Figures 9-15; test the paper's six claims
on perturbed runs, with and without gravity, for both inertia variants.

DIR receives ideal.nc, case1_0.2mm.nc, case2_0.5mm.nc; fig09 ... fig15 as .png; errors.md with
the figures and their errors; claims.md and claims.csv; ensemble.csv with the numbers of each
perturbed run; paper.md, which shows all of it on one page.
"""

import argparse
import sys
import time

from jointplay.base import signals
from jointplay.cli.options import Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("--out", metavar="DIR", required=True, help="folder for the results")
    add("--gravity", choices=("balanced", "loaded"), default="balanced", help="gravity in the "
        "three cases: balanced (none, as the orbits of Figure 12 need) or loaded")
    add("--inertia", choices=("consistent", "as-printed"), default="consistent", help="inertias in "
        "the three cases: consistent, or as-printed, which no rigid body can have")
    add("--integrator", choices=("multi-rate", "semi-implicit-euler", "rk4"), default="multi-rate",
        help="method of all runs; semi-implicit-euler: explicit, with the paper's step of 10 us")
    add("--runs", metavar="N", type=int, default=8, help="perturbed runs for each clearance and "
        "condition; 0 skips the claims")
    parser.share("--pdf", "--jobs", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.paper.outputs import PAGE, folder

    # Before anything is loaded that takes time.
    folder(options.out, options.runs, options.jobs, options.pdf)
    from jointplay import paper

    started = time.perf_counter()
    progress = not options.quiet
    study = paper.run_study(
        options.out,
        options.runs,
        options.jobs,
        progress,
        lambda label, result: print(f"\n{label}: {result.message}\n{result.audit}"),
        condition=paper.Condition(options.gravity, options.inertia.replace("-", " ")),
        integrator=options.integrator,
        pdf=options.pdf,
    )
    print("\nFigures with their numerical errors, and by other methods:\n")
    print(paper.errors_text(study.rows, study.warnings))
    if study.verdicts:
        print(f"\nThe paper's claims on {options.runs} runs each; numbers in claims.md:\n")
        print(paper.summary(study.verdicts))
    print(f"\nresults in {options.out}, {time.perf_counter() - started:.0f} s")
    print(f"look at {options.out}/fig12.png, and read {options.out}/{PAGE}: all of it on one page")
    if signals.stop_requested():
        print(signals.SAVED, file=sys.stderr)
    return 0
