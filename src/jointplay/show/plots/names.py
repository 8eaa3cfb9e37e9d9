"""Names of figures, modes, robots and results, without importing anything that draws."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jointplay.base.errors import JointplayError
from jointplay.model.linkage import DRAWN
from jointplay.simulation import analysis

if TYPE_CHECKING:
    from jointplay.physics.geometry import Form
    from jointplay.simulation.result.result import Result

PAPER_ROBOTS = ("scara.urdf", "scara_as_printed.urdf")

MARK = "jointplay figures"  # in the pictures' metadata: files with it may be replaced

NAMES = (
    *("tool_displacement", "tool_velocity", "tool_path", "journal_orbit"),
    *("force_x", "force_y", "force_z", "overview", "bearing_loads"),
)
"""Figures of one or several cases, in the order in which they are drawn."""

SHORT = ("overview", "bearing_loads")
"""Figures that `save` draws when it is asked for few."""

PAPER = {name: f"fig{9 + k:02d}" for k, name in enumerate(NAMES[:-2])}
"""Numbers of those figures in the paper, 9 to 15, as file names."""


MODES = ("no contact", "just touching", "in contact")
"""Plain names of a journal's modes, in the order of `geometry.Mode`."""

MODE_TERMS = ("free flight", "continuous contact", "pseudo-penetration")
"""The paper's terms for these modes (Table 1)."""

MODE_MEANINGS = (
    "a gap of more than 0.1 µm on every side",
    "a gap within ±0.1 µm of zero",
    "pressed together: the ordinary state of a loaded joint; the surfaces overlap by the elastic "
    "deflection",
)
"""Condition of each mode."""


def form_name(form: Form) -> str:
    """The name of a contact form, after its letter in Figure 2."""
    name = form.name.lower().replace("_", " ")
    return f"{form.letter}: {name}" if form else name


def is_paper_robot(urdf: str) -> bool:
    """Whether a URDF's path is that of the paper's robot, by its file name."""
    return Path(urdf.rpartition(":")[2]).name in PAPER_ROBOTS


def kinds(pdf: bool) -> tuple[str, ...]:
    """File formats of a figure; PDF only on demand, as it takes three times as long as PNG."""
    return ("png", "pdf") if pdf else ("png",)


def file_names(paper: bool, rolling: bool = True, pdf: bool = False) -> list[str]:
    """Names of all files that `figures.save` may write, with the paper's numbers for its robot."""
    shown = NAMES if rolling else NAMES[:-1]
    names = [PAPER.get(name, name) if paper else name for name in shown]
    return [f"{name}.{kind}" for name in names for kind in kinds(pdf)]


def load_one(place: str | Path) -> Result:
    """The only result at a place: a file, or a folder with one.

    Raises:
        JointplayError: several results, or as `load`.
    """
    path = Path(place)
    results = load([path])
    if len(results) > 1:
        files = ", ".join(file.name for file in _files_in(path))
        raise JointplayError(f"{str(path)!r} has {len(results)} results; name one: {files}")
    (result,) = results.values()
    return result


def load(paths: Sequence[str | Path], labels: Sequence[str] = ()) -> dict[str, Result]:
    """Read results by label; a folder stands for the results in it, the ideal mechanism's first.

    By default labels are the names of the scenario's cases, or else the first of these that tell
    the results apart: file names without suffix, folder names, whole paths.

    Raises:
        JointplayError: a file that is missing, given twice, damaged or not a result; a folder
            without results; labels that do not fit.
    """
    from jointplay.simulation.result.result import Result

    files: list[Path] = []
    for path in map(Path, paths):
        inside = _files_in(path) if path.is_dir() else [path]
        if not inside:
            raise JointplayError(f"the folder {str(path)!r} holds no results (*.nc)")
        files += inside
    resolved = [file.resolve() for file in files]
    for file, again in zip(files, resolved, strict=True):
        if resolved.count(again) > 1:
            raise JointplayError(f"result {str(file)!r} is given twice")
    if labels and len(labels) != len(files):
        raise JointplayError(f"{len(labels)} labels for {len(files)} results; give one for each")
    for label in labels:
        if list(labels).count(label) > 1:
            raise JointplayError(f"two results are called {label!r}; name them with --label")
    results = [Result.load(file) for file in files]
    for file, result in zip(files, results, strict=True):
        if not len(result.time):
            raise JointplayError(f"{str(file)!r} holds no records")
    cases = [str(result.dataset.attrs.get("case", "")) for result in results]
    choices = [
        labels,
        cases if all(cases) else [],
        [file.stem for file in files],
        [file.parent.name for file in resolved],
        [str(file.with_suffix("")) for file in resolved],
    ]
    names = next(choice for choice in choices if choice and len(set(choice)) == len(files))
    return dict(zip(names, results, strict=True))


def _files_in(folder: Path) -> list[Path]:
    """Files of results in a folder: the ideal mechanism first, then by name, numbers as numbers."""

    def place(file: Path) -> tuple[bool, list[tuple[float, str]]]:
        parts = re.split(r"(\d+(?:\.\d+)?)", file.stem)
        numbers = [(float(p), "") if p[:1].isdigit() else (0.0, p) for p in parts]
        return file.stem != "ideal", numbers

    return sorted(folder.glob("*.nc"), key=place)


def title_of(results: Mapping[str, Result]) -> str:
    """The title of the results' scenario, or else their robots and joints with play."""
    titles = dict.fromkeys(
        str(result.dataset.attrs.get("title", "")) for result in results.values()
    )
    if len(titles) == 1 and all(titles):
        return next(iter(titles))
    robots = dict.fromkeys(map(robot_of, results.values()))
    joints = dict.fromkeys(name for result in results.values() for name in result.joints)
    play = f", play in {', '.join(joints)}" if joints else ""
    return f"{', '.join(robots)}{play}"


def robot_of(result: Result) -> str:
    """The name of a run's robot: its URDF's file name, or the scenario's title for a linkage."""
    name = Path(str(analysis.inputs(result)["mechanism"]["urdf"]).rpartition(":")[2]).stem
    return str(result.dataset.attrs.get("title") or name) if name == DRAWN else name
