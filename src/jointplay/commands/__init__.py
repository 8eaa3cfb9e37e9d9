"""Commands of the command line, one module each.

A module has `add`, which adds its parser, and `run`, which does the work and returns the exit
status. To keep `jointplay --help` quick, modules import what they need inside `run`.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
from collections.abc import Collection
from contextlib import suppress
from typing import Any

MODULES = (
    "scara",
    "run",
    "init",
    "check",
    "schema",
    "play",
    "report",
    "export",
    "robots",
    "urdf",
    "wear",
    "dynamics",
    "budget",
    "allocate",
    "reduce",
    "iso9283",
    "maintenance",
    "identify",
    "shares",
    "sweep",
    "plot_sweep",
    "uncertainty",
)
"""Modules with a command of their own, in the order of the help."""


def add_trust(parser: Any) -> None:
    """Add the option of commands that read files which may name a law of the user's own."""
    parser.add_argument(
        "--trust",
        action="append",
        default=[],
        metavar="MODULE",
        help="import laws from this module, should the file name any (repeatable; by default a "
        "result imports none, a scenario those beside it)",
    )


def add_quiet(parser: Any) -> None:
    """Add the option of commands that show a bar."""
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def add_case(parser: Any) -> None:
    """Add the option of commands that take one case of a scenario."""
    parser.add_argument("--case", help="case of the scenario; may be left out if there is one")


def add_jobs(parser: Any) -> None:
    """Add the option of commands that work on several cores."""
    parser.add_argument("--jobs", type=int, metavar="N", help="processes (default: one per core)")


def add_unphysical(parser: Any) -> None:
    """Add the option of commands that read a URDF."""
    parser.add_argument(
        "--allow-unphysical",
        action="extend",
        type=listed,
        default=[],
        metavar="LINK,...",
        help="accept these links' inertia although no rigid body has it (repeatable)",
    )


def name_and_value(text: str, names: Collection[str] = ()) -> tuple[str, str | None]:
    """Name and number of ``NAME=NUMBER``; None if there is no number.

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
    if equals and (name in names or re.match(r"\s*[+-]?\.?\d", value)):
        return name, value
    return text, None


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
