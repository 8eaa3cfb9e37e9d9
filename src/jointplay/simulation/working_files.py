"""The files beside a result in which an unfinished run keeps its records and its checkpoint."""

from __future__ import annotations

from pathlib import Path

from jointplay.base import files

CHECKPOINT = b"jointplay checkpoint 4\n"
"""First bytes of a checkpoint."""
RECORDS = b"jointplay records 1 "
"""First bytes of a file of records; then come the run's own name and a line end."""


def working_paths(path: Path) -> tuple[Path, Path]:
    """Paths of the records and of the checkpoint of the run whose result goes to `path`."""
    return path.with_suffix(".records"), path.with_suffix(".checkpoint")


def check_own(path: Path) -> None:
    """Refuse files of others where the run whose result goes to `path` would keep its own.

    Only files that begin with our marks are ever replaced or deleted.
    """
    records, checkpoint_path = working_paths(path)
    files.check_own(records, RECORDS, "file of records")
    files.check_own(checkpoint_path, CHECKPOINT, "checkpoint")


def remove(path: Path) -> None:
    """Delete the working files of the run whose result is in `path`; files of others stay."""
    records, checkpoint_path = working_paths(path)
    files.remove_own(records, RECORDS)
    files.remove_own(checkpoint_path, CHECKPOINT)
