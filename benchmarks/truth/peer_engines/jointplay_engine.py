"""This package."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
from truth.peer_engines.common import Problem
from truth.peer_engines.trace import Trace

from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation.run import Run


def run_jointplay(
    task: Problem, step: float, duration: float, every: int = 1, integrator: str = DEFAULT,
    **options: object,
) -> Trace:  # fmt: skip
    """Simulate `duration` seconds, a record every `every` steps; `options` of the simulation."""
    options |= {"step": step, "duration": duration, "record_every": every, "integrator": integrator}
    run = Run(dataclasses.replace(task.simulation, **options))
    run.workspace.q[:], run.workspace.v[:] = task.start
    if not task.driven and task.prescribed < 0:
        run.workspace.reference[:] = 0.0
        run.workspace.drives["kp"] = run.workspace.drives["kd"] = 0.0
    started = time.process_time()
    status = run.run_to_end()
    spent = time.process_time() - started
    if status != 0:
        raise RuntimeError(run.message(status))
    recorded = run.workspace.recorded
    force = np.linalg.norm(recorded("force"), axis=(1, 2))
    time_, q, v = (recorded(name).copy() for name in ("time", "q", "v"))
    return Trace(time_, q, v, force, spent, run.total_steps)
