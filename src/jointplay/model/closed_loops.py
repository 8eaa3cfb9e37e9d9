"""Closed loops at rest: which joints follow which, and what the play of a joint moves.

The driven coordinates stand where the encoders say; in a loop the passive ones follow. Let A be the
Jacobian of the loop closures (`closing_rows`) by the passive coordinates q. If each joint i with
play is displaced by xi_i, which opens the loops by O_i xi_i, they stay closed where

    A dq + sum_i O_i xi_i = 0

so that dq = -A^+ sum_i O_i xi_i. What A cannot produce must be zero by itself: with N^T A = 0, the
ties N^T sum_i O_i xi_i = 0 hold the plays together (`loop_play`). In a plane linkage the pins can
only lean as far as they allow each other.
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
    closing_rows,
    closures,
    ideal_coordinates,
    least_open,
    newton,
    openings,
)
from jointplay.model.mechanism import Mechanism, frame_index
from jointplay.model.urdf import Mimic

_STEP = 0.05
"""Step of driven joints from one closed configuration to the next [rad, or on an arm of
`ANGLE_ARM_M` if they slide]: so short that no Newton step leaps to another branch (judged)."""
NOWHERE = 1e-9
"""Way of the tool's origin in a turn of the tool by 1 rad, up to which it is rounding [m]."""


@dataclass(frozen=True)
class Closing:
    """The loop equations of a mechanism, linearised and solved in one closed configuration.

    All is for openings with their `weight`.
    """

    follow: np.ndarray
    """A^+: displacement of the passive coordinates per opening of the loops, (passive, rows)."""
    ties: np.ndarray
    """N^T: combinations of rows that no passive coordinate can close, (ties, rows)."""
    loose: np.ndarray
    """Null space of A: directions of the passive coordinates that open no loop, (passive, k)."""
    weight: np.ndarray
    """Length for a unit of each row, (rows,): 1 for an offset, an arm for an angle [1 or m]."""


class ClosedLoops:
    """The loops of a mechanism whose driven joints, and all joints outside the loops, stand still.

    Args:
        mechanism: one with loops.
        q: a configuration, shape (nq,).
        driven: joints that stand; None: of the joints in loops, those nearest to the base that
            determine the others at `q`: there machines have their motors.

    Attributes:
        driven: joints that stand.
        passive: indices of the coordinates that follow.

    Raises:
        MissingName: no such joint.
    """

    def __init__(
        self, mechanism: Mechanism, q: np.ndarray, driven: Sequence[str] | None = None
    ) -> None:
        self.mechanism = mechanism
        self._weight = _weights(mechanism)
        # Coordinates inside the loops are those that open them, in any of three configurations.
        somewhere = np.random.default_rng(0).uniform(-1.0, 1.0, (3, mechanism.model.nq))
        felt = np.max([np.abs(closing_rows(mechanism, at)).max(axis=0) for at in somewhere], axis=0)
        inside = [i for i in ideal_coordinates(mechanism) if felt[i] > 1e-9]
        self.driven = self._determining(q, inside) if driven is None else tuple(driven)
        held = {mechanism.coordinate(name) for name in self.driven}
        self.passive = np.array([i for i in inside if i not in held], int)
        self._standing = np.setdiff1d(np.arange(mechanism.model.nq), self.passive)
        self._steps = np.full(mechanism.model.nq, _STEP)
        for name in self.driven:
            if mechanism.description.joints[name].slides:
                self._steps[mechanism.coordinate(name)] *= ANGLE_ARM_M

    def _determining(self, q: np.ndarray, inside: Sequence[int]) -> tuple[str, ...]:
        """The joints nearest to the base that determine the other coordinates inside the loops.

        From the base outwards, a joint is taken if the loops determine the rest as well without it:
        if the columns left have the same rank. It ends when they are independent.
        """
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
        """Jacobian of the weighted openings by all coordinates, (rows, nv)."""
        return self._weight[:, None] * closing_rows(self.mechanism, q)

    def stands(self, q: np.ndarray, at: int, count: int) -> str:
        """Positions of the driven joints at `q` (nq,), pose number `at` of `count`, in words."""
        place = self.mechanism.coordinate
        entries = self.mechanism.description.joints
        values = ", ".join(
            f"{name} {readable(q[place(name)], entries[name].unit)}" for name in self.driven
        )
        pose = f" (pose {at + 1} of {count})" if count > 1 else ""
        return (values or "no joint driven") + pose

    def linear(self, q: np.ndarray) -> Closing:
        """The loop equations in the closed configuration q, solved by singular values."""
        left, sizes, right = np.linalg.svd(self._rows(q)[:, self.passive])
        rank = int((sizes > _threshold(sizes)).sum())
        follow = right[:rank].T / sizes[:rank] @ left[:, :rank].T
        return Closing(follow, left[:, rank:].T, right[rank:].T, self._weight)

    def closed(self, q: np.ndarray, begin: np.ndarray | None = None) -> np.ndarray:
        """Configurations (n, nq) with their loops closed in order, from `begin` (nq,) if given.

        Raises:
            JointplayError: the loops of one cannot be closed; see `close_all`.
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
        """Configurations (n, nq) with closed loops, journals centred; and where that succeeded.

        From one to the next the driven joints go in small steps, so that the mechanism stays on its
        branch. The first is reached from `begin` (nq,), closed, or else from its own passive
        positions. With `apart` they are not in the order of a motion: each is reached from the
        nearest one that is closed.
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
                for name in self.mechanism.gears:  # motors turn along: gears are unstrained
                    motor = self.mechanism.motor(name)
                    closed[i, motor] = solution[self.mechanism.coordinate(name)]
        return closed, good

    def _reach(self, begin: np.ndarray | None, goal: np.ndarray) -> np.ndarray | None:
        """The closed configuration with the driven positions of `goal`; None if it is not reached.

        In steps from `begin`, closed; without it, from the passive positions of `goal`.
        """
        if begin is None:
            near = self.close(goal)
            if near is None:
                near = self.close(least_open(self.mechanism, goal, self.passive, {}))
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
        """Configuration (nq,) near `start` whose passive coordinates close the loops, or None.

        Other coordinates stay, those of displaced journals in the tree, too. Journals of loops have
        the poses `aside` in their bearings; centred if not given. Unless `exactly`, the openings
        need only be least.
        """
        directions = np.eye(len(start))[:, self.passive]
        q = newton(self.mechanism, start, directions, self._weight, aside)
        if q is not None and exactly and not is_closed(self.mechanism, q):
            return None
        return q


def opening(mechanism: Mechanism, moved: int, twist: np.ndarray) -> np.ndarray:
    """Rate at which loops and locks open if all that Pinocchio joint `moved` carries has a twist.

    Shape (rows, k). `twist` (6, k): velocity of the world's origin and angular velocity, world
    axes; after `pin.computeJointJacobians`.
    """
    supports = mechanism.model.supports
    rows = [np.zeros((0, twist.shape[1]))]
    for closure in closures(mechanism):
        (i, _), (j, _) = closure.frames
        sign = int(moved in supports[j]) - int(moved in supports[i])
        rows.append(motion_between(mechanism.data, closure.frames, sign * twist)[closure.rows])
    return np.concatenate(rows)


def own_opening(mechanism: Mechanism, loop: str) -> np.ndarray:
    """Openings of all loops per displacement of the journal of `loop` in its bearing, (rows, 6)."""
    still, moved = np.zeros((6, 6)), -np.eye(6)
    rows = [(moved if c.name == loop else still)[c.rows] for c in closures(mechanism)]
    return np.concatenate([np.zeros((0, 6)), *rows])


def is_closed(mechanism: Mechanism, q: np.ndarray) -> bool:
    """Whether all loops are closed to `ASSEMBLY_TOLERANCE_M`, journals centred."""
    gaps = np.abs(_weights(mechanism) * openings(mechanism, q))
    return bool(gaps.max(initial=0.0) <= ASSEMBLY_TOLERANCE_M)


def from_the_base(mechanism: Mechanism) -> list[str]:
    """Joints that have one coordinate without clearance, in order of their depth from the base."""
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
    """Joints that mimic others, by name, where no loop determines them.

    In the URDF of a gripper or a lift, `<mimic>` often stands for a loop that a URDF cannot have.
    Where the loop is there, joints follow the loop: a mimic that would hold its leader, or that
    follows from the loops anyway, is left out. That is judged by the rank of the constraints in
    `q` (nq,), in which loops are closed without clearance. Joints in `alone` follow nothing.
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
            more_rank = _rank(more)
            if more_rank == rank:  # the loops imply it
                continue
            if mimic.leader in mechanism.coordinates:
                leads = np.eye(mechanism.model.nv)[[mechanism.coordinate(mimic.leader)]]
                if _rank(np.concatenate([more, leads])) == more_rank:  # it holds its leader
                    continue
            rank = more_rank
        followed[name], rows = mimic, more
    return followed


def turns_in_place(mechanism: Mechanism, q: np.ndarray) -> bool:
    """Whether the tool of the ideal mechanism turns about its own origin, as a linkage's rocker.

    Its output then is an angle, although with play in its pivot the origin moves as well.
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
    """Constraint row of a mimicking joint, shape (nv,): zero times every velocity that obeys it."""
    row = np.zeros(mechanism.model.nv)
    row[mechanism.coordinate(name)] = 1.0
    if mimic.leader in mechanism.coordinates:
        row[mechanism.coordinate(mimic.leader)] -= mimic.multiplier
    return row


def _weights(mechanism: Mechanism) -> np.ndarray:
    """`Closure.weights` of all closures, shape (rows,)."""
    return np.concatenate([np.zeros(0), *(c.weights for c in closures(mechanism))])


def _threshold(sizes: np.ndarray) -> float:
    """Singular value up to which it counts as zero."""
    return float(SINGULAR * max(sizes.max(initial=0.0), ANGLE_ARM_M))


def _rank(rows: np.ndarray) -> int:
    sizes = np.linalg.svd(rows, compute_uv=False)
    return int((sizes > _threshold(sizes)).sum())
