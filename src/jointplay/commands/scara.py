"""`jointplay scara`: the paper's study."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

from jointplay.commands import add_option, add_shared
from jointplay.core import signals


def add(commands: Any) -> None:
    """Add the command's parser."""
    scara = commands.add_parser(
        "scara",
        help="run the study of the SCARA arm: three cases, figures, claims",
        description="Simulate the SCARA assembly robot of Wang et al. (2023) ideal, with 0.2 mm "
        "and with 0.5 mm of radial and axial clearance in joint B; give the headline figures with "
        "their numerical errors, and beside them those of explicit integration with a fixed step; "
        "draw Figures 9-15; test the paper's six claims on perturbed runs, with and without "
        "gravity, for both inertia variants.",
        epilog="DIR receives ideal.nc, case1_0.2mm.nc, case2_0.5mm.nc; fig09 ... fig15 as .png and "
        ".pdf; errors.md with the figures and their errors; claims.md and claims.csv; ensemble.csv "
        "with the numbers of each perturbed run.",
    )
    add_option(scara, "--out DIR", "folder for the results", required=True)
    add_option(
        scara, "--runs N", "perturbed runs for each clearance and condition; 0 skips the claims", 8
    )
    add_shared(scara, "--jobs", "--quiet")


def run(options: argparse.Namespace) -> int:
    """Run the study and print its tables."""
    from jointplay.study.outputs import folder

    folder(options.out, options.runs, options.jobs)  # before anything is loaded that takes time
    from jointplay import study

    started = time.perf_counter()
    progress = not options.quiet
    _, rows, verdicts = study.run_study(
        options.out,
        options.runs,
        options.jobs,
        progress,
        lambda label, result: print(f"\n{label}: {result.message}\n{result.audit}"),
    )
    print("\nFigures with their numerical errors, compared with the explicit method:\n")
    print(study.errors_text(rows))
    if verdicts:
        print(f"\nThe paper's claims on {options.runs} runs each; numbers in claims.md:\n")
        print(study.summary(verdicts))
    print(f"\nresults in {options.out}, {time.perf_counter() - started:.0f} s")
    if signals.stop_requested():
        print(signals.SAVED, file=sys.stderr)
    return 0
