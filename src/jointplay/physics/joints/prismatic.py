"""The prismatic joint with clearance: a slider in a guide, touching it with its corners."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import ClassVar, Self

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.schema import OptionalQuantity, Quantity, quantity
from jointplay.base.units import readable
from jointplay.physics.contact import ContactProperties
from jointplay.physics.geometry import Shape
from jointplay.physics.joints.base import VIRTUAL_LINK, Outline, SlidingClearance

_SIGNS = (1.0, -1.0)
_ENDS = {1.0: "A", -1.0: "B"}
_MARK = {1.0: "+", -1.0: "-"}


@dataclass(frozen=True, kw_only=True)
class PrismaticClearance(SlidingClearance):
    """A block-shaped slider (the journal) in a straight guide (the bearing) that is longer.

    z is the direction of sliding. Each of the slider's eight corners can touch the walls across x
    and across y; a face touches with four corners, an edge with two. Reference for the planar case:
    P. Flores, R. Leine, C. Glocker, Multibody System Dynamics 23 (2010) 165-190.

    Raises:
        JointplayError: a dimension that is not positive, or a clearance that leaves no slider.
    """

    kind: ClassVar[str] = "prismatic"
    replaces: ClassVar[tuple[str, ...]] = ("prismatic",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("z",)
    clearance_fields: ClassVar[Mapping[str, str | None]] = {"clearance": None, "clearance_y": None}
    fit_size: ClassVar[tuple[str, float] | None] = ("width", 1.0)

    length: Quantity = quantity("m", default=80e-3, above=0.0, label="slider length")
    """Length of the slider, along z [m]."""
    width: Quantity = quantity("m", default=40e-3, above=0.0, label="slider width")
    """Width of the slider, along x [m]."""
    height: Quantity = quantity("m", default=40e-3, above=0.0, label="slider height")
    """Height of the slider, along y [m]."""
    clearance: OptionalQuantity = quantity("m", default=None, least=0.0, label="slider clearance")
    """Clearance on each side across x [m]; 0: an ideal joint; None: that of the fit."""
    clearance_y: OptionalQuantity = quantity(
        "m", default=None, least=0.0, label="slider clearance across y"
    )
    """Clearance on each side across y [m]; None takes that across x, 0 is `planar`."""
    corner_radius: Quantity = quantity("m", default=1e-3, above=0.0, label="slider corner radius")
    """Rounding of the corners [m]: each touches as a sphere on a plane."""
    lock_tilt: bool = False
    """The slider stays parallel to the guide: whole faces touch."""
    planar: bool = False
    """Motion in the x-z plane only: four corners, no play across y."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.refuse_line_contact()
        if self.clearance is None:
            raise JointplayError("give the slider's clearance, or a fit", where=("clearance",))
        if self.clearance_y is None:
            object.__setattr__(self, "clearance_y", self.clearance)
        elif self.clearance_y == 0.0 < self.clearance:
            object.__setattr__(self, "planar", True)
        for name, play, side in (
            ("clearance", self.cx, self.width),
            ("clearance_y", self.cy, self.height),
        ):
            if play >= side:
                raise JointplayError(
                    f"slider clearance {readable(play, 'm')} is as large as the slider's side "
                    f"{readable(side, 'm')}",
                    where=(name,),
                )

    def at_clearance(self, size: float) -> Self:
        """The slider with another clearance across x [m], and across y if they were equal."""
        equal = [name for name, play in self.clearances.items() if play == self.cx]
        return self.with_clearances(dict.fromkeys(equal, size))

    @property
    def cx(self) -> float:
        """Clearance across x, on each side [m]."""
        assert self.clearance is not None
        return self.clearance

    @property
    def cy(self) -> float:
        """Clearance across y, on each side [m]."""
        assert self.clearance_y is not None
        return self.clearance_y

    @property
    def hertz_stiffness(self) -> float:
        """k of eq. 11 for a corner on a plane, or the given `stiffness` [N/m^1.5]."""
        return self.hertz(self.corner_radius)

    def contact_properties(self, contact: int) -> ContactProperties:
        return self.contact(
            self.hertz_stiffness, bearing_radius=math.inf, journal_radius=self.corner_radius
        )

    @property
    def _places(self) -> list[tuple[str, tuple[float, float, float], int, float]]:
        """Name, point on the slider [m], axis of the wall (0: x, 1: y) and side of each contact."""
        half = (self.width / 2, self.height / 2, self.length / 2)
        places = []
        for wall in (0,) if self.planar else (0, 1):
            across = 1 - wall
            for side in _SIGNS:
                name = f"{'xy'[wall]}{_MARK[side]}"
                ends = (0.0,) if self.lock_tilt else _SIGNS
                sides = (0.0,) if self.lock_tilt or self.planar else _SIGNS
                for end, edge in product(ends, sides):
                    point = [0.0, 0.0, end * half[2]]
                    point[wall], point[across] = side * half[wall], edge * half[across]
                    full = name
                    full += f"_{_ENDS[end]}" if end else ""
                    full += f"_{'xy'[across]}{_MARK[edge]}" if edge else ""
                    places.append((full, (point[0], point[1], point[2]), wall, side))
        return places

    @property
    def shape(self) -> Shape:
        return Shape.BLOCK

    @property
    def dimensions(self) -> tuple[float, ...]:
        guide = (self.width / 2 + self.cx, self.height / 2 + self.cy)
        places = (
            number for _, point, wall, side in self._places for number in (*point, wall, side)
        )
        return *guide, *places

    @property
    def contacts(self) -> tuple[str, ...]:
        return tuple(name for name, *_ in self._places)

    @property
    def contact_clearances(self) -> tuple[float, ...]:
        return tuple((self.cx, self.cy)[wall] for _, _, wall, _ in self._places)

    @property
    def freedoms(self) -> tuple[str, ...]:
        turns = () if self.lock_tilt else ("pitch",) if self.planar else VIRTUAL_LINK[3:]
        return ("x", *(() if self.planar else ("y",)), "z", *turns)

    @property
    def outline(self) -> Outline:
        size = (self.width / 2, self.height / 2, self.length / 2)
        return Outline("block", size, (self.cx, self.cy, 0.0), not self.planar)

    @property
    def clearances(self) -> dict[str, float]:
        return {"clearance": self.cx} | ({} if self.planar else {"clearance_y": self.cy})

    def directions(self) -> np.ndarray:
        rows = np.zeros((len(self.contacts), 6))
        for row, (_, point, wall, side) in zip(rows, self._places, strict=True):
            row[wall] = -side
            row[3:] = np.cross(point, row[:3])
        return rows
