"""Forces that joints transmit, for friction that grows with them: means over short intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.kernel.sites import LoadSite
from jointplay.kernel.workspace import Workspace
from jointplay.loads.base import Load, Site
from jointplay.loads.loaded_friction import LEVEL, RATE, TIME, LoadedFriction
from jointplay.mechanism.mechanism import Mechanism

REACTION_S = 2e-4
"""Interval over which a transmitted force is a mean [s]."""


class Reactions:
    """The loads of a run that follow the force that their joint transmits.

    Args:
        loads: all loads, by name.
        sites: what the kernels know of them.
        mechanism: where they act.
        workspace: of the run.
        step: time step [s].
    """

    def __init__(
        self,
        loads: Mapping[str, Load],
        sites: Sequence[LoadSite],
        mechanism: Mechanism,
        workspace: Workspace,
        step: float,
    ) -> None:
        """Find the joints and their axes."""
        self._workspace = workspace
        self.every = max(round(REACTION_S / step), 1)
        self._members = []
        self._pushers: list[tuple[int, Site]] = []
        for index, (load, site) in enumerate(zip(loads.values(), sites, strict=True)):
            if isinstance(load, LoadedFriction):
                self._members.append((load, site.numbers, *_axis(mechanism, load.joint)))
            elif site.carriers is not None:
                self._pushers.append((index, load.site(mechanism)))
        self._data: pin.Data | None = None
        self._none = pin.StdVec_Force()
        self._none.extend([pin.Force.Zero()] * mechanism.model.njoints)
        self._before: tuple[float, np.ndarray, np.ndarray] | None = None

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._members)

    def until_next(self, step: int) -> int | None:
        """Steps from `step` until they are found again; None if never."""
        return self.every - step % self.every if self._members else None

    def due(self, step: int) -> bool:
        """Whether they are found at `step`."""
        return bool(self._members) and step % self.every == 0

    def memory(self) -> list[Any] | None:
        """Time and state of the last look, for a checkpoint."""
        if self._before is None:
            return None
        time, q, v = self._before
        return [time, q.tolist(), v.tolist()]

    def recall(self, memory: Sequence[Any] | None) -> None:
        """Go on from that look."""
        if memory is not None:
            time, q, v = memory
            self._before = float(time), np.array(q, float), np.array(v, float)

    def begin(self, model: pin.Model, v: np.ndarray, acceleration: np.ndarray) -> None:
        """Take the forces of the first instant, which no friction has changed yet."""
        w = self._workspace
        for (_, numbers, *_rest), level in zip(
            self._members, self._friction(model, w.q, v, acceleration), strict=True
        ):
            numbers[TIME], numbers[LEVEL], numbers[RATE] = w.time, level, 0.0
        self._before = (w.time, w.q.copy(), v.copy())

    def follow(self, model: pin.Model, v: np.ndarray) -> None:
        """Take the mean forces since the last time, and draw them on along a line."""
        w = self._workspace
        assert self._before is not None
        time, q, speed = self._before
        span = w.time - time
        if span <= 0.0:
            return
        middle = 0.5 * (w.q + q), (w.q - q) / span, (v - speed) / span
        for (_, numbers, *_rest), level in zip(
            self._members, self._friction(model, *middle), strict=True
        ):
            now = time + 0.5 * span
            apart = now - numbers[TIME]
            rate = (level - numbers[LEVEL]) / apart if apart > 0.0 else 0.0
            numbers[TIME], numbers[LEVEL], numbers[RATE] = now, level, rate
        self._before = (w.time, w.q.copy(), v.copy())

    def _friction(
        self, model: pin.Model, q: np.ndarray, v: np.ndarray, a: np.ndarray
    ) -> list[float]:
        if self._data is None:
            self._data = model.createData()
        data = self._data
        pin.rnea(model, data, q, v, a, self._external(model, data, q))
        return [
            load.friction(data.f[joint].linear, axis, slides)
            for load, _, joint, axis, slides in self._members
        ]

    def _external(self, model: pin.Model, data: pin.Data, q: np.ndarray) -> pin.StdVec_Force:
        """Wrenches of loads between frames, on the bodies and in their joints' frames."""
        if not self._pushers:
            return self._none
        forces = pin.StdVec_Force()
        forces.extend([pin.Force.Zero()] * model.njoints)
        pin.forwardKinematics(model, data, q)
        for index, site in self._pushers:
            assert site.frames is not None
            (i, first), (j, second) = site.frames
            wrench = self._workspace.loads["wrench"][index]
            turn = (data.oMi[i] * first).rotation
            at = (data.oMi[j] * second).translation
            acting = pin.SE3(np.eye(3), at).act(pin.Force(turn @ wrench[:3], turn @ wrench[3:]))
            forces[j] = forces[j] + data.oMi[j].actInv(acting)
            forces[i] = forces[i] - data.oMi[i].actInv(acting)
        return forces


def _axis(mechanism: Mechanism, name: str) -> tuple[int, np.ndarray, bool]:
    """Pinocchio joint, its axis in its own frame, and whether it slides."""
    model = mechanism.model
    index = int(model.getJointId(name))
    slides = mechanism.description.joints[name].slides
    if name in mechanism.clearance:
        return index, np.array([0.0, 0.0, 1.0]), slides
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    local = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
    column = local.reshape(6, model.nv)[:, model.joints[index].idx_v]
    return index, column[:3] if slides else column[3:], slides
