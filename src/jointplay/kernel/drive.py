"""What acts on single coordinates: drives, joint friction, gears with play."""

from __future__ import annotations

import math

from jointplay.core.compiler import internal
from jointplay.kernel.access import drives, floats, frictions, gears, integers, matrix
from jointplay.kernel.layout import DRIVE, GEAR, JOINT_FRICTION
from jointplay.kernel.words import JOINT_FRICTION_SPEED


@internal
def _reference(run, time):
    """Rows of the reference (2, 3, nu) around a time, and how far between them it is (0 to 1)."""
    place = time / run.reference_interval
    node = min(int(place), run.nref - 2)
    rows = floats(run.reference + 8 * 3 * run.nu * node, 6 * run.nu)
    return rows, min(place - node, 1.0)


@internal
def prescribe(run, q, v, time):
    """Put prescribed coordinates where they must be, and keep armature x acceleration in drive.

    Cubic Hermite interpolation between the nodes of the reference.
    """
    rows, s = _reference(run, time)
    nu, h = run.nu, run.reference_interval
    effort = floats(run.drive, run.nv)
    for drive in drives(run):
        if drive.armature <= 0.0:
            continue
        i, u = drive.coordinate, drive.column
        q0, v0 = rows[u], h * rows[nu + u]
        rise, v1 = rows[3 * nu + u] - q0, h * rows[4 * nu + u]
        b, c = 3.0 * rise - 2.0 * v0 - v1, v0 + v1 - 2.0 * rise
        q[i] = q0 + s * (v0 + s * (b + s * c))
        v[i] = (v0 + s * (2.0 * b + 3.0 * s * c)) / h
        effort[i] = drive.armature * (2.0 * b + 6.0 * s * c) / (h * h)


@internal
def drive(run, q, v, time, tau):
    """Write the drives' efforts at state (q, v) into `drive` and add them to tau."""
    rows, part = _reference(run, time)
    nu = run.nu
    effort = floats(run.drive, run.nv)
    for one in drives(run):
        i = one.coordinate
        if one.armature <= 0.0:  # prescribed: `prescribe` has written it
            u = one.column
            position = rows[u] + part * (rows[3 * nu + u] - rows[u])
            u += nu
            speed = rows[u] + part * (rows[3 * nu + u] - rows[u])
            u += nu
            forward = rows[u] + part * (rows[3 * nu + u] - rows[u])
            seen = one.seen
            effort[i] = forward + one.kp * (position - q[seen]) + one.kd * (speed - v[seen])
            if abs(effort[i]) > one.limit:
                effort[i] = math.copysign(one.limit, effort[i])
        tau[i] += effort[i]


@internal
def work_of_drives(run, v):
    """Add the power of the drives whose effort is known to the powers."""
    effort = floats(run.drive, run.nv)
    for one in drives(run):
        if one.armature <= 0.0:
            run.power[DRIVE] += effort[one.coordinate] * v[one.coordinate]


@internal
def work_of_prescribed(run, v, a):
    """Complete the effort of prescribed motion, the acceleration known, and add its power."""
    effort = floats(run.drive, run.nv)
    for one in drives(run):
        if one.armature > 0.0:
            i = one.coordinate
            effort[i] -= one.armature * a[i]
            run.power[DRIVE] += effort[i] * v[i]


@internal
def _joint_friction(row, speed):
    """Friction at a speed, and its slope."""
    ratio = speed / row.stribeck
    excess = row.stiction * math.exp(-ratio * ratio)
    turn = math.tanh(speed / JOINT_FRICTION_SPEED)
    rise = (1.0 - turn * turn) / JOINT_FRICTION_SPEED
    dry = row.coulomb + excess
    slope = dry * rise - 2.0 * ratio / row.stribeck * excess * turn + row.viscous
    return dry * turn + row.viscous * speed, slope


@internal
def apply_joint_friction(run, v, tau):
    """Subtract the joints' own friction from tau."""
    for row in frictions(run):
        i = row.coordinate
        friction, _ = _joint_friction(row, v[i])
        tau[i] -= friction


@internal
def _torque(gear, q, v):
    """Torque that a gear passes, the part of it that is elastic, its side, and the teeth's rate."""
    twist = q[gear.motor] - q[gear.link]
    depth = abs(twist) - gear.half_play
    if depth <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    side = math.copysign(1.0, twist)
    rate = side * (v[gear.motor] - v[gear.link])
    elastic = gear.stiffness * depth
    return max(elastic + gear.damping * rate, 0.0), elastic, side, rate  # teeth never pull


@internal
def turn_gears(run, q, v, tau):
    """Add the torque of all gears: none within their play, a spring and a damper beyond."""
    for gear in gears(run):
        torque, _, side, _ = _torque(gear, q, v)
        tau[gear.motor] -= side * torque
        tau[gear.link] += side * torque


@internal
def steepen_joints(run, q, v):
    """Add how joint friction and gears change with the velocity to the run's slope."""
    slope, place = matrix(run.slope, run.active, run.active), integers(run.place, run.nv)
    for row in frictions(run):
        i = place[row.coordinate]
        _, rise = _joint_friction(row, v[row.coordinate])
        slope[i, i] -= rise
    for gear in gears(run):
        torque, _, _, _ = _torque(gear, q, v)
        if torque > 0.0:
            m, k = place[gear.motor], place[gear.link]
            slope[m, m] -= gear.damping
            slope[k, k] -= gear.damping
            slope[m, k] += gear.damping
            slope[k, m] += gear.damping


@internal
def lose_in_joints(run, q, v):
    """Add what joint friction and gears lose at state (q, v) to the powers."""
    for row in frictions(run):
        friction, _ = _joint_friction(row, v[row.coordinate])
        run.power[JOINT_FRICTION] += friction * v[row.coordinate]
    for gear in gears(run):
        torque, elastic, _, rate = _torque(gear, q, v)
        run.power[GEAR] += (torque - elastic) * rate
