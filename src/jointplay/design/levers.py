"""From the play of each joint to the motion of the tool: sources of play and their levers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError, require_finite
from jointplay.design import loops
from jointplay.joints.play import Cone, Cones, Play, Support
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.model import z_to

# How far the journals of a joint can move in their bearing, without forces: exact, in closed
# form.
#
# A joint's play is a set of small displacements of the child's body against the parent's: the
# journal's centre c [m] and rotation vector phi [rad], in bearing axes. What a load can reach in
# that set is its support function
#
#     h(F, M) = max (F . c + M . phi)
#
# for a load F [N], M [N m] about the bearing's centre. The displacement at which the maximum is
# attained is where the journal rests under this load, if nothing rubs. Sums of such sets have the
# sum of the support functions, so a robot's budget is a sum over its joints (`budget`).
#
# The sets follow from the gaps of docs/theory.md. In the first order of the clearance they are
# convex: for a journal of length L with its rims' centres p = c + L/2 s and q = c - L/2 s, where
# s is the lean of its axis,
#
#     |p| <= C_r,  |q| <= C_r,  |c_z| + R_j |s| <= C_a
#
# In the second order a leaning journal has a little more room, R_j |s|^2 / 2 across and L |s|^2 /
# 4 along: the true set is not quite convex. Here both clearances are widened by what the largest
# lean gives, so that h is never too small; `excess` says by which part it may be too large.


@dataclass(frozen=True)
class TurnPlay(Play):
    """A gear's backlash: the joint turns about its axis while the motor stands."""

    half: float
    """Half of the whole play [rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        """No displacement, half of the play."""
        return 0.0, self.half

    @property
    def cones(self) -> Cones:
        """As far either way."""
        return Cones(self.half * np.eye(6)[:, 5:], (Cone(np.eye(1), np.zeros(1), 1.0),))

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        point = np.zeros((len(loads), 6))
        point[:, 5] = self.half * np.sign(loads[:, 5])
        return Support(np.abs(loads[:, 5]) * self.half, point)


# In a tree a joint's play moves all that it carries. In a closed loop the joints that are not
# driven follow (`loops`), the tool with them; and plays of one loop may hold each other
# (`Part.tie`).


GEAR = " (gear)"
"""Appended to a joint's name for the play of its gear."""
_FELT = 1e-9
"""Motion of the tool per motion of a coordinate that is none [1 or m]."""


@dataclass(frozen=True)
class Part:
    """What one source of play does to the tool, at each of n poses."""

    name: str
    play: Play
    move: np.ndarray
    """Tool's displacement and rotation in world axes per displacement of the joint, (n, 6, 6)."""
    load: np.ndarray
    """Gravity and the tool's load on the joint, about its centre, bearing axes, (n, 6) [N, N m]."""
    tie: np.ndarray | None = None
    """By how much each displacement opens loops that nothing else can close, (n, r, 6), zero in
    sum over all parts; None: no loops hold the plays. See `loop_play`."""

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
    driven: Sequence[str] | None = None,
    loops: bool = False,
) -> tuple[Part, ...]:
    """Every source of play, and how it moves the tool at each pose; arguments are `budget`'s.

    With `loops` the caller heeds `Part.tie`; else mechanisms with loops are refused.
    """
    if mechanism.loops and not loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: this is for robots without closed loops; "
            "jointplay budget and allocate take them, and so does jointplay run"
        )
    if not mechanism.clearance and not mechanism.gears:
        raise JointplayError(
            "nothing has play: give joints with clearance, or gears with play; joints: "
            + ", ".join([*mechanism.joints, *mechanism.loops])
        )
    q = configurations(mechanism, poses, driven)
    push = np.array([require_finite("force on the tool", f, "N") for f in force])
    if push.shape != (3,):
        raise JointplayError(f"the force on the tool must have three components, got {force!r}")
    names = [(name, joint.play(second_order)) for name, joint in mechanism.clearance.items()]
    gears = [(name, TurnPlay(gear.play / 2.0)) for name, gear in mechanism.gears.items()]
    labels = [*names, *gears]
    moves = np.zeros((len(labels), len(q), 6, 6))
    loads = np.zeros((len(labels), len(q), 6))
    following = _Following(mechanism, q, driven) if mechanism.loops else None
    ties: list[np.ndarray] = []
    for i, row in enumerate(q):
        pin.computeJointJacobians(mechanism.model, mechanism.data, row)
        tool = tool_place(mechanism, row)
        pin.centerOfMass(mechanism.model, mechanism.data, row, True)
        for j, (name, _) in enumerate(labels):
            if name not in mechanism.loops:
                moves[j, i], loads[j, i] = _lever(mechanism, name, tool.translation, push)
        if following is not None:
            joints = [name for name, _ in labels]
            ties.append(following.add(i, joints, push, moves[:, i], loads[:, i]))
    named = [*names, *((name + GEAR, one) for name, one in gears)]
    for name, _ in names:
        if any(name == source + GEAR for source, _ in gears):
            raise JointplayError(f"the joint {name!r} is called like the gear of another joint")
    tied = _padded(ties) if ties else None
    if tied is not None and not _hold(tied, [one for _, one in labels]):
        tied = None
    return tuple(
        Part(name, one, moves[j], loads[j], None if tied is None else tied[j])
        for j, (name, one) in enumerate(named)
    )


def configurations(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    driven: Sequence[str] | None = None,
) -> np.ndarray:
    """Configurations, shape (n, nq): journals centred, loops closed.

    Args:
        mechanism: the robot.
        poses: joint positions by name, the rest zero; or configurations (n, nq).
        driven: see `budget`; positions of other joints of a loop say from where it is closed.

    Raises:
        JointplayError: a wrong shape; a loop that cannot be closed.
        MissingName: no such joint.
    """
    if isinstance(poses, Mapping):
        q = mechanism.configuration(poses)[None]
    else:
        q = np.atleast_2d(np.asarray(poses, float))
    if q.ndim != 2 or q.shape[1] != mechanism.model.nq or not np.isfinite(q).all():
        raise JointplayError(
            f"poses must be finite and of the shape (n, {mechanism.model.nq}), got {q.shape}"
        )
    if not mechanism.loops or all(loops.is_closed(mechanism, row) for row in q):
        return q
    names = loops.driven_joints(mechanism, q[0], driven)
    passive = loops.passive_coordinates(mechanism, names)
    closed, good = loops.close_all(mechanism, q, passive)
    if not good.all():
        at = int(np.argmin(good))
        raise JointplayError(loops.blame(mechanism, q[at], names, at, len(q)))
    return closed


def _hold(ties: np.ndarray, plays: Sequence[Play]) -> bool:
    """Whether ties (j, n, r, 6) hold any of the plays."""
    pairs = zip(ties, plays, strict=True)
    return any(
        np.abs(tie @ one.cones.spread).max(initial=0.0) > _FELT * max(one.reach)
        for tie, one in pairs
    )


def _padded(ties: Sequence[np.ndarray]) -> np.ndarray:
    """Ties of all poses (each (j, r, 6)) with as many rows, shape (j, n, r, 6)."""
    rows = max(one.shape[1] for one in ties)
    full = np.zeros((len(ties[0]), len(ties), rows, 6))
    for i, one in enumerate(ties):
        full[:, i, : one.shape[1]] = one
    return full


class _Following:
    """What follows through the loops when a joint's play moves."""

    def __init__(self, mechanism: Mechanism, q: np.ndarray, driven: Sequence[str] | None) -> None:
        self._mechanism, self._q = mechanism, q
        self._drives = loops.driven_joints(mechanism, q[0], driven)
        self._passive = loops.passive_coordinates(mechanism, self._drives)

    def add(
        self,
        pose: int,
        joints: Sequence[str],
        push: np.ndarray,
        moves: np.ndarray,
        loads: np.ndarray,
    ) -> np.ndarray:
        """Add to levers (j, 6, 6) and loads (j, 6) at a pose; the joints' ties (j, r, 6)."""
        mechanism, q, passive = self._mechanism, self._q[pose], self._passive
        model, data = mechanism.model, mechanism.data
        give = loops.linear(mechanism, q, passive)
        pin.computeJointJacobians(model, data, q)
        axes_of_world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        tool = pin.getFrameJacobian(model, data, mechanism.tool_frame, axes_of_world)
        tool = tool.reshape(6, model.nv)
        if np.abs(tool[:, passive] @ give.loose).max(initial=0.0) > _FELT:
            raise JointplayError(self._undetermined(pose))
        weight = tool[:3].T @ push - pin.computeGeneralizedGravity(model, data, q)
        pin.computeJointJacobians(model, data, q)
        ties = np.zeros((len(joints), len(give.rest), 6))
        for j, name in enumerate(joints):
            if name in mechanism.loops:
                opened = loops.own_opening(mechanism, name)
            else:
                index, axes = place(mechanism, name)
                along = axes.rotation
                arm = np.cross(axes.translation, along, axisb=0, axisc=0)  # centre x each axis
                twist = np.block([[along, arm], [np.zeros((3, 3)), along]])
                opened = loops.opening(mechanism, index, twist)
            opened = give.weight[:, None] * opened
            followed = -give.follow @ opened
            moves[j] += tool[:, passive] @ followed
            loads[j] += followed.T @ weight[passive]
            ties[j] = give.rest @ opened
        return ties

    def _undetermined(self, pose: int) -> str:
        q, count = self._q[pose], len(self._q)
        at = ", ".join(f"{n} {q[self._mechanism.coordinate(n)]:.6g}" for n in self._drives)
        where = f" (pose {pose + 1} of {count})" if count > 1 else ""
        return (
            f"the driven joints do not determine the tool {self._mechanism.tool!r} at "
            f"{at or 'no joint driven'}{where}: a singular position, or too few driven joints"
        )


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
    """The joint that carries the child's body; the bearing's axes, z its axis, at the journal."""
    data = mechanism.data
    if name in mechanism.clearance:
        (i, bearing), (j, journal) = mechanism.bearing_frame(name), mechanism.journal_frame(name)
        centre = (data.oMi[j] * journal).translation
        return int(mechanism.model.getJointId(name)), pin.SE3(
            (data.oMi[i] * bearing).rotation, centre
        )
    index = int(mechanism.model.getJointId(name))
    place = data.oMi[index]
    column = pin.getJointJacobian(mechanism.model, data, index, pin.ReferenceFrame.WORLD)
    axis = column.reshape(6, -1)[3:, mechanism.model.joints[index].idx_v]
    return index, pin.SE3(z_to(axis), place.translation)
