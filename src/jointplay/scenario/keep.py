"""Running a simulation and having its result on disk, whatever happens in between."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.errors import JointplayError
from jointplay.host import stopping

if TYPE_CHECKING:
    from jointplay.result.result import Result
    from jointplay.simulation.simulation import Run, Simulation


def run_and_save(
    run: Run, path: Path, progress: bool = False, notes: Mapping[str, Any] | None = None
) -> Result:
    """Run and save; told to stop, the run is saved as far as it came.

    Args:
        run: made ready.
        path: a new file.
        progress: show a bar.
        notes: further attributes of the file.

    Raises:
        JointplayError: the result cannot be written to `path`; the message says where it is.
        KeyboardInterrupt: told to stop twice, or before anything was computed.
    """
    with stopping.keeping(str(path)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the caller says how runs ended
            result = stopping.stoppable(run).execute(progress)
        result.dataset.attrs.update(notes or {})
        save(result, path)
    return result


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
    from jointplay.kernel import Status

    if result.status == Status.INTERRUPTED or stopping.told():
        return
    certificate = certify(result, simulation=simulation, progress=progress, begin=begin)
    with stopping.keeping(f"the certificate of {path}"):
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
