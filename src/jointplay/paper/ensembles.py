"""Ensembles of perturbed runs, kept on disk, and what they say of the paper's claims."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager
from functools import partial
from operator import call
from pathlib import Path
from typing import Any

from jointplay.analysis.claims import ISOLATED, Measures, Verdict, judge
from jointplay.core import files
from jointplay.core.processes import Pool, number_of
from jointplay.core.progress import current
from jointplay.core.tables import Table
from jointplay.kernel.integrators import DEFAULT
from jointplay.mechanism.urdf import GRAVITY
from jointplay.paper.cases import (
    CASES,
    CONDITIONS,
    METHODS,
    VARIANTS,
    Condition,
    Found,
    by_method,
    length,
    perturbed,
)
from jointplay.result.settings import START_UP
from jointplay.result.stored import versions
from jointplay.simulation.initial import PERTURBATION
from jointplay.study.study import Study, Workers

_LOOK_S = 0.2
"""Interval at which progress is looked at."""


class Ensembles:
    """The perturbed runs behind the claims, on all cores.

    Args:
        runs: perturbed runs for each clearance and condition.
        table: CSV file to which every run is written as soon as it is done.
        jobs: processes; None takes one for each core.
        condition: under which the cases are also run by other methods.
        integrator: of the perturbed runs; the other methods are those of `METHODS` without it.

    Attributes:
        measures: results so far, by condition, case and seed.
        kept: see `Store`, which it is one.
    """

    def __init__(
        self,
        runs: int,
        table: Path,
        jobs: int | None = None,
        condition: Condition = CONDITIONS[0],
        integrator: str = DEFAULT,
    ) -> None:
        """Plan the runs."""
        self.condition, self.integrator = condition, integrator
        self.runs = runs
        self.table = table
        self.jobs = number_of(jobs)
        self.measures: dict[tuple[Condition, str, int], Measures] = {}
        self._found: dict[tuple[str, str], Found] = {}
        self.kept = f"the runs so far are in {str(table)!r}"
        self._methods = [
            (label, method)
            for label in CASES
            for method, options in METHODS.items()
            if options["integrator"] != integrator or "tolerance" in options
        ]
        labels = [label for label, clearance in CASES.items() if clearance is not None]
        self.plan = [
            (condition, label, seed)
            for condition in CONDITIONS
            for label in labels
            for seed in range(runs)
        ]

    @contextmanager
    def started(self) -> Iterator[Future[None]]:
        """Run in the background while the block runs; Ctrl-C in the block ends the processes.

        Whatever the block is doing, each run is kept and written to the table when it is done.
        Yields what `wait` waits for.
        """
        plan: dict[Any, Callable[[], Any]]
        plan = {key: partial(by_method, *key, self.condition) for key in self._methods}
        plan |= {key: partial(perturbed, *key, self.integrator) for key in self.plan}
        study: Study[Callable[[], Any], Any] = Study(plan, call, self)
        pool = Pool(study.measure, self.jobs, kept=self.kept)
        with ThreadPoolExecutor(1) as thread, closing(pool):
            yield thread.submit(self._collect, study, pool)

    def _collect(self, study: Study[Any, Any], pool: Workers[Any, Any]) -> None:
        """Keep what the processes find, as it comes."""
        for _ in study.outcomes(workers=pool):
            if (bar := current()) is not None:
                bar.add(length())

    def __contains__(self, key: object) -> bool:
        """Whether it has been run."""
        return key in self.measures or key in self._found

    def __getitem__(self, key: Any) -> Measures | Found:
        """What was found."""
        return self.measures[key] if key in self.measures else self._found[key]

    def keep(self, key: Any, value: Any) -> None:
        """Keep a run; one behind the claims is written to the table at once."""
        if isinstance(value, Found):
            self._found[key] = value
            return
        condition, label, seed = key
        row: dict[str, object] = {"gravity": condition.gravity, "inertia": condition.variant}
        row |= {"clearance": label, "seed": seed, **value}
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, list(row))
        if not self.measures:
            writer.writeheader()
        writer.writerow(row)
        self.measures[key] = value
        files.append(self.table, text.getvalue())

    @property
    def others(self) -> dict[tuple[str, str], Found]:
        """What other methods found so far, by case and method, in the order of the cases."""
        return {key: self._found[key] for key in self._methods if key in self._found}

    @property
    def to_simulate(self) -> float:
        """What the runs that `started` begins simulate [s]."""
        return (len(self.plan) + len(self._methods)) * length()

    def wait(self, collecting: Future[None]) -> None:
        """Wait for the runs, those by the explicit method among them.

        Raises:
            JointplayError: a run did not complete, or the table cannot be written.
        """
        while not collecting.done():
            wait([collecting], _LOOK_S)
            if (bar := current()) is not None:
                done, all_runs = len(self.measures), len(self.plan)
                bar.say(f"perturbed runs, {done} of {all_runs}")
                bar.add(0.0)
        collecting.result()

    def verdicts(self) -> list[Verdict]:
        """Claims under each condition for which at least two runs of each case are there."""
        verdicts = []
        for condition in CONDITIONS:
            small, large = (
                [self.measures[key] for key in self.plan
                 if key in self.measures and key[:2] == (condition, label)]
                for label in ("0.2 mm", "0.5 mm")
            )  # fmt: skip
            if min(len(small), len(large)) >= 2:
                verdicts += judge(small, large, str(condition))
        return sorted(verdicts, key=lambda verdict: verdict.claim)


HEADER = ("claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm")


def write_claims(verdicts: Sequence[Verdict], ensembles: Ensembles, out: Path) -> None:
    """Write ``claims.csv`` and ``claims.md``."""
    rows = [HEADER, *(verdict.row() for verdict in verdicts)]
    table = Table.of_texts(rows)
    files.write(out / "claims.csv", table.csv())
    done, planned = len(ensembles.measures), len(ensembles.plan)
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
        *([f"**Incomplete: {done} of {planned} runs.**", ""] if done < planned else []),
        table.markdown(),
        "",
        made_with(),
        "",
    ]
    files.write(out / "claims.md", "\n".join(lines))


def made_with() -> str:
    """A line that names the versions."""
    names = ", ".join(f"{name} {version}" for name, version in versions().items())
    return f"Made with {names}."


def summary(verdicts: Sequence[Verdict]) -> str:
    """Claims against conditions, for the terminal."""
    lines = [
        " " * 16 + "".join(f"{gravity:<24}" for gravity in GRAVITY),
        " " * 16 + "".join(f"{variant:<12}" for _ in GRAVITY for variant in VARIANTS),
    ]
    for number, subject in sorted({(v.claim, v.subject) for v in verdicts}):
        answers = {v.condition: v.holds for v in verdicts if v.claim == number}
        cells = "".join(f"{answers.get(str(condition), '-'):<12}" for condition in CONDITIONS)
        lines.append(f"{number} {subject:<14}{cells}")
    return "\n".join(line.rstrip() for line in lines)
