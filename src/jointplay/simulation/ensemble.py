"""Many runs: perturbed starts, other values, whatever simulations there are, on all cores."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from contextlib import closing, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from jointplay import kernel
from jointplay.core.errors import require_a
from jointplay.core.processes import Pool, number_of, one_thread, with_item
from jointplay.core.progress import ProgressBar
from jointplay.kernel import Status

if TYPE_CHECKING:
    from jointplay.result.result import Result
    from jointplay.simulation.simulation import Simulation


Item = TypeVar("Item")
Value = TypeVar("Value")

BAR_AFTER_S = 2.0
"""What takes no longer shows no bar [s]."""


class EnsembleInterrupted(KeyboardInterrupt):
    """An ensemble was told to stop.

    Attributes:
        finished: what was kept of the simulations that were finished, by their place.
    """

    def __init__(self, finished: Mapping[int, Any]) -> None:
        """Hold what was finished."""
        super().__init__(f"{len(finished)} simulations were finished; they are in .finished")
        self.finished = dict(finished)


def ensemble(
    simulations: Iterable[Simulation],
    *,
    jobs: int | None = None,
    keep: Callable[[Result], Any] | None = None,
    progress: bool = False,
    check_step: bool = True,
) -> list[Any]:
    """Run many simulations, on all cores: `[keep(one.run()) for one in simulations]`.

    The same bit for bit, whatever `jobs`: each run has one core to itself.

        seeds = [dataclasses.replace(simulation, seed=seed) for seed in range(100)]
        peaks = jp.ensemble(seeds, keep=peak_force)

    Args:
        simulations: any number; a generator is asked for the next one when a process is free.
        jobs: processes; None takes one for each core, 1 runs here.
        keep: what is wanted of a result. It runs where the simulation ran, so that memory does not
            grow with the number of runs; it, and what it returns, must be such as `pickle` takes: a
            function of a module, no lambda. None: the results themselves.
        progress: show a bar with the time left, if it takes more than `BAR_AFTER_S`.
        check_step: see `Run.finish`.

    Returns:
        What `keep` returned, in the order of the simulations. As from `Simulation.run`, a result
        may be of a run that stopped early, with a warning; `Result.completed` makes that an error.

    Raises:
        JointplayError: one of them cannot be run, or its process was killed; `where` is
            ``("simulations", 3)``.
        EnsembleInterrupted: Ctrl-C; a KeyboardInterrupt that has what was finished.
    """
    require_a("simulations", simulations, "Iterable")
    kept: dict[int, Any] = {}
    total = len(simulations) if isinstance(simulations, Sized) else None
    bar = ProgressBar(total=total, unit="run", disable=not progress, delay=BAR_AFTER_S)
    one = partial(_run, keep, check_step)
    try:
        with bar, run_parallel(one, simulations, jobs, name="simulations") as outcomes:
            for place, (value, warned) in outcomes:
                kept[place] = value
                for category, text in warned:
                    warnings.warn(f"simulations[{place}]: {text}", category, stacklevel=2)
                bar.update()
    except KeyboardInterrupt:
        raise EnsembleInterrupted(kept) from None
    return [kept[place] for place in range(len(kept))]


def _run(
    keep: Callable[[Result], Any] | None, check_step: bool, simulation: Simulation
) -> tuple[Any, list[tuple[type[Warning], str]]]:
    """What is kept of a run, and the warnings that it gave."""
    require_a("simulation", simulation, "Simulation")
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        result = simulation.run(check_step=check_step, estimate=False)
        if result.status == Status.INTERRUPTED:
            raise KeyboardInterrupt
        value = result if keep is None else keep(result)
    return value, [(one.category, str(one.message)) for one in warned]


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


def run_in_order(
    work: Callable[[Item], Value], items: Iterable[Item], jobs: int | None, bar: ProgressBar
) -> list[Value]:
    """What came of the items, in their order; each moves the bar by one. See `run_parallel`."""
    found: dict[int, Value] = {}
    with run_parallel(work, items, jobs) as outcomes:
        for place, value in outcomes:
            found[place] = value
            bar.update()
    return [found[place] for place in range(len(found))]


@contextmanager
def run_parallel(
    work: Callable[[Item], Value],
    items: Iterable[Item],
    jobs: int | None = None,
    *,
    kept: str = "nothing was kept",
    name: str = "",
) -> Iterator[Iterator[tuple[int, Value]]]:
    """Do work that simulates for each item; gives their places and what came of them, as they come.

    The processes end with the block. One job needs none: the work is done here.

    Args:
        work, kept, name: see `Pool`.
        items: any number, taken as they are needed.
        jobs: processes; None takes one for each core.

    Raises:
        JointplayError: `jobs` that make no sense, a process that was ended from outside.
        BaseException: what the work raised.
    """
    number = number_of(jobs, items)
    if number == 1:
        yield _run_serially(work, items, name)
        return
    kernel.compiled()  # once, for all of them
    with closing(Pool(work, number, kept=kept, name=name)) as pool:
        yield pool.run(items)


def _run_serially(
    work: Callable[[Item], Value], items: Iterable[Item], name: str
) -> Iterator[tuple[int, Value]]:
    for place, item in enumerate(items):
        try:
            with one_thread():
                value = work(item)
        except Exception as error:
            with_item(error, name, place)
            raise
        yield place, value
