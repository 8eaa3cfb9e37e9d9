"""Contact forces of one joint: gaps, normal and friction forces, their derivatives, and history.

1. `find_gaps` finds the gaps (eqs 4-9) and elastic forces at the joint's pose.
2. `add_contact_forces` adds the contact forces at the joint's twist to its wrench (eqs 18-21);
   `add_contact_slope` adds the derivative of the wrench by the twist, for the velocity solve.
3. `add_dissipation` adds the powers lost at the velocity found.
4. `commit_contacts` accepts the state as one of the trajectory: onset and end of contacts, approach
   speed, bristles, peaks, impulses and sliding work.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import address_of, compiled, pointer
from jointplay.physics.contact.calls import call_bristle, call_friction, call_normal
from jointplay.physics.contact.law import BRISTLE_NUMBERS
from jointplay.physics.geometry import Shape, clear_of_cylinder, touch_faces, touch_rims
from jointplay.physics.geometry import touch as touch_shape
from jointplay.physics.kernel.access import record_failure
from jointplay.physics.kernel.constants import AZIMUTHS, WELL_RESOLVED_STEPS, Status
from jointplay.physics.kernel.frames import (
    add,
    add_scaled,
    cross,
    dot,
    get_vector,
    norm,
    scale,
    set_vector,
)
from jointplay.physics.kernel.layout import FRICTION, MIN_APPROACH_SPEED, NORMAL, STORED
from jointplay.physics.kernel.rolling import (
    add_element_forces,
    add_element_losses,
    add_element_slope,
    element_gap,
    find_elements,
)

_CYLINDER = int(Shape.CYLINDER)
_BROKE_OUT, _FILM_BROKE = int(Status.BROKE_OUT), int(Status.FILM_BROKE)
_BAD_FORCE = int(Status.BAD_FORCE)

_BENDING, _RELEASE, _STIFFNESS, _DAMPING, _VISCOUS, _CAP, _TARGET, _RATE = range(BRISTLE_NUMBERS)
"""Indices of a bristle law's results in `RUN.law_numbers`; see `bristle.Bristles`."""

_DIFFERENCE = 1e-5
"""Relative step in speed of the difference quotients that differentiate laws."""
_LEAST_DIFFERENCE = 1e-9
"""Least such step, taken at zero speed [m/s]."""
_SLID_BEFORE_S = 1e-2
"""Time for which contacts that touch at the start are taken to have slid before [s]: bristles that
began straight at full speed would push by many times the friction until they have bent."""


@compiled
def _touch(joint, k):
    """Gap of contact k at the joint's pose, its arm (3) and direction (3), as one tuple."""
    pose, dimensions = joint.pose, pointer(joint.dimensions)
    return touch_shape(joint.shape, dimensions, 0, k, pose[0], pose[1], pose[2], pose, 3)


@compiled
def _cylinder_pose(joint):
    """Centre and axis of a cylinder at the joint's pose, then its dimensions."""
    pose, d = joint.pose, pointer(joint.dimensions)
    axis = pose[5], pose[8], pose[11]
    return (pose[0], pose[1], pose[2], *axis, d[0], d[1], d[2], d[3])


@compiled
def contact_gap(joint, k):
    """Gap of contact k at the joint's pose."""
    if joint.resultant != 0:
        return element_gap(joint)
    return _touch(joint, k)[0]


@compiled
def is_clear(joint, k):
    """Whether a cheap bound shows that contact k does not touch at the joint's pose."""
    if joint.shape != _CYLINDER or joint.resultant != 0:
        return False
    return clear_of_cylinder(k, *_cylinder_pose(joint))


@compiled
def _store_contact(run, j, joint, k, place):
    """Store gap, arm and normal of contact k of joint j, and its elastic force.

    Returns whether it touches. Where it must not, the run is stopped.
    """
    contact = run.contacts[j, k]
    gap, rx, ry, rz, nx, ny, nz = place
    contact.gap = gap
    contact.touching = 0
    if gap >= 0.0:
        return False
    if gap < joint.limit:
        record_failure(run, _BROKE_OUT, run.width * j + k)
        return False
    if k < joint.must_not_touch:
        record_failure(run, _FILM_BROKE, run.width * j + k)
        return False
    contact.touching = 1
    set_vector(contact.arm, 0, (rx, ry, rz))
    set_vector(contact.direction, 0, (nx, ny, nz))
    law = address_of(contact.parameters)
    contact.elastic = call_normal(joint.normal_law, (-gap, 0.0, 1.0, law))
    return True


@compiled
def find_gaps(run, j, joint):
    """Find gap, place and normal of each contact of joint j; returns whether any touches.

    Elastic forces follow, for they depend on the depth alone.
    """
    if joint.resultant != 0:
        return find_elements(run, j, joint)
    touching = False
    if joint.shape != _CYLINDER:
        for k in range(joint.count):
            touching |= _store_contact(run, j, joint, k, _touch(joint, k))
        return touching
    end_a, end_b = touch_rims(*_cylinder_pose(joint))
    touching |= _store_contact(run, j, joint, 0, end_a)
    touching |= _store_contact(run, j, joint, 1, end_b)
    if joint.count > 2:
        end_a, end_b = touch_faces(*_cylinder_pose(joint))
        touching |= _store_contact(run, j, joint, 2, end_a)
        touching |= _store_contact(run, j, joint, 3, end_b)
    return touching


@compiled
def _find_contact_velocity(joint, contact):
    """Rate of penetration, sliding velocity and its magnitude at a contact, from the twist."""
    arm, normal = get_vector(contact.arm, 0), get_vector(contact.direction, 0)
    velocity = add(get_vector(joint.twist, 0), cross(get_vector(joint.twist, 3), arm))
    rate = -dot(normal, velocity)
    slip = add_scaled(velocity, rate, normal)
    return rate, slip, norm(slip)


@compiled
def _normal_force(joint, contact, rate):
    """Normal force [N], the approach speed, and the speed that damping is referred to [m/s].

    The approach speed is the largest since the contact began. For an impact that is the speed at
    its onset (eq. 14), for |ddelta| only falls from there.

    Hysteresis laws divide by it, and say nothing of a contact that began at rest: referred to its
    own smallest rates the damper would be a brake, which no explicit step follows. Damping is
    therefore referred to the speed at which `rest_mass` would have brought the energy that the
    contact holds, if that is more: a damper that depends smoothly on depth and rate. Impacts are
    not affected, for `rest_mass` is far larger than the masses they meet, and an impact never holds
    more energy than it came with (docs/theory.md).
    """
    approach = max(abs(rate), MIN_APPROACH_SPEED)
    if contact.steps > 0.0:
        approach = max(approach, contact.ddelta0)
    reference = approach
    energy = STORED * contact.elastic * -contact.gap
    if energy > 0.5 * joint.rest_mass * approach * approach:
        reference = math.sqrt(2.0 * energy / joint.rest_mass)
    law = address_of(contact.parameters)
    force = call_normal(joint.normal_law, (-contact.gap, rate, reference, law))
    return max(force, 0.0), approach, reference  # a dry contact never pulls


@compiled
def _evaluate_bristle_law(run, joint, contact, speed, normal, dwell):
    """Evaluate the bristle law (see `BristleLaw`) into `law_numbers`."""
    law, out = address_of(joint.friction_parameters), address_of(run.law_numbers)
    call_bristle(joint.friction_law, (speed, normal, dwell, law, out))


@compiled
def _advance_bristle(run, contact, z, slip, elapsed):
    """Deflection of bristles `elapsed` [s] after z, exact for constant slip, and its gain by slip.

    dz/dt = A v - r z, with A and r of the law last evaluated; z is first turned into the tangent
    plane.
    """
    bending, release = run.law_numbers[_BENDING], run.law_numbers[_RELEASE]
    direction = get_vector(contact.direction, 0)
    z = add_scaled(z, -dot(direction, z), direction)
    left = math.exp(-release * elapsed)
    gain = bending * (elapsed if release * elapsed < 1e-9 else (1.0 - left) / release)
    return add(scale(left, z), scale(gain, slip)), gain


@compiled
def _advance_dwell(run, dwell, elapsed):
    """Dwell `elapsed` [s] later: exponential approach to the target of the law last evaluated."""
    target, rate = run.law_numbers[_TARGET], run.law_numbers[_RATE]
    return target + (dwell - target) * math.exp(-rate * elapsed) if rate != 0.0 else dwell


@compiled
def bend_at_start(run, j, joint):
    """Bend the bristles of contacts that touch at the start, at the present twist."""
    for k in range(joint.count):
        contact = run.contacts[j, k]
        if contact.touching == 0 or contact.steps > 0.0:
            continue
        rate, slip, speed = _find_contact_velocity(joint, contact)
        normal, _, _ = _normal_force(joint, contact, rate)
        _evaluate_bristle_law(run, joint, contact, speed, normal, 0.0)
        z, _ = _advance_bristle(run, contact, (0.0, 0.0, 0.0), slip, _SLID_BEFORE_S)
        set_vector(contact.bristle, 0, z)
        contact.dwell = _advance_dwell(run, 0.0, _SLID_BEFORE_S)


@compiled
def time_bristles(run, j, joint, elapsed, step):
    """Set the time for which bristles of joint j have bent since they were kept, `elapsed` [s].

    Those of a contact that began within the last `step` [s] were straight at its onset, which the
    depth and its rate tell.
    """
    for k in range(joint.count):
        contact = run.contacts[j, k]
        contact.elapsed = elapsed
        if contact.touching != 0 and contact.steps == 0.0 and run.time > 0.0:
            rate, _, _ = _find_contact_velocity(joint, contact)
            depth = -contact.gap
            contact.elapsed = depth / rate if rate * step > depth else step


@compiled
def _bristle_force(run, joint, contact, normal, slip, speed):
    """Friction of bristles at a sliding velocity v: -(k z + d (A v - r z)), capped, less c v.

    Returns the force, how much it falls per velocity across it, z and dwell at the end of
    `contact.elapsed`.
    """
    _evaluate_bristle_law(run, joint, contact, speed, normal, contact.dwell)
    out, elapsed = run.law_numbers, contact.elapsed
    z, gain = _advance_bristle(run, contact, get_vector(contact.bristle, 0), slip, elapsed)
    dwell = contact.dwell
    if out[_RATE] != 0.0:
        dwell = _advance_dwell(run, dwell, elapsed)
        _evaluate_bristle_law(run, joint, contact, speed, normal, dwell)
    damper = out[_DAMPING] * out[_BENDING]
    pull = out[_STIFFNESS] - out[_DAMPING] * out[_RELEASE]
    force = add(scale(-pull, z), scale(-damper, slip))
    fall = damper + pull * gain
    size = norm(force)
    if size > out[_CAP]:
        force = scale(out[_CAP] / size, force)
        fall *= out[_CAP] / size
    return add_scaled(force, -out[_VISCOUS], slip), fall + out[_VISCOUS], z, dwell


@compiled
def _bristle_slope(run, joint, contact, slip):
    """Direction of sliding, derivative of the bristles' force along it, and its fall across it."""
    speed, normal = contact.speed, contact.normal_now
    more = speed * _DIFFERENCE + _LEAST_DIFFERENCE
    force, across, _, _ = _bristle_force(run, joint, contact, normal, slip, speed)
    if speed <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), across
    t = scale(1.0 / speed, slip)
    further, _, _, _ = _bristle_force(
        run, joint, contact, normal, add_scaled(slip, more, t), speed + more
    )
    return t, scale(1.0 / more, add_scaled(further, -1.0, force)), across


@compiled
def _keep_bristle(run, joint, contact, ahead):
    """Keep bristles and dwell as they will be `ahead` [s] after the state, at its velocity."""
    z, dwell = get_vector(contact.bristle_now, 0), contact.dwell_now
    if ahead > 0.0:
        _, slip, speed = _find_contact_velocity(joint, contact)
        _evaluate_bristle_law(run, joint, contact, speed, contact.normal_now, dwell)
        z, _ = _advance_bristle(run, contact, z, slip, ahead)
        dwell = _advance_dwell(run, dwell, ahead)
    set_vector(contact.bristle, 0, z)
    contact.dwell = dwell


@compiled
def _friction_slope(joint, contact, slip):
    """Direction of sliding, derivative of friction (eqs 20, 21) along it, and its fall across it.

    Across the sliding direction the force turns with the velocity, mu F_n/|v_t| per velocity; at
    rest it falls alike in all directions.
    """
    speed, normal, mu = contact.speed, contact.normal_now, contact.mu
    law = address_of(joint.friction_parameters)
    more = speed * _DIFFERENCE + _LEAST_DIFFERENCE
    rise = (call_friction(joint.friction_law, (speed + more, law)) - mu) / more
    if speed <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), rise * normal
    t = scale(1.0 / speed, slip)
    return t, scale(-rise * normal, t), mu / speed * normal


@compiled
def _add_slope(joint, contact, b):
    """Add b = d(force)/d(velocity) at a contact (3 columns) to d(wrench)/d(twist), as X^T b X.

    X = [1, -[r]] maps the twist to the velocity of the contact point at the arm r.
    """
    arm, wrench_slope = get_vector(contact.arm, 0), joint.wrench_slope
    for c in range(3):
        turned = cross(arm, b[c])
        for r in range(3):
            wrench_slope[r, c] += b[c][r]
            wrench_slope[3 + r, c] += turned[r]
    # The velocity of the point is u + w x r: the columns of b (-[r]).
    x, y, z = arm
    columns = (
        add_scaled(scale(-z, b[1]), y, b[2]),
        add_scaled(scale(z, b[0]), -x, b[2]),
        add_scaled(scale(-y, b[0]), x, b[1]),
    )
    for c in range(3):
        turned = cross(arm, columns[c])
        for r in range(3):
            wrench_slope[r, 3 + c] += columns[c][r]
            wrench_slope[3 + r, 3 + c] += turned[r]


@compiled
def add_contact_slope(run, j, joint):
    """Add the derivative of the wrench by the twist; after `add_contact_forces`."""
    if joint.resultant != 0:
        add_element_slope(joint)
        return
    for k in range(joint.count):
        contact = run.contacts[j, k]
        if contact.touching == 0:
            continue
        rate, slip, _ = _find_contact_velocity(joint, contact)
        if joint.bristles != 0:
            t, b, fall = _bristle_slope(run, joint, contact, slip)
            mu = 0.0  # the effect of the normal force on bristles is left to the next trial
        else:
            t, b, fall = _friction_slope(joint, contact, slip)
            mu = contact.mu
        more = contact.reference * _DIFFERENCE
        higher, _, _ = _normal_force(joint, contact, rate + more)
        damping = (higher - contact.normal_now) / more
        n = get_vector(contact.direction, 0)
        a = add_scaled(scale(-damping, n), mu * damping, t)
        # a n^T + b t^T - fall (1 - n n^T - t t^T), column by column
        a, b = add_scaled(a, fall, n), add_scaled(b, fall, t)
        columns = (
            add(add(scale(n[0], a), scale(t[0], b)), (-fall, 0.0, 0.0)),
            add(add(scale(n[1], a), scale(t[1], b)), (0.0, -fall, 0.0)),
            add(add(scale(n[2], a), scale(t[2], b)), (0.0, 0.0, -fall)),
        )
        _add_slope(joint, contact, columns)


@compiled
def add_contact_forces(run, j, joint):
    """Add the contact forces at the joint's twist to its wrench."""
    if joint.resultant != 0:
        add_element_forces(run, j, joint)
        return
    wrench = joint.wrench
    for k in range(joint.count):
        contact = run.contacts[j, k]
        if contact.touching == 0:
            continue
        rate, slip, speed = _find_contact_velocity(joint, contact)
        normal, approach, reference = _normal_force(joint, contact, rate)
        contact.rate, contact.speed = rate, speed
        contact.approach, contact.reference = approach, reference
        if joint.bristles != 0:
            friction, _, z, dwell = _bristle_force(run, joint, contact, normal, slip, speed)
            set_vector(contact.bristle_now, 0, z)
            contact.dwell_now = dwell
        else:
            law = address_of(joint.friction_parameters)
            contact.mu = call_friction(joint.friction_law, (speed, law))
            friction = scale(-contact.mu * normal / speed if speed > 0.0 else 0.0, slip)
        contact.normal_now = normal
        set_vector(contact.friction, 0, friction)
        set_vector(contact.slip, 0, slip)
        force = add_scaled(friction, normal, get_vector(contact.direction, 0))
        moment = cross(get_vector(contact.arm, 0), force)
        for r in range(3):
            wrench[r] += force[r]
            wrench[3 + r] += moment[r]


@compiled
def add_dissipation(run, j, joint):
    """Add the power dissipated in the contacts of joint j; stop the run where a law has failed.

    This and the size of the friction force are found once a state, not at every trial velocity.
    """
    if joint.resultant != 0:
        add_element_losses(run, joint)
        return
    for k in range(joint.count):
        contact = run.contacts[j, k]
        if contact.touching == 0:
            continue
        friction = get_vector(contact.friction, 0)
        contact.tangential_now = norm(friction)
        contact.friction_power = -dot(friction, get_vector(contact.slip, 0))
        run.power[NORMAL] += (contact.normal_now - contact.elastic) * contact.rate
        run.power[FRICTION] += contact.friction_power
        finite = math.isfinite(contact.normal_now + contact.elastic + contact.tangential_now)
        if not finite or (joint.bristles == 0 and contact.friction_power < 0.0):
            record_failure(run, _BAD_FORCE, run.width * j + k)


@compiled
def average_stage_forces(joint, contact_rows, stage, part):
    """Add the forces at a Runge-Kutta stage, weighted by `part`, to the means over the step."""
    mean, film = joint.mean_force, joint.mean_film_force
    for r in range(3):
        mean[r] = part * joint.wrench[r] + (mean[r] if stage > 0 else 0.0)
        film[r] = part * joint.film_wrench[r] + (film[r] if stage > 0 else 0.0)
    for k in range(joint.count):
        contact = contact_rows[k]
        if stage == 0:
            contact.mean_normal = 0.0
            set_vector(contact.mean_friction, 0, (0.0, 0.0, 0.0))
        if contact.touching != 0:
            contact.mean_normal += part * contact.normal_now
            mean = get_vector(contact.mean_friction, 0)
            friction = get_vector(contact.friction, 0)
            set_vector(contact.mean_friction, 0, add_scaled(mean, part, friction))


@compiled
def commit_contacts(run, j, joint, duration, ahead):
    """Accept the contacts' state as one of the trajectory; its forces act for `duration` [s].

    Bristles are kept as they will be `ahead` [s] after it. Forces for record and audit are those of
    the state or, where a step has stages, their mean over the step that led to the state.
    """
    averaged = run.averaged != 0
    for k in range(joint.count):
        contact = run.contacts[j, k]
        contact.gap_min = min(contact.gap_min, contact.gap)
        contact.deepest = min(contact.deepest, contact.gap)
        if averaged:
            contact.normal = contact.mean_normal
            contact.tangential = norm(get_vector(contact.mean_friction, 0))
        elif contact.touching != 0:
            contact.normal, contact.tangential = contact.normal_now, contact.tangential_now
        else:
            contact.normal = contact.tangential = 0.0
        impulse = contact.normal * duration
        contact.impulse += impulse
        contact.normal_peak = max(contact.normal_peak, contact.normal)
        if contact.touching == 0:
            # The end of a contact.
            if contact.gap >= 0.0 and contact.steps > 0.0:
                run.events += 1
                contact.own_impulse += impulse
                _end_contact(contact)
            continue
        if contact.steps == 0.0:
            # Its onset.
            run.events += 1
            contact.onsets += 1.0
            contact.own_impulse = 0.0
        contact.ddelta0 = contact.approach
        contact.steps += 1.0
        contact.own_impulse += impulse
        if joint.bristles != 0:
            _keep_bristle(run, joint, contact, ahead)
        if k < joint.wearing:
            # Sliding work by azimuth on the bore, in bearing axes, and on the journal, in its own.
            n, pose, work = contact.direction, joint.pose, impulse * contact.speed
            x = pose[3] * n[0] + pose[6] * n[1] + pose[9] * n[2]
            y = pose[4] * n[0] + pose[7] * n[1] + pose[10] * n[2]
            _count_sliding(joint, 0, k, n[0], n[1], work)
            _count_sliding(joint, 1, k, x, y, work)
    force = get_vector(joint.mean_force, 0) if averaged else get_vector(joint.wrench, 0)
    set_vector(joint.impulse, 0, add_scaled(get_vector(joint.impulse, 0), duration, force))
    square = dot(force, force)
    if square > joint.peak_square:
        joint.peak_square = square
        set_vector(joint.peak, 0, force)


@compiled
def _end_contact(contact):
    """Count a contact that has ended, and whether its steps were enough to resolve it."""
    contact.ended += 1.0
    contact.fastest = max(contact.fastest, contact.ddelta0)
    contact.shortest = min(contact.shortest, contact.steps)
    if contact.steps < WELL_RESOLVED_STEPS:
        contact.under += 1.0
        contact.impulse_under += contact.own_impulse
    contact.steps = 0.0
    contact.dwell = 0.0
    set_vector(contact.bristle, 0, (0.0, 0.0, 0.0))


@compiled
def _count_sliding(joint, part, k, x, y, work):
    """Split a contact's sliding work between the two azimuths on either side of it.

    `part` is 0 for the bore, 1 for the journal; (x, y) is the contact's direction, from the bearing
    into the journal, in the axes of that part.
    """
    counted = joint.sliding_work
    place = math.atan2(-y, -x) * (AZIMUTHS / (2.0 * math.pi))
    lower = math.floor(place)
    beyond = place - lower
    at = int(lower) % AZIMUTHS
    counted[part, k, at] += (1.0 - beyond) * work
    counted[part, k, (at + 1) % AZIMUTHS] += beyond * work
