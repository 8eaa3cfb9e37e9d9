"""When a start has died away: by the first contacts that a run itself shows.

A journal that is released falls, and bounces. Of a ball that is pressed by a constant force and
falls for the time t, each flight is as long as the one before times the restitution e; the first
one after the fall lasts 2 e t. All are over at

    t + 2 e t + 2 e^2 t + ... = t (1 + e)/(1 - e).

Where the force grows, as at the beginning of a motion, flights are shorter than that: it is a
bound. Teeth of a gear fall through its play likewise, with the restitution exp(-pi z/sqrt(1 - z^2))
of an oscillator of their damping ratio z.

What has touched nothing yet, when all that has touched has settled, is not waited for: nothing
presses it. A run that ends before, or bounces without loss, is judged from its start, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from jointplay.model.gear import Gearing
from jointplay.model.mechanism import Mechanism
from jointplay.physics.kernel.workspace import Workspace

LOOK_S = 1e-3
"""Interval at which a run looks for first contacts [s]: what falls faster counts as so long."""


class Settling:
    """Looks at the contacts of a run from its start until they have settled."""

    def __init__(self, mechanism: Mechanism, step: float) -> None:
        self._mechanism = mechanism
        self._every = max(round(LOOK_S / step), 1)
        self.next_step = self._every
        """At or after which the run shall look."""
        self._settled: dict[str, float] = {}
        """By joint that has touched: when its bounces are over [s]."""

    def has_settled(self, workspace: Workspace) -> bool:
        """Look, at `next_step` or later: whether all that has touched by now lies."""
        self.next_step = (workspace.steps // self._every + 1) * self._every
        time, mechanism = workspace.time, self._mechanism
        onsets = workspace.contact_statistics()["onsets"]
        for (name, joint), own in zip(mechanism.clearance.items(), onsets, strict=True):
            if own.any() and joint.has_play and name not in self._settled:
                nominal = joint.contact_properties(0).restitution
                delivered = joint.normal.effective_restitution(nominal)
                restitution = nominal if delivered is None else delivered
                self._settled[name] = bounced_until(time, restitution)
        for name, gear in mechanism.gears.items():
            ends = (workspace.q[mechanism.motor(name)], workspace.q[mechanism.coordinate(name)])
            touches = abs(gear.twist(*ends)) >= 0.5 * gear.play > 0.0
            if touches and f"{name}.motor" not in self._settled:
                self._settled[f"{name}.motor"] = bounced_until(time, _restitution(gear))
        return bool(self._settled) and time >= max(self._settled.values())

    def memory(self) -> dict[str, Any]:
        return {"next_step": self.next_step, "settled": self._settled}

    def recall(self, memory: Mapping[str, Any]) -> None:
        self.next_step = int(memory["next_step"])
        self._settled = {str(name): float(time) for name, time in memory["settled"].items()}


def bounced_until(fallen: float, restitution: float) -> float:
    """When the bounces after a fall that began at 0 and ended at `fallen` are over [s]."""
    if restitution >= 1.0:
        return math.inf
    return fallen * (1.0 + restitution) / (1.0 - restitution)


def _restitution(gear: Gearing) -> float:
    """Of teeth, with the rotor alone on them: a joint beside it makes it smaller."""
    ratio = gear.damping / (2.0 * math.sqrt(gear.steepest * max(gear.rotor_inertia, 1e-300)))
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 0.0
