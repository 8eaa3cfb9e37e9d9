"""Adaptive micro steps of the multi-rate method: step size by error, stability and impacts.

A micro step of length h changes velocities by h a, with the acceleration a at its middle as the
leapfrog method takes it. Its error is Taylor's next term,

    e = h^3/24 d2a/dt2,

estimated from the accelerations at the last three states. It is tolerated up to `micro_tolerance`
times the velocity that contacts and inertia change in the step, both measured as the root of twice
a kinetic energy.

Impacts count by their mean deceleration at least, for their beginning, where the force grows from
nothing, would otherwise be resolved without end. So a step in flight spans the macro step, steps in
lasting contact follow the oscillation of the contact, and an impact takes the same number of steps
however stiff it is. Onsets of contacts are located by root finding. A step whose error turns out
too large is done again, shorter, from a copy of the state; no call of Pinocchio is repeated. Steps
grow only by a large factor, for leapfrog steps of equal length keep the energy of an elastic
contact.

The error says nothing of stability: a journal at rest has none, however long the step, until it has
begun to oscillate. Steps are therefore never longer than the stiffness of the contacts that touch
allows, nor than springs, gears and drives do (`longest_micro`).

Records are due at multiples of `run.dt`, between the states: they are interpolated.
"""

from __future__ import annotations

import math

import numpy as np

from jointplay.base.compiler import address_of, compiled
from jointplay.physics.contact.calls import call_normal
from jointplay.physics.kernel.access import machine_words
from jointplay.physics.kernel.constants import POWERS
from jointplay.physics.kernel.contact import contact_gap, is_clear
from jointplay.physics.kernel.frames import (
    cross,
    find_pose,
    get_vector,
    place_bodies,
    project_wrench,
    set_vector,
)
from jointplay.physics.kernel.layout import SPEED, STORED
from jointplay.physics.kernel.multirate import (
    add_work,
    check_prediction,
    commit_memories,
    end_macro_step,
    evaluate,
    plan_macro_step,
    step_positions,
)
from jointplay.physics.kernel.record import fill_row, is_due, write_interpolated
from jointplay.physics.kernel.rolling import element_frequency

_NP = len(POWERS)

REFUSED = 2.0
"""Error of a micro step, over the tolerance, beyond which the step is done again."""
GROWTH = 2.5
"""Largest ratio of a micro step's length to that of the one before."""
LEAST_GROWTH = 2.0
"""Smallest such ratio: a step that could grow by less stays as long as it is, for leapfrog steps of
equal length keep energy."""
SAFETY = 0.85
"""Length of the next step, relative to what the last error would allow."""
FIRST_PART = 0.6
"""Length of the first step of an impact, relative to what the tolerance would allow in its midst:
the force grows there from nothing."""
STABLE_TURN = 1.0
"""Largest phase of the stiffest oscillation in a step [rad]; leapfrog is stable up to 2."""
STIFFNESS_DIFFERENCE = 1e-2
"""Relative step in depth of the difference quotient that gives a contact's stiffness."""
IMPACT = 2.5
"""Duration after which an impact is over or has become a lasting contact, over its first half."""
SMALL_SPEED = 1e-5
"""Speed, as the root of twice a kinetic energy, below which motion is not resolved further
[kg^0.5 m/s]."""
SMALL_DEPTH = 1e-9
"""Least depth from which the search for an impact's largest depth starts [m]."""
DEPTH_TRIALS = 4
"""Iterations of that search; the first is exact for Hertz's force."""
ONSET_TRIALS = 30
"""Most iterations in locating the onset of a contact."""
ONSET_DEPTH = 1e-3
"""Depth at which the located onset may lie, relative to the distance travelled in the step."""
HALF_IMPACT = 1.47
"""Duration of the compression phase of a Hertzian impact, over depth/speed: the integral of
(1 - x^(5/2))^(-1/2) from 0 to 1 (K. L. Johnson, Contact Mechanics, 1985, section 11.4)."""
ROUNDING = 1e-6
"""Part of a step by which a time may differ from a multiple of the step."""


_ARRAY, _COPY = range(2)
"""Columns of `run.copies`; the third has their size."""


@compiled
def _copy(run, source, target):
    """Copy everything that a macro step changes, from one column of `run.copies` to the other."""
    for k in range(run.ncopies):
        size = run.copies[k, 2]
        values = machine_words(run.copies[k, source], size)
        into = machine_words(run.copies[k, target], size)
        for i in range(size):
            into[i] = values[i]


@compiled
def _restore(run):
    """Come back to the copy; counters of work and what is known of refused steps are kept."""
    solves, iterations, unsolved = run.solves, run.iterations, run.unsolved
    at, step, length = run.refused_at, run.refused_step, run.refused_length
    retried = run.retried_at
    _copy(run, _COPY, _ARRAY)
    run.solves, run.iterations, run.unsolved = solves, iterations, unsolved
    run.refused_at, run.refused_step, run.refused_length = at, step, length
    run.retried_at = retried


@compiled
def _gap_ahead(run, elapsed, all_contacts):
    """Smallest gap of the contacts that do not touch now, predicted `elapsed` [s] ahead.

    Positions are extrapolated at constant acceleration. Unless `all_contacts`, those that are
    plainly clear are left out.
    """
    nv = run.nv
    q, v, a = run.q, run.v, run.a
    ahead = run.trial[SPEED]
    for i in range(nv):
        ahead[i] = q[i] + elapsed * (v[i] + 0.5 * elapsed * a[i])
    place_bodies(run, ahead)
    least = np.inf
    for j in range(run.nj):
        joint = run.joints[j]
        find_pose(run, joint, ahead)
        for k in range(joint.count):
            if run.contacts[j, k].touching == 0 and (all_contacts or not is_clear(joint, k)):
                least = min(least, contact_gap(joint, k))
    return least


@compiled
def _least_gap(run):
    """Smallest gap of the contacts that do not touch at the present state."""
    least = np.inf
    for j in range(run.nj):
        for k in range(run.joints[j].count):
            contact = run.contacts[j, k]
            if contact.touching == 0:
                least = min(least, contact.gap)
    return least


@compiled
def _time_to_onset(run, h):
    """Time to the onset of the next contact [s]; `h` if none begins within it.

    By the Illinois variant of regula falsi; the time found lies just behind the onset.
    """
    end = _gap_ahead(run, h, False)
    if end >= 0.0:
        return h
    low, gap, high, depth = 0.0, _least_gap(run), h, -end
    if not gap > 0.0:
        return h
    enough, weight = ONSET_DEPTH * (gap + depth), depth
    for _ in range(ONSET_TRIALS):
        if depth <= enough or high - low <= 1e-9 * h:
            break
        # Aim just behind the onset, so that the end of the bracket behind it converges.
        part = (gap + 0.5 * enough) / (gap + weight)
        middle = low + min(max(part, 1e-3), 0.999) * (high - low)
        gap_there = _gap_ahead(run, middle, True)
        if gap_there >= 0.0:
            low, gap = middle, gap_there
            weight *= 0.5
        else:
            high, depth, weight = middle, -gap_there, -gap_there
            gap *= 0.5 if part > 0.5 else 1.0
    return high


@compiled
def _quadratic_form(run, forces):
    """Quadratic form f^T M^-1 f of generalised forces f."""
    nv = run.nv
    minv = run.minv
    total = 0.0
    for i in range(nv):
        if forces[i] != 0.0:
            for k in range(nv):
                total += forces[i] * minv[i, k] * forces[k]
    return total


@compiled
def _compliance_at(run, joint, contact):
    """Inverse of the effective mass of a contact along its normal, n^T J M^-1 J^T n [1/kg]."""
    nv = run.nv
    pull = run.scratch
    # `project_wrench` projects the joint's own wrench: lend it a unit force along the normal.
    saved = (get_vector(joint.wrench, 0), get_vector(joint.wrench, 3))
    normal = get_vector(contact.direction, 0)
    set_vector(joint.wrench, 0, normal)
    set_vector(joint.wrench, 3, cross(get_vector(contact.arm, 0), normal))
    for i in range(nv):
        pull[i] = 0.0
    project_wrench(joint, pull)
    set_vector(joint.wrench, 0, saved[0])
    set_vector(joint.wrench, 3, saved[1])
    return _quadratic_form(run, pull)


@compiled
def _estimate_impact(run, joint, contact):
    """Estimate duration and mean deceleration of the impact that has just begun.

    Both follow from the depth at which the contact has stored the kinetic energy of the approach.
    The micro step is cut to what resolves the impact.
    """
    speed, compliance = max(contact.rate, 0.0), contact.compliance
    contact.braking = 0.0
    if not (speed > 0.0 and compliance > 0.0):
        return
    energy = 0.5 * speed * speed / compliance
    law = address_of(contact.parameters)
    depth = max(-contact.gap, SMALL_DEPTH)
    for _ in range(DEPTH_TRIALS):
        stored = STORED * depth * call_normal(joint.normal_law, (depth, 0.0, 1.0, law))
        if not stored > 0.0:
            return
        depth *= (energy / stored) ** 0.4  # the energy grows as depth^(5/2)
    half = HALF_IMPACT * depth / speed
    contact.braking = speed / (half * math.sqrt(compliance))
    contact.braking_end = run.time + IMPACT * half
    # From e = h^3/24 d2a/dt2 = tolerance h a, with d2a/dt2 about a/half^2.
    first = FIRST_PART * math.sqrt(24.0 * run.micro_tolerance) * half
    run.micro_step = min(run.micro_step, max(first, run.shortest_micro))


@compiled
def _stiffness(joint, contact):
    """Stiffness of a contact, the derivative of its elastic force by depth [N/m]."""
    depth = -contact.gap
    law = address_of(contact.parameters)
    deeper = (1.0 + STIFFNESS_DIFFERENCE) * depth
    rise = call_normal(joint.normal_law, (deeper, 0.0, 1.0, law)) - contact.elastic
    return max(rise, 0.0) / (STIFFNESS_DIFFERENCE * depth)


@compiled
def _assess_contacts(run, moved):
    """Find the largest deceleration by impacts (`braking`) and the longest stable micro step.

    For stability, the sum of the squared frequencies of all contacts, each alone, is an upper bound
    of the square of the highest frequency that they have together.

    Args:
        moved: whether the inverse mass matrix has changed since the last call.
    """
    most = squares = 0.0
    for j in range(run.nj):
        joint = run.joints[j]
        for k in range(joint.count):
            contact = run.contacts[j, k]
            if contact.touching == 0:
                continue
            begins = contact.steps == 0.0
            if begins or moved:
                contact.compliance = _compliance_at(run, joint, contact)
            if begins:
                _estimate_impact(run, joint, contact)
            if run.time < contact.braking_end:
                most = max(most, contact.braking)
            # Impacts are resolved by their error; contacts that last must be followed stably.
            if joint.resultant != 0:
                squares += element_frequency(run, joint)
            elif not run.time < contact.braking_end:
                squares += contact.compliance * _stiffness(joint, contact)
    run.braking = most
    run.stable_micro = run.longest_micro
    if squares > 0.0:
        run.stable_micro = min(run.longest_micro, STABLE_TURN / math.sqrt(squares))


@compiled
def _norm(run, values):
    """Norm of generalised velocities or accelerations: the root of twice their kinetic energy."""
    nv = run.nv
    minv, weights = run.minv, run.weights
    total = 0.0
    for i in range(nv):
        total += weights[i] * values[i] * values[i] / minv[i, i]
    return math.sqrt(total)


@compiled
def _step_error(run, h):
    """Error of the step of length h to the state just evaluated, relative to the tolerance."""
    nv = run.nv
    a, last = run.a, run.earlier_a
    off, before = last[2], run.earlier_dt
    for i in range(nv):
        if run.known_a > 1:
            # e/h, as d2a/dt2 is twice the second divided difference of a.
            slope, slope_before = (a[i] - last[0, i]) / h, (last[0, i] - last[1, i]) / before
            off[i] = h * h / 12.0 * (slope - slope_before) / (h + before)
        else:
            # After a jump only the change of a is known; it stands for h^2 d2a/dt2.
            off[i] = (a[i] - last[0, i]) / 24.0
    wrong = _norm(run, off)
    if wrong == 0.0:
        return 0.0
    moved = max(run.moved_by_forces, _norm(run, a))
    scale = max(moved, run.moved, run.braking)
    run.moved = moved
    return wrong / (run.micro_tolerance * (scale + SMALL_SPEED / h))


@compiled
def _first_due(run, time):
    """First step at or after a time that is to be recorded; the last of the macro step if none."""
    step = math.ceil(time / run.dt - ROUNDING)
    last = run.step + run.macro
    while step < last and not is_due(run, step):
        step += 1
    return int(step)


@compiled
def _remember_acceleration(run, h):
    """Add the acceleration at the present state to those of the last states."""
    nv = run.nv
    a, last = run.a, run.earlier_a
    for i in range(nv):
        last[1, i], last[0, i] = last[0, i], a[i]
    run.earlier_dt = run.dt_before
    run.known_a = min(run.known_a + 1, 2)


@compiled
def _next_step_length(run, remaining):
    """Length of the next micro step; the last few of a macro step divide the rest evenly."""
    h = max(min(run.micro_step, run.stable_micro), run.shortest_micro)
    if h >= remaining:
        return remaining
    return remaining / math.ceil(remaining / h) if remaining < 3.0 * h else h


@compiled
def _keep_row(run):
    """Keep the state just evaluated, from which records are interpolated."""
    fill_row(run, run.row_before)
    for i in range(_NP):
        run.before[i] = run.power[i]
    for load in run.loads:
        load.before = load.power


@compiled
def _write_due_records(run, start, h, due):
    """Write the records due in the micro step from `start`, from step `due` on.

    Returns the step that is due next.
    """
    end = start + h
    fill_row(run, run.row_after)
    while due < run.step + run.macro and due * run.dt < end - ROUNDING * run.dt:
        write_interpolated(run, due * run.dt, max(due * run.dt - start, 0.0), h)
        due = _first_due(run, (due + 0.5) * run.dt)
    return due


@compiled
def _try_steps(run):
    """Do the micro steps of a macro step; returns False where one was refused.

    Then the caller restores the copy, and the steps are repeated from there: up to `refused_at`
    exactly as before, from where on `refused_step` is the length. A new copy is taken there, so
    that a second refusal repeats no more than its own step.
    """
    end = (run.step + run.macro) * run.dt
    last = run.step + run.macro
    evaluate(run)
    due = _first_due(run, run.time)
    begins = True
    while run.status == 0:
        # 1. Choose the length of the step.
        if run.time >= run.refused_at:
            run.micro_step, run.refused_at = run.refused_step, np.inf
            _copy(run, _ARRAY, _COPY)
        _assess_contacts(run, begins)
        begins = False
        start = run.time
        wanted = _next_step_length(run, end - start)
        h = _time_to_onset(run, wanted)
        # 2. Accept the present state, go to the next and evaluate it.
        before = 0.5 * run.dt_before if run.fresh == 0 else 0.0
        add_work(run, before)
        commit_memories(run, before, 0.5 * h)
        records = due < last and due * run.dt < start + h - ROUNDING * run.dt
        if records:
            _keep_row(run)
        add_work(run, 0.5 * h)
        run.fresh = 0
        _remember_acceleration(run, h)
        step_positions(run, h)
        run.time = start + h
        evaluate(run)
        # 3. Refuse the step if its error is too large. One that is far too long can end anywhere:
        # a failure counts only with the shortest.
        error = _step_error(run, h) if run.status == 0 else np.inf
        retried = run.retried_at == start
        if retried:
            # Where the acceleration jumps, no step is short enough for the relative error: the
            # error in momentum counts, against a step as long as the first refused here.
            error *= h / run.refused_length
        if error > REFUSED and h > run.shortest_micro:
            if not retried:
                run.retried_at, run.refused_length = start, h
            run.refused_at = start
            run.refused_step = max(h * max(SAFETY * error ** (-1.0 / 3.0), 0.1), run.shortest_micro)
            return False
        if run.status != 0:
            break
        if error > REFUSED:
            run.unresolved += 1
        # 4. Suggest the length of the next step, and write the records in between.
        factor = min(SAFETY * error ** (-1.0 / 3.0), GROWTH) if error > 0.0 else GROWTH
        if factor < 1.0 or (factor > LEAST_GROWTH and h >= 0.99 * run.micro_step):
            run.micro_step = max(factor * h, run.shortest_micro)
        if records:
            due = _write_due_records(run, start, h, due)
        if h < wanted or retried:
            run.known_a = 0  # a contact begins, or a force jumps: the acceleration has a corner
        # 5. End the macro step early if the state has left the predicted path.
        end_macro_step(run)
        if run.departure > run.departure_limit:
            # Macro steps end at multiples of `dt`.
            steps = math.ceil(run.time / run.dt - ROUNDING)
            if steps * run.dt < end - 0.5 * run.dt:
                last = int(steps)
                end = last * run.dt
        if run.time >= end - 1e-9 * run.dt:
            break
    if run.status == 0:
        run.step = last
        run.time = run.evaluated_at = last * run.dt
    else:
        run.step = int(run.time / run.dt)
    return True


@compiled
def advance_adaptively(run):
    """Do the planned macro step with Pinocchio's result by adaptive steps, and plan the next."""
    check_prediction(run)
    if run.refused != 0:
        return
    run.macros += 1
    first, macro = run.step, run.macro
    run.refused_at = np.inf
    run.retried_at = -1.0
    _copy(run, _ARRAY, _COPY)
    while not _try_steps(run):
        _restore(run)
    steps = run.step - first
    if run.fixed == 0 and steps < macro:
        run.suggested = min(max(2 * steps, 1), run.longest)
    if run.status == 0 and run.step < run.until:
        plan_macro_step(run)
