"""The one compiled function through which all kernels are entered."""

from __future__ import annotations

from functools import cache
from typing import Any

from jointplay.host.numba_cache import njit
from jointplay.kernel import multirate, path, singlerate
from jointplay.kernel import record as records
from jointplay.kernel.layout import TABLE
from jointplay.kernel.sources import stamp
from jointplay.kernel.words import THERE, Command

(
    _ADVANCE, _PLAN, _RESTART, _SET_OFF, _SETTLE_MACRO, _FINISH, _BEGIN, _REFRESH,
    _LOAD, _SETTLE, _RECORD, _EULER, _RUNGE_KUTTA, _TAKE_MIDDLE, _ADAPTIVE_STEP,
) = (int(command) for command in Command)  # fmt: skip


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
