"""Geometry of clearance: gaps of a journal in its bearing (eqs 4-9, Table 1, Figure 2).

The bearing frame has its origin at the bearing's centre and z along the bore; the journal frame
likewise. A pose is the journal's centre and orientation in the bearing frame; of the orientation a
cylinder needs its axis `a` only. The four possible contacts of a cylinder are, in this order
everywhere in the package (`Shape` has the other shapes):

    0  radial at end A   rim of the journal's +z end against the bore
    1  radial at end B   rim of the journal's -z end against the bore
    2  axial at end A    rim of the +z end against the +z end wall
    3  axial at end B    rim of the -z end against the -z end wall

A gap is positive in free flight and negative in penetration. Each gap's gradient is the contact
normal, and its rate is the normal velocity of the contact point, so contact forces do exactly the
work that the change of the gap implies.

Compiled functions (`kernels`) are imported with the first of them that is used.
"""

from typing import TYPE_CHECKING

from jointplay.geometry.shapes import (
    CONTACT_TOLERANCE_M,
    CONTACTS,
    EDGE_ROUNDING_M,
    Form,
    Mode,
    Shape,
)
from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.geometry.kernels import axial_gap as axial_gap
    from jointplay.geometry.kernels import classify_form as classify_form
    from jointplay.geometry.kernels import classify_many as classify_many
    from jointplay.geometry.kernels import classify_mode as classify_mode
    from jointplay.geometry.kernels import deepest_rim_direction as deepest_rim_direction
    from jointplay.geometry.kernels import gaps as gaps
    from jointplay.geometry.kernels import journal_axis as journal_axis
    from jointplay.geometry.kernels import radial_gap as radial_gap
    from jointplay.geometry.kernels import touch as touch
    from jointplay.geometry.kernels import touch_cylinder as touch_cylinder
    from jointplay.geometry.kernels import worn_bore as worn_bore
    from jointplay.geometry.kernels import worn_gap as worn_gap

_COMPILED = (
    *("axial_gap", "classify_form", "classify_many", "classify_mode", "deepest_rim_direction"),
    *("gaps", "journal_axis", "radial_gap", "touch", "touch_cylinder", "worn_bore", "worn_gap"),
)

__getattr__ = offering(__name__, dict.fromkeys(_COMPILED, "kernels"))

__all__ = [
    "CONTACTS",
    "CONTACT_TOLERANCE_M",
    "EDGE_ROUNDING_M",
    "Form",
    "Mode",
    "Shape",
    "axial_gap",
    "classify_form",
    "classify_many",
    "classify_mode",
    "deepest_rim_direction",
    "gaps",
    "journal_axis",
    "radial_gap",
    "touch",
    "touch_cylinder",
    "worn_bore",
    "worn_gap",
]
