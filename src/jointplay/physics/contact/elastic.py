"""Elastic joints: springs that hold a body, alone or in series with a rolling bearing.

With xi = (p_x, p_y, p_z, a_x, a_y), the displacement of the journal's centre and the components of
its axis across the bearing's, the joint stores

    U = xi . K xi / 2 + sum of the curves' energies

and its wrench is minus the gradient, as for the elements of a rolling bearing (`rolling`), with
parameters and results at the same indices. In a bearing with an elastic seat both are in series:
the outer ring, which has no mass of its own, takes the displacement u that minimises
U_seat(u) + U_elements(xi - u).

A slider on springs has xi = (p_x, p_y, a_x, a_y, c) instead, where c = (R_yx - R_xy) / 2 is its
rotation about the direction of sliding.

A mount that holds its body in every direction has xi = (p, c), where c = vee(R - R^T) / 2 is the
axis of rotation times the sine of the angle; at the angular velocity w it changes by
(tr(R) I - R) w / 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.physics.contact.resultant import (
    ANSWERS,
    CAGE,
    COUNT,
    CURVE,
    DEEPEST,
    ENERGY,
    EXACT,
    FORCES,
    GUIDE,
    LARGEST,
    LOADED,
    MOUNT,
    NODES,
    SEAT,
    SEAT_ANSWERS,
    SEATED,
    SPRINGS,
    SUM,
    TABLE,
    TANGENT,
    WAYS,
)
from jointplay.physics.contact.rolling import (
    find_element_curvature,
    find_element_forces,
    solve_in_place,
)

_MOST_STEPS, _BALANCED, _LEAST_PART = 60, 1e-12, 1e-6
"""Newton's method for the outer ring's displacement (judged): most steps, residual force relative
to the load, smallest part of a step."""
_LEVER = 30.0
"""Factor that turns moments into forces, by a lever arm of a thirtieth of a metre, about a
bearing's radius [1/m]."""
_ALL = 6
"""Directions in which a body can move."""

_elements, _curvature = compiled(find_element_forces), compiled(find_element_curvature)


@compiled
def _curve_force(d, at, x):
    """Force, stiffness and energy of a force-displacement curve at a displacement."""
    count = int(d[at])
    size, last, force, energy, slope = abs(x), 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        node, node_force = d[at + 1 + k], d[at + 1 + NODES + k]
        slope = (node_force - force) / (node - last)
        if size <= node or k == count - 1:
            beyond = size - last
            return (
                math.copysign(force + slope * beyond, x),
                slope,
                energy + beyond * (force + 0.5 * slope * beyond),
            )
        energy += 0.5 * (node - last) * (force + node_force)
        last, force = node, node_force
    return 0.0, 0.0, 0.0


@compiled
def _spring_energy(d, at, n, xi, push, bend):
    """Energy of springs in n directions; its gradient (n) and Hessian (n n) into push and bend."""
    energy = 0.0
    for i in range(n):
        push[i] = 0.0
        for j in range(n):
            bend[n * i + j] = d[at + n * i + j]
            push[i] += d[at + n * i + j] * xi[j]
        energy += 0.5 * push[i] * xi[i]
    for i in range(n):
        force, slope, stored = _curve_force(d, at + n * n + CURVE * i, xi[i])
        push[i] += force
        bend[n * i + i] += slope
        energy += stored
    return energy


@compiled
def _transform(push, bend, lengths, rates, out, slopes):
    """Transform gradient and Hessian by xi into wrench and stiffness by a twist, into `out`.

    The first `lengths` components of xi are coordinates of the centre; `rates` (n - lengths, 3) are
    the rates of the others per angular velocity.
    """
    n = push.size
    for i in range(3):
        out[i] = -push[i] if i < lengths else 0.0
        out[3 + i] = 0.0
        for k in range(n - lengths):
            out[3 + i] -= rates[k, i] * push[lengths + k]
    if not slopes:
        return
    for i in range(3):
        for j in range(3):
            straight = mixed = turned = 0.0
            if i < lengths:
                straight = bend[n * i + j] if j < lengths else 0.0
                for k in range(n - lengths):
                    mixed += bend[n * i + lengths + k] * rates[k, j]
            for k in range(n - lengths):
                for m in range(n - lengths):
                    stiffness = bend[n * (lengths + k) + lengths + m]
                    turned += rates[k, i] * stiffness * rates[m, j]
            out[TANGENT + 6 * i + j] = straight
            out[TANGENT + 6 * i + 3 + j] = out[TANGENT + 6 * (3 + j) + i] = mixed
            out[TANGENT + 6 * (3 + i) + 3 + j] = turned


@compiled
def _tilt_rates(pose, rates):
    """Write the rates of a_x, a_y per angular velocity, the first two rows of `rates`."""
    ax, ay, az = pose[5], pose[8], pose[11]
    rates[0, 1], rates[0, 2], rates[1, 0], rates[1, 2] = az, -ay, -az, ax


@compiled
def _evaluate_springs(d, xi, lengths, rates, out, mode):
    """Evaluate springs alone, displaced by xi; `lengths` and `rates` as in `_transform`."""
    n = xi.size
    push, bend = np.zeros(n), np.zeros(n * n)
    for i in range(ANSWERS if mode != FORCES else TANGENT):
        out[i] = 0.0
    energy = _spring_energy(d, TABLE, n, xi, push, bend)
    _transform(push, bend, lengths, rates, out, mode != FORCES)
    size = deepest = 0.0
    for k in range(lengths):
        size += push[k] * push[k]
        deepest += xi[k] * xi[k]
    size = math.sqrt(size)
    out[ENERGY], out[SUM], out[LARGEST], out[LOADED] = energy, size, size, 1.0
    out[DEEPEST] = math.sqrt(deepest) + 1e-300


def find_spring_forces(d, pose, out, mode):
    """Find wrench and stiffness of springs on the journal; as `rolling.find_element_forces`."""
    xi, rates = np.zeros(WAYS), np.zeros((2, 3))
    xi[0], xi[1], xi[2], xi[3], xi[4] = pose[0], pose[1], pose[2], pose[5], pose[8]
    _tilt_rates(pose, rates)
    _evaluate_springs(d, xi, 3, rates, out, mode)


def find_guide_forces(d, pose, out, mode):
    """Find wrench and stiffness of springs on a slider; as `rolling.find_element_forces`."""
    xi, rates = np.zeros(WAYS), np.zeros((3, 3))
    xi[0], xi[1], xi[2], xi[3] = pose[0], pose[1], pose[5], pose[8]
    xi[4] = 0.5 * (pose[6] - pose[4])
    _tilt_rates(pose, rates)
    rates[2, 0], rates[2, 1] = -0.5 * pose[9], -0.5 * pose[10]
    rates[2, 2] = 0.5 * (pose[3] + pose[7])
    _evaluate_springs(d, xi, 2, rates, out, mode)


def find_mount_forces(d, pose, out, mode):
    """Find wrench and stiffness of a mount on its body; as `rolling.find_element_forces`."""
    xi, rates = np.zeros(_ALL), np.zeros((3, 3))
    trace = pose[3] + pose[7] + pose[11]
    for i in range(3):
        u, w = (i + 1) % 3, (i + 2) % 3
        xi[i] = pose[i]
        xi[3 + i] = 0.5 * (pose[3 + 3 * w + u] - pose[3 + 3 * u + w])
        for j in range(3):
            rates[i, j] = -0.5 * pose[3 + 3 * i + j]
        rates[i, i] += 0.5 * trace
    _evaluate_springs(d, xi, 3, rates, out, mode)


def find_seated_forces(d, pose, out, mode):
    """Find wrench and stiffness of a bearing in an elastic seat on its inner ring.

    As `rolling.find_element_forces`; `out` has `SEAT_ANSWERS` numbers, the last of which are the
    outer ring's displacement u, from which the search for the next begins.
    """
    at = TABLE + 2 * int(d[COUNT])
    seat, soft = np.zeros(WAYS), np.zeros(WAYS * WAYS)
    push, bend = np.zeros(WAYS), np.zeros(WAYS * WAYS)
    step, matrix = np.zeros(WAYS), np.zeros(WAYS * WAYS)
    u, last, relative = np.zeros(WAYS), np.zeros(WAYS), np.zeros(12)
    for i in range(WAYS):
        u[i] = out[SEAT + i]
    # Newton's method for u: balance the seat's force with the elements', which act on `relative`.
    part_taken, lowest = 1.0, np.inf
    energy, error = 0.0, np.inf
    for _ in range(_MOST_STEPS):
        for i in range(12):
            relative[i] = pose[i]
        for i in range(3):
            relative[i] -= u[i]
        relative[5] -= u[3]
        relative[8] -= u[4]
        _elements(d, relative, out, FORCES)
        _curvature(d, relative, bend)
        stored = _spring_energy(d, at, WAYS, u, seat, soft)
        energy = stored + out[ENERGY]
        push[0], push[1], push[2] = -out[0], -out[1], -out[2]
        push[3], push[4] = -out[4] / relative[11], out[3] / relative[11]
        left = size = 0.0
        for i in range(WAYS):
            unit = 1.0 if i < 3 else _LEVER
            left = max(left, abs(seat[i] - push[i]) * unit)
            size = max(size, abs(seat[i]) * unit, abs(push[i]) * unit)
        if energy > lowest + 1e-13 * abs(lowest) and part_taken > _LEAST_PART and left > error:
            # Neither energy nor residual fell: take half of the step.
            part_taken *= 0.5
            for i in range(WAYS):
                u[i] = last[i] + part_taken * step[i]
            continue
        if left <= _BALANCED * size or (left >= error and left <= 1e-9 * size):
            break
        lowest, error, part_taken = energy, left, 1.0
        for i in range(WAYS):
            last[i] = u[i]
            step[i] = push[i] - seat[i]
            for j in range(WAYS):
                matrix[WAYS * i + j] = soft[WAYS * i + j] + bend[WAYS * i + j]
        solve_in_place(matrix, step, 1, -1.0)
        for i in range(WAYS):
            u[i] += step[i]
    for i in range(WAYS):
        out[SEAT + i] = u[i]
    out[ENERGY] = energy
    rates = np.zeros((2, 3))
    _tilt_rates(pose, rates)
    _transform(seat, soft, 3, rates, out, False)
    if mode == FORCES:
        return
    # Stiffness of both in series: K - K (K + H)^-1 K, K of the seat and H of the elements.
    series, columns = np.zeros(WAYS * WAYS), np.zeros(WAYS * WAYS)
    for i in range(WAYS * WAYS):
        matrix[i] = soft[i] + bend[i]
        columns[i] = soft[i]
    solve_in_place(matrix, columns, WAYS, -1.0)
    for i in range(WAYS):
        for j in range(WAYS):
            series[WAYS * i + j] = soft[WAYS * i + j]
            for k in range(WAYS):
                series[WAYS * i + j] -= soft[WAYS * i + k] * columns[WAYS * k + j]
    _transform(seat, series, 3, rates, out, True)


_springs_alone, _seated = compiled(find_spring_forces), compiled(find_seated_forces)
_guide, _mount = compiled(find_guide_forces), compiled(find_mount_forces)

FUNCTIONS = (
    *(find_element_forces, find_seated_forces, find_spring_forces, find_guide_forces),
    find_mount_forces,
)
"""Functions of the laws `ELEMENTS`, `SEATED`, `SPRINGS`, `GUIDE` and `MOUNT`."""


@compiled
def _evaluate_at_poses(law, numbers, poses, cage, out):
    """Evaluate a law at many poses into `out`."""
    joint = numbers.copy()
    for i in range(poses.shape[0]):
        joint[CAGE] = cage[i]
        if law == SPRINGS:
            _springs_alone(joint, poses[i], out[i], EXACT)
        elif law == GUIDE:
            _guide(joint, poses[i], out[i], EXACT)
        elif law == MOUNT:
            _mount(joint, poses[i], out[i], EXACT)
        elif law == SEATED:
            _seated(joint, poses[i], out[i], EXACT)
        else:
            _elements(joint, poses[i], out[i], EXACT)


def answers(
    law: int, numbers: Sequence[float], poses: np.ndarray, cage: np.ndarray | float = 0.0
) -> np.ndarray:
    """Evaluate a law at many poses; results of `rolling.find_element_forces`, (n, `SEAT_ANSWERS`).

    Args:
        law: `ELEMENTS`, `SEATED`, `SPRINGS`, `GUIDE` or `MOUNT`.
        numbers: its parameters.
        poses: the journal in its bearing, centre [m] and orientation row by row, shape (n, 12).
        cage: azimuth of the first element, shape (n,) [rad].
    """
    out = np.zeros((len(poses), SEAT_ANSWERS))
    turns = np.broadcast_to(np.asarray(cage, float), len(poses)).copy()
    _evaluate_at_poses(law, np.array(numbers), np.ascontiguousarray(poses), turns, out)
    return out


@cache
def address(law: int) -> int:
    """Machine address of a law's compiled function, for the time loop."""
    from jointplay.physics.contact.machine_code import compiled_function  # the time loop's alone

    return compiled_function(FUNCTIONS[law], "v(p,p,p,i)").address
