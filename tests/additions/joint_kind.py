"""A kind of joint of one's own: a pin in a bore of three flat sides, whose axes stay parallel."""

import math
from dataclasses import dataclass
from typing import ClassVar

from jointplay.base.schema import add
from jointplay.physics.joints import Clearance, Outline, RoundClearance


def touch(k, pose, bearing_radius, journal_radius):
    """Gap to side k, its point of contact from the pin's centre, and the normal into the pin."""
    angle = 2.0 * math.pi * k / 3.0
    c, s = math.cos(angle), math.sin(angle)
    gap = bearing_radius - journal_radius - c * pose[0] - s * pose[1]
    reach = gap + journal_radius
    return gap, reach * c, reach * s, 0.0, -c, -s, 0.0


@dataclass(frozen=True, kw_only=True)
class ThreeSided(RoundClearance):
    """A pin of radius R_j between three planes that touch the circle of radius R_i."""

    kind: ClassVar[str] = "three-sided"
    replaces: ClassVar[tuple[str, ...]] = ("revolute", "continuous")
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("yaw",)
    touch: ClassVar = staticmethod(touch)

    contacts: ClassVar[tuple[str, ...]] = ("x", "left", "right")
    freedoms: ClassVar[tuple[str, ...]] = ("x", "y", "yaw")

    @property
    def outline(self):
        return Outline("cylinder", (self.rj, self.rj, 0.02), (self.cr, self.cr, 0.0))


add(Clearance, ThreeSided)
