"""Forces in the joints of a tree at many states at once: compiled.

First what the motion takes without accelerations of the coordinates; by the mass matrix, and forces
that hold points together, the accelerations to which the efforts lead; then the forces of the
bodies, summed up from the tips. `bodies` is a `tree.Bodies`; numbers of bodies as in `body_motion`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jointplay.host.numba_cache import njit, stamp
from jointplay.kernel.parts import internal
from jointplay.mechanism import body_motion
from jointplay.mechanism.body_motion import cross, ground, place, spin, turned, turned_back

_REGULAR = 1e-8
"""What is added to the matrix of held points, relative to its mean diagonal."""
_ACCURACY, _ITERATIONS = 1e-15, 10
"""Acceleration that is left, relative to what is to be held, and the most iterations."""


@internal
def _accelerate(bodies, v, i, a, turn, origin, omega, alpha, grow):
    """Angular acceleration of all bodies and their origins' acceleration, with a = q''."""
    parents, slides = bodies[0], bodies[1]
    for b in range(1, parents.size):
        p, rate, gain = parents[b], v[i, b - 1], a[b - 1]
        ax, ay, az = turn[b, 2], turn[b, 5], turn[b, 8]
        wx, wy, wz = omega[p, 0], omega[p, 1], omega[p, 2]
        x, y, z = (
            origin[b, 0] - origin[p, 0],
            origin[b, 1] - origin[p, 1],
            origin[b, 2] - origin[p, 2],
        )
        ex, ey, ez = alpha[p, 0], alpha[p, 1], alpha[p, 2]
        gx, gy, gz = _lifted(ex, ey, ez, wx, wy, wz, x, y, z)
        cx, cy, cz = cross(wx, wy, wz, ax, ay, az)
        if slides[b]:
            gx += 2.0 * rate * cx + gain * ax
            gy += 2.0 * rate * cy + gain * ay
            gz += 2.0 * rate * cz + gain * az
        else:
            ex, ey, ez = (
                ex + rate * cx + gain * ax,
                ey + rate * cy + gain * ay,
                ez + rate * cz + gain * az,
            )
        alpha[b, 0], alpha[b, 1], alpha[b, 2] = ex, ey, ez
        grow[b, 0], grow[b, 1], grow[b, 2] = grow[p, 0] + gx, grow[p, 1] + gy, grow[p, 2] + gz


@internal
def _lifted(ex, ey, ez, wx, wy, wz, x, y, z):
    """Acceleration of a point at (x, y, z) from an origin at rest: alpha x r + w x (w x r)."""
    tx, ty, tz = cross(ex, ey, ez, x, y, z)
    cx, cy, cz = cross(wx, wy, wz, x, y, z)
    cx, cy, cz = cross(wx, wy, wz, cx, cy, cz)
    return tx + cx, ty + cy, tz + cz


@internal
def _pushed(bodies, b, turn, origin, omega, alpha, grow):
    """Force that moves body b against gravity, and its mass's centre from the body's origin."""
    inertias, gravity = bodies[4], bodies[5]
    mass = inertias[b, 0]
    x, y, z = turned(turn, b, inertias[b, 1], inertias[b, 2], inertias[b, 3])
    gx, gy, gz = _lifted(
        alpha[b, 0], alpha[b, 1], alpha[b, 2], omega[b, 0], omega[b, 1], omega[b, 2], x, y, z
    )
    return (
        mass * (gx + grow[b, 0] - gravity[0]),
        mass * (gy + grow[b, 1] - gravity[1]),
        mass * (gz + grow[b, 2] - gravity[2]),
        x,
        y,
        z,
    )


@internal
def _needed(bodies, turn, origin, omega, alpha, grow, arm, force, moment):
    """Force, and moment about the world's origin, that each body's motion takes against gravity.

    `arm` gets each mass's centre from its body's origin.
    """
    inertias = bodies[4]
    for b in range(1, bodies[0].size):
        fx, fy, fz, x, y, z = _pushed(bodies, b, turn, origin, omega, alpha, grow)
        arm[b, 0], arm[b, 1], arm[b, 2] = x, y, z
        force[b, 0], force[b, 1], force[b, 2] = fx, fy, fz
        wx, wy, wz = turned_back(turn, b, omega[b, 0], omega[b, 1], omega[b, 2])
        ex, ey, ez = turned_back(turn, b, alpha[b, 0], alpha[b, 1], alpha[b, 2])
        lx, ly, lz = spin(inertias, b, wx, wy, wz)
        lx, ly, lz = cross(wx, wy, wz, lx, ly, lz)
        ex, ey, ez = spin(inertias, b, ex, ey, ez)
        lx, ly, lz = turned(turn, b, lx + ex, ly + ey, lz + ez)
        x, y, z = cross(x + origin[b, 0], y + origin[b, 1], z + origin[b, 2], fx, fy, fz)
        moment[b, 0], moment[b, 1], moment[b, 2] = lx + x, ly + y, lz + z


@internal
def _factor(matrix, size):
    """Replace the lower triangle of a symmetric matrix by L and D of L D L^T."""
    for r in range(size):
        for c in range(r):
            total = matrix[r, c]
            for k in range(c):
                total -= matrix[r, k] * matrix[c, k]
            matrix[r, c] = total  # L D for now
        pivot = matrix[r, r]
        for c in range(r):
            scaled = matrix[r, c] / matrix[c, c]
            pivot -= scaled * matrix[r, c]
            matrix[r, c] = scaled
        matrix[r, r] = pivot


@internal
def _solve(matrix, size, x):
    """Solve L D L^T x = x in place, L and D by `_factor`."""
    for r in range(size):
        for k in range(r):
            x[r] -= matrix[r, k] * x[k]
    for r in range(size):
        x[r] /= matrix[r, r]
    for r in range(size - 1, -1, -1):
        for k in range(r + 1, size):
            x[r] -= matrix[k, r] * x[k]


@internal
def _mass_matrix(bodies, turn, origin, arm, weight, first_moment, second, mass):
    """Lower triangle of the mass matrix, from what each body and those beyond it weigh.

    Moments are about the world's origin; `arm` has each mass's centre from its body's origin.
    """
    parents, slides, inertias = bodies[0], bodies[1], bodies[4]
    count = parents.size
    for b in range(1, count):
        m = inertias[b, 0]
        x, y, z = origin[b, 0] + arm[b, 0], origin[b, 1] + arm[b, 1], origin[b, 2] + arm[b, 2]
        weight[b] = m
        first_moment[b, 0], first_moment[b, 1], first_moment[b, 2] = m * x, m * y, m * z
        for r in range(3):  # R I R^T, column by column
            k = 3 * r
            lx, ly, lz = spin(inertias, b, turn[b, k], turn[b, k + 1], turn[b, k + 2])
            second[b, k], second[b, k + 1], second[b, k + 2] = turned(turn, b, lx, ly, lz)
        square = m * (x * x + y * y + z * z)
        second[b, 0] += square - m * x * x
        second[b, 4] += square - m * y * y
        second[b, 8] += square - m * z * z
        second[b, 1] -= m * x * y
        second[b, 3] -= m * x * y
        second[b, 2] -= m * x * z
        second[b, 6] -= m * x * z
        second[b, 5] -= m * y * z
        second[b, 7] -= m * y * z
    for b in range(count - 1, 0, -1):
        p = parents[b]
        ax, ay, az = turn[b, 2], turn[b, 5], turn[b, 8]
        hx, hy, hz = first_moment[b, 0], first_moment[b, 1], first_moment[b, 2]
        m = weight[b]
        if slides[b]:
            px, py, pz = m * ax, m * ay, m * az
            lx, ly, lz = cross(hx, hy, hz, ax, ay, az)
        else:
            ux, uy, uz = cross(origin[b, 0], origin[b, 1], origin[b, 2], ax, ay, az)
            px, py, pz = cross(ax, ay, az, hx, hy, hz)
            px, py, pz = px + m * ux, py + m * uy, pz + m * uz
            lx, ly, lz = turned(second, b, ax, ay, az)
            ux, uy, uz = cross(hx, hy, hz, ux, uy, uz)
            lx, ly, lz = lx + ux, ly + uy, lz + uz
        j = b
        for k in range(b):
            mass[b - 1, k] = 0.0
        while j > 0:
            mass[b - 1, j - 1] = _effort(slides, turn, origin, j, px, py, pz, lx, ly, lz)
            j = parents[j]
        if p > 0:
            weight[p] += m
            for k in range(3):
                first_moment[p, k] += first_moment[b, k]
            for k in range(9):
                second[p, k] += second[b, k]


@internal
def _effort(slides, turn, origin, b, px, py, pz, lx, ly, lz):
    """What a force and a moment about the world's origin do at the coordinate of body b."""
    ax, ay, az = turn[b, 2], turn[b, 5], turn[b, 8]
    if slides[b]:
        return ax * px + ay * py + az * pz
    x, y, z = cross(origin[b, 0], origin[b, 1], origin[b, 2], px, py, pz)
    return ax * (lx - x) + ay * (ly - y) + az * (lz - z)


@internal
def _hold(bodies, carriers, places, turn, origin, omega, alpha, grow, rows, drift):
    """Motion of held points against each other: Jacobian, and acceleration at constant speeds."""
    parents, slides = bodies[0], bodies[1]
    rows[:] = 0.0
    for f in range(carriers.size):
        b, row, sign = carriers[f], 3 * (f // 2), 1.0 - 2.0 * (f % 2)
        x, y, z = turned(turn, b, places[f, 9], places[f, 10], places[f, 11])
        gx, gy, gz = _lifted(
            alpha[b, 0], alpha[b, 1], alpha[b, 2], omega[b, 0], omega[b, 1], omega[b, 2], x, y, z
        )
        if sign > 0.0:
            drift[row] = drift[row + 1] = drift[row + 2] = 0.0
        drift[row] += sign * (gx + grow[b, 0])
        drift[row + 1] += sign * (gy + grow[b, 1])
        drift[row + 2] += sign * (gz + grow[b, 2])
        x, y, z = x + origin[b, 0], y + origin[b, 1], z + origin[b, 2]
        while b > 0:
            ax, ay, az = turn[b, 2], turn[b, 5], turn[b, 8]
            if not slides[b]:
                ax, ay, az = cross(ax, ay, az, x - origin[b, 0], y - origin[b, 1], z - origin[b, 2])
            rows[row, b - 1] += sign * ax
            rows[row + 1, b - 1] += sign * ay
            rows[row + 2, b - 1] += sign * az
            b = parents[b]


@internal
def _close(mass, rows, drift, solved, square, acceleration, push):
    """Forces `push` that hold all points, and the acceleration with them, which is changed.

    The matrix may be singular; the proximal iteration, as in Pinocchio, finds the smallest forces.
    """
    size, nv = rows.shape
    for r in range(size):
        for k in range(nv):
            solved[r, k] = rows[r, k]
        _solve(mass, nv, solved[r])
        for k in range(nv):
            drift[r] += rows[r, k] * acceleration[k]
    mu = 1e-100  # points that nothing can move need no force
    for r in range(size):
        push[r] = 0.0
        for s in range(r + 1):
            square[r, s] = 0.0
            for k in range(nv):
                square[r, s] += rows[r, k] * solved[s, k]
        mu += _REGULAR * square[r, r] / size
    for r in range(size):
        square[r, r] += mu
    _factor(square, size)
    guess = solved[size]
    for _ in range(_ITERATIONS):
        for r in range(size):
            guess[r] = mu * push[r] - drift[r]
        _solve(square, size, guess)
        change = largest = 0.0
        for r in range(size):
            change = max(change, abs(guess[r] - push[r]))
            largest = max(largest, abs(drift[r]))
            push[r] = guess[r]
        if mu * change <= _ACCURACY * largest:
            break
    for r in range(size):
        for k in range(nv):
            acceleration[k] += solved[r, k] * push[r]


@njit(cache=True, error_model="numpy")
def react(
    bodies,
    q,
    v,
    effort,
    first,
    end,
    wanted,
    carriers,
    places,
    acted,
    given,
    forces,
    holds,
):
    """Fill `forces` and `holds`; see `tree.Tree.reactions`.

    `wanted` and `acted`: bodies whose joints' forces are wanted, and on which `given` acts.
    """
    parents, slides = bodies[0], bodies[1]
    count, held = parents.size, 3 * (carriers.size // 2)
    nv = count - 1
    turn, origin, omega, speed = ground(count)
    alpha, grow = np.zeros((count, 3)), np.zeros((count, 3))
    force, moment, arm = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    weight, first_moment, second = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 9))
    mass, acceleration = np.empty((nv, nv)), np.empty(nv)
    rows, drift, push = np.empty((held, nv)), np.empty(held), np.empty(held)
    solved, square = np.empty((held + 1, max(nv, held))), np.empty((held, held))
    for i in range(first, end):
        place(bodies, q, v, i, turn, origin, omega, speed)
        acceleration[:] = 0.0
        _accelerate(bodies, v, i, acceleration, turn, origin, omega, alpha, grow)
        _needed(bodies, turn, origin, omega, alpha, grow, arm, force, moment)
        for w in range(acted.size):
            for k in range(3):
                force[acted[w], k] -= given[i, w, k]
                moment[acted[w], k] -= given[i, w, 3 + k]
        for b in range(count - 1, 0, -1):
            fx, fy, fz = force[b, 0], force[b, 1], force[b, 2]
            lx, ly, lz = moment[b, 0], moment[b, 1], moment[b, 2]
            acceleration[b - 1] = effort[i, b - 1] - _effort(
                slides, turn, origin, b, fx, fy, fz, lx, ly, lz
            )
            for k in range(3):
                force[parents[b], k] += force[b, k]
                moment[parents[b], k] += moment[b, k]
        _mass_matrix(bodies, turn, origin, arm, weight, first_moment, second, mass)
        _factor(mass, nv)
        _solve(mass, nv, acceleration)
        if held:
            _hold(bodies, carriers, places, turn, origin, omega, alpha, grow, rows, drift)
            _close(mass, rows, drift, solved, square, acceleration, push)
        _accelerate(bodies, v, i, acceleration, turn, origin, omega, alpha, grow)
        for b in range(1, count):
            fx, fy, fz, _, _, _ = _pushed(bodies, b, turn, origin, omega, alpha, grow)
            force[b, 0], force[b, 1], force[b, 2] = fx, fy, fz
        for w in range(acted.size):
            for k in range(3):
                force[acted[w], k] -= given[i, w, k]
        for f in range(carriers.size):
            sign = 1.0 - 2.0 * (f % 2)
            for k in range(3):
                force[carriers[f], k] -= sign * push[3 * (f // 2) + k]
                holds[i - first, f // 2, k] = push[3 * (f // 2) + k]
        for b in range(count - 1, 0, -1):
            for k in range(3):
                force[parents[b], k] += force[b, k]
        for j in range(wanted.size):
            for k in range(3):
                forces[i - first, j, k] = force[wanted[j], k]


stamp(react, (Path(__file__), Path(body_motion.__file__)))
