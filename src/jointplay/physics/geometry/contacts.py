"""Gap, contact point and normal of one contact of a joint of any shape; modes and forms."""

from __future__ import annotations

import math

import numpy as np

from jointplay.base.compiler import calling_with_arrays, compiled
from jointplay.physics.geometry.cylinder import touch_cylinder, worn_gap
from jointplay.physics.geometry.shapes import (
    _ALIGNED_CYLINDER,
    _BALL,
    _BLOCK,
    _CYLINDER,
    _WORN,
    _WORN_ALIGNED,
    _WORN_NODE,
    CONTACT_TOLERANCE_M,
    LAST_SHAPE,
)

# A kind of joint may bring a geometry function of its own, compiled and called by address.
#
# It gets the index of the contact, the pose of the journal in the bearing frame (its centre, then
# its orientation row by row), and the joint's dimensions; it writes the seven numbers that `touch`
# returns. `contact.machine_code.compiled_touch` makes one.


POSE, ANSWER = 12, 7
"""Numbers of a pose, and of the result of `touch`: gap, contact point (3), normal (3)."""


call_touch = calling_with_arrays(POSE, ANSWER)


@compiled
def touch(shape, d, at, k, cx, cy, cz, r, first):
    """Gap, contact point and normal of contact k of a joint.

    Args:
        shape: value of a `Shape`, or the address of the joint's own function.
        d, at: array in which the joint's dimensions begin at index `at`.
        k: index of the contact.
        cx, cy, cz: journal centre in the bearing frame [m].
        r, first: array in which the orientation of the journal frame in the bearing frame begins at
            index `first`, nine elements row by row. A cylinder needs only its third column, a ball
            none.

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
            # Radial contacts of a worn bore, each end with its own profile; then the rim's point
            # that is farthest in the direction u.
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
        # A corner of the block against one wall of the guide.
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
        # The whole end face against its wall.
        side = 3.0 - 2.0 * k
        oz = side * d[at + 3]
        return d[at + 2] - side * (cz + oz), 0.0, 0.0, oz, 0.0, 0.0, -side
    if shape > LAST_SHAPE:
        turn = r[first], r[first + 1], r[first + 2], r[first + 3], r[first + 4], r[first + 5]
        last = r[first + 6], r[first + 7], r[first + 8]
        return call_touch(shape, k, (cx, cy, cz, *turn, *last), d, at)
    # Along the line of centres: a ball, or a cylinder that does not tilt.
    if shape != _BALL:
        cz = 0.0
    distance = math.sqrt(cx * cx + cy * cy + cz * cz)
    inverse = 1.0 / distance if distance > 0.0 else 0.0
    nx, ny, nz = cx * inverse, cy * inverse, cz * inverse
    rj = d[at + 1]
    return d[at] - rj - distance, rj * nx, rj * ny, rj * nz, -nx, -ny, -nz


# Modes and forms of contact (Table 1, Figure 2).


@compiled
def classify_mode(gap) -> int:
    """Mode of the joint from all its gaps [m] (Table 1), as the value of a `Mode`."""
    smallest = gap[0]
    for k in range(1, gap.size):
        smallest = min(smallest, gap[k])
    if smallest < -CONTACT_TOLERANCE_M:
        return 2
    if smallest <= CONTACT_TOLERANCE_M:
        return 1
    return 0


@compiled
def classify_form(gap, normal, face_drop) -> int:
    """Contact form (Figure 2), as the value of a `Form`.

    Args:
        gap: the four gaps, shape (4,) [m].
        normal: their contact normals, shape (4, 3).
        face_drop: 2 R_j sin(tilt), the height of a tilted end face between its two rims [m].

    Two radial contacts on the same side of the bore are one line contact. An axial contact is a
    surface contact when the far side of the face lies within the wall too.
    """
    rim_a = gap[0] <= CONTACT_TOLERANCE_M
    rim_b = gap[1] <= CONTACT_TOLERANCE_M
    wall_a = gap[2] <= CONTACT_TOLERANCE_M
    wall_b = gap[3] <= CONTACT_TOLERANCE_M
    radial = int(rim_a) + int(rim_b)
    axial = int(wall_a) + int(wall_b)
    line = radial == 2 and (normal[0, 0] * normal[1, 0] + normal[0, 1] * normal[1, 1]) > 0.0
    surface = axial == 1 and min(gap[2], gap[3]) + face_drop <= CONTACT_TOLERANCE_M
    if radial == 0:
        if axial == 0:
            return 0
        if axial == 2:
            return 4
        return 10 if surface else 6
    if radial == 1:
        if axial == 0:
            return 5
        if axial == 2:
            return 8
        return 2 if rim_a == wall_a else 3
    if axial == 0:
        return 11 if line else 1
    if axial == 2:
        return 9
    return 12 if line and surface else 7


def classify_many(
    shape: int, dimensions: np.ndarray, count: int, poses: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gaps (n, count) [m], modes (n,) and forms (n,), the last two as int8, of many poses.

    Args:
        shape: value of a `Shape`, or the address of a kind's own function.
        dimensions: dimensions of the joint, as `touch` takes them.
        count: number of its contacts.
        poses: journal centre [m], then its orientation row by row, in the bearing frame, (n, 12).

    The form is -1 for joints that Figure 2 does not show.
    """
    n = len(poses)
    gaps, modes, forms = np.empty((n, count)), np.empty(n, np.int8), np.full(n, -1, np.int8)
    _classify(shape, dimensions, poses, np.empty((count, 3)), gaps, modes, forms)
    return gaps, modes, forms


@compiled
def _classify(shape, dimensions, poses, normal, gaps, modes, forms):
    """Fill `gaps`, `modes` and `forms` for `classify_many`; `normal` is scratch room."""
    count = gaps.shape[1]
    for i in range(poses.shape[0]):
        pose, gap = poses[i], gaps[i]
        for k in range(count):
            gap[k], _, _, _, nx, ny, nz = touch(
                shape, dimensions, 0, k, pose[0], pose[1], pose[2], pose, 3
            )
            normal[k, 0], normal[k, 1], normal[k, 2] = nx, ny, nz
        modes[i] = classify_mode(gap)
        if shape in (_CYLINDER, _WORN) and count == 4:
            drop = 2.0 * dimensions[1] * math.sqrt(pose[5] * pose[5] + pose[8] * pose[8])
            forms[i] = classify_form(gap, normal, drop)
