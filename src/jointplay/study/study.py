"""Many runs: which (a plan), what is wanted of each (a measure), where that is kept (a store).

A plan is any collection of cases: simulations, changes of a scenario, numbers. A measure is a
function of a case; it runs where the case does, and only what it returns comes back. Cases that
the store has are not run again, so a study that was interrupted goes on.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from contextlib import closing
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from jointplay.core.processes import Pool, Serial, number_of
from jointplay.core.progress import ProgressBar

if TYPE_CHECKING:
    from jointplay.result.result import Result
    from jointplay.simulation.simulation import Simulation

Item = TypeVar("Item")
Value = TypeVar("Value")
Taken = TypeVar("Taken", contravariant=True)
Given = TypeVar("Given", covariant=True)


class Store(Protocol[Value]):
    """Keeps what was found, by the keys of cases."""

    @property
    def kept(self) -> str:
        """What is left if a process is killed, in words."""

    def __contains__(self, key: Any) -> bool:
        """Whether a case has been run."""

    def __getitem__(self, key: Any) -> Value:
        """What was found of a case."""

    def keep(self, key: Any, value: Value) -> None:
        """Keep what was found of a case."""


class Memory(dict[Any, Value]):
    """A store that ends with the process."""

    kept = "nothing was kept"

    def keep(self, key: Any, value: Value) -> None:
        """Keep what was found of a case."""
        self[key] = value


class Workers(Protocol[Taken, Given]):
    """Who runs cases: this process, others of this machine, or those of a cluster."""

    def run(self, items: Iterable[tuple[Any, Taken]]) -> Iterator[tuple[Any, Given]]:
        """Do the work for these items, by key; gives what comes of them, as it comes."""

    def close(self) -> None:
        """End them; what they were doing is given up."""


class Study(Generic[Item, Value]):
    """Many runs.

    Args:
        plan: cases by key, or in order, which are then their keys; an iterator is asked for the
            next one when a process is free. Only of a mapping may the store have some already.
        measure: what is wanted of a case. With several processes it, cases, and what it returns
            travel pickled.
        store: keeps it; None: memory.
        name: of the cases, with which errors say of which they are.

    Attributes:
        keys: of the cases that the plan has given so far, in order.
    """

    def __init__(
        self,
        plan: Mapping[Any, Item] | Iterable[Item],
        measure: Callable[[Item], Value],
        store: Store[Value] | None = None,
        *,
        name: str = "",
    ) -> None:
        """Plan; nothing runs."""
        self._cases = plan.items() if isinstance(plan, Mapping) else enumerate(plan)
        self.count = len(plan) if isinstance(plan, Sized) else None
        self.measure, self.name = measure, name
        self.store: Store[Value] = Memory() if store is None else store
        self.keys: list[Any] = []

    def left(self) -> Iterator[tuple[Any, Item]]:
        """Cases that the store has not, by key, as they are taken."""
        for key, item in self._cases:
            self.keys.append(key)
            if key not in self.store:
                yield key, item

    def workers(self, jobs: int | None) -> Workers[Item, Value]:
        """Processes of this machine, as many as wanted or one for each core; this one, if one.

        Raises:
            JointplayError: `jobs` that make no sense.
        """
        items: Sized | None = None
        if isinstance(self._cases, Sized):
            items = [key for key, _ in self._cases if key not in self.store]
        elif self.count is not None:
            items = range(self.count)
        number = number_of(jobs, items)
        if number == 1:
            return Serial(self.measure, name=self.name)
        from jointplay import kernel

        kernel.compiled()  # once, for all of them
        return Pool(self.measure, number, kept=self.store.kept, name=self.name)

    def outcomes(self, workers: Workers[Item, Value]) -> Iterator[tuple[Any, Value]]:
        """Run what is left; gives each case's key and what was found, when it has been kept.

        Raises:
            JointplayError: a process was ended from outside; it cannot be kept.
            BaseException: what the measure raised.
        """
        for key, value in workers.run(self.left()):
            self.store.keep(key, value)
            yield key, value

    def run(
        self, jobs: int | None = None, progress: bool | ProgressBar = False, **shown: Any
    ) -> list[Value]:
        """Run what is left, on all cores.

        Args:
            jobs: processes; None takes one for each core, 1 runs here.
            progress: show a bar on standard error; or a bar, which each case moves by one.
            shown: of the bar, as `ProgressBar` takes it.

        Returns:
            What was found of all cases, in the order of the plan.

        Raises:
            JointplayError, BaseException: see `outcomes`; what was finished is in the store.
        """
        with closing(self.workers(jobs)) as workers:
            if isinstance(progress, ProgressBar):
                self._move(progress, workers)
            else:
                done = 0
                if isinstance(self._cases, Sized):
                    done = sum(key in self.store for key, _ in self._cases)
                with ProgressBar(
                    total=self.count, initial=done, disable=not progress, unit="run", **shown
                ) as bar:
                    self._move(bar, workers)
        return [self.store[key] for key in self.keys]

    def _move(self, bar: ProgressBar, workers: Workers[Item, Value]) -> None:
        for _ in self.outcomes(workers):
            bar.update()


def run_to_the_end(simulation: Simulation, words: str) -> Result:
    """Simulate; what stops a run is said in the error, not in a warning before it.

    Args:
        simulation: what is run, without a check of its step.
        words: what it is called where it fails.

    Raises:
        KeyboardInterrupt: it was interrupted.
        JointplayError: it stopped early: why.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        result = simulation.run(check_step=False, estimate=False)
    return result.completed(words)
