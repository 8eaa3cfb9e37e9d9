"""Keys of a scenario by their dotted names: whether they exist, their units, values put at them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cache
from typing import Any

from jointplay.core.errors import JointplayError
from jointplay.core.schema import Field, unknown_key
from jointplay.core.units import toml_text
from jointplay.scenario.model import Model
from jointplay.scenario.places import Key, dotted
from jointplay.scenario.schema import SchemaTables

_PART = re.compile(
    r"""(?P<quoted>"(?:[^"\\]|\\.)*"|'[^']*')|\[(?P<number>\d+)\]|(?P<word>[^."'\[\]]+)"""
)
"""A part of a key, quoted as in TOML where it has other signs than a word."""

NOT_SWEPT = ("title", "errors", "output", "cases", "sweep")
"""Tables over which no sweep goes; runs have no errors."""


def path_of(name: str) -> Key:
    """The path that ``joints.joint_b.friction.mu_d`` or ``payloads[1].mass`` names.

    Elements of lists are counted from 1 (`places.dotted`), in the path from 0.

    Raises:
        JointplayError: it names none.
    """
    parts: list[str | int] = []
    at = 0
    text = name if isinstance(name, str) else ""
    while at < len(text):
        part = _PART.match(text, at)
        if part is None:
            break
        quoted, number, word = part.groups()
        try:
            name = tomllib.loads(f"name = {quoted}")["name"] if quoted else (word or "").strip()
        except tomllib.TOMLDecodeError:  # an escape that TOML has not
            break
        if number and int(number) == 0:
            raise JointplayError(
                f"{toml_text(text)}: elements of lists are counted from 1; the first is "
                f"{text[:at]}[1]"
            )
        parts.append(int(number) - 1 if number else name)
        at = part.end()
        if at < len(text) and text[at] == ".":
            at += 1
    if not parts or at < len(text):
        raise JointplayError(
            f"{toml_text(name)} is not a key of a scenario; write it like "
            '"joints.joint_b.radial_clearance" or "payloads[1].mass"'
        )
    return tuple(parts)


class _Units(SchemaTables):
    """The schema of scenarios, with the units of its numbers where programs find them."""

    def field(self, field: Field, text: str) -> dict[str, Any]:
        """Schema of a field, the units at its numbers."""
        schema = super().field(field, text)
        _mark(schema, " or ".join(field.units))
        return schema


def _mark(node: Any, unit: str) -> None:
    """Note the unit at all numbers of a schema."""
    if node.get("type") == ["number", "string"]:
        node["x-unit"] = unit
    for inner in (*node.get("anyOf", ()), node.get("items"), node.get("additionalProperties")):
        if isinstance(inner, dict):
            _mark(inner, unit)


@cache
def _schema() -> Mapping[str, Any]:
    """JSON schema of scenarios, with units at its numbers."""
    tables = _Units()
    own = tables.properties(Model)
    return {"$defs": tables.definitions, "properties": own}


def _inside(node: Any) -> list[Mapping[str, Any]]:
    """The kinds of table or value that a part of the schema allows."""
    if "$ref" in node:
        return _inside(_schema()["$defs"][node["$ref"].rpartition("/")[2]])
    several = [one for word in ("anyOf", "oneOf", "allOf") for one in node.get(word, ())]
    return [kind for one in several for kind in _inside(one)] or [node]


def kinds(path: Key) -> list[Mapping[str, Any]]:
    """What the schema says of the values at `path`: one entry for each kind they can have.

    Raises:
        JointplayError: there is no such key; the nearest names are given.
    """
    here = [_schema()]
    for depth, part in enumerate(path):
        known: dict[str, None] = {}
        there: list[Mapping[str, Any]] = []
        for node in here:
            tables = node.get("properties", {})
            known |= dict.fromkeys(tables)
            if isinstance(part, int):
                there += _inside(node["items"]) if "items" in node else []
            elif part in tables:
                there += _inside(tables[part])
            elif isinstance(node.get("additionalProperties"), Mapping):
                there += _inside(node["additionalProperties"])
        if not there:
            where = f" in {dotted(path[:depth])}" if depth else ""
            if not known:
                raise JointplayError(
                    f"{dotted(path)}: {dotted(path[:depth])} has no keys of its own"
                )
            raise JointplayError(unknown_key(str(part), known) + where)
        here = there
    if path[0] in NOT_SWEPT:
        raise JointplayError(f"no sweep goes over {path[0]!r}")
    return here


def units_of(path: Key) -> tuple[str, ...] | None:
    """SI units that a quantity at `path` can have, ``("",)`` for a pure number; None: no quantity.

    Raises:
        JointplayError: there is no such key.
    """
    units: dict[str, None] = {}
    for kind in kinds(path):
        if kind.get("type") == ["number", "string"]:
            units |= dict.fromkeys(kind.get("x-unit", "").split(" or "))
    return tuple(units) or None


def is_whole(path: Key) -> bool:
    """Whether the key at `path` takes whole numbers."""
    return any(kind.get("type") == "integer" for kind in kinds(path))


def put(changes: dict[str, Any], base: Mapping[str, Any], path: Key, value: Any) -> None:
    """Set `path` to `value` in `changes`, which are to be merged onto the tables `base`.

    Raises:
        JointplayError: `base` has no such element of a list.
    """
    here: Any = changes
    under: Any = base
    for depth, part in enumerate(path[:-1]):
        under = _at(under, part, path[: depth + 1])
        before = here[part] if not isinstance(here, Mapping) or part in here else None
        if isinstance(under, str) and not isinstance(before, Mapping):
            before = {"law" if path[0] == "joints" else "kind": under}  # a bare word
        if isinstance(path[depth + 1], int) and before is None:
            before = deepcopy(list(under)) if isinstance(under, Sequence) else []
        here[part] = {} if before is None else before
        here = here[part]
    if isinstance(path[-1], int):
        _at(under, path[-1], path)
    here[path[-1]] = value


def _at(under: Any, part: str | int, path: Key) -> Any:
    """What tables have at a key or index; None if nothing."""
    if isinstance(part, int):
        size = len(under) if isinstance(under, Sequence) else 0
        if part >= size:
            raise JointplayError(f"{dotted(path)} is not in the scenario, which has {size} of them")
        return under[part]
    return under.get(part) if isinstance(under, Mapping) else None
