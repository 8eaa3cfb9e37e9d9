"""Fields of values: each number has its unit, and the range that it must lie in, beside it.

@dataclass(frozen=True)
class LinearSpring:
    stiffness: float | None = quantity("N/m", None, above=0.0)

    def __post_init__(self):
        check_fields(self)
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import textwrap
from collections.abc import Collection, Mapping
from functools import cache
from itertools import pairwise
from typing import Any, get_args, get_type_hints

from jointplay.errors import Where, require_finite, require_non_negative, require_positive

UNITS = "units"
CHOICES = "choices"
FINITE = "finite"
_RANGE = "range"
_WORDS = "words"

_SINGLE = ("float", "float | None")
"""Types of fields that hold a single number."""


def quantity(
    *units: str,
    default: Any = dataclasses.MISSING,
    default_factory: Any = dataclasses.MISSING,
    choices: tuple[str, Mapping[str, Any]] | None = None,
    above: float | None = None,
    least: float | None = None,
    words: str = "",
    finite: bool = True,
) -> Any:
    """Field of a dataclass that holds a number, or several, in an SI unit.

    Args:
        units: of which one it has; ``""`` for pure numbers. Two where it depends on the joint:
            that of revolute and that of prismatic joints.
        default, default_factory: of the field; without one it must be given.
        choices: what words are called that stand for a value, and these.
        above: 0.0 if the number must be positive, as `check_fields` demands.
        least: 0.0 if it must not be negative.
        words: what errors call it; the field's name, if not given.
        finite: without, files may have infinity or no number (NaN) here.
    """
    if above not in (None, 0.0) or least not in (None, 0.0):
        raise ValueError("a range begins at zero, or the class checks it itself")
    check = require_positive if above == 0.0 else require_non_negative
    check = require_finite if above is None and least is None else check
    metadata = {UNITS: units, _RANGE: check, _WORDS: words, FINITE: finite}
    metadata |= {} if choices is None else {CHOICES: choices}
    if default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=default_factory, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def choice(
    noun: str, choices: Collection[str] | Mapping[str, Any], *, default: Any = dataclasses.MISSING
) -> Any:
    """Field of a dataclass that holds one of several words.

    Args:
        noun: what one is called.
        choices: the words; a mapping has the values for which they stand.
        default: of the field; without one it must be given.
    """
    return dataclasses.field(default=default, metadata={CHOICES: (noun, choices)})


def units_of(field: dataclasses.Field[Any]) -> tuple[str, ...] | None:
    """Units that a field of a dataclass can have; None if none is said."""
    units: tuple[str, ...] | None = field.metadata.get(UNITS)
    return units


def check_fields(value: Any) -> None:
    """Make floats of all single numbers of a dataclass that have a unit; they must be in range.

    Fields that hold several numbers the class checks itself.

    Raises:
        JointplayError: a number that is not finite or out of its range, with the field's name as
            its place.
    """
    for field in dataclasses.fields(value):
        units, given = units_of(field), getattr(value, field.name)
        kind = "float" if field.type is float else str(field.type)
        if units is None or kind not in _SINGLE or (given is None and field.default is None):
            continue
        words = field.metadata[_WORDS] or field.name
        where: Where = (field.name,)
        number = field.metadata[_RANGE](words, given, units[0].replace("*", " "), where)
        object.__setattr__(value, field.name, number)


@dataclasses.dataclass(frozen=True)
class Field:
    """What a class says of one of its fields."""

    name: str
    hint: Any
    units: tuple[str, ...]
    """SI units that its numbers can have; ``("",)`` for pure numbers."""
    required: bool
    choices: tuple[str, Collection[str] | Mapping[str, Any]] | None = None
    """What its words are called, and these; a mapping has the values they stand for."""
    finite: bool = True
    """Whether its number must be finite."""


@cache
def fields_of(kind: type) -> dict[str, Field]:
    """The fields of a class as they are written, by name.

    Raises:
        TypeError: one that holds a number has no unit.
    """
    written = getattr(kind, "written", None) or kind
    hints = get_type_hints(written)
    fields = {}
    for one in dataclasses.fields(written):
        hint, units = hints[one.name], units_of(one)
        if units is None and CHOICES not in one.metadata and _measures(hint):
            raise TypeError(
                f"{kind.__name__}.{one.name} is a number without a unit; see `quantity`"
            )
        missing = dataclasses.MISSING
        required = one.default is missing and one.default_factory is missing
        choices = one.metadata.get(CHOICES)
        finite = one.metadata.get(FINITE, True)
        fields[one.name] = Field(one.name, hint, units or ("",), required, choices, finite)
    return fields


def _measures(hint: Any) -> bool:
    """Whether a type holds numbers that can have a unit."""
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return False
    return hint is float or any(_measures(part) for part in get_args(hint))


@cache
def explanations(kind: type) -> dict[str, str]:
    """What a class says below its fields as they are written, and its bases below theirs."""
    texts: dict[str, str] = {}
    owner = getattr(kind, "written", None) or kind
    for base in reversed(owner.__mro__):
        if "__dataclass_fields__" not in vars(base):
            continue
        try:
            (body,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        except (OSError, SyntaxError, TypeError):  # made where no file is
            continue
        assert isinstance(body, ast.ClassDef)
        for field, text in pairwise(body.body):
            match field, text:
                case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(said))):
                    texts[name] = said
    return {name: " ".join(text.split()) for name, text in texts.items()}
