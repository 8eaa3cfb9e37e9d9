"""From where the tool shall be to how the joints must move: inverse kinematics of the ideal robot.

A controller knows nothing of clearance. The reference is therefore that of the ideal mechanism; how
far the real tool misses it is what a simulation with clearance shows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.core.errors import (
    JointplayError,
    MissingName,
    require_finite,
    require_numbers,
    within,
)
from jointplay.mechanism.mechanism import Mechanism, frame_index
from jointplay.motion.reference import Motion, check_waypoints

# The ideal arm, and how its joints must stand for its tool to be somewhere.


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
                f"a Cartesian motion cannot move the ball joint {balls[0]!r}, which has no drive"
            )
        if not self.joints:
            raise JointplayError("a Cartesian motion needs moving joints, this robot has none")
        self.model, self.data = ideal.model, ideal.data
        self.frame = frame_index(self.model, ideal.tool if frame is None else frame)
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
    entries = [mechanism.description.joints[name] for name in joints]
    low = [-np.inf if entry.lower is None else entry.lower for entry in entries]
    high = [np.inf if entry.upper is None else entry.upper for entry in entries]
    return np.array(low), np.array(high)


PATHS = ("joint", "line")

SAMPLE_S = 5e-3
"""Longest time between two inverse solutions on a line [s]."""

SAMPLE_M = 2e-3
"""Longest way of the tool between them [m]; an angle counts on an arm of `ANGLE_ARM_M`."""

JUMP = 0.1
"""A joint that moves farther than this while the tool moves by `SAMPLE_M` jumps [rad or m]."""

_RESTARTS = 40


def cartesian_motion(
    mechanism: Mechanism,
    times: Sequence[float] | np.ndarray,
    positions: Sequence[Sequence[float]] | np.ndarray,
    orientations: Sequence[Sequence[float]] | np.ndarray | None = None,
    *,
    frame: str | None = None,
    path: str = "joint",
    start: Mapping[str, float] | None = None,
) -> Motion:
    """Reference motion of all joints that leads the tool of the ideal robot through waypoints.

    Each waypoint is solved from the one before, so that the robot keeps its branch (elbow, wrist);
    within the joint limits of the URDF. Where the waypoints leave joints free to choose - more
    joints than commanded directions - the configuration nearest to the one before is taken, 1 m
    counting as 1 rad. The method is that of Levenberg and Marquardt on the frame's Jacobian
    (K. Levenberg, Quarterly of Applied Mathematics 2 (1944) 164-168).

    Args:
        mechanism: a robot without loops; its clearance and its gears' play are left out.
        times: of the waypoints, increasing, shape (n,), n >= 2 [s].
        positions: of the frame's origin in world axes, shape (n, 3) [m].
        orientations: roll, pitch, yaw of the frame in world axes as in URDF, shape (n, 3) [rad];
            None leaves the orientation free.
        frame: name of the frame that is led; None takes the mechanism's tool.
        path: ``joint`` moves the joints by rest-to-rest quintics between the waypoints; ``line``
            moves the frame on straight lines, resting at each waypoint, by the same quintic law in
            time, while its orientation turns about a fixed axis, the shorter way round. A line is
            solved at least every `SAMPLE_S` and `SAMPLE_M`, with quintic splines between.
        start: where the search for the first waypoint begins, by joint [rad or m]; what is not
            named begins at zero, or at the limit nearest to it. It selects the branch.

    Returns:
        A motion of all joints of `mechanism`.

    Raises:
        JointplayError: wrong shapes or numbers; a waypoint out of reach, or within reach only
            beyond joint limits or in another branch; a singular configuration, in which the frame
            cannot be led in all directions in which it can elsewhere; a line on which a joint would
            jump; a mechanism with loops or ball joints.
    """
    if path not in PATHS:
        raise MissingName("path", path, PATHS)
    moments, targets = _waypoints(times, positions, orientations)
    arm = Arm(mechanism, frame)
    random = np.random.default_rng(0)
    arm.find_rank(orientations is not None, random)
    with within("positions", 0):
        q = _solve(arm, _seed(arm, start or {}), targets[0], "waypoint 1", random, first=True)
    solved = [(float(moments[0]), q)]
    for i in range(1, len(moments)):
        with within("positions", i):
            if path == "line":
                solved += _line(arm, q, moments[i - 1 :], targets[i - 1 :], i + 1, random)
            else:
                q = _solve(arm, q, targets[i], f"waypoint {i + 1}", random)
                solved.append((float(moments[i]), q))
        q = solved[-1][1]
    interpolation = "spline" if path == "line" else "rest-to-rest"
    nodes, configurations = zip(*solved, strict=True)
    return Motion(arm.joints, np.array(nodes), np.array(configurations), interpolation)


def _waypoints(
    times: Sequence[float] | np.ndarray,
    positions: Sequence[Sequence[float]] | np.ndarray,
    orientations: Sequence[Sequence[float]] | np.ndarray | None,
) -> tuple[np.ndarray, list[Target]]:
    """Checked times (n,), and where the frame shall be at each."""
    given = {"times": times, "positions": positions}
    if orientations is not None:
        given["orientations"] = orientations
    checked = {name: require_numbers(name, values) for name, values in given.items()}
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


def _seed(arm: Arm, start: Mapping[str, float]) -> np.ndarray:
    q = np.clip(np.zeros(len(arm.joints)), arm.low, arm.high)
    for name, value in start.items():
        if name not in arm.joints:
            raise MissingName("moving joint", name, arm.joints)
        i = arm.joints.index(name)
        q[i] = require_finite(f"start of joint {name!r}", value, "rad or m")
        if not arm.low[i] <= q[i] <= arm.high[i]:
            raise JointplayError(
                f"start of joint {name!r} at {q[i]:g} violates its limits "
                f"{arm.low[i]:g} to {arm.high[i]:g}"
            )
    return q


def _solve(
    arm: Arm,
    seed: np.ndarray,
    target: Target,
    what: str,
    random: np.random.Generator,
    first: bool = False,
) -> np.ndarray:
    """Configuration near `seed` in which the frame is where it shall be; `what` names it."""
    solution = arm.search(seed, target)
    if not solution.reached:
        solution = _otherwise(arm, solution, seed, target, what, random, first)
    if len(seed) > arm.rank:
        solution = arm.nearest(solution, seed, target)
    smallest = arm.manoeuvrability(solution.q, target.turn is not None)
    if smallest < SINGULAR_M:
        raise JointplayError(_singular(what, target, smallest))
    return solution.q


def _otherwise(
    arm: Arm,
    attempt: Found,
    seed: np.ndarray,
    target: Target,
    what: str,
    random: np.random.Generator,
    first: bool,
) -> Found:
    """Another solution for the first waypoint, else the reason why there is none."""
    tries = [arm.search(arm.anywhere(random), target) for _ in range(_RESTARTS)]
    others = [one for one in tries if one.reached]
    other = min(others, key=lambda one: float(np.linalg.norm(one.q - seed)), default=None)
    remedy = ""
    if other is not None:
        if first:
            return other
        values = ", ".join(f"{n} = {x:.4g}" for n, x in zip(arm.joints, other.q, strict=True))
        remedy = f"; another branch reaches it, such as {values}: choose it by start"
    endless = np.full(len(seed), np.inf)
    beyond = arm.search(seed, target, (-endless, endless))
    if beyond.reached:
        i = int(np.argmax(np.maximum(arm.low - beyond.q, beyond.q - arm.high)))
        raise JointplayError(
            f"{what} at {target} violates the limits of joint {arm.joints[i]!r}: it would have to "
            f"be at {beyond.q[i]:.4g}, allowed is {arm.low[i]:g} to {arm.high[i]:g}{remedy}"
        )
    if remedy:
        raise JointplayError(
            f"{what} at {target} cannot be reached from the waypoint before{remedy}"
        )
    best = min([attempt, *tries], key=lambda one: float(np.linalg.norm(one.error)))
    smallest = arm.manoeuvrability(best.q, target.turn is not None)
    if np.linalg.norm(best.error) < NEARLY_M and smallest < SINGULAR_M:
        raise JointplayError(_singular(what, target, smallest))
    distance = np.linalg.norm(best.error[:3])
    angle = np.linalg.norm(best.error[3:]) / ANGLE_ARM_M
    raise JointplayError(
        f"{what} at {target} is out of reach: {distance:.4g} m and {angle:.4g} rad remain; "
        "move it closer"
    )


def _line(
    arm: Arm,
    q: np.ndarray,
    times: np.ndarray,
    targets: Sequence[Target],
    number: int,
    random: np.random.Generator,
) -> list[tuple[float, np.ndarray]]:
    """Times and configurations on the line to waypoint `number`, its beginning left out."""
    (begin, before), (end, after) = targets[0], targets[1]
    way, axis = end - begin, np.zeros(3)
    if before is not None and after is not None:
        axis = pin.log3(before.T @ after)
    size = float(np.linalg.norm([*way, *(ANGLE_ARM_M * axis)]))
    span = float(times[1] - times[0])
    # The quintic's largest speed is 15/8 of the mean; a spline needs a few points.
    count = max(math.ceil(span / SAMPLE_S), math.ceil(15.0 / 8.0 * size / SAMPLE_M), 10)
    solved = []
    for k in range(1, count + 1):
        part, what = k / count, f"the line to waypoint {number}"
        law = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        turn = None if before is None else before @ pin.exp3(law * axis)
        time, target = times[0] + part * span, Target(begin + law * way, turn)
        if k == count:
            time, target, what = times[1], targets[1], f"waypoint {number}"
        ahead = _solve(arm, q, target, what, random)
        moved = np.abs(ahead - q)
        if moved.max() > JUMP:
            i = int(np.argmax(moved))
            raise JointplayError(
                f"on the line to waypoint {number}, near {target}, joint {arm.joints[i]!r} would "
                f"jump by {moved[i]:.3g}, to another branch or past a singular configuration; "
                "choose another branch by start, or another way"
            )
        q = ahead
        solved.append((float(time), q))
    return solved


def _singular(what: str, target: Target, smallest: float) -> str:
    return (
        f"{what} at {target} is singular: the tool cannot be led in every direction there "
        f"(smallest singular value {smallest:.2g} m, at least {SINGULAR_M:g} m is needed)"
    )
