"""The search for the best values, and for others that are as good.

Play that may or may not meet its walls has several minima, and edges: at the clearance at which
an end wall begins to limit the lean, more of it changes nothing. So the search begins at several
places, and what explains the means as well as the best widens the intervals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.stats import qmc

from jointplay.analysis.identify.fit import SAFETY, Fit, Problem, solve
from jointplay.analysis.identify.planning import enough

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
"""In which errors are made as large as what is left demands."""


def search(problem: Problem, start: np.ndarray, kinds: np.ndarray) -> tuple[Problem, Fit]:
    """Least squares with errors as large as what is left demands, by kind of signal.

    Means scatter by more than their records do: journals do not come to rest at quite the same
    place, and the model is not exact. That is added to the errors.
    """
    tried = [solve(problem, one, _FIRST) for one in _starts(problem, start)]
    best = min(tried, key=lambda fit: cost(problem, fit.theta))
    own = problem.error
    for _ in range(_ROUNDS):
        left = problem.rest(best.theta)
        rough = _ROUGH * np.abs(problem.predict(best.theta))
        share = max(best.freedom, 1) / len(own)
        more = np.zeros(len(own))
        for kind in np.unique(kinds):
            mine = kinds == kind
            more[mine] = _excess(left[mine], np.hypot(own, rough)[mine], share * mine.sum())
        problem = replace(problem, error=np.sqrt(own**2 + more**2 + rough**2))
        best = solve(problem, best.theta, _LATER)
    others = [fit.theta for fit in tried if _far(problem, fit.theta, best)]
    others = [solve(problem, theta, _LATER).theta for theta in others]
    others += _with_other_walls(problem, best.theta)
    limit = _AS_GOOD * cost(problem, best.theta)
    away = [np.abs(theta - best.theta) for theta in others if cost(problem, theta) <= limit]
    wide = np.max([best.half_width, *away], axis=0)
    wide = np.array([_profiled(problem, best, wide, i) for i in range(len(wide))])
    return problem, replace(best, half_width=wide)


def _profiled(problem: Problem, best: Fit, wide: np.ndarray, i: int) -> float:
    """Half width of an unknown with which the profile of the cost agrees.

    Slopes at the best values do not see how the others, where walls begin or end to hold a journal,
    make up for a change of this one. So each end is tried with all others fitted anew, and moved
    outwards until the means are explained worse by what the interval allows.
    """
    half = float(wide[i])
    one = problem.unknowns[i]
    if not one.sought or half > enough(one, best.theta[i]):
        return half  # nothing is told already
    limit = cost(problem, best.theta) + (best.quantile * SAFETY * max(best.misfit, 1.0)) ** 2
    for side in (1.0, -1.0):
        own = float(wide[i])
        start = best.theta
        while own <= enough(one, best.theta[i]):
            value = best.theta[i] + side * own
            if not 0.0 < value < one.most:
                break
            start = _fitted_beside(problem, start, i, value)
            if cost(problem, start) > limit:
                break
            own *= _OUTWARDS
        half = max(half, own)
    return half


def _with_other_walls(problem: Problem, theta: np.ndarray) -> list[np.ndarray]:
    """The best with each axial clearance much larger or smaller than found.

    At the edge at which an end wall begins to limit the lean the model is steep on one side, and an
    interval by slopes would not see how little is lost far away on the other.
    """
    solutions = []
    for i, one in enumerate(problem.unknowns):
        if one.name != "axial_clearance":
            continue
        for factor in (_OTHER_WALL, 1.0 / _OTHER_WALL):
            value = min(max(theta[i], 0.1 * one.scale) * factor, one.most)
            if len(theta) > 1:
                solutions.append(_fitted_beside(problem, theta, i, value))
    return solutions


def _fitted_beside(problem: Problem, theta: np.ndarray, i: int, value: float) -> np.ndarray:
    """The best values of all others, from `theta` on, where the i-th has a given one."""
    kept = np.arange(len(theta)) != i
    whole = partial(_inserted, i, value)
    if not kept.any():
        return whole(theta[kept])
    part = replace(
        problem,
        unknowns=tuple(other for k, other in enumerate(problem.unknowns) if kept[k]),
        predict=partial(_predicted, problem, whole),
    )
    return whole(solve(part, theta[kept], _LATER).theta)


def _inserted(i: int, value: float, x: np.ndarray) -> np.ndarray:
    return np.insert(x, i, value)


def _predicted(
    problem: Problem, whole: Callable[[np.ndarray], np.ndarray], x: np.ndarray
) -> np.ndarray:
    return problem.predict(whole(x))


def cost(problem: Problem, theta: np.ndarray) -> float:
    """Sum of the squares that are left, in standard errors."""
    return float(np.square(problem.residual(theta)).sum())


def _far(problem: Problem, theta: np.ndarray, best: Fit) -> bool:
    """Whether another minimum is none that the intervals hold."""
    return bool((np.abs(theta - best.theta) > np.minimum(best.half_width, problem.scale)).any())


def _starts(problem: Problem, start: np.ndarray) -> list[np.ndarray]:
    """Where to begin: play that may or may not meet its walls has several minima.

    The given start, it with end walls near and far, and the best of many about it.
    """
    walls = np.array([one.name == "axial_clearance" for one in problem.unknowns])
    starts = [start]
    if walls.any():
        starts += [np.where(walls, factor * start, start) for factor in (1.0 / _RANGE, _RANGE)]
    spread = qmc.LatinHypercube(len(start), rng=0).random(_TRIED)
    options = start * _RANGE ** (2.0 * spread - 1.0)
    options = np.minimum(options, [one.most for one in problem.unknowns])
    return [*starts, min(options, key=lambda theta: cost(problem, theta))]


def _excess(left: np.ndarray, error: np.ndarray, freedom: float) -> float:
    """Standard deviation that, added to errors, explains what is left."""
    low, high = 0.0, float(np.sqrt(np.square(left).sum() / max(freedom, 1e-9)))
    if np.square(left / error).sum() <= freedom:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = np.square(left / np.hypot(error, middle)).sum() > freedom
        low, high = (middle, high) if above else (low, middle)
    return high
