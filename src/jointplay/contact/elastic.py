"""Elastic joints: what a body does to another that it holds by springs, alone or with a bearing.

With xi = (p_x, p_y, p_z, a_x, a_y), the displacement of the journal's centre and the part of its
axis across the bearing's, the joint stores

    U = xi . K xi / 2 + sum of the curves' energies

and answers with its gradient, like the elements of a rolling bearing (`rolling`), with the same
numbers ahead and in the same places. A bearing in a seat that gives way is both in series: the
outer ring is displaced by the u that makes U_seat(u) + U_elements(xi - u) least, the ring having no
mass of its own.

A slider on springs has xi = (p_x, p_y, a_x, a_y, c) instead, where c = (R_yx - R_xy) / 2 is its
turn about the direction of sliding.

A mount that holds its body in every direction has xi = (p, c), where c = vee(R - R^T) / 2 is the
sine of the angle along the axis of the turn, and changes with the angular velocity w by
(tr(R) I - R) w / 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from jointplay.contact import resultant, rolling
from jointplay.contact.resultant import (
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
from jointplay.contact.rolling import find_element_forces, part
from jointplay.core import compiler
from jointplay.core.compiler import njit, stamp

_MOST, _ENOUGH, _LEAST_PART = 60, 1e-12, 1e-6
_ALL = 6
"""Directions of a body."""

_elements = part(find_element_forces)


@part
def _on_curve(d, at, x):
    """Force, its slope and the energy of a curve at a displacement."""
    count = int(d[at])
    size, last, force, energy, slope = abs(x), 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        here, there = d[at + 1 + k], d[at + 1 + NODES + k]
        slope = (there - force) / (here - last)
        if size <= here or k == count - 1:
            way = size - last
            return (
                math.copysign(force + slope * way, x),
                slope,
                energy + way * (force + 0.5 * slope * way),
            )
        energy += 0.5 * (here - last) * (force + there)
        last, force = here, there
    return 0.0, 0.0, 0.0


@part
def _springs(d, at, ways, xi, push, bend):
    """Gradient (n) and curvature (n n) of the energy of springs in n `ways`; returns the energy."""
    energy = 0.0
    for i in range(ways):
        push[i] = 0.0
        for j in range(ways):
            bend[ways * i + j] = d[at + ways * i + j]
            push[i] += d[at + ways * i + j] * xi[j]
        energy += 0.5 * push[i] * xi[i]
    for i in range(ways):
        force, slope, stored = _on_curve(d, at + ways * ways + CURVE * i, xi[i])
        push[i] += force
        bend[ways * i + i] += slope
        energy += stored
    return energy


@part
def _answer(push, bend, ax, ay, az, out, slopes):
    """Write wrench and stiffness in terms of a twist, from those in terms of xi."""
    gx, gy = push[3], push[4]
    out[0], out[1], out[2] = -push[0], -push[1], -push[2]
    out[3], out[4], out[5] = az * gy, -az * gx, -(ax * gy - ay * gx)
    if not slopes:
        return
    # Rates of a_x and a_y by an angular velocity: rows of the Jacobian of xi.
    rows = ((0.0, az, -ay), (-az, 0.0, ax))
    for i in range(3):
        for j in range(3):
            out[TANGENT + 6 * i + j] = bend[WAYS * i + j]
            mixed = turned = 0.0
            for k in range(2):
                mixed += bend[WAYS * i + 3 + k] * rows[k][j]
                for m in range(2):
                    turned += rows[k][i] * bend[WAYS * (3 + k) + 3 + m] * rows[m][j]
            out[TANGENT + 6 * i + 3 + j] = out[TANGENT + 6 * (3 + j) + i] = mixed
            out[TANGENT + 6 * (3 + i) + 3 + j] = turned


def find_spring_forces(d, pose, out, mode):
    """What springs alone do to the journal; as `rolling.find_element_forces`."""
    push, bend, xi = np.zeros(WAYS), np.zeros(WAYS * WAYS), np.zeros(WAYS)
    xi[0], xi[1], xi[2] = pose[0], pose[1], pose[2]
    xi[3], xi[4] = pose[5], pose[8]
    for i in range(ANSWERS if mode != FORCES else TANGENT):
        out[i] = 0.0
    energy = _springs(d, TABLE, WAYS, xi, push, bend)
    _answer(push, bend, pose[5], pose[8], pose[11], out, mode != FORCES)
    size = math.sqrt(push[0] * push[0] + push[1] * push[1] + push[2] * push[2])
    out[ENERGY], out[SUM], out[LARGEST], out[LOADED] = energy, size, size, 1.0
    out[DEEPEST] = math.sqrt(xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]) + 1e-300


@part
def _guide_answer(push, bend, pose, out, slopes):
    """Write wrench and stiffness of a slider in terms of a twist."""
    # Rates of xi by a twist: the Jacobian.
    ax, ay, az = pose[5], pose[8], pose[11]
    rows = (
        (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, az, -ay),
        (0.0, 0.0, 0.0, -az, 0.0, ax),
        (0.0, 0.0, 0.0, -0.5 * pose[9], -0.5 * pose[10], 0.5 * (pose[3] + pose[7])),
    )
    for i in range(6):
        out[i] = 0.0
        for k in range(WAYS):
            out[i] -= rows[k][i] * push[k]
    if not slopes:
        return
    for i in range(6):
        for j in range(6):
            whole = 0.0
            for k in range(WAYS):
                for m in range(WAYS):
                    whole += rows[k][i] * bend[WAYS * k + m] * rows[m][j]
            out[TANGENT + 6 * i + j] = whole


def find_guide_forces(d, pose, out, mode):
    """What springs that let a slider move do to it; as `rolling.find_element_forces`."""
    push, bend, xi = np.zeros(WAYS), np.zeros(WAYS * WAYS), np.zeros(WAYS)
    xi[0], xi[1], xi[2], xi[3] = pose[0], pose[1], pose[5], pose[8]
    xi[4] = 0.5 * (pose[6] - pose[4])
    for i in range(ANSWERS if mode != FORCES else TANGENT):
        out[i] = 0.0
    energy = _springs(d, TABLE, WAYS, xi, push, bend)
    _guide_answer(push, bend, pose, out, mode != FORCES)
    size = math.sqrt(push[0] * push[0] + push[1] * push[1])
    out[ENERGY], out[SUM], out[LARGEST], out[LOADED] = energy, size, size, 1.0
    out[DEEPEST] = math.sqrt(xi[0] * xi[0] + xi[1] * xi[1]) + 1e-300


def find_mount_forces(d, pose, out, mode):
    """What springs in all six directions do to what they hold; as `rolling.find_element_forces`."""
    push, bend, xi = np.zeros(_ALL), np.zeros(_ALL * _ALL), np.zeros(_ALL)
    rows = np.zeros(9)  # of the rates of c by an angular velocity
    trace = pose[3] + pose[7] + pose[11]
    for i in range(3):
        u, w = (i + 1) % 3, (i + 2) % 3
        xi[i] = pose[i]
        xi[3 + i] = 0.5 * (pose[3 + 3 * w + u] - pose[3 + 3 * u + w])
        for j in range(3):
            rows[3 * i + j] = -0.5 * pose[3 + 3 * i + j]
        rows[4 * i] += 0.5 * trace
    for i in range(ANSWERS if mode != FORCES else TANGENT):
        out[i] = 0.0
    energy = _springs(d, TABLE, _ALL, xi, push, bend)
    for i in range(3):
        out[i] = -push[i]
        for k in range(3):
            out[3 + i] -= rows[3 * k + i] * push[3 + k]
    if mode != FORCES:
        for i in range(3):
            for j in range(3):
                out[TANGENT + 6 * i + j] = bend[_ALL * i + j]
                mixed = turned = 0.0
                for k in range(3):
                    mixed += bend[_ALL * i + 3 + k] * rows[3 * k + j]
                    for m in range(3):
                        turned += rows[3 * k + i] * bend[_ALL * (3 + k) + 3 + m] * rows[3 * m + j]
                out[TANGENT + 6 * i + 3 + j] = out[TANGENT + 6 * (3 + j) + i] = mixed
                out[TANGENT + 6 * (3 + i) + 3 + j] = turned
    size = math.sqrt(push[0] * push[0] + push[1] * push[1] + push[2] * push[2])
    out[ENERGY], out[SUM], out[LARGEST], out[LOADED] = energy, size, size, 1.0
    out[DEEPEST] = math.sqrt(xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]) + 1e-300


@part
def _solve(matrix, right, columns):
    """Solve a positive definite system (25) in place for some columns (5, columns)."""
    for k in range(WAYS):
        for i in range(k + 1, WAYS):
            factor = matrix[WAYS * i + k] / matrix[WAYS * k + k]
            for j in range(k, WAYS):
                matrix[WAYS * i + j] -= factor * matrix[WAYS * k + j]
            for c in range(columns):
                right[columns * i + c] -= factor * right[columns * k + c]
    for k in range(WAYS - 1, -1, -1):
        for c in range(columns):
            for j in range(k + 1, WAYS):
                right[columns * k + c] -= matrix[WAYS * k + j] * right[columns * j + c]
            right[columns * k + c] /= matrix[WAYS * k + k]


def find_seated_forces(d, pose, out, mode):
    """What a bearing in a seat that gives way does to its inner ring.

    As `rolling.find_element_forces`; `out` has `SEAT_ANSWERS` numbers, the last of which are the
    outer ring's displacement, from which the search begins.
    """
    at = TABLE + 2 * int(d[COUNT])
    seat, soft = np.zeros(WAYS), np.zeros(WAYS * WAYS)
    push, bend = np.zeros(WAYS), np.zeros(WAYS * WAYS)
    step, matrix = np.zeros(WAYS), np.zeros(WAYS * WAYS)
    u, last, there = np.zeros(WAYS), np.zeros(WAYS), np.zeros(12)
    for i in range(WAYS):
        u[i] = out[SEAT + i]
    part_taken, lowest = 1.0, np.inf
    energy, error = 0.0, np.inf
    for _ in range(_MOST):
        for i in range(12):
            there[i] = pose[i]
        for i in range(3):
            there[i] -= u[i]
        there[5] -= u[3]
        there[8] -= u[4]
        _elements(d, there, out, EXACT)
        stored = _springs(d, at, WAYS, u, seat, soft)
        energy = stored + out[ENERGY]
        _gradient(out, there, push, bend)
        left = size = 0.0
        for i in range(WAYS):
            unit = 1.0 if i < 3 else 30.0  # angles count by a lever of a thirtieth of a metre
            left = max(left, abs(seat[i] - push[i]) * unit)
            size = max(size, abs(seat[i]) * unit, abs(push[i]) * unit)
        if energy > lowest + 1e-13 * abs(lowest) and part_taken > _LEAST_PART and left > error:
            part_taken *= 0.5
            for i in range(WAYS):
                u[i] = last[i] + part_taken * step[i]
            continue
        if left <= _ENOUGH * size or (left >= error and left <= 1e-9 * size):
            break
        lowest, error, part_taken = energy, left, 1.0
        for i in range(WAYS):
            last[i] = u[i]
            step[i] = push[i] - seat[i]
            for j in range(WAYS):
                matrix[WAYS * i + j] = soft[WAYS * i + j] + bend[WAYS * i + j]
        _solve(matrix, step, 1)
        for i in range(WAYS):
            u[i] += step[i]
    for i in range(WAYS):
        out[SEAT + i] = u[i]
    out[ENERGY] = energy
    _answer(seat, soft, pose[5], pose[8], pose[11], out, False)
    if mode == FORCES:
        return
    # Both in series: K - K (K + H)^-1 K.
    series, columns = np.zeros(WAYS * WAYS), np.zeros(WAYS * WAYS)
    for i in range(WAYS * WAYS):
        matrix[i] = soft[i] + bend[i]
        columns[i] = soft[i]
    _solve(matrix, columns, WAYS)
    for i in range(WAYS):
        for j in range(WAYS):
            series[WAYS * i + j] = soft[WAYS * i + j]
            for k in range(WAYS):
                series[WAYS * i + j] -= soft[WAYS * i + k] * columns[WAYS * k + j]
    _answer(seat, series, pose[5], pose[8], pose[11], out, True)


@part
def _gradient(out, pose, push, bend):
    """Gradient and curvature in terms of xi of the elements' energy, from what they answer.

    Curvatures at an upright axis: they lead the search only.
    """
    push[0], push[1], push[2] = -out[0], -out[1], -out[2]
    push[3], push[4] = -out[4] / pose[11], out[3] / pose[11]
    # xi's angles are (about y, -about x) of a twist.
    for i in range(WAYS):
        for j in range(WAYS):
            a, one = (i, 1.0) if i < 3 else ((4, 1.0) if i == 3 else (3, -1.0))
            b, other = (j, 1.0) if j < 3 else ((4, 1.0) if j == 3 else (3, -1.0))
            bend[WAYS * i + j] = one * other * out[TANGENT + 6 * a + b]


_springs_alone, _seated = part(find_spring_forces), part(find_seated_forces)
_guide, _mount = part(find_guide_forces), part(find_mount_forces)

FUNCTIONS = (
    *(find_element_forces, find_seated_forces, find_spring_forces, find_guide_forces),
    find_mount_forces,
)
"""By law."""


@njit(cache=True, error_model="numpy")
def forces_at(law, numbers, poses, cage, out):
    """Answers of a law at many poses."""
    own = numbers.copy()
    for i in range(poses.shape[0]):
        own[CAGE] = cage[i]
        if law == SPRINGS:
            _springs_alone(own, poses[i], out[i], EXACT)
        elif law == GUIDE:
            _guide(own, poses[i], out[i], EXACT)
        elif law == MOUNT:
            _mount(own, poses[i], out[i], EXACT)
        elif law == SEATED:
            _seated(own, poses[i], out[i], EXACT)
        else:
            _elements(own, poses[i], out[i], EXACT)


_SOURCES = (__file__, resultant.__file__, rolling.__file__, compiler.__file__)
stamp(forces_at, map(Path, _SOURCES))


def answers(
    law: int, numbers: Sequence[float], poses: np.ndarray, cage: np.ndarray | float = 0.0
) -> np.ndarray:
    """What a law answers at many poses, all exact.

    Args:
        law: `ELEMENTS`, `SEATED`, `SPRINGS`, `GUIDE` or `MOUNT`.
        numbers: of the joint.
        poses: (n, 12) of the journal in its bearing: centre [m], orientation row by row.
        cage: azimuth of the first element, (n,) [rad].

    Returns:
        (n, `SEAT_ANSWERS`), see `rolling.find_element_forces`.
    """
    found = np.zeros((len(poses), SEAT_ANSWERS))
    turns = np.broadcast_to(np.asarray(cage, float), len(poses)).copy()
    forces_at(law, np.array(numbers), np.ascontiguousarray(poses), turns, found)
    return found


@cache
def address(law: int) -> int:
    """Machine address of a law, for the time loop."""
    from numba import types

    from jointplay.contact.compiled import compiled_function  # the time loop's alone

    array = types.CPointer(types.float64)
    signature = types.void(array, array, array, types.int64)
    return int(compiled_function(FUNCTIONS[law], signature).address)
