"""Compliant joints: springs in the directions in which a joint holds its two bodies.

`Elasticity` is their stiffness. `CompliantJoint` and `CompliantSlider` are joints without play held
by such springs; a rolling bearing can have them as its `seat`, in series with its balls or rollers.
`CompliantMount` holds a body in every direction: instead of a fixed joint, or under the bush of a
joint whose surfaces slide (`parts_of_seat`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from jointplay.base.errors import JointplayError, require_a, require_known, within
from jointplay.physics.contact import resultant
from jointplay.physics.contact.law import ContactProperties, NormalForceLaw
from jointplay.physics.joints import base
from jointplay.physics.joints.elasticity import ABOUT_AXIS, ALONG_AXIS, Elasticity
from jointplay.physics.joints.element_play import NO_PLAY
from jointplay.physics.joints.play import Play

_LAWS = {ABOUT_AXIS: resultant.SPRINGS, ALONG_AXIS: resultant.GUIDE, None: resultant.MOUNT}
"""Compiled laws of springs, by the direction that they leave free."""


@dataclass(frozen=True, kw_only=True)
class _Held(base.WholeLawJoint):
    """A joint without play, held by springs in all directions that are not free."""

    clearance_fields: ClassVar[Mapping[str, str | None]] = {}
    free: ClassVar[int | None]
    """Direction that springs leave free, see `Elasticity.require_free`."""
    thickness: ClassVar[float] = 0.5
    """Thickness of the disc in pictures, relative to its diameter."""

    elasticity: Elasticity
    """Stiffness of the joint; none in the direction that is free."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_a("elasticity", self.elasticity, "Elasticity")
        with within("elasticity"):
            self.elasticity.require_free(self.free)

    @property
    def springs(self) -> Elasticity:
        return self.elasticity

    @property
    def contacts(self) -> tuple[str, ...]:
        return ("springs",)

    @cached_property
    def resultant(self) -> tuple[float, ...]:
        head = resultant.bearing_numbers(
            rollers=False, count=0, stiffness=0.0, radius=0.0, reach=0.0, distance=0.0, ratio=0.0,
            rows=(), damping=self.elasticity.damping_time,
        )  # fmt: skip
        return (*head, *self.elasticity.numbers(self.free))

    @property
    def law(self) -> int:
        return _LAWS[self.free]

    @property
    def normal(self) -> NormalForceLaw:
        """A linear spring across the axis."""
        return resultant.ElementContact(1.0)

    def contact_properties(self, contact: int) -> ContactProperties:
        return ContactProperties(float(np.diag(self.elasticity.stiffness)[:2].max()), 1.0)

    @property
    def radial_travel(self) -> float:
        return 0.0

    @property
    def search_radius(self) -> float:
        return 1.0 / float(np.diag(self.elasticity.stiffness)[:2].max())

    @property
    def depth_limit(self) -> float:
        return 0.1

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        return True

    def play(self, second_order: bool = True) -> Play:
        return NO_PLAY

    def directions(self) -> np.ndarray:
        rows = [base.RELATIVE.index(part) for part in self.freedoms]
        rows = [row for row in rows if row != self.free]
        forces = [row for row in rows if row < 3]
        return np.eye(6)[forces] if forces else self.outline.size[0] * np.eye(6)[rows]

    @property
    def outline(self) -> base.Outline:
        """A disc for pictures, without room, of the radius at which tilt is as stiff as axial."""
        _, _, along, tilt, _, _ = np.diag(self.elasticity.stiffness)
        radius = float(np.clip(math.sqrt(2.0 * tilt / along), 5e-3, 0.1))
        size = (radius, radius, self.thickness * radius)
        return base.Outline("cylinder", size, (0.0, 0.0, 0.0), walls=True)

    def scaled(self, factor: float) -> _Held:
        return self

    @property
    def summary(self) -> str:
        return f"compliant, {self.elasticity.summary}"

    @property
    def play_words(self) -> str:
        return "no play"


@dataclass(frozen=True, kw_only=True)
class CompliantJoint(_Held):
    """A joint that turns without play, and is elastic across, along and in tilt (`Elasticity`).

    Its six coordinates are free; springs hold all but the rotation about the axis.
    """

    kind: ClassVar[str] = "compliant"
    replaces: ClassVar[tuple[str, ...]] = ("revolute", "continuous")
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("yaw",)
    free: ClassVar[int | None] = ABOUT_AXIS


@dataclass(frozen=True, kw_only=True)
class CompliantSlider(_Held):
    """A joint that slides without play, and is elastic across and in all rotations (`Elasticity`).

    Its six coordinates are free; springs hold all but the displacement along z.
    """

    kind: ClassVar[str] = "compliant-slider"
    replaces: ClassVar[tuple[str, ...]] = ("prismatic",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("z",)
    free: ClassVar[int | None] = ALONG_AXIS

    @property
    def outline(self) -> base.Outline:
        """A block for pictures, without room; at its sides torsion is as stiff as across."""
        across, _, _, _, _, torsion = np.diag(self.elasticity.stiffness)
        half = float(np.clip(math.sqrt(torsion / across), 5e-3, 0.1))
        return base.Outline("block", (half, half, 2.0 * half), (0.0, 0.0, 0.0), walls=True)


_WAYS = ("along x", "along y", "along z", "about x", "about y", "about z")
"""The six directions in words, in the order of a twist."""


@dataclass(frozen=True, kw_only=True)
class CompliantMount(_Held):
    """A fixed joint that is elastic in all six directions: a soft table, a suspension, a flange.

    Its coordinates are free but for those that are `locked`, and springs hold them all; no drive
    acts on it. Its axes are those of the URDF's joint.

    Raises:
        JointplayError: see `Elasticity`; a direction to lock that there is not, or nothing left.
    """

    kind: ClassVar[str] = "compliant-mount"
    replaces: ClassVar[tuple[str, ...]] = ("fixed",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = ()
    free: ClassVar[int | None] = None
    thickness: ClassVar[float] = 0.25
    locked: tuple[str, ...] = ()
    """Directions in which it is rigid, among ``x``, ``y``, ``z``, ``yaw`` (about z), ``pitch``
    (about y), ``roll`` (about x). Their stiffness has no effect."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "locked", tuple(self.locked))
        for part in self.locked:
            require_known("direction to lock", part, base.VIRTUAL_LINK, where=("locked",))
        if not self.freedoms:
            raise JointplayError("a mount must give way in some direction", where=("locked",))

    @property
    def freedoms(self) -> tuple[str, ...]:
        return tuple(part for part in base.VIRTUAL_LINK if part not in self.locked)

    @property
    def summary(self) -> str:
        if not self.locked:
            return super().summary
        diagonal = np.diag(self.elasticity.stiffness)
        free = [base.RELATIVE.index(part) for part in self.freedoms]
        parts = [
            f"{_WAYS[row]} {diagonal[row]:.3g} {'N/m' if row < 3 else 'N m/rad'}" for row in free
        ]
        return f"compliant, {', '.join(parts)}, rigid otherwise"

    @property
    def search_radius(self) -> float:
        if not {"x", "y"} <= set(self.locked):
            return super().search_radius
        return self.outline.size[0] ** 2 / float(np.diag(self.elasticity.stiffness)[3:5].max())


def hinge_of_beam(
    stiffness: np.ndarray, damping_time: float, locked: tuple[str, ...]
) -> CompliantMount:
    """The mount that holds two pieces of a flexible link together, z along the beam.

    Args:
        stiffness: along x, y, z [N/m] and about them [N m/rad], shape (6,).
        damping_time: damping over stiffness [s].
    """
    springs = Elasticity(matrix=np.diag(stiffness).tolist(), damping_time=damping_time)
    return CompliantMount(elasticity=springs, locked=locked)


# The bush of a joint in a seat is a body of its own. A contact needs a body to push against: unlike
# the rings of rolling bearings, surfaces in the time loop cannot belong to a massless body.


BUSH_WALL = 0.5
"""Wall of a bush over the half width of its bore, where no mass is given."""
BUSH_DENSITY = 7850.0
"""Density of steel [kg/m^3], for bearings of a material without one."""


class SeatParts(NamedTuple):
    """The parts of a joint in a seat."""

    joint: base.Clearance
    """The joint between the bush and the other body, without its seat."""
    mount: base.Clearance
    """The mount that holds the bush in the body that carries the bearing."""
    mass: float
    """Mass of the bush [kg]."""
    moments: tuple[float, float, float]
    """Moments of inertia about the bush's centre and the bearing's axes [kg m^2]."""


def parts_of_seat(joint: base.Clearance) -> SeatParts | None:
    """Bush and mount of a joint in a seat; None without a seat, or if a law includes it.

    The seat of an ideal joint is rigid: None, too. The bush is a body as long as the bearing with a
    wall of half the half width of its bore (`BUSH_WALL`): a tube, a hollow ball or a hollow block;
    `seat_mass` only scales it.
    """
    if not isinstance(joint, base.SlidingClearance) or joint.seat is None or joint.ideal:
        return None
    outline = joint.outline
    inner = np.add(outline.size, outline.room)
    wall = BUSH_WALL * float(inner[:2].min())
    outer = inner + wall * np.array([1.0, 1.0, float(outline.form == "ball")])
    (filled, most), (bore, less) = _solid(outline, outer), _solid(outline, inner)
    volume, moments = filled - bore, most - less
    density = joint.bearing_material.density or BUSH_DENSITY
    mass = density * volume if joint.seat_mass is None else joint.seat_mass
    x, y, z = map(float, mass / volume * moments)
    alone = replace(joint, seat=None, seat_mass=None)
    return SeatParts(alone, CompliantMount(elasticity=joint.seat), float(mass), (x, y, z))


def _solid(outline: base.Outline, half: np.ndarray) -> tuple[float, np.ndarray]:
    """Volume [m^3] and moments of inertia at density 1 [m^5] of a body with these half extents."""
    x, y, z = half
    if outline.form == "cylinder":
        volume = 2.0 * math.pi * x * y * z
        across = x * x / 4.0 + z * z / 3.0
        return volume, volume * np.array([across, across, x * x / 2.0])
    whole, part = (4.0 / 3.0 * math.pi, 5.0) if outline.form == "ball" else (8.0, 3.0)
    volume = whole * x * y * z
    return volume, volume / part * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
