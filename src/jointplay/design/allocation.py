"""Which clearances may be how large: the cheapest ones that keep the tool within its tolerance.

On the static model (`budget`), in the first order of the clearances: the worst case at a pose and
along a direction is then a sum over joints, linear in their clearances, so that all clearances that
keep a target make a convex set, and a convex cost has one minimum on it. It is found by cutting
planes: the convex problem is solved for the poses and directions known to bind, the worst ones of
the solution are added, and so on until none is worse than the target. A joint's axial clearance
keeps its ratio to the radial one.

Where plays of a loop hold each other the worst case is concave in the clearances: a plane found at
some of them is too strict for others. What is found keeps the target; it need not be the cheapest.

The quantile supposes that each journal rests, independently of the others, where a load on the tool
of random direction puts it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog, minimize, nnls
from scipy.stats import binom

from jointplay.core.errors import (
    JointplayError,
    MissingName,
    require_a,
    require_positive,
    require_share,
    require_whole,
)
from jointplay.core.progress import ProgressBar
from jointplay.core.tables import Column, Table
from jointplay.core.units import readable
from jointplay.design.levers import PlaySources, sources
from jointplay.design.static_budget import budget, half_sphere
from jointplay.mechanism.mechanism import Mechanism

COSTS = ("reciprocal", "reciprocal-squared", "linear")
"""What a clearance c [mm] costs, times its weight: 1/c, 1/c^2, or what `most` has more."""
LEAST_M, MOST_M = 2e-6, 1e-3
"""Clearances that can be bought, unless others are given [m]."""
SAMPLES = 4000
"""States drawn for a quantile."""
_MM = 1e3
"""Costs are of clearances in millimetres."""
_QUANTILE_POSES = 12
PATIENCE_S = 2.0
"""What takes longer has a bar [s]."""
_DIRECTIONS_TIED = 60
"""Over half a sphere, where plays hold each other: each is a search, in every round anew."""
_ROUNDS, _QUANTILE_ROUNDS = 80, 8
_REFINEMENTS = 5
_EXACT = 2e-5
_CLOSE = 0.9995
"""Part of the target that must be used up, second order included."""


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
        self._bar = ProgressBar(
            desc="allocating", unit="round", disable=not progress, delay=PATIENCE_S, leave=False
        )
        self.names = allocated(mechanism)
        self.nominal = np.array([mechanism.clearance[name].radial_room for name in self.names])
        every = sources(mechanism, poses, second_order=False, driven=driven, loops=True)
        without = {*mechanism.clearance} - {*self.names}
        self.sources = every.subset([i for i, n in enumerate(every.names) if n not in without])
        self.j = len(self.names)
        if self.sources.tied and quantile is not None:
            raise JointplayError(
                "a quantile is defined for journals that rest independently of each other, but "
                "journals that tilt in a loop constrain each other: use the worst case, or kind "
                "'planar'"
            )
        if quantile is None:
            self._half = half_sphere(_DIRECTIONS_TIED) if self.sources.tied else half_sphere()
            # Per unit of clearance; then what gears add.
            self._grid = self._gains(np.ones(len(self.sources.names)))
        else:
            # A state is drawn at the poses that matter; the result is judged at all of them.
            first = self._draw(self.sources, SAMPLES // 20).sum(axis=0)
            size = np.quantile(np.linalg.norm(first, axis=2), quantile, axis=1)
            self.sources = self.sources.subset(poses=np.argsort(size)[-_QUANTILE_POSES:])
            self._states = self._draw(self.sources)

    @property
    def n(self) -> int:
        """Poses that are looked at."""
        return self.sources.move.shape[1]

    def _draw(self, plays: PlaySources, count: int = SAMPLES) -> np.ndarray:
        """States of each source under loads of random directions, (sources, n, count, 3) [m]."""
        random = np.random.default_rng(self.seed)
        states = []
        for j in range(len(plays.names)):
            d = random.normal(size=(1, count, 3))
            d /= np.linalg.norm(d, axis=2, keepdims=True)
            shape = (plays.move.shape[1], count, 3)
            found = plays.subset([j]).along(np.broadcast_to(d, shape))
            states.append(found.error[0, ..., :3])
        return np.stack(states)

    def _gains(self, scale: np.ndarray) -> np.ndarray:
        """Error along each direction at each pose, by clearance: (n, directions, sources)."""
        directions = np.broadcast_to(self._half, (self.n, *self._half.shape))
        return np.moveaxis(self._per_clearance(directions, scale), 0, 2)

    def _per_clearance(self, directions: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """The same along directions (n, m, 3), (sources, n, m); what gears add, as it is."""
        gains = self.sources.along(directions, scale=scale).value / scale[:, None, None]
        gains[: self.j] /= self.nominal[:, None, None]
        return gains

    def with_clearance(self, clearance: np.ndarray) -> Mechanism:
        """The mechanism with these clearances."""
        factors = clearance / self.nominal
        joints = self.mechanism.clearance
        pairs = zip(self.names, factors, strict=True)
        scaled = {name: joints[name].scaled(float(factor)) for name, factor in pairs}
        return self.mechanism.with_clearance({**joints, **scaled})

    def error(self, clearance: np.ndarray) -> float:
        """Largest error of all poses [m]."""
        rows, offsets = self.rows(clearance)
        return float((rows @ clearance + offsets).max())

    def rows(self, clearance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The error at each pose as rows . clearance + offsets, exact here: (n, j), (n,)."""
        scale = np.append(clearance / self.nominal, np.ones(len(self.sources.names) - self.j))
        self._bar.update()
        return self._worst(scale) if self.quantile is None else self._at_quantile(scale)

    def _worst(self, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        per_unit = np.append(scale[: self.j] * self.nominal, scale[self.j :])
        grid = self._gains(scale) if self.sources.tied else self._grid
        best = (grid @ per_unit).argmax(axis=1)
        d = self.sources.climb(self._half[best], _REFINEMENTS, scale=scale)
        values = self._per_clearance(d[:, None], scale)[:, :, 0].T
        return values[:, : self.j], values[:, self.j :].sum(axis=1)

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
        plays = sources(mechanism, self.poses, driven=self.driven, loops=True)
        size = np.sort(np.linalg.norm(self._draw(plays).sum(axis=0), axis=2), axis=1)
        low, high = binom.ppf([0.025, 0.975], SAMPLES, self.quantile).astype(int)
        place = int(np.ceil(self.quantile * SAMPLES)) - 1
        worst = int(size[:, place].argmax())
        row = size[worst]
        return float(row[place]), (float(row[low]), float(row[min(high, SAMPLES - 1)]))


@dataclass(frozen=True)
class AllocationProblem:
    """Cost and limits of the clearances."""

    cost: str
    weight: np.ndarray
    least: float
    most: float

    def value(self, c: np.ndarray) -> float:
        """Cost of clearances c [m]."""
        if self.cost == "linear":
            return float(self.weight @ (self.most - c)) * _MM
        return float(self.weight @ (1.0 / (_MM * c) ** self._power))

    def slope(self, c: np.ndarray) -> np.ndarray:
        """Derivative of the cost by each clearance [1/m]."""
        if self.cost == "linear":
            return -self.weight * _MM
        return -self._power * self.weight / ((_MM * c) ** self._power * c)

    @property
    def _power(self) -> int:
        """Of 1/c."""
        return 2 if self.cost == "reciprocal-squared" else 1

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
                raise JointplayError(f"no clearances meet the target: {optimum.message}")
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


@dataclass(frozen=True)
class Allocation:
    """Clearances that keep a target, of j joints."""

    target: float
    """Largest error of the tool [m]."""
    quantile: float | None
    """Part of all states that keep it; None: all."""
    cost: str
    """How clearances are paid for."""
    joints: tuple[str, ...]
    clearance: np.ndarray
    """Radial (across x, of a slider), shape (j,) [m]."""
    error: float
    """What they lead to, by the static model with its second order [m]."""
    spread: tuple[float, float]
    """95 % interval of a quantile, for it is of samples; of a worst case, the value itself [m]."""
    total: float
    """Cost of all."""
    gain: np.ndarray
    """Error per clearance of each joint, where the target binds, shape (j,)."""
    price: np.ndarray
    """What the last micrometre of each joint costs: cost saved by one more, (j,) [1/um]."""
    relief: float
    """Cost saved by a target one micrometre wider [1/um]."""
    bound: tuple[str, ...]
    """For each joint: ``least``, ``most``, or ``""`` where the target decides."""
    mechanism: Mechanism
    """With these clearances."""

    @property
    def kind(self) -> str:
        """Worst case or quantile, in words."""
        if self.quantile is None:
            return "static worst case"
        return f"static {100 * self.quantile:g} % quantile, of {SAMPLES} states"

    @property
    def table(self) -> Table:
        """A row for each joint."""
        low, high = self.spread
        interval = f" (95 %: {1e6 * low:.2f} to {1e6 * high:.2f})" if high > low else ""
        return Table(
            (
                Column("joint", self.joints),
                Column("clearance", self.clearance, "m", fine=True),
                Column("error per clearance", self.gain),
                Column("adds", self.gain * self.clearance, "m", fine=True),
                Column("a um more saves", self.price, key="saved_by_a_micrometre"),
                Column("held by", [one or "target" for one in self.bound]),
            ),
            notes=(
                f"{self.kind}: {1e6 * self.error:.2f} um{interval} of {1e6 * self.target:.2f} um; "
                f"cost {self.total:.5g} ({self.cost}); a target one um wider saves "
                f"{self.relief:.4g}",
            ),
        )

    def __str__(self) -> str:
        """The table."""
        return str(self.table)


def allocate(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    target: float,
    *,
    quantile: float | None = None,
    cost: str = COSTS[0],
    weights: Mapping[str, float] | None = None,
    least: float = LEAST_M,
    most: float = MOST_M,
    seed: int = 0,
    driven: Sequence[str] | None = None,
    progress: bool = False,
) -> Allocation:
    """The cheapest clearances with which the tool's error stays below `target` at all poses.

    Args:
        mechanism: its joints with clearance are those to decide on; their sizes set the ratio of
            axial to radial clearance. The play of gears, and what has none, stay as they are.
        poses: as for `budget`.
        target: largest distance of the tool from the ideal one [m].
        quantile: the part of states that must keep it, such as 0.99; None: the worst case.
        cost: one of `COSTS`.
        weights: of the joints' costs, by name; one where not given.
        least, most: clearances that can be bought [m].
        seed: of the sampled states.
        driven: joints of loops that stand; see `budget`.
        progress: show a count of the rounds on standard error, if it takes long.

    Raises:
        JointplayError: a target that the least clearances miss, which says what can be reached;
            values that cannot be; rolling bearings.
        MissingName: no such cost or joint.
    """
    require_a("mechanism", mechanism, "Mechanism")
    names = allocated(mechanism)
    _refuse_rolling(mechanism)
    _check(names, target, quantile, cost, weights or {}, least, most)
    weight = np.array([(weights or {}).get(name, 1.0) for name in names])
    seed = require_whole("seed", seed)
    model = ErrorModel(mechanism, poses, quantile, seed, driven, progress)
    problem = AllocationProblem(cost, weight, least, most)
    smallest = model.error(np.full(len(names), least))
    if smallest > target:
        raise JointplayError(
            f"a target of {1e6 * target:.4g} um cannot be reached: with {1e6 * least:.4g} um in "
            f"every joint the error is {1e6 * smallest:.4g} um already"
        )
    aim = target
    for _ in range(4 if quantile else 6):
        clearances, rows, offsets = _solve(model, problem, aim)
        true, spread = _true_error(model, clearances)
        if _CLOSE * target <= true <= target or (clearances >= most * (1 - 1e-9)).all():
            break
        aim *= 0.5 * (1.0 + _CLOSE) * target / true
    slack = aim - rows @ clearances - offsets
    binding = np.flatnonzero(slack < 1e-3 * target)
    price, multipliers = problem.duals(clearances, rows[binding])
    total = multipliers.sum()
    gain = multipliers @ rows[binding] / total if total > 0.0 else rows[np.argmin(slack)]
    bound = tuple(
        "least" if c <= least * (1 + 1e-6) else "most" if c >= most * (1 - 1e-6) else ""
        for c in clearances
    )
    return Allocation(
        target,
        quantile,
        cost,
        names,
        clearances,
        true,
        spread,
        problem.value(clearances),
        gain,
        price * 1e-6,
        float(total) * 1e-6,
        bound,
        model.with_clearance(clearances),
    )


def allocated(mechanism: Mechanism) -> tuple[str, ...]:
    """Joints that have clearance to allocate; those that springs hold have none."""
    return tuple(name for name, joint in mechanism.clearance.items() if joint.clearances)


def _refuse_rolling(mechanism: Mechanism) -> None:
    joints, names = mechanism.clearance, allocated(mechanism)
    if joints and not names:
        name, joint = next(iter(joints.items()))
        raise JointplayError(f"joint {name!r} is {joint.kind}: it has no clearance to allocate")
    rolling = [name for name in names if joints[name].resultant is not None]
    if rolling:
        raise JointplayError(
            f"the clearance of rolling bearings cannot be allocated ({', '.join(rolling)}): they "
            "are bought in classes, and their play along the axis and in tilt is not proportional "
            "to their radial clearance; choose classes with allocate_classes, or "
            f"jointplay allocate --joint {rolling[0]}=6010"
        )


def _check(
    names: tuple[str, ...],
    target: float,
    quantile: float | None,
    cost: str,
    weights: Mapping[str, float],
    least: float,
    most: float,
) -> None:
    """Refuse what `allocate` cannot work on."""
    require_positive("target", target, "m")
    if quantile is not None:
        require_share("the quantile", quantile)
    if cost not in COSTS:
        raise MissingName("cost", cost, COSTS)
    if quantile is not None and cost == "linear":
        raise JointplayError(
            "the cost 'linear' is possible for the worst case only, because a quantile is not "
            "convex; use " + " or ".join(COSTS[:2])
        )
    most = require_positive("the most clearance", most, "m")
    if require_positive("least clearance", least, "m") >= most:
        raise JointplayError(
            f"the least clearance {readable(least, 'm')} must be below the most, "
            f"{readable(most, 'm')}"
        )
    if not names:
        raise JointplayError("no joint has clearance to allocate")
    for name, value in weights.items():
        if name not in names:
            raise MissingName("joint with clearance", name, names)
        require_positive(f"weight of {name!r}", value, "")


def _true_error(model: ErrorModel, clearance: np.ndarray) -> tuple[float, tuple[float, float]]:
    """Error with these clearances, second order included, and its interval [m]."""
    mechanism = model.with_clearance(clearance)
    if model.quantile is not None:
        return model.spread(mechanism)
    worst = float(budget(mechanism, model.poses, driven=model.driven).worst.max())
    return worst, (worst, worst)


def _solve(
    model: ErrorModel, problem: AllocationProblem, target: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Clearances, and the rows and offsets that hold them."""
    c = np.full(model.j, problem.most)
    if model.quantile is not None:
        return _solve_quantile(model, problem, target, c)
    rows, offsets = np.zeros((0, model.j)), np.zeros(0)
    for _ in range(_ROUNDS):
        new, added = model.rows(c)
        values = new @ c + added
        if values.max() <= target * (1.0 + _EXACT):
            if len(rows) == 0:
                return c, new, added
            break
        worst = np.argsort(values)[::-1][:12]
        worst = worst[values[worst] > target]
        rows, offsets = np.vstack([rows, new[worst]]), np.append(offsets, added[worst])
        room = target - offsets
        start = np.clip(c * float((room / np.maximum(rows @ c, 1e-300)).min()), problem.least, None)
        c = problem.solve(rows, room, np.minimum(start, problem.most))
    return c, rows, offsets


def _solve_quantile(
    model: ErrorModel, problem: AllocationProblem, target: float, c: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `_solve`: a quantile is not convex, so what holds near the last clearances is solved."""
    rows, offsets = model.rows(c)
    if (rows @ c + offsets).max() <= target:
        return c, rows, offsets
    for _ in range(_QUANTILE_ROUNDS):
        # All errors are nearly proportional to the clearances.
        start = np.maximum(c * target / (rows @ c + offsets).max(), problem.least)
        rows, offsets = model.rows(start)
        room = np.maximum(target - offsets, 1e-3 * target)
        new = problem.solve(rows, room, problem.shrunk(start, rows, room))
        c = np.sqrt(start * new)
        rows, offsets = model.rows(c)
    for _ in range(4):
        c = np.clip(c * target / (rows @ c + offsets).max(), problem.least, problem.most)
        rows, offsets = model.rows(c)
    return c, rows, offsets
