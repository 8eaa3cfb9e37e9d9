"""Where the inner ring of a loaded rolling bearing comes to rest, by the law of `rolling`.

What is loaded settles at the minimum of the energy of all elements less the work of the load. In
xi = (p_x, p_y, p_z, a_x, a_y), the displacement of the ring's centre and the part of its axis
across the outer ring's, that energy is convex but for what a lean adds in its second order. So
steps with its second derivatives, no longer than they can be trusted, find the minimum from
anywhere: J. J. More, D. C. Sorensen, Computing a trust region step, SIAM J. Sci. Stat. Comput. 4
(1983) 553-572.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.physics.contact.resultant import (
    ANSWERS,
    BALL_EXPONENT,
    CAGE,
    CAGE_SLOPE,
    DISTANCE,
    FORCES,
    RADIUS,
    RATIO,
    REACH,
    ROLLER_EXPONENT,
    ROLLERS,
    ROW_NUMBERS,
    ROW_PLACES,
    ROWS,
    STIFFNESS,
    SUM,
    WAYS,
)
from jointplay.physics.contact.rolling import find_element_curvature, find_element_forces

_MOST, _MOST_CUTS, _MOST_SHIFTS = 600, 40, 60
"""Steps, trials of each, and shifts of curvature."""
_BALANCED, _ACCEPTED, _ROUNDING = 1e-11, 1e-8, 1e-14
"""Forces left over, by the load: that are aimed at, and that rounding is allowed to leave; and by
the sum of the elements' loads."""
_CAREFUL = 0.9
"""By how much of the slope that a step goes down the slope at its end may go up."""
_IDLE, _LONGER = 0.9, 4.0
"""Part of that slope above which a step was too short, and by how much it is made longer: where one
element bears all, there is no stiffness across it until the next one is touched."""
_STEEPEST = 0.25
"""Square of the largest sine of a lean."""
_SINGULAR = 1e-12
"""Stiffness of a direction that counts as none, by the largest."""


_elements, _curvature = compiled(find_element_forces), compiled(find_element_curvature)
_SQUARE = WAYS * WAYS
FOUND, PUSH, SOFT = WAYS, WAYS + 1, 2 * WAYS + 1
"""Places of what `rests` finds behind xi: whether it is a place of rest, the load in terms of xi
less what the cage takes (5) [N, N m], and how xi changes with force and moment (5, 5)."""
REST = SOFT + _SQUARE
"""How many numbers it finds."""


@compiled
def _answer(d, load, lean, xi, pose, out, left):
    """Ask the elements at a place: what of the load is not balanced, in terms of xi."""
    x, y = xi[3] + lean[0], xi[4] + lean[1]
    up = math.sqrt(1.0 - x * x - y * y)
    pose[0], pose[1], pose[2] = xi[0], xi[1], xi[2]
    pose[5], pose[8], pose[11] = xi[3], xi[4], up
    _elements(d, pose, out, FORCES)
    for i in range(3):
        left[i] = load[i] + out[i]
    left[3], left[4] = (load[4] + out[4]) / up, -(load[3] + out[3]) / up


@compiled
def _factor(bend, shift, lower):
    """Cholesky's factor (25) of a matrix with a shift of its diagonal; whether it has one."""
    for i in range(WAYS):
        for j in range(i + 1):
            left = bend[WAYS * i + j] + (shift if i == j else 0.0)
            for k in range(j):
                left -= lower[WAYS * i + k] * lower[WAYS * j + k]
            if i > j:
                lower[WAYS * i + j] = left / lower[WAYS * j + j]
            elif left <= 0.0 or left <= _SINGULAR * bend[WAYS * i + i]:
                return False
            else:
                lower[WAYS * i + i] = math.sqrt(left)
    return True


@compiled
def _half_solved(lower, right, found):
    """L^-1 times the right hand side."""
    for i in range(WAYS):
        found[i] = right[i]
        for k in range(i):
            found[i] -= lower[WAYS * i + k] * found[k]
        found[i] /= lower[WAYS * i + i]


@compiled
def _solved(lower, right, found):
    """(L L^T)^-1 times the right hand side."""
    _half_solved(lower, right, found)
    for i in range(WAYS - 1, -1, -1):
        for k in range(i + 1, WAYS):
            found[i] -= lower[WAYS * k + i] * found[k]
        found[i] /= lower[WAYS * i + i]


@compiled
def _length(vector):
    """Of five numbers."""
    total = 0.0
    for x in vector:
        total += x * x
    return math.sqrt(total)


@compiled
def _step(bend, left, trust, lower, way, half):
    """Down the energy as far as its curvature says, about `trust` at most; its length."""
    largest = 0.0
    for i in range(WAYS):
        largest = max(largest, abs(bend[WAYS * i + i]))
    least = _SINGULAR * max(largest, _length(left) / trust)
    shift = 0.0
    for _ in range(_MOST_SHIFTS):
        if not _factor(bend, shift, lower):
            shift = max(4.0 * shift, least)
            continue
        _solved(lower, left, way)
        size = _length(way)
        if size <= 1.2 * trust:
            return size
        _half_solved(lower, way, half)
        bent = _length(half)
        shift += (size / trust - 1.0) * (size / bent) ** 2
    return size


@compiled
def _soften(d, load, xi, pose, out, bend, unit, soft):
    """How xi changes with force and moment, from the balance of `_answer`; whether it is told."""
    ax, ay, up = pose[5], pose[8], pose[11]
    gradient, turned = np.zeros(WAYS), np.zeros(WAYS)
    back, ratio = d[RATIO] * out[CAGE_SLOPE], d[RATIO]
    for i in range(3):
        gradient[i] = -out[i]
    gradient[3], gradient[4] = -(out[4] + back * ay) / up, (out[3] + back * ax) / up
    turned[0], turned[1], turned[3], turned[4] = xi[1], -xi[0], ay, -ax
    fall = bend.copy()
    for j in range(WAYS):
        back_by = 0.0
        for i in range(WAYS):
            back_by += ratio * bend[WAYS * j + i] * turned[i]
        if j in (0, 3):
            back_by -= ratio * gradient[j + 1]
        elif j in (1, 4):
            back_by += ratio * gradient[j - 1]
        steeper = (ax if j == 3 else ay) / up**3 if j > 2 else 0.0
        fall[WAYS * 3 + j] += back_by * ay / up - (load[4] - back * ay) * steeper
        fall[WAYS * 4 + j] -= back_by * ax / up + (back * ax - load[3]) * steeper
    fall[WAYS * 3 + 4] += back / up
    fall[WAYS * 4 + 3] -= back / up
    # Solve for a force and a moment each, in units in which the numbers are of like size.
    right = np.zeros(_SQUARE)
    for i in range(3):
        right[WAYS * i + i] = unit[i]
    right[WAYS * 3 + 4], right[WAYS * 4 + 3] = unit[3] / up, -unit[4] / up
    largest = 0.0
    for i in range(WAYS):
        for j in range(WAYS):
            fall[WAYS * i + j] *= unit[i] * unit[j]
        largest = max(largest, abs(fall[WAYS * i + i]))
    for k in range(WAYS):
        if abs(fall[WAYS * k + k]) <= _SINGULAR * largest:
            return False
        for i in range(k + 1, WAYS):
            factor = fall[WAYS * i + k] / fall[WAYS * k + k]
            for j in range(WAYS):
                fall[WAYS * i + j] -= factor * fall[WAYS * k + j]
                right[WAYS * i + j] -= factor * right[WAYS * k + j]
    for k in range(WAYS - 1, -1, -1):
        for j in range(WAYS):
            for i in range(k + 1, WAYS):
                right[WAYS * k + j] -= fall[WAYS * k + i] * right[WAYS * i + j]
            right[WAYS * k + j] /= fall[WAYS * k + k]
    for i in range(WAYS):
        for j in range(WAYS):
            soft[WAYS * i + j] = right[WAYS * i + j] * unit[i]
    return True


@compiled
def _size(d, force, unit):
    """Of xi at which a force changes much, (5,) [m, 1]."""
    exponent = ROLLER_EXPONENT if d[ROLLERS] != 0.0 else BALL_EXPONENT
    depth = (force / d[STIFFNESS]) ** (1.0 / exponent)
    h, up, last = d[ROW_PLACES], d[ROW_PLACES + 1], int(d[ROWS]) - 1
    if d[ROLLERS] != 0.0:
        across = along = max(d[REACH], 0.0) + depth
    elif d[ROW_PLACES + ROW_NUMBERS * last + 1] == up:  # rows that press the same way, if any
        across = max(d[DISTANCE] - d[REACH], 0.0) + depth
        far = d[DISTANCE] + depth
        along = math.sqrt(max(far * far - d[REACH] ** 2, depth * depth))
    else:
        across = along = max(d[DISTANCE] - math.sqrt(d[REACH] ** 2 + up * up), 0.0) + depth
    lever = d[RADIUS] + abs(h)
    unit[0], unit[1], unit[2] = across, across, along
    unit[3] = unit[4] = along / lever


@compiled
def _rest(d, load, lean, found):
    """Where the ring rests under a load, into the numbers `found`; see `rests`."""
    xi, there, best = np.zeros(WAYS), np.zeros(WAYS), np.zeros(WAYS)
    left, scaled, way, half = np.zeros(WAYS), np.zeros(WAYS), np.zeros(WAYS), np.zeros(WAYS)
    bend, lower, unit = np.zeros(_SQUARE), np.zeros(_SQUARE), np.zeros(WAYS)
    pose, out, matrix = np.zeros(12), np.zeros(ANSWERS), np.zeros(_SQUARE)
    lever = d[RADIUS]
    size = _norm(load, lever)
    _answer(d, load, lean, xi, pose, out, left)
    _size(d, max(size, 1e-3 * out[SUM], 1e-9), unit)
    if out[SUM] == 0.0:
        if size == 0.0:
            found[FOUND] = 1.0
            return
        long = 0.0
        for i in range(WAYS):
            xi[i] = left[i] * unit[i]
            long += xi[i] * xi[i]
        for i in range(WAYS):
            xi[i] *= unit[i] / math.sqrt(long)
        _answer(d, load, lean, xi, pose, out, left)
    trust, least = 1.0, np.inf
    for _ in range(_MOST):
        error = _norm(left, lever)
        if error < least:
            least = error
            for i in range(WAYS):
                best[i] = xi[i]
        if error <= _BALANCED * size + _ROUNDING * out[SUM]:
            break
        _curvature(d, pose, bend)
        for i in range(WAYS):
            scaled[i] = left[i] * unit[i]
            for j in range(WAYS):
                matrix[WAYS * i + j] = bend[WAYS * i + j] * unit[i] * unit[j]
        long = _step(matrix, scaled, trust, lower, way, half)
        down, share, longer = 0.0, 1.0, True
        for i in range(WAYS):
            down += scaled[i] * way[i]
        for _ in range(_MOST_CUTS):
            for i in range(WAYS):
                there[i] = xi[i] + share * unit[i] * way[i]
            after = -np.inf
            if (there[3] + lean[0]) ** 2 + (there[4] + lean[1]) ** 2 < _STEEPEST:
                _answer(d, load, lean, there, pose, out, left)
                after = 0.0
                for i in range(WAYS):
                    after += left[i] * unit[i] * way[i]
            if after >= -_CAREFUL * down:
                longer &= after > _IDLE * down and _LONGER * share * long <= trust
                if not longer:
                    break
                share *= _LONGER
                continue
            longer = False
            share *= max(0.1, min(0.7, down / (down - after)))
        if share < 1.0:
            trust = 2.0 * share * long
        elif long > 0.9 * trust:
            trust *= 2.0
        for i in range(WAYS):
            xi[i] = there[i]
    if least > _ACCEPTED * size + _ROUNDING * out[SUM]:
        return
    _answer(d, load, lean, best, pose, out, left)
    _curvature(d, pose, bend)
    told = _soften(d, load, best, pose, out, bend, unit, found[SOFT:])
    found[FOUND] = 1.0 if told else -1.0
    for i in range(WAYS):
        found[i] = best[i]
    for i in range(3):
        found[PUSH + i] = -out[i]
    found[PUSH + 3], found[PUSH + 4] = -out[4] / pose[11], out[3] / pose[11]


@compiled
def _norm(load, lever):
    """Of a force and two moments [N]."""
    turning = (load[3] * load[3] + load[4] * load[4]) / (lever * lever)
    return math.sqrt(load[0] ** 2 + load[1] ** 2 + load[2] ** 2 + turning)


@compiled
def _rests(numbers, loads, cage, lean, found):
    own = numbers.copy()
    for i in range(loads.shape[0]):
        own[CAGE] = cage[i]
        _rest(own, loads[i], lean[i], found[i])


def rests(
    numbers: Sequence[float], loads: np.ndarray, cage: np.ndarray | float, lean: np.ndarray
) -> np.ndarray:
    """Where the inner ring rests under loads (n, 5), each a force and moments about x and y [N m].

    Args:
        numbers: of the bearing (`resultant.bearing_numbers`).
        loads: on the ring, in the axes of the outer one.
        cage: azimuth of the first element (n,) [rad].
        lean: what the outer ring leans by in its seat, x and y of its axis (n, 2).

    Returns:
        `REST` numbers of each (n, REST): xi, 1 where it is a place of rest, -1 where it is one and
        something is free to move there, so that what follows is not told, 0 where none was found;
        the load in terms of xi; the compliance.
    """
    found = np.zeros((len(loads), REST))
    turns = np.broadcast_to(np.asarray(cage, float), len(loads)).copy()
    _rests(np.array(numbers), np.ascontiguousarray(loads), turns, lean, found)
    return found
