"""The velocity solve: friction, damping and films of all contacts together, implicit in velocity.

The multi-rate method asks, in every micro step, for the velocity v with

    v = v_half + h (a_free + M^-1 [tau + tau_c(q, v)]),    h = dt/2

v_half being the velocity half a step ago, tau the forces that do not depend on v, and tau_c those
that do: contacts (their elastic part, too), films, joint friction, gears, damping of loads.

1. `find_velocity_forces` finds gaps, elastic forces and bristles at q, and lists the coordinates on
   which tau_c acts.
2. `solve_velocity` solves for v on these by Newton's method, all contacts at once, for the rims of
   one journal couple strongly. The matrix is

    I - h M^-1 d(tau_c)/dv

   It is kept from step to step as long as it converges fast (a chord method). Where friction falls
   with speed, the Newton step is halved until the residual falls.

Reference for friction as one implicit problem in velocity: M. Anitescu, F. Potra, Int. J. Numer.
Meth. Engng 55 (2002) 753-784; A. Castro, X. Han, J. Masterjohn, Irrotational Contact Fields, arXiv
2312.03908 (2023).
"""

from __future__ import annotations

import math

from jointplay.base.compiler import compiled, contracted, reordered
from jointplay.physics.kernel.access import flat, square
from jointplay.physics.kernel.contact import (
    add_contact_forces,
    add_contact_slope,
    find_gaps,
    time_bristles,
)
from jointplay.physics.kernel.drive import (
    add_joint_slopes,
    apply_drive_damping,
    apply_joint_friction,
)
from jointplay.physics.kernel.film import add_film_forces, add_film_slope
from jointplay.physics.kernel.frames import (
    find_pose,
    find_twist,
    place_bodies,
    project_slope,
    project_wrench,
)
from jointplay.physics.kernel.gear import add_gear_slopes, apply_gears, mark_gears, place_gears
from jointplay.physics.kernel.layout import BASE, ERROR, INERTIA, LAST, MARKS, PUSH, SPEED, STEP
from jointplay.physics.kernel.load import add_load_slopes, apply_velocity_loads, evaluate_loads

TOLERANCE = 1e-9
"""Residual velocity tolerated, root mean square over the coordinates, each as the root of twice its
kinetic energy [kg^0.5 m/s]."""
RELATIVE_TOLERANCE = 1e-11
"""Residual velocity tolerated besides, relative to the velocity without tau_c in the same norm."""
MOST_LISTED = 0.75
"""Part of all coordinates beyond which all are solved for: their rows of M^-1 need no copying."""
SINGLE = 6
"""Coordinates of one joint with clearance: loops of this length are compiled separately, their
length known to the compiler."""
CONTRACTION = 0.1
"""Ratio of successive residuals above which a kept Newton matrix is computed anew."""
REFINED = 0.05
"""Residual, over the tolerance, below which it does not spoil the guesses extrapolated from it."""
MOST_TRIALS = 40
"""Most trial velocities in a solve."""
LEAST_PART = 1.0 / 64.0
"""Smallest part of a Newton step that is tried."""


@compiled
def find_velocity_forces(run, q, half):
    """Find which forces at q depend on velocity, and list the coordinates on which they act.

    `half`, the half-step velocity, tells when contacts began that touch for the first time.
    """
    nv = run.nv
    touched, place = run.touched, run.place
    marks = run.trial[MARKS]
    for i in range(nv):
        marks[i] = 0.0
    run.touching = 0
    place_bodies(run, q)
    for j in range(run.nj):
        joint = run.joints[j]
        find_pose(run, joint, q)
        touching = find_gaps(run, j, joint)
        run.touching += 1 if touching else 0
        joint.touching = 1 if touching or joint.sections > 0 or joint.resultant != 0 else 0
        for r in range(6):
            joint.wrench[r] = 0.0
        if joint.touching == 0:
            continue
        if joint.bristles != 0:
            find_twist(joint, half)
            time_bristles(run, j, joint, run.time - run.bent_at, run.dt_before)
        support = joint.support
        for k in range(joint.nsupport):
            marks[support[k]] = 1.0
    for row in run.frictions:
        marks[row.coordinate] = 1.0
    for drive in run.drives:
        if drive.implicit != 0:
            marks[drive.coordinate] = marks[drive.encoder] = 1.0
    if run.nl + run.ng > 0:
        place_gears(run, q)
        mark_gears(run, marks)
        evaluate_loads(run, q, run.v, marks)
    n = 0
    for i in range(nv):
        if marks[i] != 0.0:
            touched[n] = i
            place[i] = n
            n += 1
    if n > SINGLE and n > MOST_LISTED * nv:
        n = nv
        for i in range(nv):
            touched[i] = place[i] = i
    run.active = n


@compiled
def evaluate_velocity_forces(run, q, v):
    """Evaluate tau_c at state (q, v) into `velocity_forces`."""
    tau = run.velocity_forces
    for i in range(run.nv):
        tau[i] = 0.0
    for j in range(run.nj):
        joint = run.joints[j]
        if joint.touching == 0:
            continue
        find_twist(joint, v)
        for r in range(6):
            joint.wrench[r] = 0.0
        if joint.sections > 0:
            add_film_forces(run, j, joint, False)
        add_contact_forces(run, j, joint)
        project_wrench(joint, tau)
    apply_joint_friction(run, v, run.time, tau)
    apply_gears(run, v, tau)
    apply_drive_damping(run, v, tau)
    apply_velocity_loads(run, v, tau)


@compiled
def _evaluate_slopes(run, q, v):
    """Evaluate d(tau_c)/dv at the last evaluated state into `slope`."""
    slope = flat(run.slope)
    for i in range(slope.size):
        slope[i] = 0.0
    for j in range(run.nj):
        joint = run.joints[j]
        if joint.touching == 0:
            continue
        for r in range(6):
            for c in range(6):
                joint.wrench_slope[r, c] = 0.0
        if joint.sections > 0:
            add_film_slope(run, j, joint)
        add_contact_slope(run, j, joint)
        project_slope(run, joint)
    add_joint_slopes(run, v)
    add_gear_slopes(run, v)
    add_load_slopes(run)


@contracted
def add_rows(rows, factors, total, n, size):
    """Add up `n` rows, each times its factor, into the first `size` elements of `total`.

    This is the product of a symmetric matrix and a vector in an order that vectorises; a sum along
    a row would have to be done one term after the other. Six rows at once, as many as a joint has,
    so that `total` is read and written less often.
    """
    for a in range(size):
        total[a] = 0.0
    sixes = n - n % 6
    for b in range(0, sixes, 6):
        f0, f1, f2 = factors[b], factors[b + 1], factors[b + 2]
        f3, f4, f5 = factors[b + 3], factors[b + 4], factors[b + 5]
        for a in range(size):
            more = total[a] + f0 * rows[b, a] + f1 * rows[b + 1, a] + f2 * rows[b + 2, a]
            more = more + f3 * rows[b + 3, a] + f4 * rows[b + 4, a]
            total[a] = more + f5 * rows[b + 5, a]
    for b in range(sixes, n):
        factor = factors[b]
        for a in range(size):
            total[a] += factor * rows[b, a]


@reordered
def weighted_square(values, weights, n):
    """Sum of the squares of the first `n` values, each times its weight."""
    total = 0.0
    for a in range(n):
        total += values[a] * values[a] * weights[a]
    return total


@compiled
def _active_compliance(run, n):
    """M^-1 of the active coordinates, shape (n, n)."""
    return square(run.minv if n == run.nv else run.compliance, n)


@compiled
def _residual(run, h, n):
    """Write the residual v - base - h M^-1 tau_c; returns its squared norm, weighted by inertia."""
    trial = run.trial
    speed, base, inertia, error = trial[SPEED], trial[BASE], trial[INERTIA], trial[ERROR]
    add_rows(_active_compliance(run, n), trial[PUSH], error, n, n)
    for a in range(n):
        error[a] = speed[a] - base[a] - h * error[a]
    return weighted_square(error, inertia, n)


@compiled
def _evaluate_trial(run, q, v, h):
    """Evaluate tau_c and the residual at the velocities in `trial`; returns its squared norm."""
    n, touched = run.active, run.touched
    trial, tau = run.trial, run.velocity_forces
    for a in range(n):
        v[touched[a]] = trial[SPEED, a]
    evaluate_velocity_forces(run, q, v)
    for a in range(n):
        trial[PUSH, a] = tau[touched[a]]
    return _residual(run, h, SINGLE) if n == SINGLE else _residual(run, h, n)


@compiled
def _factor(run, h):
    """Invert I - h M^-1 d(tau_c)/dv, transposed, into `inverse`.

    By Gauss-Jordan elimination in place with partial pivoting.
    """
    n = run.active
    inverse, exchanged = run.inverse, run.exchanged
    compliance, slope = _active_compliance(run, n), run.slope
    # As M^-1 is symmetric, each row of the transposed product is a sum of rows of M^-1.
    for a in range(n):
        row = inverse[a]
        for b in range(n):
            row[b] = 0.0
        for c in range(n):
            factor = h * slope[c, a]
            if factor != 0.0:  # most coordinates exert no force on each other
                for b in range(n):
                    row[b] -= factor * compliance[c, b]
        row[a] += 1.0
    for k in range(n):
        best = k
        for a in range(k + 1, n):
            if abs(inverse[a, k]) > abs(inverse[best, k]):
                best = a
        exchanged[k] = best
        row = inverse[k]
        if best != k:
            exchanged_row = inverse[best]
            for b in range(n):
                row[b], exchanged_row[b] = exchanged_row[b], row[b]
        pivot = 1.0 / row[k]
        row[k] = 1.0
        for b in range(n):
            row[b] *= pivot
        for a in range(n):
            exchanged_row = inverse[a]
            factor = exchanged_row[k]
            if a != k and factor != 0.0:
                exchanged_row[k] = 0.0
                for b in range(n):
                    exchanged_row[b] -= factor * row[b]
    # Rows exchanged in the matrix are columns exchanged in its inverse, last first.
    for k in range(n - 1, -1, -1):
        best = exchanged[k]
        if best != k:
            for a in range(n):
                inverse[a, k], inverse[a, best] = inverse[a, best], inverse[a, k]
    run.factored = n


@compiled
def _newton_step(run, n):
    """Write the Newton step of the matrix inverted last into `trial`, and where it starts."""
    trial, inverse = run.trial, square(run.inverse, n)
    add_rows(inverse, trial[ERROR], trial[STEP], n, n)
    for a in range(n):
        trial[STEP, a] = -trial[STEP, a]
        trial[LAST, a] = trial[SPEED, a]


@compiled
def _gather_compliance(run, n):
    """Gather M^-1 of the active coordinates, if these are not all, into `compliance`."""
    touched, minv, compliance = run.touched, run.minv, run.compliance
    first = touched[0]
    if n == SINGLE and touched[SINGLE - 1] == first + SINGLE - 1:  # those of one virtual link
        compliance = square(compliance, SINGLE)
        for a in range(SINGLE):
            for b in range(SINGLE):
                compliance[a, b] = minv[first + a, first + b]
        return
    for a in range(n):
        row = minv[touched[a]]
        for b in range(n):
            compliance[a, b] = row[touched[b]]


@compiled
def _start_trials(run, base, v, n):
    """Start the trials from the velocities `v`; returns the squared tolerance of the residual."""
    touched, trial, inertia = run.touched, run.trial, run.inertia
    if n == run.nv:
        for a in range(n):
            trial[BASE, a], trial[SPEED, a], trial[INERTIA, a] = base[a], v[a], inertia[a]
    else:
        for a in range(n):
            i = touched[a]
            trial[BASE, a], trial[SPEED, a], trial[INERTIA, a] = base[i], v[i], inertia[i]
    size = weighted_square(trial[BASE], trial[INERTIA], n)
    return n * TOLERANCE * TOLERANCE + RELATIVE_TOLERANCE * RELATIVE_TOLERANCE * size


@compiled
def _take_step(run, q, v, h, part):
    """Take a part of the Newton step; returns the squared residual there."""
    trial = run.trial
    for a in range(run.active):
        trial[SPEED, a] = trial[LAST, a] + part * trial[STEP, a]
    return _evaluate_trial(run, q, v, h)


@compiled
def _refine(run, n):
    """Take a last Newton step without evaluating its residual, which is less than the last.

    The guesses of the next velocities are extrapolated from those found, and enlarge their errors.
    Not done for a single joint, whose impulses are then exactly those of the forces evaluated last
    (otherwise only within the tolerance). Nor where coordinates are left out, for these move by the
    forces evaluated last.
    """
    trial = run.trial
    _newton_step(run, n)
    for a in range(n):
        trial[SPEED, a] += trial[STEP, a]
        trial[ERROR, a] = 0.0


@compiled
def solve_velocity(run, q, base, v, h):
    """Solve for v on the coordinates that `find_velocity_forces` listed, by Newton's method.

    It starts from the `v` given. The matrix of an earlier step is used as long as each trial
    reduces the residual by `CONTRACTION`. A solve that does not converge takes the last velocity
    and is counted.
    """
    n = run.active
    if n < run.nv:
        _gather_compliance(run, n)
    limit = _start_trials(run, base, v, n)
    error, trials = _evaluate_trial(run, q, v, h), 1
    old = run.factored == n
    while not error <= limit:
        if trials >= MOST_TRIALS or not math.isfinite(error):
            run.unsolved += 1
            break
        if not old:
            _evaluate_slopes(run, q, v)
            _factor(run, h)
        _newton_step(run, SINGLE) if n == SINGLE else _newton_step(run, n)
        least, part = error, 1.0
        error, trials = _take_step(run, q, v, h, part), trials + 1
        if old:
            # A kept matrix that converges slowly, or not at all, is replaced in the next trial.
            old = error < CONTRACTION * CONTRACTION * least
            if not error < least:
                error = _take_step(run, q, v, h, 0.0)
            continue
        # Line search by halving, with a matrix of this state.
        while not error < least and part > LEAST_PART and trials < MOST_TRIALS:
            part *= 0.5
            error, trials = _take_step(run, q, v, h, part), trials + 1
        old = error < CONTRACTION * CONTRACTION * least
    several = n > SINGLE and n == run.nv == run.factored
    if several and REFINED * REFINED * limit < error <= limit:
        _refine(run, n)
    run.solves += 1
    run.iterations += trials
