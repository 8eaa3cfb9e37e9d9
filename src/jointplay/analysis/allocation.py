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

from jointplay.analysis.allocating import SAMPLES, ErrorModel, Problem
from jointplay.analysis.static_budget import budget
from jointplay.errors import JointplayError, MissingName, require_positive
from jointplay.mechanism.mechanism import Mechanism

COSTS = ("reciprocal", "reciprocal-squared", "linear")
"""What a clearance c [mm] costs, times its weight: 1/c, 1/c^2, or what `most` has more."""

LEAST_M, MOST_M = 2e-6, 1e-3
"""Clearances that can be bought, unless others are given [m]."""

_ROUNDS = 80

_QUANTILE_ROUNDS = 8

_EXACT = 2e-5

_CLOSE = 0.9995
"""Part of the target that must be used up, second order included."""


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

    def __str__(self) -> str:
        """The table."""
        lines = [
            "joint                       clearance [um]  error per um  adds [um]  "
            "a um more saves  held by"
        ]
        for j, name in enumerate(self.joints):
            lines.append(
                f"{name:<27} {1e6 * self.clearance[j]:>14.2f}  {self.gain[j]:>12.3f}  "
                f"{1e6 * self.gain[j] * self.clearance[j]:>9.2f}  {self.price[j]:>15.4g}  "
                f"{self.bound[j] or 'target'}"
            )
        low, high = self.spread
        interval = f" (95 %: {1e6 * low:.2f} to {1e6 * high:.2f})" if high > low else ""
        lines.append(
            f"{self.kind}: {1e6 * self.error:.2f} um{interval} of {1e6 * self.target:.2f} um; cost "
            f"{self.total:.5g} ({self.cost}); a target one um wider saves {self.relief:.4g}"
        )
        return "\n".join(lines)


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
            axial to radial clearance. The play of gears stays as it is.
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
            values that cannot be.
        MissingName: no such cost or joint.
    """
    names = tuple(mechanism.clearance)
    _check(names, target, quantile, cost, weights or {}, least, most)
    weight = np.array([(weights or {}).get(name, 1.0) for name in names])
    model = ErrorModel(mechanism, poses, quantile, seed, driven, progress)
    problem = Problem(cost, weight, least, most)
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
    if quantile is not None and not 0.0 < quantile < 1.0:
        raise JointplayError(f"the quantile must lie between 0 and 1, got {quantile:g}")
    if cost not in COSTS:
        raise MissingName("cost", cost, COSTS)
    if quantile is not None and cost == "linear":
        raise JointplayError(
            "the cost 'linear' goes with the worst case only, for a quantile is not convex; take "
            + " or ".join(COSTS[:2])
        )
    if not 0.0 < require_positive("least clearance", least, "m") < most:
        raise JointplayError(f"the least clearance {least:g} m must be below the most, {most:g} m")
    if not names:
        raise JointplayError("no joint has clearance to decide on")
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
    model: ErrorModel, problem: Problem, target: float
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
    model: ErrorModel, problem: Problem, target: float, c: np.ndarray
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
