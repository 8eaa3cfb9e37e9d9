"""Rolling bearings: load, stiffness and equilibrium of the inner ring on its rolling elements.

Each element is a spring between two raceways that only pushes. With e_r the radial direction at its
azimuth, p the displacement of the inner ring's centre, a the ring's axis and s = e_r . a, the ends
of the spring of a ball are the centres of curvature of both grooves, A apart where it just touches:

    X = r_i - r_o + p . e_r + h s - r_i s^2 / 2
    Y = y_0 + p_z - r_i s + h (a_z - 1),        delta = sqrt(X^2 + Y^2) - A

in the plane of its azimuth, with the radii r_i and r_o of the circles on which these centres lie
and the position h of the row along the axis. A crossed roller, whose axis is inclined by 45 degrees
one way or the other (k = 1 or -1), has

    delta = (p . e_r + k (p_z - r s) - C_r) / sqrt(2)

The load of an element is Q = K delta^n, n = 3/2 for a ball (Hertz's point contacts at both rings in
series) and 10/9 for a roller (ISO/TS 16281). All forces and moments are the gradient of the energy

    U = sum K delta^(n + 1) / (n + 1)

so no energy is gained or lost on a closed path; the lever arm of a ball's moment is then that of
the groove. The elements go around with the cage, by ratio = (1 - D cos(alpha) / d_m) / 2 of the
ring's own rotation. As U depends on the azimuth of the cage, the moment about the axis is
-ratio dU/d(cage). Centrifugal and gyroscopic forces of the elements are left out.

The first part evaluates forces and stiffness at a pose, the second finds the pose in equilibrium
with a load (`rests`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.physics.contact.resultant import (
    ACROSS,
    ALONG,
    ANSWERS,
    BALL_EXPONENT,
    BOUNDED,
    CAGE,
    CAGE_SLOPE,
    COSINE,
    COUNT,
    DEEPEST,
    DISTANCE,
    ENERGY,
    FORCES,
    LARGEST,
    LOADED,
    PLACE,
    RADIUS,
    RATIO,
    REACH,
    ROLLER_EXPONENT,
    ROLLERS,
    ROW_NUMBERS,
    ROW_PLACES,
    ROWS,
    SINE,
    STIFFNESS,
    SUM,
    TABLE,
    TANGENT,
    WAYS,
)

_HALF = math.sqrt(0.5)


@compiled
def _ninth_root(x):
    """x^(1/9) for x > 0, to rounding: the cube root of a cube root."""
    return np.cbrt(np.cbrt(x))


@compiled
def _gap_at_least(d, radial, axial, lean):
    """Lower bound of the gap of all elements [m], given the size of displacements and tilt.

    If it is negative an element may bear load.
    """
    if d[ROLLERS] != 0.0:
        return _HALF * (d[REACH] - radial - axial - d[RADIUS] * lean)
    farthest = 0.0
    for row in range(int(d[ROWS])):
        h, y = d[ROW_PLACES + ROW_NUMBERS * row], d[ROW_PLACES + ROW_NUMBERS * row + 1]
        x = d[REACH] + radial + abs(h) * lean
        y = abs(y) + axial + d[RADIUS] * lean + abs(h) * lean * lean
        farthest = max(farthest, x * x + y * y)
    return d[DISTANCE] - math.sqrt(farthest)


@compiled
def _touch(d, pose, h, start, element, turn_c, turn_s):
    """Deflection of one element and its geometry, by the equations above.

    Args:
        d, pose: see `find_element_forces`.
        h: position of its row along the axis [m].
        start: y_0 + p_z + h (a_z - 1), the same for all elements of a row [m].
        element: its number in the row, from the cage's azimuth on.
        turn_c, turn_s: cosine and sine of that azimuth.

    Returns:
        delta [m]; cosine and sine of its azimuth; the components of the contact direction across
        and along the axis; the lever arm of the former about the ring's centre [m]; the distance
        of the two centres of curvature [m], meaningless for a roller.
    """
    c0, s0 = d[TABLE + 2 * element], d[TABLE + 2 * element + 1]
    c, s = c0 * turn_c - s0 * turn_s, s0 * turn_c + c0 * turn_s
    r, reach = d[RADIUS], d[REACH]
    lean = c * pose[5] + s * pose[8]
    radial = pose[0] * c + pose[1] * s
    if d[ROLLERS] != 0.0:  # crossed rollers are inclined one way and the other in turn
        up = _HALF if element % 2 == 0 else -_HALF
        delta = _HALF * (radial - reach) + up * (start - r * lean)
        return delta, c, s, _HALF, up, 0.0, 1.0
    x = reach + radial + (h - 0.5 * r * lean) * lean
    y = start - r * lean
    length = math.sqrt(x * x + y * y)
    return length - d[DISTANCE], c, s, x / length, y / length, h - r * lean, length


@compiled
def _add_outer(sums, rise, a, b, c, d, e, f):
    """Lower triangle of a symmetric matrix, row by row (21), plus rise s s^T, s = (a, ..., f).

    As a tuple the sums stay in registers; an array would be read and written 21 times for each
    element.
    """
    ra, rb, rc, rd, re, rf = rise * a, rise * b, rise * c, rise * d, rise * e, rise * f
    return (
        sums[0] + ra * a,
        sums[1] + rb * a, sums[2] + rb * b,
        sums[3] + rc * a, sums[4] + rc * b, sums[5] + rc * c,
        sums[6] + rd * a, sums[7] + rd * b, sums[8] + rd * c, sums[9] + rd * d,
        sums[10] + re * a, sums[11] + re * b, sums[12] + re * c, sums[13] + re * d,
        sums[14] + re * e,
        sums[15] + rf * a, sums[16] + rf * b, sums[17] + rf * c, sums[18] + rf * d,
        sums[19] + rf * e, sums[20] + rf * f,
    )  # fmt: skip


def find_element_forces(d, pose, out, mode):
    """Find wrench and stiffness of all elements on the inner ring at a pose, into `out`; compiled.

    The wrench is minus the gradient of the energy: each element's load times the derivatives s of
    its deflection by the ring's displacement and rotation. The stiffness is the sum of Q' s s^T
    over the elements, Q' being the derivative of the load by the deflection.

    Args:
        d: parameters of the bearing (`bearing_numbers`).
        pose: twelve numbers: centre of the ring in the axes of the outer one [m], orientation row
            by row.
        out: `ANSWERS` numbers: force and moment about the ring's centre (6) [N, N m]; energy [J];
            sum of all element loads [N], the largest [N], how many elements bear load; largest
            deflection (negative: smallest gap) [m], then of that element cosine and sine of the
            azimuth, row position [m], and the components of its contact direction across and along
            the axis; dU/d(cage) [N m]; the stiffness (6, 6), contact directions held constant.
        mode: `BOUNDED`: where a bound shows that no element bears load, none is evaluated, and the
            bound stands for the smallest gap; `EXACT`: all elements; `FORCES`: all, without
            stiffness.
    """
    px, py, pz = pose[0], pose[1], pose[2]
    ax, ay, az = pose[5], pose[8], pose[11]
    with_stiffness = mode != FORCES
    for i in range(ANSWERS if with_stiffness else TANGENT):
        out[i] = 0.0
    if mode == BOUNDED:
        room = _gap_at_least(d, math.sqrt(px * px + py * py), abs(pz), math.sqrt(ax * ax + ay * ay))
        if room > 0.0:
            out[DEEPEST] = -room
            return
    turn_c, turn_s = math.cos(d[CAGE]), math.sin(d[CAGE])
    rollers, count, k, r = d[ROLLERS] != 0.0, int(d[COUNT]), d[STIFFNESS], d[RADIUS]
    exponent = ROLLER_EXPONENT if rollers else BALL_EXPONENT
    fx = fy = fz = gx = gy = gz = 0.0
    energy = total = largest = loaded = cage_slope = 0.0
    deepest, lower = -np.inf, (0.0,) * 21
    for row in range(int(d[ROWS])):
        h = d[ROW_PLACES + ROW_NUMBERS * row]
        start = d[ROW_PLACES + ROW_NUMBERS * row + 1] + pz + h * (az - 1.0)
        for element in range(count):
            delta, c, s, across, up, arm, _ = _touch(d, pose, h, start, element, turn_c, turn_s)
            if delta > deepest:
                deepest, out[COSINE], out[SINE], out[PLACE] = delta, c, s, h
                out[ACROSS], out[ALONG] = across, up
            if delta <= 0.0:
                continue
            rise = k * (_ninth_root(delta) if rollers else math.sqrt(delta))
            load = rise * delta
            energy += load * delta
            total += load
            largest = max(largest, load)
            loaded += 1.0
            # Derivatives of the deflection: by the centre, and by the axis taken as a free vector.
            dx, dy = across * c, across * s
            lever = across * arm - up * r
            tx, ty, tz = lever * c, lever * s, up * h
            fx += load * dx
            fy += load * dy
            fz += load * up
            gx += load * tx
            gy += load * ty
            gz += load * tz
            cage_slope += load * (across * (py * c - px * s) + lever * (ay * c - ax * s))
            if with_stiffness:
                mx, my, mz = ay * tz - az * ty, az * tx - ax * tz, ax * ty - ay * tx
                lower = _add_outer(lower, rise * exponent, dx, dy, up, mx, my, mz)
    # The moment is axis x gradient by the axis; elements going around take theirs from the spin.
    out[0], out[1], out[2] = -fx, -fy, -fz
    back = d[RATIO] * cage_slope
    out[3] = -(ay * gz - az * gy) - back * ax
    out[4] = -(az * gx - ax * gz) - back * ay
    out[5] = -(ax * gy - ay * gx) - back * az
    out[ENERGY], out[SUM] = energy / (exponent + 1.0), total
    out[LARGEST], out[LOADED], out[DEEPEST], out[CAGE_SLOPE] = largest, loaded, deepest, cage_slope
    if with_stiffness:
        for i in range(6):
            for j in range(i + 1):
                entry = lower[i * (i + 1) // 2 + j]
                out[TANGENT + 6 * i + j] = out[TANGENT + 6 * j + i] = entry


def find_element_curvature(d, pose, bend):
    """Find the Hessian of the energy of all elements by xi, into `bend` (25); compiled.

    xi = (p_x, p_y, p_z, a_x, a_y): displacement of the ring's centre, and the components of its
    axis across the outer ring's.
    """
    ax, ay, az = pose[5], pose[8], pose[11]
    turn_c, turn_s = math.cos(d[CAGE]), math.sin(d[CAGE])
    rollers, k, r = d[ROLLERS] != 0.0, d[STIFFNESS], d[RADIUS]
    exponent = ROLLER_EXPONENT if rollers else BALL_EXPONENT
    by, aside = np.zeros(WAYS), np.zeros(WAYS)
    for i in range(WAYS * WAYS):
        bend[i] = 0.0
    for row in range(int(d[ROWS])):
        h = d[ROW_PLACES + ROW_NUMBERS * row]
        start = d[ROW_PLACES + ROW_NUMBERS * row + 1] + pose[2] + h * (az - 1.0)
        for element in range(int(d[COUNT])):
            delta, c, s, across, up, arm, length = _touch(
                d, pose, h, start, element, turn_c, turn_s
            )
            if delta <= 0.0:
                continue
            load = k * delta**exponent
            steep = exponent * load / delta
            # Derivatives of X and Y by the tilt s; then of the deflection and, at a right angle to
            # it, of the contact direction.
            x_by, y_by = arm, -r
            tip_x, tip_y = -h * ax / az, -h * ay / az
            by[0], by[1], by[2] = across * c, across * s, up
            by[3] = (across * x_by + up * y_by) * c + up * tip_x
            by[4] = (across * x_by + up * y_by) * s + up * tip_y
            for i in range(WAYS):
                for j in range(i + 1):
                    bend[WAYS * i + j] += steep * by[i] * by[j]
            if rollers:
                continue
            aside[0], aside[1], aside[2] = -up * c, -up * s, across
            aside[3] = (across * y_by - up * x_by) * c + across * tip_x
            aside[4] = (across * y_by - up * x_by) * s + across * tip_y
            for i in range(WAYS):
                for j in range(i + 1):
                    bend[WAYS * i + j] += load / length * aside[i] * aside[j]
            # Second derivatives of X and Y by the axis.
            flat, tall = load * across * r, load * up * h / az
            bend[WAYS * 3 + 3] -= flat * c * c + tall * (1.0 + ax * ax / (az * az))
            bend[WAYS * 4 + 3] -= flat * c * s + tall * ax * ay / (az * az)
            bend[WAYS * 4 + 4] -= flat * s * s + tall * (1.0 + ay * ay / (az * az))
    for i in range(WAYS):
        for j in range(i):
            bend[WAYS * j + i] = bend[WAYS * i + j]


# Static equilibrium of the inner ring under a load: the minimum of the energy less the load's work.
#
# Newton's method in xi with a trust radius: a Hessian that is not positive definite is shifted
# until it is (`_newton_step`), and a line search scales the step by the derivative along it
# (`_line_search`).

_MOST_STEPS, _MOST_CUTS, _MOST_SHIFTS = 600, 40, 60
"""Most steps, most trials in each line search, most shifts of a Hessian (judged)."""
_ASIDE = 1e-3
"""Offset beside the load's line at which a search that failed begins anew, in units of `_scales`.
Where a load points at an element, the search may climb the ridge between the two minima beside it
and leave it by rounding alone (measured: any offset from 1e-7 to 0.5 finds the same minimum of the
load of tests/physics/joints/test_bearings.py)."""
_BALANCED, _ACCEPTED, _ROUNDING = 1e-11, 1e-8, 1e-14
"""Residual force: aimed at, and accepted where rounding leaves no less, relative to the load; and,
in addition, relative to the sum of the elements' loads, which cancel each other to rounding."""
_CAREFUL = 0.9
"""Largest slope at the end of a step, relative to that at its start, sign reversed (Wolfe)."""
_IDLE, _LONGER = 0.9, 4.0
"""A step at whose end more than this part of the slope is left was too short, and is lengthened by
this factor: where one element bears all, there is no stiffness across it until the next touches."""
_STEEPEST = 0.25
"""Square of the sine of the largest tilt tried: 30 degrees, more than any bearing allows."""
_SINGULAR = 1e-12
"""Stiffness of a direction that counts as none, relative to the largest."""


_elements, _curvature = compiled(find_element_forces), compiled(find_element_curvature)
_SQUARE = WAYS * WAYS
STATE, PUSH, SOFT = WAYS, WAYS + 1, 2 * WAYS + 1
"""Indices of the results of `rests` behind xi: whether it is an equilibrium; the load by xi, as the
elements bear it (5) [N, N m]; the compliance d(xi)/d(force, moment) (5, 5)."""
REST = SOFT + _SQUARE
"""Number of results of `rests`."""


@compiled
def solve_in_place(matrix, right, columns, least):
    """Solve `WAYS` linear equations with several right-hand sides by Gaussian elimination.

    Overwrites matrix (25), and right (5, columns) by the solution. Without pivoting: for matrices
    that are nearly positive definite. Returns whether all pivots were larger than `least`.
    """
    for k in range(WAYS):
        if abs(matrix[WAYS * k + k]) <= least:
            return False
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
    return True


@compiled
def _residual(d, load, lean, xi, pose, out, left):
    """Residual of the equilibrium at xi: the load plus the elements' wrench, by xi, into `left`.

    `lean` is the tilt of the outer ring, to which that in xi is relative.
    """
    x, y = xi[3] + lean[0], xi[4] + lean[1]
    up = math.sqrt(1.0 - x * x - y * y)
    pose[0], pose[1], pose[2] = xi[0], xi[1], xi[2]
    pose[5], pose[8], pose[11] = xi[3], xi[4], up
    _elements(d, pose, out, FORCES)
    for i in range(3):
        left[i] = load[i] + out[i]
    left[3], left[4] = (load[4] + out[4]) / up, -(load[3] + out[3]) / up


@compiled
def _cholesky(bend, shift, lower):
    """Cholesky factor (25) of a matrix with its diagonal shifted; returns whether it exists."""
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
def _solve_lower(lower, right, solution):
    """Solve L y = right by forward substitution."""
    for i in range(WAYS):
        solution[i] = right[i]
        for k in range(i):
            solution[i] -= lower[WAYS * i + k] * solution[k]
        solution[i] /= lower[WAYS * i + i]


@compiled
def _solve_cholesky(lower, right, solution):
    """Solve L L^T x = right."""
    _solve_lower(lower, right, solution)
    for i in range(WAYS - 1, -1, -1):
        for k in range(i + 1, WAYS):
            solution[i] -= lower[WAYS * k + i] * solution[k]
        solution[i] /= lower[WAYS * i + i]


@compiled
def _length(vector):
    """Euclidean norm."""
    total = 0.0
    for x in vector:
        total += x * x
    return math.sqrt(total)


@compiled
def _newton_step(bend, left, trust, lower, step, half):
    """Newton step within about the radius `trust`, into `step`; returns its length.

    The Hessian's diagonal is shifted until it is positive definite and the step short enough; the
    shift follows Newton's iteration for the trust radius (J. J. More, D. C. Sorensen, SIAM J. Sci.
    Stat. Comput. 4 (1983) 553-572).
    """
    largest = 0.0
    for i in range(WAYS):
        largest = max(largest, abs(bend[WAYS * i + i]))
    least = _SINGULAR * max(largest, _length(left) / trust)
    shift = 0.0
    for _ in range(_MOST_SHIFTS):
        if not _cholesky(bend, shift, lower):
            shift = max(4.0 * shift, least)
            continue
        _solve_cholesky(lower, left, step)
        size = _length(step)
        if size <= 1.2 * trust:
            return size
        _solve_lower(lower, step, half)
        bent = _length(half)
        shift += (size / trust - 1.0) * (size / bent) ** 2
    return size


@compiled
def _find_compliance(d, load, xi, pose, out, bend, unit, soft):
    """Compliance d(xi)/d(force, moment), by linearising `_residual`; returns False where singular.

    The Hessian alone is not the derivative: the cage's moment and the direction of the axis, by
    which moments act on (a_x, a_y), change with xi, too.
    """
    ax, ay, up = pose[5], pose[8], pose[11]
    gradient, turned = np.zeros(WAYS), np.zeros(WAYS)
    back, ratio = d[RATIO] * out[CAGE_SLOPE], d[RATIO]
    for i in range(3):
        gradient[i] = -out[i]
    gradient[3], gradient[4] = -(out[4] + back * ay) / up, (out[3] + back * ax) / up
    # Derivative of the residual: the Hessian, and what the cage and the axis' direction add.
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
    # Solve for unit forces and moments; `unit` makes the numbers of similar size.
    right = np.zeros(_SQUARE)
    for i in range(3):
        right[WAYS * i + i] = unit[i]
    right[WAYS * 3 + 4], right[WAYS * 4 + 3] = unit[3] / up, -unit[4] / up
    largest = 0.0
    for i in range(WAYS):
        for j in range(WAYS):
            fall[WAYS * i + j] *= unit[i] * unit[j]
        largest = max(largest, abs(fall[WAYS * i + i]))
    if not solve_in_place(fall, right, WAYS, _SINGULAR * largest):
        return False
    for i in range(WAYS):
        for j in range(WAYS):
            soft[WAYS * i + j] = right[WAYS * i + j] * unit[i]
    return True


@compiled
def _scales(d, force, unit):
    """Scale of each component of xi under a force, (5,) [m, 1]: free travel plus deflection."""
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
def _line_search(d, load, lean, xi, unit, step, long, trust, room):
    """Line search: returns the multiple of `step` to take, and leaves the trial there in `room`.

    The derivative along the step decides: too far where it is reversed by more than `_CAREFUL`, too
    short where more than `_IDLE` of it is left.

    `room`: trial xi, pose, results of the elements, and residual.
    """
    trial, pose, out, left = room
    down, share, longer = 0.0, 1.0, True
    for i in range(WAYS):
        down += left[i] * unit[i] * step[i]
    for _ in range(_MOST_CUTS):
        for i in range(WAYS):
            trial[i] = xi[i] + share * unit[i] * step[i]
        after = -np.inf
        if (trial[3] + lean[0]) ** 2 + (trial[4] + lean[1]) ** 2 < _STEEPEST:
            _residual(d, load, lean, trial, pose, out, left)
            after = 0.0
            for i in range(WAYS):
                after += left[i] * unit[i] * step[i]
        if after >= -_CAREFUL * down:
            longer &= after > _IDLE * down and _LONGER * share * long <= trust
            if not longer:
                break
            share *= _LONGER
            continue
        longer = False
        share *= max(0.1, min(0.7, down / (down - after)))  # root of the slope's secant
    return share


@compiled
def _find_equilibrium(d, load, lean, aside, result):
    """Find the equilibrium of the ring under a load, into `result`; see `rests`.

    `aside`: offset beside the load's line at which the search begins, in units of `_scales`.
    """
    xi, trial, best = np.zeros(WAYS), np.zeros(WAYS), np.zeros(WAYS)
    left, scaled, step, half = np.zeros(WAYS), np.zeros(WAYS), np.zeros(WAYS), np.zeros(WAYS)
    bend, lower, unit = np.zeros(_SQUARE), np.zeros(_SQUARE), np.zeros(WAYS)
    pose, out, matrix = np.zeros(12), np.zeros(ANSWERS), np.zeros(_SQUARE)
    lever = d[RADIUS]
    size = _load_norm(load, lever)
    _residual(d, load, lean, xi, pose, out, left)
    _scales(d, max(size, 1e-3 * out[SUM], 1e-9), unit)
    if out[SUM] == 0.0:
        if size == 0.0:
            result[STATE] = 1.0
            return
        # Centred, no element bears load: begin off centre along the load.
        long = 0.0
        for i in range(WAYS):
            xi[i] = left[i] * unit[i]
            long += xi[i] * xi[i]
        for i in range(WAYS):
            xi[i] *= unit[i] / math.sqrt(long)
        xi[0] -= aside * unit[0] * load[1] / size
        xi[1] += aside * unit[1] * load[0] / size
        _residual(d, load, lean, xi, pose, out, left)
    # Newton's method, in the scales `unit`; the best point is kept.
    trust, least = 1.0, np.inf
    for _ in range(_MOST_STEPS):
        error = _load_norm(left, lever)
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
        long = _newton_step(matrix, scaled, trust, lower, step, half)
        share = _line_search(d, load, lean, xi, unit, step, long, trust, (trial, pose, out, left))
        # The trust radius follows the lengths of the steps taken.
        if share < 1.0:
            trust = 2.0 * share * long
        elif long > 0.9 * trust:
            trust *= 2.0
        for i in range(WAYS):
            xi[i] = trial[i]
    if least > _ACCEPTED * size + _ROUNDING * out[SUM]:
        return
    _residual(d, load, lean, best, pose, out, left)
    _curvature(d, pose, bend)
    stiff = _find_compliance(d, load, best, pose, out, bend, unit, result[SOFT:])
    result[STATE] = 1.0 if stiff else -1.0
    for i in range(WAYS):
        result[i] = best[i]
    for i in range(3):
        result[PUSH + i] = -out[i]
    result[PUSH + 3], result[PUSH + 4] = -out[4] / pose[11], out[3] / pose[11]


@compiled
def _load_norm(load, lever):
    """Norm of a force and two moments, these divided by the lever arm [N]."""
    turning = (load[3] * load[3] + load[4] * load[4]) / (lever * lever)
    return math.sqrt(load[0] ** 2 + load[1] ** 2 + load[2] ** 2 + turning)


@compiled
def _find_equilibria(numbers, loads, cage, lean, results):
    bearing = numbers.copy()
    for i in range(loads.shape[0]):
        bearing[CAGE] = cage[i]
        _find_equilibrium(bearing, loads[i], lean[i], 0.0, results[i])
        if results[i, STATE] == 0.0:  # the search stayed on the ridge between two minima
            _find_equilibrium(bearing, loads[i], lean[i], _ASIDE, results[i])


def rests(
    numbers: Sequence[float], loads: np.ndarray, cage: np.ndarray | float, lean: np.ndarray
) -> np.ndarray:
    """Find the equilibrium of the inner ring under each of several loads.

    Args:
        numbers: parameters of the bearing (`resultant.bearing_numbers`).
        loads: force [N] and moments about x and y [N m] on the ring, in the axes of the outer one,
            shape (n, 5).
        cage: azimuth of the first element, shape (n,) [rad].
        lean: tilt of the outer ring in its seat, x and y of its axis, shape (n, 2).

    Returns:
        `REST` numbers each, shape (n, REST): xi; 1 for an equilibrium, -1 for one in which the ring
        is free to move in some direction (no compliance then), 0 where none was found; the load by
        xi, as the elements bear it; the compliance.
    """
    results = np.zeros((len(loads), REST))
    turns = np.broadcast_to(np.asarray(cage, float), len(loads)).copy()
    _find_equilibria(np.array(numbers), np.ascontiguousarray(loads), turns, lean, results)
    return results
