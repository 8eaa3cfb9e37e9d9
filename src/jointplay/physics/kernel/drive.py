"""Forces on single coordinates: drives, friction of joints, and servos.

A drive is a feedback of position and speed with a feed-forward effort, or prescribes the motion.
A servo adds a voltage-driven motor behind a PID position controller.

Bristles of joint friction are those of `contact.bristle` in one dimension: deflected by the motion
of the joint, released at the rate |v| over the deflection at which they slide, and kept half a step
ahead.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import carray, compiled
from jointplay.physics.kernel.access import run_at, run_part
from jointplay.physics.kernel.constants import JOINT_FRICTION_SPEED
from jointplay.physics.kernel.layout import DRIVE, JOINT_FRICTION

_DIFFERENCE = 1e-5
"""Relative step in speed of the difference quotient that differentiates bristle friction."""
_LEAST_DIFFERENCE = 1e-9
"""Least such step [rad/s or m/s]."""


@compiled
def reference_rows(run, time):
    """Nodes of the reference (3, nu) before and after a time, and the fraction in between."""
    place = time / run.reference_interval
    node = min(int(place), run.nref - 2)
    return run.reference[node], run.reference[node + 1], min(place - node, 1.0)


@compiled
def between_rows(before, after, part, kind, column):
    """Interpolate position (kind 0), speed (1) or effort (2) of a column between two nodes."""
    return before[kind, column] + part * (after[kind, column] - before[kind, column])


@compiled
def prescribe_motion(run, q, v, time):
    """Set prescribed coordinates to the reference, by cubic Hermite interpolation of its nodes.

    Armature times the acceleration is kept in `run.drive`: the effort if nothing else acted.
    """
    before, after, s = reference_rows(run, time)
    h = run.reference_interval
    effort = run.drive
    for row in run.drives:
        if row.armature <= 0.0:
            continue
        i, u = row.coordinate, row.column
        q0, v0 = before[0, u], h * before[1, u]
        rise, v1 = after[0, u] - q0, h * after[1, u]
        b, c = 3.0 * rise - 2.0 * v0 - v1, v0 + v1 - 2.0 * rise
        q[i] = q0 + s * (v0 + s * (b + s * c))
        v[i] = (v0 + s * (2.0 * b + 3.0 * s * c)) / h
        effort[i] = row.armature * (2.0 * b + 6.0 * s * c) / (h * h)


@compiled
def apply_drives(run, q, v, time, tau):
    """Write the drives' efforts at state (q, v) into `run.drive` and add them to tau."""
    before, after, part = reference_rows(run, time)
    effort = run.drive
    for row in run.drives:
        i = row.coordinate
        if row.armature <= 0.0:  # prescribed: `prescribe_motion` has written it
            position = between_rows(before, after, part, 0, row.column)
            speed = between_rows(before, after, part, 1, row.column)
            forward = between_rows(before, after, part, 2, row.column)
            encoder = row.encoder
            row.taken_at = v[encoder]
            effort[i] = forward + row.kp * (position - q[encoder]) + row.kd * (speed - v[encoder])
            # A pure damper is the back-EMF of a servo: `apply_servos` limits their sum.
            if abs(effort[i]) > row.limit and (row.kp != 0.0 or row.kd == 0.0):
                effort[i] = math.copysign(row.limit, effort[i])
        tau[i] += effort[i]


@compiled
def apply_drive_damping(run, v, tau):
    """Correct the damping of implicit drives from the extrapolated speeds to the speeds v.

    Implicit, for damping chosen for an arm is stiff where play separates arm and drive: a journal
    in flight has only its own inertia to oppose.
    """
    effort = run.drive
    for row in run.drives:
        if row.implicit != 0 and abs(effort[row.coordinate]) < row.limit:
            tau[row.coordinate] -= row.kd * (v[row.encoder] - row.taken_at)


@compiled
def complete_drives(run, v):
    """Move that correction from `velocity_forces` to the drives' efforts, once v is found."""
    effort, forces = run.drive, run.velocity_forces
    for row in run.drives:
        i = row.coordinate
        if row.implicit != 0 and abs(effort[i]) < row.limit:
            change = row.kd * (v[row.encoder] - row.taken_at)
            effort[i] -= change
            forces[i] += change
            row.taken_at = v[row.encoder]


@compiled
def add_drive_power(run, v):
    """Add the power of all drives but those of prescribed motion to the powers."""
    effort = run.drive
    for row in run.drives:
        if row.armature <= 0.0:
            run.power[DRIVE] += effort[row.coordinate] * v[row.coordinate]


@compiled
def add_prescribed_power(run, v, a):
    """Complete the effort of prescribed motion from the acceleration a, and add its power."""
    effort = run.drive
    for row in run.drives:
        if row.armature > 0.0:
            i = row.coordinate
            effort[i] -= row.armature * a[i]
            run.power[DRIVE] += effort[i] * v[i]


@compiled
def _advance_bristles(row, bend, speed, elapsed):
    """Deflection of bristles after `elapsed` [s], exact for constant speed, and their limit.

    The limit, at which they slide, is the presliding deflection times the Stribeck curve.
    """
    ratio = speed / row.stribeck
    dry = row.coulomb + row.stiction * math.exp(-ratio * ratio)
    part = max(dry / (row.coulomb + row.stiction), _LEAST_DIFFERENCE)
    most = math.copysign(row.presliding * part, speed)
    return most + (bend - most) * math.exp(-speed * elapsed / most), most


@compiled
def _bristle_friction(row, speed, elapsed):
    """Friction with bristles at a speed: k z + d dz/dt, and viscous."""
    bend, most = _advance_bristles(row, row.kept_bend, speed, elapsed)
    row.bend = bend
    stiffness = (row.coulomb + row.stiction) / row.presliding
    row.torque = stiffness * bend + row.damping * speed * (1.0 - bend / most) + row.viscous * speed
    return row.torque


@compiled
def _joint_friction(row, speed, elapsed):
    """Friction at a speed and its derivative; bristles have bent for `elapsed` [s] since kept.

    Without bristles: Coulomb and Stribeck friction, their sign smoothed, and viscous.
    """
    if row.presliding > 0.0:
        more = abs(speed) * _DIFFERENCE + _LEAST_DIFFERENCE
        further = _bristle_friction(row, speed + more, elapsed)
        friction = _bristle_friction(row, speed, elapsed)  # last: `bend` and `torque` are these
        return friction, (further - friction) / more
    ratio = speed / row.stribeck
    excess = row.stiction * math.exp(-ratio * ratio)
    turn = math.tanh(speed / JOINT_FRICTION_SPEED)
    rise = (1.0 - turn * turn) / JOINT_FRICTION_SPEED
    dry = row.coulomb + excess
    slope = dry * rise - 2.0 * ratio / row.stribeck * excess * turn + row.viscous
    return dry * turn + row.viscous * speed, slope


@compiled
def apply_joint_friction(run, v, time, tau):
    """Subtract the joints' own friction from tau."""
    elapsed = max(time - run.bent_at, 0.0)
    for row in run.frictions:
        i = row.coordinate
        friction, _ = _joint_friction(row, v[i], elapsed)
        tau[i] -= friction


@compiled
def commit_bristles(run, v, ahead):
    """Accept the bristles of joint friction, and keep them as they will be `ahead` [s] later."""
    for row in run.frictions:
        if row.presliding > 0.0:
            row.kept_bend, _ = _advance_bristles(row, row.bend, v[row.coordinate], ahead)


@compiled
def add_joint_slopes(run, v):
    """Add the velocity derivatives of joint friction and implicit drives to d(tau_c)/dv."""
    slope, place = run.slope, run.place
    effort = run.drive
    for drive in run.drives:
        if drive.implicit != 0 and abs(effort[drive.coordinate]) < drive.limit:
            slope[place[drive.coordinate], place[drive.encoder]] -= drive.kd
    for row in run.frictions:
        i = place[row.coordinate]
        _, rise = _joint_friction(row, v[row.coordinate], max(run.time - run.bent_at, 0.0))
        slope[i, i] -= rise


@compiled
def add_joint_losses(run, v):
    """Add the power that joint friction takes at velocities v, including what bristles store."""
    for row in run.frictions:
        friction = row.torque
        if not row.presliding > 0.0:
            friction, _ = _joint_friction(row, v[row.coordinate], 0.0)
        run.power[JOINT_FRICTION] += friction * v[row.coordinate]


# Servos: a motor at the voltage that a position controller asks for. The P, I and D terms act on
# the encoder's reading, rounded to its resolution, and on the error beyond a dead band. With a
# sampling period the voltage is held between samples; else the controller is continuous, and its
# integral goes by the trapezoidal rule.

ROUNDING = 1e-9
"""Part of a period by which a sample may come early."""


@compiled
def _saturated(servo, voltage):
    """Voltage limited to what the servo has."""
    return min(max(voltage, -servo.voltage), servo.voltage)


@compiled
def _voltage(servo, position, speed, q, v, time):
    """Voltage that the controller asks for at a state; reading, error and integral are kept."""
    read = q[servo.encoder]
    if servo.resolution > 0.0:
        read = servo.resolution * math.floor(read / servo.resolution + 0.5)
    error = position - read
    servo.reading = read
    servo.error = math.copysign(max(abs(error) - servo.dead_band, 0.0), error)
    if servo.period > 0.0:
        gained = servo.period * servo.error
    else:
        gained = 0.5 * (time - servo.integrated_until) * (servo.error_before + servo.error)
    servo.integral = _saturated(servo, servo.integral_before + servo.i_gain * gained)
    measured = v[servo.encoder]
    if servo.differences != 0:
        measured = (read - servo.reading_before) / servo.period if time > 0.0 else 0.0
    asked = servo.p_gain * servo.error + servo.integral
    asked += servo.d_gain * (speed - measured)
    return _saturated(servo, asked)


@compiled
def _commit_servo(servo, time):
    """Keep the controller's state at a time, for the next state or sample to go on from."""
    servo.integral_before, servo.error_before = servo.integral, servo.error
    servo.reading_before, servo.integrated_until = servo.reading, time


@compiled
def _apply_servos(run, q, v, time, tau):
    """See `apply_servos`."""
    before, after, part = reference_rows(run, time)
    effort = run.drive
    for servo in run.servos:
        position = between_rows(before, after, part, 0, servo.column)
        speed = between_rows(before, after, part, 1, servo.column)
        if servo.period > 0.0:
            # At a sample the voltage jumps. The state there stands for half a step on either side,
            # and gets the mean.
            if time >= servo.next_sample - ROUNDING * servo.period:
                servo.held_before = servo.held
                _commit_servo(servo, servo.sampled_at)
                servo.sampled_at = time
                servo.next_sample += servo.period
            if abs(time - servo.sampled_at) <= ROUNDING * servo.period:
                servo.held = _voltage(servo, position, speed, q, v, time)
                if time == 0.0:
                    servo.held_before = servo.held
                asked = 0.5 * (servo.held_before + servo.held)
            else:
                asked = servo.held
        else:
            asked = _voltage(servo, position, speed, q, v, time)
        i = servo.coordinate
        push = servo.stall * asked
        total = effort[i] + push
        if abs(total) > servo.limit:
            push = math.copysign(servo.limit, total) - effort[i]
        effort[i] += push
        tau[i] += push


_COMMIT, _APPLY = range(2)


@compiled
def servos(address, q, v, tau, time, task):
    """Carry out one of the tasks above (`access.RUN_PART`)."""
    run = run_at(address)
    nv = run.nv
    if task == _COMMIT:
        for servo in run.servos:
            if servo.period == 0.0:
                _commit_servo(servo, run.time)
    else:
        _apply_servos(run, carray(q, (nv,)), carray(v, (nv,)), time, carray(tau, (nv,)))


@compiled
def commit_servos(run):
    """Accept the state of continuous servos as one of the trajectory."""
    if run.ns > 0:
        run_part(run.servo_part, run, run.q, run.q, run.q, 0.0, _COMMIT)


@compiled
def apply_servos(run, q, v, time, tau):
    """Add the torques of the servos' voltages to the efforts and to tau; after `apply_drives`."""
    if run.ns > 0:
        run_part(run.servo_part, run, q, v, tau, time, _APPLY)
