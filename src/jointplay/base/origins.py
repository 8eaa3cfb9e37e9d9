"""Origins of values: who or which rule gave each, and what another value would change."""

from __future__ import annotations

import json
from collections.abc import Mapping
from textwrap import shorten
from typing import NamedTuple

from jointplay.base.tables import Table

GIVEN, FILE, SEEN, ASSUMED, GUESSED = "given", "file", "seen", "assumed", "guessed"
"""Origins: given by the user, in options or in files; from the robot's own file; seen in a
catalogue; assumed, that is given by nobody, by a rule that holds; guessed, by a rule that may not
hold. Numbers of presets are measured, seen, estimated or assumed."""

Key = tuple[str, ...]
Origins = Mapping[Key, tuple[str, str]]
"""Origin and source of each value, by its key in the scenario, which may be that of a table."""


def given(origins: Origins, *path: str) -> set[str]:
    """Names in the table at `path` whose values were not assumed."""
    return {
        key[len(path)]
        for key, (origin, _) in origins.items()
        if origin != ASSUMED and key[: len(path)] == path and len(key) > len(path)
    }


_WIDTH = 60
"""Most characters of a value or source that a table shows."""

EFFECTS = {
    "radial_clearance": "the error, in proportion",
    "clearance": "the error, in proportion",
    "axial_clearance": "the error along the axis, and tilt",
    "bearing_radius": "stiffness of contacts; of short bearings, tilt",
    "bearing_length": "tilt, so the error far from the joint: in proportion to 1/length",
    "journal_length": "tilt",
    "restitution": "impacts and noise, hardly the error",
    "friction": "where it rests",
    "play": "play's part of the error, in proportion",
    "stiffness": "elasticity's part of the error, in proportion to 1/stiffness",
    "rotor_inertia": "peaks of fast motions",
    "damping": "how long teeth ring",
    "encoder": "whether drives take play and elasticity out: on the link they do",
    "kind": "the drive's own error",
    "bandwidth": "the drive's own error",
    "motion": "everything",
    "interpolation": "peaks between points",
    "tool": "what is measured",
    "gravity": "on which side joints rest",
    "start": "the first impacts",
    "payloads": "on which side joints rest, and elasticity's part",
    "joint_friction": "on which side teeth stop",
}
"""Effect of another value, by the last part of its key, or the first."""


class Value(NamedTuple):
    """A value, or one that several joints share."""

    key: str
    """Key in the scenario: ``joints.elbow.radial_clearance``."""
    value: str
    """Value with its unit."""
    origin: str
    """``given``, ``file``, ``measured``, ``seen``, ``estimated``, ``assumed`` or ``guessed``."""
    source: str
    """Option, file, preset or rule that gave it."""

    @property
    def assumed(self) -> bool:
        return self.origin in (ASSUMED, GUESSED)

    @property
    def effect(self) -> str:
        """Effect that another value would have."""
        name = self.key.rpartition(".")[2]
        return EFFECTS.get(name, EFFECTS.get(self.key.partition(".")[0], ""))


def from_text(text: str) -> list[Value]:
    """Read the values that `to_text` wrote."""
    return [Value(*map(str, fields)) for fields in json.loads(text)]


def to_text(values: list[Value]) -> str:
    """Write values as text, for result files."""
    return json.dumps(values, ensure_ascii=False)


def value_table(values: list[Value]) -> Table:
    """Table of values for readers, those that were assumed first."""
    rows = [("value", "is", "by", "another would change")]
    for v in sorted(values, key=lambda v: not v.assumed):
        by = v.source if v.assumed else f"{v.origin}: {v.source}"
        rows.append((v.key, shorten(v.value, _WIDTH), shorten(by, _WIDTH), v.effect))
    return Table.of_texts(rows)
