"""Many runs: perturbed starts, other values, whatever simulations there are, on all cores."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from tqdm import tqdm

from jointplay import kernel
from jointplay.core import processes
from jointplay.kernel import Status

if TYPE_CHECKING:
    from jointplay.result.result import Result
    from jointplay.simulation.simulation import Simulation

__all__ = ["EnsembleInterrupted", "ensemble"]

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
        check_step: see `Run.execute`.

    Returns:
        What `keep` returned, in the order of the simulations. As from `Simulation.run`, a result
        may be of a run that stopped early, with a warning; `Result.completed` makes that an error.

    Raises:
        JointplayError: one of them cannot be run, or its process was killed; `where` is
            ``("simulations", 3)``.
        EnsembleInterrupted: Ctrl-C; a KeyboardInterrupt that has what was finished.
    """
    kept: dict[int, Any] = {}
    total = len(simulations) if isinstance(simulations, Sized) else None
    bar = tqdm(total=total, unit="run", disable=not progress, delay=BAR_AFTER_S)
    one = partial(_run, keep, check_step)
    try:
        with bar, side_by_side(one, simulations, jobs, name="simulations") as outcomes:
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
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        result = simulation.run(check_step=check_step)
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
        result = simulation.run(check_step=False)
    return result.completed(words)


@contextmanager
def side_by_side(
    work: Callable[[Item], Value],
    items: Iterable[Item],
    jobs: int | None = None,
    *,
    kept: str = "nothing was kept",
    name: str = "",
) -> Iterator[Iterator[tuple[int, Value]]]:
    """`processes.each` of work that simulates: what is compiled is compiled once, before."""
    if processes.number_of(jobs, items) > 1:
        kernel.compiled()
    with processes.each(work, items, jobs, kept=kept, name=name) as outcomes:
        yield outcomes
