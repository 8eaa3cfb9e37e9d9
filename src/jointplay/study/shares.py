"""Dynamic budget: which joint's play brings about the tool's error in runs, and what it depends on.

The tool's error e(t) is its distance from the ideal mechanism's tool under the same drives. Each
source of play is simulated alone, giving e_j(t), and all together, giving e(t); parts add up to

    1 = sum_j <e_j . e> / <e . e>  +  <(e - sum_j e_j) . e> / <e . e>

averaged over time. The last term is the interaction. A part may be negative, where a joint works
against the whole. Sobol indices tell how much of the variance of the RMS error comes from which
input (Saltelli et al., Comput. Phys. Commun. 181 (2010) 259-270; SALib).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.accuracy.jacobians import GEAR
from jointplay.base.errors import (
    JointplayError,
    require_a,
    require_finite,
    require_non_negative,
    require_positive,
    require_whole,
)
from jointplay.base.tables import Column, Table, few
from jointplay.base.units import readable
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.simulation.analysis.twins import ideal_simulation, state_without_play
from jointplay.simulation.analysis.uncertainty import (
    SobolIndices,
    salib,
    sobol_indices,
    standard_error,
)
from jointplay.simulation.simulation import Simulation
from jointplay.study.axes import points
from jointplay.study.courses import (
    MOST_RUNS,
    at_speed,
    check_numbers,
    errors,
    loaded,
    seeded,
    traces,
)

RECORD_S = 1e-3
"""Interval of the records that shares are reckoned from [s]."""


@dataclass(frozen=True)
class DynamicBudget:
    """Shares of the tool's error in runs; n perturbed runs, j sources of play."""

    joints: tuple[str, ...]
    """Sources of play, gears last."""
    alone_rms: np.ndarray
    """RMS error with the play of one source only, shape (n, j) [m]."""
    alone_peak: np.ndarray
    """Its peak, shape (n, j) [m]."""
    rms: np.ndarray
    """RMS error with all play, shape (n,) [m]."""
    peak: np.ndarray
    """Its peak, shape (n,) [m]."""
    parts: np.ndarray
    """Share of each source in the mean square of the error, shape (n, j)."""
    since: float
    """Nothing before is judged [s]."""

    @property
    def interaction(self) -> np.ndarray:
        """What no source brings about alone, share of the mean square, shape (n,)."""
        return np.asarray(1.0 - self.parts.sum(axis=1))

    @property
    def sentence(self) -> str:
        mean = dict(zip(self.joints, self.parts.mean(axis=0), strict=True))
        order = sorted(mean, key=lambda name: -mean[name])
        told = few([f"{name} {100 * mean[name]:.0f} %" for name in order])
        return (
            f"Of the tool's mean square error in the simulated motion (RMS "
            f"{readable(float(self.rms.mean()), 'm', 3)}) play causes, by joint: {told}; "
            f"interaction {round(100 * float(self.interaction.mean()))} %"
        )

    @property
    def validity(self) -> str:
        runs = len(self.rms)
        known = "+- standard error" if runs > 1 else "one run each: scatter unknown"
        return (
            f"simulated, {runs} perturbed run{'s' * (runs > 1)} of each, from {self.since:g} s on "
            f"({known}); against the ideal mechanism under the same drives; numerical error not "
            "included"
        )

    @property
    def table(self) -> Table:
        shares = [*self.parts.T, self.interaction]
        several = len(self.rms) > 1
        return Table(
            (
                Column("joint", (*self.joints, "interaction")),
                Column("alone: RMS", [*self.alone_rms.mean(axis=0), None], "m", digits=4),
                Column("peak", [*self.alone_peak.max(axis=0), None], "m", digits=4),
                Column(
                    "share of the mean square",
                    [one.mean() for one in shares],
                    "1",
                    digits=4,
                    errors=[standard_error(one) for one in shares] if several else (),
                ),
            ),
            totals=(("all together", self.rms.mean(), self.peak.max(), 1.0),),
            notes=(self.validity,),
        )

    @property
    def runs(self) -> Table:
        rows: list[tuple] = []
        for run in range(len(self.rms)):
            alone = (self.alone_rms[run], self.alone_peak[run], self.parts[run])
            rows += [(run, *row) for row in zip(self.joints, *alone, strict=True)]
            rows.append((run, "interaction", None, None, self.interaction[run]))
            rows.append((run, "all", self.rms[run], self.peak[run], 1.0))
        heads = (("run", ""), ("source", ""), ("rms", "m"), ("peak", "m"), ("share", "1"))
        return Table.of(heads, rows)

    def __str__(self) -> str:
        return str(self.table)


def shares(
    simulation: Simulation,
    runs: int = 3,
    *,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> DynamicBudget:
    """Simulate each source of play alone and all together.

    Args:
        simulation: one cycle of the machine, with play.
        runs: perturbed runs of each.
        jobs, keep, progress: see `traces`.

    Raises:
        JointplayError: no play, no motion, a run that fails.
    """
    require_a("simulation", simulation, "Simulation")
    check_numbers(runs, jobs)
    base = _coarser(simulation)
    names = _sources(base)
    if not names:
        raise JointplayError("no joint or gear has play: there is no error to share")
    whole = seeded(base, runs)
    alike = [seeded(_only(base, name), runs) for name in names]
    single = [one for same_seed in zip(*alike, strict=True) for one in same_seed]
    courses = traces(
        [ideal_simulation(base), *whole, *single], jobs=jobs, keep=keep, progress=progress
    )
    since = whole[0].judged_from
    error = errors(courses[1:], courses[0])[:, courses[0].time >= since]
    together = error[:runs]
    alone = error[runs:].reshape(runs, len(names), *error.shape[1:])
    mean = (together**2).sum(axis=(1, 2))
    shared = np.einsum("rjti,rti->rj", alone, together)
    parts = np.divide(shared, mean[:, None], out=np.zeros_like(shared), where=mean[:, None] > 0.0)
    sizes, each = np.linalg.norm(together, axis=2), np.linalg.norm(alone, axis=3)
    return DynamicBudget(
        tuple(names),
        np.sqrt((each**2).mean(axis=2)),
        each.max(axis=2),
        np.sqrt((sizes**2).mean(axis=1)),
        sizes.max(axis=1),
        parts,
        since,
    )


def _coarser(simulation: Simulation) -> Simulation:
    """The simulation with no more records than shares need."""
    if simulation.motion is None:
        raise JointplayError("nothing moves: the simulation has no motion")
    every = max(simulation.record_every, round(RECORD_S / simulation.step))
    return replace(simulation, record_every=every)


def _sources(simulation: Simulation) -> list[str]:
    joints = simulation.mechanism.clearance.items()
    names = [name for name, joint in joints if not getattr(joint, "ideal", False)]
    return names + [name + GEAR for name in simulation.mechanism.gears]


def _only(simulation: Simulation, source: str) -> Simulation:
    """The simulation with the play of one source; states of other journals are dropped."""
    mechanism = simulation.mechanism
    joints = dict(mechanism.ideal().clearance)
    if source in mechanism.clearance:
        joints[source] = mechanism.clearance[source]
    gears = {name: gear for name, gear in mechanism.gears.items() if name + GEAR == source}
    own = [c for c in mechanism.coordinates if c.part and (c.joint == source or c.joint in gears)]
    state: dict[str, Any] = {**state_without_play(simulation)}
    state |= {name: at for name, at in simulation.state.items() if name in own}
    return replace(simulation, mechanism=mechanism.with_clearance(joints, gears), state=state)


@dataclass(frozen=True)
class Sensitivity(SobolIndices):
    """Sobol indices of the tool's RMS error."""

    ranges: tuple[tuple[float, float], ...]
    """Between which inputs vary; clearances, friction and speed relative, payload [kg]."""
    rms: np.ndarray
    """RMS error of the tool in each run [m]."""

    @property
    def table(self) -> Table:
        wide = max(self.first_confidence.max(), self.total_confidence.max()) > _WIDE
        inputs, *indices = self.columns
        ranges = Column("range", [f"{low:g} to {high:g}" for low, high in self.ranges])
        return Table(
            (inputs, ranges, *indices),
            notes=(
                f"statistical, from {len(self.rms)} simulated runs: RMS error "
                f"{1e3 * self.rms.min():.4g} to {1e3 * self.rms.max():.4g} mm; +- 95 % "
                "confidence of the indices by resampling",
                *(["the intervals are wide: use more samples (--sobol)"] if wide else []),
            ),
        )

    def __str__(self) -> str:
        return str(self.table)


_WIDE = 0.3


def sensitivity(
    simulation: Simulation,
    samples: int = 16,
    *,
    spread: float = 2.0,
    slowest: float = 0.7,
    payload: float = 0.0,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> Sensitivity:
    """Sobol indices of the tool's RMS error over clearances, friction, speed and payload.

    Args:
        simulation: one cycle of the machine, with play.
        samples: n, a power of two; n (d + 2) runs are done for d inputs.
        spread: each clearance and all friction vary between 1/spread and spread times their values,
            evenly in their logarithms.
        slowest: speed varies between this part of the motion's and the whole; 1: it does not.
        payload: largest mass at the tool, from zero on [kg]; 0: none.
        jobs, keep, progress: see `shares`.

    Raises:
        JointplayError: no play, no motion, a value out of range, SALib missing, a run that fails.
    """
    check(samples, spread, slowest, payload)
    base = _coarser(simulation)
    inputs = _inputs(base, spread, slowest, payload)
    salib()  # before anything runs
    work = []
    for point in points("saltelli", samples, len(inputs), seed=0):
        one = base
        for (low, high, change), x in zip(inputs.values(), point, strict=True):
            one = change(one, low * (high / low) ** x if low > 0.0 else low + x * (high - low))
        work += [ideal_simulation(one), *seeded(one, 1)]
    courses = traces(work, jobs=jobs, keep=keep, progress=progress)
    runs = zip(courses[::2], courses[1::2], work[1::2], strict=True)
    judged = [errors([run], ideal)[:, ideal.time >= one.judged_from] for ideal, run, one in runs]
    rms = np.array([math.sqrt((part**2).sum(axis=2).mean()) for part in judged])
    ranges = tuple((low, high) for low, high, _ in inputs.values())
    return Sensitivity(**vars(sobol_indices(rms, tuple(inputs))), ranges=ranges, rms=rms)


def check(samples: int | None, spread: float, slowest: float, payload: float) -> None:
    """Raise a JointplayError on numbers with which there is no `sensitivity`; None: not asked."""
    if samples is not None and (require_whole("samples", samples, 2, MOST_RUNS) & (samples - 1)):
        raise JointplayError(f"samples must be a power of two, 2 or more, got {samples!r}")
    require_positive("spread - 1", require_finite("spread", spread, "") - 1.0, "")
    if not 0.0 < require_finite("the slowest speed", slowest, "") <= 1.0:
        raise JointplayError(f"the slowest speed must be in (0, 1], got {slowest:g}")
    require_non_negative("the payload", payload, "kg")


Change = Callable[[Simulation, float], Simulation]


def _inputs(
    base: Simulation, spread: float, slowest: float, payload: float
) -> dict[str, tuple[float, float, Change]]:
    """What varies, by name: its range, and how a simulation takes a value."""
    joints = {
        name: joint
        for name, joint in base.mechanism.clearance.items()
        if not getattr(joint, "ideal", False)
        and joint.clearances
        and not (isinstance(joint, RollingBearing) and joint.preloaded)
    }
    if not joints:
        raise JointplayError(
            "no joint has clearance that could vary (preloaded bearings have none)"
        )
    low = 1.0 / spread
    inputs: dict[str, tuple[float, float, Change]] = {
        f"clearance {name}": (low, spread, partial(_changed, lambda one, x: one.scaled(x), (name,)))
        for name in joints
    }
    if any(any(joint.friction.coefficients.values()) for joint in joints.values()):
        inputs["friction of the bearings"] = low, spread, partial(_changed, _rougher, None)
    if slowest < 1.0:
        inputs["speed"] = slowest, 1.0, at_speed
    if payload > 0.0:
        inputs["payload [kg]"] = 0.0, payload, loaded
    return inputs


def _rougher(joint: Clearance, factor: float) -> Clearance:
    return joint.with_friction(joint.friction.scaled(factor))


def _changed(
    change: Callable[[Any, float], Any], names: Sequence[str] | None, one: Simulation, factor: float
) -> Simulation:
    joints = dict(one.mechanism.clearance)
    joints |= {name: change(joints[name], factor) for name in names or joints}
    return replace(one, mechanism=one.mechanism.with_clearance(joints))
