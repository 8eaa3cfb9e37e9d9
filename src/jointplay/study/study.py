"""The paper's study as a whole: `jointplay scara`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from jointplay.analysis.certification import further_runs
from jointplay.analysis.claims import Verdict
from jointplay.core import files, signals
from jointplay.core.progress import printing, whole
from jointplay.core.tables import columns, markdown
from jointplay.result.certificate import shown_in
from jointplay.result.result import Result
from jointplay.study.cases import (
    BESIDE,
    CASES,
    DIFFERS,
    EXPLICIT,
    EXPLICIT_STEP_S,
    length,
    run_case,
    scara,
)
from jointplay.study.ensembles import Ensembles, made_with, write_claims
from jointplay.study.outputs import folder


def errors_table(
    cases: Mapping[str, Result], others: Mapping[str, Mapping[str, float]]
) -> list[tuple[str, ...]]:
    """Certified figures of the cases, and the explicit method's where they differ.

    Args:
        cases: results by label.
        others: what `explicit` found, by label.

    Returns:
        Rows of case, figure, value ± error and unit, mark, the explicit method's value or nothing.
    """
    rows: list[tuple[str, ...]] = []
    for label, result in cases.items():
        certificate = result.certificate
        for figure in certificate.headline if certificate else ():
            other = others.get(label, {}).get(figure.name)
            beside = ""
            if other is not None and figure.name in BESIDE:
                change = other / figure.value - 1.0 if figure.value else 0.0
                if abs(other - figure.value) > max(figure.error, DIFFERS * abs(figure.value)):
                    factor, unit = shown_in(figure.unit)
                    beside = f"{factor * other:.4g} {unit} ({100 * change:+.1f} %)"
                else:
                    beside = "the same"
            mark = "above 5 %" if figure.marked else ""
            rows.append((label, figure.name, str(figure), mark, beside))
    return rows


ERRORS_HEADER = (
    "case",
    "figure",
    "value ± numerical error",
    "error",
    f"{EXPLICIT}, {1e6 * EXPLICIT_STEP_S:g} µs",
)


def measures_table(cases: Mapping[str, Result]) -> list[tuple[str, ...]]:
    """What the claims use, a row for each measure and a column for each case that has it."""
    named = {
        label: {one.name: one for one in certificate.figures if one not in certificate.headline}
        for label, result in cases.items()
        if (certificate := result.certificate) is not None
    }
    played = {label: measures for label, measures in named.items() if measures}
    names = dict.fromkeys(name for measures in played.values() for name in measures)
    head = ("measure", *played)
    rows = []
    for name in names:
        figures = [measures[name] for measures in played.values()]
        rows.append((name, *(f"{one}{' (above 5 %)' if one.marked else ''}" for one in figures)))
    return [head, *rows]


def write_errors(
    rows: Sequence[tuple[str, ...]], measures: Sequence[tuple[str, ...]], out: Path
) -> None:
    """Write ``errors.md``."""
    done = len({label for label, *_ in rows})
    used = "What the claims use, of these runs, by the names in ensemble.csv:"
    lines = [
        "# The study's figures with their numerical errors",
        "",
        "Each case was repeated with finer steps (docs/certificates.md); errors above 5 % are "
        f"marked. The last column is the explicit integration with a fixed step ({EXPLICIT}, "
        f"{1e6 * EXPLICIT_STEP_S:g} µs) of the same case: its value where it differs by more than "
        f"{100 * DIFFERS:g} % and the error.",
        "",
        *([f"**Incomplete: {done} of {len(CASES)} cases.**", ""] if done < len(CASES) else []),
        *markdown([ERRORS_HEADER, *rows]),
        "",
        *([used, "", *markdown(measures), ""] if len(measures) > 1 else []),
        made_with(),
        "",
    ]
    files.write(out / "errors.md", "\n".join(lines))


def errors_text(rows: Sequence[tuple[str, ...]]) -> str:
    """The same table for the terminal."""
    return "\n".join(columns([ERRORS_HEADER, *rows]))


def run_study(
    out: str | Path,
    runs: int = 8,
    jobs: int | None = None,
    progress: bool = True,
    done: Callable[[str, Result], None] = lambda label, result: None,
) -> tuple[dict[str, Result], list[tuple[str, ...]], list[Verdict]]:
    """Run the whole study into the folder `out`.

    Args:
        out: folder for ``*.nc``, ``fig09`` ... ``fig15`` (PNG and PDF), ``errors.md``,
            ``claims.md``, ``claims.csv`` and ``ensemble.csv`` (the numbers of every perturbed run).
        runs: perturbed runs for each clearance and condition; 0 leaves the claims out.
        jobs: processes; None takes one for each core.
        progress: show a bar.
        done: is told of each case when it has been run and certified.

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
    cases: dict[str, Result] = {}
    ensembles = Ensembles(runs, out / "ensemble.csv", jobs)
    played = [label for label, clearance in CASES.items() if clearance is not None]

    def run(label: str) -> None:
        cases[label] = run_case(label, out, progress)
        with printing():
            done(label, cases[label])

    of_cases = sum(1 + further_runs(scara(clearance)) for clearance in CASES.values())
    total = (of_cases + len(played)) * length() + ensembles.to_simulate
    try:
        with whole(total, progress):
            run(first)
            with ensembles.started(played) as collecting:
                for label in rest:
                    run(label)
                ensembles.wait(collecting)
    finally:  # whatever happens, what was found is written
        with signals.keeping(f"the tables in {out}"):
            rows = errors_table(cases, ensembles.explicit)
            verdicts = ensembles.verdicts()
            write_errors(rows, measures_table(cases), out)
            if runs:
                write_claims(verdicts, ensembles, out)
    with signals.keeping(f"the figures in {out}"):
        plots.save(cases, out)  # last: whatever happens to figures, the numbers are there
    return cases, rows, verdicts
