"""The time loop between two events: who calls Pinocchio when, and the kernels in between."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.kernel import Command, compiled, entry_of, layout
from jointplay.kernel.integrators import Integrator
from jointplay.kernel.sites import CarriedFrame
from jointplay.kernel.workspace import Workspace
from jointplay.mechanism.loop import PROXIMAL
from jointplay.mechanism.tree import Frame, Tree

LOOP_CORRECTION = 0.1
"""Frequency of Baumgarte's stabilisation of ideal loops, times the step; of single-rate methods."""


def moving_bodies(
    model: pin.Model, frames: Sequence[Frame]
) -> tuple[np.ndarray, list[CarriedFrame]]:
    """Bodies between some frames and the ground, for the kernels.

    Args:
        model: of the run.
        frames: joints of Pinocchio's, and placements in them.

    Returns:
        Records of `layout.BODY`, the ground first, parents before their children; and by frame the
        body that carries it, and its place in that.
    """
    tree = Tree(model)
    every = tree.bodies
    carriers, places = tree.frames(frames)
    needed = {0}
    for body in map(int, carriers):
        while body not in needed:
            needed.add(body)
            body = int(every.parents[body])
    numbers = {body: number for number, body in enumerate(sorted(needed))}
    rows = np.zeros(len(numbers), layout.BODY)
    rows["rotation"][0] = np.eye(3).ravel()
    for body, number in numbers.items():
        row = rows[number]
        row["parent"], row["coordinate"] = numbers[int(every.parents[body])], body - 1
        row["slides"] = every.slides[body]
        row["turn"], row["shift"] = every.turns[body], every.shifts[body]
    return rows, [(numbers[int(b)], place) for b, place in zip(carriers, places, strict=True)]


class Loop(ABC):
    """Steps a run from one event to the next.

    Args:
        model, data: Pinocchio's, of the run.
        workspace: holds the state.
        method: the integrator.
        constraints: of the ideal loops.
    """

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        workspace: Workspace,
        method: Integrator,
        constraints: list[pin.RigidConstraintModel],
    ) -> None:
        """Keep what the loop works on."""
        self.model, self.data, self.workspace, self.method = model, data, workspace, method
        self._models = pin.StdVec_RigidConstraintModel()
        self._models.extend(constraints)
        self._datas = pin.StdVec_RigidConstraintData()
        self._datas.extend([constraint.createData() for constraint in constraints])
        if constraints:
            pin.initConstraintDynamics(model, data, self._models, self._datas)
        # The Python binding of pin.aba tries the form with external forces first: to give it none
        # costs less than to leave them out.
        self._none = pin.StdVec_Force()
        self._none.extend([pin.Force.Zero()] * model.njoints)

    def _dynamics(
        self, q: np.ndarray, v: np.ndarray, tau: np.ndarray
    ) -> tuple[Any, tuple[Any, ...]]:
        """What puts the acceleration into `data.ddq`, and what it is called with."""
        state = (self.model, self.data, q, v, tau)
        if len(self._models):
            return pin.constraintDynamics, (*state, self._models, self._datas, PROXIMAL)
        return pin.aba, (*state, self._none, pin.Convention.WORLD)

    @property
    def commands(self) -> tuple[Command, ...]:
        """One of each compiled entry that the loop calls."""
        return (self.method.command,)

    @property
    def compiled(self) -> bool:
        """Whether this process has all compiled code that the loop calls."""
        return all(entry_of(command).signatures for command in self.commands)

    def compile(self) -> None:
        """Compile that code, or load it."""
        for command in self.commands:
            compiled(command)

    @abstractmethod
    def begin(self) -> None:
        """Make ready to step from the workspace's state, or from one that an event has changed."""

    @abstractmethod
    def settle(self) -> None:
        """Make the workspace's state (q, v) whole, for an event that is going to change it."""

    def velocity(self) -> np.ndarray:
        """Velocities at the present instant, shape (nv,)."""
        return self.workspace.v

    def look(self) -> None:
        """Evaluate the present state to be read; the caller brings the workspace back to it."""
        return None

    def memory(self) -> dict[str, float]:
        """What is known beside the workspace, for a checkpoint."""
        return {}

    def recall(self, memory: Mapping[str, float]) -> None:
        """Go on as the loop that had this memory."""
        return None

    @abstractmethod
    def stretch(self, steps: int, pause: int | None = None) -> bool:
        """Do some steps, no more than `steps`; returns whether all is well.

        Args:
            steps: to do at most.
            pause: return at or after this step, between macro steps, if that is earlier; what
                follows is the same as without.
        """

    @abstractmethod
    def finish(self) -> None:
        """Record the last state."""
