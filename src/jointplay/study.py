"""The paper's study: three cases, Figures 9-15, and its claims tested on ensembles."""

from __future__ import annotations

import csv
import io
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from jointplay import files, stopping, workers
from jointplay.certify import figures
from jointplay.claims import ISOLATED, START_UP, Measures, Verdict, judge, measure
from jointplay.errors import JointplayError
from jointplay.histories import versions
from jointplay.keep import add_certificate, run_and_save
from jointplay.kernel import Status
from jointplay.result import Result
from jointplay.scenario import Scenario
from jointplay.scenario.model import GRAVITY
from jointplay.simulation import PERTURBATION, Simulation
from jointplay.urdf import shipped

JOINT = "joint_b"
FILES = {"ideal": "ideal.nc", "0.2 mm": "case1_0.2mm.nc", "0.5 mm": "case2_0.5mm.nc"}


@cache
def scenario() -> Scenario:
    """The study as a scenario file."""
    return Scenario.load(shipped("scara.toml"))


def _clearance(case: str) -> float | None:
    table = scenario().model(case).joints[JOINT]
    return None if table.ideal else float(table.radial_clearance)


CASES = {case: _clearance(case) for case in scenario().cases}
"""Clearance C_r = C_a of each case [m] (Table 4)."""
VARIANTS = {"consistent": ("scara.urdf", ()), "as printed": ("scara_as_printed.urdf", ("arm1",))}
"""URDF and the links whose inertia no rigid body has, used because they were printed."""

ENSEMBLE_RECORD_EVERY = 50

EXPLICIT, EXPLICIT_STEP_S = "semi-implicit-euler", 1e-5
"""The explicit integration with a fixed step that the cases are run with for comparison."""
BESIDE = ("peak joint force", "RMS joint force", "dissipated energy")
"""Figures of it that are shown."""
DIFFERS = 0.01
"""A figure differs if it does by more than this part, and by more than its error."""

MOST_RUNS = 1000
"""Most perturbed runs for each clearance and condition: days of computing."""


@dataclass(frozen=True)
class Condition:
    """Gravity and inertia variant under which the claims are judged."""

    gravity: str
    variant: str

    def __str__(self) -> str:
        """Name in tables."""
        return f"{self.gravity}, {self.variant}"


CONDITIONS = tuple(Condition(gravity, variant) for gravity in GRAVITY for variant in VARIANTS)


def scara(
    clearance: float | None,
    condition: Condition = CONDITIONS[0],
    record_every: int = 10,
    seed: int | None = None,
) -> Simulation:
    """Set up one run of the paper's SCARA.

    Args:
        clearance: C_r = C_a [m], None for the ideal robot.
        condition: gravity and inertia variant.
        record_every: steps between records.
        seed: perturbs the journal's initial position; see `Simulation`.
    """
    urdf, unphysical = VARIANTS[condition.variant]
    robot = {"urdf": urdf, "gravity": condition.gravity, "allow_unphysical": list(unphysical)}
    changes: dict[str, Any] = {"robot": robot, "output": {"record_every": record_every}}
    if seed is not None:
        changes["integration"] = {"seed": seed}
    if clearance is None:
        return scenario().simulation("ideal", changes)
    # Any case with clearance will do: the clearance is all in which they differ.
    play = {"radial_clearance": clearance, "axial_clearance": clearance}
    return scenario().simulation("0.2 mm", changes | {"joints": {JOINT: play}})


@cache
def _ideal(condition: Condition) -> Result:
    return scara(None, condition, ENSEMBLE_RECORD_EVERY).run()


def perturbed(condition: Condition, label: str, seed: int) -> Measures:
    """Measures of one perturbed run of the case `label`."""
    run = scara(CASES[label], condition, ENSEMBLE_RECORD_EVERY, seed).run()
    if run.status != Status.COMPLETED:
        raise JointplayError(f"{condition}, {label}, seed {seed}: {run.message}")
    return measure(run, _ideal(condition))


def run_case(label: str, out: Path, progress: bool) -> Result:
    """Simulate one of the three cases, save it, and certify it.

    Raises:
        KeyboardInterrupt: after Ctrl-C, when the case has been saved as far as it came.
    """
    if progress:
        tqdm.write(f"case {label}:", file=sys.stderr)
    simulation = scara(CASES[label])
    result = run_and_save(simulation.prepare(progress), out / FILES[label], progress)
    if result.status == Status.INTERRUPTED or stopping.told():
        raise KeyboardInterrupt
    add_certificate(result, out / FILES[label], simulation, progress)
    if stopping.told():
        raise KeyboardInterrupt
    return result


def explicit(label: str) -> dict[str, float]:
    """Figures of the case `label` by the explicit method with the paper's fixed step."""
    simulation = replace(scara(CASES[label]), integrator=EXPLICIT, step=EXPLICIT_STEP_S)
    result = simulation.run()
    if result.status != Status.COMPLETED:
        raise JointplayError(f"{label}, {EXPLICIT}: {result.message}")
    return {name: value for name, (value, _) in figures(result, None).items()}


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
                    beside = f"{other:.4g} {figure.unit} ({100 * change:+.1f} %)"
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
    found = {
        label: {one.name: one for one in certificate.figures if one not in certificate.headline}
        for label, result in cases.items()
        if (certificate := result.certificate) is not None
    }
    played = {label: measures for label, measures in found.items() if measures}
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
    made_with = ", ".join(f"{name} {version}" for name, version in versions().items())
    found = len({label for label, *_ in rows})
    used = [
        "What the claims use, of these runs, by the names in ensemble.csv:",
        "",
        *("| " + " | ".join(row) + " |" for row in (measures[0], ["---"] * len(measures[0]))),
        *("| " + " | ".join(row) + " |" for row in measures[1:]),
        "",
    ]
    if len(measures) == 1:
        used = []
    lines = [
        "# The study's figures with their numerical errors",
        "",
        "Each case was run again more finely (docs/certificates.md); errors above 5 % are marked. "
        f"The last column is the explicit integration with a fixed step ({EXPLICIT}, "
        f"{1e6 * EXPLICIT_STEP_S:g} µs) of the same case: its value where it differs by more than "
        f"{100 * DIFFERS:g} % and the error.",
        "",
        *([f"**Incomplete: {found} of {len(CASES)} cases.**", ""] if found < len(CASES) else []),
        *("| " + " | ".join(row) + " |" for row in (ERRORS_HEADER, ["---"] * len(ERRORS_HEADER))),
        *("| " + " | ".join(row) + " |" for row in rows),
        "",
        *used,
        f"Made with {made_with}.",
        "",
    ]
    files.write(out / "errors.md", "\n".join(lines))


def errors_text(rows: Sequence[tuple[str, ...]]) -> str:
    """The same table for the terminal."""
    table = [ERRORS_HEADER, *rows]
    widths = [max(len(row[k]) for row in table) for k in range(len(ERRORS_HEADER))]
    return "\n".join(
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    )


class Ensembles:
    """The perturbed runs behind the claims, on all cores.

    Args:
        runs: perturbed runs for each clearance and condition.
        table: CSV file to which every run is written as soon as it is done.
        jobs: processes; None takes one for each core.

    Attributes:
        measures: results so far, by condition, case and seed.
    """

    def __init__(self, runs: int, table: Path, jobs: int | None = None) -> None:
        """Plan the runs."""
        self.runs = runs
        self.table = table
        self.jobs = jobs or _cores()
        self.measures: dict[tuple[Condition, str, int], Measures] = {}
        self.unwritten: JointplayError | None = None
        labels = [label for label, clearance in CASES.items() if clearance is not None]
        self.plan = [
            (condition, label, seed)
            for condition in CONDITIONS
            for label in labels
            for seed in range(runs)
        ]

    @contextmanager
    def started(
        self, others: Sequence[str] = ()
    ) -> Iterator[tuple[list[Future[Measures]], dict[str, Future[dict[str, float]]]]]:
        """Run in the background while the block runs; Ctrl-C in the block ends the processes.

        Whatever the block is doing, each run is kept and written to the table when it is done.

        Args:
            others: cases that are also run by the explicit method.

        Yields:
            The perturbed runs, and the explicit ones by case.
        """
        pool = ProcessPoolExecutor(self.jobs, initializer=workers.begin)
        futures = []
        try:
            beside = {label: pool.submit(explicit, label) for label in others}
            for key in self.plan:
                future = pool.submit(perturbed, *key)
                future.add_done_callback(partial(self._keep, key))
                futures.append(future)
            yield futures, beside
        except BaseException:
            workers.abandon(pool)
            raise
        else:
            pool.shutdown()

    def _keep(self, key: tuple[Condition, str, int], future: Future[Measures]) -> None:
        if future.cancelled() or future.exception() is not None:
            return
        condition, label, seed = key
        found = future.result()
        row: dict[str, object] = {"gravity": condition.gravity, "inertia": condition.variant}
        row |= {"clearance": label, "seed": seed, **found}
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, list(row))
        if not self.measures:
            writer.writeheader()
        writer.writerow(row)
        self.measures[key] = found
        try:
            with self.table.open("ab", buffering=0) as file:
                file.write(text.getvalue().encode())  # at once: no kill leaves half a row
        except OSError as error:
            self.unwritten = files.cannot_write(self.table, error)

    def wait(self, futures: Sequence[Future[Any]], progress: bool) -> None:
        """Wait for the runs, those by the explicit method among them.

        Raises:
            JointplayError: a run did not complete, or the table cannot be written.
        """
        bar = tqdm(total=len(futures), desc="further runs", unit="run", disable=not progress)
        with bar:
            try:
                for future in as_completed(futures):
                    future.result()
                    bar.update()
                    if self.unwritten is not None:
                        raise self.unwritten
            except BrokenExecutor:
                raise JointplayError(
                    "a process was ended from outside (too little memory?); the runs so far are "
                    f"in {str(self.table)!r}"
                ) from None

    def verdicts(self) -> list[Verdict]:
        """Claims under each condition for which at least two runs of each case are there."""
        verdicts = []
        for condition in CONDITIONS:
            small, large = (
                [found for (c, name, _), found in sorted(self.measures.items(), key=_seed)
                 if c == condition and name == label]
                for label in ("0.2 mm", "0.5 mm")
            )  # fmt: skip
            if min(len(small), len(large)) >= 2:
                verdicts += judge(small, large, str(condition))
        return sorted(verdicts, key=lambda verdict: verdict.claim)


def _seed(item: tuple[tuple[Condition, str, int], Measures]) -> int:
    return item[0][2]


def _found(
    futures: Mapping[str, Future[dict[str, float]]],
) -> dict[str, dict[str, float]]:
    """What those that are done have found."""
    return {
        label: future.result()
        for label, future in futures.items()
        if future.done() and not future.cancelled() and future.exception() is None
    }


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


HEADER = ("claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm")


def write_claims(verdicts: Sequence[Verdict], ensembles: Ensembles, out: Path) -> None:
    """Write ``claims.csv`` and ``claims.md``."""
    table = io.StringIO(newline="")
    csv.writer(table).writerows([HEADER, *(verdict.row() for verdict in verdicts)])
    files.write(out / "claims.csv", table.getvalue())
    found, planned = len(ensembles.measures), len(ensembles.plan)
    made_with = ", ".join(f"{name} {version}" for name, version in versions().items())
    lines = [
        "# The paper's claims",
        "",
        "Wang et al., Appl. Sci. 2023, 13(4), 2211, Section 5: joint B with "
        "C_r = C_a = 0.2 mm and 0.5 mm.",
        "",
        f"Each row compares {ensembles.runs} runs at either clearance, the journal starting up to "
        f"{100 * PERTURBATION:.0f} % of its clearance off centre; mean ± standard deviation. A "
        "comparison holds (yes) if the 95 % confidence interval of the difference (Welch) lies on "
        "its side of zero, fails (no) if it lies on the other, and is undecided otherwise; claim 4 "
        "holds if every run visits every mode; peaks are isolated if they fill less than "
        f"{100 * ISOLATED:.0f} % of the time. The first "
        f"{START_UP:g} s, in which the journal falls into its bearing, are not judged. *Balanced* "
        "is without gravity, *loaded* with it; *consistent* and *as printed* are the two inertia "
        "variants (docs/assumptions.md). Numerical errors of the numbers, of one run: errors.md.",
        "",
        *([f"**Incomplete: {found} of {planned} runs.**", ""] if found < planned else []),
        "| " + " | ".join(HEADER) + " |",
        "|" + " --- |" * len(HEADER),
        *("| " + " | ".join(cell.replace("|", "\\|") for cell in v.row()) + " |" for v in verdicts),
        "",
        f"Made with {made_with}.",
        "",
    ]
    files.write(out / "claims.md", "\n".join(lines))


def summary(verdicts: Sequence[Verdict]) -> str:
    """Claims against conditions, for the terminal."""
    lines = [
        " " * 16 + "".join(f"{gravity:<24}" for gravity in GRAVITY),
        " " * 16 + "".join(f"{variant:<12}" for _ in GRAVITY for variant in VARIANTS),
    ]
    for number, subject in sorted({(v.claim, v.subject) for v in verdicts}):
        found = {v.condition: v.holds for v in verdicts if v.claim == number}
        cells = "".join(f"{found.get(str(condition), '-'):<12}" for condition in CONDITIONS)
        lines.append(f"{number} {subject:<14}{cells}")
    return "\n".join(line.rstrip() for line in lines)


def output_names() -> list[str]:
    """Every file that the study writes."""
    from jointplay.plots import FIGURES

    drawn = [f"{name}.{kind}" for name in FIGURES for kind in ("png", "pdf")]
    return [*FILES.values(), *drawn, "errors.md", "ensemble.csv", "claims.csv", "claims.md"]


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

    if runs < 0 or runs == 1:
        raise JointplayError(f"the claims need at least 2 runs (0 leaves them out), got {runs}")
    if runs > MOST_RUNS:
        raise JointplayError(f"at most {MOST_RUNS} runs for each clearance, got {runs}")
    if jobs is not None and jobs < 1:
        raise JointplayError(f"at least one process is needed, got {jobs}")
    out = files.claim(out, output_names())
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
