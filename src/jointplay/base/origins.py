"""Values and their origins: who gave each, or which rule did, and what another would change."""

from __future__ import annotations

import json
from collections.abc import Mapping
from textwrap import shorten
from typing import NamedTuple

from jointplay.base.tables import Table

GIVEN, FILE, SEEN, ASSUMED, GUESSED = "given", "file", "seen", "assumed", "guessed"
"""Of what the user said, in options or in files; what a robot's own file has; what was seen in
a catalogue; what nobody said, by a rule that holds or by one that may not. Numbers of presets are
measured, seen, estimated or assumed."""

Key = tuple[str, ...]
Origins = Mapping[Key, tuple[str, str]]
"""Origin and source of values, by key of a scenario; of a whole table, too."""


def given(origins: Origins, *path: str) -> set[str]:
    """Names of what somebody gave in the table at `path`."""
    return {
        key[len(path)]
        for key, (origin, _) in origins.items()
        if origin != ASSUMED and key[: len(path)] == path and len(key) > len(path)
    }


_WIDTH = 60
"""Letters of a source that a table shows."""

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
"""What another value would change, by the last part of its key."""


class Value(NamedTuple):
    """A value, or the same one of several joints."""

    key: str
    """As scenarios have it: ``joints.elbow.radial_clearance``."""
    value: str
    """With its unit."""
    origin: str
    """``given``, ``file``, ``measured``, ``seen``, ``estimated`` or ``assumed``."""
    source: str
    """The option, file, preset or rule."""

    @property
    def assumed(self) -> bool:
        return self.origin in (ASSUMED, GUESSED)

    @property
    def effect(self) -> str:
        """What another value would change."""
        name = self.key.rpartition(".")[2]
        return EFFECTS.get(name, EFFECTS.get(self.key.partition(".")[0], ""))


def from_text(text: str) -> list[Value]:
    """The values that `to_text` wrote."""
    return [Value(*map(str, fields)) for fields in json.loads(text)]


def to_text(values: list[Value]) -> str:
    """Values as result files have them."""
    return json.dumps(values, ensure_ascii=False)


def value_table(values: list[Value]) -> Table:
    """Values for readers, those that were assumed first."""
    rows = [("value", "is", "by", "another would change")]
    for v in sorted(values, key=lambda v: not v.assumed):
        by = v.source if v.assumed else f"{v.origin}: {v.source}"
        rows.append((v.key, shorten(v.value, _WIDTH), shorten(by, _WIDTH), v.effect))
    return Table.of_texts(rows)
