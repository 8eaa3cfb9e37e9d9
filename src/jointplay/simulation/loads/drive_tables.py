"""Drives as the kernels have them: rows of gains, and a table of references and efforts over time.

Each drive has a row with its gains and limits, and one column (a servo two) of the table over time:
position and velocity to follow, and effort that is known beforehand. The table has a node every
`REFERENCE_NODE_S`; a long one is made and kept in memory block by block (`Reference`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.model.mechanism import Mechanism
from jointplay.physics.kernel import layout
from jointplay.physics.kernel.layout import CoordinateTables, drive_row, friction_row, stacked
from jointplay.simulation.loads.drive import (
    BANDWIDTH,
    PRESCRIBED_ARMATURE,
    ComputedTorque,
    Drive,
    Free,
    JointFriction,
    Prescribed,
    Servo,
    Torque,
)
from jointplay.simulation.motion.ideal import IdealMotion
from jointplay.simulation.motion.reference import REFERENCE_NODE_S, Motion

BLOCK_NODES = 25_000
"""Nodes of a block; a table of at most twice as many is one block."""


_MOST_RECENT = 2
"""Number of tables in `_recent`."""
_recent: dict[tuple[object, ...], tuple[pin.Model, np.ndarray]] = {}
"""The last tables of trees, by what they depend on, each with the model that was moved."""


class Reference:
    """Position, velocity and feed-forward effort of the driven coordinates over time.

    Two blocks are in memory, that of the present time and the next. A node has the same numbers
    whichever blocks they are, so that a run does not depend on when it goes on to the next ones.

    Args:
        rows: makes the table at consecutive times (n,) [s]; its second argument shows a bar.
        nodes: number of nodes of the whole table.
        ideal: ideal mechanism whose efforts are in it, if any.
        ahead: number of nodes that must be in memory beyond the present time.
        progress: show a bar on standard error while the first block is made, if that takes long.

    Attributes:
        first: first node of the table in memory.
        table: rows of q, v and effort of the driven coordinates, shape (n, 3 nu).
    """

    def __init__(
        self,
        rows: Callable[[np.ndarray, bool], np.ndarray],
        nodes: int,
        ideal: IdealMotion | None,
        ahead: int,
        progress: bool,
    ) -> None:
        self._rows, self.nodes, self._ideal = rows, nodes, ideal
        self._block = max(BLOCK_NODES, ahead)
        if nodes <= 2 * self._block:
            self._block = nodes
        self._at = 0
        self._blocks = {0: self._make(0, progress)}
        self._take(0)

    @property
    def until(self) -> float:
        """Time from which `go_to` must be called [s]; inf if the table reaches to the end."""
        last = (self._at + 2) * self._block >= self.nodes
        return math.inf if last else (self._at + 1) * self._block * REFERENCE_NODE_S

    def go_to(self, time: float) -> None:
        """Bring the blocks of `time` [s] into memory."""
        at = min(int(time / REFERENCE_NODE_S) // self._block, max(self._count - 2, 0))
        if at != self._at:
            self._take(at)

    def memory(self) -> dict[str, Any]:
        """State for checkpoints: that of the ideal mechanism."""
        return {} if self._ideal is None else self._ideal.memory()

    def recall(self, memory: Mapping[str, Any]) -> None:
        if self._ideal is not None and memory:
            self._ideal.recall(memory)

    @property
    def _count(self) -> int:
        return -(-self.nodes // self._block)

    def _take(self, at: int) -> None:
        indices = [k for k in (at, at + 1) if k < self._count]
        self._blocks = {k: self._blocks[k] if k in self._blocks else self._make(k) for k in indices}
        self._at, self.first = at, at * self._block
        parts = [self._blocks[k] for k in indices]
        self.table = parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _make(self, block: int, progress: bool = False) -> np.ndarray:
        first = block * self._block
        times = np.arange(first, min(first + self._block, self.nodes)) * REFERENCE_NODE_S
        return self._rows(times, progress)


def table_nodes(motion: Motion | None, drives: Mapping[str, Drive], duration: float) -> int:
    """Number of nodes of the table of all drives, which ends where nothing changes any more."""
    ends = [0.0]
    for drive in drives.values():
        if isinstance(drive, Torque):
            ends.append(drive.times[-1])
        elif drive.follows and motion is not None:
            ends.append(motion.still_from)
    last = min(max(ends), duration)
    still = 1 if last < duration else 0  # then the last two nodes stand still, for cubics
    return max(math.ceil(last / REFERENCE_NODE_S - 1e-9) + 1 + still, 2)


def _friction_row(coordinate: int, losses: JointFriction) -> np.ndarray:
    return friction_row(
        coordinate,
        coulomb=losses.coulomb,
        stiction=losses.excess,
        stribeck=losses.stribeck_speed,
        viscous=losses.viscous,
        presliding=losses.presliding if losses.coulomb + losses.excess else 0.0,
        damping=losses.presliding_damping,
    )


class Column(NamedTuple):
    """A column of the table over time: a reference to follow, or a given effort."""

    follows: int | None = None
    """Index of the joint among those that follow the motion; None: the effort is given."""
    times: tuple[float, ...] = (0.0,)
    """Times of `efforts`, increasing [s]."""
    efforts: tuple[float, ...] = (0.0,)
    """Given efforts, linear between the times [N m or N]."""
    rotor: float | None = None
    """Rotor inertia of a drive with the ideal mechanism's effort as feed-forward [kg m^2 or kg];
    None: without feed-forward."""
    losses: JointFriction = JointFriction()
    """Friction in the feed-forward."""
    goals: tuple[float, float] | None = None
    """Limits to which a servo cuts its reference [rad or m]."""


class DriveRows(NamedTuple):
    """One drive's columns, and its rows of `layout.DRIVE_ROW`, `SERVO` and `FRICTION_ROW`."""

    columns: list[Column]
    drive: np.ndarray
    servo: np.ndarray | None = None
    friction: np.ndarray | None = None


def _make_rows(
    mechanism: Mechanism,
    name: str,
    drive: Drive,
    column: int,
    follows: int | None,
    ideal: IdealMotion | None,
    losses: JointFriction,
    limit: float,
    carried: np.ndarray,
) -> DriveRows:
    """Make the rows of a drive, whose columns begin at `column`.

    A servo has two columns, for the back-EMF of its motor is a damping against a speed of zero. A
    prescribed joint has an armature so large that nothing else counts.

    Args:
        mechanism, name, drive: the joint `name`, and its drive.
        column: index of its first column.
        follows: index of the joint among those that follow the motion.
        ideal: the ideal mechanism along the motion, for computed torque.
        losses: friction of the joint.
        limit: effort at which the drive saturates [N m or N].
        carried: inertia at each coordinate, (nv,) [kg m^2 or kg].
    """
    at, gear = mechanism.motor(name), mechanism.gears.get(name)
    behind = isinstance(drive, ComputedTorque | Servo) and drive.encoder == "link"
    measured = mechanism.coordinate(name) if behind else at
    if isinstance(drive, Torque):
        effort = Column(None, drive.times, drive.values)
        return DriveRows([effort], drive_row(column, at, limit=limit))
    if isinstance(drive, Prescribed):
        row = drive_row(column, at, armature=PRESCRIBED_ARMATURE * carried[at])
        return DriveRows([Column(follows)], row)
    if isinstance(drive, ComputedTorque):
        assert ideal is not None
        assert follows is not None
        rotor = gear.rotor_inertia if gear else 0.0
        inertia = ideal.inertia[follows] + rotor
        bandwidth = drive.through_teeth(ideal.inertia[follows], gear).bandwidth or BANDWIDTH
        kd = 2.0 * drive.damping_ratio * bandwidth * inertia
        row = drive_row(column, at, measured, bandwidth**2 * inertia, kd, limit=limit)
        return DriveRows([Column(follows, rotor=rotor, losses=losses)], row)
    assert isinstance(drive, Servo)
    limit = min(limit, math.inf if drive.effort is None else drive.effort)
    rubs = gear is not None and (drive.friction or drive.viscous)
    return DriveRows(
        [Column(follows, goals=drive.goals), Column()],
        drive_row(column + 1, at, kd=drive.braking, limit=limit),
        _servo_row(drive, column, at, measured, limit),
        _friction_row(at, drive.with_friction(JointFriction())) if rubs else None,
    )


def tabulate(
    mechanism: Mechanism,
    motion: Motion | None,
    drives: Mapping[str, Drive],
    duration: float,
    friction: Mapping[str, JointFriction],
    start: np.ndarray,
    progress: bool = False,
    bounds: Mapping[str, float] | None = None,
    ahead: float = 0.0,
    speed: np.ndarray | None = None,
) -> tuple[CoordinateTables, Reference]:
    """Tabulate all drives: their gains, and over time what they follow.

    Args:
        mechanism, motion, drives, friction: what is driven, and how.
        duration: time to which the table must reach [s].
        start: configuration of `mechanism` at the start, loops closed, shape (nq,).
        progress: show a bar on standard error if it takes long.
        bounds: efforts at which the drives saturate, by joint; prescribed motion does not.
        ahead: time beyond the present to which the table in memory must reach [s].
        speed: velocities at the start, of which a free base's count, shape (nv,); None: it is at
            rest.

    Returns:
        The tables at the start, whose armature the model must be given; and the reference, which
        makes the tables of later times.
    """
    nodes = table_nodes(motion, drives, duration)
    follows = [name for name, drive in drives.items() if drive.follows]
    ideal = None
    if any(isinstance(drive, ComputedTorque) for drive in drives.values()):
        assert motion is not None
        end = (nodes - 1) * REFERENCE_NODE_S
        ideal = IdealMotion(mechanism, motion, follows, end, start, speed)
    model = mechanism.model
    carried = pin.crba(model, mechanism.data, start).reshape(model.nv, model.nv).diagonal().copy()
    columns, parts = list[Column](), list[DriveRows]()
    for name, drive in drives.items():
        if isinstance(drive, Free):
            continue
        k = follows.index(name) if drive.follows else None
        losses, limit = friction.get(name, JointFriction()), (bounds or {}).get(name, np.inf)
        part = _make_rows(mechanism, name, drive, len(columns), k, ideal, losses, limit, carried)
        columns += part.columns
        parts.append(part)
    # Friction of joints, then of motors behind gears.
    frictions = [
        _friction_row(mechanism.coordinate(name), losses)
        for name, losses in friction.items()
        if losses.coulomb or losses.excess or losses.viscous
    ]
    frictions += [part.friction for part in parts if part.friction is not None]
    servos = [part.servo for part in parts if part.servo is not None]
    gears = [
        gear.row(mechanism.motor(name), mechanism.coordinate(name))
        for name, gear in mechanism.gears.items()
    ]
    rows = partial(_recent_table, columns, motion, follows, ideal)
    nodes_ahead = math.ceil(ahead / REFERENCE_NODE_S) + 4
    reference = Reference(rows, nodes, ideal, nodes_ahead, progress)
    tables = CoordinateTables(
        stacked([part.drive for part in parts], layout.DRIVE_ROW),
        stacked(servos, layout.SERVO),
        stacked(frictions, layout.FRICTION_ROW),
        stacked(gears, layout.GEAR_ROW),
        reference.table,
        REFERENCE_NODE_S,
        nodes,
    )
    return tables, reference


def _servo_row(
    drive: Servo, column: int, coordinate: int, encoder: int, limit: float
) -> np.ndarray:
    row = np.zeros(1, layout.SERVO)
    for field in ("stall", "p_gain", "i_gain", "d_gain", "resolution", "voltage"):
        row[field] = getattr(drive, field)
    row["differences"] = drive.speed == "difference"
    row["dead_band"], row["period"] = drive.band, drive.period or 0.0
    row["column"], row["coordinate"], row["encoder"] = column, coordinate, encoder
    row["limit"], row["sampled_at"] = limit, -1.0
    return row


def _recent_table(
    columns: Sequence[Column],
    motion: Motion | None,
    follows: Sequence[str],
    ideal: IdealMotion | None,
    times: np.ndarray,
    progress: bool,
) -> np.ndarray:
    """The result of `_table`, kept for the next runs.

    A run, its ideal twin, the runs that state its errors, and the same machine with other
    clearances all need the same table.
    """
    alike = None if ideal is None else ideal.alike()
    if alike is None or motion is None or any(column.follows is None for column in columns):
        return _table(columns, motion, follows, ideal, times, progress)
    state, model = alike
    key = (
        *(motion.joints, motion.times.tobytes(), motion.positions.tobytes()),
        *(motion.interpolation, times[0], times[-1], len(times), state),
        *(tuple(columns), tuple(follows)),
    )
    if key not in _recent or _recent[key][0] != model:
        table = _table(columns, motion, follows, ideal, times, progress)
        while len(_recent) >= _MOST_RECENT:
            _recent.pop(next(iter(_recent)), None)
        _recent[key] = model, table
    return _recent[key][1].copy()


def _table(
    columns: Sequence[Column],
    motion: Motion | None,
    follows: Sequence[str],
    ideal: IdealMotion | None,
    times: np.ndarray,
    progress: bool,
) -> np.ndarray:
    """Positions, velocities and efforts of all columns at some times, (n, 3 columns)."""
    table = np.zeros((3, len(times), max(len(columns), 1)))
    if follows:
        assert motion is not None
        order = [motion.joints.index(name) for name in follows]
        position, velocity, acceleration = (values[:, order] for values in motion(times))
    if ideal is not None:
        effort = ideal.efforts(times, progress)
    for u, column in enumerate(columns):
        k = column.follows
        if k is None:
            table[2, :, u] = np.interp(times, column.times, column.efforts)
            continue
        table[0, :, u], table[1, :, u] = position[:, k], velocity[:, k]
        if column.goals is not None:
            cut = np.clip(table[0, :, u], *column.goals)
            table[1, cut != table[0, :, u], u] = 0.0
            table[0, :, u] = cut
        if column.rotor is not None:
            friction = column.losses.torque(velocity[:, k])
            table[2, :, u] = effort[:, k] + column.rotor * acceleration[:, k] + friction
    return np.hstack(list(table))
