"""Geometry of clearance: gaps of a journal in its bearing (eqs 4-9, Table 1, Figure 2).

The bearing frame has its origin at the bearing's centre and z along the bore; the journal frame
is placed in the journal alike. A pose is the journal's centre and orientation in the bearing frame;
of the orientation a cylinder needs only its axis `a`. The four possible contacts of a cylinder are,
in this order everywhere in the package (`Shape` has the other shapes):

    0  radial at end A   rim of the journal's +z end against the bore
    1  radial at end B   rim of the journal's -z end against the bore
    2  axial at end A    rim of the +z end against the +z end wall
    3  axial at end B    rim of the -z end against the -z end wall

A gap is positive in free flight and negative in penetration. Each gap's gradient is the contact
normal, and its rate is the normal velocity of the contact point, so contact forces do exactly the
work that the change of the gap implies.

The compiled functions (`cylinder`, `contacts`) are imported when the first of them is used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
