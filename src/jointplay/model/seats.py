"""Bushes in seats that give way, as links of the URDF.

A joint in a seat has one more body: its bush, which the mount ``JOINT_seat`` holds in the link that
carries the bearing, and against which the journal hits. In the URDF it is the link ``JOINT_bush``,
and the mount a fixed joint, which is what remains of it without clearance.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.model import elements
from jointplay.model.builder import z_to
from jointplay.model.loop import Loop
from jointplay.model.urdf import NO_AXIS, Description, read_again
from jointplay.physics.joints import Clearance, SeatParts

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
        elements.set_end(element, "child", bush)
        _put_bush(root, bush, parts, turn)
        elements.put(root, "link", name=bed)
        elements.put_fixed(root, mount, bush, bed, turn)
        elements.put_fixed(root, f"{name}{SEAT}{_BED}", bed, entry.child, turn.inverse())
    else:
        place = elements.place_of(element)
        for origin in element.findall("origin"):
            element.remove(origin)
        _put_bush(root, bush, parts)
        elements.put_fixed(root, mount, entry.parent, bush, place * turn)
        elements.set_end(element, "parent", bush)
        element.append(elements.origin_of(turn.inverse()))
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
    _put_bush(root, bush, parts)
    elements.put_fixed(root, mount, link, bush, place)
    zero = (0.0, 0.0, 0.0)
    changes: dict[str, Any] = {f"{side}_link": bush, f"{side}_xyz": zero, f"{side}_rpy": zero}
    return read_again(description, root, "seat", bush, mount), replace(loop, **changes)


def _put_bush(
    root: elements.Element, name: str, parts: SeatParts, axes: pin.SE3 | None = None
) -> None:
    inertia = pin.Inertia(parts.mass, np.zeros(3), np.diag(parts.moments))
    elements.put_inertial(elements.put(root, "link", name=name), inertia, axes)
