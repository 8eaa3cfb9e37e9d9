"""The spherical joint with clearance: a ball in a socket."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from jointplay.contact import ContactProperties
from jointplay.geometry import Shape
from jointplay.joints.base import VIRTUAL_LINK, Outline, RoundClearance
from jointplay.joints.play import BallPlay

_NUMBER = 200


@dataclass(frozen=True, kw_only=True)
class SphericalClearance(RoundClearance):
    """A ball of radius R_j in a socket of radius R_i that encloses it (one contact).

    Give the socket and either the clearance C = R_i - R_j or the ball. The Hertz stiffness of
    eqs 11-13, of a sphere in a spherical cavity, is meant for just this geometry. Reference:
    P. Flores, H. M. Lankarani, Nonlinear Dynamics 60 (2010) 99-114.

    In a URDF it replaces a ``floating`` joint, for which URDF has no better word. Its rotation is
    described by yaw, pitch and roll about the socket's axes: z should be the axis about which the
    ball turns far, and pitch must stay away from 90 degrees.

    Raises:
        JointplayError: a dimension that is missing, not positive, contradictory or impossible.
    """

    kind: ClassVar[str] = "spherical"
    replaces: ClassVar[tuple[str, ...]] = ("floating",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = VIRTUAL_LINK[3:]

    def __post_init__(self) -> None:
        """Derive what is missing and refuse what cannot be."""
        super().__post_init__()
        self.refuse_line_contact()

    @classmethod
    def of_room(cls, radial: float, axial: float, sizes: Mapping[str, float]) -> Self:
        """See `Clearance.of_room`."""
        own = {name: size for name, size in sizes.items() if name == "bearing_radius"}
        return cls(radial_clearance=radial, **own)  # type: ignore[arg-type]

    def contact_properties(self, contact: int) -> ContactProperties:
        """Those of the one contact."""
        return self.round_contact()

    @property
    def shape(self) -> Shape:
        """A ball."""
        return Shape.BALL

    @property
    def dimensions(self) -> tuple[float, ...]:
        """R_i and R_j [m]."""
        return self.bearing_radius, self.rj

    @property
    def contacts(self) -> tuple[str, ...]:
        """One, wherever the ball touches."""
        return ("socket",)

    @property
    def rooms(self) -> tuple[float, ...]:
        """C [m]."""
        return (self.cr,)

    @property
    def room_to_start(self) -> dict[str, float]:
        """C / sqrt(3) each, so that every corner of the box is inside the socket."""
        return dict.fromkeys(VIRTUAL_LINK[:3], self.cr / np.sqrt(3.0))

    @property
    def outline(self) -> Outline:
        """A ball in a socket."""
        return Outline("ball", (self.rj,) * 3, (self.cr,) * 3, False)

    @property
    def travel(self) -> dict[str, float]:
        """C, and rotations that are free: half of the turn that the coordinates can tell."""
        return dict.fromkeys("xyz", self.cr) | {"pitch": math.pi / 4, "roll": math.pi / 2}

    def play(self, second_order: bool = True) -> BallPlay:
        """A ball, exact in every order."""
        return BallPlay(self.cr)

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        """Within a sphere, however it is turned."""
        return bool(np.linalg.norm(np.abs(offset)) <= self.cr)

    def ideal_part(self, rotation: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Any rotation, no translation."""
        return rotation, np.zeros(3)

    def directions(self) -> np.ndarray:
        """Evenly over the sphere (Fibonacci lattice); the force passes through the ball's centre.

        The friction it causes does not, but friction starts no impact.
        """
        i = np.arange(_NUMBER)
        z = 1.0 - (2.0 * i + 1.0) / _NUMBER
        r, phi = np.sqrt(1.0 - z * z), i * np.pi * (3.0 - np.sqrt(5.0))
        return np.column_stack([r * np.cos(phi), r * np.sin(phi), z, np.zeros((_NUMBER, 3))])
