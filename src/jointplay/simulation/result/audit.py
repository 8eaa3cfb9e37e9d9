"""The audit of a run: energy balance, resolution of impacts, penetration, convergence, limits.

`Auditor` collects the figures portion by portion while histories are made; `Audit` holds them and
says what they mean, each warning with its remedy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base.schema import Described, quantity
from jointplay.base.units import readable
from jointplay.model.impact import friction_step_limit, tooth_duration
from jointplay.model.mechanism import Mechanism
from jointplay.physics.contact import ContactProperties
from jointplay.physics.kernel import WELL_RESOLVED_STEPS
from jointplay.physics.kernel.constants import DEFAULT, integrator
from jointplay.physics.kernel.layout import FRICTION
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation.loads.limits import beyond, worst
from jointplay.simulation.result.certificate import UNKNOWN_DIGITS, Certificate, alone, shown
from jointplay.simulation.result.variables import Records

if TYPE_CHECKING:
    from jointplay.simulation.statics import Rest

DRIFT_WARNING_M = 1e-6
"""Gap of an ideal loop above which a run warns [m]."""
NOTHING_EXCHANGED = 1e-6
"""Least energy exchanged, relative to the largest kinetic and elastic energy."""
SPEED_NOISE = 1e-9
"""Speed of one kilogram below the resolution of the velocity solve (`solve.TOLERANCE`) [m/s]."""
ENERGY_WARNING = 0.01
"""Relative energy residual above which a run warns."""
UNDER_RESOLVED_WARNING = 1e-3
"""Share of the normal impulse in contacts of too few steps above which a run warns."""
STEP_WARNING = 0.01
"""Error by the step, relative to the motion, above which a run warns."""
DEEP_WARNING = 0.5
"""Penetration over clearance above which a run warns: judged, far beyond what contact laws are for.
"""
FEW_UNSOLVED = 10
"""Number of steps whose velocity solve may stop short of its tolerance before a run warns: a first
step from rest, or a corner of a friction law hit exactly."""
IMPULSE_WARNING = 0.01
"""Part of a joint's impulse that its recorded forces may miss before a run warns."""
FED_WARNING = 0.01
"""Energy that friction may give back, relative to the energy exchanged, before a run warns."""


_figure = partial(quantity, finite=False)
"""A field for a number that may be infinite or NaN, as in a run that went wrong."""


@dataclass(frozen=True, kw_only=True)
class Audit(Described):
    """Figures by which to judge the quality of a run."""

    energy_residual: float = _figure("J")
    """Largest error of the energy balance [J]."""
    energy_exchanged: float = _figure("J")
    """Energy exchanged in the run: the largest total variation of the kinetic energy, the potential
    energy, or any force's work [J].

    It is at least a millionth of the kinetic energy and of what springs and contacts store, and the
    work of the largest joint force at `SPEED_NOISE`: rounding is not worth a warning.
    """
    impacts: int
    """Number of contacts that began, at all places of all joints."""
    shortest_contact_steps: int
    """Steps of the shortest contact that ended; 0 if none did."""
    under_resolved: int
    """Number of contacts that lasted fewer than 10 steps."""
    under_resolved_impulse: float = _figure("")
    """Share of these contacts in the normal impulse, 0 to 1."""
    normal_impulse: float = _figure("N*s")
    """Normal impulse of all contacts together [N s]."""
    largest_penetration: float = _figure("m")
    """Deepest overlap of surfaces [m]."""
    penetration_over_clearance: float = _figure("")
    """Largest penetration relative to the clearance of its direction."""
    step: float = _figure("s")
    """Time step [s]."""
    friction_step_limit: float = _figure("s")
    """Largest step that follows friction under the largest normal force [s]."""
    unsolved: int = 0
    """Number of steps whose velocity solve did not converge."""
    unresolved: int = 0
    """Number of micro steps of the shortest length that missed the tolerance."""
    impulse_missed: float = _figure("", default=0.0)
    """Largest part of a joint's impulse that its recorded forces miss; see `Auditor`.

    The impulse is that of all steps, which is what changed the momentum. Forces that alternate from
    step to step stand in the records with one of their sides only.
    """
    friction_fed: float = _figure("J", default=0.0)
    """Largest fall of the energy that friction has taken up, which bristles gave back [J]."""
    step_error: float | None = _figure("m", default=None)
    """Estimated largest error of the tool's position because of the step [m]; see `step_check`.

    None where it is not checked, or the check was given up.
    """
    relative_step_error: float | None = _figure("", default=None)
    """Estimated error of all coordinates but motors because of the step, in the norm of the mass
    matrix, relative to their motion."""
    tooth_steps: float = _figure("", default=math.inf)
    """Fewest steps in an impact of gear teeth that touched; inf without any.

    Also inf where steps are chosen by a tolerance.
    """
    loop_drift: float = _figure("m", default=0.0)
    """Largest gap of a loop without clearance [m]."""
    start: str = "centred"
    """Where journals began: ``rest`` or ``centred``."""
    start_residual: float | None = _figure("N", default=None)
    """Largest force that the search for equilibrium left unbalanced [N]; inf if it diverged; None
    without a search."""
    start_load: float | None = _figure("N", default=None)
    """Largest force of a joint at that equilibrium [N]."""
    judged_from: float = _figure("s", default=0.0)
    """Time from which figures are judged [s]."""
    judged_impacts: int = 0
    """Number of contacts that began from then on; contacts that touch at the start do not count."""
    judged_impulse: float = _figure("N*s", default=0.0)
    """Normal impulse from then on, that of lasting contacts included [N s]."""
    peak_force: float | None = _figure("N", default=None)
    """Largest force of a joint from then on [N]; None without clearance."""
    peak_force_before: float | None = _figure("N", default=None)
    """Largest force of a joint before [N]; None if all is judged."""
    law_warnings: tuple[str, ...] = ()
    """Uses of normal-force and film laws beyond their range, in words; see `out_of_range`."""
    limit_warnings: tuple[str, ...] = ()
    """Excesses over the URDF's limits of joints, in words; see `loads.limits`."""

    @property
    def relative_energy_residual(self) -> float:
        """Energy residual over energy exchanged; 0 if nothing moved."""
        if self.energy_exchanged == 0.0:
            return 0.0 if self.energy_residual == 0.0 else math.inf
        return self.energy_residual / self.energy_exchanged

    @property
    def warnings(self) -> list[str]:
        """Warnings for the user, each with its remedy."""
        worries = []
        if self.start != "rest" and self.start_residual is not None:
            worries.append(f"the run starts centred, and falls into contact: {self._not_at_rest}")
        if not self.relative_energy_residual <= ENERGY_WARNING:
            worries.append(
                f"the energy balance is off by {100 * self.relative_energy_residual:.2g} % of the "
                "energy exchanged: reduce the step"
            )
        if self.under_resolved_impulse > UNDER_RESOLVED_WARNING:
            worries.append(
                f"{self.under_resolved} of {self.impacts} contacts lasted fewer than "
                f"{WELL_RESOLVED_STEPS} steps (shortest {self.shortest_contact_steps}; "
                f"{100 * self.under_resolved_impulse:.2g} % of the impulse): reduce the step"
            )
        if self.penetration_over_clearance > DEEP_WARNING:
            worries.append(
                f"the journal sank in by {self.largest_penetration:.3g} m, "
                f"{100 * self.penetration_over_clearance:.0f} % of its clearance: the contact is "
                "too soft for this load"
            )
        if self.step > self.friction_step_limit:
            worries.append(
                f"the explicit step of {self.step:.3g} s does not follow friction under the "
                f"largest normal force, which requires {self.friction_step_limit:.3g} s: forces "
                "of a jammed journal may be off by tens of per cent; take the integrator "
                f"{DEFAULT!r}, which does"
            )
        if self.unsolved > FEW_UNSOLVED:
            worries.append(
                f"the velocity equations of {self.unsolved} steps did not converge: friction "
                "falls too steeply with speed for this step; reduce it"
            )
        if self.unresolved:
            worries.append(
                f"{self.unresolved} of the shortest micro steps did not reach the tolerance: "
                "raise it"
            )
        if self.impulse_missed > IMPULSE_WARNING:
            worries.append(
                f"the recorded forces of a joint miss {100 * self.impulse_missed:.2g} % of its "
                "impulse: they alternate from step to step, and records show one side; reduce the "
                "step, or set record_every to 1"
            )
        if self.friction_fed > FED_WARNING * self.energy_exchanged:
            worries.append(
                f"friction returned {self.friction_fed:.3g} J: its bristles are not passive with "
                "these parameters (docs/laws.md)"
            )
        if self.relative_step_error is not None and not self.relative_step_error <= STEP_WARNING:
            worries.append(self._step_too_large())
        if self.relative_step_error is None and self.tooth_steps < WELL_RESOLVED_STEPS:
            worries.append(
                f"impacts of gear teeth last {self.tooth_steps:.2g} steps, fewer than "
                f"{WELL_RESOLVED_STEPS}: reduce the step"
            )
        if self.loop_drift > DRIFT_WARNING_M:
            worries.append(
                f"ideal loops drifted apart by {self.loop_drift:.2g} m: reduce the step, or use rk4"
            )
        return worries + list(self.law_warnings) + list(self.limit_warnings)

    @property
    def _residual(self) -> str:
        load = alone(self.start_load or 0.0)
        return f"(residual force {self.start_residual:.1g} N of {load} N)"

    @property
    def _not_at_rest(self) -> str:
        """Why a run that should start at rest does not."""
        if self.start_residual == math.inf:
            return "the search for an equilibrium diverged"
        return f"no equilibrium was found {self._residual}"

    def headline_with(self, certificate: Certificate | None) -> str:
        """How the run began, its largest force, and from when on that is judged, in a line.

        The force has its numerical error if a certificate has it.
        """
        began = f"starts {'at rest' if self.start == 'rest' else 'centred'}"
        if self.start_residual is not None:
            balanced = self.start == "rest"
            began += f" {self._residual}" if balanced else f", because {self._not_at_rest}"
        if self.peak_force is None:
            return began
        known = certificate.headline if certificate else ()
        # The force may be that of a flexible link's hinge, for which no figure is certified.
        same = (
            figure.name
            for figure in known
            if figure.name.startswith("peak joint force")
            and math.isclose(figure.value, self.peak_force, rel_tol=1e-6)
        )
        peak = shown(certificate, next(same, ""), self.peak_force, "N")
        if not self.judged_from:
            falling = ", with the fall of the journals" if self.start == "centred" else ""
            return f"{began}; largest joint force {peak}, judged from the start{falling}"
        return (
            f"{began}; from {self.judged_from:g} s on, {self.judged_impacts} contacts began, "
            f"largest joint force {peak} (before: {alone(self.peak_force_before or 0.0)} N)"
        )

    def _step_too_large(self) -> str:
        relative = self.relative_step_error
        if relative is None or not math.isfinite(relative):
            return "with half the step the run ends differently: reduce the step"
        tool = (
            "" if self.step_error is None else f"the tool is off by about {self.step_error:.2g} m, "
        )
        return (
            f"half the step gives different results: {tool}all coordinates by "
            f"{100 * relative:.2g} % of how far they move: reduce the step"
        )

    def __str__(self) -> str:
        return self.text()

    def text(self, certificate: Certificate | None = None) -> str:
        """The audit in lines, with numerical errors if a certificate has them."""
        percent = 100 * self.relative_energy_residual
        lines = [
            f"  energy residual: {_readable(self.energy_residual, 'J')}, "
            f"{percent:.2g} % of {_readable(self.energy_exchanged, 'J')} exchanged"
        ]
        if self.impacts:
            steps = self.shortest_contact_steps
            shortest = f"shortest {steps} steps" if steps else "none ended"
            deepest = f"  largest penetration: {_readable(self.largest_penetration, 'm')}, "
            deepest += f"{100 * self.penetration_over_clearance:.2g} % of the clearance"
            if not self.penetration_over_clearance:  # rolling elements alone, without clearance
                depth = _readable(self.largest_penetration, "m")
                deepest = f"  largest deflection of an element: {depth}"
            lines += [
                f"  contacts: {self.impacts}, {shortest}, "
                f"{self.under_resolved} under {WELL_RESOLVED_STEPS} steps",
                deepest,
            ]
        if self.peak_force is not None:
            lines.append(f"  {self.headline_with(certificate)}")
        if self.step_error is not None and self.relative_step_error is not None:
            lines.append(
                f"  error by the step: tool {readable(self.step_error, 'm', 2)}, "
                f"{100 * self.relative_step_error:.2g} % of the motion"
            )
        if self.loop_drift:
            lines.append(f"  drift of ideal loops: {_readable(self.loop_drift, 'm')}")
        return "\n".join(lines + [f"  warning: {text}" for text in self.warnings])


def _readable(value: float, unit: str) -> str:
    """A figure whose error is unknown, with its unit."""
    return readable(value, unit, UNKNOWN_DIGITS)


def out_of_range(mechanism: Mechanism, statistics: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Where a run left the range of its normal-force and film laws, a line each.

    By the deepest penetration and the fastest approach of each contact that began.
    """
    lines: dict[str, None] = {}  # an ordered set
    for j, (name, joint) in enumerate(mechanism.clearance.items()):
        extremes: dict[ContactProperties, tuple[float, float]] = {}
        for k in range(len(joint.contacts)):
            if statistics["onsets"][j, k]:
                contact = joint.contact_properties(k)
                depth, speed = extremes.get(contact, (0.0, 0.0))
                depth = max(depth, -float(statistics["smallest_gap"][j, k]))
                speed = max(speed, float(statistics["fastest_approach"][j, k]))
                extremes[contact] = depth, speed
        for contact, (depth, speed) in extremes.items():
            for text in joint.normal.warnings(contact, max_depth=depth, max_speed=speed):
                lines[f"joint {name!r}: {text}"] = None
        if joint.film is not None:
            law, film = joint.film
            thinnest = float(statistics["smallest_gap"][j, : film.contacts].min())
            for text in law.warnings(film, thinnest=thinnest):
                lines[f"joint {name!r}: {text}"] = None
    return tuple(lines)


# Collecting the figures, portion by portion.


PORTION = 4096
"""Number of records in a portion.

Sums are over portions, so that it makes no difference how many of them are in memory at once:
records that are added together must begin at a multiple of this.
"""


MISSED = 5.0
"""Standard errors by which the impulse of a joint's records must miss that of all steps to count.

Between two records a force is unknown by no more than it is seen to vary there, its peak included;
over many intervals these errors add up as independent ones do, unless records and force keep step.
"""
MOST_WORST = 64
"""Number of portions whose worst records are kept apart."""


class Auditor:
    """Collects the audit figures of a run from its histories.

    Args:
        mechanism: the run's.
        simulation: the whole simulation as plain data.
        judged_from: time from which figures are judged [s].
    """

    def __init__(
        self, mechanism: Mechanism, simulation: Mapping[str, Any], judged_from: float
    ) -> None:
        self._mechanism, self._simulation = mechanism, simulation
        self._judged_from = judged_from
        self._start: np.ndarray | None = None
        """Coordinates of the first record."""
        # Energies: total variations, the largest stored, and what friction has taken up.
        self._last: np.ndarray | None = None
        self._variations: Any = 0.0
        self._stored = self._residual = self._drift = self._friction_returned = 0.0
        self._friction_work = -math.inf
        # Forces: normal peaks by joint, the largest of a joint, and impulses of the records.
        self._peaks = np.zeros(len(mechanism.clearance))
        self._peak = self._peak_before = 0.0
        self._before: tuple[np.ndarray, np.ndarray] | None = None
        """Time and forces of the last record."""
        self._impulse: Any = 0.0
        """Integral of each joint's force, (nj, 3) [N s]."""
        self._pressed: Any = 0.0
        """Integral of its magnitude, (nj,) [N s]."""
        self._unknown: Any = 0.0
        """Variance of the impulse, because forces are unknown between records, (nj,) [N^2 s^2]."""
        self._twists = dict.fromkeys(mechanism.gears, 0.0)
        """Largest twist of each gear [rad or m]."""
        self._worst: list[tuple[np.ndarray, ...]] = []
        """Times, coordinates, velocities and efforts of records that decide `loads.limits`."""

    def add_records(
        self,
        records: Records,
        state: Sequence[np.ndarray],
        energies: Sequence[np.ndarray],
        work: np.ndarray,
        residual: np.ndarray,
        drift: np.ndarray,
        effort: np.ndarray,
        elastic: np.ndarray,
    ) -> None:
        """Add the next records, and histories made of them.

        Args:
            records: the next records.
            state: q and v, (n, nv) each.
            energies: kinetic and potential energy [J].
            work: work of each kind of force (n, forces) [J].
            residual: residual of the energy balance [J].
            drift: gaps of ideal loops (n, loops) [m].
            effort: efforts of drives and controllers (n, nv).
            elastic: energy stored in contacts, gears and loads [J].
        """
        if not 0 < records.rows <= PORTION:
            for begin in range(0, records.rows, PORTION):
                at = slice(begin, begin + PORTION)
                arrays = (values[at] for values in (work, residual, drift, effort, elastic))
                part = records.part(begin, begin + PORTION)
                motion, energy = ([values[at] for values in two] for two in (state, energies))
                self.add_records(part, motion, energy, *arrays)
            return
        q, v = state
        if self._start is None:
            self._start = q[0].copy()
        moved = np.column_stack([*energies, work])
        before = moved[:1] if self._last is None else self._last
        self._variations += np.abs(np.diff(np.vstack([before, moved]), axis=0)).sum(axis=0)
        self._last = moved[-1:].copy()
        self._stored = _larger(self._stored, energies[0] + elastic)
        self._residual = _larger(self._residual, np.abs(residual))
        self._drift = _larger(self._drift, drift)
        largest = np.maximum.accumulate(np.concatenate([[self._friction_work], work[:, FRICTION]]))
        self._friction_returned = _larger(self._friction_returned, largest[1:] - work[:, FRICTION])
        self._friction_work = float(largest[-1])
        self._add_forces(records)
        for name in self._twists:
            motor, link = self._mechanism.motor(name), self._mechanism.coordinate(name)
            twist = self._mechanism.gears[name].twist(q[:, motor], q[:, link])
            self._twists[name] = _larger(self._twists[name], np.abs(twist))
        if self._simulation["limits"] != "ignore":
            time = records.recorded("time")
            rows = worst(self._mechanism, q, v, effort)
            self._worst.append((time[rows], q[rows], v[rows], effort[rows]))
            if len(self._worst) > MOST_WORST:  # memory must not grow with the length of a run
                time, q, v, effort = self._worst_records()
                rows = worst(self._mechanism, q, v, effort)
                self._worst = [(time[rows], q[rows], v[rows], effort[rows])]

    def _worst_records(self) -> list[np.ndarray]:
        """The arrays of `_worst`, each of all portions together."""
        return [np.concatenate(parts) for parts in zip(*self._worst, strict=True)]

    def _add_forces(self, records: Records) -> None:
        """Add the largest forces, and impulses by the trapezium rule with their uncertainty."""
        if not len(self._peaks):
            return
        self._peaks = np.maximum(self._peaks, records.recorded("normal_peak").max(axis=(0, 2)))
        peaks = records.recorded("force_peak")
        sizes = lengths(peaks).max(axis=1)
        time, force = records.recorded("time"), records.recorded("force")
        late = time >= self._judged_from
        self._peak = _larger(self._peak, sizes[late])
        self._peak_before = _larger(self._peak_before, sizes[~late])
        if self._before is not None:
            time = np.concatenate([self._before[0], time])
            force = np.concatenate([self._before[1], force])
            peaks = np.concatenate([peaks[:1], peaks])
        self._before = time[-1:].copy(), force[-1:].copy()
        interval, begin, end, peak = np.diff(time)[:, None], force[:-1], force[1:], peaks[1:]
        self._impulse += 0.5 * (interval[..., None] * (begin + end)).sum(axis=0)
        sizes = lengths(force)
        self._pressed += 0.5 * (interval * (sizes[:-1] + sizes[1:])).sum(axis=0)
        # Within an interval the force varies by no more than between its ends and its peak.
        widest = np.maximum(lengths(begin - end), lengths(begin - peak))
        widest = np.maximum(widest, lengths(end - peak))
        self._unknown += ((interval * widest) ** 2).sum(axis=0)

    def audit(
        self, workspace: Workspace, rest: Rest | None, unjudged: Mapping[str, np.ndarray] | None
    ) -> Audit:
        """The figures of a run at its end.

        Args:
            workspace: the run's.
            rest: where the search for equilibrium ended; None: there was none.
            unjudged: contact statistics when judging began; None: it never did.
        """
        mechanism, simulation = self._mechanism, self._simulation
        statistics = workspace.contact_statistics()
        shortest = float(np.min(statistics["shortest_steps"], initial=np.inf))
        impulse = float(statistics["impulse"].sum())
        poorly = float(statistics["under_resolved_impulse"].sum())
        depth, relative = 0.0, 0.0
        joints = mechanism.clearance.values()
        for joint, gaps in zip(joints, statistics["smallest_gap"], strict=True):
            if joint.springs is not None:  # they give way, and nothing penetrates
                continue
            for gap, room in zip(gaps, joint.contact_clearances, strict=False):
                depth = max(depth, -gap)
                if joint.resultant is None:  # elements give way by more than they are free
                    relative = max(relative, -gap / room)
        moved = np.max(self._variations, initial=0.0)
        seconds = 0.0 if self._before is None else float(self._before[0][-1])
        noise = max(self._peak, self._peak_before) * SPEED_NOISE * seconds
        before = unjudged or {name: np.zeros(1) for name in ("onsets", "impulse")}
        # What touches where a run begins, as all springs do, need not have had an onset.
        onsets = np.maximum(statistics["onsets"] - before["onsets"], 0.0)
        late = self._judged_from > 0.0
        residual, load = (rest.residual, rest.load) if rest else (None, None)
        if rest and not rest.inside:  # where it ended says nothing
            residual = load = math.inf
        return Audit(
            energy_residual=self._residual,
            energy_exchanged=max(float(moved), NOTHING_EXCHANGED * self._stored, noise),
            impacts=int(statistics["onsets"].sum()),
            shortest_contact_steps=int(shortest) if math.isfinite(shortest) else 0,
            under_resolved=int(statistics["under_resolved"].sum()),
            under_resolved_impulse=poorly / impulse if impulse else 0.0,
            normal_impulse=impulse,
            largest_penetration=float(depth),
            penetration_over_clearance=float(relative),
            step=float(simulation["step"]),
            friction_step_limit=self._friction_step_limit(),
            unsolved=int(workspace.run["unsolved"][0]),
            unresolved=workspace.unresolved,
            impulse_missed=self._impulse_missed(workspace),
            friction_fed=self._friction_returned,
            tooth_steps=self._tooth_steps(),
            loop_drift=self._drift,
            law_warnings=out_of_range(mechanism, statistics),
            limit_warnings=beyond(mechanism, *self._worst_records()) if self._worst else (),
            start="rest" if rest and rest.solved else "centred",
            start_residual=residual,
            start_load=load,
            judged_from=self._judged_from,
            judged_impacts=int(onsets.sum()),
            judged_impulse=float((statistics["impulse"] - before["impulse"]).sum()),
            peak_force=self._peak if mechanism.clearance else None,
            peak_force_before=self._peak_before if mechanism.clearance and late else None,
        )

    def _impulse_missed(self, workspace: Workspace) -> float:
        """`Audit.impulse_missed`, as far as it exceeds `MISSED` standard errors."""
        if self._before is None:
            return 0.0
        impulse = workspace.joints["impulse"]
        missed = np.linalg.norm(self._impulse - impulse, axis=1) - MISSED * np.sqrt(self._unknown)
        total = np.maximum(self._pressed, np.linalg.norm(impulse, axis=1))
        return float(np.max(missed[total > 0.0] / total[total > 0.0], initial=0.0))

    def _friction_step_limit(self) -> float:
        explicit = integrator(self._simulation["integrator"]).single_rate
        if not explicit or self._start is None:
            return math.inf
        forces = zip(self._mechanism.clearance, self._peaks, strict=True)
        steps = (
            friction_step_limit(self._mechanism, name, self._start, float(force))
            for name, force in forces
        )
        return min(steps, default=math.inf)

    def _tooth_steps(self) -> float:
        if self._start is None or self._simulation["tolerance"] is not None:
            return math.inf
        gears = self._mechanism.gears.items()
        touched = [name for name, gear in gears if self._twists[name] > gear.play / 2.0]
        durations = (tooth_duration(self._mechanism, name, self._start) for name in touched)
        return min(durations, default=math.inf) / float(self._simulation["step"])


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Lengths of vectors (..., 3), as `numpy.linalg.norm` in a third of its time."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    sizes: np.ndarray = np.sqrt(x * x + y * y + z * z)
    return sizes


def _larger(before: float, values: np.ndarray) -> float:
    """The largest of all; NaN if one of them is."""
    return float(np.maximum(before, values.max(initial=0.0)))
