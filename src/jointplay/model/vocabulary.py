"""The vocabulary of URDF: its elements, their attributes, and how numbers are written in it.

Programs of all kinds put elements of their own into URDFs, so that an unknown word cannot be an
error by itself. One that resembles a known word, or stands where no program puts its own, is taken
for a slip and refused (`check_words`); the rest is told (`unread`).
"""

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
"""Element of a robot with contents for which URDF has no words, as JSON (`urdf.Beyond`)."""

_INFINITE = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)


class Words(NamedTuple):
    """Words inside an element; one with a prefix (``drake:``) always belongs to another program."""

    attributes: tuple[str, ...] = ()
    """Attributes that are known."""
    elements: tuple[str, ...] = ()
    """Child elements that are known."""
    several: tuple[str, ...] = ()
    """Child elements of which there may be more than one."""
    others: tuple[str, ...] = ()
    """Other programs' words, although they resemble known ones or belong elsewhere."""
    meant: Mapping[str, str] = MappingProxyType({})
    """Known words by what people write instead."""
    exclusive: bool = False
    """Whether all other words are slips, because no program puts its own here."""


MIRRORED = {"iyx": "ixy", "izx": "ixz", "izy": "iyz"}
"""Entries of an inertia that some write besides, and the entries that they must equal."""
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
"""Words inside each element. Elements that are not here are other programs' and not looked into."""


JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
"""Types of joint that Pinocchio reads."""

_SHOWN = 30
"""Letters of an unread text that messages show."""

_ALIKE = 0.7
"""Likeness to a known word from which a word is a slip rather than another program's."""


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
    """A line on the words and texts that are not read in elements that are; none without any."""
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
    """Whether a word is neither known nor has the prefix or namespace of another program."""
    return not (word in known or ":" in word or "}" in word)


def read_elements(
    element: ElementTree.Element, top: ElementTree.Element | None = None
) -> Iterator[tuple[ElementTree.Element, str, ElementTree.Element | None]]:
    """An element and all elements in it that are read.

    Yields:
        Each element; its place, such as ``link 'arm': <origin>``; and the link, joint or material
        to which it belongs (None: the robot).
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
    """Refuse a `word` at a `place` if it is a slip for a `known` one, or belongs `elsewhere`.

    `shown`: the word as messages have it, in quotes or brackets.
    """
    if word in vocabulary.others or not _foreign(word, known):
        return
    likeness = _ALIKE if not vocabulary.exclusive else 0.6 if len(known) > 1 else 0.0
    near = vocabulary.meant.get(word)
    meant = f'did you mean "{near}"? ' if near else closest(word, known, likeness)
    if meant or vocabulary.exclusive:
        choices = ", ".join(known) or "nothing"
        raise JointplayError(f"{place} has {shown}, which is not read; {meant}known: {choices}")
    if word in elsewhere:
        homes = [f"<{tag}>" for tag, its in WORDS.items() if word in its.elements]
        raise JointplayError(
            f"{place} has {shown}, where it is not read; it belongs in {' or '.join(homes)}"
        )


def numbers(
    element: ElementTree.Element | None,
    key: str,
    label: str,
    count: int,
    default: str | None = None,
    infinite: bool = False,
) -> list[float]:
    """Read `count` numbers of an attribute, as all programs read them.

    A mass that Python reads and Pinocchio does not, such as ``4_35``, becomes 0 there without a
    word. So only plain numbers are taken, and the element gets them separated by single spaces: a
    mass with a space behind it becomes 0, too, and vectors with tabs or line ends are not read.

    Args:
        element: the element; None: it is missing.
        key: name of the attribute.
        label: what messages call it.
        count: 1, 3 or 4.
        default: text of an attribute that is missing; None: it must be there.
        infinite: whether numbers may be infinite.

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
    """A number that a float can hold; NaN for any other text."""
    try:
        value = not_lost(text) if NUMBER.fullmatch(text) else math.nan
    except ValueError:  # too small
        return math.nan
    return value if math.isfinite(value) else math.nan


def as_option(names: Sequence[str]) -> str:
    """Names as ``--fix`` and ``--allow-unphysical`` take them: with commas, quoted for a shell."""
    written = io.StringIO()
    csv.writer(written, lineterminator="").writerow(names)
    return shlex.quote(written.getvalue())
