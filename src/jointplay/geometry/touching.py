"""Gap, place and normal of one contact of a joint of any shape."""

from __future__ import annotations

import math

from jointplay.geometry.bore import worn_gap
from jointplay.geometry.cylinder import touch_cylinder
from jointplay.geometry.own import call_touch
from jointplay.geometry.shapes import (
    _ALIGNED_CYLINDER,
    _BALL,
    _BLOCK,
    _CYLINDER,
    _WORN,
    _WORN_ALIGNED,
    _WORN_NODE,
    LAST_SHAPE,
)
from jointplay.host.numba_cache import njit


@njit(cache=True, error_model="numpy")
def touch(shape, d, at, k, cx, cy, cz, r, first):
    """Gap, place and normal of contact k of a joint.

    Args:
        shape: value of a `Shape`, or the address of a function of the joint's own.
        d, at: array in which the joint's dimensions begin at index `at`.
        k: index of the contact.
        cx, cy, cz: journal centre in the bearing frame [m].
        r, first: array in which the orientation of the journal frame in the bearing frame begins at
            index `first`, nine elements row by row. A cylinder needs its third column only, a
            ball none.

    Returns:
        gap [m], the contact point's offset from the journal's centre (3) [m], and the unit normal
        from the bearing into the journal (3), all in the bearing frame.
    """
    if shape == _CYLINDER:
        ax, ay, az = r[first + 2], r[first + 5], r[first + 8]
        return touch_cylinder(k, cx, cy, cz, ax, ay, az, d[at], d[at + 1], d[at + 2], d[at + 3])
    if shape in (_WORN, _WORN_ALIGNED):
        aligned = shape == _WORN_ALIGNED
        ax, ay, az = r[first + 2], r[first + 5], r[first + 8]
        if k < (1 if aligned else 2):
            reach = 0.0 if aligned else (1.0 - 2.0 * k) * d[at + 3]
            profile = at + 4
            if k == 1:
                profile += 1 + _WORN_NODE * int(d[profile])
            ex, ey, ez = reach * ax, reach * ay, reach * az
            gap, ux, uy = worn_gap(cx + ex, cy + ey, ax, ay, d, profile, d[at], d[at + 1])
            lean = ux * ax + uy * ay
            size = d[at + 1] / math.sqrt(1.0 - lean * lean)
            ox, oy, oz = size * (ux - lean * ax), size * (uy - lean * ay), -size * lean * az
            return gap, ex + ox, ey + oy, ez + oz, -ux, -uy, 0.0
        if not aligned:
            return touch_cylinder(k, cx, cy, cz, ax, ay, az, d[at], d[at + 1], d[at + 2], d[at + 3])
    if shape == _BLOCK:
        place = at + 2 + 5 * k
        px, py, pz = d[place], d[place + 1], d[place + 2]
        ox = r[first] * px + r[first + 1] * py + r[first + 2] * pz
        oy = r[first + 3] * px + r[first + 4] * py + r[first + 5] * pz
        oz = r[first + 6] * px + r[first + 7] * py + r[first + 8] * pz
        side = d[place + 4]
        if d[place + 3] == 0.0:
            return d[at] - side * (cx + ox), ox, oy, oz, -side, 0.0, 0.0
        return d[at + 1] - side * (cy + oy), ox, oy, oz, 0.0, -side, 0.0
    if shape in (_ALIGNED_CYLINDER, _WORN_ALIGNED) and k > 0:
        side = 3.0 - 2.0 * k
        oz = side * d[at + 3]
        return d[at + 2] - side * (cz + oz), 0.0, 0.0, oz, 0.0, 0.0, -side
    if shape > LAST_SHAPE:
        turn = r[first], r[first + 1], r[first + 2], r[first + 3], r[first + 4], r[first + 5]
        last = r[first + 6], r[first + 7], r[first + 8]
        return call_touch(shape, k, d, at, (cx, cy, cz), turn, last)
    # Along the line of centres: a ball, or a cylinder that does not tilt.
    if shape != _BALL:
        cz = 0.0
    distance = math.sqrt(cx * cx + cy * cy + cz * cz)
    inverse = 1.0 / distance if distance > 0.0 else 0.0
    nx, ny, nz = cx * inverse, cy * inverse, cz * inverse
    rj = d[at + 1]
    return d[at] - rj - distance, rj * nx, rj * ny, rj * nz, -nx, -ny, -nz
