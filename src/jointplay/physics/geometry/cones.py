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


@compiled
def _height(walls, centres, rooms, aim, weight, y):
    """Barrier less the weighted aim; infinite outside."""
    total = 0.0
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
        total -= math.log(left)
    return total


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
def farthest(walls, centres, rooms, start, aims, points, forces):
    """Points of the set farthest along some directions, and the forces of its walls there.

    Args:
        walls: (k, m, 5), m two for cones and one for half spaces.
        centres: (k, m).
        rooms: (k,), of |walls . y + centres| <= rooms, or walls . y <= rooms.
        start: a point inside, (5,).
        aims: (n, 5).
        points: (n, 5), for the points found.
        forces: (n, k), for the walls' forces, whose sum balances each aim.
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
                        for i in range(WAYS):
                            own[i] = walls[n, 0, i] / left
                            slope[i] += own[i]
                        for i in range(WAYS):
                            for j in range(WAYS):
                                bend[i, j] += own[i] * own[j]
                        continue
                    u, w = centres[n, 0], centres[n, 1]
                    for i in range(WAYS):
                        u += walls[n, 0, i] * y[i]
                        w += walls[n, 1, i] * y[i]
                    left = rooms[n] * rooms[n] - u * u - w * w
                    for i in range(WAYS):
                        own[i] = 2.0 * (u * walls[n, 0, i] + w * walls[n, 1, i]) / left
                        slope[i] += own[i]
                    for i in range(WAYS):
                        for j in range(WAYS):
                            a = walls[n, 0, i] * walls[n, 0, j] + walls[n, 1, i] * walls[n, 1, j]
                            bend[i, j] += 2.0 * a / left + own[i] * own[j]
                before = _height(walls, centres, rooms, aim, weight, y)
                gain = 0.0
                for i in range(WAYS):
                    own[i] = slope[i]
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
        for n in range(count):
            if walls.shape[1] == 1:
                left = rooms[n]
                for i in range(WAYS):
                    left -= walls[n, 0, i] * y[i]
                forces[load, n] = 1.0 / (weight * left)
            else:
                u, w = centres[n, 0], centres[n, 1]
                for i in range(WAYS):
                    u += walls[n, 0, i] * y[i]
                    w += walls[n, 1, i] * y[i]
                left = rooms[n] * rooms[n] - u * u - w * w
                forces[load, n] = 2.0 * math.sqrt(u * u + w * w) / (weight * left)
