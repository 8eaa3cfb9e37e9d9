"""Held joints: made fixed in the description, as if welded.

That is also how links without inertia at the end of a chain can be used: a head that is a frame for
its cameras, the fingers of a hand.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pinocchio as pin

from jointplay.base.errors import MissingName
from jointplay.model.elements import origin_of, place_of
from jointplay.model.urdf import Description, doubt, read_again
from jointplay.model.vocabulary import numbers

_OF_FIXED = ("parent", "child")
"""Elements that a joint keeps when it becomes fixed; its origin is written anew."""


def without_floating_base(description: Description, clearance: Collection[str]) -> Description:
    """The description with a floating joint from the ground made fixed.

    Whether the base is free, `Mechanism`'s argument `base` says. A floating joint that has
    `clearance` stays: it is a joint with play, for which URDF has no other word.
    """
    bases = [
        joint.name
        for joint in description.joints.values()
        if joint.kind == "floating"
        and joint.parent == description.root
        and joint.name not in clearance
    ]
    if not bases:
        return description
    root = description.elements()
    for name in bases:
        doubt(root, f"floating joint {name!r} to the ground: --base free, or held (default)")
    return with_fixed(read_again(description, root, "floating joint"), bases)


def with_fixed(description: Description, joints: Collection[str]) -> Description:
    """The description with these joints fixed, and the joints that mimic them.

    A joint is held in its neutral position (`JointEntry.neutral`). One that is fixed already stays
    as it is.

    Raises:
        MissingName: no such joint.
    """
    for name in joints:
        if name not in description.joints:
            raise MissingName("joint", name, description.moving, where=("fix",))
    moving = description.moving
    places = {name: description.joints[name].neutral for name in joints if name in moving}
    if not places:
        return description
    while followers := [
        (entry.name, mimic)
        for entry in description.joints.values()
        if entry.name not in places
        and (mimic := entry.mimic) is not None
        and mimic.leader in places
    ]:
        for name, mimic in followers:
            places[name] = mimic.multiplier * places[mimic.leader] + mimic.offset
    root = description.elements()
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        if name not in places:
            continue
        place, position = place_of(joint), places[name]
        if position:
            axis = np.array(numbers(joint.find("axis"), "xyz", "axis", 3, "1 0 0"))
            move, still = position * axis / np.linalg.norm(axis), np.zeros(3)
            turns = description.joints[name].turns
            place = place * (pin.SE3(pin.exp3(move), still) if turns else pin.SE3(np.eye(3), move))
        for element in [child for child in joint if child.tag not in _OF_FIXED]:
            joint.remove(element)
        joint.insert(0, origin_of(place))
        joint.set("type", "fixed")
    return read_again(description, root, "joint")
