"""Runs of which an analysis needs the end."""

from __future__ import annotations

import warnings

from jointplay.result.result import Result
from jointplay.simulation.simulation import Simulation


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
