"""Weighted least squares with nuisance parameters projected out, and what the data can tell.

Nuisances are offsets (where the tracker's frame lies, by how much the robot's geometry is off at a
place, the zero of an encoder), how the readings drift as the machine warms up, and by how much
joints and structure give way. They enter linearly and are projected out; what is known of them
before is a measurement more. What is left of the unknowns' effect is the sensitivity J, and
F = J^T J the Fisher information (standard errors one).

Play that may or may not meet its walls has several minima, and edges: at the clearance at which an
end wall begins to limit the lean, more of it changes nothing. So the search begins at several
places, and what explains the means as well as the best widens the intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.optimize import least_squares
from scipy.stats import qmc
from scipy.stats import t as student

from jointplay.identification.measurement import (
    READINGS,
    Key,
    signal_effect,
    stacked,
    tool_effect,
)
from jointplay.identification.parameters import Parameter

REFERENCES = ("place", "frame", "ideal")
"""What is known of the tool's ideal place: nothing but that it is the same at each visit of a
place; all but where the tracker's frame lies; all."""
DRIFT = 3
"""Degree of the polynomial in time by which readings may drift, unless said otherwise."""
DEGREE = 3
"""Of the polynomial of each joint's position by which the geometry's error changes at a place."""
CONFIDENCE = 0.95
_STEP = 1e-3
"""Step of differences, relative to an unknown's scale."""
_RANK = 1e-9
"""Singular values below this part of the largest count as zero."""
SHARE = 0.1
"""Part of a direction in the null space from which on an unknown is named with it."""
MODEL, MODEL_ELSE = {"friction": 0.1}, 0.02
"""Part of a value by which the static model itself is off, see benchmarks/truth/identify.py."""
SAFETY = 1.5
"""By which intervals are wider than the statistics say, for errors of the model that all means
share; set by the first ten machines of benchmarks/truth/identify.py."""
_LOOKS, _NEAR, _FAR = 2, 0.02, 0.5
"""How often effects are sought over the width of the intervals; least and largest step by scale."""
_LEAST_FREEDOM = 8
"""Freedom that few groups are granted: with less, intervals say nothing."""
NULL = 1e-4
"""Square of the part of an unknown that may lie in the null space."""
FAINT = 1e-3
"""Effect of a whole scale below which nothing is identified, in standard errors."""
_TRIED, _RANGE = 16, 3.0
"""Starts that are looked at, and how far they lie from the scenario's values."""
_FIRST, _LATER = 15, 8
"""Most steps of least squares from each start, and with other errors."""
_AS_GOOD = 1.1
"""Cost of another minimum, relative to the best, up to which it is as good an explanation."""
_ROUGH = 0.005
"""Part of what play does to a signal by which the static model may be off at a visit."""
_OTHER_WALL = 4.0
"""Factor of axial clearances that are tried besides the best."""
_OUTWARDS = 1.3
"""By which an end of an interval is moved at a time."""
_ROUNDS = 2
"""In which errors are made as large as the residuals demand."""


def offsets(
    keys: Sequence[Key], cell: np.ndarray, position: np.ndarray, tool: np.ndarray, reference: str
) -> np.ndarray:
    """How unknown offsets move the signals, shape (n, keys, offsets), see `REFERENCES`.

    Visits of a place (`cell`, (n,)) are not quite at one: beside an offset for each, the geometry's
    error is a polynomial of the joints' positions (n, j) [rad or m]. `tool` is the ideal
    mechanism's (n, 3) [m].
    """
    n, columns = len(cell), []
    axes = [key for key in keys if key[0] == "tool"]
    if reference == "place":
        courses = [cell == number for number in np.unique(cell)] + _within(cell, position)
        columns += [signal_effect(keys, axis, course) for axis in axes for course in courses]
    elif reference == "frame" and axes:
        columns += [signal_effect(keys, axis, np.ones(n)) for axis in axes]
        arm = tool - tool.mean(axis=0)
        columns += [tool_effect(keys, np.cross(about, arm)) for about in np.eye(3)]
    columns += [signal_effect(keys, key, np.ones(n)) for key in keys if key not in axes]
    return stacked(columns, n, keys)


def _within(cell: np.ndarray, position: np.ndarray) -> list[np.ndarray]:
    """Powers of the joints' positions as far as they differ between visits of a place."""
    powers = []
    for values in position.T:
        span = np.ptp(values)
        if span > 0.0:
            even = (values - values.mean()) / span
            for power in range(1, DEGREE + 1):
                moved = even**power
                for number in np.unique(cell):
                    moved[cell == number] -= moved[cell == number].mean()
                powers.append(moved)
    return powers


def drifts(keys: Sequence[Key], time: np.ndarray, degree: int) -> np.ndarray:
    """How a slow drift at times (n,) moves readings of tool and links, shape (n, keys, columns).

    Legendre polynomials up to a degree; 0: none.
    """
    middle, half = 0.5 * (time.min() + time.max()), max(0.5 * float(np.ptp(time)), 1e-12)
    shapes = legvander((time - middle) / half, degree)[:, 1:]
    columns = [
        signal_effect(keys, key, shape) for key in keys if key[0] in READINGS for shape in shapes.T
    ]
    return stacked(columns, len(time), keys)


def basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the span of columns (m, k), shape (m, rank)."""
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, sizes > _RANK * sizes.max(initial=1e-300)]


@dataclass(frozen=True)
class LeastSquares:
    """What least squares solve: m numbers with their errors and nuisances.

    Numbers are means of signals, and then what was known before of unknowns and compliances.
    """

    unknowns: tuple[Parameter, ...]
    predict: Callable[[np.ndarray], np.ndarray]
    """From the unknowns (p,) to the signals (m,)."""
    measured: np.ndarray
    """Shape (m,)."""
    error: np.ndarray
    """Standard errors, shape (m,)."""
    nuisance: np.ndarray
    """Effect of offsets, drift and compliances, shape (m, nuisances)."""
    groups: tuple[np.ndarray, ...]
    """Numbers that may be wrong together, of a place or of a load, have the same number, (m,)."""
    elastic: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Columns of `nuisance` that are compliances, by their labels."""
    softening: Mapping[str, np.ndarray] = field(default_factory=dict)
    """By joint, see `StaticModel.softening`, (m,)."""

    @property
    def scale(self) -> np.ndarray:
        """Sizes that matter, shape (p,)."""
        return np.array([one.scale for one in self.unknowns])

    @property
    def most(self) -> np.ndarray:
        """Largest possible values, shape (p,)."""
        return np.array([one.most for one in self.unknowns])

    @cached_property
    def projected(self) -> np.ndarray:
        """Orthonormal basis of the nuisances in standard errors, shape (m, rank)."""
        return basis(self.nuisance / self.error[:, None])

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Values (m,) or (m, k) by their errors, nuisances projected out."""
        scaled = values / (self.error if values.ndim == 1 else self.error[:, None])
        return np.asarray(scaled - self.projected @ (self.projected.T @ scaled))

    def rigid(self, labels: Collection[str]) -> LeastSquares:
        """The problem of a machine without these compliances."""
        columns = [self.elastic[label] for label in labels]
        gone = np.concatenate(columns) if columns else np.zeros(0, int)
        return replace(self, nuisance=np.delete(self.nuisance, gone, axis=1), elastic={})

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """Residual in standard errors, shape (m,)."""
        return self.whiten(self.predict(theta) - self.measured)

    def softened(self, joint: str) -> LeastSquares | None:
        """The problem of a machine whose bearing in a joint gives way like a contact of lines, not
        in proportion to its load; None where that is no unknown.

        What becomes stiffer under load looks like play and a stiffer one in proportion.
        """
        k = self.elastic.get(f"{joint} radial")
        if k is None:
            return None
        nuisance = self.nuisance.copy()
        nuisance[:, k] *= self.softening[joint][:, None]
        return replace(self, nuisance=nuisance, softening={})

    def cost(self, theta: np.ndarray) -> float:
        """Sum of the squared residuals, in standard errors."""
        return float(np.square(self.residual(theta)).sum())

    def _predicted(self, theta: np.ndarray, i: int, value: float) -> np.ndarray:
        """The signals with another value of the i-th unknown."""
        moved = theta.copy()
        moved[i] = value
        return self.predict(moved)

    def forward_sensitivity(self, theta: np.ndarray) -> np.ndarray:
        """`sensitivity` by differences to one side, at half the cost, for the search."""
        here, columns = self.predict(theta), []
        for i, one in enumerate(self.unknowns):
            step = _STEP * one.scale
            value = theta[i] + (step if theta[i] + step <= one.most else -step)
            change = self._predicted(theta, i, value) - here
            columns.append(change * one.scale / (value - theta[i]))
        return self.whiten(np.stack(columns, axis=1))

    def sensitivity(self, theta: np.ndarray, raw: bool = False) -> np.ndarray:
        """Effect of each unknown by its scale, in standard errors, shape (m, p).

        With `raw` as it is [SI], nothing projected out.
        """
        columns = []
        for i, one in enumerate(self.unknowns):
            step = _STEP * one.scale
            high, low = (
                min(max(value, 0.0), one.most) for value in (theta[i] + step, theta[i] - step)
            )
            change = self._predicted(theta, i, high) - self._predicted(theta, i, low)
            columns.append(change * one.scale / (high - low))
        effect = np.stack(columns, axis=1)
        return effect if raw else self.whiten(effect)

    def weaker_sensitivity(self, theta: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """`sensitivity` by steps (p,) to either side, of which the one with less effect counts.

        Where a journal just reaches a wall, more clearance changes nothing and less of it much: an
        interval by the steep side would be far too narrow on the flat one.
        """
        here, columns = self.predict(theta), []
        for i, one in enumerate(self.unknowns):
            sides = []
            for goal in (theta[i] + steps[i], theta[i] - steps[i]):
                value = min(max(goal, 0.0), one.most)
                if abs(value - theta[i]) >= 0.2 * steps[i]:  # else a limit is too near
                    change = self._predicted(theta, i, value) - here
                    sides.append(change * one.scale / (value - theta[i]))
            if not sides:
                sides = [np.zeros(len(here))]
            columns.append(min(sides, key=lambda side: float(np.linalg.norm(side / self.error))))
        return self.whiten(np.stack(columns, axis=1))


@dataclass(frozen=True)
class Fit:
    """What least squares found of p unknowns."""

    theta: np.ndarray
    """Shape (p,)."""
    half_width: np.ndarray
    """Half of the 95 % confidence intervals; infinite in the null space, shape (p,)."""
    freedom: int
    """Numbers less unknowns and nuisances."""
    misfit: float
    """RMS of the residuals, in standard errors: one if the model and the errors are right."""
    null: np.ndarray
    """Projector on the null space of the unknowns by their scales, shape (p, p)."""
    effect: np.ndarray
    """Of each unknown by its scale on all signals, in standard errors, shape (p,)."""
    quantile: float = np.inf
    """Of Student's distribution, by which the intervals were made."""

    def partners(self, i: int) -> list[int]:
        """Unknowns that cannot be told apart from the i-th, the strongest first."""
        return partners(self.null[i], i)


def partners(row: np.ndarray, i: int) -> list[int]:
    """Which entries share the i-th one's null space, by its row of the projector; strongest first.

    None where the i-th lies outside of it.
    """
    row = np.abs(row)
    others = [int(k) for k in np.argsort(-row) if k != i and row[k] > SHARE * row[i]]
    return others if row[i] > NULL else []


def solve(problem: LeastSquares, start: np.ndarray, most_steps: int) -> Fit:
    """Least squares from a start (p,), 0 and each unknown's most being the limits."""
    scale, most = problem.scale, problem.most
    begin = np.clip(start, 1e-3 * scale, most * (1.0 - 1e-6))
    optimum = least_squares(
        lambda x: problem.residual(x * scale),
        begin / scale,
        lambda x: problem.forward_sensitivity(x * scale),
        bounds=(0.0, most / scale),
        x_scale=1.0,
        max_nfev=most_steps,
    )
    theta = optimum.x * scale
    fit = _intervals(problem, theta, problem.sensitivity(theta))
    for _ in range(_LOOKS):
        steps = np.clip(fit.half_width, _NEAR * scale, _FAR * np.maximum(scale, theta))
        fit = _intervals(problem, theta, problem.weaker_sensitivity(theta, steps))
    return fit


def _intervals(problem: LeastSquares, theta: np.ndarray, effect: np.ndarray) -> Fit:
    """Intervals about a solution (p,) by sensitivities (m, p)."""
    left = problem.residual(theta)
    covariance, null, rank = information(effect)
    size = np.linalg.norm(effect, axis=0)
    freedom = len(problem.measured) - problem.projected.shape[1] - rank
    if freedom < 1:
        infinite = np.full(len(theta), np.inf)
        return Fit(theta, infinite, freedom, np.nan, null, size)
    misfit = float(np.sqrt(left @ left / freedom))
    spread = covariance * max(misfit, 1.0) ** 2
    variance, least = np.diag(spread), freedom
    for group in problem.groups:
        # What is wrong at one place, or under one load, is wrong in all its numbers.
        numbers = np.unique(group)
        if len(numbers) > rank:
            scores = np.stack([left[group == g] @ effect[group == g] for g in numbers])
            factor = len(numbers) / (len(numbers) - rank)
            robust = factor * covariance @ (scores.T @ scores) @ covariance
            variance = np.maximum(variance, np.diag(robust))
            least = min(least, max(len(numbers) - rank, _LEAST_FREEDOM))
    quantile = float(student.ppf(0.5 + CONFIDENCE / 2.0, least))
    own = np.array([MODEL.get(one.name, MODEL_ELSE) for one in problem.unknowns]) * theta
    half = SAFETY * np.hypot(quantile * np.sqrt(variance) * problem.scale, own)
    half[np.diag(null) > NULL] = np.inf
    return Fit(theta, half, freedom, misfit, null, size, quantile)


def information(effect: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Covariance (p, p) outside of the null space, projector (p, p) on it, and the rank.

    By the effect (m, p) of the unknowns by their scales, in standard errors.
    """
    _, sizes, right = np.linalg.svd(effect, full_matrices=True)
    every = np.zeros(effect.shape[1])
    every[: len(sizes)] = sizes
    # An effect of a whole scale that is a thousandth of the noise identifies nothing either.
    clear = every > max(_RANK * every.max(initial=0.0), FAINT)
    axes = right[clear].T / every[clear]
    return axes @ axes.T, right[~clear].T @ right[~clear], int(clear.sum())


def search(problem: LeastSquares, start: np.ndarray, kinds: np.ndarray) -> tuple[LeastSquares, Fit]:
    """Least squares with errors as large as the residuals demand, by kind of signal.

    Means scatter by more than their records do: journals do not come to rest at quite the same
    place, and the model is not exact. That is added to the errors. `kinds` (m,) has the number of
    each number's kind of signal, -1 for what was known before.
    """
    tried = [solve(problem, one, _FIRST) for one in _starts(problem, start)]
    best = min(tried, key=lambda fit: problem.cost(fit.theta))
    own = problem.error
    for _ in range(_ROUNDS):
        left = problem.residual(best.theta) * problem.error
        rough = np.where(kinds < 0, 0.0, _ROUGH * np.abs(problem.predict(best.theta)))
        share = max(best.freedom, 1) / len(own)
        more = np.zeros(len(own))
        for kind in np.unique(kinds[kinds >= 0]):
            mine = kinds == kind
            more[mine] = _excess(left[mine], np.hypot(own, rough)[mine], share * mine.sum())
        problem = replace(problem, error=np.sqrt(own**2 + more**2 + rough**2))
        best = solve(problem, best.theta, _LATER)
    far = np.minimum(best.half_width, problem.scale)  # another minimum, not within the intervals
    others = [
        solve(problem, fit.theta, _LATER).theta
        for fit in tried
        if (np.abs(fit.theta - best.theta) > far).any()
    ]
    others += _with_other_walls(problem, best.theta)
    limit = _AS_GOOD * problem.cost(best.theta)
    away = [np.abs(theta - best.theta) for theta in others if problem.cost(theta) <= limit]
    plays = [one.name.endswith("clearance") for one in problem.unknowns]
    softened = [soft for joint in problem.softening if (soft := problem.softened(joint))]
    for soft in softened:
        fit = solve(soft, best.theta, _LATER)
        cost = soft.cost(fit.theta)
        if cost <= limit:
            # Where that explains the means better, its own interval counts, too.
            nearer = fit if cost < problem.cost(best.theta) else best
            size = np.abs(fit.theta - best.theta) + nearer.half_width
            away.append(np.where(plays, size, 0.0))
    wide = np.max([best.half_width, *away], axis=0)
    wide = np.array([_profiled(problem, best, wide, i) for i in range(len(wide))])
    return problem, replace(best, half_width=wide)


def _profiled(problem: LeastSquares, best: Fit, wide: np.ndarray, i: int) -> float:
    """Half width of an unknown with which the profile of the cost agrees.

    Slopes at the best values do not see how the others, where walls begin or end to hold a journal,
    make up for a change of this one. So each end is tried with all others fitted anew, and moved
    outwards until the means are explained worse by what the interval allows.
    """
    half = float(wide[i])
    one = problem.unknowns[i]
    widest = one.widest(best.theta[i])
    if not one.sought or half > widest:
        return half  # it is not identified in any case
    limit = problem.cost(best.theta) + (best.quantile * SAFETY * max(best.misfit, 1.0)) ** 2
    for side in (1.0, -1.0):
        own = float(wide[i])
        start = best.theta
        while own <= widest:
            value = best.theta[i] + side * own
            if not 0.0 < value < one.most:
                break
            start = _fitted_beside(problem, start, i, value)
            if problem.cost(start) > limit:
                break
            own *= _OUTWARDS
        half = max(half, own)
    return half


def _with_other_walls(problem: LeastSquares, theta: np.ndarray) -> list[np.ndarray]:
    """The best with each axial clearance much larger or smaller than found.

    At the edge at which an end wall begins to limit the lean the model is steep on one side, and an
    interval by slopes would not see how little is lost far away on the other.
    """
    return [
        _fitted_beside(problem, theta, i, min(max(theta[i], 0.1 * one.scale) * factor, one.most))
        for i, one in enumerate(problem.unknowns)
        if one.name == "axial_clearance" and len(theta) > 1
        for factor in (_OTHER_WALL, 1.0 / _OTHER_WALL)
    ]


def _fitted_beside(problem: LeastSquares, theta: np.ndarray, i: int, value: float) -> np.ndarray:
    """The best values of all others, from `theta` on, where the i-th has a given one."""
    kept = np.arange(len(theta)) != i

    def whole(x: np.ndarray) -> np.ndarray:
        return np.insert(x, i, value)

    if not kept.any():
        return whole(theta[kept])
    others = tuple(other for k, other in enumerate(problem.unknowns) if kept[k])
    part = replace(problem, unknowns=others, predict=lambda x: problem.predict(whole(x)))
    return whole(solve(part, theta[kept], _LATER).theta)


def _starts(problem: LeastSquares, start: np.ndarray) -> list[np.ndarray]:
    """Where to begin: at the start, at it with end walls near and far, at the best about it."""
    walls = np.array([one.name == "axial_clearance" for one in problem.unknowns])
    starts = [start]
    if walls.any():
        starts += [np.where(walls, factor * start, start) for factor in (1.0 / _RANGE, _RANGE)]
    spread = qmc.LatinHypercube(len(start), rng=0).random(_TRIED)
    options = np.minimum(start * _RANGE ** (2.0 * spread - 1.0), problem.most)
    return [*starts, min(options, key=problem.cost)]


def _excess(left: np.ndarray, error: np.ndarray, freedom: float) -> float:
    """Standard deviation that, added to errors, explains residuals; by bisection."""
    low, high = 0.0, float(np.sqrt(np.square(left).sum() / max(freedom, 1e-9)))
    if np.square(left / error).sum() <= freedom:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = np.square(left / np.hypot(error, middle)).sum() > freedom
        low, high = (middle, high) if above else (low, middle)
    return high
