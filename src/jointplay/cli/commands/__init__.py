"""Commands of the command line, one module each, and what they have in common.

A module's docstring is the command's help, from which `cli` makes its parser: the summary, the
description, the epilog, and its options as they are typed, each with its explanation. `run` does
the work and returns the exit status; what takes long to import is imported there.

    --runs N  perturbed runs of each variant (default 3)
    --verify [RUNS=3]  the number may be left out, and is 3 then
    --set KEY=VALUE ...  may be given several times
    --encoder {motor,link}  takes one of these words
    --quiet  has no value

What stands for the value says how it is read (`UNITS`, `TYPES`), and ``(default 3)`` what it is if
the option is not given. ``FILE | ROBOT`` stands for the inputs of `inputs`, of the groups behind
it, or all. Options under the title of a group are only in ``--help all``.
"""

import argparse
import csv
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import misread, name_and_number

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

UNITS = {"LENGTH": "m", "MASS": "kg", "TIME": "s", "ANGLE": "rad", "FORCE": "N", "MU": ""}
"""SI units of options' values, by what stands for them in the help; text has a unit of its own."""


def listed(text: str) -> list[str]:
    """Names of an option that takes several, joined by commas; one with commas in double quotes.

    Raises:
        ArgumentTypeError: a quote that is not closed.
    """
    parts = re.sub(r'(^|,|")\s+(?=$|,|")', r"\1", text)  # blanks around quotes
    try:
        names = next(csv.reader([parts], skipinitialspace=True, strict=True), [])
    except csv.Error as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}") from None
    return [name.strip() for name in names if name.strip()]


TYPES: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("N", "RUNS"), int),
    **dict.fromkeys(("X", "P", "PERCENT", "T"), float),
    **dict.fromkeys(("LIST", "LINK,...", "JOINT,..."), listed),
}
"""How other values are read, likewise; what is in neither is text."""

SHARED = {
    "--case": "--case NAME  case of the scenario (not needed if there is only one)",
    "--jobs": "--jobs N  processes (default: one per core)",
    "--quiet": "--quiet  do not show progress",
    "--detail": "--detail  print everything that is known, not only the answer",
    "--import": "--import MODULE ...  import this module of your own, by name or file: a file that "
    "is read may name functions in it (none is imported otherwise)",
}
"""Options that several commands have; their help has only the name."""

Entry = tuple[str, str, str]
"""An option as it is typed, what is said of it, and the title of its group."""

PLACE = "FILE | ROBOT"


def read_help(text: str) -> tuple[list[str], list[Entry]]:
    """Paragraphs of a command's help, and its options."""
    prose, entries, group = [""], list[list[str]](), ""
    for line in text.splitlines():
        if line.startswith("     "):
            entries[-1][1] += f" {line.strip()}"
        elif line.startswith("    "):
            words, _, about = SHARED.get(line.strip(), line.strip()).partition("  ")
            entries.append([words, about, group])
        elif line.startswith("  "):
            group = line.strip().rstrip(":")
        elif line:
            prose[-1] += f"{line} "
        elif prose[-1]:
            prose.append("")
    return [" ".join(one.split()) for one in prose if one], [(a, b, c) for a, b, c in entries]


MOST_NOTES = 3
"""Lines about what was chosen and assumed that are printed without ``--detail``."""
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
    sentence: str, body: object, notes: Iterable[str], detail: bool, more: bool = False
) -> None:
    """Print an answer in a sentence, its tables, and of the notes the `first_notes`.

    `more`: whether the tables have more in detail.
    """
    notes = list(dict.fromkeys(notes))
    kept = first_notes(notes, detail)
    more = len(kept) < len(notes) or (more and not detail)
    lines = [sentence, str(body), *kept, *([MORE] if more else [])]
    print("\n".join(filter(None, lines)))


def in_unit(unit: str) -> Callable[[str], float]:
    """What reads an option's value: a number in SI units, or text such as ``0.1 mm``."""

    def read(text: str) -> float:
        try:
            return quantity(text, unit)
        except JointplayError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read


def quantity(text: str, unit: str, option: str = "") -> float:
    """A number in SI units of text such as ``0.1 mm``; errors name the option."""
    from jointplay.base.units import ask_unit, convert, plain_number

    try:
        value: float | str = plain_number(text)
    except ValueError:
        value = text
    try:
        if isinstance(value, float):
            ask_unit(value, unit)
        return float(convert(value, unit))
    except ValueError as error:
        raise JointplayError(f"{option}: {error}" if option else str(error)) from None


def given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Values of those options that were given, by name."""
    values = {name: getattr(options, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def numbers_by_name(
    entries: Iterable[str], words: str, unit: str | Mapping[str, str] = ""
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
        own = unit if isinstance(unit, str) else unit.get(name)
        if value is None or own is None:
            raise misread(text, f"{words}{of}")
        numbers[name] = quantity(value, own, f"{words.partition(' ')[0]} {name}")
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
