"""Poses at which a budget is drawn up: one, those along a motion, or many over the workspace.

In mechanisms with loops only the driven joints are given; the loops are closed by the others, from
the positions `near` on, which choose the branch.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from scipy.stats import qmc

from jointplay.base.errors import JointplayError, require_finite, require_known, require_whole
from jointplay.model.closed_loops import ClosedLoops
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.initial import position_and_speed
from jointplay.simulation.motion.cartesian import joint_limits
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.simulation import Simulation

ALONG = 60
"""Poses along a motion, at equal intervals."""
MOST_POSES = 1_000_000
_SLACK = 1e-6
"""How far beyond its limits a position may be, for what was rounded [rad or m]."""


def at_pose(
    mechanism: Mechanism,
    positions: Mapping[str, float],
    driven: Sequence[str] | None = None,
    near: Mapping[str, float] | None = None,
) -> np.ndarray:
    """The configuration with the given joint positions [rad or m], (1, nq); else `middle`.

    Loops are closed first at the positions `near`, from which the `driven` joints go on to
    `positions`, unless these hold others of the loops, too.

    Raises:
        MissingName: no such joint.
        JointplayError: a position that is not finite or outside the URDF's limits; loops that
            cannot be closed.
    """
    names = moving(mechanism)
    for name, value in positions.items():
        require_known("moving joint", name, names)
        require_finite(f"position of joint {name!r}", value, "rad or m")
    begin = _begin(mechanism, near)
    given = {**begin, **positions}
    q = _fill(mechanism, np.array([[at[name] for name in names] for at in (given, begin)]))
    _check(mechanism, q[:1])
    return _closed(mechanism, q[:1], driven, q[1], positions)


def along_motion(
    mechanism: Mechanism,
    motion: Motion,
    count: int = ALONG,
    near: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Configurations along a motion at equal intervals, its waypoints among them, (n, nq).

    Of loops those joints are driven that the motion moves.

    Raises:
        JointplayError: fewer than two poses; a pose outside the URDF's limits; loops that cannot be
            closed.
        MissingName: the motion moves a joint that the mechanism has not.
    """
    require_whole("the number of poses", count, 2, MOST_POSES)
    names = moving(mechanism)
    for name in motion.joints:
        require_known("moving joint", name, names, " (in the motion)")
    times = times_along(motion, count)
    position = motion(times)[0]
    begin = _begin(mechanism, near)
    values = np.tile([begin[name] for name in names], (1 + len(times), 1))
    for column, name in enumerate(motion.joints):
        values[1:, names.index(name)] = position[:, column]
    q = _fill(mechanism, values)
    _check(mechanism, q[1:])
    return _closed(mechanism, q[1:], motion.joints, q[0])


def times_along(motion: Motion, count: int = ALONG) -> np.ndarray:
    """Equal intervals over a motion, and its waypoints unless they are more, (n,) [s]."""
    even = np.linspace(motion.times[0], motion.times[-1], count)
    waypoints = motion.waypoints[0]
    return np.union1d(even, waypoints) if len(waypoints) <= count else even


def over_workspace(
    mechanism: Mechanism,
    count: int,
    seed: int = 0,
    driven: Sequence[str] | None = None,
    near: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Configurations spread evenly over all joints' limits (Sobol sequence), (count, nq).

    A joint without limits turns once around, one that slides without limits stays. With loops, the
    driven joints are spread; poses in which the loops cannot be closed within the limits are left
    out.

    Raises:
        JointplayError: no pose.
    """
    require_whole("the number of poses", count, 1, MOST_POSES)
    seed = require_whole("seed", seed)
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
    values = low + spread * (high - low)
    if not mechanism.loops:
        return _fill(mechanism, values)
    begin = _begin(mechanism, near)
    first = _fill(mechanism, np.array([[begin[name] for name in names]]))
    first = _closed(mechanism, first, driven, first[0])
    loops = ClosedLoops(mechanism, first[0], driven)
    own = [i for i, name in enumerate(names) if mechanism.coordinate(name) in loops.passive]
    values[:, own] = first[0, [mechanism.coordinate(names[i]) for i in own]]
    q = np.concatenate([first, _fill(mechanism, values)])
    closed, good = loops.close_all(q, apart=True)
    found = closed[1:][good[1:] & ~_outside(mechanism, closed[1:]).any(axis=1)]
    if not len(found):
        raise JointplayError(
            f"the loops {', '.join(mechanism.loops)} cannot be closed at any of {count} poses"
        )
    return found


def middle(mechanism: Mechanism) -> dict[str, float]:
    """Zero for each joint, or the middle of its limits if zero lies outside [rad or m]."""
    names = moving(mechanism)
    low, high = joint_limits(mechanism, names)
    inside = (low <= 0.0) & (high >= 0.0)
    with np.errstate(invalid="ignore"):
        values = np.where(inside, 0.0, 0.5 * (low + high))
    return dict(zip(names, values.tolist(), strict=True))


def start_of(simulation: Simulation) -> dict[str, float]:
    """Positions with which a simulation begins, as far as they are given, by coordinate."""
    begin = {name: position_and_speed(name, value)[0] for name, value in simulation.state.items()}
    return {name: value for name, value in begin.items() if value is not None}


def standing(
    mechanism: Mechanism, motion: Motion | None, near: Mapping[str, float]
) -> tuple[str, ...]:
    """Joints of loops that stand: those that the motion moves, or the first that are enough.

    `near` has the positions at which loops are closed first, by joint [rad or m].
    """
    if motion is not None:
        return tuple(name for name in motion.joints if name in moving(mechanism))
    return ClosedLoops(mechanism, at_pose(mechanism, {}, None, near)[0]).driven


def moving(mechanism: Mechanism) -> list[str]:
    """Joints that have one coordinate of their own, the drives' motors aside."""
    return [name for name in mechanism.joints if name in mechanism.description.joints]


def _begin(mechanism: Mechanism, near: Mapping[str, float] | None) -> dict[str, float]:
    """Positions by joint where none are given: those of `near`, or `middle`."""
    known = {name: value for name, value in (near or {}).items() if name in moving(mechanism)}
    return {**middle(mechanism), **known}


def _closed(
    mechanism: Mechanism,
    q: np.ndarray,
    driven: Sequence[str] | None,
    begin: np.ndarray,
    given: Collection[str] = (),
) -> np.ndarray:
    """The configurations (n, nq) with their loops closed, within the limits.

    From `begin` (nq,) on, closed itself, unless passive joints among those `given` say where.
    """
    if not mechanism.loops:
        return q
    loops = ClosedLoops(mechanism, q[0], driven)
    chosen = any(mechanism.coordinate(name) in loops.passive for name in given)
    closed = loops.closed(q, None if chosen else begin)
    _check(mechanism, closed)
    return closed


def _outside(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Which joints of `moving` are outside their limits in configurations (n, nq), (n, joints)."""
    names = moving(mechanism)
    low, high = joint_limits(mechanism, names)
    values = q[:, [mechanism.coordinate(name) for name in names]]
    return np.asarray((values < low - _SLACK) | (values > high + _SLACK))


def _check(mechanism: Mechanism, q: np.ndarray) -> None:
    outside = _outside(mechanism, q)
    if outside.any():
        row, column = np.argwhere(outside)[0]
        name = moving(mechanism)[column]
        low, high = joint_limits(mechanism, [name])
        pose = f" (pose {row + 1} of {len(q)})" if len(q) > 1 else ""
        raise JointplayError(
            f"joint {name!r} at {q[row, mechanism.coordinate(name)]:g} is outside its limits "
            f"{low[0]:g} to {high[0]:g}{pose}"
        )


def _fill(mechanism: Mechanism, values: np.ndarray) -> np.ndarray:
    """Configurations (n, nq) in which the joints of `moving` have these values (n, joints)."""
    q = np.zeros((len(values), mechanism.model.nq))
    for column, name in enumerate(moving(mechanism)):
        q[:, mechanism.coordinate(name)] = values[:, column]
        q[:, mechanism.motor(name)] = values[:, column]
    return q
