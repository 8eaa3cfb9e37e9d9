"""Many runs: which (a plan), what is wanted of each (a measure), where that is kept (a store).

A plan is any collection of cases: simulations, changes of a scenario, numbers. A measure is a
function of a case; it runs where the case does, and only what it returns comes back. Cases that
the store has are not run again, so a study that was interrupted goes on.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sized
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from jointplay.base.processes import Pool, Serial, number_of
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import known_keywords

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.simulation import Simulation

Case = TypeVar("Case")
Value = TypeVar("Value")
Input = TypeVar("Input", contravariant=True)
Output = TypeVar("Output", covariant=True)


class Store(Protocol[Input]):
    """Keeps what was found, by the keys of cases."""

    @property
    def recovery(self) -> str:
        """What is left if a process is killed, in words."""

    def __contains__(self, key: Any) -> bool:
        """Whether a case has been run."""

    def keep(self, key: Any, value: Input, /) -> None:
        """Keep what was found of a case."""


class Memory(dict[Any, Value]):
    """A store that ends with the process."""

    recovery = "nothing was kept"

    def keep(self, key: Any, value: Value) -> None:
        self[key] = value


class Workers(Protocol[Input, Output]):
    """Who runs cases: this process, others of this machine, or those of a cluster."""

    def run(self, cases: Iterable[tuple[Any, Input]]) -> Iterator[tuple[Any, Output]]:
        """Do the work for these items, by key; gives what comes of them, as it comes."""

    def close(self) -> None:
        """End them; what they were doing is given up."""


@known_keywords
class Study(Generic[Case, Value]):
    """Many runs.

    Args:
        plan: cases by key, or in order, which are then their keys; an iterator is asked for the
            next one when a process is free. Only of a mapping may the store have some already.
        measure: what is wanted of a case. With several processes it, cases, and what it returns
            travel pickled.
        store: keeps it; None: memory.
        name: of the cases, with which errors say of which they are.
        early: whether a process that is told to stop ends its case early and saves it.
    """

    def __init__(
        self,
        plan: Mapping[Any, Case] | Iterable[Case],
        measure: Callable[[Case], Value],
        store: Store[Value] | None = None,
        *,
        name: str = "",
        early: bool = False,
    ) -> None:
        self.plan, self._started = plan, 0
        self.count = len(plan) if isinstance(plan, Sized) else None
        self.measure, self.name, self._early = measure, name, early
        self.store: Store[Value] = Memory() if store is None else store

    def outcomes(
        self,
        jobs: int | None = None,
        progress: bool | ProgressBar = False,
        *,
        workers: Workers[Case, Value] | None = None,
        **bar_options: Any,
    ) -> Generator[tuple[Any, Value]]:
        """Run what is left; gives each case's key and what was found, once that has been kept.

        Args:
            jobs: processes; None takes one for each core, 1 runs here.
            progress: show a bar on standard error; or a bar, which each case moves by one.
            workers: that run the cases instead; they are not closed.
            shown: of the bar, as `ProgressBar` takes it.

        Raises:
            JointplayError: `jobs` that make no sense, a process that was ended from outside; it
                cannot be kept.
            BaseException: what the measure raised; what was finished is in the store.
        """
        by_key = isinstance(self.plan, Mapping)
        finished = sum(key in self.store for key in self.plan) if by_key else 0
        with ExitStack() as stack:
            if workers is None:
                pending = None if self.count is None else range(self.count - finished)
                workers = stack.enter_context(closing(self._workers(number_of(jobs, pending))))
            bar = progress if isinstance(progress, ProgressBar) else None
            if bar is None:
                options = {"unit": "run", **bar_options, "total": self.count, "initial": finished}
                bar = stack.enter_context(ProgressBar(disable=not progress, **options))
            for key, value in workers.run(self._pending()):
                self.store.keep(key, value)
                yield key, value
                bar.update()

    def run(
        self, jobs: int | None = None, progress: bool | ProgressBar = False, **bar_options: Any
    ) -> list[Value]:
        """Run what is left; gives what was found of all cases, in order. See `outcomes`.

        Raises:
            TypeError: the store is none that is in memory.
        """
        if not isinstance(self.store, Memory):
            raise TypeError("outcomes() runs a study whose store is not in memory")
        for _ in self.outcomes(jobs, progress, **bar_options):
            pass
        keys = self.plan if isinstance(self.plan, Mapping) else range(self._started)
        return [self.store[key] for key in keys]

    def _pending(self) -> Iterator[tuple[Any, Case]]:
        """Cases that the store has not, by key, as they are taken."""
        if isinstance(self.plan, Mapping):
            yield from ((key, self.plan[key]) for key in self.plan if key not in self.store)
            return
        for number, case in enumerate(self.plan):
            self._started = number + 1
            yield number, case

    def _workers(self, number: int) -> Workers[Case, Value]:
        if number == 1:
            return Serial(self.measure, name=self.name)
        from jointplay.physics import kernel

        kernel.caller_of()  # once, for all of them
        recovery = self.store.recovery
        return Pool(self.measure, number, early=self._early, recovery=recovery, name=self.name)


@dataclass(frozen=True)
class Measure(Generic[Value]):
    """What is wanted of simulations: each is run, and a function of its result is kept."""

    of: Callable[[Result], Value]
    """A function of a module, which other processes find."""
    label: str = "a run"
    """What a simulation is called where it fails."""
    check_step: bool = False
    """Whether each run checks its step by a second one, as `Run.finish` does."""

    def __call__(self, simulation: Simulation) -> Value:
        seed = "" if simulation.seed is None else f" with seed {simulation.seed}"
        return self.of(run_to_the_end(simulation, f"{self.label}{seed}", self.check_step))


def run_to_the_end(simulation: Simulation, label: str, check_step: bool = False) -> Result:
    """Simulate; what stops a run, which is called `label`, is said in the error, not in a warning.

    Raises:
        KeyboardInterrupt: it was interrupted.
        JointplayError: it stopped early: why.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        result = simulation.run(check_step=check_step, estimate=False)
    return result.completed(label)
