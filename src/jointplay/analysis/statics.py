"""How far the journals of a joint can move in their bearing, without forces: exact, in closed form.

A joint's play is a set of small displacements of the child's body against the parent's: the
journal's centre c [m] and rotation vector phi [rad], in bearing axes. What a load can reach in that
set is its support function

    h(F, M) = max (F . c + M . phi)

for a load F [N], M [N m] about the bearing's centre. The displacement at which the maximum is
attained is where the journal rests under this load, if nothing rubs. Sums of such sets have the sum
of the support functions, so a robot's budget is a sum over its joints (`budget`).

The sets follow from the gaps of docs/theory.md. In the first order of the clearance they are
convex: for a journal of length L with its rims' centres p = c + L/2 s and q = c - L/2 s, where s is
the lean of its axis,

    |p| <= C_r,  |q| <= C_r,  |c_z| + R_j |s| <= C_a

In the second order a leaning journal has a little more room, R_j |s|^2 / 2 across and L |s|^2 / 4
along: the true set is not quite convex. Here both clearances are widened by what the largest lean
gives, so that h is never too small; `excess` says by which part it may be too large.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jointplay.errors import JointplayError
from jointplay.geometry import EDGE_ROUNDING_M
from jointplay.joints import Clearance, ClearanceJoint, PrismaticJoint, SphericalJoint

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_SEARCHES = 34
"""Golden sections: they leave 1e-7 of the angle, and 1e-14 of the maximum."""
_NOTHING = 1e-9
"""Part of a load that is rounding."""


class Support(NamedTuple):
    """Support function of a joint's play, and where it is attained."""

    value: np.ndarray
    """F . c + M . phi, shape (n,) [J for loads in N and N m]."""
    point: np.ndarray
    """Displacement c [m] and rotation phi [rad], shape (n, 6)."""


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


@dataclass(frozen=True)
class TurnPlay(Play):
    """A gear's backlash: the joint turns about its axis while the motor stands."""

    half: float
    """Half of the whole play [rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        """No displacement, half of the play."""
        return 0.0, self.half

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        point = np.zeros((len(loads), 6))
        point[:, 5] = self.half * np.sign(loads[:, 5])
        return Support(np.abs(loads[:, 5]) * self.half, point)


def play(joint: Clearance, second_order: bool = True) -> Play:
    """The set of displacements that a joint with clearance allows.

    The drive holds the joint's own coordinate. A worn bore counts as a round one, as wide as its
    deepest place.

    Args:
        joint: revolute (also planar), spherical or prismatic.
        second_order: widen the set so that it contains all poses without penetration; without, it
            is proportional to the clearances.

    Raises:
        JointplayError: a joint of another kind.
    """
    if isinstance(joint, ClearanceJoint):
        return _journal(joint, second_order)
    if isinstance(joint, SphericalJoint):
        return BallPlay(joint.cr)
    if isinstance(joint, PrismaticJoint):
        return _block(joint, second_order)
    raise JointplayError(f"the play of a joint of the kind {joint.kind!r} is not known")


def _journal(joint: ClearanceJoint, second_order: bool) -> JournalPlay:
    across = joint.cr + (0.0 if joint.worn is None else float(np.max(joint.worn)))
    along = joint.ca if joint.walls else 0.0 if joint.lock_axial else math.inf
    if joint.lock_tilt:
        return JournalPlay(across, along, math.inf, 0.0)
    rim = joint.rj if joint.walls else 0.0
    if not second_order:
        return JournalPlay(across, along, joint.lj, rim)
    wide, way = across, along
    steepest = math.sqrt(2.0 * across / joint.rj)  # docs/theory.md, uniqueness
    for _ in range(40):
        lean = min(2.0 * wide / joint.lj, way / rim if rim else math.inf, steepest, 1.0)
        shorter = 1.0 - math.sqrt(1.0 - lean * lean)
        wide = across + joint.rj * shorter
        way = along + 0.5 * joint.lj * shorter + EDGE_ROUNDING_M if joint.walls else along
    excess = max(wide / across, way / along if joint.walls else 1.0) - 1.0
    return JournalPlay(wide, way, joint.lj, rim, excess)


def _block(joint: PrismaticJoint, second_order: bool) -> BlockPlay:
    given = joint.clearance, 0.0 if joint.planar else joint.cy
    arms = joint.width / 2, joint.height / 2, joint.length / 2
    free = "roll" in joint.freedoms, "pitch" in joint.freedoms, "yaw" in joint.freedoms
    found = BlockPlay(given, arms, free)
    if not second_order or joint.lock_tilt:
        return found
    corner = math.hypot(*arms)
    for _ in range(40):
        more = 0.5 * corner * min(found.reach[1], 1.0) ** 2
        wide = given[0] + more, given[1] + more if given[1] else 0.0
        excess = max(w / g for w, g in zip(wide, given, strict=True) if g) - 1.0
        found = BlockPlay(wide, arms, free, excess)
    return found


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
        found = np.sqrt(np.maximum(squares + turned, 0.0))
        for size, fits in inside:
            found = np.maximum(found, np.where(apart <= fits, sums + apart * size, 0.0))
        return found - hold * apart

    farthest = 2.0 * np.sin(most)
    low, high = np.zeros_like(most), farthest.copy()
    for _ in range(_SEARCHES):
        step = _GOLDEN * (high - low)
        right = gain(high - step) < gain(low + step)
        low, high = np.where(right, high - step, low), np.where(right, high, low + step)
    best = 0.5 * (low + high)
    best = np.where(gain(farthest) >= gain(best), farthest, best)
    return np.arcsin(np.minimum(0.5 * best, 1.0))
