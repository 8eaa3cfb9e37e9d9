"""Interface of laws for a whole joint: the elements of a rolling bearing, springs, or both.

Such a law takes the joint's parameters and a pose, and gives wrench, energy and stiffness at once
(`rolling`, `elastic`). Parameters and results are flat arrays: here are the indices of both, and
how to make parameters from dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointplay.base.schema import OptionalQuantity, Quantity, quantity
from jointplay.physics.contact.law import ContactProperties, FrictionLaw, NormalForceLaw

(
    CAGE, ROLLERS, ROWS, COUNT, STIFFNESS, RADIUS, REACH, DISTANCE, RATIO,
    DRAG, FRICTION, DAMPING, ROW_PLACES,
) = range(13)  # fmt: skip
"""Indices of a bearing's parameters; see `bearing_numbers`."""

ROW_NUMBERS = 2
"""Parameters of each row, from `ROW_PLACES` on: its position h along the axis and y_0 [m]."""

MOST_ROWS = 2

TABLE = ROW_PLACES + ROW_NUMBERS * MOST_ROWS
"""Index from which on cosine and sine of each element's azimuth in the cage follow."""

(
    WRENCH, ENERGY, SUM, LARGEST, LOADED, DEEPEST, COSINE, SINE, PLACE, ACROSS, ALONG,
    CAGE_SLOPE, TANGENT,
) = (0, *range(6, 18))  # fmt: skip
"""Indices of the results; see `rolling.find_element_forces`."""

ANSWERS = TANGENT + 36
"""Number of results."""
BOUNDED, EXACT, FORCES = range(3)
"""Modes of evaluation; see `rolling.find_element_forces`."""

BALL_EXPONENT, ROLLER_EXPONENT = 1.5, 10.0 / 9.0
"""Exponents n of the load-deflection law Q = K delta^n of an element."""

WAYS = 5
"""Dimension of xi = (p_x, p_y, p_z, a_x, a_y), in which a ring's position is described."""
SEAT = ANSWERS
"""Index, among the results of a bearing in a seat, of the displacement u of its outer ring."""

SEAT_ANSWERS = ANSWERS + WAYS

NODES = 12
"""Most points of a spring's force-displacement curve."""
CURVE = 1 + 2 * NODES
"""Parameters of a curve: the number of its points, their displacements, their forces."""
ELEMENTS, SEATED, SPRINGS, GUIDE, MOUNT = range(5)
"""Laws: a bearing's elements; the same in an elastic seat; springs alone, that let a body rotate
about the axis, or slide along it, or hold it in every direction."""
HOLDING = (SPRINGS, GUIDE, MOUNT)
"""Laws without clearance, in which there are no impacts."""


def bearing_numbers(
    *,
    rollers: bool,
    count: int,
    stiffness: float,
    radius: float,
    reach: float,
    distance: float,
    ratio: float,
    rows: tuple[tuple[float, float], ...],
    drag: float = 0.0,
    friction: float = 0.0,
    damping: float = 0.0,
    cage: float = 0.0,
) -> tuple[float, ...]:
    """Parameters of a bearing for compiled code, as a flat array; symbols as in `rolling`.

    Args:
        rollers: whether the elements are crossed rollers; else balls.
        count: elements per row, even for rollers.
        stiffness: K of an element [N/m^n].
        radius: r_i of balls, half of the pitch diameter of rollers [m].
        reach: r_i - r_o of balls, the radial clearance C_r of rollers [m].
        distance: A of balls [m].
        ratio: rotation of the cage over that of the ring.
        rows: position h along the axis and y_0 of each row, at most `MOST_ROWS` rows [m].
        drag: friction torque without load [N m].
        friction: friction torque per sum of all element loads [m].
        damping: damping over stiffness [s].
        cage: azimuth of the first element [rad].
    """
    places = [number for row in rows for number in row]
    places += [0.0] * (ROW_NUMBERS * MOST_ROWS - len(places))
    angles = 2.0 * np.pi * np.arange(count) / count
    table = np.column_stack([np.cos(angles), np.sin(angles)]).ravel()
    head = (cage, float(rollers), len(rows), count, stiffness, radius, reach, distance, ratio)
    return (*head, drag, friction, damping, *places, *table.tolist())


def spring_numbers(
    matrix: np.ndarray, curves: Sequence[Sequence[tuple[float, float]]]
) -> tuple[float, ...]:
    """Parameters of springs for compiled code: K (n, n) [N/m, N, N m] and a curve per direction.

    A curve has points (displacement, force) on the positive side of zero and is odd; beyond its
    last point it goes on straight.
    """
    numbers = list(np.asarray(matrix, float).ravel())
    for curve in curves:
        places, forces = ([row[k] for row in curve] for k in (0, 1))
        room = [0.0] * (NODES - len(curve))
        numbers += [float(len(curve)), *places, *room, *forces, *room]
    return tuple(numbers)


@dataclass(frozen=True)
class ElementContact(NormalForceLaw):
    """Load of one rolling element, K delta^n: the normal-force law of a bearing's contacts."""

    name = "rolling-element"
    formula = r"Q = K \delta^n"
    reference = "Hertz (1882) for balls; ISO/TS 16281 for rollers"

    exponent: Quantity = quantity("", default=BALL_EXPONENT, above=0.0)
    """Exponent n."""
    rated_load: OptionalQuantity = quantity("N", default=None, above=0.0)
    """Load of an element at the bearing's static rating [N]; None: the bearing has no rating."""

    @staticmethod
    def function(
        delta: float, ddelta: float, ddelta0: float, stiffness: float, exponent: float
    ) -> float:
        return stiffness * delta**exponent

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        return contact.stiffness, self.exponent

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        load = contact.stiffness * max_depth**self.exponent
        if self.rated_load is None or load <= self.rated_load:
            return []
        return [
            f"an element bore {load:.3g} N, and at the bearing's static rating it bears "
            f"{self.rated_load:.3g} N: raceways keep dents"
        ]


@dataclass(frozen=True)
class NoFriction(FrictionLaw):
    """No sliding friction: elements roll, and their torque is the bearing's (`BallBearing`)."""

    name = "none"

    @staticmethod
    def function(speed: float) -> float:
        return 0.0
