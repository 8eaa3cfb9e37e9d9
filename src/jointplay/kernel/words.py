"""Words of the kernels that others use too; no compiler is needed to know them."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Why the time loop stopped."""

    COMPLETED = 0
    INTERRUPTED = 1
    RUN_AWAY = 2
    BROKE_OUT = 3
    BAD_FORCE = 4
    FILM_BROKE = 5
    BAD_LOAD = 6


class Command(IntEnum):
    """What an entry shall do."""

    ADVANCE = 0
    PLAN = 1
    RESTART = 2
    SET_OFF = 3
    SETTLE_MACRO = 4
    FINISH = 5
    BEGIN = 6
    REFRESH = 7
    LOAD = 8
    SETTLE = 9
    RECORD = 10
    SEMI_IMPLICIT_EULER = 11
    RUNGE_KUTTA_4 = 12
    TAKE_MIDDLE = 13
    ADAPTIVE_STEP = 14


THERE = -1
"""What an entry returns where a run has got as far as it should for now."""

POWERS = (
    "drive",
    "normal_dissipation",
    "friction_dissipation",
    "joint_friction",
    "gear_dissipation",
    "film_dissipation",
)

AZIMUTHS = 72
"""Places around the bore at which sliding work is counted, the first on the bearing's x axis."""

JOINT_FRICTION_SPEED = 1e-3
"""Speed over which dry joint friction turns its sign [rad/s or m/s]."""

WELL_RESOLVED_STEPS = 10
"""A contact of fewer steps than this is not resolved."""

NEVER, ALWAYS, IF_PRESSED = range(3)
"""When a load depends on velocity; IF_PRESSED: where its answer at rest is not zero."""
