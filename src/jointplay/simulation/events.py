"""What happens to the bodies during a run: payloads are picked up and released."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from jointplay.errors import MissingName
from jointplay.kernel.workspace import Workspace
from jointplay.mechanism.loop import closing_rows
from jointplay.mechanism.mechanism import Mechanism, frame_index
from jointplay.mechanism.payload import Payload, velocity_after_pick
from jointplay.result.kinematics import Phase


class Events:
    """Picks and releases in the order of the steps at which they happen.

    Args:
        mechanism: the mechanism.
        model: the run's own, whose inertias change.
        payloads: what is picked up and released.
        step: time step [s].
        record_every: steps between records.

    Attributes:
        phases: the stretches so far in which the bodies keep their inertias.

    Raises:
        MissingName: a payload at a frame that does not exist.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        model: pin.Model,
        payloads: Sequence[Payload],
        step: float,
        record_every: int,
    ) -> None:
        """Sort what will happen."""
        self._mechanism, self._model, self._every = mechanism, model, record_every
        self.phases = [Phase(0, mechanism.model.copy())]
        planned: list[tuple[int, Payload, bool]] = []
        for payload in payloads:
            if not model.existFrame(payload.frame):
                names = [frame.name for frame in model.frames if frame.name != "universe"]
                raise MissingName("frame for a payload", payload.frame, names)
            times = [(payload.pick, True)]
            times += [] if payload.release is None else [(payload.release, False)]
            planned += [(round(time / step), payload, picked) for time, picked in times]
        self._planned = sorted(planned, key=lambda event: event[0], reverse=True)

    @property
    def next_step(self) -> int | None:
        """Step before which something happens; None if nothing will."""
        return self._planned[-1][0] if self._planned else None

    def happen(self, w: Workspace) -> None:
        """Pick and release what is due in the state of a workspace."""
        while self._planned and self._planned[-1][0] <= w.steps:
            _, payload, picked = self._planned.pop()
            self._exchange(w, payload, picked)

    def memory(self) -> list[tuple[int, float]]:
        """Row and energy of each phase so far, for a checkpoint."""
        return [(phase.row, phase.energy) for phase in self.phases]

    def recall(self, memory: Sequence[Sequence[float]]) -> None:
        """Let what happened before a checkpoint have happened."""
        for row, energy in list(memory)[len(self.phases) :]:
            _, payload, picked = self._planned.pop()
            bodies = self._change(payload, picked)
            self.phases.append(Phase(int(row), bodies, float(energy)))

    def _change(self, payload: Payload, picked: bool) -> pin.Model:
        """Change the inertias of the run's model; returns the bodies that then are."""
        bodies = self.phases[-1].model.copy()  # without the armature of prescribed motion
        frame = bodies.frames[frame_index(bodies, payload.frame)]
        body = frame.placement.act(payload.body)
        for model in (self._model, bodies):
            held = model.inertias[frame.parentJoint]
            model.inertias[frame.parentJoint] = held + body if picked else held - body
        return bodies

    def _exchange(self, w: Workspace, payload: Payload, picked: bool) -> None:
        last, driven, speed = self.phases[-1], self._model.copy(), w.v.copy()
        bodies = self._change(payload, picked)
        brought = last.energy
        if w.steps > 0:
            if picked:
                ideal = set(self._mechanism.loops) - set(self._mechanism.clearance)
                rows = closing_rows(self._mechanism, w.q, ideal)
                w.v[:] = velocity_after_pick(driven, self._model, w.q, speed, rows)
            brought += _energy(bodies, w.q, w.v) - _energy(last.model, w.q, speed)
        row = -(-w.steps // self._every)
        self.phases.append(Phase(row, bodies, brought))


def _energy(model: pin.Model, q: np.ndarray, v: np.ndarray) -> float:
    """Kinetic and potential energy [J]."""
    data = model.createData()
    kinetic = pin.computeKineticEnergy(model, data, q, v)
    return float(kinetic + pin.computePotentialEnergy(model, data, q))
