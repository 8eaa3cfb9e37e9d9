"""The pin in a groove and the follower on a cam: a pin guided by a plane curve of a body."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError, within
from jointplay.base.schema import Quantity, choice, quantity
from jointplay.base.units import readable
from jointplay.physics.contact import ContactProperties
from jointplay.physics.geometry.curve import Curve, nearest_on_curve, place_words
from jointplay.physics.joints.base import Outline, SlidingClearance

_SIDES = {"both": ("left", "right"), "left": ("left",), "right": ("right",)}
"""The walls by the word that selects them; left and right as seen along the points."""
_NARROWEST = 1.97
"""Least distance at which a curve may pass itself, in half widths of the groove: two, less a margin
because after nine tenths of half a turn the tightest circle is as near (`Curve.narrowest`)."""


def touch(k: Any, pose: Any, p: Any, out: Any) -> None:
    """Write the gap of contact k, the point of contact from the pin's centre, and the normal.

    The pin's centre lies s to the left of the curve: the left wall, R_j + C from the curve, is
    C - s away from the pin, the right one C + s. The gradient of s is the curve's normal, so that
    forces do the work that the gap's change implies. A groove with ends has half circles there,
    the last contact: beyond an end the pin touches them, and the sides no more.

    p: R_j, C, side of the first wall (1: left), number of walls, whether there are ends; the curve.
    """
    s, tx, ty, beyond = nearest_on_curve(p, 5, pose[0], pose[1])
    side = p[2] if k == 0 else -p[2]
    nx, ny = side * ty, -side * tx
    gap = p[1] - side * s
    if k < p[3]:
        if p[4] != 0.0 and beyond != 0.0:
            gap = 2.0 * p[1]
    else:
        away = math.sqrt(s * s + beyond * beyond)
        inverse = 1.0 / away if away > 0.0 else 0.0
        nx, ny = -inverse * (beyond * tx - s * ty), -inverse * (beyond * ty + s * tx)
        gap = p[1] - away if beyond != 0.0 else 2.0 * p[1]
    out[0] = gap
    out[1], out[2], out[3] = -p[0] * nx, -p[0] * ny, 0.0
    out[4], out[5], out[6] = nx, ny, 0.0


@dataclass(frozen=True, kw_only=True)
class GrooveClearance(SlidingClearance):
    """A pin of radius R_j whose centre follows a plane curve of the bearing's body, with play.

    The curve lies in the x-y plane of the bearing frame, z is the pin's axis. The walls are at the
    distance R_j + C from it. Both make a groove or slot, closed by half circles at the ends of an
    open curve; one makes a cam, of which the curve is the pitch curve, with a follower that can
    lift off. An open cam goes on straight beyond its ends. A roller is a body of its own: put it on
    a pin, or leave friction out.

    Pin and body move in one plane: x, y and yaw are free between them. Without clearance it closes
    loops for budgets and drives, but cannot be simulated: a run with it has no tool error.

    Raises:
        JointplayError: a curve that crosses itself, bends or comes back more sharply than its walls
            allow, or has too few points.
    """

    kind: ClassVar[str] = "groove"
    replaces: ClassVar[tuple[str, ...]] = ("floating",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("x", "yaw")
    runs_ideal: ClassVar[bool] = False
    clearance_fields: ClassVar[Mapping[str, str | None]] = {"wall_clearance": None}
    touch: ClassVar[Callable[..., Any]] = staticmethod(touch)
    freedoms: ClassVar[tuple[str, ...]] = ("x", "y", "yaw")

    points: Sequence[Sequence[float]] = quantity("m")
    """Points of the curve, a cubic spline on which the pin's centre runs: x and y of each in the
    bearing frame [m]; two or more, of a closed curve three or more."""
    closed: bool = False
    """The last point is followed by the first."""
    walls: str = choice("walls", list(_SIDES), default="both")
    """``both``, a groove, or the one wall of a cam, ``left`` or ``right`` as seen along the points.
    """
    pin_radius: Quantity = quantity("m", default=5e-3, above=0.0, label="pin radius")
    """Radius R_j of the pin [m]."""
    wall_clearance: Quantity = quantity(
        "m", default=0.1e-3, least=0.0, label="clearance between pin and wall"
    )
    """Clearance C between the pin, its centre on the curve, and each wall [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.refuse_line_contact()
        with within("points"):
            self._check_curve()

    def _check_curve(self) -> None:
        """Refuse points that make no curve, and a curve that its walls do not allow."""
        if any(len(point) != 2 for point in self.points):
            raise JointplayError("points have two coordinates each, x and y of the bearing frame")
        object.__setattr__(self, "points", tuple(map(tuple, self.points)))
        left, right = (side in _SIDES[self.walls] for side in ("left", "right"))
        reach, curve = self.pin_radius + self.wall_clearance, self.curve
        *bends, at_left, at_right = curve.sharpest()
        for bend, place, walled in zip(bends, (at_left, at_right), (left, right), strict=True):
            if walled and bend * reach >= 1.0:
                raise JointplayError(
                    f"the curve bends with a radius of {readable(1.0 / bend, 'm')} at "
                    f"{place_words(place)}; the wall on that side needs more than pin radius and "
                    f"clearance, {readable(reach, 'm')}"
                )
        width, place = curve.narrowest(left, right)
        if width < _NARROWEST * reach:
            raise JointplayError(
                f"the curve comes back as near as {readable(width, 'm')} at {place_words(place)}; "
                f"the wall between needs more than {readable(2.0 * reach, 'm')}"
            )

    @cached_property
    def curve(self) -> Curve:
        """The curve on which the pin's centre runs."""
        return Curve(self.points, self.closed)

    @property
    def _has_ends(self) -> bool:
        """Whether half circles close the groove."""
        return self.walls == "both" and not self.closed

    @property
    def contacts(self) -> tuple[str, ...]:
        return (*_SIDES[self.walls], *(("end",) if self._has_ends else ()))

    @cached_property
    def dimensions(self) -> tuple[float, ...]:
        first, *others = _SIDES[self.walls]
        side = 1.0 if first == "left" else -1.0
        numbers = self.curve.numbers(self.pin_radius + self.wall_clearance)
        head = self.pin_radius, self.wall_clearance, side, 1.0 + len(others), float(self._has_ends)
        return *head, *numbers

    def effective_radius(self, contact: int) -> float:
        """Radius R of the sphere on a plane that is as stiff, 1/R = 1/R_j + wall's curvature [m].

        As a contact has one law, a wall has one stiffness: that for its mean curvature.
        """
        reach, name = self.pin_radius + self.wall_clearance, self.contacts[contact]
        if name == "end":
            return 1.0 / (1.0 / self.pin_radius - 1.0 / reach)
        bend = self.curve.mean_curvature * (1.0 if name == "left" else -1.0)
        return 1.0 / (1.0 / self.pin_radius + bend / (1.0 - bend * reach))

    @property
    def hertz_stiffness(self) -> float:
        """k of eq. 11 for the first wall, or the given `stiffness` [N/m^1.5]."""
        return self.hertz(self.effective_radius(0))

    def contact_properties(self, contact: int) -> ContactProperties:
        radius = self.effective_radius(contact)
        return self.contact(self.hertz(radius), bearing_radius=math.inf, journal_radius=radius)

    @property
    def outline(self) -> Outline:
        return Outline("cylinder", (self.pin_radius,) * 3, (self.wall_clearance,) * 2 + (0.0,))

    @property
    def start_travels(self) -> dict[str, float]:
        return {}  # it starts where it is put, on its curve

    def guided_at(self, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y, z = map(float, centre)
        s, tx, ty, beyond = nearest_on_curve(np.array(self.dimensions), 5, x, y)
        place = centre + np.array([s * ty - beyond * tx, -s * tx - beyond * ty, -z])
        return np.array([[tx, -ty, 0.0], [ty, tx, 0.0], [0.0, 0.0, 1.0]]), place

    def ideal_part(self, rotation: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return rotation, self.guided_at(centre)[1]

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        return bool(np.hypot(*offset[:2]) <= self.wall_clearance)
