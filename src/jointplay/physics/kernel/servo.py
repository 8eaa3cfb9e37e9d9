"""Servos: a motor at a voltage that a position controller sets.

The voltage is a gain times what the error of the encoder's reading exceeds a dead band by, one
times the integral of that, itself cut to the supply's voltage, and one times the error of the
speed, which may be found from readings a period apart; it is cut to the supply's. The motor's
effort is

    tau = k/R (V - k v)

with its torque constant k and resistance R; -k^2/R v is the row of `drive` that each servo has
besides. With a sampling period the voltage is held from one sample to the next; at the time of a
sample the mean acts, for that stands for half of the step before and half of the next. Without one
the integral goes on by the trapezoidal rule from the last state of the trajectory.

Compiled apart as `servos`, for runs that have some; what others call calls it.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import carray, compiled
from jointplay.physics.kernel.access import carry_out, run_at
from jointplay.physics.kernel.drive import between_rows, reference_rows

ROUNDING = 1e-9
"""Part of a period by which a sample may come early."""


@compiled
def _cut(servo, voltage):
    return min(max(voltage, -servo.voltage), servo.voltage)


@compiled
def _voltage(servo, position, speed, q, v, time):
    """What the controller asks for at a state, and its integral there."""
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
    servo.integral = _cut(servo, servo.integral_before + servo.i_gain * gained)
    measured = v[servo.encoder]
    if servo.differences != 0:
        measured = (read - servo.reading_before) / servo.period if time > 0.0 else 0.0
    asked = servo.p_gain * servo.error + servo.integral
    asked += servo.d_gain * (speed - measured)
    return _cut(servo, asked)


@compiled
def _commit_servo(servo, time):
    servo.integral_before, servo.error_before = servo.integral, servo.error
    servo.reading_before, servo.integrated_until = servo.reading, time


@compiled
def _commit_servos(run):
    """See `commit_servos`."""
    for servo in run.servos:
        if servo.period == 0.0:
            _commit_servo(servo, run.time)


@compiled
def _apply_servos(run, q, v, time, tau):
    """See `apply_servos`."""
    before, after, part = reference_rows(run, time)
    effort = run.drive
    for servo in run.servos:
        position = between_rows(before, after, part, 0, servo.column)
        speed = between_rows(before, after, part, 1, servo.column)
        if servo.period > 0.0:
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
        whole = effort[i] + push
        if abs(whole) > servo.limit:
            push = math.copysign(servo.limit, whole) - effort[i]
        effort[i] += push
        tau[i] += push


_COMMIT, _APPLY = range(2)


@compiled
def servos(run, one, other, third, number, what):
    """Do one of the following (`access.RUN_PART`)."""
    own = run_at(run)
    nv = own.nv
    if what == _COMMIT:
        _commit_servos(own)
    else:
        q, v, tau = carray(one, (nv,)), carray(other, (nv,)), carray(third, (nv,))
        _apply_servos(own, q, v, number, tau)


@compiled
def commit_servos(run):
    """Accept the state of continuous servos as one of the trajectory."""
    if run.ns > 0:
        carry_out(run.servo_part, run, run.q, run.q, run.q, 0.0, _COMMIT)


@compiled
def apply_servos(run, q, v, time, tau):
    """Add what the voltages push to the drives' efforts and to tau; after `apply_drives`."""
    if run.ns > 0:
        carry_out(run.servo_part, run, q, v, tau, time, _APPLY)
