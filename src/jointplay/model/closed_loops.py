"""Closed loops at rest: which joints follow which, and what the play of a joint moves.

The driven coordinates stand where the encoders say. In a loop the others follow: with the tree's
coordinates q, the opening of all loops by a displacement xi_i of each joint with play is

    A dq + sum_i O_i xi_i = 0        (journals that rest in their bearings: rows of `closing_rows`)

so that dq = -A^+ sum O_i xi_i in the passive coordinates, and what A cannot produce must be zero:
N^T O_i xi_i summed over the joints, N^T A = 0. These ties hold plays together (`loop_play`): in a
plane linkage the pins can only lean as far as they allow each other.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.base.units import readable
from jointplay.model.frames import motion_between
from jointplay.model.loop import (
    ANGLE_ARM_M,
    ASSEMBLY_TOLERANCE_M,
    SINGULAR,
    closest,
    closing_rows,
    closures,
    newton,
    openings,
    own_coordinates,
)
from jointplay.model.mechanism import Mechanism, frame_index
from jointplay.model.urdf import Mimic

_STEP = 0.05
"""Of the driven joints, from one closed configuration to the next [rad, or of what slides
`ANGLE_ARM_M`]: so short that no Newton step leaps to another branch (judged)."""
NOWHERE = 1e-9
"""Way of the tool's origin by a turn of the tool of 1 rad that is rounding [m]."""


@dataclass(frozen=True)
class Closing:
    """How the loops of a mechanism give way, in one closed configuration."""

    follow: np.ndarray
    """Displacement of the passive coordinates per opening of the loops, (passive, rows)."""
    ties: np.ndarray
    """Rows that no passive coordinate can close, combined, (ties, rows)."""
    loose: np.ndarray
    """Directions of the passive coordinates that no loop feels, (passive, k)."""
    weight: np.ndarray
    """Of each row: angles count on an arm, (rows,)."""


class ClosedLoops:
    """The loops of a mechanism whose driven joints, and all joints outside the loops, stand.

    Args:
        mechanism: with loops.
        q: a configuration, shape (nq,).
        driven: joints that stand; None: those of the loops nearest to the base that determine the
            others at `q`: there machines have their motors.

    Attributes:
        driven: joints that stand.
        passive: coordinates that follow.

    Raises:
        MissingName: no such joint.
    """

    def __init__(
        self, mechanism: Mechanism, q: np.ndarray, driven: Sequence[str] | None = None
    ) -> None:
        self.mechanism = mechanism
        self._weight = _weights(mechanism)
        somewhere = np.random.default_rng(0).uniform(-1.0, 1.0, (3, mechanism.model.nq))
        felt = np.max([np.abs(closing_rows(mechanism, at)).max(axis=0) for at in somewhere], axis=0)
        inside = [i for i in own_coordinates(mechanism) if felt[i] > 1e-9]
        self.driven = self._determining(q, inside) if driven is None else tuple(driven)
        held = {mechanism.coordinate(name) for name in self.driven}
        self.passive = np.array([i for i in inside if i not in held], int)
        self._standing = np.setdiff1d(np.arange(mechanism.model.nq), self.passive)
        described = mechanism.description.joints
        self._steps = np.full(mechanism.model.nq, _STEP)
        for name in self.driven:
            if name in described and described[name].slides:
                self._steps[mechanism.coordinate(name)] *= ANGLE_ARM_M

    def _determining(self, q: np.ndarray, inside: Sequence[int]) -> tuple[str, ...]:
        """The joints nearest to the base that determine the other coordinates inside the loops."""
        rows = self._rows(q)
        rank = _rank(rows[:, inside])
        chosen: list[str] = []
        left = list(inside)
        for name in from_the_base(self.mechanism):
            if len(left) == rank:
                break
            at = self.mechanism.coordinate(name)
            if at in left and _rank(rows[:, [i for i in left if i != at]]) == rank:
                left.remove(at)
                chosen.append(name)
        return tuple(chosen)

    def _rows(self, q: np.ndarray) -> np.ndarray:
        """Openings per displacement of the coordinates, angles on an arm, (rows, nv)."""
        return self._weight[:, None] * closing_rows(self.mechanism, q)

    def stands(self, q: np.ndarray, at: int, count: int) -> str:
        """Where the driven joints stand at `q` (nq,), number `at` of several, in words."""
        place = self.mechanism.coordinate
        entries = self.mechanism.description.joints
        values = ", ".join(
            f"{name} {readable(q[place(name)], entries[name].unit)}" for name in self.driven
        )
        pose = f" (pose {at + 1} of {count})" if count > 1 else ""
        return (values or "no joint driven") + pose

    def linear(self, q: np.ndarray) -> Closing:
        """How the loops give way in the closed configuration q."""
        left, sizes, right = np.linalg.svd(self._rows(q)[:, self.passive])
        rank = int((sizes > _threshold(sizes)).sum())
        follow = right[:rank].T / sizes[:rank] @ left[:, :rank].T
        return Closing(follow, left[:, rank:].T, right[rank:].T, self._weight)

    def closed(self, q: np.ndarray, begin: np.ndarray | None = None) -> np.ndarray:
        """Configurations (n, nq) with their loops closed, as `close_all`; from `begin` (nq,) on.

        Raises:
            JointplayError: loops that cannot be closed.
        """
        first = [] if begin is None else [begin]
        configurations, good = self.close_all(np.array([*first, *q]))
        configurations, good = configurations[len(first) :], good[len(first) :]
        if not good.all():
            at = int(np.argmin(good))
            raise JointplayError(
                f"the loops {', '.join(self.mechanism.loops)} cannot be closed with "
                f"{self.stands(q[at], at, len(q))}: out of reach, or at the limit of reach"
            )
        return configurations

    def close_all(
        self, q: np.ndarray, *, apart: bool = False, begin: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Configurations (n, nq) with their loops closed, journals centred, and which could be.

        From one to the next the driven joints go in small steps, so that the mechanism stays on its
        branch; the first begins at `begin` (nq,), closed, or with the passive positions it has.
        With `apart` they are not in the order of a motion: each is reached from the nearest one
        closed.
        """
        closed, good = q.copy(), np.zeros(len(q), bool)
        for i, row in enumerate(q):
            (indices,) = np.nonzero(good[:i])
            last = begin
            if len(indices):
                away = np.abs(closed[indices][:, self._standing] - row[self._standing]).max(axis=1)
                last = closed[indices[away.argmin()] if apart else indices[-1]]
            solution = self._reach(last, row)
            if solution is not None:
                closed[i], good[i] = solution, True
                for name in self.mechanism.gears:  # unstrained
                    motor = self.mechanism.motor(name)
                    closed[i, motor] = solution[self.mechanism.coordinate(name)]
        return closed, good

    def _reach(self, begin: np.ndarray | None, goal: np.ndarray) -> np.ndarray | None:
        """The closed configuration with the driven positions of `goal`, from a closed one on."""
        if begin is None:
            near = self.close(goal)
            if near is None:
                near = self.close(closest(self.mechanism, goal, self.passive, {}))
            return near
        distance = (goal - begin)[self._standing]
        count = max(
            int(np.ceil(np.abs(distance / self._steps[self._standing]).max(initial=0.0))), 1
        )
        q: np.ndarray | None = begin
        for part in range(1, count + 1):
            assert q is not None
            trial = q.copy()
            trial[self._standing] = begin[self._standing] + part / count * distance
            q = self.close(trial)
            if q is None:
                return None
        return q

    def close(
        self, start: np.ndarray, aside: Mapping[str, pin.SE3] | None = None, *, exactly: bool = True
    ) -> np.ndarray | None:
        """Where near `start` (nq,) the passive coordinates close the loops: (nq,), or None.

        What is not passive stays, displaced journals too; those of loops have the poses `aside` in
        their bearings, centred if not given. Unless `exactly`, as well as can be.
        """
        directions = np.eye(len(start))[:, self.passive]
        q = newton(self.mechanism, start, directions, self._weight, aside)
        if q is not None and exactly and not is_closed(self.mechanism, q):
            return None
        return q


def opening(mechanism: Mechanism, moved: int, twist: np.ndarray) -> np.ndarray:
    """By how much loops and locks open if what Pinocchio joint `moved` carries moves, (rows, k).

    `twist` (6, k): velocity of the world's origin and angular velocity, world axes; after
    `pin.computeJointJacobians`.
    """
    supports = mechanism.model.supports
    rows = [np.zeros((0, twist.shape[1]))]
    for closure in closures(mechanism):
        (i, _), (j, _) = closure.frames
        sign = int(moved in supports[j]) - int(moved in supports[i])
        rows.append(motion_between(mechanism.data, closure.frames, sign * twist)[closure.rows])
    return np.concatenate(rows)


def own_opening(mechanism: Mechanism, loop: str) -> np.ndarray:
    """What the play of the joint of a loop takes from its rows, (rows, 6)."""
    blocks = [-np.eye(6) if c.name == loop else np.zeros((6, 6)) for c in closures(mechanism)]
    rows = [part[c.rows] for part, c in zip(blocks, closures(mechanism), strict=True)]
    return np.concatenate([np.zeros((0, 6)), *rows])


def is_closed(mechanism: Mechanism, q: np.ndarray) -> bool:
    """Whether all loops are closed, journals centred; angles count on an arm."""
    gaps = np.abs(_weights(mechanism) * openings(mechanism, q))
    return bool(gaps.max(initial=0.0) <= ASSEMBLY_TOLERANCE_M)


def from_the_base(mechanism: Mechanism) -> list[str]:
    """Joints with one coordinate without clearance, those on the base first, else as they come."""
    single = [
        name
        for name in mechanism.joints
        if name not in mechanism.given_joints or not mechanism.given_joints[name].compound()
    ]
    described, moving = mechanism.description, set(mechanism.joints)

    def depth(name: str) -> int:
        return sum(joint.name in moving for joint in described.above(described.joints[name].parent))

    return sorted(single, key=depth)


def followed_mimics(
    mechanism: Mechanism, q: np.ndarray, alone: Collection[str] = ()
) -> dict[str, Mimic]:
    """Joints that mimic others, and what each follows: those that no loop determines.

    In the URDF of a gripper or a lift, `<mimic>` often stands for a loop that a URDF cannot have.
    Where the loop is there, it is the loop that joints follow: a mimic that would hold its leader,
    or that follows from the loops anyway, is left out. Loops are closed in `q` (nq,), without
    clearance; joints in `alone` follow nothing.
    """
    rows = closing_rows(mechanism, q) if mechanism.loops else np.zeros((0, mechanism.model.nv))
    rank = _rank(rows) if len(rows) else 0
    followed: dict[str, Mimic] = {}
    for name in mechanism.joints:
        mimic = mechanism.description.joints[name].mimic
        if mimic is None or name in alone or name not in mechanism.coordinates:
            continue
        more = np.concatenate([rows, mimic_row(mechanism, name, mimic)[None]])
        if mechanism.loops:
            held = _rank(more)
            if held == rank:
                continue
            if mimic.leader in mechanism.coordinates:
                leads = np.eye(mechanism.model.nv)[[mechanism.coordinate(mimic.leader)]]
                if _rank(np.concatenate([more, leads])) == held:
                    continue
            rank = held
        followed[name], rows = mimic, more
    return followed


def turns_in_place(mechanism: Mechanism, q: np.ndarray) -> bool:
    """Whether the ideal tool turns, and its origin stands whatever moves: the rocker of a linkage.

    With play in its pivot the origin moves as well, and the output is an angle all the same.
    `q`: a configuration of the mechanism, (nq,).
    """
    if not mechanism.loops:
        return False
    ideal = mechanism.ideal()
    row = np.zeros(ideal.model.nq)
    for k, coordinate in enumerate(ideal.coordinates):
        if coordinate in mechanism.coordinates:
            row[k] = q[mechanism.coordinates.index(coordinate)]
    frame = frame_index(ideal.model, ideal.tool)
    jacobian = pin.computeFrameJacobian(
        ideal.model, ideal.model.createData(), row, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    size = np.abs(jacobian[3:]).max(initial=0.0)
    return bool(size > 0.0 and np.abs(jacobian[:3]).max(initial=0.0) <= NOWHERE * size)


def mimic_row(mechanism: Mechanism, name: str, mimic: Mimic) -> np.ndarray:
    """What is zero times each velocity with which the joint `name` follows, shape (nv,)."""
    row = np.zeros(mechanism.model.nv)
    row[mechanism.coordinate(name)] = 1.0
    if mimic.leader in mechanism.coordinates:
        row[mechanism.coordinate(mimic.leader)] -= mimic.multiplier
    return row


def _weights(mechanism: Mechanism) -> np.ndarray:
    """One for each row of an offset, the arm for one of an angle, shape (rows,)."""
    return np.concatenate([np.zeros(0), *(c.weights for c in closures(mechanism))])


def _threshold(sizes: np.ndarray) -> float:
    """Singular values up to here are none."""
    return float(SINGULAR * max(sizes.max(initial=0.0), ANGLE_ARM_M))


def _rank(rows: np.ndarray) -> int:
    sizes = np.linalg.svd(rows, compute_uv=False)
    return int((sizes > _threshold(sizes)).sum())
