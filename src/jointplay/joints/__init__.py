"""Kinds of joint with clearance, one module each; `base` says what a kind must tell."""

from __future__ import annotations

from typing import Any

from jointplay.errors import MissingName
from jointplay.joints.base import VIRTUAL_LINK, Clearance, Material
from jointplay.joints.prismatic import PrismaticJoint
from jointplay.joints.revolute import ClearanceJoint
from jointplay.joints.spherical import SphericalJoint

JOINT_KINDS: dict[str, type[Clearance]] = {
    kind.kind: kind for kind in (ClearanceJoint, SphericalJoint, PrismaticJoint)
}


def joint_from_description(description: dict[str, Any]) -> Clearance:
    """Build the joint that `Clearance.describe` described.

    Raises:
        MissingName: no such kind of joint.
    """
    kind = description["kind"]
    if kind not in JOINT_KINDS:
        raise MissingName("kind of joint", kind, JOINT_KINDS)
    return JOINT_KINDS[kind].from_description(description)


__all__ = [
    "JOINT_KINDS",
    "VIRTUAL_LINK",
    "Clearance",
    "ClearanceJoint",
    "Material",
    "PrismaticJoint",
    "SphericalJoint",
    "joint_from_description",
]
