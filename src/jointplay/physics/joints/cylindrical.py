"""The cylindrical joint with clearance: a rod that turns and slides in a bushing.

The rod is longer than the bushing: its side touches the edges of the bore. `touch` finds the gaps;
it is compiled and called by address (`geometry.contacts`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.schema import Quantity, quantity
from jointplay.base.units import readable
from jointplay.physics.contact import ContactProperties
from jointplay.physics.joints.base import Outline, RoundClearance
from jointplay.physics.joints.play import JournalPlay

_NEAR = 0.1
"""Term of the tilt, relative to the offset, below which Newton's method converges to the nearest
point; above, bisection is used."""


def touch(k, pose, bearing_radius, journal_radius, bearing_length):  # type: ignore[no-untyped-def]
    """Gap between an edge of the bushing (k = 0: the end at +z, 1: at -z) and the rod.

    The edge is a circle of radius R_i in the plane z = h, which the rod's axis a intersects at o.
    With the direction t in which the axis leans, and n across it, the edge's point at the azimuth
    phi is at the distance from the axis

        d(phi)^2 = (R_i cos(phi) - o_t)^2 cos(tilt)^2 + (R_i sin(phi) - o_n)^2

    Its minimum lies in the quadrant of o, where o_n cos(phi) - o_t cos(tilt)^2 sin(phi)
    - R_i sin(tilt)^2 sin(phi) cos(phi) has one root. The gap is d - R_j, the force acts at the
    edge's point towards the axis: it does exactly the work that the change of the gap implies.

    Returns the gap [m], the point's offset from the rod's centre (3) [m], and the normal (3).
    """
    ax, ay, az = pose[5], pose[8], pose[11]
    height = 0.5 * bearing_length if k == 0 else -0.5 * bearing_length
    distance_along = (height - pose[2]) / az
    ox, oy = pose[0] + distance_along * ax, pose[1] + distance_along * ay
    sine = math.sqrt(ax * ax + ay * ay)
    tx, ty = (ax / sine, ay / sine) if sine > 1e-15 else (1.0, 0.0)
    along, across = ox * tx + oy * ty, oy * tx - ox * ty
    x, y, bulge = abs(along) * az * az, abs(across), bearing_radius * sine * sine
    norm = math.sqrt(x * x + y * y)
    c, s = (x / norm, y / norm) if norm > 1e-150 else (1.0, 0.0)
    if norm > 1e-150 and 0.0 < bulge < _NEAR * norm:
        for _ in range(5):
            slope = -y * s - x * c - bulge * (c * c - s * s)
            step = -(y * c - x * s - bulge * s * c) / slope
            c, s = c - step * s, s + step * c
            scale = 1.0 / math.sqrt(c * c + s * s)
            c, s = scale * c, scale * s
    elif bulge > 0.0 and norm > 1e-150:
        low, high = 0.0, 0.5 * math.pi
        for _ in range(60):
            phi = 0.5 * (low + high)
            c, s = math.cos(phi), math.sin(phi)
            if y * c - x * s - bulge * s * c > 0.0:
                low = phi
            else:
                high = phi
    c = bearing_radius * math.copysign(c, along)
    s = bearing_radius * math.copysign(s, across)
    rx, ry, rz = c * tx - s * ty - pose[0], c * ty + s * tx - pose[1], height - pose[2]
    axial = rx * ax + ry * ay + rz * az
    fx, fy, fz = axial * ax - rx, axial * ay - ry, axial * az - rz
    distance = math.sqrt(fx * fx + fy * fy + fz * fz)
    inverse = 1.0 / distance if distance > 0.0 else 0.0  # an edge on the axis has no direction
    return distance - journal_radius, rx, ry, rz, inverse * fx, inverse * fy, inverse * fz


@dataclass(frozen=True, kw_only=True)
class CylindricalClearance(RoundClearance):
    """A rod of radius R_j that turns and slides in a bushing of radius R_i and length L_i.

    The rod reaches beyond both ends of the bushing wherever it slides, so that the edges of the
    bore touch it, one contact at each end; nothing limits it along the axis. The ideal joint has
    two freedoms: z, and yaw, on which a drive acts.

    In a URDF it replaces a ``floating`` joint, as URDF has no type for it; z is the axis.

    Raises:
        JointplayError: a dimension that is missing, not positive, contradictory or impossible.
    """

    kind: ClassVar[str] = "cylindrical"
    replaces: ClassVar[tuple[str, ...]] = ("floating",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("z", "yaw")
    touch: ClassVar[Callable[..., Any]] = staticmethod(touch)

    bearing_length: Quantity = quantity("m", default=40e-3, above=0.0, label="bearing length")
    """Length L_i of the bushing [m]."""
    stroke: Quantity = quantity("m", default=0.1, above=0.0, label="stroke")
    """Travel of the rod, to either side [m]; a limit in URDFs that are written, no force."""

    def __post_init__(self) -> None:
        super().__post_init__()
        shortest = 2.0 * math.sqrt(self.ri * self.cr)  # as for a journal: docs/theory.md
        if self.bearing_length <= shortest:
            raise JointplayError(
                f"bearing length {readable(self.bearing_length, 'm')} is too short for radial "
                f"clearance {readable(self.cr, 'm')}: an edge would touch both sides of the rod; "
                f"it must exceed {readable(shortest, 'm')}",
                where=("bearing_length",),
            )

    @property
    def contacts(self) -> tuple[str, ...]:
        return "edge_A", "edge_B"

    def contact_properties(self, contact: int) -> ContactProperties:
        return self.round_contact(
            journal_length=self.bearing_length, contact_length=self.bearing_length / 2
        )

    @property
    def outline(self) -> Outline:
        size = (self.rj, self.rj, self.bearing_length / 2)
        return Outline("cylinder", size, (self.cr, self.cr, 0.0))

    @property
    def travel(self) -> dict[str, float]:
        return super().travel | {"z": self.stroke}

    def play(self, second_order: bool = True) -> JournalPlay:
        return JournalPlay(self.cr, 0.0, self.bearing_length, 0.0, radius=self.rj)

    def arm(self, centre: np.ndarray) -> float:
        return super().arm(centre) + float(np.linalg.norm(centre))
