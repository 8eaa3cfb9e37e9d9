"""Weighted least squares with what nobody knows taken out, and what the data can tell.

What nobody knows are offsets (where the tracker's frame lies, by how much the robot's geometry is
off at a place, the zero of an encoder), how the readings drift as the machine warms up, and by how
much joints and structure give way. They enter linearly and are projected out; what is known of them
before is a measurement more. What is left of the unknowns' effect is the sensitivity J, and
F = J^T J the Fisher information (standard errors one).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.optimize import least_squares
from scipy.stats import t as student

from jointplay.core.errors import MissingName
from jointplay.identification.measurement import Key
from jointplay.identification.parameters import Parameter
from jointplay.result.result import AXES

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
"""Part of the largest singular value that is none."""
SHARE = 0.1
"""Part of a direction that cannot be told from which on an unknown is named with it."""
MODEL, MODEL_ELSE = {"friction": 0.1}, 0.02
"""Part of a value by which the static model itself is off, see benchmarks/identify.py."""
SAFETY = 1.5
"""By which intervals are wider than the statistics say, for errors of the model that all means
share; set by the first ten machines of benchmarks/identify.py."""
_LOOKS, _NEAR, _FAR = 2, 0.02, 0.5
"""How often effects are sought over the width of the intervals; least and largest step by scale."""
_LEAST_FREEDOM = 8
"""Freedom that few groups are granted: with less, intervals say nothing."""
BLIND = 1e-4
"""Square of the part of an unknown that may lie in what cannot be told."""
FAINT = 1e-3
"""Effect of a whole scale below which nothing is told, in standard errors."""


def offsets(
    keys: Sequence[Key],
    cell: np.ndarray,
    position: np.ndarray,
    tool: np.ndarray,
    reference: str,
) -> np.ndarray:
    """How offsets that nobody knows move the signals, shape (n, keys, offsets).

    Visits of a place are not quite at one: beside an offset for each, the geometry's error is a
    polynomial of the joints' positions.

    Args:
        keys: the signals.
        cell: number of each visit's place, shape (n,).
        position: of the joints, shape (n, j) [rad or m].
        tool: of the ideal mechanism, shape (n, 3) [m].
        reference: one of `REFERENCES`.

    Raises:
        MissingName: no such reference.
    """
    if reference not in REFERENCES:
        raise MissingName("reference", reference, REFERENCES)
    n, columns = len(cell), []
    axes = [axis for kind, axis in keys if kind == "tool"]

    def column(key: Key, values: np.ndarray) -> None:
        made = np.zeros((n, len(keys)))
        made[:, list(keys).index(key)] = values
        columns.append(made)

    if reference == "place":
        for axis in axes:
            for number in np.unique(cell):
                column(("tool", axis), (cell == number).astype(float))
            for values in _within(cell, position):
                column(("tool", axis), values)
    elif reference == "frame" and axes:
        for axis in axes:
            column(("tool", axis), np.ones(n))
        for about in range(3):
            turn = np.cross(np.eye(3)[about], tool - tool.mean(axis=0))
            made = np.zeros((n, len(keys)))
            for k, (kind, axis) in enumerate(keys):
                if kind == "tool":
                    made[:, k] = turn[:, AXES.index(axis)]
            columns.append(made)
    for kind, name in keys:
        if kind != "tool":
            column((kind, name), np.ones(n))
    return np.stack(columns, axis=2) if columns else np.zeros((n, len(keys), 0))


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
    """How a slow drift moves the readings of tool and links, shape (n, keys, columns).

    Args:
        keys: the signals.
        time: of the visits, shape (n,) [s].
        degree: of the Legendre polynomials in time; 0: none.
    """
    middle, half = 0.5 * (time.min() + time.max()), max(0.5 * float(np.ptp(time)), 1e-12)
    shapes = (
        legvander((time - middle) / half, degree)[:, 1:] if degree else np.zeros((len(time), 0))
    )
    columns = []
    for column, (kind, _) in enumerate(keys):
        for shape in shapes.T if kind in ("tool", "link") else ():
            made = np.zeros((len(time), len(keys)))
            made[:, column] = shape
            columns.append(made)
    return np.stack(columns, axis=2) if columns else np.zeros((len(time), len(keys), 0))


@dataclass(frozen=True)
class LeastSquares:
    """What least squares solve: m numbers with their errors and offsets.

    Numbers are means of signals, and then what was known before of unknowns and compliances.
    """

    unknowns: tuple[Parameter, ...]
    predict: Callable[[np.ndarray], np.ndarray]
    """From the unknowns (p,) to the signals (m,)."""
    seen: np.ndarray
    """Shape (m,)."""
    error: np.ndarray
    """Standard errors, shape (m,)."""
    free: np.ndarray
    """Effect of offsets, drift and compliances, shape (m, offsets)."""
    groups: tuple[np.ndarray, ...]
    """Numbers that may be wrong together, of a place or of a load, have the same number, (m,)."""
    elastic: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Columns of `free` that are compliances, by their labels."""

    @property
    def scale(self) -> np.ndarray:
        """Sizes that matter, shape (p,)."""
        return np.array([one.scale for one in self.unknowns])

    def rest(self, theta: np.ndarray) -> np.ndarray:
        """What the model and the offsets leave, shape (m,) [SI]."""
        return self.residual(theta) * self.error

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Values (m,) or (m, k) by their errors, offsets taken out."""
        if not hasattr(self, "_basis"):
            left, sizes, _ = np.linalg.svd(self.free / self.error[:, None], full_matrices=False)
            kept = sizes > _RANK * sizes.max(initial=1e-300)
            object.__setattr__(self, "_basis", left[:, kept])
        basis = vars(self)["_basis"]
        scaled = values / (self.error if values.ndim == 1 else self.error[:, None])
        return np.asarray(scaled - basis @ (basis.T @ scaled))

    @property
    def offsets(self) -> int:
        """How many offsets are taken out."""
        self.whiten(self.seen)
        return int(vars(self)["_basis"].shape[1])

    def without(self, labels: Collection[str]) -> LeastSquares:
        """The problem of a machine that is rigid in these ways."""
        columns = [self.elastic[label] for label in labels]
        gone = np.concatenate(columns) if columns else np.zeros(0, int)
        return replace(self, free=np.delete(self.free, gone, axis=1), elastic={})

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """What the model leaves, in standard errors, shape (m,)."""
        return self.whiten(self.predict(theta) - self.seen)

    def slopes(self, theta: np.ndarray) -> np.ndarray:
        """`sensitivity` by differences to one side, at half the cost, for the search."""
        here, columns = self.predict(theta), []
        for i, one in enumerate(self.unknowns):
            step = _STEP * one.scale
            moved = theta.copy()
            moved[i] = theta[i] + (step if theta[i] + step <= one.most else -step)
            columns.append((self.predict(moved) - here) * one.scale / (moved[i] - theta[i]))
        return self.whiten(np.stack(columns, axis=1))

    def sensitivity(self, theta: np.ndarray, raw: bool = False) -> np.ndarray:
        """Effect of each unknown by its scale, in standard errors, shape (m, p).

        Args:
            theta: of the unknowns, shape (p,).
            raw: as it is [SI], nothing taken out.
        """
        columns = []
        for i, one in enumerate(self.unknowns):
            step = _STEP * one.scale
            ends = []
            for side in (1.0, -1.0):
                moved = theta.copy()
                moved[i] = min(max(theta[i] + side * step, 0.0), one.most)
                ends.append((moved[i], self.predict(moved)))
            (high, above), (low, below) = ends
            columns.append((above - below) * one.scale / (high - low))
        effect = np.stack(columns, axis=1)
        return effect if raw else self.whiten(effect)

    def weaker(self, theta: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """The same by steps (p,) to either side, of which the one with less effect counts.

        Where a journal just reaches a wall, more clearance changes nothing and less of it much: an
        interval by the steep side would be far too narrow on the flat one.
        """
        here, columns = self.predict(theta), []
        for i, one in enumerate(self.unknowns):
            sides = []
            for moved_to in (theta[i] + steps[i], theta[i] - steps[i]):
                value = min(max(moved_to, 0.0), one.most)
                if abs(value - theta[i]) < 0.2 * steps[i]:
                    continue  # a limit
                moved = theta.copy()
                moved[i] = value
                sides.append((self.predict(moved) - here) * one.scale / (value - theta[i]))
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
    """Half of the 95 % confidence intervals; infinite where nothing is told, shape (p,)."""
    freedom: int
    """Numbers less unknowns and offsets."""
    misfit: float
    """RMS of what is left, in standard errors: one if the model and the errors are right."""
    blind: np.ndarray
    """Projector on what cannot be told of the unknowns by their scales, shape (p, p)."""
    felt: np.ndarray
    """Effect of each unknown by its scale on all signals, in standard errors, shape (p,)."""
    quantile: float = np.inf
    """Of Student's distribution, by which the intervals were made."""

    def partners(self, i: int) -> list[int]:
        """Unknowns that cannot be told apart from the i-th, the strongest first."""
        row = np.abs(self.blind[i])
        others = [int(k) for k in np.argsort(-row) if k != i and row[k] > SHARE * row[i]]
        return others if row[i] > BLIND else []


def solve(problem: LeastSquares, start: np.ndarray, most_steps: int) -> Fit:
    """Least squares from a start (p,), 0 and each unknown's most being the limits."""
    scale = problem.scale
    most = np.array([one.most for one in problem.unknowns])
    begin = np.clip(start, 1e-3 * scale, most * (1.0 - 1e-6))
    optimum = least_squares(
        lambda x: problem.residual(x * scale),
        begin / scale,
        lambda x: problem.slopes(x * scale),
        bounds=(0.0, most / scale),
        x_scale=1.0,
        max_nfev=most_steps,
    )
    theta = optimum.x * scale
    return describe(problem, theta)


def describe(problem: LeastSquares, theta: np.ndarray) -> Fit:
    """Intervals about a solution (p,)."""
    fit = _intervals(problem, theta, problem.sensitivity(theta))
    for _ in range(_LOOKS):
        wide = np.where(np.isfinite(fit.half_width), fit.half_width, np.inf)
        steps = np.clip(wide, _NEAR * problem.scale, _FAR * np.maximum(problem.scale, theta))
        fit = _intervals(problem, theta, problem.weaker(theta, steps))
    return fit


def _intervals(problem: LeastSquares, theta: np.ndarray, effect: np.ndarray) -> Fit:
    left = problem.residual(theta)
    covariance, blind, rank = information(effect)
    felt = np.linalg.norm(effect, axis=0)
    freedom = len(problem.seen) - problem.offsets - rank
    if freedom < 1:
        infinite = np.full(len(theta), np.inf)
        return Fit(theta, infinite, freedom, np.nan, blind, felt)
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
    half[np.diag(blind) > BLIND] = np.inf
    return Fit(theta, half, freedom, misfit, blind, felt, quantile)


def information(effect: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Covariance (p, p) of what is told, projector (p, p) on what is not, and the rank.

    Args:
        effect: of the unknowns by their scales, in standard errors, shape (m, p).
    """
    _, sizes, right = np.linalg.svd(effect, full_matrices=True)
    every = np.zeros(effect.shape[1])
    every[: len(sizes)] = sizes
    # An effect of a whole scale that is a thousandth of the noise tells nothing either.
    told = every > max(_RANK * every.max(initial=0.0), FAINT)
    axes = right[told].T / every[told]
    return axes @ axes.T, right[~told].T @ right[~told], int(told.sum())
