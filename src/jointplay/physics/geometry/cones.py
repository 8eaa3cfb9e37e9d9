"""Farthest points of what second-order cones or half spaces in five coordinates have in common.

Each is found by a barrier method (Boyd, Vandenberghe, Convex Optimization, 2004, chapter 11).
"""

from __future__ import annotations

import math

import numpy as np

from jointplay.base.compiler import compiled

WAYS = 5
"""Coordinates."""

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
def _solve(matrix, right):
    """Solve a positive definite system in place, by elimination."""
    for k in range(WAYS):
        for i in range(k + 1, WAYS):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, WAYS):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(WAYS - 1, -1, -1):
        for j in range(k + 1, WAYS):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]


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
    slope, bend, trial = np.zeros(WAYS), np.zeros((WAYS, WAYS)), np.zeros(WAYS)
    own = np.zeros(WAYS)
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
                        bend[i, j] = 0.0
                for n in range(count):
                    if walls.shape[1] == 1:
                        left = rooms[n]
                        for i in range(WAYS):
                            left -= walls[n, 0, i] * y[i]
                        inverse = 1.0 / left
                        for i in range(WAYS):
                            own[i] = walls[n, 0, i] * inverse
                            slope[i] += own[i]
                            for j in range(i + 1):
                                bend[i, j] += own[i] * own[j]
                        continue
                    u, w = centres[n, 0], centres[n, 1]
                    for i in range(WAYS):
                        u += walls[n, 0, i] * y[i]
                        w += walls[n, 1, i] * y[i]
                    left = rooms[n] * rooms[n] - u * u - w * w
                    inverse = 2.0 / left
                    for i in range(WAYS):
                        a, b = walls[n, 0, i] * inverse, walls[n, 1, i] * inverse
                        own[i] = u * a + w * b
                        slope[i] += own[i]
                        for j in range(i + 1):
                            bend[i, j] += a * walls[n, 0, j] + b * walls[n, 1, j] + own[i] * own[j]
                before = _height(walls, centres, rooms, aim, weight, y)
                gain = 0.0
                for i in range(WAYS):
                    own[i] = slope[i]
                    for j in range(i):
                        bend[j, i] = bend[i, j]
                _solve(bend, own)
                for i in range(WAYS):
                    gain += slope[i] * own[i]
                part, moved = 1.0, False
                for _ in range(_SHORTER):
                    for i in range(WAYS):
                        trial[i] = y[i] - part * own[i]
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
