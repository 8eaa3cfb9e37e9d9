"""Kinematic calibration with play: which causes of a tool's errors predict poses held back.

Offsets, lengths, compliance, play and encoder errors are fitted to static poses together with the
unknown places of base and tool. A cause is kept only if it predicts poses better that the fit has
not seen; of every joint's play there is an interval or bound, or the reason why there is none.
Words and methods are those of J. M. Hollerbach and C. W. Wampler (International Journal of Robotics
Research 15, 1996); play, priors and the rule for held-back poses are added here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.core import tables
from jointplay.core.errors import JointplayError, MissingName, require_a
from jointplay.core.tables import Table
from jointplay.core.units import displayed
from jointplay.identification.kinematic_model import (
    Column,
    Fitted,
    Poses,
    Problem,
    State,
    Term,
)
from jointplay.identification.static_poses import StaticPoses
from jointplay.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from jointplay.mechanism.payload import Payload

TERMS = ("offset", "placement", "compliance", "eccentricity", "play")
"""Causes that are tried if none are named."""
CHANCE = 0.1
"""Probability of chance below which a gain counts, one-sided."""
LEAST_GAIN = 0.01
"""Part by which held-back errors must shrink at least (RMS)."""
RARER_SIGN = 0.05
"""Part of the poses in which a joint must be loaded the other way, or its play cannot be told."""
INFORMED = 0.5
"""Part of a prior's variance that the poses must take away, or they tell nothing."""
LARGE = 1.2
"""Excess of held-back errors from which on it is said."""
TOGETHER = 0.7
"""Correlation from which two coefficients are said to act together."""
FRICTIONS = tuple(step / 20.0 for step in range(15))
TRANSITIONS = (0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.22, 0.33, 0.5, 0.7)
"""Of play, over the largest load of the joint, where they are sought."""
_TURNS = ("rx", "ry", "rz")
"""Components of rotation vectors."""
DRAWS, NORMAL, TWO_UNKNOWNS = 1000, 1.96, 5.99
"""Of coefficients for an effect's interval; half of a 95 % interval in standard deviations; 95 %
quantile of chi-square with two degrees of freedom, friction's and transition's."""
SMOOTHINGS = (0.25, 1.0, 4.0)
"""Times a transition that is given, for which a bound must hold."""


def improves(before: np.ndarray, after: np.ndarray, units: np.ndarray) -> tuple[bool, float, float]:
    """Whether losses of held-back rows shrink by more than chance.

    The mean of the differences over independent units (rows, points, groups) must exceed the
    one-sided 90 % quantile of Student's t times its standard error, and the root of the mean loss
    must shrink by one per cent.

    Args:
        before, after: squared weighted errors of the rows, shape (n,).
        units: number of the unit of each row, shape (n,).

    Returns:
        Whether; the mean difference; what it had to exceed.
    """
    from scipy.stats import t

    names = np.unique(units)
    gains = np.array([np.mean(before[units == u] - after[units == u]) for u in names])
    m = len(gains)
    margin = np.inf if m < 2 else t.ppf(1.0 - CHANCE, m - 1) * gains.std(ddof=1) / np.sqrt(m)
    smaller = np.sqrt(after.mean()) < (1.0 - LEAST_GAIN) * np.sqrt(before.mean())
    return bool(gains.mean() > margin and smaller), float(gains.mean()), float(margin)


@dataclass(frozen=True)
class Step:
    """One model that was tried: its causes, and its errors in training and on held-back poses."""

    added: str
    """The term that it has beyond those kept before, or lacks (-)."""
    terms: tuple[str, ...]
    unknowns: int
    training: tuple[float, float]
    """RMS of the position's [m] and the orientation's [rad] error, lengths of vectors."""
    held_back: tuple[float, float]
    kept: bool
    gain: float
    """Mean reduction of the squared weighted error of held-back rows."""
    margin: float
    """What the gain had to exceed; of a term that is dropped, what it did not."""


@dataclass(frozen=True)
class Coefficient:
    """A fitted coefficient of a term that was kept; SI units."""

    label: str
    term: str
    joint: str
    unit: str
    value: float
    low: float
    high: float
    """95 % interval."""
    determined: bool
    """Whether the poses say more of it than was assumed beforehand."""
    correlated: str = ""
    """The coefficient that it acts together with, if any."""

    def __str__(self) -> str:
        """One line."""
        value, low, high = (_in_unit(x, self.unit) for x in (self.value, self.low, self.high))
        text = f"{self.label:<40} {value:>16}  {low} to {high}"
        return text + (f" (acts together with {self.correlated})" if self.correlated else "")


@dataclass(frozen=True)
class PlayBound:
    """What the poses tell of a joint's half-play by the side of its load; SI units."""

    joint: str
    unit: str
    half: float
    low: float
    high: float
    """95 % interval."""
    upper: float
    """Upper bound, one-sided 95 %."""
    reason: str
    """Why this measurement cannot tell; empty if it can."""
    found: bool
    """Whether play predicts held-back poses better, and the interval excludes none."""

    def __str__(self) -> str:
        """One line."""
        if self.reason:
            return f"{self.joint:<20} this measurement cannot tell: {self.reason}"
        half, low, high, upper = (
            _in_unit(x, self.unit) for x in (self.half, self.low, self.high, self.upper)
        )
        if self.found:
            return f"{self.joint:<20} half-play {half} ({low} to {high})"
        return f"{self.joint:<20} no play told; half-play at most {upper} (95 %)"


@dataclass(frozen=True)
class Effect:
    """What a kept term moves the tool by, beyond what other places of base and tool would do."""

    term: str
    size: float
    """RMS over the poses [m]."""
    low: float
    high: float
    """95 % interval, by draws of its coefficients [m]."""

    def __str__(self) -> str:
        """One line."""
        size, low, high = (1e3 * one for one in (self.size, self.low, self.high))
        return f"{self.term:<40} {size:>9.3g} mm RMS  {low:.3g} to {high:.3g} mm"


def _in_unit(value: float, unit: str) -> str:
    factor, word = displayed(unit)
    return f"{factor * value:.3g} {word}".strip()


@dataclass(frozen=True)
class Calibration:
    """What static poses tell of a mechanism; SI units."""

    mechanism: Mechanism
    poses: StaticPoses
    kept: tuple[Term, ...]
    steps: tuple[Step, ...]
    """All models that were tried, in order; the first has no causes but those always in it."""
    coefficients: tuple[Coefficient, ...]
    """Of the terms that were kept, but play, of which `play` has what is told."""
    play: tuple[PlayBound, ...]
    """Of every joint of the chain, all candidates and everybody's play free."""
    error: tuple[float, float]
    """By which residuals of positions [m] and orientations [rad] were weighted."""
    state: State
    training: tuple[np.ndarray, np.ndarray]
    """Errors of position (n, 3) [m] and orientation (n, 3) [rad] by the model that was kept."""
    held_back: tuple[np.ndarray, np.ndarray]
    """The same, each row by a fit that has not seen it."""
    within: np.ndarray
    """Whether each held-back position lay in its predicted 95 % region, shape (n,)."""
    folds: str
    """What was held back, in words."""
    notes: tuple[str, ...] = ()
    effects: tuple[Effect, ...] = ()
    """Of the terms that were kept."""
    problem: Problem | None = field(default=None, repr=False)

    def step(self) -> Step:
        """The model that was kept."""
        return [one for one in self.steps if one.kept][-1]

    def __getitem__(self, label: str) -> Coefficient:
        """A coefficient by its label, such as ``"compliance elbow"``."""
        for one in self.coefficients:
            if one.label == label:
                return one
        raise MissingName("coefficient", label, [one.label for one in self.coefficients])

    def play_of(self, joint: str) -> PlayBound:
        """What is told of a joint's play."""
        for one in self.play:
            if one.joint == joint:
                return one
        raise MissingName("joint", joint, [one.joint for one in self.play])

    def __str__(self) -> str:
        """Tables of models, coefficients and play."""
        turned = self.poses.orientation is not None
        columns = [
            tables.Column("model", [one.added for one in self.steps]),
            tables.Column("unknowns", [one.unknowns for one in self.steps]),
        ]
        for what in ("training", "held back"):
            errors = np.array([getattr(one, what.replace(" ", "_")) for one in self.steps])
            columns.append(tables.Column(what, errors[:, 0], "m"))
            if turned:
                columns.append(tables.Column(f"{what}, turn", errors[:, 1], "rad"))
        columns.append(tables.Column("kept", ["yes" if one.kept else "no" for one in self.steps]))
        lines = [*self.notes, str(Table(columns))]
        lines.append(
            f"{int(self.within.sum())} of {len(self.within)} held-back positions lie in their "
            "predicted 95 % regions"
        )
        lines.append(
            f"held back: {self.folds}; a term is kept if the squared errors of held-back "
            f"{_unit_words(self.poses)} shrink by more than chance (one-sided 90 %) and their RMS "
            "by 1 %"
        )
        if self.coefficients:
            lines.append("")
            lines.append(f"{'coefficient':<40} {'found':>16}  95 % interval")
            lines += [str(one) for one in self.coefficients if one.determined]
            if vague := [one.label for one in self.coefficients if not one.determined]:
                lines.append(
                    "not determined (they do what base, tool or others do, or nothing shows them): "
                    + ", ".join(vague)
                )
        if self.effects:
            lines += ["", "the tool moves by, base and tool placed best without it:"]
            lines += map(str, self.effects)
        lines += ["", "play by the side of the load:", *map(str, self.play)]
        return "\n".join(lines)

    @property
    def data(self) -> Table:
        """All numbers [SI]."""
        heads = ("kind", "name", "unit", "value", "low", "high", "kept", "why not")
        rows: list[tuple[Any, ...]] = []
        for one in self.steps:
            name = " + ".join(one.terms) or one.added
            for what, (position, orientation) in (
                ("training", one.training),
                ("held back", one.held_back),
            ):
                rows.append((f"{what} position", name, "m", position, "", "", one.kept, ""))
                if self.poses.orientation is not None:
                    rows.append(
                        (f"{what} orientation", name, "rad", orientation, "", "", one.kept, "")
                    )
        for c in self.coefficients:
            rows.append(
                ("coefficient", c.label, c.unit, c.value, c.low, c.high, c.determined, c.correlated)
            )
        for e in self.effects:
            rows.append(("effect", e.term, "m", e.size, e.low, e.high, True, ""))
        for p in self.play:
            if p.reason:
                rows.append(("half-play", p.joint, p.unit, "", "", "", False, p.reason))
            else:
                rows.append(("half-play", p.joint, p.unit, p.half, p.low, p.high, p.found, ""))
                rows.append(
                    ("half-play upper bound", p.joint, p.unit, p.upper, "", "", p.found, "")
                )
        return Table.of([(head, "") for head in heads], rows)

    @property
    def residuals(self) -> Table:
        """Errors of every pose, in training and held back."""
        count, group, point = len(self.poses), self.poses.group, self.poses.point
        columns = [
            tables.Column("row", range(1, count + 1)),
            tables.Column("group", group or [""] * count),
            tables.Column("point", point or [""] * count),
        ]
        for what, errors in (("training", self.training), ("held back", self.held_back)):
            for unit, axes, values in zip(("m", "rad"), ("xyz", _TURNS), errors, strict=True):
                for k, axis in enumerate(axes):
                    columns.append(tables.Column(f"{what} {axis}", values[:, k], unit))
        return Table(columns)

    def describe(self) -> dict[str, Any]:
        """All of it as plain data [SI]."""
        return {
            "joints": list(self.poses.joints),
            "poses": len(self.poses),
            "held_back": self.folds,
            "within_region": [bool(one) for one in self.within],
            "error": {"position": self.error[0], "orientation": self.error[1]},
            "kept": [str(term) for term in self.kept],
            "models": [vars(one) | {"terms": list(one.terms)} for one in self.steps],
            "coefficients": [dict(vars(one)) for one in self.coefficients],
            "play": [
                {k: None if v == np.inf else v for k, v in vars(one).items()} for one in self.play
            ],
            "notes": list(self.notes),
        }


def _unit_words(poses: StaticPoses) -> str:
    """What counts as independent."""
    return "points" if poses.point is not None else "groups" if poses.group else "rows"


def rms(vectors: np.ndarray) -> float:
    """Root of the mean of the squares of the vectors' lengths, of shape (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(np.square(vectors), axis=-1))))


@dataclass(frozen=True)
class _HeldBack:
    """Every row as it is predicted by a fit that has not seen it."""

    position: np.ndarray
    """Errors, shape (n, 3) [m]."""
    orientation: np.ndarray
    """Errors, shape (n, 3) [rad]."""
    within: np.ndarray
    """Whether the position was within its predicted 95 % region, shape (n,)."""
    excess: np.ndarray
    """Mean square of the position's error over what was predicted, shape (n,)."""


@dataclass(frozen=True)
class _Tried:
    """A model with its errors in training and on held-back rows."""

    terms: tuple[Term, ...]
    problem: Problem
    fitted: Fitted
    chosen: dict[str, tuple[float, float]]
    """Friction and transition of play by joint, where they were sought [N m]."""
    training: tuple[np.ndarray, np.ndarray]
    """Errors of positions and orientations, shapes (n, 3) [m, rad]."""
    held: _HeldBack
    loss: np.ndarray
    """Squared weighted errors of the held-back rows, shape (n,)."""

    def step(self, added: str, kept: bool, gain: tuple[float, float] = (0.0, 0.0)) -> Step:
        """For the table; `gain` with the margin that it had to exceed."""
        unknowns = self.problem.first + len(self.problem.columns)
        training = rms(self.training[0]), rms(self.training[1])
        held = rms(self.held.position), rms(self.held.orientation)
        return Step(added, tuple(map(str, self.terms)), unknowns, training, held, kept, *gain)


@dataclass
class _Fits:
    """Fits of sets of terms to all rows and to folds."""

    poses: Poses
    base: Problem
    """Without columns."""
    folds: list[np.ndarray]
    """Rows that are held back together."""
    units: np.ndarray
    tick: Callable[[], None]
    start: State | None = None
    """Where base and tool were found last: it saves the search for where they roughly are."""
    excess: float = 1.0
    """By which held-back errors exceed what the fits predict; intervals are enlarged by it."""

    def problem(
        self, terms: Sequence[Term], rows: np.ndarray, start: State | None = None
    ) -> tuple[Problem, Fitted, dict[str, tuple[float, float]]]:
        """The problem of some terms, with friction and transition of play as these rows have them,
        its solution, and what was chosen by joint; base and tool begin where `start` has them."""
        made = [column for term in terms for column in self.poses.columns(term)]
        sought = [i for i, one in enumerate(made) if one.term.kind == "play" and self.sought(one)]
        problem = replace(self.base, columns=tuple(made))
        chosen: dict[str, tuple[float, float]] = {}
        if not sought:
            return problem, problem.fit(rows, self._blank(problem, start)), chosen
        # From the solution without these columns, each in turn takes the best of its features; once
        # more with the others as they are.
        without = replace(
            self.base, columns=tuple(c for i, c in enumerate(made) if i not in sought)
        )
        state = without.fit(rows, self._blank(without, start)).state
        c = np.zeros(len(made))
        c[[i for i in range(len(made)) if i not in sought]] = state.c
        now = replace(state, c=c)
        for _ in range(2):
            for i in sought:
                zeroed = replace(now, c=np.where(np.arange(len(made)) == i, 0.0, now.c))
                made[i], chosen[made[i].joint] = self._best_lean(made, i, zeroed, rows)
            problem = replace(self.base, columns=tuple(made))
            fitted = problem.fit(rows, now)
            now = fitted.state
        return problem, fitted, chosen

    def _blank(self, problem: Problem, start: State | None) -> State | None:
        """A state with no errors but base and tool as given."""
        return None if start is None else replace(start, c=np.zeros(len(problem.columns)))

    def sought(self, column: Column) -> bool:
        """Whether friction or transition of a column of play is sought."""
        return column.term.friction is None or column.term.transition is None

    def leans(self, column: Column) -> list[tuple[float, float]]:
        """Pairs of friction and transition that may be [N m]."""
        largest = float(np.abs(self.poses.load[:, column.index]).max())
        term = column.term
        ordered = self.poses.measured.ordered
        frictions = [f * largest for f in FRICTIONS] if ordered else [0.0]
        frictions = frictions if term.friction is None else [term.friction]
        transitions = [t * largest for t in TRANSITIONS]
        transitions = transitions if term.transition is None else [term.transition]
        return [(f, t) for f in frictions for t in transitions]

    def _best_lean(
        self, made: list[Column], i: int, state: State, rows: np.ndarray
    ) -> tuple[Column, tuple[float, float]]:
        """The column of play that lowers the cost most, to first order, beside all others."""
        problem = replace(self.base, columns=tuple(made))
        one = problem.columns[i]
        k = problem.first + i
        bare = replace(one, feature=np.ones(len(self.poses)))
        unit = replace(problem, columns=(*made[:i], bare, *made[i + 1 :]))
        residual, slope = unit.residual(state, rows, jacobian=True)
        precision = problem.priors**-2.0
        others = np.delete(np.arange(slope.shape[1]), k)
        rest = slope[:, others]
        hessian = rest.T @ rest + np.diag(precision[others])
        prior = precision * unit._from_priors(state)
        step = np.linalg.solve(hessian, rest.T @ residual - prior[others])
        left = residual - rest @ step
        best, chosen = -np.inf, (0.0, 0.0)
        for lean in self.leans(one):
            feature = self.poses.leaning(one.joint, *lean)
            own = slope[:, k] * self._over_residuals(problem, feature[rows], rows, len(residual))
            across = rest.T @ own
            size = own @ own - across @ np.linalg.solve(hessian, across) + precision[k]
            gain = (own @ left) ** 2 / size
            if gain > best:
                best, chosen = gain, lean
        return replace(one, feature=self.poses.leaning(one.joint, *chosen)), chosen

    def _over_residuals(
        self, problem: Problem, feature: np.ndarray, rows: np.ndarray, size: int
    ) -> np.ndarray:
        """A feature of the rows for each residual; of what relates rows, none."""
        each = np.repeat(feature, 3)
        whole = np.concatenate([each, each]) if problem.turned else each
        return np.concatenate([whole, np.zeros(size - len(whole))])

    def loss(self, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Squared weighted errors of rows, shape (n,)."""
        sp, so = self.base.error
        return np.asarray(
            np.sum(position**2, axis=1) / sp**2 + np.sum(orientation**2, axis=1) / so**2
        )

    def tried(self, terms: Sequence[Term]) -> _Tried:
        """A set of terms, fitted to all rows and to each fold."""
        rows = np.arange(len(self.poses))
        problem, fitted, chosen = self.problem(terms, rows, self.start)
        self.start = fitted.state
        self.tick()
        training, held = problem.errors(fitted.state, rows), self.held_back(terms)
        loss = self.loss(held.position, held.orientation)
        return _Tried(tuple(terms), problem, fitted, chosen, training, held, loss)

    def held_back(self, terms: Sequence[Term]) -> _HeldBack:
        """Every row by the fit of a fold that leaves it out."""
        n = len(self.poses)
        made = _HeldBack(np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n, bool), np.zeros(n))
        for out in self.folds:
            train = np.setdiff1d(np.arange(n), out)
            problem, fitted, _ = self.problem(terms, train, self.start)
            made.position[out], made.orientation[out] = problem.errors(fitted.state, out)
            made.within[out], made.excess[out] = self._within(problem, fitted, out)
            self.tick()
        return made

    def _within(
        self, problem: Problem, fitted: Fitted, out: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Whether held-back positions lie in the 95 % regions that the fit of the others predicts,
        of its unknowns' covariance and of the scatter about it; and their mean square over it."""
        from scipy.stats import f

        free, stretch = freedom(problem, fitted)
        residual, slope = problem.residual(fitted.state, out, jacobian=True)
        n = len(out)
        off, slope = residual[: 3 * n].reshape(n, 3), slope[: 3 * n].reshape(n, 3, -1)
        own = np.ones(n)
        if problem.closure:  # about the mean of the held-back rows of the same point
            names = np.array(problem.poses.measured.point)[out]
            own = np.array([1.0 - 1.0 / (names == name).sum() for name in names])
        spread = slope @ fitted.covariance @ np.swapaxes(slope, 1, 2)
        spread = stretch * (spread + np.maximum(own, 1e-9)[:, None, None] * np.eye(3))
        distance = np.einsum("na,na->n", off, np.linalg.solve(spread, off[:, :, None])[:, :, 0])
        return distance <= 3.0 * f.ppf(0.95, 3, free), distance / 3.0


def calibrate(
    mechanism: Mechanism | str | Path,
    poses: StaticPoses | str | Path,
    terms: Sequence[Term | str] = TERMS,
    *,
    always: Sequence[Term | str] = (),
    folds: int | str = 3,
    error: tuple[float, float] | None = None,
    payloads: Sequence[Payload] = (),
    point: Sequence[float] = (0.0, 0.0, 0.0),
    point_width: float | None = None,
    progress: bool = False,
) -> Calibration:
    """Fit causes of errors to static poses, and keep those that predict held-back poses better.

    Forward selection: to what is kept, the term is added whose fit predicts held-back poses best,
    as long as that is better by more than chance (`improves`); then terms are dropped whose loss is
    not worse by more than chance. Base and tool are unknown always.
    Intervals are those of the linearised fit (Gauss-Newton with priors), by Student's t, or of the
    sandwich over independent units where that is wider; those of play hold for every friction and
    transition whose fit is not significantly worse.

    Args:
        mechanism: open chain, or a URDF or robot's name; the tool is the mechanism's.
        poses: or the path of a CSV file (docs/real_robots.md).
        terms: candidates, as `Term` or text such as ``"compliance elbow,wrist"``.
        always: terms that are in every model.
        folds: every k-th row is held back in turn; ``"rows"``: each; ``"groups"``, ``"points"``:
            each of them. Closure data are held back by groups, or by points if there is one group.
        error: scatter of positions [m] and orientations [rad] about the model, by which they are
            weighted against each other and the priors; estimated from the fit of all `always` and
            `terms` if None. Intervals follow from the residuals.
        payloads: bodies that the mechanism carried all the time.
        point: nominal place of the measured point in the tool frame, shape (3,) [m].
        point_width: of its prior [m]; 0.02 for closure, 10 otherwise.
        progress: whether to show a bar if it takes more than two seconds.

    Raises:
        JointplayError: see `StaticPoses`, `Term`, `Chain`, `Poses`; nothing measured; a number of
            folds that does not fit.
    """
    require_a("mechanism", mechanism, "Mechanism", "str", "Path")
    require_a("poses", poses, "StaticPoses", "str", "Path")
    if not isinstance(mechanism, Mechanism):
        mechanism = Mechanism(mechanism)
    if not isinstance(poses, StaticPoses):
        poses = read_poses(mechanism, poses)
    if poses.position is None and poses.point is None:
        raise JointplayError(
            f"{poses.source}: nothing measured: neither positions of the tool nor points"
        )
    candidates = [one if isinstance(one, Term) else Term.parse(one) for one in terms]
    given = [one if isinstance(one, Term) else Term.parse(one) for one in always]
    all_poses = Poses(mechanism, poses, payloads)
    groups, units, words = _folds(poses, folds)
    start = error or (1e-3, 5e-3)
    if point_width is None:
        point_width = 0.02 if poses.point is not None else 10.0
    nominal = np.asarray(point, float)
    base = Problem(all_poses, (), start, nominal, point_width)
    count = len(candidates)
    with _bar(progress, (count * (count + 1) // 2 + 1) * (len(groups) + 1)) as tick:
        fits = _Fits(all_poses, base, groups, units, tick)
        if error is None:
            base = replace(base, error=_estimated(fits, [*given, *candidates]))
            fits.base = base
        return _select(mechanism, poses, fits, candidates, given, words)


def read_poses(mechanism: Mechanism, path: str | Path) -> StaticPoses:
    """Read a CSV file of static poses of a mechanism.

    Raises:
        JointplayError: see `StaticPoses.from_csv`.
    """
    entries = mechanism.description.joints
    joints = {name: name in entries and entries[name].slides for name in mechanism.ideal().joints}
    return StaticPoses.from_csv(path, joints)


def _bar(show: bool, total: int) -> Any:
    """A progress bar that appears after two seconds, as a context with a function that counts."""
    from contextlib import contextmanager

    from jointplay.core.progress import ProgressBar

    @contextmanager
    def shown() -> Any:
        with ProgressBar(total=total, desc="models", delay=2.0, disable=not show) as bar:
            yield lambda: bar.update(1)

    return shown()


def _folds(poses: StaticPoses, folds: int | str) -> tuple[list[np.ndarray], np.ndarray, str]:
    """Rows held back together, number of the independent unit of each row, and words."""
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
        words = f"each of {n} poses" if k == n else f"every {_ordinal(k)} of {n} poses, {k} folds"
    independent = poses.point or poses.group
    units = np.arange(n)
    if independent is not None:
        units = np.unique(np.array(independent), return_inverse=True)[1]
    return held, units, words


def _ordinal(k: int) -> str:
    return {2: "second", 3: "third"}.get(k, f"{k}th")


def _estimated(fits: _Fits, terms: Sequence[Term]) -> tuple[float, float]:
    """Scatter about the fit of all terms, per axis [m, rad]; degrees of freedom by the share of
    each coefficient that the poses determine."""
    rows = np.arange(len(fits.poses))
    state: State | None = None
    for _ in range(4):
        problem, fitted, _ = fits.problem(terms, rows, state)
        state = fitted.state
        position, orientation = problem.errors(state, rows)
        m = 3 * len(rows)
        taken = [
            float(np.sum((part @ fitted.covariance) * part))
            for part in (fitted.jacobian[:m], fitted.jacobian[m:])
        ]
        if problem.closure:
            taken[0] += 3.0 * len(set(fits.poses.measured.point or ()))
        sp = np.sqrt(np.sum(position**2) / max(m - taken[0], 0.1 * m))
        so = np.sqrt(np.sum(orientation**2) / max(m - taken[1], 0.1 * m))
        fits.base = replace(fits.base, error=(max(float(sp), 1e-9), max(float(so), 1e-9)))
    return fits.base.error


def _select(
    mechanism: Mechanism,
    poses: StaticPoses,
    fits: _Fits,
    candidates: Sequence[Term],
    given: Sequence[Term],
    words: str,
) -> Calibration:
    """Forward selection, then intervals and bounds."""
    first = fits.tried(given)
    name = "base and tool" + "".join(f" + {one.short}" for one in given)
    steps = [first.step(name, True)]
    kept = _dropped(fits, _added(fits, first, candidates, steps), len(given), steps)
    fits.excess = max(1.0, float(np.sqrt(np.mean(kept.held.excess))))
    state, terms = kept.fitted.state, kept.terms
    return Calibration(
        mechanism,
        poses,
        terms,
        tuple(steps),
        _coefficients(fits, terms, state),
        _bounds(fits, terms, candidates, state),
        fits.base.error,
        state,
        kept.training,
        (kept.held.position, kept.held.orientation),
        kept.held.within,
        words,
        _notes(fits, kept),
        _effects(fits, terms, state),
        kept.problem,
    )


def _added(fits: _Fits, now: _Tried, candidates: Sequence[Term], steps: list[Step]) -> _Tried:
    """The model with candidates added, the best first, as long as one is better than chance."""
    left = [term for term in candidates if fits.poses.columns(term)]
    while left:
        best: tuple[_Tried, Term, tuple[float, float]] | None = None
        for term in left:
            made = fits.tried([*now.terms, term])
            better, *gain = improves(now.loss, made.loss, fits.units)
            found = made, term, (gain[0], gain[1])
            if better and (best is None or made.loss.mean() < best[0].loss.mean()):
                found, best = best or found, found
            if found is not best:
                steps.append(found[0].step(f"+ {found[1].short}", False, found[2]))
        if best is None:
            break
        now, term, gains = best
        left.remove(term)
        steps.append(now.step(f"+ {term.short}", True, gains))
    return now


def _dropped(fits: _Fits, now: _Tried, given: int, steps: list[Step]) -> _Tried:
    """The model without terms that later ones explain: without them, nothing is worse."""
    while len(now.terms) > given:
        needless = []
        for term in now.terms[given:]:
            made = fits.tried([one for one in now.terms if one is not term])
            worse, *gain = improves(made.loss, now.loss, fits.units)
            if not worse:
                needless.append((gain, term, made))
        if not needless:
            break
        gain, term, now = min(needless, key=lambda one: one[0][0])
        steps.append(now.step(f"- {term.short}", True, (gain[0], gain[1])))
    return now


def _notes(fits: _Fits, kept: _Tried) -> tuple[str, ...]:
    """What was noticed and chosen, a line each."""
    notes, poses = [], fits.poses.measured
    if fits.excess > LARGE:
        notes.append(
            f"note: held-back errors are {fits.excess:.1f} times as large as the fits predict: "
            "these causes do not explain all of it; intervals and bounds are enlarged accordingly"
        )
    if poses.exchanged:
        listed = ", ".join(str(i + 1) for i in poses.exchanged)
        notes.append(
            f"note: labels of markers are exchanged in {len(poses.exchanged)} of {len(poses)} rows "
            f"({listed}); put right"
        )
    for joint, (friction, transition) in kept.chosen.items():
        notes.append(
            f"play {joint}: friction {friction:.2g}, transition {transition:.2g} N m, "
            "chosen by the fit of each fold"
        )
    return tuple(notes)


def freedom(problem: Problem, fitted: Fitted) -> tuple[float, float]:
    """Degrees of freedom that a fit leaves, counting of each unknown what the poses determine; and
    the residuals' mean square, in the weights' units."""
    slope, residual = fitted.jacobian, fitted.residual
    free = len(residual) - float(np.sum((slope @ fitted.covariance) * slope))
    if problem.closure:
        points = problem.poses.measured.point or ()
        free -= 3.0 * len({points[i] for i in fitted.rows})
    free = max(free, 3.0)
    return free, float(residual @ residual) / free


def _spread(fits: _Fits, problem: Problem, fitted: Fitted) -> tuple[np.ndarray, np.ndarray, float]:
    """Half widths of 95 % intervals and of one-sided bounds of all unknowns, and the stretch of
    costs by which they follow from the residuals' own scatter."""
    from scipy.stats import t

    covariance, n = fitted.covariance, len(fits.poses)
    slope, residual = fitted.jacobian, fitted.residual
    free, stretch = freedom(problem, fitted)
    plain = np.sqrt(stretch * np.diag(covariance))
    parts = np.arange(len(residual))
    owner = np.where(parts < 3 * n, parts // 3, (parts - 3 * n) // 3)
    owner = np.minimum(owner, n - 1)
    if problem.closure:
        slope, residual = slope[: 3 * n], residual[: 3 * n]
        owner = owner[: 3 * n]
    scores = slope * residual[:, None]
    names = np.unique(fits.units)
    summed = np.array([scores[fits.units[owner] == u].sum(axis=0) for u in names])
    m = len(names)
    robust = covariance @ (summed.T @ summed * m / max(m - 1, 1)) @ covariance
    wide = np.sqrt(np.maximum(np.diag(robust), 0.0))
    two = np.maximum(t.ppf(0.975, free) * plain, t.ppf(0.975, max(m - 1, 4)) * wide)
    one = np.maximum(t.ppf(0.95, free) * plain, t.ppf(0.95, max(m - 1, 4)) * wide)
    return fits.excess * two, fits.excess * one, fits.excess**2 * stretch


def _coefficients(fits: _Fits, kept: Sequence[Term], start: State) -> tuple[Coefficient, ...]:
    """Of the terms that were kept, with intervals; of play see `_bounds`."""
    rows = np.arange(len(fits.poses))
    problem, fitted, _ = fits.problem(kept, rows, start)
    half, _, _ = _spread(fits, problem, fitted)
    made = []
    for i, column in enumerate(problem.columns):
        k = problem.first + i
        value = float(fitted.state.c[i])
        low, high = value - half[k], value + half[k]
        if column.term.kind == "play":
            continue  # what is told of it stands in one place, `_bounds`
        told, _, other = _informed(problem, fitted, i)
        name, kind, unit = column.label, column.term.kind, column.unit
        made.append(
            Coefficient(
                name, kind, column.joint, unit, value, low, high, bool(told > INFORMED), other
            )
        )
    return tuple(made)


def _effects(fits: _Fits, kept: Sequence[Term], start: State) -> tuple[Effect, ...]:
    """Of the terms that were kept, on the tool's position."""
    n = len(fits.poses)
    problem, fitted, _ = fits.problem(kept, np.arange(n), start)
    half, _, _ = _spread(fits, problem, fitted)
    slope, random = fitted.jacobian, np.random.default_rng(0)
    frame = slope[:, : problem.first]
    made = []
    for term in kept:
        mine = [
            i for i, one in enumerate(problem.columns)
            if (one.term.kind, one.term.joints, one.term.by) == (term.kind, term.joints, term.by)
        ]  # fmt: skip
        if not mine:
            continue
        at = problem.first + np.array(mine)
        moved = slope[:, at] - frame @ np.linalg.lstsq(frame, slope[:, at], rcond=None)[0]
        moved = fits.base.error[0] * moved[: 3 * n] / np.sqrt(n)
        covariance = fitted.covariance[np.ix_(at, at)]
        wider = half[at] / (NORMAL * np.sqrt(np.diag(covariance)))
        value = fitted.state.c[mine]
        drawn = random.multivariate_normal(value, covariance * np.outer(wider, wider), DRAWS)
        size = float(np.linalg.norm(moved @ value))
        low, high = np.quantile(np.linalg.norm(moved @ drawn.T, axis=0), [0.025, 0.975])
        made.append(Effect(term.short, size, min(float(low), size), max(float(high), size)))
    return tuple(made)


def _over_leans(
    fits: _Fits, problem: Problem, fitted: Fitted, i: int, half: float, stretch: float
) -> tuple[float, float]:
    """Ends of play's interval over all frictions and transitions that are not worse by more than
    the 95 % quantile of chi-square, of two unknowns; each fit to first order from the best one."""
    column = problem.columns[i]
    rows, k = fitted.rows, problem.first + i
    bare = replace(column, feature=np.ones(len(fits.poses)))
    unit = replace(problem, columns=(*problem.columns[:i], bare, *problem.columns[i + 1 :]))
    zeroed = replace(
        fitted.state, c=np.where(np.arange(len(problem.columns)) == i, 0.0, fitted.state.c)
    )
    residual, slope = unit.residual(zeroed, rows, jacobian=True)
    precision = problem.priors**-2.0
    prior = precision * unit._from_priors(zeroed)
    found = []
    for lean in fits.leans(column):
        feature = fits.poses.leaning(column.joint, *lean)
        own = slope.copy()
        own[:, k] *= fits._over_residuals(problem, feature[rows], rows, len(residual))
        hessian = own.T @ own + np.diag(precision)
        gradient = own.T @ residual - prior
        step = np.linalg.solve(hessian, gradient)
        found.append((-float(gradient @ step), float(step[k])))
    best = min(cost for cost, _ in found)
    near = [value for cost, value in found if cost <= best + TWO_UNKNOWNS * stretch]
    return min(near) - half, max(near) + half


def _informed(problem: Problem, fitted: Fitted, i: int) -> tuple[float, float, str]:
    """Part of a prior's variance that the poses took away; the largest correlation with another
    coefficient, and its label if that is large."""
    k = problem.first + i
    covariance = fitted.covariance
    told = 1.0 - covariance[k, k] * fitted.precision[k]
    spread = np.sqrt(np.diag(covariance))
    together = np.abs(covariance[k] / spread[k] / spread)
    together[k] = 0.0
    own = together[problem.first :]
    if not len(own) or own.max() < TOGETHER:
        return told, float(own.max(initial=0.0)), ""
    return told, float(own.max()), problem.columns[int(own.argmax())].label


def _bounds(
    fits: _Fits, kept: Sequence[Term], candidates: Sequence[Term], start: State
) -> tuple[PlayBound, ...]:
    """What is told of every joint's play, with all candidates and everybody's play free."""
    poses, rows = fits.poses, np.arange(len(fits.poses))
    every = [*kept, *(one for one in candidates if one not in kept)]
    named = [one for one in every if one.kind == "play"]
    others = [one for one in every if one.kind != "play"]
    in_terms = {column.joint for term in named for column in poses.columns(term)}
    rest = tuple(n for n in poses.known if n not in in_terms and poses.loaded(n))
    model = [*others, *named, *([Term("play", rest)] if rest else [])]
    predicted = {c.joint for term in kept if term.kind == "play" for c in poses.columns(term)}
    problem, fitted, _ = fits.problem(model, rows, start)
    half, side, stretch = _spread(fits, problem, fitted)
    made = []
    for joint in poses.known:
        j = poses.chain.names.index(joint)
        unit = "rad" if poses.chain.turns[j] else "m"
        where = [
            i for i, c in enumerate(problem.columns) if (c.term.kind, c.joint) == ("play", joint)
        ]
        if not where:
            reason = "gravity does not load this joint"
            made.append(PlayBound(joint, unit, 0.0, 0.0, 0.0, np.inf, reason, False))
            continue
        i = where[0]
        k = problem.first + i
        value = float(fitted.state.c[i])
        low, high = value - half[k], value + half[k]
        upper = max(value, 0.0) + side[k]
        column = problem.columns[i]
        if fits.sought(column):
            low, high = _over_leans(fits, problem, fitted, i, half[k], stretch)
            upper = max(upper, max(high - half[k], 0.0) + side[k])
        else:
            upper = max(upper, _smoothed(fits, problem, fitted.state, i))
        reason = _why_not(poses, problem, fitted, i)
        seen = bool(joint in predicted and low > 0.0)
        made.append(PlayBound(joint, unit, value, low, high, upper, "" if seen else reason, seen))
    return tuple(made)


def _smoothed(fits: _Fits, problem: Problem, start: State, i: int) -> float:
    """The largest bound over other transitions of this joint's play."""
    column, largest = problem.columns[i], 0.0
    friction, transition = column.term.friction or 0.0, column.term.transition or 0.0
    for factor in SMOOTHINGS:
        feature = fits.poses.leaning(column.joint, friction, factor * transition)
        columns = list(problem.columns)
        columns[i] = replace(column, feature=feature)
        other = replace(problem, columns=tuple(columns))
        fitted = other.fit(np.arange(len(fits.poses)), start)
        side = _spread(fits, other, fitted)[1][other.first + i]
        largest = max(largest, max(float(fitted.state.c[i]), 0.0) + side)
    return largest


def _why_not(poses: Poses, problem: Problem, fitted: Fitted, i: int) -> str:
    """Why a joint's play cannot be told; empty if it can."""
    column = problem.columns[i]
    load = poses.load[:, column.index]
    friction = column.term.friction
    effort = "N m" if poses.chain.turns[column.index] else "N"
    if friction and np.abs(load).max() < friction:
        return (
            f"its load, at most {np.abs(load).max():.2g} {effort}, is smaller than the friction of "
            f"{friction:.2g} {effort}"
        )
    side = poses.leaning(column.joint, 0.0, column.term.transition or 0.05 * np.abs(load).max())
    rarer = int(min((side > 0.5).sum(), (side < -0.5).sum()))
    if rarer < max(RARER_SIGN * len(poses), 2.0):
        times = "never" if not rarer else f"in only {rarer} of {len(poses)} poses"
        return f"its load is on the other side {times}"
    told, together, other = _informed(problem, fitted, i)
    if told < INFORMED:
        if other:
            return f"it acts together with {other} (correlation {together:.2f})"
        return "the poses say less of it than was assumed beforehand"
    return ""
