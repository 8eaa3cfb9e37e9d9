"""What looks at a run between its steps: sampled controllers, friction that follows forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pinocchio as pin

from jointplay.kernel.sites import LoadSite
from jointplay.kernel.workspace import Workspace
from jointplay.loads.base import Load
from jointplay.mechanism.mechanism import Mechanism
from jointplay.simulation.loads import Sampling
from jointplay.simulation.loop import Loop
from jointplay.simulation.reactions import Reactions


class Watch:
    """The loads of a run that look at its state, and when.

    Args:
        loads: all loads, by name.
        sites: what the kernels know of them.
        mechanism: where they act.
        model: the run's own, payloads in hand.
        workspace: of the run.
        step: time step [s].

    Raises:
        JointplayError: a controller's period that is no multiple of the step.
    """

    def __init__(
        self,
        loads: Mapping[str, Load],
        sites: Sequence[LoadSite],
        mechanism: Mechanism,
        model: pin.Model,
        workspace: Workspace,
        step: float,
    ) -> None:
        """Find them."""
        self._workspace, self._model = workspace, model
        self._sampling = Sampling(loads, sites, workspace, step)
        self._reactions = Reactions(loads, sites, mechanism, workspace, step)

    def until_next(self, step: int) -> int | None:
        """Steps from `step` until one of them looks again; None if none ever does."""
        waits = (self._sampling.until_next(step), self._reactions.until_next(step))
        return min((due for due in waits if due is not None), default=None)

    def due(self, step: int) -> bool:
        """Whether one of them looks at `step`."""
        return self._sampling.due(step) or self._reactions.due(step)

    def set_off(self, loop: Loop) -> None:
        """Let a loop begin, once more when the forces that joints transmit are known."""
        w = self._workspace
        self._sampling.sample(w.q, w.v, jumps=False)
        loop.begin()
        if self._reactions:
            self._reactions.begin(self._model, w.v, w.acceleration)
            loop.begin()

    def look(self, loop: Loop, last: bool) -> None:
        """Let those look at the state whose time it is; no controller samples the last one."""
        w = self._workspace
        if self._reactions.due(w.steps):
            self._reactions.follow(self._model, loop.velocity())
        if last or not self._sampling.due(w.steps):
            return
        if loop.method.single_rate:
            loop.settle()
            self._sampling.sample(w.q, w.v, jumps=False)
            loop.begin()
        else:
            self._sampling.sample(w.q, loop.velocity(), jumps=True)

    def memory(self) -> dict[str, Any]:
        """What a checkpoint holds; the numbers of the loads are the workspace's.

        Raises:
            JointplayError: a controller that cannot say its state.
        """
        return {"sampling": self._sampling.memory(), "reactions": self._reactions.memory()}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as those that had this memory."""
        self._sampling.recall(memory["sampling"])
        self._reactions.recall(memory["reactions"])
