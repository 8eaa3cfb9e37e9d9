"""A study: a plan of cases, the measure taken of each, and the store that keeps the values.

A plan is any collection of cases: simulations, changes of a scenario, numbers. A measure is a
function of a case; it runs in the process that runs the case, and only its return value comes
back. Cases already in the store are not run again, so an interrupted study resumes where it
stopped.
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
    """Keeps the value measured of each case, by the case's key."""

    @property
    def recovery(self) -> str:
        """What survives if a process is killed: a clause for the error message."""

    def __contains__(self, key: Any) -> bool:
        """Whether the case with this key has been run."""

    def keep(self, key: Any, value: Input, /) -> None:
        """Store the value measured of a case."""


class Memory(dict[Any, Value]):
    """A store in memory, lost when the process ends."""

    recovery = "nothing was kept"

    def keep(self, key: Any, value: Value) -> None:
        self[key] = value


class Workers(Protocol[Input, Output]):
    """Runs cases: in this process, in others on this machine, or on a cluster."""

    def run(self, cases: Iterable[tuple[Any, Input]]) -> Iterator[tuple[Any, Output]]:
        """Run cases, given with their keys; yields key and value of each as it finishes."""

    def close(self) -> None:
        """End the workers; cases in progress are abandoned."""


@known_keywords
class Study(Generic[Case, Value]):
    """Many runs of one measure.

    Args:
        plan: cases by key, or in order, their numbers then being the keys; an iterator is asked for
            the next case when a process is free. Only with a mapping may the store already hold
            some of the cases.
        measure: function of a case. With several processes, the measure, the cases and the
            returned values are pickled.
        store: keeps the values; None: memory.
        name: what the cases are called in errors.
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
        """Run the cases that are left; yields key and value of each once the store has it.

        Args:
            jobs: processes; None takes one for each core, 1 runs in this process.
            progress: show a bar on standard error; or a bar, which each case advances by one.
            workers: run the cases in place of `jobs` processes; they are not closed.
            bar_options: options of `ProgressBar`.

        Raises:
            JointplayError: `jobs` out of range, a process that was ended from outside, or a value
                that cannot be stored.
            BaseException: what the measure raised; finished cases are in the store.
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
        """Run the cases that are left; returns the values of all cases, in order. See `outcomes`.

        Raises:
            TypeError: the store is not a `Memory`.
        """
        if not isinstance(self.store, Memory):
            raise TypeError("outcomes() runs a study whose store is not in memory")
        for _ in self.outcomes(jobs, progress, **bar_options):
            pass
        keys = self.plan if isinstance(self.plan, Mapping) else range(self._started)
        return [self.store[key] for key in keys]

    def _pending(self) -> Iterator[tuple[Any, Case]]:
        """Yield key and case of those that the store lacks; plain cases are numbered as taken."""
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

        kernel.caller_of()  # compiled here once, not once in each process
        recovery = self.store.recovery
        return Pool(self.measure, number, early=self._early, recovery=recovery, name=self.name)


@dataclass(frozen=True)
class Measure(Generic[Value]):
    """The measure of a study of simulations: runs each, and takes a function of its result."""

    of: Callable[[Result], Value]
    """Function of the result; defined in a module, so that other processes can import it."""
    label: str = "a run"
    """What a simulation is called in the error if it fails."""
    check_step: bool = False
    """Whether each run checks its step by a second run, as `Run.finish` does."""

    def __call__(self, simulation: Simulation) -> Value:
        seed = "" if simulation.seed is None else f" with seed {simulation.seed}"
        return self.of(run_to_the_end(simulation, f"{self.label}{seed}", self.check_step))


def run_to_the_end(simulation: Simulation, label: str, check_step: bool = False) -> Result:
    """Simulate to the end; a run that stops early is an error, which calls it `label`.

    Raises:
        KeyboardInterrupt: the run was interrupted.
        JointplayError: the run stopped early; says why.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        result = simulation.run(check_step=check_step, estimate=False)
    return result.completed(label)
