"""Which causes of errors predict best what a fit has not seen, by more than chance.

Forward selection with cross-validation. Of all causes that are not in the model yet, each is fitted
to all rows but those of a fold, which it then predicts, fold by fold. The cause is added whose
predictions are best, if they are better by more than chance (`improves`) than those without it;
among causes that do as well, the one with the fewest unknowns. When none is left, those causes are
dropped again without which the predictions are not worse by more than chance.

Features that have to be chosen (play's friction and transition, the place of a jump) are chosen
from a table, anew by the rows of each fold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t as student

from jointplay.base.errors import JointplayError
from jointplay.estimate.kinematic_model import Term
from jointplay.estimate.least_squares import basis
from jointplay.estimate.pose_problem import Fitted, Problem
from jointplay.estimate.static_poses import StaticPoses
from jointplay.estimate.unknowns import ROUNDING, TINY

CHANCE = 0.1
"""Probability of chance below which a gain counts, one-sided: judged. On 59 random robots
(benchmarks/truth/calibrate.py) with 0.05 or 0.2 one play more or less is told,
none where there is none, and as many intervals hold."""
LEAST_GAIN = 0.01
"""Part by which held-back errors must shrink at least (RMS): judged. With thousands of poses any
cause is beyond chance; on 59 random robots between 0 and 0.02 only more or fewer offsets are told,
and all intervals hold alike."""


@dataclass(frozen=True)
class Step:
    """One model that was tried: its causes, and its errors in training and on held-back poses."""

    terms: tuple[Term, ...]
    fitted: Fitted = field(repr=False)
    chosen: Mapping[int, int]
    """Choice of columns whose feature depends on one, by their numbers."""
    errors: Mapping[str, Sequence[np.ndarray]] = field(repr=False)
    """By kind (n, components) [SI]: ``training``, and ``held_back``, each row by a fit that has not
    seen it."""
    within: np.ndarray = field(repr=False)
    """Whether each held-back row lay in its predicted 95 % region, shape (n,)."""
    excess: float
    """By which held-back errors exceed what the fits predict."""
    added: str = ""
    """The term that it has beyond those kept before, or lacks (-)."""
    kept: bool = True
    gain: float = 0.0
    """Mean reduction of the squared weighted error of held-back rows."""
    margin: float = 0.0
    """What the gain had to exceed; of a term that is dropped, what it did not."""

    @property
    def unknowns(self) -> int:
        return len(self.fitted.theta)

    @property
    def loss(self) -> np.ndarray:
        """Squared weighted errors of the held-back rows, shape (n,)."""
        parts = zip(self.errors["held_back"], self.fitted.problem.error, strict=True)
        return np.asarray(sum(np.sum((part / size) ** 2, axis=1) for part, size in parts))

    @property
    def training(self) -> tuple[float, ...]:
        """RMS of the errors of each kind, lengths of vectors [SI]."""
        return self._rms("training")

    @property
    def held_back(self) -> tuple[float, ...]:
        return self._rms("held_back")

    def _rms(self, which: str) -> tuple[float, ...]:
        sums = [np.sum(np.square(vectors), axis=-1) for vectors in self.errors[which]]
        return tuple(float(np.sqrt(square.mean())) for square in sums)

    def describe(self) -> dict[str, Any]:
        names = ("added", "unknowns", "training", "held_back", "kept", "gain", "margin")
        numbers = {name: getattr(self, name) for name in names}
        return {"terms": [str(term) for term in self.terms], **numbers}


class Gain(NamedTuple):
    """Of predictions of held-back rows by one model over another's."""

    counts: bool
    """Whether errors shrink by more than chance."""
    mean: float
    """Mean reduction of the squared weighted error."""
    margin: float
    """What the mean had to exceed."""


def improves(before: np.ndarray, after: np.ndarray, units: np.ndarray) -> Gain:
    """Whether losses of held-back rows shrink by more than chance.

    The mean of the differences over independent units (rows, points, groups) must exceed the
    one-sided 90 % quantile of Student's t times its standard error, and the root of the mean loss
    must shrink by one per cent.

    Args:
        before, after: squared weighted errors of the rows, shape (n,).
        units: number of the unit of each row, shape (n,).
    """
    names = np.unique(units)
    gains = np.array([np.mean(before[units == u] - after[units == u]) for u in names])
    m = len(gains)
    margin = np.inf if m < 2 else student.ppf(1.0 - CHANCE, m - 1) * gains.std(ddof=1) / np.sqrt(m)
    smaller = np.sqrt(after.mean()) < (1.0 - LEAST_GAIN) * np.sqrt(before.mean())
    return Gain(bool(gains.mean() > margin and smaller), float(gains.mean()), float(margin))


def held_back(poses: StaticPoses, folds: int | str) -> tuple[list[np.ndarray], str]:
    """Rows held back together, and how a report says it."""
    n = len(poses)
    choices = "a number from 2 to the number of rows, rows, groups or points"
    if folds not in ("rows", "groups", "points") and not isinstance(folds, int):
        raise JointplayError(f"folds must be {choices}, got {folds!r}")
    if poses.point is not None and folds not in ("groups", "points"):
        folds = "groups" if len(set(poses.group or ())) > 1 else "points"
    labels = {"groups": poses.group, "points": poses.point}.get(str(folds))
    if folds in ("groups", "points"):
        names = list(dict.fromkeys(labels or ()))
        if len(names) < 2:
            raise JointplayError(
                f"{poses.source}: to hold back {folds}, at least two are needed, got {len(names)}"
            )
        held = [np.flatnonzero(np.array(labels) == name) for name in names]
        text = f"each of {len(names)} {folds}"
    else:
        k = n if folds == "rows" else int(folds)
        if not 2 <= k <= n:
            raise JointplayError(f"folds must be {choices} ({n}), got {folds!r}")
        held = [np.flatnonzero(np.arange(n) % k == i) for i in range(k)]
        which = {2: "second", 3: "third"}.get(k, f"{k}th")
        text = f"each of {n} poses" if k == n else f"every {which} of {n} poses, {k} folds"
    return held, text


@dataclass
class Selection:
    """Fits of sets of terms to all rows and to folds, and what was tried."""

    base: Problem
    """Without columns."""
    folds: list[np.ndarray]
    """Rows that are held back together."""
    start: np.ndarray
    """Unknowns besides the coefficients, where the last fit had them."""
    joints: tuple[str, ...]
    """Whose play is asked for."""
    tick: Callable[[], object] = int
    """Called after each fit."""
    steps: list[Step] = field(default_factory=list)
    excess: float = 1.0
    """By which held-back errors exceed what the fits predict; intervals are enlarged by it."""

    @cached_property
    def rows(self) -> np.ndarray:
        return np.arange(len(self.base.poses))

    @cached_property
    def units(self) -> np.ndarray:
        return self.base.poses.measured.units

    def fit(
        self, terms: Sequence[Term], rows: np.ndarray, preferred: Mapping[int, int] | None = None
    ) -> tuple[Fitted, dict[int, int]]:
        """Some terms, with features chosen as these rows have them, fitted to these rows; and the
        choices by number of column: of those that these rows do not tell apart, the preferred."""
        columns = [column for term in terms for column in self.base.poses.columns(term)]
        start = np.concatenate([self.start, np.zeros(len(columns))])
        fitted, chosen = self.base.having(columns).fit(rows, start), {}
        open_columns = [i for i, column in enumerate(columns) if column.options is not None]
        # Each in turn takes the best of its features, once more with the others as they then are.
        for _ in range(2):
            for i in open_columns:
                gains, *_ = self.gains(self.base.having(columns), i, fitted.theta, rows)
                best = int(gains.argmax())
                liked = (preferred or {}).get(i, best)
                if gains[liked] >= gains[best] * (1.0 - ROUNDING):
                    best = liked
                chosen[i] = best
                options = columns[i].options
                assert options is not None
                columns[i] = replace(columns[i], feature=options[:, best])
            if open_columns:
                fitted = self.base.having(columns).fit(rows, fitted.theta)
        return fitted, chosen

    def gains(
        self, problem: Problem, i: int, theta: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What each choice of the i-th column's feature does to first order, beside all other
        unknowns: by how much the cost falls, and the coefficient, shape (choices,) each; and all
        unknowns with it, shape (p, choices).

        As in the theorem of Frisch, Waugh and Lovell: what is left of the feature beside the others
        is fitted to the residuals alone.
        """
        column, k = problem.columns[i], len(problem.frame) + i
        bare = replace(column, feature=np.ones(len(self.rows)))
        least = problem.having([*problem.columns[:i], bare, *problem.columns[i + 1 :]]).at(rows)
        owner, options = self.base.owner(rows), column.options
        assert options is not None
        theta = np.where(np.arange(len(theta)) == k, 0.0, theta)
        slope, residual = least.effects(theta), least.residual(theta)
        remaining = least.project(np.delete(slope, k, axis=1))
        span = basis(remaining)
        features = np.ones((len(slope), options.shape[1]))  # also of what was known before
        features[: len(owner)] = options[rows][owner]
        features[len(owner) : len(least.measured)] = 0.0
        effect = least.project(slope[:, k, None] * features)
        apart = effect - span @ (span.T @ effect)
        along, square = -(residual @ apart), np.maximum(np.sum(apart**2, axis=0), TINY)
        size = along / square
        moved = -np.linalg.lstsq(remaining, residual[:, None] + effect * size, rcond=None)[0]
        moved = np.insert(moved, k, size, axis=0)
        return (
            along**2 / square,
            least.scale[k] * size,
            theta[:, None] + least.scale[:, None] * moved,
        )

    def tried(self, terms: Sequence[Term]) -> Step:
        """A set of terms, fitted to all rows and to each fold."""
        n = len(self.rows)
        fitted, chosen = self.fit(terms, self.rows)
        self.start = fitted.theta[: len(self.start)]
        self.tick()
        training = fitted.problem.errors(fitted.theta, self.rows)
        held = [np.zeros_like(errors) for errors in training]
        within, excess = np.zeros(n, bool), np.zeros(n)
        for out in self.folds:
            fit, _ = self.fit(terms, np.setdiff1d(self.rows, out), chosen)
            for of_kind, of_fold in zip(held, fit.problem.errors(fit.theta, out), strict=True):
                of_kind[out] = of_fold
            within[out], excess[out] = fit.within(out)
            self.tick()
        size = max(1.0, float(np.sqrt(np.mean(excess))))
        errors = {"training": training, "held_back": held}
        return Step(tuple(terms), fitted, chosen, errors, within, size)

    def run(
        self,
        name: str,
        always: Sequence[Term],
        candidates: Sequence[Sequence[Term]],
        fits: Callable[[Sequence[Term], Sequence[Term]], bool] = lambda now, further: True,
    ) -> Step:
        """The model with those candidates that predict better than chance, and no needless ones.

        Args:
            name: of the model with the terms alone that are always in it.
            always: terms that are in every model.
            candidates: terms that may be added together, if they have columns.
            fits: whether some may be added to those that a model has.
        """
        now = replace(self.tried(always), added=name)
        self.steps.append(now)
        candidates = [terms for terms in candidates if any(map(self.base.poses.columns, terms))]
        while True:
            tried: list[Step] = []
            better: list[Step] = []
            for terms in candidates:
                further = [term for term in terms if term not in now.terms]
                if not further or not fits(now.terms, further):
                    continue
                added = f"+ {' + '.join(term.short for term in further)}"
                step = self.tried([*now.terms, *further])
                gain = improves(now.loss, step.loss, self.units)
                step = replace(step, added=added, kept=False, gain=gain.mean, margin=gain.margin)
                tried.append(step)
                better += [step] if gain.counts else []
            if not better:
                self.steps += tried
                break
            best = self._simplest(better)
            self.steps += [step for step in tried if step is not best]
            now = replace(best, kept=True)
            self.steps.append(now)
        now = self._dropped(now, len(always))
        self.excess = now.excess
        return now

    def _simplest(self, steps: Sequence[Step]) -> Step:
        """The best of some models, or the simplest that it does not beat by more than chance."""
        best = min(steps, key=lambda step: float(step.loss.mean()))
        simpler = [
            step for step in steps
            if step.unknowns < best.unknowns
            and not improves(step.loss, best.loss, self.units).counts
        ]  # fmt: skip
        return min(simpler or [best], key=lambda step: (step.unknowns, float(step.loss.mean())))

    def _dropped(self, now: Step, always: int) -> Step:
        """The model without terms that later ones explain: without them, nothing is worse."""
        while len(now.terms) > always:
            needless = []
            for term in now.terms[always:]:
                without = self.tried([member for member in now.terms if member is not term])
                gain = improves(without.loss, now.loss, self.units)
                if not gain.counts:
                    name = f"- {term.short}"
                    needless.append(
                        replace(without, added=name, gain=gain.mean, margin=gain.margin)
                    )
            if not needless:
                break
            now = min(needless, key=lambda step: step.gain)
            self.steps.append(now)
        return now
