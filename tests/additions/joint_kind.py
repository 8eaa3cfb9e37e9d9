"""A kind of joint of one's own: a pin in a bore of three flat sides, whose axes stay parallel."""

import math
from dataclasses import dataclass
from typing import ClassVar

from jointplay.contact.compiled import compiled_touch
from jointplay.core.schema import add
from jointplay.joints import Clearance, RevoluteClearance


def touch(k, pose, bore_radius, pin_radius):
    """Gap to side k, its point of contact from the pin's centre, and the normal into the pin."""
    angle = 2.0 * math.pi * k / 3.0
    c, s = math.cos(angle), math.sin(angle)
    gap = bore_radius - pin_radius - c * pose[0] - s * pose[1]
    return gap, (gap + pin_radius) * c, (gap + pin_radius) * s, 0.0, -c, -s, 0.0


@dataclass(frozen=True, kw_only=True)
class ThreeSided(RevoluteClearance):
    """A pin of radius R_j between three planes that touch the circle of radius R_i."""

    kind: ClassVar[str] = "three-sided"

    lock_tilt: bool = True
    lock_axial: bool = True

    @property
    def shape(self):
        return compiled_touch(touch)

    @property
    def dimensions(self):
        return self.ri, self.rj

    @property
    def contacts(self):
        return "radial_A", "radial_B", "radial_C"


add(Clearance, ThreeSided)
