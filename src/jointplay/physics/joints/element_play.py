"""What a rolling bearing leaves free: the displacements at which no element bears load.

With the ring's radial and axial displacement at an element's azimuth,

    u = c . e_r + h s,   w = c_z - r s,   s = e_r . a

a ball keeps to |(X + u, y_0 + w)| <= A, a second-order cone, and a roller to u + k w <= C_r, a half
space. The set is what all of them have in common, exact in the first order of the lean a.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.base.errors import JointplayError
from jointplay.physics.contact.resultant import WAYS
from jointplay.physics.contact.rolling import solve_in_place
from jointplay.physics.joints.play import Cone, Cones, Play, Pressed, Support

# Farthest points of what second-order cones or half spaces in five coordinates have in common.

_EXACT = 1e-6
"""Part of the largest by which a support function may fall short."""
_STAGE, _STEPS, _SHORTER = 30.0, 40, 40
"""Factor of the objective from stage to stage; most Newton steps in one, halvings of a step."""
_FACTORS = 8
"""Distances whose product can be told, each 1e-30 at least."""


@compiled
def _height(walls, centres, rooms, aim, weight, y):
    """Barrier less the weighted aim; infinite outside."""
    total, product = 0.0, 1.0
    for i in range(WAYS):
        total -= weight * aim[i] * y[i]
    for n in range(walls.shape[0]):
        if walls.shape[1] == 1:
            left = rooms[n]
            for i in range(WAYS):
                left -= walls[n, 0, i] * y[i]
        else:
            u, w = centres[n, 0], centres[n, 1]
            for i in range(WAYS):
                u += walls[n, 0, i] * y[i]
                w += walls[n, 1, i] * y[i]
            left = rooms[n] * rooms[n] - u * u - w * w
        if not left > 0.0:
            return np.inf
        product *= left
        if n % _FACTORS == 0:  # a logarithm takes as long as all else of a wall
            total -= math.log(product)
            product = 1.0
    return total - math.log(product)


@compiled
def farthest(walls, centres, rooms, start, aims, points):
    """Points of the set farthest along some directions.

    Args:
        walls: (k, m, 5), m two for cones and one for half spaces.
        centres: (k, m).
        rooms: (k,), of |walls . y + centres| <= rooms, or walls . y <= rooms.
        start: a point inside, (5,).
        aims: (n, 5).
        points: (n, 5), for the points found.
    """
    count = walls.shape[0]
    slope, bend, trial = np.zeros(WAYS), np.zeros(WAYS * WAYS), np.zeros(WAYS)
    direction = np.zeros(WAYS)
    degree = float(count * (1 if walls.shape[1] == 1 else 2))
    for load in range(aims.shape[0]):
        aim = aims[load]
        y = points[load]
        for i in range(WAYS):
            y[i] = start[i]
        weight, last = degree, degree / _EXACT
        while True:
            for _ in range(_STEPS):
                for i in range(WAYS):
                    slope[i] = -weight * aim[i]
                    for j in range(WAYS):
                        bend[WAYS * i + j] = 0.0
                for n in range(count):
                    if walls.shape[1] == 1:
                        left = rooms[n]
                        for i in range(WAYS):
                            left -= walls[n, 0, i] * y[i]
                        inverse = 1.0 / left
                        for i in range(WAYS):
                            direction[i] = walls[n, 0, i] * inverse
                            slope[i] += direction[i]
                            for j in range(i + 1):
                                bend[WAYS * i + j] += direction[i] * direction[j]
                        continue
                    u, w = centres[n, 0], centres[n, 1]
                    for i in range(WAYS):
                        u += walls[n, 0, i] * y[i]
                        w += walls[n, 1, i] * y[i]
                    left = rooms[n] * rooms[n] - u * u - w * w
                    inverse = 2.0 / left
                    for i in range(WAYS):
                        a, b = walls[n, 0, i] * inverse, walls[n, 1, i] * inverse
                        direction[i] = u * a + w * b
                        slope[i] += direction[i]
                        for j in range(i + 1):
                            twice = a * walls[n, 0, j] + b * walls[n, 1, j]
                            bend[WAYS * i + j] += twice + direction[i] * direction[j]
                before = _height(walls, centres, rooms, aim, weight, y)
                gain = 0.0
                for i in range(WAYS):
                    direction[i] = slope[i]
                    for j in range(i):
                        bend[WAYS * j + i] = bend[WAYS * i + j]
                solve_in_place(bend, direction, 1, -1.0)
                for i in range(WAYS):
                    gain += slope[i] * direction[i]
                part, moved = 1.0, False
                for _ in range(_SHORTER):
                    for i in range(WAYS):
                        trial[i] = y[i] - part * direction[i]
                    after = _height(walls, centres, rooms, aim, weight, trial)
                    if after <= before - 0.1 * part * gain + 1e-13 * abs(before):
                        moved = True
                        break
                    part *= 0.5
                if moved:
                    for i in range(WAYS):
                        y[i] = trial[i]
                if not moved or gain < (1e-6 if weight >= last else 0.1):
                    break
            if weight >= last:
                break
            weight = min(_STAGE * weight, last)


def wall_forces(places: np.ndarray, rooms: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Forces of the walls at points that are farthest along some aims, which they balance.

    By the slopes of the barrier, which needs no further search.

    Args:
        places: walls . y + centres of the points y, (n, k, m).
        rooms: (k,).
        sizes: of the aims, (n,).

    Returns:
        Shape (n, k).
    """
    if places.shape[2] == 1:
        degree, slopes = 1, 1.0 / (rooms - places[:, :, 0])
    else:
        squares = (places**2).sum(axis=2)
        degree, slopes = 2, 2.0 * np.sqrt(squares) / (rooms**2 - squares)
    return np.asarray(slopes * sizes[:, None] * _EXACT / (degree * len(rooms)))


@dataclass(frozen=True)
class ElementPlay(Play):
    """The inner ring of a rolling bearing while no element bears load.

    With preload, or none left, the set is the point zero.
    """

    rows: tuple[tuple[float, float], ...]
    """Place h along the axis and y_0 of each row [m]."""
    count: int
    """Elements of a row."""
    cage: float
    """Azimuth of the first [rad]."""
    radius: float
    """r of the groove's centres of curvature, or of the rollers' centres [m]."""
    across: float
    """X of balls, C_r of rollers [m]."""
    distance: float
    """A of balls [m]."""
    rollers: bool
    excess: float = 0.0
    """Part by which it was widened, see `widened`."""

    @cached_property
    def widened(self) -> ElementPlay:
        """The set large enough for what a lean adds in its second order, r s^2 / 2 across."""
        if self.empty:
            return self
        lean = float(self.support(np.eye(6)[3:5]).value.max())
        more = 0.5 * (self.radius + max(abs(h) for h, _ in self.rows)) * lean * lean
        excess = more / float(self.support(np.eye(6)[:1]).value[0])
        if self.rollers:
            return replace(self, across=self.across + more, excess=excess)
        return replace(self, distance=self.distance + more, excess=excess)

    @cached_property
    def empty(self) -> bool:
        """Whether nothing is free."""
        if self.rollers:
            return self.across <= 0.0
        y = np.array([self._start[2] + up for _, up in self.rows])
        return bool((np.hypot(self.across, y) >= self.distance * (1.0 - 1e-12)).any())

    @cached_property
    def _start(self) -> np.ndarray:
        """A point inside: balls of rows that press the same way stand off their shoulders."""
        start = np.zeros(WAYS)
        if not self.rollers and len({up for _, up in self.rows}) == 1:
            start[2] = -self.rows[0][1]
        return start

    @cached_property
    def _walls(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows (n, k, 5), centres (n, k) and rooms (n,) of |rows . y + centre| <= room.

        k is two for balls and one for rollers, whose walls have one side.
        """
        phi = self.cage + 2.0 * np.pi * np.arange(self.count) / self.count
        c, s, zero = np.cos(phi), np.sin(phi), np.zeros(self.count)
        rows, centres = [], []
        for h, up in self.rows:
            u = np.column_stack([c, s, zero, h * c, h * s])
            w = np.column_stack([zero, zero, zero + 1.0, -self.radius * c, -self.radius * s])
            if self.rollers:
                sides = np.where(np.arange(self.count) % 2 == 0, 1.0, -1.0)[:, None]
                rows.append((u + sides * w)[:, None])
                centres.append(np.zeros((self.count, 1)))
            else:
                rows.append(np.stack([u, w], axis=1))
                centres.append(np.tile([self.across, up], (self.count, 1)))
        walls = np.concatenate(rows)
        room = self.across if self.rollers else self.distance
        return walls, np.concatenate(centres), np.full(len(walls), room)

    @cached_property
    def _units(self) -> np.ndarray:
        """In which the five coordinates are of like size [m, m, m, 1, 1]."""
        across = self.across if self.rollers else self.distance - self.across
        along = across
        if not self.rollers:
            along = math.sqrt(max(self.distance**2 - self.across**2, 0.0))
        lever = self.radius + max(abs(h) for h, _ in self.rows)
        return np.array([across, across, along, along / lever, along / lever])

    @cached_property
    def reach(self) -> tuple[float, float]:
        x, y, z, roll, pitch = self.support(np.eye(6)[:5]).value
        back = self.support(-np.eye(6)[2:3]).value[0]
        gap = 1.0 / math.cos(math.pi / self.count)
        return gap * math.hypot(max(x, y), max(z, back)), gap * max(roll, pitch)

    @property
    def cones(self) -> Cones:
        if self.empty:
            return Cones(np.zeros((6, 1)), (Cone(np.eye(1), np.zeros(1), 1.0),))
        if self._start.any():
            raise JointplayError(
                "in a closed loop a single angular contact bearing has no play about its centre: "
                "take a pair (arrangement DB or DF)"
            )
        spread = np.zeros((6, WAYS))
        spread[:3, :3] = np.diag(self._units[:3])
        spread[4, 3], spread[3, 4] = self._units[3], -self._units[4]
        walls, centres, rooms = self._walls
        cones = []
        for rows, centre, room in zip(walls * self._units, centres, rooms, strict=True):
            if self.rollers:
                cones.append(Cone(np.zeros((0, WAYS)), rows[0] / room, 1.0))
            else:
                cones.append(Cone(rows / room, np.zeros(WAYS), 1.0, centre / room))
        return Cones(spread, tuple(cones))

    def _aims(self, loads: np.ndarray) -> np.ndarray:
        """Loads (n, 6) on the five coordinates in their units, (n, 5) [J]."""
        return np.column_stack([loads[:, :3], loads[:, 4], -loads[:, 3]]) * self._units

    def support(self, loads: np.ndarray) -> Support:
        loads = np.asarray(loads, float).reshape(-1, 6)
        point = np.zeros((len(loads), 6))
        if not self.empty:
            walls, centres, rooms = self._walls
            aims, room = self._aims(loads), rooms[0]
            size = np.linalg.norm(aims, axis=1, keepdims=True)
            aims = np.divide(aims, size, out=np.zeros_like(aims), where=size > 0.0)
            points = np.zeros((len(loads), WAYS))
            scaled = np.ascontiguousarray(walls * self._units / room)
            start = self._start / np.where(self._units > 0.0, self._units, 1.0)
            farthest(scaled, centres / room, rooms / room, start, aims, points)
            y = points * self._units
            point[:, :3], point[:, 4], point[:, 3] = y[:, :3], y[:, 3], -y[:, 4]
        return Support(np.einsum("ij,ij->i", loads, point), point)

    def pressed(self, loads: np.ndarray, point: np.ndarray) -> Pressed:
        loads = np.asarray(loads, float).reshape(-1, 6)
        walls, centres, rooms = self._walls
        n, k = len(loads), len(walls)
        normal, forces = np.zeros((n, k, 6)), np.zeros((n, k))
        if not self.empty:
            y = np.column_stack([point[:, :3], point[:, 4], -point[:, 3]])
            out = np.einsum("kai,ni->nka", walls, y) + centres
            work = np.linalg.norm(self._aims(loads), axis=1)
            forces = wall_forces(out, rooms, work)
            size = np.linalg.norm(out, axis=2, keepdims=True)
            direction = np.ones_like(out) if self.rollers else out / size
            push = np.einsum("nka,kai->nki", direction, walls)
            normal[:, :, :3] = -push[:, :, :3]
            normal[:, :, 4], normal[:, :, 3] = -push[:, :, 3], push[:, :, 4]
        touching = forces > 1e-4 * forces.max(axis=1, initial=0.0, keepdims=True)
        across = np.zeros((n, k, 2, 6))
        return Pressed(
            (0,) * k, forces, normal, across, touching, np.zeros((n, k)), (0, 1, 2, 3, 4)
        )


NO_PLAY = ElementPlay(
    rows=((0.0, 0.0),), count=2, cage=0.0, radius=1.0, across=0.0, distance=0.0, rollers=True
)
"""The point zero."""
