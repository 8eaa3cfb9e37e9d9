"""From when on a simulation is judged: after it has settled."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from jointplay.core.errors import JointplayError, require_non_negative
from jointplay.motion.reference import Motion
from jointplay.result.settings import START_UP

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

_TURNS = re.compile(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(turns?|s)\s*")

_NODES = 20000
"""Times at which a motion is searched for its turns."""


def duration_of(simulation: Simulation) -> float:
    """Simulated time [s]; not a number where neither duration nor motion say."""
    if simulation.duration is not None:
        return float(simulation.duration)
    return math.nan if simulation.motion is None else float(simulation.motion.duration)


def judged_from(simulation: Simulation) -> float:
    """See `Simulation.judged_from`."""
    duration = duration_of(simulation)
    if simulation.judge_from is not None:
        if simulation.settle is not None:
            raise JointplayError(
                f"judge_from ({simulation.judge_from!r}) and settle ({simulation.settle!r}) say "
                "the same; give one of them"
            )
        start = require_non_negative("judge_from", simulation.judge_from, "s")
    elif simulation.settle is not None:
        start = settling_time(simulation, simulation.settle, duration)
    else:
        falls = not simulation.starts_at_rest or simulation.seed is not None
        falls = falls and bool(simulation.mechanism.clearance)
        return START_UP if falls and duration > 2.0 * START_UP else 0.0
    if start >= duration:
        raise JointplayError(
            f"figures would be judged from {start:g} s on, but the run ends at {duration:g} s"
        )
    return start


def settling_time(simulation: Simulation, settle: float | str, duration: float) -> float:
    """Time in which a motion settles [s], of seconds or of turns."""
    if not isinstance(settle, str):
        return require_non_negative("settle", settle, "s", ("settle",))
    match = _TURNS.fullmatch(settle)
    if match is None:
        raise JointplayError(
            f"settle must be seconds or as in '2 turns', got {settle!r}", where=("settle",)
        )
    number = float(match[1])
    if match[2] == "s":
        return number
    motion, mechanism = simulation.motion, simulation.mechanism
    turning = [] if motion is None else [n for n in motion.joints if n in mechanism.joints]
    entries = mechanism.description.joints
    turning = [name for name in turning if not entries[name].slides]
    if motion is None or not turning:
        raise JointplayError(
            f"settle = {settle!r}: no joint follows a motion; give seconds", ("settle",)
        )
    times = [_time_of_turns(motion, name, number, duration) for name in turning]
    first = min(times)
    if math.isinf(first):
        raise JointplayError(
            f"settle = {settle!r}: no joint of the motion turns so often; give seconds",
            where=("settle",),
        )
    return first


def _time_of_turns(motion: Motion, joint: str, turns: float, duration: float) -> float:
    """When a joint of the motion is so many turns from its start [s]; infinite if it never is."""
    times = np.linspace(0.0, duration, _NODES)
    position = motion(times)[0][:, motion.joints.index(joint)]
    way = np.abs(position - position[0])
    there = np.flatnonzero(way >= 2.0 * np.pi * turns * (1.0 - 1e-12))
    if not len(there):
        return math.inf
    k = int(there[0])
    if k == 0:
        return 0.0
    part = (2.0 * np.pi * turns - way[k - 1]) / (way[k] - way[k - 1])
    return float(times[k - 1] + part * (times[k] - times[k - 1]))
