"""Poses at which a budget is drawn up: one, those along a motion, or many over the workspace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import qmc

from jointplay.errors import JointplayError, MissingName, require_finite
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.arm import joint_limits
from jointplay.motion.reference import Motion

ALONG = 60
"""Poses along a motion, at equal intervals."""
_SLACK = 1e-6
"""How far beyond its limits a position may be, for what was rounded [rad or m]."""


def at_pose(mechanism: Mechanism, positions: Mapping[str, float]) -> np.ndarray:
    """The configuration with the given joint positions, (1, nq); the rest where `middle` says.

    Raises:
        MissingName: no such joint.
        JointplayError: a position that is not finite or outside the URDF's limits.
    """
    names = moving(mechanism)
    for name, value in positions.items():
        if name not in names:
            raise MissingName("moving joint", name, names)
        require_finite(f"position of joint {name!r}", value, "rad or m")
    given = {**middle(mechanism), **positions}
    values = np.array([[given[name] for name in names]])
    _check(mechanism, names, values)
    return _fill(mechanism, names, values)


def along_motion(mechanism: Mechanism, motion: Motion, count: int = ALONG) -> np.ndarray:
    """Configurations along a motion at equal intervals, its waypoints among them, (n, nq).

    Raises:
        JointplayError: fewer than two poses; a pose outside the URDF's limits.
        MissingName: the motion moves a joint that the mechanism has not.
    """
    _check_count(count, 2)
    names = moving(mechanism)
    for name in motion.joints:
        if name not in names:
            raise MissingName("moving joint", name, names, " (in the motion)")
    times = times_along(motion, count)
    position = motion(times)[0]
    middles = middle(mechanism)
    values = np.tile([middles[name] for name in names], (len(times), 1))
    for column, name in enumerate(motion.joints):
        values[:, names.index(name)] = position[:, column]
    _check(mechanism, names, values)
    return _fill(mechanism, names, values)


def times_along(motion: Motion, count: int = ALONG) -> np.ndarray:
    """Equal intervals over a motion, and its waypoints unless they are more, (n,) [s]."""
    even = np.linspace(motion.times[0], motion.times[-1], count)
    return np.union1d(even, motion.times) if len(motion.times) <= count else even


def over_workspace(mechanism: Mechanism, count: int, seed: int = 0) -> np.ndarray:
    """Configurations spread evenly over all joints' limits (Sobol sequence), (count, nq).

    A joint without limits turns once around, one that slides without limits stays.

    Raises:
        JointplayError: no pose.
    """
    _check_count(count, 1)
    names = moving(mechanism)
    low, high = joint_limits(mechanism, names)
    for i, name in enumerate(names):
        turns = not mechanism.description.joints[name].slides
        if not (np.isfinite(low[i]) and np.isfinite(high[i])) or high[i] < low[i]:
            low[i], high[i] = (-np.pi, np.pi) if turns else (0.0, 0.0)
        elif turns and high[i] - low[i] > 2.0 * np.pi:
            low[i], high[i] = -np.pi, np.pi
    power = max(int(np.ceil(np.log2(count))), 0)
    spread = qmc.Sobol(len(names), seed=seed).random_base2(power)[:count]
    return _fill(mechanism, names, low + spread * (high - low))


def middle(mechanism: Mechanism) -> dict[str, float]:
    """Zero for each joint, or the middle of its limits if zero lies outside [rad or m]."""
    names = moving(mechanism)
    low, high = joint_limits(mechanism, names)
    inside = (low <= 0.0) & (high >= 0.0)
    with np.errstate(invalid="ignore"):
        values = np.where(inside, 0.0, 0.5 * (low + high))
    return dict(zip(names, values.tolist(), strict=True))


def moving(mechanism: Mechanism) -> list[str]:
    """Joints that have one coordinate of their own, the drives' motors aside."""
    return [name for name in mechanism.joints if name in mechanism.description.joints]


def _check_count(count: int, least: int) -> None:
    if count < least:
        raise JointplayError(f"at least {least} pose{'s' * (least > 1)} are needed, got {count}")


def _check(mechanism: Mechanism, names: Sequence[str], values: np.ndarray) -> None:
    low, high = joint_limits(mechanism, names)
    outside = (values < low - _SLACK) | (values > high + _SLACK)
    if outside.any():
        row, column = np.argwhere(outside)[0]
        pose = f" (pose {row + 1} of {len(values)})" if len(values) > 1 else ""
        raise JointplayError(
            f"joint {names[column]!r} at {values[row, column]:g} is outside its limits "
            f"{low[column]:g} to {high[column]:g}{pose}"
        )


def _fill(mechanism: Mechanism, names: Sequence[str], values: np.ndarray) -> np.ndarray:
    q = np.zeros((len(values), mechanism.model.nq))
    for column, name in enumerate(names):
        q[:, mechanism.coordinate(name)] = values[:, column]
        q[:, mechanism.motor(name)] = values[:, column]
    return q
