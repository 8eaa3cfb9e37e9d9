"""Ensembles of perturbed runs, and what they say of the paper's claims."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager
from functools import partial
from operator import call
from pathlib import Path
from typing import Any

from jointplay.base import files
from jointplay.base.processes import Pool, number_of
from jointplay.base.progress import current
from jointplay.base.tables import Table
from jointplay.model.urdf import GRAVITY
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
from jointplay.physics.kernel.integrators import DEFAULT
from jointplay.simulation.analysis.claims import ISOLATED, Measures, Verdict, judge
from jointplay.simulation.initial import PERTURBATION
from jointplay.simulation.result.settings import START_UP
from jointplay.simulation.result.stored import versions
from jointplay.study.study import Memory, Study

_LOOK_S = 0.2
"""Interval at which progress is looked at."""


class Ensembles:
    """The perturbed runs behind the claims, and the cases by other methods, on all cores.

    Args:
        runs: perturbed runs for each clearance and condition.
        jobs: processes; None takes one for each core.
        condition: under which the cases are also run by other methods.
        integrator: of the perturbed runs; the other methods are those of `METHODS` without it.

    Attributes:
        plan: perturbed runs, by condition, case and seed.
    """

    def __init__(
        self,
        runs: int,
        jobs: int | None = None,
        condition: Condition = CONDITIONS[0],
        integrator: str = DEFAULT,
    ) -> None:
        """Plan the runs."""
        self.runs, self.jobs = runs, number_of(jobs)
        labels = [label for label, clearance in CASES.items() if clearance is not None]
        self.plan = [
            (condition, label, seed)
            for condition in CONDITIONS
            for label in labels
            for seed in range(runs)
        ]
        self._methods = [
            (label, method)
            for label in CASES
            for method, options in METHODS.items()
            if options["integrator"] != integrator or "tolerance" in options
        ]
        plan: dict[Any, Callable[[], Any]]
        plan = {key: partial(by_method, *key, condition) for key in self._methods}
        plan |= {key: partial(perturbed, *key, integrator) for key in self.plan}
        self._found = Memory[Any]()
        self._study: Study[Callable[[], Any], Any] = Study(plan, call, self._found)

    @property
    def measures(self) -> dict[tuple[Condition, str, int], Measures]:
        """Of the perturbed runs so far, by condition, case and seed."""
        return {key: self._found[key] for key in self.plan if key in self._found}

    @property
    def others(self) -> dict[tuple[str, str], Found]:
        """What other methods found so far, by case and method."""
        return {key: self._found[key] for key in self._methods if key in self._found}

    @contextmanager
    def started(self) -> Iterator[Future[None]]:
        """Run in the background while the block runs; Ctrl-C in the block ends the processes.

        Yields what `wait` waits for.
        """
        pool: Pool[Callable[[], Any], Any]
        pool = Pool(call, self.jobs, kept="the tables have the runs so far")
        with ThreadPoolExecutor(1) as thread, closing(pool):
            yield thread.submit(self._collect, pool)

    def _collect(self, pool: Pool[Callable[[], Any], Any]) -> None:
        for _ in self._study.outcomes(workers=pool):
            if (bar := current()) is not None:
                bar.update(length())

    @property
    def to_simulate(self) -> float:
        """What the runs that `started` begins simulate [s]."""
        return (len(self.plan) + len(self._methods)) * length()

    def wait(self, collecting: Future[None]) -> None:
        """Wait for the runs, those by the explicit method among them.

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
        """A row for each perturbed run: what it was run with, and its measures."""
        found = self.measures
        heads = ["gravity", "inertia", "clearance", "seed", *next(iter(found.values()), {})]
        rows = [
            (condition.gravity, condition.variant, label, seed, *measures.values())
            for (condition, label, seed), measures in found.items()
        ]
        return Table.of([(head, "") for head in heads], rows)

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
    """Write ``ensemble.csv``, ``claims.csv`` and ``claims.md``."""
    files.write(out / "ensemble.csv", ensembles.table.csv(17))
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
