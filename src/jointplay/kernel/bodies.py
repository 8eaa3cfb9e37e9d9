"""Where bodies are, and how they move: what joints need that are reached through frames.

The bodies between those that carry bearings and journals and the ground, one to a coordinate, each
turning about its own z or sliding along it (`mechanism.tree` splits Pinocchio's joints so). Frames
and Jacobian are exact at every micro step; mass matrix and bias are Pinocchio's.
"""

from __future__ import annotations

import math

from jointplay.core.compiler import internal
from jointplay.kernel.access import bodies, floats
from jointplay.kernel.frames import add, along, cross, put, scale, vector


@internal
def times(columns, x, y, z):
    """Matrix, given by its nine numbers column by column, times a vector."""
    first = along(scale(x, vector(columns, 0)), y, vector(columns, 3))
    return along(first, z, vector(columns, 6))


@internal
def place_bodies(run, q):
    """Orientation and origin of all bodies at the coordinates q, and the Jacobian's columns.

    A column has the velocity of the point of the body at the world's origin, and the angular one.
    """
    columns, every = floats(run.jacobian, 6 * run.nv), bodies(run)
    for b in range(1, run.nb):
        body = every[b]
        parent, turn, i = every[body.parent], body.turn, body.coordinate
        origin = add(
            vector(parent.origin, 0),
            times(parent.rotation, body.shift[0], body.shift[1], body.shift[2]),
        )
        x = times(parent.rotation, turn[0], turn[3], turn[6])
        y = times(parent.rotation, turn[1], turn[4], turn[7])
        axis = times(parent.rotation, turn[2], turn[5], turn[8])
        if body.slides != 0:
            origin = along(origin, q[i], axis)
            put(columns, 6 * i, axis)
        else:
            c, s = math.cos(q[i]), math.sin(q[i])
            x, y = along(scale(c, x), s, y), along(scale(c, y), -s, x)
            put(columns, 6 * i, cross(origin, axis))
            put(columns, 6 * i + 3, axis)
        put(body.rotation, 0, x)
        put(body.rotation, 3, y)
        put(body.rotation, 6, axis)
        put(body.origin, 0, origin)


@internal
def lifted(body, arm):
    """Acceleration at constant speeds of a point `arm` from a body's origin."""
    omega = vector(body.omega, 0)
    turning = cross(vector(body.alpha, 0), arm)
    return add(vector(body.lift, 0), add(turning, cross(omega, cross(omega, arm))))


@internal
def swing_bodies(run, v):
    """Angular velocities of the bodies just placed, and accelerations at constant speeds v."""
    every = bodies(run)
    for b in range(1, run.nb):
        body = every[b]
        parent, rate = every[body.parent], v[body.coordinate]
        axis, omega = vector(body.rotation, 6), vector(parent.omega, 0)
        lift = lifted(parent, along(vector(body.origin, 0), -1.0, vector(parent.origin, 0)))
        alpha, across = vector(parent.alpha, 0), scale(rate, cross(omega, axis))
        if body.slides != 0:
            lift = along(lift, 2.0, across)
        else:
            omega, alpha = along(omega, rate, axis), add(alpha, across)
        put(body.omega, 0, omega)
        put(body.alpha, 0, alpha)
        put(body.lift, 0, lift)
