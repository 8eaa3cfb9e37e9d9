"""Commands of the command line, one module each, and what they have in common.

The docstring of a module is the head of its help: summary, description, epilog. `declare` adds its
options to its parser; `run` does the work and returns the exit status; what takes long to import is
imported there.
"""

import argparse
import json
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import misread, name_and_number
from jointplay.cli.options import quantity

GROUPS = {
    "simulate": ("run", "study", "check", "init"),
    "decide": ("budget", "allocate", "compensate"),
    "measure": ("identify", "calibrate"),
    "look": ("play", "live", "report", "compare", "plot"),
    "hand on": ("export",),
    "know": ("robots",),
    "the paper": ("scara",),
}
"""Commands by what they are for, each a module, in the order of the help."""

KINDS = {
    "study": ("sweep", "iso9283", "uncertainty", "wear", "dynamics", "hunting"),
    "export": ("result", "simulator", "urdf"),
}
"""Commands of several kinds: packages with a module for each."""

FRONT = ("run", "study", "budget", "identify", "play", "live", "report", "export")
"""What a newcomer is shown first."""

MOST_NOTES = 3
"""Lines about what was chosen and assumed that are printed without ``--detail`` (judged:
tool, sizes and motion are those that decide most)."""
MORE = "(more with --detail)"


def first_notes(lines: Iterable[str], detail: bool) -> list[str]:
    """The first lines of those that say what was chosen and assumed, and every "note:" and warning.

    `detail`: all of them.
    """
    kept: list[str] = []
    left = MOST_NOTES
    for line in lines:
        heard = line.startswith(("note:", "warning:"))
        if detail or heard or left:
            kept.append(line)
            left -= not (detail or heard)
    return kept


def print_answer(
    sentence: str,
    body: object,
    notes: Iterable[str],
    options: argparse.Namespace,
    more: bool = False,
    data: Callable[[], Mapping[str, Any]] = dict,
) -> None:
    """Print an answer in a sentence, its tables, and of the notes the `first_notes`.

    Args:
        sentence, body, notes: the answer, its tables and what else to know, for readers.
        options: of the command; ``--detail`` prints all notes, ``--json`` JSON instead.
        more: whether the tables have more in detail.
        data: gives the tables and numbers of the answer, for JSON.
    """
    notes, detail = list(dict.fromkeys(notes)), options.detail
    if getattr(options, "json", None):
        print_json(options, {"answer": sentence, **data(), "notes": notes})
        return
    kept = first_notes(notes, detail)
    more = len(kept) < len(notes) or (more and not detail)
    lines = [sentence, str(body), *kept, *([MORE] if more else [])]
    print("\n".join(filter(None, lines)))


def print_json(options: argparse.Namespace, answer: Mapping[str, Any]) -> None:
    """Print an answer as JSON: SI units, null for what is no finite number.

    Keys of tables end with the unit; values have the origin that they have in `base.origins`.
    """
    text = json.dumps(_plain(answer), indent=1, ensure_ascii=False, allow_nan=False)
    print(text, file=options.json)


def _plain(value: Any) -> Any:
    if hasattr(value, "records"):  # a table
        return [_plain(row) for row in value.records()]
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):  # of numpy
        return _plain(value.tolist())
    if isinstance(value, list | tuple | range):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, int | str | None) else str(value)


def given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Values of those options that were given, by name."""
    values = {name: getattr(options, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def numbers_by_name(
    entries: Iterable[str], form: str, unit: str | Mapping[str, str] = ""
) -> dict[str, float]:
    """Numbers of a repeatable option such as ``--weight JOINT=X`` by name, in SI units.

    Raises:
        JointplayError: an entry without a number, or a number of another unit; or a name that is
            none of those whose units are given.
    """
    of = "" if isinstance(unit, str) else f" with one of {', '.join(unit)}"
    numbers = {}
    for text in entries:
        name, value = name_and_number(text)
        its_unit = unit if isinstance(unit, str) else unit.get(name)
        if value is None or its_unit is None:
            raise misread(text, f"{form}{of}")
        numbers[name] = quantity(value, its_unit, f"{form.partition(' ')[0]} {name}")
    return numbers


def vector(text: str, unit: str, option: str) -> tuple[float, float, float]:
    """Three numbers in SI units of text such as ``0,0,0.24``; errors name the option."""
    parts = text.split(",")
    if len(parts) != 3:
        raise JointplayError(f"{option} must be three numbers x,y,z [{unit}], got {text!r}")
    x, y, z = (quantity(part.strip(), unit, option) for part in parts)
    return x, y, z


class Outputs:
    """The files that a command writes into the folder of ``--out``; without the option, none.

    Raises:
        JointplayError: the folder holds one of them, known before anything slow is loaded.
    """

    def __init__(self, folder: str | None, names: Iterable[str]) -> None:
        self.folder, self.names = folder, list(names)
        if folder:
            files.refuse_present(folder, self.names)

    def claim(self) -> Path | None:
        """Make the folder, sure that the files can be written there (`files.claim`)."""
        return files.claim(self.folder, self.names) if self.folder else None

    def write(self, contents: Mapping[str, Any], further: str = "") -> None:
        """Write texts, bytes and figures by name, each whole or not at all, and print their names.

        `further` is what else the line says.
        """
        assert self.folder is not None
        for name, content in contents.items():
            put = files.write if isinstance(content, str | bytes) else files.picture
            put(Path(self.folder) / name, content)
        print(f"written to {self.folder}: {', '.join(contents)}{further}")


def write_preset(path: str, preset: Any) -> None:
    """Write a preset of one's own, and say how to use it."""
    files.write(Path(path), preset.text)
    print(f"written: {path}; every command takes it as --preset {path}")


def write_robot(path: str, text: str, meshes: Mapping[str, bytes], words: str) -> None:
    """Write a robot's file, and beside it its meshes; and say so."""
    from jointplay.model.meshes import FOLDER

    folder = Path(path).parent / FOLDER
    files.write(Path(path), text)
    if meshes:
        folder.mkdir(exist_ok=True)
    for name, content in meshes.items():
        files.write(folder / name, content, overwrite=True)
    print(f"written: {path}{words}")
