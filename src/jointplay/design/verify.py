"""What a static error is worth: the tool's error in dynamic runs of the same mechanism."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jointplay import kernel
from jointplay.analysis.runs import check_numbers, errors, traces
from jointplay.analysis.twins import ideal_simulation
from jointplay.core.errors import JointplayError
from jointplay.mechanism.impact import contact_duration
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion
from jointplay.result.settings import START_UP
from jointplay.simulation.simulation import Simulation

LONGEST_STEP_S = 1e-5
_FINER = (1.0, 0.2)
"""Steps that are tried, relative: a jammed journal may break out with the first."""


@dataclass(frozen=True)
class DynamicError:
    """Distance of the tool from the ideal mechanism's in perturbed runs, from `since` on."""

    peak: np.ndarray
    """Of each run [m]."""
    rms: np.ndarray
    """Of each run [m]."""
    since: float
    """Before it the journals fall from the centre of their bearings [s]."""
    step: float
    """Time step of the runs [s]."""

    def __str__(self) -> str:
        """One line."""
        return (
            f"simulated: {len(self.peak)} perturbed run{'s' * (len(self.peak) > 1)}, step "
            f"{1e6 * self.step:.3g} us, from {self.since:g} s on: peak error "
            f"{1e6 * self.peak.max():.4g} um, RMS {1e6 * self.rms.mean():.4g} um"
        )


def fitting_step(mechanism: Mechanism, q: np.ndarray) -> float:
    """A time step that resolves the impacts of all joints [s]."""
    shortest = min(contact_duration(mechanism, name, q) for name in mechanism.clearance)
    return min(LONGEST_STEP_S, shortest / kernel.WELL_RESOLVED_STEPS)


def dynamic_error(
    mechanism: Mechanism,
    motion: Motion,
    simulation: Simulation | None = None,
    *,
    runs: int = 3,
    jobs: int | None = None,
    progress: bool = False,
) -> DynamicError:
    """Tool's error against the ideal mechanism in runs whose journals start displaced at random.

    Args:
        mechanism, motion: what is run, with play.
        simulation: whose drives, payloads and settings are used; None takes the usual ones.
        runs, jobs, progress: see `traces`.

    Raises:
        JointplayError: a run that failed; fewer than one run.
    """
    check_numbers(runs, jobs)
    base = simulation or Simulation(mechanism, motion)
    begin = {name: float(x) for name, x in zip(motion.joints, motion.positions[0], strict=True)}
    longest = min(base.step, fitting_step(mechanism, mechanism.configuration(begin)))
    failed = None
    for part in _FINER:
        step = part * longest
        every = max(round(2e-4 / step), 1)
        own = replace(base, mechanism=mechanism, motion=motion, step=step, record_every=every)
        drawn = [ideal_simulation(own), *(replace(own, seed=seed) for seed in range(1, runs + 1))]
        try:
            ideal, *courses = traces(drawn, jobs=jobs, progress=progress)
        except JointplayError as error:
            failed = error
            continue
        since = min(START_UP, 0.5 * float(ideal.time[-1]))
        size = np.linalg.norm(errors(courses, ideal)[:, ideal.time >= since], axis=2)
        return DynamicError(size.max(axis=1), np.sqrt((size**2).mean(axis=1)), since, step)
    raise JointplayError(f"to verify: {failed}")
