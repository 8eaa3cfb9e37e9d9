"""Figures of the audit that histories tell, gathered portion by portion while they pass."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jointplay.kernel.integrators import integrator
from jointplay.kernel.layout import FRICTION
from jointplay.kernel.workspace import Workspace
from jointplay.loads.limits import beyond, worst
from jointplay.mechanism.impact import friction_step_limit, tooth_duration
from jointplay.mechanism.mechanism import Mechanism
from jointplay.result.audit import NOTHING_EXCHANGED, Audit, Judgement, out_of_range
from jointplay.result.records import Records

PORTION = 4096
"""Records of a portion.

Sums are over portions, so that it makes no difference how many of them are in memory at once: what
passes at a time must begin at a multiple of this.
"""


MOST_WORST = 64
"""Portions whose worst records are kept apart."""


class Auditor:
    """Watches the histories of a run pass.

    Args:
        mechanism: what was simulated.
        simulation: the whole simulation as plain data.
        judged_from: when judging begins [s].
    """

    def __init__(
        self, mechanism: Mechanism, simulation: Mapping[str, Any], judged_from: float
    ) -> None:
        """Nothing has passed yet."""
        self._mechanism, self._simulation = mechanism, simulation
        self._judged_from = judged_from
        self._start: np.ndarray | None = None
        self._last: np.ndarray | None = None
        self._variations: Any = 0.0
        self._kinetic = self._residual = self._drift = self._fed = 0.0
        self._rubbed = -math.inf
        self._peaks = np.zeros(len(mechanism.clearance))
        self._late = self._early = 0.0
        self._twists = dict.fromkeys(mechanism.gears, 0.0)
        self._worst: list[tuple[np.ndarray, ...]] = []

    def watch(
        self,
        records: Records,
        energies: Sequence[np.ndarray],
        work: np.ndarray,
        residual: np.ndarray,
        drift: np.ndarray,
        effort: np.ndarray,
    ) -> None:
        """Look at the next histories.

        Args:
            records: the next records.
            energies: kinetic and potential [J].
            work: of all that does work (n, forces) [J].
            residual: of the energy balance [J].
            drift: of ideal loops (n, loops) [m].
            effort: of drives and controllers (n, nv).
        """
        for begin in range(0, records.rows, PORTION):
            at = slice(begin, begin + PORTION)
            self._look(
                records.part(begin, begin + PORTION),
                [values[at] for values in energies],
                work[at],
                residual[at],
                drift[at] if len(drift) else drift,
                effort[at],
            )

    def _look(
        self,
        records: Records,
        energies: Sequence[np.ndarray],
        work: np.ndarray,
        residual: np.ndarray,
        drift: np.ndarray,
        effort: np.ndarray,
    ) -> None:
        q = records.recorded("q")
        if self._start is None:
            self._start = q[0].copy()
        moved = np.column_stack([*energies, work])
        before = moved[:1] if self._last is None else self._last
        self._variations += np.abs(np.diff(np.vstack([before, moved]), axis=0)).sum(axis=0)
        self._last = moved[-1:].copy()
        self._kinetic = _larger(self._kinetic, energies[0])
        self._residual = _larger(self._residual, np.abs(residual))
        self._drift = _larger(self._drift, drift)
        rubbed = np.maximum.accumulate(np.concatenate([[self._rubbed], work[:, FRICTION]]))
        self._fed = _larger(self._fed, rubbed[1:] - work[:, FRICTION])
        self._rubbed = float(rubbed[-1])
        self._forces(records)
        for name in self._twists:
            motor, link = self._mechanism.motor(name), self._mechanism.coordinate(name)
            self._twists[name] = _larger(self._twists[name], np.abs(q[:, motor] - q[:, link]))
        if self._simulation["limits"] != "ignore":
            time, v = records.recorded("time")[:, 0], records.recorded("v")
            self._worst.append(self._of_worst(time, q, v, effort))
            if len(self._worst) > MOST_WORST:  # memory must not grow with the length of a run
                self._worst = [self._of_worst(*map(np.concatenate, zip(*self._worst, strict=True)))]

    def _of_worst(
        self, time: np.ndarray, q: np.ndarray, v: np.ndarray, effort: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """The records that say all about limits."""
        rows = worst(self._mechanism, q, v, effort)
        return time[rows], q[rows], v[rows], effort[rows]

    def _forces(self, records: Records) -> None:
        if not len(self._peaks):
            return
        peaks = records.recorded("normal_peak").reshape(records.rows, -1, records.width)
        self._peaks = np.maximum(self._peaks, peaks.max(axis=(0, 2)))
        vectors = records.recorded("force_peak").reshape(records.rows, -1, 3)
        sizes = np.linalg.norm(vectors, axis=2).max(axis=1)
        late = records.recorded("time")[:, 0] >= self._judged_from
        self._late = _larger(self._late, sizes[late])
        self._early = _larger(self._early, sizes[~late])

    def audit(self, workspace: Workspace, judgement: Judgement) -> Audit:
        """What it comes to, with what the kernels counted in `workspace`."""
        mechanism, simulation = self._mechanism, self._simulation
        statistics = workspace.contact_statistics()
        shortest = float(np.min(statistics["shortest_steps"], initial=np.inf))
        impulse = float(statistics["impulse"].sum())
        depth, relative = 0.0, 0.0
        for name, gaps in zip(mechanism.clearance, statistics["smallest_gap"], strict=True):
            for gap, room in zip(gaps, mechanism.clearance[name].rooms, strict=False):
                depth, relative = max(depth, -gap), max(relative, -gap / room)
        moved = np.max(self._variations, initial=0.0)
        return Audit(
            energy_residual=self._residual,
            energy_exchanged=max(float(moved), NOTHING_EXCHANGED * self._kinetic),
            impacts=int(statistics["onsets"].sum()),
            shortest_contact_steps=int(shortest) if math.isfinite(shortest) else 0,
            under_resolved=int(statistics["under_resolved"].sum()),
            under_resolved_impulse=float(statistics["under_resolved_impulse"].sum()) / impulse
            if impulse
            else 0.0,
            normal_impulse=impulse,
            largest_penetration=float(depth),
            penetration_over_clearance=float(relative),
            step=float(simulation["step"]),
            friction_step_limit=self._friction_step_limit(),
            unsolved=int(workspace.run["unsolved"][0]),
            unresolved=workspace.unresolved,
            friction_fed=self._fed,
            tooth_steps=self._tooth_steps(),
            loop_drift=self._drift,
            law_warnings=out_of_range(mechanism, statistics),
            limit_warnings=self._beyond_limits(),
            **self._judged(statistics, judgement),
        )

    def _friction_step_limit(self) -> float:
        limit = math.inf
        explicit = integrator(self._simulation["integrator"]).single_rate
        if explicit and self._start is not None:
            for name, force in zip(self._mechanism.clearance, self._peaks, strict=True):
                step = friction_step_limit(self._mechanism, name, self._start, float(force))
                limit = min(limit, step)
        return limit

    def _tooth_steps(self) -> float:
        """See `Audit.tooth_steps`."""
        steps = math.inf
        if self._start is None or self._simulation["tolerance"] is not None:
            return steps
        for name, gear in self._mechanism.gears.items():
            if self._twists[name] > gear.play / 2.0:
                duration = tooth_duration(self._mechanism, name, self._start)
                steps = min(steps, duration / float(self._simulation["step"]))
        return steps

    def _beyond_limits(self) -> tuple[str, ...]:
        if not self._worst:
            return ()
        return beyond(self._mechanism, *map(np.concatenate, zip(*self._worst, strict=True)))

    def _judged(self, statistics: Mapping[str, np.ndarray], judgement: Judgement) -> dict[str, Any]:
        """Headlines of the part of a run that is judged."""
        before = judgement.before or {name: np.zeros(1) for name in ("onsets", "impulse")}
        headlines: dict[str, Any] = {
            "start": judgement.start,
            "start_residual": judgement.residual,
            "start_load": judgement.load,
            "judged_from": judgement.judged_from,
            "judged_impacts": int((statistics["onsets"] - before["onsets"]).sum()),
            "judged_impulse": float((statistics["impulse"] - before["impulse"]).sum()),
        }
        if self._mechanism.clearance:
            headlines["peak_force"] = self._late
            if judgement.judged_from > 0.0:
                headlines["peak_force_before"] = self._early
        return headlines


def _larger(before: float, values: np.ndarray) -> float:
    """The largest of all; not a number if one of them is not."""
    return float(np.maximum(before, values.max(initial=0.0)))
