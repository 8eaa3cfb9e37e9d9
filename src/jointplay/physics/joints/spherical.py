"""The spherical joint with clearance: a ball in a socket."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jointplay.physics.geometry import Shape
from jointplay.physics.joints.base import VIRTUAL_LINK, Outline, RoundClearance


@dataclass(frozen=True, kw_only=True)
class SphericalClearance(RoundClearance):
    """A ball of radius R_j in a socket of radius R_i that encloses it (one contact).

    Give the socket and either the clearance C = R_i - R_j or the ball. The Hertz stiffness of
    eqs 11-13, of a sphere in a spherical cavity, is meant for just this geometry. Reference:
    P. Flores, H. M. Lankarani, Nonlinear Dynamics 60 (2010) 99-114.

    In a URDF it replaces a ``floating`` joint, as URDF has no closer type. Its rotation is
    described by yaw, pitch and roll about the socket's axes: z should be the axis about which the
    ball turns far, and pitch must stay away from 90 degrees.

    Raises:
        JointplayError: a dimension that is missing, not positive, contradictory or impossible.
    """

    kind: ClassVar[str] = "spherical"
    replaces: ClassVar[tuple[str, ...]] = ("floating",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = VIRTUAL_LINK[3:]
    fit_size: ClassVar[tuple[str, float] | None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.refuse_line_contact()

    @property
    def shape(self) -> Shape:
        return Shape.BALL

    @property
    def dimensions(self) -> tuple[float, ...]:
        return self.ri, self.rj

    @property
    def contacts(self) -> tuple[str, ...]:
        return ("socket",)

    @property
    def outline(self) -> Outline:
        return Outline("ball", (self.rj,) * 3, (self.cr,) * 3)

    @property
    def start_travels(self) -> dict[str, float]:
        return dict.fromkeys(VIRTUAL_LINK[:3], self.cr / np.sqrt(3.0))

    @property
    def travel(self) -> dict[str, float]:
        return super().travel | {"pitch": math.pi / 4, "roll": math.pi / 2}


IDEAL_BALL = SphericalClearance(bearing_radius=0.01, radial_clearance=1e-4, ideal=True)
"""A ball without clearance; its dimensions have no effect."""
