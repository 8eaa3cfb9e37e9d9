"""Where the kernels act: what they know of a joint with clearance, its film, and a load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.kernel.words import NEVER

Carriers = tuple[tuple[int, pin.SE3], tuple[int, pin.SE3]]
"""Two Pinocchio joints, and the placement of a frame in each."""


@dataclass(frozen=True)
class FilmSite:
    """What the kernels know of a film."""

    law: int
    """Address of the law."""
    sections: int
    """1, or 2 for a journal that can tilt."""
    section: float
    """Their distance from the journal's centre [m]."""
    clearance: float
    """c [m]."""
    thinnest: float
    """Eccentricity ratio at which the film is thinnest."""
    transition: float
    """Depth at which nothing of it is left [m]."""
    lag_mass: float
    """No more than the smallest mass that the film meets; of explicit methods [kg]."""
    parameters: tuple[float, ...]
    """Of the film law."""


@dataclass(frozen=True)
class ContactSite:
    """What the kernels know of one joint with clearance.

    Attributes:
        shape, dimensions: see `geometry.touch`.
        depth_limit: penetration at which the journal has broken out [m].
        normal, friction: addresses of the laws.
        bristles: whether the friction law has them.
        parameters: of the normal-force law, for each contact.
        friction_parameters: of the friction law.
        first: index of the virtual link's first coordinate, or None where bearing and journal are
            reached through their frames; then are needed
        carriers: Pinocchio joint that carries the bearing, and the bearing's placement in it; the
            same of the journal.
        film: None for a dry joint.
        wearing: this many contacts, from the first, count their sliding work.
        must_not_touch: this many contacts, from the first, end the run when they touch.
        signs: +1 for coordinates that move the journal only, -1 for those that move the bearing
            only, 0 for all others, shape (nv,).
    """

    shape: int
    dimensions: tuple[float, ...]
    depth_limit: float
    normal: int
    friction: int
    bristles: bool
    parameters: Sequence[tuple[float, ...]]
    friction_parameters: tuple[float, ...]
    first: int | None
    carriers: Carriers | None = None
    signs: np.ndarray | None = None
    film: FilmSite | None = None
    must_not_touch: int = 0
    wearing: int = 0


PARTS = ("bearing", "journal")

CarriedFrame = tuple[int, np.ndarray]
"""A body by its place, and a frame's rotation, row by row, and origin in it, shape (12,)."""


@dataclass(frozen=True)
class LoadSite:
    """What the kernels know of one load; see `kernel.load`.

    It acts either on coordinates or between two frames.
    """

    law: int
    """Address of its law."""
    numbers: np.ndarray
    """Of the law; what is written into it later, the law sees."""
    stores: bool = False
    """Whether its answer at rest is the slope of an energy."""
    implicit: int = NEVER
    """When the rest of it depends on velocity: `words.NEVER`, `ALWAYS` or `IF_PRESSED`."""
    seen: tuple[int, ...] = ()
    """Coordinates that the law sees."""
    pushed: tuple[int, ...] = ()
    """Coordinates on which it acts; if it is implicit, those that it sees."""
    bounds: tuple[float, ...] = ()
    """Largest effort on each of them, if it is limited [N m or N]."""
    carriers: Carriers | None = None
    """Between frames: Pinocchio joints that carry them, and the frames' placements in these."""
    signs: np.ndarray | None = None
    """See `ContactSite`."""

    @property
    def size(self) -> int:
        """Numbers that the law gives."""
        return len(self.pushed) if self.carriers is None else 6
