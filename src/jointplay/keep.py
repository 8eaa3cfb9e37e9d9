"""Running a simulation and having its result on disk, whatever happens in between."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay import stopping
from jointplay.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.result import Result
    from jointplay.simulation import Run


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


def save(result: Result, path: Path) -> None:
    """Save to `path`, or, if that cannot be, among temporary files.

    Raises:
        JointplayError: it cannot be written to `path`; the message says where it is instead.
    """
    try:
        result.save(path)
    except JointplayError as error:
        try:
            other = Path(tempfile.mkdtemp(prefix="jointplay-")) / path.name
            result.save(other)
        except (JointplayError, OSError):
            raise JointplayError(f"{error}; nor is there room for it elsewhere") from None
        raise JointplayError(f"{error}; the result is in {str(other)!r} instead") from None
