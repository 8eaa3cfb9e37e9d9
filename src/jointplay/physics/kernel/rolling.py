"""Joints with one law for all their contacts: rolling bearings, springs, seats.

`find_elements` evaluates the law (`contact.rolling`, `contact.elastic`) once a pose: elastic wrench
and stiffness. At a twist, damping in proportion to that stiffness and the friction torque about the
axis then follow at little cost. The element that bears most is recorded as the joint's contact.

Compiled apart as `elements`, for joints that have some; the functions without underscore call it.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import address_of, compiled, place_of, pointer
from jointplay.physics.contact.calls import call_elements
from jointplay.physics.contact.resultant import (
    ACROSS,
    ALONG,
    BOUNDED,
    CAGE,
    COSINE,
    DAMPING,
    DEEPEST,
    DRAG,
    FORCES,
    FRICTION,
    LARGEST,
    PLACE,
    RADIUS,
    RATIO,
    SINE,
    SUM,
    TANGENT,
)
from jointplay.physics.kernel.access import call_part, joint_at, record_failure, run_at
from jointplay.physics.kernel.constants import JOINT_FRICTION_SPEED, Status
from jointplay.physics.kernel.frames import find_twist, set_vector
from jointplay.physics.kernel.layout import FRICTION as FRICTION_POWER
from jointplay.physics.kernel.layout import NORMAL

_BROKE_OUT, _BAD_FORCE = int(Status.BROKE_OUT), int(Status.BAD_FORCE)


@compiled
def _evaluate(joint, mode):
    """Evaluate the joint's law at its pose; returns the results (`contact.resultant`)."""
    numbers, out = pointer(joint.dimensions), pointer(joint.elements)
    numbers[CAGE] = joint.cage
    call_elements(joint.element_law, (numbers, address_of(joint.pose), out, mode))
    return out


@compiled
def _find(run, j, joint):
    """See `find_elements`."""
    out = _evaluate(joint, BOUNDED)
    contact = run.contacts[j, 0]
    contact.gap = -out[DEEPEST]
    contact.touching = 0
    if contact.gap >= 0.0:
        return False
    if contact.gap < joint.limit:
        record_failure(run, _BROKE_OUT, run.width * j)
        return False
    if not math.isfinite(out[SUM]):
        record_failure(run, _BAD_FORCE, run.width * j)
        return False
    contact.touching = 1
    contact.elastic = contact.normal_now = out[LARGEST]
    c, s, up = out[COSINE], out[SINE], out[ALONG]
    radius, place = pointer(joint.dimensions)[RADIUS], out[PLACE]
    set_vector(contact.direction, 0, (-out[ACROSS] * c, -out[ACROSS] * s, -up))
    set_vector(contact.arm, 0, (radius * c, radius * s, place))
    return True


@compiled
def _spin(joint):
    """Speed about the ring's own axis [rad/s], and that axis."""
    axis = (joint.pose[5], joint.pose[8], joint.pose[11])
    twist = joint.twist
    return axis[0] * twist[3] + axis[1] * twist[4] + axis[2] * twist[5], axis


@compiled
def _friction_torque(joint, spin):
    """Friction torque at the ring's speed of rotation, and its derivative."""
    numbers, out = pointer(joint.dimensions), pointer(joint.elements)
    most = numbers[DRAG] + numbers[FRICTION] * out[SUM]
    turn = math.tanh(spin / JOINT_FRICTION_SPEED)
    return most * turn, most * (1.0 - turn * turn) / JOINT_FRICTION_SPEED


@compiled
def _add_forces(run, j, joint):
    """See `add_element_forces`."""
    wrench, twist, out = joint.wrench, joint.twist, pointer(joint.elements)
    contact = run.contacts[j, 0]
    if contact.touching != 0:
        damping = pointer(joint.dimensions)[DAMPING]
        for r in range(6):
            force = 0.0
            for c in range(6):
                force += out[TANGENT + 6 * r + c] * twist[c]
            wrench[r] += out[r] - damping * force
        rate = 0.0
        for k in range(3):
            rate -= contact.direction[k] * twist[k]
        contact.rate, contact.speed = rate, 0.0
        contact.approach = contact.reference = abs(rate)
        contact.tangential_now = contact.friction_power = 0.0
    spin, axis = _spin(joint)
    torque, _ = _friction_torque(joint, spin)
    for k in range(3):
        wrench[3 + k] -= torque * axis[k]


@compiled
def _add_slope(joint):
    """See `add_element_slope`."""
    slope, out = joint.wrench_slope, pointer(joint.elements)
    damping = pointer(joint.dimensions)[DAMPING]
    for r in range(6):
        for c in range(6):
            slope[r, c] -= damping * out[TANGENT + 6 * r + c]
    spin, axis = _spin(joint)
    _, rise = _friction_torque(joint, spin)
    for r in range(3):
        for c in range(3):
            slope[3 + r, 3 + c] -= rise * axis[r] * axis[c]


@compiled
def _add_losses(run, joint):
    """See `add_element_losses`."""
    twist, out = joint.twist, pointer(joint.elements)
    damping = pointer(joint.dimensions)[DAMPING]
    lost = 0.0
    for r in range(6):
        for c in range(6):
            lost += twist[r] * out[TANGENT + 6 * r + c] * twist[c]
    spin, _ = _spin(joint)
    torque, _ = _friction_torque(joint, spin)
    run.power[NORMAL] += damping * lost
    run.power[FRICTION_POWER] += torque * spin


@compiled
def _frequency(run, joint):
    """See `element_frequency`."""
    minv, out = run.minv, pointer(joint.elements)
    total = 0.0
    if joint.first < 0:
        n = joint.nsupport
        jacobian, support = joint.jacobian, joint.support
        for k in range(n):
            for m in range(n):
                bend = 0.0
                for r in range(6):
                    for c in range(6):
                        bend += jacobian[r, k] * out[TANGENT + 6 * r + c] * jacobian[c, m]
                total += bend * minv[support[k], support[m]]
        return total
    # Columns of the virtual link's rotations: e_z, (-sy, cy, 0) and (cy cp, sy cp, -sp).
    sy, cy, sp, cp = joint.sines[0], joint.sines[1], joint.sines[2], joint.sines[3]
    turns = ((0.0, 0.0, 1.0), (-sy, cy, 0.0), (cy * cp, sy * cp, -sp))
    at = joint.first
    for r in range(3):
        for c in range(3):
            total += out[TANGENT + 6 * r + c] * minv[at + r, at + c]
            mixed = turned = 0.0
            for a in range(3):
                mixed += out[TANGENT + 6 * r + 3 + a] * turns[c][a]
                for b in range(3):
                    turned += turns[r][a] * out[TANGENT + 6 * (3 + a) + 3 + b] * turns[c][b]
            total += 2.0 * mixed * minv[at + r, at + 3 + c]
            total += turned * minv[at + 3 + r, at + 3 + c]
    return total


_GAP, _FIND, _ADD_FORCES, _ADD_SLOPE, _ADD_LOSSES, _FREQUENCY = range(6)


@compiled
def elements(run_address, joint_address, j, task):
    """Carry out one of the tasks above for a joint with elements (`access.PART`)."""
    joint = joint_at(joint_address)
    if task == _GAP:
        return -_evaluate(joint, FORCES)[DEEPEST]
    if task == _ADD_SLOPE:
        _add_slope(joint)
        return 0.0
    run = run_at(run_address)
    if task == _FREQUENCY:
        return _frequency(run, joint)
    if task == _FIND:
        return 1.0 if _find(run, j, joint) else 0.0
    if task == _ADD_FORCES:
        _add_forces(run, j, joint)
    else:
        _add_losses(run, joint)
    return 0.0


@compiled
def element_gap(joint):
    """Smallest gap of the elements at the joint's pose."""
    return call_part(joint.element_part, (0, place_of(joint), 0, _GAP))


@compiled
def find_elements(run, j, joint):
    """Find elastic wrench and stiffness of joint j at its pose; returns whether it bears load."""
    return call_part(joint.element_part, (place_of(run), place_of(joint), j, _FIND)) != 0.0


@compiled
def add_element_forces(run, j, joint):
    """Add elastic wrench, damping and friction at the joint's twist to its wrench."""
    call_part(joint.element_part, (place_of(run), place_of(joint), j, _ADD_FORCES))


@compiled
def add_element_slope(joint):
    """Add the derivative of damping and friction by the twist to d(wrench)/d(twist)."""
    call_part(joint.element_part, (0, place_of(joint), 0, _ADD_SLOPE))


@compiled
def add_element_losses(run, joint):
    """Add the power dissipated by damping and friction."""
    call_part(joint.element_part, (place_of(run), place_of(joint), 0, _ADD_LOSSES))


@compiled
def element_frequency(run, joint):
    """Sum of the squared natural frequencies on the joint's stiffness K [rad^2/s^2].

    It is the trace of M^-1 J^T K J, an upper bound of the square of the highest frequency.
    """
    return call_part(joint.element_part, (place_of(run), place_of(joint), 0, _FREQUENCY))


@compiled
def cage_rate(joint, v):
    """Angular speed of the cage at velocities v [rad/s]."""
    find_twist(joint, v)
    spin, _ = _spin(joint)
    return pointer(joint.dimensions)[RATIO] * spin


@compiled
def advance_cages(run, v, elapsed):
    """Turn all cages for `elapsed` [s] at velocities v."""
    for j in range(run.nj):
        joint = run.joints[j]
        if joint.resultant != 0:
            joint.cage += elapsed * cage_rate(joint, v)


@compiled
def advance_cages_by_stage(run, v, stage, weight, ahead):
    """Turn all cages to the next stage of a Runge-Kutta step, or to its end (stage 3)."""
    for j in range(run.nj):
        joint = run.joints[j]
        if joint.resultant == 0:
            continue
        rate = cage_rate(joint, v)
        if stage == 0:
            joint.cage_start, joint.cage_sum = joint.cage, 0.0
        joint.cage_sum += weight * rate
        joint.cage = joint.cage_start + (joint.cage_sum if stage == 3 else ahead * rate)
