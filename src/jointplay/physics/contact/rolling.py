"""Rolling bearings: what all rolling elements together do to the inner ring.

Each element is a spring between two raceways that only pushes. With e_r the radial direction at its
azimuth, p the displacement of the inner ring's centre, a the ring's axis and s = e_r . a, the ends
of the spring of a ball are the centres of curvature of both grooves, A apart where it just touches:

    X = r_i - r_o + p . e_r + h s - r_i s^2 / 2
    Y = y_0 + p_z - r_i s + h (a_z - 1),        delta = sqrt(X^2 + Y^2) - A

in the plane of its azimuth, with the radii r_i and r_o of the circles on which these centres lie
and the place h of the row along the axis. A crossed roller, whose axis is inclined by 45 degrees
one way or the other (k = 1 or -1), has

    delta = (p . e_r + k (p_z - r s) - C_r) / sqrt(2)

The load of an element is Q = K delta^n, n = 3/2 for a ball (Hertz's point contacts at both rings in
series) and 10/9 for a roller (ISO/TS 16281). All forces and moments are the gradient of the energy

    U = sum K delta^(n + 1) / (n + 1)

so nothing is gained or lost on a closed way; with it the lever of a ball's moment is that of the
groove. The elements go around with the cage, by ratio = (1 - D cos(alpha) / d_m) / 2 of the ring's
own turn. Their places change U, and what they take comes from the turn: the moment about the axis
is -ratio dU/d(cage). Centrifugal and gyroscopic forces of the elements are left out.
"""

from __future__ import annotations

import math

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
    """How far displacements and lean of the ring are from where any element bears load, at least.

    Negative: one may.
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


def find_element_forces(d, pose, out, mode):
    """What all elements do to the inner ring at a pose, into `out`; it is compiled.

    Args:
        d: numbers of the bearing (`bearing_numbers`).
        pose: twelve numbers: centre of the ring in the axes of the outer one [m], orientation row
            by row.
        out: `ANSWERS` numbers: force and moment about the ring's centre (6) [N, N m], energy [J],
            sum of all element loads [N], the largest [N], how many bear load, largest deflection
            (negative: least gap) [m], then cosine and sine of the azimuth and row place [m] of that
            element, and the components of its contact's direction across and along the axis;
            dU/d(cage) [N m]; the stiffness (6, 6) by the deflections of the elements.
        mode: `BOUNDED`: where a bound shows that no element bears load none is looked at, and the
            least gap is the bound's; `EXACT`: all; `FORCES`: all, without the stiffness.
    """
    px, py, pz = pose[0], pose[1], pose[2]
    ax, ay, az = pose[5], pose[8], pose[11]
    slopes = mode != FORCES
    for i in range(ANSWERS if slopes else TANGENT):
        out[i] = 0.0
    if mode == BOUNDED:
        room = _gap_at_least(d, math.sqrt(px * px + py * py), abs(pz), math.sqrt(ax * ax + ay * ay))
        if room > 0.0:
            out[DEEPEST] = -room
            return
    turn_c, turn_s = math.cos(d[CAGE]), math.sin(d[CAGE])
    rollers, count = d[ROLLERS] != 0.0, int(d[COUNT])
    exponent = ROLLER_EXPONENT if rollers else BALL_EXPONENT
    k, r, reach, distance = d[STIFFNESS], d[RADIUS], d[REACH], d[DISTANCE]
    fx = fy = fz = gx = gy = gz = 0.0
    energy = total = largest = loaded = cage_slope = 0.0
    deepest, at_c, at_s, at_h, at_across, at_up = -np.inf, 0.0, 0.0, 0.0, 0.0, 0.0
    t00 = t10 = t11 = t20 = t21 = t22 = t30 = t31 = t32 = t33 = 0.0
    t40 = t41 = t42 = t43 = t44 = t50 = t51 = t52 = t53 = t54 = t55 = 0.0
    for row in range(int(d[ROWS])):
        h = d[ROW_PLACES + ROW_NUMBERS * row]
        start = d[ROW_PLACES + ROW_NUMBERS * row + 1] + pz + h * (az - 1.0)
        for element in range(count):
            c0, s0 = d[TABLE + 2 * element], d[TABLE + 2 * element + 1]
            c, s = c0 * turn_c - s0 * turn_s, s0 * turn_c + c0 * turn_s
            lie = c * ax + s * ay
            radial = px * c + py * s
            if rollers:
                across = _HALF
                up = _HALF if element % 2 == 0 else -_HALF
                delta = across * (radial - reach) + up * (start - r * lie)
                arm = 0.0
            else:
                x = reach + radial + (h - 0.5 * r * lie) * lie
                y = start - r * lie
                length = math.sqrt(x * x + y * y)
                delta = length - distance
                across, up, arm = x / length, y / length, h - r * lie
            if delta > deepest:
                deepest, at_c, at_s, at_h, at_across, at_up = delta, c, s, h, across, up
            if delta <= 0.0:
                continue
            rise = k * (_ninth_root(delta) if rollers else math.sqrt(delta))
            load = rise * delta
            energy += load * delta
            total += load
            largest = max(largest, load)
            loaded += 1.0
            # Slopes of the deflection: by the centre, and by the axis taken for a free vector.
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
            if slopes:
                rise *= exponent
                mx, my, mz = ay * tz - az * ty, az * tx - ax * tz, ax * ty - ay * tx
                u = rise * dx
                t00 += u * dx
                u = rise * dy
                t10 += u * dx
                t11 += u * dy
                u = rise * up
                t20 += u * dx
                t21 += u * dy
                t22 += u * up
                u = rise * mx
                t30 += u * dx
                t31 += u * dy
                t32 += u * up
                t33 += u * mx
                u = rise * my
                t40 += u * dx
                t41 += u * dy
                t42 += u * up
                t43 += u * mx
                t44 += u * my
                u = rise * mz
                t50 += u * dx
                t51 += u * dy
                t52 += u * up
                t53 += u * mx
                t54 += u * my
                t55 += u * mz
    out[0], out[1], out[2] = -fx, -fy, -fz
    back = d[RATIO] * cage_slope  # what the elements take on their way around
    out[3] = -(ay * gz - az * gy) - back * ax
    out[4] = -(az * gx - ax * gz) - back * ay
    out[5] = -(ax * gy - ay * gx) - back * az
    out[ENERGY], out[SUM] = energy / (exponent + 1.0), total
    out[LARGEST], out[LOADED], out[DEEPEST] = largest, loaded, deepest
    out[COSINE], out[SINE], out[PLACE] = at_c, at_s, at_h
    out[ACROSS], out[ALONG], out[CAGE_SLOPE] = at_across, at_up, cage_slope
    if slopes:
        lower = (
            (t00, t10, t20, t30, t40, t50),
            (t10, t11, t21, t31, t41, t51),
            (t20, t21, t22, t32, t42, t52),
            (t30, t31, t32, t33, t43, t53),
            (t40, t41, t42, t43, t44, t54),
            (t50, t51, t52, t53, t54, t55),
        )
        for i in range(6):
            for j in range(6):
                out[TANGENT + 6 * i + j] = lower[i][j]


def find_element_curvature(d, pose, bend):
    """Second derivatives of the energy of all elements, into (25); it is compiled.

    By xi = (p_x, p_y, p_z, a_x, a_y), the displacement of the ring's centre and the part of its
    axis across the outer ring's.
    """
    px, py, pz = pose[0], pose[1], pose[2]
    ax, ay, az = pose[5], pose[8], pose[11]
    turn_c, turn_s = math.cos(d[CAGE]), math.sin(d[CAGE])
    rollers, count = d[ROLLERS] != 0.0, int(d[COUNT])
    exponent = ROLLER_EXPONENT if rollers else BALL_EXPONENT
    k, r, reach, distance = d[STIFFNESS], d[RADIUS], d[REACH], d[DISTANCE]
    by, aside = np.zeros(WAYS), np.zeros(WAYS)
    for i in range(WAYS * WAYS):
        bend[i] = 0.0
    for row in range(int(d[ROWS])):
        h = d[ROW_PLACES + ROW_NUMBERS * row]
        start = d[ROW_PLACES + ROW_NUMBERS * row + 1] + pz + h * (az - 1.0)
        for element in range(count):
            c0, s0 = d[TABLE + 2 * element], d[TABLE + 2 * element + 1]
            c, s = c0 * turn_c - s0 * turn_s, s0 * turn_c + c0 * turn_s
            lie = c * ax + s * ay
            radial = px * c + py * s
            if rollers:
                across = _HALF
                up = _HALF if element % 2 == 0 else -_HALF
                delta = across * (radial - reach) + up * (start - r * lie)
                arm, length = 0.0, 1.0
            else:
                x = reach + radial + (h - 0.5 * r * lie) * lie
                y = start - r * lie
                length = math.sqrt(x * x + y * y)
                delta = length - distance
                across, up, arm = x / length, y / length, h - r * lie
            if delta <= 0.0:
                continue
            load = k * delta**exponent
            steep = exponent * load / delta
            # Slopes of X and Y by the lean; of the deflection, and at a right angle to it.
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
            # X and Y themselves bend with the lean.
            flat, tall = load * across * r, load * up * h / az
            bend[WAYS * 3 + 3] -= flat * c * c + tall * (1.0 + ax * ax / (az * az))
            bend[WAYS * 4 + 3] -= flat * c * s + tall * ax * ay / (az * az)
            bend[WAYS * 4 + 4] -= flat * s * s + tall * (1.0 + ay * ay / (az * az))
    for i in range(WAYS):
        for j in range(i):
            bend[WAYS * j + i] = bend[WAYS * i + j]
