"""Selection of causes of errors by cross-validation: those that predict held-back poses better.

Forward selection, then backward elimination:

1. Each cause that is not in the model yet is fitted with those that are, to all rows but those of a
   fold, which are then predicted, fold by fold.
2. The cause whose predictions are best is added if they are better than those without it by more
   than chance (`known.improves`); of causes that do as well, the one with the fewest unknowns.
3. When no cause is left that does, those are dropped without which predictions are not worse by
   more than chance.

Features with parameters that are not linear (friction and transition of play, the place of a jump)
are chosen from a table, anew for the rows of each fold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.estimate.kinematic_model import Term
from jointplay.estimate.known import improves
from jointplay.estimate.least_squares import basis
from jointplay.estimate.pose_problem import Fitted, Problem
from jointplay.estimate.static_poses import StaticPoses
from jointplay.estimate.unknowns import ROUNDING, TINY


@dataclass(frozen=True)
class Step:
    """A model that was tried: its causes, and its errors in training and on held-back poses."""

    terms: tuple[Term, ...]
    fitted: Fitted = field(repr=False)
    chosen: Mapping[int, int]
    """Number of the chosen feature, by the number of each column that has several."""
    errors: Mapping[str, Sequence[np.ndarray]] = field(repr=False)
    """Errors of each kind, (n, components) [SI]: in ``training``, and ``held_back``, each row by a
    fit that has not seen it."""
    within: np.ndarray = field(repr=False)
    """Whether each held-back row lay in its predicted 95 % region, shape (n,)."""
    excess: float
    """RMS of held-back errors over what the fits predict of it, at least 1."""
    added: str = ""
    """The term that it has beyond those kept before (+), or lacks (-)."""
    kept: bool = True
    """Whether it became the model to which further terms were added."""
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
        """RMS length of the errors of each kind, of rows that the fit has seen [SI]."""
        return self._rms("training")

    @property
    def held_back(self) -> tuple[float, ...]:
        """RMS length of the errors of each kind, of rows that the fit has not seen [SI]."""
        return self._rms("held_back")

    def _rms(self, which: str) -> tuple[float, ...]:
        sums = [np.sum(np.square(vectors), axis=-1) for vectors in self.errors[which]]
        return tuple(float(np.sqrt(square.mean())) for square in sums)

    def describe(self) -> dict[str, Any]:
        names = ("added", "unknowns", "training", "held_back", "kept", "gain", "margin")
        numbers = {name: getattr(self, name) for name in names}
        return {"terms": [str(term) for term in self.terms], **numbers}


def held_back(poses: StaticPoses, folds: int | str) -> tuple[list[np.ndarray], str]:
    """The folds, as numbers of the rows that are held back together, and a text that names them."""
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
    """A selection under way: the poses, their folds, and the models tried so far."""

    base: Problem
    """The measurement, without columns."""
    folds: list[np.ndarray]
    """Rows that are held back together."""
    start: np.ndarray
    """Unknowns besides the coefficients, where the last fit had them."""
    joints: tuple[str, ...]
    """Joints whose play is asked for."""
    tick: Callable[[], object] = int
    """Called after each fit, for a progress bar."""
    steps: list[Step] = field(default_factory=list)
    """Models that were tried, in order."""
    excess: float = 1.0
    """`Step.excess` of the selected model; intervals are enlarged by it."""

    @cached_property
    def rows(self) -> np.ndarray:
        """Numbers of all rows, (n,)."""
        return np.arange(len(self.base.poses))

    @cached_property
    def units(self) -> np.ndarray:
        """Number of the independent unit of each row, (n,)."""
        return self.base.poses.measured.units

    def fit(
        self, terms: Sequence[Term], rows: np.ndarray, preferred: Mapping[int, int] | None = None
    ) -> tuple[Fitted, dict[int, int]]:
        """Fit terms to some rows, with the features that fit these rows best.

        Returns:
            The fit; and the number of the chosen feature, by the number of each column that has
            several. Of features that these rows do not tell apart it is the preferred one.
        """
        columns = [column for term in terms for column in self.base.poses.columns(term)]
        start = np.concatenate([self.start, np.zeros(len(columns))])
        fitted, chosen = self.base.having(columns).fit(rows, start), {}
        open_columns = [i for i, column in enumerate(columns) if column.options is not None]
        # Coordinate descent: each column in turn takes the best of its features; a second round
        # sees those that the others took.
        for _ in range(2):
            for i in open_columns:
                gains, *_ = self.gains(self.base.having(columns), i, fitted.theta, rows)
                best = int(gains.argmax())
                favourite = (preferred or {}).get(i, best)
                if gains[favourite] >= gains[best] * (1.0 - ROUNDING):
                    best = favourite
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
        """Effect of each choice of the i-th column's feature, to first order.

        By the theorem of Frisch, Waugh and Lovell: the part of the feature that is orthogonal to
        all other unknowns' effects is fitted to the residuals alone.

        Returns:
            By how much the cost falls, and the coefficient, shape (choices,) each; all unknowns
            with it, shape (p, choices).
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
        # The slope is that of a feature of one, so each row's is multiplied by its own feature.
        # Numbers of no row (distances of points) count as not depending on it; the prior's row at
        # the end stays.
        features = np.ones((len(slope), options.shape[1]))
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
        """The model of these terms: fitted to all rows, and tested on each fold."""
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
        """Select the candidates that predict better than chance.

        Args:
            name: of the model that has `always` alone, for tables.
            always: terms that are in every model.
            candidates: sets of terms, each of which is added as a whole; those without columns are
                left out.
            fits: whether terms (second argument) may be added to those of a model (first).
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
        """The model with the best predictions, or the simplest that it does not beat by more than
        chance."""
        best = min(steps, key=lambda step: float(step.loss.mean()))
        simpler = [
            step for step in steps
            if step.unknowns < best.unknowns
            and not improves(step.loss, best.loss, self.units).counts
        ]  # fmt: skip
        return min(simpler or [best], key=lambda step: (step.unknowns, float(step.loss.mean())))

    def _dropped(self, now: Step, always: int) -> Step:
        """Drop terms, but the first `always`, without which predictions are not worse by more than
        chance: those that later terms explain."""
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
