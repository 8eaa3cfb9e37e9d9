"""A run's judgement of itself: energy, resolution of impacts, depth of penetration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from jointplay.codec import Described
from jointplay.contact import ContactProperties
from jointplay.fields import quantity
from jointplay.kernel import WELL_RESOLVED_STEPS
from jointplay.kernel.integrators import DEFAULT
from jointplay.mechanism.mechanism import Mechanism

DRIFT_WARNING_M = 1e-6
"""Gap of an ideal loop above which a run warns."""

NOTHING_EXCHANGED = 1e-6
"""Part of the kinetic energy below which its variation counts as none."""

ENERGY_WARNING = 0.01
"""Relative energy residual above which a run warns."""

UNDER_RESOLVED_WARNING = 1e-3
"""Share of the normal impulse in contacts of too few steps above which a run warns."""

STEP_WARNING = 0.01
"""Error by the step, relative to the motion, above which a run warns."""

FEW_UNSOLVED = 10
"""So many steps whose velocities are known to less than the solve's tolerance are not worth a word:
a first step from rest, or a corner of a friction law hit exactly."""

FED_WARNING = 0.01
"""What friction may give back, relative to the energy exchanged, before a run warns."""


@dataclass(frozen=True)
class Judgement:
    """How a run began, and from when on it is judged."""

    start: str = "centred"
    """Where journals began."""
    judged_from: float = 0.0
    """[s]."""
    residual: float | None = None
    """Unbalanced force of the place of rest [N]."""
    load: float | None = None
    """Largest force of a joint there [N]."""
    before: Mapping[str, np.ndarray] | None = None
    """`Workspace.contact_statistics` when judging began; None: at the start, or it never did."""


_figure = partial(quantity, finite=False)
"""A run that went wrong has figures that are no numbers."""


@dataclass(frozen=True, kw_only=True)
class Audit(Described):
    """Figures by which to judge a run."""

    energy_residual: float = _figure("J")
    """Largest error of the energy balance [J]."""
    energy_exchanged: float = _figure("J")
    """Total variation of the kinetic or potential energy or of any force's work, the largest [J].

    At least a millionth of the kinetic energy, for rounding is not worth a warning.
    """
    impacts: int
    """Contacts that began, at all places of all joints."""
    shortest_contact_steps: int
    """Steps of the shortest contact that ended; 0 if none did."""
    under_resolved: int
    """Contacts that lasted fewer than 10 steps."""
    under_resolved_impulse: float = _figure("")
    """Their share of the normal impulse, 0 to 1."""
    normal_impulse: float = _figure("N*s")
    """Of all contacts together [N s]."""
    largest_penetration: float = _figure("m")
    """[m]."""
    penetration_over_clearance: float = _figure("")
    """The same relative to the clearance of its direction."""
    step: float = _figure("s")
    """The time step [s]."""
    friction_step_limit: float = _figure("s")
    """Largest step that follows friction under the largest normal force [s]."""
    unsolved: int = 0
    """Steps whose velocity solve did not converge."""
    unresolved: int = 0
    """Macro steps in which the shortest micro steps did not reach the tolerance."""
    friction_fed: float = _figure("J", default=0.0)
    """Largest fall of the energy that friction has taken up: what bristles gave back [J]."""
    step_error: float | None = _figure("m", default=None)
    """Largest error of the tool's position because of the step, estimated [m]; see `step_check`.

    None where that is not looked for, or was given up.
    """
    relative_step_error: float | None = _figure("", default=None)
    """The same of all coordinates but motors, weighted with masses, relative to their motion."""
    tooth_steps: float = _figure("", default=math.inf)
    """Steps in an impact of gear teeth, of those that touched the fewest; inf without.

    Also where steps are chosen by a tolerance.
    """
    loop_drift: float = _figure("m", default=0.0)
    """Largest gap of a loop without clearance [m]."""
    start: str = "centred"
    """Where journals began: ``rest`` or ``centred``."""
    start_residual: float | None = _figure("N", default=None)
    """Largest force that the search for the place of rest left unbalanced [N]; None: no search."""
    start_load: float | None = _figure("N", default=None)
    """Largest force of a joint there [N]."""
    judged_from: float | None = _figure("s", default=None)
    """When figures begin to be judged [s]; None in results of version 0.1."""
    judged_impacts: int | None = None
    """Contacts that began from then on."""
    judged_impulse: float | None = _figure("N*s", default=None)
    """Their normal impulse, with that of contacts that lasted [N s]."""
    peak_force: float | None = _figure("N", default=None)
    """Largest force of a joint from then on [N]; None without clearance."""
    peak_force_before: float | None = _figure("N", default=None)
    """Largest force of a joint before [N]; None if all is judged."""
    law_warnings: tuple[str, ...] = ()
    """In what normal-force and film laws were used beyond their range; see `out_of_range`."""
    limit_warnings: tuple[str, ...] = ()
    """In what the run went beyond the URDF's limits of joints; see `loads.limits`."""

    @property
    def relative_energy_residual(self) -> float:
        """Energy residual over energy exchanged; 0 if nothing moved."""
        if self.energy_exchanged == 0.0:
            return 0.0 if self.energy_residual == 0.0 else math.inf
        return self.energy_residual / self.energy_exchanged

    @property
    def warnings(self) -> list[str]:
        """What a user should worry about, each with its remedy; empty if nothing."""
        worries = []
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
        if self.penetration_over_clearance > 0.5:
            worries.append(
                f"the journal sank in by {self.largest_penetration:.3g} m, "
                f"{100 * self.penetration_over_clearance:.0f} % of its clearance: the contact is "
                "too soft for this load"
            )
        if self.step > self.friction_step_limit:
            worries.append(
                f"the explicit step of {self.step:.3g} s does not follow friction under the "
                f"largest normal force, which asks for {self.friction_step_limit:.3g} s: forces of "
                "a jammed journal may be off by tens of per cent; take the integrator "
                f"{DEFAULT!r}, which does"
            )
        if self.unsolved > FEW_UNSOLVED:
            worries.append(
                f"the velocities of {self.unsolved} steps were not found: friction falls too "
                "steeply with speed for this step; reduce it"
            )
        if self.unresolved:
            worries.append(
                f"{self.unresolved} macro steps did not reach the tolerance with the shortest "
                "micro steps: raise it"
            )
        if self.friction_fed > FED_WARNING * self.energy_exchanged:
            worries.append(
                f"friction gave back {self.friction_fed:.3g} J: its bristles are not passive with "
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
    def headline(self) -> str:
        """How the run began and its largest force, and from when on that is judged; a line."""
        began = f"journals start {'at rest' if self.start == 'rest' else 'centred'}"
        if self.start_residual is not None:
            reason = "" if self.start == "rest" else ", for no place of rest was found"
            began += f"{reason} (unbalanced {self.start_residual:.1g} N of {self.start_load:.3g} N)"
        if self.peak_force is None:
            return began
        if not self.judged_from:
            return f"{began}; largest joint force {self.peak_force:.4g} N, judged from the start"
        return (
            f"{began}; from {self.judged_from:g} s on, {self.judged_impacts} contacts began, "
            f"largest joint force {self.peak_force:.4g} N (before: {self.peak_force_before:.4g} N)"
        )

    def _step_too_large(self) -> str:
        """What to say of a step that another step contradicts."""
        relative = self.relative_step_error
        if relative is None or not math.isfinite(relative):
            return "with half the step the run ends otherwise: reduce the step"
        tool = (
            "" if self.step_error is None else f"the tool is off by about {self.step_error:.2g} m, "
        )
        return (
            f"half the step gives another motion: {tool}all coordinates by {100 * relative:.2g} % "
            "of how far they move: reduce the step"
        )

    def __str__(self) -> str:
        """Figures, then warnings, one a line."""
        percent = 100 * self.relative_energy_residual
        lines = [
            f"  energy residual: {self.energy_residual:.3g} J, "
            f"{percent:.2g} % of {self.energy_exchanged:.3g} J exchanged"
        ]
        if self.impacts:
            steps = self.shortest_contact_steps
            shortest = f"shortest {steps} steps" if steps else "none ended"
            lines += [
                f"  contacts: {self.impacts}, {shortest}, "
                f"{self.under_resolved} under {WELL_RESOLVED_STEPS} steps",
                f"  largest penetration: {self.largest_penetration:.3g} m, "
                f"{100 * self.penetration_over_clearance:.2g} % of the clearance",
            ]
        if self.peak_force is not None:
            lines.append(f"  {self.headline}")
        if self.step_error is not None and self.relative_step_error is not None:
            lines.append(
                f"  error by the step: tool {self.step_error:.2g} m, "
                f"{100 * self.relative_step_error:.2g} % of the motion"
            )
        if self.loop_drift:
            lines.append(f"  drift of ideal loops: {self.loop_drift:.3g} m")
        return "\n".join(lines + [f"  warning: {text}" for text in self.warnings])


def out_of_range(mechanism: Mechanism, statistics: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Say in what a run left the range of its normal-force and film laws, a line each.

    Afterwards, from the deepest penetration and the fastest approach of each contact that began.

    Args:
        mechanism: what was simulated.
        statistics: `Workspace.contact_statistics`.
    """
    lines: dict[str, None] = {}  # a set that keeps its order
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
