"""Where a run that is not finished keeps what it has so far."""

from __future__ import annotations

from pathlib import Path


def beside(path: Path) -> tuple[Path, Path]:
    """Where the records and the checkpoint of the run are whose result goes to `path`."""
    return path.with_suffix(".records"), path.with_suffix(".checkpoint")
