"""The contact law and the drive written down once more, for engines that have only forces."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jointplay.physics.geometry import touch_cylinder
from jointplay.simulation.motion.reference import REFERENCE_NODE_S


@njit(cache=True)
def drive_effort(t, q, v, table, column, kp, kd, out):
    """Efforts of computed torque with PD, linear between the nodes of the table [N m or N]."""
    nu = table.shape[1] // 3
    place = t / REFERENCE_NODE_S
    node = min(int(place), table.shape[0] - 2)
    s = min(place - node, 1.0)
    for i in range(q.size):
        out[i] = 0.0
        u = int(column[i])
        if u >= 0:
            want = (1.0 - s) * table[node] + s * table[node + 1]
            out[i] = want[2 * nu + u] + kp[i] * (want[u] - q[i]) + kd[i] * (want[nu + u] - v[i])


@njit(cache=True)
def _forces(gap, rate, speed, law, memory, k, commit):
    """Normal force and friction over sliding speed of one contact; `memory` has d'_0, or 0.

    Damping refers to d'_0, or to the speed at which the mass `law[6]` would have stored what the
    contact holds, if that is more.
    """
    approach = max(abs(rate), 1e-9, memory[k])
    if law[5] != 0.0 and memory[k] > 0.0:
        approach = memory[k]
    if commit:
        memory[k] = approach
    reference = max(approach, math.sqrt(0.8 * law[0] * (-gap) ** 2.5 / law[6]))
    normal = max(law[0] * (-gap) ** 1.5 * (1.0 + law[1] * rate / reference), 0.0)
    mu = law[2] * min(max((speed - law[3]) / (law[4] - law[3]), 0.0), 1.0)
    return normal, mu * normal / speed if speed > 0.0 else 0.0


@njit(cache=True)
def planar_wrench(c, u, w, sizes, law, memory, commit, out):
    """Force on a journal with parallel axis and moment about its centre, `out` (6,) [N, N m].

    By its place c and velocity u as seen from the bearing, along any axes [m, m/s], and its
    relative angular velocity w about z [rad/s]; `memory` has d'_0 of each contact, which is kept
    if the state is an accepted one (`commit`).
    """
    out[:] = 0.0
    distance = math.hypot(c[0], c[1])
    gap = sizes[0] - sizes[1] - distance
    if gap >= 0.0:
        if commit:
            memory[0] = 0.0
        return
    ex, ey = c[0] / distance, c[1] / distance
    rx, ry = sizes[1] * ex, sizes[1] * ey
    vx, vy = u[0] - w * ry, u[1] + w * rx
    rate = ex * vx + ey * vy
    sx, sy = vx - rate * ex, vy - rate * ey
    normal, drag = _forces(gap, rate, math.hypot(sx, sy), law, memory, 0, commit)
    out[0] = -normal * ex - drag * sx
    out[1] = -normal * ey - drag * sy
    out[5] = rx * out[1] - ry * out[0]


@njit(cache=True)
def spatial_wrench(c, turn, u, w, sizes, law, memory, commit, out):
    """The same of a journal that tilts by `turn` (3, 3), all (3,) in the bearing frame."""
    out[:] = 0.0
    for k in range(4):
        gap, rx, ry, rz, nx, ny, nz = touch_cylinder(
            k, c[0], c[1], c[2], turn[0, 2], turn[1, 2], turn[2, 2],
            sizes[0], sizes[1], sizes[2], sizes[3],
        )  # fmt: skip
        if gap >= 0.0:
            if commit:
                memory[k] = 0.0
            continue
        vx = u[0] + w[1] * rz - w[2] * ry
        vy = u[1] + w[2] * rx - w[0] * rz
        vz = u[2] + w[0] * ry - w[1] * rx
        rate = -(nx * vx + ny * vy + nz * vz)
        sx, sy, sz = vx + rate * nx, vy + rate * ny, vz + rate * nz
        speed = math.sqrt(sx * sx + sy * sy + sz * sz)
        normal, drag = _forces(gap, rate, speed, law, memory, k, commit)
        fx, fy, fz = normal * nx - drag * sx, normal * ny - drag * sy, normal * nz - drag * sz
        out[0] += fx
        out[1] += fy
        out[2] += fz
        out[3] += ry * fz - rz * fy
        out[4] += rz * fx - rx * fz
        out[5] += rx * fy - ry * fx


@njit(cache=True)
def world_wrench(planar, here, there, bearing, journal, slow, fast, sizes, law, memory, out):
    """By one of these at centres (3,) and orientations (9,) in the world; whether they touch.

    `slow` and `fast` are angular velocity and velocity of bearing and of journal (6,).
    """
    turn, c, u, w = np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros(3)
    ax, ay, az = there[0] - here[0], there[1] - here[1], there[2] - here[2]
    # Of the journal's centre as seen from the bearing, which turns.
    vx = fast[3] - slow[3] - (slow[1] * az - slow[2] * ay)
    vy = fast[4] - slow[4] - (slow[2] * ax - slow[0] * az)
    vz = fast[5] - slow[5] - (slow[0] * ay - slow[1] * ax)
    for i in range(3):
        bx, by, bz = bearing[i], bearing[3 + i], bearing[6 + i]
        c[i] = bx * ax + by * ay + bz * az
        u[i] = bx * vx + by * vy + bz * vz
        w[i] = bx * (fast[0] - slow[0]) + by * (fast[1] - slow[1]) + bz * (fast[2] - slow[2])
        for k in range(3):
            turn[i, k] = bx * journal[k] + by * journal[3 + k] + bz * journal[6 + k]
    if planar:
        planar_wrench(c, u, w[2], sizes, law, memory, True, out)
    else:
        spatial_wrench(c, turn, u, w, sizes, law, memory, True, out)
    touching = False
    for i in (0, 3):
        x, y, z = out[i], out[i + 1], out[i + 2]
        touching = touching or x != 0.0 or y != 0.0 or z != 0.0
        for k in range(3):
            out[i + k] = bearing[3 * k] * x + bearing[3 * k + 1] * y + bearing[3 * k + 2] * z
    return touching
