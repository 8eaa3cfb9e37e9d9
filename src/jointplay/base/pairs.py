"""Texts that read ``NAME=VALUE``, as options of commands do; a name may stand in double quotes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from typing import Any

from jointplay.base.errors import JointplayError

ALL = "all"
"""Stands for all joints in the place of a name."""
_KEY = re.compile(r"""(?:"(?:[^"\\]|\\.)*"|'[^']*'|[^="'])*""")
_QUOTED = re.compile(r'("(?:[^"\\]|\\.)*")(?:=(.*))?')


def divided(text: str) -> tuple[str, str | None]:
    """Key and value of ``KEY=VALUE``; what is quoted in the key may have such a sign.

    The value is None if there is no sign.
    """
    opening = _KEY.match(text)
    end = 0 if opening is None else opening.end()
    if text[end : end + 1] != "=":  # a quote that is not closed
        end = text.find("=")
    return (text[:end], text[end + 1 :]) if end >= 0 else (text, None)


def name_and_number(
    text: str, names: Collection[str] = (), is_number: Callable[[str], object] | None = None
) -> tuple[str, str | None]:
    """Name and number of ``NAME=NUMBER``; None if there is no number.

    What `is_number` is true for counts as one, too. Names may have signs of equality of their own:
    the number comes after the last one. One that would be mistaken needs quotes.
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
    """A number, or text with its unit, which the scenario reads or refuses."""
    from jointplay.base.units import plain_number

    with suppress(ValueError):
        value = plain_number(text)
        return int(text) if text.strip().lstrip("+-").isdecimal() else value
    return text


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


def length_or_angle(text: str, option: str) -> tuple[float, bool]:
    """A number in m, or in rad, of text with either unit, and whether it is an angle."""
    try:
        return quantity(text, "m", option), False
    except JointplayError as error:
        with suppress(JointplayError):
            return quantity(text, "rad"), True
        raise error from None


def numbers_by_name(
    entries: Iterable[str], form: str, unit: str | Mapping[str, str] = ""
) -> dict[str, float]:
    """Numbers of a repeatable option such as ``--weight JOINT=X`` by name, in SI units.

    Raises:
        JointplayError: an entry without a number, or a number of another unit; or a name that is
            none of those whose units are given.
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
    """Three numbers in SI units of text such as ``0,0,0.24``; errors name the option."""
    parts = text.split(",")
    if len(parts) != 3:
        raise JointplayError(f"{option} must be three numbers x,y,z [{unit}], got {text!r}")
    x, y, z = (quantity(part.strip(), unit, option) for part in parts)
    return x, y, z


def pair(text: str, usage: str) -> tuple[str, str]:
    """Both sides of ``NAME=VALUE``, neither empty: of the first sign that is not in quotes.

    `usage` are the option and how it must read, for the error.
    """
    name, value = divided(text)
    if not name.strip() or not (value or "").strip():
        raise misread(text, usage)
    return name.strip(), str(value).strip()


def pairs(texts: Iterable[str], usage: str) -> dict[str, str]:
    """What stands on both sides of each `pair`.

    Raises:
        JointplayError: a name that appears twice.
    """
    values: dict[str, str] = {}
    for text in texts:
        name, value = pair(text, usage)
        if name in values:
            raise JointplayError(f"{usage.partition(' ')[0]} {name!r} appears twice")
        values[name] = value
    return values


def misread(text: str, usage: str) -> JointplayError:
    """The error of an option's text that does not read as it must."""
    option, _, form = usage.partition(" ")
    return JointplayError(f"{option} must read {form}, got {text!r}")
