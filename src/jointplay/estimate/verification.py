"""Whether the full model does what was measured, with what was identified: statistics, not traces.

Runs with values within the intervals, started differently, scatter. If the measurement could be one
more of them it agrees: means over visits, and what impacts show, each within what the runs do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import t as student

from jointplay.base.errors import JointplayError
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Table
from jointplay.base.units import displayed
from jointplay.estimate.identification import Identification
from jointplay.estimate.least_squares import basis
from jointplay.estimate.machine import drawn
from jointplay.estimate.measurement import SHOWN, departures, histories
from jointplay.estimate.restitution import RUN, Instruments, channels
from jointplay.simulation.result.result import Result
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Study, run_to_the_end

RUNS = 6
FEWEST_RUNS = 3
LEVEL = 0.05
"""How often a measurement of just this machine would be said to disagree, in all checks."""
_LEAST_SPREAD = 0.02
"""Scatter of the logarithm of a statistic below which runs are not taken to agree."""


@dataclass(frozen=True)
class Check:
    """A statistic of the measurement beside those of the runs."""

    name: str
    unit: str
    measured: float
    low: float
    """Least that runs and measurement would have in common."""
    high: float

    @property
    def agrees(self) -> bool:
        return self.low <= self.measured <= self.high


@dataclass(frozen=True)
class Verification:
    """Statistics of the measurement beside those of runs with what was identified."""

    left: dict[str, dict[str, float]]
    """RMS residuals of the measured means, nuisances projected out, ``without_play``, of the
    ``static`` model, of the mean ``simulated`` run, and their ``standard_error``; by kind of signal
    [SI]."""
    checks: tuple[Check, ...]
    runs: int
    not_identified: tuple[str, ...]
    """Unknowns that had the scenario's value."""

    @property
    def agrees(self) -> bool:
        return all(one.agrees for one in self.checks)

    def __str__(self) -> str:
        lines = []
        if self.left:
            kinds = [(kind, displayed(SHOWN[kind], fine=True)) for kind in self.left["static"]]
            rows = [
                [f"{kind} [{unit}]", *(f"{factor * one[kind]:.4g}" for one in self.left.values())]
                for kind, (factor, unit) in kinds
            ]
            heads = [name.replace("_", " ") for name in self.left]
            lines.append(Table.of_texts([["RMS residual", *heads], *rows]))
        head = ["statistic", "measured", f"of {self.runs} runs and their scatter", ""]
        found = [
            [
                one.name + (f" [{one.unit}]" if one.unit else ""),
                f"{one.measured:.4g}",
                f"{one.low:.4g} to {one.high:.4g}",
                "agrees" if one.agrees else "DISAGREES",
            ]
            for one in self.checks
        ]
        verdict = "the identified machine reproduces the measurement within scatter (simulated)"
        if off := sum(not one.agrees for one in self.checks):
            verdict = "the identified machine does not reproduce the measurement: "
            verdict += f"{off} of {len(self.checks)} statistics are off"
            if names := ", ".join(self.not_identified):
                verdict += f"; not determined, taken from the scenario: {names}"
        return "\n".join(map(str, [*lines, Table.of_texts([head, *found]), verdict]))

    def describe(self) -> dict[str, Any]:
        checks = [{**vars(one), "agrees": one.agrees} for one in self.checks]
        return {"agrees": self.agrees, "runs": self.runs, "left_over": self.left, "checks": checks}


def verify(
    simulation: Simulation,
    identification: Identification,
    *,
    runs: int = RUNS,
    jobs: int | None = None,
    progress: bool = False,
) -> Verification:
    """Run the motion with what was identified, and compare statistics.

    Args:
        simulation: of the motion and the loads that were measured, times alike.
        identification: what was identified.
        runs: how many, each with other values within the intervals and another start.
        jobs: processes; None takes one for each core.
        progress: show a bar.

    Raises:
        JointplayError: too few runs; a scenario without motion; nothing to compare; a run that
            fails.
    """
    if simulation.motion is None and simulation.duration is None:
        raise JointplayError("to verify, the scenario must have the motion that was measured")
    if runs < FEWEST_RUNS:
        raise JointplayError(
            f"to estimate the scatter, at least {FEWEST_RUNS} runs are needed, got {runs}"
        )
    measured, keys = identification.measured, identification.observed.keys
    impacts = bool(channels(measured))
    if not keys and not impacts:
        raise JointplayError("nothing to compare: no means over visits and no impacts")
    own = replace(simulation, duration=float(measured.time[-1]))
    instruments = Instruments(measured) if impacts else None
    if instruments is not None:
        own = instruments.settings(simulation)
    made = [_perturbed(own, identification, number) for number in range(runs)]
    with ProgressBar(total=runs, desc="verify", disable=not progress, unit="run") as bar:
        found = Study(made, partial(_look, identification, instruments)).run(jobs, bar)
    means, rows = zip(*found, strict=True)
    statistics = {} if instruments is None else instruments.statistics(measured)
    number = len({kind for kind, _ in keys}) + len(statistics)
    left: dict[str, dict[str, float]] = {}
    checks: list[Check] = []
    if keys:
        left, checks = _compare_means(identification, np.array(means), number)
    for name, value in statistics.items():
        compared = np.array([row[name] for row in rows])
        if np.isfinite([value, *compared]).all():
            checks.append(_impact_check(name, value, compared, number))
    labels = [one.label for one in identification.sought if one.reason]
    return Verification(left, tuple(checks), runs, tuple(labels))


def _look(
    identification: Identification, instruments: Instruments | None, simulation: Simulation
) -> tuple[np.ndarray | None, dict[str, float]]:
    result = run_to_the_end(simulation, RUN)
    means = _means(result, identification) if identification.observed.keys else None
    return means, {} if instruments is None else instruments.look(result)


def _perturbed(simulation: Simulation, identification: Identification, number: int) -> Simulation:
    """A run with values within the intervals and a start of its own."""
    found = (*identification.estimates, *identification.restitutions)
    mechanism = drawn(identification.mechanism, found, np.random.default_rng(number))
    still = all(getattr(joint, "ideal", False) for joint in mechanism.clearance.values())
    return replace(simulation, mechanism=mechanism, seed=None if still else number + 1)


def _width(scatter: np.ndarray, checks: int) -> float:
    """How far off the runs' mean one more run may lie, in so many checks together; of logarithms
    (runs,)."""
    runs = len(scatter)
    quantile = float(student.ppf(1.0 - LEVEL / checks / 2.0, runs - 1)) * np.sqrt(1.0 + 1.0 / runs)
    return quantile * max(float(scatter.std(ddof=1)), _LEAST_SPREAD)


def _impact_check(name: str, measured: float, runs: np.ndarray, number: int) -> Check:
    wide = _width(runs, number)
    ends = np.exp([measured, runs.mean() - wide, runs.mean() + wide]) - name.startswith("number")
    return Check(name, "", *(float(max(x, 0.0)) for x in ends))


def _compare_means(
    identification: Identification, means: np.ndarray, number: int
) -> tuple[dict[str, dict[str, float]], list[Check]]:
    """RMS residuals of means over visits by kind, beside those of runs from each other.

    `means` are the runs', shape (runs, n, keys); there are `number` checks in all.
    """
    measured, error = identification.observed.mean, identification.error
    use = np.isfinite(error) & np.isfinite(means).all(axis=0)
    weights = np.where(use, 1.0 / error, 0.0).ravel()
    span = basis(identification.nuisances.reshape(use.size, -1) * weights[:, None])
    kinds = np.array([kind for kind, _ in identification.observed.keys])

    def plain(values: np.ndarray) -> dict[str, float]:
        """RMS by kind of signal, of values (n, keys) [SI]."""
        shown = {kind: (values[:, kinds == kind], use[:, kinds == kind]) for kind in kinds}
        return {
            str(kind): float(np.sqrt(np.mean(mine[here] ** 2)))
            for kind, (mine, here) in shown.items()
            if here.any()
        }

    def rms(values: np.ndarray) -> dict[str, float]:
        scaled = np.where(use, values, 0.0).ravel() * weights
        return plain((scaled - span @ (span.T @ scaled)).reshape(use.shape) * error)

    left = {
        "without_play": rms(measured),
        "static": rms(measured - identification.predicted),
        "simulated": rms(measured - means.mean(axis=0)),
        "standard_error": plain(error),
    }
    random = np.random.default_rng(0)
    others = [
        rms(own + error * random.standard_normal(measured.shape) - np.delete(means, k, 0).mean(0))
        for k, own in enumerate(means)
    ]
    checks = []
    for kind, value in left["simulated"].items():
        logs = np.log([max(other[kind], 1e-300) for other in others])
        factor, unit = displayed(SHOWN[kind], fine=True)
        high = factor * float(np.exp(logs.mean() + _width(logs, number)))
        name = f"{kind}: RMS left of means over visits"
        checks.append(Check(name, unit, factor * value, 0.0, high))
    return left, checks


def _means(result: Result, identification: Identification) -> np.ndarray:
    joints, keys = identification.visits.joints, identification.observed.keys
    motors = histories(result, "motor")
    signals = {(kind, name): histories(result, kind)[name] for kind, name in keys}
    q = np.column_stack([motors[name] for name in joints])
    table = np.column_stack([*departures(identification.mechanism, joints, q, signals).values()])
    means = np.full((len(identification.visits), len(keys)), np.nan)
    for i, (begin, end) in enumerate(identification.visits.time):
        inside = (result.time >= begin) & (result.time <= end)
        if inside.any():
            means[i] = table[inside].mean(axis=0)
    return means
