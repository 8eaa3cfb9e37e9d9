"""Poses at which a budget is computed: one or several, along a motion, or over the workspace.

In mechanisms with loops only the driven joints are given; the others close the loops, starting from
the positions `near`, which choose the branch of the solution.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, require_finite, require_known, require_whole
from jointplay.base.files import csv_rows
from jointplay.base.pairs import misread, name_and_number, quantity
from jointplay.base.tables import counted
from jointplay.model.closed_loops import ClosedLoops
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.initial import position_and_speed
from jointplay.simulation.loads.drive import Drive
from jointplay.simulation.motion.cartesian import joint_limits
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.simulation import Simulation

ALONG = 60
"""Poses along a motion, at equal intervals."""
MOST_POSES = 1_000_000
"""Most poses of a budget: more take hours and gigabytes (judged)."""
_SLACK = 1e-6
"""Distance beyond its limits at which a position is accepted as rounded [rad or m]."""


@dataclass(frozen=True)
class Poses:
    """A machine that stands, its base held and its loops closed, at one pose or at several."""

    machine: Simulation
    """The machine: its mechanism, drives, loads and payloads."""
    q: np.ndarray
    """Configurations, (n, nq)."""
    kind: str
    """``pose``, ``motion`` or ``workspace``."""
    label: str
    """Description of the poses in words."""
    names: tuple[str, ...] = ()
    """Names of the poses, if several were given one by one."""
    times: np.ndarray | None = None
    """Times of poses along a motion, (n,) [s]."""
    driven: tuple[str, ...] | None = None
    """Joints of closed loops that stand; None without loops."""

    @property
    def mechanism(self) -> Mechanism:
        return self.machine.mechanism

    @property
    def holding(self) -> dict[str, Any]:
        """The arguments of `budget` that hold and load the machine; drives only if they hold."""
        machine, drive = self.machine, self.machine.drive
        drives = dict.fromkeys(self.mechanism.joints, drive) if isinstance(drive, Drive) else drive
        return {
            "driven": self.driven,
            "drive": {name: held for name, held in drives.items() if held.follows},
            "joint_friction": machine.joint_friction,
            "payloads": machine.payloads,
            "loads": machine.loads,
        }

    @property
    def loops(self) -> str:
        """The joints of loops that stand and those that follow, in words; empty without loops."""
        if self.driven is None:
            return ""
        passive = ClosedLoops(self.mechanism, self.q[0], self.driven).passive
        follow = [n for n in moving(self.mechanism) if self.mechanism.coordinate(n) in passive]
        driven = ", ".join(self.driven) or "none"
        return f"loops: driven {driven}; following {', '.join(follow) or 'none'}"

    def positions(self, row: int = 0) -> dict[str, float]:
        """Joint positions at a pose by name [rad or m]."""
        at = self.mechanism.coordinate
        return {name: float(self.q[row, at(name)]) for name in moving(self.mechanism)}


def poses_of(
    machine: Mechanism | Simulation,
    named: Mapping[str, Mapping[str, float]] | None = None,
    workspace: int | None = None,
    motion: Motion | None = None,
) -> Poses:
    """Poses of a machine: those named, spread over its workspace, along its motion, or else one.

    Args:
        machine: a mechanism, or a simulation, whose motion and drives count; its loops are closed
            where a run begins.
        named: joint positions by the name of the pose [rad or m]; others are as in `middle`.
        workspace: number of poses to spread over the limits of all joints.
        motion: motion along which to take poses; None: that of the simulation.

    Raises:
        JointplayError: see `at_pose`, `along_motion`, `over_workspace`.
        MissingName: no such joint.
    """
    if isinstance(machine, Mechanism):
        machine = Simulation(machine)
    machine = replace(machine, mechanism=machine.mechanism.bolted())
    mechanism, motion = machine.mechanism, motion or machine.motion
    near: dict[str, float] = {}
    driven: tuple[str, ...] | None = None
    if mechanism.loops:
        near = start_of(machine)
        # Those that the motion moves stand, or the first that determine the others.
        if motion is not None:
            driven = tuple(name for name in motion.joints if name in moving(mechanism))
        else:
            driven = ClosedLoops(mechanism, at_pose(mechanism, {}, None, near)[0]).driven
    if workspace is not None:
        q = over_workspace(mechanism, workspace, driven=driven, near=near)
        label = f"{counted(len(q), 'pose')} over the workspace"
        if out := workspace - len(q):
            label += f" ({out} others were left out because the loops do not close there)"
        return Poses(machine, q, "workspace", label, driven=driven)
    if named is None and motion is not None:
        q, times = along_motion(mechanism, motion, near=near), times_along(motion)
        label = f"{counted(len(q), 'pose')} along the motion"
        return Poses(machine, q, "motion", label, (), times, driven)
    poses, rows = named or {"": {}}, []
    for name, positions in poses.items():
        try:
            rows.append(at_pose(mechanism, positions, driven, near))
        except JointplayError as error:
            raise JointplayError(f"pose {name}: {error}" if name else str(error)) from None
    q = np.concatenate(rows)
    if len(poses) > 1:
        label = counted(len(poses), "pose")
        return Poses(machine, q, "pose", label, tuple(poses), None, driven)
    at, shown = {**middle(mechanism), **next(iter(poses.values()))}, driven or mechanism.movers()
    units = {name: joint.unit for name, joint in mechanism.description.joints.items()}
    label = "pose " + ", ".join(
        f"{name} {x:.4g}{f' {units[name]}' * (x != 0.0 and name in units)}"
        for name, x in at.items()
        if name in shown
    )
    if not named:
        label += " (chosen: zero, or the middle of the limits; see --pose, --motion)"
    return Poses(machine, q, "pose", label, driven=driven)


def read_poses(mechanism: Mechanism, path: Path) -> dict[str, dict[str, float]]:
    """Joint positions by the name or number of a pose, from a CSV file with a pose in each line.

    Its header is ``<joint>,...``, or ``name,<joint>,...``; positions are in rad and m, or have a
    unit.

    Raises:
        JointplayError: no pose, or two of one name, a column twice, or see `csv_rows`.
    """
    (_, header), *rows = csv_rows(path, "poses")
    header = [cell.strip() for cell in header]
    named = header[0] == "name"
    if twice := [name for name, count in Counter(header).items() if count > 1]:
        raise JointplayError(f"{path}: column {twice[0]!r} appears twice")
    poses: dict[str, dict[str, float]] = {}
    for number, row in rows:
        line, cells = f"{path}, line {number}", [cell.strip() for cell in row]
        name = cells[0] if named else str(len(poses) + 1)
        if name in poses:
            raise JointplayError(f"{line}: there are two poses {name!r}")
        pairs = [*zip(header, cells, strict=True)][named:]
        poses[name] = {
            joint: _position(mechanism, joint, cell, f"{line}, {joint}") for joint, cell in pairs
        }
    if not poses:
        raise JointplayError(f"{path} has no poses: give a line of joint positions for each")
    return poses


def read_pose(mechanism: Mechanism, text: str) -> dict[str, float]:
    """Joint positions [rad or m] from text such as ``JOINT=X,JOINT=X``."""
    pose = {}
    names = mechanism.description.joints
    longest = sorted(map(re.escape, names), key=len, reverse=True)
    ahead = f"(?=\\s*(?:{'|'.join(longest)})\\s*=)"  # a name may have commas of its own
    for part in re.split(f",{ahead}", text) if text else ():
        name, value = name_and_number(part.strip(), names)
        name = name if name in names else name.strip()
        if value is None:
            raise misread(part, "--pose JOINT=X,JOINT=X,...")
        pose[name] = _position(mechanism, name, value, f"--pose {name}")
    return pose


def _position(mechanism: Mechanism, joint: str, text: str, where: str) -> float:
    """Position of a joint [rad or m] from text; errors begin with `where`."""
    entry = mechanism.description.joints.get(joint)
    return quantity(text, "m" if entry is not None and entry.slides else "rad", where)


def at_pose(
    mechanism: Mechanism,
    positions: Mapping[str, float],
    driven: Sequence[str] | None = None,
    near: Mapping[str, float] | None = None,
) -> np.ndarray:
    """The configuration with the given joint positions [rad or m], others `middle`, (1, nq).

    Loops are closed first at the positions `near`, from which the `driven` joints move on to
    `positions`; unless these name passive joints, too, which then choose the branch.

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
    coordinates = {**begin, **positions}
    q = _fill(mechanism, np.array([[at[name] for name in names] for at in (coordinates, begin)]))
    _check(mechanism, q[:1])
    return _closed(mechanism, q[:1], driven, q[1], positions)


def along_motion(
    mechanism: Mechanism,
    motion: Motion,
    count: int = ALONG,
    near: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Configurations along a motion at equal intervals, its waypoints among them, (n, nq).

    In loops the driven joints are those that the motion moves.

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
    """Times at equal intervals over a motion, with its waypoints if they are no more, (n,) [s]."""
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

    A joint that turns without limits takes one full turn, one that slides without limits stays at
    zero. With loops, the driven joints are spread; poses in which the loops cannot be closed within
    the limits are left out.

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
    from scipy.stats import qmc  # which takes most of a second that a single pose need not spend

    spread = qmc.Sobol(len(names), seed=seed).random_base2(power)[:count]
    values = low + spread * (high - low)
    if not mechanism.loops:
        return _fill(mechanism, values)
    begin = _begin(mechanism, near)
    # Close the loops at `near`, and from there at each pose, as far as they can be closed.
    first = _fill(mechanism, np.array([[begin[name] for name in names]]))
    first = _closed(mechanism, first, driven, first[0])
    loops = ClosedLoops(mechanism, first[0], driven)
    following = [i for i, name in enumerate(names) if mechanism.coordinate(name) in loops.passive]
    values[:, following] = first[0, [mechanism.coordinate(names[i]) for i in following]]
    q = np.concatenate([first, _fill(mechanism, values)])
    closed, good = loops.close_all(q, apart=True)
    reachable = closed[1:][good[1:] & ~_outside(mechanism, closed[1:]).any(axis=1)]
    if not len(reachable):
        raise JointplayError(
            f"the loops {', '.join(mechanism.loops)} cannot be closed at any of {count} poses"
        )
    return reachable


def middle(mechanism: Mechanism) -> dict[str, float]:
    """Neutral position of each joint: zero, or the middle of its limits if zero lies outside [rad
    or m]."""
    return {name: mechanism.description.joints[name].neutral for name in moving(mechanism)}


def start_of(simulation: Simulation) -> dict[str, float]:
    """Start positions of a simulation, as far as they are given, by coordinate."""
    begin = {name: position_and_speed(name, value)[0] for name, value in simulation.state.items()}
    return {name: value for name, value in begin.items() if value is not None}


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
    named: Collection[str] = (),
) -> np.ndarray:
    """The configurations (n, nq) with their loops closed, within the limits.

    They are closed starting from `begin` (nq,), which is closed itself; unless passive joints are
    among those `named`: then their positions are where it starts.
    """
    if not mechanism.loops:
        return q
    loops = ClosedLoops(mechanism, q[0], driven)
    chosen = any(mechanism.coordinate(name) in loops.passive for name in named)
    closed = loops.closed(q, None if chosen else begin)
    _check(mechanism, closed)
    return closed


def _outside(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Whether joints of `moving` are outside their limits at q (n, nq), shape (n, joints)."""
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
