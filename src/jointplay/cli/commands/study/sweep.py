"""`jointplay study sweep`: run many cases of a scenario: grids, samples, repeats.

Run all cases of the table [sweep] of a scenario (docs/sweeps.md) on all cores, or on the workers of
a Dask cluster. Whenever a process is killed, --resume continues, and no finished case runs again.

STORE is a folder with cases.sqlite, a row for each case: read it with jointplay.open_sweep, or any
tool for SQLite. Keys of axes count elements of lists from 1: payloads[1].mass is the first
payload's.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from jointplay.cli.commands import given
from jointplay.cli.options import FLAG, STOPPED, Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("file", metavar="FILE", help="scenario (TOML) with a table [sweep]")
    add("--out", metavar="STORE", required=True, help="folder for the results")
    add("--resume", **FLAG, help="continue the sweep")
    add("--extend", **FLAG, help="continue the sweep with more samples, repeats, or values at the "
        "end of a list")
    add("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers run the cases, such "
        "as tcp://10.0.0.1:8786")
    add("--yes", **FLAG, help="run the sweep even if it is very large")
    add("--rows", metavar="N", type=int, default=20, help="rows of the printed table")
    parser.share("--jobs", "--quiet", "--import")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.study.database import is_there

    # Before anything is loaded that takes time.
    is_there(Path(options.out), options.resume or options.extend)
    from jointplay.study import open_sweep, plan_of, run_plan
    from jointplay.study.store import FAILED
    from jointplay.study.sweep_table import table

    plan = plan_of(options.file)
    heading = f"{plan.scenario.path}: {plan.summary}"

    def begin(notes: Sequence[str]) -> None:
        warnings = (note for note in notes if note.startswith("warning"))  # others: single cases
        print(heading, *warnings, sep="\n", flush=True)

    run_plan(
        plan,
        options.out,
        **given(options, "jobs", "scheduler", "resume", "extend", "yes"),
        progress=not options.quiet,
        begin=None if options.quiet else begin,
    )
    dataset = open_sweep(options.out).dataset()
    print(table(dataset, options.rows))
    print(f"\nresults in {options.out}")
    return STOPPED if bool((dataset["status"] == FAILED).all()) else 0
