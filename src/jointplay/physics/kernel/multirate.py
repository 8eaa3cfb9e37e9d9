"""The multi-rate method: long macro steps for the arm's inertia, short micro steps for contacts.

1. `plan_macro_step` chooses the length of the next macro step and predicts the state in its middle.
2. Pinocchio evaluates the inverse mass matrix M^-1 and the free acceleration a_free (of gravity
   and motion alone, without the forces of this package) at that state.
3. `check_prediction` compares both with the parabolas in time through the last three middles. Too
   far off, the step is planned anew, shorter; otherwise the parabolas take the new middle in.
4. `macro_step` does micro steps of length dt in compiled code alone, M^-1 and a_free following
   their parabolas:

    solve for v_n:   v_n = v_half + dt/2 (a_free + M^-1 [tau(q_n, t_n) + tau_c(q_n, v_n)])
    v_half <- 2 v_n - v_half,      q_{n+1} = q_n + dt v_half

This is the leapfrog method in positions: second order, symplectic for elastic forces. Forces tau_c
that depend on velocity are taken at v_n, half way between the two half-step velocities, so that the
work of every force in a step is dt times its power at v_n, as exactly as v_n is solved for. Records
hold the state (q_n, v_n) and the forces at it. `adaptive` replaces 4 by micro steps of varying
length.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import compiled, reordered
from jointplay.physics.kernel.access import flat, record_failure
from jointplay.physics.kernel.constants import Status
from jointplay.physics.kernel.contact import add_dissipation, bend_at_start, commit_contacts
from jointplay.physics.kernel.drive import (
    add_drive_power,
    add_joint_losses,
    apply_drives,
    apply_servos,
    commit_bristles,
    commit_servos,
    complete_drives,
    prescribe_motion,
)
from jointplay.physics.kernel.film import add_film_losses
from jointplay.physics.kernel.gear import add_gear_losses, commit_gears
from jointplay.physics.kernel.layout import (
    ACCELERATION,
    DRIVE,
    ERROR,
    HALF,
    JERK,
    MARKS,
    MEAN,
    MIDDLE,
    MIDDLE_SPEED,
    POWERS,
    SPEED,
    SPEED_LIMIT,
    START_SPEED,
    STEP,
)
from jointplay.physics.kernel.load import add_load_work, apply_loads, find_load_powers
from jointplay.physics.kernel.loops import correct_drift, project_dynamics
from jointplay.physics.kernel.record import is_due, write_record
from jointplay.physics.kernel.rolling import advance_cages
from jointplay.physics.kernel.solve import (
    TOLERANCE,
    evaluate_velocity_forces,
    find_velocity_forces,
    solve_velocity,
    weighted_square,
)

# Macro steps: their length, the predicted path, and the parabolas of M^-1 and a_free.
#
# The distance of the new middle from the parabola through the three before it is the error
# estimate.


LARGEST_TURN = 0.02
"""Largest rotation of any joint in a macro step whose length the error estimate chooses [rad]."""
FEWEST_STEPS = 6
"""Micro steps that a macro step may have although joints turn further than `LARGEST_TURN`: for
fast machines with coarse steps."""
REFUSED = 4.0
"""Error of a macro step's middle, over the tolerance, beyond which the step is planned anew."""
LEAST_STEPS = 8
"""Shortest macro step planned after one that was ended early [micro steps]."""
GROWTH = 1.5
"""Largest ratio of a macro step's length to that of the one before."""
LEAST_APART = 0.3
"""Least distance of two middles, relative to the macro step, to draw a line through them."""
CHORD_STEPS = 4
"""Micro steps over which a chord replaces the parabola of the inverse mass matrix: the parabola's
coefficients do not fit into the nearest cache beside what the velocity solve needs there."""
LEAST_COMPLIANCE = 1e-14
"""Inverse inertia of a coordinate that is held, relative to the largest: it must not be zero."""
CHORD_PART = 0.25
"""Longest chord, relative to the macro step."""


@compiled
def _predict_path(run):
    """Predict the path of the next macro step, `run.macro` micro steps long, into `run.path`.

    From the present state positions follow a cubic (constant jerk). Of this path the state in the
    middle is what Pinocchio evaluates.
    """
    nv = run.nv
    path = run.path
    q, half, a = run.q, run.half, run.a
    elapsed = run.time - run.path_start
    if elapsed > 0.0:  # else the same step is planned anew
        # Rate of change of the mean acceleration from one macro step to the next: the jerk.
        apart = run.path_start + 0.5 * elapsed - run.mean_time
        smooth = run.touching == 0 and run.events == 0 and run.known_free > 1
        for i in range(nv):
            # The acceleration of a contact that lasts swings; its mean is what moves the arm.
            mean = (half[i] - path[HALF, i]) / elapsed
            jerk = 0.0
            if smooth:
                jerk = (mean - path[MEAN, i]) / apart
            path[ACCELERATION, i] = mean + 0.5 * elapsed * jerk if run.touching > 0 else a[i]
            path[JERK, i] = jerk
            path[MEAN, i] = mean
        run.mean_time = run.path_start + 0.5 * elapsed
    span = run.macro * run.dt
    s = 0.5 * span
    for i in range(nv):
        rise, jerk = path[ACCELERATION, i], path[JERK, i]
        speed = half[i] + 0.5 * run.dt_before * rise
        path[START_SPEED, i], path[HALF, i] = speed, half[i]
        path[MIDDLE, i] = q[i] + s * (speed + s * (0.5 * rise + s * jerk / 6.0))
        path[MIDDLE_SPEED, i] = speed + s * (rise + 0.5 * s * jerk)
    run.path_start, run.path_span = run.time, span


@compiled
def _next_macro_length(run):
    """Length of the next macro step in micro steps: as suggested, unless joints turn too far."""
    longest = run.until - run.step
    macro = min(longest, max(run.suggested // run.unit, 1) * run.unit)
    if run.fixed == 0 and run.fastest * macro * run.dt > LARGEST_TURN:
        units = int(LARGEST_TURN / (run.fastest * run.dt * run.unit))
        macro = max(units, FEWEST_STEPS // run.unit, 1) * run.unit
    return min(macro, longest)


@compiled
def plan_macro_step(run):
    """Choose the length of the next macro step and predict its path."""
    if run.nh > 0:
        correct_drift(run)
    run.macro = _next_macro_length(run)
    _predict_path(run)


@compiled
def _copy_inverse_mass(run):
    """Copy Pinocchio's inverse mass matrix to both triangles of `minv_rate`, free till a chord."""
    answer, minv = run.found_minv, run.minv_rate
    for i in range(run.nv):
        for k in range(i, run.nv):
            minv[i, k] = minv[k, i] = answer[i, k]


@compiled
def _find_path_error(run):
    """Estimate the error of the extrapolated M^-1 and a_free at the predicted middle.

    `run.path_error` is the difference between the acceleration that Pinocchio's values and the
    extrapolated ones give under the present forces, relative to the acceleration itself; -1 where
    fewer than two middles are known or a contact has begun or ended since.
    """
    nv = run.nv
    apart = run.path_start + 0.5 * run.path_span - run.middle_time
    square = apart * (apart + run.middles_apart)
    minv, free = run.minv_rate, run.found_free
    middle, slope = run.minv_middle, run.minv_slope
    curve, free_curve = run.minv_curve, run.free_curve
    free_middle, free_slope = run.free_middle, run.free_slope
    forces, effort, weights = (run.velocity_forces, run.drive, run.weights)
    loaded = run.load_forces
    run.path_error = -1.0
    if run.known_free < 2 or run.events > 0:
        return
    miss, acceleration, inertia = run.trial[ERROR], run.trial[SPEED], run.inertia
    for i in range(nv):
        miss[i] = free[i] - free_middle[i] - apart * free_slope[i] - square * free_curve[i]
        acceleration[i] = free[i]
    for k in range(nv):  # the matrices are symmetric
        force = forces[k] + effort[k] + loaded[k]
        for i in range(nv):
            change = apart * slope[k, i] + square * curve[k, i]
            miss[i] += (minv[k, i] - middle[k, i] - change) * force
            acceleration[i] += minv[k, i] * force
    wrong = total = 0.0
    for i in range(nv):
        wrong += weights[i] * miss[i] * miss[i] * inertia[i]
        total += weights[i] * acceleration[i] * acceleration[i] * inertia[i]
    if total > 0.0:
        run.path_error = math.sqrt(wrong / total)


@compiled
def _fit_parabola(values, middle, slope, curve, value, known, lengths):
    """Fit the parabola in time through `values` at a new middle and the last two middles.

    Newton's form: `slope` and `curve` get the first and second divided differences. `value` is set
    to the parabola at the start of the macro step. With one middle `known` it is a line; with none,
    a line with the slope of the last one.

    `lengths`: half of the macro step; from the last middle to this; from the one before to the last
    [s].
    """
    s, apart, before = -lengths[0], lengths[1], lengths[2]
    part, per_span = 1.0 / apart, 1.0 / (apart + before)  # a division takes as long as all the rest
    for i in range(values.size):
        bend = 0.0
        if known > 0:
            rise = (values[i] - middle[i]) * part
            bend = (rise - slope[i]) * per_span if known > 1 else 0.0
            slope[i] = rise
        curve[i], middle[i] = bend, values[i]
        value[i] = values[i] + s * (slope[i] + bend * (s + apart))


@compiled
def _find_inertia(run):
    """Find the inertia of each coordinate alone, 1/(M^-1)_ii, at the last middle."""
    middle, inertia, least = run.minv_middle, run.inertia, 0.0
    for i in range(run.nv):
        least = max(least, LEAST_COMPLIANCE * middle[i, i])
    for i in range(run.nv):
        inertia[i] = 1.0 / max(middle[i, i], least)


@compiled
def _accept_middle(run):
    """Fit the parabolas of M^-1 and a_free through Pinocchio's values at the predicted middle.

    Where a contact has begun or ended in between, velocities have jumped and a_free with them: its
    parabola begins anew, as a line that keeps the last slope.
    """
    span = run.path_span
    now = run.path_start + 0.5 * span
    apart = now - run.middle_time
    if not apart > LEAST_APART * span:
        run.known_middles = run.known_free = 0
    if run.events > 0:
        run.known_free = 0
    lengths = (0.5 * span, apart, run.middles_apart)
    _fit_parabola(
        flat(run.minv_rate), flat(run.minv_middle),
        flat(run.minv_slope), flat(run.minv_curve),
        flat(run.minv), run.known_middles, lengths,
    )  # fmt: skip
    _fit_parabola(
        run.found_free, run.free_middle, run.free_slope,
        run.free_curve, run.free, run.known_free, lengths,
    )  # fmt: skip
    _find_inertia(run)
    run.events = 0
    run.middle_time, run.middles_apart, run.chord_end = now, apart, run.path_start
    run.known_middles = min(run.known_middles + 1, 3)
    run.known_free = min(run.known_free + 1, 3)


@compiled
def check_prediction(run):
    """Accept Pinocchio's result, or plan a shorter macro step (`refused`); suggest the next length.

    The length follows the error by the usual rule, (tolerance/error)^(1/p), aimed at half the
    tolerance.
    """
    if run.nh > 0:
        path = run.path
        project_dynamics(run, path[MIDDLE], path[MIDDLE_SPEED])
    _copy_inverse_mass(run)
    _find_path_error(run)
    error, macro, unit = run.path_error, run.macro, run.unit
    run.refused = 0
    if run.fixed == 0 and macro > unit and error > REFUSED * run.tolerance:
        run.refused = 1
        run.macro = max(macro // (4 * unit), 1) * unit
        _predict_path(run)
        return
    if run.fixed == 0:
        factor = GROWTH
        if error > 0.0:
            # A parabola through three middles errs by the third power of the step, a line by its
            # square.
            order = 1.0 / 3.0 if run.known_free > 2 else 0.5
            factor = min(max((0.5 * run.tolerance / error) ** order, 0.25), GROWTH)
        best = int(macro * factor + 0.9)
        if macro == run.until - run.step and factor >= 1.0:
            # `until`, not its error, cut this macro step short.
            best = max(best, run.suggested)
        run.suggested = min(max(best, 1), run.longest)
    _accept_middle(run)


@compiled
def end_macro_step(run):
    """Measure the fastest rotation, and how far angles have departed from the predicted path."""
    nv = run.nv
    path, half, angular = run.path, run.half, run.angular
    elapsed = run.time - run.path_start
    run.fastest = run.departure = 0.0
    for i in range(nv):
        at = elapsed - 0.5 * run.dt_before
        expected = path[START_SPEED, i] + at * (path[ACCELERATION, i] + 0.5 * at * path[JERK, i])
        run.fastest = max(run.fastest, angular[i] * abs(half[i]))
        run.departure = max(run.departure, angular[i] * abs(half[i] - expected) * elapsed)


@compiled
def begin(run):
    """Take Pinocchio's M^-1 and a_free at the present state as the first known middle."""
    nv = run.nv
    path, half, a = run.path, run.half, run.a
    for i in range(nv):
        path[HALF, i], path[JERK, i] = half[i], 0.0
        path[ACCELERATION, i] = path[MEAN, i] = a[i]
    minv, middle = run.found_minv, run.minv_middle
    free, free_middle = run.found_free, run.free_middle
    for i in range(nv):
        free_middle[i] = free[i]
        for k in range(nv):
            middle[i, k] = minv[i, k] if i <= k else minv[k, i]
    _find_inertia(run)
    run.middle_time, run.departure = run.time, 0.0
    run.known_middles = run.known_free = 1
    run.mean_time = run.time


_NP = len(POWERS)
_RUN_AWAY = int(Status.RUN_AWAY)

LEAST_DONE = 2
"""Micro steps before which no macro step is ended early."""


@compiled
def _base_velocity(run, q, half, v, base, h):
    """Find `base`, the velocity v_n without the forces that the velocity solve finds.

    base = v_half + h (a_free + M^-1 tau), tau of the drives and servos, evaluated at a velocity
    extrapolated from the last acceleration. Prescribed coordinates are set to their reference.
    """
    nv = run.nv
    a, tau = run.a, run.tau
    free, minv = run.free, run.minv
    for i in range(nv):
        v[i] = half[i] + h * a[i]
        tau[i] = 0.0
    if run.prescribed != 0:
        # The half-step velocity of a prescribed coordinate is the one that led it from its last
        # position to the reference.
        for drive in run.drives:
            if drive.armature > 0.0:
                half[drive.coordinate] -= q[drive.coordinate] / run.dt_before
        prescribe_motion(run, q, v, run.time)
        for drive in run.drives:
            if drive.armature > 0.0:
                half[drive.coordinate] += q[drive.coordinate] / run.dt_before
    apply_drives(run, q, v, run.time, tau)
    apply_servos(run, q, v, run.time, tau)
    for i in range(nv):
        base[i] = half[i] + h * free[i]
    for drive in run.drives:
        k = drive.coordinate
        row, moved = minv[k], h * tau[k]
        for i in range(nv):
            base[i] += moved * row[i]
    if run.prescribed != 0:
        for drive in run.drives:
            if drive.armature > 0.0:
                base[drive.coordinate] = v[drive.coordinate]


@reordered
def _sizes(v, forces, pushed, nv):
    """Sum of all speeds, and the product tau_c . M^-1 tau_c of forces and what they accelerate."""
    size = square = 0.0
    for i in range(nv):
        size += abs(v[i])
        square += forces[i] * pushed[i]
    return size, square


@compiled
def _complete_velocities(run, half, v, base, h):
    """Find all velocities and accelerations from those of the solve; returns the sum of speeds.

    The solve found v on the coordinates on which forces depend on velocity; these forces move the
    others, too. M^-1 tau_c is kept in `pushed`.
    """
    nv, n = run.nv, run.active
    a, forces, minv = run.a, run.velocity_forces, run.minv
    pushed, trial, part = run.pushed[0], run.trial, 1.0 / h
    # The residual of the last trial, v - base - h M^-1 tau_c, has the product already.
    if n == nv:
        for i in range(nv):
            pushed[i] = (trial[SPEED, i] - trial[ERROR, i] - base[i]) * part
    else:
        touched = run.touched
        for i in range(nv):
            if trial[MARKS, i] == 0.0:
                pushed[i] = 0.0
                for b in range(n):
                    pushed[i] += forces[touched[b]] * minv[i, touched[b]]
        for b in range(n):
            i = touched[b]
            pushed[i] = (trial[SPEED, b] - trial[ERROR, b] - base[i]) * part
    for i in range(nv):
        v[i] = base[i] + h * pushed[i]
        a[i] = (v[i] - half[i]) * part
    size, square = _sizes(v, forces, pushed, nv)
    run.moved_by_forces = math.sqrt(max(square, 0.0))
    return size


@compiled
def _find_powers(run, v):
    """Find the powers of all forces at the state, and the effort of prescribed motion.

    That effort is armature times the difference between the prescribed acceleration, already in
    `run.drive`, and the one without the drive.
    """
    nv = run.nv
    for i in range(_NP):
        run.power[i] = 0.0
    complete_drives(run, v)
    add_drive_power(run, v)
    add_joint_losses(run, v)
    add_gear_losses(run, v)
    find_load_powers(run, v)
    for j in range(run.nj):
        joint = run.joints[j]
        if joint.touching != 0:
            add_dissipation(run, j, joint)
            if joint.sections > 0:
                add_film_losses(run, j, joint)
    if run.prescribed == 0:
        return
    effort, minv = run.drive, run.minv
    free, tau, forces = run.free, run.tau, run.velocity_forces
    for row in run.drives:
        if row.armature > 0.0:
            i = row.coordinate
            acceleration = free[i]
            for k in range(nv):
                acceleration += minv[i, k] * (tau[k] + forces[k])
            effort[i] -= row.armature * acceleration
            run.power[DRIVE] += effort[i] * v[i]


@compiled
def _choose_guess(run, h):
    """Update the divided differences of `pushed`, and choose the next guess: parabola or line.

    Whichever would have come nearer to the value just found. But extrapolating a parabola enlarges
    the errors of the solves sevenfold, a line threefold: where the line was off by no more than
    these errors it is kept.
    """
    dt, span, pushed = run.dt_before, run.dt_before + run.pushed_dt, run.pushed
    now, slope, before, curve = pushed[0], pushed[1], pushed[2], pushed[3]
    off, further = run.trial[ERROR], run.trial[STEP]
    part, per_span = 1.0 / dt, 1.0 / span
    for i in range(run.nv):
        rise = (now[i] - before[i]) * part
        off[i] = rise - slope[i]
        further[i] = off[i] - span * curve[i]
        curve[i], slope[i] = off[i] * per_span, rise
    straight = weighted_square(off, run.inertia, run.nv)
    bent = weighted_square(further, run.inertia, run.nv)
    least = run.active * (TOLERANCE / (h * dt)) ** 2
    run.pushed_bends = 1 if straight > max(bent, least) else 0
    run.pushed_dt = dt


@compiled
def evaluate(run):
    """Find v_n, all forces and their powers at the present position and time."""
    nv = run.nv
    q, v, half = run.q, run.v, run.half
    base = run.scratch
    forces = run.velocity_forces
    h = 0.5 * run.dt_before
    # 1. What does not depend on velocity: drives, gravity, inertia, and elastic loads.
    _base_velocity(run, q, half, v, base, h)
    find_velocity_forces(run, q, half)
    if run.nl > 0:
        apply_loads(run, base, h)
    # 2. A first guess, extrapolated from M^-1 tau_c of the last steps. A state that ends one macro
    # step and begins the next is evaluated with both parabolas: the first result is then the best
    # guess for the second.
    pushed, new = run.pushed, run.time != run.evaluated_at
    if new:
        dt = run.dt_before
        bend = dt * (dt + run.pushed_dt) if run.pushed_bends != 0 else 0.0
        for i in range(nv):
            pushed[2, i] = pushed[0, i]
            guess = pushed[0, i] + dt * pushed[1, i] + bend * pushed[3, i]
            v[i] = base[i] + h * guess
    else:
        for i in range(nv):
            v[i] = base[i] + h * pushed[0, i]
    # 3. The velocity solve, and what follows from it.
    if run.active > 0:
        solve_velocity(run, q, base, v, h)
    else:
        for i in range(nv):
            forces[i] = 0.0
    run.evaluated_at = run.time
    size = _complete_velocities(run, half, v, base, h)
    if new:
        _choose_guess(run, h)
    _find_powers(run, v)
    if not size < SPEED_LIMIT:  # true for NaN as well
        record_failure(run, _RUN_AWAY, 0)


@compiled
def _begin_chord(value, rate, middle, slope, curve, s, apart, span, dt):
    """Begin a chord: find the rates that lead the values to their parabola in `span` [s].

    The chord ends `s` [s] after the middle; the values take its first step, `dt` long.
    """
    square, part = s * (s + apart), 1.0 / span  # a division takes as long as all the rest
    for i in range(value.size):
        rate[i] = part * (middle[i] + s * slope[i] + square * curve[i] - value[i])
        value[i] += dt * rate[i]


@compiled
def _begin_chords(run, span, dt):
    """Begin chords `span` long of the parabolas of M^-1 and a_free, and follow them for `dt`."""
    run.chord_end = run.time + span
    s, apart = run.chord_end - run.middle_time, run.middles_apart
    _begin_chord(
        run.free, run.free_rate, run.free_middle,
        run.free_slope, run.free_curve, s, apart, span, dt,
    )  # fmt: skip
    _begin_chord(
        flat(run.minv), flat(run.minv_rate),
        flat(run.minv_middle), flat(run.minv_slope),
        flat(run.minv_curve), s, apart, span, dt,
    )  # fmt: skip


@compiled
def _advance(value, rate, dt):
    """Advance values at their rates by `dt`."""
    for i in range(value.size):
        value[i] += dt * rate[i]


@compiled
def step_positions(run, dt):
    """Advance positions, half-step velocities, M^-1 and a_free from the state evaluated by `dt`.

    v_half <- v_n + (dt/dt_before) (v_n - v_half), which is 2 v_n - v_half for equal steps.
    """
    nv = run.nv
    q, v, half = run.q, run.v, run.half
    ratio = dt / run.dt_before
    for i in range(nv):
        half[i] = v[i] + ratio * (v[i] - half[i])
    advance_cages(run, half, dt)
    for i in range(nv):
        q[i] += dt * half[i]
    if run.time + 0.5 * dt > run.chord_end:
        _begin_chords(run, max(min(CHORD_STEPS * dt, CHORD_PART * run.path_span), dt), dt)
    else:
        _advance(run.free, run.free_rate, dt)
        _advance(flat(run.minv), flat(run.minv_rate), dt)
    run.dt_before = dt


@compiled
def add_work(run, duration):
    """Add the works of all forces at their present powers over `duration` [s] to the totals."""
    for i in range(_NP):
        run.work[i] += duration * run.power[i]
    if run.nl > 0:
        add_load_work(run, duration)


@compiled
def commit_memories(run, before, after):
    """Accept the history of gears, servos, bristles and contacts as that of the present state.

    Its forces are taken to act from `before` [s] before it until `after` [s] after it.
    """
    commit_gears(run)
    commit_servos(run)
    commit_bristles(run, run.v, after)
    for j in range(run.nj):
        commit_contacts(run, j, run.joints[j], before + after, after)
    run.bent_at = run.time + after


@compiled
def _commit_state(run, dt, recorded):
    """Accept the state just evaluated as one of the trajectory, and record it if asked to.

    Its forces do work from half a step before it to half of the next step, `dt`, after it; the
    first state has no step before it (`fresh`).
    """
    before = 0.5 * run.dt_before if run.fresh == 0 else 0.0
    add_work(run, before)
    commit_memories(run, before, 0.5 * dt)
    if recorded:
        write_record(run)
    add_work(run, 0.5 * dt)
    run.fresh = 0


@compiled
def macro_step(run):
    """Do the micro steps of a macro step, each `run.dt` long, until it leaves its predicted path.

    That is how an impact, which no prediction foresees, ends its macro step.
    """
    run.macros += 1
    for k in range(run.macro):
        evaluate(run)
        _commit_state(run, run.dt, is_due(run, run.step))
        if run.status != 0:
            return
        step_positions(run, run.dt)
        run.step += 1
        run.time = run.step * run.dt
        end_macro_step(run)
        if run.departure > run.departure_limit and k + 1 >= LEAST_DONE:
            return


@compiled
def synchronize(run):
    """Evaluate velocity and forces at the present time, and complete the work up to it."""
    evaluate(run)
    if run.fresh == 0:
        add_work(run, 0.5 * run.dt_before)


@compiled
def record_last_state(run):
    """Record the state at the end of the last macro step."""
    evaluate(run)
    _commit_state(run, 0.0, True)


@compiled
def restart(run):
    """Discard the history of the integration, after q and v were set from outside."""
    nv = run.nv
    v, half, a = run.v, run.half, run.a
    run.touching = run.known_middles = run.known_free = run.events = run.known_a = 0
    run.moved = 0.0
    run.path_start = run.time
    run.dt_before = run.dt
    for i in range(nv):
        half[i], a[i] = v[i], 0.0


@compiled
def start_half_step(run):
    """Start from a given state (q, v): find the forces at it, and `half`, v half a step before."""
    if run.nh > 0:
        project_dynamics(run, run.q, run.v)
    nv = run.nv
    q, v, half = run.q, run.v, run.half
    a, tau, forces = run.a, run.tau, run.velocity_forces
    free, minv = run.found_free, run.found_minv
    if run.prescribed != 0:
        prescribe_motion(run, q, v, run.time)
    for i in range(nv):
        tau[i] = 0.0
    apply_drives(run, q, v, run.time, tau)
    apply_servos(run, q, v, run.time, tau)
    find_velocity_forces(run, q, v)
    if run.time == 0.0:
        for j in range(run.nj):
            joint = run.joints[j]
            if joint.touching != 0 and joint.bristles != 0:
                bend_at_start(run, j, joint)
    evaluate_velocity_forces(run, q, v)
    loaded = run.load_forces
    for i in range(nv):
        tau[i] += loaded[i]
    pushed = run.pushed[0]  # from which the first solve starts
    for i in range(nv):
        a[i], pushed[i] = free[i], 0.0
        for k in range(nv):
            compliance = minv[i, k] if i <= k else minv[k, i]
            a[i] += compliance * (tau[k] + forces[k])
            pushed[i] += compliance * forces[k]
        half[i] = v[i] - 0.5 * run.dt * a[i]
    begin(run)
    run.fresh = 1


@compiled
def advance(run):
    """Do the planned macro step with Pinocchio's result, and plan the next.

    If the prediction is refused, a shorter step is planned instead, for which Pinocchio is asked
    again.
    """
    check_prediction(run)
    if run.refused != 0:
        return
    first, macro = run.step, run.macro
    macro_step(run)
    steps = run.step - first
    if run.fixed == 0 and steps < macro:
        run.suggested = min(max(2 * steps, LEAST_STEPS), run.longest)
    if run.status == 0 and run.step < run.until:
        plan_macro_step(run)
