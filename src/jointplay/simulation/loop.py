"""The time loop between two events: who calls Pinocchio when, and the kernels in between."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.kernel import Command, compiled
from jointplay.kernel.integrators import Integrator
from jointplay.kernel.workspace import Workspace
from jointplay.mechanism.loop import PROXIMAL

LOOP_CORRECTION = 0.1
"""Frequency of Baumgarte's stabilisation of ideal loops, times the step; of single-rate methods."""

LOOP_CORRECTION_PER_MACRO = 0.5
"""The same times the macro step, at whose pace the multi-rate method evaluates it."""

LONGEST_MACRO_STEP_S = 2e-4
"""Macro steps that an error estimate chooses are no longer than this [s]."""

MACRO_TOLERANCE = 1e-3
"""Error of the acceleration drawn along a line through two macro steps, relative: what the third
says differs from it by no more, or the next macro step is shorter.

The error between the middles is a small part of that. Measured: docs/integrators.md.
"""

REFUSED = 4.0
"""A macro step whose middle is so many times the tolerance off is planned anew."""

LARGEST_TURN = 0.02
"""Angle by which no joint turns further in a macro step that an error estimate chooses [rad]."""

LARGEST_DEPARTURE = 1e-5
"""Angle by which the state may leave the path that was predicted for a macro step [rad]."""

LEAST_STEPS = 8
"""Macro steps are planned no shorter than this many steps where one has been ended early."""

GROWTH = 1.5
"""By how much a macro step is longer than the one before at most."""

LOOP_TOLERANCE = 3e-5
"""The same with ideal loops, which drift apart by what the line is off."""

SHORTEST_MICRO_STEP_S = 2e-8
"""Adaptive micro steps are halved down to this [s]."""

_aba, _inverse, _WORLD = pin.aba, pin.computeMinverse, pin.Convention.WORLD
_PREDICT, _NODES = int(Command.PREDICT), int(Command.NODES)
_MACRO_STEP = int(Command.MACRO_STEP)


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
        self._enter = compiled()
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

    def recall(self, memory: Mapping[str, float]) -> None:
        """Do not begin from the start again."""
        self._begun = True

    def stretch(self, steps: int) -> bool:
        """Do `steps` steps."""
        enter, run = self._enter, self.workspace.run
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
    """Pinocchio once a macro step; the micro steps in compiled code.

    Args:
        macro_step: length of macro steps [s]; None lets an error estimate choose.
    """

    def __init__(self, *args: Any, macro_step: float | None = None) -> None:
        """Prepare the calls."""
        super().__init__(*args)
        w, nv = self.workspace, self.model.nv
        self._dt = dt = float(w.run["dt"][0])
        self._nodes = [(w.path[3 + 2 * k], w.path[4 + 2 * k]) for k in range(3)]
        self._zero = np.zeros(nv)
        self._planned, self._fastest = w.run["macro"], w.run["fastest"]
        self._path_error, self._path_limit = w.run["path_error"], w.run["path_limit"]
        self._through_frames, self._node = w.needs_jacobians, w.run["node"]
        self._fixed = macro_step is not None
        for joint in self.model.joints[1:]:
            if joint.nv == 1 and "P" not in joint.shortname()[len("JointModel") :][:1]:
                w.turning[joint.idx_v] = 1.0
            if joint.shortname() == "JointModelSphericalZYX":
                w.turning[joint.idx_v : joint.idx_v + 3] = 1.0
        w.run["departure_limit"] = np.inf if self._fixed else LARGEST_DEPARTURE
        longest = LONGEST_MACRO_STEP_S if macro_step is None else macro_step
        self._longest = max(round(longest / dt), 1)
        self._macro = self._longest if self._fixed else max(self._longest // 10, 1)
        self._tolerance = LOOP_TOLERANCE if len(self._models) else MACRO_TOLERANCE
        if len(self._models):
            # What Pinocchio's data hold is of one call; here an answer is made of several.
            self._tau = np.zeros(nv)
            self._other = self.model.createData()
            w.own_inertia()

    def _inertia(self, q: np.ndarray, v: np.ndarray) -> None:
        """Inverse mass matrix, and acceleration without forces, of this state."""
        if len(self._models):
            self._inertia_of_loops(q, v)
            return
        _aba(self.model, self.data, q, v, self._zero, self._none, _WORLD)
        _inverse(self.model, self.data)

    def _inertia_of_loops(self, q: np.ndarray, v: np.ndarray) -> None:
        """The same with ideal loops: accelerations per force, the constraints' forces included."""
        w = self.workspace
        self._correct(0.0)
        dynamics, state = self._dynamics(q, v, self._tau)
        dynamics(*state)
        w.free[:] = self.data.ddq
        pin.computeMinverse(self.model, self._other, q)
        # Forces large enough for their effect not to drown in the acceleration there is.
        sizes = (1.0 + np.abs(w.free).max()) / self._other.Minv.diagonal()
        for i, size in enumerate(sizes):
            self._tau[i] = size
            dynamics(*state)
            w.inverse_mass[:, i] = (self.data.ddq - w.free) / size
            self._tau[i] = 0.0

    def _correct(self, frequency: float) -> None:
        """Set the frequency of Baumgarte's stabilisation [rad/s]."""
        for constraint in self._models:
            constraint.m_baumgarte_parameters.Kp = frequency**2
            constraint.m_baumgarte_parameters.Kd = 2.0 * frequency

    def _close_loops(self, span: float, q: np.ndarray, v: np.ndarray) -> None:
        """Add what Baumgarte's stabilisation does in a macro step of `span` seconds to the speeds.

        At once, for within the step it would spoil the line that the acceleration follows.
        """
        self._correct(LOOP_CORRECTION_PER_MACRO / span)
        dynamics, state = self._dynamics(q, v, self._tau)
        dynamics(*state)
        self.workspace.half += span * (self.data.ddq - self.workspace.free)

    def begin(self) -> None:
        """Evaluate forces and acceleration, and set off half a step before."""
        w = self.workspace
        w.run["macro"] = 0
        w.do(Command.RESTART)
        w.do(Command.PREDICT)
        if self._through_frames:
            self._frames(1)
        self._inertia(w.q, w.v)
        w.do(Command.SET_OFF)

    def settle(self) -> None:
        """Find the velocity at the present instant."""
        self.workspace.do(Command.SETTLE_MACRO)

    def look(self) -> None:
        """Find the velocity at the present instant, for a moment."""
        if not self.workspace.run["fresh"][0]:
            self.settle()

    def memory(self) -> dict[str, float]:
        """Length of the next macro step, in steps."""
        return {"macro": self._macro}

    def recall(self, memory: Mapping[str, float]) -> None:
        """Take the length of the next macro step."""
        self._macro = int(memory["macro"])

    def _frames(self, nodes: int) -> None:
        """Frames and Jacobians at the first `nodes` nodes of the predicted path."""
        run = self.workspace.run
        for node in range(nodes):
            pin.computeJointJacobians(self.model, self.data, self._nodes[node][0])
            self._node[0] = node
            self._enter(run, _NODES)

    def stretch(self, steps: int) -> bool:
        """Do one macro step."""
        w = self.workspace
        before = w.steps
        macro = self._prepare(min(steps, self._macro), _MACRO_STEP)
        done = w.steps - before
        if not self._fixed and done < macro:
            self._macro = min(max(2 * done, LEAST_STEPS), self._longest)
        return not w.failed

    def _prepare(self, macro: int, command: int, unit: int = 1) -> int:
        """Ask Pinocchio for what a macro step needs and let the kernels carry out `command` on it.

        Where the answer is too far from what was expected a shorter step is planned instead.

        Args:
            macro: length of the macro step, in steps.
            command: is not carried out where the answer is too far off.
            unit: the length remains a multiple of this, unless it is shorter from the first.

        Returns:
            The length that was taken.
        """
        fastest = self._fastest.item()
        if not self._fixed and fastest * macro * self._dt > LARGEST_TURN:
            macro = max(int(LARGEST_TURN / (fastest * self._dt * unit)), 1) * unit
        while True:
            self._ask(macro)
            limit = np.inf if self._fixed or macro <= unit else REFUSED * self._tolerance
            self._path_limit[0] = limit
            self._enter(self.workspace.run, command)
            error = self._path_error.item()
            if not error > limit:
                break
            macro = max(macro // (4 * unit), 1) * unit
        if not self._fixed:
            # What is not a number says nothing; the run's own check will find it.
            factor = (0.5 * self._tolerance / max(error, 1e-12)) ** 0.5 if error > 0.0 else GROWTH
            best = int(macro * min(max(factor, 0.25), GROWTH) + 0.9)
            self._macro = min(max(best, 1), self._longest)
        return macro

    def _ask(self, macro: int) -> None:
        """Ask Pinocchio for all that a macro step of so many steps needs."""
        self._planned[0] = macro
        self._enter(self.workspace.run, _PREDICT)
        if self._through_frames:
            self._frames(3)
        self._inertia(*self._nodes[1])
        if len(self._models):
            self._close_loops(macro * self._dt, *self._nodes[1])

    def finish(self) -> None:
        """Record the last state."""
        self.workspace.do(Command.FINISH)


class Adaptive(MultiRate):
    """The multi-rate method with micro steps of its own choice.

    A macro step is done twice, the second time with micro steps half as long, until both agree: no
    call of Pinocchio is repeated. Steps are divided at the onsets of contacts.

    Args:
        macro_step: see `MultiRate`.
        tolerance: difference of the momenta at the end of the macro step, relative to what contacts
            and inertia have moved in it; likewise of the positions.
    """

    def __init__(self, *args: Any, macro_step: float | None, tolerance: float) -> None:
        """Prepare the calls, and the room for states to come back to."""
        super().__init__(*args, macro_step=macro_step)
        w = self.workspace
        self._tolerated = tolerance
        self._state = w.state()
        self._kept = [array.copy() for array in self._state]
        self._every = int(w.run["every"][0])
        # Macro steps go from record to record, or divide the way between them.
        fitting = (n for n in range(min(self._every, self._longest), 0, -1) if self._every % n == 0)
        self._unit = next(fitting)
        self._micro_step = self._dt

    def memory(self) -> dict[str, float]:
        """Length of the next macro and micro steps."""
        return super().memory() | {"micro_step": self._micro_step}

    def recall(self, memory: Mapping[str, float]) -> None:
        """Take the lengths of the next steps."""
        super().recall(memory)
        self._micro_step = float(memory["micro_step"])

    def stretch(self, steps: int) -> bool:
        """Do one macro step as finely as it needs."""
        macro = min(steps, max(self._macro // self._unit, 1) * self._unit)
        macro = self._prepare(macro, int(Command.TAKE_MIDDLE), self._unit)
        span = macro * self._dt
        for kept, array in zip(self._kept, self._state, strict=True):
            np.copyto(kept, array)
        self._begun = self.workspace.half.copy()
        records = macro // self._every if macro % self._every == 0 else 1
        halvings = math.ceil(math.log2(max(0.5 * span / (self._micro_step * records), 1.0)) - 1e-9)
        micro = records * 2**halvings
        coarse = self._try(micro)
        while True:
            for kept, array in zip(self._kept, self._state, strict=True):
                np.copyto(array, kept)
            micro *= 2
            fine = self._try(micro)
            error = self._difference(coarse, fine, span)
            if not error > self._tolerated:
                break
            if 0.5 * span / micro < SHORTEST_MICRO_STEP_S:
                self.workspace.unresolved += 1
                break
            coarse = fine
        # The error falls by four when steps are halved; less where a contact begins or ends.
        self._micro_step = span / micro * (2.0 if error < 0.1 * self._tolerated else 1.0)
        return not self.workspace.failed

    def _try(self, micro: int) -> tuple[np.ndarray, np.ndarray]:
        """Do the macro step with so many micro steps; returns q and v at its end."""
        w = self.workspace
        w.run["micro"] = micro
        self._enter(w.run, int(Command.ADAPTIVE_STEP))
        # From half a step ago to now, with the acceleration of the last state.
        v = w.half + 0.5 * float(w.run["dt_before"][0]) * w.acceleration
        return w.q.copy(), v

    def _difference(
        self, one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray], span: float
    ) -> float:
        """Difference of two ends, relative to what was moved in the macro step; 0 if it failed."""
        w = self.workspace
        if w.failed:
            return 0.0
        mass = 1.0 / np.maximum(w.inverse_mass.diagonal(), 1e-300)

        def size(v: np.ndarray) -> float:
            return float(np.sqrt(mass @ (v * v)))

        moved = float(w.run["pushed"][0]) + size(other[1] - self._begun)
        if moved == 0.0:
            return 0.0
        return max(size(one[1] - other[1]), size(one[0] - other[0]) / span) / moved
