"""The optimisation behind `allocation`: the cheapest sizes and offers whose error keeps a target.

The error (`error_model`) is convex in the factors of its contributions: at a pose and along a
direction the worst case is linear in them, as support functions add; the root mean square is the
root of a quadratic form, as variances add and loads shift. So the factors that keep a target at all
poses make a convex set, and a convex price has one minimum on it. Cutting planes find it: the
problem is solved for the poses and directions known to bind, the worst ones of the solution are
added, and so on until none is worse than the target.

- Sizes are any numbers within limits. Their price is convex; the dual of the problem, which has
  bounds only, is solved by L-BFGS-B, or by HiGHS where the price is linear.
- Of each group of offers one is chosen, by mixed-integer programming (HiGHS), in which the prices
  of sizes are replaced by tangents, more of them until the choice stays (outer approximation: Duran
  and Grossmann, Mathematical Programming 36, 1986, 307).

Two errors are not convex. Where loops tie plays to each other the worst case is concave in the
clearances: a plane found at some of them is too strict for others, so the solution keeps the target
but need not be the cheapest. A quantile supposes that each journal rests, independently of the
others, where a load on the tool of random direction puts it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp, minimize
from scipy.stats import binom

from jointplay.accuracy.error_model import ErrorModel, half_sphere
from jointplay.base.errors import JointplayError

COSTS = ("reciprocal", "reciprocal-squared", "linear")
"""Price of a size c per weight: 1/c, 1/c^2, or the difference from the largest size."""
SAMPLES = 4000
"""States drawn for a quantile."""
TOLERANCE = 1e-8
"""Part of the target by which an error may exceed it."""
_QUANTILE_POSES, _QUANTILE_ROUNDS = 12, 8
"""Poses with the largest errors, at which alone states are drawn, as all would take long; rounds,
each of which halves the way left to the cheapest sizes (judged)."""
_DIRECTIONS_TIED = 60
"""Directions over half a sphere where loops tie plays: each is a search, anew in every round."""
_NEAR = 0.98
"""Part of the largest error from which on the direction of a pose is refined: the sphere's
directions are about 7 degrees apart, which hides 0.7 %."""
_ROUNDS, _CUTS = 100, 12
"""Most rounds of cutting planes, after which a target is refused; worst poses added in each."""
_TANGENTS = 16
"""Tangents of each size's price to begin with."""
_TIE = 1e-6
"""Part of the largest price that decides between offers of equal price: the tighter is chosen."""

Key = tuple[str, str]
"""Joint (or its gear) and cause: what a size belongs to."""

# The error as a function of the choice z, (v,): a size for each key, then a number for each offer,
# 1 if it is bought and 0 if not. Contributions that nobody chooses have the factor 1.


class Error(ABC):
    """The largest error of all poses as a function of the choice, and planes that touch it."""

    convex = True
    kind: str
    """The error in words."""

    def __init__(self, model: ErrorModel, of: Sequence[int], now: np.ndarray) -> None:
        """The error of a model made with the choice `now` (v,).

        `of` says which component of the choice multiplies each contribution; -1: none.
        """
        self.model, self._of, self._count = model, np.array(of, int), len(now) + 1
        self._unit = np.append(1.0 / now, 1.0)[self._of]

    @abstractmethod
    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Planes rows . z + offsets that equal the error at z and, if it is convex, bound it below.

        One for each of m poses: all, or those that may have the largest error; (m, v), (m,) [m].
        """

    @abstractmethod
    def parts(self, z: np.ndarray) -> np.ndarray:
        """Share of each contribution in the largest error, (k,) [m]."""

    def at(self, z: np.ndarray) -> float:
        """The largest error at a choice [m]."""
        rows, offsets = self.planes(z)
        return float((rows @ z + offsets).max())

    def slopes(self, z: np.ndarray) -> np.ndarray:
        """Derivative of the largest error by each component of the choice, (v,) [m]."""
        rows, offsets = self.planes(z)
        return np.asarray(rows[(rows @ z + offsets).argmax()])

    def _ratio(self, z: np.ndarray) -> np.ndarray:
        """Factor of each of the model's contributions at a choice, (k,)."""
        return np.asarray(np.append(z, 1.0)[self._of] * self._unit)

    def _by_choice(self, values: np.ndarray) -> np.ndarray:
        """Values of contributions (k, ...) summed by component of the choice, (v + 1, ...).

        They are per unit of the choice; the last sum is of contributions that nobody chooses.
        """
        sums = np.zeros((self._count, *values.shape[1:]))
        weighted = values * self._unit.reshape(-1, *[1] * (values.ndim - 1))
        np.add.at(sums, self._of % self._count, weighted)
        return sums


class WorstCase(Error):
    """The largest distance of the tool in any state."""

    kind = "static worst case"

    def __init__(self, model: ErrorModel, of: Sequence[int], now: np.ndarray) -> None:
        super().__init__(model, of, now)
        self.convex = not model.tied
        self._sphere = half_sphere(_DIRECTIONS_TIED) if model.tied else model.sphere
        self._grids: dict[int, np.ndarray] = {}

    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Support functions along the worst direction of each pose that may be the worst."""
        ratio = self._ratio(z)
        (counting,) = np.nonzero(ratio)
        scaled = self.model.scaled(self.model.scale * ratio)
        total = self._on_sphere(z) if self.convex else scaled.values(self._sphere).sum(axis=0)
        size = total.max(axis=1)
        (near,) = np.nonzero(size >= _NEAR * size.max())
        start = self._sphere[total[near].argmax(axis=1)]
        d = scaled.subset(counting, near).climb(start)[:, None]
        if self.convex:
            parts = self.model.subset(poses=near).along(d).value[..., 0]
        else:
            parts = scaled.subset(poses=near).along(d).value[..., 0] / ratio[:, None]
        rows = self._by_choice(parts).T
        self._worst = parts[:, int((rows @ np.append(z, 1.0)).argmax())]
        return rows[:, :-1], rows[:, -1]

    def _on_sphere(self, z: np.ndarray) -> np.ndarray:
        """The error at all poses along all directions, (n, m), from sums that are kept."""
        total = np.zeros((self.model.poses, len(self._sphere)))
        for k, part in enumerate(np.append(z, 1.0)):
            (members,) = np.nonzero(self._of % self._count == k)
            if part == 0.0 or not len(members):
                continue
            if k not in self._grids:
                each = self.model.subset(members).values(self._sphere)
                self._grids[k] = np.tensordot(self._unit[members], each, 1)
            total += part * self._grids[k]
        return total

    def parts(self, z: np.ndarray) -> np.ndarray:
        self.planes(z)
        return self._worst * self._ratio(z)


class RootMeanSquare(Error):
    """The largest root mean square distance of the tool."""

    kind = "RMS"

    def __init__(self, model: ErrorModel, of: Sequence[int], now: np.ndarray) -> None:
        if model.tied:
            raise JointplayError(
                "variances do not add where joints of closed loops hold each other: allocate by "
                "the worst case, or give the loops joints that do not (kind 'planar', balls)"
            )
        super().__init__(model, of, now)
        self._means = self._by_choice(model.means)
        variances = np.trace(model.covariances, axis1=2, axis2=3)
        self._variances = self._by_choice(variances * self._unit[:, None])

    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tangents of the root of a quadratic form."""
        factors = np.append(z, 1.0)
        mean = np.einsum("kni,k->ni", self._means, factors)
        square = (mean**2).sum(axis=1) + factors**2 @ self._variances
        rows = np.einsum("kni,ni->nk", self._means, mean) + self._variances.T * factors
        rows /= np.sqrt(np.maximum(square, 1e-300))[:, None]
        return rows[:, :-1], rows[:, -1]

    def parts(self, z: np.ndarray) -> np.ndarray:
        rows, offsets = self.planes(z)
        values = rows @ z + offsets
        at, ratio = int(values.argmax()), self._ratio(z)
        means = self.model.means[:, at] * ratio[:, None]
        square = np.trace(self.model.covariances[:, at], axis1=1, axis2=2) * ratio**2
        return np.asarray((means @ means.sum(axis=0) + square) / max(float(values[at]), 1e-300))


class Quantile(Error):
    """The largest quantile of the tool's distance over random states of the journals.

    States are drawn at the poses with the largest errors; the result is judged at all (`spread`).
    """

    convex = False

    def __init__(
        self, model: ErrorModel, of: Sequence[int], now: np.ndarray, quantile: float, seed: int
    ) -> None:
        if model.tied:
            raise JointplayError(
                "a quantile is defined for journals that rest independently of each other, but "
                "journals that tilt in a loop constrain each other: use the worst case, or kind "
                "'planar'"
            )
        self.quantile, self.seed = quantile, seed
        self.kind = f"static {100 * quantile:g} % quantile, of {SAMPLES} states"
        first = drawn(model, seed, SAMPLES // 20).sum(axis=0)
        size = np.quantile(np.linalg.norm(first, axis=2), quantile, axis=1)
        super().__init__(model.subset(poses=np.argsort(size)[-_QUANTILE_POSES:]), of, now)
        self._states = drawn(self.model, seed)

    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tangents of the quantile, averaged over the states next to it."""
        rows = self._by_choice(self._additions(z)).T
        return rows[:, :-1], rows[:, -1]

    def parts(self, z: np.ndarray) -> np.ndarray:
        additions = self._additions(z) * self._ratio(z)[:, None]
        return np.asarray(additions[:, additions.sum(axis=0).argmax()])

    def _additions(self, z: np.ndarray) -> np.ndarray:
        """Share of each of the model's contributions in the quantile per factor, (k, n) [m]."""
        scale = self._ratio(z)
        total = np.einsum("j,jnsk->nsk", scale, self._states)
        size = np.linalg.norm(total, axis=2)
        order = np.argsort(size, axis=1)
        place = int(np.ceil(self.quantile * SAMPLES)) - 1
        width = max(int(0.005 * SAMPLES), 1)
        near = order[:, max(place - width, 0) : min(place + width + 1, SAMPLES)]
        poses = np.arange(self.model.poses)[:, None]
        unit = total[poses, near] / np.maximum(size[poses, near], 1e-300)[..., None]
        adds = np.einsum("jnsk,nsk->jn", self._states[:, poses, near], unit) / near.shape[1]
        # Scaled, so that they add up to the quantile itself and not to the mean about it.
        mean, exact = scale @ adds, size[poses[:, 0], order[:, place]]
        return np.asarray(adds * np.divide(exact, mean, out=np.ones_like(mean), where=mean > 0.0))


def drawn(model: ErrorModel, seed: int, count: int = SAMPLES) -> np.ndarray:
    """The tool's errors as loads of random directions push each play, (k, n, count, 3) [m]."""
    random = np.random.default_rng(seed)
    states = []
    for k in range(len(model.contributions)):
        d = random.normal(size=(1, count, 3))
        d /= np.linalg.norm(d, axis=2, keepdims=True)
        farthest = model.subset([k]).along(np.broadcast_to(d, (model.poses, count, 3)))
        states.append(farthest.error[0, ..., :3])
    return np.stack(states)


def spread(model: ErrorModel, quantile: float, seed: int) -> tuple[float, tuple[float, float]]:
    """A quantile of the error at the worst of all poses, and its 95 % interval [m].

    The interval is between order statistics, by the binomial distribution of their ranks.
    """
    size = np.sort(np.linalg.norm(drawn(model, seed).sum(axis=0), axis=2), axis=1)
    low, high = binom.ppf([0.025, 0.975], SAMPLES, quantile).astype(int)
    place = int(np.ceil(quantile * SAMPLES)) - 1
    row = size[int(size[:, place].argmax())]
    return float(row[place]), (float(row[low]), float(row[min(high, SAMPLES - 1)]))


# The choice, and its price.


@dataclass(frozen=True)
class Sizes:
    """Sizes to be chosen within limits, each as a part x of what it is now; all arrays (s,)."""

    keys: tuple[Key, ...]
    weight: np.ndarray
    """Factor of each one's price."""
    least: np.ndarray
    most: np.ndarray
    unit: np.ndarray
    """Size at x = 1 in the unit of its price: of clearances in millimetres."""
    cost: str
    """Price of unit times x, one of `COSTS`."""

    @property
    def power(self) -> int:
        """Exponent of reciprocal prices."""
        return 2 if self.cost == "reciprocal-squared" else 1

    @property
    def linear(self) -> bool:
        return self.cost == "linear"

    @cached_property
    def scaled(self) -> np.ndarray:
        """Factor of x, or of its reciprocal power, in the price."""
        return self.weight * (self.unit if self.linear else self.unit**-self.power)

    def prices(self, x: np.ndarray) -> np.ndarray:
        return self.scaled * (self.most - x if self.linear else x**-self.power)

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Derivatives of the prices by x."""
        if self.linear:
            return -self.scaled
        return -self.power * self.scaled * x ** (-self.power - 1)

    def held(self, x: np.ndarray) -> list[str]:
        """The bound that holds each size: ``least``, ``most``, or ``target``."""
        return [
            "least" if p <= low * (1.0 + 1e-6) else "most" if p >= high * (1.0 - 1e-6) else "target"
            for p, low, high in zip(x, self.least, self.most, strict=True)
        ]


class Problem:
    """The cheapest choice that keeps a target, solved by cutting planes.

    The cuts, rows . z + offsets <= target, are a growing set of poses and directions.
    """

    def __init__(
        self, error: Error, sizes: Sizes, offers: Sequence[np.ndarray], target: float, bar: Any
    ) -> None:
        """`offers` are the prices of each joint's offers; `bar` counts rounds; target in m."""
        self.error, self.sizes, self.offers, self.target = error, sizes, offers, target
        self._bar, self._count = bar, len(sizes.keys)
        self._ends = self._count + np.cumsum([0, *(len(prices) for prices in offers)])
        self._rows = np.zeros((0, self._ends[-1]))
        self._offsets, self._multipliers = np.zeros(0), np.zeros(0)
        self._tangents = np.geomspace(sizes.least, sizes.most, _TANGENTS)

    def free(self) -> np.ndarray:
        """The cheapest choice without a target: the largest sizes, the cheapest offers, (v,)."""
        return np.concatenate([self.sizes.most, *(np.eye(len(p))[p.argmin()] for p in self.offers)])

    def chosen(self, z: np.ndarray) -> list[int]:
        """Index of the offer that is bought for each joint."""
        return [int(z[a:b].argmax()) for a, b in zip(self._ends, self._ends[1:], strict=False)]

    def solve(self) -> np.ndarray:
        """The cheapest choice: sizes, and 1 for each offer that is bought, (v,)."""
        z = self.free()
        if self._add(z) <= self.target:
            return z
        if isinstance(self.error, Quantile):
            return self._solve_quantile(z)
        self._require_reachable()
        for _ in range(_ROUNDS):
            z = self._cheapest()
            if self._add(z) <= self.target * (1.0 + TOLERANCE):
                return z
        raise JointplayError("the allocation did not settle; give fewer poses, offers or causes")

    @property
    def relief(self) -> float:
        """Price saved by a target one metre wider, the sum of the cuts' multipliers [1/m]."""
        return float(self._multipliers.sum())

    def gains(self, z: np.ndarray) -> np.ndarray:
        """Error per component of the choice where the target binds, (v,) [m]."""
        known = self._rows[: len(self._multipliers)]
        if self._multipliers.any():
            return np.asarray(self._multipliers @ known / self._multipliers.sum())
        return self.error.slopes(z)

    def _add(self, z: np.ndarray) -> float:
        """Add cuts at the poses with the largest errors at z, and return the largest [m]."""
        self._bar.update()
        rows, offsets = self.error.planes(z)
        values = rows @ z + offsets
        worst = np.argsort(values)[::-1][:_CUTS]
        self._rows = np.vstack([self._rows, rows[worst]])
        self._offsets = np.append(self._offsets, offsets[worst])
        return float(values.max())

    def _require_reachable(self) -> None:
        """Refuse a target that no choice keeps at any price."""
        z = np.concatenate([self.sizes.least, *(np.eye(len(p))[0] for p in self.offers)])
        for _ in range(_ROUNDS):
            if self._add(z) <= self.target:
                return
            if not self.error.convex:
                break
            # Shifts by different loads may cancel: then the smallest sizes are not the best.
            z, bound = self._least()
            if bound > self.target:
                raise Unreachable(self.target, bound, z)
        raise Unreachable(self.target, max(self.error.at(z), self.target), z)

    def _least(self) -> tuple[np.ndarray, float]:
        """The choice with the least error on the known cuts, and this error [m]."""
        column = np.ones((len(self._rows), 1))
        solution = self._mixed_integer(
            np.append(np.zeros(self._ends[-1]), 1.0),
            np.hstack([self._rows / self.target, -column]),
            -self._offsets / self.target,
        )
        return solution[:-1], float(solution[-1]) * self.target

    def _mixed_integer(self, price: np.ndarray, rows: np.ndarray, slack: np.ndarray) -> np.ndarray:
        """The (z, y) of least price with rows . (z, y) <= slack and one offer for each joint.

        y >= 0 are as many further variables as `price` has.
        """
        more = len(price) - self._ends[-1]
        low = np.concatenate([self.sizes.least, np.zeros(len(price) - self._count)])
        ones = np.ones(self._ends[-1] - self._count)
        high = np.concatenate([self.sizes.most, ones, np.full(more, np.inf)])
        limits = [LinearConstraint(rows, -np.inf, slack)]
        for first, end in zip(self._ends, self._ends[1:], strict=False):
            row = np.zeros((1, len(price)))
            row[0, first:end] = 1.0
            limits.append(LinearConstraint(row, 1.0, 1.0))
        discrete = np.concatenate([np.zeros(self._count), ones, np.zeros(more)])
        result = milp(
            price, constraints=limits, integrality=discrete, bounds=Bounds(low, high),
            options={"presolve": False},  # which prints where it had been wrong
        )  # fmt: skip
        assert result.x is not None  # targets that cannot be reached have been refused before
        return np.clip(result.x, low, high)

    def _cheapest(self) -> np.ndarray:
        """The cheapest choice on the known cuts, by outer approximation: offers by tangents of the
        sizes' prices, then the sizes to these offers, until offers repeat.
        """
        if not self.offers:
            return self._cheapest_sizes(np.zeros(0))
        tried: dict[tuple[int, ...], tuple[float, np.ndarray]] = {}
        while True:
            picked = self._cheapest_offers()
            key = tuple(self.chosen(picked))
            if key in tried:
                return min(tried.values(), key=lambda entry: entry[0])[1]
            z = self._cheapest_sizes(picked[self._count :].round())
            tried[key] = self.price(z), z
            if not self._count:
                return z
            self._tangents = np.vstack([self._tangents, z[: self._count]])

    def price(self, z: np.ndarray) -> float:
        """Price of a choice."""
        x, picked = z[: self._count], z[self._count :]
        return float(self.sizes.prices(x).sum() + np.concatenate([[], *self.offers]) @ picked)

    def _cheapest_offers(self) -> np.ndarray:
        """The cheapest choice on the known cuts, with tangents for the prices of sizes."""
        prices, row = np.concatenate(self.offers), self._rows[-1, self._count :]
        prices = prices + _TIE * prices.max() * row / max(row.max(), 1e-300)
        rows, slack = self._rows / self.target, 1.0 - self._offsets / self.target
        k = self._count
        if self.sizes.linear or not k:
            solution = self._mixed_integer(np.append(-self.sizes.scaled, prices), rows, slack)
        else:  # a further variable for each size: its price, above all tangents
            slopes = np.array([self.sizes.slopes(x) for x in self._tangents])
            at = np.array([self.sizes.prices(x) for x in self._tangents])
            count, total = len(slopes), self._ends[-1] + k
            cuts = np.zeros((count, k, total))
            cuts[:, np.arange(k), np.arange(k)] = slopes / at
            cuts[:, np.arange(k), self._ends[-1] + np.arange(k)] = -1.0 / at
            left = slopes * self._tangents / at - 1.0
            solution = self._mixed_integer(
                np.concatenate([np.zeros(k), prices, np.ones(k)]),
                np.vstack([np.hstack([rows, np.zeros((len(rows), k))]), cuts.reshape(-1, total)]),
                np.append(slack, left.ravel()),
            )
        return solution[: self._ends[-1]]

    def _cheapest_sizes(self, picked: np.ndarray) -> np.ndarray:
        """The choice of cheapest sizes on the known cuts with these offers (0 or 1), (v,)."""
        k = self._count
        if not k:
            return picked
        rows = self._rows[:, :k] / self.target
        slack = 1.0 - (self._offsets + self._rows[:, k:] @ picked) / self.target
        solve = self._by_linear_program if self.sizes.linear else self._by_dual
        x, multipliers = solve(rows, slack)
        self._multipliers = multipliers / self.target
        return np.append(x, picked)

    def _by_linear_program(
        self, rows: np.ndarray, slack: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Sizes of least linear price with rows . x <= slack, and the rows' multipliers."""
        sizes = self.sizes
        # The solver's tolerances are absolute: sizes are scaled by the largest each could have.
        alone = (slack[:, None] / np.maximum(rows, 1e-12)).min(axis=0)
        unit = np.clip(alone, sizes.least, sizes.most)
        largest = float((sizes.scaled * unit).max())
        result = linprog(
            -sizes.scaled * unit / largest,
            A_ub=rows * unit,
            b_ub=slack,
            bounds=np.column_stack([sizes.least / unit, sizes.most / unit]),
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10},
        )
        if not result.success:
            raise JointplayError(f"no clearances meet the target: {result.message}")
        x = np.clip(result.x * unit, sizes.least, sizes.most)
        return x, -result.ineqlin.marginals * largest

    def _by_dual(self, rows: np.ndarray, slack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sizes of least price w x^-p with rows R . x <= slack, and the rows' multipliers y.

        The dual problem has bounds only: given y, each size is (p w / (R' y))^(1 / (p + 1)), or the
        nearer of its limits.
        """
        sizes, power = self.sizes, self.sizes.power
        total = sizes.scaled.sum()
        unit = sizes.scaled / total

        def best(multiplier: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            slope = multiplier @ rows
            x = (power * unit / np.maximum(slope, 1e-12)) ** (1.0 / (power + 1))
            return np.clip(x, sizes.least, sizes.most), slope

        def dual(multiplier: np.ndarray) -> tuple[float, np.ndarray]:
            x, slope = best(multiplier)
            value = float((unit * x**-power + slope * x).sum() - multiplier @ slack)
            return -value, slack - rows @ x

        start = np.zeros(len(rows))
        known = self._multipliers * self.target / total
        start[: len(known)] = known
        result = minimize(
            dual, start, jac=True, method="L-BFGS-B", bounds=[(0.0, None)] * len(rows),
            options={"maxiter": 5000, "maxfun": 20000, "ftol": 1e-16, "gtol": 1e-10, "maxcor": 30},
        )  # fmt: skip
        x = best(result.x)[0]
        return np.where(x > sizes.most * (1.0 - 1e-9), sizes.most, x), result.x * total

    def _solve_quantile(self, z: np.ndarray) -> np.ndarray:
        """The cheapest sizes for a quantile, by its tangents, as it is not convex."""
        least, most = self.sizes.least, self.sizes.most
        if (reached := self.error.at(least)) > self.target:
            raise Unreachable(self.target, reached, least)
        for _ in range(_QUANTILE_ROUNDS):
            # Errors are nearly proportional to the sizes: begin on the target.
            start = np.maximum(z * self.target / self.error.at(z), least)
            rows, self._offsets = self.error.planes(start)
            self._offsets = np.minimum(self._offsets, (1.0 - 1e-3) * self.target)
            self._rows, self._multipliers = rows, np.zeros(0)
            z = np.sqrt(start * self._cheapest_sizes(np.zeros(0)))  # half of the way there
        for _ in range(4):
            z = np.clip(z * self.target / self.error.at(z), least, most)
        return z


@dataclass(eq=False)
class Unreachable(Exception):
    """A target that no choice keeps."""

    target: float
    """The target [m]."""
    bound: float
    """The least error that a choice leaves [m]."""
    z: np.ndarray
    """That choice, (v,)."""
