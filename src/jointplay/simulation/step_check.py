"""Step doubling: the error of a run without clearance because of its step.

Energy does not tell: it can balance within a per cent while a robot that rattles in its gears is
centimetres from where it should be. So the run is done again with twice the step, at half its cost.
Only where the two differ is it done with half the step too, which then decides: a step that is good
enough is not blamed for what twice of it would do.

Impacts in clearances separate neighbouring runs; there the duration of impacts judges the step
(`audit`).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base import signals
from jointplay.base.errors import JointplayError, JointplayWarning
from jointplay.physics.kernel import Status
from jointplay.physics.kernel.constants import integrator
from jointplay.simulation.loads.gear_pair import GearPair
from jointplay.simulation.result.audit import STEP_WARNING
from jointplay.simulation.time_loop import LONGEST_MACRO_STEP_S

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation

_DOUBTED = 0.3 * STEP_WARNING
"""Difference from the run with twice the step above which half the step is tried."""
_LEAST_MOTION = 1e-6
"""Motion of all coordinates to which errors are relative at least [rad or m]."""
_MOST_ROWS = 2000
"""Records of the other runs, about: so few that their memory does not count."""


StepError = tuple[float, float]
"""Error of a run by its step: largest error of the tool's position [m]; and that of all coordinates
but motors in the norm of the mass matrix, relative to how far they move at most."""
COMPARED = ("q", "tool_position")
"""Histories that are compared."""

_UNBOUNDED = math.inf, math.inf


def is_needed(simulation: Simulation) -> bool:
    """Whether nothing else judges the step.

    The multi-rate method judges it by the error of its macro steps, but not where teeth mesh, where
    the step is longer than its macro steps, or where these are given.
    """
    mechanism = simulation.mechanism
    if mechanism.clearance:
        return False
    meshing = any(isinstance(load, GearPair) for load in simulation.loads.values())
    alone = integrator(simulation.integrator).single_rate or bool(mechanism.gears) or meshing
    coarse = simulation.macro_step is not None or simulation.step > LONGEST_MACRO_STEP_S
    return alone or coarse


def step_error(
    run: Run, result: Result, start: tuple[np.ndarray, np.ndarray], progress: bool
) -> StepError | None:
    """Estimate the error of a completed run; None if told to stop, or with a warning if it fails.

    A method of order p has the error d 2^p / (2^p - 1) if half the step changes the result by d
    (Richardson). 2^p is the ratio of the changes by twice and by half the step, within 2 and 16:
    rattling gears have no order. A small change by twice the step is taken as the error itself.
    """
    try:
        coarse = _difference(run, result, start, 2.0, progress)
        if coarse[1] <= _DOUBTED:
            return coarse
        fine = _difference(run, result, start, 0.5, progress)
    except signals.GivenUp:
        raise
    except KeyboardInterrupt:
        return None
    except JointplayError as error:  # no memory, or too many steps
        warnings.warn(f"the step was not checked: {error}", JointplayWarning, stacklevel=2)
        return None
    fall = coarse[1] / fine[1] if fine[1] > 0.0 else math.inf
    fall = min(max(fall, 2.0), 16.0)
    return fine[0] * fall / (fall - 1.0), fine[1] * fall / (fall - 1.0)


def _difference(
    run: Run, result: Result, start: tuple[np.ndarray, np.ndarray], factor: float, progress: bool
) -> StepError:
    """Distance of a run from the same with `factor` times the step."""
    simulation = run.simulation
    macro, tolerance = simulation.macro_step, simulation.tolerance
    interval = simulation.record_every * max(len(result.time) // _MOST_ROWS, 1)
    interval += interval % 2 if factor > 1.0 else 0
    try:
        finer = replace(
            simulation,
            step=factor * simulation.step,
            record_every=round(interval / factor),
            macro_step=None if macro is None else factor * macro,
            tolerance=None if tolerance is None else factor**2 * tolerance,
        )
        twin = run.__class__(finer, progress)
    except JointplayError:
        if factor > 1.0:
            return _UNBOUNDED  # half the step decides
        raise
    twin.label = "checking the step "
    twin.stop_checks += run.stop_checks
    mine, theirs = run.workspace, twin.workspace
    theirs.drives[:] = mine.drives
    twin.share_reference(run)
    theirs.q[:], theirs.v[:] = start
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        comparison = twin.finish(progress, check_step=False)
    if comparison.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    if comparison.status != Status.COMPLETED:
        return _UNBOUNDED
    return _largest_distance(run, result, comparison)


def _largest_distance(run: Run, result: Result, twin: Result) -> StepError:
    """Distance of two runs over the records that they have at the same times."""
    step = run.simulation.step
    ours, theirs = (np.round(side.time / step).astype(np.int64) for side in (result, twin))
    _, rows, twin_rows = np.intersect1d(ours, theirs, return_indices=True)
    if len(rows) < 2:
        return _UNBOUNDED
    mechanism = run.mechanism
    q = result["q"].values
    mass = mechanism.mass_matrix(q[0])
    for name in mechanism.gears:  # where in its play a motor rattles is no error of the motion
        mass[mechanism.motor(name)] = 0.0

    def size(changes: np.ndarray) -> float:
        return float(np.sqrt(np.einsum("ni,ij,nj->n", changes, mass, changes).max()))

    moved = max(size(q - q[0]), _LEAST_MOTION * math.sqrt(float(np.trace(mass))))
    tool = result["tool_position"].values[rows] - twin["tool_position"].values[twin_rows]
    apart = size(q[rows] - twin["q"].values[twin_rows])
    return float(np.linalg.norm(tool, axis=1).max()), apart / moved
