"""Commands of the command line, one module each, and what they have in common.

A module has `add`, which adds its parser, and `run`, which does the work and returns the exit
status. To keep `jointplay --help` quick, modules import what they need inside `run`.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from jointplay.base import files
from jointplay.base.errors import JointplayError

MODULES = (
    *("scara", "run", "init", "check", "schema", "play", "live", "compare", "report", "export"),
    *("robots", "presets", "urdf"),
    *("wear", "dynamics", "budget", "allocate", "reduce", "iso9283", "maintenance", "identify"),
    "calibrate",
    *("shares", "sweep", "plot_sweep", "uncertainty"),
)
"""Modules with a command of their own, in the order of the help."""

UNITS = {"LENGTH": "m", "MASS": "kg", "TIME": "s", "ANGLE": "rad", "FORCE": "N", "MU": ""}
"""SI units of options' values, by what stands for them in the help; text has a unit of its own."""

NUMBERS = {"N": int, "RUNS": int, "X": float, "P": float, "PERCENT": float, "T": float}
"""Types of values without a unit, likewise."""


def add_option(parser: Any, words: str, text: str, default: Any = None, **more: Any) -> None:
    """Add an option that takes a value; its help ends with the unit and the default.

    Args:
        parser: or a group of its options.
        words: its name and what stands for the value in the help, ``--target LENGTH``; the latter
            also says how the value is read: in the unit of `UNITS`, as a number of `NUMBERS`,
            or else as text.
        text: the help.
        default: value if it is not given.
        more: of `argparse.ArgumentParser.add_argument`.
    """
    name, _, metavar = words.partition(" ")
    if metavar in UNITS:
        before, mark, default_words = text.partition(" (default")
        unit = f" [{UNITS[metavar]}]" if UNITS[metavar] else ""
        text = f"{before}{unit}{mark}{default_words}"
        more.setdefault("type", in_unit(UNITS[metavar]))
    elif metavar in NUMBERS:
        more.setdefault("type", NUMBERS[metavar])
    if default is not None:
        shown = f"{default:g}" if isinstance(default, float | int) else default
        text += f" (default {shown})"
    parser.add_argument(name, metavar=metavar or None, help=text, default=default, **more)


def add_repeatable(parser: Any, words: str, text: str, **more: Any) -> None:
    """Add an option that may be given several times; its value is a list."""
    name, _, metavar = words.partition(" ")
    options = {"action": "append", "default": []} | more
    text += " (repeatable)"
    parser.add_argument(name, metavar=metavar or None, help=text, **options)


def add_switch(parser: Any, name: str, text: str) -> None:
    """Add an option without a value."""
    parser.add_argument(name, action="store_true", help=text)


def add_shared(parser: Any, *names: str) -> None:
    """Add some of the options that several commands have."""
    for name in names:
        parser.add_argument(name, **_SHARED[name])


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
    from jointplay.base.units import ask_degrees, convert, plain_number

    try:
        value: float | str = plain_number(text)
    except ValueError:
        value = text
    try:
        if unit == "rad" and isinstance(value, float):
            ask_degrees(value)
        return float(convert(value, unit))
    except ValueError as error:
        raise JointplayError(f"{option}: {error}" if option else str(error)) from None


def given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Values of those options that were given, by name."""
    values = {name: getattr(options, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def name_and_value(
    text: str, names: Collection[str] = (), is_value: Callable[[str], Any] | None = None
) -> tuple[str, str | None]:
    """Name and number of ``NAME=NUMBER``; None if there is no number.

    What `is_value` is true for counts as one, too.

    Names may have signs of equality of their own: the number comes after the last one. A name that
    would be mistaken may stand in double quotes.
    """
    quoted = re.fullmatch(r'("(?:[^"\\]|\\.)*")(?:=(.*))?', text)
    if text in names:
        return text, None
    if quoted:
        with suppress(ValueError):
            return str(json.loads(quoted[1])), quoted[2]
    name, equals, value = text.rpartition("=")
    given = re.match(r"\s*[+-]?\.?\d", value) or (is_value is not None and is_value(value))
    if equals and (name in names or given):
        return name, value
    return text, None


def numbers_by_name(entries: Iterable[str], words: str, unit: str = "") -> dict[str, float]:
    """Numbers of a repeatable option such as ``--weight JOINT=X`` by name, in SI units.

    Raises:
        JointplayError: an entry without a number, or a number of another unit.
    """
    option, _, form = words.partition(" ")
    numbers = {}
    for text in entries:
        name, value = name_and_value(text)
        if value is None:
            raise JointplayError(f"{option} must read {form}, got {text!r}")
        numbers[name] = quantity(value, unit, f"{option} {name}")
    return numbers


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


class Outputs:
    """The files that a command writes into the folder of ``--out``; without the option, none."""

    def __init__(self, folder: str | None, names: Iterable[str]) -> None:
        """Refuse a folder that holds one of the files, before anything slow is loaded.

        Raises:
            JointplayError: it does.
        """
        self.folder, self.names = folder, list(names)
        if folder:
            files.refuse_present(folder, self.names)

    def claim(self) -> Path | None:
        """Make the folder, sure that the files can be written there; None without ``--out``.

        Raises:
            JointplayError: see `files.claim`.
        """
        return files.claim(self.folder, self.names) if self.folder else None

    def write(self, contents: Mapping[str, Any], further: str = "") -> None:
        """Write texts and figures by name, each whole or not at all, and print their names.

        `further` is what else the line says.
        """
        assert self.folder is not None
        for name, content in contents.items():
            put = files.write if isinstance(content, str) else files.picture
            put(Path(self.folder) / name, content)
        print(f"written to {self.folder}: {', '.join(contents)}{further}")


_SHARED: dict[str, dict[str, Any]] = {
    "--case": {"help": "case of the scenario (not needed if there is only one)"},
    "--jobs": {"type": int, "metavar": "N", "help": "processes (default: one per core)"},
    "--quiet": {"action": "store_true", "help": "do not show progress"},
    "--trust": {
        "action": "append",
        "default": [],
        "metavar": "MODULE",
        "help": "allow laws to be imported from this module (repeatable; by default a result "
        "imports no module, a scenario only those in its own folder)",
    },
    "--allow-unphysical": {
        "action": "extend",
        "type": listed,
        "default": [],
        "metavar": "LINK,...",
        "help": "accept these links' inertias although they are physically impossible, or all "
        "(repeatable)",
    },
    "--fix": {
        "action": "extend",
        "type": listed,
        "default": [],
        "metavar": "JOINT,...",
        "help": "hold these joints, at zero or the limit nearest to it; those that mimic them are "
        "held, too (repeatable)",
    },
}
"""Options that several commands have."""
