"""Where bodies are, and how they move: what joints need that are reached through frames.

The bodies between those that carry bearings and journals and the ground, one to a coordinate, each
turning about its own z or sliding along it (`model.tree` splits Pinocchio's joints so). Frames
and Jacobian are exact at every micro step; mass matrix and bias are Pinocchio's.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import compiled
from jointplay.physics.kernel.frames import add, add_scaled, cross, get_vector, scale, set_vector


@compiled
def matrix_times_vector(columns, x, y, z):
    """Matrix, given by its nine numbers column by column, times a vector."""
    first = add_scaled(scale(x, get_vector(columns, 0)), y, get_vector(columns, 3))
    return add_scaled(first, z, get_vector(columns, 6))


@compiled
def place_bodies(run, q):
    """Orientation and origin of all bodies at the coordinates q, and the Jacobian's columns.

    A column has the velocity of the point of the body at the world's origin, and the angular one.
    """
    columns, every = run.world_jacobian, run.bodies
    for b in range(1, run.nb):
        body = every[b]
        parent, turn, i = every[body.parent], body.turn, body.coordinate
        origin = add(
            get_vector(parent.origin, 0),
            matrix_times_vector(parent.rotation, body.shift[0], body.shift[1], body.shift[2]),
        )
        x = matrix_times_vector(parent.rotation, turn[0], turn[3], turn[6])
        y = matrix_times_vector(parent.rotation, turn[1], turn[4], turn[7])
        axis = matrix_times_vector(parent.rotation, turn[2], turn[5], turn[8])
        if body.slides != 0:
            origin = add_scaled(origin, q[i], axis)
            set_vector(columns[i], 0, axis)
        else:
            c, s = math.cos(q[i]), math.sin(q[i])
            x, y = add_scaled(scale(c, x), s, y), add_scaled(scale(c, y), -s, x)
            set_vector(columns[i], 0, cross(origin, axis))
            set_vector(columns[i], 3, axis)
        set_vector(body.rotation, 0, x)
        set_vector(body.rotation, 3, y)
        set_vector(body.rotation, 6, axis)
        set_vector(body.origin, 0, origin)


@compiled
def point_acceleration(body, arm):
    """Acceleration of a point at `arm` from a body's origin, at constant generalised velocities."""
    omega = get_vector(body.omega, 0)
    turning = cross(get_vector(body.alpha, 0), arm)
    return add(get_vector(body.lift, 0), add(turning, cross(omega, cross(omega, arm))))


@compiled
def find_body_rates(run, v):
    """Angular velocities of the bodies just placed, and accelerations at constant speeds v."""
    every = run.bodies
    for b in range(1, run.nb):
        body = every[b]
        parent, rate = every[body.parent], v[body.coordinate]
        axis, omega = get_vector(body.rotation, 6), get_vector(parent.omega, 0)
        lift = point_acceleration(
            parent, add_scaled(get_vector(body.origin, 0), -1.0, get_vector(parent.origin, 0))
        )
        alpha, across = get_vector(parent.alpha, 0), scale(rate, cross(omega, axis))
        if body.slides != 0:
            lift = add_scaled(lift, 2.0, across)
        else:
            omega, alpha = add_scaled(omega, rate, axis), add(alpha, across)
        set_vector(body.omega, 0, omega)
        set_vector(body.alpha, 0, alpha)
        set_vector(body.lift, 0, lift)
