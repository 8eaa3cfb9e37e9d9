"""Runs of which only the tool's trajectory is kept, and its error against the ideal mechanism."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, require_whole
from jointplay.base.modules import files_with
from jointplay.base.processes import number_of
from jointplay.model.impact import fitting_step
from jointplay.model.mechanism import Mechanism
from jointplay.physics.contact.functions import OfFunction
from jointplay.simulation.analysis.tool_error import rms_in_time
from jointplay.simulation.analysis.twins import ideal_simulation
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import Result
from jointplay.simulation.simulation import Simulation
from jointplay.study.runs import MOST_RUNS, Arrays, store_in
from jointplay.study.study import Measure, Study


@dataclass(frozen=True)
class Trace:
    """The tool's trajectory in one run, at the times of the records [s], in world axes.

    Position (n, 3) [m], velocity (n, 3) [m/s], orientation (unit quaternions, scalar first, (n, 4);
    None: unknown), and the time from which the run is judged [s].
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    orientation: np.ndarray | None = None
    judged_from: float | np.ndarray = 0.0


def errors(runs: Sequence[Trace], ideal: Trace) -> np.ndarray:
    """Position of the tool in each run less that of the ideal one, shape (runs, n, 3) [m].

    Raises:
        JointplayError: a run was recorded at other times than the ideal one.
    """
    time = ideal.time
    for run in runs:
        aligned = len(run.time) == len(time)
        if not aligned or not np.allclose(run.time, time, 0.0, 1e-9 + 1e-9 * time[-1]):
            raise JointplayError("a run was not recorded at the times of the ideal mechanism's")
    return np.stack([run.position - ideal.position for run in runs])


def seeded(simulation: Simulation, runs: int) -> list[Simulation]:
    """The simulation with `runs` successive seeds, from its own on, or from 1."""
    first = 1 if simulation.seed is None else simulation.seed
    return [dataclasses.replace(simulation, seed=first + run) for run in range(runs)]


def at_speed(simulation: Simulation, factor: float) -> Simulation:
    """The simulation with its motion at `factor` times the speed."""
    if factor == 1.0 or simulation.motion is None:
        return simulation
    duration = None if simulation.duration is None else simulation.duration / factor
    motion = simulation.motion.at_speed(factor)
    return dataclasses.replace(simulation, motion=motion, duration=duration)


RUNS = "runs"
"""Name of the file in which trajectories are kept."""


def check_numbers(runs: int, jobs: int | None) -> None:
    """Raise a JointplayError if the number of runs or of processes is out of range."""
    require_whole("runs", runs, 1, MOST_RUNS)
    number_of(jobs)


def traces(
    simulations: Sequence[Simulation],
    *,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
    label: str = "runs",
) -> list[Trace]:
    """Run all simulations; returns the tool's trajectory of each.

    Args:
        simulations: simulations to run; equal ones are run once.
        jobs: processes; None takes one for each core, 1 runs in this process.
        keep: folder in whose file `RUNS` each run is kept as soon as it is done; runs that are
            there already are not made again, if all their inputs and the version are the same.
        progress: show a bar on standard error.
        label: name of the runs, shown by the bar.

    Raises:
        JointplayError: a run that did not complete; `jobs` out of range; `keep` cannot be written.
    """
    check_numbers(max(len(simulations), 1), jobs)
    keys = [run_key(simulation) for simulation in simulations]
    plan = dict(zip(keys, simulations, strict=True))
    with store_in(None if keep is None else keep / RUNS) as store:
        Study(plan, Measure(_course), store).run(jobs, progress, desc=label)
    return [Trace(**store[key]) for key in keys]


def _course(result: Result) -> Arrays:
    names = ("position", "velocity", "orientation")
    courses = {name: result[f"tool_{name}"].values.copy() for name in names}
    start = np.array(result.audit.judged_from)
    return {"time": np.asarray(result.time), "judged_from": start, **courses}


def run_key(simulation: Simulation) -> str:
    """Hash of all inputs of a run and of the version: its key in a store."""
    inputs = json.dumps(
        [simulation.describe(), _own_modules(simulation)], sort_keys=True, default=str
    )
    return hashlib.sha256(f"{version('jointplay')} {inputs}".encode()).hexdigest()[:20]


def _own_modules(simulation: Simulation) -> list[str]:
    """Source texts of the modules of the user's own laws.

    The description of a simulation has only the law's function, which may call others there.
    """
    acting: list[Any] = [*simulation.loads.values()]
    for joint in simulation.mechanism.clearance.values():
        acting += [getattr(joint, field.name) for field in dataclasses.fields(joint)]
    names = [law.function.__module__ for law in acting if isinstance(law, OfFunction)]
    return [file.read_text(encoding="utf-8") for name in names for file in files_with(name)]


# Verification of a static error: the tool's error in dynamic runs of the same mechanism.


_FINER = (1.0, 0.2)
"""Steps that are tried in turn, relative: with the first a jammed journal may break out."""


@dataclass(frozen=True)
class DynamicError:
    """Distance of the tool from the ideal mechanism's in perturbed runs, from `since` on."""

    peak: np.ndarray
    """Largest distance in each run [m]."""
    rms: np.ndarray
    """RMS distance in each run [m]."""
    since: float
    """Time from which it is judged; before, journals fall from their bearings' centres [s]."""
    step: float
    """Time step of the runs [s]."""

    def __str__(self) -> str:
        return (
            f"simulated: {len(self.peak)} perturbed run{'s' * (len(self.peak) > 1)}, step "
            f"{1e6 * self.step:.3g} µs, from {self.since:g} s on: peak error "
            f"{1e6 * self.peak.max():.4g} µm, RMS {1e6 * self.rms.mean():.4g} µm"
        )


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
        mechanism, motion: the mechanism with play, and its motion.
        simulation: gives drives, payloads and settings; None takes the defaults.
        runs: number of perturbed runs.
        jobs, progress: see `traces`.

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
        stride = max(round(2e-4 / step), 1)
        timed = dataclasses.replace(
            base, mechanism=mechanism, motion=motion, step=step, record_every=stride
        )
        drawn = [
            ideal_simulation(timed),
            *(dataclasses.replace(timed, seed=seed) for seed in range(1, runs + 1)),
        ]
        try:
            ideal, *courses = traces(drawn, jobs=jobs, progress=progress)
        except JointplayError as error:
            failed = error
            continue
        since = max(float(course.judged_from) for course in courses)
        judged = ideal.time >= since
        size = np.linalg.norm(errors(courses, ideal)[:, judged], axis=2)
        rms = rms_in_time(ideal.time[judged], size.T)
        return DynamicError(size.max(axis=1), rms, since, step)
    raise JointplayError(f"verification by runs failed: {failed}")
