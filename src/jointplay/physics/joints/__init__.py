"""Kinds of joint with clearance, one module each; `base` has what each kind must define."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jointplay.base.schema import Family, Preset, register, register_names
from jointplay.physics.joints import materials
from jointplay.physics.joints.base import (
    MOTOR,
    RELATIVE,
    VIRTUAL_LINK,
    Clearance,
    Coordinate,
    Material,
    Outline,
    RoundClearance,
    SlidingClearance,
)
from jointplay.physics.joints.bearings import BallBearing, CrossedRollerBearing, RollingBearing
from jointplay.physics.joints.compliance import (
    CompliantJoint,
    CompliantMount,
    CompliantSlider,
    SeatParts,
    parts_of_seat,
)
from jointplay.physics.joints.cylindrical import CylindricalClearance
from jointplay.physics.joints.elasticity import Elasticity
from jointplay.physics.joints.fits import Fit
from jointplay.physics.joints.groove import GrooveClearance
from jointplay.physics.joints.prismatic import PrismaticClearance
from jointplay.physics.joints.revolute import RevoluteClearance
from jointplay.physics.joints.spherical import IDEAL_BALL, SphericalClearance

JOINT_KINDS: dict[str, type[Clearance]] = {
    kind.kind: kind
    for kind in (
        *(RevoluteClearance, SphericalClearance, PrismaticClearance, CylindricalClearance),
        *(GrooveClearance, BallBearing, CrossedRollerBearing),
        *(CompliantJoint, CompliantSlider, CompliantMount),
    )
}
"""The kinds of joint by the word that selects them."""

UNNAMED_KIND: type[Clearance] = RevoluteClearance
"""Kind of a joint that names none."""

JOINT_WORDS: dict[str, type[Clearance] | Preset] = {
    **JOINT_KINDS,
    "planar": Preset(RevoluteClearance, "PlanarJoint", {"lock_tilt": True, "lock_axial": True}),
}
"""Words for kinds of joint in scenarios."""

register(
    Clearance, Family("kind", "kind of joint", JOINT_WORDS, default=UNNAMED_KIND.kind, bare=False)
)
register_names(Material, materials.material, lambda: materials.materials(aliases=True))


def class_of(description: Mapping[str, Any]) -> type[Clearance]:
    """Class of the joint with this description by `Clearance.describe`."""
    kind = JOINT_WORDS[description.get("kind", UNNAMED_KIND.kind)]
    return kind.kind if isinstance(kind, Preset) else kind


def replacing(entry: str) -> list[str]:
    """Kinds of joint that can take the place of a URDF joint of the type `entry`."""
    return [name for name, kind in JOINT_KINDS.items() if entry in kind.replaces]


__all__ = [
    "IDEAL_BALL", "JOINT_KINDS", "JOINT_WORDS", "MOTOR", "RELATIVE", "UNNAMED_KIND", "VIRTUAL_LINK",
    "BallBearing", "Clearance", "CompliantJoint", "CompliantMount", "CompliantSlider", "Coordinate",
    "CrossedRollerBearing", "CylindricalClearance", "Elasticity", "Fit", "GrooveClearance",
    "Material", "Outline", "PrismaticClearance", "RevoluteClearance", "RollingBearing",
    "RoundClearance", "SeatParts", "SlidingClearance", "SphericalClearance", "class_of",
    "parts_of_seat", "replacing",
]  # fmt: skip
