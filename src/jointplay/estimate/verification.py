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
from jointplay.estimate.identification import Identification, spreads
from jointplay.estimate.least_squares import basis
from jointplay.estimate.machine import known_gears
from jointplay.estimate.measurement import SHOWN, tool_positions
from jointplay.estimate.restitution import Instruments, channels, run, sampled_joint
from jointplay.estimate.unknowns import NORMAL
from jointplay.physics.joints import SlidingClearance
from jointplay.simulation.result.result import AXES, Result
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Study

RUNS = 6
"""Runs with which a measurement is compared."""
FEWEST_RUNS = 3
LEVEL = 0.05
"""How often a measurement of just this machine would be said to disagree, in all checks."""
_LEAST_SPREAD = 0.02
"""Scatter of the logarithm of a statistic below which runs are not taken to agree."""

_ByKind = dict[str, float]
_Parts = tuple[_ByKind, _ByKind, _ByKind, _ByKind]


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
        """Whether the measurement could be one more of the runs."""
        return self.low <= self.measured <= self.high


@dataclass(frozen=True)
class Verification:
    """RMS residuals of the measured means, nuisances projected out, by kind of signal [SI]."""

    measured: dict[str, float]
    """Of the means themselves: what a model without play leaves."""
    static: dict[str, float]
    """Of the static model with what was identified."""
    dynamic: dict[str, float]
    """Of the mean of the runs of the full model with it."""
    error: dict[str, float]
    """Standard error of the means."""
    checks: tuple[Check, ...]
    runs: int
    not_identified: tuple[str, ...]
    """Unknowns that had the scenario's value."""

    @property
    def agrees(self) -> bool:
        """Whether the measurement could be one more of the runs."""
        return all(one.agrees for one in self.checks)

    def __str__(self) -> str:
        """A line for each kind of signal and each statistic, and the verdict."""
        lines = []
        if self.measured:
            heads = ("without play", "static model", "simulated", "standard error of the means")
            parts = (self.measured, self.static, self.dynamic, self.error)
            kinds = [(kind, displayed(SHOWN[kind], fine=True)) for kind in self.measured]
            rows = [
                [f"{kind} [{unit}]", *(f"{factor * part[kind]:.4g}" for part in parts)]
                for kind, (factor, unit) in kinds
            ]
            lines.append(str(Table.of_texts([["RMS residual", *heads], *rows])))
        found = [
            [
                one.name + (f" [{one.unit}]" if one.unit else ""),
                f"{one.measured:.4g}",
                f"{one.low:.4g} to {one.high:.4g}",
                "agrees" if one.agrees else "DISAGREES",
            ]
            for one in self.checks
        ]
        head = ["statistic", "measured", f"of {self.runs} runs and their scatter", ""]
        lines.append(str(Table.of_texts([head, *found])))
        off = sum(not one.agrees for one in self.checks)
        if off:
            verdict = f"{off} of {len(self.checks)} statistics are off"
            if self.not_identified:
                verdict += (
                    f"; not determined, taken from the scenario: {', '.join(self.not_identified)}"
                )
            lines.append(f"the identified machine does not reproduce the measurement: {verdict}")
        else:
            lines.append(
                "the identified machine reproduces the measurement within scatter (simulated)"
            )
        return "\n".join(lines)

    def describe(self) -> dict[str, Any]:
        """As plain data [SI]."""
        left = {"without_play": self.measured, "static": self.static}
        left |= {"simulated": self.dynamic, "standard_error": self.error}
        checks = [{**vars(one), "agrees": one.agrees} for one in self.checks]
        return {"agrees": self.agrees, "runs": self.runs, "left_over": left, "checks": checks}


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
    instruments = Instruments.of(measured) if impacts else None
    if instruments is not None:
        own = instruments.settings(simulation)
    drawn = [_perturbed(own, identification, number) for number in range(runs)]
    with ProgressBar(total=runs, desc="verify", disable=not progress, unit="run") as bar:
        found = Study(drawn, partial(_look, identification, instruments)).run(jobs, bar)
    means, rows = zip(*found, strict=True)
    statistics = {} if instruments is None else instruments.statistics(measured)
    number = len({kind for kind, _ in keys}) + len(statistics)
    parts: _Parts = ({}, {}, {}, {})
    checks: list[Check] = []
    if keys:
        parts, checks = _compare_means(identification, np.array(means), number)
    for name, value in statistics.items():
        compared = np.array([row[name] for row in rows])
        if np.isfinite([value, *compared]).all():
            checks.append(_impact_check(name, value, compared, number))
    labels = [one.label for one in identification.sought if one.reason]
    return Verification(*parts, tuple(checks), runs, tuple(labels))


def _look(
    identification: Identification, instruments: Instruments | None, simulation: Simulation
) -> tuple[np.ndarray | None, dict[str, float]]:
    """Means over visits of a run, and the statistics of its impacts, as far as they are asked."""
    result = run(simulation)
    means = _means(result, identification) if identification.observed.keys else None
    return means, {} if instruments is None else instruments.statistics(instruments.look(result))


def _perturbed(simulation: Simulation, identification: Identification, number: int) -> Simulation:
    """A run with values within the intervals and a start of its own."""
    random = np.random.default_rng(number)
    known, mechanism = spreads(identification), identification.mechanism
    bounced = {one.joint: one for one in identification.restitutions if not one.reason}
    joints = {}
    for name, joint in mechanism.clearance.items():
        made = sampled_joint(joint, known.get(name, {}), random)
        if name in bounced and isinstance(joint, SlidingClearance):
            shift = bounced[name].half_width / NORMAL * random.standard_normal()
            value = min(max(joint.restitution + shift, 0.02), 1.0)
            made = made.with_restitution(value)
        joints[name] = made
    gears = known_gears(mechanism)
    for one in identification.estimates:
        if one.unknown.name == "gear_play" and one.identified:
            shift = one.half_width / NORMAL * random.standard_normal()
            play = max(gears[one.joint].play + shift, 0.0)
            gears[one.joint] = replace(gears[one.joint], play=float(play))
    made_of = mechanism.with_clearance(joints, gears)
    seed = None if all(getattr(j, "ideal", False) for j in joints.values()) else number + 1
    return replace(simulation, mechanism=made_of, seed=seed)


def _quantile(runs: int, checks: int) -> float:
    """Spreads within which one more run lies, in all checks together."""
    part = LEVEL / checks
    return float(student.ppf(1.0 - part / 2.0, runs - 1)) * np.sqrt(1.0 + 1.0 / runs)


def _impact_check(name: str, measured: float, runs: np.ndarray, number: int) -> Check:
    """A statistic of impacts, of `number` checks in all; values are logarithms."""
    wide = _quantile(len(runs), number) * max(float(runs.std(ddof=1)), _LEAST_SPREAD)
    ends = np.exp([measured, runs.mean() - wide, runs.mean() + wide]) - name.startswith("number")
    return Check(name, "", *(float(max(x, 0.0)) for x in ends))


def _compare_means(
    identification: Identification, means: np.ndarray, number: int
) -> tuple[_Parts, list[Check]]:
    """RMS residuals of means over visits by kind, beside those of runs from each other.

    `means` are the runs', shape (runs, n, keys); there are `number` checks in all.
    """
    left = _Residuals(identification, np.isfinite(means).all(axis=0))
    measured, count = identification.observed.mean, len(means)
    parts = (
        left.rms(measured),
        left.rms(measured - identification.predicted),
        left.rms(measured - means.mean(axis=0)),
        left.plain(identification.error),
    )
    random = np.random.default_rng(0)
    others: list[dict[str, float]] = []
    for k in range(count):
        rest = np.delete(means, k, axis=0).mean(axis=0)
        noise = identification.error * random.standard_normal(measured.shape)
        others.append(left.rms(means[k] + noise - rest))
    checks = []
    for kind, value in parts[2].items():
        logs = np.log([max(other[kind], 1e-300) for other in others])
        wide = _quantile(count, number) * max(float(logs.std(ddof=1)), _LEAST_SPREAD)
        factor, unit = displayed(SHOWN[kind], fine=True)
        high = factor * float(np.exp(logs.mean() + wide))
        checks.append(
            Check(f"{kind}: RMS left of means over visits", unit, factor * value, 0.0, high)
        )
    return parts, checks


class _Residuals:
    """RMS of values at visits, nuisances projected out."""

    def __init__(self, identification: Identification, there: np.ndarray) -> None:
        """Find the nuisances of the signals at visits that are there, (n, keys)."""
        self._error = identification.error
        self.use = np.isfinite(self._error) & there
        self._weights = np.where(self.use, 1.0 / self._error, 0.0).ravel()
        design = identification.nuisances.reshape(self.use.size, -1) * self._weights[:, None]
        self._basis = basis(design)
        self._kinds = [kind for kind, _ in identification.observed.keys]

    def rms(self, values: np.ndarray) -> dict[str, float]:
        """By kind of signal, of values (n, keys) [SI]."""
        scaled = np.where(self.use, values, 0.0).ravel() * self._weights
        rest = (scaled - self._basis @ (self._basis.T @ scaled)).reshape(self.use.shape)
        return self.plain(rest * self._error)

    def plain(self, values: np.ndarray) -> dict[str, float]:
        """The same, nuisances left in."""
        shown = np.where(self.use, values, np.nan)
        found = {}
        for kind in dict.fromkeys(self._kinds):
            mine = [k == kind for k in self._kinds]
            if self.use[:, mine].any():
                found[kind] = float(np.sqrt(np.nanmean(shown[:, mine] ** 2)))
        return found


def _means(result: Result, identification: Identification) -> np.ndarray:
    """What a run shows at the visits, shape (n, keys)."""
    mechanism, joints = identification.mechanism, identification.visits.joints
    motors = result["q"].values[:, [mechanism.motor(name) for name in joints]]
    ideal = tool_positions(mechanism, joints, motors)
    values = []
    for kind, name in identification.observed.keys:
        if kind == "tool":
            i = AXES.index(name)
            values.append(result["tool_position"].values[:, i] - ideal[:, i])
        elif kind == "link":
            link = result["q"].values[:, mechanism.coordinate(name)]
            values.append(link - motors[:, joints.index(name)])
        else:
            values.append(result["drive"].values[:, mechanism.motor(name)])
    table = np.column_stack(values)
    means = np.full((len(identification.visits), len(values)), np.nan)
    for i, (begin, end) in enumerate(identification.visits.time):
        inside = (result.time >= begin) & (result.time <= end)
        if inside.any():
            means[i] = table[inside].mean(axis=0)
    return means
