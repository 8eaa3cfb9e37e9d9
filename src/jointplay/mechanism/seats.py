"""Bushes in seats that give way, as links of the URDF.

A joint in a seat has one more body: its bush, which the mount ``JOINT_seat`` holds in the link that
carries the bearing, and against which the journal hits. In the URDF it is the link ``JOINT_bush``,
and the mount a fixed joint, which is what remains of it without clearance.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError
from jointplay.joints import Clearance, SeatParts
from jointplay.mechanism.loop import Loop
from jointplay.mechanism.model import z_to
from jointplay.mechanism.urdf import NO_AXIS, Description, impossible_inertias, parse

BUSH, SEAT, _BED = "_bush", "_seat", "_bed"
"""What is appended to a joint's name: of its bush, of the mount of this, of the link beyond."""


def seat_of_joint(
    description: Description, name: str, joint: Clearance, parts: SeatParts
) -> Description:
    """The URDF with the bush of the joint `name`.

    The mount's z is the joint's axis. Where the child carries the bearing (`Clearance.exchanged`),
    a link without mass turns its axes back to the child's.

    Raises:
        JointplayError: a name is taken.
    """
    root = description.elements()
    element = next(one for one in root.findall("joint") if one.get("name") == name)
    axis = np.array([0.0, 0.0, 1.0])
    if element.get("type") not in NO_AXIS:
        given = element.find("axis")
        text = "1 0 0" if given is None else str(given.get("xyz", "1 0 0"))
        axis = np.array([float(x) for x in text.split()])
        axis /= np.linalg.norm(axis)
    turn = pin.SE3(z_to(axis), np.zeros(3))
    bush, mount, bed = (f"{name}{part}" for part in (BUSH, SEAT, _BED))
    entry = description.joints[name]
    if joint.exchanged:
        set_end(element, "child", bush)
        _add_link(root, bush, parts, turn)
        _add_link(root, bed)
        add_fixed(root, mount, bush, bed, turn)
        add_fixed(root, f"{name}{SEAT}{_BED}", bed, entry.child, turn.inverse())
    else:
        place = place_of(element)
        for origin in element.findall("origin"):
            element.remove(origin)
        _add_link(root, bush, parts)
        add_fixed(root, mount, entry.parent, bush, place * turn)
        set_end(element, "parent", bush)
        element.append(origin_of(turn.inverse()))
    return read_again(description, root, "seat", bush, mount, bed)


def seat_of_loop(
    description: Description, name: str, loop: Loop, joint: Clearance, parts: SeatParts
) -> tuple[Description, Loop]:
    """The URDF and the loop `name` with the bush of its joint.

    Raises:
        JointplayError: a name is taken.
    """
    root = description.elements()
    bush, mount = f"{name}{BUSH}", f"{name}{SEAT}"
    side = "journal" if joint.exchanged else "bearing"
    link, place = getattr(loop, f"{side}_link"), getattr(loop, side)
    _add_link(root, bush, parts)
    add_fixed(root, mount, link, bush, place)
    zero = (0.0, 0.0, 0.0)
    changes: dict[str, Any] = {f"{side}_link": bush, f"{side}_xyz": zero, f"{side}_rpy": zero}
    return read_again(description, root, "seat", bush, mount), replace(loop, **changes)


def read_again(
    description: Description, root: ElementTree.Element, what: str, *names: str
) -> Description:
    """The URDF with changed elements.

    Raises:
        JointplayError: one of `names`, which are those of new links and joints, is taken; `what`
            needs it.
    """
    for name in names:
        if name in (*description.links, *description.joints):
            raise JointplayError(
                f"the URDF already has a {name!r}: a {what} needs this name. To change a {what}, "
                "build the mechanism from its own URDF again"
            )
    text = ElementTree.tostring(root, encoding="unicode")
    # Its inertias have been checked, and some allowed although no body has them.
    made = parse(text, description.path, list(impossible_inertias(root)))
    return replace(made, stored=description.stored)


def _add_link(
    root: ElementTree.Element,
    name: str,
    parts: SeatParts | None = None,
    axes: pin.SE3 | None = None,
) -> None:
    link = ElementTree.SubElement(root, "link", name=name)
    if parts is None:
        return
    inertial = ElementTree.SubElement(link, "inertial")
    if axes is not None:
        inertial.append(origin_of(axes))
    ElementTree.SubElement(inertial, "mass", value=repr(parts.mass))
    values = dict(zip(("ixx", "iyy", "izz"), map(repr, parts.moments), strict=True))
    products = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    ElementTree.SubElement(inertial, "inertia", values | products)


def set_end(joint: ElementTree.Element, end: str, link: str) -> None:
    """Let an end of a joint be another link."""
    for one in joint.findall(end):
        one.set("link", link)


def add_fixed(
    root: ElementTree.Element, name: str, parent: str, child: str, place: pin.SE3
) -> None:
    """Add a fixed joint with the child at `place` in the parent."""
    joint = ElementTree.SubElement(root, "joint", name=name, type="fixed")
    joint.append(origin_of(place))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)


def place_of(element: ElementTree.Element) -> pin.SE3:
    """Where the origin of a joint or of an inertial is."""
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = ([float(x) for x in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))


def origin_of(place: pin.SE3) -> ElementTree.Element:
    """The element that says so."""
    xyz, rpy = place.translation, pin.rpy.matrixToRpy(place.rotation)
    written = {key: " ".join(f"{x:.17g}" for x in v) for key, v in (("xyz", xyz), ("rpy", rpy))}
    return ElementTree.Element("origin", written)
