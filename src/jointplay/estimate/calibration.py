"""Kinematic calibration with play: which causes of a tool's errors predict poses held back.

Offsets, lengths, compliance, play and encoder errors are fitted to static poses together with the
unknown places of base and tool. A cause is kept only if it predicts poses better that the fit has
not seen; of every joint's play there is an interval or bound, or the reason why there is none.
Words and methods are those of J. M. Hollerbach and C. W. Wampler (International Journal of Robotics
Research 15, 1996); play, priors and the rule for held-back poses are added here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import tables
from jointplay.base.errors import JointplayError, MissingName, require_a
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Table
from jointplay.estimate.kinematic_model import Column, Fitted, Poses, Problem, State, Term
from jointplay.estimate.least_squares import sandwich
from jointplay.estimate.selection import Gain, grown, improves, one_sided
from jointplay.estimate.static_poses import StaticPoses
from jointplay.estimate.unknowns import NORMAL, Estimate, Unknown, by_label, data, listed
from jointplay.model.mechanism import Mechanism

if TYPE_CHECKING:
    from jointplay.model.payload import Payload

TERMS = ("offset", "placement", "compliance", "eccentricity", "play")
"""Causes that are tried if none are named."""
INFORMED = 0.5
"""Part of a prior's variance that the poses must take away, or they tell nothing."""
LARGE = 1.2
"""Excess of held-back errors from which on it is said."""
FRICTIONS = tuple(step / 20.0 for step in range(15))
TRANSITIONS = (0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.22, 0.33, 0.5, 0.7)
"""Of play, over the largest load of the joint, where they are sought."""
_TURNS = ("rx", "ry", "rz")
_VAGUE = "base, tool or other causes do the same, or nothing shows it"
DRAWS, TWO_UNKNOWNS = 1000, 5.99
"""Of coefficients for an effect's interval; 95 % quantile of chi-square with two degrees of
freedom, friction's and transition's."""
SMOOTHINGS = (0.25, 1.0, 4.0)
"""Times a transition that is given, for which a bound must hold."""


@dataclass(frozen=True)
class Step:
    """One model that was tried: its causes, and its errors in training and on held-back poses."""

    terms: tuple[Term, ...]
    fitted: Fitted = field(repr=False)
    chosen: Mapping[str, tuple[float, float]]
    """Friction and transition of play by joint, where they were sought [N m]."""
    errors: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(repr=False)
    """Of position (n, 3) [m] and orientation (n, 3) [rad]: ``training``, and ``held_back``, each
    row by a fit that has not seen it."""
    within: np.ndarray = field(repr=False)
    """Whether each held-back position lay in its predicted 95 % region, shape (n,)."""
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
        return len(self.fitted.problem.free)

    @property
    def loss(self) -> np.ndarray:
        """Squared weighted errors of the held-back rows, shape (n,)."""
        parts = zip(self.errors["held_back"], self.fitted.problem.error, strict=True)
        return np.asarray(sum(np.sum((part / size) ** 2, axis=1) for part, size in parts))

    @property
    def training(self) -> tuple[float, float]:
        """RMS of the position's [m] and the orientation's [rad] error, lengths of vectors."""
        return self._rms("training")

    @property
    def held_back(self) -> tuple[float, float]:
        return self._rms("held_back")

    def _rms(self, which: str) -> tuple[float, float]:
        sums = [np.sum(np.square(vectors), axis=-1) for vectors in self.errors[which]]
        return float(np.sqrt(sums[0].mean())), float(np.sqrt(sums[1].mean()))

    def describe(self) -> dict[str, Any]:
        """As plain data [SI]."""
        names = ("added", "unknowns", "training", "held_back", "kept", "gain", "margin")
        numbers = {name: getattr(self, name) for name in names}
        return {"terms": [str(term) for term in self.terms], **numbers}


@dataclass(frozen=True)
class Calibration:
    """What static poses tell of a mechanism; SI units."""

    mechanism: Mechanism
    poses: StaticPoses
    steps: tuple[Step, ...]
    """All models that were tried, in order; the first has no causes but those always in it."""
    coefficients: tuple[Estimate, ...]
    """Of the terms that were kept, but play, of which `play` has what is told."""
    play: tuple[Estimate, ...]
    """Of every joint of the chain, all candidates and everybody's play free."""
    folds: str
    """What was held back, in words."""
    notes: tuple[str, ...] = ()
    effects: tuple[Estimate, ...] = ()
    """What each term that was kept moves the tool by, RMS over the poses, beyond what other places
    of base and tool would do [m]."""

    def step(self) -> Step:
        """The model that was kept."""
        return [one for one in self.steps if one.kept][-1]

    @property
    def kept(self) -> tuple[Term, ...]:
        return self.step().terms

    @property
    def within(self) -> np.ndarray:
        """Which held-back positions lay in their predicted 95 % regions, shape (n,)."""
        return self.step().within

    def __getitem__(self, label: str) -> Estimate:
        return by_label(self.coefficients, label)

    def play_of(self, joint: str) -> Estimate:
        """What is told of a joint's half-play by the side of its load."""
        for one in self.play:
            if one.joint == joint:
                return one
        raise MissingName("joint", joint, [one.joint for one in self.play])

    @property
    def models(self) -> Table:
        columns = [
            tables.Column("model", [one.added for one in self.steps]),
            tables.Column("unknowns", [one.unknowns for one in self.steps]),
        ]
        for what in ("training", "held back"):
            errors = np.array([getattr(one, what.replace(" ", "_")) for one in self.steps])
            columns.append(tables.Column(what, errors[:, 0], "m"))
            if self.poses.orientation is not None:
                columns.append(tables.Column(f"{what}, turn", errors[:, 1], "rad"))
        columns.append(tables.Column("kept", ["yes" if one.kept else "no" for one in self.steps]))
        return Table(columns)

    def __str__(self) -> str:
        poses = self.poses
        units = "points" if poses.point is not None else "groups" if poses.group else "rows"
        lines = [
            *self.notes,
            str(self.models),
            f"{int(self.within.sum())} of {len(self.within)} held-back positions lie in their "
            "predicted 95 % regions",
            f"held back: {self.folds}; a term is kept if the squared errors of held-back "
            f"{units} shrink by more than chance (one-sided 90 %) and their RMS by 1 %",
        ]
        if self.coefficients:
            lines += ["", listed(self.coefficients, "coefficient", f"not determined ({_VAGUE})")]
        if self.effects:
            head = "moves the tool by (RMS), base and tool placed best without it"
            lines += ["", listed(self.effects, head)]
        return "\n".join([*lines, "", listed(self.play, "play by the side of the load")])

    @property
    def data(self) -> Table:
        """Errors of all models, coefficients, effects and bounds of play [SI]."""
        errors, turned = [], 1 if self.poses.orientation is None else 2
        for one in self.steps:
            name = " + ".join(map(str, one.terms)) or one.added
            note = "kept" if one.kept else "not kept"
            for what in ("training", "held_back"):
                kinds = [("position", "m"), ("orientation", "rad")]
                for (kind, unit), size in zip(kinds[:turned], getattr(one, what), strict=False):
                    error = Unknown("", f"{what} {kind}: {name}", unit, np.nan)
                    errors.append(Estimate(error, size, note=note))
        return data([*errors, *self.coefficients, *self.effects, *self.play])

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
            for unit, axes, values in zip(("m", "rad"), ("xyz", _TURNS), errors, strict=True):
                for k, axis in enumerate(axes):
                    columns.append(
                        tables.Column(f"{what.replace('_', ' ')} {axis}", values[:, k], unit)
                    )
        return Table(columns)

    def describe(self) -> dict[str, Any]:
        """All of it as plain data [SI]."""
        error = self.step().fitted.problem.error
        return {
            "joints": list(self.poses.joints),
            "poses": len(self.poses),
            "held_back": self.folds,
            "within_region": [bool(one) for one in self.within],
            "error": dict(zip(("position", "orientation"), error, strict=True)),
            "kept": [str(term) for term in self.kept],
            "models": [one.describe() for one in self.steps],
            **{
                name: [one.describe() for one in getattr(self, name)]
                for name in ("coefficients", "effects", "play")
            },
            "notes": list(self.notes),
        }


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

    def fit(
        self, terms: Sequence[Term], rows: np.ndarray, start: State | None = None
    ) -> tuple[Fitted, dict[str, tuple[float, float]]]:
        """Some terms, with friction and transition of play as these rows have them, fitted to these
        rows; and what was chosen by joint. Base and tool begin where `start` has them."""
        made = [column for term in terms for column in self.poses.columns(term)]
        free = [one.term.kind == "play" and self.sought(one) for one in made]
        chosen: dict[str, tuple[float, float]] = {}
        problem = self._with(column for column, own in zip(made, free, strict=True) if not own)
        if start is not None:
            start = replace(start, c=np.zeros(len(problem.columns)))
        fitted = problem.fit(rows, start)
        if not any(free):
            return fitted, chosen
        # From the solution without these columns, each in turn takes the best of its features; once
        # more with the others as they are.
        sought, c = [i for i, own in enumerate(free) if own], np.zeros(len(made))
        c[~np.array(free)] = fitted.state.c
        now = replace(fitted.state, c=c)
        for _ in range(2):
            for i in sought:
                zeroed = replace(now, c=np.where(np.arange(len(made)) == i, 0.0, now.c))
                gains, _ = self.leanings(self._with(made), i, zeroed, rows)
                joint, lean = made[i].joint, self.leans(made[i])[int(gains.argmax())]
                made[i] = replace(made[i], feature=self.poses.leaning(joint, *lean))
                chosen[joint] = lean
            fitted = self._with(made).fit(rows, now)
            now = fitted.state
        return fitted, chosen

    def _with(self, columns: Iterable[Column]) -> Problem:
        return replace(self.base, columns=tuple(columns))

    def sought(self, column: Column) -> bool:
        """Whether friction or transition of a column of play is sought."""
        return column.term.friction is None or column.term.transition is None

    def leans(self, column: Column) -> list[tuple[float, float]]:
        """Pairs of friction and transition that may be [N m]."""
        largest = float(np.abs(self.poses.load[:, column.index]).max())
        term = column.term
        frictions = [f * largest for f in FRICTIONS] if self.poses.measured.ordered else [0.0]
        frictions = frictions if term.friction is None else [term.friction]
        transitions = [t * largest for t in TRANSITIONS]
        transitions = transitions if term.transition is None else [term.transition]
        return list(product(frictions, transitions))

    def leanings(
        self, problem: Problem, i: int, state: State, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What each friction and transition of the i-th column, of play, does to first order.

        Beside all other unknowns, from a state without that play: by how much the cost falls, and
        the half-play, shape (frictions and transitions,) each.
        """
        one, k = problem.columns[i], problem.first + i
        bare = replace(one, feature=np.ones(len(self.poses)))
        unit = self._with([*problem.columns[:i], bare, *problem.columns[i + 1 :]])
        residual, slope = unit.residual(state, rows, jacobian=True)
        precision = problem.priors**-2.0
        others = np.delete(np.arange(slope.shape[1]), k)
        rest = slope[:, others]
        hessian = rest.T @ rest + np.diag(precision[others])
        prior = precision * unit.from_priors(state)
        left = residual - rest @ np.linalg.solve(hessian, rest.T @ residual - prior[others])
        features = self.poses.leaning(one.joint, *np.transpose(self.leans(one)))[rows]
        # A feature for each component of a row's residual; of what relates rows, none.
        each = np.tile(np.repeat(features, 3, axis=0), (2 if problem.turned else 1, 1))
        own = slope[:, k, None] * np.pad(each, ((0, len(residual) - len(each)), (0, 0)))
        across = rest.T @ own
        size = np.sum(own**2, axis=0) + precision[k]
        size -= np.sum(across * np.linalg.solve(hessian, across), axis=0)
        along = left @ own
        return along**2 / size, along / size

    def tried(self, terms: Sequence[Term]) -> Step:
        """A set of terms, fitted to all rows and to each fold."""
        n = len(self.poses)
        fitted, chosen = self.fit(terms, np.arange(n), self.start)
        self.start = fitted.state
        self.tick()
        position, orientation, *_ = fitted.problem.errors(fitted.state, np.arange(n))
        held, within, excess = np.zeros((2, n, 3)), np.zeros(n, bool), np.zeros(n)
        for out in self.folds:
            fit, _ = self.fit(terms, np.setdiff1d(np.arange(n), out), self.start)
            held[0, out], held[1, out], *_ = fit.problem.errors(fit.state, out)
            within[out], excess[out] = _within(fit, out)
            self.tick()
        errors = {"training": (position, orientation), "held_back": (held[0], held[1])}
        size = max(1.0, float(np.sqrt(np.mean(excess))))
        return Step(tuple(terms), fitted, chosen, errors, within, size)


def _within(fitted: Fitted, out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether held-back positions lie in the 95 % regions that the fit of the others predicts, of
    its unknowns' covariance and of the scatter about it; and their mean square over it."""
    from scipy.stats import f

    problem, n = fitted.problem, len(out)
    residual, slope = problem.residual(fitted.state, out, jacobian=True)
    off, slope = residual[: 3 * n].reshape(n, 3), slope[: 3 * n].reshape(n, 3, -1)
    own = np.ones(n)
    if problem.closure:  # about the mean of the held-back rows of the same point
        names = np.array(problem.poses.measured.point)[out]
        own = np.array([1.0 - 1.0 / (names == name).sum() for name in names])
    spread = slope @ fitted.covariance @ np.swapaxes(slope, 1, 2)
    spread = fitted.stretch * (spread + np.maximum(own, 1e-9)[:, None, None] * np.eye(3))
    distance = np.einsum("na,na->n", off, np.linalg.solve(spread, off[:, :, None])[:, :, 0])
    return distance <= 3.0 * f.ppf(0.95, 3, fitted.freedom), distance / 3.0


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
        JointplayError: see `StaticPoses`, `Term`, `Poses`; nothing measured; a number of
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
    if point_width is None:
        point_width = 0.02 if poses.point is not None else 10.0
    scatter = error or (1e-3, 5e-3)
    base = Problem(all_poses, (), scatter, np.asarray(point, float), point_width)
    count = len(candidates)
    total = (count * (count + 1) // 2 + 1) * (len(groups) + 1)
    with ProgressBar(total=total, desc="models", delay=2.0, disable=not progress) as bar:
        fits = _Fits(all_poses, base, groups, units, bar.update)
        if error is None:
            _estimate_scatter(fits, [*given, *candidates])
        first = fits.tried(given)
        name = "base and tool" + "".join(f" + {one.short}" for one in given)
        steps = [replace(first, added=name)]
        kept = _dropped(fits, _added(fits, first, candidates, steps), len(given), steps)
        fits.excess = kept.excess
        found, bounds = _coefficients(fits, kept), _bounds(fits, kept, candidates)
        notes, effects = _notes(fits, kept), _effects(fits, kept)
    return Calibration(mechanism, poses, tuple(steps), found, bounds, words, notes, effects)


def read_poses(mechanism: Mechanism, path: str | Path) -> StaticPoses:
    """Static poses of a mechanism from a CSV file, see `StaticPoses.from_csv`."""
    entries = mechanism.description.joints
    joints = {name: name in entries and entries[name].slides for name in mechanism.ideal().joints}
    return StaticPoses.from_csv(path, joints)


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
        which = {2: "second", 3: "third"}.get(k, f"{k}th")
        words = f"each of {n} poses" if k == n else f"every {which} of {n} poses, {k} folds"
    units = np.unique(poses.point or poses.group or np.arange(n), return_inverse=True)[1]
    return held, units, words


def _estimate_scatter(fits: _Fits, terms: Sequence[Term]) -> None:
    """Take the scatter about the fit of all terms, per axis [m, rad]; degrees of freedom by the
    share of each coefficient that the poses determine."""
    rows = np.arange(len(fits.poses))
    state, m = None, 3 * len(rows)
    for _ in range(4):
        fitted, _ = fits.fit(terms, rows, state)
        state = fitted.state
        sizes: list[float] = []
        halves = fitted.jacobian[:m], fitted.jacobian[m:]
        for part, left in zip(halves, fitted.problem.errors(state, rows)[:2], strict=True):
            taken = float(np.sum((part @ fitted.covariance) * part))
            if fitted.problem.closure and not sizes:
                taken += 3.0 * len(set(fits.poses.measured.point or ()))
            sizes.append(max(float(np.sqrt(np.sum(left**2) / max(m - taken, 0.1 * m))), 1e-9))
        fits.base = replace(fits.base, error=(sizes[0], sizes[1]))


def _added(fits: _Fits, now: Step, candidates: Sequence[Term], steps: list[Step]) -> Step:
    """The model with candidates added, the best first, as long as one is better than chance."""

    def tried(made: Step, term: Term, gain: Gain, kept: bool) -> None:
        _, size, margin = gain
        name = f"+ {term.short}"
        steps.append(replace(made, added=name, kept=kept, gain=size, margin=margin))

    some = [term for term in candidates if fits.poses.columns(term)]
    return grown(now, some, lambda one, term: fits.tried([*one.terms, term]), fits.units, tried)


def _dropped(fits: _Fits, now: Step, given: int, steps: list[Step]) -> Step:
    """The model without terms that later ones explain: without them, nothing is worse."""
    while len(now.terms) > given:
        needless = []
        for term in now.terms[given:]:
            made = fits.tried([one for one in now.terms if one is not term])
            worse, gain, margin = improves(made.loss, now.loss, fits.units)
            if not worse:
                name = f"- {term.short}"
                needless.append(replace(made, added=name, gain=gain, margin=margin))
        if not needless:
            break
        now = min(needless, key=lambda one: one.gain)
        steps.append(now)
    return now


def _notes(fits: _Fits, kept: Step) -> tuple[str, ...]:
    notes, poses = [], fits.poses.measured
    if fits.excess > LARGE:
        notes.append(
            f"note: held-back errors are {fits.excess:.1f} times as large as the fits predict: "
            "these causes do not explain all of it; intervals and bounds are enlarged accordingly"
        )
    if poses.exchanged:
        rows = ", ".join(str(i + 1) for i in poses.exchanged)
        notes.append(
            f"note: labels of markers are exchanged in {len(poses.exchanged)} of {len(poses)} rows "
            f"({rows}); put right"
        )
    for joint, (friction, transition) in kept.chosen.items():
        notes.append(
            f"play {joint}: friction {friction:.2g}, transition {transition:.2g} N m, "
            "chosen by the fit of each fold"
        )
    return tuple(notes)


def _spread(fits: _Fits, fitted: Fitted) -> tuple[np.ndarray, np.ndarray, float]:
    """Half widths of 95 % intervals and of one-sided bounds of all unknowns, and the stretch of
    costs by which they follow from the residuals' own scatter."""
    from scipy.stats import t

    covariance, n = fitted.covariance, len(fits.poses)
    slope, residual, free = fitted.jacobian, fitted.residual, fitted.freedom
    plain = np.sqrt(fitted.stretch * np.diag(covariance))
    if fitted.problem.closure:  # without distances
        slope, residual = slope[: 3 * n], residual[: 3 * n]
    owner = np.arange(len(residual)) % (3 * n) // 3
    robust, m = sandwich(covariance, slope, residual, fits.units[owner])
    wide = np.sqrt(robust * m / max(m - 1, 1))
    two, one = (
        np.maximum(t.ppf(part, free) * plain, t.ppf(part, max(m - 1, 4)) * wide)
        for part in (0.975, 0.95)
    )
    return fits.excess * two, fits.excess * one, fits.excess**2 * fitted.stretch


def _coefficients(fits: _Fits, kept: Step) -> tuple[Estimate, ...]:
    """Of the terms that were kept, with intervals; what is told of play stands in `_bounds`."""
    fitted, problem, made = kept.fitted, kept.fitted.problem, []
    half, _, _ = _spread(fits, fitted)
    for i, column in enumerate(problem.columns):
        if column.term.kind == "play":
            continue
        told, _, other = fitted.informed(i)
        reason, note = "" if told > INFORMED else _VAGUE, other and f"acts together with {other}"
        value, width = float(fitted.state.c[i]), float(half[problem.first + i])
        made.append(Estimate(column.unknown, value, width, reason, note=note))
    return tuple(made)


def _effects(fits: _Fits, kept: Step) -> tuple[Estimate, ...]:
    """Of the terms that were kept, on the tool's position."""
    n, fitted, problem, made = len(fits.poses), kept.fitted, kept.fitted.problem, []
    half, _, _ = _spread(fits, fitted)
    slope, random = fitted.jacobian, np.random.default_rng(0)
    frame = slope[:, : problem.first]
    for term in kept.terms:
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
        ends = min(float(low), size), max(float(high), size)
        effect = Unknown("", term.short, "m", sought=False, fine=False)
        made.append(Estimate(effect, size, ends=ends))
    return tuple(made)


def _bounds(fits: _Fits, kept: Step, candidates: Sequence[Term]) -> tuple[Estimate, ...]:
    """What is told of every joint's play, with all candidates and everybody's play free."""
    poses, rows = fits.poses, np.arange(len(fits.poses))
    every = [*kept.terms, *(one for one in candidates if one not in kept.terms)]
    named = [one for one in every if one.kind == "play"]
    others = [one for one in every if one.kind != "play"]
    in_terms = {column.joint for term in named for column in poses.columns(term)}
    rest = tuple(n for n in poses.known if n not in in_terms and poses.loaded(n))
    model = [*others, *named, *([Term("play", rest)] if rest else [])]
    predicted = {c.joint for c in kept.fitted.problem.columns if c.term.kind == "play"}
    fitted, _ = fits.fit(model, rows, kept.fitted.state)
    problem, (half, side, stretch) = fitted.problem, _spread(fits, fitted)
    numbers = {c.joint: i for i, c in enumerate(problem.columns) if c.term.kind == "play"}
    made = []
    for joint in poses.known:
        if joint not in numbers:
            (column,) = poses.columns(Term("play", (joint,)))
            reason = "gravity does not load this joint"
            made.append(Estimate(column.unknown, 0.0, reason=reason, found=False))
            continue
        i = numbers[joint]
        k, column = problem.first + i, problem.columns[i]
        value = float(fitted.state.c[i])
        low, high = value - half[k], value + half[k]
        upper = max(value, 0.0) + side[k]
        if fits.sought(column):
            # Over all frictions and transitions that are not worse by more than chi-square's
            # quantile; each to first order from the best one.
            c = np.where(np.arange(len(problem.columns)) == i, 0.0, fitted.state.c)
            gains, values = fits.leanings(problem, i, replace(fitted.state, c=c), rows)
            near = values[gains >= gains.max() - TWO_UNKNOWNS * stretch]
            low, high = float(near.min()) - half[k], float(near.max()) + half[k]
            upper = max(upper, max(high - half[k], 0.0) + side[k])
        else:
            upper = max(upper, _smoothed(fits, fitted, i))
        seen = bool(joint in predicted and low > 0.0)
        reason, ends = "" if seen else _why_not(fitted, i), (low, high)
        one = Estimate(column.unknown, value, reason=reason, ends=ends, upper=upper, found=seen)
        made.append(one)
    return tuple(made)


def _smoothed(fits: _Fits, fitted: Fitted, i: int) -> float:
    """The largest bound over other transitions of this joint's play."""
    columns, largest = list(fitted.problem.columns), 0.0
    column = columns[i]
    friction, transition = column.term.friction or 0.0, column.term.transition or 0.0
    for factor in SMOOTHINGS:
        feature = fits.poses.leaning(column.joint, friction, factor * transition)
        columns[i] = replace(column, feature=feature)
        other = replace(fitted.problem, columns=tuple(columns)).fit(fitted.rows, fitted.state)
        side = _spread(fits, other)[1][fitted.problem.first + i]
        largest = max(largest, max(float(other.state.c[i]), 0.0) + side)
    return largest


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
    told, together, other = fitted.informed(i)
    if told >= INFORMED:
        return ""
    if other:
        return f"it acts together with {other} (correlation {together:.2f})"
    return "the poses say less of it than was assumed beforehand"
