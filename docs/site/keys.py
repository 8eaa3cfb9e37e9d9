"""The reference of all keys of scenario files, made from the classes that read them."""

import dataclasses
from pathlib import Path
from typing import get_args

import jinja2

from jointplay.accuracy.robot_errors import JointErrors, RobotErrors
from jointplay.base.schema import (
    Preset,
    explanations,
    family_of,
    fields_of,
    is_word,
    names_of,
)
from jointplay.model.beams import FlexibleLink
from jointplay.model.gear import Gearing
from jointplay.model.linkage import Linkage, LinkageLink, LinkageSlider
from jointplay.physics.contact.film import FilmLaw
from jointplay.physics.contact.law import FrictionLaw, NormalForceLaw
from jointplay.physics.joints import Clearance
from jointplay.scenario.declarations import (
    HeldPayload,
    IntegrationTable,
    LoopEnds,
    MotionTable,
    Output,
    Robot,
)
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive, JointFriction

KINDS = (
    *(
        Robot,
        Linkage,
        LinkageLink,
        LinkageSlider,
        LoopEnds,
        Clearance,
        NormalForceLaw,
        FrictionLaw,
        FilmLaw,
        MotionTable,
        Drive,
    ),
    *(JointFriction, Gearing, FlexibleLink, Load, HeldPayload),
    *(RobotErrors, JointErrors, IntegrationTable, Output),
)
"""Classes whose keys have a table on the page."""
IN_A_LINE = (NormalForceLaw, FrictionLaw, FilmLaw, Drive, Load)
"""Families of which each member has a line with all its keys."""


def members_of(kind):
    """Classes of a family by word, with the keys that the word leaves open; or just the class."""
    family = family_of(kind)
    members = {"": kind} if family is None else family.members
    found = {}
    for word, member in members.items():
        preset = member if isinstance(member, Preset) else Preset(member, "", {})
        fields = fields_of(preset.kind)
        keys = {name: one for name, one in fields.items() if name not in preset.given}
        found[word] = preset.kind, keys
    return found


def units(field):
    return f" [{' or '.join(field.units)}]".replace("*", " ") if field.units != ("",) else ""


def default_of(field):
    """What a key is if not given, as a file would say it; empty if the explanation says it."""
    if field.required:
        return "required"
    value = field.default
    if field.choices and not is_word(field.hint):
        value = next((word for word, one in dict(field.choices[1]).items() if one == value), value)
    if value is None:
        family = family_of(field.hint)
        value = None if family is None else family.default
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`' if value else ""
    if isinstance(value, tuple):
        return f"`[{', '.join(f'{one:g}' for one in value)}]`"
    return f"{value:g}" if isinstance(value, int | float) else ""


def inner_keys(hint):
    """Keys of a table that a key holds, if it holds one of a single class."""
    for part in (hint, *get_args(hint)):
        if dataclasses.is_dataclass(part) and family_of(part) is None:
            named = (f"`{name}`{units(one)}" for name, one in fields_of(part).items())
            return f" Table: {', '.join(named)}."
    return ""


def meaning(kind, name, field):
    text = explanations(kind).get(name, "").replace("``", "`").rstrip(".")
    text += units(field) if "[" not in text else ""
    words = [f"`{word}`" for word in (field.choices[1] if field.choices else ())]
    if not all(word in text for word in words):
        text += f": {', '.join(words)}"
    parts = (field.hint, *get_args(field.hint))
    if not text:
        text = next((f"A {family.noun}" for part in parts if (family := family_of(part))), "")
    if any(map(names_of, parts)):
        text = f"{text}. By name, or a table".removeprefix(". ")
    text = f"{text}.{inner_keys(field.hint)}".replace("a table. Table", "a table")
    return text.removeprefix(".").strip().replace("|", "\\|")


def table(kind):
    """A line for each key; of a family with the words that have it."""
    members = members_of(kind)
    several = len(members) > 1
    lines = ["| key | kinds | meaning | default |" if several else "| key | meaning | default |"]
    lines.append("| --- | --- | --- | --- |" if several else "| --- | --- | --- |")
    if several:
        family = family_of(kind)
        words = ", ".join(f"`{word}`" for word in members)
        lines.append(f"| `{family.key}` | all | {words} | `{family.default}` |")
    done = set()
    for owner, keys in members.values():
        for name, field in keys.items():
            inner = inner_keys(field.hint)  # the same key can hold different tables
            if (name, inner) in done:
                continue
            done.add((name, inner))
            having = [
                word for word, (_, own) in members.items()
                if name in own and inner_keys(own[name].hint) == inner
            ]  # fmt: skip
            among = "all" if len(having) == len(members) else ", ".join(having)
            cells = [f"`{name}`", *([among] if several else [])]
            cells += [meaning(owner, name, field), default_of(field)]
            lines.append(f"| {' | '.join(cells)} |")
    return lines


def in_a_line(kind):
    """A line for each member of a family, with its keys, their units and defaults."""
    family = family_of(kind)
    same = {}
    for word, (_, keys) in members_of(kind).items():
        parts = []
        for name, field in keys.items():
            if name == "source":  # which only results have
                continue
            default = default_of(field)
            if field.choices and is_word(field.hint):
                others = [word for word in field.choices[1] if word != field.default]
                default = ", ".join([default, *(f'`"{word}"`' for word in others)])
            default = f" ({default})" if default else ""
            parts.append(f"`{name}`{units(field)}{default}")
        same.setdefault(", ".join(parts) or "none", []).append(f"`{word}`")
    lines = [f"| `{family.key}` | keys |", "| --- | --- |"]
    return lines + [f"| {', '.join(words)} | {keys} |" for keys, words in same.items()]


def page():
    """The page, as Markdown."""
    tables = {
        kind.__name__: "\n".join((in_a_line if kind in IN_A_LINE else table)(kind))
        for kind in KINDS
    }
    text = Path(__file__).with_name("keys.md.jinja").read_text(encoding="utf-8")
    return jinja2.Template(text, keep_trailing_newline=True).render(keys=tables)
