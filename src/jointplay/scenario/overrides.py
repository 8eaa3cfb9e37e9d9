"""Settings: single keys of a scenario given on top of its file, as by ``--set KEY=VALUE``.

What a robot's own file says beyond a URDF is settings, too.
"""

from __future__ import annotations

import copy
import json
import tomllib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError
from jointplay.base.origins import ASSUMED, FILE, GIVEN
from jointplay.base.pairs import divided
from jointplay.base.units import not_lost, toml_text
from jointplay.scenario.places import Key, dotted

if TYPE_CHECKING:
    from jointplay.model.urdf import Description


@dataclass(frozen=True)
class Setting:
    """A key, its value as TOML has it, and who gave it."""

    key: tuple[str, ...]
    value: Any
    source: str
    """What errors name: the option that gave it."""
    origin: str = GIVEN
    """``given``, ``file`` of the robot; of presets ``measured``, ``seen``, ``estimated``;
    ``assumed`` if it stands for what nobody gave."""

    why: str = ""
    """Where a number was seen, or why it was chosen."""

    @property
    def assumed(self) -> bool:
        return self.origin == ASSUMED


def parse(text: str) -> Setting:
    """A setting written as ``KEY=VALUE``: a dotted key, and its value as in a scenario file.

    Text needs no quotes, for shells take them away: ``drive.kind=prescribed``.

    Raises:
        JointplayError: there is no key, or no value.
    """
    name, value = divided(text)
    if "\n" in name or not name.strip() or value is None or not value.strip():
        raise JointplayError(
            f"--set {toml_text(text)}: give KEY=VALUE, such as "
            'joints.joint_b.radial_clearance="0.3 mm" or integration.step=5e-6'
        )
    name, value = name.strip(), value.strip()
    try:
        table = tomllib.loads(f"{name} = 0")
    except (tomllib.TOMLDecodeError, RecursionError):
        raise JointplayError(
            f"--set {toml_text(text)}: {toml_text(name)} is not a key; parts are joined by dots, "
            "and quoted where they have other signs than letters, digits, - and _; the shell needs "
            "quotes of its own around that: --set 'joints.\"left elbow\".restitution=0.8'"
        ) from None
    key = []
    here: Any = table
    while isinstance(here, dict):
        ((part, here),) = here.items()
        key.append(part)
    return Setting(tuple(key), _value(value), f"--set {name}")


def with_names(settings: Iterable[Setting], names: Collection[str]) -> list[Setting]:
    """Settings in which parts of keys that spell one of `names` together are that name.

    Shells take quotes away: ``joints."joint_0.0".ideal`` comes as ``joints.joint_0.0.ideal``.
    """
    spelled = {tuple(name.split(".")): name for name in names if "." in name}
    found = []
    for setting in settings:
        key: list[str] = []
        rest = setting.key
        while rest:
            fits = [parts for parts in spelled if rest[: len(parts)] == parts]
            parts = max(fits, key=len, default=rest[:1]) if key else rest[:1]
            key.append(spelled.get(parts, parts[0]))
            rest = rest[len(parts) :]
        found.append(replace(setting, key=tuple(key)))
    return found


def _value(text: str) -> Any:
    for written in (text, json.dumps(text, ensure_ascii=False)):
        try:
            table = tomllib.loads(f"value = {written}", parse_float=not_lost)
        except (ValueError, RecursionError):
            continue
        if set(table) == {"value"}:
            return table["value"]
    return text


def tree(settings: Iterable[Setting]) -> dict[str, Any]:
    """All settings as tables within tables; of two for one key the later counts."""
    root: dict[str, Any] = {}
    for setting in settings:
        here = root
        for part in setting.key[:-1]:
            below = here.get(part)
            if not isinstance(below, dict):
                below = here[part] = {}
            here = below
        here[setting.key[-1]] = copy.deepcopy(setting.value)  # later settings may reach into it
    return root


def given_by(settings: Iterable[Setting], path: Key) -> str | None:
    """Which setting gave the key at `path`, the last one of several; None if none did."""
    given = [one.source for one in settings if one.key and path[: len(one.key)] == one.key]
    return given[-1] if given else None


def setting_texts(settings: Iterable[Setting]) -> list[str]:
    """Settings as lines that `parse` reads, to be kept with a result."""
    return [f"{dotted(s.key)}={inline(s.value)}" for s in settings]


def as_toml(data: Mapping[str, Any]) -> str:
    """Tables as a TOML file has them: single keys first, then a section a table."""
    lines: list[str] = []
    _section((), data, lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def _section(path: Key, table: Mapping[str, Any], lines: list[str]) -> None:
    own = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    if path and (own or not table):
        lines += ["", f"[{dotted(path)}]"]
    lines += [f"{dotted((key,))} = {inline(value)}" for key, value in own.items()]
    for key, value in table.items():
        if isinstance(value, Mapping):
            _section((*path, key), value, lines)


def inline(value: Any) -> str:
    """A value as TOML writes it in one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(inline, value))}]"
    if isinstance(value, float):
        return repr(float(value))  # also of numpy's
    return json.dumps(value, ensure_ascii=False, default=str)


# The robot that settings make of its file, and what that file says beyond a URDF.


def description_of(place: str, settings: Sequence[Setting], folder: Path = Path()) -> Description:
    """A robot with what settings allow and hold; what else they say is read with the scenario."""
    robot = tree(settings).get("robot", {})
    names = {key: robot.get(key) for key in ("allow_unphysical", "fix")}
    allowed, fix = (one if isinstance(one, list) else [] for one in names.values())
    arguments = robot.get("xacro")
    arguments = arguments if isinstance(arguments, dict) else {}
    from jointplay.model.fixing import with_fixed  # imports Pinocchio
    from jointplay.model.formats import read

    return with_fixed(read(place, allowed, folder, arguments), fix)


def settings_beyond(description: Description, ideal: bool) -> list[Setting]:
    """What a robot's file says beyond a URDF, of joints that move; play unless it is `ideal`."""
    settings = []
    for table, rows in description.beyond.tables.items():
        for name, row in rows.items():
            if table == "robot":
                settings.append(Setting((table, name), row, "the MJCF", FILE))
                continue
            if row.get("joint", name) not in description.moving:
                continue
            if table == "gears" and ideal:
                row = row | {"play": 0.0}
            settings.append(Setting((table, name), row, "the MJCF", FILE))
    return settings
