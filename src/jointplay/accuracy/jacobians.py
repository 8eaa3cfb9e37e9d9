"""How a small displacement at each joint moves the tool, and the load that the joint bears.

In a tree what a joint displaces is all that it carries. In a closed loop the joints that are not
driven follow, the tool with them; what they cannot close ties the displacements of the loop's
joints to each other.
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
"""Of a place that is found through a chain of joints, relative to its distance from the origin."""
FELT = 1e-9
"""Motion of the tool per motion of a coordinate that is none [1 or m]."""


class Jacobians(NamedTuple):
    """What j joints do to the tool at n poses; a displacement is one of the child's body.

    Of a joint about its centre, in the axes of its bearing, z the joint's own; without clearance
    its frame has that place.
    """

    tool: np.ndarray
    """The tool's displacement and rotation in world axes per the joint's own, (j, n, 6, 6)."""
    load: np.ndarray
    """What gravity and loads exert on the joint, about its centre, (j, n, 6) [N, N m]."""
    tie: np.ndarray
    """By how much each displacement opens loops that nothing else can close, (j, n, r, 6), zero in
    sum over all joints."""
    growth: np.ndarray
    """The tool's displacement and rotation per relative growth of the link that the joint carries,
    (j, n, 6); of links between two of the `joints`, or one and the tool."""
    growth_tie: np.ndarray
    """By how much growth opens loops that nothing else can close, (j, n, r)."""


def jacobians(
    mechanism: Mechanism,
    q: np.ndarray,
    joints: Sequence[str],
    loads: Mapping[str, Load],
    driven: Sequence[str] | None = None,
    relative_to: str | None = None,
) -> Jacobians:
    """Jacobians at configurations q (n, nq), journals centred and loops closed; see `budget`.

    Beside gravity `loads` act, as they do where a run begins.

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
        in_tree = [(j, name) for j, name in enumerate(joints) if name not in mechanism.loops]
        places = {j: place(mechanism, name) for j, name in in_tree}
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
    """What a relative growth of one displaces where the links of `joints` end.

    After `pin.computeJointJacobians`: for each end the joint that carries the link, the joint there
    (empty for the tool, and the body from which it is seen), and the displacement that this end's
    motion is for that joint, as of `Jacobians`, or for the tool, (6,) [m].
    """
    data, model = mechanism.data, mechanism.model
    ends: list[tuple[int, str, np.ndarray, np.ndarray]] = []
    for name in joints:
        bearing, journal = mechanism.frames(name)
        if name in mechanism.loops:
            back = (data.oMi[bearing[0]] * bearing[1]).rotation.T
            for (index, frame), sign in ((bearing, 1.0), (journal, -1.0)):
                ends.append((index, name, sign * back, (data.oMi[index] * frame).translation))
        else:  # the child's own link begins here
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

    Some are `Load.left_out`, as controllers: drives hold the machine in their stead.
    """
    push = [require_finite("force on the tool", component, "N") for component in force]
    if len(push) != 3:
        raise JointplayError(f"the force on the tool must have three components, got {force!r}")
    known = {name: load for name, load in (loads or {}).items() if not load.left_out()}
    x, y, z = push
    return known | ({"force on the tool": Wrench(mechanism.tool, (x, y, z))} if any(push) else {})


def static_loads(mechanism: Mechanism, loads: Mapping[str, Load]) -> StaticLoads:
    """Loads of a mechanism, as statics ask for them."""
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
    """The same with all payloads in hand, of which computed torque, as in a run, does not know."""
    if not payloads:
        return mechanism
    held = copy.copy(mechanism)
    always = [replace(payload, pick=0.0, release=None) for payload in payloads]
    held.model = loaded(mechanism.model, always, 0.0)
    held.data = held.model.createData()
    vars(held)["_ideal"] = mechanism.ideal()  # of which drives know
    return held


def configurations(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    driven: Sequence[str] | None = None,
) -> np.ndarray:
    """Configurations (n, nq), journals centred, loops closed: from positions by name, or others.

    Positions of joints of a loop that are not `driven` say from where it is closed.

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
    """Add what follows through the loops at a pose to (j, n, ...); the ties there, (j, r, 6)."""
    mechanism, passive = closing.mechanism, closing.passive
    model, data = mechanism.model, mechanism.data
    closing_up = closing.linear(q[pose])
    pin.computeJointJacobians(model, data, q[pose])
    axes_of_world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    tool = pin.getFrameJacobian(model, data, mechanism.tool_frame, axes_of_world)
    tool = tool.reshape(6, model.nv)
    if np.abs(tool[:, passive] @ closing_up.loose).max(initial=0.0) > FELT:
        sizes = np.abs(closing_up.loose).max(axis=1, initial=0.0)
        loose = [i for i, size in zip(passive, sizes, strict=True) if size > FELT]
        names = dict.fromkeys(repr(mechanism.coordinates[i].joint) for i in loose)
        raise JointplayError(
            f"the driven joints ({', '.join(map(repr, closing.driven)) or 'none'}) do not "
            f"determine the tool {mechanism.tool!r} at {closing.stands(q[pose], pose, len(q))}: "
            f"nothing determines {', '.join(names)} (a singular position, or too few driven joints)"
        )
    weight = -pin.computeGeneralizedGravity(model, data, q[pose])
    pin.computeJointJacobians(model, data, q[pose])
    for index, push in pushes:
        twist = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.WORLD)
        weight += twist.reshape(6, model.nv).T @ push
    ties = np.zeros((len(joints), len(closing_up.ties), 6))
    for j, name in enumerate(joints):
        if name in mechanism.loops:
            opened = own_opening(mechanism, name)
        else:
            index, axes = place(mechanism, name)
            along = axes.rotation
            arm = np.cross(axes.translation, along, axisb=0, axisc=0)  # centre x each axis
            twist = np.block([[along, arm], [np.zeros((3, 3)), along]])
            opened = opening(mechanism, index, twist)
        opened = closing_up.weight[:, None] * opened
        followed = -closing_up.follow @ opened
        moves[j, pose] += tool[:, passive] @ followed
        loads[j, pose] += followed.T @ weight[passive]
        ties[j] = closing_up.ties @ opened
    return ties


def tool_place(mechanism: Mechanism, q: np.ndarray, relative_to: str | None = None) -> pin.SE3:
    """Where the tool is in configuration q (nq,), in the world or in a body's axes."""
    pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    tool = mechanism.data.oMf[mechanism.tool_frame].copy()
    if relative_to is None:
        return tool
    return mechanism.data.oMf[frame_index(mechanism.model, relative_to)].actInv(tool)


SPARED = 0.05
"""Singular values of the Jacobian below this part of the largest are damped: as
joints near singular poses would go far for little, they go the less, the nearer (judged)."""
_LOST = 1e-9
"""Part of the largest singular value below which a motion leaves the tool where it is."""


def taken_up(
    ideal: Mechanism, at: Mapping[str, float], displacement: np.ndarray, size: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """How far joints move to displace the tool, by damped least squares, and what they cannot do.

    Unless a length weighs a turn against it, the position comes first; by the motions that leave
    the position as it is the tool is turned as far as it can be.

    Args:
        ideal: a robot without loops.
        at: positions of the joints that move [rad or m].
        displacement: of the tool, world axes, shape (6,) [m, rad].
        size: a turn counts as the displacement of what is so far from the tool [m].

    Returns:
        Of each joint, shape (len(at),) [rad or m], and what is left, shape (6,).
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
    """Damped near singular poses only, shape (columns of moves,)."""
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
    """Jacobian (6, 6) and load (6,) of the joint at a `place`, under `StaticLoads.wrenches`.

    The play is the same both ways, so it does not matter which of the two bodies is the bearing.
    Relative to a body, in its axes: what moves both does not count, and what moves only the body
    moves the tool the other way.
    """
    model, data = mechanism.model, mechanism.data
    index, axes = at
    turn, centre = axes.rotation, axes.translation
    move, load = np.zeros((6, 6)), np.zeros(6)
    carried = [(push[:3], push[3:]) for body, push in pushes if index in model.supports[body]]
    if data.mass[index] > 0.0:  # what has no mass has no centre of mass
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
        # On an axis but for rounding: as far from the world's origin as both may be.
        size = np.linalg.norm(tool.translation) + np.linalg.norm(centre)
        arms[np.abs(arms) < _ROUNDING * size] = 0.0
        move[:3, 3:] = sign * arms
    if relative_to is not None:
        back = data.oMf[body].rotation.T
        move = np.concatenate([back @ move[:3], back @ move[3:]])
    for force, moment in carried:  # about the world's origin
        load[:3] += turn.T @ force
        load[3:] += turn.T @ (moment - np.cross(centre, force))
    return move, load


def place(mechanism: Mechanism, name: str) -> tuple[int, pin.SE3]:
    """The joint that carries the child's body; the bearing's axes, z its axis, at the journal.

    After `pin.computeJointJacobians`. Without clearance z is the way in which the joint moves.
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
    """Where the tool is, exactly, with joints displaced from a configuration q (nq,), (m, 3) [m].

    Loops are closed afresh, as well as can be; NaN where they cannot. `points` (m, k, 6) are
    displacement and rotation vector of the child's body, bearing axes, by joint, loop and gear
    [m, rad]; of a link by how much it grows, relatively, first.
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
        finally:  # however it ends, the mechanism is as it was
            for index, placement in were.items():
                model.jointPlacements[index] = placement
    return tools


def displaced_configuration(
    mechanism: Mechanism, q: np.ndarray, aside: Mapping[str, np.ndarray]
) -> np.ndarray:
    """The configuration with journals of the tree and teeth `displaced`, (nq,)."""
    moved = q.copy()
    gears = {name + GEAR: name for name in mechanism.gears}
    for name, xi in aside.items():
        if name in gears:
            joint = gears[name]
            moved[mechanism.coordinate(joint)] += xi[mechanism.description.joints[joint].component]
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
    carrier, placement = mechanism.frames(name)[mechanism.clearance[name].exchanged]
    seat = data.oMi[carrier] * placement  # of the virtual link, whichever body the bearing is in
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
            # The same turn, not one more.
            moved[at[part]] = value + 2.0 * np.pi * round((q[at[part]] - value) / (2.0 * np.pi))
