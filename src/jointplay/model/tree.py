"""Bodies of a Pinocchio model at many states at once: motion, energies, forces in the joints.

Pinocchio does one state per call, and its results must be fetched array by array: microseconds, of
which the arithmetic is a few tenths. Here all states of a run are one call of a compiled loop:
`Tree.motion` or `Tree.reactions`. Every joint is split into joints of one coordinate, with bodies
without mass between them; all vectors are in world axes. tests/model/test_tree.py holds it against
Pinocchio.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.compiler import compiled
from jointplay.model.design import z_to
from jointplay.model.frames import WORLD_FRAME, Frame, motions
from jointplay.physics.kernel.frames import add, add_scaled, cross, dot, get_vector, scale

# Compiled kinematics: where the bodies of a tree are and how fast they move.
#
# `bodies` is a `Bodies`. Bodies are numbered from 1, their parents first; 0 is the ground.
# `turn[b]` is the orientation of body b in the world, row by row; `origin`, `omega` and `speed` are
# its origin's position, its angular velocity, and its origin's velocity.


@compiled
def row(a, i):
    """Vector a[i, :3]."""
    return a[i, 0], a[i, 1], a[i, 2]


@compiled
def put(a, i, vector):
    """Write a vector into a[i, :3]."""
    a[i, 0], a[i, 1], a[i, 2] = vector


@compiled
def axis_of(turn, b):
    """Third column of a rotation turn[b]: the axis of body b."""
    return turn[b, 2], turn[b, 5], turn[b, 8]


@compiled
def subtract(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def times(a, i, b, j, c, k):
    """Product of rotations c[k] = a[i] b[j], all stored row by row."""
    for r in (0, 3, 6):
        x, y, z = a[i, r], a[i, r + 1], a[i, r + 2]
        for s in range(3):
            c[k, r + s] = x * b[j, s] + y * b[j, 3 + s] + z * b[j, 6 + s]


@compiled
def rotated(a, i, vector):
    """Vector R (x, y, z), with the rotation R = a[i]."""
    x, y, z = vector
    return (
        a[i, 0] * x + a[i, 1] * y + a[i, 2] * z,
        a[i, 3] * x + a[i, 4] * y + a[i, 5] * z,
        a[i, 6] * x + a[i, 7] * y + a[i, 8] * z,
    )


@compiled
def turned_back(a, i, vector):
    """Vector R^T (x, y, z), with the rotation R = a[i]."""
    x, y, z = vector
    return (
        a[i, 0] * x + a[i, 3] * y + a[i, 6] * z,
        a[i, 1] * x + a[i, 4] * y + a[i, 7] * z,
        a[i, 2] * x + a[i, 5] * y + a[i, 8] * z,
    )


@compiled
def spin(inertias, b, vector):
    """Inertia of body b about its centre of mass times a vector, both in the body's axes."""
    x, y, z = vector
    xx, xy, yy = inertias[b, 4], inertias[b, 5], inertias[b, 6]
    xz, yz, zz = inertias[b, 7], inertias[b, 8], inertias[b, 9]
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@compiled
def mass_centre(bodies, turn, b):
    """Centre of mass of body b from the body's origin, in world axes."""
    inertias = bodies.inertias
    return rotated(turn, b, (inertias[b, 1], inertias[b, 2], inertias[b, 3]))


@compiled
def place(bodies, q, v, i, turn, origin, omega, speed):
    """Fill orientations, origins and velocities of all bodies in state i, from the base on."""
    for b in range(1, bodies.parents.size):
        p, angle, rate = bodies.parents[b], q[i, b - 1], v[i, b - 1]
        times(turn, p, bodies.turns, b, turn, b)
        arm, axis = rotated(turn, p, row(bodies.shifts, b)), axis_of(turn, b)
        along = 0.0
        if bodies.slides[b]:
            arm = add_scaled(arm, angle, axis)
            along, rate = rate, 0.0
        else:
            c, s = math.cos(angle), math.sin(angle)
            for r in (0, 3, 6):
                first, second = turn[b, r], turn[b, r + 1]
                turn[b, r] = c * first + s * second
                turn[b, r + 1] = c * second - s * first
        velocity = add(row(speed, p), cross(row(omega, p), arm))
        put(origin, b, add(row(origin, p), arm))
        put(speed, b, add_scaled(velocity, along, axis))
        put(omega, b, add_scaled(row(omega, p), rate, axis))


@compiled
def ground(count):
    """Arrays for `place`, with body 0, the ground, at rest in the world's axes."""
    turn = np.zeros((count, 9))
    turn[0, 0] = turn[0, 4] = turn[0, 8] = 1.0
    return turn, np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))


@compiled
def _orient(turn, b, orientation, i):
    """Write rotation turn[b] as the unit quaternion orientation[i], its sign as the one before.

    Of the four formulas for a rotation's quaternion, the one that divides by its largest component.
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


@compiled
def move(
    bodies, q, v, first, end, carriers, places, tool, orientation, turning, energy, bearings, poses
):
    """Fill the records `first` to `end` of a `BodyMotion`, whose arrays come last.

    `carriers` and `places` (`Tree.frames`) are those of the tool, then of each pair's two frames.
    """
    gravity = get_vector(bodies.gravity, 0)
    turn, origin, omega, speed = ground(bodies.parents.size)
    at, frame = np.empty((carriers.size, 3)), np.empty((carriers.size, 9))
    for i in range(first, end):
        place(bodies, q, v, i, turn, origin, omega, speed)
        kinetic = potential = 0.0
        for b in range(1, bodies.parents.size):
            mass, arm = bodies.inertias[b, 0], mass_centre(bodies, turn, b)
            velocity = add(cross(row(omega, b), arm), row(speed, b))
            w = turned_back(turn, b, row(omega, b))
            momentum = spin(bodies.inertias, b, w)
            kinetic += bodies.armature[b] * v[i, b - 1] * v[i, b - 1]
            kinetic += (
                mass * dot(velocity, velocity)
                + w[0] * momentum[0]
                + w[1] * momentum[1]
                + w[2] * momentum[2]
            )
            potential -= mass * dot(add(arm, row(origin, b)), gravity)
        energy[i, 0], energy[i, 1] = 0.5 * kinetic, potential
        for f in range(carriers.size):
            b = carriers[f]
            arm = rotated(turn, b, (places[f, 9], places[f, 10], places[f, 11]))
            times(turn, b, places, f, frame, f)
            if f == 0:
                _orient(frame, f, orientation, i)
                put(turning, i, row(omega, b))
                velocity = add(cross(row(omega, b), arm), row(speed, b))
                tool[i, 3], tool[i, 4], tool[i, 5] = velocity
            put(at, f, add(arm, row(origin, b)))
        put(tool, i, row(at, 0))
        for j in range(poses.shape[0]):
            f, g = 2 * j + 1, 2 * j + 2
            for k in range(9):
                bearings[j, i, k] = frame[f, k]
            centre = turned_back(frame, f, subtract(row(at, g), row(at, f)))
            poses[j, i, 0], poses[j, i, 1], poses[j, i, 2] = centre
            for k in range(3):
                column = turned_back(frame, f, (frame[g, k], frame[g, 3 + k], frame[g, 6 + k]))
                poses[j, i, 3 + k], poses[j, i, 6 + k], poses[j, i, 9 + k] = column


# Compiled dynamics: forces that the joints of a tree transmit.
#
# In each state, `react` goes four steps:
#
# 1. Bias: bodies accelerated by their velocities alone (q'' = 0) need forces; their moments about
#    the joints' axes are efforts that the motion takes (Newton and Euler).
# 2. The rest of the given efforts accelerates the coordinates, by the mass matrix that composite
#    bodies give (Featherstone's composite rigid body algorithm).
# 3. Points that are held together add forces, and with these accelerations.
# 4. The forces that the bodies need in their actual motion, summed up from the tips to the base,
#    are what the joints transmit.
#
# `alpha` is the angular acceleration of each body, `lift` its origin's acceleration.


_REGULAR = 1e-8
"""Regularisation of the matrix of held points, relative to its mean diagonal."""
_ACCURACY, _ITERATIONS = 1e-15, 10
"""Proximal iteration: acceleration of held points that may remain, relative to the largest that is
to be held; and the most iterations."""


@compiled
def _accelerate(bodies, v, i, a, turn, origin, omega, alpha, lift):
    """Fill angular accelerations of all bodies and their origins' accelerations, with q'' = a."""
    for b in range(1, bodies.parents.size):
        p, rate, gain, axis = bodies.parents[b], v[i, b - 1], a[b - 1], axis_of(turn, b)
        across = cross(row(omega, p), axis)
        rise = _lifted(row(alpha, p), row(omega, p), subtract(row(origin, b), row(origin, p)))
        turning = row(alpha, p)
        if bodies.slides[b]:
            rise = add(rise, add_scaled(scale(2.0 * rate, across), gain, axis))
        else:
            turning = add_scaled(add_scaled(turning, rate, across), gain, axis)
        put(alpha, b, turning)
        put(lift, b, add(row(lift, p), rise))


@compiled
def _lifted(alpha, omega, arm):
    """Acceleration of a body's point against its origin: alpha x r + w x (w x r)."""
    return add(cross(alpha, arm), cross(omega, cross(omega, arm)))


@compiled
def _pushed(bodies, b, omega, alpha, lift, arm):
    """Force that body b needs to move and to bear its weight; `arm`: origin to centre of mass."""
    rise = add(_lifted(row(alpha, b), row(omega, b), arm), row(lift, b))
    return scale(bodies.inertias[b, 0], subtract(rise, get_vector(bodies.gravity, 0)))


@compiled
def _needed(bodies, turn, origin, omega, alpha, lift, arm, force, moment):
    """Fill force, and moment about the world's origin, that each body needs (`_pushed`).

    `arm` gets each centre of mass from its body's origin.
    """
    inertias = bodies.inertias
    for b in range(1, bodies.parents.size):
        put(arm, b, mass_centre(bodies, turn, b))
        put(force, b, _pushed(bodies, b, omega, alpha, lift, row(arm, b)))
        w = turned_back(turn, b, row(omega, b))
        gyroscopic = cross(w, spin(inertias, b, w))
        inertial = spin(inertias, b, turned_back(turn, b, row(alpha, b)))
        about_centre = rotated(turn, b, add(gyroscopic, inertial))
        put(moment, b, add(about_centre, cross(add(row(arm, b), row(origin, b)), row(force, b))))


@compiled
def _factor(matrix, size):
    """Factor a symmetric matrix in place: its lower triangle becomes L and D of L D L^T."""
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


@compiled
def _solve(matrix, size, x):
    """Solve L D L^T y = x, with L and D by `_factor`; y replaces x."""
    for r in range(size):
        for k in range(r):
            x[r] -= matrix[r, k] * x[k]
    for r in range(size):
        x[r] /= matrix[r, r]
    for r in range(size - 1, -1, -1):
        for k in range(r + 1, size):
            x[r] -= matrix[k, r] * x[k]


@compiled
def _mass_matrix(bodies, turn, origin, arm, weight, first_moment, second, mass):
    """Lower triangle of the mass matrix, by the inertia of each body with those beyond it.

    Inertias are mass, first and second moment about the world's origin, in world axes: they add.
    The force that moves a composite body at unit acceleration of its coordinate, seen at each
    coordinate on the way to the base, is a row. `arm`: origins to centres of mass.
    """
    count = bodies.parents.size
    for b in range(1, count):  # inertia of each body alone, moved to the world's origin
        m, centre = bodies.inertias[b, 0], add(row(origin, b), row(arm, b))
        weight[b] = m
        put(first_moment, b, scale(m, centre))
        for r in range(3):  # R I R^T, column by column
            k = 3 * r
            column = spin(bodies.inertias, b, (turn[b, k], turn[b, k + 1], turn[b, k + 2]))
            second[b, k], second[b, k + 1], second[b, k + 2] = rotated(turn, b, column)
        square = m * dot(centre, centre)
        for r in range(3):
            for k in range(3):
                if r == k:
                    second[b, 4 * r] += square - m * centre[r] * centre[r]
                else:
                    second[b, 3 * r + k] -= m * centre[min(r, k)] * centre[max(r, k)]
    for b in range(count - 1, 0, -1):  # from the tips: all beyond b is in its inertia by now
        p, axis, moment = bodies.parents[b], axis_of(turn, b), row(first_moment, b)
        if bodies.slides[b]:
            push, turning = scale(weight[b], axis), cross(moment, axis)
        else:
            at_rest = cross(row(origin, b), axis)
            push = add_scaled(cross(axis, moment), weight[b], at_rest)
            turning = add(rotated(second, b, axis), cross(moment, at_rest))
        for k in range(b):
            mass[b - 1, k] = 0.0
        j = b
        while j > 0:
            mass[b - 1, j - 1] = _effort(bodies.slides, turn, origin, j, push, turning)
            j = bodies.parents[j]
        mass[b - 1, b - 1] += bodies.armature[b]
        if p > 0:
            weight[p] += weight[b]
            put(first_moment, p, add(row(first_moment, p), moment))
            for k in range(9):
                second[p, k] += second[b, k]


@compiled
def _effort(slides, turn, origin, b, force, moment):
    """Generalised force of a force and a moment about the world's origin at body b's coordinate."""
    axis = axis_of(turn, b)
    if slides[b]:
        return dot(axis, force)
    return dot(axis, subtract(moment, cross(row(origin, b), force)))


@compiled
def _hold(bodies, carriers, places, turn, origin, omega, alpha, lift, rows, drift):
    """Fill the Jacobian `rows` of held points against each other, and their `drift` at q'' = 0."""
    rows[:] = 0.0
    drift[:] = 0.0
    for f in range(carriers.size):
        b, first, sign = carriers[f], 3 * (f // 2), 1.0 - 2.0 * (f % 2)
        arm = rotated(turn, b, (places[f, 9], places[f, 10], places[f, 11]))
        rise = add(_lifted(row(alpha, b), row(omega, b), arm), row(lift, b))
        for k in range(3):
            drift[first + k] += sign * rise[k]
        point = add(arm, row(origin, b))
        while b > 0:
            motion = axis_of(turn, b)
            if not bodies.slides[b]:
                motion = cross(motion, subtract(point, row(origin, b)))
            for k in range(3):
                rows[first + k, b - 1] += sign * motion[k]
            b = bodies.parents[b]


@compiled
def _close(mass, rows, drift, solved, square, acceleration, push):
    """Find the forces `push` that hold all points, and add the acceleration that they cause.

    With the Jacobian J of the points they obey J M^-1 J^T push = -(drift + J acceleration). The
    matrix may be singular; the proximal iteration, as in Pinocchio, finds the smallest forces.
    """
    size, nv = rows.shape
    for r in range(size):  # M^-1 J^T, a column in each row of `solved`
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


@compiled
def react(
    bodies, q, v, effort, first, end, wanted, carriers, places, acted, wrenches, forces, holds
):
    """Fill `forces` and `holds`; see `Tree.reactions`.

    `wanted` and `acted`: bodies whose joints' forces are wanted, and on which `wrenches` acts.
    """
    parents = bodies.parents
    count, held = parents.size, 3 * (carriers.size // 2)
    nv = count - 1
    turn, origin, omega, speed = ground(count)
    alpha, lift = np.zeros((count, 3)), np.zeros((count, 3))
    force, moment, arm = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    weight, first_moment, second = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 9))
    mass, acceleration = np.empty((nv, nv)), np.empty(nv)
    rows, drift, push = np.empty((held, nv)), np.empty(held), np.empty(held)
    solved, square = np.empty((held + 1, max(nv, held))), np.empty((held, held))
    for i in range(first, end):
        place(bodies, q, v, i, turn, origin, omega, speed)
        # 1. Bias efforts, and what is left of the given ones.
        acceleration[:] = 0.0
        _accelerate(bodies, v, i, acceleration, turn, origin, omega, alpha, lift)
        _needed(bodies, turn, origin, omega, alpha, lift, arm, force, moment)
        for w in range(acted.size):
            for k in range(3):
                force[acted[w], k] -= wrenches[i, w, k]
                moment[acted[w], k] -= wrenches[i, w, 3 + k]
        for b in range(count - 1, 0, -1):
            needed = _effort(bodies.slides, turn, origin, b, row(force, b), row(moment, b))
            acceleration[b - 1] = effort[i, b - 1] - needed
            put(force, parents[b], add(row(force, parents[b]), row(force, b)))
            put(moment, parents[b], add(row(moment, parents[b]), row(moment, b)))
        # 2. Free acceleration.
        _mass_matrix(bodies, turn, origin, arm, weight, first_moment, second, mass)
        _factor(mass, nv)
        _solve(mass, nv, acceleration)
        # 3. Constrained acceleration.
        if held:
            _hold(bodies, carriers, places, turn, origin, omega, alpha, lift, rows, drift)
            _close(mass, rows, drift, solved, square, acceleration, push)
        # 4. Forces of the bodies in this motion, from the tips to the base.
        _accelerate(bodies, v, i, acceleration, turn, origin, omega, alpha, lift)
        for b in range(1, count):
            put(force, b, _pushed(bodies, b, omega, alpha, lift, row(arm, b)))
        for w in range(acted.size):
            for k in range(3):
                force[acted[w], k] -= wrenches[i, w, k]
        for f in range(carriers.size):
            hold = get_vector(push, 3 * (f // 2))
            put(force, carriers[f], add_scaled(row(force, carriers[f]), 2.0 * (f % 2) - 1.0, hold))
            put(holds[i - first], f // 2, hold)
        for b in range(count - 1, 0, -1):
            put(force, parents[b], add(row(force, parents[b]), row(force, b)))
        for j in range(wanted.size):
            put(forces[i - first], j, row(force, wanted[j]))


class Bodies(NamedTuple):
    """Bodies by number, parents first; 0 is the ground. Body b is moved by coordinate b - 1.

    Each body turns about its own z, or slides along it.
    """

    parents: np.ndarray
    """Number of each body's parent (nb,)."""
    slides: np.ndarray
    """Whether each body slides (nb,)."""
    turns: np.ndarray
    """Orientation in the parent at coordinate zero, row by row (nb, 9)."""
    shifts: np.ndarray
    """Origin in the parent at coordinate zero (nb, 3) [m]."""
    inertias: np.ndarray
    """Mass [kg], centre of mass (3) [m], and xx, xy, yy, xz, yz, zz about it [kg m^2]: (nb, 10)."""
    armature: np.ndarray
    """Rotor inertia at each body's coordinate (nb,) [kg m^2 or kg]."""
    gravity: np.ndarray
    """Acceleration of gravity, world axes (3,) [m/s^2]."""


class BodyMotion(NamedTuple):
    """Motion of a tool and of pairs of frames, and energies, by record."""

    tool: np.ndarray
    """Position [m] and velocity [m/s] of the tool, world axes (n, 6)."""
    orientation: np.ndarray
    """Orientation of the tool in the world: quaternion w, x, y, z (n, 4), without jumps in sign."""
    spin: np.ndarray
    """Angular velocity of the tool, world axes (n, 3) [rad/s]."""
    energy: np.ndarray
    """Kinetic and potential energy (n, 2) [J]."""
    bearings: np.ndarray
    """Orientation of each pair's first frame in the world, row by row (pairs, n, 9)."""
    poses: np.ndarray
    """Pose of each pair's second frame in the first: origin [m], orientation row by row
    (pairs, n, 12)."""

    @classmethod
    def of(cls, n: int, pairs: int) -> BodyMotion:
        """Arrays, to be filled, for n records and `pairs` pairs of frames."""
        tool = np.empty((n, 6)), np.empty((n, 4)), np.empty((n, 3))
        return cls(*tool, np.empty((n, 2)), np.empty((pairs, n, 9)), np.empty((pairs, n, 12)))


class Tree:
    """The bodies of a model that `design.build` made, each joint split into single coordinates."""

    def __init__(self, model: pin.Model) -> None:
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        parents, slides, placements, inertias = [0], [False], [pin.SE3.Identity()], [np.zeros(10)]
        self._last_body = [0]  # of each Pinocchio joint, the body that carries its inertia
        self._turned = [pin.SE3.Identity()]  # a joint's frame as seen from its last body
        for index in range(1, model.njoints):
            before = model.parents[index]
            body = self._last_body[before]
            start = self._turned[before] * model.jointPlacements[index]
            for axis in motions(model, data, index):  # a body for each coordinate
                straight = bool(axis[:3].any())
                turn = pin.SE3(z_to(axis[:3] if straight else axis[3:]), np.zeros(3))
                parents.append(body)
                slides.append(straight)
                placements.append(start * turn)
                inertias.append(np.zeros(10))
                body, start = len(parents) - 1, turn.inverse()
            inertia = start.act(model.inertias[index])
            xx, xy, yy, xz, yz, zz = inertia.inertia[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]
            inertias[body] = np.array([inertia.mass, *inertia.lever, xx, xy, yy, xz, yz, zz])
            self._last_body.append(body)
            self._turned.append(start)
        self.bodies = Bodies(
            np.array(parents),
            np.array(slides),
            np.array([placement.rotation.ravel() for placement in placements]),
            np.array([placement.translation for placement in placements]),
            np.array(inertias),
            np.array([0.0, *model.armature]),
            np.array(model.gravity.linear),
        )

    def frames(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
        """Bodies that carry the frames (nf,), and rotation and origin of each in them (nf, 12)."""
        carriers = np.array([self._last_body[index] for index, _ in frames], dtype=np.int64)
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
        """Fill the records `first` to `end` of `motion`, throughout which the inertias are these.

        Args:
            motion: arrays to fill (`BodyMotion.of`).
            first, end: records to fill.
            q, v: states of all records, C-contiguous, shape (n, nv).
            tool: frame whose motion is wanted.
            pairs: frames of which the pose of the second in the first is wanted.
        """
        carriers, places = self.frames([tool, *(frame for pair in pairs for frame in pair)])
        move(self.bodies, q, v, first, end, carriers, places, *motion)

    def motion(
        self,
        q: np.ndarray,
        v: np.ndarray | None = None,
        tool: Frame = WORLD_FRAME,
        pairs: Sequence[tuple[Frame, Frame]] = (),
    ) -> BodyMotion:
        """Motion of the bodies in states q and v (n, nv), at rest without v; see `move`."""
        q = np.ascontiguousarray(q, float)
        v = np.zeros_like(q) if v is None else np.ascontiguousarray(v, float)
        motion = BodyMotion.of(len(q), len(pairs))
        self.move(motion, 0, len(q), q, v, tool, pairs)
        return motion

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
            q, v, effort: states and efforts of all records, C-contiguous, shape (n, nv).
            joints: Pinocchio joints whose forces are wanted.
            constraints: points held together, of the kind CONTACT_3D, not stabilised; if they are
                redundant, the smallest forces hold them.
            pushed: Pinocchio joints on whose bodies given wrenches act.
            wrenches: force [N] and moment about the world's origin [N m] of each, world axes,
                shape (n, pushed, 6).

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
        wanted = np.array([self._last_body[index] for index in joints], dtype=np.int64)
        forces = np.empty((end - first, len(wanted), 3))
        holds = np.empty((end - first, len(constraints), 3))
        acted = np.array([self._last_body[index] for index in pushed], dtype=np.int64)
        pushes = np.zeros((len(q), 0, 6)) if wrenches is None else np.ascontiguousarray(wrenches)
        points = carriers, places
        react(self.bodies, q, v, effort, first, end, wanted, *points, acted, pushes, forces, holds)
        return forces, holds
