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
"""

from pathlib import Path

from jointplay.geometry.bore import worn_bore, worn_gap
from jointplay.geometry.cylinder import (
    axial_gap,
    deepest_rim_direction,
    gaps,
    radial_gap,
    touch_cylinder,
)
from jointplay.geometry.forms import (
    CONTACT_TOLERANCE_M,
    Form,
    Mode,
    classify_form,
    classify_many,
    classify_mode,
    journal_axis,
)
from jointplay.geometry.shapes import CONTACTS, EDGE_ROUNDING_M, Shape
from jointplay.geometry.touching import touch
from jointplay.host.numba_cache import stamp

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

# They call each other across files, so their compiled code is valid for all of them only.
_SOURCES = sorted(Path(__file__).parent.glob("*.py"))
for _compiled in (
    *(axial_gap, radial_gap, deepest_rim_direction, touch_cylinder, gaps, worn_gap, touch),
    *(classify_form, classify_mode, classify_many),
):
    stamp(_compiled, _SOURCES)
