"""`jointplay study sweep`: run many cases of a scenario: grids, samples, repeats.

Run all cases of the table [sweep] of a scenario (docs/sweeps.md) on all cores, or on the workers of
a Dask cluster. Whenever a process is killed, --resume continues, and no finished case runs again.

STORE is a folder with cases.sqlite, a row for each case: read it with jointplay.open_sweep, or any
tool for SQLite. Keys of axes count elements of lists from 1: payloads[1].mass is the first
payload's.

    FILE  scenario (TOML) with a table [sweep]
    --out STORE  folder for the results (required)
    --resume  continue the sweep
    --extend  continue the sweep with more samples, repeats, or values at the end of a list
    --jobs
    --scheduler ADDRESS  Dask scheduler whose workers run the cases, such as tcp://10.0.0.1:8786
    --yes  run the sweep even if it is very large
    --rows N  rows of the printed table (default 20)
    --quiet
    --import
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

ALL_FAILED = 1


def run(options: argparse.Namespace) -> int:
    from jointplay.study.database import is_there

    # Before anything is loaded that takes time.
    is_there(Path(options.out), options.resume or options.extend)
    from jointplay.study import open_sweep, plan_of, run_plan
    from jointplay.study.outcome import FAILED
    from jointplay.study.sweep_table import table

    made = plan_of(options.file)
    words = f"{made.scenario.path}: {made.summary}"

    def begin(notes: Sequence[str]) -> None:
        warned = [one for one in notes if one.startswith("warning")]  # others are of single cases
        print("\n".join([words, *warned]), flush=True)

    run_plan(
        made,
        options.out,
        jobs=options.jobs,
        scheduler=options.scheduler,
        resume=options.resume,
        extend=options.extend,
        yes=options.yes,
        progress=not options.quiet,
        begin=None if options.quiet else begin,
    )
    dataset = open_sweep(options.out).dataset()
    print(table(dataset, options.rows))
    print(f"\nresults in {options.out}")
    return ALL_FAILED if bool((dataset["status"] == FAILED).all()) else 0
