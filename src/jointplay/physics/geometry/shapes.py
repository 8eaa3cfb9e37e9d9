"""Shapes of journals in their bearings, and the modes and forms of contact."""

from __future__ import annotations

from enum import IntEnum

EDGE_ROUNDING_M = 1e-7
"""Rounding of a flat end face's edge, over which face contact passes to edge contact [m]; see
`axial_gap`."""
CONTACT_TOLERANCE_M = 1e-7
"""A gap within this of zero counts as continuous contact: the paper's integration tolerance."""


class Shape(IntEnum):
    """Shape of a journal in its bearing; its dimensions are those of `touch`.

    CYLINDER           R_i, R_j, L_i/2, L_j/2         radial_A, radial_B, axial_A, axial_B
    ALIGNED_CYLINDER   R_i, R_j, L_i/2, L_j/2         radial, axial_A, axial_B
    BALL               R_i, R_j                       one contact
    BLOCK              half widths of the guide across x and y; then for each contact its point
                       on the journal (3), 0 or 1 for a wall across x or y, and the wall's side +-1
    WORN_CYLINDER          as CYLINDER, then `worn_bore` of end A and of end B
    WORN_ALIGNED_CYLINDER  as ALIGNED_CYLINDER, then `worn_bore`
    ROLLING            elements between two rings, `contact.rolling`: no contact of `touch`

    In place of a shape, a kind of joint may give the address of a geometry function of its own
    (`contacts`): any number above the last of these is taken as an address.
    """

    CYLINDER = 0
    ALIGNED_CYLINDER = 1
    BALL = 2
    BLOCK = 3
    WORN_CYLINDER = 4
    WORN_ALIGNED_CYLINDER = 5
    ROLLING = 6


(
    _CYLINDER, _ALIGNED_CYLINDER, _BALL, _BLOCK, _WORN, _WORN_ALIGNED, _ROLLING,
) = (int(shape) for shape in Shape)  # fmt: skip

LAST_SHAPE = int(max(Shape))
"""Largest value of a `Shape`; numbers above it are addresses."""
_WORN_NODE = 4
"""Numbers per azimuth in `worn_bore`."""


class Mode(IntEnum):
    """Mode of the joint (Table 1)."""

    FREE_FLIGHT = 0
    CONTINUOUS_CONTACT = 1
    PSEUDO_PENETRATION = 2


class Form(IntEnum):
    """Contact form (Figure 2 a-l); NONE is free flight."""

    NONE = 0
    RADIAL_BOTH_ENDS_OPPOSITE = 1
    RADIAL_AXIAL_SAME_END = 2
    RADIAL_AXIAL_OTHER_END = 3
    AXIAL_BOTH_ENDS = 4
    ONE_RADIAL = 5
    ONE_AXIAL = 6
    TWO_RADIAL_ONE_AXIAL = 7
    ONE_RADIAL_TWO_AXIAL = 8
    FOUR_POINTS = 9
    SURFACE = 10
    LINE = 11
    SURFACE_AND_LINE = 12

    @property
    def letter(self) -> str:
        """Letter of the form in Figure 2 of the paper, '-' for none."""
        return "-abcdefghijkl"[self.value]
