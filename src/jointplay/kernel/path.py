"""Macro steps: how long they are, where they lead, and what Pinocchio says of their middle.

The inverse mass matrix and the acceleration without forces follow parabolas in time through the
middles of this macro step and of the last two. How far the new middle lies off the parabola of the
three before it is the error estimate.
"""

from __future__ import annotations

import math

from jointplay.kernel.access import floats, matrix
from jointplay.kernel.loops import close, project
from jointplay.kernel.parts import internal
from jointplay.kernel.solve import LEAST_COMPLIANCE

(
    PLACE, SPEED, ACCELERATION, MIDDLE, MIDDLE_SPEED, HALF, JERK, MEAN, ROWS,
) = range(9)  # fmt: skip
"""Rows of `run.path`: the state at the start of the predicted path and what changes it, the state
in its middle, `half` at its start, and the mean acceleration of the last macro step."""

LARGEST_TURN = 0.02
"""Angle by which no joint turns further in a macro step that an error estimate chooses [rad]."""

FEWEST_STEPS = 6
"""Steps that a macro step has although joints turn further: coarse steps of fast machines."""

REFUSED = 4.0
"""A macro step whose middle is so many times the tolerance off is planned anew."""

LEAST_STEPS = 8
"""Macro steps are planned no shorter than this many steps where one has been ended early."""

GROWTH = 1.5
"""By how much a macro step is longer than the one before at most."""

LEAST_APART = 0.3
"""Middles nearer to each other than this, relative to the macro step, do not make a line."""


@internal
def _predict(run):
    """Predict the path of the next macro step, `run.macro` micro steps long."""
    nv = run.nv
    path = matrix(run.path, ROWS, nv)
    q, half, a = floats(run.q, nv), floats(run.half, nv), floats(run.a, nv)
    done = run.time - run.path_start
    if done > 0.0:  # else planned anew
        apart = run.path_start + 0.5 * done - run.mean_time
        smooth = run.touching == 0 and run.events == 0 and run.known_free > 1
        for i in range(nv):
            # The acceleration of a contact that lasts swings; its mean is what moves the arm.
            mean = (half[i] - path[HALF, i]) / done
            jerk = 0.0
            if smooth:
                jerk = (mean - path[MEAN, i]) / apart
            path[ACCELERATION, i] = mean + 0.5 * done * jerk if run.touching > 0 else a[i]
            path[JERK, i] = jerk
            path[MEAN, i] = mean
        run.mean_time = run.path_start + 0.5 * done
    span = run.macro * run.dt
    s = 0.5 * span
    for i in range(nv):
        rise, jerk = path[ACCELERATION, i], path[JERK, i]
        speed = half[i] + 0.5 * run.dt_before * rise
        path[PLACE, i], path[SPEED, i], path[HALF, i] = q[i], speed, half[i]
        path[MIDDLE, i] = q[i] + s * (speed + s * (0.5 * rise + s * jerk / 6.0))
        path[MIDDLE_SPEED, i] = speed + s * (rise + 0.5 * s * jerk)
    run.path_start, run.path_span = run.time, span


@internal
def _bounded(run):
    """Length of the next macro step in steps: as wished, unless joints turn too far."""
    longest = run.until - run.step
    macro = min(longest, max(run.wish // run.unit, 1) * run.unit)
    if run.fixed == 0 and run.fastest * macro * run.dt > LARGEST_TURN:
        units = int(LARGEST_TURN / (run.fastest * run.dt * run.unit))
        macro = max(units, FEWEST_STEPS // run.unit, 1) * run.unit
    return min(macro, longest)


@internal
def plan(run):
    """Choose the length of the next macro step and predict its path."""
    if run.nh > 0:
        close(run)
    run.macro = _bounded(run)
    _predict(run)


@internal
def _find_path_error(run):
    """Compare Pinocchio's answer at the predicted middle with the parabola through the last three.

    The difference of the accelerations is `run.path_error`, relative to the whole acceleration; -1
    where there is no line, or velocities have jumped since.
    """
    nv = run.nv
    apart = run.path_start + 0.5 * run.path_span - run.middle_time
    square = apart * (apart + run.middles_apart)
    answer, found_free = matrix(run.found_minv, nv, nv), floats(run.found_free, nv)
    middle, slope = matrix(run.minv_middle, nv, nv), matrix(run.minv_slope, nv, nv)
    curve, free_curve = matrix(run.minv_curve, nv, nv), floats(run.free_curve, nv)
    free_middle, free_slope = floats(run.free_middle, nv), floats(run.free_slope, nv)
    push, effort, weights = (
        floats(run.contact_push, nv),
        floats(run.drive, nv),
        floats(run.weights, nv),
    )
    loaded = floats(run.load_push, nv)
    run.path_error = -1.0
    if run.known_free < 2 or run.events > 0:
        return
    wrong = whole = least = 0.0
    for i in range(nv):
        least = max(least, LEAST_COMPLIANCE * middle[i, i])
    for i in range(nv):
        miss = found_free[i] - free_middle[i] - apart * free_slope[i] - square * free_curve[i]
        acceleration = found_free[i]
        for k in range(nv):
            value = answer[i, k] if i <= k else answer[k, i]
            force = push[k] + effort[k] + loaded[k]
            change = apart * slope[i, k] + square * curve[i, k]
            miss += (value - middle[i, k] - change) * force
            acceleration += value * force
        wrong += weights[i] * miss * miss / max(middle[i, i], least)
        whole += weights[i] * acceleration * acceleration / max(middle[i, i], least)
    if whole > 0.0:
        run.path_error = math.sqrt(wrong / whole)


@internal
def _draw(answer, middle, slope, curve, value, rate, known, lengths):
    """Draw the parabola through a new middle and the last two `known`; begin at the step's start.

    `lengths`: half of the macro step, and how far apart the last two middles and those before are.
    """
    s, apart, before = -lengths[0], lengths[1], lengths[2]
    for i in range(answer.size):
        bend = 0.0
        if known > 0:
            rise = (answer[i] - middle[i]) / apart
            bend = (rise - slope[i]) / (apart + before) if known > 1 else 0.0
            slope[i] = rise
        else:
            slope[i] = 0.0
        curve[i], middle[i] = bend, answer[i]
        value[i] = answer[i] + s * (slope[i] + bend * (s + apart))
        rate[i] = slope[i] + bend * (2.0 * s + apart)


@internal
def _take_middle(run):
    """Take Pinocchio's answer at the predicted middle, and draw the parabola through the last ones.

    Where a contact has begun or ended in between, velocities have jumped, and the acceleration
    without forces with them: its line is then level.
    """
    nv, span = run.nv, run.path_span
    now = run.path_start + 0.5 * span
    apart = now - run.middle_time
    if not apart > LEAST_APART * span:
        run.known_middles = run.known_free = 0
    if run.events > 0:
        run.known_free = 0
    lengths = (0.5 * span, apart, run.middles_apart)
    answer = matrix(run.found_minv, nv, nv)
    for i in range(nv):
        for k in range(i):
            answer[i, k] = answer[k, i]
    _draw(
        floats(run.found_minv, nv * nv), floats(run.minv_middle, nv * nv),
        floats(run.minv_slope, nv * nv), floats(run.minv_curve, nv * nv),
        floats(run.minv, nv * nv), floats(run.minv_rate, nv * nv), run.known_middles, lengths,
    )  # fmt: skip
    _draw(
        floats(run.found_free, nv), floats(run.free_middle, nv), floats(run.free_slope, nv),
        floats(run.free_curve, nv), floats(run.free, nv), floats(run.free_rate, nv),
        run.known_free, lengths,
    )  # fmt: skip
    run.events = 0
    run.middle_time, run.middles_apart = now, apart
    run.known_middles = min(run.known_middles + 1, 3)
    run.known_free = min(run.known_free + 1, 3)


@internal
def judge(run):
    """Take Pinocchio's answer, or plan a shorter macro step where it is too far from expected.

    Then `refused` is set.
    """
    if run.nh > 0:
        path = matrix(run.path, ROWS, run.nv)
        project(run, path[MIDDLE], path[MIDDLE_SPEED])
    _find_path_error(run)
    error, macro, unit = run.path_error, run.macro, run.unit
    run.refused = 0
    if run.fixed == 0 and macro > unit and error > REFUSED * run.tolerance:
        run.refused = 1
        run.macro = max(macro // (4 * unit), 1) * unit
        _predict(run)
        return
    if run.fixed == 0:
        factor = GROWTH
        if error > 0.0:
            order = 1.0 / 3.0 if run.known_free > 2 else 0.5
            factor = min(max((0.5 * run.tolerance / error) ** order, 0.25), GROWTH)
        best = int(macro * factor + 0.9)
        if macro == run.until - run.step and factor >= 1.0:
            best = max(best, run.wish)  # it was not this macro step's own error that cut it short
        run.wish = min(max(best, 1), run.longest)
    _take_middle(run)


@internal
def leave(run):
    """See how fast angles change at the end of a macro step, and how far off its path it ended."""
    nv = run.nv
    path, half, turning = matrix(run.path, ROWS, nv), floats(run.half, nv), floats(run.turning, nv)
    done = run.time - run.path_start
    run.fastest = run.departure = 0.0
    for i in range(nv):
        at = done - 0.5 * run.dt_before
        expected = path[SPEED, i] + at * (path[ACCELERATION, i] + 0.5 * at * path[JERK, i])
        run.fastest = max(run.fastest, turning[i] * abs(half[i]))
        run.departure = max(run.departure, turning[i] * abs(half[i] - expected) * done)


@internal
def begin(run):
    """Let inverse mass matrix, free acceleration and path begin at the state just evaluated."""
    nv = run.nv
    path, half, a = matrix(run.path, ROWS, nv), floats(run.half, nv), floats(run.a, nv)
    for i in range(nv):
        path[HALF, i], path[JERK, i] = half[i], 0.0
        path[ACCELERATION, i] = path[MEAN, i] = a[i]
    answer, middle = matrix(run.found_minv, nv, nv), matrix(run.minv_middle, nv, nv)
    free, free_middle = floats(run.found_free, nv), floats(run.free_middle, nv)
    for i in range(nv):
        free_middle[i] = free[i]
        for k in range(nv):
            middle[i, k] = answer[i, k] if i <= k else answer[k, i]
    run.middle_time, run.departure = run.time, 0.0
    run.known_middles = run.known_free = 1
    run.mean_time = run.time
