"""Limits and fits by ISO 286-1: from ``20H7/g6`` to the clearance between a hole and its shaft.

A tolerance class, such as H7, has a letter for the position of the tolerance (the fundamental
deviation) and a grade for its width. Tables and their sources are in ``data/fits.toml``; deviations
of holes follow from those of shafts by the standard's rules.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, NamedTuple, NoReturn

from jointplay.base.errors import JointplayError, closest
from jointplay.base.files import shipped_table
from jointplay.base.schema import known_keywords
from jointplay.base.units import plain_number

CLEARANCE, TRANSITION, INTERFERENCE = "clearance", "transition", "interference"
"""Kinds of fit."""

PREFERRED = (
    *("H6/g5", "H6/h5", "H7/f6", "H7/g6", "H7/h6", "H8/e7", "H8/f7", "H8/h7", "H8/d8", "H8/e8"),
    *("H8/f8", "H8/h8", "H9/d8", "H9/e8", "H9/f8", "H9/h8", "H10/b9", "H10/c9", "H10/d9"),
    *("H10/e9", "H10/h9", "H11/b11", "H11/c11", "H11/d10", "H11/h10"),
)
"""Clearance fits that the standard prefers in the hole-basis system (its table as copied in public
code, seen)."""

_LOOKS_FITTED = re.compile(
    r"\s*\d+(?:[.,]\d+)?\s*(?:mm)?\s*(?:[A-Za-z]{1,2}\s?\d{1,2}\s*(?:[/-].*|[A-Za-z].*)?|/\s*[a-z]{1,2}\d.*)",
    re.ASCII,
)
"""A number, letters and a number again, unlike any length."""
_FORM = re.compile(
    r"(\d+(?:[.,]\d+)?)(?:mm)?([A-Za-z]{1,2})(\d{1,2})([/-]?)(?:([A-Za-z]{1,2})(\d{1,2}))?",
    re.ASCII,
)
"""Size, letter and grade of the hole, slash, letter and grade of the shaft."""


tables = partial(shipped_table, __file__, "fits")
"""The content of ``data/fits.toml``, by section."""


@cache
def letters(hole: bool) -> tuple[str, ...]:
    """Letters of tolerance classes, of holes (capitals) or of shafts."""
    names = [*tables()["shafts"]]
    names[names.index("k") : names.index("k")] = ["js", "j"]
    return tuple(name.upper() if hole else name for name in names)


def tolerance(size: float, grade: int) -> float:
    """Standard tolerance IT of a grade for a nominal size [mm], in µm."""
    return _looked_up(size, tables()["grades"][str(grade)])


def _looked_up(size: float, row: list[float]) -> float:
    """The entry of a table's row for a nominal size [mm]."""
    sizes = tables()["sizes"]
    steps = sizes["steps"] if len(row) == len(sizes["steps"]) else sizes["fine_steps"]
    return float(row[bisect_left(steps, size)])


class Limits(NamedTuple):
    """Deviations from the nominal size [µm]."""

    lower: float
    upper: float


def limits(size: float, letter: str, grade: int) -> Limits:
    """Limit deviations of a hole (capital letter) or a shaft of a nominal size [mm].

    Raises:
        JointplayError: a size, letter or grade that the tables do not have, or not together.
    """
    hole = letter[:1].isupper()
    noun = "hole" if hole else "shaft"
    if letter not in letters(hole):
        near = closest(letter, letters(hole), 0.9)
        listed = ", ".join(letters(hole))
        raise JointplayError(f"no {noun} has the letter {letter!r}; {near}{noun}s: {listed}")
    if str(grade) not in (known := [*tables()["grades"]]):
        raise JointplayError(
            f"no grade {grade} (of {letter}{grade}); grades: {known[0]} to {known[-1]}"
        )
    largest = tables()["sizes"]["steps"][-1]
    if not 0.0 < size <= largest:
        raise JointplayError(
            f"{size:g} mm is out of range: the tables have sizes above 0 up to {largest} mm"
        )
    width, low = tolerance(size, grade), letter.lower()
    if size <= 1.0 and (grade > 13 or low in "ab" or (letter == "N" and grade > 8)):
        _undefined(size, letter, grade, "up to 1 mm there is none")
    if low == "js":  # symmetric
        return Limits(-0.5 * width, 0.5 * width)
    if low == "j":  # a table of its own
        rows = tables()[letter]
        end = _looked_up(size, rows[str(grade)]) if str(grade) in rows else math.nan
        if math.isnan(end):
            only = "6 to 8" if hole else "5 to 7, and 8 up to 3 mm"
            _undefined(size, letter, grade, f"it has the grades {only}")
        return Limits(end - width, end) if hole else Limits(end, end + width)
    shift = _looked_up(size, tables()["shafts"][low])
    if math.isnan(shift):
        _undefined(size, letter, grade, "the letter has no deviation for this size")
    if low <= "h":  # clearance: EI = -es
        return Limits(0.0 - shift, width - shift) if hole else Limits(shift - width, shift)
    if not hole:
        shift = 0.0 if letter == "k" and not 4 <= grade <= 7 else shift
        return Limits(shift, shift + width)
    end = _end_of_hole(size, letter, grade, shift)
    return Limits(end - width, end)


def _end_of_hole(size: float, letter: str, grade: int, shift: float) -> float:
    """Upper deviation ES of a hole of K to ZC, from the shift of the shaft of its letter [µm]."""
    if grade < 3:
        _undefined(size, letter, grade, "holes of K to ZC have the grades from 3 on")
    near = letter in ("K", "M", "N")
    if letter in ("K", "N") and grade > 8 and size > 3.0:
        if letter == "K":
            _undefined(size, letter, grade, "above 3 mm it has the grades up to 8")
        return 0.0
    if letter == "M" and grade == 6 and 250.0 < size <= 315.0:
        return -9.0  # the standard's exception to its rule
    if size <= 3.0 or grade > (8 if near else 7):
        return -shift
    # The standard's delta: so P7/h6 has the limits of H7/p6, the fit of the same letters.
    return tolerance(size, grade) - tolerance(size, grade - 1) - shift


def _undefined(size: float, letter: str, grade: int, why: str) -> NoReturn:
    raise JointplayError(f"{letter}{grade} is not defined for {size:g} mm: {why}")


def is_fit(text: str) -> bool:
    """Whether `text` is meant as a fit, valid or not, rather than a length."""
    try:
        plain_number(text)
    except ValueError:
        return _LOOKS_FITTED.fullmatch(text) is not None
    return False


@known_keywords
@dataclass(frozen=True)
class Fit:
    """A hole and a shaft of one nominal size: ``Fit("20H7/g6")``.

    Clearances are radial: half of the difference of the diameters. Both diameters are taken as
    independent and uniformly distributed within their tolerances.

    Raises:
        JointplayError: text that is no fit, or a size, letter or grade that the tables of ISO 286-1
            do not have.
    """

    text: str
    size: float = field(init=False, compare=False)
    """Nominal diameter, or width between parallel faces [m]."""
    hole: Limits = field(init=False, compare=False)
    """Limit deviations EI and ES of the hole [µm]."""
    shaft: Limits = field(init=False, compare=False)
    """Limit deviations ei and es of the shaft [µm]."""
    grades: tuple[int, int] = field(init=False, compare=False)
    """Grades of hole and shaft."""

    def __post_init__(self) -> None:
        size, *parts = _parted(self.text)
        try:
            hole, shaft = (limits(size, letter, grade) for letter, grade in parts)
        except JointplayError as error:
            raise JointplayError(f"fit {self.text!r}: {error}") from None
        classes = [f"{letter}{grade}" for letter, grade in parts]
        values = {"text": f"{size:g}{classes[0]}/{classes[1]}", "size": 1e-3 * size}
        values |= {"hole": hole, "shaft": shaft, "grades": (parts[0][1], parts[1][1])}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __str__(self) -> str:
        return self.text

    @property
    def least(self) -> float:
        """Least clearance; negative for interference [m]."""
        return 0.5e-6 * (self.hole.lower - self.shaft.upper)

    @property
    def most(self) -> float:
        """Largest clearance; negative where there is always interference [m]."""
        return 0.5e-6 * (self.hole.upper - self.shaft.lower)

    @property
    def middle(self) -> float:
        """Middle of the range, which is the mean [m]."""
        return 0.5 * (self.least + self.most)

    @property
    def deviation(self) -> float:
        """Standard deviation of the clearance [m]."""
        return 0.5e-6 * math.hypot(*self._widths) / math.sqrt(12.0)

    @property
    def _widths(self) -> tuple[float, float]:
        """Tolerances of hole and shaft [µm]."""
        return self.hole.upper - self.hole.lower, self.shaft.upper - self.shaft.lower

    @property
    def kind(self) -> str:
        """``clearance``, ``transition`` or ``interference``."""
        if self.least >= 0.0:
            return CLEARANCE
        return TRANSITION if self.most > 0.0 else INTERFERENCE

    @property
    def range(self) -> str:
        """The limits of the clearance, in words."""
        return f"{1e6 * self.least:.4g} to {1e6 * self.most:.4g} µm"

    def quantile(self, probability: Any) -> Any:
        """Quantiles of the clearance, whose distribution is a trapezoid [m]."""
        from scipy import stats

        inner, outer = sorted(self._widths)
        ends = inner / (inner + outer), outer / (inner + outer)
        spread = stats.trapezoid(*ends, loc=self.least, scale=self.most - self.least)
        return spread.ppf(probability)

    def require_clearance(self) -> None:
        """Refuse a fit that is not always loose.

        Raises:
            JointplayError: a transition or interference fit.
        """
        if self.kind == CLEARANCE:
            return
        loose = [str(fit) for fit in self.alternatives() if fit.grades == self.grades]
        loose = loose or [str(fit) for fit in self.alternatives()]
        article = "an" if self.kind == INTERFERENCE else "a"
        raise JointplayError(
            f"{self} is {article} {self.kind} fit ({self.range} of clearance on each side), in "
            "which nothing is sure to move; a joint needs a clearance fit, such as "
            f"{', '.join(loose[:3])}; what is pressed in place has no play (a seat says how it "
            "gives way)"
        )

    def alternatives(self) -> tuple[Fit, ...]:
        """This fit, if it is a clearance fit, and the preferred ones of its size."""
        fits = [self] if self.kind == CLEARANCE else []
        for classes in PREFERRED:
            with suppress(JointplayError):  # up to 1 mm some are not defined
                fits.append(Fit(f"{1e3 * self.size:g}{classes}"))
        return tuple(dict.fromkeys(fits))


def _parted(text: object) -> tuple[Any, ...]:
    """Nominal size [mm], and letter and grade of hole and of shaft."""
    form = 'a fit reads "20H7/g6": nominal size in mm, hole, a slash, shaft'
    match = _FORM.fullmatch("".join(text.split())) if isinstance(text, str) else None
    if match is None:
        raise JointplayError(f"{text!r:.60} is no fit; {form}")
    size, *first, slash, letter, grade = match.groups()
    if letter is None:
        missing = "shaft" if first[0][0].isupper() else "hole"
        raise JointplayError(f"fit {text!r} has no {missing}; {form}")
    parts = [
        (name.upper() if name[0].isupper() else name, int(number))  # Js is JS
        for name, number in (first, (letter, grade))
    ]
    hole, shaft = (f"{name}{number}" for name, number in parts)
    holes = [part[0][0].isupper() for part in parts]
    if holes == [False, True]:
        raise JointplayError(
            f"fit {text!r} has its shaft first; the hole, in capital letters, comes first: "
            f'"{size}{shaft}/{hole}"'
        )
    if holes[0] == holes[1]:
        kind = "holes, in capital" if holes[0] else "shafts, in small"
        raise JointplayError(f"fit {text!r} has two {kind} letters; {form}")
    if not slash:
        raise JointplayError(f'fit {text!r} has no slash before its shaft: "{size}{hole}/{shaft}"')
    return float(size.replace(",", ".")), *parts
