"""Robots people have: those of the package example-robot-data, by short names.

The package (BSD-3-Clause) is nothing but URDFs and meshes; `pip install 'jointplay[robots]'` brings
it. A robot's name is that of its URDF, in small letters and without ``_robot``; where two folders
have a URDF of the same name, the folder's name instead.
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from jointplay.errors import JointplayError, MissingName

PACKAGE = "example-robot-data"
PREFIX = f"{PACKAGE}:"
"""Marks a robot's name where a path could stand, as in ``example-robot-data:ur5``."""

_NO_MASS = 1e-12
"""A joint whose entry on the mass matrix's diagonal is no larger moves nothing [kg m^2 or kg]."""

_FOLDER_SUFFIXES = ("_description", "_data", "_simple")


def share() -> Path:
    """Folder of the package's data; `robots/` is in it.

    Raises:
        JointplayError: the package is not installed; the message says how to install it.
    """
    found = [Path(sys.prefix) / "share" / PACKAGE]  # conda, ROS
    try:
        wheel = distribution(PACKAGE).locate_file("cmeel.prefix")
        found.insert(0, Path(str(wheel)) / "share" / PACKAGE)
    except PackageNotFoundError:
        pass
    for folder in found:
        if (folder / "robots").is_dir():
            return folder
    raise JointplayError(
        f"the robots of {PACKAGE} are not installed; install them (131 MB to download) with: "
        "pip install 'jointplay[robots]'"
    )


@cache
def _table(folder: Path) -> dict[str, Path]:
    """The URDF of each robot, by name."""
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


def names() -> tuple[str, ...]:
    """Names of all robots.

    Raises:
        JointplayError: see `share`.
    """
    return tuple(_table(share() / "robots"))


def robot_urdf(name: str) -> Path:
    """URDF of a robot such as ``ur5`` or ``panda``; upper case and ``-`` for ``_`` do no harm.

    Raises:
        JointplayError: the package is not installed.
        MissingName: no such robot; the message lists those whose names resemble it, or all.
    """
    table = _table(share() / "robots")
    wanted = _normal(name)
    if wanted not in table:
        similar = [known for known in table if wanted and wanted in known]
        raise MissingName("robot", name, similar or table, "" if not similar else ", and others")
    return table[wanted]


def resolve(place: str | Path) -> Path:
    """Path of a URDF that is given as such, or as ``example-robot-data:NAME``.

    Raises:
        JointplayError, MissingName: see `robot_urdf`.
    """
    text = str(place)
    return robot_urdf(text.removeprefix(PREFIX)) if text.startswith(PREFIX) else Path(place)


@dataclass(frozen=True)
class Survey:
    """What a robot is made of, and how far it can be simulated; found by loading it."""

    name: str
    path: Path
    moving: dict[str, str]
    """URDF type of each joint that is not fixed, by name, from the base outwards."""
    serial: bool = False
    """Its revolute joints lie on one path from the base: an arm."""
    unphysical: tuple[str, ...] = ()
    """Links whose inertia no rigid body has; to be allowed by name."""
    mimics: tuple[str, ...] = ()
    """Joints that follow others, unless a motion or drive says otherwise."""
    massless: tuple[str, ...] = ()
    """Joints that move no mass: nothing can be simulated unless they are fixed."""
    problem: str = ""
    """Why it cannot be loaded at all; empty if it can."""

    @property
    def revolute(self) -> tuple[str, ...]:
        """Joints that can get clearance as revolute joints."""
        return tuple(n for n, kind in self.moving.items() if kind in ("revolute", "continuous"))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is not as it should be, in words."""
        found = []
        if self.problem:
            found.append(self.problem)
        if self.massless:
            found.append(f"cannot be simulated: {_list(self.massless)} move no mass")
        if self.unphysical:
            found.append(f"impossible inertia, to be allowed by name: {_list(self.unphysical)}")
        if self.mimics:
            found.append(f"joints that follow others: {_list(self.mimics)}")
        return tuple(found)


def survey(name: str) -> Survey:
    """Load the robot `name` and look at what it is made of.

    Raises:
        JointplayError, MissingName: see `robot_urdf`.
    """
    import numpy as np
    import pinocchio as pin

    from jointplay.mechanism.mechanism import Mechanism
    from jointplay.mechanism.urdf import impossible_inertias

    path = robot_urdf(name)
    root = ElementTree.parse(path).getroot()
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    moving = {n: joint.get("type", "") for n, joint in joints.items()}
    moving = {n: kind for n, kind in moving.items() if kind != "fixed"}
    mimics = tuple(n for n in moving if joints[n].find("mimic") is not None)
    unphysical = tuple(impossible_inertias(root))
    try:
        mechanism = Mechanism(path, allow_unphysical=unphysical)
    except JointplayError as error:
        return Survey(name, path, moving, False, unphysical, mimics, (), str(error))
    model = mechanism.model
    moving = {n: moving[n] for n in mechanism.coordinates}
    mass = pin.crba(model, mechanism.data, pin.neutral(model))
    massless = tuple(
        joint
        for joint, m in zip(mechanism.coordinates, np.diag(mass), strict=True)
        if m <= _NO_MASS
    )
    turning = [model.getJointId(n) for n in moving if moving[n] in ("revolute", "continuous")]
    paths = [set(model.supports[joint]) for joint in turning]
    serial = bool(paths) and max(paths, key=len).issuperset(turning)
    return Survey(name, path, moving, serial, unphysical, mimics, massless)


def _list(words: tuple[str, ...], most: int = 4) -> str:
    rest = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + rest
