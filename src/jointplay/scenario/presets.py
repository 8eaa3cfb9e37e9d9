"""What is publicly known of robots' joints, and classes to choose from where nothing is.

    jointplay robots --presets
    jointplay run so101 --preset
    jointplay budget ur5 --preset ur-like --whole industrial
    jointplay budget ur5 --preset my_arm.toml

    import jointplay as jp
    robot = jp.presets.preset("so101").mechanism()

Each is a file, in ``data/`` or one's own: tables of a scenario, and for each number whether it was
measured on this robot, seen in a public source, estimated from one, or assumed.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError, MissingName, require_known
from jointplay.base.files import read_text
from jointplay.base.schema import one_of, quantity, read, shortest, unknown_key
from jointplay.model.gear import Gearing
from jointplay.model.urdf import Description
from jointplay.physics.joints import Clearance
from jointplay.scenario.overrides import Setting, as_toml

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.simulation.loads.drive import Drive

__all__ = ["LEFT_OUT", "ORIGINS", "Origin", "Preset", "preset", "preset_of", "presets"]
_TABLES = {"bearing": "joints", "gear": "gears", "drive": "drives", "friction": "joint_friction"}
"""Tables of a scenario by what a preset calls a joint's."""
_PARTS = ("preset", "every", "joint", "origin")
ORIGINS = ("measured", "seen", "estimated", "assumed")
"""What a number can be."""
QUANTITIES = {
    "gear.play": "gear_play",
    "gear.stiffness": "gear_compliance",
    "friction.coulomb": "dry_friction",
}
"""What measurements call numbers of a joint; of bearings as the number is called."""
_UNSAID = "what the file says"
LEFT_OUT = {
    "openarm": "Damiao's manuals of its motors state ratios of 9, 40 and 10, but no backlash",
    "dummy": "its strain-wave gears (ratios 50, 30, 30, 24, 30, 50) have no stated maker or size",
}
"""Robots of which too little is public for a preset, and what there is."""


@dataclass(frozen=True)
class Origin:
    """Where a number of a preset comes from."""

    key: str
    value: str
    origin: str
    """One of `ORIGINS`."""
    source: str
    interval: tuple[float, ...] = quantity("", default=())
    """Ends of the 95 % interval of one that was measured on this robot [SI]."""

    def __str__(self) -> str:
        return f"{self.key} {self.value}: {self.origin}; {self.source}"


@dataclass(frozen=True)
class Preset:
    """Joints of a robot, or of robots of a kind."""

    name: str
    words: str
    """What it is."""
    known: str
    """What is publicly known of it."""
    robots: tuple[str, ...]
    """Short names of robots that it is for; none: any arm."""
    robot: str | None
    """URDF that it was made for, if there is one."""
    errors: str
    """Class of errors besides play (`accuracy.robot_errors`)."""
    origins: tuple[Origin, ...]
    every: Mapping[str, Any] = field(default_factory=dict)
    """Tables of each of its joints, and their names; empty if `ordered` or `named` has them."""
    ordered: tuple[Mapping[str, Any], ...] = ()
    """Tables by the order of joints from the base on; the last is for all that follow."""
    named: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Tables by joint."""

    @property
    def assumed(self) -> bool:
        return all(one.origin == "assumed" for one in self.origins)

    @classmethod
    def of_mechanism(
        cls,
        mechanism: Mechanism,
        words: str,
        origins: Sequence[Origin],
        tables: Mapping[str, Mapping[str, Any]],
        robot: str | None = None,
    ) -> Preset:
        """The bearings and gears of a mechanism, as a preset of its own.

        Args:
            mechanism: whose joints.
            words: what it is.
            origins: where its numbers come from.
            tables: more of them, such as of ``drive`` and ``friction``, by what a preset calls
                them and by joint.
            robot: name or path of its robot.
        """
        parts: dict[str, Mapping[str, Any]] = {
            "bearing": {
                name: shortest(Clearance, one)
                for name, one in mechanism.clearance.items()
                if name in mechanism.description.joints
            },
            "gear": {name: shortest(Gearing, one) for name, one in mechanism.gears.items()},
        }
        named: dict[str, dict[str, Any]] = {}
        for some in (parts, tables):
            for part, by_joint in some.items():
                for joint, table in by_joint.items():
                    named.setdefault(joint, {})[part] = table
        known = "what was measured on this robot, and what stood in its scenario"
        return cls(str(robot or words), words, known, (), robot, "", tuple(origins), named=named)

    @property
    def intervals(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Of what was measured on this robot, by joint and quantity as measurements call it."""
        found = {}
        for one in self.origins:
            if len(one.interval) != 2:
                continue
            joint, _, number = one.key.rpartition(".")
            joint, _, part = joint.rpartition(".")
            low, high = one.interval
            name = QUANTITIES.get(f"{part}.{number}", number)
            if name.endswith("compliance") and name != number:
                low, high = (1.0 / end if end else math.inf for end in (high, low))
            found[joint, name] = low, high
        return found

    def _numbers(self) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
        """Each table: whose, part, what it holds; whose is empty where a table is for many."""
        for whose, tables in [
            ("", self.every),
            *(("", one) for one in self.ordered),
            *self.named.items(),
        ]:
            for part, table in tables.items():
                if part in _TABLES:
                    yield whose, part, table

    def lacks(self) -> list[str]:
        """What keeps it from being part of jointplay, a line each: numbers without origin, ..."""
        from jointplay.accuracy.robot_errors import CLASSES
        from jointplay.simulation.loads.drive import Drive, JointFriction

        kinds = {"bearing": Clearance, "gear": Gearing, "drive": Drive, "friction": JointFriction}
        said = {key.strip() for one in self.origins for key in one.key.split(",")}
        lines, held = [], set()
        for whose, part, table in self._numbers():
            at = f"{whose}." if whose else ""
            try:
                read(kinds[part], dict(table))
            except JointplayError as error:
                lines.append(f"{at}{part}: {error}")
            for key in table:
                names = {part, f"{part}.{key}", f"{at}{part}", f"{at}{part}.{key}"}
                held |= names
                if key != "kind" and not names & said:
                    lines.append(f'{at}{part}.{key} has no [[origin]] with key = "{part}.{key}"')
        for one in self.origins:
            if one.origin not in ORIGINS:
                lines.append(f"{one.key}: {one_of('origin', one.origin, ORIGINS)}")
            if not one.source.strip():
                lines.append(
                    f"{one.key}: source is empty: where was it seen, or from what estimated?"
                )
        lines += [f'[[origin]]: no number has the key "{key}"' for key in sorted(said - held)]
        if self.errors not in CLASSES:
            lines.append(f"[preset]: {one_of('errors', self.errors, CLASSES)}")
        if self.known == _UNSAID:
            lines.append("[preset]: known is missing: what is publicly known of the robot?")
        return lines

    def tables(self, description: Description) -> dict[str, dict[str, Any]]:
        """Tables of a scenario for a robot: ``joints``, ``gears``, ``drives``, by joint.

        Raises:
            JointplayError: the robot has none of its joints.
        """
        able, holds = ("revolute", "continuous"), description.joints
        if self.every or self.named:
            for name in self.named:
                require_known("joint", name, holds, f"; preset {self.name!r} names it")
            tables_of = self.named or dict.fromkeys(self.every["joints"], self.every)
            own = [(name, tables) for name, tables in tables_of.items() if name in holds]
            if not own:
                raise JointplayError(
                    f"preset {self.name!r} is for the joints {', '.join(tables_of)}, "
                    f"and {description.path.name} has none of them; its joints: {', '.join(holds)}"
                )
        else:
            turning = [name for name, one in holds.items() if one.kind in able]
            turning.sort(key=lambda name: len([*description.above(holds[name].parent)]))
            last = len(self.ordered) - 1
            own = [(name, self.ordered[min(k, last)]) for k, name in enumerate(turning)]
        found: dict[str, dict[str, Any]] = {}
        for name, tables in own:
            for part, table in _TABLES.items():
                if part in tables:
                    found.setdefault(table, {})[name] = dict(tables[part])
        return found

    def settings(self, description: Description) -> list[Setting]:
        return [
            Setting((table, joint, key), value, f"--preset {self.name}")
            for table, joints in self.tables(description).items()
            for joint, keys in joints.items()
            for key, value in keys.items()
        ]

    def mechanism(self, robot: str | Path | None = None, **options: Any) -> Mechanism:
        """A robot with these joints and gears.

        Args:
            robot: a URDF or a robot's name; None takes the preset's own.
            options: of `Mechanism`.

        Raises:
            JointplayError: no robot is given and the preset has none.
        """
        from jointplay.scenario.robot import at_rest, description_of, robot_place, robot_scenario

        place = robot or self.robot
        if place is None:
            raise JointplayError(f"preset {self.name!r} is for any arm: give a robot")
        own = [Setting(("robot", key), value, key) for key, value in options.items()]
        description = description_of(robot_place(str(place)), own)
        gears = self.tables(description).get("gears", {})
        settings = [*self.settings(description), *at_rest(gears, gears, description)]
        return robot_scenario(str(place), settings=[*settings, *own], still=True).mechanism()

    def drives(self, description: Description) -> dict[str, Drive]:
        """Drives that it knows, by joint; see `tables`."""
        from jointplay.simulation.loads.drive import Drive

        tables = self.tables(description).get("drives", {})
        return {name: read(Drive, one) for name, one in tables.items()}

    def __str__(self) -> str:
        whom = f" ({', '.join(self.robots)})" if self.robots else " (any arm)"
        lines = [f"{self.name}{whom}: {self.words}", f"    publicly known: {self.known}"]
        return "\n".join([*lines, *(f"    {one}" for one in self.origins)])

    @property
    def text(self) -> str:
        """The file that `preset` reads, of one with tables by joint."""
        head = {"words": self.words, "known": self.known, "robots": list(self.robots)}
        head |= {"robot": self.robot} if self.robot else {}
        head |= {"errors": self.errors} if self.errors else {}
        said = [{k: v for k, v in vars(one).items() if v != ()} for one in self.origins]
        origins = [as_toml({"origin": one}) for one in said]
        tables = as_toml({"preset": head, "joint": self.named})
        return "\n".join([tables, *(one.replace("[origin]", "[[origin]]") for one in origins)])


@cache
def _presets() -> dict[str, Preset]:
    folder = Path(__file__).parent / "data"
    return {path.stem: _read(path, path.stem) for path in sorted(folder.glob("*.toml"))}


def _read(path: Path, name: str) -> Preset:
    text = read_text(path, "preset")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise JointplayError(f"{path}: not a TOML file: {error}") from None
    for key in data:
        if key not in _PARTS:
            raise JointplayError(f"{path}: {unknown_key(key, _PARTS, ' of a preset')}")
    head, joint = data.get("preset", {}), data.get("joint", {})
    if not isinstance(head, dict) or not (joint or data.get("every")):
        raise JointplayError(
            f"{path}: no preset: tables such as [joint.elbow.gear] or [joint.elbow.bearing] are "
            "needed (docs/robots.md)"
        )
    named = joint if isinstance(joint, dict) else {}
    for whose, tables in named.items():
        for part in tables:
            if part not in _TABLES:
                words = unknown_key(part, _TABLES, f" of joint {whose!r}")
                raise JointplayError(f"{path}: {words}")
    return Preset(
        name,
        head.get("words", path.name),
        head.get("known", _UNSAID),
        tuple(head.get("robots", ())),
        head.get("robot"),
        head.get("errors", ""),
        tuple(read(Origin, one) for one in data.get("origin", ())),
        data.get("every", {}),
        () if named else tuple(joint),
        named,
    )


def presets() -> list[str]:
    """Names of all presets."""
    return list(_presets())


def preset(name: str | Path) -> Preset:
    """A preset by its name, or a file of one's own, a path that ends in ``.toml``.

    Raises:
        MissingName: none of that name; the nearest are named.
        JointplayError: the file is missing, or is none.
    """
    if str(name).lower().endswith(".toml"):
        return _read(Path(name), str(name))
    known = _presets()
    if name not in known:
        why = f"; {name}: {LEFT_OUT[str(name)]}" if name in LEFT_OUT else ""
        raise MissingName("preset", str(name), known, f", or a file of your own (NAME.toml){why}")
    return known[str(name)]


def preset_of(robot: str) -> Preset:
    """The preset for a robot, by its short name such as ``so101``, or a file of that name.

    Raises:
        JointplayError: nothing is publicly known of its joints; the message has what to choose.
    """
    name = Path(robot).name.partition(".")[0].lower()
    fitting = [one for one in _presets().values() if name in one.robots]
    for one in fitting:
        if not one.assumed:
            return one
    classes = [one.name for one in fitting]
    classes += [kind for kind, one in _presets().items() if one.ordered and kind not in classes]
    little = "too little" if name in LEFT_OUT else "nothing"
    why = f" ({LEFT_OUT[name]})" if name in LEFT_OUT else ""
    raise JointplayError(
        f"{little} is publicly known of the joints of {robot!r}{why}; choose what they may be "
        f"like: {', '.join(f'--preset {kind}' for kind in classes)}"
    )
