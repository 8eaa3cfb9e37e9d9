"""The prismatic joint with clearance: a slider in a guide, touching it with its corners."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import ClassVar, Self

import numpy as np

from jointplay.contact import ContactProperties
from jointplay.core.errors import JointplayError
from jointplay.core.schema import quantity
from jointplay.geometry import Shape
from jointplay.joints.base import VIRTUAL_LINK, Clearance, Outline
from jointplay.joints.play import BlockPlay

_SIGNS = (1.0, -1.0)
_ENDS = {1.0: "A", -1.0: "B"}
_MARK = {1.0: "+", -1.0: "-"}


@dataclass(frozen=True, kw_only=True)
class PrismaticClearance(Clearance):
    """A block-shaped slider (the journal) in a straight guide (the bearing) that is longer.

    z is the direction of sliding. Each of the slider's eight corners can touch the walls across x
    and across y; face contact is that of four corners, edge contact that of two. Reference for
    the planar case: P. Flores, R. Leine, C. Glocker, Multibody System Dynamics 23 (2010) 165-190.

    Raises:
        JointplayError: a dimension that is not positive, or a clearance that leaves no slider.
    """

    kind: ClassVar[str] = "prismatic"
    replaces: ClassVar[tuple[str, ...]] = ("prismatic",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("z",)

    length: float = quantity("m", default=80e-3, above=0.0, words="slider length")
    """Of the slider, along z [m]."""
    width: float = quantity("m", default=40e-3, above=0.0, words="slider width")
    """Of the slider, along x [m]."""
    height: float = quantity("m", default=40e-3, above=0.0, words="slider height")
    """Of the slider, along y [m]."""
    clearance: float = quantity("m", above=0.0, words="slider clearance")
    """On each side, across x [m]."""
    clearance_y: float | None = quantity(
        "m", default=None, above=0.0, words="slider clearance across y"
    )
    """On each side, across y [m]; None takes that across x."""
    corner_radius: float = quantity("m", default=1e-3, above=0.0, words="slider corner radius")
    """Rounding of the corners, which makes eq. 11 a sphere on a plane [m]."""
    lock_tilt: bool = False
    """The slider stays parallel to the guide: whole faces touch."""
    planar: bool = False
    """Motion in the x-z plane only: four corners, no play across y."""

    def __post_init__(self) -> None:
        """Check the dimensions."""
        super().__post_init__()
        self.refuse_line_contact()
        if self.clearance_y is None:
            object.__setattr__(self, "clearance_y", self.clearance)
        for name, play, side in (
            ("clearance", self.clearance, self.width),
            ("clearance_y", self.cy, self.height),
        ):
            if play >= side:
                raise JointplayError(
                    f"slider clearance {play:g} m is as large as the slider's side {side:g} m",
                    where=(name,),
                )

    @classmethod
    def of_room(cls, radial: float, axial: float, sizes: Mapping[str, float]) -> Self:
        """See `Clearance.of_room`."""
        return cls(clearance=radial)

    @property
    def cy(self) -> float:
        """Clearance across y, on each side [m]."""
        assert self.clearance_y is not None
        return self.clearance_y

    @property
    def hertz_stiffness(self) -> float:
        """k of eq. 11 for a corner of the given radius on a plane, or the given one [N/m^1.5]."""
        return self.hertz(self.corner_radius) if self.stiffness is None else self.stiffness

    def contact_properties(self, contact: int) -> ContactProperties:
        """The same for all corners."""
        return self.contact(
            self.hertz_stiffness, bearing_radius=math.inf, journal_radius=self.corner_radius
        )

    @property
    def _places(self) -> list[tuple[str, tuple[float, float, float], int, float]]:
        """Name, point on the slider [m], wall's axis (0: x, 1: y) and side of each contact."""
        half = (self.width / 2, self.height / 2, self.length / 2)
        places = []
        for wall in (0,) if self.planar else (0, 1):
            across = 1 - wall
            for side in _SIGNS:
                name = f"{'xy'[wall]}{_MARK[side]}"
                ends = (0.0,) if self.lock_tilt else _SIGNS
                sides = (0.0,) if self.lock_tilt or self.planar else _SIGNS
                for end, other in product(ends, sides):
                    point = [0.0, 0.0, end * half[2]]
                    point[wall], point[across] = side * half[wall], other * half[across]
                    full = name
                    full += f"_{_ENDS[end]}" if end else ""
                    full += f"_{'xy'[across]}{_MARK[other]}" if other else ""
                    places.append((full, (point[0], point[1], point[2]), wall, side))
        return places

    @property
    def shape(self) -> Shape:
        """A block."""
        return Shape.BLOCK

    @property
    def dimensions(self) -> tuple[float, ...]:
        """Half widths of the guide across x and y [m]; then point, axis and side per contact."""
        guide = (self.width / 2 + self.clearance, self.height / 2 + self.cy)
        places = (
            number for _, point, wall, side in self._places for number in (*point, wall, side)
        )
        return *guide, *places

    @property
    def contacts(self) -> tuple[str, ...]:
        """Wall, end, and side: ``x+_A_y-`` is the corner at end A and -y, on the wall at +x."""
        return tuple(name for name, *_ in self._places)

    @property
    def rooms(self) -> tuple[float, ...]:
        """Clearance across each contact's wall [m]."""
        return tuple((self.clearance, self.cy)[wall] for _, _, wall, _ in self._places)

    @property
    def freedoms(self) -> tuple[str, ...]:
        """All six but for those that are locked."""
        turns = () if self.lock_tilt else ("pitch",) if self.planar else VIRTUAL_LINK[3:]
        return ("x", *(() if self.planar else ("y",)), "z", *turns)

    @property
    def drive_coordinate(self) -> str:
        """z."""
        return "z"

    @property
    def room_to_start(self) -> dict[str, float]:
        """The clearances across the guide."""
        return {"x": self.clearance} | ({} if self.planar else {"y": self.cy})

    @property
    def radial_room(self) -> float:
        """Clearance across x [m]."""
        return self.clearance

    @property
    def depth_limit(self) -> float:
        """A twentieth of the slider's smaller side."""
        return 0.05 * min(self.width, self.height)

    @property
    def outline(self) -> Outline:
        """A block in a guide."""
        size = (self.width / 2, self.height / 2, self.length / 2)
        return Outline("block", size, (self.clearance, self.cy, 0.0), not self.planar)

    @property
    def half_width(self) -> float:
        """Half of the slider's height [m]."""
        return self.height / 2

    @property
    def travel(self) -> dict[str, float]:
        """The clearances across, and the angles at which opposite corners touch."""
        return {
            "x": self.clearance,
            "y": self.cy,
            "yaw": min(2.0 * self.cy / self.width, 2.0 * self.clearance / self.height),
            "pitch": 2.0 * self.clearance / self.length,
            "roll": 2.0 * self.cy / self.length,
        }

    def play(self, second_order: bool = True) -> BlockPlay:
        """A slider in a guide."""
        given = self.clearance, 0.0 if self.planar else self.cy
        arms = self.width / 2, self.height / 2, self.length / 2
        free = "roll" in self.freedoms, "pitch" in self.freedoms, "yaw" in self.freedoms
        block = BlockPlay(given, arms, free)
        if not second_order or self.lock_tilt:
            return block
        corner = math.hypot(*arms)
        for _ in range(40):
            more = 0.5 * corner * min(block.reach[1], 1.0) ** 2
            wide = given[0] + more, given[1] + more if given[1] else 0.0
            excess = max(w / g for w, g in zip(wide, given, strict=True) if g) - 1.0
            block = BlockPlay(wide, arms, free, excess)
        return block

    @property
    def clearances(self) -> dict[str, float]:
        """Across x, and across y unless planar [m]."""
        return {"clearance": self.clearance} | ({} if self.planar else {"clearance_y": self.cy})

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        """Across within a rectangle."""
        x, y, _ = np.abs(offset)
        across, high = (max(self.room_to_start.get(part, 0.0), least) for part in "xy")
        return bool(x + lean <= across and y + lean <= high)

    def ideal_part(self, rotation: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Translation along z."""
        return np.eye(3), np.array([0.0, 0.0, centre[2]])

    def directions(self) -> np.ndarray:
        """At each contact, along its wall's normal."""
        rows = np.zeros((len(self.contacts), 6))
        for row, (_, point, wall, side) in zip(rows, self._places, strict=True):
            row[wall] = -side
            row[3:] = np.cross(point, row[:3])
        return rows
