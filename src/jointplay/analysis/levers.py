"""From the play of each joint to the motion of the tool: sources of play and their levers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.analysis.statics import Play, TurnPlay, play
from jointplay.errors import JointplayError, require_finite
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.model import z_to

GEAR = " (gear)"
"""Appended to a joint's name for the play of its gear."""


@dataclass(frozen=True)
class Part:
    """What one source of play does to the tool, at each of n poses."""

    name: str
    play: Play
    move: np.ndarray
    """Tool's displacement and rotation in world axes per displacement of the joint, (n, 6, 6)."""
    load: np.ndarray
    """Gravity and the tool's load on the joint, about its centre, bearing axes, (n, 6) [N, N m]."""

    def along(self, directions: np.ndarray, turn: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Farthest displacements of the tool that this play allows, along directions.

        Args:
            directions: unit vectors in world axes, shape (n, m, 3).
            turn: rotations of the tool instead of displacements.

        Returns:
            The support function (n, m) [m or rad], and the tool's error there (n, m, 6).
        """
        rows = self.move[:, 3:] if turn else self.move[:, :3]
        loads = np.einsum("nmk,nkj->nmj", directions, rows)
        support = self.play.support(loads.reshape(-1, 6))
        point = support.point.reshape(loads.shape)
        return support.value.reshape(loads.shape[:2]), np.einsum("nij,nmj->nmi", self.move, point)


def sources(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    *,
    force: Sequence[float] = (0.0, 0.0, 0.0),
    second_order: bool = True,
) -> tuple[Part, ...]:
    """Every source of play, and how it moves the tool at each pose; see `budget`."""
    if mechanism.loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: budgets are for robots without closed loops; "
            "simulate this mechanism instead (jointplay run)"
        )
    if not mechanism.clearance and not mechanism.gears:
        raise JointplayError(
            "nothing has play: give joints with clearance, or gears with play; joints: "
            + ", ".join(mechanism.joints)
        )
    q = configurations(mechanism, poses)
    push = np.array([require_finite("force on the tool", f, "N") for f in force])
    if push.shape != (3,):
        raise JointplayError(f"the force on the tool must have three components, got {force!r}")
    names = [(name, play(joint, second_order)) for name, joint in mechanism.clearance.items()]
    gears = [(name, TurnPlay(gear.play / 2.0)) for name, gear in mechanism.gears.items()]
    moves = np.zeros((len(names) + len(gears), len(q), 6, 6))
    loads = np.zeros((len(names) + len(gears), len(q), 6))
    for i, row in enumerate(q):
        pin.computeJointJacobians(mechanism.model, mechanism.data, row)
        tool = tool_place(mechanism, row)
        pin.centerOfMass(mechanism.model, mechanism.data, row, True)
        for j, (name, _) in enumerate([*names, *gears]):
            moves[j, i], loads[j, i] = _lever(mechanism, name, tool.translation, push)
    labels = [*names, *((name + GEAR, one) for name, one in gears)]
    return tuple(Part(name, one, moves[j], loads[j]) for j, (name, one) in enumerate(labels))


def configurations(mechanism: Mechanism, poses: np.ndarray | Mapping[str, float]) -> np.ndarray:
    """Configurations, shape (n, nq): journals centred, if given as joint positions by name."""
    if isinstance(poses, Mapping):
        return mechanism.configuration(poses)[None]
    q = np.atleast_2d(np.asarray(poses, float))
    if q.ndim != 2 or q.shape[1] != mechanism.model.nq or not np.isfinite(q).all():
        raise JointplayError(
            f"poses must be finite and of the shape (n, {mechanism.model.nq}), got {q.shape}"
        )
    return q


def tool_place(mechanism: Mechanism, q: np.ndarray) -> pin.SE3:
    """Where the tool is in configuration q (nq,)."""
    pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    return mechanism.data.oMf[mechanism.tool_frame].copy()


def _lever(
    mechanism: Mechanism, name: str, tool: np.ndarray, push: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Tool's displacement per displacement of the child at a joint (6, 6), and the joint's load.

    The play is the same both ways, so it does not matter which of the two bodies is the bearing.
    """
    model, data = mechanism.model, mechanism.data
    index, axes = place(mechanism, name)
    moves = index in model.supports[model.frames[mechanism.tool_frame].parentJoint]
    turn, centre = axes.rotation, axes.translation
    move, load = np.zeros((6, 6)), np.zeros(6)
    weight = data.mass[index] * np.array(mechanism.gravity)
    heavy = data.oMi[index].act(data.com[index])
    forces = [(weight, heavy)]
    if moves:
        arm = tool - centre
        move[:3, :3] = turn
        move[3:, 3:] = turn
        move[:3, 3:] = np.cross(turn.T, arm).T  # columns: axis x arm
        forces.append((push, tool))
    for force, at in forces:
        load[:3] += turn.T @ force
        load[3:] += turn.T @ np.cross(at - centre, force)
    return move, load


def place(mechanism: Mechanism, name: str) -> tuple[int, pin.SE3]:
    """The joint that carries the child's body, and the joint's axes in the world, z its axis."""
    data = mechanism.data
    if name in mechanism.clearance:
        i, bearing = mechanism.bearing_frame(name)
        return int(mechanism.model.getJointId(name)), data.oMi[i] * bearing
    index = int(mechanism.model.getJointId(name))
    place = data.oMi[index]
    column = pin.getJointJacobian(mechanism.model, data, index, pin.ReferenceFrame.WORLD)
    axis = column.reshape(6, -1)[3:, mechanism.model.joints[index].idx_v]
    return index, pin.SE3(z_to(axis), place.translation)
