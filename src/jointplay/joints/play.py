"""What the clearance of a joint lets its journal do while it touches nothing: convex sets.

Each is known by its support function, the farthest that a load can push the journal.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from jointplay.errors import JointplayError

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_SEARCHES = 34
"""Golden sections: they leave 1e-7 of the angle, and 1e-14 of the maximum."""
_NOTHING = 1e-9
"""Part of a load that is rounding."""
_FAR = 100.0
"""Clearances that a journal without end walls is granted along its axis, in `Play.cones`."""


class Support(NamedTuple):
    """Support function of a joint's play, and where it is attained."""

    value: np.ndarray
    """F . c + M . phi, shape (n,) [J for loads in N and N m]."""
    point: np.ndarray
    """Displacement c [m] and rotation phi [rad], shape (n, 6)."""


class Cone(NamedTuple):
    """What coordinates y, shape (m,), must keep to: |across @ y| <= room - along . y."""

    across: np.ndarray
    """Shape (k, m); no rows for a plane wall."""
    along: np.ndarray
    """Shape (m,)."""
    room: float


class Cones(NamedTuple):
    """A play as what some cones have in common: displacements `spread` @ y."""

    spread: np.ndarray
    """Displacement c [m] and rotation phi [rad] of each coordinate, shape (6, m)."""
    walls: tuple[Cone, ...]
    """The coordinates are parts of their clearances: y = 0 lies inside of all."""


class Play(ABC):
    """The set of small displacements that a joint's play allows; it contains zero."""

    @abstractmethod
    def support(self, loads: np.ndarray) -> Support:
        """The farthest displacements in the directions of `loads`, shape (n, 6) [N, N m]."""

    @property
    @abstractmethod
    def reach(self) -> tuple[float, float]:
        """Longest displacement [m] and largest rotation [rad] in the set."""

    @property
    def cones(self) -> Cones:
        """The set itself, for plays in a closed loop, which hold each other.

        Raises:
            JointplayError: a kind of play that does not say.
        """
        raise JointplayError(
            f"{type(self).__name__} does not say which cones bound it, which a closed loop asks for"
        )

    @property
    def excess(self) -> float:
        """Part by which the set may be larger than the true one, the second order of the play."""
        return 0.0


@dataclass(frozen=True)
class JournalPlay(Play):
    """A journal in a bore: a disc across, a way along, and a lean that is coupled with both.

    The maximum over the two rims' centres has four candidates, each of which can be reached: no
    lean; both rims on the bore, leaning in between or as far as the walls let them; one rim on the
    bore, and the other inside as far from it as the walls let it.
    """

    across: float
    """C_r, widened by the second order [m]."""
    along: float
    """C_a, likewise; infinite without end walls, zero if locked [m]."""
    length: float
    """L_j; infinite if the journal cannot lean [m]."""
    rim: float
    """R_j [m]; zero if nothing limits the lean but the bore."""
    widening: float = 0.0
    """Part of the clearances by which they were widened."""

    @property
    def reach(self) -> tuple[float, float]:
        """To the corner of disc and way; rims on opposite sides, or at the walls."""
        along = 0.0 if math.isinf(self.along) else self.along
        return math.hypot(self.across, along), self._lean

    @property
    def excess(self) -> float:
        """What leaning adds to the clearances."""
        return self.widening

    @property
    def cones(self) -> Cones:
        """A disc for each rim; between the walls as much as their lean leaves."""
        way = _FAR * self.across if math.isinf(self.along) else self.along
        leans = not math.isinf(self.length)
        count = (4 if leans else 2) + (way > 0.0)
        spread, nothing = np.zeros((6, count)), np.zeros(count)
        rims = [np.eye(2, count), np.eye(2, count, 2)] if leans else [np.eye(2, count)]
        for number, rim in enumerate(rims):
            spread[:2] += self.across * rim / len(rims)
            turn = (1.0, -1.0)[number] * self.across / self.length
            spread[3:5] += turn * rim[::-1] * [[-1.0], [1.0]]
        walls = [Cone(rim, nothing, 1.0) for rim in rims]
        if way > 0.0:
            spread[2, -1] = way
            holds = leans and self.rim > 0.0
            part = self.rim * self.across / (self.length * way) if holds else 0.0
            apart = part * (rims[0] - rims[-1])[: 2 if holds else 0]
            walls += [Cone(apart, side * np.eye(count)[-1], 1.0) for side in (1.0, -1.0)]
        return Cones(spread, tuple(walls))

    @property
    def _lean(self) -> float:
        bore = 2.0 * self.across / self.length
        return bore if self.rim == 0.0 else min(bore, self.along / self.rim)

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`.

        Raises:
            JointplayError: a load along an axis on which nothing limits the journal.
        """
        loads = np.asarray(loads, float).reshape(-1, 6)
        push, axial = loads[:, :2], loads[:, 2]
        point = np.zeros((len(loads), 6))
        if math.isinf(self.along):
            size = np.abs(loads).max(axis=1, initial=0.0)
            if (np.abs(axial) > _NOTHING * size).any():
                raise JointplayError(
                    "nothing limits the journal along its axis, and the tool feels it: give the "
                    "joint end walls (an axial clearance), or lock_axial"
                )
            axial, way = np.zeros(len(loads)), 0.0
        else:
            way = self.along
        if math.isinf(self.length):
            point[:, :2] = self.across * _unit(push)
            point[:, 2] = way * np.sign(axial)
            return Support(np.einsum("ij,ij->i", loads, point), point)
        bend = np.column_stack([loads[:, 4], -loads[:, 3]]) / self.length
        near, far = push / 2.0 + bend, push / 2.0 - bend
        p, q = self._rims(near, far, np.abs(axial) * self.rim / self.length)
        lean = (p - q) / self.length
        point[:, :2] = (p + q) / 2.0
        left = way - self.rim * np.linalg.norm(lean, axis=1)
        point[:, 2] = np.maximum(left, 0.0) * np.sign(axial)
        point[:, 3], point[:, 4] = -lean[:, 1], lean[:, 0]
        return Support(np.einsum("ij,ij->i", loads, point), point)

    def _rims(self, near: np.ndarray, far: np.ndarray, hold: np.ndarray) -> tuple:
        """Centres of both rims that maximise near . p + far . q - hold |p - q|, each (n, 2)."""
        radius = self.across
        widest = 2.0 * radius if self.rim == 0.0 else self.length * self.along / self.rim
        most = math.asin(min(1.0, widest / (2.0 * radius)))
        dot = np.einsum("ij,ij->i", near, far)
        cross = near[:, 0] * far[:, 1] - near[:, 1] * far[:, 0]
        # Half the angle between the rims: turned to each other, loads could add up most at `goal`.
        side = np.where(cross > 0.0, 1.0, -1.0)
        goal = 0.5 * np.arctan2(np.abs(cross), dot)
        half = np.minimum(goal, most)
        # Where the end wall holds, leaning pays if no share of the load balances it at both rims.
        half = np.where(_distance(-near, far) <= hold, np.where(hold > 0.0, 0.0, half), half)
        (some,) = np.nonzero((hold > 0.0) & (half > 0.0))
        half[some] = _largest(near[some], far[some], hold[some], half[some])
        both = _unit(_turn(near, side * half) + _turn(far, -side * half))
        p, q = radius * _turn(both, -side * half), radius * _turn(both, side * half)
        best = np.einsum("ij,ij->i", near, p) + np.einsum("ij,ij->i", far, q)
        best -= hold * np.linalg.norm(p - q, axis=1)
        if widest < 2.0 * radius:
            middle = radius * _unit(near + far)
            for first in (True, False):
                away = middle + widest * _unit(near if first else far)
                one, other = (away, middle) if first else (middle, away)
                value = np.einsum("ij,ij->i", near, one) + np.einsum("ij,ij->i", far, other)
                value -= hold * np.linalg.norm(one - other, axis=1)
                fits = np.linalg.norm(away, axis=1) <= radius * (1.0 + 1e-12)
                better = fits & (value > best)
                best = np.where(better, value, best)
                p = np.where(better[:, None], one, p)
                q = np.where(better[:, None], other, q)
        return p, q


@dataclass(frozen=True)
class BallPlay(Play):
    """A ball in a socket: it is displaced any way; what holds its rotation is not the socket."""

    radius: float
    """C [m]."""

    @property
    def reach(self) -> tuple[float, float]:
        """C, and no rotation."""
        return self.radius, 0.0

    @property
    def cones(self) -> Cones:
        """One ball."""
        return Cones(self.radius * np.eye(6, 3), (Cone(np.eye(3), np.zeros(3), 1.0),))

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        point = np.zeros((len(loads), 6))
        point[:, :3] = self.radius * _unit(loads[:, :3])
        return Support(np.einsum("ij,ij->i", loads, point), point)


@dataclass(frozen=True)
class BlockPlay(Play):
    """A slider in a guide: |c_x| + l/2 |phi_y| + h/2 |phi_z| <= C_x, and likewise across y."""

    clearances: tuple[float, float]
    """Across x and y, widened by the second order; zero where there is none [m]."""
    arms: tuple[float, float, float]
    """Half width (x), half height (y), half length (z) of the slider [m]."""
    turns: tuple[bool, bool, bool]
    """Whether it can turn about x, y, z."""
    widening: float = 0.0
    """Part of the clearances by which they were widened."""

    @property
    def excess(self) -> float:
        """What turning adds to the clearances."""
        return self.widening

    @property
    def cones(self) -> Cones:
        """Plane walls, half of those of each clearance with each sign of its two turns."""
        parts: list[tuple[np.ndarray, list[float]]] = []
        for place, size in ((0, self.clearances[0]), (1, self.clearances[1])):
            if size > 0.0:
                parts.append((size * np.eye(6)[place], [float(place == i) for i in (0, 1)]))
                turn = 4 - place
                if self.turns[turn - 3]:
                    parts.append((size / self.arms[2] * np.eye(6)[turn], parts[-1][1]))
        if self._yaw > 0.0:
            shares = [
                arm * self._yaw / size
                for arm, size in zip(self.arms[1::-1], self.clearances, strict=True)
            ]
            parts.append((self._yaw * np.eye(6)[5], shares))
        share = np.array([weights for _, weights in parts])
        walls = []
        for axis in (0, 1):
            (own,) = np.nonzero(share[:, axis])
            for signs in product((1.0, -1.0), repeat=len(own)):
                along = np.zeros(len(parts))
                along[own] = np.array(signs) * share[own, axis]
                walls.append(Cone(np.zeros((0, len(parts))), along, 1.0))
        spread = np.column_stack([way for way, _ in parts])
        return Cones(spread, tuple(wall for wall in walls if wall.along.any()))

    @property
    def _yaw(self) -> float:
        x, y = self.clearances
        return min(x / self.arms[1], y / self.arms[0]) if self.turns[2] else 0.0

    @property
    def reach(self) -> tuple[float, float]:
        """Into a corner; corners of the slider on opposite walls."""
        x, y = self.clearances
        lean = math.hypot(x * self.turns[1], y * self.turns[0]) / self.arms[2]
        return math.hypot(x, y), math.hypot(lean, self._yaw)

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`; what is left of the room after yaw goes where it gains most."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        best = Support(np.full(len(loads), -np.inf), np.zeros((len(loads), 6)))
        for yaw in sorted({0.0, self._yaw}):
            point = np.zeros((len(loads), 6))
            point[:, 5] = yaw * np.sign(loads[:, 5])
            for axis in (0, 1):
                room = max(self.clearances[axis] - yaw * self.arms[1 - axis], 0.0)
                turn = 4 - axis
                pay = np.abs(loads[:, axis]), np.abs(loads[:, turn]) / self.arms[2]
                leans = (pay[1] > pay[0]) & self.turns[turn - 3]
                point[:, axis] = np.where(leans, 0.0, room * np.sign(loads[:, axis]))
                lean = room / self.arms[2] * np.sign(loads[:, turn])
                point[:, turn] = np.where(leans, lean, 0.0)
            value = np.einsum("ij,ij->i", loads, point)
            better = value > best.value
            best = Support(
                np.where(better, value, best.value),
                np.where(better[:, None], point, best.point),
            )
        return best


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors, zero for zero."""
    sizes = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, sizes, out=np.zeros_like(vectors), where=sizes > 0.0)


def _turn(vectors: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Plane vectors turned by an angle each [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.column_stack([c * x - s * y, s * x + c * y])


def _distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distance of the straight ways between points of the plane, (n, 2) each, from its origin."""
    way = other - one
    length = (way**2).sum(axis=1)
    part = -np.divide((one * way).sum(axis=1), length, out=np.zeros(len(way)), where=length > 0.0)
    return np.linalg.norm(one + np.clip(part, 0.0, 1.0)[:, None] * way, axis=1)


def _largest(near: np.ndarray, far: np.ndarray, hold: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Half the angle between the rims, 0 to `most`, at which the load gains most, (n,) [rad].

    For a bore of radius one. What can be gained with the rims no farther apart than a length is a
    concave function of it, so golden sections find its maximum; with rims close together one of
    them may gain more inside the bore.
    """
    dot = (near * far).sum(axis=1)
    cross = np.abs(near[:, 0] * far[:, 1] - near[:, 1] * far[:, 0])
    squares = (near**2).sum(axis=1) + (far**2).sum(axis=1)
    sums = np.linalg.norm(near + far, axis=1)
    inside = []
    for load in (near, far):
        size = np.linalg.norm(load, axis=1)
        along = ((near + far) * load).sum(axis=1)
        fits = np.divide(-2.0 * along, sums * size, out=np.full(len(size), 2.0), where=sums > 0.0)
        inside.append((size, fits))

    def gain(apart: np.ndarray) -> np.ndarray:
        sine = 0.5 * apart
        cosine = np.sqrt(1.0 - sine * sine)
        turned = 2.0 * (dot * (1.0 - 2.0 * sine * sine) + cross * 2.0 * sine * cosine)
        gains = np.sqrt(np.maximum(squares + turned, 0.0))
        for size, fits in inside:
            gains = np.maximum(gains, np.where(apart <= fits, sums + apart * size, 0.0))
        return gains - hold * apart

    farthest = 2.0 * np.sin(most)
    low, high = np.zeros_like(most), farthest.copy()
    for _ in range(_SEARCHES):
        step = _GOLDEN * (high - low)
        right = gain(high - step) < gain(low + step)
        low, high = np.where(right, high - step, low), np.where(right, high, low + step)
    best = 0.5 * (low + high)
    best = np.where(gain(farthest) >= gain(best), farthest, best)
    return np.arcsin(np.minimum(0.5 * best, 1.0))
