"""Sources of play, how each moves the tool, and how far all of them together can.

A joint's play is a set of small displacements of the child's body against the parent's: the
journal's centre c [m] and rotation vector phi [rad], in bearing axes. What a load can reach in that
set is its support function

    h(F, M) = max (F . c + M . phi)

for a load F [N], M [N m] about the bearing's centre. The displacement at which the maximum is
attained is where the journal rests under this load, if nothing rubs. Sums of such sets have the sum
of the support functions, so a robot's budget is a sum over its joints.

The sets follow from the gaps of docs/theory.md. In the first order of the clearance they are
convex: for a journal of length L with its rims' centres p = c + L/2 s and q = c - L/2 s, where s is
the lean of its axis,

    |p| <= C_r,  |q| <= C_r,  |c_z| + R_j |s| <= C_a

In the second order a leaning journal has a little more room, R_j |s|^2 / 2 across and L |s|^2 / 4
along: the true set is not quite convex. Here both clearances are widened by what the largest lean
gives, so that h is never too small; `Play.excess` says by which part it may be too large.

In a tree a joint's play moves all that it carries. In a closed loop the joints that are not driven
follow (`loops`), the tool with them; and plays of one loop may hold each other (`loop_play`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError, require_finite, require_numbers
from jointplay.design import loop_play
from jointplay.joints import Coordinate
from jointplay.joints.play import Cone, Cones, JournalPlay, Play, Support
from jointplay.mechanism.closed_loops import ClosedLoops, is_closed, opening, own_opening
from jointplay.mechanism.mechanism import Mechanism, frame_index
from jointplay.mechanism.model import z_to

GEAR = " (gear)"
"""Appended to a joint's name for the play of its gear."""
_FELT = 1e-9
"""Motion of the tool per motion of a coordinate that is none [1 or m]."""
_FITS = 1e-9
"""Part of what the plays could open that may stay open."""


@dataclass(frozen=True)
class TurnPlay(Play):
    """A gear's play and hysteresis: the joint turns about its axis while the motor stands."""

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


@dataclass(frozen=True)
class LeanPlay(Play):
    """A lean of the axis alone, in a disc: what reduced models know of a journal's play."""

    tilt: float
    """Either way [rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        """No displacement, the lean."""
        return 0.0, self.tilt

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        moment = loads[:, 3:5]
        size = np.linalg.norm(moment, axis=1)
        point = np.zeros((len(loads), 6))
        some = size > 0.0
        point[some, 3:5] = self.tilt * moment[some] / size[some, None]
        return Support(self.tilt * size, point)


@dataclass(frozen=True)
class States:
    """Farthest states of j sources of play at n poses along m directions."""

    value: np.ndarray
    """By source, their sum being a bound, shape (j, n, m) [m or rad]."""
    point: np.ndarray
    """Displacements of the joints, which attain it, shape (j, n, m, 6)."""
    error: np.ndarray
    """The tool's error there, by source, shape (j, n, m, 6)."""


@dataclass(frozen=True)
class PlaySources:
    """All sources of play of a machine at n poses: what they are, and what they do to the tool."""

    names: tuple[str, ...]
    """Joints with clearance, then gears; length j."""
    plays: tuple[Play, ...]
    move: np.ndarray
    """The tool's displacement and rotation in world axes per the joint's own, (j, n, 6, 6)."""
    load: np.ndarray
    """Gravity and the tool's load on the joint, about its centre, bearing axes, (j, n, 6) [N, N m].
    """
    tie: np.ndarray
    """By how much each displacement opens loops that nothing else can close, (j, n, r, 6), zero in
    sum over all sources; r is zero if no loops hold the plays. See `loop_play`."""

    @property
    def tied(self) -> bool:
        """Whether plays hold each other."""
        return self.tie.shape[2] > 0

    def subset(self, sources: Any = slice(None), poses: Any = slice(None)) -> PlaySources:
        """Some of the sources and poses, by indices or slices."""
        some = np.arange(len(self.names))[sources]
        arrays = (array[some][:, poses] for array in (self.move, self.load, self.tie))
        return PlaySources(
            tuple(self.names[i] for i in some), tuple(self.plays[i] for i in some), *arrays
        )

    def along(
        self, directions: np.ndarray, turn: bool = False, scale: np.ndarray | None = None
    ) -> States:
        """Farthest displacements of the tool that all plays together allow, along directions.

        Args:
            directions: unit vectors in world axes, shape (n, m, 3).
            turn: rotations of the tool instead of displacements.
            scale: what the clearances of each source are multiplied by, shape (j,).
        """
        rows = self.move[:, :, 3:] if turn else self.move[:, :, :3]
        return self._farthest(np.einsum("nmk,jnki->jnmi", directions, rows), scale)

    def at_rest(self) -> States:
        """Where gravity and the tool's load put the journals, without friction; m is one."""
        return self._farthest(self.load[:, :, None])

    def climb(
        self, d: np.ndarray, steps: int, turn: bool = False, scale: np.ndarray | None = None
    ) -> np.ndarray:
        """Directions (n, 3) in which the tool gets no less far than along directions `d`.

        In each step d is replaced by the direction of the point that is farthest along d.
        """
        wanted = slice(3, 6) if turn else slice(0, 3)
        for _ in range(steps):
            total = self.along(d[:, None], turn, scale).error.sum(axis=0)[:, 0, wanted]
            size = np.linalg.norm(total, axis=1, keepdims=True)
            d = np.where(size > 0.0, total / np.where(size > 0.0, size, 1.0), d)
        return d

    def _farthest(self, loads: np.ndarray, scale: np.ndarray | None = None) -> States:
        """See `along`; loads (j, n, m, 6) of any unit."""
        j, n, m, _ = loads.shape
        factor = np.ones((j, 1, 1)) if scale is None else scale[:, None, None]
        flat = loads.reshape(j, n * m, 6)
        plays = [loop_play.ended(play) for play in self.plays] if self.tied else self.plays
        values, point = np.empty(flat.shape[:2]), np.empty_like(flat)
        for play in dict.fromkeys(plays):  # alike ones together: many at once cost little more
            alike = [number for number, one in enumerate(plays) if one == play]
            found = play.support(flat[alike].reshape(-1, 6))
            values[alike] = found.value.reshape(len(alike), -1)
            point[alike] = found.point.reshape(len(alike), -1, 6)
        value, point = factor[..., 0] * values, factor * point
        if self.tied:
            ties = np.repeat(factor[..., None] * self.tie, m, axis=1)
            opened = np.abs(np.einsum("jnri,jni->nr", ties, point / factor)).max(axis=1)
            able = sum(loop_play.opening(*pair) for pair in zip(plays, ties, strict=True))
            (some,) = np.nonzero(opened > _FITS * able)
            if len(some):
                value[:, some], inner = loop_play.farthest(
                    plays, (factor * flat)[:, some], ties[:, some]
                )
                point[:, some] = factor * inner
        point = point.reshape(j, n, m, 6)
        error = np.einsum("jnik,jnmk->jnmi", self.move, point)
        if self.tied:
            self._check_ends(point, error)
        return States(value.reshape(j, n, m), point, error)

    def _check_ends(self, point: np.ndarray, error: np.ndarray) -> None:
        """Refuse a journal without end walls at an end that it has not, if the tool feels it."""
        for name, play, at, errors in zip(self.names, self.plays, point, error, strict=True):
            if not isinstance(play, JournalPlay) or not math.isinf(play.along):
                continue
            far = np.abs(at[..., 2]) > 0.5 * loop_play.FAR * play.across
            if (far & (np.abs(errors[..., :3]).max(axis=-1) > play.across)).any():
                raise JointplayError(
                    f"nothing limits the journal of {name!r} along its axis, and the tool feels "
                    "it: give the joint end walls (an axial clearance), or lock_axial"
                )


def sources(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    *,
    force: Sequence[float] = (0.0, 0.0, 0.0),
    second_order: bool = True,
    driven: Sequence[str] | None = None,
    loops: bool = False,
    relative_to: str | None = None,
) -> PlaySources:
    """Every source of play, and how it moves the tool at each pose; arguments are `budget`'s.

    With `loops` mechanisms with loops are taken, too, whose plays may be tied to each other.
    """
    if relative_to is not None:
        _check_body(mechanism, relative_to)
    if mechanism.loops and not loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: this works only for robots without closed "
            "loops; jointplay budget, allocate and run accept them"
        )
    if not mechanism.clearance and not mechanism.gears:
        raise JointplayError(
            "nothing has play: give joints with clearance, or gears with play (in a "
            'command: --clearance "0.1 mm" for all that move the tool, or --joint '
            'NAME="0.1 mm"); joints: ' + ", ".join([*mechanism.joints, *mechanism.loops])
        )
    q = configurations(mechanism, poses, driven)
    push = np.array([require_finite("force on the tool", f, "N") for f in force])
    if push.shape != (3,):
        raise JointplayError(f"the force on the tool must have three components, got {force!r}")
    gears = [name + GEAR for name in mechanism.gears]
    for name in set(gears) & set(mechanism.clearance):
        raise JointplayError(f"the joint {name!r} has the same name as the gear of another joint")
    plays = [joint.play(second_order) for joint in mechanism.clearance.values()]
    plays += [TurnPlay(gear.unloaded_range / 2.0) for gear in mechanism.gears.values()]
    joints = [*mechanism.clearance, *mechanism.gears]
    moves, loads = np.zeros((len(joints), len(q), 6, 6)), np.zeros((len(joints), len(q), 6))
    closing = ClosedLoops(mechanism, q[0], driven) if mechanism.loops else None
    ties = []
    for i, row in enumerate(q):
        pin.computeJointJacobians(mechanism.model, mechanism.data, row)
        tool = tool_place(mechanism, row)
        pin.centerOfMass(mechanism.model, mechanism.data, row, True)
        for j, name in enumerate(joints):
            if name not in mechanism.loops:
                moves[j, i], loads[j, i] = lever(
                    mechanism, name, tool.translation, push, relative_to
                )
        if closing is not None:
            ties.append(_follow(closing, q, i, joints, push, moves, loads))
    most = max((one.shape[1] for one in ties), default=0)
    tie = np.zeros((len(joints), len(q), most, 6))
    for i, one in enumerate(ties):
        tie[:, i, : one.shape[1]] = one
    holds = (
        np.abs(one @ play.cones.spread).max(initial=0.0) > _FELT * max(play.reach)
        for one, play in zip(tie, plays, strict=True)
        if most
    )
    if not any(holds):
        tie = tie[:, :, :0]
    return PlaySources((*mechanism.clearance, *gears), tuple(plays), moves, loads, tie)


def _check_body(mechanism: Mechanism, body: str) -> None:
    """Refuse a body from which the tool's motion cannot be seen."""
    frame_index(mechanism.model, body, "body", where=("relative_to",))
    if mechanism.loops:
        raise JointplayError(
            f"relative_to {body!r}: a budget relative to a body works only for robots without "
            "closed loops",
            where=("relative_to",),
        )
    if body == mechanism.tool:
        raise JointplayError(
            f"relative_to {body!r} is the tool itself: name another body, or another tool",
            where=("relative_to",),
        )


def configurations(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    driven: Sequence[str] | None = None,
) -> np.ndarray:
    """Configurations, shape (n, nq): journals centred, loops closed.

    Args:
        poses: joint positions by name, the rest zero; or configurations (n, nq).
        driven: see `budget`; positions of other joints of a loop say from where it is closed.

    Raises:
        JointplayError: a wrong shape; a loop that cannot be closed.
        MissingName: no such joint.
    """
    if mechanism.free_base is not None:
        raise JointplayError(
            "static budgets are of a base that is held, and this one is free: take the mechanism "
            'with base = "held"; relative_to then names the body whose motion does not count'
        )
    if isinstance(poses, Mapping):
        q = mechanism.configuration(poses)[None]
    else:
        q = np.atleast_2d(require_numbers("poses", poses, ("poses",)))
    if q.ndim != 2 or q.shape[1] != mechanism.model.nq or not np.isfinite(q).all():
        raise JointplayError(
            f"poses must be finite and of the shape (n, {mechanism.model.nq}), got {q.shape}"
        )
    if not mechanism.loops or all(is_closed(mechanism, row) for row in q):
        return q
    return ClosedLoops(mechanism, q[0], driven).closed(q)


def _follow(
    closing: ClosedLoops,
    q: np.ndarray,
    pose: int,
    joints: Sequence[str],
    push: np.ndarray,
    moves: np.ndarray,
    loads: np.ndarray,
) -> np.ndarray:
    """Add what follows through the loops to levers and loads (j, n, ...) at a pose of q (n, nq).

    Returns:
        The joints' ties there, (j, r, 6).
    """
    mechanism, passive = closing.mechanism, closing.passive
    model, data = mechanism.model, mechanism.data
    give = closing.linear(q[pose])
    pin.computeJointJacobians(model, data, q[pose])
    axes_of_world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    tool = pin.getFrameJacobian(model, data, mechanism.tool_frame, axes_of_world)
    tool = tool.reshape(6, model.nv)
    if np.abs(tool[:, passive] @ give.loose).max(initial=0.0) > _FELT:
        sizes = np.abs(give.loose).max(axis=1, initial=0.0)
        names = ", ".join(
            dict.fromkeys(
                repr(mechanism.coordinates[i].joint)
                for i, size in zip(passive, sizes, strict=True)
                if size > _FELT
            )
        )
        raise JointplayError(
            f"the driven joints ({', '.join(map(repr, closing.driven)) or 'none'}) do not "
            f"determine the tool {mechanism.tool!r} at {closing.stands(q[pose], pose, len(q))}: "
            f"nothing determines {names} (a singular position, or too few driven joints)"
        )
    weight = tool[:3].T @ push - pin.computeGeneralizedGravity(model, data, q[pose])
    pin.computeJointJacobians(model, data, q[pose])
    ties = np.zeros((len(joints), len(give.rest), 6))
    for j, name in enumerate(joints):
        if name in mechanism.loops:
            opened = own_opening(mechanism, name)
        else:
            index, axes = place(mechanism, name)
            along = axes.rotation
            arm = np.cross(axes.translation, along, axisb=0, axisc=0)  # centre x each axis
            twist = np.block([[along, arm], [np.zeros((3, 3)), along]])
            opened = opening(mechanism, index, twist)
        opened = give.weight[:, None] * opened
        followed = -give.follow @ opened
        moves[j, pose] += tool[:, passive] @ followed
        loads[j, pose] += followed.T @ weight[passive]
        ties[j] = give.rest @ opened
    return ties


def tool_place(mechanism: Mechanism, q: np.ndarray, relative_to: str | None = None) -> pin.SE3:
    """Where the tool is in configuration q (nq,), in the world or in a body's axes."""
    pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    tool = mechanism.data.oMf[mechanism.tool_frame].copy()
    if relative_to is None:
        return tool
    return mechanism.data.oMf[frame_index(mechanism.model, relative_to)].actInv(tool)


def lever(
    mechanism: Mechanism,
    name: str,
    tool: np.ndarray,
    push: np.ndarray,
    relative_to: str | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Tool's displacement per displacement of the child at a joint (6, 6), and the joint's load.

    The play is the same both ways, so it does not matter which of the two bodies is the bearing.
    Relative to a body, in its axes: what moves both does not count, and what moves only the body
    moves the tool the other way.
    """
    model, data = mechanism.model, mechanism.data
    index, axes = place(mechanism, name)
    turn, centre = axes.rotation, axes.translation
    move, load = np.zeros((6, 6)), np.zeros(6)
    forces = []
    if data.mass[index] > 0.0:  # what has no mass has no centre of mass
        weight = data.mass[index] * np.array(mechanism.gravity)
        forces.append((weight, data.oMi[index].act(data.com[index])))
    moved = index in model.supports[model.frames[mechanism.tool_frame].parentJoint]
    sign = float(moved)
    if relative_to is not None:
        body = frame_index(model, relative_to)
        sign -= float(index in model.supports[model.frames[body].parentJoint])
    if sign:
        move[:3, :3] = move[3:, 3:] = sign * turn
        move[:3, 3:] = sign * np.cross(turn.T, tool - centre).T  # columns: axis x arm
    if relative_to is not None:
        back = data.oMf[body].rotation.T
        move = np.concatenate([back @ move[:3], back @ move[3:]])
    if moved:
        forces.append((push, tool))
    for force, at in forces:
        load[:3] += turn.T @ force
        load[3:] += turn.T @ np.cross(at - centre, force)
    return move, load


def place(mechanism: Mechanism, name: str) -> tuple[int, pin.SE3]:
    """The joint that carries the child's body; the bearing's axes, z its axis, at the journal."""
    data = mechanism.data
    index = int(mechanism.model.getJointId(name))
    if name in mechanism.clearance:
        (i, bearing), (j, journal) = mechanism.bearing_frame(name), mechanism.journal_frame(name)
        centre = (data.oMi[j] * journal).translation
        return index, pin.SE3((data.oMi[i] * bearing).rotation, centre)
    column = pin.getJointJacobian(mechanism.model, data, index, pin.ReferenceFrame.WORLD)
    axis = column.reshape(6, -1)[3:, mechanism.model.joints[index].idx_v]
    return index, pin.SE3(z_to(axis), data.oMi[index].translation)


def displaced(
    closing: ClosedLoops, q: np.ndarray, aside: Mapping[str, np.ndarray]
) -> pin.SE3 | None:
    """Where the tool is, exactly, with journals displaced; None if the loops cannot be closed.

    Args:
        q: a closed configuration, journals centred, shape (nq,).
        aside: displacement and rotation vector of the child's body in bearing axes, by source of
            play, shape (6,) [m, rad].
    """
    mechanism = closing.mechanism
    at_loops = {
        name: pin.SE3(pin.exp3(xi[3:]), xi[:3])
        for name, xi in aside.items()
        if name in mechanism.loops
    }
    own = {name: xi for name, xi in aside.items() if name not in at_loops}
    moved = displaced_configuration(mechanism, q, own)
    closed = closing.close(moved, at_loops, exactly=False)
    return None if closed is None else tool_place(mechanism, closed)


def displaced_configuration(
    mechanism: Mechanism, q: np.ndarray, aside: Mapping[str, np.ndarray]
) -> np.ndarray:
    """The configuration with journals of the tree and teeth displaced, shape (nq,).

    Args:
        q: journals centred, shape (nq,).
        aside: see `displaced`; no joint that closes a loop.
    """
    moved = q.copy()
    gears = {name + GEAR: name for name in mechanism.gears}
    for name, xi in aside.items():
        if name in gears:
            moved[mechanism.coordinate(gears[name])] += xi[5]
        else:
            _push(mechanism, q, moved, name, xi)
    return moved


def _push(
    mechanism: Mechanism, q: np.ndarray, moved: np.ndarray, name: str, xi: np.ndarray
) -> None:
    """Displace a journal of the tree by its coordinates in `moved`."""
    model, data = mechanism.model, mechanism.data
    pin.forwardKinematics(model, data, q)
    index, axes = place(mechanism, name)
    first = index
    while mechanism.owner(model.parents[first]) == name:
        first = model.parents[first]
    seat = data.oMi[model.parents[first]] * model.jointPlacements[first]
    turned = seat.rotation.T @ axes.rotation
    arm = seat.rotation.T @ (data.oMi[index].translation - axes.translation)
    turn = pin.exp3(turned @ xi[3:])
    shift = turned @ xi[:3] + turn @ arm - arm
    at = {
        part: mechanism.coordinates.index(Coordinate(name, part))
        for part in mechanism.clearance[name].freedoms
    }
    for part, value in zip("xyz", shift, strict=True):
        if part in at:
            moved[at[part]] += value
    parts = ("roll", "pitch", "yaw")
    angles = [q[at[part]] if part in at else 0.0 for part in parts]
    for part, value in zip(
        parts, pin.rpy.matrixToRpy(turn @ pin.rpy.rpyToMatrix(*angles)), strict=True
    ):
        if part in at:
            # The same turn, not one more.
            moved[at[part]] = value + 2.0 * np.pi * round((q[at[part]] - value) / (2.0 * np.pi))
