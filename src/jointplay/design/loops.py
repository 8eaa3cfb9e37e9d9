"""Closed loops at rest: which joints follow which, and what the play of a joint moves.

The driven coordinates stand where the encoders say. In a loop the others follow: with the tree's
coordinates q, the opening of all loops by a displacement xi_i of each joint with play is

    A dq + sum_i O_i xi_i = 0        (journals that rest in their bearings: rows of `closing_rows`)

so that dq = -A^+ sum O_i xi_i in the passive coordinates, and what A cannot produce must be zero:
N^T O_i xi_i summed over the joints, N^T A = 0. These ties hold plays together (`loop_play`): in a
plane linkage the pins can only lean as far as they allow each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.joints import VIRTUAL_LINK
from jointplay.mechanism.loop import ANGLE_ARM_M, ASSEMBLY_TOLERANCE_M, closing_rows
from jointplay.mechanism.mechanism import Mechanism

Frame = tuple[int, pin.SE3]

_SINGULAR = 1e-9
"""Part of the largest singular value that is none."""
_STEP = 0.05
"""Of the driven joints, from one closed configuration to the next [rad or m]."""
_REACH, _CHANGE, _STEPS = 0.3, 1e-12, 30
"""Largest step of Newton's method, the one after which it is there, and most of them."""


@dataclass(frozen=True)
class Closing:
    """How the loops of a mechanism give way, in one closed configuration."""

    passive: np.ndarray
    """Coordinates that follow."""
    follow: np.ndarray
    """Their displacement per opening of the loops, (passive, rows)."""
    rest: np.ndarray
    """Rows that no passive coordinate can close, combined, (ties, rows)."""
    loose: np.ndarray
    """Directions of the passive coordinates that no loop feels, (passive, k)."""
    weight: np.ndarray
    """Of each row: angles count on an arm, (rows,)."""


def loop_coordinates(mechanism: Mechanism) -> np.ndarray:
    """Coordinates, journals' play aside, that some loop feels in some configuration."""
    own = _own(mechanism)
    somewhere = np.random.default_rng(0).uniform(-1.0, 1.0, (3, mechanism.model.nq))
    felt = np.max([np.abs(closing_rows(mechanism, q)).max(axis=0) for q in somewhere], axis=0)
    return np.array([i for i in own if felt[i] > 1e-9], int)


def driven_joints(
    mechanism: Mechanism, q: np.ndarray, given: Sequence[str] | None = None
) -> tuple[str, ...]:
    """Joints of the loops that stand: those given, or the first that determine the others.

    Args:
        mechanism: with loops.
        q: a configuration, shape (nq,).
        given: names of driven joints; those outside the loops do not matter here.

    Raises:
        MissingName: no such joint.
    """
    if given is not None:
        for name in given:
            mechanism.coordinate(name)
        return tuple(given)
    inside = loop_coordinates(mechanism)
    rows = _weighted(mechanism, closing_rows(mechanism, q))[1]
    rank = _rank(rows[:, inside])
    chosen: list[str] = []
    left = list(inside)
    for name in mechanism.joints:
        if len(left) == rank:
            break
        at = mechanism.coordinate(name)
        if at in left and _rank(rows[:, [i for i in left if i != at]]) == rank:
            left.remove(at)
            chosen.append(name)
    return tuple(chosen)


def passive_coordinates(mechanism: Mechanism, driven: Sequence[str]) -> np.ndarray:
    """Coordinates that follow when the driven joints, and all outside the loops, stand."""
    held = {mechanism.coordinate(name) for name in driven}
    return np.array([i for i in loop_coordinates(mechanism) if i not in held], int)


def linear(mechanism: Mechanism, q: np.ndarray, passive: np.ndarray) -> Closing:
    """How the loops give way in the closed configuration q."""
    weight, rows = _weighted(mechanism, closing_rows(mechanism, q))
    left, sizes, right = np.linalg.svd(rows[:, passive])
    rank = int((sizes > _SINGULAR * max(sizes.max(initial=0.0), ANGLE_ARM_M)).sum())
    follow = right[:rank].T / sizes[:rank] @ left[:, :rank].T
    return Closing(passive, follow, left[:, rank:].T, right[rank:].T, weight)


def opening(mechanism: Mechanism, moved: int, twist: np.ndarray) -> np.ndarray:
    """By how much loops and locks open if what Pinocchio joint `moved` carries moves, (rows, k).

    Args:
        mechanism: after `pin.computeJointJacobians`.
        moved: index of the joint.
        twist: velocity of the world's origin and angular velocity, world axes, (6, k).
    """
    rows = [np.zeros((0, twist.shape[1]))]
    for name in mechanism.loops:
        pair = mechanism.bearing_frame(name), mechanism.journal_frame(name)
        held = mechanism.loop_class(name).held()
        rows.append(_apart(mechanism, *pair, moved, twist)[held])
    rows += [_apart(mechanism, *pair, moved, twist) for pair in mechanism.locks.values()]
    return np.concatenate(rows)


def own_opening(mechanism: Mechanism, loop: str) -> np.ndarray:
    """What the play of the joint of a loop takes from its rows, (rows, 6)."""
    rows = [np.zeros((0, 6))]
    for name in mechanism.loops:
        held = mechanism.loop_class(name).held()
        rows.append((-np.eye(6) if name == loop else np.zeros((6, 6)))[held])
    rows += [np.zeros((6, 6)) for _ in mechanism.locks]
    return np.concatenate(rows)


def _apart(
    mechanism: Mechanism, bearing: Frame, journal: Frame, moved: int, twist: np.ndarray
) -> np.ndarray:
    """Motion of a journal against its bearing, in bearing axes, (6, k)."""
    model, data = mechanism.model, mechanism.data
    sign = int(moved in model.supports[journal[0]]) - int(moved in model.supports[bearing[0]])
    turn = (data.oMi[bearing[0]] * bearing[1]).rotation
    centre = (data.oMi[journal[0]] * journal[1]).translation
    along = twist[:3] + np.cross(twist[3:], centre, axisa=0, axisc=0)
    return sign * np.concatenate([turn.T @ along, turn.T @ twist[3:]])


def close_all(
    mechanism: Mechanism,
    rows: np.ndarray,
    passive: np.ndarray,
    *,
    apart: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Configurations with their loops closed, journals centred: all (n, nq), and which could be.

    From one to the next the driven joints go in small steps, so that the mechanism stays on its
    branch; the first begins with the passive positions it has.

    Args:
        mechanism: with loops.
        rows: configurations whose driven coordinates count, (n, nq).
        passive: coordinates that follow.
        apart: the configurations are not in the order of a motion: each is reached from the nearest
            one that is closed.
    """
    closed, good = rows.copy(), np.zeros(len(rows), bool)
    stands = np.setdiff1d(np.arange(mechanism.model.nq), passive)
    for i, row in enumerate(rows):
        (done,) = np.nonzero(good[:i])
        begin = None
        if len(done):
            away = np.abs(closed[done][:, stands] - row[stands]).max(axis=1)
            begin = closed[done[away.argmin()] if apart else done[-1]]
        found = _reach(mechanism, begin, row, passive)
        if found is not None:
            closed[i], good[i] = found, True
            for name in mechanism.gears:  # unstrained
                closed[i, mechanism.motor(name)] = found[mechanism.coordinate(name)]
    return closed, good


def _reach(
    mechanism: Mechanism, begin: np.ndarray | None, goal: np.ndarray, passive: np.ndarray
) -> np.ndarray | None:
    """The closed configuration with the driven positions of `goal`, from a closed one on."""
    if begin is None:
        near = close_loops(mechanism, goal, passive)
        return searched(mechanism, goal, passive) if near is None else near
    way = goal - begin
    way[passive] = 0.0
    count = max(int(np.ceil(np.abs(way).max(initial=0.0) / _STEP)), 1)
    q: np.ndarray | None = begin
    for part in range(1, count + 1):
        assert q is not None
        trial = q.copy()
        stands = np.setdiff1d(np.arange(len(q)), passive)
        trial[stands] = (begin + part / count * way)[stands]
        q = close_loops(mechanism, trial, passive)
        if q is None:
            return None
    return q


def close_loops(
    mechanism: Mechanism,
    start: np.ndarray,
    passive: np.ndarray,
    aside: Mapping[str, pin.SE3] | None = None,
    *,
    closed: bool = True,
) -> np.ndarray | None:
    """Configuration near `start` in which the passive coordinates close the loops; None if none.

    Args:
        mechanism: with loops.
        start: shape (nq,); what is not passive stays, displaced journals too.
        passive: coordinates that follow.
        aside: poses that journals of loops have in their bearings; centred if not given.
        closed: whether they must be closed; else as well as can be.
    """
    q = start.copy()
    for _ in range(_STEPS):
        weight, rows = _weighted(mechanism, closing_rows(mechanism, q))
        left = weight * _open(mechanism, q, aside or {})
        change = np.linalg.lstsq(rows[:, passive], -left, rcond=_SINGULAR)[0]
        size = float(np.abs(change).max(initial=0.0))
        if not size < _REACH:
            return None
        q[passive] += change
        if size < _CHANGE:
            break
    else:
        return None
    return q if not closed or is_closed(mechanism, q) else None


def searched(mechanism: Mechanism, start: np.ndarray, passive: np.ndarray) -> np.ndarray | None:
    """The same from farther away."""
    from scipy.optimize import least_squares  # takes long to import

    def left(values: np.ndarray) -> np.ndarray:
        q = start.copy()
        q[passive] = values
        return _open(mechanism, q, {})

    near = start.copy()
    if len(passive):
        near[passive] = least_squares(left, start[passive], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return close_loops(mechanism, near, passive)


def is_closed(mechanism: Mechanism, q: np.ndarray) -> bool:
    """Whether all loops are closed, journals centred."""
    return gap(mechanism, q) <= ASSEMBLY_TOLERANCE_M


def blame(mechanism: Mechanism, q: np.ndarray, driven: Sequence[str], at: int, count: int) -> str:
    """What to say of a configuration whose loops cannot be closed."""
    values = [f"{name} {q[mechanism.coordinate(name)]:.6g}" for name in driven]
    stands = ", ".join(values) or "no joint driven"
    pose = f" (pose {at + 1} of {count})" if count > 1 else ""
    return (
        f"the loops {', '.join(mechanism.loops)} cannot be closed with {stands}"
        f"{pose}: out of reach, or at the end of it"
    )


def gap(mechanism: Mechanism, q: np.ndarray) -> float:
    """Largest opening of a loop, journals centred; angles on an arm [m]."""
    weight = _weights(mechanism)
    return float(np.abs(weight * _open(mechanism, q, {})).max(initial=0.0))


def _open(mechanism: Mechanism, q: np.ndarray, aside: Mapping[str, pin.SE3]) -> np.ndarray:
    """Openings in the order of `closing_rows`, of loops whose journals are `aside` [m, rad]."""
    pin.forwardKinematics(mechanism.model, mechanism.data, q)
    parts = [np.zeros(0)]
    for name in mechanism.loops:
        pose = mechanism.journal_pose(name)
        if name in aside:
            pose = aside[name].actInv(pose)
        kind, turn = mechanism.loop_class(name), pose.rotation
        angles = pin.log3(turn)
        if "yaw" in kind.ideal_freedoms:
            angles = np.array([-turn[1, 2], turn[0, 2], 0.0])
        parts.append(np.concatenate([pose.translation, angles])[kind.held()])
    for name in mechanism.locks:
        pose = mechanism.lock_pose(name)
        parts.append(np.concatenate([pose.translation, pin.log3(pose.rotation)]))
    return np.concatenate(parts)


def _own(mechanism: Mechanism) -> list[int]:
    """Coordinates that the ideal mechanism has too, carriages of locks among them."""
    own = []
    for index, coordinate in enumerate(mechanism.coordinates):
        name, part = coordinate.joint, coordinate.part
        joint = mechanism.clearance.get(name)
        plain = joint is None or name in mechanism.loops or part not in VIRTUAL_LINK
        if plain or (joint is not None and part in joint.ideal_freedoms):
            own.append(index)
    return own


def _weights(mechanism: Mechanism) -> np.ndarray:
    """One for each row of an offset, the arm for one of an angle, shape (rows,)."""
    held = [row for name in mechanism.loops for row in mechanism.loop_class(name).held()]
    held += list(range(6)) * len(mechanism.locks)
    return np.where(np.array(held, int) < 3, 1.0, ANGLE_ARM_M)


def _weighted(mechanism: Mechanism, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    weight = _weights(mechanism)
    return weight, weight[:, None] * rows


def _rank(rows: np.ndarray) -> int:
    sizes = np.linalg.svd(rows, compute_uv=False)
    return int((sizes > _SINGULAR * max(sizes.max(initial=0.0), ANGLE_ARM_M)).sum())
