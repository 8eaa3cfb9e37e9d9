"""Explicit methods: Pinocchio at every stage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pinocchio as pin

from jointplay.kernel import Command, compiled
from jointplay.simulation.loop import Loop


class SingleRate(Loop):
    """Explicit methods: Pinocchio at every stage."""

    def __init__(self, *args: Any) -> None:
        """Prepare the calls."""
        super().__init__(*args)
        w = self.workspace
        self._call = self._dynamics(w.q, w.v, w.tau)
        self._begun = False

    def begin(self) -> None:
        """Evaluate forces and acceleration."""
        self.workspace.do(Command.REFRESH if self._begun else Command.BEGIN)
        self._begun = True
        if self.workspace.needs_jacobians:
            pin.computeJointJacobians(self.model, self.data, self.workspace.q)
            self.workspace.do(Command.LOAD)
        dynamics, state = self._call
        dynamics(*state)

    def settle(self) -> None:
        """Complete the work of the last step."""
        self.workspace.do(Command.SETTLE)

    def recall(self, memory: Mapping[str, float]) -> None:
        """Do not begin from the start again."""
        self._begun = True

    def stretch(self, steps: int, pause: int | None = None) -> bool:
        """Do `steps` steps, or fewer."""
        if pause is not None:
            steps = min(steps, max(pause - self.workspace.steps, 1))
        enter, run = compiled(self.method.command), self.workspace.run
        command, load = int(self.method.command), int(Command.LOAD)
        dynamics, state = self._call
        jacobians, place = pin.computeJointJacobians, (self.model, self.data, self.workspace.q)
        through_frames = self.workspace.needs_jacobians
        for _ in range(steps * self.method.stages):
            if enter(run, command):
                return False
            if through_frames:
                jacobians(*place)
                if enter(run, load):
                    return False
            dynamics(*state)
        return True

    def finish(self) -> None:
        """Record the last state."""
        self.workspace.do(Command.RECORD)
