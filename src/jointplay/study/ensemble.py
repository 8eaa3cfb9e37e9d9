"""Ensembles: any collection of simulations, such as perturbed starts, run on all cores."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import require_a
from jointplay.base.schema import known_keywords
from jointplay.physics.kernel import Status
from jointplay.study.study import Study

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.simulation import Simulation

BAR_AFTER_S = 2.0
"""Ensembles that take no longer than this show no progress bar [s]."""


class EnsembleInterrupted(KeyboardInterrupt):
    """An ensemble was interrupted.

    Attributes:
        finished: the values of the finished simulations, by their place in the ensemble.
    """

    def __init__(self, finished: Mapping[int, Any]) -> None:
        super().__init__(f"{len(finished)} simulations were finished; they are in .finished")
        self.finished = dict(finished)


@known_keywords
def ensemble(
    simulations: Iterable[Simulation],
    *,
    jobs: int | None = None,
    keep: Callable[[Result], Any] | None = None,
    progress: bool = False,
    check_step: bool = True,
) -> list[Any]:
    """Run many simulations, on all cores: `[keep(one.run()) for one in simulations]`.

    Results are the same bit for bit for any `jobs`: each run has one core to itself.

        seeds = [dataclasses.replace(simulation, seed=seed) for seed in range(100)]
        peaks = jp.ensemble(seeds, keep=peak_force)

    Args:
        simulations: any number; a generator is asked for the next one when a process is free.
        jobs: processes; None takes one for each core, 1 runs in this process.
        keep: function of a result, whose value is kept. It runs where the simulation ran, so that
            memory does not grow with the number of runs; it and its value must be picklable: a
            function of a module, no lambda. None keeps the results themselves.
        progress: show a bar with the time left, if the ensemble takes more than `BAR_AFTER_S`.
        check_step: see `Run.finish`.

    Returns:
        The values of `keep`, in the order of the simulations. As with `Simulation.run`, a result
        may be of a run that stopped early, with a warning; `Result.completed` makes that an error.

    Raises:
        JointplayError: one of them cannot be run, or its process was killed; `where` is
            ``("simulations", 3)``.
        EnsembleInterrupted: Ctrl-C; a KeyboardInterrupt with the values of the finished runs.
    """
    require_a("simulations", simulations, "Iterable")
    values: dict[int, Any] = {}
    study = Study(simulations, partial(_run, keep, check_step), name="simulations")
    try:
        with closing(study.outcomes(jobs, progress, delay=BAR_AFTER_S)) as outcomes:
            for place, (value, warned) in outcomes:
                values[place] = value
                for category, text in warned:
                    warnings.warn(f"simulations[{place}]: {text}", category, stacklevel=2)
    except KeyboardInterrupt:
        raise EnsembleInterrupted(values) from None
    return [values[place] for place in range(len(values))]


def _run(
    keep: Callable[[Result], Any] | None, check_step: bool, simulation: Simulation
) -> tuple[Any, list[tuple[type[Warning], str]]]:
    """The value kept of a run, and the warnings that the run gave."""
    from jointplay.simulation.run import Run  # slow to import

    require_a("simulation", simulation, "Simulation")
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        result = Run(simulation).finish(check_step=check_step)
        if result.status == Status.INTERRUPTED:
            raise KeyboardInterrupt
        value = result if keep is None else keep(result)
    return value, [(warning.category, str(warning.message)) for warning in warned]
