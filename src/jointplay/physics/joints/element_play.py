"""The play of a rolling bearing: the displacements at which no element bears load.

With the radial and axial displacement of the inner ring at an element's azimuth,

    u = c . e_r + h s,   w = c_z - r s,   s = e_r . a

an unloaded ball satisfies |(X + u, y_0 + w)| <= A, a second-order cone, and an unloaded roller
u + k w <= C_r, a half space. The play is the intersection of these sets over all elements, exact to
first order in the lean a. A barrier method (Boyd, Vandenberghe, Convex Optimization, 2004, chapter
11) finds its farthest points.
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

# Farthest points of an intersection of second-order cones or half spaces in five coordinates.

_EXACT = 1e-6
"""Largest relative error of a support function."""
_STAGE, _STEPS, _SHORTER = 30.0, 40, 40
"""Factor of the objective's weight from stage to stage; most Newton steps in one; most halvings of
a step."""
_FACTORS = 8
"""Distances multiplied before a logarithm is taken, without underflow if each is over 1e-30."""


@compiled
def _height(walls, centres, rooms, aim, weight, y):
    """Barrier less the weighted aim at a point y; infinite outside the set."""
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
        if n % _FACTORS == 0:  # one logarithm takes as long as the rest of a wall
            total -= math.log(product)
            product = 1.0
    return total - math.log(product)


@compiled
def farthest(walls, centres, rooms, start, aims, points):
    """Points y of the set |walls . y + centres| <= rooms that are farthest along some directions.

    For half spaces the set is walls . y <= rooms.

    Args:
        walls: (k, m, 5); m is 2 for cones and 1 for half spaces.
        centres: (k, m).
        rooms: (k,).
        start: a point inside, (5,).
        aims: directions, (n, 5).
        points: the result, (n, 5).
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
                # Gradient and Hessian of the barrier less the weighted aim.
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
                # Newton's step, halved until the objective decreases enough.
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


@dataclass(frozen=True)
class ElementPlay(Play):
    """Displacements of a rolling bearing's inner ring at which no element bears load.

    Without clearance, or with preload, the set is the point zero.
    """

    rows: tuple[tuple[float, float], ...]
    """Axial position h and y_0 of each row [m]."""
    count: int
    """Number of elements in a row."""
    cage: float
    """Azimuth of the first element [rad]."""
    radius: float
    """Radius r of the groove's centres of curvature, or of the rollers' centres [m]."""
    across: float
    """X of balls, C_r of rollers [m]."""
    distance: float
    """A of balls [m]."""
    rollers: bool
    excess: float = 0.0
    """Relative excess of a set that is `widened`."""

    @cached_property
    def widened(self) -> ElementPlay:
        """The set widened by the second order of the lean, r s^2 / 2 across."""
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
        """Whether the set is the point zero."""
        if self.rollers:
            return self.across <= 0.0
        y = np.array([self._start[2] + up for _, up in self.rows])
        return bool((np.hypot(self.across, y) >= self.distance * (1.0 - 1e-12)).any())

    @cached_property
    def _start(self) -> np.ndarray:
        """A point inside, (5,): where all rows press the same way, away from that side."""
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
        """Units in which the five coordinates are of similar size [m, m, m, 1, 1]."""
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
        walls, centres, rooms = self._walls
        n, k = len(loads), len(walls)
        normal, forces = np.zeros((n, k, 6)), np.zeros((n, k))
        if not self.empty:
            y = np.column_stack([point[:, :3], point[:, 4], -point[:, 3]])
            out = np.einsum("kai,ni->nka", walls, y) + centres
            # At the end of the central path the gradient of the barrier, over the weight, balances
            # the aim: each wall's part of it is its force.
            if self.rollers:
                degree, slopes = 1, 1.0 / (rooms - out[:, :, 0])
            else:
                squares = (out**2).sum(axis=2)
                degree, slopes = 2, 2.0 * np.sqrt(squares) / (rooms**2 - squares)
            work = np.linalg.norm(self._aims(loads), axis=1)
            forces = slopes * work[:, None] * _EXACT / (degree * k)
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
"""The play of a joint without any: the point zero."""
