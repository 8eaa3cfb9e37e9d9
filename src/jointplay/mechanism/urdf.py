"""Reading a URDF: what ships with the package, and whether a file describes a possible robot."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from jointplay.errors import JointplayError, MissingName
from jointplay.mechanism.declared import Declared, Transmission
from jointplay.mechanism.entry import JointEntry

_INSTALLED = Path(__file__).parents[1] / "shipped"
_CHECKOUT = Path(__file__).parents[3] / "urdf"

MOST_LINKS, MOST_MOVING = 5000, 250
"""Most links and moving joints of a robot: to set up its equations grows with their cube."""

MOST_LETTERS = 200
"""Longest name of a link or joint."""

_NO_AXIS = ("fixed", "floating", "ball")
"""Types of joint whose axis means nothing; exporters write zeros there."""

INERTIA_TOLERANCE = 1e-6
"""Violation of the triangle inequality that passes for rounding, relative to the largest moment."""


def shipped(name: str) -> Path:
    """Path of a file that ships with the package, such as ``scara.urdf`` or ``scara_motion.csv``.

    Raises:
        MissingName: no such file; the message lists those that exist.
    """
    folder = _INSTALLED if _INSTALLED.is_dir() else _CHECKOUT
    path = folder / name
    if not path.is_file():
        names = sorted(file.name for file in folder.glob("*") if file.is_file())
        raise MissingName("shipped file", name, names)
    return path


@dataclass(frozen=True)
class Description:
    """A URDF's text, with its joints by name in the order of the file."""

    path: Path
    text: str
    joints: dict[str, JointEntry]
    links: tuple[str, ...]
    stored: bool = False
    """From a result: a file of its own, with a folder that it may take meshes from, it has not."""

    @property
    def revolute(self) -> list[str]:
        """Names of the joints that can get clearance."""
        return [j.name for j in self.joints.values() if j.turns]

    @property
    def transmissions(self) -> dict[str, Transmission]:
        """What stands between motors and joints, by joint."""
        return Declared(self.text).transmissions


def read(path: str | Path, allow_unphysical: Collection[str] = ()) -> Description:
    """Read a URDF and check every inertia.

    Args:
        path: the file.
        allow_unphysical: names of links whose inertia is used although no rigid body has it.

    Raises:
        JointplayError: the file is missing or malformed, its links do not form one tree, or a
            link's inertia is impossible (the message names the link and its principal moments).
    """
    path = Path(path)
    return parse(_text(path), path, allow_unphysical)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise JointplayError(f"cannot read the URDF {str(path)!r}: {reason}") from None


def elements(path: Path) -> ElementTree.Element:
    """A URDF's elements, unchecked.

    Raises:
        JointplayError: the file cannot be read, or is no URDF.
    """
    return _root(_text(path), path)


def _root(text: str, path: Path) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise JointplayError(f"the URDF {str(path)!r} is not well-formed XML: {error}") from None
    if root.tag != "robot":
        raise JointplayError(f"the URDF {str(path)!r} has the root <{root.tag}>, expected <robot>")
    return root


def parse(text: str, path: Path, allow_unphysical: Collection[str] = ()) -> Description:
    """Check the URDF `text`, naming `path` in errors; see `read`.

    The same text is read once: what is returned is shared, and must not be changed.
    """
    return _parsed(text, path, tuple(allow_unphysical))


@lru_cache(maxsize=32)
def _parsed(text: str, path: Path, allow_unphysical: tuple[str, ...]) -> Description:
    root = _root(text, path)
    tags = root.findall("link")
    if not tags:
        raise JointplayError(f"the URDF {str(path)!r} has no links")
    moving = sum(joint.get("type") != "fixed" for joint in root.findall("joint"))
    for number, most, what in (
        (len(tags), MOST_LINKS, "links"),
        (moving, MOST_MOVING, "moving joints"),
    ):
        if number > most:
            raise JointplayError(
                f"the URDF {str(path)!r} has {number} {what}; at most {most} are possible"
            )
    links = {link.get("name", ""): link for link in tags}
    for kind in ("link", "joint"):
        _check_names(kind, [one.get("name", "") for one in root.findall(kind)])
    _check_placements(root)
    for name in allow_unphysical:
        if name not in links:
            raise MissingName("link", name, links)
    faults = impossible_inertias(root)
    wrong = [name for name in faults if name not in allow_unphysical]
    if wrong:
        flag = f"--allow-unphysical {','.join(wrong)}"
        rest = f" (impossible too: {', '.join(wrong[1:])}; all: {flag})" if wrong[1:] else ""
        raise JointplayError(faults[wrong[0]] + rest)
    joints = {}
    declared = Declared(text)
    followers, _ = leaders(root)
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        _check_limit(joint, name)
        dynamics = joint.find("dynamics")
        joints[name] = JointEntry(
            name,
            joint.get("type", ""),
            _link(joint, "parent", links),
            _link(joint, "child", links),
            _number(dynamics, "friction", f"joint {name!r}", 0.0),
            _number(dynamics, "damping", f"joint {name!r}", 0.0),
            name in followers,
            declared,
        )
    _check_tree(path, links, joints.values())
    return Description(path, text, joints, tuple(links))


def _check_limit(joint: ElementTree.Element, name: str) -> None:
    """Refuse limits that are no numbers; they may be infinite."""
    limit = joint.find("limit")
    for key in ("lower", "upper", "effort", "velocity"):
        text = "0" if limit is None else limit.get(key, "0")
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if np.isnan(value):
            raise JointplayError(f"{key} of the limit of joint {name!r} is no number: {text!r}")


def leaders(root: ElementTree.Element) -> tuple[dict[str, str], dict[str, str]]:
    """Joint that each joint mimics: those that exist, and those that do not.

    Raises:
        JointplayError: numbers that are none, or joints that in the end follow themselves.
    """
    followers: dict[str, str] = {}
    astray: dict[str, str] = {}
    joints = {joint.get("name", "") for joint in root.findall("joint")}
    for joint in root.findall("joint"):
        name, mimic = joint.get("name", ""), joint.find("mimic")
        if mimic is None:
            continue
        for key, default in (("multiplier", 1.0), ("offset", 0.0)):
            _number(mimic, key, f"joint {name!r}: mimic", default)
        leader = mimic.get("joint", "")
        (followers if leader in joints else astray)[name] = leader
    for name in followers:
        way = [name]
        while way[-1] in followers:
            way.append(followers[way[-1]])
            if way[-1] in way[:-1]:
                ring = " - ".join(way[way.index(way[-1]) :])
                raise JointplayError(f"joints mimic each other in a ring: {ring}")
    return followers, astray


def _check_names(kind: str, names: Sequence[str]) -> None:
    """Refuse names that are missing, given twice, or that no one could write in a message."""
    seen: set[str] = set()
    for name in names:
        if not name:
            raise JointplayError(f"a {kind} of the URDF has no name")
        if len(name) > MOST_LETTERS or not name.isprintable():
            shown = name if len(name) <= MOST_LETTERS else f"{name[:40]}..."
            raise JointplayError(
                f"the {kind} {shown!r}: a name has at most {MOST_LETTERS} printable characters"
            )
        if name in seen:
            raise JointplayError(f"two {kind}s of the URDF are called {name!r}")
        seen.add(name)


def _check_placements(root: ElementTree.Element) -> None:
    """Refuse origins and axes that are not three finite numbers, and axes of no direction."""
    for link in root.findall("link"):
        owner = f"link {link.get('name', '')!r}"
        for origin in link.findall("*/origin"):
            _check_origin(origin, owner)
    for joint in root.findall("joint"):
        owner = f"joint {joint.get('name', '')!r}"
        for origin in joint.findall("origin"):
            _check_origin(origin, owner)
        axis = joint.find("axis")
        if axis is None or joint.get("type") in _NO_AXIS:
            continue
        if not any(_three(axis, "xyz", f"{owner}: axis", "1 0 0")):
            raise JointplayError(
                f"{owner} has the axis {axis.get('xyz')!r}, which points nowhere; give a direction"
            )


def _check_origin(origin: ElementTree.Element, owner: str) -> None:
    for key in ("xyz", "rpy"):
        _three(origin, key, f"{owner}: origin {key}", "0 0 0")


def _three(element: ElementTree.Element, key: str, what: str, default: str) -> list[float]:
    text = element.get(key, default)
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != 3 or not np.isfinite(values).all():
        raise JointplayError(f"{what} must be three finite numbers, got {text!r}")
    return values


def impossible_inertias(root: ElementTree.Element) -> dict[str, str]:
    """What is wrong with the inertias that no rigid body has, by link."""
    faults = {}
    for link in root.findall("link"):
        name, inertial = link.get("name", ""), link.find("inertial")
        if inertial is not None:
            try:
                _check_inertia(name, inertial)
            except JointplayError as error:
                faults[name] = str(error)
    return faults


def _link(joint: ElementTree.Element, end: str, links: Collection[str]) -> str:
    element = joint.find(end)
    name = "" if element is None else element.get("link", "")
    if name not in links:
        raise MissingName(f"link (the {end} of joint {joint.get('name', '')!r})", name, links)
    return name


def _check_tree(path: Path, links: Collection[str], joints: Iterable[JointEntry]) -> None:
    """Refuse links that do not hang together as one tree."""
    above: dict[str, JointEntry] = {}
    for joint in joints:
        if joint.child in above:
            raise JointplayError(
                f"the URDF {str(path)!r} is no tree: link {joint.child!r} is the child of the "
                f"joints {above[joint.child].name!r} and {joint.name!r}; describe one of them as a "
                "loop instead"
            )
        above[joint.child] = joint
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise JointplayError(
            f"the URDF {str(path)!r} falls apart: {', '.join(map(repr, roots))} have no parent; "
            "exactly one link must have none"
        )
    good: set[str] = set(roots)
    for link in links:
        way = [link]
        while way[-1] not in good:
            way.append(above[way[-1]].parent)
            if way[-1] in way[:-1]:
                ring = " - ".join(way[way.index(way[-1]) :])
                raise JointplayError(
                    f"the URDF {str(path)!r} is cyclic: {ring}; describe one of these joints as a "
                    "loop instead"
                )
        good.update(way)


def _number(
    element: ElementTree.Element | None, key: str, owner: str, default: float | None = None
) -> float:
    text = None if element is None else element.get(key)
    if text is None:
        if default is None:
            raise JointplayError(f"{owner} has no {key} in its URDF")
        return default
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise JointplayError(f"{owner}: {key} must be a finite number, got {text!r}")
    return value


def _check_inertia(name: str, inertial: ElementTree.Element) -> None:
    owner = f"link {name!r}"
    mass = _number(inertial.find("mass"), "value", owner)
    element = inertial.find("inertia")
    xx, yy, zz, xy, xz, yz = (
        _number(element, f"i{axes}", owner) for axes in ("xx", "yy", "zz", "xy", "xz", "yz")
    )
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if mass == 0.0 and not tensor.any():
        return  # a frame without mass
    if mass <= 0.0:
        raise JointplayError(f"{owner} has the mass {mass:g} kg; it must be positive")
    low, middle, high = np.linalg.eigvalsh(tensor)
    moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg m2"
    hint = f"; correct it, or allow this link by name (--allow-unphysical {name})"
    if low <= 0.0:
        raise JointplayError(f"{owner} has {moments}: not positive definite{hint}")
    if high > (low + middle) * (1.0 + INERTIA_TOLERANCE):
        raise JointplayError(
            f"{owner} has {moments}: no rigid body has {high:.4g} > {low:.4g} + {middle:.4g}{hint}"
        )
