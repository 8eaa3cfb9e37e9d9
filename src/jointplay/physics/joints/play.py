"""Play: the convex set of displacements that a joint's clearance allows its journal.

A set is known by its support function: how far a load can push the journal, and to which point.
There the journal touches; `Play.pressed` gives the contacts and their forces against the load.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.physics.geometry import EDGE_ROUNDING_M

if TYPE_CHECKING:
    from jointplay.physics.joints.base import Outline

_SEARCHES = 60
"""Most Newton steps of the search for the rims' distance."""
_EXACT = 1e-8
"""Length of its last step, relative to the bore's radius; the error that remains is its square."""
_ROUNDING = 1e-12
"""Distance from the upper end at which it starts, relative to the bore's radius."""
_NOTHING = 1e-9
"""Part of a load, or of a clearance, that is rounding."""
_TOUCHES = 1.0 - 1e-6
"""Part of its clearance beyond which a journal counts as touching: the support function's point is
exact up to rounding, and margins of 1e-10 to 1e-5 give the same contacts for 30,000 loads."""
DRAWS = 4000
"""States drawn for the covariance of a play."""
FAR = 100.0
"""Distance of a stand-in end of a journal without end walls, in clearances across, where loops tie
plays to each other: a tool that is moved by the way to it is refused."""


class Support(NamedTuple):
    """Support function of a joint's play, and where it is attained."""

    value: np.ndarray
    """Largest F . c + M . phi in the set, shape (n,) [J for loads in N and N m]."""
    point: np.ndarray
    """Displacement c [m] and rotation phi [rad] that attain it, shape (n, 6)."""


class Cone(NamedTuple):
    """Second-order cone of coordinates y, shape (m,): |across @ y + centre| <= room - along . y."""

    across: np.ndarray
    """Shape (k, m); no rows for a plane wall."""
    along: np.ndarray
    """Shape (m,)."""
    room: float
    centre: np.ndarray | float = 0.0
    """Shape (k,)."""


class Cones(NamedTuple):
    """A play as an intersection of cones: the displacements `spread` @ y with y in all of them."""

    spread: np.ndarray
    """Displacement c [m] and rotation phi [rad] per coordinate, shape (6, m)."""
    walls: tuple[Cone, ...]
    """The cones. Coordinates are in units of the clearances, and y = 0 lies inside all cones."""


class Pressed(NamedTuple):
    """The k contacts that hold a journal against each of n loads, about the bearing's centre."""

    contact: tuple[int, ...]
    """Index of each among the joint's `contacts`, for its stiffness, length k."""
    force: np.ndarray
    """Normal forces, zero where nothing touches, shape (n, k) [N]."""
    normal: np.ndarray
    """Wrench on the journal of a unit normal force, shape (n, k, 6) [1, m]."""
    across: np.ndarray
    """Wrenches on the journal of unit friction forces along two tangents, shape (n, k, 2, 6)."""
    touching: np.ndarray
    """Whether each touches, even without a force, shape (n, k)."""
    patch: np.ndarray
    """Radius about the axis within which a flat face may push, zero of others, (n, k) [m]."""
    borne: tuple[int, ...]
    """Components of a load that only the contacts can bear."""

    def subset(self, rows: np.ndarray) -> Pressed:
        """The contacts against some of the n loads."""
        force, normal, across, touching, patch = (array[rows] for array in self[1:6])
        return Pressed(self.contact, force, normal, across, touching, patch, self.borne)

    def replaced(self, rows: np.ndarray, by: Pressed) -> Pressed:
        """The contacts, those against some of the n loads replaced by others."""
        changed = self.subset(np.arange(len(self.force)))
        for old, new in zip(changed[1:6], by[1:6], strict=True):
            old[rows] = new
        return changed


class Play(ABC):
    """The set of small displacements that a joint's play allows; it contains zero."""

    excess: float = 0.0
    """Relative excess of the set over the true one, which is of second order in the play."""

    @abstractmethod
    def support(self, loads: np.ndarray) -> Support:
        """The farthest displacements in the directions of `loads`, shape (n, 6) [N, N m]."""

    @property
    @abstractmethod
    def reach(self) -> tuple[float, float]:
        """Longest displacement [m] and largest rotation [rad] in the set."""

    @property
    def cones(self) -> Cones:
        """The set as an intersection of cones, for plays that a closed loop ties to each other.

        Raises:
            JointplayError: a kind of play that does not define it.
        """
        raise JointplayError(
            f"{type(self).__name__} does not give the cones that bound it, which a closed loop "
            "needs"
        )

    def pressed(self, loads: np.ndarray, point: np.ndarray) -> Pressed | None:
        """The contacts at the points (n, 6) to which loads (n, 6) push the journal in `support`.

        None for a kind of play that does not define them: then friction can hold it anywhere.
        """
        return None

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        """Points to which loads of random direction push the journal, shape (count, 6)."""
        aside, angle = self.reach
        if aside == 0.0 and angle == 0.0:
            return np.zeros((count, 6))
        arm = aside / angle if angle > 0.0 and aside > 0.0 else 1.0
        loads = random.normal(size=(count, 6)) * ([1.0] * 3 + [arm] * 3)
        loads[:, 5] = 0.0  # the drive bears the moment about the axis
        return self.support(loads).point

    @cached_property
    def covariance(self) -> np.ndarray:
        """Second moments of the points of `draw`, shape (6, 6)."""
        states = self.draw(np.random.default_rng(0), DRAWS)
        return np.asarray(states.T @ states / DRAWS)


@dataclass(frozen=True)
class JournalPlay(Play):
    """A journal in a bore: displacement in a disc and along the axis, coupled with a lean.

    The set is described by the centres of the two rims, p and q, each in the disc of radius C_r:
    the displacement is (p + q) / 2, the lean (p - q) / L_j, and a lean takes R_j |p - q| / L_j of
    the axial clearance. The load's work is largest at one of four candidates: no lean; both rims on
    the bore, leaning less than the walls allow or as far as they do; one rim on the bore, the other
    inside, as far away as the walls allow.
    """

    across: float
    """C_r, widened by the second order [m]."""
    along: float
    """C_a, widened by the second order; infinite without end walls, zero if locked [m]."""
    length: float
    """L_j; infinite if the journal cannot lean [m]."""
    rim: float
    """R_j [m]; zero if nothing limits the lean but the bore."""
    excess: float = 0.0
    """Part of the clearances by which they were widened."""
    radius: float = 0.0
    """R_j [m] also without walls, the arm of friction along the axis."""

    @property
    def reach(self) -> tuple[float, float]:
        """Displacement to the edge of the disc at an end wall; lean with rims on opposite sides of
        the bore, or at the walls.
        """
        along = 0.0 if math.isinf(self.along) else self.along
        bore = 2.0 * self.across / self.length
        return math.hypot(self.across, along), min(
            bore, self.along / self.rim
        ) if self.rim else bore

    @property
    def cones(self) -> Cones:
        """In coordinates of the rims' centres, and of the axial displacement if there is any."""
        axial = FAR * self.across if math.isinf(self.along) else self.along
        leans = not math.isinf(self.length)
        count = (4 if leans else 2) + (axial > 0.0)
        spread, nothing = np.zeros((6, count)), np.zeros(count)
        rims = [np.eye(2, count), np.eye(2, count, 2)] if leans else [np.eye(2, count)]
        for number, rim in enumerate(rims):
            spread[:2] += self.across * rim / len(rims)
            turn = (1.0, -1.0)[number] * self.across / self.length
            spread[3:5] += turn * rim[::-1] * [[-1.0], [1.0]]
        walls = [Cone(rim, nothing, 1.0) for rim in rims]
        if axial > 0.0:
            spread[2, -1] = axial
            holds = leans and self.rim > 0.0
            part = self.rim * self.across / (self.length * axial) if holds else 0.0
            apart = part * (rims[0] - rims[-1])[: 2 if holds else 0]
            walls += [Cone(apart, side * np.eye(count)[-1], 1.0) for side in (1.0, -1.0)]
        return Cones(spread, tuple(walls))

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`.

        Raises:
            JointplayError: a load along an axis on which nothing limits the journal.
        """
        push, axial = loads[:, :2], loads[:, 2]
        point = np.zeros((len(loads), 6))
        if math.isinf(self.along):
            size = np.abs(loads).max(axis=1, initial=0.0)
            if (np.abs(axial) > _NOTHING * size).any():
                raise JointplayError(
                    "nothing limits the journal along its axis, and this affects the tool: give "
                    "the joint end walls (an axial clearance), or lock_axial"
                )
            axial, axial_room = np.zeros(len(loads)), 0.0
        else:
            axial_room = self.along
        if math.isinf(self.length):
            point[:, :2] = self.across * _unit(push)
            point[:, 2] = axial_room * np.sign(axial)
            return Support(np.einsum("ij,ij->i", loads, point), point)
        # The load as forces at the centres of the rims at +L_j/2 and -L_j/2.
        bend = np.column_stack([loads[:, 4], -loads[:, 3]]) / self.length
        near, far = push / 2.0 + bend, push / 2.0 - bend
        p, q = self._rims(near, far, np.abs(axial) * self.rim / self.length)
        lean = (p - q) / self.length
        point[:, :2] = (p + q) / 2.0
        left = axial_room - self.rim * np.linalg.norm(lean, axis=1)
        point[:, 2] = np.maximum(left, 0.0) * np.sign(axial)
        point[:, 3], point[:, 4] = -lean[:, 1], lean[:, 0]
        return Support(np.einsum("ij,ij->i", loads, point), point)

    def pressed(self, loads: np.ndarray, point: np.ndarray) -> Pressed:
        """Rims A and B on the bore, then the walls at ends A and B; see `Play.pressed`.

        A journal that cannot lean has one line of contact instead of two rims.
        """
        walled, leans = 0.0 < self.along < math.inf, not math.isinf(self.length)
        if leans:
            outward, lean, forces = self._borne_leaning(loads, point, walled)
            heights = [0.5 * self.length, -0.5 * self.length]
        else:
            outward, lean, heights = [_unit(loads[:, :2])], np.zeros((len(loads), 2)), [0.0]
            axial = loads[:, 2] * walled
            radial = np.linalg.norm(loads[:, :2], axis=1)
            forces = [radial, np.maximum(axial, 0.0), np.maximum(-axial, 0.0)]
        contacts = [self._on_bore(*rim) for rim in zip(outward, heights, strict=True)]
        for side in (1.0, -1.0):
            normal, across, reached, patch = self._on_wall(side, lean, point, heights[0])
            contacts.append((normal, across, reached & walled, patch * leans))
        arrays = (np.stack(parts, axis=1) for parts in zip(*contacts, strict=True))
        normal, across, touching, patch = arrays
        which, force = tuple(range(len(contacts))), np.column_stack(forces)
        borne = (0, 1) + (2,) * walled + (3, 4) * leans
        return Pressed(which, force, normal, across, touching, patch, borne)

    def _on_bore(self, outward: np.ndarray, height: float) -> tuple[np.ndarray, ...]:
        """Contact of a rim with the bore.

        Args:
            outward: unit direction of the contact across the axis, zero without one, (n, 2).
            height: position of the rim along the axis [m].

        Returns:
            Wrenches of a unit normal force, (n, 6), and of unit forces along two tangents, (n, 2,
            6); whether it touches, (n,); radius of its patch, zero, (n,) [m].
        """
        n, e_z = len(outward), np.array([0.0, 0.0, 1.0])
        out = np.column_stack([outward, np.zeros(n)])
        around = np.cross(e_z, out)
        along = np.hstack([np.broadcast_to(e_z, (n, 3)), -self.radius * around])
        tangents = np.stack([np.hstack([around, -height * out]), along], axis=1)
        touching = np.abs(outward).max(axis=1) > 0.0
        return np.hstack([-out, -height * around]), tangents, touching, np.zeros(n)

    def _on_wall(
        self, side: float, lean: np.ndarray, point: np.ndarray, height: float
    ) -> tuple[np.ndarray, ...]:
        """Contact of a face with the wall at the end on this `side`; returns as `_on_bore`.

        `lean` is the unit direction in which the journal leans, zero if it is straight, (n, 2).
        """
        n, e_z = len(lean), np.array([0.0, 0.0, 1.0])
        # The wall meets a leaning face at the highest point of its rim; a straight one lies flat.
        highest = self.rim * np.column_stack([lean, np.zeros(n)])
        normal = np.hstack([np.broadcast_to([0.0, 0.0, -side], (n, 3)), np.cross(highest, e_z)])
        across = np.eye(3)[:2]
        tangents = np.hstack([across, side * height * np.cross(e_z, across)])
        rise = self.rim * np.hypot(point[:, 3], point[:, 4])
        reached = side * point[:, 2] >= (self.along - rise) - (1.0 - _TOUCHES) * self.along
        patch = np.where(lean.any(axis=1), 0.0, self.rim)
        return normal, np.broadcast_to(tangents, (n, 2, 6)), reached, patch

    def _borne_leaning(
        self, loads: np.ndarray, point: np.ndarray, walled: bool
    ) -> tuple[list[np.ndarray], np.ndarray, list[np.ndarray]]:
        """Contacts of a journal that can lean, and the forces of rims and walls.

        The load at each rim's centre is balanced by the bore, N u outward, and by the walls, which
        resist leaning in the direction s:

            near = N_A u_A + h s,  far = N_B u_B - h s,  h = (sum of the walls' forces) R / L

        Returns:
            The directions u of both rims, zero for one that does not touch, each (n, 2); s, zero
            without lean, (n, 2); the forces of rims A and B and walls A and B, each (n,) [N].
        """
        up, down = (np.maximum(side * loads[:, 2], 0.0) * walled for side in (1.0, -1.0))
        half, bend = loads[:, :2] / 2.0, np.column_stack([loads[:, 4], -loads[:, 3]])
        near, far = half + bend / self.length, half - bend / self.length
        slope = 0.5 * self.length * np.column_stack([point[:, 4], -point[:, 3]])
        rim_a, rim_b = point[:, :2] + slope, point[:, :2] - slope
        u_a, u_b = (
            np.where(np.linalg.norm(r, axis=1, keepdims=True) >= _TOUCHES * self.across, r, 0.0)
            / self.across
            for r in (rim_a, rim_b)
        )
        apart = np.linalg.norm(rim_a - rim_b, axis=1)
        straight = apart <= _NOTHING * self.across
        lean = np.where(straight[:, None], 0.0, _unit(rim_a - rim_b))
        hold = (up + down) * self.rim / self.length
        widest = self.length * self.along / self.rim if walled and self.rim > 0.0 else math.inf
        (most,) = np.nonzero(apart >= _TOUCHES * widest)
        if len(most):  # both walls stop the lean: least squares find h
            zero = np.zeros((len(most), 2))
            columns = np.stack(
                [
                    np.hstack([lean[most], -lean[most]]),
                    np.hstack([u_a[most], zero]),
                    np.hstack([zero, u_b[most]]),
                ],
                axis=2,
            )
            right = np.hstack([near[most], far[most]])[..., None]
            share = (np.linalg.pinv(columns, rcond=_NOTHING) @ right)[:, 0, 0]
            hold[most] = np.maximum(share, hold[most])
            walls_force = hold[most] * self.length / self.rim
            up[most], down[most] = (0.5 * (walls_force + k * loads[most, 2]) for k in (1.0, -1.0))
        on_a = np.maximum(((near - hold[:, None] * lean) * u_a).sum(axis=1), 0.0)
        on_b = np.maximum(((far + hold[:, None] * lean) * u_b).sum(axis=1), 0.0)
        # Without lean both rims touch at one azimuth, and share the force there.
        together = np.maximum(((near + far) * u_a).sum(axis=1), 0.0)
        on_a = np.where(straight, np.minimum(on_a, together), on_a)
        on_b = np.where(straight, np.maximum(together - on_a, 0.0), on_b)
        return [u_a, u_b], lean, [on_a, on_b, up, down]

    def _rims(self, near: np.ndarray, far: np.ndarray, hold: np.ndarray) -> tuple:
        """Centres of both rims that maximise near . p + far . q - hold |p - q|, each (n, 2)."""
        radius = self.across
        widest = 2.0 * radius if self.rim == 0.0 else self.length * self.along / self.rim
        most = math.asin(min(1.0, widest / (2.0 * radius)))
        dot = np.einsum("ij,ij->i", near, far)
        cross = near[:, 0] * far[:, 1] - near[:, 1] * far[:, 0]
        # Rims on the bore, `half` the angle between them. Without walls `goal`, half the angle
        # between the loads, is best; walls limit it, or make it pay less.
        side = np.where(cross > 0.0, 1.0, -1.0)
        goal = 0.5 * np.arctan2(np.abs(cross), dot)
        half = np.minimum(goal, most)
        # Against an axial force leaning pays only if -near and far, and all between, exceed `hold`.
        half = np.where(_distance(-near, far) <= hold, np.where(hold > 0.0, 0.0, half), half)
        (some,) = np.nonzero((hold > 0.0) & (half > 0.0))
        half[some] = _largest(near[some], far[some], hold[some], half[some])
        middle = _unit(_turn(near, side * half) + _turn(far, -side * half))
        p, q = radius * _turn(middle, -side * half), radius * _turn(middle, side * half)
        best = np.einsum("ij,ij->i", near, p) + np.einsum("ij,ij->i", far, q)
        best -= hold * np.linalg.norm(p - q, axis=1)
        if widest < 2.0 * radius:  # or one rim inside the bore, as far away as the walls allow
            middle = radius * _unit(near + far)
            for first in (True, False):
                away = middle + widest * _unit(near if first else far)
                rim_a, rim_b = (away, middle) if first else (middle, away)
                value = np.einsum("ij,ij->i", near, rim_a) + np.einsum("ij,ij->i", far, rim_b)
                value -= hold * np.linalg.norm(rim_a - rim_b, axis=1)
                fits = np.linalg.norm(away, axis=1) <= radius * (1.0 + 1e-12)
                better = fits & (value > best)
                best = np.where(better, value, best)
                p = np.where(better[:, None], rim_a, p)
                q = np.where(better[:, None], rim_b, q)
        return p, q


@dataclass(frozen=True)
class BallPlay(Play):
    """A ball in a socket: displaced in any direction; the socket does not hold its rotation."""

    radius: float
    """C [m]."""

    @property
    def reach(self) -> tuple[float, float]:
        return self.radius, 0.0

    @property
    def cones(self) -> Cones:
        return Cones(self.radius * np.eye(6, 3), (Cone(np.eye(3), np.zeros(3), 1.0),))

    def support(self, loads: np.ndarray) -> Support:
        point = np.zeros((len(loads), 6))
        point[:, :3] = self.radius * _unit(loads[:, :3])
        return Support(np.einsum("ij,ij->i", loads, point), point)

    def pressed(self, loads: np.ndarray, point: np.ndarray) -> Pressed:
        out = _unit(loads[:, :3])
        least = np.eye(3)[np.abs(out).argmin(axis=1)]  # the axis that is most nearly across
        tangent = _unit(np.cross(out, least))
        normal, across = np.zeros((len(loads), 1, 6)), np.zeros((len(loads), 1, 2, 6))
        normal[:, 0, :3] = -out
        across[:, 0, 0, :3], across[:, 0, 1, :3] = tangent, np.cross(out, tangent)
        force = np.linalg.norm(loads[:, :3], axis=1)[:, None]
        return Pressed((0,), force, normal, across, force > 0.0, np.zeros_like(force), (0, 1, 2))


@dataclass(frozen=True)
class BlockPlay(Play):
    """A slider in a guide: |c_x| + l/2 |phi_y| + h/2 |phi_z| <= C_x, and the same across y."""

    clearances: tuple[float, float]
    """C_x and C_y, widened by the second order; zero where there is none [m]."""
    arms: tuple[float, float, float]
    """Half width (x), half height (y), half length (z) of the slider [m]."""
    turns: tuple[bool, bool, bool]
    """Whether it can turn about x, y, z."""
    excess: float = 0.0
    """Part of the clearances by which they were widened."""

    @property
    def cones(self) -> Cones:
        """Plane walls, one for each choice of signs in the two inequalities."""
        # Coordinates: displacement of each, and the part of C_x and C_y that one unit takes.
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
            (moving,) = np.nonzero(share[:, axis])
            for signs in product((1.0, -1.0), repeat=len(moving)):
                along = np.zeros(len(parts))
                along[moving] = np.array(signs) * share[moving, axis]
                walls.append(Cone(np.zeros((0, len(parts))), along, 1.0))
        spread = np.column_stack([direction for direction, _ in parts])
        return Cones(spread, tuple(wall for wall in walls if wall.along.any()))

    @property
    def _yaw(self) -> float:
        """Largest rotation about z [rad]."""
        x, y = self.clearances
        return min(x / self.arms[1], y / self.arms[0]) if self.turns[2] else 0.0

    @property
    def reach(self) -> tuple[float, float]:
        x, y = self.clearances
        lean = math.hypot(x * self.turns[1], y * self.turns[0]) / self.arms[2]
        return math.hypot(x, y), math.hypot(lean, self._yaw)

    def support(self, loads: np.ndarray) -> Support:
        """At a corner of the set: without yaw or with all, then a shift or a lean on each axis."""
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
                np.where(better, value, best.value), np.where(better[:, None], point, best.point)
            )
        return best

    def pressed(self, loads: np.ndarray, point: np.ndarray) -> Pressed:
        """The slider's corners on the walls, their forces by non-negative least squares."""
        from scipy.optimize import nnls  # takes long to import

        normal, across, rooms = [], [], []
        for axis in (0, 1):
            for side, end, edge in product((1.0, -1.0), repeat=3):
                if self.clearances[axis] == 0.0:
                    continue
                place = np.zeros(3)
                place[1 - axis], place[2] = edge * self.arms[1 - axis], end * self.arms[2]
                forces = np.eye(3)[[axis, 1 - axis, 2]] * [[-side], [1.0], [1.0]]
                wrenches = np.hstack([forces, np.cross(place, forces)])
                normal.append(wrenches[0])
                across.append(wrenches[1:])
                rooms.append(self.clearances[axis])
        normals, room = np.array(normal), np.array(rooms)
        close = -point @ normals.T >= room - 1e-6 * room.max()
        # Components of a load that only the walls bear, moments divided by an arm.
        bears = np.array([size > 0.0 for size in self.clearances] + [False] + [*self.turns])
        weight = np.where(bears, [1.0] * 3 + [1.0 / self.arms[2]] * 3, 0.0)
        force = np.zeros((len(loads), len(normals)))
        for row, active, load in zip(force, close, loads * weight, strict=True):
            if active.any():
                row[active] = nnls(-(normals[active] * weight).T, load)[0]
        shape = len(loads), len(normals)
        return Pressed(
            (0,) * len(normals),
            force,
            np.broadcast_to(normals, (*shape, 6)),
            np.broadcast_to(np.array(across), (*shape, 2, 6)),
            close,
            np.zeros(shape),
            tuple(map(int, np.flatnonzero(bears))),
        )


def play_within(outline: Outline, freedoms: Sequence[str], second_order: bool) -> Play:
    """Play of a journal of this outline with these freedoms in its bearing.

    To second order, leaning and turning widen the clearances; the widened ones, which allow more
    leaning and turning, are found by iteration.
    """
    if outline.form == "ball":
        return BallPlay(outline.room[0])  # exact in every order
    if outline.form == "block":
        return _block_play(outline, freedoms, second_order)
    return _journal_play(outline, freedoms, second_order)


def _journal_play(outline: Outline, freedoms: Sequence[str], second_order: bool) -> JournalPlay:
    """Play of a journal in a bore, at the deepest wear of the bore."""
    radius, half, walls = outline.size[0], outline.size[2], outline.walls
    across = outline.room[0] + max((max(row) for row in outline.worn), default=0.0)
    along = outline.room[2] if walls else math.inf if "z" in freedoms else 0.0
    if "pitch" not in freedoms:
        return JournalPlay(across, along, math.inf, 0.0, radius=radius)
    length, rim = 2.0 * half, radius if walls else 0.0
    if not second_order:
        return JournalPlay(across, along, length, rim, radius=radius)
    wide, axial = across, along
    steepest = math.sqrt(2.0 * across / radius)  # docs/theory.md, uniqueness
    for _ in range(40):
        lean = min(2.0 * wide / length, axial / rim if rim else math.inf, steepest, 1.0)
        shorter = 1.0 - math.sqrt(1.0 - lean * lean)
        wide = across + radius * shorter
        axial = along + 0.5 * length * shorter + EDGE_ROUNDING_M if walls else along
    excess = max(wide / across, axial / along if walls else 1.0) - 1.0
    return JournalPlay(wide, axial, length, rim, excess, radius)


def _block_play(outline: Outline, freedoms: Sequence[str], second_order: bool) -> BlockPlay:
    """Play of a slider in a guide."""
    sizes = outline.room[0], outline.room[1] if outline.walls else 0.0
    free = "roll" in freedoms, "pitch" in freedoms, "yaw" in freedoms
    block = BlockPlay(sizes, outline.size, free)
    if not second_order or not any(free):
        return block
    corner = math.hypot(*outline.size)
    for _ in range(40):
        more = 0.5 * corner * min(block.reach[1], 1.0) ** 2
        wide = sizes[0] + more, sizes[1] + more if sizes[1] else 0.0
        excess = max(w / g for w, g in zip(wide, sizes, strict=True) if g) - 1.0
        block = BlockPlay(wide, outline.size, free, excess)
    return block


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors, zero for zero."""
    sizes = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, sizes, out=np.zeros_like(vectors), where=sizes > 0.0)


def _turn(vectors: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Plane vectors turned by an angle each [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.column_stack([c * x - s * y, s * x + c * y])


def _distance(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance of the segments between points of the plane, (n, 2) each, from its origin, (n,)."""
    step = end - start
    length = (step**2).sum(axis=1)
    product = (start * step).sum(axis=1)
    part = -np.divide(product, length, out=np.zeros(len(step)), where=length > 0.0)
    return np.linalg.norm(start + np.clip(part, 0.0, 1.0)[:, None] * step, axis=1)


def _largest(near: np.ndarray, far: np.ndarray, hold: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Half the angle between the rims, 0 to `most`, that maximises the load's work, (n,) [rad].

    For a bore of radius one. The work with the rims no farther apart than a length is a concave
    function of that length. While one rim stays inside the bore its slope is the load on that rim;
    beyond, Newton steps in brackets find the length at which the slope is `hold`.
    """
    dot = (near * far).sum(axis=1)
    cross = np.abs(near[:, 0] * far[:, 1] - near[:, 1] * far[:, 0])
    sizes = (near**2).sum(axis=1), (far**2).sum(axis=1)
    squares = sizes[0] + sizes[1]
    sums = np.sqrt(np.maximum(squares + 2.0 * dot, 0.0))
    low, high = np.zeros(len(hold)), 2.0 * np.sin(most)
    for size in np.sqrt(sizes):
        inside = -2.0 * (size**2 + dot)
        with np.errstate(divide="ignore", invalid="ignore"):
            fits = np.where(inside > 0.0, inside / (sums * size), 0.0)
        low = np.where(size > hold, np.maximum(low, np.minimum(fits, high)), low)
    apart = (1.0 - _ROUNDING) * high
    # gain(apart), its slope `rise`, and the derivative of that, `fall`, of two rims on the bore.
    for _ in range(_SEARCHES):
        cosine = np.sqrt(1.0 - 0.25 * apart * apart)
        twice = 1.0 - 0.5 * apart * apart
        along, aside = dot * twice + cross * apart * cosine, cross * twice - dot * apart * cosine
        gain = np.sqrt(np.maximum(squares + 2.0 * along, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            rise = aside / (cosine * gain)
            fall = (along / gain - 0.25 * apart * rise) / cosine**2 + rise * rise / gain
            trial = apart + (rise - hold) / fall
        on = rise > hold
        low, high = np.where(on, apart, low), np.where(on, high, apart)
        trial = np.where(trial >= low, trial, low + 0.5 * _EXACT)  # the solution may be at `low`
        trial = np.where(trial <= high, trial, 0.5 * (low + high))
        moved, apart = np.abs(trial - apart).max(initial=0.0), trial
        if moved <= _EXACT:
            break
    return np.arcsin(np.minimum(0.5 * apart, 1.0))
