"""Restitution of joints: by flights where a journal bounces freely, by simulated impacts elsewhere.

In a machine impacts rarely die away as a ball's do: rims strike in turn, drives answer, loads turn.
So runs of the scenario with different restitutions are compared with the measurement by the
statistics of their impacts (`likelihood`), never by their traces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from tqdm import tqdm

from jointplay.analysis.identify.bounces import SHORTEST, flights
from jointplay.analysis.identify.impacts import IMPACT_KINDS, WINDOW, channels
from jointplay.analysis.identify.instruments import Instruments, drawn, run
from jointplay.analysis.identify.likelihood import Estimate, design, estimate, runs_needed
from jointplay.analysis.identify.reading import Measurement
from jointplay.errors import JointplayError
from jointplay.host import workers
from jointplay.joints import Clearance
from jointplay.mechanism.mechanism import Mechanism
from jointplay.simulation.simulation import Simulation

RUNS = 40
"""Runs by which restitutions are sought, unless told otherwise."""
LOW, HIGH = 0.05, 0.98
"""Restitutions between which is sought."""
_TOLD = 0.15
"""Half width of an interval with which a restitution is told."""
_FEWEST_IMPACTS = 3
GRAVITY = 9.81
"""Acceleration at which a journal is taken to fall [m/s^2]."""
_WIDER = 1.5
"""By which the second half of the runs covers more than the interval of the first."""


@dataclass(frozen=True)
class Restitution:
    """Of a joint's impacts, with 95 % interval; or why it cannot be told."""

    joint: str
    value: float
    """That impacts have, whatever law and coefficient make it."""
    half_width: float
    nominal: float
    """Coefficient with which the joint's law delivers it; nan if it cannot."""
    evidence: str
    """What tells it, in words."""
    reason: str
    """Why it cannot be told; empty if it can."""

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval within what can be."""
        return max(self.value - self.half_width, 0.0), min(self.value + self.half_width, 1.0)

    def __str__(self) -> str:
        """One line, as in the table; without the reason."""
        label = f"{self.joint} restitution"
        if self.reason:
            return f"{label:<34} {'':>12} {'-':>12}  this measurement cannot tell"
        low, high = self.interval
        line = f"{label:<34} {'':>12} {self.value:>12.4g}  {low:.4g} to {high:.4g}"
        if np.isnan(self.nominal):
            return f"{line} ({self.evidence}; the joint's law cannot deliver it)"
        nominal = "" if abs(self.nominal - self.value) < 5e-3 else f"; c_e {self.nominal:.3g}"
        return f"{line} ({self.evidence}{nominal})"


def delivered(joint: Clearance, nominal: float) -> float:
    """Restitution that impacts have with a nominal one."""
    value = joint.normal.effective_restitution(nominal)
    return nominal if value is None else float(value)


def nominal_of(joint: Clearance, value: float) -> float:
    """The nominal restitution with which the joint's law delivers a value; nan if it cannot."""
    ends = [delivered(joint, end) - value for end in (1e-3, 1.0)]
    if ends[0] * ends[1] > 0.0:
        return np.nan
    return float(brentq(lambda nominal: delivered(joint, nominal) - value, 1e-3, 1.0, xtol=1e-6))


def by_flights(mechanism: Mechanism, measured: Measurement) -> tuple[Restitution, ...]:
    """Restitution of each joint with clearance by flights.

    A force between bearing and journal counts for its joint. An accelerometer cannot tell whose
    impact it feels: it counts where one joint only has clearance.
    """
    seen = {one.joint: one for one in channels(measured)}
    names = list(mechanism.clearance)
    made = []
    for name in names:
        if not seen and any(measured.has(kind) for kind in IMPACT_KINDS):
            reason = f"{len(measured.time)} records are too few to see an impact; {WINDOW} at least"
            made.append(_untold(name, reason + ", many for each flight, are needed"))
            continue
        if not seen:
            made.append(_untold(name, _unseen(name, mechanism.clearance[name])))
            continue
        channel = seen.get(name) or (seen.get("") if len(names) == 1 else None)
        if channel is None:
            others = ", ".join(names)
            reason = f"an impact may be of any of {others}: measure '{name} reaction', give the "
            reason += "others no clearance, or compare with simulations (--restitution)"
            made.append(_untold(name, reason))
            continue
        told = flights(channel)
        if told.reason:
            made.append(_untold(name, told.reason))
            continue
        nominal = nominal_of(mechanism.clearance[name], told.value)
        evidence = f"{told.ratios} ratios of flights"
        made.append(Restitution(name, told.value, told.half_width, nominal, evidence, ""))
    return tuple(made)


def _unseen(name: str, joint: Clearance) -> str:
    """Which signal would show a joint's impacts, and how fast."""
    room = 2.0 * max(joint.clearances.values(), default=0.0)
    words = f"no signal shows impacts; an accelerometer on the tool or '{name} reaction' would"
    if room <= 0.0:
        return words
    # A journal that falls through its room and bounces three times at half its speed.
    flight = 2.0 * math.sqrt(2.0 * room / GRAVITY) * 0.5**3
    return f"{words}, with {SHORTEST / flight:.2g} records a second or more"


def _untold(joint: str, reason: str) -> Restitution:
    return Restitution(joint, np.nan, np.inf, np.nan, "", reason)


def by_simulation(
    simulation: Simulation,
    measured: Measurement,
    spreads: Mapping[str, Mapping[str, float]] | None = None,
    *,
    runs: int = RUNS,
    jobs: int = 1,
    seed: int = 0,
    progress: bool = False,
) -> tuple[Restitution, ...]:
    """Restitution of each joint with clearance by the statistics of simulated impacts.

    Args:
        simulation: of the motion and the loads that were measured, times alike, with the
            clearances and friction that are known.
        measured: an accelerometer's or forces' records.
        spreads: standard deviations of clearances and friction, by joint and name; each run has
            others.
        runs: half over all restitutions, half about what these say.
        jobs: processes.
        seed: of the runs' values and starts.
        progress: show a bar.

    Raises:
        JointplayError: too few runs; no signal that shows impacts; no motion; a run that fails.
    """
    names = list(simulation.mechanism.clearance)
    least = 2 * runs_needed(len(names))
    if runs < least:
        raise JointplayError(
            f"restitution of {len(names)} joint{'s' * (len(names) > 1)} takes at least {least} "
            f"runs, got {runs}"
        )
    hits = Instruments.of(measured).hits(measured)
    if hits < _FEWEST_IMPACTS:
        reason = f"{hits} impacts stand out of the noise; let loads turn round suddenly, or take a "
        return tuple(_untold(name, reason + "quieter or faster sensor") for name in names)
    maker = _Maker(simulation, measured, spreads or {}, seed)
    low, high = _limits(simulation.mechanism)
    with tqdm(total=runs, desc="restitution", disable=not progress, unit="run") as bar:
        values = design(runs // 2, low, high, seed)
        table = maker.run(values, jobs, bar)
        first = _fit(values, table, maker.seen, low, high)
        if first is not None:
            begin = np.maximum(low, first[0].value - _WIDER * first[0].half_width)
            end = np.minimum(high, first[0].value + _WIDER * first[0].half_width)
        else:
            begin, end = low, high
        more = design(runs - len(values), begin, end, seed + 1)
        table = np.vstack([table, maker.run(more, jobs, bar)])
        values = np.vstack([values, more])
    near = ((values >= begin) & (values <= end)).all(axis=1)
    found = _fit(values[near], table[near], maker.seen, begin, end)
    return tuple(
        _verdict(simulation.mechanism, i, found, maker, (low[i], high[i]), int(near.sum()))
        for i in range(len(names))
    )


def _limits(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """Delivered restitutions that the joints' laws can have within `LOW` to `HIGH`."""
    ends = [[delivered(one, x) for x in (LOW, HIGH)] for one in mechanism.clearance.values()]
    low, high = np.array(ends).T
    return low, high


def _fit(
    values: np.ndarray, table: np.ndarray, seen: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[Estimate, np.ndarray] | None:
    """The estimate, and which statistics it is of; None if none counts."""
    with np.errstate(invalid="ignore"):
        use = np.isfinite(seen) & np.isfinite(table).all(axis=0) & (np.ptp(table, axis=0) > 1e-9)
    if not use.any():
        return None
    made = estimate(values, table[:, use], seen[use], low, high)
    return made, np.flatnonzero(use)


def _verdict(
    mechanism: Mechanism,
    i: int,
    found: tuple[Estimate, np.ndarray] | None,
    maker: _Maker,
    limits: tuple[float, float],
    runs: int,
) -> Restitution:
    name = list(mechanism.clearance)[i]
    if found is None:
        return _untold(name, "no statistic of the impacts is there in every run")
    made, use = found
    if made.strange:
        odd = maker.names[use[made.oddest]]
        reason = f"its impacts are like those of no simulated machine ({odd} is farthest off); is "
        return _untold(name, reason + "the scenario's motion, load, clearance or noise another?")
    value, half = float(made.value[i]), float(made.half_width[i])
    if half > _TOLD:
        reason = f"its 95 % interval would be {value:.2g} +- {half:.2g}: impacts of runs with other"
        return _untold(
            name,
            f"{reason} restitutions look alike; more drops, or a faster or quieter sensor may tell",
        )
    joint = mechanism.clearance[name]
    where = f"impacts of {runs} runs"
    if "clearance" not in " ".join(maker.spreads.get(name, ())):
        where += ", clearance as in the scenario"
    if value - half < limits[0] or value + half > limits[1]:
        where += f", sought from {limits[0]:.3g} to {limits[1]:.3g}"
    return Restitution(name, value, half, nominal_of(joint, value), where, "")


class _Maker:
    """Runs with given restitutions, and the statistics of their impacts."""

    def __init__(
        self,
        simulation: Simulation,
        measured: Measurement,
        spreads: Mapping[str, Mapping[str, float]],
        seed: int,
    ) -> None:
        """Look at the measurement."""
        self._instruments = Instruments.of(measured)
        self._simulation = self._instruments.settings(simulation)
        self.spreads, self._seed = spreads, seed
        self._random = np.random.default_rng(seed)
        seen = self._instruments.statistics(measured)
        self.names, self.seen = tuple(seen), np.array(list(seen.values()))

    def run(self, values: np.ndarray, jobs: int, bar: tqdm) -> np.ndarray:
        """Statistics of runs with the given restitutions (n, p), shape (n, d)."""
        todo = [self._with(row) for row in values]
        rows = []
        if jobs == 1:
            for one in todo:
                rows.append(_statistics(one, self._instruments))
                bar.update()
        else:
            with workers.pool(min(jobs, len(todo)), "nothing was kept") as pool:
                for row in pool.map(_statistics, todo, [self._instruments] * len(todo)):
                    rows.append(row)
                    bar.update()
        return np.array([[row[name] for name in self.names] for row in rows])

    def _with(self, row: np.ndarray) -> Simulation:
        """A run with these restitutions, other values as uncertain as they are, another start."""
        self._seed += 1
        mechanism, joints = self._simulation.mechanism, {}
        for (name, joint), value in zip(mechanism.clearance.items(), row.tolist(), strict=True):
            nominal = nominal_of(joint, value)
            made = replace(joint, restitution=value if np.isnan(nominal) else nominal)
            joints[name] = drawn(made, self.spreads.get(name, {}), self._random)
        return replace(
            self._simulation, mechanism=mechanism.with_clearance(joints), seed=self._seed
        )


def _statistics(simulation: Simulation, instruments: Instruments) -> dict[str, float]:
    return instruments.statistics(instruments.look(run(simulation)))
