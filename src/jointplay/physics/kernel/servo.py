"""Servos: a motor at a voltage that a position controller sets.

The voltage is a gain times what the error of the encoder's reading exceeds a dead band by, and one
times the error of the speed, cut to the supply's. The motor's effort is

    tau = k/R (V - k v)

with its torque constant k and resistance R; -k^2/R v is the row of `drive` that each servo has
besides. With a sampling period the voltage is held from one sample to the next; at the time of a
sample the mean acts, for that stands for half of the step before and half of the next.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import compiled
from jointplay.physics.kernel.drive import between_rows, reference_rows

ROUNDING = 1e-9
"""Part of a period by which a sample may come early."""


@compiled
def _voltage(servo, position, speed, q, v):
    """What the controller asks for at a state."""
    read = q[servo.encoder]
    if servo.resolution > 0.0:
        read = servo.resolution * math.floor(read / servo.resolution + 0.5)
    error = position - read
    beyond = max(abs(error) - servo.dead_band, 0.0)
    asked = servo.p_gain * math.copysign(beyond, error)
    asked += servo.d_gain * (speed - v[servo.encoder])
    return min(max(asked, -servo.voltage), servo.voltage)


@compiled
def apply_servos(run, q, v, time, tau):
    """Add what the voltages push to the drives' efforts and to tau; after `apply_drives`."""
    before, after, part = reference_rows(run, time)
    effort = run.drive
    for servo in run.servos:
        position = between_rows(before, after, part, 0, servo.column)
        speed = between_rows(before, after, part, 1, servo.column)
        if servo.period > 0.0:
            if time >= servo.next_sample - ROUNDING * servo.period:
                servo.held_before = servo.held
                servo.sampled_at = time
                servo.next_sample += servo.period
            if abs(time - servo.sampled_at) <= ROUNDING * servo.period:
                servo.held = _voltage(servo, position, speed, q, v)
                if time == 0.0:
                    servo.held_before = servo.held
                asked = 0.5 * (servo.held_before + servo.held)
            else:
                asked = servo.held
        else:
            asked = _voltage(servo, position, speed, q, v)
        i = servo.coordinate
        push = servo.stall * asked
        whole = effort[i] + push
        if abs(whole) > servo.limit:
            push = math.copysign(servo.limit, whole) - effort[i]
        effort[i] += push
        tau[i] += push
