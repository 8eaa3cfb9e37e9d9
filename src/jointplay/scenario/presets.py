"""Presets: numbers of robots' joints as publicly known, or of a class of robots to choose from.

    jointplay robots --presets
    jointplay run so101 --preset
    jointplay budget ur5 --preset ur-like --whole industrial
    jointplay budget ur5 --preset my_arm.toml

    import jointplay as jp
    robot = jp.presets.preset("so101").mechanism()

A preset is a file, in ``data/`` or one's own: tables of a scenario by joint, and for each number
its origin: measured on this robot, seen in a public source, estimated from one, or assumed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.accuracy.robot_errors import CLASSES
from jointplay.base.errors import (
    JointplayError,
    MissingKey,
    MissingName,
    require_a,
    require_known,
    within,
)
from jointplay.base.files import read_text
from jointplay.base.origins import ASSUMED
from jointplay.base.schema import ask_scales, check, choice, make, quantity, read, shortest
from jointplay.model.gear import Gearing
from jointplay.model.urdf import Description
from jointplay.physics.joints import Clearance
from jointplay.scenario.reading import Setting, as_toml, lines, parsed, said_at
from jointplay.simulation.loads.drive import Drive, JointFriction

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism

__all__ = ["LEFT_OUT", "ORIGINS", "Origin", "Preset", "preset", "preset_of", "presets"]
_TABLES = {"bearing": "joints", "gear": "gears", "drive": "drives", "friction": "joint_friction"}
"""Tables of a scenario by the part of a joint that a preset has."""
_KINDS: dict[str, Any] = {
    "bearing": Clearance,
    "gear": Gearing,
    "drive": Drive,
    "friction": JointFriction,
}
"""Classes of the parts of a joint."""
ORIGINS = ("measured", "seen", "estimated", "assumed")
"""Possible origins of a number."""
QUANTITIES = {
    "gear.play": "gear_play",
    "gear.stiffness": "gear_compliance",
    "friction.coulomb": "dry_friction",
}
"""Names that identification has for numbers of a joint; for other numbers it has their own."""
_UNSAID = "what the file says"
_NONE = "no preset: tables such as [joint.elbow.gear] or [joint.elbow.bearing] are needed"
LEFT_OUT = {
    "openarm": "Damiao's manuals of its motors state ratios of 9, 40 and 10, but no backlash",
    "dummy": "its strain-wave gears (ratios 50, 30, 30, 24, 30, 50) have no stated maker or size",
}
"""Robots without a preset because too little is public, and what is known of them."""


@dataclass(frozen=True, kw_only=True)
class _Joint:
    """Tables of a joint as a scenario has them; keys that they lack may be given elsewhere."""

    bearing: Any = None
    gear: Any = None
    drive: Any = None
    friction: Any = None


@dataclass(frozen=True, kw_only=True)
class _Joints(_Joint):
    """Tables of each of several joints."""

    joints: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class _Head:
    """Table [preset] of a file."""

    description: str = ""
    """The robot, or class of robots, in a line."""
    known: str = _UNSAID
    """What is publicly known of the robot, in words."""
    robots: tuple[str, ...] = ()
    """Short names of the robots that the preset is for; none: any arm."""
    robot: str | None = None
    """URDF that the preset was made for, if there is one."""
    errors: str = choice("class of errors", CLASSES, default="")
    """Class of errors besides play (`accuracy.robot_errors`)."""


@dataclass(frozen=True, kw_only=True)
class Origin:
    """The origin of a number of a preset."""

    key: str
    """Key of the number: ``gear.play``, or with the joint before it; or several, with commas."""
    value: str
    """The number as text, for readers."""
    origin: str = choice("origin", ORIGINS)
    """Whether it was measured on this robot, seen in a source, estimated from one, or assumed."""
    source: str
    """The source in which it was seen, or from which it was estimated."""
    interval: tuple[float, ...] = quantity("", default=())
    """Ends of the 95 % interval of a number that was measured on this robot [SI]."""

    def __post_init__(self) -> None:
        if self.interval and (len(self.interval) != 2 or self.interval[0] > self.interval[1]):
            raise JointplayError(
                f"interval must have a lower and an upper end, got {list(self.interval)}",
                where=("interval",),
            )

    def __str__(self) -> str:
        return f"{self.key} {self.value}: {self.origin}; {self.source}"


@dataclass(frozen=True, kw_only=True)
class _File:
    """The format of a preset's file; see `Preset`."""

    preset: _Head = _Head()
    every: _Joints | None = None
    joint: dict[str, _Joint] | list[_Joint] = field(default_factory=dict)
    origin: list[Origin] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Preset(_Head):
    """Bearings, gears, drives and friction of a robot's joints, or of a class of robots'.

    One of `every`, `ordered` and `named` has the tables.
    """

    name: str
    origins: tuple[Origin, ...]
    every: Mapping[str, Any] = field(default_factory=dict)
    """Tables for each of several joints, and under ``joints`` their names."""
    ordered: tuple[Mapping[str, Any], ...] = ()
    """Tables in the order of joints from the base on; the last is for all that follow."""
    named: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Tables by joint."""

    @property
    def assumed(self) -> bool:
        """Whether nothing in the preset has a source."""
        return all(origin.origin == "assumed" for origin in self.origins)

    @classmethod
    def of_mechanism(
        cls,
        mechanism: Mechanism,
        description: str,
        origins: Sequence[Origin],
        tables: Mapping[str, Mapping[str, Any]],
        robot: str | None = None,
    ) -> Preset:
        """Preset of the bearings and gears of a mechanism.

        Args:
            mechanism: the mechanism.
            description: a line on the robot.
            origins: origins of the numbers.
            tables: further tables by part, such as ``drive`` and ``friction``, and by joint.
            robot: name or path of the robot.
        """
        parts: dict[str, Mapping[str, Any]] = {
            "bearing": {
                name: shortest(Clearance, value)
                for name, value in mechanism.clearance.items()
                if name in mechanism.description.joints
            },
            "gear": {name: shortest(Gearing, value) for name, value in mechanism.gears.items()},
        }
        named: dict[str, dict[str, Any]] = {}
        for by_part in (parts, tables):
            for part, by_joint in by_part.items():
                for joint, table in by_joint.items():
                    named.setdefault(joint, {})[part] = table
        return cls(
            name=str(robot or description),
            description=description,
            known="what was measured on this robot, and what stood in its scenario",
            robot=robot,
            origins=tuple(origins),
            named=named,
        )

    @property
    def intervals(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Intervals of numbers measured on this robot, by joint and name in identification.

        A compliance has the reciprocal ends of a stiffness.
        """
        intervals = {}
        for origin in self.origins:
            if len(origin.interval) != 2:
                continue
            joint, _, number = origin.key.rpartition(".")
            joint, _, part = joint.rpartition(".")
            low, high = origin.interval
            name = QUANTITIES.get(f"{part}.{number}", number)
            if name.endswith("compliance") and name != number:
                low, high = (1.0 / end if end else math.inf for end in (high, low))
            intervals[joint, name] = low, high
        return intervals

    def _numbers(self) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
        """Each table of the preset: joint, empty if it is for several, part, and table."""
        for whose, tables in [
            ("", self.every),
            *(("", joint) for joint in self.ordered),
            *self.named.items(),
        ]:
            for part, table in tables.items():
                if part in _TABLES:
                    yield whose, part, table

    def lacks(self) -> list[str]:
        """Lines on what the preset lacks to be part of jointplay: origins of numbers, ..."""
        explained = {key.strip() for origin in self.origins for key in origin.key.split(",")}
        lines, held = [], set()
        for whose, part, table in self._numbers():
            at = f"{whose}." if whose else ""
            try:
                read(_KINDS[part], table)
            except JointplayError as error:
                lines.append(f"{at}{part}: {error}")
            for key in table:
                names = {part, f"{part}.{key}", f"{at}{part}", f"{at}{part}.{key}"}
                held |= names
                if key != "kind" and not names & explained:
                    lines.append(f'{at}{part}.{key} has no [[origin]] with key = "{part}.{key}"')
        lines += [
            f"{origin.key}: source is empty: where was it seen, or from what estimated?"
            for origin in self.origins
            if not origin.source.strip()
        ]
        lines += [f'[[origin]]: no number has the key "{key}"' for key in sorted(explained - held)]
        if not self.errors:
            lines.append(f"[preset]: errors is missing, one of {', '.join(CLASSES)}")
        if self.known == _UNSAID:
            lines.append("[preset]: known is missing: what is publicly known of the robot?")
        return lines

    def tables(self, description: Description) -> dict[str, dict[str, Any]]:
        """Tables of a scenario for a robot: ``joints``, ``gears``, ``drives``, ..., by joint.

        Raises:
            JointplayError: the robot does not have all joints of the preset.
        """
        holds = description.joints
        if self.every or self.named:
            tables_of = self.named or dict.fromkeys(self.every["joints"], self.every)
            if tables_of.keys().isdisjoint(holds):
                raise JointplayError(
                    f"preset {self.name!r} is for the joints {', '.join(tables_of)}, "
                    f"and {description.path.name} has none of them; its joints: {', '.join(holds)}"
                )
            for name in tables_of:
                require_known("joint", name, holds, f"; preset {self.name!r} names it")
            by_joint = list(tables_of.items())
        else:
            turning = sorted(
                description.revolute, key=lambda name: len([*description.above(holds[name].parent)])
            )
            last = len(self.ordered) - 1
            by_joint = [(name, self.ordered[min(k, last)]) for k, name in enumerate(turning)]
        by_table: dict[str, dict[str, Any]] = {}
        for name, tables in by_joint:
            for part, table in _TABLES.items():
                if part in tables:
                    by_table.setdefault(table, {})[name] = dict(tables[part])
        return by_table

    def settings(self, description: Description) -> list[Setting]:
        """Settings of a scenario for a robot, with their origins; see `tables`."""
        parts = {table: part for part, table in _TABLES.items()}
        settings = []
        for table, joints in self.tables(description).items():
            for joint, keys in joints.items():
                for key, value in keys.items():
                    about = self._origin(joint, parts[table], key)
                    settings.append(
                        Setting((table, joint, key), value, f"--preset {self.name}", *about)
                    )
        return settings

    def _origin(self, joint: str, part: str, key: str) -> tuple[str, str]:
        """Origin and source of a number of a joint: of the most special key that covers it."""
        names = (f"{joint}.{part}.{key}", f"{joint}.{part}", f"{part}.{key}", part)
        for name in names:
            for origin in self.origins:
                if name in (each.strip() for each in origin.key.split(",")):
                    return origin.origin, origin.source
        return ASSUMED, ""

    def mechanism(self, robot: str | Path | None = None, **options: Any) -> Mechanism:
        """A robot with the joints and gears of the preset.

        Args:
            robot: a URDF or a robot's name; None takes the preset's own.
            options: options of `Mechanism`.

        Raises:
            JointplayError: no robot is given and the preset has none.
        """
        from jointplay.scenario.reading import description_of
        from jointplay.scenario.robot import robot_place, robot_scenario

        place = robot or self.robot
        if place is None:
            raise JointplayError(f"preset {self.name!r} is for any arm: give a robot")
        robot_settings = [Setting(("robot", key), value, key) for key, value in options.items()]
        description = description_of(robot_place(str(place)), robot_settings)
        settings = [*self.settings(description), *robot_settings]
        return robot_scenario(str(place), settings=settings, moves=False).mechanism()

    def drives(self, description: Description) -> dict[str, Drive]:
        """Drives of a robot's joints in the preset, by joint; see `tables`."""
        tables = self.tables(description).get("drives", {})
        return {name: read(Drive, table) for name, table in tables.items()}

    def __str__(self) -> str:
        whom = f" ({', '.join(self.robots)})" if self.robots else " (any arm)"
        lines = [f"{self.name}{whom}: {self.description}", f"    publicly known: {self.known}"]
        return "\n".join([*lines, *(f"    {origin}" for origin in self.origins)])

    @property
    def text(self) -> str:
        """Text of the preset's file, which `preset` reads; for a preset with `named` tables."""
        head = {"description": self.description, "known": self.known, "robots": list(self.robots)}
        head |= {"robot": self.robot} if self.robot else {}
        head |= {"errors": self.errors} if self.errors else {}
        entries = [{k: v for k, v in vars(entry).items() if v != ()} for entry in self.origins]
        origins = [as_toml({"origin": entry}) for entry in entries]
        tables = as_toml({"preset": head, "joint": self.named})
        return "\n".join([tables, *(entry.replace("[origin]", "[[origin]]") for entry in origins)])


def _files() -> list[Path]:
    return sorted((Path(__file__).parent / "data").glob("*.toml"))


@cache
def _presets() -> dict[str, Preset]:
    """Presets that ship with the package, by name."""
    return {path.stem: _read(path, path.stem) for path in _files()}


@cache
def _known() -> dict[str, str]:
    """Names of presets with publicly known numbers, by the short names of their robots.

    The files are not checked, for that takes as long as the rest of a command's start.
    """
    known: dict[str, str] = {}
    for path in _files():
        data = parsed(read_text(path, "preset"), path)
        if any(origin["origin"] != ASSUMED for origin in data["origin"]):
            known |= dict.fromkeys(data["preset"].get("robots", ()), path.stem)
    return known


def _read(path: Path, name: str) -> Preset:
    """Read and check a preset's file."""
    text = read_text(path, "preset")
    data = parsed(text, path)
    try:
        file: _File = make(check(_File, data), objects=False)
        joint: Any = data.get("joint", {})
        is_named = isinstance(joint, dict)
        entries = joint.items() if is_named else enumerate(joint)
        places: dict[tuple[Any, ...], Any] = {("joint", key): tables for key, tables in entries}
        places |= {("every",): data["every"]} if "every" in data else {}
        for place, tables in places.items():
            for part in tables.keys() & _KINDS.keys():
                with within(*place, part):
                    try:
                        check(_KINDS[part], tables[part])
                        if isinstance(tables[part], Mapping):
                            ask_scales(_KINDS[part], tables[part])
                    except MissingKey as error:  # of the part itself may be given elsewhere
                        if error.where:
                            raise
        if bool(file.every) == bool(file.joint):
            raise JointplayError(
                _NONE if not file.every else "either [every] or [joint] is possible"
            )
    except JointplayError as error:
        raise JointplayError(f"{said_at(path, lines(text), error.where)}: {error}") from None
    return Preset(
        **vars(file.preset) | {"description": file.preset.description or path.name},
        name=name,
        origins=tuple(file.origin),
        every=_whole(data.get("every", {})),
        ordered=() if is_named else tuple(map(_whole, joint)),
        named={whose: _whole(part) for whose, part in joint.items()} if is_named else {},
    )


def _whole(tables: Mapping[str, Any]) -> dict[str, Any]:
    """A joint's tables, with a table in place of a bare word for its kind."""
    return {
        part: {"kind": table} if part in _TABLES and isinstance(table, str) else table
        for part, table in tables.items()
    }


def presets() -> list[str]:
    """Names of all presets."""
    return list(_presets())


def preset(name: str | Path) -> Preset:
    """A preset by its name, or from a file of one's own, whose path ends in ``.toml``.

    Raises:
        MissingName: there is no preset of that name; the message has the nearest names.
        JointplayError: the file is missing, or is no preset.
    """
    require_a("name", name, "str", "Path")
    text, known = str(name), _presets()
    if text.lower().endswith(".toml"):
        return _read(Path(name), text)
    if text not in known:
        why = f"; {text}: {LEFT_OUT[text]}" if text in LEFT_OUT else ""
        raise MissingName("preset", text, known, f", or a file of your own (NAME.toml){why}")
    return known[text]


def own_preset(robot: str) -> str:
    """Name of the preset with publicly known numbers of a robot's joints; empty without one."""
    return _known().get(_short(robot), "")


def _short(robot: str) -> str:
    """Short name of a robot, or of its file, as presets have it."""
    return Path(robot).name.partition(".")[0].lower()


def preset_of(robot: str) -> Preset:
    """The preset for a robot, by its short name such as ``so101``, or a file of that name.

    Raises:
        JointplayError: nothing is publicly known of its joints; the message has presets to choose.
    """
    require_a("robot", robot, "str", "Path")
    if known := own_preset(robot):
        return preset(known)
    name = _short(robot)
    classes = [candidate.name for candidate in _presets().values() if name in candidate.robots]
    classes += [
        kind for kind, candidate in _presets().items() if candidate.ordered and kind not in classes
    ]
    little = "too little" if name in LEFT_OUT else "nothing"
    why = f" ({LEFT_OUT[name]})" if name in LEFT_OUT else ""
    raise JointplayError(
        f"{little} is publicly known of the joints of {robot!r}{why}; choose what they may be "
        f"like: {', '.join(f'--preset {kind}' for kind in classes)}"
    )
