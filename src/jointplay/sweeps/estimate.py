"""What a sweep would take, found by running the beginning of one of its cases."""

from __future__ import annotations

import time
from dataclasses import dataclass

from jointplay.errors import JointplayError
from jointplay.sweeps.case import Bench
from jointplay.sweeps.plan import Plan

MANY = 20_000
"""Cases above which a sweep asks whether it is meant."""

PATIENCE_S = 2.0
"""How long a case is tried [s]."""

MEASURES_BYTES = 300
"""What the measures of a case take in the store [bytes]."""


@dataclass(frozen=True)
class Estimate:
    """What a sweep takes."""

    seconds: float
    """On so many processes."""
    processes: int
    bytes: float

    @property
    def words(self) -> str:
        """Time and size in words."""
        return (
            f"about {_time(self.seconds)} on {self.processes} processes and "
            f"{_size(self.bytes)} of results"
        )


def estimate(made: Plan, bench: Bench, processes: int) -> Estimate:
    """Run the beginning of a case, and reckon from its pace."""
    for index in made.indices():
        try:
            started = time.perf_counter()
            run = bench.simulation(made.changes(index)).prepare()
            ready = time.perf_counter() - started
            break
        except JointplayError:
            continue
    run.begin()
    started = time.perf_counter()
    while run.workspace.steps < run.steps and time.perf_counter() - started < PATIENCE_S:
        if not run.stretch():
            break
    share = max(run.workspace.steps, 1) / run.steps
    seconds = ready + (time.perf_counter() - started) / share
    records = run.steps / run.simulation.record_every
    kept = 8.0 * 3.0 * records * len(made.histories)
    return Estimate(
        made.count * seconds / processes, processes, made.count * (MEASURES_BYTES + kept)
    )


def _time(seconds: float) -> str:
    for size, name in ((86400.0, "days"), (3600.0, "hours"), (60.0, "minutes")):
        if seconds >= 2.0 * size:
            return _rounded(seconds / size, name)
    return f"{seconds:.0f} seconds"


def _rounded(value: float, unit: str) -> str:
    return f"{value:.2g} {unit}" if value < 100.0 else f"{value:.0f} {unit}"


def _size(size: float) -> str:
    for factor, name in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB")):
        if size >= factor:
            return _rounded(size / factor, name)
    return f"{size / 1e3:.0f} kB"
