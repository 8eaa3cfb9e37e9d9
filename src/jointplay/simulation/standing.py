"""What loads do to a machine that stands: energies of springs and stops, and given forces."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from jointplay.kernel.sites import Carriers, LoadSite
from jointplay.loads.base import Load, compiled_law
from jointplay.mechanism.mechanism import Mechanism

_MOTION = 1e-6
"""Displacement by which stiffnesses are found [m or rad]."""

_NUMBERS = ctypes.POINTER(ctypes.c_double)


def relative_pose(data: pin.Data, frames: Carriers) -> np.ndarray:
    """Pose of the second frame in the first: origin, then rotation row by row, (12,)."""
    (i, first), (j, second) = frames
    pose = (data.oMi[i] * first).actInv(data.oMi[j] * second)
    return np.concatenate([pose.translation, pose.rotation.ravel()])


def relative_motion(data: pin.Data, frames: Carriers, signs: np.ndarray) -> np.ndarray:
    """Motion of the second frame's origin in axes of the first, per velocity, (6, nv)."""
    (i, first), (j, second) = frames
    turn = (data.oMi[i] * first).rotation
    centre = (data.oMi[j] * second).translation
    columns = data.J.reshape(6, -1) * signs
    linear = columns[:3] + np.cross(columns[3:], centre, axisa=0, axisc=0)
    return np.concatenate([turn.T @ linear, turn.T @ columns[3:]])


class StandingLoads:
    """The loads of a machine at time 0.

    What a load stores energy for has a potential; anything else, such as a wrench, a damper at a
    moving start or a compiled controller, is a given force. What sampled controllers will give is
    not known yet and not counted, nor is friction that grows with a joint's load.

    Args:
        loads: by name.
        mechanism: on which they act.
        sites: what the kernels know of them.
    """

    def __init__(
        self, loads: Mapping[str, Load], mechanism: Mechanism, sites: Sequence[LoadSite]
    ) -> None:
        """Find where they act."""
        self._members = [
            _Standing(load, site, mechanism.model.nv)
            for load, site in zip(loads.values(), sites, strict=True)
        ]

    def given(self, model: pin.Model, data: pin.Data, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Generalised forces of what is no potential, (nv,)."""
        pin.computeJointJacobians(model, data, q)
        forces = np.zeros(model.nv)
        for one in self._members:
            x, moves = one.place(data, q), one.moves(data)
            answer = one.answer(x, moves @ v)
            if one.load.stores:
                answer = answer - one.answer(x, np.zeros(len(moves)))
            forces += one.pushes(data).T @ np.nan_to_num(answer, posinf=0.0, neginf=0.0)
        return forces

    def energy(self, data: pin.Data, q: np.ndarray) -> float:
        """Energy that they store [J]; data has the bodies' places."""
        return float(
            sum(
                one.load.energy(one.place(data, q)[None], one.site.numbers)[0]
                for one in self._members
                if one.load.stores
            )
        )

    def slopes(self, data: pin.Data, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (nv,) and curvature (nv, nv) of the energy; data has the joints' Jacobians."""
        gradient, curvature = np.zeros(len(q)), np.zeros((len(q), len(q)))
        for one in self._members:
            if one.load.stores:
                x, moves, pushes = one.place(data, q), one.moves(data), one.pushes(data)
                gradient -= pushes.T @ one.answer(x, np.zeros(len(moves)))
                curvature += pushes.T @ one.stiffness(x) @ moves
        return gradient, curvature


class _Standing:
    """One load."""

    def __init__(self, load: Load, site: LoadSite, nv: int) -> None:
        self.load, self.site = load, site
        self._law = ctypes.CFUNCTYPE(None, ctypes.c_double, *(_NUMBERS,) * 4)(
            compiled_law(load).address
        )
        self._every = np.eye(nv)

    def place(self, data: pin.Data, q: np.ndarray) -> np.ndarray:
        """What its law sees."""
        if self.site.carriers is None:
            return q[list(self.site.seen)]
        return relative_pose(data, self.site.carriers)

    def moves(self, data: pin.Data) -> np.ndarray:
        """Rates that its law sees, per velocity."""
        if self.site.carriers is None:
            return self._every[list(self.site.seen)]
        assert self.site.signs is not None
        return relative_motion(data, self.site.carriers, self.site.signs)

    def pushes(self, data: pin.Data) -> np.ndarray:
        """What its law's answer acts on."""
        if self.site.carriers is None:
            return self._every[list(self.site.pushed)]
        return self.moves(data)

    def answer(self, x: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Its law's, at time 0."""
        out = np.zeros(self.site.size)
        given = [np.ascontiguousarray(one, float) for one in (x, rate, self.site.numbers)]
        self._law(0.0, *(one.ctypes.data_as(_NUMBERS) for one in (*given, out)))
        if self.site.bounds:
            out = np.clip(out, -np.array(self.site.bounds), self.site.bounds)
        return out

    def stiffness(self, x: np.ndarray) -> np.ndarray:
        """How its answer at rest falls with what it sees, by differences."""
        rate = np.zeros(6 if self.site.carriers else len(x))
        columns = []
        for k in range(len(rate)):
            ends = [
                self.answer(_moved(x, k, way, bool(self.site.carriers)), rate) for way in (1, -1)
            ]
            columns.append((ends[1] - ends[0]) / (2.0 * _MOTION))
        return np.stack(columns, axis=1)


def _moved(x: np.ndarray, k: int, way: int, frames: bool) -> np.ndarray:
    x = x.copy()
    if not frames or k < 3:
        x[k] += way * _MOTION
        return x
    turn = pin.exp3(way * _MOTION * np.eye(3)[k - 3])
    x[3:] = (turn @ x[3:].reshape(3, 3)).ravel()
    return x
