"""Where the bodies of a tree are and how fast they move, at many states at once: compiled.

`bodies` is a `tree.Bodies`. Bodies are numbered from 1, their parents first; 0 is the ground.
"""

from __future__ import annotations

import math

import numpy as np

from jointplay.host.numba_cache import njit
from jointplay.kernel.parts import internal


@internal
def times(a, i, b, j, c, k):
    """Product of rotations c[k] = a[i] b[j], row by row."""
    for r in (0, 3, 6):
        x, y, z = a[i, r], a[i, r + 1], a[i, r + 2]
        for s in range(3):
            c[k, r + s] = x * b[j, s] + y * b[j, 3 + s] + z * b[j, 6 + s]


@internal
def turned(a, i, x, y, z):
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
        x, y, z = turned(turn, p, shifts[b, 0], shifts[b, 1], shifts[b, 2])
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
            x, y, z = turned(turn, b, inertias[b, 1], inertias[b, 2], inertias[b, 3])
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
            at[f, 0], at[f, 1], at[f, 2] = turned(
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
