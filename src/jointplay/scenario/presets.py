"""What is publicly known of robots' joints, and classes to choose from where nothing is.

    jointplay robots --presets
    jointplay run so101 --preset
    jointplay budget ur5 --preset ur-like --whole industrial

    import jointplay as jp
    robot = jp.presets.preset("so101").mechanism()

Each is a file in ``data/``: tables of a scenario, and for each number whether it was seen in a
public source, estimated from one, or assumed.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError, MissingName
from jointplay.model.urdf import Description
from jointplay.scenario.overrides import Setting

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.simulation.loads.drive import Drive

__all__ = ["ORIGINS", "Origin", "Preset", "preset", "preset_of", "presets"]
_TABLES = {"bearing": "joints", "gear": "gears", "drive": "drives", "friction": "joint_friction"}
"""Tables of a scenario by what a preset calls a joint's."""
ORIGINS = ("seen", "estimated", "assumed")
"""What a number can be."""


@dataclass(frozen=True)
class Origin:
    """Where a number of a preset comes from."""

    key: str
    value: str
    origin: str
    """One of `ORIGINS`."""
    source: str

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
    every: Mapping[str, Any]
    """Tables of each of its joints, and their names; empty if `ordered` has them."""
    ordered: tuple[Mapping[str, Any], ...]
    """Tables by the order of joints from the base on; the last is for all that follow."""
    origins: tuple[Origin, ...]

    @property
    def assumed(self) -> bool:
        return all(one.origin == "assumed" for one in self.origins)

    def tables(self, description: Description) -> dict[str, dict[str, Any]]:
        """Tables of a scenario for a robot: ``joints``, ``gears``, ``drives``, by joint.

        Raises:
            JointplayError: the robot has none of its joints.
        """
        able = ("revolute", "continuous")
        turning = [name for name, one in description.joints.items() if one.kind in able]
        if self.every:
            names = [name for name in self.every["joints"] if name in description.joints]
            if not names:
                raise JointplayError(
                    f"preset {self.name!r} is for the joints {', '.join(self.every['joints'])}, "
                    f"and {description.path.name} has none of them"
                )
            own: list[tuple[str, Mapping[str, Any]]] = [(name, self.every) for name in names]
        else:
            holds = description.joints
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
        from jointplay.scenario.robot import description_of, robot_place, robot_scenario

        place = robot or self.robot
        if place is None:
            raise JointplayError(f"preset {self.name!r} is for any arm: give a robot")
        own = [Setting(("robot", key), value, key) for key, value in options.items()]
        settings = self.settings(description_of(robot_place(str(place)), own))
        return robot_scenario(str(place), settings=[*settings, *own], still=True).mechanism()

    def drives(self, description: Description) -> dict[str, Drive]:
        """Drives that it knows, by joint; see `tables`."""
        from jointplay.base.schema import read as make
        from jointplay.simulation.loads.drive import Drive

        tables = self.tables(description).get("drives", {})
        return {name: make(Drive, one) for name, one in tables.items()}

    def __str__(self) -> str:
        whom = f" ({', '.join(self.robots)})" if self.robots else " (any arm)"
        lines = [f"{self.name}{whom}: {self.words}", f"    publicly known: {self.known}"]
        return "\n".join([*lines, *(f"    {one}" for one in self.origins)])


@cache
def _presets() -> dict[str, Preset]:
    found = {}
    for path in sorted((Path(__file__).parent / "data").glob("*.toml")):
        with path.open("rb") as file:
            data = tomllib.load(file)
        head = data["preset"]
        found[path.stem] = Preset(
            path.stem,
            head["words"],
            head["known"],
            tuple(head["robots"]),
            head.get("robot"),
            head["errors"],
            data.get("every", {}),
            tuple(data.get("joint", ())),
            tuple(Origin(**one) for one in data["origin"]),
        )
    return found


def presets() -> list[str]:
    """Names of all presets."""
    return list(_presets())


def preset(name: str) -> Preset:
    """A preset by its name.

    Raises:
        MissingName: none of that name; the nearest are named.
    """
    known = _presets()
    if name not in known:
        raise MissingName("preset", name, known)
    return known[name]


def preset_of(robot: str) -> Preset:
    """The preset for a robot, by its short name such as ``so101``.

    Raises:
        JointplayError: nothing is publicly known of its joints; the message has what to choose.
    """
    fitting = [one for one in _presets().values() if robot in one.robots]
    for one in fitting:
        if not one.assumed:
            return one
    classes = [one.name for one in fitting]
    classes += [name for name, one in _presets().items() if not one.every and name not in classes]
    raise JointplayError(
        f"nothing is publicly known of the joints of {robot!r}; choose what they may be like: "
        + ", ".join(f"--preset {name}" for name in classes)
    )
