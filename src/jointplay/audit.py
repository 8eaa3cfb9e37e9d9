"""A run's judgement of itself: energy, resolution of impacts, depth of penetration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from jointplay.impact import friction_step_limit
from jointplay.kernel import WELL_RESOLVED_STEPS, Workspace
from jointplay.mechanism import Mechanism

ENERGY_WARNING = 0.01
"""Relative energy residual above which a run warns."""


@dataclass(frozen=True)
class Audit:
    """Figures by which to judge a run."""

    energy_residual: float
    """Largest error of the energy balance [J]."""
    energy_exchanged: float
    """Total variation of the kinetic energy or of the drives' work, the larger [J]."""
    impacts: int
    """Contacts that began, all four places of all joints."""
    shortest_contact_steps: int
    """Steps of the shortest contact that ended; 0 if none did."""
    under_resolved: int
    """Contacts that lasted fewer than 10 steps."""
    under_resolved_impulse: float
    """Their share of the normal impulse, 0 to 1."""
    normal_impulse: float
    """Of all contacts together [N s]."""
    largest_penetration: float
    """[m]."""
    penetration_over_clearance: float
    """The same relative to the clearance of its direction."""
    step: float
    """The time step [s]."""
    friction_step_limit: float
    """Largest step that follows friction under the largest normal force [s]."""

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        simulation: Mapping[str, Any],
        workspace: Workspace,
        kinetic: np.ndarray,
        work: np.ndarray,
        residual: np.ndarray,
    ) -> Audit:
        """Audit the records in `workspace` of `simulation`, which is given as plain data."""
        statistics = workspace.contact_statistics()
        exchanged = max(
            (float(np.abs(np.diff(values)).sum()) for values in (kinetic, work[:, 0])), default=0.0
        )
        shortest = float(np.min(statistics["shortest_steps"], initial=np.inf))
        impulse = float(statistics["impulse"].sum())
        depth, relative, limit = 0.0, 0.0, math.inf
        peaks = workspace.recorded("normal_peak")
        peaks = peaks.reshape(workspace.rows, len(mechanism.clearance), 4)
        largest = peaks.max(axis=(0, 2), initial=0.0)
        for name, gaps, force in zip(
            mechanism.clearance, statistics["smallest_gap"], largest, strict=True
        ):
            joint = mechanism.clearance[name]
            if workspace.rows:
                q = workspace.recorded("q")[0]
                limit = min(limit, friction_step_limit(mechanism, name, q, float(force)))
            rooms = (joint.cr, joint.cr, joint.ca, joint.ca)
            for gap, room in zip(gaps, rooms, strict=True):
                depth, relative = max(depth, -gap), max(relative, -gap / room)
        return cls(
            energy_residual=float(np.abs(residual).max(initial=0.0)),
            energy_exchanged=exchanged,
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
            friction_step_limit=limit,
        )

    @property
    def relative_energy_residual(self) -> float:
        """Energy residual over energy exchanged; 0 if nothing moved."""
        if self.energy_exchanged == 0.0:
            return 0.0 if self.energy_residual == 0.0 else math.inf
        return self.energy_residual / self.energy_exchanged

    @property
    def warnings(self) -> list[str]:
        """What a user should worry about, each with its remedy; empty if nothing."""
        found = []
        if not self.relative_energy_residual <= ENERGY_WARNING:
            found.append(
                f"the energy balance is off by {100 * self.relative_energy_residual:.2g} % of the "
                "energy exchanged: reduce the step"
            )
        if self.under_resolved:
            found.append(
                f"{self.under_resolved} of {self.impacts} contacts lasted fewer than "
                f"{WELL_RESOLVED_STEPS} steps (shortest {self.shortest_contact_steps}; "
                f"{100 * self.under_resolved_impulse:.2g} % of the impulse): reduce the step"
            )
        if self.penetration_over_clearance > 0.5:
            found.append(
                f"the journal sank in by {self.largest_penetration:.3g} m, "
                f"{100 * self.penetration_over_clearance:.0f} % of its clearance: the contact is "
                "too soft for this load"
            )
        if self.step > self.friction_step_limit:
            found.append(
                f"the step of {self.step:.2g} s does not follow friction under the largest normal "
                f"force, which needs {self.friction_step_limit:.1g} s: forces of a jammed journal "
                "may be off by some per cent; reduce the step or widen the friction law's ramp"
            )
        return found

    def describe(self) -> dict[str, Any]:
        """Fields of the audit as plain data."""
        return asdict(self)

    def __str__(self) -> str:
        """Figures, then warnings, one a line."""
        percent = 100 * self.relative_energy_residual
        lines = [
            f"  energy residual: {self.energy_residual:.3g} J, "
            f"{percent:.2g} % of {self.energy_exchanged:.3g} J exchanged"
        ]
        if self.impacts:
            lines += [
                f"  contacts: {self.impacts}, shortest {self.shortest_contact_steps} steps, "
                f"{self.under_resolved} under {WELL_RESOLVED_STEPS} steps",
                f"  largest penetration: {self.largest_penetration:.3g} m, "
                f"{100 * self.penetration_over_clearance:.2g} % of the clearance",
            ]
        return "\n".join(lines + [f"  warning: {text}" for text in self.warnings])
