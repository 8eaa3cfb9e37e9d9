"""Parsing of ``NAME=VALUE``, the form of many options; a name may be in double quotes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from typing import Any

from jointplay.base.errors import JointplayError
from jointplay.base.units import ask_unit, convert, plain_number

ALL = "all"
"""Word in place of a name that stands for all joints."""
_KEY = re.compile(r"""(?:"(?:[^"\\]|\\.)*"|'[^']*'|[^="'])*""")
_QUOTED = re.compile(r'("(?:[^"\\]|\\.)*")(?:=(.*))?')


def divided(text: str) -> tuple[str, str | None]:
    """Split ``KEY=VALUE`` into key and value at the first ``=`` outside quotes.

    The value is None if there is none.
    """
    opening = _KEY.match(text)
    end = 0 if opening is None else opening.end()
    if text[end : end + 1] != "=":  # a quote that is not closed
        end = text.find("=")
    return (text[:end], text[end + 1 :]) if end >= 0 else (text, None)


def name_and_number(
    text: str, names: Collection[str] = (), is_number: Callable[[str], object] | None = None
) -> tuple[str, str | None]:
    """Split ``NAME=NUMBER`` into name and number; the number is None if there is none.

    Names may contain ``=``: the number comes after the last one. A name that would be mistaken
    needs quotes.

    Args:
        text: the text.
        names: known names, which are recognised as such.
        is_number: true for further texts that count as numbers.
    """
    if text in names:
        return text, None
    if quoted := _QUOTED.fullmatch(text):
        with suppress(ValueError):
            return str(json.loads(quoted[1])), quoted[2]
    name, equals, value = text.rpartition("=")
    numeric = re.match(r"\s*[+-]?\.?\d", value) or (is_number is not None and is_number(value))
    return (name, value) if equals and (name in names or numeric) else (text, None)


def number(text: str) -> Any:
    """Read a number; return other text, such as one with a unit, for the scenario to read."""
    with suppress(ValueError):
        value = plain_number(text)
        return int(text) if text.strip().lstrip("+-").isdecimal() else value
    return text


def quantity(text: str, unit: str, option: str = "") -> float:
    """Read text such as ``0.1 mm`` as a number in SI units; errors name the option."""
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


def length_or_angle(text: str, option: str) -> tuple[float, bool]:
    """Read a length [m] or an angle [rad]; returns the number and whether it is an angle."""
    try:
        return quantity(text, "m", option), False
    except JointplayError as error:
        with suppress(JointplayError):
            return quantity(text, "rad"), True
        raise error from None


def numbers_by_name(
    entries: Iterable[str], form: str, unit: str | Mapping[str, str] = ""
) -> dict[str, float]:
    """Read a repeatable option such as ``--weight JOINT=X``: numbers by name, in SI units.

    Args:
        entries: the texts.
        form: the option and its form, for errors.
        unit: SI unit of the numbers, or the unit by name where only these names are allowed.

    Raises:
        JointplayError: an entry without a number, a number in another unit, or a name that is not
            allowed.
    """
    choices = "" if isinstance(unit, str) else f" with one of {', '.join(unit)}"
    numbers = {}
    for text in entries:
        name, value = name_and_number(text)
        its_unit = unit if isinstance(unit, str) else unit.get(name)
        if value is None or its_unit is None:
            raise misread(text, f"{form}{choices}")
        numbers[name] = quantity(value, its_unit, f"{form.partition(' ')[0]} {name}")
    return numbers


def vector(text: str, unit: str, option: str) -> tuple[float, float, float]:
    """Read text such as ``0,0,0.24`` as three numbers in SI units; errors name the option."""
    parts = text.split(",")
    if len(parts) != 3:
        raise JointplayError(f"{option} must be three numbers x,y,z [{unit}], got {text!r}")
    x, y, z = (quantity(part.strip(), unit, option) for part in parts)
    return x, y, z


def pair(text: str, usage: str) -> tuple[str, str]:
    """Split ``NAME=VALUE`` at the first ``=`` outside quotes; neither side may be empty.

    `usage`: the option and its form, for the error.
    """
    name, value = divided(text)
    if not name.strip() or not (value or "").strip():
        raise misread(text, usage)
    return name.strip(), str(value).strip()


def pairs(texts: Iterable[str], usage: str) -> dict[str, str]:
    """Split several texts as `pair` does; values by name.

    Raises:
        JointplayError: a name appears twice.
    """
    values: dict[str, str] = {}
    for text in texts:
        name, value = pair(text, usage)
        if name in values:
            raise JointplayError(f"{usage.partition(' ')[0]} {name!r} appears twice")
        values[name] = value
    return values


def misread(text: str, usage: str) -> JointplayError:
    """Error for an option's text that has not the form in `usage`."""
    option, _, form = usage.partition(" ")
    return JointplayError(f"{option} must read {form}, got {text!r}")
