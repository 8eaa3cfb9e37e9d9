"""Laws that answer for a whole joint: the elements of a rolling bearing, springs, or both.

Such a law gets the numbers of the joint and a pose, and answers with force, moment, energy and
stiffness at once (`rolling`, `elastic`). Here is what both sides must know: the places of numbers
and answers, how to make the former from dimensions, and how to ask. The laws themselves are
compiled when they are first asked.
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
"""Places of the numbers of a bearing; see `bearing_numbers`."""

ROW_NUMBERS = 2
"""Numbers of each row from `ROW_PLACES` on: its place h along the axis and y_0 [m]."""

MOST_ROWS = 2

TABLE = ROW_PLACES + ROW_NUMBERS * MOST_ROWS
"""From here on cosine and sine of each element's azimuth in the cage."""

(
    WRENCH, ENERGY, SUM, LARGEST, LOADED, DEEPEST, COSINE, SINE, PLACE, ACROSS, ALONG,
    CAGE_SLOPE, TANGENT,
) = (0, *range(6, 18))  # fmt: skip
"""Places of what `find_element_forces` answers, see there."""

ANSWERS = TANGENT + 36
"""How many numbers that is."""
BOUNDED, EXACT, FORCES = range(3)
"""How `find_element_forces` looks at the elements."""

BALL_EXPONENT, ROLLER_EXPONENT = 1.5, 10.0 / 9.0

WAYS = 5
"""Numbers of xi."""
SEAT = ANSWERS
"""Where a bearing in a seat keeps the displacement u of its outer ring."""

SEAT_ANSWERS = ANSWERS + WAYS

NODES = 12
"""Most points of a curve."""
CURVE = 1 + 2 * NODES
"""Numbers of a curve: how many points, their displacements, their forces."""
ELEMENTS, SEATED, SPRINGS, GUIDE, MOUNT = range(5)
"""Laws: of a bearing's elements, of the same in a seat, of springs alone that let a body turn about
the axis, or slide along it, or hold it in every direction."""
HOLDING = (SPRINGS, GUIDE, MOUNT)
"""Laws without play, in which nothing hits."""


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
    """Numbers by which compiled code knows a bearing.

    Args:
        rollers: crossed rollers, else balls.
        count: elements of a row, even for rollers.
        stiffness: K of an element [N/m^n].
        radius: r_i of balls, half of the pitch diameter of rollers [m].
        reach: r_i - r_o of balls, the radial clearance C_r of rollers [m].
        distance: A of balls [m].
        ratio: of the cage's turn to the ring's.
        rows: place along the axis and y_0 of each, at most `MOST_ROWS` [m].
        drag: friction torque without load [N m].
        friction: the same over the sum of all element loads [m].
        damping: over the stiffness [s].
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
    """Numbers of springs: their matrix K (n, n) [N/m, N, N m], and a curve in each direction.

    A curve has points (displacement, force) beyond zero, the same with opposite signs on the other
    side; it goes on as it ends.
    """
    numbers = list(np.asarray(matrix, float).ravel())
    for curve in curves:
        places, forces = ([row[k] for row in curve] for k in (0, 1))
        room = [0.0] * (NODES - len(curve))
        numbers += [float(len(curve)), *places, *room, *forces, *room]
    return tuple(numbers)


@dataclass(frozen=True)
class ElementContact(NormalForceLaw):
    """Load of one rolling element, K delta^n, for what asks of a joint how stiff a contact is."""

    name = "rolling-element"
    formula = r"Q = K \delta^n"
    reference = "Hertz (1882) for balls; ISO/TS 16281 for rollers"

    exponent: Quantity = quantity("", default=BALL_EXPONENT, above=0.0)
    """n."""
    rated_load: OptionalQuantity = quantity("N", default=None, above=0.0)
    """Load of an element at the bearing's static rating [N]; None: nothing is rated."""

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
