"""Reading a URDF: its joints as declared, and whether it describes a possible robot.

`parse` checks a URDF and makes a `Description` of it, immutable. What cannot be right is refused;
what may be a slip, or is not read, is told as `doubts`. Changed descriptions are made of changed
elements (`Description.elements`, `read_again`).
"""

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


SHAPES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("scale",),
}
"""Geometries that are drawn, and the attributes with their sizes; others are left out."""
_READ = ("link", "joint", "material")
"""Elements of a robot that are read."""


class Mimic(NamedTuple):
    """How a joint follows another: its position is multiplier * (leader's position) + offset."""

    leader: str
    multiplier: float
    """Rate against the leader's [1, or rad/m or m/rad where one of the two slides]."""
    offset: float
    """Position where the leader is at zero [rad or m]."""

    def formula(self) -> str:
        """The position as a formula, such as ``2 wrist - 0.1``."""
        factor = "" if self.multiplier == 1.0 else f"{self.multiplier:g} "
        sign = "+" if self.offset > 0.0 else "-"
        return f"{factor}{self.leader}" + (f" {sign} {abs(self.offset):g}" if self.offset else "")


def between(lower: float | None, upper: float | None) -> float:
    """Zero if the limits allow it; else their middle, or the limit if there is only one."""
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
    """Lower limit of the position [rad or m]; None where there is none."""
    upper: float | None = None
    """Upper limit of the position [rad or m]; None where there is none."""
    speed: float | None = None
    """Limit of the speed [rad/s or m/s]; None where there is none, or 0."""
    effort: float | None = None
    """Limit of the effort [N m or N]; None where there is none, or 0."""
    mimic: Mimic | None = None
    """The joint that this one follows, and how; None if it follows none that exists."""

    @property
    def unit(self) -> str:
        """Unit of the joint's position: ``m`` if it slides, else ``rad``."""
        return "m" if self.slides else "rad"

    @property
    def neutral(self) -> float:
        """Position if none is given [rad or m]: zero, or the middle of limits that exclude it."""
        return between(self.lower, self.upper)

    @property
    def component(self) -> int:
        """Row of a twist in which the joint moves, with z as its axis: along z, or about it."""
        return 2 if self.slides else 5

    @property
    def turns(self) -> bool:
        return self.kind in ("revolute", "continuous")

    @property
    def slides(self) -> bool:
        """Whether the joint's position is a length, and its effort a force."""
        return self.kind == "prismatic"


MOST_LINKS, MOST_MOVING = 5000, 250
"""Most links and moving joints: the work to set up the equations grows with their cube."""

MOST_IN_SERIES = 1000
"""Most links in series: Pinocchio's reader calls itself for each, and with some 4,000 of them it
overflows a stack of 8 MB and ends the process."""

MOST_LETTERS = 200
"""Longest name of a link or joint."""

GROUND = "universe"
"""Name of Pinocchio's ground frame and joint: a link of that name would be taken for it."""

LIMITED = ("revolute", "prismatic")
"""Types of joint whose position has limits."""

NO_AXIS = ("fixed", "floating")
"""Types of joint whose axis means nothing; exporters write zeros there."""

SHORTEST_AXIS = 1e-6
"""Largest component of an axis up to which it has no direction: an axis is a unit vector."""

UNIT = 1e-3
"""Error of an axis' length up to which it is rounding, to three digits."""

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""Acceleration of gravity in world axes [m/s^2]."""

GRAVITY = {"balanced": (0.0, 0.0, 0.0), "loaded": STANDARD_GRAVITY}
"""Gravity by word [m/s^2]: none, as if the weight were balanced, or 9.81 m/s^2 along -z."""


@dataclass(frozen=True)
class Beyond:
    """Contents of a file of another format for which a URDF has no words."""

    tables: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Tables of a scenario: ``robot``, ``gears``, ``drives``, ``loads``, ..."""
    notes: tuple[str, ...] = ()
    """Lines on what was read and what was left out."""
    hinges: dict[str, str] | None = None
    """Second hinges of an MJCF that are the play of a joint, by joint; None for other formats."""
    armature: dict[str, float] = field(default_factory=dict)
    """Inertia of rotors rigidly geared to joints, by joint, at its side [kg m^2 or kg]."""
    doubts: tuple[str, ...] = ()
    """Lines on what was not taken as it stands."""


@dataclass(frozen=True)
class Description:
    """A URDF's text, with its joints by name in the order of the file."""

    path: Path
    text: str
    joints: dict[str, JointEntry]
    links: tuple[str, ...]
    parsed: ElementTree.Element = field(compare=False, repr=False)
    """Root element of the URDF, checked; not to be changed."""
    stored: bool = False
    """Whether the URDF comes from a result: it then has no folder from which to take meshes."""

    @cached_property
    def beyond(self) -> Beyond:
        """Contents of the robot's file for which a URDF has no words."""
        return Beyond(**json.loads(self.parsed.findtext(BEYOND) or "{}"))

    @cached_property
    def declared(self) -> yourdfpy.urdf.Robot:
        """Links and joints with all their elements, read by yourdfpy, which is slow to import.

        No mesh is looked for, no file is opened.

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
                    link.remove(picture)  # of a geometry that only other programs know
        text = io.BytesIO(ElementTree.tostring(root))
        try:
            return yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False).robot
        except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
            raise JointplayError(f"yourdfpy cannot read the URDF: {error}") from None

    @cached_property
    def reductions(self) -> dict[str, float]:
        """Gear ratios by joint, from transmissions; yourdfpy (0.0.60) leaves them out."""
        ratios = {}
        for element in self.parsed.findall("transmission"):
            with suppress(ValueError):
                ratio = float(element.findtext(".//mechanicalReduction") or "")
                ratios.update({joint.get("name", ""): ratio for joint in element.findall("joint")})
        return ratios

    @property
    def plain_text(self) -> str:
        """The URDF's text without the element for `beyond`."""
        return re.sub(rf"\s*<{BEYOND}>.*?</{BEYOND}>", "", self.text, flags=re.DOTALL)

    @property
    def revolute(self) -> list[str]:
        """Names of the joints that turn: revolute or continuous."""
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
        """The base: the link that no joint holds."""
        return next(link for link in self.links if link not in self.holders)

    @cached_property
    def holders(self) -> dict[str, JointEntry]:
        """The joint that holds each link, by link; the base has none."""
        return {joint.child: joint for joint in self.joints.values()}

    def above(self, link: str) -> Iterator[JointEntry]:
        """The joints between a link and the base, the nearest to the link first."""
        while link in self.holders:
            joint = self.holders[link]
            yield joint
            link = joint.parent

    @property
    def held(self) -> str:
        """A sentence that the base is held; empty for robots whose base everybody expects held.

        A URDF does not say whether its base is free, as that of a robot that walks, drives or
        flies. Arms are held; and a base without mass is the ground.
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
        """Lines on what in the URDF is not whole or not read; see `doubts`."""
        return doubts(self.parsed)

    def require_moving(self) -> None:
        """Raise unless some joint moves.

        Raises:
            JointplayError: no joint does, as in a drone that is described as one body.
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
        """A copy of the URDF's root element, which may be changed."""
        return deepcopy(self.parsed)


def with_armature(description: Description, armature: Mapping[str, float]) -> Description:
    """The description with another armature; see `Beyond.armature`."""
    root = description.elements()
    element = root.find(BEYOND)
    if element is None:
        element = ElementTree.SubElement(root, BEYOND)
    beyond = json.loads(element.text or "{}")
    element.text = json.dumps(beyond | {"armature": dict(armature)})
    return read_again(description, root, "gear")


_DEEPEST = 200
"""Most levels of elements in a URDF; those in use have about six."""
_WORLD = "world"
"""Link at which joints begin in Drake's URDFs, described or not: the ground."""


def elements(text: str, path: Path) -> ElementTree.Element:
    """Root element of a URDF, unchecked.

    Raises:
        JointplayError: the text is no URDF; the message has its `path`.
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
    """Check a URDF's `text`, of the file `path`, and describe it.

    Inertias are checked, too, except those of links in `allow_unphysical`, or all by ``"all"``. The
    same text is read once: the description is shared, and must not be changed.

    Raises:
        JointplayError: it is malformed, its links do not form one tree, or a link's inertia is
            impossible (the message names the link and its principal moments).
    """
    return _parsed(text, path, tuple(allow_unphysical))


def _with_world(root: ElementTree.Element) -> bool:
    """Add the link ``world`` if joints begin at it and no link is called so; whether it was added.

    It is the ground in Drake's URDFs.
    """
    links = {link.get("name") for link in root.findall("link")}
    parents = {parent.get("link") for parent in root.findall("joint/parent")}
    if not links or _WORLD in links or _WORLD not in parents:
        return False
    root.insert(0, ElementTree.Element("link", name=_WORLD))
    doubt(
        root, f"joints begin at {_WORLD!r}, but no link is called so: it is the ground, as in Drake"
    )
    return True


def doubt(root: ElementTree.Element, line: str) -> None:
    """Add a line to the `doubts` that a URDF carries with it."""
    beyond = json.loads(root.findtext(BEYOND) or "{}")
    for old in root.findall(BEYOND):
        root.remove(old)
    beyond["doubts"] = [*beyond.get("doubts", ()), line]
    ElementTree.SubElement(root, BEYOND).text = json.dumps(beyond)


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
    # Every element is sound by now; joints, the tree and inertias are looked at as a whole.
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
    """Links, joints and materials that `parse` would refuse by themselves, each with a reason."""
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
    """Limits of a joint by the fields of `JointEntry`; exporters write 0 or -1 for unknown ones.

    Raises:
        JointplayError: a limit is no number, or the limits are the wrong way round. They may be
            infinite.
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
    """Lines on what is not whole or not read: missing leaders, limits, axes, colours, ..."""
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
    lines += _partly_limited(root)
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
    """Length of each moving joint's axis, by joint, where the URDF states one."""
    moving = [joint for joint in root.findall("joint") if joint.get("type") not in NO_AXIS]
    axes = {joint.get("name", ""): joint.find("axis") for joint in moving}
    return {
        name: math.hypot(*numbers(axis, "xyz", f"joint {name!r}: axis", 3, "1 0 0"))
        for name, axis in axes.items()
        if axis is not None
    }


def _partly_limited(root: ElementTree.Element) -> list[str]:
    """Lines on joints whose <limit> lacks attributes that their type needs."""
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
    """Friction or damping of a joint, not negative."""
    (value,) = numbers(dynamics, key, f"joint {name!r}: {key}", 1, "0")
    if value < 0.0:
        raise JointplayError(f"joint {name!r}: {key} must not be negative, got {value:g}")
    return value


def mimics(root: ElementTree.Element) -> tuple[dict[str, Mimic], dict[str, Mimic]]:
    """Mimicking joints by name: those whose leader exists, and those whose leader does not.

    Raises:
        JointplayError: a number that is none, or joints that mimic each other in a cycle.
    """
    followers: dict[str, Mimic] = {}
    astray: dict[str, Mimic] = {}
    joints = {joint.get("name", "") for joint in root.findall("joint")}
    for joint in root.findall("joint"):
        name, mimic = joint.get("name", ""), joint.find("mimic")
        if mimic is None:
            continue
        leader = mimic.get("joint", "")
        (factor,) = numbers(mimic, "multiplier", f"joint {name!r}: mimic multiplier", 1, "1")
        (offset,) = numbers(mimic, "offset", f"joint {name!r}: mimic offset", 1, "0")
        (followers if leader in joints else astray)[name] = Mimic(leader, factor, offset)
    above = {name: mimic.leader for name, mimic in followers.items()}
    for name in followers:
        _, ring = _ascend(name, above, ())
        if ring:
            raise JointplayError(f"joints mimic each other in a cycle: {ring}")
    return followers, astray


def _ascend(name: str, above: Mapping[str, str], known: Collection[str]) -> tuple[list[str], str]:
    """Path from `name` upwards, to a `known` name or the top, and the cycle in which it ends.

    The cycle is a text such as ``a - b - a``; empty if there is none.
    """
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
    """Refuse poses, axes, sizes and colours that are not the numbers they must be."""
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
    """`numbers` that are lengths or angles, none beyond `LARGEST`."""
    values = numbers(element, key, label, count, default)
    worst = max(values, key=abs)
    if abs(worst) > LARGEST:
        raise JointplayError(f"{label} must be no larger than {LARGEST:g}, got {worst:g}")
    return values


def read_again(
    description: Description, root: ElementTree.Element, noun: str, *names: str
) -> Description:
    """The description of a URDF whose elements were changed to `root`.

    `names` are those of new links and joints, `noun` is what needs them in messages.

    Raises:
        JointplayError: one of `names` is taken.
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
    """Refuse links that do not form one tree, or form one that is too deep."""
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
