"""Keys of a scenario by their dotted names: whether they exist, their units, and setting them."""

from __future__ import annotations

import re
import tomllib
import types
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import is_dataclass
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin

from jointplay.base.errors import JointplayError
from jointplay.base.schema import Field, family_of, fields_of, unknown_key
from jointplay.base.units import toml_text
from jointplay.scenario.declarations import Model
from jointplay.scenario.reading import Key, dotted

_PART = re.compile(
    r"""(?P<quoted>"(?:[^"\\]|\\.)*"|'[^']*')|\[(?P<number>\d+)\]|(?P<word>[^."'\[\]]+)"""
)
"""A part of a key: a word, an index in brackets, or a name quoted as in TOML."""
NOT_SWEPT = ("title", "errors", "output", "cases", "sweep")
"""Tables of the scenario whose keys do not change a run, so that no sweep may vary them."""


def path_of(name: str) -> Key:
    """Path of a dotted name such as ``joints.joint_b.friction.mu_d`` or ``payloads[1].mass``.

    The name counts elements of lists from 1 (`reading.dotted`), the path from 0.

    Raises:
        JointplayError: not a dotted name.
    """
    parts: list[str | int] = []
    start = 0
    text = name if isinstance(name, str) else ""
    while start < len(text):
        part = _PART.match(text, start)
        if part is None:
            break
        quoted, number, bare = part.groups()
        try:
            name = tomllib.loads(f"name = {quoted}")["name"] if quoted else (bare or "").strip()
        except tomllib.TOMLDecodeError:  # an escape that TOML has not
            break
        if number and int(number) == 0:
            first = f"elements of lists are counted from 1; the first is {text[:start]}[1]"
            raise JointplayError(f"{toml_text(text)}: {first}")
        parts.append(int(number) - 1 if number else name)
        start = part.end()
        if start < len(text) and text[start] == ".":
            start += 1
    if not parts or start < len(text):
        raise JointplayError(
            f"{toml_text(name)} is not a key of a scenario; write it like "
            '"joints.joint_b.radial_clearance" or "payloads[1].mass"'
        )
    return tuple(parts)


class Kind(NamedTuple):
    """A type that the value of a key can have."""

    hint: Any
    units: tuple[str, ...] = ("",)
    """SI units of its numbers."""
    fields: Mapping[str, Field] = {}
    """Fields by name, if the value is a table."""


def _alternatives(hint: Any, units: tuple[str, ...] = ("",)) -> Iterator[Kind]:
    """The types that a hint allows: the parts of a union, and each member of a family."""
    family = family_of(hint)
    if get_origin(hint) in (Union, types.UnionType):
        for part in get_args(hint):
            yield from _alternatives(part, units)
    elif family is not None:
        for name in family.members:
            member = family.member(name)
            fields = {n: f for n, f in fields_of(member.kind).items() if n not in member.given}
            choice = {family.key: Field(family.key, str, ("",), False)}
            yield Kind(member.kind, units, choice | fields)
    else:
        yield Kind(hint, units, fields_of(hint) if is_dataclass(hint) else {})  # type: ignore[arg-type]


def kinds(path: Key) -> list[Kind]:
    """Types that the value at `path` can have.

    Raises:
        JointplayError: there is no such key; gives the nearest names.
    """
    # From part to part: the types of the tables at this depth, then of their entries.
    level = list(_alternatives(Model))
    for depth, part in enumerate(path):
        names = dict.fromkeys(name for kind in level for name in kind.fields)
        children: list[Kind] = []
        for kind in level:
            origin, parts = get_origin(kind.hint), get_args(kind.hint)
            by_name = isinstance(origin, type) and issubclass(origin, Mapping)
            if isinstance(part, str) and part in kind.fields:
                field = kind.fields[part]
                children += _alternatives(field.hint, field.units)
            elif parts and origin is not Literal and by_name == isinstance(part, str):
                children += _alternatives(parts[1 if by_name else 0], kind.units)
        if not children:
            location = f" in {dotted(path[:depth])}" if depth else ""
            if not names:
                parent = dotted(path[:depth])
                raise JointplayError(f"{dotted(path)}: {parent} has no keys of its own")
            raise JointplayError(unknown_key(str(part), names) + location)
        level = children
    if path[0] in NOT_SWEPT:
        raise JointplayError(f"a sweep cannot vary {path[0]!r}")
    return level


def units_of(path: Key) -> tuple[str, ...] | None:
    """SI units of the quantity at `path`, ``("",)`` for a pure number; None: not a quantity.

    Raises:
        JointplayError: there is no such key.
    """
    symbols = [unit for kind in kinds(path) if kind.hint is float for unit in kind.units]
    return tuple(dict.fromkeys(symbols)) or None


def is_whole(path: Key) -> bool:
    """Whether the key at `path` takes whole numbers."""
    return any(kind.hint is int for kind in kinds(path))


def set_key(changes: dict[str, Any], base: Mapping[str, Any], path: Key, value: Any) -> None:
    """Set `path` to `value` in `changes`, which are to be merged onto the tables `base`.

    Raises:
        JointplayError: `base` has no such element of a list.
    """
    # Down the path, in `changes` making tables as needed, and in `base` beside.
    table: Any = changes
    element: Any = base
    for depth, part in enumerate(path[:-1]):
        element = _element(element, part, path[: depth + 1])
        nested = table[part] if not isinstance(table, Mapping) or part in table else None
        if isinstance(element, str) and not isinstance(nested, Mapping):
            # A bare word stands for a table, which changes of its keys must still name.
            nested = {"law" if path[0] == "joints" else "kind": element}
        # Merging replaces a list as a whole, so a change of one element begins with a copy.
        if isinstance(path[depth + 1], int) and nested is None:
            nested = deepcopy(list(element)) if isinstance(element, Sequence) else []
        table[part] = {} if nested is None else nested
        table = table[part]
    if isinstance(path[-1], int):
        _element(element, path[-1], path)
    table[path[-1]] = value


def _element(element: Any, part: str | int, path: Key) -> Any:
    """Entry of a table at a key, None if it has none, or element of a list at an index."""
    if isinstance(part, int):
        size = len(element) if isinstance(element, Sequence) else 0
        if part >= size:
            raise JointplayError(f"{dotted(path)} is not in the scenario, which has {size} of them")
        return element[part]
    return element.get(part) if isinstance(element, Mapping) else None
