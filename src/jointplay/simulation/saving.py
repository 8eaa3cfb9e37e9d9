"""Running a simulation with its result on disk: checkpoints, requests to stop, and saving."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files, signals
from jointplay.base.errors import JointplayError
from jointplay.base.progress import ProgressBar
from jointplay.physics.kernel import Status
from jointplay.simulation import checkpoint, working_files
from jointplay.simulation.result.histories import HistoryBuilder
from jointplay.simulation.result.netcdf import GrowingDataset
from jointplay.simulation.result.result import Result
from jointplay.simulation.run import Run
from jointplay.simulation.working_files import working_paths

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

CHECKPOINT_S = 60.0
"""Interval between the checkpoints of a run whose records go to disk [s]."""


def run_to(simulation: Simulation, path: Path, progress: bool, resume: bool) -> Result:
    """Run with records and checkpoints beside `path`, and save; `resume` continues from them."""
    records, checkpoint_path = working_paths(path)
    working_files.check_own(path)
    resume = resume and checkpoint_path.exists()
    if not resume:
        files.check_new(path)
        files.check_new(checkpoint_path)
    else:
        checkpoint.check_replaceable(path)
    run = Run(simulation, progress, records)
    if resume:
        checkpoint.continue_run(run, checkpoint_path)
    with signals.listening():
        run_and_save(run, path, progress, overwrite=resume)
    return Result.open(path)


def run_and_save(
    run: Run,
    path: Path,
    progress: bool = False,
    notes: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> tuple[Status, Result | None]:
    """Run and save; after a request to stop, save what there is, with a checkpoint beside it.

    Returns:
        How it ended, and the result; None for a run whose records are on disk: the file has it.

    Raises:
        JointplayError: the result cannot be written to `path`; the message says where it is.
        KeyboardInterrupt: two requests to stop, or one before anything was computed.
    """
    on_disk = run.on_disk
    checkpoint_path = working_paths(path)[1]
    result: Result | None = None
    with signals.keeping(str(path)):
        if signals.stop_requested():  # before it began
            raise KeyboardInterrupt
        run.stop_checks.append(signals.stop_requested)
        if on_disk is not None:
            run.stop_checks.append(_checkpoints(run, checkpoint_path))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the caller says how runs ended
            if on_disk is None or not on_disk.needed:
                result = run.finish(progress)
                status = result.status
            else:
                status = run.run_to_end(progress)
        if status == Status.INTERRUPTED and on_disk is not None:
            try:
                run.checkpoint(checkpoint_path)
            except JointplayError as error:
                signals.say(f"no checkpoint: {error}")
            else:
                at = f"{run.workspace.time:.6g} s"
                signals.say(f"checkpoint at t = {at}: --resume continues from it")
        if result is not None:
            result.dataset.attrs.update(notes or {})
            save(result, path, overwrite)
        else:
            _save_from_disk(run, path, status, notes, overwrite, progress)
        if status != Status.INTERRUPTED and on_disk is not None:
            on_disk.remove()
            working_files.remove(path)
    return status, result


def _checkpoints(run: Run, path: Path) -> Callable[[], bool]:
    """A stop check that never stops, and writes a checkpoint every `CHECKPOINT_S`."""
    last = time.monotonic()

    def write_if_due() -> bool:
        nonlocal last
        if time.monotonic() - last >= CHECKPOINT_S:
            run.checkpoint(path)
            last = time.monotonic()
        return False

    return write_if_due


def _save_from_disk(
    run: Run,
    path: Path,
    status: Status,
    notes: Mapping[str, Any] | None,
    overwrite: bool,
    progress: bool,
) -> None:
    """Make the result file of records on disk, portion by portion."""
    assert run.on_disk is not None
    run.on_disk.write_to_disk()
    portions, builder = run.on_disk.portions(), HistoryBuilder(run)
    bar = ProgressBar((), "writing the histories", total=run.on_disk.rows, disable=not progress)
    with bar, files.writing(path, overwrite=overwrite) as file:
        totals, records = builder.totals(), next(portions)
        first = builder.portion(records).assign(totals)
        bar.update(records.rows)
        with closing(GrowingDataset(file, first)) as growing:
            for records in portions:
                growing.append(builder.portion(records))
                bar.update(records.rows)
            growing.finish({**builder.attributes(status), **(notes or {})}, totals)


def save(result: Result, path: Path, overwrite: bool = False) -> None:
    """Save to `path`, or, if that cannot be, among temporary files.

    Raises:
        JointplayError: it cannot be written to `path`; the message says where it is instead.
    """
    try:
        result.save(path, overwrite)
    except JointplayError as error:
        try:
            elsewhere = Path(tempfile.mkdtemp(prefix="jointplay-")) / path.name
            result.save(elsewhere)
        except (JointplayError, OSError):
            raise JointplayError(f"{error}; it could not be saved elsewhere either") from None
        raise JointplayError(f"{error}; the result is in {str(elsewhere)!r} instead") from None
