"""Where the inner ring of a loaded rolling bearing comes to rest.

The law of `contact.rolling` in numpy, over all elements at once, with its second derivatives: what
is loaded settles at the minimum of the energy of all elements less the work of the load. With
xi = (p_x, p_y, p_z, a_x, a_y), the displacement of the ring's centre and the part of its axis
across the outer ring's, that energy is convex but for what a lean adds in its second order, so a
Newton method in a region of trust finds the minimum from anywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jointplay.physics.contact.resultant import BALL_EXPONENT, ROLLER_EXPONENT, WAYS

_HALF = math.sqrt(0.5)
_MOST, _MOST_CUTS = 200, 40
"""Steps, and trials of each."""
_BALANCED, _ACCEPTED, _ROUNDING = 1e-11, 1e-8, 1e-14
"""Forces left over, by the load: that are aimed at, and that rounding is allowed to leave; and by
the sum of the elements' loads."""
_CAREFUL = 0.9
"""By how much of the slope that a step goes down the slope at its end may go up."""
_STEEPEST = 0.25
"""Square of the largest sine of a lean."""
_SINGULAR = 1e-12
"""Stiffness of a direction that counts as none, by the largest."""

# What turns a displacement, and an axis, about z.
_ABOUT_Z = np.zeros((WAYS, WAYS))
_ABOUT_Z[0, 1] = _ABOUT_Z[3, 4] = 1.0
_ABOUT_Z[1, 0] = _ABOUT_Z[4, 3] = -1.0


class Deflections(NamedTuple):
    """Of elements, (..., rows * Z)."""

    depth: np.ndarray
    """delta, negative where an element bears no load [m]."""
    across: np.ndarray
    """Radial component of the contact's direction, times `length`."""
    up: np.ndarray
    """Axial one."""
    length: np.ndarray | float
    arm: np.ndarray | float
    """How far a lean moves the inner end of an element across [m]."""


class Push(NamedTuple):
    """What elements do to the ring at a place."""

    gradient: np.ndarray
    """Of their energy by xi, (5,) [N, N m]."""
    bend: np.ndarray
    """Second derivatives of their energy by xi, (5, 5)."""
    total: float
    """Sum of their loads [N]."""


@dataclass(frozen=True)
class Elements:
    """All rolling elements of a bearing, their cage standing."""

    rollers: bool
    stiffness: float
    """K [N/m^n]."""
    radius: float
    reach: float
    distance: float
    """See `contact.resultant.bearing_numbers`."""
    ratio: float
    cosine: np.ndarray
    sine: np.ndarray
    """Of the azimuths, row by row, (..., rows * Z)."""
    place: np.ndarray
    """h of each, (rows * Z,) [m]."""
    rise: np.ndarray
    """y_0 of each [m]; of rollers 0."""
    way: np.ndarray
    """1 or -1: which way the axis of a roller is inclined."""

    @property
    def exponent(self) -> float:
        """n."""
        return ROLLER_EXPONENT if self.rollers else BALL_EXPONENT

    def deflections(self, centre: np.ndarray, axis: np.ndarray) -> Deflections:
        """At places of the ring: its centre (..., 3) [m] and its axis (..., 3)."""
        c, s, r = self.cosine, self.sine, self.radius
        lie = c * axis[..., 0, None] + s * axis[..., 1, None]
        radial = c * centre[..., 0, None] + s * centre[..., 1, None]
        start = self.rise + centre[..., 2, None]
        if self.rollers:
            depth = _HALF * (radial - self.reach + self.way * (start - r * lie))
            return Deflections(depth, np.full_like(depth, _HALF), _HALF * self.way, 1.0, 0.0)
        x = self.reach + radial + (self.place - 0.5 * r * lie) * lie
        y = start + self.place * (axis[..., 2, None] - 1.0) - r * lie
        length = np.hypot(x, y)
        return Deflections(length - self.distance, x, y, length, self.place - r * lie)

    def loads(self, depth: np.ndarray) -> np.ndarray:
        """Of elements [N]."""
        loads: np.ndarray = self.stiffness * np.maximum(depth, 0.0) ** self.exponent
        return loads

    def push(self, xi: np.ndarray, upright: float) -> Push:
        """At a place; `upright` is the axis' component along the outer ring's."""
        c, s, r, h = self.cosine, self.sine, self.radius, self.place
        found = self.deflections(xi[:3], np.array([xi[3], xi[4], upright]))
        depth = np.maximum(found.depth, 0.0)
        steep = self.stiffness * (np.cbrt(np.cbrt(depth)) if self.rollers else np.sqrt(depth))
        loads = steep * depth
        across, up = found.across / found.length, found.up / found.length
        # Slopes of X and Y by xi, in whose terms those of the deflection are.
        x_by, y_by = np.zeros((WAYS, len(c))), np.zeros((WAYS, len(c)))
        x_by[0], x_by[1], y_by[2] = c, s, 1.0
        if not self.rollers:
            x_by[3], x_by[4] = found.arm * c, found.arm * s
        y_by[3], y_by[4] = -r * c, -r * s
        if not self.rollers:
            y_by[3:] -= xi[3:, None] / upright * h
        by = across * x_by + up * y_by
        bend = (by * (self.exponent * steep)) @ by.T
        if not self.rollers:
            aside = across * y_by - up * x_by
            bend += (aside * (loads / found.length)) @ aside.T
            turned = r * across * loads
            bend[3, 3] -= (turned * c) @ c
            bend[4, 4] -= (turned * s) @ s
            mixed = (turned * c) @ s
            bend[3, 4] -= mixed
            bend[4, 3] -= mixed
            lean = xi[3:]
            tall = float((up * h) @ loads) / upright
            bend[3:, 3:] -= tall * (np.eye(2) + np.outer(lean, lean) / upright**2)
        return Push(by @ loads, bend, float(loads.sum()))

    def size(self, force: float) -> np.ndarray:
        """Of xi at which a force changes much, (5,) [m, 1]."""
        depth = (force / self.stiffness) ** (1.0 / self.exponent)
        if self.rollers:
            across = along = max(self.reach, 0.0) + depth
        else:
            across = max(self.distance - math.hypot(self.reach, self.rise[0]), 0.0) + depth
            if (self.rise == self.rise[0]).all():
                far = self.distance + depth
                across = max(self.distance - self.reach, 0.0) + depth
                along = math.sqrt(max(far * far - self.reach**2, depth * depth))
            else:
                along = across
        lever = self.radius + np.abs(self.place).max()
        return np.array([across, across, along, along / lever, along / lever])


class Rest(NamedTuple):
    """Where the ring of a loaded bearing stands."""

    xi: np.ndarray
    """(5,) [m, 1]."""
    given: np.ndarray
    """The load in terms of xi, less what the cage takes, (5,) [N, N m]."""
    compliance: np.ndarray
    """Change of xi by force and moments about x and y, (5, 5); none where nothing holds."""


def rest(elements: Elements, load: np.ndarray, lean: np.ndarray) -> Rest | None:
    """Where the ring rests under a force and moments about x and y (5,) [N, N m]; None if nowhere.

    `lean` (2,) is what the outer ring leans by in its seat.
    """
    weight = np.array([1.0, 1.0, 1.0, 1.0 / elements.radius, 1.0 / elements.radius])
    size = float(np.linalg.norm(load * weight))
    xi = np.zeros(WAYS)
    upright = _upright(xi, lean)
    push = elements.push(xi, upright)
    unit = elements.size(max(size, 1e-3 * push.total, 1e-9))
    if push.total == 0.0:
        if size == 0.0:
            return Rest(xi, np.zeros(WAYS), np.zeros((WAYS, WAYS)))
        aim = load[[0, 1, 2, 4, 3]] * [1.0, 1.0, 1.0, 1.0, -1.0] * unit
        xi = aim / np.linalg.norm(aim) * unit
        upright = _upright(xi, lean)
        push = elements.push(xi, upright)
    trust, best, error_of_best = 1.0, None, _ACCEPTED * size
    for _ in range(_MOST):
        given = _given(elements, push, xi, upright, load)
        left = given - push.gradient
        error = float(np.linalg.norm(left * weight))
        if error < error_of_best:
            best, error_of_best = (xi, upright, push, given), error
        if error <= _BALANCED * size + _ROUNDING * push.total:
            best = xi, upright, push, given
            break
        way = unit * _step(push.bend * np.outer(unit, unit), left * unit, trust)
        down, part, long = float(left @ way), 1.0, float(np.linalg.norm(way / unit))
        for _ in range(_MOST_CUTS):
            there = xi + part * way
            tilted = there[3:] + lean
            after = -math.inf
            if tilted @ tilted < _STEEPEST:
                upright = _upright(there, lean)
                push = elements.push(there, upright)
                given = _given(elements, push, there, upright, load)
                after = float((given - push.gradient) @ way)
            if after >= -_CAREFUL * down:
                break
            part *= max(0.1, min(0.7, down / (down - after)))
        if part < 1.0:
            trust = 2.0 * part * long
        elif long > 0.9 * trust:
            trust *= 2.0
        xi = there
    if best is None:
        return None
    xi, upright, push, given = best
    return Rest(xi, given, _compliance(elements, push, xi, upright, load, unit))


def _upright(xi: np.ndarray, lean: np.ndarray) -> float:
    x, y = xi[3] + lean[0], xi[4] + lean[1]
    return math.sqrt(1.0 - x * x - y * y)


def _given(
    elements: Elements, push: Push, xi: np.ndarray, upright: float, load: np.ndarray
) -> np.ndarray:
    """A load in terms of xi, less what elements take on their way around with the cage, (5,)."""
    back, (_, _, _, x, y) = elements.ratio * float(push.gradient @ (_ABOUT_Z @ xi)), xi
    fx, fy, fz, mx, my = load
    return np.array([fx, fy, fz, (my - back * y) / upright, (back * x - mx) / upright])


def _compliance(
    elements: Elements,
    push: Push,
    xi: np.ndarray,
    upright: float,
    load: np.ndarray,
    unit: np.ndarray,
) -> np.ndarray:
    """Change of xi by a force and moments, from that of `_given` less the gradient, (5, 5)."""
    turned = _ABOUT_Z @ xi
    back = elements.ratio * float(push.gradient @ turned)
    back_by = elements.ratio * (push.bend @ turned + push.gradient @ _ABOUT_Z)
    (x, y), steeper = xi[3:], np.append(np.zeros(3), xi[3:]) / upright**3
    fall = push.bend.copy()
    fall[3] += back_by * y / upright - (load[4] - back * y) * steeper
    fall[4] -= back_by * x / upright + (back * x - load[3]) * steeper
    fall[3, 4] += back / upright
    fall[4, 3] -= back / upright
    by_load = np.eye(WAYS)
    by_load[3:, 3:] = [[0.0, 1.0 / upright], [-1.0 / upright, 0.0]]
    soft = np.linalg.pinv(fall * np.outer(unit, unit), _SINGULAR) * np.outer(unit, unit)
    compliance: np.ndarray = soft @ by_load
    return compliance


def _step(bend: np.ndarray, left: np.ndarray, trust: float) -> np.ndarray:
    """Down the energy as far as its curvature says, at most `trust`."""
    values, ways = np.linalg.eigh(bend)
    along = ways.T @ left
    floor = _SINGULAR * max(values[-1], math.sqrt(along @ along) / trust)
    if values[0] > floor:
        part = along / values
        if part @ part <= trust * trust:
            return ways @ part
    # The shift of all curvatures with which the step is as long as it may be.
    low = max(floor - values[0], 0.0)
    more = low + floor
    for _ in range(60):
        part = along / (values + more)
        long = math.sqrt(part @ part)
        if long <= 1.2 * trust:
            break
        bent = (part * part) @ (1.0 / (values + more))
        more += (long / trust - 1.0) * long * long / bent
    return ways @ part
