"""A robot's URDF with calibrated joint placements, and with the freedoms of bearings' clearance.

Each joint with clearance becomes the chain of its virtual link, so that other simulators have the
freedoms that play adds. The bearings themselves - round, elastic, with friction - cannot be
described in a URDF; limits take their place: a box of twice the clearance, and for a rolling
bearing, to which no contacts can be added, the free travel of its inner ring.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from xml.parsers import expat

import pinocchio as pin

from jointplay.base.errors import JointplayError, require_a, require_known
from jointplay.base.schema import known_keywords
from jointplay.model.elements import Element, origin_of, place_of, put, put_inertial
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import VIRTUAL_LINK

LIMIT_FACTOR = 2.0
"""Limits relative to the clearance: wider, so that contacts added to the file act before them."""

MASS_FRACTION = 1e-6
"""Mass of each link within a virtual link, relative to that of the body it carries.

Other simulators do not take massless links between moving joints. Each is a ball as large as the
bearing's bore.
"""
LEAST_MASS = 1e-9
"""Least mass of such a link [kg]."""

SPEED = {"prismatic": 10.0, "revolute": 100.0}
"""Velocity limits of the freedoms that play adds, as the format requires some [m/s or rad/s]."""


@known_keywords
def to_urdf(mechanism: Mechanism, corrections: Mapping[str, pin.SE3] | None = None) -> str:
    """Text of the mechanism's URDF in which each joint with clearance is a chain of single joints.

    The joint J becomes J.x, J.y, J.z, J, J.pitch, J.roll, without locked ones: the coordinates of
    `mechanism`, J being the one that a drive acts on. That one keeps its name, type, limits,
    dynamics and all else, so that transmissions, mimics and controllers find it. The axes are those
    of the bearing frame, expressed in the joint's own frame, which need not be turned: poses and
    inertias of all bodies stay as written. All other text stays byte for byte.

    Args:
        mechanism: the mechanism whose URDF is written.
        corrections: by joint, its calibrated pose in the frame of its origin, such as
            `Calibration.corrections`; it is written into the origin.

    Raises:
        MissingName: a correction of a joint that the URDF does not have.
        JointplayError: the mechanism has loops or gears, which a URDF cannot describe, a joint has
            no play, such as a preloaded bearing, or one of the new names is taken.
    """
    require_a("mechanism", mechanism, "Mechanism")
    for name in (*mechanism.loops, *mechanism.gears):
        noun = "loop" if name in mechanism.loops else "gear with play"
        raise JointplayError(
            f"{noun} {name!r} cannot be written: a URDF can only describe a tree of joints"
        )
    text = mechanism.description.plain_text  # mounts have no play, and stay fixed
    data = text.encode("utf-8")
    joints = mechanism.description.elements().findall("joint")
    elements = {joint.get("name", ""): joint for joint in joints}
    names = set(elements) | set(mechanism.description.links)
    pieces, end = [], 0
    corrections = corrections or {}
    for name in corrections:
        require_known("joint", name, elements)
    # The text between the joints that change is copied as it is.
    for name, start, stop in _spans(data, "joint"):
        if name in corrections:
            origin = origin_of(place_of(elements[name]) * corrections[name])
            former = elements[name].find("origin")
            if former is not None:
                elements[name].remove(former)
            elements[name].insert(0, origin)
            if name not in mechanism.clearance or name in mechanism.mounts:
                pieces += [data[end:start], _with_origin(data[start:stop], origin)]
                end = stop
        if name in mechanism.clearance and name not in mechanism.mounts:
            chain = _chain(mechanism, name, elements[name])
            for element in chain:
                if element.get("name") in names - {name}:
                    raise JointplayError(f"the URDF already has a {element.get('name')!r}")
            pieces += [data[end:start], _written(chain).encode("utf-8")]
            end = stop
    return b"".join([*pieces, data[end:]]).decode("utf-8")


def _spans(data: bytes, sought: str) -> list[tuple[str, int, int]]:
    """Name, first byte and end byte of each child of the root with this tag."""
    spans, depth, begun = [], 0, ("", 0)
    # The text has been decoded, whatever encoding its first line declares.
    parser = expat.ParserCreate(encoding="utf-8")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, begun
        depth += 1
        if depth == 2 and tag == sought:
            begun = (attributes.get("name", ""), parser.CurrentByteIndex)

    def stop(tag: str) -> None:
        nonlocal depth
        if depth == 2 and tag == sought:
            end = parser.CurrentByteIndex  # of <tag/>, its end
            if data.startswith(f"</{tag}".encode(), end):
                end = data.index(b">", end) + 1
            spans.append((*begun, end))
        depth -= 1

    parser.StartElementHandler, parser.EndElementHandler = start, stop
    parser.Parse(data, True)
    return spans


def _with_origin(joint: bytes, origin: Element) -> bytes:
    """Text of a joint with another origin; all else stays as written."""
    text = ElementTree.tostring(origin)
    for _, start, stop in _spans(joint, "origin"):
        return joint[:start] + text + joint[stop:]
    _, start, _ = _spans(joint, "parent")[0]
    return joint[:start] + text + joint[start:]


def _chain(mechanism: Mechanism, name: str, original: Element) -> list[Element]:
    """Joints and links of a joint's virtual link, from its parent link to its child."""
    joint = mechanism.clearance[name]
    if max(joint.play(second_order=False).reach) == 0.0:
        raise JointplayError(
            f"joint {name!r} has no play ({joint.summary}), and a URDF cannot say how it gives "
            "way: leave it out, or give it a bearing with clearance"
        )
    entry = mechanism.description.joints[name]
    child = mechanism.model.getFrameId(entry.child, pin.FrameType.BODY)
    # Columns: axes of the bearing in the child's own frame, which is that of the URDF's joint.
    axes = mechanism.model.frames[child].placement.rotation.T
    carried = mechanism.model.inertias[mechanism.model.getJointId(name)].mass
    chain: list[Element] = []
    link = entry.parent
    for freedom in joint.freedoms:
        group = VIRTUAL_LINK.index(freedom) // 3  # 0: translations x, y, z; 1: rotations z, y, x
        axis = axes[:, "xyz".index(freedom) if group == 0 else 2 - VIRTUAL_LINK[3:].index(freedom)]
        if freedom == joint.drive_coordinate:
            element = Element("joint", original.attrib)
            element.extend(e for e in original if e.tag not in ("parent", "child", "origin"))
            if original.get("type") == "floating":
                element.set("type", "continuous")
            if element.find("axis") is None:
                put(element, "axis", xyz=axis)
        else:
            kind = "revolute" if group else "prismatic"
            element = Element("joint", name=f"{name}.{freedom}", type=kind)
            put(element, "axis", xyz=axis)
            reach = joint.travel[freedom] * (LIMIT_FACTOR if joint.resultant is None else 1.0)
            put(element, "limit", lower=-reach, upper=reach, effort=0.0, velocity=SPEED[kind])
        last = freedom == joint.freedoms[-1]
        following = entry.child if last else f"{name}.{freedom}_link"
        links = [Element("parent", link=link), Element("child", link=following)]
        # The first joint of the chain has the origin of the original, the last one its child.
        if not chain and (origin := original.find("origin")) is not None:
            links.append(origin)
        for index, end in enumerate(links):
            element.insert(index, end)
        chain.append(element)
        if not last:
            mass = max(MASS_FRACTION * carried, LEAST_MASS)
            chain.append(Element("link", name=following))
            put_inertial(chain[-1], pin.Inertia.FromSphere(mass, joint.half_width))
        link = following
    return chain


def _written(chain: Iterable[Element]) -> str:
    parts = []
    for element in chain:
        ElementTree.indent(element, "  ", 1)
        element.tail = None
        parts.append(ElementTree.tostring(element, encoding="unicode"))
    return "\n  ".join(parts)
