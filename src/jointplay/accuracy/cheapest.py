"""The cheapest sizes and offers with which the tool's error keeps a target, at all poses.

The error (`error_model`) is convex in what its contributions are multiplied by: at a pose and along
a direction the worst case is linear in them, as support functions add; the root mean square is the
root of a quadratic form, as variances add and loads shift. So what keeps a target at all poses
makes a convex set, and a convex price has one minimum on it. It is found by cutting planes: the
problem is solved for the poses and directions known to bind, the worst ones of the solution are
added, and so on until none is worse than the target.

- Sizes are any numbers within limits. Their price is convex; the dual of the problem, which has
  bounds only, is solved by L-BFGS-B, or by HiGHS where the price is linear.
- Of offers one is chosen in each group: integer programming (HiGHS), for which prices of sizes are
  replaced by tangents, more of them until the choice stays (outer approximation: Duran and
  Grossmann, Mathematical Programming 36, 1986, 307).

Where plays of a loop hold each other the worst case is concave in the clearances: a plane found at
some of them is too strict for others. What is found keeps the target; it need not be the cheapest.
A quantile is not convex either: it supposes that each journal rests, independently of the others,
where a load on the tool of random direction puts it.
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
"""What a size c costs, times its weight: 1/c, 1/c^2, or what the largest has more."""
SAMPLES = 4000
"""States drawn for a quantile."""
FITS = 1e-8
"""Part of the target by which an error may miss it."""
_QUANTILE_POSES, _QUANTILE_ROUNDS = 12, 8
"""Poses with the largest errors, at which states are drawn, for at all it would take long; rounds,
each of which halves what is left on the way to the cheapest sizes (judged)."""
_DIRECTIONS_TIED = 60
"""Over half a sphere, where plays hold each other: each is a search, in every round anew."""
_NEAR = 0.98
"""Part of the largest error from which on poses are looked at closely: the sphere's directions are
about 7 degrees apart, which hides 0.7 %."""
_ROUNDS, _CUTS = 100, 12
"""Most rounds of cutting planes, after which a target is refused; worst poses added in each."""
_TANGENTS = 16
"""To begin with, of each price."""
_TIE = 1e-6
"""Part of the largest price by which of equal prices the tighter offer is chosen."""

Key = tuple[str, str]

# The error as a function of what can be chosen: sizes x, a number from 0 to 1 of each offer, and 1
# of all that stays.


class Error(ABC):
    """The largest error of all poses by what is chosen, and planes that touch it."""

    convex = True

    def __init__(self, model: ErrorModel, of: Sequence[int], now: np.ndarray) -> None:
        """Of a model with choices of sizes `now` (v,); `of` is each contribution's, or -1."""
        self.model, self.of = model, np.array(of, int)
        self._unit = np.append(1.0 / now, 1.0)[self.of]

    @abstractmethod
    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The error as rows . z + offsets, exact at z and nowhere above it; (m, v), (m,) [m].

        Of m poses: all, or those that may have the largest error.
        """

    @abstractmethod
    def parts(self, z: np.ndarray) -> np.ndarray:
        """What each contribution adds where the error is largest, (k,) [m]."""

    def at(self, z: np.ndarray) -> float:
        """The error [m]."""
        rows, offsets = self.planes(z)
        return float((rows @ z + offsets).max())

    def slopes(self, z: np.ndarray) -> np.ndarray:
        """How the largest error grows with each choice, (v,) [m]."""
        rows, offsets = self.planes(z)
        return np.asarray(rows[(rows @ z + offsets).argmax()])

    def _ratio(self, z: np.ndarray) -> np.ndarray:
        """What contributions as they are must be multiplied by, (k,)."""
        return np.asarray(np.append(z, 1.0)[self.of] * self._unit)

    def _by_choice(self, values: np.ndarray, count: int) -> np.ndarray:
        """Sums over contributions (k, ...) of each choice and of what stays, (v + 1, ...)."""
        sums = np.zeros((count, *values.shape[1:]))
        weighted = values * self._unit.reshape(-1, *[1] * (values.ndim - 1))
        np.add.at(sums, self.of % count, weighted)
        return sums


class WorstCase(Error):
    """The largest distance of the tool at all."""

    def __init__(self, model: ErrorModel, of: Sequence[int], now: np.ndarray) -> None:
        super().__init__(model, of, now)
        self.convex, self._count = not model.tied, len(now) + 1
        self._sphere = half_sphere(_DIRECTIONS_TIED) if model.tied else model.sphere
        self._grids: dict[int, np.ndarray] = {}

    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Along the worst direction of each pose."""
        ratio = self._ratio(z)
        (counting,) = np.nonzero(ratio)
        scaled = self.model.scaled(self.model.scale * ratio)
        total = self._around(z) if self.convex else scaled.values(self._sphere).sum(axis=0)
        size = total.max(axis=1)
        (near,) = np.nonzero(size >= _NEAR * size.max())
        start = self._sphere[total[near].argmax(axis=1)]
        d = scaled.subset(counting, near).climb(start)[:, None]
        if self.convex:
            parts = self.model.subset(poses=near).along(d).value[..., 0]
        else:
            parts = scaled.subset(poses=near).along(d).value[..., 0] / ratio[:, None]
        rows = self._by_choice(parts, self._count).T
        self._worst = parts[:, int((rows @ np.append(z, 1.0)).argmax())]
        return rows[:, :-1], rows[:, -1]

    def _around(self, z: np.ndarray) -> np.ndarray:
        """The error at all poses along all directions, (n, m): sums of what each choice does."""
        total = np.zeros((self.model.poses, len(self._sphere)))
        for k, part in enumerate(np.append(z, 1.0)):
            (members,) = np.nonzero(self.of % self._count == k)
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

    def __init__(self, model: ErrorModel, of: Sequence[int], now: np.ndarray) -> None:
        if model.tied:
            raise JointplayError(
                "variances do not add where joints of closed loops hold each other: allocate by "
                "the worst case, or give the loops joints that do not (kind 'planar', balls)"
            )
        super().__init__(model, of, now)
        count = len(now) + 1
        self._means = self._by_choice(model.means, count)
        variances = np.trace(model.covariances, axis1=2, axis2=3)
        self._variances = self._by_choice(variances * self._unit[:, None], count)

    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By the derivative of the root of a quadratic form."""
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
    """The largest distance that a part of all states of the journals keeps to.

    A state is drawn at the poses that matter; the result is judged at all of them (`spread`).
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
        self.quantile, self.seed, self._count = quantile, seed, len(now) + 1
        first = drawn(model, seed, SAMPLES // 20).sum(axis=0)
        size = np.quantile(np.linalg.norm(first, axis=2), quantile, axis=1)
        super().__init__(model.subset(poses=np.argsort(size)[-_QUANTILE_POSES:]), of, now)
        self._states = drawn(self.model, seed)

    def planes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The mean over states about the quantile of what each adds along the error."""
        rows = self._by_choice(self._additions(z), self._count).T
        return rows[:, :-1], rows[:, -1]

    def parts(self, z: np.ndarray) -> np.ndarray:
        additions = self._additions(z) * self._ratio(z)[:, None]
        return np.asarray(additions[:, additions.sum(axis=0).argmax()])

    def _additions(self, z: np.ndarray) -> np.ndarray:
        """What each contribution as it is adds at each pose, (k, n)."""
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
        mean, exact = scale @ adds, size[poses[:, 0], order[:, place]]
        return np.asarray(adds * np.divide(exact, mean, out=np.ones_like(mean), where=mean > 0.0))


def drawn(model: ErrorModel, seed: int, count: int = SAMPLES) -> np.ndarray:
    """The tool's errors where loads of random directions put each play, (k, n, count, 3) [m]."""
    random = np.random.default_rng(seed)
    states = []
    for k in range(len(model.contributions)):
        d = random.normal(size=(1, count, 3))
        d /= np.linalg.norm(d, axis=2, keepdims=True)
        farthest = model.subset([k]).along(np.broadcast_to(d, (model.poses, count, 3)))
        states.append(farthest.error[0, ..., :3])
    return np.stack(states)


def spread(model: ErrorModel, quantile: float, seed: int) -> tuple[float, tuple[float, float]]:
    """A quantile of the error at the worst of all poses, and its 95 % interval [m]."""
    size = np.sort(np.linalg.norm(drawn(model, seed).sum(axis=0), axis=2), axis=1)
    low, high = binom.ppf([0.025, 0.975], SAMPLES, quantile).astype(int)
    place = int(np.ceil(quantile * SAMPLES)) - 1
    row = size[int(size[:, place].argmax())]
    return float(row[place]), (float(row[low]), float(row[min(high, SAMPLES - 1)]))


# What is to be chosen, and what it costs.


@dataclass(frozen=True)
class Sizes:
    """What can have any size within limits, as a part x of what it is."""

    keys: tuple[Key, ...]
    weight: np.ndarray
    least: np.ndarray
    most: np.ndarray
    unit: np.ndarray
    """What x = 1 counts in the price; of clearances millimetres."""
    cost: str
    """One of `COSTS`, of unit times x."""

    @property
    def power(self) -> int:
        return 2 if self.cost == "reciprocal-squared" else 1

    @property
    def linear(self) -> bool:
        return self.cost == "linear"

    @cached_property
    def scaled(self) -> np.ndarray:
        return self.weight * (self.unit if self.linear else self.unit**-self.power)

    def prices(self, x: np.ndarray) -> np.ndarray:
        return self.scaled * (self.most - x if self.linear else x**-self.power)

    def slopes(self, x: np.ndarray) -> np.ndarray:
        if self.linear:
            return -self.scaled
        return -self.power * self.scaled * x ** (-self.power - 1)

    def held(self, x: np.ndarray) -> list[str]:
        """What holds each: ``least``, ``most``, or ``target``."""
        return [
            "least" if p <= low * (1.0 + 1e-6) else "most" if p >= high * (1.0 - 1e-6) else "target"
            for p, low, high in zip(x, self.least, self.most, strict=True)
        ]


class Problem:
    """The cheapest choice on a growing set of poses and directions."""

    def __init__(
        self, error: Error, sizes: Sizes, offers: Sequence[np.ndarray], target: float, bar: Any
    ) -> None:
        """Error by sizes, then offers; prices of each joint's offers; target [m]."""
        self.error, self.sizes, self.offers, self.target = error, sizes, offers, target
        self._bar, self._count = bar, len(sizes.keys)
        self._ends = self._count + np.cumsum([0, *(len(prices) for prices in offers)])
        self._rows = np.zeros((0, self._ends[-1]))
        self._offsets, self._multipliers = np.zeros(0), np.zeros(0)
        self._tangents = np.geomspace(sizes.least, sizes.most, _TANGENTS)

    def free(self) -> np.ndarray:
        return np.concatenate([self.sizes.most, *(np.eye(len(p))[p.argmin()] for p in self.offers)])

    def chosen(self, z: np.ndarray) -> list[int]:
        return [int(z[a:b].argmax()) for a, b in zip(self._ends, self._ends[1:], strict=False)]

    def solve(self) -> np.ndarray:
        """The cheapest sizes, and a one for each offer that is taken, (v,)."""
        z = self.free()
        if self._add(z) <= self.target:
            return z
        if isinstance(self.error, Quantile):
            return self._solve_quantile(z)
        self._require_reachable()
        for _ in range(_ROUNDS):
            z = self._cheapest()
            if self._add(z) <= self.target * (1.0 + FITS):
                return z
        raise JointplayError("the allocation did not settle; give fewer poses, offers or causes")

    @property
    def relief(self) -> float:
        """Price saved by a target one metre wider [1/m]."""
        return float(self._multipliers.sum())

    def gains(self, z: np.ndarray) -> np.ndarray:
        """Error per choice where the target binds, (v,) [m]."""
        known = self._rows[: len(self._multipliers)]
        if self._multipliers.any():
            return np.asarray(self._multipliers @ known / self._multipliers.sum())
        return self.error.slopes(z)

    def _add(self, z: np.ndarray) -> float:
        """Take into account where the error is largest; the error there [m]."""
        self._bar.update()
        rows, offsets = self.error.planes(z)
        values = rows @ z + offsets
        worst = np.argsort(values)[::-1][:_CUTS]
        self._rows = np.vstack([self._rows, rows[worst]])
        self._offsets = np.append(self._offsets, offsets[worst])
        return float(values.max())

    def _require_reachable(self) -> None:
        """Refuse a target that no choice keeps, whatever it costs."""
        z = np.concatenate([self.sizes.least, *(np.eye(len(p))[0] for p in self.offers)])
        for _ in range(_ROUNDS):
            if self._add(z) <= self.target:
                return
            if not self.error.convex:
                break
            # Where loads shift the tool against each other, the least need not be the best.
            z, bound = self._least()
            if bound > self.target:
                raise Unreachable(self.target, bound, z)
        raise Unreachable(self.target, max(self.error.at(z), self.target), z)

    def _least(self) -> tuple[np.ndarray, float]:
        """The choice with the least error by what is known, and this error [m]."""
        column = np.ones((len(self._rows), 1))
        solution = self._integers(
            np.append(np.zeros(self._ends[-1]), 1.0),
            np.hstack([self._rows / self.target, -column]),
            -self._offsets / self.target,
        )
        assert solution is not None
        return solution[:-1], float(solution[-1]) * self.target

    def _integers(
        self, price: np.ndarray, rows: np.ndarray, slack: np.ndarray
    ) -> np.ndarray | None:
        """The cheapest choice with rows . (z, more) <= slack; None: there is none."""
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
        return None if result.x is None else np.clip(result.x, low, high)

    def _cheapest(self) -> np.ndarray:
        if not self.offers:
            return self._sized(np.zeros(0))
        tried: dict[tuple[int, ...], tuple[float, np.ndarray]] = {}
        while True:
            picked = self._chosen_offers()
            key = tuple(self.chosen(picked))
            if key in tried:
                return min(tried.values(), key=lambda entry: entry[0])[1]
            z = self._sized(picked[self._count :].round())
            tried[key] = self.price(z), z
            if not self._count:
                return z
            self._tangents = np.vstack([self._tangents, z[: self._count]])

    def price(self, z: np.ndarray) -> float:
        x, picked = z[: self._count], z[self._count :]
        return float(self.sizes.prices(x).sum() + np.concatenate([[], *self.offers]) @ picked)

    def _chosen_offers(self) -> np.ndarray:
        prices, row = np.concatenate(self.offers), self._rows[-1, self._count :]
        prices = prices + _TIE * prices.max() * row / max(row.max(), 1e-300)
        rows, slack = self._rows / self.target, 1.0 - self._offsets / self.target
        k = self._count
        if self.sizes.linear or not k:
            solution = self._integers(np.append(-self.sizes.scaled, prices), rows, slack)
        else:  # one more number for each size: its price, above all tangents
            slopes = np.array([self.sizes.slopes(x) for x in self._tangents])
            at = np.array([self.sizes.prices(x) for x in self._tangents])
            count, total = len(slopes), self._ends[-1] + k
            cuts = np.zeros((count, k, total))
            cuts[:, np.arange(k), np.arange(k)] = slopes / at
            cuts[:, np.arange(k), self._ends[-1] + np.arange(k)] = -1.0 / at
            left = slopes * self._tangents / at - 1.0
            solution = self._integers(
                np.concatenate([np.zeros(k), prices, np.ones(k)]),
                np.vstack([np.hstack([rows, np.zeros((len(rows), k))]), cuts.reshape(-1, total)]),
                np.append(slack, left.ravel()),
            )
        assert solution is not None
        return solution[: self._ends[-1]]

    def _sized(self, picked: np.ndarray) -> np.ndarray:
        """The cheapest sizes with these offers (0 or 1), and the offers."""
        k, sizes = self._count, self.sizes
        rows = self._rows[:, :k] / self.target
        slack = 1.0 - (self._offsets + self._rows[:, k:] @ picked) / self.target
        if not k:
            return picked
        solve = self._linear if sizes.linear else self._dual
        x, multipliers = solve(rows, slack)
        self._multipliers = multipliers / self.target
        return np.append(x, picked)

    def _linear(self, rows: np.ndarray, slack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sizes = self.sizes
        # The solver's tolerances are absolute: in parts of what each could have alone.
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

    def _dual(self, rows: np.ndarray, slack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By the dual, which has bounds only: with multipliers y of the rows R, each size is
        (p w / (R' y))^(1 / (p + 1)) within its limits.
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
        """A quantile is not convex: what holds near the last sizes is solved."""
        least, most = self.sizes.least, self.sizes.most
        if (reached := self.error.at(least)) > self.target:
            raise Unreachable(self.target, reached, least)
        for _ in range(_QUANTILE_ROUNDS):
            # All errors are nearly proportional to the sizes.
            start = np.maximum(z * self.target / self.error.at(z), least)
            rows, self._offsets = self.error.planes(start)
            self._offsets = np.minimum(self._offsets, (1.0 - 1e-3) * self.target)
            self._rows, self._multipliers = rows, np.zeros(0)
            z = np.sqrt(start * self._sized(np.zeros(0)))
        for _ in range(4):
            z = np.clip(z * self.target / self.error.at(z), least, most)
        return z


@dataclass(eq=False)
class Unreachable(Exception):
    """A target that no choice keeps."""

    target: float
    """[m]."""
    bound: float
    """The error that is left [m]."""
    z: np.ndarray
