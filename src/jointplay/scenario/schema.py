"""JSON schema of scenario files, for completion, explanations and checks in editors."""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Union, get_args, get_origin

from jointplay.base.schema import (
    Family,
    Field,
    explanations,
    family_of,
    fields_at,
    fields_of,
    is_word,
    names_of,
)
from jointplay.scenario.declarations import NOT_IN_A_CASE, Model

CASE = "Case"
"""Name of the schema's definition of a case."""
MOST_CHOICES = 9
"""Number of words from which the help of a key lists only some (judged: fewer fit two lines)."""
_TYPES = {bool: "boolean", int: "integer", str: "string"}


def schema() -> dict[str, Any]:
    """JSON schema of a scenario file: its keys, words and units, with those of cases.

    It requires no key: any case can give what the file's own tables leave out, and only both
    together must be complete. `jointplay check` tells what is missing.
    """
    tables = SchemaTables()
    known = tables.properties(Model)
    definitions = tables.definitions
    definitions[CASE] = {
        "type": "object",
        "description": "What is different in this case.",
        "properties": {key: about for key, about in known.items() if key not in NOT_IN_A_CASE},
        "additionalProperties": False,
    }
    known["cases"] = {
        "type": "object",
        "description": "Changes of the tables above, by name; all cases are run.",
        "additionalProperties": {"$ref": f"#/$defs/{CASE}"},
    }
    known["sweep"] = {
        "type": "object",
        "description": "Many cases: axes over keys of the tables above; see docs/sweeps.md.",
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "$defs": definitions,
        "title": "Scenario",
        "description": inspect.getdoc(Model),
        "type": "object",
        "properties": known,
        "additionalProperties": False,
    }


def explain(keys: Sequence[Sequence[str]]) -> tuple[str, str, str]:
    """Help text of keys that one option sets together, with choices, units and defaults.

    Returns:
        The text, the unit of a number, and the placeholder of a value that is no number.
    """
    fields = list(fields_at(Model, keys[0]))
    text = next((text for _, text in fields if text), "")
    text = " ".join(text.split()).replace("`", "").rstrip(".")
    text = text if re.match(r"Hertz|[A-Z](\w*'s|[A-Z])", text) else text[:1].lower() + text[1:]
    field = fields[0][0]
    names = [word for each, _ in fields if each.choices for word in each.choices[1]]
    choices = list(dict.fromkeys(names))
    if choices and len(choices) < MOST_CHOICES:
        text = f"{text}: {', '.join(choices)}" if text else ", ".join(choices)
    elif choices:
        text = f"{text or 'one'} of {len(choices)}, see docs/laws.md: {', '.join(choices[:3])} ..."
    units = [unit.replace("*", " ") for unit in field.units if unit]
    if units and "[" not in text:
        text += f" [{' or '.join(units)}]"
    known = [default for key in keys if (default := _default_of(key))]
    text += f" (default {' '.join(dict.fromkeys(known))})" if known else ""
    if is_word(field.hint):
        return text, "", "WORD" if choices else keys[0][-1].upper()
    return text, field.units[0], ""


def _default_of(key: Sequence[str]) -> str:
    """Default of a key, as text; empty if there is none."""
    field = next((each for each, _ in fields_at(Model, key, deep=False)), None)
    if field is None:
        return ""
    value, allowed = field.default, field.choices[1] if field.choices else ()
    if isinstance(allowed, Mapping) and not isinstance(value, str):
        value = next((word for word, stands_for in allowed.items() if stands_for == value), None)
    if isinstance(value, float | int):
        return f"{value:g}"
    return value if isinstance(value, str) else ""


class SchemaTables:
    """Schemas of types, as `base.schema.check` takes their values."""

    def __init__(self) -> None:
        self.definitions: dict[str, Any] = {}
        """Schemas of tables, by name; others refer to them."""

    def properties(self, kind: type, preset: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Schemas of a class's fields, with explanations, except fields that are `preset`."""
        texts = explanations(kind)
        return {
            name: self.field(field, texts.get(name, ""))
            for name, field in fields_of(kind).items()
            if name not in (preset or {})
        }

    def field(self, field: Field, text: str) -> dict[str, Any]:
        """Schema of a field that `text` explains."""
        about = self.of(field.hint)
        if field.choices is not None:
            enum = {"enum": list(field.choices[1])}
            about = enum if is_word(field.hint) else {"anyOf": [enum, about]}
        if field.units != ("",) and "[" not in text:
            text = f"{text} [{' or '.join(field.units)}]".strip()
        return {**about, "description": text} if text else about

    def of(self, kind: Any) -> dict[str, Any]:
        """Schema of a type."""
        origin, parts = get_origin(kind), get_args(kind)
        if origin in (Union, types.UnionType):
            several = [self.of(part) for part in parts if part is not type(None)]
            return several[0] if len(several) == 1 else {"anyOf": several}
        if origin is Literal:
            return {"enum": list(parts)}
        if origin is not None:
            return self.collection(origin, parts)
        if kind is float:
            return {"type": ["number", "string"]}
        if kind in _TYPES:
            return {"type": _TYPES[kind]}
        family = family_of(kind)
        if family is not None:
            return self.family(family)
        table = self.table(kind, kind.__name__)
        names = list(names_of(kind))
        return {"anyOf": [{"enum": names}, table]} if names else table

    def collection(self, origin: Any, parts: tuple[Any, ...]) -> dict[str, Any]:
        """Schema of a table or list with entries of a type."""
        if issubclass(origin, Mapping):
            return {"type": "object", "additionalProperties": self.of(parts[1])}
        array: dict[str, Any] = {"type": "array", "items": self.of(parts[0])}
        if origin is tuple and parts[-1] is not Ellipsis:
            array |= {"minItems": len(parts), "maxItems": len(parts)}
        return array

    def family(self, family: Family) -> dict[str, Any]:
        """Schema of a family: a table for each member, and the bare word where that is enough."""
        tables, bare = [], []
        for word in family.members:
            preset = family.member(word)
            title = preset.title or preset.kind.__name__
            tables.append(self.table(preset.kind, title, (family.key, word), preset.given))
            if not any(field.required for field in fields_of(preset.kind).values()):
                bare.append(word)
        number = [{"type": "number"}] if family.number else []
        return {"anyOf": [*([{"enum": bare}] if family.bare else []), *number, *tables]}

    def table(
        self,
        kind: type,
        title: str,
        word: tuple[str, str] | None = None,
        preset: Mapping[str, Any] | None = None,
    ) -> dict[str, Any]:
        """Reference to the schema of a class's table, which is added to the definitions."""
        if title not in self.definitions:
            chosen = {word[0]: {"const": word[1]}} if word else {}
            self.definitions[title] = {
                "type": "object",
                "description": inspect.getdoc(kind) or "",
                "properties": chosen | self.properties(kind, preset),
                "additionalProperties": False,
            }
        return {"$ref": f"#/$defs/{title}"}
