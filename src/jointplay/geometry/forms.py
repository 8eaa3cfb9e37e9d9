"""Modes and forms of contact (Table 1, Figure 2)."""

from __future__ import annotations

import math

import numpy as np

from jointplay.geometry.shapes import (
    _CYLINDER,
    _WORN,
    CONTACT_TOLERANCE_M,
)
from jointplay.geometry.touching import touch
from jointplay.host.numba_cache import njit


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def classify_many(shape, dimensions, count, poses):
    """Gaps, mode and form for many poses.

    Args:
        shape: value of a `Shape`, or the address of a kind's own touch.
        dimensions: of the joint.
        count: number of its contacts.
        poses: (n, 12), journal centre [m], then its orientation row by row, in the bearing frame.

    Returns:
        gaps (n, count) [m], modes (n,) and forms (n,) as int8; the form is -1 for joints that
        Figure 2 does not show.
    """
    # Element by element: slices would triple the compilation time of the whole package.
    n = poses.shape[0]
    all_gaps = np.empty((n, count))
    modes = np.empty(n, np.int8)
    forms = np.full(n, -1, np.int8)
    turn, gap, normal = np.empty(9), np.empty(count), np.empty((count, 3))
    for i in range(n):
        for k in range(9):
            turn[k] = poses[i, 3 + k]
        for k in range(count):
            g, _, _, _, nx, ny, nz = touch(
                shape, dimensions, 0, k, poses[i, 0], poses[i, 1], poses[i, 2], turn, 0
            )
            gap[k] = g
            all_gaps[i, k] = g
            normal[k, 0], normal[k, 1], normal[k, 2] = nx, ny, nz
        modes[i] = classify_mode(gap)
        if shape in (_CYLINDER, _WORN) and count == 4:
            drop = 2.0 * dimensions[1] * math.sqrt(turn[2] * turn[2] + turn[5] * turn[5])
            forms[i] = classify_form(gap, normal, drop)
    return all_gaps, modes, forms


def journal_axis(angles: np.ndarray) -> np.ndarray:
    """Journal axis in the bearing frame for yaw, pitch, roll (n, 3) [rad]: shape (n, 3)."""
    yaw, pitch, roll = angles.T
    cy, sy, cp, sp, cr, sr = (
        function(angle) for angle in (yaw, pitch, roll) for function in (np.cos, np.sin)
    )
    return np.column_stack([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr])
