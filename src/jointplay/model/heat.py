"""Heat: links lengthen, journals and bores grow, and clearances change by the difference.

One temperature for a link, a journal or a bearing, and one for a whole run: a machine takes minutes
to become warm, and a run seconds. A curve over the time since the machine was switched on says how
warm it is at the moment of the run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_finite, require_known, within
from jointplay.base.schema import quantity
from jointplay.base.tables import few
from jointplay.base.units import plain_number
from jointplay.model.urdf import Description, read_again
from jointplay.physics.joints.base import Clearance
from jointplay.physics.joints.materials import material

if TYPE_CHECKING:
    from jointplay.model.loop import Loop

JOURNAL, BEARING = "journal", "bearing"


@dataclass(frozen=True, kw_only=True)
class JointHeat:
    """By how much the halves of a joint are warmer than when their clearance was measured."""

    journal: float = quantity("K", default=0.0)
    """The inner half [K]; of a rolling bearing its inner ring."""
    bearing: float = quantity("K", default=0.0)
    """The outer half [K]."""


@dataclass(frozen=True, kw_only=True)
class LinkHeat:
    """By how much a link, and what is fixed to it, is warmer than when it was measured."""

    warmer: float = quantity("K", default=0.0)
    """By how much [K]."""
    material: str | None = None
    """What it is made of, by name; if not given, that of [heat]."""


@dataclass(frozen=True, kw_only=True)
class Heat:
    """How warm a machine is.

    Clearances change by the growth of bore and journal, each with the expansion of its material
    (`Material.expansion`); a rolling bearing by its rings' difference of temperature. Links
    lengthen by the expansion of theirs.

    Raises:
        JointplayError: a material that is not known, or a curve without a time, or a time without.
    """

    joints: dict[str, JointHeat] = field(default_factory=dict)
    """Joints with clearance, by name."""
    links: dict[str, LinkHeat] = field(default_factory=dict)
    """Links, by name."""
    material: str = "aluminium"
    """What links are made of, by name."""
    curve: str | None = None
    """CSV with the header ``time_s,<link>,<joint>.journal,<joint>.bearing,...`` and temperature
    differences [K]; takes the place of the numbers above."""
    time: float | None = quantity("s", default=None, least=0.0)
    """When on this curve the run takes place."""

    def __post_init__(self) -> None:
        for where, name in [
            (("material",), self.material),
            *((("links", link, "material"), one.material) for link, one in self.links.items()),
        ]:
            if name is not None:
                with within(*where):
                    material(name)
        if (self.curve is None) != (self.time is None):
            missing, given = ("time", "curve") if self.time is None else ("curve", "time")
            raise JointplayError(f"{given} needs {missing} as well", where=(given,))

    def at_its_time(self, path: Path | None) -> Heat:
        """The same with the temperatures that its curve, at `path`, has at its time; else itself.

        Raises:
            JointplayError: no such file, a wrong header, a cell that is not a number, times that
                do not rise, or a time beyond the curve.
        """
        if path is None or self.time is None:
            return self
        header, table = _curve(path)
        time = table[:, 0]
        if not time[0] <= self.time <= time[-1]:
            raise JointplayError(
                f"the curve {str(path)!r} lasts from {time[0]:g} s to {time[-1]:g} s, "
                f"got {self.time:g} s",
                where=("time",),
            )
        joints, links = dict(self.joints), dict(self.links)
        for column, name in enumerate(header[1:], 1):
            warmer = float(np.interp(self.time, time, table[:, column]))
            joint, dot, half = name.rpartition(".")
            if dot and half in (JOURNAL, BEARING):
                now = joints.get(joint, JointHeat())
                joints[joint] = replace(now, **{half: warmer})
            else:
                links[name] = replace(links.get(name, LinkHeat()), warmer=warmer)
        return replace(self, joints=joints, links=links, curve=None, time=None)


def _of_fit(joint: Clearance) -> str:
    return f" (the middle of {joint.fitted}, whose limits do not count)" if joint.fitted else ""


def _curve(path: Path) -> tuple[list[str], np.ndarray]:
    rows = files.csv_rows(path, "curve")
    header = [cell.strip() for cell in rows[0][1]]
    if header[0] != "time_s" or len(header) < 2:
        raise JointplayError(
            f"{path}, line {rows[0][0]}: the header must be time_s and then links, JOINT.journal "
            f"or JOINT.bearing, got {','.join(header)!r}"
        )
    table = np.array([[_cell(path, number, cell) for cell in row] for number, row in rows[1:]])
    if len(table) < 2 or np.any(np.diff(table[:, 0]) <= 0.0):
        raise JointplayError(f"{path}: a curve needs two times or more, which rise")
    return header, table


def _cell(path: Path, number: int, cell: str) -> float:
    try:
        return require_finite("the value", plain_number(cell), "")
    except ValueError:
        raise JointplayError(f"{path}, line {number}: {cell.strip()!r} is not a number") from None


def warmed(
    description: Description, joints: Mapping[str, Clearance], loops: Mapping[str, Loop], heat: Heat
) -> tuple[Description, dict[str, Clearance], dict[str, Loop], list[str]]:
    """URDF, joints and loops as warm as `heat` is at its time, and what has changed, a line each.

    Raises:
        JointplayError: a joint or link that does not exist, a joint that seizes, or one whose kind
            has no clearance that heat changes.
    """
    notes = []
    hot = dict(joints)
    for name, one in heat.joints.items():
        with within("joints", name):
            require_known("joint with clearance", name, joints)
            if joints[name].ideal or not (one.journal or one.bearing):
                continue
            hot[name] = joints[name].warmed(one.journal, one.bearing)
        before, after = joints[name].play_words, hot[name].play_words
        notes.append(
            f"heat in {name}: journal {one.journal:g} K and bearing {one.bearing:g} K warmer: "
            f"clearance {before}, now {after}{_of_fit(joints[name])}"
        )
    growth = _growth(description, heat)
    if not growth:
        return description, hot, dict(loops), notes
    most = max(growth, key=lambda link: abs(growth[link]))
    notes.append(
        f"heat in {few([link for link in heat.links])}: lengths grow, most by "
        f"{1e6 * growth[most]:.4g} µm/m"
    )
    grown = {
        name: replace(
            loop,
            bearing_xyz=_longer(loop.bearing_xyz, growth.get(loop.bearing_link, 0.0)),
            journal_xyz=_longer(loop.journal_xyz, growth.get(loop.journal_link, 0.0)),
        )
        for name, loop in loops.items()
    }
    return _lengthened(description, growth), hot, grown, notes


def _longer(place: tuple[float, float, float], growth: float) -> tuple[float, float, float]:
    x, y, z = (one * (1.0 + growth) for one in place)
    return x, y, z


def _growth(description: Description, heat: Heat) -> dict[str, float]:
    """Relative growth of each link that is warmer, and of what is fixed to it."""
    found = {}
    for link, one in heat.links.items():
        with within("links", link):
            require_known("link", link, description.links)
            found[link] = material(one.material or heat.material).growth(one.warmer)
    for link in description.links:  # what is fixed to a link is as warm as it is
        path = [link]
        for joint in description.above(link):
            if path[-1] in found or joint.kind != "fixed":
                break
            path.append(joint.parent)
        if path[-1] in found:
            found.update(dict.fromkeys(path, found[path[-1]]))
    return {link: growth for link, growth in found.items() if growth}


def _lengthened(description: Description, growth: Mapping[str, float]) -> Description:
    """The URDF with places in these links farther from the link's frame, and inertias to match."""
    root = description.elements()
    for joint in root.findall("joint"):
        parent = joint.find("parent")
        assert parent is not None
        _move(joint, growth.get(str(parent.get("link")), 0.0))
    for link in root.findall("link"):
        inertial, more = link.find("inertial"), growth.get(str(link.get("name")), 0.0)
        if inertial is None or not more:
            continue
        _move(inertial, more)
        inertia = inertial.find("inertia")
        for key, value in () if inertia is None else inertia.attrib.items():
            inertia.set(key, repr(float(value) * (1.0 + more) ** 2))  # type: ignore[union-attr]
    return read_again(description, root, "link")


def _move(element: ElementTree.Element, growth: float) -> None:
    origin = element.find("origin")
    if origin is None or not growth:
        return
    place = [float(one) for one in origin.get("xyz", "0 0 0").split()]
    origin.set("xyz", " ".join(repr(one * (1.0 + growth)) for one in place))
