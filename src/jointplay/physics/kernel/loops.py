"""Loops without clearance: inverse mass matrix and free acceleration of the closed mechanism.

Points p and p' are held together: J a + g = 0, J the Jacobian of p - p', g its acceleration at
constant speeds. Starting from Pinocchio's M^-1 and a of the open tree, the rows j of J are imposed
one after the other,

    u = M^-1 j / sqrt(j M^-1 j),    a <- a - u (j a + g) / sqrt(j M^-1 j),    M^-1 <- M^-1 - u u^T

the row with the largest j M^-1 j first: in effect a pivoted Cholesky factorisation of J M^-1 J^T.
Rows that depend linearly on others are left with j M^-1 j = 0 and are skipped. The same steps
correct the drift of loops in position and velocity.

Compiled apart as `loops`, for runs that have some; the functions without underscore call it.
"""

from __future__ import annotations

from jointplay.base.compiler import carray, compiled
from jointplay.physics.kernel.access import flat, run_at, run_part
from jointplay.physics.kernel.frames import (
    add,
    cross,
    find_body_rates,
    get_vector,
    matrix_times_vector,
    place_bodies,
    point_acceleration,
)

REDUNDANT = 1e-10
"""Value of j M^-1 j, relative to the first row's, below which a row is redundant."""


@compiled
def _add_point_rows(run, k, sign, at, place, residual, moving):
    """Add one point of held pair k to its constraint rows, with `sign`, and to `residual`.

    The residual gets the point's acceleration at constant speeds if `moving`, else its position.
    """
    rows = run.loop_rows
    columns, bodies = run.world_jacobian, run.bodies
    arm = matrix_times_vector(bodies[at].rotation, place[0], place[1], place[2])
    point = add(get_vector(bodies[at].origin, 0), arm)
    value = point_acceleration(bodies[at], arm) if moving else point
    for r in range(3):
        residual[3 * k + r] += sign * value[r]
    b = at
    while b > 0:
        i = bodies[b].coordinate
        column = add(get_vector(columns[i], 0), cross(get_vector(columns[i], 3), point))
        for r in range(3):
            rows[3 * k + r, i] += sign * column[r]
        b = bodies[b].parent


@compiled
def _find_rows(run, residual, moving):
    """Find the constraint rows of all pairs and their residuals, once the bodies are placed."""
    rows = flat(run.loop_rows)
    for i in range(rows.size):
        rows[i] = 0.0
    for i in range(3 * run.nh):
        residual[i] = 0.0
    for k in range(run.nh):
        hold = run.holds[k]
        _add_point_rows(run, k, 1.0, hold.body, hold.place, residual, moving)
        _add_point_rows(run, k, -1.0, hold.partner, hold.partner_place, residual, moving)


@compiled
def _inverse_mass_of(rows, minv, r):
    """j M^-1 j of row r."""
    total = 0.0
    for i in range(minv.shape[0]):
        if rows[r, i] != 0.0:
            for k in range(minv.shape[0]):
                total += rows[r, i] * minv[i, k] * rows[r, k]
    return total


@compiled
def _constrain(run, minv, residual, x):
    """Impose all rows on `minv`, and correct both rows of x (2, nv) by their residuals."""
    nv, size = run.nv, 3 * run.nh
    rows = run.loop_rows
    first = 0.0
    for step in range(size):
        # The row with the largest j M^-1 j that is left, unless all are redundant.
        best, most = -1, 0.0
        for r in range(size):
            mass = _inverse_mass_of(rows, minv, r)
            if mass > most:
                best, most = r, mass
        if step == 0:
            first = most
        if best < 0 or most <= REDUNDANT * first:
            return
        u = run.scratch
        for i in range(nv):
            u[i] = 0.0
            for k in range(nv):
                u[i] += minv[i, k] * rows[best, k]
        # Correct x so that the row holds, and take its direction out of M^-1.
        for column in range(2):
            open_by = residual[column, best]
            for i in range(nv):
                open_by += rows[best, i] * x[column, i]
            for i in range(nv):
                x[column, i] -= u[i] * (open_by / most)
        for i in range(nv):
            for k in range(nv):
                minv[i, k] -= u[i] * u[k] / most


@compiled
def _project_dynamics(run, q, v):
    """See `project_dynamics`."""
    nv = run.nv
    open_minv, free = run.open_minv, run.open_free
    minv, acceleration = run.found_minv, run.found_free
    x, residual = run.loop_correction, run.loop_residual
    place_bodies(run, q)
    find_body_rates(run, v)
    _find_rows(run, residual[0], True)
    for i in range(nv):
        x[0, i], x[1, i] = free[i], 0.0
        for k in range(nv):
            minv[i, k] = open_minv[i, k] if i <= k else open_minv[k, i]
    _constrain(run, minv, residual, x)
    for i in range(nv):
        acceleration[i] = x[0, i]


@compiled
def _correct_drift(run):
    """See `correct_drift`."""
    nv = run.nv
    q, half, a = run.q, run.half, run.a
    open_minv, minv = run.open_minv, run.loop_minv
    x, residual = run.loop_correction, run.loop_residual
    place_bodies(run, q)
    _find_rows(run, residual[0], False)
    for r in range(3 * run.nh):
        residual[1, r] = 0.0
    for i in range(nv):
        x[0, i], x[1, i] = 0.0, half[i] + 0.5 * run.dt_before * a[i]
        for k in range(nv):
            minv[i, k] = open_minv[i, k] if i <= k else open_minv[k, i]
    _constrain(run, minv, residual, x)
    for i in range(nv):
        q[i] += x[0, i]
        half[i] = x[1, i] - 0.5 * run.dt_before * a[i]


_PROJECT, _CORRECT = range(2)


@compiled
def loops(address, q, v, _tau, _time, task):
    """Carry out one of the tasks above (`access.RUN_PART`)."""
    run = run_at(address)
    if task == _PROJECT:
        nv = run.nv
        _project_dynamics(run, carray(q, (nv,)), carray(v, (nv,)))
    else:
        _correct_drift(run)


@compiled
def project_dynamics(run, q, v):
    """Find the closed mechanism's `found_minv` and `found_free` at the state (q, v)."""
    run_part(run.loop_part, run, q, v, v, 0.0, _PROJECT)


@compiled
def correct_drift(run):
    """Correct the drift of the loops since the last macro step, in positions and velocities."""
    run_part(run.loop_part, run, run.q, run.q, run.q, 0.0, _CORRECT)
