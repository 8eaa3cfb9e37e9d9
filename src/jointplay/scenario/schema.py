"""JSON schema of scenario files: completion, explanations and checks in editors."""

from __future__ import annotations

from typing import Any

from jointplay.scenario.model import NOT_IN_A_CASE, Model

CASE = "Case"


def schema() -> dict[str, Any]:
    """Keys, words and units of a scenario file, cases included.

    What is missing it does not say: any case can give what the file's own tables leave out, and
    only both together must be complete. `jointplay check` tells.
    """
    made = Model.model_json_schema()
    made = _tidy(made)
    tables = made["properties"]
    made["$defs"][CASE] = {
        "type": "object",
        "description": "What is different in this case.",
        "properties": {key: text for key, text in tables.items() if key not in NOT_IN_A_CASE},
        "additionalProperties": False,
    }
    tables["cases"] = {
        "type": "object",
        "description": "Changes of the tables above, by name; all cases are run.",
        "additionalProperties": {"$ref": f"#/$defs/{CASE}"},
    }
    tables["sweep"] = {
        "type": "object",
        "description": "Many cases: axes over keys of the tables above; see docs/sweeps.md.",
    }
    return {"$schema": "http://json-schema.org/draft-07/schema#", **made, "title": "Scenario"}


def _tidy(part: Any, names: bool = False) -> Any:
    """`part` without what does not hold of tables whose cases are not yet merged.

    Args:
        part: of a schema.
        names: its keys are names of tables or keys, not words of the schema.
    """
    if isinstance(part, list):
        return [_tidy(one) for one in part if one != {"type": "null"}]
    if not isinstance(part, dict):
        return part
    drop = () if names else ("required", "title", "x-unit")
    tidy = {
        # A table that does not say its kind yet can be any.
        "anyOf" if key == "oneOf" and not names else key: _tidy(
            value, not names and key in ("properties", "$defs")
        )
        for key, value in part.items()
        if key not in drop and not (key == "default" and not names and value is None)
    }
    unit = part.get("x-unit")
    if unit and not names:
        said = tidy.get("description", "")
        tidy["description"] = said if "[" in said else f"{said} [{unit}]"
        tidy["description"] = tidy["description"].strip()
    return tidy
