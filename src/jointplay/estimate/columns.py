"""Columns of measured tables: their names, units, and numbers in SI.

A column is called ``tool x [mm]``: the signal, and its unit in brackets (or ``tool_x_mm``).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.units import convert, plain_number, titled

Key = tuple[str, str]
"""A signal: its kind, then its axis or joint, as ``("tool", "x")``, ``("link", "elbow")``."""
_MOTOR, _GOAL = "motor", "goal"
"""Kinds of signal of a joint's motor: where it was, and where it was sent, which is not used."""
_LARGEST = 1e12
"""Largest number in a measurement [SI]: times since 1970 have ten digits, all else has fewer."""


def read(
    path: Path,
    kind: str,
    meaning: Callable[[str], tuple[Key, str] | None],
    known: str,
    labels: Collection[str] = (),
    gaps: Collection[str] = (),
) -> tuple[dict[Key, np.ndarray], dict[str, tuple[str, ...]]]:
    """Read a CSV file: numbers by signal [SI], shape (n,) each, and texts by column.

    Args:
        path: the file; lines beginning with # are comments.
        kind: what the file is, for messages.
        meaning: from the name of a column to its signal and SI unit; None: unknown.
        known: text of the columns that there may be, for messages.
        labels: names of columns of text.
        gaps: kinds of signal that may have empty cells, which are nan.

    Raises:
        JointplayError: no such file; a column without unit, of an unknown name or given twice; a
            cell that is not a number, or larger than any (with its line).
    """
    rows = files.csv_rows(path, kind)
    numbers: dict[Key, np.ndarray] = {}
    texts: dict[str, tuple[str, ...]] = {}
    _check_titles(path, [cell.strip() for cell in rows[0][1]], meaning, known, labels)
    for column, title in enumerate(cell.strip() for cell in rows[0][1]):
        cells = [(line, row[column].strip()) for line, row in rows[1:]]
        if title in labels:
            if title in texts:
                raise JointplayError(f"{path}: {title!r} appears twice")
            texts[title] = tuple(cell for _, cell in cells)
            continue
        name, unit = split_title(title)
        meant = meaning(name)
        assert meant is not None  # by the check of all titles
        key, goal = meant
        if key[0] == _GOAL:
            continue
        factor = float(convert(f"1 {unit}", goal))
        if key in numbers:
            raise JointplayError(f"{path}: {name!r} appears twice")
        values = np.full(len(cells), np.nan)
        for i, (line, cell) in enumerate(cells):
            try:
                if cell or key[0] not in gaps:
                    values[i] = plain_number(cell)
            except ValueError:
                raise JointplayError(
                    f"{path}, line {line}: {title!r} must be a number, got {cell!r}"
                ) from None
        numbers[key] = factor * values
        if (far := np.flatnonzero(np.abs(numbers[key]) > _LARGEST)).size:
            line, cell = cells[far[0]]
            raise JointplayError(
                f"{path}, line {line}: {title!r} is at most {_LARGEST:g} in SI, got {cell}"
            )
    return numbers, texts


def is_readings(path: str | Path) -> bool:
    """Whether a file is a table of readings of a dial gauge: it has a column ``joint``."""
    path = Path(path)
    if path.suffix.lower() != ".csv" or not files.is_file(path):
        return False
    return "joint" in [cell.strip() for cell in files.csv_rows(path, "measurement")[0][1]]


def is_stairs(path: str | Path) -> bool:
    """Whether a table of readings (`is_readings`) is one of moves back and forth, without push."""
    titles = [
        cell.strip().partition(" ")[0] for cell in files.csv_rows(Path(path), "readings")[0][1]
    ]
    return "motor" in titles and not {"force", "torque"} & {*titles}


def _check_titles(
    path: Path,
    titles: list[str],
    meaning: Callable[[str], tuple[Key, str] | None],
    known: str,
    labels: Collection[str],
) -> None:
    """Refuse columns of unknown name, or without a unit that fits, all in one message."""
    wrong, unknown = [], False
    for title in titles:
        if title in labels:
            continue
        name, unit = split_title(title)
        if not unit:
            proposal = as_written(name, meaning) or "'time [s]', 'elbow motor [deg]'"
            wrong.append(f"{title!r} has no unit; write {proposal}")
        elif (known_as := meaning(name)) is None:
            unknown = True
            proposal = as_written(name, meaning)
            wrong.append(f"{title!r} is unknown{f'; did you mean {proposal}?' if proposal else ''}")
        elif known_as[0][0] != _GOAL:
            try:
                convert(f"1 {unit}", known_as[1])
            except ValueError as error:
                wrong.append(f"{title!r}: {error}")
    if wrong:
        choices = f"; there are: {known}" if unknown else ""
        number = "column" if len(wrong) == 1 else "columns"
        raise JointplayError(f"{path}: {number} {', '.join(wrong)}{choices}")


def as_written(name: str, meaning: Callable[[str], tuple[Key, str] | None]) -> str:
    """Title here of a column that others call `name`, as in logs of LeRobot; empty if unknown."""
    if name.lower() in ("timestamp", "stamp", "t", "time"):
        return "'time [s]'" if meaning("time") else ""
    if (known := meaning(name)) is not None:
        return f"'{name} [{'deg' if known[1] == 'rad' else known[1].replace('*', ' ')}]'"
    joint, _, last = name.rpartition(".")
    kind = {"pos": "", "position": "", "goal": " goal", "cmd": " goal", "action": " goal"}.get(last)
    if joint and kind is not None and (quantity := meaning(f"{joint}{kind}")):
        return f"'{joint}{kind} [{'deg' if quantity[1] == 'rad' else 'mm'}]'"
    return ""


def split_title(title: str) -> tuple[str, str]:
    """Name and unit of a column called ``tool x [mm]`` or ``tool_x_mm``; the unit may be empty."""
    if (in_brackets := titled(title)) != (title, ""):
        return in_brackets
    name, _, unit = title.rpartition("_")
    try:
        convert(f"1 {unit}", "s", "m", "rad", "N", "N*m")
    except ValueError:
        name = ""
    return (name.strip(), unit) if name else (title, "")


def meaning(
    name: str,
    joints: Mapping[str, bool],
    of_joints: Mapping[str, tuple[str, str]],
    of_axes: Mapping[str, Mapping[str, str]],
) -> tuple[Key, str] | None:
    """Signal and SI unit of a column such as ``tool x``, ``elbow motor``; None: unknown.

    A joint alone, or its ``position``, is its motor's position; its ``goal`` is known and not used.

    Args:
        name: of the column.
        joints: the robot's joints, and whether each slides.
        of_joints: units of a joint's kinds of signal, for one that turns and one that slides.
        of_axes: units by axis of other kinds of signal.
    """
    joint = name.removesuffix(" position")
    if joint in joints:
        return (_MOTOR, joint), of_joints[_MOTOR][joints[joint]]
    joint = name.removesuffix(f" {_GOAL}")
    if joint in joints:
        return (_GOAL, joint), of_joints[_MOTOR][joints[joint]]
    for mark in (" ", "_", "."):
        first, _, last = name.partition(mark)
        if last in of_axes.get(first, ()):
            return (first, last), of_axes[first][last]
        first, _, last = name.rpartition(mark)
        if last in of_joints and first in joints:
            return (last, first), of_joints[last][joints[first]]
    return None
