"""Which cause of error to improve at which joint: the cheapest way to keep a target.

Of each cause at each joint a part x remains, from its limit up to 1 (as it is), at the price

    w (1 / x - 1),

reciprocal to what remains: halving costs w. Each displaces the tool in proportion to x. So the
worst case at a pose and in a direction is linear in all x, as support functions add; the root mean
square is the root of a quadratic form, as variances add and loads shift. Either is convex, and so
is the price: one choice is the cheapest. L-BFGS-B solves its dual on the poses and directions known
to bind, and the worst ones of each choice are added until none exceeds the target.

A clearance's play has a second order: it is found anew at each choice until both agree. The play of
a rolling bearing is not proportional to its clearance, so it stays; `allocate_classes` decides on
it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import linprog, minimize

from jointplay.core.errors import (
    JointplayError,
    MissingName,
    require_a,
    require_positive,
)
from jointplay.core.progress import ProgressBar
from jointplay.core.tables import Column, Table
from jointplay.design.allocation import PATIENCE_S
from jointplay.design.error_budget import (
    CAUSES,
    ErrorBudget,
    error_budget,
    is_proportional,
)
from jointplay.design.robot_errors import RobotErrors
from jointplay.mechanism.mechanism import Mechanism

LIMIT = 0.1
"""Part of a cause that remains at least, unless it is given: assumed."""
_NEAR = 0.98
"""Part of the largest error from which on poses are looked at closely: the sphere's directions are
7 degrees apart, which hides 0.7 %."""
_ROUNDS, _RENEWALS = 100, 12
_FITS = 1e-8
"""Part of the target by which an error may miss it."""
_USED = 1e-6
"""Part of the target that may be left."""
_SETTLED = 1e-3
"""Relative change of parts below which plays, of the second order, are as they were."""
_LISTED = 2e-3
"""Part of the error below which a cause has no line of its own."""


@dataclass(frozen=True)
class CauseAllocation:
    """What must become smaller to keep a target: k causes at joints."""

    target: float
    """Largest error of the tool [m]."""
    statistical: bool
    """Whether the error is a root mean square; else a worst case."""
    joints: tuple[str, ...]
    """Of each cause, length k."""
    causes: tuple[str, ...]
    """Which they are, of `CAUSES`."""
    remaining: np.ndarray
    """Part that remains of each, (k,)."""
    before: np.ndarray
    """What each adds to the error as it is, (k,) [m]."""
    after: np.ndarray
    """What it adds in the end, (k,) [m]."""
    price: np.ndarray
    """Of each, (k,)."""
    order: tuple[int, ...]
    """Which is bought first: rank by what the first of its price saves, from 1 on; 0 where nothing
    is bought."""
    held: tuple[str, ...]
    """What holds each: ``target``, ``limit``, ``as is`` where nothing is bought, or ``kept``."""
    relief: float
    """Price saved by a target one metre wider [1/m]."""
    first: ErrorBudget
    """As it is."""
    budget: ErrorBudget
    """In the end."""
    notes: tuple[str, ...]
    """What was assumed of prices and limits, and what stays as it is, lines of text."""

    @property
    def error(self) -> float:
        """What is reached [m]."""
        return _largest(self.budget, self.statistical)

    @property
    def total(self) -> float:
        """Price of all."""
        return float(self.price.sum())

    @property
    def parts(self) -> dict[tuple[str, str], float]:
        """What remains by joint and cause, where less than all: `remaining` of `error_budget`."""
        every = zip(self.joints, self.causes, self.remaining, strict=True)
        return {(joint, cause): float(x) for joint, cause, x in every if x < 1.0}

    @property
    def words(self) -> str:
        """Worst case or root mean square."""
        return "RMS" if self.statistical else "worst case"

    @property
    def table(self) -> Table:
        """A row for each cause at each joint, those that matter first."""
        whole = _largest(self.first, self.statistical)
        rank = np.lexsort((-self.before, np.array(self.order) == 0))
        small = (np.abs(self.before) <= _LISTED * whole) & (np.array(self.order) == 0)
        kept = [int(k) for k in rank if not small[k]]
        more = []
        if small.any():
            sums = (float(part[small].sum()) for part in (self.before, self.after))
            more = [(f"{int(small.sum())} more", None, *sums, None, None, None, None, None)]
        return replace(self._rows(kept), totals=more, notes=self._notes(whole))

    @property
    def causes_table(self) -> Table:
        """The same of all causes, in their order."""
        return self._rows(range(len(self.causes)))

    def _rows(self, kept: Sequence[int]) -> Table:
        total = self.total
        some = np.array(kept, int)
        return Table(
            (
                Column("joint", [self.joints[k] for k in kept]),
                Column("cause", [self.causes[k] for k in kept]),
                Column("before", self.before[some], "m"),
                Column("after", self.after[some], "m"),
                Column("remains", self.remaining[some], key="remaining"),
                Column("price", self.price[some], digits=4),
                Column("of all", self.price[some] / (total or 1.0), "1", only="text", digits=4),
                Column("bought", [self.order[k] or None for k in kept]),
                Column("held by", [self.held[k] for k in kept]),
            )
        )

    def _notes(self, whole: float) -> list[str]:
        """The outcome, what was given and what was assumed, in lines."""
        line = (
            f"{self.words} {1e3 * self.error:.4f} mm of {1e3 * self.target:.4f} mm (as it is "
            f"{1e3 * whole:.4f} mm)"
        )
        if self.total == 0.0:
            line += ": within the target already, nothing is spent"
        else:
            line += f"; price {self.total:.5g}; a target 1 % wider saves "
            line += f"{0.01 * self.target * self.relief:.4g}"
        given = [f"given: {one}" for one in self.first.given]
        return [line, *given, *(f"assumed: {one}" for one in self.first.assumed), *self.notes]

    def __str__(self) -> str:
        """The table."""
        return str(self.table)


def allocate_causes(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    target: float,
    *,
    statistical: bool = False,
    force: Sequence[float] = (0.0, 0.0, 0.0),
    errors: RobotErrors | None = None,
    kind: str | None = None,
    causes: Collection[str] = CAUSES,
    keep: Collection[str] = (),
    prices: Mapping[str, float] | None = None,
    weights: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    progress: bool = False,
) -> CauseAllocation:
    """The cheapest improvements with which the whole error stays below `target` at all poses.

    Args:
        mechanism, poses, force, errors, kind, causes: as for `error_budget`.
        target: largest distance of the tool from where it should be [m].
        statistical: the target is of the root mean square, not of the worst case.
        keep: causes that count but stay as they are.
        prices: of halving a cause, by cause; 1 where not given.
        weights: of joints, which multiply prices; 1 where not given.
        limits: part of a cause that remains at least, by cause; `LIMIT` where not given.
        progress: show a count of the rounds on standard error, if it takes long.

    Raises:
        JointplayError: a target that cannot be reached, with the cause that prevents it; nothing
            that may be improved; values that cannot be; see `error_budget`.
        MissingName: no such cause or joint.
    """
    require_a("mechanism", mechanism, "Mechanism")
    target = require_positive("target", target, "m")
    prices, weights, limits = dict(prices or {}), dict(weights or {}), dict(limits or {})
    for name in (*keep, *prices, *limits):
        if name not in CAUSES:
            raise MissingName("cause of errors", name, CAUSES)
    for name in weights:
        if name not in (*mechanism.joints, *mechanism.mounts):
            raise MissingName("joint", name, [*mechanism.joints, *mechanism.mounts])
    for noun, own in (("price of", prices), ("weight of", weights), ("limit of", limits)):
        for name, value in own.items():
            require_positive(f"{noun} {name!r}", value, "")
    for name, value in limits.items():
        if value > 1.0:
            raise JointplayError(f"limit of {name!r}: a part of at most 1 remains, got {value:g}")

    def at(remaining: Mapping[tuple[str, str], float]) -> ErrorBudget:
        return error_budget(
            mechanism, poses, force=force, errors=errors, kind=kind, causes=causes,
            remaining=remaining,
        )  # fmt: skip

    first = at({})
    keys = list(dict.fromkeys((one.joint, one.cause) for one in first.contributions))
    able = {(one.joint, one.cause) for one in first.contributions if one.proportional}
    free = [key for key in keys if key in able and key[1] not in keep]
    if not free:
        raise JointplayError("no cause is left that may be improved: keep fewer")
    weight = np.array([prices.get(c, 1.0) * weights.get(j, 1.0) for j, c in free])
    least = np.array([limits.get(c, LIMIT) for _, c in free])
    curved = any(c == "play" and is_proportional(mechanism, j) for j, c in free)
    with ProgressBar(desc="allocating", unit="round", disable=not progress, delay=PATIENCE_S,
              leave=False) as bar:  # fmt: skip
        x, aim, budget = np.ones(len(free)), target * (1.0 - _FITS), first
        for _ in range(_RENEWALS):
            before = x
            error = _Error(budget, free, before, statistical)
            problem = _Problem(error, weight, least, aim, bar)
            x = problem.solve()
            budget = at({key: float(part) for key, part in zip(free, x, strict=True) if part < 1.0})
            reached = _largest(budget, statistical)
            settled = not curved or np.abs(x / before - 1.0).max() < _SETTLED
            used = reached >= target * (1.0 - _USED) or (x == 1.0).all()
            if settled and used and reached <= target * (1.0 + _FITS):
                break
            if settled:
                aim *= target / reached * (1.0 - _FITS)
        else:
            raise JointplayError(
                f"the allocation did not settle within {100 * abs(reached / target - 1.0):.2g} % "
                "of the target; keep play, or allocate clearances first"
            )
    last = _Error(budget, free, x, statistical)
    price = weight * (1.0 / x - 1.0)
    held = ["as is" if p > 1.0 - 1e-6 else "limit" if p < low * (1.0 + 1e-6) else "target"
            for p, low in zip(x, least, strict=True)]  # fmt: skip
    place = {key: k for k, key in enumerate(free)}
    ones = np.ones(len(free))
    start = _Error(first, free, ones, statistical)
    gain, worth = start.parts(ones), start.slopes(ones) / weight
    bought = [k for k in np.argsort(-worth) if held[k] != "as is"]
    parts = last.parts(x)
    return CauseAllocation(
        target,
        statistical,
        tuple(joint for joint, _ in keys),
        tuple(cause for _, cause in keys),
        np.array([x[place[key]] if key in place else 1.0 for key in keys]),
        np.array([gain[key] for key in keys]),
        np.array([parts.get(key, 0.0) for key in keys]),
        np.array([price[place[key]] if key in place else 0.0 for key in keys]),
        tuple(bought.index(place[key]) + 1 if place.get(key, -1) in bought else 0 for key in keys),
        tuple(held[place[key]] if key in place else "kept" for key in keys),
        problem.relief,
        first,
        budget,
        tuple(_notes(first, free, prices, limits)),
    )


def _largest(budget: ErrorBudget, statistical: bool) -> float:
    """Largest error of all poses [m]."""
    return float((budget.rms if statistical else budget.worst).max())


def _notes(
    budget: ErrorBudget,
    free: Sequence[tuple[str, str]],
    prices: Mapping[str, float],
    limits: Mapping[str, float],
) -> list[str]:
    """What was assumed of prices and limits, and which plays stay."""
    causes = list(dict.fromkeys(cause for _, cause in free))
    notes = []
    if unpriced := [cause for cause in causes if cause not in prices]:
        notes.append(
            f"assumed: prices: halving costs 1 at each joint, of {', '.join(unpriced)} "
            "(--price CAUSE=X, --weight JOINT=X)"
        )
    if unlimited := [cause for cause in causes if cause not in limits]:
        notes.append(
            f"assumed: limits: at least {LIMIT:g} remains, of {', '.join(unlimited)} "
            "(--limit CAUSE=X)"
        )
    rolling = [one.joint for one in budget.contributions if not one.proportional]
    if rolling:
        notes.append(
            f"kept: the play of the bearings of {', '.join(rolling)}, which is not proportional to "
            "their clearance: allocate by class chooses theirs"
        )
    return notes


class _Error:
    """The error at n poses by what remains of k causes, sums of their parts and of what stays."""

    def __init__(
        self,
        budget: ErrorBudget,
        free: Sequence[tuple[str, str]],
        now: np.ndarray,
        statistical: bool,
    ) -> None:
        """Find what each contributes; `budget` is of the parts `now`."""
        self.budget, self.now, self.statistical = budget, now, statistical
        self.free = list(free)
        place = {key: k for k, key in enumerate(free)}
        stays = len(free)
        # What stays has the last column, of which all remains.
        self._of = [
            place.get((one.joint, one.cause), stays) if one.proportional else stays
            for one in budget.contributions
        ]
        both = zip(self._of, budget.contributions, strict=True)
        self.kept = {one.cause for k, one in both if k == stays}
        self._unit = np.append(1.0 / now, 1.0)
        n = len(budget.q)
        if statistical:
            self._mean = np.zeros((n, stays + 1, 3))
            self._variance = np.zeros((n, stays + 1))
            for k, one in zip(self._of, budget.contributions, strict=True):
                self._mean[:, k] += one.mean() * self._unit[k]
                whole = np.trace(one.variance(), axis1=1, axis2=2)
                self._variance[:, k] += whole * self._unit[k] ** 2
            return
        self._sphere = budget.sphere()
        every = np.broadcast_to(self._sphere, (n, *self._sphere.shape))
        self._grid = np.zeros((stays + 1, *every.shape[:2]))
        for k, one in zip(self._of, budget.contributions, strict=True):
            self._grid[k] += one.along(every)[0] * self._unit[k]

    def rows(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The error as rows . x + offsets, exact at x and nowhere above it; (m, k), (m,) [m].

        Of m poses: all, or of worst cases those that may have the largest one.
        """
        whole = np.append(x, 1.0)
        rows = self._quadratic(whole) if self.statistical else self._linear(whole)
        return rows[:, :-1], rows[:, -1]

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """How the largest error falls with each part, (k,) [m]."""
        rows, offsets = self.rows(x)
        return np.asarray(rows[(rows @ x + offsets).argmax()])

    def parts(self, x: np.ndarray) -> dict[tuple[str, str], float]:
        """What each adds at the worst pose, those that stay too [m]."""
        rows, offsets = self.rows(x)
        at = int((rows @ x + offsets).argmax())
        found = dict(zip(self.free, rows[at] * x, strict=True))
        for one, k in zip(self.budget.contributions, self._of, strict=True):
            if k < len(self.free):
                continue
            if self.statistical:
                mean = self._mean[at].T @ np.append(x, 1.0)
                own = one.mean()[at] @ mean + float(np.trace(one.variance()[at]))
                own /= max(float(rows[at] @ x + offsets[at]), 1e-300)
            else:
                own = one.at([self._poses[at]]).along(self._d[at][None, None])[0][0, 0]
            key = one.joint, one.cause
            found[key] = found.get(key, 0.0) + float(own)
        return found

    def _quadratic(self, whole: np.ndarray) -> np.ndarray:
        mean = np.einsum("nki,k->ni", self._mean, whole)
        square = (mean**2).sum(axis=1) + self._variance @ whole**2
        rows = np.einsum("nki,ni->nk", self._mean, mean) + self._variance * whole
        return np.asarray(rows / np.sqrt(np.maximum(square, 1e-300))[:, None])

    def _linear(self, whole: np.ndarray) -> np.ndarray:
        total = np.tensordot(whole, self._grid, 1)
        size = total.max(axis=1)
        self._poses = np.flatnonzero(size >= _NEAR * size.max())
        ratio = whole * self._unit
        near = [one.at(self._poses) for one in self.budget.contributions]
        made = [
            replace(one, factor=one.factor * ratio[k])
            for k, one in zip(self._of, near, strict=True)
        ]
        start = self._sphere[total[self._poses].argmax(axis=1)]
        _, self._d = self.budget.farthest(made, start)
        rows = np.zeros((len(self._poses), len(whole)))
        for k, one in zip(self._of, near, strict=True):
            rows[:, k] += one.along(self._d[:, None])[0][:, 0] * self._unit[k]
        return rows


class _Problem:
    """The cheapest parts on a growing set of poses and directions."""

    def __init__(
        self,
        error: _Error,
        weight: np.ndarray,
        least: np.ndarray,
        target: float,
        bar: Any,
    ) -> None:
        self.error, self.weight, self.least, self.target = error, weight, least, target
        self.bar = bar
        self._rows = np.zeros((0, len(weight)))
        self._offsets, self._multipliers = np.zeros(0), np.zeros(0)

    def solve(self) -> np.ndarray:
        """What remains of each.

        Raises:
            JointplayError: the target cannot be reached.
        """
        x = np.ones(len(self.weight))
        if self._add(x) <= self.target:
            return x
        self._require_reachable()
        for _ in range(_ROUNDS):
            x = self._cheapest()
            if self._add(x) <= self.target * (1.0 + _FITS):
                return x
        raise JointplayError("the allocation did not settle; give fewer poses or keep more causes")

    @property
    def relief(self) -> float:
        """Price saved by a target one metre wider [1/m]."""
        return float(self._multipliers.sum() * self.weight.sum() / self.target)

    def _add(self, x: np.ndarray) -> float:
        """Take into account where the error is largest; the error there [m]."""
        self.bar.update()
        rows, offsets = self.error.rows(x)
        values = rows @ x + offsets
        worst = np.argsort(values)[::-1][:12]
        self._rows = np.vstack([self._rows, rows[worst]])
        self._offsets = np.append(self._offsets, offsets[worst])
        return float(values.max())

    def _require_reachable(self) -> None:
        """Refuse a target that no parts keep, whatever they cost."""
        if self._add(self.least) <= self.target:
            return
        # Where loads shift the tool against each other, the least parts need not be the best.
        for _ in range(_ROUNDS):
            one = np.ones((len(self._rows), 1))
            found = linprog(
                np.append(np.zeros(len(self.least)), 1.0),
                A_ub=np.hstack([self._rows / self.target, -one]),
                b_ub=-self._offsets / self.target,
                bounds=[*((low, 1.0) for low in self.least), (0.0, None)],
                method="highs",
            )
            x, bound = np.clip(found.x[:-1], self.least, 1.0), float(found.x[-1])
            if bound > 1.0:
                raise self._refusal(x, bound * self.target)
            if self._add(x) <= self.target:
                return
        raise self._refusal(x, self.target)

    def _refusal(self, x: np.ndarray, bound: float) -> JointplayError:
        """Which cause prevents the target."""
        sums: dict[str, float] = {}
        for (_, cause), part in self.error.parts(x).items():
            sums[cause] = sums.get(cause, 0.0) + part
        kept = self.error.kept
        limit = {cause: low for (_, cause), low in zip(self.error.free, self.least, strict=True)}
        words = [
            f"{cause} {1e6 * part:.4g} um ("
            + " and ".join(
                [*([f"at least {limit[cause]:g} of it remains"] if cause in limit else []),
                 *(["kept"] if cause in kept else [])]
            )
            + ")"
            for cause, part in sorted(sums.items(), key=lambda one: -one[1])[:3]
        ]  # fmt: skip
        return JointplayError(
            f"a target of {1e6 * self.target:.4g} um cannot be reached: with all causes at their "
            f"limits the error is {1e6 * bound:.4g} um at least, most of it by "
            + "; then ".join(words)
        )

    def _cheapest(self) -> np.ndarray:
        """The cheapest parts by what is known, by their dual: it has bounds only.

        With multipliers y of the rows R, each part is sqrt(w / (R' y)) within its bounds.
        """
        unit = self.weight / self.weight.sum()
        rows, room = self._rows / self.target, 1.0 - self._offsets / self.target

        def parts(multiplier: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            slope = multiplier @ rows
            return np.clip(np.sqrt(unit / np.maximum(slope, 1e-12)), self.least, 1.0), slope

        def dual(multiplier: np.ndarray) -> tuple[float, np.ndarray]:
            x, slope = parts(multiplier)
            value = float((unit / x + slope * x).sum() - multiplier @ room)
            return -value, room - rows @ x

        start = np.append(self._multipliers, np.zeros(len(rows) - len(self._multipliers)))
        found = minimize(
            dual, start, jac=True, method="L-BFGS-B", bounds=[(0.0, None)] * len(rows),
            options={"maxiter": 5000, "maxfun": 20000, "ftol": 1e-16, "gtol": 1e-10, "maxcor": 30},
        )  # fmt: skip
        self._multipliers, x = found.x, parts(found.x)[0]
        return np.where(x > 1.0 - 1e-9, 1.0, x)
