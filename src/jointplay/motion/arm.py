"""The ideal arm, and how its joints must stand for its tool to be somewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.errors import JointplayError, MissingName
from jointplay.mechanism.mechanism import Mechanism, frame_index
from jointplay.mechanism.model import parse

ANGLE_ARM_M = 0.1
"""What turns an angle of the tool into a length [m]: 1 rad counts as 0.1 m."""

REACHED_M = 1e-11
"""Error within which a waypoint counts as reached [m]."""

NEARLY_M = 1e-6
"""Error to which a search that ends in a singular configuration may have come [m]."""

SINGULAR_M = 1e-4
"""Singular values of the tool's Jacobian below this have lost their direction [m per rad or m]."""

_DAMPING = (1e-7, 1e-2, 1e3)
"""Smallest, first and largest damping of the search [m]."""

_ITERATIONS = 300

HALF_RANGE = math.pi
"""Range of restarts about zero, for joints without limits [rad or m]."""


class Target(NamedTuple):
    """Where the frame shall be."""

    position: np.ndarray
    turn: np.ndarray | None
    """Rotation matrix; None: any."""

    def __str__(self) -> str:
        """The place."""
        x, y, z = self.position
        return f"({x:.6g}, {y:.6g}, {z:.6g}) m"


@dataclass(frozen=True)
class Found:
    """Where a search ended."""

    q: np.ndarray
    error: np.ndarray
    """Distance in world axes [m], then the rotation vector that is left times `ANGLE_ARM_M`."""

    @property
    def reached(self) -> bool:
        """Whether the frame is there."""
        return float(np.linalg.norm(self.error)) < REACHED_M


class Arm:
    """The ideal robot, the frame that is led, and the joints' limits."""

    def __init__(self, mechanism: Mechanism, frame: str | None) -> None:
        """Refuse robots that cannot be led by one frame."""
        if mechanism.loops:
            raise JointplayError(
                "a Cartesian motion needs a robot without loops, this one has "
                f"{', '.join(mechanism.loops)}; give the motion of its driven joints instead"
            )
        ideal = mechanism.ideal()
        self.joints = ideal.joints
        balls = [name for name in self.joints if name not in ideal.coordinates]
        if balls:
            raise JointplayError(
                f"a Cartesian motion cannot lead the ball joint {balls[0]!r}, which no drive turns"
            )
        if not self.joints:
            raise JointplayError("a Cartesian motion needs moving joints, this robot has none")
        self.model, self.data = ideal.model, ideal.data
        name = ideal.tool if frame is None else frame
        if not self.model.existFrame(name):
            frames = [known.name for known in self.model.frames if known.name != "universe"]
            raise MissingName("frame", name, frames)
        self.frame = frame_index(self.model, name)
        self.low, self.high = joint_limits(mechanism, self.joints)
        self.rank = 0

    def pose(self, q: np.ndarray) -> pin.SE3:
        """Of the frame in the world."""
        pin.forwardKinematics(self.model, self.data, q)
        return pin.updateFramePlacement(self.model, self.data, self.frame)

    def error(self, q: np.ndarray, target: Target) -> np.ndarray:
        """As in `Found`, shape (3,) or (6,)."""
        pose = self.pose(q)
        way = target.position - pose.translation
        if target.turn is None:
            return way
        return np.concatenate([way, ANGLE_ARM_M * pin.log3(target.turn @ pose.rotation.T)])

    def jacobian(self, q: np.ndarray, turning: bool) -> np.ndarray:
        """Of `error` without its sign, shape (3 or 6, nv)."""
        kind = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(self.model, self.data, q, self.frame, kind)
        jacobian = jacobian.reshape(6, self.model.nv)
        if not turning:
            return jacobian[:3]
        return np.concatenate([jacobian[:3], ANGLE_ARM_M * jacobian[3:]])

    def find_rank(self, turning: bool, random: np.random.Generator) -> None:
        """How many directions the tool can be led in at all, somewhere."""
        for _ in range(20):
            values = np.linalg.svd(self.jacobian(self.anywhere(random), turning), compute_uv=False)
            self.rank = max(self.rank, int(np.sum(values > 10.0 * SINGULAR_M)))

    def anywhere(self, random: np.random.Generator) -> np.ndarray:
        """A random configuration within the limits."""
        low = np.where(np.isfinite(self.low), self.low, -HALF_RANGE)
        high = np.where(np.isfinite(self.high), self.high, HALF_RANGE)
        return random.uniform(low, high)

    def manoeuvrability(self, q: np.ndarray, turning: bool) -> float:
        """Smallest singular value of the directions in which the tool can be led at all [m]."""
        values = np.linalg.svd(self.jacobian(q, turning), compute_uv=False)
        return float(values[self.rank - 1]) if self.rank else 0.0

    def search(
        self,
        seed: np.ndarray,
        target: Target,
        bounds: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> Found:
        """Levenberg-Marquardt from `seed`; joints that come to their limits stay there.

        Steps are of least norm, so that joints which need not move do not.
        """
        low, high = (self.low, self.high) if bounds is None else bounds
        q, damping = np.clip(seed, low, high), _DAMPING[1]
        error = self.error(q, target)
        for _ in range(_ITERATIONS):
            if np.linalg.norm(error) < 1e-3 * REACHED_M:
                break
            jacobian = self.jacobian(q, target.turn is not None)
            free = np.ones(len(q), bool)
            while True:  # without the joints that would leave their range
                left, values, right = np.linalg.svd(jacobian[:, free], full_matrices=False)
                step = np.zeros(len(q))
                step[free] = right.T @ (values / (values**2 + damping**2) * (left.T @ error))
                out = ((q <= low) & (step < 0.0)) | ((q >= high) & (step > 0.0))
                if not out.any():
                    break
                free &= ~out
            trial = np.clip(q + step, low, high)
            if np.array_equal(trial, q):
                break
            left_over = self.error(trial, target)
            if np.linalg.norm(left_over) < np.linalg.norm(error):
                q, error, damping = trial, left_over, max(0.2 * damping, _DAMPING[0])
            elif damping < _DAMPING[2]:
                damping *= 4.0
            else:
                break
        return Found(q, error)

    def nearest(self, solution: Found, seed: np.ndarray, target: Target) -> Found:
        """The solution nearest to `seed` that can be reached from `solution` without losing it."""
        share = 1.0
        for _ in range(_ITERATIONS):
            _, _, right = np.linalg.svd(
                self.jacobian(solution.q, target.turn is not None), full_matrices=False
            )
            away = seed - solution.q
            step = away - right[: self.rank].T @ (right[: self.rank] @ away)
            if np.linalg.norm(step) < 1e-9 or share < 1e-3:
                break
            trial = self.search(solution.q + share * step, target)
            if trial.reached and np.linalg.norm(seed - trial.q) < np.linalg.norm(away):
                solution = trial
            else:
                share *= 0.5
        return solution


def joint_limits(mechanism: Mechanism, joints: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper limits that the URDF sets, infinite where it sets none."""
    source = parse(mechanism.description)
    low, high = np.full(len(joints), -np.inf), np.full(len(joints), np.inf)
    for i, name in enumerate(joints):
        joint = source.joints[source.getJointId(name)]
        if joint.nq == 1:  # a continuous joint has two coordinates there
            low[i] = source.lowerPositionLimit[joint.idx_q]
            high[i] = source.upperPositionLimit[joint.idx_q]
    return low, high
