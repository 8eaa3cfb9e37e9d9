"""The compiled functions of geometry, stamped: they call each other across files.

So their compiled code is valid for all files of this package only.
"""

from __future__ import annotations

from pathlib import Path

from jointplay.core import compiler
from jointplay.geometry.bore import worn_bore, worn_gap
from jointplay.geometry.contacts import (
    classify_form,
    classify_many,
    classify_mode,
    journal_axis,
    touch,
)
from jointplay.geometry.cylinder import (
    axial_gap,
    deepest_rim_direction,
    gaps,
    radial_gap,
    touch_cylinder,
)

__all__ = [
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

_SOURCES = (*sorted(Path(__file__).parent.glob("*.py")), Path(compiler.__file__))
for _compiled in (
    *(axial_gap, radial_gap, deepest_rim_direction, touch_cylinder, gaps, worn_gap, touch),
    *(classify_form, classify_mode, classify_many),
):
    compiler.stamp(_compiled, _SOURCES)
