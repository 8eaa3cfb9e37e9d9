"""The compiled part of the time loop.

`layout` has the records that hold a run, `vectors` and `frames` the geometry, `contact`, `film` and
`drive` the forces, `solve` the velocity solve, `record` the records, `multirate` and `singlerate`
the methods. All of it is entered through one compiled function, `enter`.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from typing import Any

from jointplay.host.numba_cache import njit
from jointplay.kernel import multirate, singlerate
from jointplay.kernel import record as records
from jointplay.kernel.frames import nodes
from jointplay.kernel.layout import (
    AZIMUTHS,
    JOINT_FRICTION_SPEED,
    MIN_APPROACH_SPEED,
    POWERS,
    TABLE,
    WELL_RESOLVED_STEPS,
    Status,
)
from jointplay.kernel.sources import stamp


class Command(IntEnum):
    """What `enter` shall do."""

    MACRO_STEP = 0
    PREDICT = 1
    NODES = 2
    RESTART = 3
    SET_OFF = 4
    SETTLE_MACRO = 5
    FINISH = 6
    BEGIN = 7
    REFRESH = 8
    LOAD = 9
    SETTLE = 10
    RECORD = 11
    SEMI_IMPLICIT_EULER = 12
    RUNGE_KUTTA_4 = 13
    TAKE_MIDDLE = 14
    ADAPTIVE_STEP = 15


(
    _MACRO_STEP, _PREDICT, _NODES, _RESTART, _SET_OFF, _SETTLE_MACRO, _FINISH, _BEGIN, _REFRESH,
    _LOAD, _SETTLE, _RECORD, _EULER, _RUNGE_KUTTA, _TAKE_MIDDLE, _ADAPTIVE_STEP,
) = (int(command) for command in Command)  # fmt: skip


@njit(cache=True, error_model="numpy")
def enter(table, command) -> int:
    """Carry out a `Command` on a run (`layout.RUN`, an array of one); returns its status."""
    run = table[0]
    if command == _MACRO_STEP:
        multirate.find_path_error(run)
        if not run.path_error > run.path_limit:
            multirate.take_middle(run)
            multirate.macro_step(run)
    elif command == _TAKE_MIDDLE:
        multirate.find_path_error(run)
        if not run.path_error > run.path_limit:
            multirate.take_middle(run)
    elif command == _ADAPTIVE_STEP:
        multirate.adaptive_step(run)
        multirate.leave(run)
    elif command == _SETTLE_MACRO:
        multirate.settle_macro(run)
    elif command == _EULER:
        singlerate.semi_implicit_euler(run)
    elif command == _RUNGE_KUTTA:
        singlerate.runge_kutta_4(run)
    elif command == _LOAD:
        singlerate.load(run)
    elif command == _PREDICT:
        multirate.predict(run)
    elif command == _NODES:
        nodes(run)
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
    "WELL_RESOLVED_STEPS",
    "Command",
    "Status",
    "compiled",
    "enter",
]
