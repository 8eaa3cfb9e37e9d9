"""The compiled part of a time step: drive, contact, bookkeeping, integration.

A stage of an integrator is one kernel call and one `pin.aba` call:

    kernel: record state n, integrate to n+1, drive efforts and contact forces at n+1 -> tau
    pin.aba(model, data, q, v, tau)                                                  -> data.ddq

The contact wrench needs no external force and no forward kinematics. Bearing and journal are
neighbours in the tree, joined by the six coordinates of the virtual link, so the force F on the
journal and its reaction -F on the bearing, at the same point, *are* a generalised force on those
six coordinates: tau += S^T w, the F_C of eq. 23 "projected on q".

A numba call costs about 0.1 us for every array it is given, as much as all its arithmetic. A
kernel therefore takes one array, the table of addresses and sizes built by `Workspace`, and opens
the others through it.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numba import carray, njit

from jointplay.contact.law import MAX_PARAMETERS, call_friction, call_normal, pointer
from jointplay.geometry import axial_gap, radial_gap


class Status(IntEnum):
    """Why the time loop stopped."""

    COMPLETED = 0
    INTERRUPTED = 1
    RUN_AWAY = 2
    BROKE_OUT = 3
    BAD_FORCE = 4


# Entries of the table (int64): addresses of float arrays, sizes, counters; then, for each
# clearance joint, the addresses of its normal-force law and of its friction law.
(
    _Q, _V, _A, _TAU, _DRIVE, _SCRATCH, _COORDINATES, _JOINTS, _FORCES, _MEMORY, _REFERENCE,
    _RECORD, _POWER, _CLOCK, _NV, _NJ, _NU, _NREF, _COLUMNS, _STEP, _EVERY, _ROW, _STAGE, _STATUS,
    _HAS_FRICTION, _BAD_CONTACT, _LAWS,
) = range(27)  # fmt: skip

_TIME, _DT, _NODE, _CLOCK_SIZE = range(4)

# Rows of the coordinate array, each of length nv.
_DRIVEN_BY, _KP, _KD, _COULOMB, _VISCOUS, _COORDINATE_ROWS = range(6)
JOINT_FRICTION_SPEED = 1e-3
"""Speed over which dry joint friction turns its sign [rad/s or m/s]."""

# A clearance joint's row: dimensions [m], first coordinate, parameters of its laws.
_RI, _RJ, _HALF_LI, _HALF_LJ, _LIMIT, _FIRST, _P_RADIAL = range(7)
_P_AXIAL = _P_RADIAL + MAX_PARAMETERS
_P_FRICTION = _P_AXIAL + MAX_PARAMETERS
_JOINT_SIZE = _P_FRICTION + MAX_PARAMETERS

# A clearance joint's force on the journal in the bearing frame, its peak since the last record,
# and the square of that peak's magnitude.
_FORCE_SIZE = 7

# What a contact remembers. _DDELTA0 ... are the contact's own, the rest is for audit and record.
(
    _DDELTA0, _STEPS, _OWN_IMPULSE, _NORMAL, _TANGENTIAL, _NORMAL_PEAK, _GAP_MIN, _ONSETS, _ENDED,
    _SHORTEST, _UNDER, _IMPULSE, _IMPULSE_UNDER, _DEEPEST, _MEMORY_SIZE,
) = range(15)  # fmt: skip
WELL_RESOLVED_STEPS = 10
"""A contact of fewer steps than this is not resolved."""

MIN_APPROACH_SPEED = 1e-9
"""Keeps ddelta/ddelta0 defined for a contact that begins at rest [m/s]."""

POWERS = ("drive", "normal_dissipation", "friction_dissipation", "joint_friction")
_NP = len(POWERS)

SPEED_LIMIT = 1e4
"""Generalised speed at which a run has run away [m/s or rad/s]."""


class Workspace:
    """The arrays of one run and the table through which the kernels reach them.

    Args:
        acceleration: Pinocchio's `data.ddq`, a view of its memory, shape (nv,).
        joints: one `joint_row` for each clearance joint, shape (nj, ...).
        laws: addresses of (normal-force law, friction law), shape (nj, 2).
        coordinates: `coordinate_rows`, shape (5, nv).
        reference: rows of q, v and feed-forward effort of the nu driven coordinates at intervals
            of `node` seconds, shape (nref, 3 nu), nref >= 2.
        node: interval of `reference` [s].
        dt: time step [s].
        every: steps between records.
        rows: room for records.
    """

    def __init__(
        self,
        acceleration: np.ndarray,
        joints: np.ndarray,
        laws: np.ndarray,
        coordinates: np.ndarray,
        reference: np.ndarray,
        node: float,
        dt: float,
        every: int,
        rows: int,
    ) -> None:
        """Allocate, and write the table."""
        nv, nj = len(acceleration), len(joints)
        self.fields, width = _layout(nv, nj)
        self.acceleration = acceleration
        self.q = np.zeros(nv)
        self.v = np.zeros(nv)
        self.tau = np.zeros(nv)
        self.drive = np.zeros(nv)
        self.forces = np.zeros((nj, _FORCE_SIZE))
        self.memory = np.zeros((nj, 4, _MEMORY_SIZE))
        self.memory[:, :, [_SHORTEST, _GAP_MIN, _DEEPEST]] = np.inf
        self.record = np.zeros((rows, width))
        self.power = np.zeros(3 * _NP)  # works, powers at the start of the step, powers now
        self.clock = np.zeros(_CLOCK_SIZE)
        self.clock[_DT], self.clock[_NODE] = dt, node
        self.scratch = np.zeros(4 * nv + _NP)
        self.joints = np.ascontiguousarray(joints, float)
        self.coordinates = np.ascontiguousarray(coordinates, float)
        self.reference = np.ascontiguousarray(reference, float)
        table = np.zeros(_LAWS + 2 * nj, np.int64)
        for entry, array in (
            (_Q, self.q),
            (_V, self.v),
            (_A, acceleration),
            (_TAU, self.tau),
            (_DRIVE, self.drive),
            (_SCRATCH, self.scratch),
            (_COORDINATES, self.coordinates),
            (_JOINTS, self.joints),
            (_FORCES, self.forces),
            (_MEMORY, self.memory),
            (_REFERENCE, self.reference),
            (_RECORD, self.record),
            (_POWER, self.power),
            (_CLOCK, self.clock),
        ):
            table[entry] = array.ctypes.data
        table[_NV], table[_NJ], table[_NU] = nv, nj, reference.shape[1] // 3
        table[_NREF], table[_COLUMNS], table[_EVERY] = len(reference), width, every
        table[_HAS_FRICTION] = int(np.any(self.coordinates[_COULOMB:] != 0.0))
        table[_LAWS:] = np.asarray(laws, np.int64).reshape(-1)
        self.table = table

    @property
    def rows(self) -> int:
        """Records written so far."""
        return int(self.table[_ROW])

    @property
    def steps(self) -> int:
        """Steps done so far."""
        return int(self.table[_STEP])

    @property
    def time(self) -> float:
        """Time of the current state [s]."""
        return float(self.clock[_TIME])

    @property
    def status(self) -> Status:
        """Status of the run."""
        return Status(int(self.table[_STATUS]))

    @property
    def bad_contact(self) -> tuple[int, int]:
        """(joint, contact) that stopped the run with `BROKE_OUT` or `BAD_FORCE`."""
        joint, contact = divmod(int(self.table[_BAD_CONTACT]), 4)
        return joint, contact

    def recorded(self, name: str) -> np.ndarray:
        """Columns `name` of the records written so far, shape (rows, width)."""
        return self.record[: self.rows, self.fields[name]]

    def contact_statistics(self) -> dict[str, np.ndarray]:
        """Per joint and contact, shape (nj, 4): counts, steps, impulses [N s], smallest gap [m]."""
        names = {
            "onsets": _ONSETS,
            "ended": _ENDED,
            "shortest_steps": _SHORTEST,
            "under_resolved": _UNDER,
            "impulse": _IMPULSE,
            "under_resolved_impulse": _IMPULSE_UNDER,
            "smallest_gap": _DEEPEST,
        }
        return {name: self.memory[:, :, index].copy() for name, index in names.items()}


def _layout(nv: int, nj: int) -> tuple[dict[str, slice], int]:
    """Columns of a record, and their number."""
    widths = {
        "time": 1,
        "q": nv,
        "v": nv,
        "drive": nv,
        "work": _NP,
        "force": 3 * nj,
        "force_peak": 3 * nj,
        "normal": 4 * nj,
        "tangential": 4 * nj,
        "normal_peak": 4 * nj,
        "gap_min": 4 * nj,
    }
    fields, at = {}, 0
    for name, width in widths.items():
        fields[name] = slice(at, at + width)
        at += width
    return fields, at


def joint_row(
    ri: float,
    rj: float,
    li: float,
    lj: float,
    first: int,
    radial: tuple[float, ...],
    axial: tuple[float, ...],
    friction: tuple[float, ...],
) -> np.ndarray:
    """Row of `Workspace.joints`: R_i, R_j, L_i, L_j [m], first coordinate, parameters of the laws.

    A journal that has penetrated by a tenth of its radius has broken out of its bearing, far
    beyond what any contact law means.
    """
    row = np.zeros(_JOINT_SIZE)
    row[:_P_RADIAL] = ri, rj, li / 2, lj / 2, -0.1 * rj, first
    for start, values in ((_P_RADIAL, radial), (_P_AXIAL, axial), (_P_FRICTION, friction)):
        row[start : start + len(values)] = values
    return row


def coordinate_rows(nv: int) -> np.ndarray:
    """Rows driven-by, kp, kd, Coulomb and viscous friction for nv coordinates; nothing driven."""
    rows = np.zeros((_COORDINATE_ROWS, nv))
    rows[_DRIVEN_BY] = -1.0
    return rows


_internal = njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""For functions that only kernels call: without wrappers they compile faster."""


@_internal
def _open(table, entry, size):
    return carray(pointer(table[entry]), (size,))


@_internal
def _fail(table, status, contact):
    """Keep the first failure: what follows it only echoes it."""
    if table[_STATUS] == 0:
        table[_STATUS] = status
        table[_BAD_CONTACT] = contact


@_internal
def _contact(table, j, q, v, tau, power, commit):
    """Add clearance joint j's forces at state (q, v) to tau and its losses to power.

    With `commit` the state is one of the trajectory, not an integrator's intermediate stage: the
    contacts' memories are then updated.
    """
    base = table[_JOINTS] + 8 * j * _JOINT_SIZE
    p = carray(pointer(base), (_JOINT_SIZE,))
    memory = carray(pointer(table[_MEMORY] + 8 * j * 4 * _MEMORY_SIZE), (4 * _MEMORY_SIZE,))
    force = carray(pointer(table[_FORCES] + 8 * j * _FORCE_SIZE), (_FORCE_SIZE,))
    clock = _open(table, _CLOCK, _CLOCK_SIZE)
    first = int(p[_FIRST])

    # Journal axis: third column of Rz(yaw) Ry(pitch) Rx(roll).
    cy, sy = math.cos(q[first + 3]), math.sin(q[first + 3])
    cp, sp = math.cos(q[first + 4]), math.sin(q[first + 4])
    cr, sr = math.cos(q[first + 5]), math.sin(q[first + 5])
    ax = cy * sp * cr + sy * sr
    ay = sy * sp * cr - cy * sr
    az = cp * cr
    # Angular velocity; the axes of yaw, pitch and roll are e_z, (-sy, cy, 0) and (ux, uy, uz).
    ux, uy, uz = cy * cp, sy * cp, -sp
    wx = -sy * v[first + 4] + ux * v[first + 5]
    wy = cy * v[first + 4] + uy * v[first + 5]
    wz = v[first + 3] + uz * v[first + 5]

    fx = fy = fz = 0.0
    mx = my = mz = 0.0
    for k in range(4):
        side = 1.0 - 2.0 * (k & 1)
        reach = side * p[_HALF_LJ]
        ex, ey, ez = reach * ax, reach * ay, reach * az
        if k < 2:
            gap, ox, oy, oz, nx, ny = radial_gap(
                q[first] + ex, q[first + 1] + ey, q[first + 2] + ez, ax, ay, az, p[_RI], p[_RJ]
            )
            nx, ny, nz = -nx, -ny, 0.0
        else:
            gap, ox, oy, oz = axial_gap(q[first + 2] + ez, ax, ay, az, side, p[_HALF_LI], p[_RJ])
            nx, ny, nz = 0.0, 0.0, -side
        m = k * _MEMORY_SIZE
        if commit:
            memory[m + _GAP_MIN] = min(memory[m + _GAP_MIN], gap)
            memory[m + _DEEPEST] = min(memory[m + _DEEPEST], gap)
        if gap >= 0.0:
            if commit:
                memory[m + _NORMAL] = 0.0
                memory[m + _TANGENTIAL] = 0.0
                if memory[m + _STEPS] > 0.0:
                    _end_contact(memory, m)
            continue
        if gap < p[_LIMIT]:
            _fail(table, 3, 4 * j + k)
            continue

        # Contact point relative to the journal's centre, and its velocity relative to the bearing.
        rx, ry, rz = ex + ox, ey + oy, ez + oz
        slip_x = v[first] + wy * rz - wz * ry
        slip_y = v[first + 1] + wz * rx - wx * rz
        slip_z = v[first + 2] + wx * ry - wy * rx
        rate = -(nx * slip_x + ny * slip_y + nz * slip_z)
        slip_x += rate * nx
        slip_y += rate * ny
        slip_z += rate * nz
        speed = math.sqrt(slip_x * slip_x + slip_y * slip_y + slip_z * slip_z)

        # The approach speed is the largest since the contact began. For an impact that is the
        # speed at its onset (eq. 14), for |ddelta| only falls from there; a contact that began
        # slowly cannot make the damping of eq. 19 grow without bound when it is loaded later.
        approach = max(abs(rate), MIN_APPROACH_SPEED)
        if memory[m + _STEPS] > 0.0:
            approach = max(approach, memory[m + _DDELTA0])
        law = pointer(base + 8 * (_P_RADIAL if k < 2 else _P_AXIAL))
        normal = call_normal(table[_LAWS + 2 * j], -gap, rate, approach, law)
        elastic = call_normal(table[_LAWS + 2 * j], -gap, 0.0, approach, law)
        mu = call_friction(table[_LAWS + 2 * j + 1], speed, pointer(base + 8 * _P_FRICTION))
        if not (math.isfinite(normal) and math.isfinite(elastic) and 0.0 <= mu < math.inf):
            _fail(table, 4, 4 * j + k)
            continue
        normal = max(normal, 0.0)  # a dry contact never pulls
        tangential = mu * normal
        scale = -tangential / speed if speed > 0.0 else 0.0
        px, py, pz = (
            normal * nx + scale * slip_x,
            normal * ny + scale * slip_y,
            normal * nz + scale * slip_z,
        )
        fx += px
        fy += py
        fz += pz
        mx += ry * pz - rz * py
        my += rz * px - rx * pz
        mz += rx * py - ry * px
        power[1] += (normal - elastic) * rate
        power[2] += tangential * speed
        if commit:
            if memory[m + _STEPS] == 0.0:
                memory[m + _ONSETS] += 1.0
                memory[m + _OWN_IMPULSE] = 0.0
            impulse = normal * clock[_DT]
            memory[m + _DDELTA0] = approach
            memory[m + _STEPS] += 1.0
            memory[m + _OWN_IMPULSE] += impulse
            memory[m + _IMPULSE] += impulse
            memory[m + _NORMAL] = normal
            memory[m + _TANGENTIAL] = tangential
            memory[m + _NORMAL_PEAK] = max(memory[m + _NORMAL_PEAK], normal)

    tau[first] += fx
    tau[first + 1] += fy
    tau[first + 2] += fz
    tau[first + 3] += mz
    tau[first + 4] += cy * my - sy * mx
    tau[first + 5] += ux * mx + uy * my + uz * mz
    if commit:
        force[0], force[1], force[2] = fx, fy, fz
        square = fx * fx + fy * fy + fz * fz
        if square > force[6]:
            force[3], force[4], force[5], force[6] = fx, fy, fz, square


@_internal
def _end_contact(memory, m):
    """Count a contact that has ended, and how well it was resolved."""
    steps = memory[m + _STEPS]
    memory[m + _STEPS] = 0.0
    memory[m + _ENDED] += 1.0
    memory[m + _SHORTEST] = min(memory[m + _SHORTEST], steps)
    if steps < WELL_RESOLVED_STEPS:
        memory[m + _UNDER] += 1.0
        memory[m + _IMPULSE_UNDER] += memory[m + _OWN_IMPULSE]


@_internal
def _load(table, q, v, time, commit):
    """Generalised forces tau and powers at state (q, v): drive, joint friction, contact."""
    nv = table[_NV]
    nu = table[_NU]
    tau = _open(table, _TAU, nv)
    drive = _open(table, _DRIVE, nv)
    rows = _open(table, _COORDINATES, _COORDINATE_ROWS * nv)
    power = carray(pointer(table[_POWER] + 8 * 2 * _NP), (_NP,))
    clock = _open(table, _CLOCK, _CLOCK_SIZE)

    last = table[_NREF] - 2
    place = time / clock[_NODE]
    node = min(int(place), last)
    part = min(place - node, 1.0)
    reference = carray(pointer(table[_REFERENCE] + 8 * 3 * nu * node), (6 * nu,))
    for i in range(_NP):
        power[i] = 0.0
    size = 0.0
    for i in range(nv):
        size += abs(v[i])
        u = int(rows[i])
        effort = 0.0
        if u >= 0:
            position = reference[u] + part * (reference[3 * nu + u] - reference[u])
            u += nu
            speed = reference[u] + part * (reference[3 * nu + u] - reference[u])
            u += nu
            forward = reference[u] + part * (reference[3 * nu + u] - reference[u])
            effort = (
                forward
                + rows[_KP * nv + i] * (position - q[i])
                + rows[_KD * nv + i] * (speed - v[i])
            )
            power[0] += effort * v[i]
        drive[i] = effort
        tau[i] = effort
    if table[_HAS_FRICTION] != 0:
        for i in range(nv):
            dry = rows[_COULOMB * nv + i] * math.tanh(v[i] / JOINT_FRICTION_SPEED)
            friction = dry + rows[_VISCOUS * nv + i] * v[i]
            tau[i] -= friction
            power[3] += friction * v[i]
    if not size < SPEED_LIMIT:  # true for NaN as well
        _fail(table, 2, 0)
    for j in range(table[_NJ]):
        _contact(table, j, q, v, tau, power, commit)


@_internal
def _record(table):
    """Write the current state and the peaks since the last record, and begin new peaks."""
    nv = table[_NV]
    nj = table[_NJ]
    columns = table[_COLUMNS]
    row = carray(pointer(table[_RECORD] + 8 * columns * table[_ROW]), (columns,))
    q = _open(table, _Q, nv)
    v = _open(table, _V, nv)
    drive = _open(table, _DRIVE, nv)
    power = _open(table, _POWER, 3 * _NP)
    forces = _open(table, _FORCES, nj * _FORCE_SIZE)
    memory = _open(table, _MEMORY, nj * 4 * _MEMORY_SIZE)
    row[0] = _open(table, _CLOCK, _CLOCK_SIZE)[_TIME]
    for i in range(nv):
        row[1 + i] = q[i]
        row[1 + nv + i] = v[i]
        row[1 + 2 * nv + i] = drive[i]
    at = 1 + 3 * nv
    for i in range(_NP):
        row[at + i] = power[i]
    at += _NP
    for j in range(nj):
        f = j * _FORCE_SIZE
        for i in range(3):
            row[at + 3 * j + i] = forces[f + i]
            row[at + 3 * nj + 3 * j + i] = forces[f + 3 + i]
        forces[f + 6] = 0.0
        for i in range(3):
            forces[f + 3 + i] = 0.0
    at += 6 * nj
    for c in range(4 * nj):
        m = c * _MEMORY_SIZE
        row[at + c] = memory[m + _NORMAL]
        row[at + 4 * nj + c] = memory[m + _TANGENTIAL]
        row[at + 8 * nj + c] = memory[m + _NORMAL_PEAK]
        row[at + 12 * nj + c] = memory[m + _GAP_MIN]
        memory[m + _NORMAL_PEAK] = 0.0
        memory[m + _GAP_MIN] = np.inf
    table[_ROW] += 1


@njit(cache=True)
def begin(table) -> int:
    """Forces at the initial state; `pin.aba` must follow. Returns the status."""
    nv = table[_NV]
    _load(table, _open(table, _Q, nv), _open(table, _V, nv), 0.0, True)
    power = _open(table, _POWER, 3 * _NP)
    for i in range(_NP):
        power[_NP + i] = power[2 * _NP + i]
    return table[_STATUS]


@njit(cache=True)
def record(table) -> int:
    """Record the current state. Returns the status."""
    _record(table)
    return table[_STATUS]


@_internal
def _advance_clock(table):
    clock = _open(table, _CLOCK, _CLOCK_SIZE)
    table[_STEP] += 1
    clock[_TIME] = table[_STEP] * clock[_DT]
    return clock[_TIME]


@njit(cache=True)
def semi_implicit_euler(table) -> int:
    """Step by v += a dt, q += v dt (first order); `pin.aba` must follow.

    Returns the status.
    """
    nv = table[_NV]
    q = _open(table, _Q, nv)
    v = _open(table, _V, nv)
    a = _open(table, _A, nv)
    power = _open(table, _POWER, 3 * _NP)
    dt = _open(table, _CLOCK, _CLOCK_SIZE)[_DT]
    if table[_STEP] % table[_EVERY] == 0:
        _record(table)
    for i in range(nv):
        v[i] += dt * a[i]
        q[i] += dt * v[i]
    _load(table, q, v, _advance_clock(table), True)
    for i in range(_NP):
        power[i] += 0.5 * dt * (power[_NP + i] + power[2 * _NP + i])
        power[_NP + i] = power[2 * _NP + i]
    return table[_STATUS]


@njit(cache=True)
def runge_kutta_4(table) -> int:
    """One stage of the classical Runge-Kutta method; `pin.aba` must follow each of the four.

    The works are integrated with the state, as further components. Returns the status.
    """
    nv = table[_NV]
    q = _open(table, _Q, nv)
    v = _open(table, _V, nv)
    a = _open(table, _A, nv)
    # State at the start of the step, weighted sums of its slopes, and those of the works.
    scratch = _open(table, _SCRATCH, 4 * nv + _NP)
    power = _open(table, _POWER, 3 * _NP)
    clock = _open(table, _CLOCK, _CLOCK_SIZE)
    dt = clock[_DT]
    stage = table[_STAGE]
    if stage == 0 and table[_STEP] % table[_EVERY] == 0:
        _record(table)
    weight = dt / 6.0 if stage == 0 or stage == 3 else dt / 3.0
    for i in range(_NP):
        done = 0.0 if stage == 0 else scratch[4 * nv + i]
        scratch[4 * nv + i] = done + weight * power[2 * _NP + i]
    ahead = dt if stage == 2 else 0.5 * dt
    for i in range(nv):
        if stage == 0:
            scratch[i] = q[i]
            scratch[nv + i] = v[i]
            scratch[2 * nv + i] = 0.0
            scratch[3 * nv + i] = 0.0
        scratch[2 * nv + i] += weight * v[i]
        scratch[3 * nv + i] += weight * a[i]
        if stage == 3:
            q[i] = scratch[i] + scratch[2 * nv + i]
            v[i] = scratch[nv + i] + scratch[3 * nv + i]
        else:
            q[i] = scratch[i] + ahead * v[i]
            v[i] = scratch[nv + i] + ahead * a[i]
    if stage < 3:
        table[_STAGE] = stage + 1
        _load(table, q, v, clock[_TIME] + ahead, False)
        return table[_STATUS]
    table[_STAGE] = 0
    for i in range(_NP):
        power[i] += scratch[4 * nv + i]
    _load(table, q, v, _advance_clock(table), True)
    return table[_STATUS]
