"""Inverse kinematics of the ideal robot: joint motions that lead its tool through poses.

A controller knows nothing of clearance, so that the reference is that of the ideal mechanism; how
far the tool misses it is what a simulation with clearance shows.

1. `Arm` is the ideal mechanism with its constraints: loops that stay closed, joints that mimic
   others. `Arm.search` finds a configuration for a pose by Levenberg and Marquardt's method, with
   the constraints as further residuals; `Arm.nearest` moves along the null space to the solution
   nearest to the configuration before.
2. `cartesian_path` solves each waypoint from the one before, so that the robot keeps its branch, on
   a line many points between; `_solve` refuses singular configurations, and says why a pose cannot
   be reached.
3. `reachable` asks for many poses whether they can be reached at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import (
    JointplayError,
    MissingName,
    require_finite,
    require_known,
    require_numbers,
    within,
)
from jointplay.base.progress import ProgressBar
from jointplay.model import closed_loops
from jointplay.model.frames import carried
from jointplay.model.loop import assemble, closing_rows, openings
from jointplay.model.mechanism import Mechanism, frame_index
from jointplay.model.tree import Tree
from jointplay.model.urdf import Mimic
from jointplay.simulation.motion.reference import Motion, check_waypoints

# The ideal mechanism and its inverse kinematics.


ANGLE_ARM_M = 0.1
"""Lever arm that turns an angle of the tool into a length [m/rad]."""
REACHED_M = 1e-11
"""Residual below which a waypoint counts as reached [m]."""
NEARLY_M = 1e-6
"""Residual below which a search that ends in a singular configuration counts as near [m]."""
SINGULAR_M = 1e-4
"""Singular value of the tool's Jacobian below which a direction is lost [m per rad or m]."""
_DAMPING = (1e-7, 1e-2, 1e3)
"""Smallest, first and largest damping of the search [m]."""
_ITERATIONS = 300
"""Most steps of a search: judged; `_STALLED` ends most that come to nothing."""
_FAR = 2.0
"""Distance, over the mechanism's reach (`Arm.reach`), beyond which nothing is searched; nearer, a
search says how near the tool comes."""
_STALLED, _STALLED_FALL = 20, 0.99
"""Steps of a search (damping takes 17 of them from its smallest to its largest) in which the
residual must fall below this part of itself: where it does not, there is no solution."""
_LOST = 1e-8
"""Singular value of the constraints' Jacobian, relative to the largest, that counts as zero."""
SINGULAR = 1e-3
"""Least authority of the driven joints, see `Arm.authority`."""
_SAMPLES = 5
"""Closed configurations, beside the first, in which freedoms are counted."""
_SAME = 1e-6
"""Largest difference of two configurations that count as the same [rad or m]."""
_NEAR = 30
"""Most steps of a search for a configuration that is near."""
_LEAST_SHARE = 1.0 / 256.0
"""Smallest step in which a target is approached, relative to the whole way."""
_CONSTRAINT_WEIGHT = 1e3
"""Weight of the constraints against the tool's residual in `Arm.nearest_miss`."""
HALF_RANGE = math.pi
"""Half the range of restarts about zero, for joints without limits [rad or m]."""


class Target(NamedTuple):
    """A pose that the frame shall have, in the world."""

    position: np.ndarray
    turn: np.ndarray | None = None
    """Rotation matrix; None: any orientation."""

    def __str__(self) -> str:
        x, y, z = self.position
        return f"({x:.6g}, {y:.6g}, {z:.6g}) m"

    def way_to(self, end: Target) -> tuple[np.ndarray, np.ndarray]:
        """Displacement [m] and rotation vector [rad] from here to `end`."""
        axis = np.zeros(3)
        if self.turn is not None and end.turn is not None:
            axis = pin.log3(self.turn.T @ end.turn)
        return end.position - self.position, axis

    def towards(self, end: Target, part: float) -> Target:
        """The pose after a part of the way to `end`."""
        if part == 1.0:
            return end
        shift, axis = self.way_to(end)
        turn = None
        if self.turn is not None and end.turn is not None:
            turn = self.turn @ pin.exp3(part * axis)
        return Target(self.position + part * shift, turn)


@dataclass(frozen=True)
class SearchEnd:
    """Where a search ended."""

    q: np.ndarray
    residual: np.ndarray
    """Displacement left to the target in world axes [m], rotation vector left times `ANGLE_ARM_M`
    [m], and residuals of the constraints [m]."""
    reached: bool
    """Whether the frame is there, and the constraints are kept."""


class Arm:
    """The ideal mechanism, the frame that is led, and the constraints on its joints.

    Loops must stay closed, and joints that mimic others must follow them: the search has both as
    residuals beside the tool's. The motions that they allow are the columns of `freedoms`. The
    arguments are those of `cartesian_path`; `turning`: whether orientations are led, too.

    Attributes:
        single: joints of one coordinate.
        joints: joints that the motion names.
        at: their coordinates.
        origin, reach: a fixed point, and the largest distance of the frame from it [m].
        seed: configuration where searches begin, loops closed, shape (nq,).
        mobility: number of independent freedoms.
        directions: number of directions in which the tool is led: 6 with its orientation, else 3.
        rank: number of directions in which it can be led at all (`_find_rank`).
    """

    def __init__(
        self,
        mechanism: Mechanism,
        frame: str | None,
        start: Mapping[str, float],
        driven: Sequence[str] | None,
        turning: bool,
    ) -> None:
        self.ideal = ideal = mechanism.ideal()
        self.names = ideal.coordinates
        self.single = [name for name in ideal.joints if name in self.names]
        balls = [name for name in ideal.joints if name not in self.names]
        if balls and not ideal.loops:
            raise JointplayError(
                f"a Cartesian motion cannot move the ball joint {balls[0]!r}, which has no drive"
            )
        if not ideal.joints:
            raise JointplayError("a Cartesian motion needs moving joints, this robot has none")
        self.model, self.data = ideal.model, ideal.data
        self.frame = frame_index(self.model, ideal.tool if frame is None else frame)
        # Limits, and the sphere of the tool.
        self.low, self.high = np.full((2, len(self.names)), [[-np.inf], [np.inf]])
        self.at = [ideal.coordinate(name) for name in self.single]
        self.low[self.at], self.high[self.at] = joint_limits(mechanism, self.single)
        self.origin, self.reach = self._sphere()
        # Constraints, and a configuration that keeps them.
        self.mimics: dict[str, Mimic] = {}
        self._constraint_weight = 1.0
        self._tolerance = REACHED_M
        self.seed = self._seed(start)
        if not ideal.loops and driven is not None:
            reason = "driven joints are chosen in closed loops only: here all its joints are driven"
            raise JointplayError(reason, ("driven",))
        self.mimics = closed_loops.followed_mimics(ideal, self.seed, () if ideal.loops else start)
        if ideal.loops or self.mimics:
            self.seed = self.search(self.seed, None).q
        # Freedoms, and the joints that a motion must lead.
        self.mobility = len(self.names)
        self.mobility = min(self.freedoms(q).shape[1] for q in self._samples())
        self.joints = ideal.joints
        if ideal.loops:
            self.joints = self._driven(driven)
            self.at = [ideal.coordinate(name) for name in self.joints]
        self.directions = 6 if turning else 3
        self.random = np.random.default_rng(0)
        self.rank = self._find_rank()
        self._tolerance = NEARLY_M if self.rank < self.directions else REACHED_M

    def _sphere(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius [m] of a sphere that the frame does not leave.

        The radius is the sum of the lengths from joint to joint and of the strokes of sliders.
        """
        tree = Tree(self.model)
        (body,), (place,) = tree.frames([carried(self.model, self.frame)])
        bodies, body, reach, link = tree.bodies, int(body), 0.0, place[9:]
        while body:
            reach += float(np.linalg.norm(link))
            link = bodies.shifts[body]
            if bodies.slides[body]:
                reach += max(-self.low[body - 1], self.high[body - 1])
            body = int(bodies.parents[body])
        return link, reach

    def _seed(self, start: Mapping[str, float]) -> np.ndarray:
        """Positions as given, the others at zero or the limit next to it, with loops closed."""
        q = np.clip(np.zeros(len(self.names)), self.low, self.high)
        for name, value in start.items():
            if name not in self.names:
                raise MissingName("moving joint", name, self.ideal.joints)
            i = self.names.index(name)
            q[i] = require_finite(f"start of joint {name!r}", value, "rad or m")
            if not self.low[i] <= q[i] <= self.high[i]:
                raise JointplayError(
                    f"start of joint {name!r} at {q[i]:g} violates its limits "
                    f"{self.low[i]:g} to {self.high[i]:g}"
                )
        if not self.ideal.loops:
            return q
        closed = self.search(q, None)
        return closed.q if closed.reached else assemble(self.ideal, q, ())

    def _samples(self) -> list[np.ndarray]:
        """Configurations about the seed in which the loops are closed, the seed among them."""
        random = np.random.default_rng(0)
        return [self.seed, *(self.anywhere(random, 0.3) for _ in range(_SAMPLES))]

    def _driven(self, driven: Sequence[str] | None) -> tuple[str, ...]:
        """The joints that a motion must name: `driven`, checked; None: those nearest to the base.

        They suffice if their rows of `freedoms` have the rank `mobility`, and are all needed.
        """
        ideal = self.ideal
        bases = [self.freedoms(q) for q in self._samples()]

        def rank(names: Sequence[str]) -> int:
            at = [ideal.coordinate(name) for name in names]
            return max(int(np.linalg.matrix_rank(base[at], _LOST)) for base in bases)

        if driven is None:
            chosen: list[str] = []
            for name in closed_loops.from_the_base(ideal):
                if name not in self.mimics and rank([*chosen, name]) > len(chosen):
                    chosen.append(name)
        else:
            chosen = list(dict.fromkeys(driven))
            for name in chosen:
                if name not in self.single:
                    raise MissingName("joint to drive", name, self.single, where=("driven",))
        held = rank(chosen)
        if held < len(chosen):
            raise JointplayError(
                f"the driven joints {', '.join(chosen)} do not move independently: the loops (and "
                f"joints that mimic others) leave them {held} of {len(chosen)} freedoms; name "
                f"{self.mobility}, such as {', '.join(self._driven(None))}",
                where=("driven",),
            )
        if held < self.mobility:
            # Name the joints that still move where the driven ones stand.
            base, at = bases[0], [ideal.coordinate(name) for name in chosen]
            _, values, motions = np.linalg.svd(base[at])
            left = np.abs(base @ motions[int((values > _LOST).sum()) :].T).max(axis=1)
            loose = dict.fromkeys(
                repr(name.joint) for name, size in zip(self.names, left, strict=True) if size > 1e-6
            )
            raise JointplayError(
                f"nothing determines {', '.join(loose)}: of the mechanism's {self.mobility} "
                f"freedoms the driven joints ({', '.join(chosen) or 'none'}) hold {held}; drive "
                "more joints, or replace a ball joint that only lets a rod spin by two hinges",
                where=("driven",),
            )
        return tuple(chosen)

    def pose(self, q: np.ndarray) -> pin.SE3:
        pin.forwardKinematics(self.model, self.data, q)
        return pin.updateFramePlacement(self.model, self.data, self.frame)

    def residual(self, q: np.ndarray, target: Target | None) -> np.ndarray:
        """The residual of `SearchEnd`; without a target that of the constraints only."""
        parts = [self._constraint_residual(q)]
        if target is not None:
            pose = self.pose(q)
            if target.turn is not None:
                parts.insert(0, ANGLE_ARM_M * pin.log3(target.turn @ pose.rotation.T))
            parts.insert(0, target.position - pose.translation)
        return np.concatenate(parts)

    def _constraint_residual(self, q: np.ndarray) -> np.ndarray:
        """Gaps of the loops and of joints that mimic others, signed as displacements left [m]."""
        parts = [-openings(self.ideal, q) if self.ideal.loops else np.zeros(0)]
        for name, mimic in self.mimics.items():
            lead = q[self.names.index(mimic.leader)] if mimic.leader in self.names else 0.0
            off = mimic.multiplier * lead + mimic.offset - q[self.names.index(name)]
            parts.append(np.array([ANGLE_ARM_M * off]))
        return self._constraint_weight * np.concatenate(parts)

    def constraint_rows(self, q: np.ndarray) -> np.ndarray:
        """Jacobian of the constraints, whose null space keeps loops closed and mimics following."""
        rows = [np.zeros((0, self.model.nv))]
        if self.ideal.loops:
            rows.append(closing_rows(self.ideal, q))
        rows += [
            ANGLE_ARM_M * closed_loops.mimic_row(self.ideal, *mimic)[None]
            for mimic in self.mimics.items()
        ]
        return self._constraint_weight * np.concatenate(rows)

    def freedoms(self, q: np.ndarray) -> np.ndarray:
        """Orthonormal basis of the motions that the constraints allow, shape (nv, mobility)."""
        rows = self.constraint_rows(q)
        if not len(rows):
            return np.eye(self.model.nv)
        _, values, right = np.linalg.svd(rows)
        held = int(np.count_nonzero(values > _LOST * values.max(initial=ANGLE_ARM_M)))
        return np.asarray(right[held:].T)

    def jacobian(self, q: np.ndarray, directions: int) -> np.ndarray:
        """Jacobian of the frame, world axes, angles on `ANGLE_ARM_M`, shape (directions, nv)."""
        kind = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(self.model, self.data, q, self.frame, kind)
        jacobian = jacobian.reshape(6, self.model.nv)
        if directions == 3:
            return jacobian[:3]
        return np.concatenate([jacobian[:3], ANGLE_ARM_M * jacobian[3:]])

    def tool_motions(self, q: np.ndarray, directions: int) -> np.ndarray:
        """Motion of the frame with each of `freedoms`, shape (directions, mobility)."""
        return self.jacobian(q, directions) @ self.freedoms(q)

    def _find_rank(self) -> int:
        """The largest number of directions in which the tool can be led, over random poses.

        If they are fewer than asked for, targets need to fit in the others only as exactly as
        numbers in a URDF do.
        """
        rank = 0
        for _ in range(20):
            motions = self.tool_motions(self.anywhere(self.random), self.directions)
            values = np.linalg.svd(motions, compute_uv=False)
            rank = max(rank, int(np.sum(values > 10.0 * SINGULAR_M)))
        return rank

    def anywhere(self, random: np.random.Generator, reach: float | None = None) -> np.ndarray:
        """A random configuration within the limits, its constraints kept.

        `reach`: largest distance from the seed before loops are closed [rad or m]; None: any.
        """
        low = np.where(np.isfinite(self.low), self.low, -HALF_RANGE)
        high = np.where(np.isfinite(self.high), self.high, HALF_RANGE)
        if reach is not None:
            low, high = np.maximum(low, self.seed - reach), np.minimum(high, self.seed + reach)
        low = np.minimum(low, high)
        if not (self.ideal.loops or self.mimics):
            return random.uniform(low, high)
        for _ in range(_RESTARTS):
            end = self.search(random.uniform(low, high), None)
            if end.reached:
                return end.q
        return self.seed

    def manoeuvrability(self, q: np.ndarray) -> float:
        """Smallest singular value of the tool's motions, of the `rank` that it can have [m]."""
        values = np.linalg.svd(self.tool_motions(q, self.directions), compute_uv=False)
        return float(values[self.rank - 1]) if self.rank else 0.0

    def authority(self, q: np.ndarray) -> float:
        """Least motion of the driven joints in a motion of all joints of size 1.

        It is 0 in a singular configuration of type 2 (C. Gosselin, J. Angeles, IEEE Transactions on
        Robotics and Automation 6 (1990) 281-290): the tool can move although they stand.
        """
        base = self.freedoms(q)
        if base.shape[1] > len(self.at):
            return 0.0
        return float(np.linalg.svd(base[self.at], compute_uv=False)[-1])

    def attainable(self) -> str:
        """Components of the frame's pose that the mechanism can lead, in words."""
        turning = self.directions == 6
        moves = [self.tool_motions(q, 6) for q in self._samples()]
        largest = np.max([np.abs(motion).max(axis=1) for motion in moves], axis=0)
        able = [axis for axis, size in zip("xyz", largest[:3], strict=True) if size > SINGULAR_M]
        turns = [axis for axis, size in zip("xyz", largest[3:], strict=True) if size > SINGULAR_M]
        ranks = [
            max(int(np.linalg.matrix_rank(motion[:rows], SINGULAR_M)) for motion in moves)
            for rows in (3, 6)
        ]
        place = self.pose(self.seed)
        notes = [f"the tool can be led along {', '.join(able) or 'no axis'}"]
        notes += [
            f"its {axis} stays {round(value, 9) + 0.0:.6g} m"
            for axis, value in zip("xyz", place.translation, strict=True)
            if axis not in able
        ]
        if turning and not turns:
            roll, pitch, yaw = np.round(pin.rpy.matrixToRpy(place.rotation), 6) + 0.0
            notes.append(f"it does not turn (rpy stays {roll:.4g}, {pitch:.4g}, {yaw:.4g} rad)")
        elif turning and ranks[1] == ranks[0]:
            notes.append("its orientation follows from its position: leave the orientation out")
        elif turning:
            notes.append(f"it can be turned about {', '.join(turns)}")
        if ranks[turning] < len(able) + (len(turns) if turning else 0):
            notes.append(f"{ranks[turning]} of these components are independent")
        return "; ".join(notes)

    def search(
        self,
        seed: np.ndarray,
        target: Target | None,
        bounds: tuple[np.ndarray, np.ndarray] | None = None,
        iterations: int = _ITERATIONS,
    ) -> SearchEnd:
        """Search from `seed` by Levenberg and Marquardt's method, within bounds (None: limits).

        Joints that come to their limits stay there. Steps are of least norm, so that joints which
        need not move do not. Without a target only the constraints are fulfilled.
        """
        low, high = (self.low, self.high) if bounds is None else bounds
        q, damping = np.clip(seed, low, high), _DAMPING[1]
        residual = self.residual(q, target)
        before = np.inf
        for k in range(iterations):
            size = float(np.linalg.norm(residual))
            if size < 1e-3 * REACHED_M:
                break
            if k % _STALLED == 0:
                if size > _STALLED_FALL * before:
                    break
                before = size
            jacobian = self._residual_rows(q, target)
            # The damped step by singular values, without the joints that would leave their range.
            free = np.ones(len(q), bool)
            while True:
                left, values, right = np.linalg.svd(jacobian[:, free], full_matrices=False)
                step = np.zeros(len(q))
                step[free] = right.T @ (values / (values**2 + damping**2) * (left.T @ residual))
                out = ((q <= low) & (step < 0.0)) | ((q >= high) & (step > 0.0))
                if not out.any():
                    break
                free &= ~out
            trial = np.clip(q + step, low, high)
            if np.array_equal(trial, q):
                break
            # Taken if it brings the residual down; else damped more.
            left_over = self.residual(trial, target)
            if np.linalg.norm(left_over) < np.linalg.norm(residual):
                q, residual, damping = trial, left_over, max(0.2 * damping, _DAMPING[0])
            elif damping < _DAMPING[2]:
                damping *= 4.0
            else:
                break
        return self._end(q, residual)

    def _end(self, q: np.ndarray, residual: np.ndarray) -> SearchEnd:
        return SearchEnd(q, residual, float(np.linalg.norm(residual)) < self._tolerance)

    def _residual_rows(self, q: np.ndarray, target: Target | None) -> np.ndarray:
        """Jacobian of `residual`, its sign changed."""
        constraints = self.constraint_rows(q)
        if target is None:
            return constraints
        return np.concatenate([self.jacobian(q, self.directions), constraints])

    def approach(self, q: np.ndarray, target: Target) -> SearchEnd:
        """Search for `target` from q, where the loops are closed, without a jump to another branch.

        With loops the tool goes in a straight line, in steps so short that each configuration is
        near the last: far from q, loops close in several ways. It ends where the line leaves the
        workspace.
        """
        if not self.ideal.loops:
            return self.search(q, target)
        pose = self.pose(q)
        begin = Target(pose.translation.copy(), pose.rotation.copy())
        part, share, end = 0.0, 1.0, self._end(q, self.residual(q, target))
        while part < 1.0 and share > _LEAST_SHARE:
            ahead = min(part + share, 1.0)
            trial = self.search(end.q, begin.towards(target, ahead), iterations=_NEAR)
            if trial.reached and np.abs(trial.q - end.q).max() < JUMP:
                end, part, share = trial, ahead, 2.0 * share
            else:
                share *= 0.5
        return self._end(end.q, self.residual(end.q, target))

    def nearest_miss(self, end: SearchEnd, target: Target) -> SearchEnd:
        """Search for the pose nearest to `target` from a search that missed it, loops closed.

        The constraints, weighted by `_CONSTRAINT_WEIGHT`, are kept practically exactly.
        """
        self._constraint_weight = _CONSTRAINT_WEIGHT
        try:
            return self.search(end.q, target)
        finally:
            self._constraint_weight = 1.0

    def nearest(self, solution: SearchEnd, seed: np.ndarray, target: Target) -> SearchEnd:
        """The solution nearest to `seed` that can be reached from `solution` through solutions.

        Each step goes to `seed` along the null space of the residual's Jacobian, and is corrected.
        """
        share, held = 1.0, len(self.names) - self.mobility + self.rank
        for _ in range(_ITERATIONS):
            rows = self._residual_rows(solution.q, target)
            _, _, right = np.linalg.svd(rows, full_matrices=False)
            away = seed - solution.q
            step = away - right[:held].T @ (right[:held] @ away)
            if np.linalg.norm(step) < 1e-9 or share < 1e-3:
                break
            trial = self.search(solution.q + share * step, target)
            if trial.reached and np.linalg.norm(seed - trial.q) < np.linalg.norm(away):
                solution = trial
            else:
                share *= 0.5
        return solution


def joint_limits(mechanism: Mechanism, joints: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper limits of joints in the URDF, infinite where it sets none."""
    entries = [mechanism.description.joints[name] for name in joints]
    low = [-np.inf if entry.lower is None else entry.lower for entry in entries]
    high = [np.inf if entry.upper is None else entry.upper for entry in entries]
    return np.array(low), np.array(high)


# Paths of the tool, solved point by point.

PATHS = ("joint", "line")

SAMPLE_S = 5e-3
"""Longest time between two inverse solutions on a line [s]."""
SAMPLE_M = 2e-3
"""Longest way of the tool between them [m]; an angle counts on `ANGLE_ARM_M`."""
JUMP = 0.1
"""Motion of a joint between two solutions beyond which it jumps [rad or m]."""
_PATIENCE_S = 2.0
"""Time after which work shows a bar [s]."""
_RESTARTS = 40
"""Searches from random configurations before a waypoint is out of reach: judged; an arm of six axes
has up to 16 branches."""


@dataclass(frozen=True)
class CartesianPath:
    """A motion of the joints that leads the tool along a path, and how loops are assembled."""

    motion: Motion
    """Motion of all joints, or in closed loops of the driven ones."""
    start: Mapping[str, float]
    """In closed loops, positions at the start of the joints that follow, so that the mechanism is
    assembled as the path has it; empty where the driven ones determine them [rad or m]."""


def cartesian_motion(
    mechanism: Mechanism,
    times: Sequence[float] | np.ndarray,
    positions: Sequence[Sequence[float]] | np.ndarray,
    orientations: Sequence[Sequence[float]] | np.ndarray | None = None,
    **options: Any,
) -> Motion:
    """Return the motion of `cartesian_path`, which explains the options.

    In closed loops use `cartesian_path`, and give the run the path's `start` as its state: loops
    can close in several ways.
    """
    return cartesian_path(mechanism, times, positions, orientations, **options).motion


def cartesian_path(
    mechanism: Mechanism,
    times: Sequence[float] | np.ndarray,
    positions: Sequence[Sequence[float]] | np.ndarray,
    orientations: Sequence[Sequence[float]] | np.ndarray | None = None,
    *,
    frame: str | None = None,
    path: str = "joint",
    start: Mapping[str, float] | None = None,
    driven: Sequence[str] | None = None,
) -> CartesianPath:
    """Make a reference motion that leads the tool of the ideal mechanism through waypoints.

    Each waypoint is solved from the one before, so that the robot keeps its branch (elbow, wrist,
    the way in which its loops are assembled), within the joint limits of the URDF. A redundant
    robot (more joints than commanded directions) takes the configuration nearest to the one before,
    1 m counting as 1 rad. The method is that of Levenberg and Marquardt on the frame's Jacobian (K.
    Levenberg, Quarterly of Applied Mathematics 2 (1944) 164-168); closed loops, and joints that
    mimic others, are further residuals.

    Args:
        mechanism: the mechanism, of which clearance and gears' play are left out.
        times: times of the waypoints, increasing, shape (n,), n >= 2 [s].
        positions: positions of the frame's origin in world axes, shape (n, 3) [m].
        orientations: roll, pitch, yaw of the frame in world axes as in URDF, shape (n, 3) [rad];
            None leaves the orientation free.
        frame: name of the frame that is led; None: the mechanism's tool.
        path: ``joint`` moves the joints by rest-to-rest quintics between the waypoints; ``line``
            moves the frame on straight lines, resting at each waypoint, by the same quintic law in
            time, while its orientation turns about a fixed axis, the shorter way round. A line is
            solved at least every `SAMPLE_S` and `SAMPLE_M`, with quintic splines between.
        start: positions by joint at which the search for the first waypoint begins [rad or m];
            joints that it does not name begin at zero, or at the limit nearest to it. It selects
            the branch.
        driven: in closed loops the joints that have a drive, as many as the mechanism has freedoms;
            None: those nearest to the base.

    Returns:
        A motion of all joints of an open mechanism, or of the driven ones of closed loops with the
        positions at which the others begin.

    Raises:
        JointplayError: wrong shapes or numbers; a waypoint out of reach, or within reach only
            beyond joint limits or in another branch; a singular configuration; a line on which a
            joint would jump; joints between waypoints that lead the loops elsewhere; driven joints
            that do not determine the others; a ball joint in an open chain.
    """
    require_known("path", path, PATHS)
    moments, targets = _waypoints(times, positions, orientations)
    arm = Arm(mechanism, frame, start or {}, driven, orientations is not None)
    for i, target in enumerate(targets):
        with within("positions", i):
            _require_near(arm, target, f"waypoint {i + 1}")
    counts = [1] * len(targets)
    if path == "line":
        counts[1:] = [_samples(*pair) for pair in pairwise(zip(moments, targets, strict=True))]
    with ProgressBar(
        total=sum(counts), desc="inverse kinematics", unit="pose", delay=_PATIENCE_S, leave=False
    ) as bar:
        with within("positions", 0):
            q = _solve(arm, arm.seed, targets[0], "waypoint 1", first=True)
        bar.update()
        solved = [(float(moments[0]), q)]
        for i in range(1, len(targets)):
            with within("positions", i):
                if path == "line":
                    ends = moments[i - 1 : i + 1], targets[i - 1 : i + 1]
                    for node in _line(arm, q, *ends, counts[i], i + 1):
                        solved.append(node)
                        bar.update()
                else:
                    ahead = _solve(arm, q, targets[i], f"waypoint {i + 1}")
                    _check_way(arm, q, ahead, targets[i], i + 1)
                    solved.append((float(moments[i]), ahead))
                    bar.update()
            q = solved[-1][1]
    interpolation = "spline" if path == "line" else "rest-to-rest"
    nodes, configurations = zip(*solved, strict=True)
    table = np.array(configurations)[:, arm.at]
    waypoints = moments if path == "line" else None
    motion = Motion(arm.joints, np.array(nodes), table, interpolation, waypoints)
    return CartesianPath(motion, _followers_at(arm, solved[0][1]))


def reachable(
    mechanism: Mechanism,
    positions: Sequence[Sequence[float]] | np.ndarray,
    orientations: Sequence[Sequence[float]] | np.ndarray | None = None,
    *,
    frame: str | None = None,
    start: Mapping[str, float] | None = None,
    driven: Sequence[str] | None = None,
    progress: bool = False,
) -> np.ndarray:
    """Find which poses the ideal mechanism's tool can have: its workspace by points, shape (n,).

    A pose counts within the joint limits of the URDF, and where the configuration is not singular.
    Each is searched from the nearest one reached before, so that a mechanism with loops stays
    assembled in the same way; give them in an order in which neighbours follow each other. The
    arguments are those of `cartesian_path`; `progress` shows a bar.

    Raises:
        JointplayError: wrong shapes or numbers; a mechanism whose tool cannot be led at all.
    """
    _, targets = _waypoints(np.arange(len(positions), dtype=float), positions, orientations)
    arm = Arm(mechanism, frame, start or {}, driven, orientations is not None)
    able = np.zeros(len(targets), bool)
    seeds, places = [arm.seed], [arm.pose(arm.seed).translation.copy()]
    shown = ProgressBar(targets, "poses", delay=1.0, leave=False) if progress else targets
    for i, target in enumerate(shown):
        away = np.linalg.norm(np.array(places) - target.position, axis=1)
        with suppress(JointplayError):
            _require_near(arm, target, "")
            end = arm.approach(seeds[int(away.argmin())], target)
            if end.reached:
                _require_regular(arm, end.q, target, "")
                able[i] = True
                seeds.append(end.q)
                places.append(target.position)
    return able


def _followers_at(arm: Arm, q: np.ndarray) -> dict[str, float]:
    """Positions of the joints that follow in loops, unless the driven ones lead there anyway."""
    if not arm.ideal.loops:
        return {}
    begin = np.zeros_like(q)
    begin[arm.at] = q[arm.at]
    with suppress(JointplayError):
        if np.abs(assemble(arm.ideal, begin, arm.at) - q).max() < _SAME:
            return {}
    return {
        name: float(q[arm.names.index(name)])
        for name in arm.single
        if name not in arm.joints and name not in arm.mimics
    }


def _check_way(arm: Arm, q: np.ndarray, ahead: np.ndarray, target: Target, number: int) -> None:
    """Refuse a way from q to waypoint `number` on which the driven joints take loops elsewhere."""
    if not arm.ideal.loops:
        return
    stand = [*arm.at, *(arm.names.index(name) for name in arm.mimics)]
    trial = q.copy()
    trial[stand] = ahead[stand]
    standing = [arm.names[i] for i in stand]
    (closed,), (good,) = closed_loops.ClosedLoops(arm.ideal, q, standing).close_all(
        trial[None], begin=q
    )
    if not good or np.abs(closed - ahead).max() > _SAME:
        raise JointplayError(
            f"on the way to waypoint {number} at {target} the driven joints "
            f"({', '.join(arm.joints)}), moved in step, pass a singular configuration (type 2) or "
            'leave the workspace; add waypoints between, or take path = "line"'
        )


def _waypoints(
    times: Sequence[float] | np.ndarray,
    positions: Sequence[Sequence[float]] | np.ndarray,
    orientations: Sequence[Sequence[float]] | np.ndarray | None,
) -> tuple[np.ndarray, list[Target]]:
    """Times and targets of waypoints, checked."""
    numbers = {"times": times, "positions": positions}
    if orientations is not None:
        numbers["orientations"] = orientations
    checked = {name: require_numbers(name, values) for name, values in numbers.items()}
    moments = checked["times"]
    if moments.ndim != 1 or len(moments) < 2:
        raise JointplayError(
            f"a Cartesian motion needs at least 2 times, got the shape {moments.shape}"
        )
    for name in list(checked)[1:]:
        if checked[name].shape != (len(moments), 3):
            raise JointplayError(
                f"{name} must have the shape (times, 3) = ({len(moments)}, 3), "
                f"got {checked[name].shape}"
            )
    check_waypoints(checked)
    turns: list[np.ndarray | None] = [None] * len(moments)
    if orientations is not None:
        turns = [pin.rpy.rpyToMatrix(*angles) for angles in checked["orientations"]]
    return moments, [Target(*pair) for pair in zip(checked["positions"], turns, strict=True)]


def _require_near(arm: Arm, target: Target, label: str) -> None:
    """Refuse a target far beyond all lengths of the mechanism, before anything is searched."""
    away = float(np.linalg.norm(target.position - arm.origin))
    if away > _FAR * arm.reach + NEARLY_M:
        raise JointplayError(
            f"{label} at {target} is out of reach: the tool comes no nearer to it than "
            f"{away - arm.reach:.4g} m, for it is {away:.4g} m from the first joint and the "
            f"lengths from joint to joint make {arm.reach:.4g} m; positions are in m"
        )


def _solve(
    arm: Arm, seed: np.ndarray, target: Target, label: str, first: bool = False
) -> np.ndarray:
    """Configuration near `seed` in which the frame is at `target`, which `label` names.

    The `first` waypoint may be solved from anywhere.
    """
    solution = arm.approach(seed, target)
    if not solution.reached and arm.ideal.loops:
        solution = arm.search(seed, target)
    if not solution.reached:
        solution = _search_elsewhere(arm, solution, seed, target, label, first)
    if arm.mobility > arm.rank:
        solution = arm.nearest(solution, seed, target)
    _require_regular(arm, solution.q, target, label)
    return solution.q


def _require_regular(arm: Arm, q: np.ndarray, target: Target, label: str) -> None:
    """Refuse a singular configuration: of type 1, or in loops of type 2."""
    smallest = arm.manoeuvrability(q)
    if smallest < SINGULAR_M:
        raise JointplayError(_singular(arm, label, target, smallest))
    if not arm.ideal.loops:
        return
    authority = arm.authority(q)
    if authority < SINGULAR:
        raise JointplayError(
            f"{label} at {target} is singular (type 2): the mechanism can move there although the "
            f"driven joints ({', '.join(arm.joints)}) stand; they move {authority:.2g} in a motion "
            f"of all joints of size 1, at least {SINGULAR:g} is needed"
        )


def _search_elsewhere(
    arm: Arm, attempt: SearchEnd, seed: np.ndarray, target: Target, label: str, first: bool
) -> SearchEnd:
    """Search from random configurations; returns a solution for the `first` waypoint only.

    Otherwise the error says what is wrong, in this order: joint limits, another branch, a singular
    configuration, or how far the nearest pose is away. `attempt` is the search that failed.
    """
    doing = f"looking for {label}"
    restarts = ProgressBar(range(_RESTARTS), doing, unit="try", delay=_PATIENCE_S, leave=False)
    tries = [arm.search(arm.anywhere(arm.random), target) for _ in restarts]
    branches = [end for end in tries if end.reached]
    branch = min(branches, key=lambda end: float(np.linalg.norm(end.q - seed)), default=None)
    remedy = ""
    if branch is not None:
        if first:
            return branch
        values = ", ".join(f"{name} = {branch.q[arm.names.index(name)]:.4g}" for name in arm.single)
        remedy = f"; another branch reaches it, such as {values}: choose it by start"
    unlimited = np.full(len(seed), np.inf)
    beyond = arm.search(seed, target, (-unlimited, unlimited))
    if beyond.reached:
        i = int(np.argmax(np.maximum(arm.low - beyond.q, beyond.q - arm.high)))
        raise JointplayError(
            f"{label} at {target} violates the limits of joint {arm.names[i]!r}: it would have to "
            f"be at {beyond.q[i]:.4g}, allowed is {arm.low[i]:g} to {arm.high[i]:g}{remedy}"
        )
    if remedy:
        raise JointplayError(
            f"{label} at {target} cannot be reached from the waypoint before{remedy}"
        )
    best = min([attempt, *tries], key=lambda end: float(np.linalg.norm(end.residual)))
    smallest = arm.manoeuvrability(best.q)
    if np.linalg.norm(best.residual) < NEARLY_M and smallest < SINGULAR_M:
        raise JointplayError(_singular(arm, label, target, smallest))
    best = arm.nearest_miss(best, target)
    distance = np.linalg.norm(best.residual[:3])
    angle = np.linalg.norm(best.residual[3 : arm.directions]) / ANGLE_ARM_M
    able = f": {arm.attainable()}" if arm.rank < arm.directions else ""
    raise JointplayError(
        f"{label} at {target} is out of reach: {distance:.4g} m and {angle:.4g} rad remain; "
        f"{'move it closer' if distance > NEARLY_M else 'turn it less'}{able}"
    )


def _samples(first: tuple[float, Target], last: tuple[float, Target]) -> int:
    """Number of points on a line from one time and target to the next."""
    shift, axis = first[1].way_to(last[1])
    size = float(np.linalg.norm([*shift, *(ANGLE_ARM_M * axis)]))
    # The quintic's largest speed is 15/8 of the mean; a spline needs a few points.
    most = max((last[0] - first[0]) / SAMPLE_S, 15.0 / 8.0 * size / SAMPLE_M)
    return max(math.ceil(most), 10)


def _line(
    arm: Arm, q: np.ndarray, times: np.ndarray, targets: Sequence[Target], count: int, number: int
) -> Iterator[tuple[float, np.ndarray]]:
    """Times and configurations on the line from q to waypoint `number`, `count` of them."""
    base = arm.freedoms(q)
    span = float(times[1] - times[0])
    for k in range(1, count + 1):
        part, label = k / count, f"the line to waypoint {number}"
        law = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        time, target = times[0] + part * span, targets[0].towards(targets[1], law)
        if k == count:
            time, label = times[1], f"waypoint {number}"
        try:
            ahead = _solve(arm, q, target, label)
        except JointplayError:  # blame the waypoint, if that cannot be reached either
            _solve(arm, q, targets[1], f"waypoint {number}", first=True)
            raise
        moved = np.abs(ahead - q)
        if moved.max() > JUMP:
            i = int(np.argmax(moved))
            raise JointplayError(
                f"on the line to waypoint {number}, near {target}, joint {arm.names[i]!r} would "
                f"jump by {moved[i]:.3g}, to another branch or past a singular configuration; "
                "choose another branch by start, or another way"
            )
        if arm.ideal.loops:
            # A singularity of type 2 lies between where the driven rows of the freedoms change the
            # sign of their determinant, in the basis of the point before.
            now = arm.freedoms(ahead)
            if np.linalg.det(now[arm.at] @ (now.T @ base)) * np.linalg.det(base[arm.at]) <= 0.0:
                raise JointplayError(
                    f"on the line to waypoint {number}, near {target}, the mechanism passes a "
                    "singular configuration (type 2), in which it can move although the driven "
                    f"joints ({', '.join(arm.joints)}) stand; choose another way"
                )
            base = now
        q = ahead
        yield float(time), q


def _singular(arm: Arm, label: str, target: Target, smallest: float) -> str:
    kind = " (type 1)" if arm.ideal.loops else ""
    return (
        f"{label} at {target} is singular{kind}: the tool cannot be led in every direction there "
        f"(smallest singular value {smallest:.2g} m, at least {SINGULAR_M:g} m is needed)"
    )
