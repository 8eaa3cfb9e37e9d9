"""The paper's study as a whole, run by `jointplay scara`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointplay.base import files, signals
from jointplay.base.progress import overall, printing
from jointplay.base.tables import Table
from jointplay.base.units import rounded
from jointplay.paper.cases import (
    CASES,
    CONDITIONS,
    EARLY,
    EARLY_S,
    Condition,
    MethodFigures,
    early_peak,
    length,
    run_case,
    scara,
)
from jointplay.paper.ensembles import Ensembles, filled, write_claims
from jointplay.paper.outputs import folder
from jointplay.paper.page import Rows, write_page
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation.analysis.claims import Verdict
from jointplay.simulation.result.certificate import CertifiedFigure
from jointplay.simulation.result.result import Result
from jointplay.study.certification import number_of_runs


def errors_table(
    cases: Mapping[str, Result], others: Mapping[tuple[str, str], MethodFigures]
) -> list[tuple[str, ...]]:
    """Certified figures of the cases beside those by other methods.

    Args:
        cases: results by label.
        others: figures by `by_method`, by label and method.

    Returns:
        The head; then rows of case, figure, value ± error with unit, mark, and for each other
        method its value and the difference, or that it was not computed.
    """
    methods = list(dict.fromkeys(method for _, method in others))
    rows: Rows = [("case", "figure", "value ± numerical error", "error", *methods)]
    for label, result in cases.items():
        headline = result.certificate.headline if result.certificate else ()
        unknown = CertifiedFigure(EARLY, early_peak(result), math.inf, "N")
        for figure in (unknown, *headline):
            beside = [_beside(figure, others.get((label, method))) for method in methods]
            mark = "above 5 %" if figure.marked and figure is not unknown else ""
            shown = str(figure) if figure is not unknown else f"{figure.value:.5g} N"
            rows.append((label, figure.name, shown, mark, *beside))
    return rows


def _beside(figure: CertifiedFigure, method: MethodFigures | None) -> str:
    """A figure by another method, and its difference from the certified value."""
    if method is None or figure.name not in method.figures:
        return "not computed"
    value = method.figures[figure.name]
    text = rounded(value, figure.unit, 5)
    if figure.value == 0.0:
        return text
    held = ", within the error" if abs(value - figure.value) <= figure.error < math.inf else ""
    return f"{text} ({100.0 * (value / figure.value - 1.0):+.1f} %{held})"


def measures_table(cases: Mapping[str, Result]) -> list[tuple[str, ...]]:
    """Measures of the claims: a row for each measure, a column for each case that has any."""
    named = {
        label: {fig.name: fig for fig in certificate.figures if fig not in certificate.headline}
        for label, result in cases.items()
        if (certificate := result.certificate) is not None
    }
    played = {label: measures for label, measures in named.items() if measures}
    rows: Rows = [("measure", *played)]
    for name in dict.fromkeys(name for measures in played.values() for name in measures):
        figures = [measures[name] for measures in played.values()]
        rows.append((name, *(f"{fig}{' (above 5 %)' if fig.marked else ''}" for fig in figures)))
    return rows


def write_errors(findings: Findings, setting: str, out: Path) -> None:
    """Write ``errors.md``."""
    text = filled(
        "errors.md",
        setting=setting,
        early=f"{EARLY_S:g}",
        rows=findings.rows,
        warnings=findings.warnings,
        measures=measures_table(findings.cases),
        done=len(findings.cases),
        planned=len(CASES),
    )
    files.write(out / "errors.md", text)


def errors_text(rows: Sequence[tuple[str, ...]], warnings: Sequence[str] = ()) -> str:
    """The table of `errors_table` for the terminal, and warnings."""
    return "\n".join([str(Table.of_texts(rows)), *(f"warning of {line}" for line in warnings)])


@dataclass(frozen=True)
class Findings:
    """The results of `run_study`."""

    cases: dict[str, Result]
    """Results of the cases, by label."""
    rows: Rows
    """The table `errors_table`."""
    warnings: list[str]
    """Warnings of other methods' runs, a line each."""
    verdicts: list[Verdict]
    """Verdicts on the paper's claims."""


def run_study(
    out: str | Path,
    runs: int = 8,
    jobs: int | None = None,
    progress: bool = True,
    done: Callable[[str, Result], None] = lambda label, result: None,
    *,
    condition: Condition = CONDITIONS[0],
    integrator: str = DEFAULT,
    pdf: bool = False,
) -> Findings:
    """Run the whole study into the folder `out`.

    Args:
        out: folder for ``*.nc``, ``fig09`` ... ``fig15`` (PNG), ``errors.md``,
            ``claims.md``, ``claims.csv``, ``ensemble.csv`` (the numbers of every perturbed run),
            and ``paper.md``, which shows all of it beside what the paper says.
        runs: perturbed runs for each clearance and condition; 0 leaves the claims out.
        jobs: processes; None takes one for each core.
        progress: show a bar.
        done: called with label and result of each case when it has been run and certified.
        condition: gravity and inertia of the three cases; claims are judged under all conditions.
        integrator: method of the cases and of all runs behind the claims.
        pdf: also draw each figure as PDF.

    Raises:
        JointplayError: 1 run or a negative number, no such integrator, or a folder that cannot be
            used.
        KeyboardInterrupt: Ctrl-C; all that was computed has been written.
    """
    from jointplay.show import plots

    out = folder(out, runs, jobs, pdf)
    cases: dict[str, Result] = {}
    ensembles = Ensembles(runs, jobs, condition, integrator)
    setting = f"{str(condition)[:1].upper()}{str(condition)[1:]}, {integrator}"

    of_cases = sum(1 + number_of_runs(scara(clearance)) for clearance in CASES.values())
    try:
        with (
            overall(of_cases * length() + ensembles.to_simulate, progress),
            ensembles.started() as collecting,
        ):
            for label in CASES:
                cases[label] = run_case(label, out, progress, condition, integrator)
                with printing():
                    done(label, cases[label])
            ensembles.wait(collecting)
    finally:  # whatever happens, the results so far are written
        with signals.keeping(f"the tables in {out}"):
            others = ensembles.others
            warnings = [
                f"{label}, {method}: {warning}"
                for (label, method), method_figures in others.items()
                for warning in method_figures.warnings
            ]
            findings = Findings(cases, errors_table(cases, others), warnings, ensembles.verdicts())
            write_errors(findings, setting, out)
            if runs:
                write_claims(findings.verdicts, ensembles, out)
    with signals.keeping(f"the figures in {out}"):
        plots.save(cases, out, pdf)  # last, so that no failure of a figure loses numbers
        write_page(findings, setting, out)
    return findings
