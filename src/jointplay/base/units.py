"""Quantities with units: reading ``"0.2 mm"``, and showing values in handy units.

Bare numbers are in SI units; text carries its unit.
"""

from __future__ import annotations

import math
import re
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pint

WORDS = {
    "": ("number", "0.1"),
    "m": ("length", "0.2 mm"),
    "rad": ("angle", "30 deg"),
    "s": ("time", "10 us"),
    "kg": ("mass", "1.5 kg"),
    "m/s": ("speed", "1 mm/s"),
    "rad/s": ("angular speed", "60 rpm"),
    "m/s^2": ("acceleration", "9.81 m/s^2"),
    "N": ("force", "5 N"),
    "N*m": ("torque", "2 N*m"),
    "Pa": ("pressure", "207 GPa"),
    "kg/m^3": ("density", "7800 kg/m^3"),
    "kg/m": ("mass per length", "2.5 kg/m"),
    "kg*m^2": ("moment of inertia", "1e-4 kg*m^2"),
    "N*m^2": ("bending or torsion stiffness of a beam", "5e4 N*m^2"),
    "N/m": ("stiffness", "1e8 N/m"),
    "N/m^1.5": ("Hertz stiffness", "1e11 N/m^1.5"),
    "N*m/rad": ("angular stiffness", "1e4 N*m/rad"),
    "N*s/m": ("damping", "100 N*s/m"),
    "N*m*s/rad": ("angular damping", "0.1 N*m*s/rad"),
    "Pa*s": ("viscosity", "0.1 Pa*s"),
    "1/m": ("bristle stiffness", "1e5 1/m"),
    "s/m": ("bristle damping", "10 s/m"),
    "K": ("temperature difference", "10 K"),
    "1/K": ("thermal expansion", "2.3e-5 1/K"),
    "V": ("voltage", "12 V"),
    "ohm": ("resistance", "2.7 ohm"),
    "N*m/A": ("torque constant", "1.2 N*m/A"),
    "V/rad": ("voltage per angle", "50 V/rad"),
    "V*s/rad": ("voltage per angular speed", "0.1 V*s/rad"),
    "N/A": ("force constant", "50 N/A"),
    "V/m": ("voltage per length", "2e4 V/m"),
    "V*s/m": ("voltage per speed", "50 V*s/m"),
    "m^3/(N*m)": ("specific wear rate", "1e-5 mm^3/(N*m)"),
}
"""SI units of the package: the quantity that each measures, and an example for messages."""

_DEGREE = 0.017453292519943295
COMMON = {unit: (unit, 1.0) for unit in WORDS if unit} | {
    "mm": ("m", 1e-3), "cm": ("m", 1e-2), "um": ("m", 1e-6), "µm": ("m", 1e-6),
    "mrad": ("rad", 1e-3), "deg": ("rad", _DEGREE), "rpm": ("rad/s", 0.10471975511965977),
    "ms": ("s", 1e-3), "us": ("s", 1e-6), "µs": ("s", 1e-6), "g": ("kg", 1e-3),
    "mm/s": ("m/s", 1e-3), "kN": ("N", 1e3), "MPa": ("Pa", 1e6), "GPa": ("Pa", 1e9),
}  # fmt: skip
"""Common units: the unit of `WORDS` that each belongs to, and its size in it. They spare the import
of pint, which knows all units and takes long; a test compares the two."""

_DOUBTED = {
    "m": (5.0, math.inf, "mm"),
    "m/s": (10.0, math.inf, "mm/s"),
    "Pa": (1e-9, 1e5, "GPa"),
}
"""Range of magnitudes in which a number without a unit is implausible in this unit, and the unit
that may have been meant: no part of a machine is so long or fast, no material so soft (judged)."""

_LARGEST = 10**300
"""Largest whole number that is converted to a float."""

_LONGEST_UNIT = 60
"""Most characters of a unit (judged)."""
_NO_UNIT = re.compile(r"\d{3}|\d\s*(\*\*|\^)|[^\w\s*/^().·°%Å-]|\n")
"""Text that no unit contains: a power of a power would keep the parser busy for ever, and pint
drops what follows a sign that it does not know, so that ``mm ; 1`` would be mm."""

_LONGEST_SHOWN, _MOST_SHOWN = 100, 20
"""Longest text, and most items of a list, that a message repeats."""

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
"""A number as all programs understand it. Python's `float` accepts more, such as ``4_35`` or digits
of other scripts."""
_NO_NUMBER = re.compile(r"[+-]?(nan|inf(inity)?)", re.ASCII | re.IGNORECASE)
_QUANTITY = re.compile(rf"\s*(?P<number>{NUMBER.pattern})\s*(?P<unit>.*?)\s*")

_DEGREES = (10.0, 360.0)
"""Range in which a whole number is probably degrees, not radians: a full turn has 6.28 radians."""

_RPM = 1000.0
"""Whole number from which on it is probably rpm, not rad/s, which would be 9549 rpm (judged)."""


class Measured(float):
    """A value in SI that remembers in which of several possible units it was given."""

    unit: str
    """SI unit, or empty for a bare number."""
    text: str
    """Text in the file."""

    def __new__(cls, value: float, unit: str, text: str) -> Measured:
        self = super().__new__(cls, value)
        self.unit, self.text = unit, text
        return self


def expected(*units: str) -> str:
    """Describe a quantity in one of `units` with an example: ``a length such as "0.2 mm"``."""
    parts = []
    for unit in units:
        word, example = WORDS.get(unit, (f"quantity in {unit}", f"1 {unit}"))
        shown = f'"{example}"' if unit else example
        parts.append(f"{_with_article(word)} such as {shown}")
    return " or ".join(parts)


def convert(value: Any, *units: str) -> Measured:
    """Convert a bare number, or text such as ``"0.2 mm"``, to SI.

    Decimal prefixes are exact: ``"0.2 mm"`` becomes the number nearest to 0.0002.

    Args:
        value: number or text.
        units: SI units, such as the keys of `WORDS`, one of which must fit; ``""`` for pure
            numbers.

    Raises:
        ValueError: the value does not fit; one line that names it and what was expected.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        if (isinstance(value, int) and abs(value) > _LARGEST) or not math.isfinite(value):
            raise ValueError(f"{toml_text(value)} is not finite; expected {expected(*units)}")
        return Measured(float(value), "", str(value))
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        raise ValueError(f"{toml_text(value)} is not {named(*units)}; expected {expected(*units)}")
    number, text = match["number"], match["unit"]
    usual, factor = COMMON.get(text, ("", 1.0))
    if usual in units and usual:
        return _measured(value, number, factor, usual, units)
    try:
        if len(text) > _LONGEST_UNIT or _NO_UNIT.search(text):
            raise ValueError(text)
        unit = unit_of(text)
    except ValueError:
        raise ValueError(
            f'unknown unit "{text}" in {toml_text(value)}; expected {expected(*units)}'
        ) from None
    for goal in units:
        if fits(unit, goal) and not (goal and not text):
            return _measured(value, number, unit.factor / unit_of(goal).factor, goal, units)
    missing = " without a unit" if not text else ""
    raise ValueError(
        f"{toml_text(value)}{missing} is not {named(*units)}; expected {expected(*units)}"
    )


_TITLE = re.compile(r"^(.*?)\s*(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\))\s*$")


def titled(title: str) -> tuple[str, str]:
    """Split a column title such as ``tool x [mm]`` or ``tool x (mm)`` into name and unit.

    The unit is empty if there is none.
    """
    match = _TITLE.match(title)
    return (match[1].strip(), (match[2] or match[3] or "").strip()) if match else (title, "")


def plain_number(text: str) -> float:
    """Read a number without a unit, `nan` and `inf` included.

    Raises:
        ValueError: the text is no number, or one too small for a float.
    """
    text = text.strip()
    if not (NUMBER.fullmatch(text) or _NO_NUMBER.fullmatch(text)):
        raise ValueError(f"{toml_text(text)} is not a number")
    return not_lost(text)


def not_lost(text: str) -> float:
    """Read a number as Python does, but refuse one that would underflow to 0.

    Raises:
        ValueError: the text is no number, or one too small for a float.
    """
    value = float(text)
    if value == 0.0 and re.search("[1-9]", text.lower().partition("e")[0]):
        raise ValueError(f"{text} is too small: the smallest number is 5e-324")
    return value


def ask_unit(value: float, unit: str) -> None:
    """Raise for a number without a unit that looks like degrees or rpm, but would be in `unit`.

    Raises:
        ValueError: a question which of the two is meant.
    """
    integral = float(value).is_integer()
    if unit == "rad/s" and integral and abs(value) >= _RPM:
        raise ValueError(
            f"{value:g} without a unit would be rad/s, {value * 30.0 / math.pi:.3g} rpm: "
            f'rpm? write "{value:g} rpm", or "{value:g} rad/s" if that is meant'
        )
    if unit == "rad" and integral and _DEGREES[0] <= abs(value) <= _DEGREES[1]:
        raise ValueError(
            f"{value:g} without a unit would be radians, {abs(value) / math.tau:.3g} turns: "
            f'degrees? write "{value:g} deg", or "{value:g} rad" if that is meant'
        )


def ask_scale(value: float, unit: str) -> None:
    """Raise for a number without a unit whose size is implausible for a machine in that unit.

    Raises:
        ValueError: a question which unit is meant.
    """
    least, most, usual = _DOUBTED.get(unit, (math.inf, 0.0, ""))
    if least <= abs(value) <= most:
        raise ValueError(
            f'{value:g} without a unit would be {unit}: {usual}? write "{value:g} {usual}", or '
            f'"{value:g} {unit}" if that is meant'
        )


def _measured(
    value: str, number: str, factor: float, goal: str, units: tuple[str, ...]
) -> Measured:
    """Multiply a number by its unit's size; raise on overflow, and on underflow to 0."""
    measured = exact(number, factor)
    if not math.isfinite(measured):
        raise ValueError(f"{toml_text(value)} is not finite; expected {expected(*units)}")
    if measured == 0.0 and Decimal(number) != 0:
        raise ValueError(f"{toml_text(value)} is too small; expected {expected(*units)}")
    return Measured(measured, goal, value)


def toml_text(value: Any) -> str:
    """Write a value as TOML does, shortened for messages."""
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= _LONGEST_SHOWN else f'"{value[:40]}..."'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        most = [toml_text(item) for item in value[:_MOST_SHOWN]]
        return f"[{', '.join([*most, '...'] if len(value) > _MOST_SHOWN else most)}]"
    if isinstance(value, int) and abs(value) > _LARGEST:
        return "a whole number of very many digits"
    return str(value)


def _with_article(word: str) -> str:
    return f"{'an' if word[0] in 'aeiou' else 'a'} {word}"


def named(*units: str) -> str:
    """Name the quantities that `units` measure: ``a length``, ``an angle or a length``."""
    nouns = [WORDS.get(unit, (f"quantity in {unit}",))[0] for unit in units]
    return " or ".join(map(_with_article, nouns))


class _Unit:
    """A unit of pint: its size in base units, its dimensions, and its power of the radian."""

    def __init__(self, unit: pint.Unit) -> None:
        root = _registry().Quantity(1.0, unit).to_root_units()
        self.factor = float(root.magnitude)
        self.dimensions = dict(root.dimensionality)
        self.turns = dict(root.unit_items()).get("radian", 0)


_NO_TURNS = ("", "rad", "m", "s", "kg", "m/s", "m/s^2", "N", "Pa", "kg/m^3", "V", "ohm")
"""Units in which the power of the radian must match: ``5 deg mm`` is no length."""


def fits(unit: _Unit, goal: str) -> bool:
    """Whether values in `unit` can be converted to `goal`."""
    # The radian has no dimension, so an angle would pass for a number, and a number for an angle.
    # Where both are common (N m per radian, 1/s), either is accepted.
    wanted = unit_of(goal)
    return unit.dimensions == wanted.dimensions and (
        goal not in _NO_TURNS or unit.turns == wanted.turns
    )


def exact(number: str, factor: float) -> float:
    """Product number * factor, correctly rounded if the factor is a power of ten."""
    try:
        power = round(math.log10(factor))
        if math.isclose(factor, 10.0**power, rel_tol=1e-12):
            return float(Decimal(number).scaleb(power))
        return float(number) * factor
    except (ArithmeticError, ValueError):  # beyond the range of numbers
        return math.inf


@cache
def unit_of(text: str) -> _Unit:
    """Look a unit up.

    Raises:
        ValueError: pint does not know it.
    """
    inverse = text.startswith("/")
    try:
        return _Unit(_registry().parse_units(f"1{text}" if inverse else text))
    except Exception as error:  # noqa: BLE001 - pint's parser raises whatever Python's own does
        raise ValueError(str(error)) from None


@cache
def _registry() -> pint.UnitRegistry[float]:
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(on_redefinition="ignore")
    # Pint's hertz is 1/s: a natural frequency of 1 Hz would be taken for 1 rad/s.
    registry.define("hertz = revolution / second = Hz")
    return registry


_DISPLAY = {
    "m": (1e3, "mm"),
    "rad": (1e3, "mrad"),
    "rad/m": (1e3, "mrad/m"),
    "rad/rad": (1e3, "mrad/rad"),
    "rad/(N*m)": (1e3, "mrad/(N*m)"),
    "m/N": (1e3, "mm/N"),
}
"""Factor and unit in which results are shown, by SI unit; other units are shown unchanged."""

_FINE = {
    "m": (1e6, "µm"),
    "rad/(N*m)": (1e6, "µrad/(N*m)"),
    "m/N": (1e6, "µm/N"),
    "m/s": (1e3, "mm/s"),
    "rad/s": (1e3, "mrad/s"),
    "s": (1e3, "ms"),
    "J": (1e6, "µJ"),
    "W": (1e3, "mW"),
}
"""Factor and unit for quantities as small as clearances, and what goes with them."""

_PREFIXED = {
    "m": ((1e-9, "nm"), (1e-6, "µm"), (1e-3, "mm"), (1.0, "m")),
    "s": ((1e-6, "µs"), (1e-3, "ms"), (1.0, "s")),
    "Pa": ((1.0, "Pa"), (1e6, "MPa"), (1e9, "GPa")),
    "J": ((1e-9, "nJ"), (1e-6, "µJ"), (1e-3, "mJ"), (1.0, "J")),
    "W": ((1e-9, "nW"), (1e-6, "µW"), (1e-3, "mW"), (1.0, "W")),
}
"""Sizes and names of units with prefixes, the smallest first."""


def displayed(unit: str, fine: bool = False) -> tuple[float, str]:
    """Factor from an SI `unit` to the unit in which results are shown, and that unit.

    `fine` selects the unit for sizes such as clearances.
    """
    factor, word = (_FINE if fine and unit in _FINE else _DISPLAY).get(unit, (1.0, unit))
    return factor, typeset(word)


def typeset(unit: str) -> str:
    """Typeset a unit: N m/s² for ``N*m/s^2``."""
    return unit.replace("^2", "²").replace("^3", "³").replace("*", " ")


def rounded(value: float, unit: str, digits: int = 4, fine: bool = False) -> str:
    """Format an SI value, rounded, in the unit in which results are shown (`displayed`)."""
    factor, word = displayed(unit, fine)
    return f"{float(f'{factor * value:.{digits}g}'):g} {word}".rstrip()


def handy(size: float, unit: str) -> tuple[float, str]:
    """Choose the prefixed unit in which a size [SI] is easy to read: its size and name."""
    best = (1.0, unit)
    if size != 0.0:
        for factor, name in _PREFIXED.get(unit, ()):
            # Tenths of millimetres are millimetres to an engineer.
            if abs(size) >= (0.01 * factor if name == "mm" else factor) * (1 - 1e-12):
                best = factor, name
    return best[0], typeset(best[1])


def readable(value: float, unit: str, digits: int = 6) -> str:
    """Format an SI value, rounded, with a handy prefix: 0.0002 m is ``0.2 mm``.

    An angle is given in degrees, mrad or rad, whichever is the shortest.
    """
    value = float(f"{value:.{digits}g}")
    if unit == "rad" and value != 0.0:
        sizes = ((_DEGREE, "deg"), (1e-3, "mrad"), (1.0, "rad"))
        return min((f"{value / size:.6g} {name}" for size, name in sizes), key=len)
    size, name = handy(value, unit)
    return f"{value / size:.6g} {name}".rstrip()


def round_below(value: float) -> float:
    """Largest of 1, 2 and 5 times a power of ten that is at most `value` > 0."""
    power = 10.0 ** math.floor(math.log10(value * (1.0 + 1e-9)))
    return float(f"{max(n for n in (1, 2, 5) if n * power <= value * (1.0 + 1e-9)) * power:.3g}")
