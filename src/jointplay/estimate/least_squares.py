"""Nonlinear least squares with priors and nuisances, and intervals for what the data can tell.

A kind of measurement states its problem (`LeastSquares`): its unknowns (`Unknown`: prior, bounds,
unit), the model that predicts measured numbers by them, these numbers and their standard errors.
The rest is the same for all kinds:

1. A prior counts like a measurement: it is one more row. Nuisances (offsets, drift, compliances)
   enter linearly and are projected out. What is left of the unknowns' effect, in standard errors,
   is the sensitivity J, and F = J^T J the Fisher information.
2. `search` begins at several places, since play that may or may not meet its walls has several
   minima, and enlarges the standard errors of each kind of signal until they explain the residuals.
3. `Fit.half_width` has the 95 % intervals: by Student's t from the residuals, or from the sandwich
   estimator over groups that may be wrong together where that is wider; with the model's own
   relative error; times `LeastSquares.safety`.
4. Slopes at the best values miss edges: at the clearance at which an end wall begins to limit the
   lean, more of it changes nothing. So intervals are widened to other minima that are as good and
   to where the profile of the cost ends.

Whether a value with such an interval counts as known is decided in `known`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.stats import qmc
from scipy.stats import t as student

from jointplay.base.progress import ProgressBar
from jointplay.estimate.known import LARGEST_SHARE, narrow, outweighs_prior, widest
from jointplay.estimate.unknowns import (
    EXPECTATION_FACTOR,
    MINOR,
    MODEL_ERROR,
    ROUNDING,
    TINY,
    TWO_SIDED,
    Estimate,
    Unknown,
)

_STEP = 1e-3
"""Step of differences, relative to an unknown's scale: with it rounding at 1e-12 leaves slopes to
`ROUNDING`, below which singular values therefore count as zero, by the largest."""
SAFETY = 1.5
"""Factor by which intervals are wider than the statistics say, unless a kind of measurement says
otherwise (measured: by the first ten machines of benchmarks/truth/identify.py)."""
_EFFECT_ROUNDS = 2
"""Rounds in which effects are taken over the width of the intervals, which depends on them (judged:
with 3 of these and of `_ERROR_ROUNDS`, and twice the starts and steps below, the same is told of 11
machines of benchmarks/truth/identify.py, in intervals that differ by 4 % at most)."""
_LEAST_FREEDOM = {False: 8, True: 4}
"""Degrees of freedom that few groups are granted, by `LeastSquares.weights`: with less, intervals
say nothing. Fewer where errors are only weights, for nothing else says how large they are (judged:
with 5 and 3, `_AS_GOOD` of 1.2 and `_VISIT_MODEL_ERROR` of 0.01 together, the same is told of these
11 machines)."""
NULL_SHARE = 1e-4
"""Squared part of an observable unknown that may lie in the null space (judged: with this and
`LEAST_EFFECT` from a hundredth and a tenth of theirs to a hundred and ten times as much, the same
is told of these 11 machines)."""
LEAST_EFFECT = 1e-3
"""Effect of a whole scale below which nothing is identified, in standard errors: with it the
interval is a thousand scales wide (judged, see `NULL_SHARE`)."""
_STARTS_TRIED = 16
"""Number of starts whose cost is compared, about the scenario's values by `EXPECTATION_FACTOR`
(judged, see `_EFFECT_ROUNDS`)."""
_FIRST_STEPS, _BEST_STEPS, _LATER_STEPS = 15, 100, 8
"""Largest number of least-squares steps from each start, from the best of these on, and after a
change of errors, of law or of one unknown (judged, see `_EFFECT_ROUNDS`)."""
_AS_GOOD = 1.1
"""Cost of another minimum, relative to the best, up to which it explains the data as well (judged,
see `_LEAST_FREEDOM`)."""
_VISIT_MODEL_ERROR = 0.005
"""Part of what play does to a signal by which the static model may be off at a visit (judged, see
`_LEAST_FREEDOM`)."""
_OUTWARDS = 1.3
"""Factor by which an end of an interval is moved at a time: ends are as sharp as that (judged: with
1.5 no interval of these 11 machines changes)."""
_ERROR_ROUNDS = 2
"""Rounds in which errors are made as large as the residuals demand, which depend on them (judged,
see `_EFFECT_ROUNDS`)."""


def basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the span of columns (m, k), shape (m, rank)."""
    vectors, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return vectors[:, sizes > ROUNDING * sizes.max(initial=TINY)]


@dataclass(frozen=True)
class LeastSquares:
    """A problem: m measured numbers, a model of them by p unknowns, and k linear nuisances.

    Its rows are the measured numbers, then the priors of unknowns that have one, r in all.
    """

    unknowns: tuple[Unknown, ...]
    predict: Callable[[np.ndarray], np.ndarray]
    """The model: from the unknowns (p,) to the numbers (m,)."""
    measured: np.ndarray
    """Measured numbers, shape (m,)."""
    error: np.ndarray
    """Their standard errors, shape (m,)."""
    nuisance: np.ndarray | None = None
    """Effect of each nuisance on the numbers, shape (m, k)."""
    labels: tuple[str, ...] = ()
    """Names of the last nuisances; the first may have none."""
    spread: np.ndarray | None = None
    """Standard deviations of the nuisances' priors about zero, shape (k,); infinite: no prior."""
    groups: tuple[np.ndarray, ...] = ()
    """Clusters, each a way to divide the numbers into groups that may be wrong together (of a
    place, of a load): the group's number of each, (m,)."""
    kinds: np.ndarray | None = None
    """Kind of signal of each number, (m,): errors of a kind grow together."""
    jacobian: Callable[[np.ndarray], np.ndarray] | None = None
    """Derivatives of `predict` by the unknowns, (m, p); by differences if None."""
    weights: bool = False
    """Whether errors are only weights: the residuals alone say how large they are, and priors only
    keep what nothing shows within its size."""
    safety: float = SAFETY
    """Factor of intervals, for errors of the model that all numbers share."""
    softening: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Factors by joint, see `StaticModel.softening`, (m,)."""
    assured: float = 0.0
    """Number of residuals that the errors as given are worth, where they are known before."""

    @property
    def scale(self) -> np.ndarray:
        """Scales of the unknowns, (p,)."""
        return np.array([unknown.scale for unknown in self.unknowns])

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest possible values, shape (p,) each."""
        ends = np.array([(unknown.least, unknown.most) for unknown in self.unknowns]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    @cached_property
    def stated(self) -> np.ndarray:
        """Indices of the unknowns that have a prior."""
        return np.flatnonzero([np.isfinite(unknown.spread) for unknown in self.unknowns])

    @cached_property
    def _before(self) -> tuple[np.ndarray, np.ndarray]:
        """Means and standard deviations of these priors."""
        known = [self.unknowns[i] for i in self.stated]
        return np.array([unknown.nominal for unknown in known]), np.array(
            [unknown.spread for unknown in known]
        )

    @cached_property
    def elastic(self) -> dict[str, np.ndarray]:
        """Indices of the labelled nuisances, by label."""
        first = 0 if self.nuisance is None else self.nuisance.shape[1] - len(self.labels)
        names = np.array(self.labels)
        return {
            label: first + np.flatnonzero(names == label) for label in dict.fromkeys(self.labels)
        }

    @cached_property
    def projected(self) -> np.ndarray:
        """Orthonormal basis of the nuisances' span in standard errors; the last rows are priors."""
        r = len(self.measured) + len(self.stated)
        if self.nuisance is None:
            return np.zeros((r, 0))
        columns = np.zeros((r, self.nuisance.shape[1]))
        columns[: len(self.measured)] = self.nuisance / self.error[:, None]
        if self.spread is not None:
            known = np.isfinite(self.spread)
            columns = np.concatenate([columns, np.diag(1.0 / self.spread)[known]])
        return basis(columns)

    def project(self, values: np.ndarray) -> np.ndarray:
        """Project the nuisances out of values in standard errors, (r,) or (r, k).

        Rows for the priors of the nuisances are added at the end.
        """
        span = self.projected
        padding = [(0, len(span) - len(values))] + [(0, 0)] * (values.ndim - 1)
        padded = np.pad(values, padding)
        return np.asarray(padded - span @ (span.T @ padded))

    def rows(self, values: np.ndarray) -> np.ndarray:
        """Values of the numbers [SI], (m,) or (m, k), in standard errors, with zeros for priors."""
        scaled = values / (self.error if values.ndim == 1 else self.error[:, None])
        padding = [(0, len(self.stated))] + [(0, 0)] * (values.ndim - 1)
        return np.pad(scaled, padding)

    def without(self, labels: Collection[str]) -> LeastSquares:
        """The problem without these nuisances: of a machine without these compliances."""
        removed = np.concatenate([np.zeros(0, int), *(self.elastic[label] for label in labels)])
        if self.nuisance is None or not len(removed):
            return self
        return replace(
            self,
            nuisance=np.delete(self.nuisance, removed, axis=1),
            labels=tuple(name for name in self.labels if name not in set(labels)),
            spread=None if self.spread is None else np.delete(self.spread, removed),
        )

    def off(self, theta: np.ndarray) -> np.ndarray:
        """Predicted less measured, nuisances left in, in standard errors, shape (r,)."""
        value, spread = self._before
        residual = (self.predict(theta) - self.measured) / self.error
        return np.concatenate([residual, (theta[self.stated] - value) / spread])

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """Predicted less measured, nuisances projected out, in standard errors."""
        return self.project(self.off(theta))

    def softened(self, joint: str) -> LeastSquares | None:
        """The problem with a joint's bearing as a contact of lines, which stiffens under load.

        Such a bearing looks like play and one of constant, greater stiffness. None where the
        radial compliance is no nuisance.
        """
        k = self.elastic.get(f"{joint} radial")
        if k is None or self.nuisance is None:
            return None
        nuisance = self.nuisance.copy()
        nuisance[:, k] *= self.softening[joint][:, None]
        return replace(self, nuisance=nuisance, softening={})

    def cost(self, theta: np.ndarray) -> float:
        """Sum of squared residuals."""
        return float(np.square(self.residual(theta)).sum())

    def effects(
        self, theta: np.ndarray, steps: np.ndarray | None = None, sides: int = 2
    ) -> np.ndarray:
        """Jacobian of `off` by unknowns in their scales, (r, p), by differences without `jacobian`.

        Where a journal just reaches a wall, more clearance changes nothing and less of it much: an
        interval by the steep side would be far too narrow on the flat one. So of differences over
        given steps the one to the side with less effect counts.

        Args:
            theta: where, shape (p,).
            steps: steps of the differences, shape (p,); None takes a small part of the scales, and
                the mean of both sides.
            sides: 1 for differences to one side, at half the cost.
        """
        if self.jacobian is not None:
            effect = self.rows(self.jacobian(theta) * self.scale)
            place = len(self.measured) + np.arange(len(self.stated))
            effect[place, self.stated] = self.scale[self.stated] / self._before[1]
            return effect
        residual, columns = self.off(theta), []
        for i, unknown in enumerate(self.unknowns):
            step = _STEP * unknown.scale if steps is None else steps[i]
            changes: list[np.ndarray] = []
            for goal in (theta[i] + step, theta[i] - step):
                moved = theta.copy()
                moved[i] = min(max(goal, unknown.least), unknown.most)
                size = moved[i] - theta[i]
                # Over less of a step, where a limit is near, rounding would show (judged: from
                # 0.05 to 0.5 the same is told of these 11 machines).
                if abs(size) >= 0.2 * step and len(changes) < sides:
                    changes.append((self.off(moved) - residual) * unknown.scale / size)
            if steps is None:
                columns.append(np.mean(changes, axis=0))
            else:
                columns.append(min(changes, key=np.linalg.norm, default=np.zeros(len(residual))))
        return np.stack(columns, axis=1)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Values of p unknowns at which least squares ended, and the intervals that follow from it.

    Of r rows the first m are the measured numbers; the rest are priors.
    """

    least: LeastSquares
    theta: np.ndarray
    """Values of the unknowns, shape (p,) [SI]."""
    steps: np.ndarray | None = None
    """Steps over which effects are taken, see `LeastSquares.effects`."""
    widened: np.ndarray | None = None
    """Half widths that other explanations as good demand, shape (p,) [SI]."""

    @cached_property
    def residual(self) -> np.ndarray:
        """Residuals at the values, `LeastSquares.residual`, shape (r,)."""
        return self.least.residual(self.theta)

    @cached_property
    def effect(self) -> np.ndarray:
        """Sensitivity J: `LeastSquares.effects` at the values, nuisances projected out, (r, p)."""
        return self.least.project(self.least.effects(self.theta, self.steps))

    @cached_property
    def _information(self) -> tuple[np.ndarray, np.ndarray, int]:
        return information(self.effect)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the unknowns in their scales outside of the null space, for residuals of
        one standard error, (p, p)."""
        return self._information[0]

    @property
    def null(self) -> np.ndarray:
        """Projector on the null space of the unknowns in their scales, shape (p, p)."""
        return self._information[1]

    @cached_property
    def freedom(self) -> float:
        """Degrees of freedom: the number of measured numbers less the trace of the hat matrix.

        An unknown with a prior that says nothing takes one, with a prior that says all, none.
        """
        m = len(self.least.measured)
        absorbed = float(np.sum(self.least.projected[:m] ** 2))
        return m - absorbed - float(np.sum((self.effect[:m] @ self.covariance) * self.effect[:m]))

    @cached_property
    def misfit(self) -> float:
        """RMS of the residuals in standard errors: one if the model and the errors are right."""
        residual, assured = self.residual[: len(self.least.measured)], self.least.assured
        return float(np.sqrt((residual @ residual + assured) / max(self.freedom + assured, 1.0)))

    @property
    def stretch(self) -> float:
        """Factor by which errors are taken larger than they were given."""
        return self.misfit if self.least.weights else max(self.misfit, 1.0)

    @cached_property
    def _spread(self) -> tuple[np.ndarray, float]:
        """Variances of the unknowns in their scales (p,), and degrees of freedom.

        By independent residuals, or by the sandwich over a division into groups where that is more.
        """
        variance = self.stretch**2 * np.diag(self.covariance)
        freedom = max(self.freedom + self.least.assured, 1.0)
        for group in self.least.groups:
            m = len(group) if self.least.weights else len(self.residual)
            # Each prior is a group by itself; where errors are only weights, priors do not count.
            group = np.concatenate([group, -1 - np.arange(m - len(group))])
            robust, number = sandwich(self.covariance, self.effect[:m], self.residual[:m], group)
            unknowns = 1 if self.least.weights else self._information[2]
            if number > unknowns:
                variance = np.maximum(variance, number / (number - unknowns) * robust)
                freedom = min(freedom, max(number - unknowns, _LEAST_FREEDOM[self.least.weights]))
        return variance, freedom

    def half_widths(self, quantile: float = TWO_SIDED) -> np.ndarray:
        """Half widths of intervals that end at a quantile, by the residuals and by the model's own
        error, (p,) [SI]."""
        variance, freedom = self._spread
        half = student.ppf(quantile, freedom) * np.sqrt(variance) * self.least.scale
        model = np.array([unknown.model_error for unknown in self.least.unknowns]) * self.theta
        return np.asarray(self.least.safety * np.hypot(half, model))

    @cached_property
    def half_width(self) -> np.ndarray:
        """Half widths of the 95 % intervals; infinite in the null space, shape (p,) [SI]."""
        if self.widened is not None:
            return self.widened
        dark = (np.diag(self.null) > NULL_SHARE) | (self.freedom + self.least.assured < 1.0)
        return np.where(dark, np.inf, self.half_widths())

    def wide(self, deviation: float, off: float = 0.0) -> float:
        """Half width of the 95 % interval of any other number.

        By its standard deviation for residuals of one standard error, and by the model's own error.
        """
        half = float(student.ppf(TWO_SIDED, self._spread[1]))
        return self.least.safety * float(np.hypot(half * self.stretch * deviation, off))

    def informed(self, i: int) -> tuple[float, float, str]:
        """What shares the i-th unknown with the prior, and with others.

        Returns:
            Part of the prior's variance that the measurement took away; largest correlation with
            another unknown that is sought; that one's label, if half of the variance is common.
        """
        unknown = self.least.unknowns[i]
        spread = np.sqrt(np.maximum(np.diag(self.covariance), TINY))
        gained = 1.0 - self.covariance[i, i] * (unknown.scale / unknown.spread) ** 2
        together = np.abs(self.covariance[i] / spread[i] / spread)
        together[~np.array([unknown.sought for unknown in self.least.unknowns])] = together[i] = 0.0
        most = float(together.max(initial=0.0))
        partner = self.least.unknowns[int(together.argmax())].label
        return float(gained), most, partner if most**2 >= 0.5 else ""

    def shows(self, i: int) -> bool:
        """Whether the i-th unknown does anything to what was measured."""
        column = self.effect[: len(self.least.measured), i]
        return bool(np.linalg.norm(column) >= LEAST_EFFECT)

    def known(self, i: int) -> bool:
        """Whether the i-th unknown is known, see `jointplay.estimate.known`.

        Where errors are only weights priors are wide and values may be zero: there the measurement
        must say more than the prior.
        """
        if self.least.weights:
            return outweighs_prior(self.informed(i)[0])
        return narrow(self.least.unknowns[i], self.theta[i], self.half_width[i])

    def why_not(self, i: int) -> str:
        """Why the measurement cannot tell the i-th unknown; empty if it can."""
        if self.known(i):
            return ""
        if not self.shows(i):
            return "not observable: nothing that was measured depends on it"
        if confounded := partners(self.null[i], i):
            names = ", ".join(self.least.unknowns[k].label for k in confounded)
            return f"it acts only together with {names}"
        if self.least.weights:
            _, together, partner = self.informed(i)
            if partner:
                return f"it acts together with {partner} (correlation {together:.2f})"
            return "the measurement says less of it than was assumed beforehand"
        if np.isfinite(half := self.half_width[i]):
            interval = self.least.unknowns[i].shown(half)
            return f"its 95 % interval would be +- {interval}, more than half of its value"
        return "it hardly shows above the noise"

    def estimates(
        self, reasons: Sequence[str] | None = None, advice: Sequence[str] = ()
    ) -> tuple[Estimate, ...]:
        """Estimates of all unknowns; `reasons` why they are not known, else those of `why_not`."""
        if reasons is None:
            reasons = [self.why_not(i) for i in range(len(self.theta))]
        advice, half = advice or [""] * len(reasons), self.half_width.tolist()
        rows = zip(self.least.unknowns, self.theta.tolist(), half, reasons, advice, strict=True)
        return tuple(Estimate(*row) for row in rows)


def partners(row: np.ndarray, i: int) -> list[int]:
    """Indices that share the null space of the i-th, by its row of the projector; strongest first.

    None where the i-th lies outside of it.
    """
    row = np.abs(row)
    numbers = [int(k) for k in np.argsort(-row) if k != i and row[k] > MINOR * row[i]]
    return numbers if row[i] > NULL_SHARE else []


def minimum(problem: LeastSquares, start: np.ndarray, most_steps: int = 40) -> np.ndarray:
    """Minimise the cost from a start (p,) within the limits of the unknowns, (p,)."""
    scale, (low, high) = problem.scale, problem.limits
    bounded = np.isfinite(low).any() or np.isfinite(high).any()
    if bounded:  # the trust-region method needs a start between the limits
        start = np.clip(start, low + _STEP * scale, high * (1.0 - 1e-6))
    optimum = least_squares(
        lambda x: problem.residual(x * scale),
        start / scale,
        lambda x: problem.project(problem.effects(x * scale, sides=1)),
        bounds=(low / scale, high / scale),
        method="trf" if bounded else "lm",
        x_scale=1.0,
        max_nfev=most_steps,
    )
    return np.asarray(optimum.x * scale)


def fit(problem: LeastSquares, start: np.ndarray, most_steps: int) -> Fit:
    """Least squares from a start (p,), with effects over the width of the intervals.

    The steps are no smaller than the model's own error, no larger than intervals that are known.
    """
    theta, scale = minimum(problem, start, most_steps), problem.scale
    fitted = Fit(least=problem, theta=theta)
    for _ in range(_EFFECT_ROUNDS):
        steps = np.clip(
            fitted.half_width, MODEL_ERROR * scale, LARGEST_SHARE * np.maximum(scale, theta)
        )
        fitted = replace(fitted, steps=steps)
    return fitted


def sandwich(
    covariance: np.ndarray, effect: np.ndarray, residual: np.ndarray, group: np.ndarray
) -> tuple[np.ndarray, int]:
    """Sandwich estimator: variances where the residuals of a group may be wrong together.

    Args:
        covariance: of the estimates for independent residuals, shape (p, p).
        effect: of the unknowns on r residuals, shape (r, p).
        residual: shape (r,).
        group: number of each residual's group, shape (r,).

    Returns:
        Variances (p,), without a correction for few groups; and the number of groups.
    """
    _, numbers = np.unique(group, return_inverse=True)
    scores = np.zeros((numbers.max(initial=-1) + 1, effect.shape[1]))
    np.add.at(scores, numbers, residual[:, None] * effect)
    return np.asarray(np.sum((scores @ covariance) ** 2, axis=0)), len(scores)


def information(effect: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Covariance (p, p) outside of the null space, projector (p, p) on it, and the rank.

    By the sensitivity (m, p) to unknowns in their scales, in standard errors.
    """
    _, sizes, right = np.linalg.svd(effect, full_matrices=len(effect) < effect.shape[1])
    padded = np.zeros(effect.shape[1])
    padded[: len(sizes)] = sizes
    clear = padded > max(ROUNDING * padded.max(initial=0.0), LEAST_EFFECT)
    axes = right[clear].T / padded[clear]
    return axes @ axes.T, right[~clear].T @ right[~clear], int(clear.sum())


def first_guess(unknowns: Sequence[Unknown]) -> np.ndarray:
    """Values from which a search begins: nominal ones, or half of the scale, (p,)."""
    known = [np.isfinite(unknown.nominal) and unknown.nominal for unknown in unknowns]
    halves = (0.5 * unknown.scale for unknown in unknowns)
    return np.array([value or half for value, half in zip(known, halves, strict=True)])


def search(problem: LeastSquares, start: np.ndarray | None = None, progress: bool = False) -> Fit:
    """Least squares from several starts, with errors as large as the residuals demand.

    Means scatter by more than their records do: journals do not come to rest at quite the same
    place, and the model is not exact. That is added to the errors, by kind of signal.

    Args:
        problem: what is solved.
        start: where to begin, shape (p,); None: `first_guess`.
        progress: show a bar.
    """
    starts = _starts(problem, first_guess(problem.unknowns) if start is None else start)
    # Of an interval each end takes at least a fit.
    steps = 2 * len(starts) + _ERROR_ROUNDS + len(problem.softening) + 2 * len(problem.unknowns)
    with ProgressBar(
        total=steps, desc="least squares", unit="fit", delay=2.0, disable=not progress, leave=False
    ) as bar:
        return _search(problem, starts, bar)


def _search(problem: LeastSquares, starts: Sequence[np.ndarray], bar: ProgressBar) -> Fit:
    # A short search from each start, and a long one from the best of them: the residuals of where
    # a short one stopped would grow the errors.
    tried = [fit(problem, start, _FIRST_STEPS) for start in bar.passed(starts)]
    best = min(tried, key=lambda candidate: problem.cost(candidate.theta))
    best = fit(problem, best.theta, _BEST_STEPS)
    # Errors as large as the residuals demand: measured, the model's, and an excess by kind.
    measured = problem.error
    kinds = np.zeros(len(measured), int) if problem.kinds is None else problem.kinds
    for _ in bar.passed(range(_ERROR_ROUNDS)):
        residual = best.residual[: len(measured)] * problem.error
        rough = _VISIT_MODEL_ERROR * np.abs(problem.predict(best.theta))
        share = max(best.freedom, 1.0) / len(measured)
        excess = np.zeros(len(measured))
        for kind in np.unique(kinds):
            alike = kinds == kind
            error = np.hypot(measured, rough)[alike]
            excess[alike] = _excess(residual[alike], error, share * alike.sum())
        problem = replace(problem, error=np.sqrt(measured**2 + excess**2 + rough**2))
        best = fit(problem, best.theta, _LATER_STEPS)
    # Other minima outside the intervals, if they are as good, widen the intervals.
    far = np.minimum(best.half_width, problem.scale)
    candidates = [
        fit(problem, candidate.theta, _LATER_STEPS).theta
        for candidate in bar.passed(tried)
        if (np.abs(candidate.theta - best.theta) > far).any()
    ]
    candidates += _with_other_walls(problem, best.theta)
    limit = _AS_GOOD * problem.cost(best.theta)
    away = [np.abs(theta - best.theta) for theta in candidates if problem.cost(theta) <= limit]
    # So do the clearances that belong to contacts of lines, if these explain the means as well.
    plays = [unknown.name.endswith("clearance") for unknown in problem.unknowns]
    for joint in bar.passed(problem.softening):
        if (soft := problem.softened(joint)) is None:
            continue
        softer = fit(soft, best.theta, _LATER_STEPS)
        cost = soft.cost(softer.theta)
        if cost <= limit:
            # Where that explains the means better, its own interval counts, too.
            nearer = softer if cost < problem.cost(best.theta) else best
            size = np.abs(softer.theta - best.theta) + nearer.half_width
            away.append(np.where(plays, size, 0.0))
    wide = np.max([best.half_width, *away], axis=0)
    # And the profile of the cost, which sees edges that slopes do not.
    wide = np.array([_profiled(best, wide, i) for i in bar.passed(range(len(wide)), 2)])
    return replace(best, widened=wide)


def _profiled(best: Fit, wide: np.ndarray, i: int) -> float:
    """Half width of the i-th unknown's interval, widened by the profile of the cost.

    Slopes at the best values do not see how the others, where walls begin or end to hold a journal,
    make up for a change of this one. So each end is tried with all others fitted anew, and moved
    outwards until the cost exceeds the least by the square of the interval's half width in standard
    errors (likelihood ratio). Intervals that are too wide to be known are left.
    """
    half, problem = float(wide[i]), best.least
    unknown = problem.unknowns[i]
    most = widest(unknown, best.theta[i])
    if not unknown.sought or half > most:
        return half
    limit = problem.cost(best.theta) + best.wide(1.0) ** 2
    for side in (1.0, -1.0):
        reach = float(wide[i])
        start = best.theta
        while reach <= most:
            value = best.theta[i] + side * reach
            if not unknown.least < value < unknown.most:
                break
            start = _fitted_beside(problem, start, i, value)
            if problem.cost(start) > limit:
                break
            reach *= _OUTWARDS
        half = max(half, reach)
    return half


def _with_other_walls(problem: LeastSquares, theta: np.ndarray) -> list[np.ndarray]:
    """Best values with each axial clearance larger or smaller by `EXPECTATION_FACTOR`.

    At the edge at which an end wall begins to limit the lean the model is steep on one side, and an
    interval by slopes would not see how little is lost far away on the other. A factor of 4 changes
    no interval of 24 machines of benchmarks/truth/identify.py.
    """
    return [
        _fitted_beside(
            problem, theta, i, min(max(theta[i], MINOR * unknown.scale) * factor, unknown.most)
        )
        for i, unknown in enumerate(problem.unknowns)
        if unknown.name == "axial_clearance" and len(theta) > 1
        for factor in (EXPECTATION_FACTOR, 1.0 / EXPECTATION_FACTOR)
    ]


def _fitted_beside(problem: LeastSquares, theta: np.ndarray, i: int, value: float) -> np.ndarray:
    """Best values, from `theta` on, with the i-th unknown held at `value`, (p,)."""
    free = np.arange(len(theta)) != i

    def embedded(x: np.ndarray) -> np.ndarray:
        return np.insert(x, i, value)

    if not free.any():
        return embedded(theta[free])
    unknowns = tuple(unknown for k, unknown in enumerate(problem.unknowns) if free[k])
    slopes = problem.jacobian
    part = replace(
        problem,
        unknowns=unknowns,
        predict=lambda x: problem.predict(embedded(x)),
        jacobian=None if slopes is None else lambda x: np.delete(slopes(embedded(x)), i, axis=1),
    )
    return embedded(fit(part, theta[free], _LATER_STEPS).theta)


def _starts(problem: LeastSquares, start: np.ndarray) -> list[np.ndarray]:
    """Starts of a search: the given one, it with end walls near and far or with the cages of
    rolling bearings turned by quarters of their period, and the best of a Latin hypercube."""
    walls = np.array([unknown.name == "axial_clearance" for unknown in problem.unknowns])
    starts = [start]
    if walls.any():
        starts += [
            np.where(walls, factor * start, start)
            for factor in (1.0 / EXPECTATION_FACTOR, EXPECTATION_FACTOR)
        ]
    cages = np.array([unknown.name == "cage_angle" for unknown in problem.unknowns])
    if cages.any():
        starts += [np.where(cages, start + part * problem.scale, start) for part in (1, 2, 3)]
    spread = qmc.LatinHypercube(len(start), rng=0).random(_STARTS_TRIED)
    options = np.minimum(start * EXPECTATION_FACTOR ** (2.0 * spread - 1.0), problem.limits[1])
    options = np.where(cages, start + 4.0 * spread * problem.scale, options)
    return [*starts, min(options, key=problem.cost)]


def _excess(residual: np.ndarray, error: np.ndarray, freedom: float) -> float:
    """Standard deviation that, added to the errors, makes the residuals as large as expected.

    That is, their sum of squares in standard errors equal to the degrees of freedom.
    """

    def beyond(excess: float) -> float:
        return float(np.square(residual / np.hypot(error, excess)).sum()) - freedom

    high = float(np.sqrt(np.square(residual).sum() / max(freedom, TINY)))  # for errors of zero
    return float(brentq(beyond, 0.0, 2.0 * high)) if beyond(0.0) > 0.0 else 0.0


def solve(problem: LeastSquares, start: np.ndarray | None = None) -> tuple[Estimate, ...]:
    """Estimates of a measurement's unknowns: values with 95 % intervals, or why it cannot tell.

    The search begins at `start` (p,), or at the nominal values.
    """
    return search(problem, start).estimates()
