"""Farthest states of plays that a closed loop ties to each other.

A loop stays closed: its other coordinates must close again what the plays of its joints open. What
they cannot close (in a plane linkage, the tilt of its pins) the plays must not open. So the
farthest displacements along loads a_i are

    max sum_i a_i . xi_i    for xi_i in P_i with sum_i T_i xi_i = 0
    = min over l of sum_i h_i(a_i + T_i^T l)

with the support functions h_i of the plays P_i (duality: Rockafellar, Convex Analysis, 1970,
section 31). Any l gives an upper bound, so the values returned are bounds whatever the numerics;
each joint's term is also the value's derivative by its relative clearance, c dh/dc.

Where the farthest states without ties leave the loops closed already, `ErrorModel` takes them
without a search. Otherwise a barrier method (Boyd, Vandenberghe, Convex Optimization, 2004, chapter
11) follows the central path of all problems at once, each play bounded by its cones (`Play.cones`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointplay.physics.joints.play import FAR, Cones, JournalPlay, Play

_EXACT = 1e-4
"""Part of the sum without ties by which points may fall short of the farthest: less than the finite
number of directions hides. Values are bounds whatever it is."""
_STAGE, _STEPS, _HALVINGS = 10.0, 30, 30
"""Factor of the objective's weight from stage to stage; most Newton steps in one, and halvings of a
step, of which a convex barrier needs a few (judged)."""
_STAGE_GAIN, _LAST_GAIN = 0.5, 1e-2
"""Decrease that a Newton step promises, in units of the barrier, below which a stage ends, and the
last one: the path need not be followed closely, and its end within `_EXACT` (judged)."""
_ROUNDING = 1e-10
"""Eigenvalues below this part of the largest are rounding."""


def ended(play: Play) -> Play:
    """The play with stand-in ends along its axis, if it has none."""
    if isinstance(play, JournalPlay) and math.isinf(play.along):
        return replace(play, along=FAR * play.across)
    return play


def opening(play: Play, ties: np.ndarray) -> np.ndarray:
    """Bound on the opening of loops by a play, for ties (n, r, 6): shape (n,)."""
    aside, angle = play.reach
    most = aside * np.abs(ties[..., :3]).sum(axis=-1) + angle * np.abs(ties[..., 3:]).sum(axis=-1)
    return np.asarray(most.max(axis=-1))


def farthest(
    plays: Sequence[Play], loads: np.ndarray, ties: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values (j, n) and points (j, n, 6) of n problems with loads (j, n, 6), ties (j, n, r, 6)."""
    sets = [play.cones for play in plays]
    aims = [loads[i] @ cone.spread for i, cone in enumerate(sets)]
    rows = [ties[i] @ cone.spread for i, cone in enumerate(sets)]
    # Scale objectives and ties to order one.
    alone = np.stack([play.support(loads[i]).value for i, play in enumerate(plays)])
    size = np.maximum(alone.sum(axis=0), 1e-300)
    wide = np.maximum(np.max([np.abs(row).max(axis=(1, 2)) for row in rows], axis=0), 1e-300)
    aims = [aim / size[:, None] for aim in aims]
    rows = [row / wide[:, None, None] for row in rows]
    places, multipliers = _Path(sets, aims, rows).follow()
    multipliers = multipliers * (size / wide)[:, None]
    value = np.stack(
        [
            play.support(loads[i] + np.einsum("nri,nr->ni", ties[i], multipliers)).value
            for i, play in enumerate(plays)
        ]
    )
    # l = 0 is a bound, too: the smaller one is taken.
    value = np.where(value.sum(axis=0) < alone.sum(axis=0), value, alone)
    point = [at @ cone.spread.T for at, cone in zip(places, sets, strict=True)]
    return value, np.stack(point)


class _Path:
    """The central path of n problems: maximise aims . y within cones, with rows . y = 0.

    For a growing weight w, it minimises the barrier less w aims . y; y are the coordinates of each
    set in `Cones`.
    """

    def __init__(
        self, sets: Sequence[Cones], aims: Sequence[np.ndarray], rows: Sequence[np.ndarray]
    ) -> None:
        self._sets, self._aims, self._rows = sets, aims, rows
        self._count = 2 * sum(len(cone.walls) for cone in sets)

    def follow(self) -> tuple[list[np.ndarray], np.ndarray]:
        """Coordinates of each set, (n, m), and the multiplier l of each tie, (n, r)."""
        y = [np.zeros_like(aim) for aim in self._aims]
        multipliers = np.zeros(self._rows[0].shape[:2])
        # At weight w the objective is within count / w of the optimum.
        weight, last = float(self._count), self._count / _EXACT
        while True:
            near = _STAGE_GAIN if weight < last else _LAST_GAIN
            active = np.arange(len(multipliers))
            for _ in range(_STEPS):
                step, multipliers[active], gain = self._newton(y, weight, active)
                self._line_search(y, step, gain, weight, active)
                active = active[gain >= near]
                if not len(active):
                    break
            if weight >= last:
                return y, -multipliers / weight
            weight = min(_STAGE * weight, last)

    def _newton(
        self, y: list[np.ndarray], weight: float, some: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Newton steps of some problems, multipliers of ties (some, r), promised gains (some,).

        The ties are eliminated by the Schur complement of the sets' Hessians, which are separate.
        """
        slopes, solved = [], []
        ties = self._rows[0].shape[1]
        inner, outer = np.zeros((len(some), ties, ties)), np.zeros((len(some), ties))
        for point, cone, aims, rows in zip(y, self._sets, self._aims, self._rows, strict=True):
            slope, curvature = _barrier(cone, point[some])
            slope = slope - weight * aims[some]
            row = rows[some]
            right = np.concatenate([slope[..., None], row.transpose(0, 2, 1)], axis=2)
            solution = np.linalg.solve(curvature, right)
            inner += row @ solution[..., 1:]
            outer += np.einsum("nri,ni->nr", row, solution[..., 0])
            slopes.append(slope)
            solved.append(solution)
        inverse = np.linalg.pinv(inner, rcond=_ROUNDING, hermitian=True)
        multipliers = -np.einsum("nrs,ns->nr", inverse, outer)
        step = [-x[..., 0] - np.einsum("nir,nr->ni", x[..., 1:], multipliers) for x in solved]
        pairs = zip(slopes, step, strict=True)
        gain = -sum(np.einsum("ni,ni->n", slope, direction) for slope, direction in pairs)
        return step, multipliers, np.asarray(gain)

    def _line_search(
        self,
        y: list[np.ndarray],
        step: list[np.ndarray],
        gain: np.ndarray,
        weight: float,
        some: np.ndarray,
    ) -> None:
        """Take steps, each halved until it stays inside and decreases the objective; or none."""
        before = self._objective([point[some] for point in y], weight, some)
        part, active = 1.0, np.arange(len(some))
        for _ in range(_HALVINGS):
            at = some[active]
            trial = [point[at] + part * move[active] for point, move in zip(y, step, strict=True)]
            after = self._objective(trial, weight, at)
            good = after <= before[active] - 0.1 * part * gain[active] + 1e-9  # Armijo's rule
            for point, moved in zip(y, trial, strict=True):
                point[at[good]] = moved[good]
            active, part = active[~good], 0.5 * part
            if not len(active):
                return

    def _objective(self, y: Sequence[np.ndarray], weight: float, some: np.ndarray) -> np.ndarray:
        """Barrier less the weighted aim at the points y of some problems, infinite outside."""
        total = np.zeros(len(some))
        for point, cone, aim in zip(y, self._sets, self._aims, strict=True):
            total -= weight * np.einsum("ni,ni->n", aim[some], point)
            for wall in cone.walls:
                margin = wall.room - point @ wall.along
                inside = margin**2 - ((point @ wall.across.T + wall.centre) ** 2).sum(axis=1)
                good = (margin > 0.0) & (inside > 0.0)
                total -= np.where(good, np.log(np.where(good, inside, 1.0)), -np.inf)
        return total


def _barrier(cones: Cones, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (n, m) and Hessian (n, m, m) of the barrier of a set.

    It is -sum log((room - along . y)^2 - |across @ y + centre|^2) over the cones.
    """
    slope, curvature = np.zeros_like(y), np.zeros((*y.shape, y.shape[1]))
    for wall in cones.walls:
        aside = y @ wall.across.T + wall.centre
        margin = wall.room - y @ wall.along
        inside = margin**2 - (aside**2).sum(axis=1)
        term = 2.0 * (margin[:, None] * wall.along + aside @ wall.across) / inside[:, None]
        curve = 2.0 * (wall.across.T @ wall.across - np.outer(wall.along, wall.along))
        slope += term
        curvature += curve / inside[:, None, None] + term[:, :, None] * term[:, None, :]
    return slope, curvature
