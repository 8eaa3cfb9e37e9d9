"""Kinds of joint with clearance, one module each; `base` says what a kind must tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jointplay import moved
from jointplay.codec import Family, Preset, read, register
from jointplay.joints.base import RELATIVE, VIRTUAL_LINK, Clearance, Material
from jointplay.joints.cylindrical import CylindricalClearance
from jointplay.joints.prismatic import PrismaticClearance
from jointplay.joints.revolute import RevoluteClearance
from jointplay.joints.spherical import SphericalClearance

JOINT_KINDS: dict[str, type[Clearance]] = {
    kind.kind: kind
    for kind in (RevoluteClearance, SphericalClearance, PrismaticClearance, CylindricalClearance)
}


UNNAMED_KIND: type[Clearance] = RevoluteClearance
"""What a joint is of which nothing is said."""

JOINT_WORDS: dict[str, type[Clearance] | Preset] = {
    **JOINT_KINDS,
    "planar": Preset(RevoluteClearance, "PlanarJoint", {"lock_tilt": True, "lock_axial": True}),
}
"""Words that scenarios have for kinds of joint."""

register(
    Clearance,
    Family("kind", "kind of joint", JOINT_WORDS, default=UNNAMED_KIND.kind, bare=False),
)


def replacing(entry: str) -> list[str]:
    """Kinds of joint that can take the place of a URDF joint of the type `entry`."""
    return [name for name, kind in JOINT_KINDS.items() if entry in kind.replaces]


def joint_from_description(description: Mapping[str, Any]) -> Clearance:
    """Build the joint that `Clearance.describe` described.

    Raises:
        JointplayError: no such kind of joint, or a value that cannot be.
    """
    joint: Clearance = read(Clearance, description)
    return joint


def __getattr__(name: str) -> Any:
    if name in moved.KINDS:
        return moved.found("jointplay.joints", name)
    raise AttributeError(f"module 'jointplay.joints' has no attribute {name!r}")


__all__ = [
    "JOINT_KINDS",
    "JOINT_WORDS",
    "RELATIVE",
    "UNNAMED_KIND",
    "VIRTUAL_LINK",
    "Clearance",
    "CylindricalClearance",
    "Material",
    "PrismaticClearance",
    "RevoluteClearance",
    "SphericalClearance",
    "joint_from_description",
    "replacing",
]
