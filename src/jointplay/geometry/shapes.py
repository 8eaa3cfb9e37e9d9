"""Shapes of journals in their bearings, and the order of their contacts."""

from __future__ import annotations

from enum import IntEnum

CONTACTS = ("radial_A", "radial_B", "axial_A", "axial_B")

EDGE_ROUNDING_M = 1e-7
"""Height over which a flat end face passes to edge contact; see `axial_gap`."""


class Shape(IntEnum):
    """Shape of a journal in its bearing; its dimensions are those of `touch`.

    CYLINDER           R_i, R_j, L_i/2, L_j/2         radial_A, radial_B, axial_A, axial_B
    ALIGNED_CYLINDER   R_i, R_j, L_i/2, L_j/2         radial, axial_A, axial_B
    BALL               R_i, R_j                       one contact
    BLOCK              half widths of the guide across x and y; then for each contact its point
                       on the journal (3), 0 or 1 for a wall across x or y, and the wall's side +-1
    WORN_CYLINDER          as CYLINDER, then `worn_bore` of end A and of end B
    WORN_ALIGNED_CYLINDER  as ALIGNED_CYLINDER, then `worn_bore`

    Where a shape is asked for, a kind of joint may give the address of its own function instead
    (`own`): all numbers above the last of these are taken for one.
    """

    CYLINDER = 0
    ALIGNED_CYLINDER = 1
    BALL = 2
    BLOCK = 3
    WORN_CYLINDER = 4
    WORN_ALIGNED_CYLINDER = 5


_CYLINDER, _ALIGNED_CYLINDER, _BALL, _BLOCK, _WORN, _WORN_ALIGNED = (int(shape) for shape in Shape)

LAST_SHAPE = int(max(Shape))
"""Numbers above are addresses."""

_WORN_NODE = 4
"""Numbers of `worn_bore` for each azimuth."""
