"""Declaration of inputs: dataclass fields with units and ranges, and their reading from plain data.

    @dataclass(frozen=True)
    class LinearSpring:
        stiffness: OptionalQuantity = quantity("N/m", default=None, above=0.0)

        def __post_init__(self):
            check_fields(self)

1. Fields (`quantity`, `choice`) declare unit, range and choices; `check_fields` enforces them.
2. Families (`Family`, `register`): a word in a file, such as ``law = "hertz"``, selects a class.
3. `read` makes objects from plain data, guided by type hints; `plain` is the reverse.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import math
import textwrap
import types
from collections.abc import (
    Callable,
    Collection,
    Iterable,
    Iterator,
    Mapping,
    MutableMapping,
    Sequence,
)
from dataclasses import dataclass
from functools import cache, wraps
from itertools import pairwise
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Literal,
    Self,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from jointplay.base.errors import (
    JointplayError,
    MissingKey,
    MissingName,
    Where,
    closest,
    require_finite,
    require_non_negative,
    require_positive,
    require_vector,
    within,
)
from jointplay.base.units import ask_scale, convert, expected, toml_text

# Fields: each number is declared with its unit and range.

_VECTOR = tuple[float, float, float]


if TYPE_CHECKING:

    class Quantity:
        """A field that is set to a number in SI or text such as ``"0.2 mm"``, and holds the number.

        `__set__` takes Any, not str: mypy infers from it what a subclass's field holds.
        """

        def __get__(self, instance: object, owner: type | None = None) -> float: ...
        def __set__(self, instance: object, value: float | Any) -> None: ...

    class OptionalQuantity:
        """A `Quantity` that may be None."""

        def __get__(self, instance: object, owner: type | None = None) -> float | None: ...
        def __set__(self, instance: object, value: float | Any | None) -> None: ...

else:
    Quantity, OptionalQuantity = float, float | None


def quantity(
    *units: str,
    default: Any = dataclasses.MISSING,
    default_factory: Any = dataclasses.MISSING,
    choices: tuple[str, Mapping[str, Any]] | None = None,
    above: float | None = None,
    least: float | None = None,
    label: str = "",
    finite: bool = True,
) -> Any:
    """Declare a dataclass field that holds a number, or several, in an SI unit.

    Args:
        units: its SI unit; ``""`` for pure numbers. Two where it depends on the joint: for revolute
            and for prismatic joints.
        default, default_factory: as in `dataclasses.field`.
        choices: words that stand for a value: the noun for such a word, and the values by word.
        above: 0.0 if the number must be positive; `check_fields` enforces it.
        least: 0.0 if it must not be negative.
        label: name in errors; the field's own by default.
        finite: False lets files give infinity or NaN.
    """
    if not units or not all(isinstance(unit, str) for unit in units):
        raise TypeError(f'units are text, "" for pure numbers, got {units!r}; see default=')
    if above not in (None, 0.0) or least not in (None, 0.0):
        raise ValueError("a range begins at zero, or the class checks it itself")
    check = require_positive if above == 0.0 else require_non_negative
    check = require_finite if above is None and least is None else check
    about = {"units": units, "check": check, "label": label, "finite": finite, "choices": choices}
    if default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=default_factory, metadata=about)
    return dataclasses.field(default=default, metadata=about)


def in_si(name: str, value: float | str, unit: str) -> float:
    """Convert text such as ``"0.2 mm"`` to a number in SI; leave numbers as they are.

    Raises:
        JointplayError: text that is no quantity in this unit, with the name.
    """
    if not isinstance(value, str):
        return value
    try:
        return float(convert(value, unit))
    except ValueError as error:
        raise JointplayError(f"{name}: {error}") from None


def choice(
    noun: str, choices: Collection[str] | Mapping[str, Any], *, default: Any = dataclasses.MISSING
) -> Any:
    """Declare a field that holds one of several words, or the value that a mapping gives for it."""
    return dataclasses.field(default=default, metadata={"choices": (noun, choices)})


def check_fields(value: Any) -> None:
    """Convert and check all fields of a dataclass instance in place, for ``__post_init__``.

    Values may be given as in files: text with a unit, ``"0.2 mm"``, becomes a number, a word or a
    table the object that it stands for, ``"flores"``. Quantities become floats, in lists and
    vectors, too.

    Raises:
        JointplayError: an impossible value, a word that is not among the field's choices, or a
            number that is not finite or out of range; `where` has the field's name.
    """
    kind: type = type(value)
    fields = fields_of(kind)
    for name in (f.name for f in dataclasses.fields(value) if f.name in fields):
        field, stated = fields[name], getattr(value, name)
        if _as_in_files(field.hint, stated):
            try:
                with within(name):
                    stated = make(_check_field(field, stated))
            except JointplayError as error:
                place = ".".join(map(str, error.where))
                raise JointplayError(f"{place}: {error}", error.where) from None
            object.__setattr__(value, name, stated)
        if stated is None and field.default is None and not field.required:
            continue
        if field.choices and is_word(field.hint) and stated not in list(field.choices[1]):
            raise MissingName(field.choices[0], str(stated), field.choices[1], where=(name,))
        if field.check is not None:
            object.__setattr__(value, name, _checked_numbers(field, stated))


def _checked_numbers(field: Field, value: Any) -> Any:
    """Check the range of a field's number, tuple or vectors; return other values unchanged."""
    hint, label, where = field.hint, field.label, (field.name,)
    unit = field.units[0].replace("*", " ")
    if hint in (float, float | None) and field.check is not None:
        return field.check(label, value, unit, where)
    if hint == _VECTOR:
        return require_vector(label, value, unit, where)
    if hint == tuple[_VECTOR, ...]:
        return tuple(require_vector(label, x, unit, (*where, i)) for i, x in enumerate(value))
    if hint == tuple[float, ...]:
        return tuple(require_finite(label, x, unit, (*where, i)) for i, x in enumerate(value))
    return value


def _as_in_files(hint: Any, value: Any) -> bool:
    """Whether a value is given as in a file, and has yet to be converted to the field's type."""
    kinds = get_args(hint) or (hint,)
    of_family = any(map(family_of, kinds))
    if isinstance(value, str):
        return not is_word(hint)
    if isinstance(value, Mapping | list | tuple):
        several = value.values() if isinstance(value, Mapping) else value
        described = of_family or any(map(dataclasses.is_dataclass, kinds))
        return (described and isinstance(value, Mapping)) or any(
            isinstance(item, str | Mapping) for item in several
        )
    return of_family and isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class Field:
    """Declaration of one field of a class."""

    name: str
    hint: Any
    """Type hint."""
    units: tuple[str, ...]
    """SI units that its numbers can have; ``("",)`` for pure numbers."""
    required: bool
    choices: tuple[str, Collection[str] | Mapping[str, Any]] | None = None
    """Noun for its words, and the words; a mapping has the values they stand for."""
    finite: bool = True
    default: Any = None
    check: Callable[[str, float, str, Where], float] | None = None
    """Function that raises if its number is out of range; None for fields without numbers."""
    label: str = ""
    """Name in errors."""


@cache
def fields_of(kind: type) -> dict[str, Field]:
    """Fields of a class as files have them, by name.

    Raises:
        TypeError: a field that holds a number has no unit.
    """
    written = getattr(kind, "written", None) or kind
    hints = get_type_hints(written)
    fields, checked = {}, {}
    if dataclasses.is_dataclass(kind):  # its own metadata prevail over those of `written`
        checked = {f.name: f.metadata for f in dataclasses.fields(kind)}
    missing = dataclasses.MISSING
    for entry in dataclasses.fields(written):
        hint, about = hints[entry.name], checked.get(entry.name) or entry.metadata
        if not about and _measures(hint):
            raise TypeError(
                f"{kind.__name__}.{entry.name} is a number without a unit; see `quantity`"
            )
        fields[entry.name] = Field(
            entry.name,
            hint,
            about.get("units", ("",)),
            required=entry.default is missing and entry.default_factory is missing,
            choices=about.get("choices"),
            finite=about.get("finite", True),
            default=None if entry.default is missing else entry.default,
            check=about.get("check"),
            label=about.get("label") or entry.name,
        )
    return fields


def fields_at(kind: Any, path: Sequence[str], deep: bool = True) -> Iterator[tuple[Field, str]]:
    """Yield the fields at a `path` of keys within a class, each with its explanation.

    There may be none. Any key matches the name of an entry in a table by name. In a family all
    members are searched, the default one first; without `deep` only that.
    """
    origin, family = get_origin(kind), family_of(kind)
    if origin in (Union, types.UnionType):
        for part in get_args(kind):
            yield from fields_at(part, path, deep)
    elif origin is not None:
        yield from fields_at(get_args(kind)[-1], path[1:], deep)
    elif family is not None and list(path) == [family.key]:
        choices = (family.noun, family.members)
        yield Field(family.key, str, ("",), False, choices, default=family.default), ""
    elif family is not None:
        first = family.default or next(iter(family.members))
        members = [first, *(family.members if deep else ())]
        for choice in dict.fromkeys(family.member(word).kind for word in members):
            yield from fields_at(choice, path, deep)
    elif dataclasses.is_dataclass(kind) and path and path[0] in (fields := fields_of(kind)):  # type: ignore[arg-type]
        field = fields[path[0]]
        if len(path) > 1:
            yield from fields_at(field.hint, path[1:], deep)
        else:
            yield field, explanations(kind).get(field.name, "")  # type: ignore[arg-type]


def ask_scales(kind: type, data: Mapping[str, Any]) -> None:
    """Raise for numbers of a checked file that have no unit and an implausible size (`ask_scale`).

    Raises:
        JointplayError: a question which unit is meant; `where` has the place.
    """
    for path, value in _bare_numbers(data):
        names = [part for part in path if isinstance(part, str)]
        units = {field.units for field, _ in fields_at(kind, names)} or {("",)}
        if len(units) == 1 and len(unit := units.pop()) == 1:
            try:
                ask_scale(value, unit[0])
            except ValueError as error:
                raise JointplayError(str(error), path) from None


def _bare_numbers(value: Any, path: Where = ()) -> Iterator[tuple[Where, float]]:
    """Yield the numbers without a unit in tables and lists, with their paths."""
    if isinstance(value, Mapping | list):
        inside = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, item in inside:
            yield from _bare_numbers(item, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, value


def _measures(hint: Any) -> bool:
    """Whether a type holds floats, which need a unit."""
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return False
    return hint is float or any(_measures(part) for part in get_args(hint))


@cache
def explanations(kind: type) -> dict[str, str]:
    """Docstrings below the fields of a class and its bases, by field, read from the source."""
    texts: dict[str, str] = {}
    owner = getattr(kind, "written", None) or kind
    for base in reversed(owner.__mro__):
        if "__dataclass_fields__" not in vars(base):
            continue
        try:
            (body,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        except (OSError, SyntaxError, TypeError):  # its source is not in a file
            continue
        assert isinstance(body, ast.ClassDef)
        for field, text in pairwise(body.body):
            match field, text:
                case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(meaning))):
                    texts[name] = meaning
    return {name: " ".join(text.split()) for name, text in texts.items()}


# Families of classes, of which a word in a file selects one: laws, joints, drives, loads.


@dataclass(frozen=True)
class Preset:
    """A class with some of its fields set."""

    kind: type
    title: str = ""
    given: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclass(frozen=True)
class Family:
    """Classes of which a word selects one."""

    key: str
    """Key whose value is the word: ``law``, ``kind``."""
    noun: str
    """Name of a member in messages."""
    members: MutableMapping[str, Any]
    """Classes and presets by word; `add` writes into it."""
    default: str | None = None
    """Word that is assumed where the key is missing."""
    bare: bool = True
    """Whether the word alone may stand for a table with only this key."""
    number: tuple[str, str] | None = None
    """Word of a member, and its key that a bare number in place of the table gives, if allowed."""

    def member(self, word: str) -> Preset:
        """Class that a word selects, and those of its fields that are set."""
        member = self.members[word]
        return member if isinstance(member, Preset) else Preset(member)


_families: dict[type, Family] = {}
_names: dict[type, tuple[Callable[[str], Any], Callable[[], Sequence[str]]]] = {}


def register(base: type, family: Family) -> None:
    """Have `base` read from data as a member of a family."""
    _families[base] = family


def add(base: type, kind: type) -> None:
    """Add a class to a family, so that files can select it by its word.

    `base` is `Load`, `Drive`, `Gearing`, `Clearance`, `NormalForceLaw`, `FrictionLaw` or `FilmLaw`.

    Raises:
        JointplayError: there is no such family, or the word is taken.
    """
    family = _families.get(base)
    if family is None or not issubclass(kind, base) or base.selector is None:  # type: ignore[attr-defined]
        raise JointplayError(f"{kind.__name__} cannot be added to {base.__name__}")
    word = getattr(kind, base.selector[1])  # type: ignore[attr-defined]
    if family.members.get(word, kind) is not kind:
        raise JointplayError(f"there is a {family.noun} {word!r} already")
    family.members[word] = kind


def register_names(
    kind: type, find: Callable[[str], Any], names: Callable[[], Sequence[str]]
) -> None:
    """Have instances of `kind` given by name, one of `names()`; `find` looks one up."""
    _names[kind] = find, names


def family_of(kind: Any) -> Family | None:
    """Family with the base `kind`, if there is one."""
    return _families.get(kind)


def names_of(kind: Any) -> Sequence[str]:
    """Names by which instances of `kind` can be given."""
    return _names[kind][1]() if kind in _names else ()


# Objects to plain data and back, guided by the type hints of their fields.
#
#     plain(joint)                      # {"kind": "revolute", "bearing_radius": 0.01, ...}
#     read(Clearance, data)             # the joint, or a JointplayError with its place
#     check(Clearance, data).make()     # the same in two steps: all checks first


T = TypeVar("T")
Target = TypeVar("Target", bound=Callable[..., Any])


class Described:
    """Base of classes whose instances can be written as plain data and read back."""

    selector: ClassVar[tuple[str, str] | None] = None
    """Key of the word that selects the class, and attribute that holds the word."""
    written: ClassVar[type | None] = None
    """Dataclass of the fields as files have them; None if they are those of the class."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        _know_class_methods(cls)

    def __new__(cls, *arguments: Any, **keywords: Any) -> Self:
        require_keywords(cls.__init__, keywords, cls.__name__)
        return super().__new__(cls)

    def describe(self) -> dict[str, Any]:
        """All fields as plain data, for result files; `from_description` reads it back."""
        word = {} if self.selector is None else {self.selector[0]: getattr(self, self.selector[1])}
        return {**word, **_fields(self)}

    @classmethod
    def from_description(cls, description: Any) -> Self:
        """Build the value from what `describe` returned; its selecting word may be left out.

        Raises:
            JointplayError: an unknown or missing key, or an impossible value; `where` has its
                place.
        """
        described: Self = read(cls, description)
        return described

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Self:
        """Build the value from its fields as files have them, already checked."""
        return cls(**fields)


def plain(value: Any) -> Any:
    """Convert a value to plain data: numbers, text, lists and dictionaries."""
    if isinstance(value, Described):
        return value.describe()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _fields(value)
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def _fields(value: Any) -> dict[str, Any]:
    return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}


def shortest(kind: type[Any], value: Any) -> dict[str, Any]:
    """Describe a value by the fewest keys from which `read` makes an equal one.

    Keys are dropped from the last on, where derived ones are.

    Args:
        kind: as for `read`.
        value: a `Described`.
    """
    table = {key: item for key, item in plain(value).items() if item is not None}
    for key in reversed(list(table)):
        fewer = {name: item for name, item in table.items() if name != key}
        try:
            if plain(read(kind, fewer)) == plain(value):
                table = fewer
        except JointplayError:  # it is required
            pass
    return table


@dataclass(frozen=True)
class Draft:
    """Checked data of an object that has yet to be made."""

    kind: type
    word: str | None
    """Word that selected the class, if one did."""
    fields: Mapping[str, Any]

    def make(self, objects: bool = True) -> Any:
        """Make the object; `objects` as in the function `make`.

        Raises:
            JointplayError: fields that contradict each other; `where` has the place.
        """
        parts = make(dict(self.fields), objects)
        if issubclass(self.kind, Described):
            return self.kind.from_fields(parts)
        return self.kind(**parts)


def make(checked: Any, objects: bool = True) -> Any:
    """Make the value of checked data (`check`), and of all drafts within them.

    Without `objects` drafts of `Described` classes are left as they are.
    """
    if isinstance(checked, Draft):
        left = not objects and issubclass(checked.kind, Described)
        return checked if left else checked.make(objects)
    if not isinstance(checked, dict | list | tuple):
        return checked
    parts = {}
    for key, item in checked.items() if isinstance(checked, dict) else enumerate(checked):
        with within(key):
            parts[key] = make(item, objects)
    return parts if isinstance(checked, dict) else type(checked)(parts.values())


def read(kind: type[T] | Any, data: Any) -> Any:
    """Read a value of a type from plain data.

    Raises:
        JointplayError: the data do not fit; `where` has the place in them.
    """
    return make(check(kind, data))


def check(kind: Any, data: Any, units: tuple[str, ...] = ("",)) -> Any:
    """Check data against a type and convert them; objects are not yet made, but become a `Draft`.

    Numbers can have these `units`; if there are several, a number remembers its own (`Measured`).

    Raises:
        JointplayError: the data do not fit; `where` has the place in them.
    """
    if isinstance(data, Described) and isinstance(kind, type) and isinstance(data, kind):
        return data
    if isinstance(data, str) and (names := names_of(kind)):
        try:
            return _names[kind][0](data)
        except MissingName:
            raise JointplayError(one_of(kind.__name__.lower(), data, names)) from None
    family = family_of(kind)
    if family is not None:
        return _check_member(family, data)
    origin, parts = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _check_union(data, parts, units)
    table = dataclasses.is_dataclass(kind) or getattr(kind, "written", None)
    if isinstance(kind, type) and table:
        return _check_table(kind, data, None, {})
    if origin is not None and origin is not Literal:
        return _check_collection(origin, parts, data, units)
    return _check_simple(kind, data, units)


def _check_member(family: Family, data: Any) -> Draft:
    """Check data of a family's member: a table with the selecting word, the word, or a number."""
    key, noun, members = family.key, family.noun, family.members
    place = (key,) if isinstance(data, Mapping) else ()
    if family.bare and isinstance(data, str):
        data = {key: data}
    if family.number and isinstance(data, int | float) and not isinstance(data, bool):
        word, parameter = family.number
        data = {key: word, parameter: data}
    if not isinstance(data, Mapping):
        text = f"a {noun} is a table with the key {key}"
        raise JointplayError(f"{toml_text(data)} is not a table; {text}")
    word = data.get(key, family.default)
    if word is None:
        raise JointplayError(f"the key {key} is missing; available: {', '.join(members)}")
    if not isinstance(word, str) or word not in members:
        raise JointplayError(one_of(noun, word, members), where=place)
    member = family.member(word)
    return _check_table(member.kind, data, (key, word), member.given)


def _check_table(
    kind: type, data: Any, word: tuple[str, str] | None, preset: Mapping[str, Any]
) -> Draft:
    """Check a table of the fields of a class; `word` is the selecting key and word, if any."""
    fields = {name: field for name, field in fields_of(kind).items() if name not in preset}
    selector = getattr(kind, "selector", None)
    if word is None and selector is not None and isinstance(data, Mapping) and selector[0] in data:
        word = (selector[0], getattr(kind, selector[1]))
        if data[word[0]] != word[1]:
            text = f"{toml_text(data[word[0]])} is not {toml_text(word[1])}"
            raise JointplayError(text, (word[0],))
    form = getattr(kind, "written", None) or kind
    keys = [*([word[0]] if word else []), *fields, *getattr(form, "further_keys", ())]
    if not isinstance(data, Mapping):
        raise JointplayError(f"{toml_text(data)} is not a table; its keys are: {', '.join(keys)}")
    for key in data:
        if key not in keys:
            whose = f" of the {word[0]} {word[1]}" if word else ""
            raise JointplayError(unknown_key(key, keys, whose), where=(key,))
    values = dict(preset)
    for name in data:  # in the order of the file, so that its first error is reported
        if name in fields:
            with within(name):
                values[name] = _check_field(fields[name], data[name])
    missing = [name for name, field in fields.items() if field.required and name not in data]
    if missing:
        several = len(missing) > 1
        raise MissingKey(
            f"the key{'s' if several else ''} {', '.join(missing)} {'are' if several else 'is'} "
            "missing"
        )
    return Draft(kind, word[1] if word else None, values)


def _check_field(field: Field, data: Any) -> Any:
    """Check the value of a field: one of its words, or data of its type."""
    if not field.finite and isinstance(data, float) and not math.isfinite(data):
        return data
    if field.choices is None or data is None:
        return check(field.hint, data, field.units)
    noun, allowed = field.choices
    word = isinstance(data, str)
    if (word or is_word(field.hint)) and not (word and data in allowed):
        raise JointplayError(one_of(noun, data, allowed))
    if word and isinstance(allowed, Mapping) and not is_word(field.hint):
        return allowed[data]
    return check(field.hint, data, field.units)


def is_word(hint: Any) -> bool:
    """Whether the words of a field with choices are its values, and do not stand for others."""
    return hint in (str, str | None)


def _check_union(data: Any, parts: Sequence[Any], units: tuple[str, ...]) -> Any:
    """Check data of a union: None where that is possible, else the first type that fits."""
    if data is None and type(None) in parts:
        return None
    errors: list[JointplayError] = []
    for part in parts:
        if part is type(None):
            continue
        try:
            return check(part, data, units)
        except JointplayError as error:
            errors.append(error)
    raise max(errors, key=lambda error: len(error.where))  # of the type that fits best


def _check_collection(origin: Any, parts: Sequence[Any], data: Any, units: tuple[str, ...]) -> Any:
    """Check a table by name, a list, or a tuple; `parts` are the types of the entries."""
    if issubclass(origin, Mapping):
        if not isinstance(data, Mapping):
            raise JointplayError(f"expected a table, got {toml_text(data)}")
        table = {}
        for key, item in data.items():
            with within(key):
                table[key] = check(parts[1], item, units)
        return table
    fixed = origin is tuple and parts[-1] is not Ellipsis
    if not isinstance(data, list | tuple) or (fixed and len(data) != len(parts)):
        if fixed and len(parts) == 3:
            form = f"give each as {expected(*units)}"
            raise JointplayError(f"{toml_text(data)} are not three components; {form}")
        raise JointplayError(f"expected a list in brackets, got {toml_text(data)}")
    several = []
    for index, item in enumerate(data):
        with within(*(() if fixed else (index,))):
            several.append(check(parts[index] if fixed else parts[0], item, units))
    return tuple(several) if origin is tuple else several


_EXPECTED = {
    bool: "true or false",
    int: "a whole number",
    str: "text in quotes",
    list: "a list in brackets",
    dict: "a table",
}


def _check_simple(kind: Any, data: Any, units: tuple[str, ...]) -> Any:
    """Check a number (converted to SI), a text, a truth value or a literal."""
    if kind is float:
        try:
            measured = convert(data, *units)
        except ValueError as error:
            raise JointplayError(str(error)) from None
        return measured if len(units) > 1 else float(measured)
    if get_origin(kind) is Literal:
        if data not in get_args(kind):
            raise JointplayError(one_of("choice", data, get_args(kind)))
        return data
    if kind in _EXPECTED and (
        not isinstance(data, kind) or (kind is int and isinstance(data, bool))
    ):
        raise JointplayError(f"expected {_EXPECTED[kind]}, got {toml_text(data)}")
    return data


SYNONYMS = {
    "backlash": "play",
    "lost_motion": "play",
    "play": "radial_clearance",
    "clearance": "radial_clearance",
    "gap": "radial_clearance",
    "rotor": "rotor_inertia",
    "armature": "rotor_inertia",
    "kp": "p_gain",
    "kd": "d_gain",
    "ki": "i_gain",
    "mu": "mu_d",
}
"""Keys that others use, and the ones of this package that mean the same."""


def unknown_key(key: str, keys: Iterable[str], whose: str = "") -> str:
    """Message for a key that does not exist."""
    keys = list(keys)
    meant = SYNONYMS.get(key) if SYNONYMS.get(key) in keys else key
    return f'unknown key "{key}"{whose}; {closest(meant, keys)}valid keys: {", ".join(keys)}'


def require_keywords(function: Any, given: Iterable[str], name: str) -> None:
    """Raise for keywords that a function does not take, with the message of `unknown_key`."""
    code = getattr(function, "__code__", None)
    if code is None or code.co_flags & inspect.CO_VARKEYWORDS:
        return
    known = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    for key in given:
        if key not in known:
            keys = [known_key for known_key in known if known_key not in ("self", "cls")]
            raise JointplayError(unknown_key(key, keys, f" of {name}"), where=(key,))


def known_keywords(target: Target) -> Target:
    """Decorate a function or class so that a wrong keyword raises with the nearest valid one.

    For a class, this holds for its constructor and its class methods; a `Described` class needs no
    decorator.
    """
    if isinstance(target, type):
        target.__init__ = known_keywords(target.__init__)  # type: ignore[misc]
        _know_class_methods(target)
        return target
    taken, name = inspect.unwrap(target), target.__qualname__.removesuffix(".__init__")

    @wraps(target)
    def call(*arguments: Any, **keywords: Any) -> Any:
        require_keywords(taken, keywords, name)
        return target(*arguments, **keywords)

    return cast(Target, call)


def _know_class_methods(kind: type) -> None:
    """Decorate the public class methods of a class with `known_keywords`."""
    for name, method in list(vars(kind).items()):
        if isinstance(method, classmethod) and not name.startswith("_"):
            setattr(kind, name, classmethod(known_keywords(method.__func__)))


def one_of(kind: str, value: Any, choices: Iterable[str]) -> str:
    """Message for a choice that does not exist."""
    choices = list(choices)
    return f"no {kind} {toml_text(value)}; {closest(value, choices)}available: {', '.join(choices)}"


# Comparison of plain data.


def differences(was: Any, now: Any, place: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the differences of two pieces of plain data: the place, and both values there."""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in {**was, **now}:
            inside = f"{place}.{key}" if place else key
            yield from differences(was.get(key), now.get(key), inside)
    elif isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        for k, (old, new) in enumerate(zip(was, now, strict=True)):
            yield from differences(old, new, f"{place}[{k}]")
    elif was != now:
        yield place, was, now


def short(value: Any) -> str:
    """Represent plain data in about sixty characters at most."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:40]}...{text[-15:]}"
