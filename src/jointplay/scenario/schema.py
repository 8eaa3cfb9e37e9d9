"""JSON schema of scenario files: completion, explanations and checks in editors."""

from __future__ import annotations

import inspect
import types
from collections.abc import Mapping
from typing import Any, Literal, Union, get_args, get_origin

from jointplay.base.schema import (
    Family,
    Field,
    explanations,
    family_of,
    fields_of,
    is_word,
    names_of,
)
from jointplay.scenario.declarations import NOT_IN_A_CASE, Model

CASE = "Case"
_TYPES = {bool: "boolean", int: "integer", str: "string"}


def schema() -> dict[str, Any]:
    """Keys, words and units of a scenario file, cases included.

    What is missing it does not say: any case can give what the file's own tables leave out, and
    only both together must be complete. `jointplay check` tells.
    """
    tables = SchemaTables()
    own = tables.properties(Model)
    definitions = tables.definitions
    definitions[CASE] = {
        "type": "object",
        "description": "What is different in this case.",
        "properties": {key: said for key, said in own.items() if key not in NOT_IN_A_CASE},
        "additionalProperties": False,
    }
    own["cases"] = {
        "type": "object",
        "description": "Changes of the tables above, by name; all cases are run.",
        "additionalProperties": {"$ref": f"#/$defs/{CASE}"},
    }
    own["sweep"] = {
        "type": "object",
        "description": "Many cases: axes over keys of the tables above; see docs/sweeps.md.",
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "$defs": definitions,
        "title": "Scenario",
        "description": inspect.getdoc(Model),
        "type": "object",
        "properties": own,
        "additionalProperties": False,
    }


class SchemaTables:
    """Schemas of types as `check` takes them; those of tables are put aside by name."""

    def __init__(self) -> None:
        self.definitions: dict[str, Any] = {}

    def properties(self, kind: type, preset: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Schemas of a class's fields but for those that are `preset`, with explanations."""
        texts = explanations(kind)
        return {
            name: self.field(field, texts.get(name, ""))
            for name, field in fields_of(kind).items()
            if name not in (preset or {})
        }

    def field(self, field: Field, text: str) -> dict[str, Any]:
        said = self.of(field.hint)
        if field.choices is not None:
            words = {"enum": list(field.choices[1])}
            said = words if is_word(field.hint) else {"anyOf": [words, said]}
        if field.units != ("",) and "[" not in text:
            text = f"{text} [{' or '.join(field.units)}]".strip()
        return {**said, "description": text} if text else said

    def of(self, kind: Any) -> dict[str, Any]:
        origin, parts = get_origin(kind), get_args(kind)
        if origin in (Union, types.UnionType):
            several = [self.of(one) for one in parts if one is not type(None)]
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
        if issubclass(origin, Mapping):
            return {"type": "object", "additionalProperties": self.of(parts[1])}
        array: dict[str, Any] = {"type": "array", "items": self.of(parts[0])}
        if origin is tuple and parts[-1] is not Ellipsis:
            array |= {"minItems": len(parts), "maxItems": len(parts)}
        return array

    def family(self, family: Family) -> dict[str, Any]:
        """Schema of what a word chooses: tables, and bare words for those that need no more."""
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
        """Reference to the schema of a class, which is put among the definitions."""
        if title not in self.definitions:
            chosen = {word[0]: {"const": word[1]}} if word else {}
            self.definitions[title] = {
                "type": "object",
                "description": inspect.getdoc(kind) or "",
                "properties": chosen | self.properties(kind, preset),
                "additionalProperties": False,
            }
        return {"$ref": f"#/$defs/{title}"}
