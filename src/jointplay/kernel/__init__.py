"""The compiled part of the time loop.

`layout` has the records that hold a run, `vectors`, `bodies` and `frames` the geometry, `contact`,
`film` and `drive` the forces, `solve` the velocity solve, `record` the records, `multirate` and
`singlerate` the methods, `path` and `loops` what the first asks of Pinocchio and makes of it. All
of it is entered through one compiled function, `enter`, which is imported with its first use.
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
    from jointplay.kernel.entry import enter as enter
    from jointplay.kernel.layout import MIN_APPROACH_SPEED as MIN_APPROACH_SPEED

__getattr__ = offering(
    __name__, {"compiled": "entry", "enter": "entry", "MIN_APPROACH_SPEED": "layout"}
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
    "enter",
]
