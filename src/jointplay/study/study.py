"""The paper's study as a whole: `jointplay scara`."""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path

from jointplay.analysis.claims import Verdict
from jointplay.host import stopping
from jointplay.result.result import Result
from jointplay.study.asked import folder
from jointplay.study.cases import CASES, run_case
from jointplay.study.ensembles import Ensembles, _found
from jointplay.study.error_tables import errors_table, measures_table, write_errors
from jointplay.study.verdicts import write_claims


def run_study(
    out: str | Path, runs: int = 8, jobs: int | None = None, progress: bool = True
) -> tuple[dict[str, Result], list[tuple[str, ...]], list[Verdict]]:
    """Run the whole study into the folder `out`.

    Args:
        out: folder for ``*.nc``, ``fig09`` ... ``fig15`` (PNG and PDF), ``errors.md``,
            ``claims.md``, ``claims.csv`` and ``ensemble.csv`` (the numbers of every perturbed run).
        runs: perturbed runs for each clearance and condition; 0 leaves the claims out.
        jobs: processes; None takes one for each core.
        progress: show progress bars.

    Returns:
        The cases by label, the rows of `errors_table`, and the verdicts on the claims.

    Raises:
        JointplayError: fewer than 2 runs (but not 0), or a folder that cannot be used.
        KeyboardInterrupt: after Ctrl-C, when all that was computed has been written.
    """
    from jointplay import plots

    out = folder(out, runs, jobs)
    # The first case has the kernels compiled and cached; from then on all cores can work.
    first, *rest = CASES
    cases = {first: run_case(first, out, progress)}
    ensembles = Ensembles(runs, out / "ensemble.csv", jobs)
    beside: dict[str, Future[dict[str, float]]] = {}
    try:
        played = [label for label, clearance in CASES.items() if clearance is not None]
        with ensembles.started(played) as (futures, beside):
            for label in rest:
                cases[label] = run_case(label, out, progress)
            ensembles.wait([*beside.values(), *futures], progress)
    finally:  # whatever happens, what was found is written
        rows = errors_table(cases, _found(beside))
        verdicts = ensembles.verdicts()
        with stopping.keeping(str(out / "errors.md")):
            write_errors(rows, measures_table(cases), out)
        if runs:
            with stopping.keeping(str(out / "claims.md")):
                write_claims(verdicts, ensembles, out)
    plots.save(cases, out)  # last: whatever happens to figures, the numbers are there
    return cases, rows, verdicts
