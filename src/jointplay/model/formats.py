"""Robots' files of all formats: a file that is no URDF is turned into one.

An MJCF is told by its root element, xacro (`model.xacro`) by what is in the file. All that comes
later sees a `Description`.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Mapping
from io import StringIO
from pathlib import Path

from jointplay.base.errors import JointplayError
from jointplay.base.files import read_text
from jointplay.model import urdf, xacro
from jointplay.model.robots import Source, source_of

_PREFIX = re.compile(r"<([A-Za-z_][\w.-]*):")
_MJCF = "mujoco"
"""Tag of an MJCF's root element."""


def read(
    place: str | Path,
    allow_unphysical: Collection[str] = (),
    folder: Path = Path(),
    arguments: Mapping[str, xacro.Value] | None = None,
) -> urdf.Description:
    """Read and check a robot.

    Args:
        place: a file, or a robot's name, as for `robots.source_of`.
        allow_unphysical: links whose inertia is not checked; ``"all"`` for all of them.
        folder: where a relative path begins.
        arguments: arguments of xacro, by name.

    Raises:
        JointplayError: the file is missing or malformed, its links do not form one tree, or a
            link's inertia is impossible (the message names the link and its principal moments).
    """
    source = source_of(place, folder)
    return urdf.parse(urdf_text(source, arguments or {}), source.path, allow_unphysical)


def urdf_text(source: Source, arguments: Mapping[str, xacro.Value]) -> str:
    """A robot's file as a URDF, unchecked; `arguments` are those of xacro.

    Raises:
        JointplayError: the file cannot be read, or not be turned into a URDF.
    """
    path, usual = source
    text = read_text(path, "robot")
    used = xacro.uses_xacro(text)
    if path.suffix.lower() == xacro.SUFFIX or (used and (arguments or usual)):
        text = xacro.expand(text, path, arguments, usual)
    elif used:
        raise JointplayError(
            f"{str(path)!r} is written in xacro, which is expanded only if it is asked for: name "
            f"it {xacro.SUFFIX}, or give it an argument"
        )
    elif arguments:
        name = next(iter(arguments))
        raise JointplayError(f"{str(path)!r} is no xacro: it takes no argument {name!r}")
    if _root_tag(text) == _MJCF:
        from jointplay.model import mjcf  # a module that a URDF does without

        return mjcf.urdf_text(text, path)
    # Many URDFs have <sensor:camera> for Gazebo, and do not declare the prefix.
    prefixes = dict.fromkeys(_PREFIX.findall(xacro.without_comments(text)))
    declared = [
        f' xmlns:{prefix}="{prefix}"' for prefix in prefixes if f"xmlns:{prefix}" not in text
    ]
    return re.sub(r"<robot\b", lambda match: match[0] + "".join(declared), text, count=1)


def says_more(place: str | Path, folder: Path = Path()) -> bool:
    """Whether a robot's file is of a format that says more than a URDF: an MJCF."""
    path = source_of(place, folder).path
    return _root_tag(read_text(path, "robot")) == _MJCF


def _root_tag(text: str) -> str:
    """Tag of the root element; empty if the text is not well-formed, which `urdf` reports."""
    try:
        _, root = next(ElementTree.iterparse(StringIO(text), ("start",)))
    except (ElementTree.ParseError, ValueError, StopIteration):
        return ""
    return root.tag if isinstance(root, ElementTree.Element) else ""
