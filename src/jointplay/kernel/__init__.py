"""The compiled part of the time loop.

`layout` has the records that hold a run, `access` opens what they point to, `vectors`, `bodies` and
`frames` have the geometry, `contact`, `film`, `load` and `drive` the forces, `solve` the velocity
solve, `record` the records, `multirate` and `singlerate` the methods, `path` and `loops` what the
first asks of Pinocchio and makes of it. All is entered through one compiled function, `enter`.

Around it, in Python: `workspace` holds a run's arrays (`pointed`), made from `sites` and `tables`;
`columns` says where its records have what.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from typing import Any

from jointplay.host.numba_cache import njit
from jointplay.kernel import multirate, path, singlerate
from jointplay.kernel import record as records
from jointplay.kernel.access import TABLE
from jointplay.kernel.layout import (
    AZIMUTHS,
    JOINT_FRICTION_SPEED,
    MIN_APPROACH_SPEED,
    POWERS,
    WELL_RESOLVED_STEPS,
    Status,
)
from jointplay.kernel.sources import stamp


class Command(IntEnum):
    """What `enter` shall do."""

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


(
    _ADVANCE, _PLAN, _RESTART, _SET_OFF, _SETTLE_MACRO, _FINISH, _BEGIN, _REFRESH,
    _LOAD, _SETTLE, _RECORD, _EULER, _RUNGE_KUTTA, _TAKE_MIDDLE, _ADAPTIVE_STEP,
) = (int(command) for command in Command)  # fmt: skip

THERE = -1
"""What `enter` returns where a run has got as far as it should for now."""


@njit(cache=True, error_model="numpy")
def enter(table, command) -> int:
    """Carry out a `Command` on a run (`layout.RUN`, an array of one); returns its status.

    Or `THERE`, where `ADVANCE` has come to the step that it should not go beyond.
    """
    run = table[0]
    if command == _ADVANCE:
        multirate.advance(run)
        if run.status == 0 and run.step >= run.until:
            return THERE
    elif command == _TAKE_MIDDLE:
        path.judge(run)
    elif command == _ADAPTIVE_STEP:
        multirate.adaptive_step(run)
        path.leave(run)
    elif command == _SETTLE_MACRO:
        multirate.settle_macro(run)
    elif command == _EULER:
        singlerate.semi_implicit_euler(run)
    elif command == _RUNGE_KUTTA:
        singlerate.runge_kutta_4(run)
    elif command == _LOAD:
        singlerate.load(run)
    elif command == _PLAN:
        path.plan(run)
    elif command == _RESTART:
        multirate.restart(run)
    elif command == _SET_OFF:
        multirate.set_off(run)
    elif command == _FINISH:
        multirate.finish(run)
    elif command in (_BEGIN, _REFRESH):
        singlerate.begin(run, command == _BEGIN)
    elif command == _SETTLE:
        records.settle(run)
    elif command == _RECORD:
        records.settle(run)
        records.record(run)
    return run.status


stamp(enter)


@cache
def compiled() -> Any:
    """Compile `enter` or load it, and return the function behind numba's dispatcher.

    To call it directly saves the dispatcher's look at the arguments, half of what a call costs.
    """
    enter.compile(TABLE)
    return enter.overloads[TABLE].entry_point


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
