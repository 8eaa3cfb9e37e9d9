"""Which causes of errors predict best what a fit has not seen, by more than chance.

A measurement of static poses is a `Problem`: it says what a model predicts by its own unknowns and
by the coefficients of columns, the causes. The rest is the same of all: causes are added as long as
held-back rows are predicted better, dropped where later ones explain them, and told with intervals
beside all that might stand in for them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import pinocchio as pin
from scipy.stats import f as fisher
from scipy.stats import t as student

from jointplay.base import tables
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.tables import Table
from jointplay.base.units import readable
from jointplay.estimate.kinematic_model import COORDINATE, PARTS, Column, Poses, Term
from jointplay.estimate.least_squares import Fit, LeastSquares, basis, minimum
from jointplay.estimate.machine import preset_found
from jointplay.estimate.static_poses import StaticPoses
from jointplay.estimate.unknowns import Estimate, Loop, Unknown, by_label, data, listed

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.presets import Preset

CHANCE = 0.1
"""Probability of chance below which a gain counts, one-sided."""
LEAST_GAIN = 0.01
"""Part by which held-back errors must shrink at least (RMS)."""
RARER_SIGN = 0.05
"""Part of the poses in which a joint must be loaded the other way, or its play cannot be told."""
LARGE_EXCESS = 1.2
"""Excess of held-back errors from which on it is said."""
TWO_UNKNOWNS = 5.99
"""95 % quantile of chi-square with two degrees of freedom, friction's and transition's."""
SMOOTHINGS = (0.25, 1.0, 4.0)
"""Times a transition that is given, for which a bound must hold."""
_ROUNDING = 1e-9
"""Part by which gains of choices differ that are the same but for rounding."""
CONSTANT = ("offset", "placement")
"""Kinds of terms that are the same in every pose."""
_BY_LOAD = ("play", "compliance", "gear", "hysteresis")
"""Kinds of terms that turn a joint by its load or by the way it came."""
_NOT_DETERMINED = "not determined (other causes do the same, or nothing shows it)"


@dataclass(frozen=True)
class Problem(ABC):
    """A measurement of static poses, and columns that may explain it."""

    poses: Poses
    error: tuple[float, ...]
    """Standard deviations about the model, by kind of number [SI]."""
    columns: tuple[Column, ...] = ()

    linear: ClassVar[bool] = False
    """Whether predictions are linear in all unknowns."""

    @property
    @abstractmethod
    def kinds(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """What was measured in a row: by the name of each kind of number, unit and components."""

    @property
    @abstractmethod
    def frame(self) -> tuple[Unknown, ...]:
        """Unknowns besides the coefficients."""

    @abstractmethod
    def at(self, rows: np.ndarray) -> LeastSquares:
        """The measurement at some rows: by kind a number for each row and component, then others.
        Errors are weights, and the groups are of `grouped`."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        return (*self.frame, *(column.unknown for column in self.columns))

    @cached_property
    def features(self) -> np.ndarray:
        """Of the columns, shape (n, k)."""
        none = np.zeros((len(self.poses), 0))
        return np.column_stack([none, *(column.feature for column in self.columns)])

    def owner(self, rows: np.ndarray) -> np.ndarray:
        """Each number's row among these, but others'."""
        return np.concatenate(
            [np.repeat(np.arange(len(rows)), len(axes)) for _, axes in self.kinds.values()]
        )

    def grouped(self, rows: np.ndarray, others: int = 0) -> np.ndarray:
        """Numbers of a unit of poses have the same number; so many others, each its own, (m,)."""
        units = self.poses.measured.units[rows][self.owner(rows)]
        return np.concatenate([units, -1 - np.arange(others)])

    def having(self, columns: Iterable[Column]) -> Self:
        return replace(self, columns=tuple(columns))

    def errors(self, theta: np.ndarray, rows: np.ndarray) -> list[np.ndarray]:
        """Measured less predicted, of each kind (n, components) [SI]."""
        least = self.at(rows)
        off, found, begin = -least.error * least.residual(theta)[: len(least.error)], [], 0
        for _, axes in self.kinds.values():
            end = begin + len(rows) * len(axes)
            found.append(off[begin:end].reshape(len(rows), -1))
            begin = end
        return found

    def fit(self, rows: np.ndarray, start: np.ndarray) -> Fitted:
        """Least squares of some rows, from unknowns (p,)."""
        least = self.at(rows)
        if self.linear:
            slope = least.project(least.effects(start))
            step = np.linalg.lstsq(slope, least.residual(start), rcond=None)[0]
            theta = start - least.scale * step
        else:
            theta = minimum(least, start)
        return Fitted(problem=self, rows=rows, least=least, theta=theta)


@dataclass(frozen=True, kw_only=True)
class Fitted(Fit):
    """Where least squares of some rows ended."""

    problem: Problem
    rows: np.ndarray

    @property
    def coefficients(self) -> np.ndarray:
        return self.theta[len(self.problem.frame) :]

    def within(self, out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether held-back rows' first kind lies in the 95 % regions that this fit predicts, of
        its unknowns' covariance and of the scatter about it; and their mean square over it."""
        least, axes = self.problem.at(out), len(next(iter(self.problem.kinds.values()))[1])
        m, shape = len(out) * axes, (len(out), axes)
        slope = least.project(least.effects(self.theta))[:m].reshape(*shape, -1)
        off = least.residual(self.theta)[:m].reshape(shape)
        own = 1.0 - np.sum(least.projected[:m] ** 2, axis=1).reshape(shape)  # about their means
        spread = slope @ self.covariance @ np.swapaxes(slope, 1, 2)
        spread = self.stretch**2 * (spread + np.maximum(own, 1e-9)[:, :, None] * np.eye(axes))
        distance = np.einsum("na,na->n", off, np.linalg.solve(spread, off[:, :, None])[:, :, 0])
        return distance <= axes * fisher.ppf(0.95, axes, max(self.freedom, 1.0)), distance / axes


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
        return tuple(float(np.sqrt(one.mean())) for one in sums)

    def describe(self) -> dict[str, Any]:
        names = ("added", "unknowns", "training", "held_back", "kept", "gain", "margin")
        numbers = {name: getattr(self, name) for name in names}
        return {"terms": [str(term) for term in self.terms], **numbers}


@dataclass(frozen=True)
class Calibration:
    """What static poses tell of the causes of errors; SI units."""

    poses: StaticPoses
    steps: tuple[Step, ...]
    """All models that were tried, in order; the first has no causes but those always in it."""
    coefficients: tuple[Estimate, ...]
    """Of the terms that were kept, but play, of which `play` has what is told; with all candidates
    free."""
    play: tuple[Estimate, ...]
    """By the side of the load, of every joint; all candidates and everybody's play are free."""
    folds: str
    """What was held back, in words."""
    notes: tuple[str, ...] = ()
    effects: tuple[Estimate, ...] = ()
    """What each term that was kept moves the tool by, RMS over the poses, beyond what other places
    of base and tool would do [m]."""
    whole: Fitted | None = field(default=None, repr=False)
    """With all candidates and everybody's play free, which `play` and `coefficients` are of."""

    def step(self) -> Step:
        return [one for one in self.steps if one.kept][-1]

    @property
    def mechanism(self) -> Mechanism:
        return self.step().fitted.problem.poses.mechanism

    @property
    def kept(self) -> tuple[Term, ...]:
        return self.step().terms

    @property
    def kinds(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """What was measured: unit and components by kind."""
        return self.step().fitted.problem.kinds

    @property
    def within(self) -> np.ndarray:
        """Which held-back rows lay in their predicted 95 % regions, shape (n,)."""
        return self.step().within

    def __getitem__(self, label: str) -> Estimate:
        return by_label(self.coefficients, label)

    def play_of(self, joint: str) -> Estimate:
        """What is told of a joint's play by the side of its load."""
        for one in self.play:
            if one.joint == joint:
                return one
        raise MissingName("joint", joint, [one.joint for one in self.play])

    def corrections(self) -> dict[str, pin.SE3]:
        """By joint, where the kept model has its frame, in the nominal one and with the joint at
        zero by its encoder: what `placement` and `offset` find. `bridges.urdf.to_urdf` writes them
        into a URDF, whose tool is then where the model has it, but for causes that depend on the
        pose or on loads."""
        fitted = self.step().fitted
        poses, moved = fitted.problem.poses, np.zeros((len(fitted.problem.poses.names), 7))
        for one, value in zip(fitted.problem.columns, fitted.coefficients, strict=True):
            if one.term.kind in CONSTANT:
                moved[one.index, one.target] += value
        found = {}
        for name, axis, turns, own in zip(poses.names, poses.axis, poses.turns, moved, strict=True):
            if own.any():
                way = own[COORDINATE] * axis
                zero = (pin.exp3(way), np.zeros(3)) if turns else (np.eye(3), way)
                found[name] = pin.SE3(pin.exp3(own[3:6]), own[:3]) * pin.SE3(*zero)
        return found

    def preset(self, robot: str | Path | None = None) -> Preset:
        """The robot's joints with what was found: play and compliance as gears, and bearings, seats
        and gears of the scenario with theirs.

        Args:
            robot: name or path of the robot; None: the file of its URDF.

        Raises:
            JointplayError: nothing of it was found.
        """
        found = [
            one for one in self.estimates
            if one.unknown.name in PARTS.values()
            and one.identified and one.found and one.value > 0.0
        ]  # fmt: skip
        if not found:
            raise JointplayError(
                "these poses tell nothing of play or stiffness, which a preset would have"
            )
        return preset_found(self.mechanism, found, self.poses.source, robot)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Of each joint whose play was fitted: how far its load and the way it came turn it."""
        order = {joint: k for k, joint in enumerate(self.poses.joints)}
        made = () if self.whole is None else _loops(self.whole)
        return tuple(sorted(made, key=lambda one: order[one.joint]))

    @property
    def models(self) -> Table:
        columns = [
            tables.Column("model", [one.added for one in self.steps]),
            tables.Column("unknowns", [one.unknowns for one in self.steps]),
        ]
        for what in ("training", "held back"):
            errors = np.array([getattr(one, what.replace(" ", "_")) for one in self.steps])
            for k, (unit, _) in enumerate(self.kinds.values()):
                columns.append(tables.Column(f"{what}{', turn' * k}", errors[:, k], unit))
        columns.append(tables.Column("kept", ["yes" if one.kept else "no" for one in self.steps]))
        return Table(columns)

    @property
    def sentence(self) -> str:
        step, kinds = self.step(), self.kinds
        sizes = zip(kinds.values(), step.held_back, strict=True)
        errors = " and ".join(readable(float(size), unit, 3) for (unit, _), size in sizes)
        causes = ", ".join(map(str, step.terms)) or "no cause"
        return (
            f"These poses show {causes}: with it, poses that the fit has not seen are predicted "
            f"to {errors} (RMS)"
        )

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Play and coefficients, by joint."""
        order = {joint: k for k, joint in enumerate(self.poses.joints)}
        found = (*self.play, *self.coefficients)
        return tuple(sorted(found, key=lambda one: order.get(one.joint, len(order))))

    def brief(self) -> str:
        """What was found, without how."""
        return listed(self.estimates, vague=_NOT_DETERMINED)

    def __str__(self) -> str:
        poses = self.poses
        units = "points" if poses.point is not None else "groups" if poses.group else "rows"
        lines = [
            *self.notes,
            str(self.models),
            f"{int(self.within.sum())} of {len(self.within)} held-back {next(iter(self.kinds))}s "
            "lie in their predicted 95 % regions",
            f"held back: {self.folds}; a term is kept if the squared errors of held-back "
            f"{units} shrink by more than chance (one-sided 90 %) and their RMS by 1 %",
        ]
        lines += ["", self.brief()]
        if self.effects:
            head = "moves the tool by (RMS), base and tool placed best without it"
            lines += ["", listed(self.effects, head)]
        return "\n".join(lines)

    @property
    def rows(self) -> list[Estimate]:
        """Errors of all models, effects, and what was found by joint [SI]."""
        errors = []
        for one in self.steps:
            name = " + ".join(map(str, one.terms)) or one.added
            note = "kept" if one.kept else "not kept"
            for what in ("training", "held_back"):
                for (kind, (unit, _)), size in zip(
                    self.kinds.items(), getattr(one, what), strict=True
                ):
                    error = Unknown("", f"{what} {kind}: {name}", unit, np.nan)
                    errors.append(Estimate(error, size, note=note))
        return [*errors, *self.effects, *self.estimates]

    @property
    def data(self) -> Table:
        return data(self.rows)

    @property
    def residuals(self) -> Table:
        """Errors of every pose, in training and held back."""
        count, group, point = len(self.poses), self.poses.group, self.poses.point
        columns = [
            tables.Column("row", range(1, count + 1)),
            tables.Column("group", group or [""] * count),
            tables.Column("point", point or [""] * count),
        ]
        for what, errors in self.step().errors.items():
            for (unit, axes), values in zip(self.kinds.values(), errors, strict=True):
                for axis, one in zip(axes, values.T, strict=True):
                    columns.append(tables.Column(f"{what.replace('_', ' ')} {axis}", one, unit))
        return Table(columns)

    def describe(self) -> dict[str, Any]:
        error = self.step().fitted.problem.error
        return {
            "joints": list(self.poses.joints),
            "poses": len(self.poses),
            "held_back": self.folds,
            "within_region": [bool(one) for one in self.within],
            "error": dict(zip(self.kinds, error, strict=True)),
            "kept": [str(term) for term in self.kept],
            "models": [one.describe() for one in self.steps],
            "unknowns": [one.describe() for one in self.estimates],
            "effects": [one.describe() for one in self.effects],
            "notes": list(self.notes),
        }


def _loops(fitted: Fitted) -> Iterator[Loop]:
    """By what a turn of the joint itself would do to what was measured in each row."""
    problem, rows = fitted.problem, fitted.rows
    poses, owner, first = problem.poses, problem.owner(rows), len(problem.frame)
    left = -fitted.residual[: len(owner)]
    mine = (owner[:, None] == np.arange(len(rows))).T  # (n, numbers)
    turns = fitted.coefficients * problem.features
    for i, one in enumerate(problem.columns):
        if one.term.kind != "play":
            continue
        bare = replace(one, feature=np.ones(len(poses)))
        plain = problem.having([*problem.columns[:i], bare, *problem.columns[i + 1 :]]).at(rows)
        effect = plain.effects(fitted.theta)[: len(owner), first + i] / one.unknown.scale
        own = sum(
            turns[:, k] for k, other in enumerate(problem.columns)
            if other.index == one.index and other.target == COORDINATE and other.moves is None
            and other.term.kind in _BY_LOAD
        )  # fmt: skip
        unit = one.unknown.unit
        yield Loop.beside(
            one.joint,
            (poses.load[rows, one.index], "load", "N" if unit == "m" else "N*m"),
            np.asarray(own)[rows],
            unit,
            np.sign(poses.approach[rows, one.index]).astype(int),
            mine * effect,
            mine * left,
        )


Gain = tuple[bool, float, float]
"""Whether errors shrink by more than chance; the mean reduction; what it had to exceed."""


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
    return bool(gains.mean() > margin and smaller), float(gains.mean()), float(margin)


def one_sided(side: np.ndarray) -> str:
    """Why a load on these sides, negative or positive (n,), tells nothing of play; empty if it can
    tell."""
    rarer = int(min((side > 0).sum(), (side < 0).sum()))
    if rarer >= max(RARER_SIGN * len(side), 2.0):
        return ""
    times = "never" if not rarer else f"in only {rarer} of {len(side)} poses"
    return f"its load is on the other side {times}"


def held_back(poses: StaticPoses, folds: int | str) -> tuple[list[np.ndarray], str]:
    """Rows held back together, and words."""
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
        words = f"each of {len(names)} {folds}"
    else:
        k = n if folds == "rows" else int(folds)
        if not 2 <= k <= n:
            raise JointplayError(f"folds must be {choices} ({n}), got {folds!r}")
        held = [np.flatnonzero(np.arange(n) % k == i) for i in range(k)]
        which = {2: "second", 3: "third"}.get(k, f"{k}th")
        words = f"each of {n} poses" if k == n else f"every {which} of {n} poses, {k} folds"
    return held, words


@dataclass
class Selection:
    """Fits of sets of terms to all rows and to folds, and what was tried."""

    base: Problem
    """Without columns."""
    folds: list[np.ndarray]
    """Rows that are held back together."""
    start: np.ndarray
    """Unknowns besides the coefficients, where they were found last."""
    joints: tuple[str, ...]
    """Of whose play something is to be told."""
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
        """Some terms, with features chosen as these rows have them, fitted to these rows; and what
        was chosen by number of column, of what these rows do not tell apart the preferred."""
        made = [column for term in terms for column in self.base.poses.columns(term)]
        start = np.concatenate([self.start, np.zeros(len(made))])
        fitted, chosen = self.base.having(made).fit(rows, start), {}
        sought = [i for i, one in enumerate(made) if one.options is not None]
        # Each in turn takes the best of its features, once more with the others as they then are.
        for _ in range(2):
            for i in sought:
                gains, *_ = self.gains(self.base.having(made), i, fitted.theta, rows)
                best = int(gains.argmax())
                liked = (preferred or {}).get(i, best)
                if gains[liked] >= gains[best] * (1.0 - _ROUNDING):
                    best = liked
                chosen[i] = best
                options = made[i].options
                assert options is not None
                made[i] = replace(made[i], feature=options[:, best])
            if sought:
                fitted = self.base.having(made).fit(rows, fitted.theta)
        return fitted, chosen

    def gains(
        self, problem: Problem, i: int, theta: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What each choice of the i-th column's feature does to first order, beside all other
        unknowns: by how much the cost falls, and the coefficient, shape (choices,) each; and all
        unknowns with it, shape (p, choices)."""
        column, k = problem.columns[i], len(problem.frame) + i
        bare = replace(column, feature=np.ones(len(self.rows)))
        least = problem.having([*problem.columns[:i], bare, *problem.columns[i + 1 :]]).at(rows)
        owner, options = self.base.owner(rows), column.options
        assert options is not None
        theta = np.where(np.arange(len(theta)) == k, 0.0, theta)
        slope, left = least.effects(theta), least.residual(theta)
        others = least.project(np.delete(slope, k, axis=1))
        span = basis(others)
        features = np.ones((len(slope), options.shape[1]))  # also of what was known before
        features[: len(owner)] = options[rows][owner]
        features[len(owner) : len(least.measured)] = 0.0
        own = least.project(slope[:, k, None] * features)
        apart = own - span @ (span.T @ own)
        along, square = -(left @ apart), np.maximum(np.sum(apart**2, axis=0), 1e-300)
        size = along / square
        moved = -np.linalg.lstsq(others, left[:, None] + own * size, rcond=None)[0]
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
        held = [np.zeros_like(one) for one in training]
        within, excess = np.zeros(n, bool), np.zeros(n)
        for out in self.folds:
            fit, _ = self.fit(terms, np.setdiff1d(self.rows, out), chosen)
            for whole, part in zip(held, fit.problem.errors(fit.theta, out), strict=True):
                whole[out] = part
            within[out], excess[out] = fit.within(out)
            self.tick()
        size = max(1.0, float(np.sqrt(np.mean(excess))))
        errors = {"training": training, "held_back": held}
        return Step(tuple(terms), fitted, chosen, errors, within, size)

    def run(
        self,
        name: str,
        given: Sequence[Term],
        candidates: Sequence[Sequence[Term]],
        fits: Callable[[Sequence[Term], Sequence[Term]], bool] = lambda now, more: True,
    ) -> Step:
        """The model with those candidates that predict better than chance, and no needless ones.

        Each time the best is added, or the simplest of those that it does not beat by more than
        chance.

        Args:
            name: of the model with the given terms alone.
            given: terms that are in every model.
            candidates: terms that may be added together, if they have columns.
            fits: whether some may be added to those that a model has.
        """
        now = replace(self.tried(given), added=name)
        self.steps.append(now)
        left = [one for one in candidates if any(map(self.base.poses.columns, one))]
        while True:
            made: list[Step] = []
            better: list[Step] = []
            for many in left:
                more = [one for one in many if one not in now.terms]
                if not more or not fits(now.terms, more):
                    continue
                words = f"+ {' + '.join(one.short for one in more)}"
                new = replace(self.tried([*now.terms, *more]), added=words)
                good, gain, margin = improves(now.loss, new.loss, self.units)
                made.append(replace(new, kept=False, gain=gain, margin=margin))
                better += made[-1:] if good else []
            if not better:
                self.steps += made
                break
            best = min(better, key=lambda one: float(one.loss.mean()))
            simpler = [
                one for one in better
                if one.unknowns < best.unknowns
                and not improves(one.loss, best.loss, self.units)[0]
            ]  # fmt: skip
            best = min(simpler or [best], key=lambda one: (one.unknowns, float(one.loss.mean())))
            self.steps += [one for one in made if one is not best]
            now = replace(best, kept=True)
            self.steps.append(now)
        now = self._dropped(now, len(given))
        self.excess = now.excess
        return now

    def _dropped(self, now: Step, given: int) -> Step:
        """The model without terms that later ones explain: without them, nothing is worse."""
        while len(now.terms) > given:
            needless = []
            for term in now.terms[given:]:
                made = self.tried([one for one in now.terms if one is not term])
                worse, gain, margin = improves(made.loss, now.loss, self.units)
                if not worse:
                    name = f"- {term.short}"
                    needless.append(replace(made, added=name, gain=gain, margin=margin))
            if not needless:
                break
            now = min(needless, key=lambda one: one.gain)
            self.steps.append(now)
        return now

    def spread(self, fitted: Fitted) -> tuple[np.ndarray, np.ndarray, float]:
        """Half widths of 95 % intervals and of one-sided bounds of all unknowns [SI], and the
        stretch of costs by which they follow from the residuals' own scatter."""
        two, one = (self.excess * fitted.half_widths(part) for part in (0.95, 0.9))
        return two, one, (self.excess * fitted.stretch) ** 2

    def told(
        self, kept: Step, candidates: Sequence[Term]
    ) -> tuple[tuple[Estimate, ...], tuple[Estimate, ...], Fitted]:
        """Of the coefficients of what was kept, and of every joint's play; and the fit.

        All candidates and everybody's play are free: where one cause does what another does, the
        interval of neither rests on the other's absence.
        """
        poses = self.base.poses
        every = [*kept.terms, *(one for one in candidates if one not in kept.terms)]
        named = [one for one in every if one.kind == "play"]
        others = [one for one in every if one.kind != "play"]
        in_terms = {column.joint for term in named for column in poses.columns(term)}
        rest = tuple(n for n in self.joints if n not in in_terms and poses.loaded(n))
        model = [*others, *named, *([Term("play", rest)] if rest else [])]
        predicted = {c.joint for c in kept.fitted.problem.columns if c.term.kind == "play"}
        fitted, _ = self.fit(model, self.rows)
        half, side, stretch = self.spread(fitted)
        found, first, numbers = [], len(self.start), {}
        # Over all frictions and transitions of play that are not worse by more than chi-square's
        # quantile, each to first order from the best one: other causes stand in for them.
        ends, chosen = np.stack([fitted.theta, fitted.theta]), dict[int, np.ndarray]()
        for i, column in enumerate(fitted.problem.columns):
            if column.options is not None and column.term.kind == "play":
                gains, values, whole = self.gains(fitted.problem, i, fitted.theta, self.rows)
                near = gains >= gains.max() - TWO_UNKNOWNS * stretch
                chosen[i], whole = values[near], whole[:, near]
                ends[0] = np.minimum(ends[0], whole.min(axis=1))
                ends[1] = np.maximum(ends[1], whole.max(axis=1))
        for i, column in enumerate(fitted.problem.columns):
            if column.term.kind == "play":
                numbers[column.joint] = i
            elif column.term in kept.terms:
                k, (*_, other) = first + i, fitted.informed(first + i)
                note = other and f"acts together with {other}"
                value, width, reason = float(fitted.theta[k]), float(half[k]), fitted.why_not(k)
                both = (float(ends[0, k]) - width, float(ends[1, k]) + width)
                one = Estimate(column.unknown, value, width, reason, note=note, ends=both)
                found.append(one)
        made = []
        for joint in self.joints:
            if joint not in numbers:
                (column,) = poses.columns(Term("play", (joint,)))
                reason = "gravity does not load this joint"
                made.append(Estimate(column.unknown, 0.0, reason=reason, found=False))
                continue
            i = numbers[joint]
            k, column, value = first + i, fitted.problem.columns[i], float(fitted.coefficients[i])
            low, high = value - half[k], value + half[k]
            upper = max(value, 0.0) + side[k]
            if column.options is not None:
                near = chosen[i]
                low, high = float(near.min()) - half[k], float(near.max()) + half[k]
                upper = max(upper, max(high - half[k], 0.0) + side[k])
            else:
                upper = max(upper, self._smoothed(fitted, i))
            seen = bool(joint in predicted and low > 0.0)
            reason, both = "" if seen else _why_not(fitted, i), (low, high)
            one = Estimate(column.unknown, value, reason=reason, ends=both, upper=upper, found=seen)
            made.append(one)
        return tuple(found), tuple(made), fitted

    def _smoothed(self, fitted: Fitted, i: int) -> float:
        """The largest bound over other transitions of this joint's play, that are given."""
        columns, largest = list(fitted.problem.columns), 0.0
        column = columns[i]
        friction, transition = column.term.friction or 0.0, column.term.transition or 0.0
        for factor in SMOOTHINGS:
            feature = 0.5 * self.base.poses.leaning(column.joint, friction, factor * transition)
            columns[i] = replace(column, feature=feature)
            other = fitted.problem.having(columns).fit(fitted.rows, fitted.theta)
            side = self.spread(other)[1][len(self.start) + i]
            largest = max(largest, max(float(other.coefficients[i]), 0.0) + side)
        return largest

    def notes(self, kept: Step) -> list[str]:
        """What must be said of the model that was kept."""
        notes = []
        if self.excess > LARGE_EXCESS:
            notes.append(
                f"note: held-back errors are {self.excess:.1f} times as large as the fits predict: "
                "these causes do not explain all of it; intervals and bounds are enlarged "
                "accordingly"
            )
        for i, choice in kept.chosen.items():
            column = kept.fitted.problem.columns[i]
            numbers, words = column.choices[choice], f"jump at {column.choices[choice][0]:.3g} rad"
            if column.term.kind == "play":
                words = "friction {:.2g}, transition {:.2g} N m".format(*numbers)
            notes.append(
                f"{column.term.kind} {column.joint}: {words}, chosen by the fit of each fold"
            )
        return notes


def _why_not(fitted: Fitted, i: int) -> str:
    """Why a joint's play cannot be told; empty if it can."""
    poses, column = fitted.problem.poses, fitted.problem.columns[i]
    load = poses.load[:, column.index]
    largest, friction = np.abs(load).max(), column.term.friction
    if friction and largest < friction:
        effort = "N m" if poses.turns[column.index] else "N"
        return (
            f"its load, at most {largest:.2g} {effort}, is smaller than the friction of "
            f"{friction:.2g} {effort}"
        )
    side = poses.leaning(column.joint, 0.0, column.term.transition or 0.05 * largest)
    if said := one_sided(np.round(side)):
        return said
    return fitted.why_not(len(fitted.problem.frame) + i)
