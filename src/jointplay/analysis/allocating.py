"""What an allocation works on: the error as rows of the clearances, and their price."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linprog, minimize, nnls
from scipy.stats import binom
from tqdm import tqdm

from jointplay.analysis import together
from jointplay.analysis.levers import Part, sources
from jointplay.analysis.static_budget import half_sphere
from jointplay.errors import JointplayError
from jointplay.mechanism.mechanism import Mechanism

_MM = 1e3
"""Costs are of clearances in millimetres."""

SAMPLES = 4000
"""States drawn for a quantile."""

_QUANTILE_POSES = 12

_PATIENCE_S = 2.0
"""What takes longer has a bar [s]."""

_DIRECTIONS_TIED = 60
"""Over half a sphere, where plays hold each other: each is a search, in every round anew."""


class ErrorModel:
    """The tool's error as a function of the clearances, and its rows."""

    def __init__(
        self,
        mechanism: Mechanism,
        poses: np.ndarray | Mapping[str, float],
        quantile: float | None,
        seed: int,
        driven: Sequence[str] | None = None,
        progress: bool = False,
    ) -> None:
        """Find the sources of play at all poses, and draw states if a quantile is asked for."""
        self.mechanism, self.poses, self.quantile = mechanism, poses, quantile
        self.seed, self.driven = seed, driven
        self._bar = tqdm(
            desc="allocating", unit="round", disable=not progress, delay=_PATIENCE_S, leave=False
        )
        self.names = tuple(mechanism.clearance)
        self.nominal = np.array([joint.radial_room for joint in mechanism.clearance.values()])
        self.parts = sources(mechanism, poses, second_order=False, driven=driven, loops=True)
        self.n, self.j = len(self.parts[0].move), len(self.names)
        self.tied = any(part.tie is not None for part in self.parts)
        if self.tied and quantile is not None:
            raise JointplayError(
                "a quantile is of journals that rest independently of each other; those of a loop "
                "that lean hold each other: take the worst case, or kind 'planar'"
            )
        if quantile is None:
            self._half = half_sphere(_DIRECTIONS_TIED) if self.tied else half_sphere()
            # Per unit of clearance; then what gears add.
            self._grid = self._gains(np.ones(len(self.parts)))
        else:
            # A state is drawn at the poses that matter; the result is judged at all of them.
            first = self._draw(self.parts, SAMPLES // 20).sum(axis=0)
            size = np.quantile(np.linalg.norm(first, axis=2), quantile, axis=1)
            kept = np.argsort(size)[-_QUANTILE_POSES:]
            self.parts = tuple(
                replace(part, move=part.move[kept], load=part.load[kept]) for part in self.parts
            )
            self.n = len(kept)
            self._states = self._draw(self.parts)

    def _draw(self, parts: Sequence[Part], count: int = SAMPLES) -> np.ndarray:
        """States of each part under loads of random directions, (parts, n, count, 3) [m]."""
        random = np.random.default_rng(self.seed)
        states = []
        for part in parts:
            d = random.normal(size=(1, count, 3))
            d /= np.linalg.norm(d, axis=2, keepdims=True)
            shape = (len(part.move), count, 3)
            states.append(part.along(np.broadcast_to(d, shape))[1][..., :3])
        return np.stack(states)

    def _gains(self, scale: np.ndarray) -> np.ndarray:
        """Error along each direction at each pose, by clearance: (n, directions, parts)."""
        directions = np.broadcast_to(self._half, (self.n, *self._half.shape))
        gains = together.along(self.parts, directions, scale=scale).value / scale[:, None, None]
        gains[: self.j] /= self.nominal[:, None, None]
        return np.moveaxis(gains, 0, 2)

    def with_clearance(self, clearance: np.ndarray) -> Mechanism:
        """The mechanism with these clearances."""
        factors = clearance / self.nominal
        joints = self.mechanism.clearance.items()
        return self.mechanism.with_clearance(
            {name: joint.scaled(float(f)) for (name, joint), f in zip(joints, factors, strict=True)}
        )

    def error(self, clearance: np.ndarray) -> float:
        """Largest error of all poses [m]."""
        rows, offsets = self.rows(clearance)
        return float((rows @ clearance + offsets).max())

    def rows(self, clearance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The error at each pose as rows . clearance + offsets, exact here: (n, j), (n,)."""
        scale = np.append(clearance / self.nominal, np.ones(len(self.parts) - self.j))
        self._bar.update()
        return self._worst(scale) if self.quantile is None else self._at_quantile(scale)

    def _worst(self, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        per_unit = np.append(scale[: self.j] * self.nominal, scale[self.j :])
        grid = self._gains(scale) if self.tied else self._grid
        best = (grid @ per_unit).argmax(axis=1)
        d = self._half[best]
        for _ in range(5):
            total = together.along(self.parts, d[:, None], scale=scale).error.sum(axis=0)[:, 0, :3]
            size = np.linalg.norm(total, axis=1, keepdims=True)
            d = np.where(size > 0.0, total / np.where(size > 0.0, size, 1.0), d)
        found = together.along(self.parts, d[:, None], scale=scale).value[:, :, 0]
        values = (found / scale[:, None]).T
        return values[:, : self.j] / self.nominal, values[:, self.j :].sum(axis=1)

    def _at_quantile(self, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The mean over states about the quantile of what each joint adds along the error."""
        assert self.quantile is not None
        total = np.einsum("j,jnsk->nsk", scale, self._states)
        size = np.linalg.norm(total, axis=2)
        order = np.argsort(size, axis=1)
        place = int(np.ceil(self.quantile * SAMPLES)) - 1
        width = max(int(0.005 * SAMPLES), 1)
        near = order[:, max(place - width, 0) : min(place + width + 1, SAMPLES)]
        poses = np.arange(self.n)[:, None]
        unit = total[poses, near] / np.maximum(size[poses, near], 1e-300)[..., None]
        adds = np.einsum("jnsk,nsk->nj", self._states[:, poses, near], unit) / near.shape[1]
        exact = size[poses[:, 0], order[:, place]]
        mean = adds @ scale
        adds *= np.divide(exact, mean, out=np.ones_like(mean), where=mean > 0.0)[:, None]
        return adds[:, : self.j] / self.nominal, adds[:, self.j :].sum(axis=1)

    def spread(self, mechanism: Mechanism) -> tuple[float, tuple[float, float]]:
        """Quantile with the second order, included, and its 95 % interval [m]."""
        assert self.quantile is not None
        parts = sources(mechanism, self.poses, driven=self.driven, loops=True)
        size = np.sort(np.linalg.norm(self._draw(parts).sum(axis=0), axis=2), axis=1)
        low, high = binom.ppf([0.025, 0.975], SAMPLES, self.quantile).astype(int)
        place = int(np.ceil(self.quantile * SAMPLES)) - 1
        worst = int(size[:, place].argmax())
        row = size[worst]
        return float(row[place]), (float(row[low]), float(row[min(high, SAMPLES - 1)]))


@dataclass(frozen=True)
class Problem:
    """Cost and limits of the clearances."""

    cost: str
    weight: np.ndarray
    least: float
    most: float

    def value(self, c: np.ndarray) -> float:
        """Cost of clearances c [m]."""
        if self.cost == "linear":
            return float(self.weight @ (self.most - c)) * _MM
        power = 1 if self.cost == "reciprocal" else 2
        return float(self.weight @ (1.0 / (_MM * c) ** power))

    def slope(self, c: np.ndarray) -> np.ndarray:
        """Derivative of the cost by each clearance [1/m]."""
        if self.cost == "linear":
            return -self.weight * _MM
        power = 1 if self.cost == "reciprocal" else 2
        return -power * self.weight / ((_MM * c) ** power * c)

    def solve(self, rows: np.ndarray, room: np.ndarray, start: np.ndarray) -> np.ndarray:
        """The cheapest clearances with rows . c <= room [m]."""
        limits = [(self.least, self.most)] * len(start)
        if self.cost == "linear":
            # The solver's tolerances are absolute: in parts of the room and of these clearances.
            alone = (room[:, None] / np.maximum(rows, 1e-12)).min(axis=0)
            unit = np.clip(alone, self.least, self.most)
            optimum = linprog(
                -self.weight * unit / unit.max(),
                A_ub=rows * unit / room[:, None],
                b_ub=np.ones(len(rows)),
                bounds=[(self.least / u, self.most / u) for u in unit],
                method="highs",
            )
            if not optimum.success:
                raise JointplayError(f"no clearances keep the target: {optimum.message}")
            return np.clip(optimum.x * unit, self.least, self.most)
        # In logarithms of clearances the problem is convex too, and well scaled.
        cost = self.value(start)
        optimum = minimize(
            lambda y: self.value(np.exp(y)) / cost,
            np.log(start),
            jac=lambda y: self.slope(np.exp(y)) * np.exp(y) / cost,
            bounds=np.log(limits),
            constraints={
                "type": "ineq",
                "fun": lambda y: 1.0 - rows @ np.exp(y) / room,
                "jac": lambda y: -rows * np.exp(y) / room[:, None],
            },
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-14},
        )
        c = np.clip(np.exp(optimum.x), self.least, self.most)
        over = float((rows @ c / room).max())
        return c if over <= 1.0 else self.shrunk(c, rows, room)

    def shrunk(self, c: np.ndarray, rows: np.ndarray, room: np.ndarray) -> np.ndarray:
        """Clearances scaled down until they fit, but not below the least."""
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            fits = (rows @ np.maximum(middle * c, self.least) <= room).all()
            low, high = (middle, high) if fits else (low, middle)
        return np.maximum(low * c, self.least)

    def duals(self, c: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the last metre of each clearance costs, and the multipliers of the rows [1/m].

        By the conditions of Karush, Kuhn and Tucker: the cost's slope is balanced by the rows that
        bind, joints at a limit aside.
        """
        slope = -self.slope(c)
        inside = (c > self.least * (1 + 1e-6)) & (c < self.most * (1 - 1e-6))
        if not len(rows) or not inside.any():
            return slope, np.zeros(len(rows))
        scale = np.linalg.norm(slope[inside])
        return slope, nnls(rows[:, inside].T, slope[inside] / scale)[0] * scale
