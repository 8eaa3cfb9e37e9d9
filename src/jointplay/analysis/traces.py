"""Many runs in processes side by side, of which only the tool's course is kept."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from tqdm import tqdm

from jointplay.analysis.running import run_to_the_end
from jointplay.errors import JointplayError
from jointplay.host import workers
from jointplay.simulation.simulation import Simulation


@dataclass(frozen=True)
class Trace:
    """The tool's course in one run, world axes."""

    time: np.ndarray
    """Of the records, shape (n,) [s]."""
    position: np.ndarray
    """Shape (n, 3) [m]."""
    velocity: np.ndarray
    """Shape (n, 3) [m/s]."""
    orientation: np.ndarray | None = None
    """Unit quaternions, scalar first, shape (n, 4); None if they are not known."""


def cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def traces(
    simulations: Sequence[Simulation],
    *,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
    what: str = "runs",
) -> list[Trace]:
    """Run all simulations.

    Args:
        simulations: what is run; equal ones are run once.
        jobs: processes; None takes one for each core, 1 runs in this one.
        keep: folder in which each run is kept as soon as it is done; runs that are there already
            are not done again, if all their inputs and the version are the same.
        progress: show a bar on standard error.
        what: name of the runs at the bar.

    Raises:
        JointplayError: a run that did not complete; no process; `keep` cannot be written to.
    """
    if jobs is not None and jobs < 1:
        raise JointplayError(f"at least one process is needed, got {jobs}")
    keys = [_key(one) for one in simulations]
    runs: dict[str, Trace] = {}
    if keep is not None:
        _make(keep)
        for key in dict.fromkeys(keys):
            there = _read(keep / f"{key}.npz")
            if there is not None:
                runs[key] = there
    todo = {k: s for k, s in zip(keys, simulations, strict=True) if k not in runs}
    number = min(jobs or cores(), max(len(todo), 1))
    bar = tqdm(
        total=len(todo) + len(runs),
        initial=len(runs),
        disable=not progress,
        desc=what,
        unit="run",
    )
    with bar:
        if number == 1:
            for key, one in todo.items():
                runs[key] = _run(one)
                _write(keep, key, runs[key])
                bar.update()
        else:
            kept = f"the runs so far are in {str(keep)!r}" if keep else "nothing was kept"
            with workers.pool(number, kept) as pool:
                futures = {pool.submit(_run, one): key for key, one in todo.items()}
                for future in as_completed(futures):
                    key = futures[future]
                    runs[key] = future.result()
                    _write(keep, key, runs[key])
                    bar.update()
    return [runs[key] for key in keys]


def _run(simulation: Simulation) -> Trace:
    seed = "" if simulation.seed is None else f" with seed {simulation.seed}"
    result = run_to_the_end(simulation, f"a run{seed}")
    return Trace(
        np.asarray(result.time),
        result["tool_position"].values.copy(),
        result["tool_velocity"].values.copy(),
        result["tool_orientation"].values.copy(),
    )


def _key(simulation: Simulation) -> str:
    inputs = json.dumps(simulation.describe(), sort_keys=True, default=str)
    return hashlib.sha256(f"{version('jointplay')} {inputs}".encode()).hexdigest()[:20]


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise JointplayError(
            f"cannot keep runs in {str(folder)!r}: {error.strerror or error}"
        ) from None


def _read(path: Path) -> Trace | None:
    """A run that was kept; None if there is none, or it is damaged."""
    try:
        with np.load(path, allow_pickle=False) as kept:
            return Trace(*(kept[name] for name in ("time", "position", "velocity", "orientation")))
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None


def _write(keep: Path | None, key: str, trace: Trace) -> None:
    if keep is None:
        return
    half = keep / f"{key}.{os.getpid()}.part"
    try:
        with half.open("wb") as file:
            np.savez_compressed(file, **vars(trace))
        half.replace(keep / f"{key}.npz")  # at once: no kill leaves half a file
    except OSError as error:
        half.unlink(missing_ok=True)
        raise JointplayError(
            f"cannot keep runs in {str(keep)!r}: {error.strerror or error}"
        ) from None
