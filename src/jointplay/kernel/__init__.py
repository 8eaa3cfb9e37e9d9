"""The compiled part of the time loop.

`words` says what is asked of it. `layout` has the records that hold a run, `access` opens what they
point to, `vectors`, `bodies` and `frames` have the geometry, `contact`, `film`, `load` and `drive`
the forces, `solve` the velocity solve, `record` the records, `multirate` and `singlerate` the
methods, `path` and `loops` what the first asks of Pinocchio and makes of it. All is entered through
the compiled functions of `entry`, which are imported with their first use.

Around it, in Python: `workspace` holds a run's arrays (`pointed`), made from `sites` and `tables`;
`columns` says where its records have what.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jointplay.host.late import offering
from jointplay.kernel.words import (
    AZIMUTHS,
    JOINT_FRICTION_SPEED,
    POWERS,
    THERE,
    WELL_RESOLVED_STEPS,
    Command,
    Status,
)

if TYPE_CHECKING:
    from jointplay.kernel.entry import compiled as compiled
    from jointplay.kernel.entry import entry_of as entry_of
    from jointplay.kernel.layout import MIN_APPROACH_SPEED as MIN_APPROACH_SPEED

__getattr__ = offering(
    __name__, {"compiled": "entry", "entry_of": "entry", "MIN_APPROACH_SPEED": "layout"}
)

__all__ = [
    "AZIMUTHS",
    "JOINT_FRICTION_SPEED",
    "MIN_APPROACH_SPEED",
    "POWERS",
    "THERE",
    "WELL_RESOLVED_STEPS",
    "Command",
    "Status",
    "compiled",
    "entry_of",
]
