"""Entry points: the compiled functions through which Python calls the kernels.

There are two, each compiled when first called for, as most runs need only the first: `enter` for
the multi-rate method, `enter_single` for the single-rate ones. Film, rolling elements, gears,
loops, loads and servos, which few runs have, are compiled apart (`apart`) and called by address.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from jointplay.base import compiler
from jointplay.physics.kernel import (
    adaptive,
    drive,
    film,
    gear,
    load,
    loops,
    multirate,
    rolling,
    singlerate,
)
from jointplay.physics.kernel import record as records
from jointplay.physics.kernel.access import PART, RUN_PART, run_at
from jointplay.physics.kernel.constants import REACHED, Command

(
    _ADVANCE, _PLAN, _RESTART, _START_HALF_STEP, _SYNCHRONIZE, _RECORD_LAST_STATE, _BEGIN,
    _REFRESH, _EVALUATE_FORCES, _COMPLETE_STEP, _RECORD, _EULER, _RUNGE_KUTTA, _CHECK_PREDICTION,
    _ADVANCE_ADAPTIVELY,
) = (int(command) for command in Command)  # fmt: skip


@compiler.compiled
def enter(address, command) -> int:
    """Carry out a `Command` of the multi-rate method on a run (`layout.RUN`) at an address.

    Returns the run's status, or `REACHED` where it has advanced to the step `until`.
    """
    run = run_at(address)
    if command in (_ADVANCE, _ADVANCE_ADAPTIVELY):
        if command == _ADVANCE:
            multirate.advance(run)
        else:
            adaptive.advance_adaptively(run)
        if run.status == 0 and run.step >= run.until:
            return REACHED
    elif command == _CHECK_PREDICTION:
        multirate.check_prediction(run)
    elif command == _SYNCHRONIZE:
        multirate.synchronize(run)
    elif command == _PLAN:
        multirate.plan_macro_step(run)
    elif command == _RESTART:
        multirate.restart(run)
    elif command == _START_HALF_STEP:
        multirate.start_half_step(run)
    elif command == _RECORD_LAST_STATE:
        multirate.record_last_state(run)
    return run.status


@compiler.compiled
def enter_single(address, command) -> int:
    """Carry out a `Command` of the single-rate methods on a run; returns its status."""
    run = run_at(address)
    if command == _EULER:
        singlerate.semi_implicit_euler(run)
    elif command == _RUNGE_KUTTA:
        singlerate.runge_kutta_4(run)
    elif command == _EVALUATE_FORCES:
        singlerate.evaluate_forces(run)
    elif command in (_BEGIN, _REFRESH):
        singlerate.begin(run, command == _BEGIN)
    elif command == _COMPLETE_STEP:
        records.complete_step(run)
    elif command == _RECORD:
        records.complete_step(run)
        records.write_record(run)
    return run.status


_SIGNATURE = "i(i,i)"
_SINGLE = (_BEGIN, _REFRESH, _EVALUATE_FORCES, _COMPLETE_STEP, _RECORD, _EULER, _RUNGE_KUTTA)


def entry_of(command: Command) -> Any:
    """The entry that carries out a command."""
    return enter_single if command in _SINGLE else enter


def caller_of(command: Command = Command.ADVANCE) -> Callable[[int, int], int]:
    """Compile or load the entry for a command, and return the callable that is fastest in Python.

    It takes the address of the run's record and a command, and returns a status.
    """
    return entry_of(command).caller(_SIGNATURE)  # type: ignore[no-any-return]


def ahead(command: Command) -> bool:
    """Begin to compile the entry for a command in the background; False if that is not needed."""
    return entry_of(command).ahead(_SIGNATURE)  # type: ignore[no-any-return]


_APART = {
    "film": (film.film, PART),
    "element": (rolling.elements, PART),
    "gear": (gear.gears, RUN_PART),
    "loop": (loops.loops, RUN_PART),
    "load": (load.loads, RUN_PART),
    "servo": (drive.servos, RUN_PART),
}


def apart(name: str) -> int:
    """Compile or load a part, and return its address, for fields such as ``film_part``."""
    function, signature = _APART[name]
    return int(function.native(signature).address)
