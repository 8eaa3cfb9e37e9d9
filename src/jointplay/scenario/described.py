"""A robot's own file: the robot that settings make of it, and what it says beyond a URDF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jointplay.base.origins import FILE
from jointplay.model.formats import read
from jointplay.model.urdf import Description
from jointplay.scenario.overrides import Setting, tree


def description_of(place: str, settings: Sequence[Setting], folder: Path = Path()) -> Description:
    """A robot with what settings allow and hold; what else they say is read with the scenario."""
    robot = tree(settings).get("robot", {})
    names = {key: robot.get(key) for key in ("allow_unphysical", "fix")}
    allowed, fix = (one if isinstance(one, list) else [] for one in names.values())
    arguments = robot.get("xacro")
    arguments = arguments if isinstance(arguments, dict) else {}
    from jointplay.model.fixing import with_fixed  # imports Pinocchio

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
