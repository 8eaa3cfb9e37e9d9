"""What figures are called; nothing is drawn here, and nothing that draws is imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jointplay.simulation import analysis

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result

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


MODES = ("no contact", "just touching", "in contact")
"""Plain names of a journal's modes, in the order of `geometry.Mode`."""

MODE_TERMS = ("free flight", "continuous contact", "pseudo-penetration")
"""What the paper calls them (Table 1)."""

MODE_MEANINGS = (
    "a gap of more than 0.1 µm on every side",
    "a gap within ±0.1 µm of zero",
    "pressed together: the ordinary state of a loaded joint; the surfaces overlap by the elastic "
    "deflection",
)
"""When a journal is in each."""


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


def case_names(results: Sequence[Result]) -> list[str] | None:
    """Cases of a scenario as their author wrote them; None where they do not tell results apart."""
    names = [str(result.dataset.attrs.get("case", "")) for result in results]
    return names if all(names) and len(set(names)) == len(names) else None


def title_of(results: Mapping[str, Result]) -> str:
    """The title of the scenario that results belong to; else robot and joints with play."""
    titles = dict.fromkeys(str(one.dataset.attrs.get("title", "")) for one in results.values())
    if len(titles) == 1 and all(titles):
        return next(iter(titles))
    robots = dict.fromkeys(map(robot_of, results.values()))
    joints = dict.fromkeys(name for one in results.values() for name in one.joints)
    play = f", play in {', '.join(joints)}" if joints else ""
    return f"{', '.join(robots)}{play}"


def robot_of(result: Result) -> str:
    """The name of a run's robot: that of its URDF's file."""
    return Path(str(analysis.inputs(result)["mechanism"]["urdf"]).rpartition(":")[2]).stem
