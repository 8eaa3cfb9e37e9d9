"""Start of judging: the time from which figures count, given or when contacts have settled.

Journals that fall into their bearings at the start, and teeth through their play, bounce. Contacts
have settled when the bounces of all that have touched are over, by the restitution of each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from jointplay.model.gear import Gearing
from jointplay.model.mechanism import Mechanism
from jointplay.physics.kernel.workspace import Workspace

LOOK_S = 1e-3
"""Interval at which a run looks for first contacts [s]: a shorter fall counts as so long."""


class Judging:
    """Finds when judging begins, and the contact statistics then.

    Args:
        mechanism: the mechanism that runs.
        step: time step [s].
        start: time from which figures are judged [s]; None: when first contacts have settled.

    Attributes:
        start: that time; 0 until contacts have settled.
        unjudged: contact statistics at that time; None before.
    """

    def __init__(self, mechanism: Mechanism, step: float, start: float | None) -> None:
        self._mechanism, self._step = mechanism, step
        self.start = start or 0.0
        self.unjudged: dict[str, np.ndarray] | None = None
        self._waits = start is None
        """Whether contacts are still to settle."""
        self._interval = max(round(LOOK_S / step), 1)
        self._next_look = self._interval
        self._settled: dict[str, float] = {}
        """End of the bounces of each joint that has touched [s]."""

    @property
    def _first_step(self) -> int:
        return round(self.start / self._step)

    def next_step(self, step: int) -> float:
        """The next step after `step` at, or soon after, which to call `look`; infinite: never."""
        begins = self._first_step if step < self._first_step else math.inf
        return min(begins, self._next_look if self._waits else math.inf)

    def begin(self, workspace: Workspace) -> None:
        """Look at the state in which the run begins: contacts that touch there are no impacts.

        The kernel counts them as onsets in its first step; `unjudged` has them before.
        """
        if workspace.steps == self._first_step == 0:
            touching = workspace.contacts["touching"].astype(float)
            self.unjudged = workspace.contact_statistics() | {"onsets": touching}

    def look(self, workspace: Workspace) -> None:
        """Look at the state at the end of a stretch."""
        if self.unjudged is None and workspace.steps >= self._first_step > 0:
            self.unjudged = workspace.contact_statistics()
        if self._waits and workspace.steps >= self._next_look and self._have_settled(workspace):
            self.start, self._waits = workspace.time, False
            self.unjudged = workspace.contact_statistics()

    def _have_settled(self, workspace: Workspace) -> bool:
        """Whether something has touched by now, and all that has lies."""
        self._next_look = (workspace.steps // self._interval + 1) * self._interval
        time, mechanism = workspace.time, self._mechanism
        onsets = workspace.contact_statistics()["onsets"]
        for (name, joint), begun in zip(mechanism.clearance.items(), onsets, strict=True):
            if begun.any() and joint.has_play and name not in self._settled:
                nominal = joint.contact_properties(0).restitution
                delivered = joint.normal.effective_restitution(nominal)
                restitution = nominal if delivered is None else delivered
                self._settled[name] = _bounced_until(time, restitution)
        for name, gear in mechanism.gears.items():
            ends = (workspace.q[mechanism.motor(name)], workspace.q[mechanism.coordinate(name)])
            touches = abs(gear.twist(*ends)) >= 0.5 * gear.play > 0.0
            if touches and f"{name}.motor" not in self._settled:
                self._settled[f"{name}.motor"] = _bounced_until(time, _restitution(gear))
        return bool(self._settled) and time >= max(self._settled.values())

    def memory(self) -> dict[str, Any]:
        """State for checkpoints; `recall` takes it with `unjudged`, which is kept apart."""
        return {
            "start": self.start,
            "waits": self._waits,
            "next_look": self._next_look,
            "settled": self._settled,
        }

    def recall(self, memory: Mapping[str, Any], unjudged: dict[str, np.ndarray] | None) -> None:
        self.start, self._waits = float(memory["start"]), bool(memory["waits"])
        self._next_look, self.unjudged = int(memory["next_look"]), unjudged
        self._settled = {str(name): float(time) for name, time in memory["settled"].items()}


def _bounced_until(fallen: float, restitution: float) -> float:
    """Time at which the bounces after a fall from 0 to `fallen` [s] are over [s].

    They last 2 e, 2 e^2, ... times the fall: a geometric series.
    """
    if restitution >= 1.0:
        return math.inf
    return fallen * (1.0 + restitution) / (1.0 - restitution)


def _restitution(gear: Gearing) -> float:
    """Restitution of teeth with the rotor alone on them; the joint's inertia makes it smaller."""
    ratio = gear.damping / (2.0 * math.sqrt(gear.steepest * max(gear.rotor_inertia, 1e-300)))
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 0.0
