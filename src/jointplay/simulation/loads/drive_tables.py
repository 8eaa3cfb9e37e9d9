"""Drives as tables that the kernels read: references, efforts, gains, by time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.model.mechanism import Mechanism
from jointplay.physics.kernel import layout
from jointplay.physics.kernel.sites import CoordinateTables, drive_row, friction_row, stacked
from jointplay.simulation.loads.drive import (
    BANDWIDTH,
    PRESCRIBED_ARMATURE,
    ComputedTorque,
    Drive,
    JointFriction,
    Prescribed,
    Servo,
    Torque,
)
from jointplay.simulation.motion.ideal import IdealMotion
from jointplay.simulation.motion.reference import REFERENCE_NODE_S, Motion

BLOCK_NODES = 25_000
"""Nodes that are tabulated at once, if there are more than twice as many."""


_KEPT = 2
_recent: dict[tuple[object, ...], tuple[pin.Model, np.ndarray]] = {}
"""Tables along the last motions of trees, with the model that was moved."""


class Reference:
    """Position, velocity and feed-forward effort of the driven coordinates over time.

    A node has the same numbers whichever blocks are in memory, so that a run does not depend on
    when it goes on to the next ones.

    Args:
        rows: the table at some times, which follow each other; whether to show a bar.
        nodes: of the whole table.
        ideal: ideal mechanism whose efforts are in it, if any.
        ahead: nodes that must be in memory beyond the present time.
        progress: show a bar on standard error while the first blocks are made, if that takes long.

    Attributes:
        first: node with which the table in memory begins.
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
        """Time at which the table in memory must give way to the next [s]; inf if it need not."""
        last = (self._at + 2) * self._block >= self.nodes
        return math.inf if last else (self._at + 1) * self._block * REFERENCE_NODE_S

    def go_to(self, time: float) -> bool:
        """Have the blocks in memory that hold `time` [s]; returns whether that changed them."""
        at = min(int(time / REFERENCE_NODE_S) // self._block, max(self._count - 2, 0))
        if at == self._at:
            return False
        self._take(at)
        return True

    def memory(self) -> dict[str, Any]:
        return {} if self._ideal is None else self._ideal.memory()

    def recall(self, memory: Mapping[str, Any]) -> None:
        if self._ideal is not None and memory:
            self._ideal.recall(memory)

    @property
    def _count(self) -> int:
        return -(-self.nodes // self._block)

    def _take(self, at: int) -> None:
        wanted = [k for k in (at, at + 1) if k < self._count]
        self._blocks = {k: self._blocks[k] if k in self._blocks else self._make(k) for k in wanted}
        self._at, self.first = at, at * self._block
        parts = [self._blocks[k] for k in wanted]
        self.table = parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _make(self, block: int, progress: bool = False) -> np.ndarray:
        first = block * self._block
        times = np.arange(first, min(first + self._block, self.nodes)) * REFERENCE_NODE_S
        return self._rows(times, progress)


def table_nodes(motion: Motion | None, drives: Mapping[str, Drive], duration: float) -> int:
    """Nodes of the table of all drives: it ends where nothing changes any more."""
    ends = [0.0]
    for drive in drives.values():
        if isinstance(drive, Torque):
            ends.append(drive.times[-1])
        elif drive.follows and motion is not None:
            ends.append(motion.still_from)
    last = min(max(ends), duration)
    still = 1 if last < duration else 0  # both of the last two nodes, for cubics
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
) -> tuple[CoordinateTables, dict[int, float], Reference]:
    """Tabulate all drives.

    Args:
        mechanism, motion, drives, friction: what is driven, and how.
        duration: until when the table must reach [s].
        start: configuration of `mechanism` at the start, loops closed, shape (nq,).
        progress: show a bar on standard error if it takes long.
        bounds: efforts to which the drives are cut, by joint; prescribed motion is not.
        ahead: how far beyond the present the table must always reach [s].
        speed: velocities at the start, of which a free base's count, shape (nv,); None: it is at
            rest.

    Returns:
        The tables as they are at the start, the armature that the model needs, by coordinate [kg
        m^2 or kg], and what the tables of later times come from.
    """
    nodes = table_nodes(motion, drives, duration)
    driven = [name for name, drive in drives.items() if drive.kind != "free"]
    follows = [name for name in driven if drives[name].follows]
    ideal = None
    if any(isinstance(drives[name], ComputedTorque) for name in follows):
        assert motion is not None
        end = (nodes - 1) * REFERENCE_NODE_S
        ideal = IdealMotion(mechanism, motion, follows, end, start, speed)
    columns: list[Any] = []
    efforts: dict[int, tuple[float, JointFriction]] = {}
    """By column, what a drive also turns, and the friction that it overcomes."""
    rows, servos = [], []
    goals: dict[int, tuple[float, float]] = {}
    """By column, to what a servo cuts its reference."""
    rubs = [
        _friction_row(mechanism.coordinate(name), one)
        for name, one in friction.items()
        if one.coulomb or one.excess or one.viscous
    ]
    model = mechanism.model
    own = pin.crba(model, mechanism.data, start).reshape(model.nv, model.nv).diagonal().copy()
    armature: dict[int, float] = {}
    for name in driven:
        drive, at, u = drives[name], mechanism.motor(name), len(columns)
        gear = mechanism.gears.get(name)
        losses, limit = friction.get(name, JointFriction()), (bounds or {}).get(name, np.inf)
        if isinstance(drive, Torque):
            columns.append((drive.times, drive.values))
            row = drive_row(u, at, limit=limit)
        else:
            columns.append(k := follows.index(name))
        measured = at
        if isinstance(drive, ComputedTorque | Servo) and drive.encoder == "link":
            measured = mechanism.coordinate(name)
        if isinstance(drive, Prescribed):
            armature[at] = PRESCRIBED_ARMATURE * own[at]
            row = drive_row(u, at, armature=armature[at])
        if isinstance(drive, ComputedTorque):
            assert ideal is not None
            bandwidth = drive.through_teeth(ideal.inertia[k], gear).bandwidth or BANDWIDTH
            rotor = gear.rotor_inertia if gear else 0.0
            inertia = ideal.inertia[k] + rotor
            efforts[k] = rotor, losses
            kp = bandwidth**2 * inertia
            kd = 2.0 * drive.damping_ratio * bandwidth * inertia
            row = drive_row(u, at, measured, kp, kd, limit=limit)
        if isinstance(drive, Servo):
            servos.append(servo := np.zeros(1, layout.SERVO))
            for field in ("stall", "p_gain", "i_gain", "d_gain", "resolution", "voltage"):
                servo[field] = getattr(drive, field)
            servo["differences"] = drive.speed == "difference"
            servo["dead_band"], servo["period"] = drive.band, drive.period or 0.0
            servo["column"], servo["coordinate"], servo["encoder"] = u, at, measured
            limit = min(limit, math.inf if drive.effort is None else drive.effort)
            servo["limit"], servo["sampled_at"] = limit, -1.0
            if drive.goals is not None:
                goals[u] = drive.goals
            columns.append(((0.0,), (0.0,)))  # back-EMF is damping against a speed of zero
            row = drive_row(u + 1, at, kd=drive.braking, limit=limit)
            if gear and (drive.friction or drive.viscous):
                rubs.append(_friction_row(at, drive.with_friction(JointFriction())))
        rows.append(row)

    def rows_at(times: np.ndarray, bar: bool) -> np.ndarray:
        # A run, its ideal twin, those that state its errors, and the same machine with other
        # clearances all ask for the same.
        alike = None if ideal is None else ideal.alike()
        if alike is None or motion is None or not all(isinstance(one, int) for one in columns):
            return made(times, bar)
        known, model = alike
        key = (
            *(motion.joints, motion.times.tobytes(), motion.positions.tobytes()),
            *(motion.interpolation, times[0], times[-1], len(times), known),
            *(tuple(columns), tuple(follows), tuple(efforts.items())),
        )
        if key not in _recent or _recent[key][0] != model:
            table = made(times, bar)
            while len(_recent) >= _KEPT:
                _recent.pop(next(iter(_recent)), None)
            _recent[key] = model, table
        return _recent[key][1].copy()

    def made(times: np.ndarray, bar: bool) -> np.ndarray:
        table = np.zeros((3, len(times), max(len(columns), 1)))
        if follows:
            assert motion is not None
            order = [motion.joints.index(name) for name in follows]
            position, velocity, acceleration = (values[:, order] for values in motion(times))
        if ideal is not None:
            effort = ideal.efforts(times, bar)
        for u, column in enumerate(columns):
            if not isinstance(column, int):
                table[2, :, u] = np.interp(times, *column)
                continue
            table[0, :, u], table[1, :, u] = position[:, column], velocity[:, column]
            if u in goals:
                cut = np.clip(table[0, :, u], *goals[u])
                table[1, cut != table[0, :, u], u] = 0.0
                table[0, :, u] = cut
            if column in efforts:
                rotor, losses = efforts[column]
                table[2, :, u] = (
                    effort[:, column]
                    + rotor * acceleration[:, column]
                    + losses.torque(velocity[:, column])
                )
        return np.hstack(list(table))

    gears = [
        gear.row(mechanism.motor(name), mechanism.coordinate(name))
        for name, gear in mechanism.gears.items()
    ]
    reference = Reference(rows_at, nodes, ideal, math.ceil(ahead / REFERENCE_NODE_S) + 4, progress)
    tables = CoordinateTables(
        stacked(rows, layout.DRIVE_ROW),
        stacked(servos, layout.SERVO),
        stacked(rubs, layout.FRICTION_ROW),
        stacked(gears, layout.GEAR_ROW),
        reference.table,
        REFERENCE_NODE_S,
        nodes,
    )
    return tables, armature, reference
