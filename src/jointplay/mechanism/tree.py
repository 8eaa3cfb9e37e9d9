"""Bodies of a Pinocchio model at many states at once: motion, energies, forces in the joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.core.compiler import internal, njit, stamp
from jointplay.mechanism.model import z_to

# Where the bodies of a tree are and how fast they move, at many states at once: compiled.
#
# `bodies` is a `tree.Bodies`. Bodies are numbered from 1, their parents first; 0 is the ground.


@internal
def times(a, i, b, j, c, k):
    """Product of rotations c[k] = a[i] b[j], row by row."""
    for r in (0, 3, 6):
        x, y, z = a[i, r], a[i, r + 1], a[i, r + 2]
        for s in range(3):
            c[k, r + s] = x * b[j, s] + y * b[j, 3 + s] + z * b[j, 6 + s]


@internal
def rotated(a, i, x, y, z):
    """Vector a[i] (x, y, z) of a rotation a[i]."""
    return (
        a[i, 0] * x + a[i, 1] * y + a[i, 2] * z,
        a[i, 3] * x + a[i, 4] * y + a[i, 5] * z,
        a[i, 6] * x + a[i, 7] * y + a[i, 8] * z,
    )


@internal
def turned_back(a, i, x, y, z):
    """Vector a[i]^T (x, y, z) of a rotation a[i]."""
    return (
        a[i, 0] * x + a[i, 3] * y + a[i, 6] * z,
        a[i, 1] * x + a[i, 4] * y + a[i, 7] * z,
        a[i, 2] * x + a[i, 5] * y + a[i, 8] * z,
    )


@internal
def cross(ax, ay, az, bx, by, bz):
    """Vector product a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@internal
def spin(inertias, b, x, y, z):
    """Inertia of body b about its mass's centre times (x, y, z), in its own axes."""
    xx, xy, yy = inertias[b, 4], inertias[b, 5], inertias[b, 6]
    xz, yz, zz = inertias[b, 7], inertias[b, 8], inertias[b, 9]
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@internal
def place(bodies, q, v, i, turn, origin, omega, speed):
    """Orientation, origin, angular velocity and the origin's velocity of all bodies in state i."""
    parents, slides, turns, shifts = bodies[0], bodies[1], bodies[2], bodies[3]
    for b in range(1, parents.size):
        p, angle, rate = parents[b], q[i, b - 1], v[i, b - 1]
        times(turn, p, turns, b, turn, b)
        x, y, z = rotated(turn, p, shifts[b, 0], shifts[b, 1], shifts[b, 2])
        ax, ay, az = turn[b, 2], turn[b, 5], turn[b, 8]
        wx, wy, wz = omega[p, 0], omega[p, 1], omega[p, 2]
        along = 0.0
        if slides[b]:
            x, y, z = x + angle * ax, y + angle * ay, z + angle * az
            along, rate = rate, 0.0
        else:
            c, s = math.cos(angle), math.sin(angle)
            for r in (0, 3, 6):
                first, second = turn[b, r], turn[b, r + 1]
                turn[b, r] = c * first + s * second
                turn[b, r + 1] = c * second - s * first
        vx, vy, vz = cross(wx, wy, wz, x, y, z)
        origin[b, 0], origin[b, 1], origin[b, 2] = (
            origin[p, 0] + x,
            origin[p, 1] + y,
            origin[p, 2] + z,
        )
        speed[b, 0] = speed[p, 0] + vx + along * ax
        speed[b, 1] = speed[p, 1] + vy + along * ay
        speed[b, 2] = speed[p, 2] + vz + along * az
        omega[b, 0], omega[b, 1], omega[b, 2] = wx + rate * ax, wy + rate * ay, wz + rate * az


@internal
def ground(count):
    """Room for the poses and velocities of bodies; the ground, and with it number 0, at rest."""
    turn = np.zeros((count, 9))
    turn[0, 0] = turn[0, 4] = turn[0, 8] = 1.0
    return turn, np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))


@internal
def _orient(turn, b, orientation, i):
    """Write rotation turn[b] as the unit quaternion orientation[i], of the sign of the one before.

    Of the four ways to do so, that which divides by the largest of its components.
    """
    xx, yy, zz = turn[b, 0], turn[b, 4], turn[b, 8]
    squares = (1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz)
    largest = 0
    for k in range(1, 4):
        if squares[k] > squares[largest]:
            largest = k
    x, y, z = turn[b, 7] - turn[b, 5], turn[b, 2] - turn[b, 6], turn[b, 3] - turn[b, 1]
    xy, xz, yz = turn[b, 1] + turn[b, 3], turn[b, 2] + turn[b, 6], turn[b, 5] + turn[b, 7]
    rows = (
        (squares[0], x, y, z),
        (x, squares[1], xy, xz),
        (y, xy, squares[2], yz),
        (z, xz, yz, squares[3]),
    )
    w, x, y, z = rows[largest]
    size = math.sqrt(w * w + x * x + y * y + z * z)
    before = w
    if i > 0:
        before = orientation[i - 1, 0] * w + orientation[i - 1, 1] * x
        before += orientation[i - 1, 2] * y + orientation[i - 1, 3] * z
    if before < 0.0:
        size = -size
    orientation[i, 0], orientation[i, 1] = w / size, x / size
    orientation[i, 2], orientation[i, 3] = y / size, z / size


@njit(cache=True, error_model="numpy")
def move(
    bodies, q, v, first, end, carriers, places, tool, orientation, turning, energy, bearings, poses
):
    """Fill the records `first` to `end` of a `tree.Motion`, whose arrays come last.

    `carriers` and `places`: of the tool, then of each pair's two frames.
    """
    inertias, gravity = bodies[4], bodies[5]
    turn, origin, omega, speed = ground(bodies[0].size)
    at, frame = np.empty((carriers.size, 3)), np.empty((carriers.size, 9))
    for i in range(first, end):
        place(bodies, q, v, i, turn, origin, omega, speed)
        kinetic = potential = 0.0
        for b in range(1, bodies[0].size):
            mass = inertias[b, 0]
            x, y, z = rotated(turn, b, inertias[b, 1], inertias[b, 2], inertias[b, 3])
            wx, wy, wz = omega[b, 0], omega[b, 1], omega[b, 2]
            vx, vy, vz = cross(wx, wy, wz, x, y, z)
            vx, vy, vz = vx + speed[b, 0], vy + speed[b, 1], vz + speed[b, 2]
            wx, wy, wz = turned_back(turn, b, wx, wy, wz)
            lx, ly, lz = spin(inertias, b, wx, wy, wz)
            kinetic += mass * (vx * vx + vy * vy + vz * vz) + wx * lx + wy * ly + wz * lz
            x, y, z = x + origin[b, 0], y + origin[b, 1], z + origin[b, 2]
            potential -= mass * (x * gravity[0] + y * gravity[1] + z * gravity[2])
        energy[i, 0], energy[i, 1] = 0.5 * kinetic, potential
        for f in range(carriers.size):
            b = carriers[f]
            at[f, 0], at[f, 1], at[f, 2] = rotated(
                turn, b, places[f, 9], places[f, 10], places[f, 11]
            )
            times(turn, b, places, f, frame, f)
            if f == 0:
                _orient(frame, f, orientation, i)
                for k in range(3):
                    turning[i, k] = omega[b, k]
                vx, vy, vz = cross(
                    omega[b, 0], omega[b, 1], omega[b, 2], at[f, 0], at[f, 1], at[f, 2]
                )
                tool[i, 3], tool[i, 4] = vx + speed[b, 0], vy + speed[b, 1]
                tool[i, 5] = vz + speed[b, 2]
            for k in range(3):
                at[f, k] += origin[b, k]
        tool[i, 0], tool[i, 1], tool[i, 2] = at[0, 0], at[0, 1], at[0, 2]
        for j in range(poses.shape[0]):
            f, g = 2 * j + 1, 2 * j + 2
            for k in range(9):
                bearings[j, i, k] = frame[f, k]
            poses[j, i, 0], poses[j, i, 1], poses[j, i, 2] = turned_back(
                frame, f, at[g, 0] - at[f, 0], at[g, 1] - at[f, 1], at[g, 2] - at[f, 2]
            )
            for k in range(3):
                poses[j, i, 3 + k], poses[j, i, 6 + k], poses[j, i, 9 + k] = turned_back(
                    frame, f, frame[g, k], frame[g, 3 + k], frame[g, 6 + k]
                )


# Forces in the joints of a tree at many states at once: compiled.
#
# First what the motion takes without accelerations of the coordinates; by the mass matrix, and
# forces that hold points together, the accelerations to which the efforts lead; then the forces
# of the bodies, summed up from the tips. `bodies` is a `tree.Bodies`; numbers of bodies as in
# the motion above.


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
    x, y, z = rotated(turn, b, inertias[b, 1], inertias[b, 2], inertias[b, 3])
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
        lx, ly, lz = rotated(turn, b, lx + ex, ly + ey, lz + ez)
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
            second[b, k], second[b, k + 1], second[b, k + 2] = rotated(turn, b, lx, ly, lz)
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
            lx, ly, lz = rotated(second, b, ax, ay, az)
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
        x, y, z = rotated(turn, b, places[f, 9], places[f, 10], places[f, 11])
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


stamp(react, (Path(__file__),))


# Pinocchio does one state per call, and what it leaves must be fetched array by array:
# microseconds, of which the arithmetic is a few tenths. Here all states of a run are one call of
# a compiled loop. Every joint is split into joints of one coordinate, with bodies of no mass
# between them; everything is in world axes. tests/test_tree.py holds it against Pinocchio.


Frame = tuple[int, pin.SE3]
"""A Pinocchio joint, and a frame's placement in it."""


class Bodies(NamedTuple):
    """Bodies by number, parents first; 0 is the ground. Body b is moved by coordinate b - 1.

    Each body turns about its own z, or slides along it.
    """

    parents: np.ndarray
    """(nb,)."""
    slides: np.ndarray
    """Whether it slides (nb,)."""
    turns: np.ndarray
    """Orientation in the parent at coordinate zero, row by row (nb, 9)."""
    shifts: np.ndarray
    """Origin in the parent at coordinate zero (nb, 3) [m]."""
    inertias: np.ndarray
    """Mass [kg], its centre (3) [m], xx, xy, yy, xz, yz, zz about that [kg m^2]: (nb, 10)."""
    gravity: np.ndarray
    """World axes (3,) [m/s^2]."""


class BodyMotion(NamedTuple):
    """What the bodies do, by record; filled stretch by stretch."""

    tool: np.ndarray
    """Position [m] and velocity [m/s] of the tool, world axes (n, 6)."""
    orientation: np.ndarray
    """Of the tool in the world: quaternion w, x, y, z (n, 4), without jumps in sign."""
    spin: np.ndarray
    """Angular velocity of the tool, world axes (n, 3) [rad/s]."""
    energy: np.ndarray
    """Kinetic and potential (n, 2) [J]."""
    bearings: np.ndarray
    """Orientation of each pair's first frame in the world, row by row (pairs, n, 9)."""
    poses: np.ndarray
    """Its second frame in the first: origin [m], orientation row by row (pairs, n, 12)."""

    @classmethod
    def of(cls, n: int, pairs: int) -> BodyMotion:
        """Room for n records and `pairs` pairs of frames."""
        tool = np.empty((n, 6)), np.empty((n, 4)), np.empty((n, 3))
        return cls(*tool, np.empty((n, 2)), np.empty((pairs, n, 9)), np.empty((pairs, n, 12)))


class Tree:
    """The bodies of a model whose joints turn about axes, slide along them, or both in turn.

    Args:
        model: of `model.build`, without armature.
    """

    def __init__(self, model: pin.Model) -> None:
        """Split the joints of `model`."""
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        parents, slides, placements, inertias = [0], [False], [pin.SE3.Identity()], [np.zeros(10)]
        self._bodies = [0]
        self._turned = [pin.SE3.Identity()]  # a joint's frame as seen from its last body
        for index in range(1, model.njoints):
            joint, before = model.joints[index], model.parents[index]
            local = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
            columns = local.reshape(6, model.nv)[:, joint.idx_v : joint.idx_v + joint.nv].T
            body, start = self._bodies[before], self._turned[before] * model.jointPlacements[index]
            for column in columns:
                straight = bool(column[:3].any())
                turn = pin.SE3(z_to(column[:3] if straight else column[3:]), np.zeros(3))
                parents.append(body)
                slides.append(straight)
                placements.append(start * turn)
                inertias.append(np.zeros(10))
                body, start = len(parents) - 1, turn.inverse()
            held = start.act(model.inertias[index])
            xx, xy, yy, xz, yz, zz = held.inertia[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]
            inertias[body] = np.array([held.mass, *held.lever, xx, xy, yy, xz, yz, zz])
            self._bodies.append(body)
            self._turned.append(start)
        self._data = Bodies(
            np.array(parents),
            np.array(slides),
            np.array([placement.rotation.ravel() for placement in placements]),
            np.array([placement.translation for placement in placements]),
            np.array(inertias),
            np.array(model.gravity.linear),
        )

    @property
    def bodies(self) -> Bodies:
        """All bodies, at coordinate zero."""
        return self._data

    def frames(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
        """Bodies that carry the frames (nf,), and rotation and origin of each in them (nf, 12)."""
        carriers = np.array([self._bodies[index] for index, _ in frames], dtype=np.int64)
        places = np.empty((len(frames), 12))
        for row, (index, placement) in zip(places, frames, strict=True):
            place = self._turned[index] * placement
            row[:9], row[9:] = place.rotation.ravel(), place.translation
        return carriers, places

    def move(
        self,
        motion: BodyMotion,
        first: int,
        end: int,
        q: np.ndarray,
        v: np.ndarray,
        tool: Frame,
        pairs: Sequence[tuple[Frame, Frame]],
    ) -> None:
        """Fill the records `first` to `end` of `motion`.

        Args:
            motion: to be filled.
            first, end: records in which the bodies have these inertias.
            q, v: states of all records, C-contiguous, shape (n, nv).
            tool: frame whose motion is wanted.
            pairs: frames whose poses are wanted, the second in the first.
        """
        carriers, places = self.frames([tool, *(frame for pair in pairs for frame in pair)])
        move(self._data, q, v, first, end, carriers, places, *motion)

    def reactions(
        self,
        first: int,
        end: int,
        q: np.ndarray,
        v: np.ndarray,
        effort: np.ndarray,
        joints: Sequence[int],
        constraints: Sequence[pin.RigidConstraintModel],
        pushed: Sequence[int] = (),
        wrenches: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Forces that the joints transmit while the bodies move freely under `effort`.

        Args:
            first, end: records that are wanted.
            q, v, effort: of all records, C-contiguous, shape (n, nv).
            joints: Pinocchio joints whose forces are wanted.
            constraints: points held together, of the kind CONTACT_3D, not stabilised; of those
                that may be redundant, the smallest forces that do it.
            pushed: Pinocchio joints on whose bodies given wrenches act.
            wrenches: these: force [N], moment about the world's origin [N m], world axes, shape
                (n, pushed, 6).

        Returns:
            Force of the parent on the child by joint (end - first, joints, 3), and that of the
            second body on the first by constraint (end - first, constraints, 3); world axes [N].
        """
        frames = [
            frame
            for held in constraints
            for frame in (
                (held.joint1_id, held.joint1_placement),
                (held.joint2_id, held.joint2_placement),
            )
        ]
        carriers, places = self.frames(frames)
        wanted = np.array([self._bodies[index] for index in joints], dtype=np.int64)
        forces = np.empty((end - first, len(wanted), 3))
        holds = np.empty((end - first, len(constraints), 3))
        acted = np.array([self._bodies[index] for index in pushed], dtype=np.int64)
        given = np.zeros((len(q), 0, 6)) if wrenches is None else np.ascontiguousarray(wrenches)
        points = carriers, places
        react(self._data, q, v, effort, first, end, wanted, *points, acted, given, forces, holds)
        return forces, holds
