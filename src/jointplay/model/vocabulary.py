"""What a URDF is made of: its elements, their attributes, and how numbers are written in it."""

from __future__ import annotations

import csv
import io
import math
import re
import shlex
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from jointplay.base.errors import JointplayError, closest
from jointplay.base.schema import one_of
from jointplay.base.tables import few
from jointplay.base.units import NUMBER, not_lost

BEYOND = "beyond_urdf"
"""Element of a robot that holds, as JSON, what no URDF says."""

_INFINITE = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)


class Words(NamedTuple):
    """What an element may have; what has a prefix (``drake:``) is another program's always."""

    attributes: tuple[str, ...] = ()
    elements: tuple[str, ...] = ()
    several: tuple[str, ...] = ()
    """Of the elements, those of which there may be more than one."""
    others: tuple[str, ...] = ()
    """What other programs put there, although it resembles these or belongs elsewhere."""
    meant: Mapping[str, str] = MappingProxyType({})
    """What people write who mean one of these."""
    exclusive: bool = False
    """Whether nothing else may stand there: no program puts its own into it."""


MIRRORED = {"iyx": "ixy", "izx": "ixz", "izy": "iyz"}
"""Entries of an inertia that some write besides, and those that they must equal."""
_SHAPED = Words(("name",), ("origin", "geometry", "material"), ("material",))

WORDS = {
    "robot": Words(
        ("name", "version"),
        ("link", "joint", "material", "transmission", "gazebo", "sensor", "ros2_control"),
        ("link", "joint", "material", "transmission", "gazebo", "sensor", "ros2_control"),
    ),
    "link": Words(
        ("name", "type"),
        ("inertial", "visual", "collision"),
        ("visual", "collision"),
        ("origin", "kinematic", "collision_checking"),
    ),
    "inertial": Words((), ("origin", "mass", "inertia"), exclusive=True),
    "mass": Words(("value",), exclusive=True),
    "inertia": Words(
        ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), others=tuple(MIRRORED), exclusive=True
    ),
    "joint": Words(
        ("name", "type"),
        (
            *("origin", "axis", "parent", "child", "limit", "dynamics", "mimic"),
            *("calibration", "safety_controller"),
        ),
    ),
    "origin": Words(("xyz", "rpy"), exclusive=True),
    "axis": Words(("xyz",), exclusive=True),
    "parent": Words(("link",), exclusive=True),
    "child": Words(("link",), exclusive=True),
    "limit": Words(
        ("lower", "upper", "effort", "velocity"),
        others=("command_effort", "current", "gear_velocity"),
        meant={"min": "lower", "max": "upper", "torque": "effort", "speed": "velocity"},
    ),
    "dynamics": Words(("damping", "friction")),
    "mimic": Words(("joint", "multiplier", "offset"), exclusive=True),
    "visual": _SHAPED,
    "collision": _SHAPED,
    "geometry": Words(("name",), ("box", "cylinder", "sphere", "mesh")),
    "box": Words(("size",)),
    "cylinder": Words(("radius", "length")),
    "sphere": Words(("radius",)),
    "mesh": Words(("filename", "scale")),
    "material": Words(("name",), ("color", "texture")),
    "color": Words(("rgba",), exclusive=True),
}
"""By element. Those that are not here are other programs'; nobody looks into them."""


JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
"""Types of joint that Pinocchio reads."""

_SHOWN = 30
"""Letters that are shown of a text that nobody reads."""

_ALIKE = 0.7
"""Likeness from which a word is a slip of the pen rather than another program's."""


def check_words(root: ElementTree.Element) -> None:
    """Refuse elements and attributes that are misspelt, misplaced or doubled.

    Raises:
        JointplayError: the message names the link or joint, the word, and what was meant.
    """
    for element, place, _ in read_elements(root):
        vocabulary = WORDS[element.tag]
        for name in element.attrib:
            _check(f'"{name}"', name, place, vocabulary.attributes, vocabulary, ())
        counts = Counter(child.tag for child in element)
        for tag, number in counts.items():
            _check(f"<{tag}>", tag, place, vocabulary.elements, vocabulary, WORDS)
            if number > 1 and tag in vocabulary.elements and tag not in vocabulary.several:
                raise JointplayError(
                    f"{place} has {number} elements <{tag}>; which of them holds? Leave one"
                )
    for joint in root.findall("joint"):
        kind = joint.get("type", "")
        if kind not in JOINT_TYPES:
            name = joint.get("name", "")
            raise JointplayError(f"joint {name!r}: {one_of('type of joint', kind, JOINT_TYPES)}")


def unread(root: ElementTree.Element) -> list[str]:
    """Words and text that nobody reads in elements that are read, in one line if there are any."""
    places: dict[str, list[str]] = {}
    for element, place, _ in read_elements(root):
        vocabulary, texts = WORDS[element.tag], [element.text, *(child.tail for child in element)]
        tags = (child.tag for child in element if child.tag != BEYOND)
        unknown = [f'"{name}"' for name in element.attrib if _foreign(name, vocabulary.attributes)]
        unknown += [f"<{tag}>" for tag in tags if _foreign(tag, vocabulary.elements)]
        unknown += [f"the text {t.strip()[:_SHOWN]!r}" for t in texts if t and t.strip()]
        for word in unknown:
            places.setdefault(word, []).append(place)
    lines = [f"{word} in {few(list(dict.fromkeys(at)), 2)}" for word, at in places.items()]
    return [f"not read in the URDF: {few(lines)}"] if lines else []


def _foreign(word: str, known: Collection[str]) -> bool:
    return not (word in known or ":" in word or "}" in word)


def read_elements(
    element: ElementTree.Element, top: ElementTree.Element | None = None
) -> Iterator[tuple[ElementTree.Element, str, ElementTree.Element | None]]:
    """The element and all in it that is read: each, where it is in words, and the link, joint or
    material `top` that it belongs to (None: the robot).
    """
    place = "the robot" if top is None else f"{top.tag} {top.get('name', '')!r}"
    yield element, place if element is top or top is None else f"{place}: <{element.tag}>", top
    for child in element:
        if child.tag in WORDS[element.tag].elements and child.tag in WORDS:
            yield from read_elements(child, child if top is None else top)


def _check(
    shown: str,
    word: str,
    place: str,
    known: Collection[str],
    vocabulary: Words,
    elsewhere: Collection[str],
) -> None:
    if word in vocabulary.others or not _foreign(word, known):
        return
    likeness = _ALIKE if not vocabulary.exclusive else 0.6 if len(known) > 1 else 0.0
    near = vocabulary.meant.get(word)
    meant = f'did you mean "{near}"? ' if near else closest(word, known, likeness)
    if meant or vocabulary.exclusive:
        choices = ", ".join(known) or "nothing"
        raise JointplayError(f"{place} has {shown}, which nobody reads; {meant}known: {choices}")
    if word in elsewhere:
        homes = [f"<{tag}>" for tag, its in WORDS.items() if word in its.elements]
        raise JointplayError(
            f"{place} has {shown}, where nobody reads it; it belongs in {' or '.join(homes)}"
        )


def numbers(
    element: ElementTree.Element | None,
    key: str,
    label: str,
    count: int,
    default: str | None = None,
    infinite: bool = False,
) -> list[float]:
    """`count` numbers of an attribute `key`, which must be there if it has no `default`.

    Of a mass that Python reads and other programs do not, such as ``4_35``, Pinocchio makes 0
    without a word. In the element the numbers are then separated by single spaces: of a mass with a
    space behind it it makes 0, too, and it does not read vectors with tabs or line ends in them.
    `label` they are called in messages; whether they may be `infinite`.

    Raises:
        JointplayError: they are not so many finite numbers.
    """
    text = default if element is None else element.get(key, default)
    if text is None:
        raise JointplayError(f"{label} is missing in the URDF")
    parts = [part for part in re.split(r"[ \t\r\n]+", text) if part]
    values = [
        float(part) if infinite and _INFINITE.fullmatch(part) else _number(part) for part in parts
    ]
    if len(values) != count or any(map(math.isnan, values)):
        kind = "" if infinite else "finite "
        word = {1: f"a {kind}number", 3: f"three {kind}numbers", 4: f"four {kind}numbers"}[count]
        raise JointplayError(f"{label} must be {word}, got {text!r}")
    if element is not None and key in element.attrib:
        element.set(key, " ".join(parts))
    return values


def _number(text: str) -> float:
    """A number that a float can hold; NaN of any other text."""
    try:
        value = not_lost(text) if NUMBER.fullmatch(text) else math.nan
    except ValueError:  # too small
        return math.nan
    return value if math.isfinite(value) else math.nan


def as_option(names: Sequence[str]) -> str:
    """Names as ``--fix`` and ``--allow-unphysical`` take them: with commas, quoted if need be."""
    written = io.StringIO()
    csv.writer(written, lineterminator="").writerow(names)
    return shlex.quote(written.getvalue())
