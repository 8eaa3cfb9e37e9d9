"""Ensembles of perturbed runs, and the verdicts on the paper's claims that they give."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager
from functools import partial
from itertools import product
from operator import call
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from jointplay.base import files
from jointplay.base.processes import Pool, number_of
from jointplay.base.progress import current
from jointplay.base.tables import Table
from jointplay.paper import cases
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation.analysis.claims import CLAIM_COLUMNS, ISOLATED, Measures, Verdict, judge
from jointplay.simulation.initial import PERTURBATION
from jointplay.simulation.result.stored import versions
from jointplay.study.study import Memory, Study

_LOOK_S = 0.2
"""Interval at which progress is shown [s]."""


class Ensembles:
    """The perturbed runs behind the claims, and the cases by other methods, on all cores.

    Args:
        runs: perturbed runs for each clearance and condition.
        jobs: processes; None takes one for each core.
        condition: condition under which the cases are also run by other methods.
        integrator: method of the perturbed runs; the other methods are the rest of `METHODS`.
    """

    def __init__(
        self,
        runs: int,
        jobs: int | None = None,
        condition: cases.Condition = cases.CONDITIONS[0],
        integrator: str = DEFAULT,
    ) -> None:
        self.runs, self.jobs = runs, number_of(jobs)
        played = [label for label, clearance in cases.CASES.items() if clearance is not None]
        self.plan = list(product(cases.CONDITIONS, played, range(runs)))
        self._methods = [
            (label, method)
            for label in cases.CASES
            for method, options in cases.METHODS.items()
            if options["integrator"] != integrator or "tolerance" in options
        ]
        plan: dict[Any, Callable[[], Any]]
        plan = {key: partial(cases.by_method, *key, condition) for key in self._methods}
        plan |= {key: partial(cases.perturbed, *key, integrator) for key in self.plan}
        self._outcomes = Memory[Any]()
        self._study: Study[Callable[[], Any], Any] = Study(plan, call, self._outcomes)
        self.to_simulate = len(plan) * cases.length()
        """Simulated time of all runs [s]."""

    @property
    def measures(self) -> dict[tuple[cases.Condition, str, int], Measures]:
        """Measures of the perturbed runs so far, by condition, case and seed."""
        return {key: self._outcomes[key] for key in self.plan if key in self._outcomes}

    @property
    def others(self) -> dict[tuple[str, str], cases.MethodFigures]:
        """Figures by other methods so far, by case and method."""
        return {key: self._outcomes[key] for key in self._methods if key in self._outcomes}

    @contextmanager
    def started(self) -> Iterator[Future[None]]:
        """Run in the background while the block runs; yields the future for `wait`.

        Ctrl-C in the block ends the processes.
        """
        import scipy.spatial  # noqa: F401 - imported here once, not by each process

        pool: Pool[Callable[[], Any], Any]
        pool = Pool(call, self.jobs, recovery="the tables have the runs so far")
        with ThreadPoolExecutor(1) as thread, closing(pool):
            yield thread.submit(self._collect, pool)

    def _collect(self, pool: Pool[Callable[[], Any], Any]) -> None:
        for _ in self._study.outcomes(workers=pool):
            if (bar := current()) is not None:
                bar.update(cases.length())

    def wait(self, collecting: Future[None]) -> None:
        """Wait for all runs, and show their progress.

        Raises:
            JointplayError: a run did not complete.
        """
        while not collecting.done():
            wait([collecting], _LOOK_S)
            if (bar := current()) is not None:
                bar.say(f"perturbed runs, {len(self.measures)} of {len(self.plan)}")
                bar.update(0.0)
        collecting.result()

    @property
    def table(self) -> Table:
        """Table with a row for each perturbed run: condition, case, seed, and measures."""
        measured = self.measures
        heads = ["gravity", "inertia", "clearance", "seed", *next(iter(measured.values()), {})]
        rows = [
            (condition.gravity, condition.variant, label, seed, *measures.values())
            for (condition, label, seed), measures in measured.items()
        ]
        return Table.of([(head, "") for head in heads], rows)

    def verdicts(self) -> list[Verdict]:
        """Verdicts on the claims under each condition with at least two runs of each case."""
        verdicts, measured = [], self.measures
        for condition in cases.CONDITIONS:
            small, large = (
                [measures for key, measures in measured.items() if key[:2] == (condition, label)]
                for label in ("0.2 mm", "0.5 mm")
            )
            if min(len(small), len(large)) >= 2:
                verdicts += judge(small, large, str(condition))
        return sorted(verdicts, key=lambda verdict: verdict.claim)


def claim_rows(verdicts: Sequence[Verdict]) -> list[tuple[str, ...]]:
    """Rows of the claims table, its head first."""
    return [CLAIM_COLUMNS, *(verdict.row() for verdict in verdicts)]


def write_claims(verdicts: Sequence[Verdict], ensembles: Ensembles, out: Path) -> None:
    """Write ``ensemble.csv``, ``claims.csv`` and ``claims.md``."""
    files.write(out / "ensemble.csv", ensembles.table.csv(None))
    rows = claim_rows(verdicts)
    files.write(out / "claims.csv", Table.of_texts(rows).csv())
    text = filled(
        "claims.md",
        rows=rows,
        runs=ensembles.runs,
        done=len(ensembles.measures),
        planned=len(ensembles.plan),
        displaced=f"{100 * PERTURBATION:.0f}",
        isolated=f"{100 * ISOLATED:.0f}",
        start=f"{cases.JUDGED_FROM_S:g}",
    )
    files.write(out / "claims.md", text)


def filled(name: str, **values: Any) -> str:
    """A page of the study: a template of `pages` filled with values and the packages' versions."""
    environment = Environment(
        loader=PackageLoader("jointplay.paper", "pages"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["table"] = lambda rows: Table.of_texts(rows).markdown()
    names = ", ".join(f"{name} {version}" for name, version in versions().items())
    return environment.get_template(name).render(values, made_with=f"Made with {names}.")


def summary(verdicts: Sequence[Verdict]) -> str:
    """Table of the verdicts for the terminal: claims by conditions."""
    rows = [("claim", *map(str, cases.CONDITIONS))]
    for number, subject in sorted({(v.claim, v.subject) for v in verdicts}):
        answers = {v.condition: v.holds for v in verdicts if v.claim == number}
        rows.append((f"{number} {subject}", *(answers.get(str(c), "-") for c in cases.CONDITIONS)))
    return str(Table.of_texts(rows))
