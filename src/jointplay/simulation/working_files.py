"""Where a run that is not finished keeps what it has so far."""

from __future__ import annotations

from pathlib import Path

from jointplay.base import files

CHECKPOINT = b"jointplay checkpoint 4\n"
"""How a checkpoint begins."""
RECORDS = b"jointplay records 1 "
"""How a file of records begins; then the run's own name and a line end."""


def working_paths(path: Path) -> tuple[Path, Path]:
    """Where the records and the checkpoint of the run are whose result goes to `path`."""
    return path.with_suffix(".records"), path.with_suffix(".checkpoint")


def check_own(path: Path) -> None:
    """Refuse files of others where the run whose result goes to `path` would keep what it has: only
    what begins as ours does is ever replaced or deleted.
    """
    records, checkpoint_path = working_paths(path)
    files.check_own(records, RECORDS, "file of records")
    files.check_own(checkpoint_path, CHECKPOINT, "checkpoint")


def remove(path: Path) -> None:
    """Delete what the run kept whose result is in `path`; files of others stay."""
    records, checkpoint_path = working_paths(path)
    files.remove_own(records, RECORDS)
    files.remove_own(checkpoint_path, CHECKPOINT)
