"""Reading a URDF: the file, its joints as declared, and whether it describes a possible robot."""

from __future__ import annotations

import io
import json
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from jointplay.base.errors import JointplayError, MissingName, closest, require_known
from jointplay.base.tables import few
from jointplay.model.inertias import (
    ALL,
    LARGEST,
    harmless_inertias,
    impossible_inertias,
    require_possible,
)
from jointplay.model.vocabulary import BEYOND, check_words, numbers, read_elements, unread

if TYPE_CHECKING:
    import yourdfpy


# What a URDF says beyond the tree of joints: mimicry, transmissions, pictures.


SHAPES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("scale",),
}
"""Geometries of pictures that are drawn, and their numbers; others are left out."""
_READ = ("link", "joint", "material")
"""Elements of a robot that are read."""


class Mimic(NamedTuple):
    """A joint follows another: its position is multiplier * that of the leader + offset."""

    leader: str
    multiplier: float
    """[1, or rad/m or m/rad where one of them slides]."""
    offset: float
    """[rad or m]."""

    def formula(self) -> str:
        """Its position, as one would write it."""
        factor = "" if self.multiplier == 1.0 else f"{self.multiplier:g} "
        sign = "+" if self.offset > 0.0 else "-"
        return f"{factor}{self.leader}" + (f" {sign} {abs(self.offset):g}" if self.offset else "")


def between(lower: float | None, upper: float | None) -> float:
    """Zero, or the middle of limits that exclude it; of a single one, that limit."""
    low, high = (-math.inf if lower is None else lower), (math.inf if upper is None else upper)
    if low <= 0.0 <= high:
        return 0.0
    return 0.5 * (low + high) if math.isfinite(high - low) else min(max(0.0, low), high)


@dataclass(frozen=True)
class JointEntry:
    """A joint as the URDF declares it."""

    name: str
    kind: str
    """URDF type: revolute, continuous, prismatic, fixed, ..."""
    parent: str
    child: str
    friction: float
    """Dry friction torque [N m or N]."""
    damping: float
    """Viscous friction [N m s/rad or N s/m]."""
    lower: float | None = None
    """Lower limit of its position [rad or m]; None where there is none, or `upper`'s."""
    upper: float | None = None
    """Upper limit of its position, likewise."""
    speed: float | None = None
    """Limit of its speed [rad/s or m/s]; None where there is none, or 0."""
    effort: float | None = None
    """Limit of its effort [N m or N], likewise."""
    mimic: Mimic | None = None
    """The joint that it follows, and how; None if it follows none that exists."""

    @property
    def unit(self) -> str:
        """Of its position: ``m`` if it slides, else ``rad``."""
        return "m" if self.slides else "rad"

    @property
    def neutral(self) -> float:
        """Where it stands if nobody says where [rad or m]: at zero, or in the middle of limits
        that exclude that.
        """
        return between(self.lower, self.upper)

    @property
    def component(self) -> int:
        """Component of a displacement that it moves, if its axis is z: along it or about it."""
        return 2 if self.slides else 5

    @property
    def turns(self) -> bool:
        return self.kind in ("revolute", "continuous")

    @property
    def slides(self) -> bool:
        """Whether it is measured in metres, and its effort in newtons; else it turns."""
        return self.kind == "prismatic"


# Reading a URDF: whether it describes a possible robot.


MOST_LINKS, MOST_MOVING = 5000, 250
"""Most links and moving joints of a robot: to set up its equations grows with their cube."""

MOST_IN_SERIES = 1000
"""Most links one behind the other: Pinocchio's reader calls itself for each, and at some 4,000 of
them ends the process with 8 MB of stack."""

MOST_LETTERS = 200
"""Longest name of a link or joint."""

GROUND = "universe"
"""Pinocchio's own frame and joint: what is called like it would be taken for the ground."""

LIMITED = ("revolute", "prismatic")
"""Types of joint whose position has limits."""

NO_AXIS = ("fixed", "floating")
"""Types of joint whose axis means nothing; exporters write zeros there."""

SHORTEST_AXIS = 1e-6
"""An axis is a unit vector: one with no longer component is rounding."""

UNIT = 1e-3
"""Error of an axis' length that passes for rounding, of three digits."""

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""In world axes [m/s^2]."""

GRAVITY = {"balanced": (0.0, 0.0, 0.0), "loaded": STANDARD_GRAVITY}
"""Gravity by word [m/s^2]: none, as if the weight were balanced, or 9.81 m/s^2 along -z."""


@dataclass(frozen=True)
class Beyond:
    """What a file of another format says and a URDF does not."""

    tables: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Of a scenario: ``robot``, ``gears``, ``drives``, ``loads``, ..."""
    notes: tuple[str, ...] = ()
    """What was read and what was left out, a line each."""
    hinges: dict[str, str] | None = None
    """Of an MJCF, by joint the second hinge that is its play; None if it was none."""
    armature: dict[str, float] = field(default_factory=dict)
    """Inertia of rotors that are rigidly geared to joints, by joint, on its side [kg m^2 or kg]."""
    doubts: tuple[str, ...] = ()
    """What was not taken as it stands, a line each."""


@dataclass(frozen=True)
class Description:
    """A URDF's text, with its joints by name in the order of the file."""

    path: Path
    text: str
    joints: dict[str, JointEntry]
    links: tuple[str, ...]
    parsed: ElementTree.Element = field(compare=False, repr=False)
    """Its elements, checked; not to be changed."""
    stored: bool = False
    """Whether it comes from a result: it then has no folder from which it may take meshes."""

    @cached_property
    def beyond(self) -> Beyond:
        """What the file said for which a URDF has no words."""
        return Beyond(**json.loads(self.parsed.findtext(BEYOND) or "{}"))

    @cached_property
    def declared(self) -> yourdfpy.urdf.Robot:
        """Links and joints with all they have, by yourdfpy, which is slow to import.

        No mesh is looked for, no file opened.

        Raises:
            JointplayError: yourdfpy cannot read it.
        """
        import yourdfpy

        root = self.elements()
        for element in [child for child in root if child.tag not in _READ]:
            root.remove(element)
        for link in root.findall("link"):
            for picture in (*link.findall("visual"), *link.findall("collision")):
                geometry = picture.find("geometry")
                if geometry is None or not any(shape.tag in SHAPES for shape in geometry):
                    link.remove(picture)  # that other programs know
        text = io.BytesIO(ElementTree.tostring(root))
        try:
            return yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False).robot
        except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
            raise JointplayError(f"yourdfpy cannot read the URDF: {error}") from None

    @cached_property
    def reductions(self) -> dict[str, float]:
        """Turns of the motor for one of the joint, by joint; yourdfpy (0.0.60) leaves them out."""
        ratios = {}
        for element in self.parsed.findall("transmission"):
            with suppress(ValueError):
                ratio = float(element.findtext(".//mechanicalReduction") or "")
                ratios.update({joint.get("name", ""): ratio for joint in element.findall("joint")})
        return ratios

    @property
    def plain_text(self) -> str:
        """The URDF without what is beyond it."""
        return re.sub(rf"\s*<{BEYOND}>.*?</{BEYOND}>", "", self.text, flags=re.DOTALL)

    @property
    def revolute(self) -> list[str]:
        """Names of the joints that can get clearance."""
        return [j.name for j in self.joints.values() if j.turns]

    @property
    def moving(self) -> list[str]:
        """Names of the joints that are not fixed."""
        return [j.name for j in self.joints.values() if j.kind != "fixed"]

    @cached_property
    def serial(self) -> bool:
        """Whether all joints that turn lie on one path from the base: an arm."""
        paths = [{joint.name for joint in self.above(self.joints[n].child)} for n in self.revolute]
        return bool(paths) and max(paths, key=len).issuperset(self.revolute)

    @property
    def root(self) -> str:
        """The link from which all joints begin: the base."""
        return next(link for link in self.links if link not in self.holders)

    @cached_property
    def holders(self) -> dict[str, JointEntry]:
        """The joint that holds each link, but for the base."""
        return {joint.child: joint for joint in self.joints.values()}

    def above(self, link: str) -> Iterator[JointEntry]:
        """The joints from a link to the base, the nearest first."""
        while link in self.holders:
            joint = self.holders[link]
            yield joint
            link = joint.parent

    def free_base(self, gravity: Sequence[float]) -> str:
        """That the base is free, in words, and what it then does under `gravity`."""
        falls = ", and it falls unless loads carry it" if any(gravity) else ""
        return f"the base {self.root!r} is free: nothing holds it{falls}"

    @property
    def held(self) -> str:
        """That the base of what is no arm is held, in words; empty if nobody would expect else.

        A URDF does not say whether its base is free, as that of what walks, drives or flies. What
        has no mass, though, is the ground.
        """
        base = self.root
        fixed = {
            link for link in self.links if all(joint.kind == "fixed" for joint in self.above(link))
        }
        masses = (
            float(mass.get("value", "0"))
            for link in self.parsed.findall("link")
            if link.get("name") in fixed and (mass := link.find("inertial/mass")) is not None
        )
        if self.serial or not self.moving or not any(masses):
            return ""
        return f"the base {base!r} is held fast, as if bolted to the ground"

    @property
    def doubts(self) -> list[str]:
        """What the URDF says that is not whole or not read; see `doubts`."""
        return doubts(self.parsed)

    def require_moving(self) -> None:
        """Raise unless some joint moves.

        Raises:
            JointplayError: none does, as of a drone that is described as one body.
        """
        if not self.moving:
            number = len(self.links)
            bodies = "one link" if number == 1 else f"{number} links, fixed to each other,"
            raise JointplayError(
                f"{self.path.name} has {bodies} and no joint that moves, so there is nothing to "
                "simulate: play is that of joints, revolute, continuous, prismatic or floating; "
                "give a URDF that has some"
            )

    def elements(self) -> ElementTree.Element:
        """Its elements, which may be changed."""
        return deepcopy(self.parsed)


def with_geared(description: Description, joints: Collection[str]) -> Description:
    """The description without the armature of joints whose gears have rotors of their own."""
    armature = description.beyond.armature
    if armature.keys().isdisjoint(joints):
        return description
    direct = {name: armature[name] for name in armature if name not in joints}
    return with_armature(description, direct)


def with_armature(description: Description, armature: Mapping[str, float]) -> Description:
    """The description with other rotors that are rigidly geared to joints; see `Beyond`."""
    root = description.elements()
    element = root.find(BEYOND)
    if element is None:
        element = ElementTree.SubElement(root, BEYOND)
    beyond = json.loads(element.text or "{}")
    element.text = json.dumps(beyond | {"armature": dict(armature)})
    return read_again(description, root, "gear")


_DEEPEST = 200
"""Levels of elements that a URDF may have; those in use have about six."""


def elements(text: str, path: Path) -> ElementTree.Element:
    """The root of a URDF, unchecked.

    Raises:
        JointplayError: it is no URDF; `path` names it.
    """
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise JointplayError(f"the URDF {str(path)!r} is not well-formed XML: {error}") from None
    if root.tag != "robot":
        raise JointplayError(f"the URDF {str(path)!r} has the root <{root.tag}>, expected <robot>")
    level = [root]
    for _ in range(_DEEPEST):
        level = [inner for element in level for inner in element]
    if level:  # Python's own XML writer gives up somewhere beyond
        raise JointplayError(f"the URDF {str(path)!r} nests elements more than {_DEEPEST} deep")
    return root


def parse(text: str, path: Path, allow_unphysical: Collection[str] = ()) -> Description:
    """Check the URDF `text`, naming `path` in errors, and every inertia, but of links in
    `allow_unphysical`, or ``"all"``.

    The same text is read once: what is returned is shared, and must not be changed.

    Raises:
        JointplayError: it is malformed, its links do not form one tree, or a link's inertia is
            impossible (the message names the link and its principal moments).
    """
    return _parsed(text, path, tuple(allow_unphysical))


def _with_world(root: ElementTree.Element) -> bool:
    """Add the link ``world`` where joints begin at it and none is described: Drake's ground."""
    links = {link.get("name") for link in root.findall("link")}
    parents = {parent.get("link") for parent in root.findall("joint/parent")}
    if not links or _WORLD in links or _WORLD not in parents:
        return False
    root.insert(0, ElementTree.Element("link", name=_WORLD))
    doubt(
        root, f"joints begin at {_WORLD!r}, which no link is called: it is the ground, as in Drake"
    )
    return True


def doubt(root: ElementTree.Element, line: str) -> None:
    """Add a line to `doubts`."""
    beyond = json.loads(root.findtext(BEYOND) or "{}")
    for old in root.findall(BEYOND):
        root.remove(old)
    beyond["doubts"] = [*beyond.get("doubts", ()), line]
    ElementTree.SubElement(root, BEYOND).text = json.dumps(beyond)


_WORLD = "world"


@lru_cache(maxsize=32)
def _parsed(text: str, path: Path, allow_unphysical: tuple[str, ...]) -> Description:
    root = elements(text, path)
    if _with_world(root):
        text = ElementTree.tostring(root, encoding="unicode")
    tags = root.findall("link")
    if not tags:
        raise JointplayError(f"the URDF {str(path)!r} has no links")
    moving = sum(joint.get("type") != "fixed" for joint in root.findall("joint"))
    for number, most, noun in (
        (len(tags), MOST_LINKS, "links"),
        (moving, MOST_MOVING, "moving joints"),
    ):
        if number > most:
            raise JointplayError(
                f"the URDF {str(path)!r} has {number} {noun}; at most {most} are possible"
            )
    links = {link.get("name", ""): link for link in tags}
    for kind in ("link", "joint"):
        _check_names(kind, [element.get("name", "") for element in root.findall(kind)])
    check_words(root)
    _check_numbers(root)
    for name in allow_unphysical:
        if name not in links and name != ALL:
            raise MissingName("link", name, [*links, ALL])
    joints = {}
    followers, _ = mimics(root)
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        dynamics = joint.find("dynamics")
        joints[name] = JointEntry(
            name,
            joint.get("type", ""),
            _link(joint, "parent", links),
            _link(joint, "child", links),
            _resistance(dynamics, "friction", name),
            _resistance(dynamics, "damping", name),
            mimic=followers.get(name),
            **_limits(joint, name),
        )
    _check_tree(path, links, joints.values())
    require_possible(impossible_inertias(root), allow_unphysical)
    return Description(path, text, joints, tuple(links), root)


def slips(root: ElementTree.Element) -> Iterator[tuple[ElementTree.Element, str]]:
    """Links, joints and materials that `parse` refuses by themselves, and the first reason why."""
    for top in root:
        if top.tag not in _READ:
            continue
        alone, name = ElementTree.Element("robot"), top.get("name", "")
        alone.append(top)
        try:
            _check_names(top.tag, [name])
            check_words(alone)
            _check_numbers(alone)
            if top.tag == "joint":
                _limits(top, name)
                for key in ("friction", "damping"):
                    _resistance(top.find("dynamics"), key, name)
                mimics(alone)
        except JointplayError as error:
            yield top, str(error)


def _limits(joint: ElementTree.Element, name: str) -> dict[str, float | None]:
    """Lower, upper, speed and effort; programs that write URDFs put 0 or -1 where they know none.

    Raises:
        JointplayError: they are no numbers, or the wrong way round; they may be infinite.
    """
    limit, kind = joint.find("limit"), joint.get("type")
    lower, upper, effort, velocity = (
        numbers(limit, key, f"joint {name!r}: limit {key}", 1, "0", infinite=True)[0]
        for key in ("lower", "upper", "effort", "velocity")
    )
    if lower > upper and kind in LIMITED:
        cure = "exchange them"
        if missing := {"lower", "upper"} - set({} if limit is None else limit.attrib):
            cure = f"the {missing.pop()} one is missing, which means 0: give it"
        raise JointplayError(
            f"joint {name!r} has the lower limit {lower:g} above the upper one {upper:g}; {cure}"
        )
    for key, value in (("effort", effort), ("velocity", velocity)):
        if value < 0.0 and value != -1.0:
            raise JointplayError(f"joint {name!r}: limit {key} must not be negative, got {value:g}")
    if kind in NO_AXIS:
        return {}
    speed, force = (value if value > 0.0 else None for value in (velocity, effort))
    limits = {"speed": speed, "effort": force}
    if lower < upper and kind != "continuous":
        limits |= {"lower": lower, "upper": upper}
    return limits


def doubts(root: ElementTree.Element) -> list[str]:
    """What is not whole or not read, a line each: leaders that do not exist, limits, axes, ..."""
    names = [joint.get("name", "") for joint in root.findall("joint")]
    geared = {
        t.get("name", ""): [joint.get("name", "") for joint in t.findall("joint")]
        for t in root.findall("transmission")
    }
    idle = [name for name, joints in geared.items() if not {*joints} & {*names}]
    lines = [
        f"{name} mimics {mimic.leader!r}, which is no joint, and moves by itself; "
        f"{closest(mimic.leader, names)}".rstrip("; ")
        for name, mimic in mimics(root)[1].items()
    ]
    lines += partly_limited(root)
    if long := [name for name, length in _axes(root).items() if abs(length - 1.0) > UNIT]:
        lines.append(f"no unit vector as axis, so only its direction counts: {few(long)}")
    if idle:
        lines.append(f"transmissions of no joint in the URDF, left out: {few(idle)}")
    materials = [m for m in root.iter("material") if {"color", "texture"} & {x.tag for x in m}]
    coloured = {m.get("name", "") for m in materials}
    used = [m.get("name", "") for m in root.findall("link/visual/material")]
    if pale := [name for name in dict.fromkeys(used) if name not in coloured and name]:
        lines.append(f"materials without a colour in the URDF: {few(pale)}")
    if harmless := harmless_inertias(root):
        lines.append(harmless)
    stored = json.loads(root.findtext(BEYOND) or "{}").get("doubts", ())
    return [*lines, *unread(root), *stored]


def _axes(root: ElementTree.Element) -> dict[str, float]:
    """Length of the axis of each joint that has one."""
    moving = [joint for joint in root.findall("joint") if joint.get("type") not in NO_AXIS]
    axes = {joint.get("name", ""): joint.find("axis") for joint in moving}
    return {
        name: math.hypot(*numbers(axis, "xyz", f"joint {name!r}: axis", 3, "1 0 0"))
        for name, axis in axes.items()
        if axis is not None
    }


def partly_limited(root: ElementTree.Element) -> list[str]:
    """Joints of whose limits the URDF gives some only, a line each; each type needs its own."""
    joints: dict[tuple[str, ...], list[str]] = {}
    for joint in root.findall("joint"):
        limit, kind = joint.find("limit"), joint.get("type")
        if kind in NO_AXIS or (limit is None and kind not in LIMITED):
            continue
        needed = (*(("lower", "upper") if kind in LIMITED else ()), "effort", "velocity")
        stated = {} if limit is None else limit.attrib
        if missing := tuple(key for key in needed if key not in stated):
            joints.setdefault(missing, []).append(joint.get("name", ""))
    lines = []
    for missing, names in joints.items():
        ends = [key for key in missing if key in ("lower", "upper")]
        zero = f", and {ends[0]} counts as 0" if len(ends) == 1 else ""
        lines.append(f"no limit {', '.join(missing)} in the URDF{zero}: {few(names)}")
    return lines


def _resistance(dynamics: ElementTree.Element | None, key: str, name: str) -> float:
    """Friction or damping of a joint."""
    value = _number(dynamics, key, f"joint {name!r}:", "0")
    if value < 0.0:
        raise JointplayError(f"joint {name!r}: {key} must not be negative, got {value:g}")
    return value


def mimics(root: ElementTree.Element) -> tuple[dict[str, Mimic], dict[str, Mimic]]:
    """What joints mimic, by name: joints that exist, and such that do not.

    Raises:
        JointplayError: numbers that are none, or joints that in the end follow themselves.
    """
    followers: dict[str, Mimic] = {}
    astray: dict[str, Mimic] = {}
    joints = {joint.get("name", "") for joint in root.findall("joint")}
    for joint in root.findall("joint"):
        name, mimic = joint.get("name", ""), joint.find("mimic")
        if mimic is None:
            continue
        label, leader = f"joint {name!r}: mimic", mimic.get("joint", "")
        factor = _number(mimic, "multiplier", label, "1")
        offset = _number(mimic, "offset", label, "0")
        (followers if leader in joints else astray)[name] = Mimic(leader, factor, offset)
    above = {name: mimic.leader for name, mimic in followers.items()}
    for name in followers:
        _, ring = _ascend(name, above, ())
        if ring:
            raise JointplayError(f"joints mimic each other in a cycle: {ring}")
    return followers, astray


def _ascend(name: str, above: Mapping[str, str], known: Collection[str]) -> tuple[list[str], str]:
    """Way from `name` to what has nothing above or is known, and the ring in which it ends."""
    path = [name]
    while path[-1] in above and path[-1] not in known:
        path.append(above[path[-1]])
        if path[-1] in path[:-1]:
            return path, " - ".join(path[path.index(path[-1]) :])
    return path, ""


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
        if name == GROUND:
            raise JointplayError(
                f"a {kind} of the URDF is called {name!r}, the name of the ground in Pinocchio"
            )
        if name in seen:
            raise JointplayError(f"two {kind}s of the URDF are called {name!r}")
        seen.add(name)


def _check_numbers(root: ElementTree.Element) -> None:
    """Refuse places, axes, sizes and colours that are not the numbers they must be."""
    for element, place, top in read_elements(root):
        owner, tag = place.partition(": <")[0], element.tag
        if tag == "origin":
            for key in ("xyz", "rpy"):
                _vector(element, key, f"{owner}: origin {key}", 3, "0 0 0")
        elif tag == "axis" and top is not None and top.get("type") not in NO_AXIS:
            if not max(map(abs, _vector(element, "xyz", f"{owner}: axis", 3))) > SHORTEST_AXIS:
                raise JointplayError(
                    f"{owner} has the axis {element.get('xyz')!r}, which has no direction"
                )
        elif tag == "color":
            numbers(element, "rgba", f"{owner}: color rgba", 4, "1 1 1 1")
        elif tag == "mesh":  # a scale may mirror, or be one for all axes
            text = element.get("scale", "1 1 1")
            numbers(
                element, "scale", f"{owner}: mesh scale", 1 if len(text.split()) == 1 else 3, text
            )
        elif tag in SHAPES:
            for key in SHAPES[tag]:
                label = f"{owner}: {tag} {key}"
                if min(_vector(element, key, label, 3 if key == "size" else 1)) < 0.0:
                    raise JointplayError(f"{label} must not be negative, got {element.get(key)!r}")


def _vector(
    element: ElementTree.Element, key: str, label: str, count: int, default: str | None = None
) -> list[float]:
    """`numbers` of lengths or angles."""
    values = numbers(element, key, label, count, default)
    worst = max(values, key=abs)
    if abs(worst) > LARGEST:
        raise JointplayError(f"{label} must be no larger than {LARGEST:g}, got {worst:g}")
    return values


def _number(
    element: ElementTree.Element | None, key: str, label: str, default: str | None = None
) -> float:
    """One number of an attribute, see `numbers`."""
    return numbers(element, key, f"{label} {key}", 1, default)[0]


def read_again(
    description: Description, root: ElementTree.Element, noun: str, *names: str
) -> Description:
    """The URDF with changed elements.

    Raises:
        JointplayError: one of `names`, which are those of new links and joints, is taken; `noun`
            needs it.
    """
    for name in names:
        if name in (*description.links, *description.joints):
            raise JointplayError(
                f"the URDF already has a {name!r}: a {noun} needs this name. To change a {noun}, "
                "build the mechanism from its own URDF again"
            )
    text = ElementTree.tostring(root, encoding="unicode")
    # Its inertias have been checked, and some allowed although no body has them.
    parsed = parse(text, description.path, [ALL])
    return replace(parsed, stored=description.stored)


def _link(joint: ElementTree.Element, end: str, links: Collection[str]) -> str:
    element = joint.find(end)
    name = "" if element is None else element.get("link", "")
    require_known(f"link (the {end} of joint {joint.get('name', '')!r})", name, links)
    return name


def _check_tree(path: Path, links: Collection[str], joints: Iterable[JointEntry]) -> None:
    """Refuse links that do not hang together as one tree."""
    above: dict[str, JointEntry] = {}
    for joint in joints:
        if joint.child in above:
            raise JointplayError(
                f"the URDF {str(path)!r} is not a tree: link {joint.child!r} is the child of the "
                f"joints {above[joint.child].name!r} and {joint.name!r}; describe one of them as "
                "a loop instead"
            )
        above[joint.child] = joint
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise JointplayError(
            f"the URDF {str(path)!r} has several roots: {', '.join(map(repr, roots))} have no "
            "parent; exactly one link must have none"
        )
    parents = {link: joint.parent for link, joint in above.items()}
    depth: dict[str, int] = dict.fromkeys(roots, 1)
    for link in links:
        ascent, ring = _ascend(link, parents, depth)
        if ring:
            raise JointplayError(
                f"the URDF {str(path)!r} is cyclic: {ring}; describe one of these joints as a "
                "loop instead"
            )
        for lower in reversed(ascent[:-1]):
            depth[lower] = depth[parents[lower]] + 1
            if depth[lower] > MOST_IN_SERIES:
                raise JointplayError(
                    f"the URDF {str(path)!r} has more than {MOST_IN_SERIES} links in series, up "
                    f"to {lower!r}; at most {MOST_IN_SERIES} are possible"
                )
