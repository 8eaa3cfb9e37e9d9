"""Oil film between journal and bore: forces, damping and losses of its sections.

The film is divided along the axis into sections. Each gets eccentricity, its rate and direction at
its own place, asks the law (`contact.film`) for the force, and adds it to the joint's wrench.

Compiled apart as `film`, for joints that have one; the functions without underscore call it.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import address_of, compiled, place_of
from jointplay.physics.contact.calls import call_film
from jointplay.physics.kernel.access import call_part, joint_at, record_failure, run_at
from jointplay.physics.kernel.constants import Status
from jointplay.physics.kernel.frames import add, add_scaled, cross, get_vector, scale
from jointplay.physics.kernel.layout import FILM

_BAD_FORCE = int(Status.BAD_FORCE)
_DIFFERENCE = 1e-4
"""Relative step in a section's speed of the difference quotient that differentiates the film."""
_LEAST_DIFFERENCE = 1e-9
"""Least such step, taken at zero speed [m/s]."""


@compiled
def _evaluate_law(run, joint, place, velocity):
    """Force of a section along x and y, its moment, and its damping, at a velocity (x, y)."""
    e, (ex, ey), part = place
    clearance = joint.clearance
    ratio = min(e / clearance, joint.thinnest)
    rate, whirl = ex * velocity[0] + ey * velocity[1], ex * velocity[1] - ey * velocity[0]
    state = ratio, rate / clearance, whirl / clearance, joint.twist[5]
    law, numbers = address_of(joint.film_parameters), address_of(run.law_numbers)
    call_film(joint.film_law, (*state, law, numbers))
    out = run.law_numbers
    along_line, across, turn, damping = out[0], out[1], out[2], out[3]
    return (
        part * (ex * along_line - ey * across),
        part * (ey * along_line + ex * across),
        part * turn,
        part * damping,
    )


@compiled
def _section_state(joint, section):
    """Arm of a section from the journal's centre, its place, and its velocity (x, y).

    The place is its eccentricity, the direction of that, and its share of the film, which fades
    where the journal is deeper in the bore than the clearance.
    """
    pose, twist = joint.pose, joint.twist
    height = joint.section * (1.0 - 2.0 * section)
    arm = scale(height, (pose[5], pose[8], pose[11]))
    px, py = pose[0] + arm[0], pose[1] + arm[1]
    e = math.sqrt(px * px + py * py)
    direction = (px / e, py / e) if e > 0.0 else (1.0, 0.0)
    part = 1.0 / joint.sections
    if e > joint.clearance:
        part *= max(1.0 - (e - joint.clearance) / joint.transition, 0.0)
    velocity = add(get_vector(twist, 0), cross(get_vector(twist, 3), arm))
    return arm, (e, direction, part), (velocity[0], velocity[1])


@compiled
def _lagged_force(run, joint, section, place, velocity):
    """Force and moment of a section, lagged so that an explicit step can follow a stiff film.

        F_n = [F(v_n + s (v_n - v_{n-1})) + lambda F_{n-1}]/(1 + lambda),
        lambda = C dt/m,  s = lambda/(1 + lambda)

    with the damping C: a mass m stays stable, and steady forces are exact (docs/bearings.md).
    """
    memory = joint.film_memory
    # s follows from the damping at v_n, lambda from that at the extrapolated velocity.
    fx, fy, turn, damping = _evaluate_law(run, joint, place, velocity)
    stiff = damping * run.dt / joint.lag_mass
    ahead = stiff / (1.0 + stiff)
    if memory[section, 4] > 0.0 and ahead > 0.0:
        ux = velocity[0] + ahead * (velocity[0] - memory[section, 2])
        uy = velocity[1] + ahead * (velocity[1] - memory[section, 3])
        fx, fy, turn, damping = _evaluate_law(run, joint, place, (ux, uy))
        stiff = damping * run.dt / joint.lag_mass
        ahead = stiff / (1.0 + stiff)
    else:
        ahead = 0.0
    fx = (1.0 - ahead) * fx + ahead * memory[section, 0]
    fy = (1.0 - ahead) * fy + ahead * memory[section, 1]
    return fx, fy, turn


@compiled
def _add_slope(run, joint, place, velocity, arm, force):
    """Add the derivative of a section's force by its velocity to the joint's d(wrench)/d(twist)."""
    size = math.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1])
    more = _DIFFERENCE * size + _LEAST_DIFFERENCE
    wrench_slope = joint.wrench_slope
    for c in range(2):
        ux = velocity[0] + (more if c == 0 else 0.0)
        uy = velocity[1] + (more if c == 1 else 0.0)
        fx, fy, _, _ = _evaluate_law(run, joint, place, (ux, uy))
        column = ((fx - force[0]) / more, (fy - force[1]) / more, 0.0)
        turned = cross(arm, column)
        # Rate of the velocity's component c per angular velocity: row c of -[arm].
        lever = (0.0, arm[2], -arm[1]) if c == 0 else (-arm[2], 0.0, arm[0])
        for r in range(3):
            wrench_slope[r, c] += column[r]
            wrench_slope[3 + r, c] += turned[r]
            for k in range(3):
                wrench_slope[r, 3 + k] += column[r] * lever[k]
                wrench_slope[3 + r, 3 + k] += turned[r] * lever[k]


@compiled
def _add_forces(run, joint, lag):
    """See `add_film_forces`."""
    wrench, film = joint.wrench, joint.film_wrench
    for r in range(6):
        film[r] = 0.0
    for section in range(joint.sections):
        arm, place, velocity = _section_state(joint, section)
        if place[2] <= 0.0:  # its share of the film has faded
            continue
        if lag:
            fx, fy, turn = _lagged_force(run, joint, section, place, velocity)
        else:
            fx, fy, turn, _ = _evaluate_law(run, joint, place, velocity)
        force = (fx, fy, 0.0)
        moment = add_scaled(cross(arm, force), turn, (0.0, 0.0, 1.0))
        for r in range(3):
            film[r] += force[r]
            film[3 + r] += moment[r]
    for r in range(6):
        wrench[r] += film[r]


@compiled
def _add_film_slope(run, joint):
    """See `add_film_slope`."""
    for section in range(joint.sections):
        arm, place, velocity = _section_state(joint, section)
        if place[2] <= 0.0:  # its share of the film has faded
            continue
        fx, fy, _, _ = _evaluate_law(run, joint, place, velocity)
        _add_slope(run, joint, place, velocity, arm, (fx, fy))


@compiled
def _add_losses(run, j, joint):
    """See `add_film_losses`."""
    wrench, twist = joint.film_wrench, joint.twist
    for r in range(6):
        run.power[FILM] -= wrench[r] * twist[r]
    if not math.isfinite(wrench[0] + wrench[1] + wrench[5]):
        record_failure(run, _BAD_FORCE, run.width * j)


@compiled
def _commit(run, joint):
    """See `commit_film`."""
    memory = joint.film_memory
    for section in range(joint.sections):
        _, place, velocity = _section_state(joint, section)
        fx, fy = 0.0, 0.0
        if place[2] > 0.0:
            fx, fy, _ = _lagged_force(run, joint, section, place, velocity)
        memory[section, 0], memory[section, 1] = fx, fy
        memory[section, 2], memory[section, 3] = velocity
        memory[section, 4] = 1.0


_FORCES, _LAGGED, _SLOPE, _LOSSES, _COMMIT = range(5)


@compiled
def film(run_address, joint_address, j, task):
    """Carry out one of the tasks above for a joint with a film (`access.PART`)."""
    run, joint = run_at(run_address), joint_at(joint_address)
    if task == _SLOPE:
        _add_film_slope(run, joint)
    elif task == _LOSSES:
        _add_losses(run, j, joint)
    elif task == _COMMIT:
        _commit(run, joint)
    else:
        _add_forces(run, joint, task == _LAGGED)
    return 0.0


@compiled
def add_film_forces(run, j, joint, lag):
    """Add the film's forces at the joint's twist to its wrench; `lag` for explicit steps."""
    task = _LAGGED if lag else _FORCES
    call_part(joint.film_part, (place_of(run), place_of(joint), j, task))


@compiled
def add_film_slope(run, j, joint):
    """Add the derivative of the film's wrench by the joint's twist."""
    call_part(joint.film_part, (place_of(run), place_of(joint), j, _SLOPE))


@compiled
def add_film_losses(run, j, joint):
    """Add the power dissipated in the film; stop the run where its law has failed."""
    call_part(joint.film_part, (place_of(run), place_of(joint), j, _LOSSES))


@compiled
def commit_film(run, j, joint):
    """Keep force and velocity of the sections, for the lag of the next explicit step."""
    call_part(joint.film_part, (place_of(run), place_of(joint), j, _COMMIT))
