"""The time loop between two events: who calls Pinocchio when, and the kernels in between."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.integrators import Integrator
from jointplay.kernel import Command, compiled
from jointplay.loops import PROXIMAL
from jointplay.workspace import Workspace

LOOP_CORRECTION = 0.1
"""Frequency of Baumgarte's stabilisation of ideal loops, times the interval of its evaluation."""


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

    @abstractmethod
    def begin(self) -> None:
        """Make ready to step from the workspace's state, or from one that an event has changed."""

    @abstractmethod
    def settle(self) -> None:
        """Make the workspace's state (q, v) whole, for an event that is going to change it."""

    @abstractmethod
    def stretch(self, steps: int) -> bool:
        """Do some steps, no more than `steps`; returns whether all is well."""

    @abstractmethod
    def finish(self) -> None:
        """Record the last state."""


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

    def stretch(self, steps: int) -> bool:
        """Do `steps` steps."""
        enter, run = compiled(), self.workspace.run
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


class MultiRate(Loop):
    """Pinocchio once a macro step; the micro steps in compiled code."""

    def __init__(self, *args: Any) -> None:
        """Prepare the calls."""
        super().__init__(*args)
        path = self.workspace.path
        self._nodes = [(path[3 + 2 * k], path[4 + 2 * k]) for k in range(3)]
        self._zero = np.zeros(self.model.nv)
        self.macro = 50

    def _inertia(self, q: np.ndarray, v: np.ndarray) -> None:
        """Inverse mass matrix, and acceleration without forces, of this state."""
        dynamics, state = self._dynamics(q, v, self._zero)
        dynamics(*state)
        pin.computeMinverse(self.model, self.data)

    def begin(self) -> None:
        """Evaluate forces and acceleration, and set off half a step before."""
        w = self.workspace
        w.run["macro"] = 0
        w.do(Command.RESTART)
        w.do(Command.PREDICT)
        self._frames(1)
        self._inertia(w.q, w.v)
        w.do(Command.SET_OFF)

    def settle(self) -> None:
        """Find the velocity at the present instant."""
        self.workspace.do(Command.EVALUATE)

    def _frames(self, nodes: int) -> None:
        """Frames and Jacobians at the first `nodes` nodes of the predicted path."""
        w = self.workspace
        if w.needs_jacobians:
            for node in range(nodes):
                pin.computeJointJacobians(self.model, self.data, self._nodes[node][0])
                w.run["node"] = node
                w.do(Command.NODES)

    def stretch(self, steps: int) -> bool:
        """Do one macro step."""
        w = self.workspace
        w.run["macro"] = min(steps, self.macro)
        w.do(Command.PREDICT)
        self._frames(3)
        self._inertia(*self._nodes[1])
        return w.do(Command.MACRO_STEP) == 0

    def finish(self) -> None:
        """Record the last state."""
        self.workspace.do(Command.FINISH)
