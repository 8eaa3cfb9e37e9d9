"""The compiled functions through which all kernels are entered.

Three, because a run needs one or two of them and each is compiled when it is first called for:
`enter` has what the multi-rate method does, `enter_adaptive` its steps of their own choice,
`enter_single` the single-rate methods.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from jointplay.core.compiler import njit
from jointplay.kernel import multirate, singlerate
from jointplay.kernel import record as records
from jointplay.kernel.access import TABLE
from jointplay.kernel.sources import stamp
from jointplay.kernel.words import THERE, Command

(
    _ADVANCE, _PLAN, _RESTART, _SET_OFF, _SETTLE_MACRO, _FINISH, _BEGIN, _REFRESH,
    _LOAD, _SETTLE, _RECORD, _EULER, _RUNGE_KUTTA, _TAKE_MIDDLE, _ADAPTIVE_STEP,
) = (int(command) for command in Command)  # fmt: skip


@njit(cache=True, error_model="numpy")
def enter(table, command) -> int:
    """Carry out a `Command` of the multi-rate method on a run (`layout.RUN`, an array of one).

    Returns the run's status, or `THERE`, where `ADVANCE` has come to the step that it should not
    go beyond.
    """
    run = table[0]
    if command == _ADVANCE:
        multirate.advance(run)
        if run.status == 0 and run.step >= run.until:
            return THERE
    elif command == _TAKE_MIDDLE:
        multirate.judge(run)
    elif command == _SETTLE_MACRO:
        multirate.settle_macro(run)
    elif command == _PLAN:
        multirate.plan(run)
    elif command == _RESTART:
        multirate.restart(run)
    elif command == _SET_OFF:
        multirate.set_off(run)
    elif command == _FINISH:
        multirate.finish(run)
    return run.status


@njit(cache=True, error_model="numpy")
def enter_adaptive(table, command) -> int:
    """Do the multi-rate method's `ADAPTIVE_STEP` on a run; returns its status."""
    run = table[0]
    if command == _ADAPTIVE_STEP:
        multirate.adaptive_step(run)
        multirate.leave(run)
    return run.status


@njit(cache=True, error_model="numpy")
def enter_single(table, command) -> int:
    """Carry out a `Command` of the single-rate methods on a run; returns its status."""
    run = table[0]
    if command == _EULER:
        singlerate.semi_implicit_euler(run)
    elif command == _RUNGE_KUTTA:
        singlerate.runge_kutta_4(run)
    elif command == _LOAD:
        singlerate.load(run)
    elif command in (_BEGIN, _REFRESH):
        singlerate.begin(run, command == _BEGIN)
    elif command == _SETTLE:
        records.settle(run)
    elif command == _RECORD:
        records.settle(run)
        records.record(run)
    return run.status


ENTRIES = (enter, enter_adaptive, enter_single)

_SINGLE = (_BEGIN, _REFRESH, _LOAD, _SETTLE, _RECORD, _EULER, _RUNGE_KUTTA)

for _entry in ENTRIES:
    stamp(_entry)


def entry_of(command: Command) -> Any:
    """The one of `ENTRIES` that carries out a command."""
    if command == Command.ADAPTIVE_STEP:
        return enter_adaptive
    return enter_single if command in _SINGLE else enter


def compiled(command: Command = Command.ADVANCE) -> Any:
    """Compile the entry for a command or load it, and return the function behind the dispatcher.

    To call it directly saves the dispatcher's look at the arguments, half of what a call costs.
    """
    return _compiled(entry_of(command))


@cache
def _compiled(entry: Any) -> Any:
    entry.compile(TABLE)
    return entry.overloads[TABLE].entry_point
