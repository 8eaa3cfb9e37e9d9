"""Robots by name: those that ship with this package, of example-robot-data, of robot_descriptions.

example-robot-data (BSD-3-Clause) is nothing but URDFs and meshes. A robot's name in it is that of
its URDF, in small letters and without ``_robot``; where two folders have a URDF of the same name,
the folder's name instead. Robots that it does not have are looked for in robot_descriptions
(`model.robot_descriptions`). The extra `robots` installs both.
"""

from __future__ import annotations

import difflib
import re
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

from jointplay.base.errors import JointplayError, MissingName, require_a, require_known
from jointplay.base.files import is_file
from jointplay.base.imports import how_to_install
from jointplay.model import robot_descriptions

PACKAGE = "example-robot-data"
SHIPPED = "jointplay:"
"""Marks the name of a file that ships with this package, as in ``jointplay:scara.urdf``."""
PREFIX = f"{PACKAGE}:"
"""Marks a robot's name where a path could stand, as in ``example-robot-data:ur5``."""

PREFIXES = (SHIPPED, PREFIX, robot_descriptions.PREFIX)
"""Prefixes of names that are no paths."""

SUFFIXES = (".urdf", ".xml", ".xacro")
"""Suffixes of files that describe robots."""

OWN = {"ar4": "ar4.urdf", "scara": "scara.urdf", "so101": "so101.urdf"}
"""Robots whose URDF ships with this package, by name; they hide others of that name."""

_INSTALLED = Path(__file__).parents[1] / "shipped"
_CHECKOUT = Path(__file__).parents[3] / "urdf"
_FOLDER_SUFFIXES = ("_description", "_data", "_simple")


def shipped(name: str) -> Path:
    """Path of a file that ships with the package, such as ``scara.urdf`` or ``scara_motion.csv``.

    Raises:
        MissingName: no such file; the message lists those that exist.
    """
    require_a("name", name, "str")
    folder = _INSTALLED if _INSTALLED.is_dir() else _CHECKOUT
    names = sorted(file.name for file in folder.glob("*") if file.is_file())
    require_known("shipped file", name, names)
    return folder / name


def share() -> Path:
    """Folder of example-robot-data's files; `robots/` is in it.

    Raises:
        JointplayError: the package is not installed; the message says how to install it.
    """
    wheels = [Path(entry) / "cmeel.prefix" for entry in sys.path]
    for prefix in [*wheels, Path(sys.prefix)]:  # the last is that of conda and ROS
        folder = prefix / "share" / PACKAGE
        if (folder / "robots").is_dir():
            return folder
    raise JointplayError(
        f"the robots of {PACKAGE} are not installed; install them (131 MB to download) with: "
        f"{how_to_install('robots')} (uvx: --from '.[robots]')"
    )


@cache
def _table(folder: Path) -> dict[str, Path]:
    """URDFs of the robots in a folder, by the robot's name."""
    families = defaultdict(list)
    for path in sorted(folder.glob("*/*/*.urdf")):
        text = path.read_text(encoding="utf-8", errors="replace")
        if "<link" in text:  # a file without links is a fragment for others to include
            families[_normal(path.stem).removesuffix("_robot")].append(path)
    table = {}
    for name, paths in families.items():
        for path in paths:
            home = path.relative_to(folder).parts[0]
            for suffix in _FOLDER_SUFFIXES:
                home = home.removesuffix(suffix)
            table[name if len(paths) == 1 else _normal(home)] = path
    return dict(sorted(table.items()))


def _normal(name: str) -> str:
    return name.lower().replace("-", "_").replace(".", "_")


class Source(NamedTuple):
    """A file that describes a robot."""

    path: Path
    usual: dict[str, str]
    """Default arguments of a xacro."""


def robots() -> tuple[str, ...]:
    """Names of all robots that ship or are of example-robot-data; errors are those of `share`."""
    return tuple(sorted({*OWN, *_table(share() / "robots")}))


def robot_urdf(name: str) -> Path:
    """URDF of a robot such as ``ur5`` or ``panda``; upper case and ``-`` for ``_`` do no harm.

    ``hyq`` is enough for ``hyq_no_sensors`` if that is the only variant.

    Raises:
        JointplayError: the package is not installed.
        MissingName: no such robot; the message lists those whose names resemble it, or all.
    """
    normalized = _normal(name)
    if normalized in OWN:
        return shipped(OWN[normalized])
    table = _table(share() / "robots")
    variants = [known for known in table if known.startswith(f"{normalized}_")]
    if normalized not in table and len(variants) == 1:
        return table[variants[0]]
    if normalized not in table:
        known_too = [f"{robot_descriptions.PREFIX}{name_}" for name_ in robot_descriptions.names()]
        similar = [known for known in (*table, *known_too) if normalized and normalized in known]
        similar = similar or difflib.get_close_matches(normalized, table)
        raise MissingName("robot", name, similar or table, "" if not similar else ", and others")
    return table[normalized]


def resolve(place: str | Path, folder: Path = Path()) -> Path:
    """Path of a file named as such, or ``jointplay:NAME``, or as a robot with its package.

    A relative path begins in `folder`; errors are those of `shipped` and `source_of`.
    """
    text = str(place)
    if text.startswith(SHIPPED):
        return shipped(text.removeprefix(SHIPPED))
    if text.startswith(PREFIX):
        return robot_urdf(text.removeprefix(PREFIX))
    if text.startswith(robot_descriptions.PREFIX):
        return robot_descriptions.find(text.removeprefix(robot_descriptions.PREFIX))[0]
    return folder / place


def source_of(place: str | Path, folder: Path = Path()) -> Source:
    """File of a robot named as for `resolve`, or by its name alone: ``ur5``, ``xarm6``.

    Raises:
        JointplayError: a package is not installed, or a robot's files are not in its cache.
        MissingName: no such robot.
    """
    text = str(place)
    if isinstance(place, str) and re.fullmatch(r"[\w+-]+", text) and not is_file(folder / text):
        text = with_package(text)
    if text.startswith(robot_descriptions.PREFIX):
        return Source(*robot_descriptions.find(text.removeprefix(robot_descriptions.PREFIX)))
    return Source(resolve(text, folder), {})


def with_package(name: str) -> str:
    """A robot's name with the prefix of the package that has it; errors as of `robot_urdf`."""
    try:
        robot_urdf(name)
    except JointplayError:
        full = robot_descriptions.full_name(name)
        if full is None:
            raise
        return f"{robot_descriptions.PREFIX}{full}"
    shipped_file = OWN.get(_normal(name))
    return f"{PREFIX}{name}" if shipped_file is None else f"{SHIPPED}{shipped_file}"


def is_robot(place: str) -> bool:
    """Whether `place` names a robot rather than a scenario file."""
    named = place.startswith((PREFIX, robot_descriptions.PREFIX))
    if named or place.lower().endswith(SUFFIXES):
        return True
    if place.lower().endswith(".toml") or is_file(Path(place)):
        return False
    try:
        with_package(place)
    except JointplayError:  # a scenario; its reader tells if there is no such file
        return False
    return True
