"""Running a simulation and having its result on disk, whatever happens in between."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.core import signals
from jointplay.core.errors import JointplayError
from jointplay.kernel import Status
from jointplay.result.result import Result
from jointplay.simulation.spool import checkpoints, forget
from jointplay.simulation.spool import save as on_disk_save
from jointplay.simulation.working_files import working_paths

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Run, Simulation


LARGE_FILE = 10_000_000
"""Files that are smaller are read whole [bytes]."""

SUMMARY_RECORDS = 50_000
"""Records of a long run that are read for its summary and figures, about."""


def run_and_save(
    run: Run,
    path: Path,
    progress: bool = False,
    notes: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> tuple[Status, Result | None]:
    """Run and save; told to stop, the run is saved as far as it came, with a checkpoint beside it.

    Args:
        run: made ready, or continued.
        path: the file.
        progress: show a bar.
        notes: further attributes of the file.
        overwrite: whether a file of that name is replaced.

    Returns:
        How it ended, and the result; None of a run whose records are on disk: the file has it.

    Raises:
        JointplayError: the result cannot be written to `path`; the message says where it is.
        KeyboardInterrupt: told to stop twice, or before anything was computed.
    """
    on_disk = run.on_disk
    kept = working_paths(path)[1]
    result: Result | None = None
    with signals.keeping(str(path)):
        signals.stoppable(run)
        if on_disk is not None:
            run.between.append(checkpoints(run, kept))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the caller says how runs ended
            if on_disk is None or not on_disk.needed:
                result = run.execute(progress)
                status = result.status
            else:
                status, message = run.complete(progress)
        if status == Status.INTERRUPTED and on_disk is not None:
            _keep_checkpoint(run, kept)
        if result is not None:
            result.dataset.attrs.update(notes or {})
            save(result, path, overwrite)
        else:
            on_disk_save(run, path, status, message, notes, overwrite, progress)
        if status != Status.INTERRUPTED and on_disk is not None:
            forget(run, path)
    return status, result


def load_some(
    path: Path, trust: Collection[str] = (), only: Collection[str] | None = None
) -> Result:
    """A result with no more than about `SUMMARY_RECORDS` records; see `Result.load`.

    Args:
        path, trust: see there.
        only: histories that are wanted, if the file is large.
    """
    if path.stat().st_size < LARGE_FILE:
        return Result.load(path, trust)
    from jointplay.result import thinning  # takes long to import

    return thinning.load(path, trust, most=SUMMARY_RECORDS, only=only)


def _keep_checkpoint(run: Run, kept: Path) -> None:
    """Write a checkpoint and say so; if it cannot be, say why."""
    try:
        run.checkpoint(kept)
    except JointplayError as error:
        signals.say(f"no checkpoint: {error}")
    else:
        signals.say(f"checkpoint at t = {run.workspace.time:.6g} s: --resume goes on from it")


def add_certificate(
    result: Result,
    path: Path,
    simulation: Simulation,
    progress: bool = False,
    begin: Callable[[Run], None] = lambda _: None,
) -> None:
    """Certify a saved result and save it again; until then the file is as it was.

    A run that was told to stop, or while it was saved, is not certified.

    Args:
        result: what `run_and_save` gave.
        path: its file.
        simulation: what was run.
        progress: show bars.
        begin: told of each further run before it begins.

    Raises:
        JointplayError: the file cannot be written again; the message says where the result is.
        KeyboardInterrupt: told to stop; the result is there without certificate.
    """
    from jointplay.analysis.certification import certify

    if result.status == Status.INTERRUPTED or signals.stop_requested():
        return
    certificate = certify(result, simulation=simulation, progress=progress, begin=begin)
    with signals.keeping(f"the certificate of {path}"):
        result.certificate = certificate
        save(result, path, overwrite=True)


def save(result: Result, path: Path, overwrite: bool = False) -> None:
    """Save to `path`, or, if that cannot be, among temporary files.

    Args:
        result: what is saved.
        path: the file.
        overwrite: whether a file of that name is replaced.

    Raises:
        JointplayError: it cannot be written to `path`; the message says where it is instead.
    """
    try:
        result.save(path, overwrite)
    except JointplayError as error:
        try:
            other = Path(tempfile.mkdtemp(prefix="jointplay-")) / path.name
            result.save(other)
        except (JointplayError, OSError):
            raise JointplayError(f"{error}; nor is there room for it elsewhere") from None
        raise JointplayError(f"{error}; the result is in {str(other)!r} instead") from None
