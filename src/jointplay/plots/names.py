"""What figures are called; nothing is drawn here, and nothing that draws is imported."""

from __future__ import annotations

from pathlib import Path

PAPER_ROBOTS = ("scara.urdf", "scara_as_printed.urdf")

MARK = "jointplay figures"
"""In the files' metadata: pictures that may be replaced."""

NAMES = (
    *("tool_displacement", "tool_velocity", "tool_path", "journal_orbit"),
    *("force_x", "force_y", "force_z", "overview", "bearing_loads"),
)
"""Figures that compare cases, in order."""

PAPER = {name: f"fig{9 + k:02d}" for k, name in enumerate(NAMES[:-2])}
"""Names of the paper's figures."""


def is_paper_robot(urdf: str) -> bool:
    """Whether a URDF of this name is the paper's robot."""
    return Path(urdf.rpartition(":")[2]).name in PAPER_ROBOTS


def file_names(paper: bool, rolling: bool = True) -> list[str]:
    """Names of all files that `figures.save` may write.

    Args:
        paper: for the paper's robot, whose figures have its numbers.
        rolling: whether there may be rolling bearings.
    """
    shown = NAMES if rolling else NAMES[:-1]
    names = [PAPER.get(name, name) if paper else name for name in shown]
    return [f"{name}.{kind}" for name in names for kind in ("png", "pdf")]
