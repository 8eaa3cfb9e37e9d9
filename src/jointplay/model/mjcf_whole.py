"""Compiling a stranger's MJCF whole, with its meshes, where it can do no harm."""

from __future__ import annotations

from pathlib import Path

from jointplay.model.mjcf import compiled, load_spec, tell, told_apart


def require_compiles(path: Path) -> None:
    """Refuse an MJCF that MuJoCo cannot compile, or not within the limits of reading one.

    Raises:
        JointplayError: so it is.
    """
    told_apart(__name__, path)


def serve(path: str) -> None:
    """What the process does."""
    tell(path, _compile)


def _compile(path: Path) -> str:
    compiled(load_spec(path), path)
    return ""
