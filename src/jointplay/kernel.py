"""The compiled part of a time step: drive, contact, bookkeeping, integration.

A stage of an integrator is one kernel call and one `pin.aba` call:

    kernel: record state n, integrate to n+1, drive efforts and contact forces at n+1 -> tau
    pin.aba(model, data, q, v, tau)                                                  -> data.ddq

A contact wrench needs no external force: the force F on the journal and its reaction -F on the
bearing, at the same point, *are* a generalised force tau += J^T w, J being the motion of the
journal relative to the bearing: the F_C of eq. 23 "projected on q". Where bearing and journal are
neighbours in the tree, joined by the six coordinates of the virtual link, J is known (S) and not
even forward kinematics is needed. Otherwise - a loop cut at the joint, a locked freedom, bearing
and journal exchanged - `pin.computeJointJacobians` comes between, and `load` after it:

    kernel: record state n, integrate to n+1
    pin.computeJointJacobians(model, data, q)                                -> data.oMi, data.J
    load: drive efforts and contact forces at n+1                                         -> tau
    pin.aba(model, data, q, v, tau)                                                  -> data.ddq

A numba call costs about 0.1 us for every array it is given, as much as all its arithmetic. A
kernel therefore takes one array, the table of addresses and sizes built by `Workspace`, and opens
the others through it.
"""

from __future__ import annotations

import math
from enum import IntEnum
from functools import cache
from typing import Any

import numba
import numpy as np
from numba import carray, njit

from jointplay.contact.law import (
    BRISTLE_NUMBERS,
    FILM_NUMBERS,
    MAX_PARAMETERS,
    call_bristle,
    call_film,
    call_friction,
    call_normal,
    pointer,
)
from jointplay.geometry import Shape, touch, touch_cylinder


class Status(IntEnum):
    """Why the time loop stopped."""

    COMPLETED = 0
    INTERRUPTED = 1
    RUN_AWAY = 2
    BROKE_OUT = 3
    BAD_FORCE = 4
    FILM_BROKE = 5


# Entries of the table (int64): addresses of float arrays, sizes, counters, flags; then a block for
# each joint with clearance.
(
    _Q, _V, _A, _TAU, _DRIVE, _SCRATCH, _COORDINATES, _FRICTIONS, _GEARS, _REFERENCE, _RECORD,
    _POWER, _CLOCK, _LAW_NUMBERS, _J, _NV, _NJ, _NU, _NF, _NG, _NREF, _WIDTH, _COLUMNS,
    _STEP, _EVERY, _ROW, _STAGE, _STATUS, _FRAMES, _COMMIT, _PENDING, _HAS_PRESCRIBED,
    _BAD_CONTACT, _BLOCKS,
) = range(34)  # fmt: skip

# A joint's block: addresses of its laws, what it looks like, where its arrays are.
(
    _NORMAL_LAW, _FRICTION_LAW, _BRISTLES, _SHAPE, _COUNT, _FIRST, _BEARING_R, _BEARING_P,
    _JOURNAL_R, _JOURNAL_P, _PLACEMENTS, _SIGNS, _NUMBERS, _PARAMETERS, _MEMORY, _FORCE, _POSE,
    _FILM_LAW, _FILM, _FILM_MEMORY, _MUST_NOT_TOUCH, _WEARING, _SLIDING_WORK, _BLOCK_SIZE,
) = range(24)  # fmt: skip
_NO_VIRTUAL_LINK = -1
"""`_FIRST` of a joint whose bearing and journal are reached through their frames."""

_TIME, _DT, _NODE, _LOAD_TIME, _CLOCK_SIZE = range(5)

# Rows of the coordinate array, each of length nv.
_DRIVEN_BY, _MEASURED, _KP, _KD, _ARMATURE, _COORDINATE_ROWS = range(6)

# Columns of the friction array. Joints without friction have no row: a loop over all coordinates
# would cost a tenth of a microsecond even where it is skipped.
_RUBS, _COULOMB, _STICTION, _STRIBECK, _VISCOUS, _FRICTION_SIZE = range(6)
JOINT_FRICTION_SPEED = 1e-3
"""Speed over which dry joint friction turns its sign [rad/s or m/s]."""

# Columns of the gear array.
_MOTOR, _LINK, _HALF_PLAY, _STIFFNESS, _DAMPING, _GEAR_SIZE = range(6)

# A joint's numbers: depth at which it has broken out [m], its friction law's parameters, its
# dimensions.
_LIMIT, _P_FRICTION = 0, 1
_DIMENSIONS = _P_FRICTION + MAX_PARAMETERS

# A joint's film: its sections and their distance from the journal's centre, clearance, eccentricity
# ratio at which it is thinnest, depth over which it fades, mass for its lag; the law's parameters.
(
    _SECTIONS, _SECTION, _CLEARANCE, _THINNEST, _TRANSITION, _LAG_MASS, _P_FILM,
) = range(7)  # fmt: skip
_FILM_SIZE = _P_FILM + MAX_PARAMETERS

# What a section of the film remembers: its force and its velocity at the last step.
_FILM_X, _FILM_Y, _FILM_U, _FILM_V, _FILM_KNOWN, _SECTION_SIZE = range(6)

# A joint's force on the journal in the bearing frame, its peak since the last record, the
# square of that peak's magnitude, and the part of the force that is the film's.
_FORCE_SIZE = 10

# A joint's pose: journal's centre, orientation, velocity and angular velocity in the bearing frame.
# Then the world frames of bearing and journal, rotation row by row and translation each.
_CENTRE, _TURN, _VELOCITY, _OMEGA, _BEARING, _JOURNAL, _POSE_SIZE = 0, 3, 12, 15, 18, 30, 42

# What a contact remembers. _DDELTA0 ... are the contact's own, the rest is for audit and record.
(
    _DDELTA0, _STEPS, _OWN_IMPULSE, _NORMAL, _TANGENTIAL, _NORMAL_PEAK, _GAP_MIN, _ONSETS, _ENDED,
    _SHORTEST, _UNDER, _IMPULSE, _IMPULSE_UNDER, _DEEPEST, _BEND_X, _BEND_Y, _BEND_Z, _DWELL,
    _FASTEST, _MEMORY_SIZE,
) = range(20)  # fmt: skip
AZIMUTHS = 72
"""Places around the bore at which sliding work is counted, the first on the bearing's x axis."""

WELL_RESOLVED_STEPS = 10
"""A contact of fewer steps than this is not resolved."""

MIN_APPROACH_SPEED = 1e-9
"""Keeps ddelta/ddelta0 defined for a contact that begins at rest [m/s]."""

POWERS = (
    "drive",
    "normal_dissipation",
    "friction_dissipation",
    "joint_friction",
    "gear_dissipation",
    "film_dissipation",
)
_NP = len(POWERS)

SPEED_LIMIT = 1e4
"""Generalised speed at which a run has run away [m/s or rad/s]."""

_CYLINDER, _BLOCK = int(Shape.CYLINDER), int(Shape.BLOCK)


_TABLE = (numba.int64[::1],)
"""Signature of all kernels."""


@cache
def compiled(kernel: Any) -> Any:
    """Compile or load a kernel, and return the function behind numba's dispatcher.

    To call it directly saves the dispatcher's look at the argument, half of what a call costs.
    """
    kernel.compile(_TABLE)
    return kernel.overloads[_TABLE].entry_point


_internal = njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
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
def _motion_of_virtual_link(q, v, first):
    """Journal's axis and angular velocity from the coordinates of the virtual link."""
    cy, sy = math.cos(q[first + 3]), math.sin(q[first + 3])
    cp, sp = math.cos(q[first + 4]), math.sin(q[first + 4])
    cr, sr = math.cos(q[first + 5]), math.sin(q[first + 5])
    # Third column of Rz(yaw) Ry(pitch) Rx(roll).
    ax, ay, az = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr
    # The axes of yaw, pitch and roll are e_z, (-sy, cy, 0) and (cy cp, sy cp, -sp).
    wx = -sy * v[first + 4] + cy * cp * v[first + 5]
    wy = cy * v[first + 4] + sy * cp * v[first + 5]
    return ax, ay, az, wx, wy, v[first + 3] - sp * v[first + 5]


@_internal
def _turn_of_virtual_link(q, first, pose):
    """Put the first two columns of the journal's orientation into `pose`."""
    cy, sy = math.cos(q[first + 3]), math.sin(q[first + 3])
    cp, sp = math.cos(q[first + 4]), math.sin(q[first + 4])
    cr, sr = math.cos(q[first + 5]), math.sin(q[first + 5])
    pose[_TURN] = cy * cp
    pose[_TURN + 1] = cy * sp * sr - sy * cr
    pose[_TURN + 3] = sy * cp
    pose[_TURN + 4] = sy * sp * sr + cy * cr
    pose[_TURN + 6] = -sp
    pose[_TURN + 7] = cp * sr


@_internal
def _push_virtual_link(q, first, tau, fx, fy, fz, mx, my, mz):
    """Project force and moment about the journal's centre on the virtual link's coordinates."""
    cy, sy = math.cos(q[first + 3]), math.sin(q[first + 3])
    cp, sp = math.cos(q[first + 4]), math.sin(q[first + 4])
    tau[first] += fx
    tau[first + 1] += fy
    tau[first + 2] += fz
    tau[first + 3] += mz
    tau[first + 4] += cy * my - sy * mx
    tau[first + 5] += cy * cp * mx + sy * cp * my - sp * mz


@_internal
def _frame_of(rotation, translation, placement, at, pose, to):
    """World frame (rotation row by row, translation) of a placement in a joint's frame.

    Pinocchio's rotations are stored column by column.
    """
    for i in range(3):
        for k in range(3):
            pose[to + 3 * i + k] = (
                rotation[i] * placement[at + k]
                + rotation[i + 3] * placement[at + 3 + k]
                + rotation[i + 6] * placement[at + 6 + k]
            )
        pose[to + 9 + i] = translation[i] + (
            rotation[i] * placement[at + 9]
            + rotation[i + 3] * placement[at + 10]
            + rotation[i + 6] * placement[at + 11]
        )


@_internal
def _pose_of_frames(table, b, v, pose):
    """Pose and rates of the journal from the frames that carry it and its bearing.

    Only coordinates that move one of both and not the other enter the rates, so that a common
    motion cannot blur them.
    """
    nv = table[_NV]
    placement = _open(table, b + _PLACEMENTS, 24)
    signs = _open(table, b + _SIGNS, nv)
    columns = _open(table, _J, 6 * nv)
    rotation, translation = _open(table, b + _BEARING_R, 9), _open(table, b + _BEARING_P, 3)
    _frame_of(rotation, translation, placement, 0, pose, _BEARING)
    rotation, translation = _open(table, b + _JOURNAL_R, 9), _open(table, b + _JOURNAL_P, 3)
    _frame_of(rotation, translation, placement, 12, pose, _JOURNAL)
    ux = uy = uz = wx = wy = wz = 0.0
    for i in range(nv):
        if signs[i] != 0.0:
            speed = signs[i] * v[i]
            ux += speed * columns[6 * i]
            uy += speed * columns[6 * i + 1]
            uz += speed * columns[6 * i + 2]
            wx += speed * columns[6 * i + 3]
            wy += speed * columns[6 * i + 4]
            wz += speed * columns[6 * i + 5]
    px, py, pz = pose[_JOURNAL + 9], pose[_JOURNAL + 10], pose[_JOURNAL + 11]
    ux, uy, uz = ux + wy * pz - wz * py, uy + wz * px - wx * pz, uz + wx * py - wy * px
    dx, dy, dz = px - pose[_BEARING + 9], py - pose[_BEARING + 10], pz - pose[_BEARING + 11]
    for i in range(3):
        # Axis i of the bearing frame.
        bx, by, bz = pose[_BEARING + i], pose[_BEARING + 3 + i], pose[_BEARING + 6 + i]
        pose[_CENTRE + i] = bx * dx + by * dy + bz * dz
        pose[_VELOCITY + i] = bx * ux + by * uy + bz * uz
        pose[_OMEGA + i] = bx * wx + by * wy + bz * wz
        for k in range(3):
            pose[_TURN + 3 * i + k] = (
                bx * pose[_JOURNAL + k] + by * pose[_JOURNAL + 3 + k] + bz * pose[_JOURNAL + 6 + k]
            )


@_internal
def _push_frames(table, b, tau, pose, fx, fy, fz, mx, my, mz):
    """Project force and moment about the journal's centre on all coordinates that feel them."""
    nv = table[_NV]
    signs = _open(table, b + _SIGNS, nv)
    columns = _open(table, _J, 6 * nv)
    gx = pose[_BEARING] * fx + pose[_BEARING + 1] * fy + pose[_BEARING + 2] * fz
    gy = pose[_BEARING + 3] * fx + pose[_BEARING + 4] * fy + pose[_BEARING + 5] * fz
    gz = pose[_BEARING + 6] * fx + pose[_BEARING + 7] * fy + pose[_BEARING + 8] * fz
    nx = pose[_BEARING] * mx + pose[_BEARING + 1] * my + pose[_BEARING + 2] * mz
    ny = pose[_BEARING + 3] * mx + pose[_BEARING + 4] * my + pose[_BEARING + 5] * mz
    nz = pose[_BEARING + 6] * mx + pose[_BEARING + 7] * my + pose[_BEARING + 8] * mz
    px, py, pz = pose[_JOURNAL + 9], pose[_JOURNAL + 10], pose[_JOURNAL + 11]
    nx, ny, nz = nx + py * gz - pz * gy, ny + pz * gx - px * gz, nz + px * gy - py * gx
    for i in range(nv):
        if signs[i] != 0.0:
            tau[i] += signs[i] * (
                columns[6 * i] * gx
                + columns[6 * i + 1] * gy
                + columns[6 * i + 2] * gz
                + columns[6 * i + 3] * nx
                + columns[6 * i + 4] * ny
                + columns[6 * i + 5] * nz
            )


@_internal
def _bristles(table, b, memory, m, elapsed, commit, nx, ny, nz, ux, uy, uz, speed, normal):
    """Friction force (3) of a contact whose law has bristles, and whether it is finite.

    (nx, ny, nz) is the contact's normal, (ux, uy, uz) the sliding velocity. The bristles bend from
    where the last step left them, for `elapsed` seconds at constant velocity.
    """
    out = _open(table, _LAW_NUMBERS, BRISTLE_NUMBERS)
    rubbing = pointer(table[b + _NUMBERS] + 8 * _P_FRICTION)
    numbers = pointer(table[_LAW_NUMBERS])
    call_bristle(table[b + _FRICTION_LAW], speed, normal, memory[m + _DWELL], rubbing, numbers)
    share, rate, stiffness, damping = out[0], out[1], out[2], out[3]
    x, y, z = memory[m + _BEND_X], memory[m + _BEND_Y], memory[m + _BEND_Z]
    across = nx * x + ny * y + nz * z
    x, y, z = x - across * nx, y - across * ny, z - across * nz
    # dz/dt = A v - r z for constant v, exactly: z -> z e^(-r t) + A v (1 - e^(-r t)) / r.
    left = math.exp(-rate * elapsed)
    gain = share * (elapsed if rate * elapsed < 1e-9 else (1.0 - left) / rate)
    x, y, z = left * x + gain * ux, left * y + gain * uy, left * z + gain * uz
    fx = -stiffness * x - damping * (share * ux - rate * x)
    fy = -stiffness * y - damping * (share * uy - rate * y)
    fz = -stiffness * z - damping * (share * uz - rate * z)
    size = math.sqrt(fx * fx + fy * fy + fz * fz)
    if size > out[5]:
        scale = out[5] / size
        fx, fy, fz = scale * fx, scale * fy, scale * fz
    fx, fy, fz = fx - out[4] * ux, fy - out[4] * uy, fz - out[4] * uz
    if commit:
        memory[m + _BEND_X], memory[m + _BEND_Y], memory[m + _BEND_Z] = x, y, z
        memory[m + _DWELL] = out[6] + (memory[m + _DWELL] - out[6]) * math.exp(-out[7] * elapsed)
    return fx, fy, fz, math.isfinite(fx + fy + fz)


@_internal
def _film(table, b, power, commit, cx, cy, ax, ay, az, ux, uy, wx, wy, wz):
    """Force (2) and moment (3) of the film on the journal about its centre, and if it is finite.

    (cx, cy) is the journal's centre and (ux, uy) its velocity across the bearing's axis, (ax, ay,
    az) the journal's axis, (wx, wy, wz) its angular velocity, all in the bearing frame.

    Where dt C/m is not small the film is stiffer than a step can follow. The force is then a mean
    of what the law says and of the force of the last step, weighted so that a mass m stays stable;
    a steady force is exact (docs/theory.md).
    """
    film = _open(table, b + _FILM, _FILM_SIZE)
    law = pointer(table[b + _FILM] + 8 * _P_FILM)
    out = _open(table, _LAW_NUMBERS, FILM_NUMBERS)
    numbers = pointer(table[_LAW_NUMBERS])
    lag = _open(table, _CLOCK, _CLOCK_SIZE)[_DT] / film[_LAG_MASS]
    clearance = film[_CLEARANCE]
    sections = int(film[_SECTIONS])
    memory = _open(table, b + _FILM_MEMORY, 2 * _SECTION_SIZE)
    fx = fy = mx = my = mz = 0.0
    for section in range(sections):
        m = section * _SECTION_SIZE
        height = film[_SECTION] * (1.0 - 2.0 * section)
        px, py = cx + height * ax, cy + height * ay
        # The section's own velocity: w x (height a) is added to the centre's.
        vx = ux + height * (wy * az - wz * ay)
        vy = uy + height * (wz * ax - wx * az)
        e = math.sqrt(px * px + py * py)
        ex, ey = (px / e, py / e) if e > 0.0 else (1.0, 0.0)
        part = 1.0 / sections
        if e > clearance:
            part *= max(1.0 - (e - clearance) / film[_TRANSITION], 0.0)
        hx = hy = turn = 0.0
        if part > 0.0:
            ratio = min(e / clearance, film[_THINNEST])
            rate, whirl = ex * vx + ey * vy, ex * vy - ey * vx
            call_film(
                table[b + _FILM_LAW], ratio, rate / clearance, whirl / clearance, wz, law, numbers
            )
            stiff = part * out[3] * lag
            ahead = stiff / (1.0 + stiff)
            if memory[m + _FILM_KNOWN] > 0.0 and ahead > 0.0:
                sx = vx + ahead * (vx - memory[m + _FILM_U])
                sy = vy + ahead * (vy - memory[m + _FILM_V])
                rate, whirl = ex * sx + ey * sy, ex * sy - ey * sx
                call_film(
                    table[b + _FILM_LAW],
                    ratio,
                    rate / clearance,
                    whirl / clearance,
                    wz,
                    law,
                    numbers,
                )
                stiff = part * out[3] * lag
                ahead = stiff / (1.0 + stiff)
            else:
                ahead = 0.0
            along, across = part * out[0], part * out[1]
            turn = part * out[2]
            hx = (1.0 - ahead) * (ex * along - ey * across) + ahead * memory[m + _FILM_X]
            hy = (1.0 - ahead) * (ey * along + ex * across) + ahead * memory[m + _FILM_Y]
        power[5] -= hx * vx + hy * vy + turn * wz
        fx += hx
        fy += hy
        # height a x h
        mx -= height * az * hy
        my += height * az * hx
        mz += turn + height * (ax * hy - ay * hx)
        if commit:
            memory[m + _FILM_X], memory[m + _FILM_Y] = hx, hy
            memory[m + _FILM_U], memory[m + _FILM_V] = vx, vy
            memory[m + _FILM_KNOWN] = 1.0
    return fx, fy, mx, my, mz, math.isfinite(fx + fy + mz)


@_internal
def _contact(table, j, q, v, tau, power, commit, elapsed):
    """Add joint j's contact forces at state (q, v) to tau and its losses to power.

    With `commit` the state is one of the trajectory, not an integrator's intermediate stage: the
    contacts' memories are then updated. `elapsed` is the time since they were last [s].
    """
    b = _BLOCKS + j * _BLOCK_SIZE
    shape = table[b + _SHAPE]
    count = table[b + _COUNT]
    first = table[b + _FIRST]
    bristles = table[b + _BRISTLES] != 0
    numbers = carray(pointer(table[b + _NUMBERS]), (_DIMENSIONS + 4,))
    memory = carray(pointer(table[b + _MEMORY]), (count * _MEMORY_SIZE,))
    force = _open(table, b + _FORCE, _FORCE_SIZE)
    pose = _open(table, b + _POSE, _POSE_SIZE)
    clock = _open(table, _CLOCK, _CLOCK_SIZE)
    if first >= 0:
        cx, cy, cz = q[first], q[first + 1], q[first + 2]
        ux, uy, uz = v[first], v[first + 1], v[first + 2]
        ax, ay, az, wx, wy, wz = _motion_of_virtual_link(q, v, first)
        if shape != _CYLINDER:
            pose[_TURN + 2], pose[_TURN + 5], pose[_TURN + 8] = ax, ay, az
        if shape == _BLOCK:
            _turn_of_virtual_link(q, first, pose)
    else:
        _pose_of_frames(table, b, v, pose)
        cx, cy, cz = pose[_CENTRE], pose[_CENTRE + 1], pose[_CENTRE + 2]
        ux, uy, uz = pose[_VELOCITY], pose[_VELOCITY + 1], pose[_VELOCITY + 2]
        wx, wy, wz = pose[_OMEGA], pose[_OMEGA + 1], pose[_OMEGA + 2]
        ax, ay, az = pose[_TURN + 2], pose[_TURN + 5], pose[_TURN + 8]
    d0, d1 = numbers[_DIMENSIONS], numbers[_DIMENSIONS + 1]
    d2, d3 = numbers[_DIMENSIONS + 2], numbers[_DIMENSIONS + 3]
    touching = False
    fx = fy = fz = 0.0
    mx = my = mz = 0.0
    if table[b + _FILM_LAW] != 0:
        fx, fy, mx, my, mz, finite = _film(
            table, b, power, commit, cx, cy, ax, ay, az, ux, uy, wx, wy, wz
        )
        touching = True
        if not finite:
            _fail(table, 4, table[_WIDTH] * j)
        if commit:
            force[7], force[8], force[9] = fx, fy, fz
    for k in range(count):
        # Contact point relative to the journal's centre.
        if shape == _CYLINDER:
            gap, rx, ry, rz, nx, ny, nz = touch_cylinder(k, cx, cy, cz, ax, ay, az, d0, d1, d2, d3)
        else:
            gap, rx, ry, rz, nx, ny, nz = touch(
                shape, numbers, _DIMENSIONS, k, cx, cy, cz, pose, _TURN
            )
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
        if gap < numbers[_LIMIT]:
            _fail(table, 3, table[_WIDTH] * j + k)
            continue
        if k < table[b + _MUST_NOT_TOUCH]:
            _fail(table, 5, table[_WIDTH] * j + k)
            continue

        # Velocity of the contact point relative to the bearing.
        slip_x = ux + wy * rz - wz * ry
        slip_y = uy + wz * rx - wx * rz
        slip_z = uz + wx * ry - wy * rx
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
        law = pointer(table[b + _PARAMETERS] + 8 * k * MAX_PARAMETERS)
        normal = call_normal(table[b + _NORMAL_LAW], -gap, rate, approach, law)
        elastic = call_normal(table[b + _NORMAL_LAW], -gap, 0.0, approach, law)
        good = math.isfinite(normal) and math.isfinite(elastic)
        normal = max(normal, 0.0)  # a dry contact never pulls
        if bristles:
            px, py, pz, finite = _bristles(
                table,
                b,
                memory,
                m,
                elapsed,
                commit,
                nx,
                ny,
                nz,
                slip_x,
                slip_y,
                slip_z,
                speed,
                normal,
            )
            good = good and finite
            tangential = math.sqrt(px * px + py * py + pz * pz)
            rubbed = -(px * slip_x + py * slip_y + pz * slip_z)
        else:
            rubbing = pointer(table[b + _NUMBERS] + 8 * _P_FRICTION)
            mu = call_friction(table[b + _FRICTION_LAW], speed, rubbing)
            good = good and 0.0 <= mu < math.inf
            tangential = mu * normal
            scale = -tangential / speed if speed > 0.0 else 0.0
            px, py, pz = scale * slip_x, scale * slip_y, scale * slip_z
            rubbed = tangential * speed
        if not good:
            _fail(table, 4, table[_WIDTH] * j + k)
            continue
        touching = True
        px, py, pz = px + normal * nx, py + normal * ny, pz + normal * nz
        fx += px
        fy += py
        fz += pz
        mx += ry * pz - rz * py
        my += rz * px - rx * pz
        mz += rx * py - ry * px
        power[1] += (normal - elastic) * rate
        power[2] += rubbed
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
            if k < table[b + _WEARING]:
                _count_sliding(table, b, k, -nx, -ny, impulse * speed)

    if touching:
        if first >= 0:
            _push_virtual_link(q, first, tau, fx, fy, fz, mx, my, mz)
        else:
            _push_frames(table, b, tau, pose, fx, fy, fz, mx, my, mz)
    if commit:
        force[0], force[1], force[2] = fx, fy, fz
        square = fx * fx + fy * fy + fz * fz
        if square > force[6]:
            force[3], force[4], force[5], force[6] = fx, fy, fz, square


@_internal
def _count_sliding(table, b, k, x, y, work):
    """Add normal force times sliding distance to the two azimuths beside the direction (x, y)."""
    counted = _open(table, b + _SLIDING_WORK, (k + 1) * AZIMUTHS)
    place = math.atan2(y, x) * (AZIMUTHS / (2.0 * math.pi))
    whole = math.floor(place)
    part = place - whole
    at = int(whole) % AZIMUTHS
    counted[k * AZIMUTHS + at] += (1.0 - part) * work
    counted[k * AZIMUTHS + (at + 1) % AZIMUTHS] += part * work


@_internal
def _end_contact(memory, m):
    """Count a contact that has ended, and how well it was resolved."""
    steps = memory[m + _STEPS]
    memory[m + _STEPS] = 0.0
    memory[m + _BEND_X] = memory[m + _BEND_Y] = memory[m + _BEND_Z] = 0.0
    memory[m + _DWELL] = 0.0
    memory[m + _ENDED] += 1.0
    memory[m + _FASTEST] = max(memory[m + _FASTEST], memory[m + _DDELTA0])
    memory[m + _SHORTEST] = min(memory[m + _SHORTEST], steps)
    if steps < WELL_RESOLVED_STEPS:
        memory[m + _UNDER] += 1.0
        memory[m + _IMPULSE_UNDER] += memory[m + _OWN_IMPULSE]


@_internal
def _prescribe(table, q, v, time):
    """Put prescribed coordinates where they must be, and keep armature x acceleration in drive.

    Cubic Hermite interpolation between the nodes of the reference.
    """
    nv = table[_NV]
    nu = table[_NU]
    rows = _open(table, _COORDINATES, _COORDINATE_ROWS * nv)
    drive = _open(table, _DRIVE, nv)
    h = _open(table, _CLOCK, _CLOCK_SIZE)[_NODE]
    place = time / h
    node = min(int(place), table[_NREF] - 2)
    s = min(place - node, 1.0)
    reference = carray(pointer(table[_REFERENCE] + 8 * 3 * nu * node), (6 * nu,))
    for i in range(nv):
        armature = rows[_ARMATURE * nv + i]
        if armature > 0.0:
            u = int(rows[i])
            q0, v0 = reference[u], h * reference[nu + u]
            rise, v1 = reference[3 * nu + u] - q0, h * reference[4 * nu + u]
            b, c = 3.0 * rise - 2.0 * v0 - v1, v0 + v1 - 2.0 * rise
            q[i] = q0 + s * (v0 + s * (b + s * c))
            v[i] = (v0 + s * (2.0 * b + 3.0 * s * c)) / h
            drive[i] = armature * (2.0 * b + 6.0 * s * c) / (h * h)


@_internal
def _gear(table, g, q, v, tau, power):
    """Add the torque of gear g: none within its play, a spring and a damper beyond."""
    gear = carray(pointer(table[_GEARS] + 8 * g * _GEAR_SIZE), (_GEAR_SIZE,))
    motor, link = int(gear[_MOTOR]), int(gear[_LINK])
    twist = q[motor] - q[link]
    depth = abs(twist) - gear[_HALF_PLAY]
    if depth > 0.0:
        side = math.copysign(1.0, twist)
        rate = side * (v[motor] - v[link])
        elastic = gear[_STIFFNESS] * depth
        torque = max(elastic + gear[_DAMPING] * rate, 0.0)  # teeth never pull
        tau[motor] -= side * torque
        tau[link] += side * torque
        power[4] += (torque - elastic) * rate


@_internal
def _joint_friction(table, f, v, tau, power):
    """Subtract friction f of a joint."""
    row = carray(pointer(table[_FRICTIONS] + 8 * f * _FRICTION_SIZE), (_FRICTION_SIZE,))
    i = int(row[_RUBS])
    ratio = v[i] / row[_STRIBECK]
    dry = row[_COULOMB] + row[_STICTION] * math.exp(-ratio * ratio)
    friction = dry * math.tanh(v[i] / JOINT_FRICTION_SPEED) + row[_VISCOUS] * v[i]
    tau[i] -= friction
    power[3] += friction * v[i]


@_internal
def _load(table, q, v, time, commit):
    """Generalised forces tau and powers at state (q, v): drive, friction, gears, contact."""
    nv = table[_NV]
    nu = table[_NU]
    tau = _open(table, _TAU, nv)
    drive = _open(table, _DRIVE, nv)
    rows = _open(table, _COORDINATES, _COORDINATE_ROWS * nv)
    power = carray(pointer(table[_POWER] + 8 * 2 * _NP), (_NP,))

    place = time / _open(table, _CLOCK, _CLOCK_SIZE)[_NODE]
    node = min(int(place), table[_NREF] - 2)
    part = min(place - node, 1.0)
    reference = carray(pointer(table[_REFERENCE] + 8 * 3 * nu * node), (6 * nu,))
    for i in range(_NP):
        power[i] = 0.0
    size = 0.0
    for i in range(nv):
        size += abs(v[i])
        u = int(rows[i])
        effort = 0.0
        if u >= 0 and rows[_ARMATURE * nv + i] > 0.0:
            effort = drive[i]  # of `_prescribe`; its power is known when the acceleration is
        elif u >= 0:
            position = reference[u] + part * (reference[3 * nu + u] - reference[u])
            u += nu
            speed = reference[u] + part * (reference[3 * nu + u] - reference[u])
            u += nu
            forward = reference[u] + part * (reference[3 * nu + u] - reference[u])
            seen = int(rows[_MEASURED * nv + i])
            effort = (
                forward
                + rows[_KP * nv + i] * (position - q[seen])
                + rows[_KD * nv + i] * (speed - v[seen])
            )
            power[0] += effort * v[i]
        drive[i] = effort
        tau[i] = effort
    for f in range(table[_NF]):
        _joint_friction(table, f, v, tau, power)
    for g in range(table[_NG]):
        _gear(table, g, q, v, tau, power)
    if not size < SPEED_LIMIT:  # true for NaN as well
        _fail(table, 2, 0)
    clock = _open(table, _CLOCK, _CLOCK_SIZE)
    elapsed = time - clock[_TIME]
    if commit and table[_STEP] > 0:
        elapsed = clock[_DT]
    for j in range(table[_NJ]):
        _contact(table, j, q, v, tau, power, commit, elapsed)


@_internal
def _settle(table):
    """Complete what could not be known before the acceleration was.

    That is the effort of prescribed motion, and with it the work of the last step by the
    trapezoidal rule, if that is pending.
    """
    nv = table[_NV]
    power = _open(table, _POWER, 3 * _NP)
    if table[_HAS_PRESCRIBED] != 0:
        rows = _open(table, _COORDINATES, _COORDINATE_ROWS * nv)
        drive = _open(table, _DRIVE, nv)
        v = _open(table, _V, nv)
        a = _open(table, _A, nv)
        for i in range(nv):
            armature = rows[_ARMATURE * nv + i]
            if armature > 0.0:
                drive[i] -= armature * a[i]
                power[2 * _NP] += drive[i] * v[i]
    if table[_PENDING] != 0:
        dt = _open(table, _CLOCK, _CLOCK_SIZE)[_DT]
        for i in range(_NP):
            power[i] += 0.5 * dt * (power[_NP + i] + power[2 * _NP + i])
    for i in range(_NP):
        power[_NP + i] = power[2 * _NP + i]
    table[_PENDING] = 0


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
    row[0] = _open(table, _CLOCK, _CLOCK_SIZE)[_TIME]
    for i in range(nv):
        row[1 + i] = q[i]
        row[1 + nv + i] = v[i]
        row[1 + 2 * nv + i] = drive[i]
    at = 1 + 3 * nv
    for i in range(_NP):
        row[at + i] = power[i]
    at += _NP
    width = table[_WIDTH]
    contacts = at + 9 * nj
    for j in range(nj):
        b = _BLOCKS + j * _BLOCK_SIZE
        force = _open(table, b + _FORCE, _FORCE_SIZE)
        for i in range(3):
            row[at + 3 * j + i] = force[i]
            row[at + 3 * nj + 3 * j + i] = force[3 + i]
            row[at + 6 * nj + 3 * j + i] = force[7 + i]
        force[6] = 0.0
        for i in range(3):
            force[3 + i] = 0.0
        memory = carray(pointer(table[b + _MEMORY]), (width * _MEMORY_SIZE,))
        for k in range(width):
            m = k * _MEMORY_SIZE
            c = contacts + j * width + k
            row[c] = memory[m + _NORMAL]
            row[c + width * nj] = memory[m + _TANGENTIAL]
            row[c + 2 * width * nj] = memory[m + _NORMAL_PEAK]
            row[c + 3 * width * nj] = memory[m + _GAP_MIN]
            memory[m + _NORMAL_PEAK] = 0.0
            memory[m + _GAP_MIN] = np.inf
    table[_ROW] += 1


@_internal
def _evaluate(table, q, v, time, commit):
    """Prepare the evaluation of the acceleration at state (q, v), or leave that to `load`."""
    if table[_HAS_PRESCRIBED] != 0:
        _prescribe(table, q, v, time)
    if table[_FRAMES] != 0:
        _open(table, _CLOCK, _CLOCK_SIZE)[_LOAD_TIME] = time
        table[_COMMIT] = 1 if commit else 0
    else:
        _load(table, q, v, time, commit)


@njit(cache=True, error_model="numpy")
def load(table) -> int:
    """Forces at the state that `begin` or an integrator prepared, frames and Jacobians given.

    Between their call and this one belongs `pin.computeJointJacobians`; `pin.aba` must follow.
    Returns the status.
    """
    nv = table[_NV]
    time = _open(table, _CLOCK, _CLOCK_SIZE)[_LOAD_TIME]
    _load(table, _open(table, _Q, nv), _open(table, _V, nv), time, table[_COMMIT] != 0)
    return table[_STATUS]


@njit(cache=True, error_model="numpy")
def begin(table) -> int:
    """Forces at the current state; `pin.aba` must follow. Returns the status."""
    nv = table[_NV]
    now = _open(table, _CLOCK, _CLOCK_SIZE)[_TIME]
    _evaluate(table, _open(table, _Q, nv), _open(table, _V, nv), now, True)
    return table[_STATUS]


@njit(cache=True, error_model="numpy")
def settle(table) -> int:
    """Complete the work of the last step before something changes the state; returns the status."""
    _settle(table)
    return table[_STATUS]


@njit(cache=True, error_model="numpy")
def refresh(table) -> int:
    """Forces at a state that something has changed; like `begin`, but no step of the contacts."""
    nv = table[_NV]
    now = _open(table, _CLOCK, _CLOCK_SIZE)[_TIME]
    _evaluate(table, _open(table, _Q, nv), _open(table, _V, nv), now, False)
    return table[_STATUS]


@njit(cache=True, error_model="numpy")
def record(table) -> int:
    """Record the current state, its acceleration known. Returns the status."""
    _settle(table)
    _record(table)
    return table[_STATUS]


@_internal
def _advance_clock(table):
    clock = _open(table, _CLOCK, _CLOCK_SIZE)
    table[_STEP] += 1
    clock[_TIME] = table[_STEP] * clock[_DT]
    return clock[_TIME]


@njit(cache=True, error_model="numpy")
def semi_implicit_euler(table) -> int:
    """Step by v += a dt, q += v dt (first order); `pin.aba` must follow.

    Returns the status.
    """
    nv = table[_NV]
    q = _open(table, _Q, nv)
    v = _open(table, _V, nv)
    a = _open(table, _A, nv)
    dt = _open(table, _CLOCK, _CLOCK_SIZE)[_DT]
    _settle(table)
    if table[_STEP] % table[_EVERY] == 0:
        _record(table)
    for i in range(nv):
        v[i] += dt * a[i]
        q[i] += dt * v[i]
    table[_PENDING] = 1
    _evaluate(table, q, v, _advance_clock(table), True)
    return table[_STATUS]


@njit(cache=True, error_model="numpy")
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
    _settle(table)
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
        _evaluate(table, q, v, clock[_TIME] + ahead, False)
        return table[_STATUS]
    table[_STAGE] = 0
    for i in range(_NP):
        power[i] += scratch[4 * nv + i]
    _evaluate(table, q, v, _advance_clock(table), True)
    return table[_STATUS]
