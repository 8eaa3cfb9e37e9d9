"""Jacobians: how a small displacement at each joint moves the tool, and the load on the joint.

In a tree a displacement moves all that the joint carries. In a closed loop the passive joints, and
the tool with them, follow it so that the loop stays closed; openings that they cannot close tie the
displacements of the loop's joints to each other.

`displaced` gives the tool's position by the exact kinematics instead, and `taken_up` the motion of
the joints that takes a displacement of the tool back.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, require_finite, require_numbers
from jointplay.model.closed_loops import ClosedLoops, is_closed, opening, own_opening
from jointplay.model.design import z_to
from jointplay.model.mechanism import Mechanism, frame_index, loaded
from jointplay.model.payload import Payload
from jointplay.physics.joints import Coordinate
from jointplay.simulation.acting import load_site
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.wrench import Wrench
from jointplay.simulation.statics import StaticLoads

GEAR = " (gear)"
"""Appended to a joint's name for the play of its gear."""
LINK = " (link)"
"""Appended to a joint's name for the growth of the link that it carries."""
_ROUNDING = 1e-14
"""Rounding of a position found through a chain of joints, relative to its distance from the
origin."""
FELT = 1e-9
"""Motion of the tool per motion of a coordinate below which it does not move [1 or m]."""


class Jacobians(NamedTuple):
    """Effects of displacements at j joints on the tool at n poses.

    A displacement is that of the child's body against its parent's, about the joint's centre, in
    the axes of its bearing, z along the joint's axis; without clearance, in the joint's frame.
    """

    tool: np.ndarray
    """The tool's displacement and rotation, world axes, per displacement of the joint, (j, n, 6,
    6)."""
    load: np.ndarray
    """Load on the joint by gravity and other loads, about its centre in its axes, (j, n, 6) [N,
    N m]."""
    tie: np.ndarray
    """Opening of the loops, as far as no other coordinate can close them, per displacement of the
    joint, (j, n, r, 6): summed over all joints it must be zero."""
    growth: np.ndarray
    """The tool's displacement and rotation per relative growth of the link that the joint carries,
    (j, n, 6); of links between two of the `joints`, or one and the tool."""
    growth_tie: np.ndarray
    """The same opening per relative growth of that link, (j, n, r)."""


def jacobians(
    mechanism: Mechanism,
    q: np.ndarray,
    joints: Sequence[str],
    loads: Mapping[str, Load],
    driven: Sequence[str] | None = None,
    relative_to: str | None = None,
) -> Jacobians:
    """Jacobians at configurations q (n, nq), journals centred and loops closed; see `budget`.

    `loads` act besides gravity, as they do where a run begins.

    Raises:
        JointplayError: a pose at which the driven joints do not determine the tool.
    """
    moves, borne = np.zeros((len(joints), len(q), 6, 6)), np.zeros((len(joints), len(q), 6))
    growth, acting = np.zeros((len(joints), len(q), 6)), static_loads(mechanism, loads)
    closing = ClosedLoops(mechanism, q[0], driven) if mechanism.loops else None
    ties, growth_ties = [], []
    for i, row in enumerate(q):
        pin.computeJointJacobians(mechanism.model, mechanism.data, row)
        tool = tool_place(mechanism, row)
        pin.centerOfMass(mechanism.model, mechanism.data, row, True)
        places = {j: place(mechanism, n) for j, n in enumerate(joints) if n not in mechanism.loops}
        pushes = acting.wrenches(mechanism, row)
        for j, at in places.items():
            moves[j, i], borne[j, i] = _of_joint(mechanism, at, tool, pushes, relative_to)
        if closing is not None:
            ties.append(_follow(closing, q, i, joints, pushes, moves, borne))
            growth_ties.append(np.zeros(ties[-1].shape[:2]))
        for name, end, xi in link_ends(mechanism, joints, relative_to):
            growth[joints.index(name), i] += moves[joints.index(end), i] @ xi if end else xi
            if end and closing is not None:
                growth_ties[-1][joints.index(name)] += ties[-1][joints.index(end)] @ xi
    most = max((rows.shape[1] for rows in ties), default=0)
    tie, growth_tie = np.zeros((len(joints), len(q), most, 6)), np.zeros((*growth.shape[:2], most))
    for i, (rows, grown) in enumerate(zip(ties, growth_ties, strict=True)):
        tie[:, i, : rows.shape[1]], growth_tie[:, i, : rows.shape[1]] = rows, grown
    return Jacobians(moves, borne, tie, growth, growth_tie)


def link_ends(
    mechanism: Mechanism, joints: Sequence[str], relative_to: str | None = None
) -> Iterator[tuple[str, str, np.ndarray]]:
    """Displacements of the ends of links, each for a relative growth of its link by one.

    To be called after `pin.computeJointJacobians`.

    Yields:
        The joint that carries the link; the joint at this end, empty for the tool and for the body
        from which it is seen; the displacement of that joint, as in `Jacobians`, or of the tool,
        (6,) [m].
    """
    data, model = mechanism.data, mechanism.model
    ends: list[tuple[int, str, np.ndarray, np.ndarray]] = []
    for name in joints:
        bearing, journal = mechanism.frames(name)
        if name in mechanism.loops:
            back = (data.oMi[bearing[0]] * bearing[1]).rotation.T
            for (index, frame), sign in ((bearing, 1.0), (journal, -1.0)):
                ends.append((index, name, sign * back, (data.oMi[index] * frame).translation))
        else:  # the joint is an end of its parent's link, and carries the child's
            _, axes = place(mechanism, name)
            parent = min(bearing[0], journal[0])
            ends.append((parent, name, axes.rotation.T, axes.translation))
    seen = None if relative_to is None else frame_index(model, relative_to)
    back = np.eye(3) if seen is None else data.oMf[seen].rotation.T
    for index, sign in ((mechanism.tool_frame, 1.0), *([] if seen is None else [(seen, -1.0)])):
        frame = model.frames[index]
        ends.append((frame.parentJoint, "", sign * back, data.oMf[index].translation))
    for index, end, axes, point in ends:
        carrier = mechanism.owner(index)
        if carrier is not None and carrier in joints:
            arm = axes @ (point - place(mechanism, carrier)[1].translation)
            yield carrier, end, np.concatenate([arm, np.zeros(3)])


def with_force(
    mechanism: Mechanism, force: Sequence[float], loads: Mapping[str, Load] | None = None
) -> dict[str, Load]:
    """Loads by name, with a force on the tool; refused unless it has three finite components [N].

    Loads that are `Load.left_out` of statics, such as controllers, are not among them: drives hold
    the machine in their stead.
    """
    push = [require_finite("force on the tool", component, "N") for component in force]
    if len(push) != 3:
        raise JointplayError(f"the force on the tool must have three components, got {force!r}")
    known = {name: load for name, load in (loads or {}).items() if not load.left_out()}
    x, y, z = push
    return known | ({"force on the tool": Wrench(mechanism.tool, (x, y, z))} if any(push) else {})


def static_loads(mechanism: Mechanism, loads: Mapping[str, Load]) -> StaticLoads:
    """Loads of a mechanism in the form that statics take."""
    sites = [load_site(load, mechanism, {}) for load in loads.values()]
    return StaticLoads(loads, mechanism, sites)


def check_body(mechanism: Mechanism, body: str) -> None:
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


def carrying(mechanism: Mechanism, payloads: Sequence[Payload]) -> Mechanism:
    """The mechanism with all payloads in hand, unknown to computed torque as in a run."""
    if not payloads:
        return mechanism
    held = copy.copy(mechanism)
    always = [replace(payload, pick=0.0, release=None) for payload in payloads]
    held.model = loaded(mechanism.model, always, 0.0)
    held.data = held.model.createData()
    vars(held)["_ideal"] = mechanism.ideal()  # the unladen robot, which is all that drives know
    return held


def configurations(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    driven: Sequence[str] | None = None,
) -> np.ndarray:
    """Configurations (n, nq) of poses, journals centred and loops closed.

    Poses are joint positions by name, others zero or in the middle of their limits, or
    configurations. Where a loop is open, it is closed from the positions given for its joints that
    are not `driven`.

    Raises:
        JointplayError: a wrong shape; a loop that cannot be closed.
        MissingName: no such joint.
    """
    if mechanism.free_base is not None:
        raise JointplayError(
            "static budgets need a base that is held, and this one is free: take the mechanism "
            'with base = "held"; relative_to then names the body whose motion does not count'
        )
    if isinstance(poses, Mapping):
        entries = mechanism.description.joints
        others = {name: entries[name].neutral for name in mechanism.joints if name in entries}
        q = mechanism.configuration({**others, **poses})[None]
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
    pushes: Sequence[tuple[int, np.ndarray]],
    moves: np.ndarray,
    loads: np.ndarray,
) -> np.ndarray:
    """Add to `moves` and `loads` at a pose what passive joints do in the loops; return its ties.

    With the loops' opening A xi by a displacement xi, and the passive coordinates' motion F that
    closes an opening, the passive joints move by -F A xi. By virtual work the generalised forces on
    them load xi, too. The ties (j, r, 6) are the part of A xi that F cannot close.
    """
    mechanism, passive = closing.mechanism, closing.passive
    model, data = mechanism.model, mechanism.data
    linear = closing.linear(q[pose])
    pin.computeJointJacobians(model, data, q[pose])
    axes_of_world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    tool = pin.getFrameJacobian(model, data, mechanism.tool_frame, axes_of_world)
    tool = tool.reshape(6, model.nv)
    if np.abs(tool[:, passive] @ linear.loose).max(initial=0.0) > FELT:
        sizes = np.abs(linear.loose).max(axis=1, initial=0.0)
        loose = [i for i, size in zip(passive, sizes, strict=True) if size > FELT]
        names = dict.fromkeys(repr(mechanism.coordinates[i].joint) for i in loose)
        raise JointplayError(
            f"the driven joints ({', '.join(map(repr, closing.driven)) or 'none'}) do not "
            f"determine the tool {mechanism.tool!r} at {closing.stands(q[pose], pose, len(q))}: "
            f"nothing determines {', '.join(names)} (a singular position, or too few driven joints)"
        )
    forces = -pin.computeGeneralizedGravity(model, data, q[pose])
    pin.computeJointJacobians(model, data, q[pose])
    for index, push in pushes:
        twist = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.WORLD)
        forces += twist.reshape(6, model.nv).T @ push
    ties = np.zeros((len(joints), len(linear.ties), 6))
    for j, name in enumerate(joints):
        if name in mechanism.loops:
            opened = own_opening(mechanism, name)
        else:
            index, axes = place(mechanism, name)
            along = axes.rotation
            arm = np.cross(axes.translation, along, axisb=0, axisc=0)  # centre x each axis
            twist = np.block([[along, arm], [np.zeros((3, 3)), along]])
            opened = opening(mechanism, index, twist)
        opened = linear.weight[:, None] * opened
        followed = -linear.follow @ opened
        moves[j, pose] += tool[:, passive] @ followed
        loads[j, pose] += followed.T @ forces[passive]
        ties[j] = linear.ties @ opened
    return ties


def tool_place(mechanism: Mechanism, q: np.ndarray, relative_to: str | None = None) -> pin.SE3:
    """Pose of the tool in configuration q (nq,), in the world or in the frame of a body."""
    pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    tool = mechanism.data.oMf[mechanism.tool_frame].copy()
    if relative_to is None:
        return tool
    return mechanism.data.oMf[frame_index(mechanism.model, relative_to)].actInv(tool)


SPARED = 0.05
"""Singular values of the Jacobian below this part of the largest are damped: near a singular pose
joints would go far to move the tool little, so they go less the nearer they are (judged)."""
_LOST = 1e-9
"""Singular values below this part of the largest belong to motions that leave the tool in place."""


def taken_up(
    ideal: Mechanism, at: Mapping[str, float], displacement: np.ndarray, size: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Joint motions that displace the tool, by damped least squares, and the residual.

    If `size` weighs turns against displacements, both are fitted at once. Otherwise the position
    comes first; the motions that leave it as it is (the null space of its Jacobian) then turn the
    tool as far as they can.

    Args:
        ideal: a robot without loops.
        at: positions of the joints that move [rad or m].
        displacement: displacement and rotation of the tool, world axes, shape (6,) [m, rad].
        size: distance from the tool at which a turn counts as the displacement there [m].

    Returns:
        Motion of each joint, shape (len(at),) [rad or m], and what is left of the displacement,
        shape (6,) [m, rad].
    """
    pin.computeJointJacobians(ideal.model, ideal.data, ideal.configuration(at))
    pin.updateFramePlacements(ideal.model, ideal.data)
    moves = pin.getFrameJacobian(
        ideal.model, ideal.data, ideal.tool_frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    ).reshape(6, -1)[:, [ideal.coordinate(name) for name in at]]
    if size is not None:
        weight = np.repeat([1.0, size], 3)
        shifts = _least_squares(weight[:, None] * moves, weight * displacement)
        return shifts, displacement - moves @ shifts
    shifts = _least_squares(moves[:3], displacement[:3])
    _, values, right = np.linalg.svd(moves[:3])
    free = right[int(np.sum(values > _LOST * values.max(initial=0.0))) :].T
    shifts += free @ _least_squares(moves[3:] @ free, displacement[3:] - moves[3:] @ shifts)
    return shifts, displacement - moves @ shifts


def _least_squares(moves: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The x that minimises |moves @ x - target|, damped near singular poses only."""
    left, values, right = np.linalg.svd(moves, full_matrices=False)
    least = SPARED * values.max(initial=0.0)
    gains = values / np.maximum(np.maximum(values, least) ** 2, 1e-300)
    return np.asarray(right.T @ (gains * (left.T @ target)))


def _of_joint(
    mechanism: Mechanism,
    at: tuple[int, pin.SE3],
    tool: pin.SE3,
    pushes: Sequence[tuple[int, np.ndarray]],
    relative_to: str | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian (6, 6) and load (6,) of a joint in the tree, given its `place` and
    `StaticLoads.wrenches`.

    Plays are symmetric, so it does not matter which of the two bodies is the bearing. Relative to a
    body, and in its axes, displacements that move both the body and the tool do not count, and
    those that move only the body move the tool the other way.
    """
    model, data = mechanism.model, mechanism.data
    index, axes = at
    turn, centre = axes.rotation, axes.translation
    move, load = np.zeros((6, 6)), np.zeros(6)
    carried = [(push[:3], push[3:]) for body, push in pushes if index in model.supports[body]]
    if data.mass[index] > 0.0:  # without mass there is no centre of mass
        weight = data.mass[index] * np.array(mechanism.gravity)
        carried.append((weight, np.cross(data.oMi[index].act(data.com[index]), weight)))
    moved = index in model.supports[model.frames[mechanism.tool_frame].parentJoint]
    sign = float(moved)
    if relative_to is not None:
        body = frame_index(model, relative_to)
        sign -= float(index in model.supports[model.frames[body].parentJoint])
    if sign:
        move[:3, :3] = move[3:, 3:] = sign * turn
        arms = np.cross(turn.T, tool.translation - centre).T  # columns: axis x arm
        # Arms that are only the rounding of both positions: the tool lies on that axis.
        size = np.linalg.norm(tool.translation) + np.linalg.norm(centre)
        arms[np.abs(arms) < _ROUNDING * size] = 0.0
        move[:3, 3:] = sign * arms
    if relative_to is not None:
        back = data.oMf[body].rotation.T
        move = np.concatenate([back @ move[:3], back @ move[3:]])
    for force, moment in carried:  # moments are about the world's origin
        load[:3] += turn.T @ force
        load[3:] += turn.T @ (moment - np.cross(centre, force))
    return move, load


def place(mechanism: Mechanism, name: str) -> tuple[int, pin.SE3]:
    """Index of the joint that carries the child's body, and its frame in the world.

    The frame has the bearing's axes, z along its axis, and its origin at the journal's centre;
    without clearance z is the axis along or about which the joint moves. To be called after
    `pin.computeJointJacobians`.
    """
    data = mechanism.data
    index = int(mechanism.model.getJointId(name))
    if name in mechanism.clearance:
        (i, bearing), (j, journal) = mechanism.frames(name)
        centre = (data.oMi[j] * journal).translation
        return index, pin.SE3((data.oMi[i] * bearing).rotation, centre)
    column = pin.getJointJacobian(mechanism.model, data, index, pin.ReferenceFrame.WORLD)
    entry = mechanism.description.joints.get(name)
    rows = slice(0, 3) if entry is not None and entry.slides else slice(3, 6)
    axis = column.reshape(6, -1)[rows, mechanism.model.joints[index].idx_v]
    return index, pin.SE3(z_to(axis), data.oMi[index].translation)


def displaced(
    mechanism: Mechanism,
    q: np.ndarray,
    names: Sequence[str],
    points: np.ndarray,
    closing: ClosedLoops | None = None,
    relative_to: str | None = None,
) -> np.ndarray:
    """Positions of the tool, by the exact kinematics, with joints displaced, shape (m, 3) [m].

    Loops are closed anew as well as possible; positions are NaN where they cannot be.

    Args:
        mechanism: left as it was.
        q: configuration from which joints are displaced, (nq,).
        names: names of k joints, loops, gears (`GEAR`) and links (`LINK`).
        points: displacement and rotation vector of the child's body, bearing axes, (m, k, 6)
            [m, rad]; of a link its relative growth, in the first component.
        closing: closes the loops; None: there are none.
        relative_to: body in whose frame the positions are; None: the world.
    """
    model, data = mechanism.model, mechanism.data
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    known = [*mechanism.joints, *mechanism.mounts, *mechanism.loops]
    bases = [name.removesuffix(GEAR) for name in names]
    ends: dict[str, list[tuple[str, np.ndarray]]] = {}
    if any(name.endswith(LINK) for name in names):
        for name, end, displacement in link_ends(mechanism, known, relative_to):
            ends.setdefault(name + LINK, []).append((end, displacement))
    seats = dict[str, tuple[int, pin.SE3]]()
    for name in {*bases, *(end for some in ends.values() for end, _ in some)} & {*known}:
        if name not in mechanism.loops:
            index, axes = place(mechanism, name)
            seats[name] = index, data.oMi[model.parents[index]].actInv(axes)
    were = {index: model.jointPlacements[index].copy() for index, _ in seats.values()}
    tools = np.full((len(points), 3), np.nan)
    for tool, point in zip(tools, points, strict=True):
        # Sum the displacements at each joint, and those of the tool itself by links that grow.
        total, shift, looped = dict[str, np.ndarray](), np.zeros(3), dict[str, pin.SE3]()
        for name, xi in zip(bases, point, strict=True):
            for end, part in (
                [(end, xi[0] * displacement) for end, displacement in ends.get(name, ())]
                if name.endswith(LINK)
                else [(name, xi)]
            ):
                if end:
                    total[end] = total.get(end, 0.0) + part
                else:
                    shift += part[:3]
        # Displace them in the model: joints of the tree by their placement, loops as they close.
        for name, xi in total.items():
            move = pin.SE3(pin.exp3(xi[3:]), xi[:3])
            if name in mechanism.loops:
                looped[name] = move
            else:
                index, seat = seats[name]
                model.jointPlacements[index] = seat * move * seat.inverse() * were[index]
        try:
            closed = q if closing is None else closing.close(q, looped, exactly=False)
            if closed is not None:
                tool[:] = tool_place(mechanism, closed, relative_to).translation + shift
        finally:  # leave the mechanism as it was
            for index, placement in were.items():
                model.jointPlacements[index] = placement
    return tools


def displaced_configuration(
    mechanism: Mechanism, q: np.ndarray, aside: Mapping[str, np.ndarray]
) -> np.ndarray:
    """The configuration with journals of the tree displaced by xi (6,) each, by name, (nq,)."""
    moved, data = q.copy(), mechanism.data
    pin.forwardKinematics(mechanism.model, data, q)
    for name, xi in aside.items():
        index, axes = place(mechanism, name)
        carrier, placement = mechanism.frames(name)[mechanism.clearance[name].exchanged]
        seat = data.oMi[carrier] * placement  # of the virtual link, wherever the bearing is
        turned = seat.rotation.T @ axes.rotation
        arm = seat.rotation.T @ (data.oMi[index].translation - axes.translation)
        turn = pin.exp3(turned @ xi[3:])
        shift = turned @ xi[:3] + turn @ arm - arm
        freedoms = mechanism.clearance[name].freedoms
        at = {part: mechanism.coordinates.index(Coordinate(name, part)) for part in freedoms}
        for part, value in zip("xyz", shift, strict=True):
            if part in at:
                moved[at[part]] += value
        parts = ("roll", "pitch", "yaw")
        angles = [q[at[part]] if part in at else 0.0 for part in parts]
        turned_to = pin.rpy.matrixToRpy(turn @ pin.rpy.rpyToMatrix(*angles))
        for part, value in zip(parts, turned_to, strict=True):
            if part in at:
                # An angle within half a turn of the one before.
                moved[at[part]] = value + 2.0 * np.pi * round((q[at[part]] - value) / (2.0 * np.pi))
    return moved
