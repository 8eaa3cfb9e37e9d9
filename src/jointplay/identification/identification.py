"""Clearances and friction from measurements: what was found, how well, and what cannot be told."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from jointplay.core.errors import JointplayError, MissingName
from jointplay.design.poses import moving
from jointplay.identification import planning
from jointplay.identification.fit import (
    BLIND,
    DRIFT,
    FAINT,
    MODEL_ELSE,
    REFERENCES,
    SAFETY,
    Fit,
    LeastSquares,
    drifts,
    information,
    offsets,
    solve,
)
from jointplay.identification.measurement import (
    Key,
    Measurement,
    Observed,
    TooLittle,
    Visits,
    no_visits,
    positions,
    visits,
)
from jointplay.identification.model import Elastic, StaticModel, tool_positions
from jointplay.identification.parameters import (
    SCALES,
    TOOL,
    WOUND,
    Compliance,
    Given,
    Parameter,
    compliances,
    friction_of,
    unknowns,
    winds,
    with_clearance,
)
from jointplay.identification.planning import enough
from jointplay.identification.restitution import (
    IMPACT_KINDS,
    Restitution,
    by_flights,
    by_simulation,
    channels,
)
from jointplay.loads.drive import JointFriction
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion
from jointplay.simulation.simulation import Simulation

# The search for the best values, and for others that are as good.
#
# Play that may or may not meet its walls has several minima, and edges: at the clearance at which
# an end wall begins to limit the lean, more of it changes nothing. So the search begins at
# several places, and what explains the means as well as the best widens the intervals.


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


def search(problem: LeastSquares, start: np.ndarray, kinds: np.ndarray) -> tuple[LeastSquares, Fit]:
    """Least squares with errors as large as what is left demands, by kind of signal.

    Args:
        problem: to solve.
        start: values to begin with, (p,).
        kinds: number of each number's kind of signal, -1 for what was known before, (m,).

    Means scatter by more than their records do: journals do not come to rest at quite the same
    place, and the model is not exact. That is added to the errors.
    """
    tried = [solve(problem, one, _FIRST) for one in _starts(problem, start)]
    best = min(tried, key=lambda fit: cost(problem, fit.theta))
    own = problem.error
    for _ in range(_ROUNDS):
        left = problem.rest(best.theta)
        rough = np.where(kinds < 0, 0.0, _ROUGH * np.abs(problem.predict(best.theta)))
        share = max(best.freedom, 1) / len(own)
        more = np.zeros(len(own))
        for kind in np.unique(kinds[kinds >= 0]):
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


def _profiled(problem: LeastSquares, best: Fit, wide: np.ndarray, i: int) -> float:
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


def _with_other_walls(problem: LeastSquares, theta: np.ndarray) -> list[np.ndarray]:
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


def _fitted_beside(problem: LeastSquares, theta: np.ndarray, i: int, value: float) -> np.ndarray:
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
    problem: LeastSquares, whole: Callable[[np.ndarray], np.ndarray], x: np.ndarray
) -> np.ndarray:
    return problem.predict(whole(x))


def cost(problem: LeastSquares, theta: np.ndarray) -> float:
    """Sum of the squares that are left, in standard errors."""
    return float(np.square(problem.residual(theta)).sum())


def _far(problem: LeastSquares, theta: np.ndarray, best: Fit) -> bool:
    """Whether another minimum is none that the intervals hold."""
    return bool((np.abs(theta - best.theta) > np.minimum(best.half_width, problem.scale)).any())


def _starts(problem: LeastSquares, start: np.ndarray) -> list[np.ndarray]:
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


# Why an unknown cannot be told, and what would tell it: in words; how the machine gives way.


_NAMED = 3
"""Compliances that are named."""
_SIZE = 8.0
"""Parts of the strongest push by which sizes of pushes are told apart."""


@dataclass(frozen=True)
class Elasticity:
    """A compliance, as far as a measurement tells it."""

    label: str
    unit: str
    value: float
    half_width: float
    """Of the 95 % interval."""

    @property
    def told(self) -> bool:
        """Whether half of the interval is less than half of the value."""
        return self.half_width <= planning.TOLD * abs(self.value)

    def __str__(self) -> str:
        """One line."""
        factor, unit = SCALES[self.unit]
        low, high = self.value - self.half_width, self.value + self.half_width
        return (
            f"{self.label + ' compliance':<34} {'':>12} {f'{factor * self.value:.4g} {unit}':>12}  "
            f"{factor * low:.4g} {unit} to {factor * high:.4g} {unit}"
        )


def elasticity(
    problem: LeastSquares, fit: Fit, elastic: Sequence[Elastic]
) -> tuple[Elasticity, ...]:
    """Each joint's compliances with what was found; the structure's at the tool is no number."""
    effect = problem.sensitivity(fit.theta, raw=True) / problem.error[:, None]
    left = (problem.seen - problem.predict(fit.theta)) / problem.error
    free = problem.free / problem.error[:, None]
    found = []
    for one in elastic:
        if one.label == TOOL or not one.effect.any():
            continue
        k = int(problem.elastic[one.label][0])
        others = np.column_stack([np.delete(free, k, axis=1), effect])
        basis, sizes, _ = np.linalg.svd(others, full_matrices=False)
        basis = basis[:, sizes > 1e-9 * sizes.max(initial=1e-300)]
        own = free[:, k] - basis @ (basis.T @ free[:, k])
        size = float(own @ own)
        if size <= 1e-12 * float(free[:, k] @ free[:, k]):
            found.append(Elasticity(one.label, one.unit, one.known.value, np.inf))
            continue
        value = one.known.value + float(own @ left) / size
        half = fit.quantile * max(fit.misfit, 1.0) / np.sqrt(size)
        half = SAFETY * float(np.hypot(half, MODEL_ELSE * value))
        found.append(Elasticity(one.label, one.unit, value, half))
    return tuple(found)


def reason(i: int, fit: Fit, problem: LeastSquares, made: Visits, model: StaticModel) -> str:
    """Why an unknown cannot be told; empty if it can."""
    one = problem.unknowns[i]
    half = fit.half_width[i]
    if half <= planning.enough(one, fit.theta[i]):
        return _held_by_friction(i, fit, problem)
    soft = _explained(i, fit, problem, made)
    if soft:
        return soft
    if fit.felt[i] < FAINT:
        return _unfelt(one, made, model)
    partners = [problem.unknowns[k].label for k in fit.partners(i)]
    if fit.blind[i, i] > BLIND and partners:
        return f"it acts only together with {', '.join(partners)}"
    return (
        f"its 95 % interval would be +- {one.shown(half)}, more than half of it"
        if np.isfinite(half)
        else "next to nothing of it shows above the noise"
    )


def _held_by_friction(i: int, fit: Fit, problem: LeastSquares) -> str:
    """That an interval which begins at zero may be friction's doing, if its friction is not told.

    A journal that friction holds does not move in wide play either: no play, and any play with
    enough friction, leave the same means.
    """
    one = problem.unknowns[i]
    if not one.name.endswith("clearance") or fit.theta[i] > fit.half_width[i]:
        return ""
    for k, other in enumerate(problem.unknowns):
        rubs = other.joint == one.joint and other.name == "friction" and other.sought
        if rubs and fit.half_width[k] > planning.enough(other, fit.theta[k]):
            return (
                f"its interval begins at zero, and {other.label}, which cannot be told, may "
                "hold the journal wherever it is: pass the places slowly, in both directions"
            )
    return ""


def _explained(i: int, fit: Fit, problem: LeastSquares, made: Visits) -> str:
    """That elasticity explains what shows of an unknown as well, if it does."""
    if problem.unknowns[i].name in WOUND:
        return ""
    wound = [one.label for one in problem.unknowns if one.name in WOUND]
    every = [*wound, *problem.elastic]
    effect = problem.sensitivity(fit.theta, raw=True)

    def told(labels: Collection[str]) -> bool:
        """Whether it would be, if the machine were rigid in these ways."""
        kept = [k for k, one in enumerate(problem.unknowns) if one.label not in labels]
        rigid = problem.without([label for label in labels if label in problem.elastic])
        covariance, blind, _ = information(rigid.whiten(effect[:, kept]))
        k = kept.index(i)
        half = fit.quantile * SAFETY * max(fit.misfit, 1.0) * np.sqrt(covariance[k, k])
        half *= problem.unknowns[i].scale
        return bool(
            blind[k, k] <= BLIND and half <= planning.enough(problem.unknowns[i], fit.theta[i])
        )

    if not every or not told(every):
        return ""
    which = [label for label in every if told([label])]
    sizes = np.unique(np.round(_SIZE * made.force / max(np.abs(made.force).max(), 1e-12)), axis=0)
    count = len(np.unique(np.round(np.linalg.norm(sizes, axis=1)))) - 1
    words = ", ".join(which[:_NAMED]) if which else "of several parts at once"
    words += f" or another of {len(which)}" if len(which) > _NAMED else ""
    return (
        f"elasticity ({words}) explains what shows as well: pushes of "
        f"{max(count, 0)} size{'s' * (count != 1)} are not enough here; push with others, or give "
        f"the stiffness (--stiffness{f' of {which[0]}' if which else ''})"
    )


def _unfelt(one: Parameter, made: Visits, model: StaticModel) -> str:
    """Why nothing moves with an unknown."""
    if one.joint in made.joints and one.name in ("friction", "gear_play", "dry_friction"):
        ways = set(made.direction[:, made.joints.index(one.joint)].tolist()) - {0}
        if len(ways) < 2:
            return "nothing shows: the joint never reverses"
        if one.name == "gear_play":
            return "nothing shows: the load keeps the gear's teeth on one side"
    move = model.lever(one.joint)
    if move is not None and not np.abs(move).max() > 0.0:
        return "nothing shows: the joint does not move the tool"
    return "nothing shows: its load pushes the journal the same way at every visit of a place"


def advice(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    given: Mapping[str, Compliance],
    fit: Fit,
    problem: LeastSquares,
    seen: Observed,
    model: StaticModel,
    reasons: Sequence[str],
) -> tuple[str, ...]:
    """Which further experiment or signal would tell what cannot be told."""
    sought = problem.unknowns
    if not any(reason and one.sought for reason, one in zip(reasons, sought, strict=True)):
        return ("",) * len(sought)
    rigid = problem.without(problem.elastic)
    gives = [
        planning.SOFT[one.unit] * problem.free[:, problem.elastic[one.label]]
        for one in model.elastic
    ]
    effect = np.column_stack(
        [rigid.sensitivity(fit.theta), *(rigid.whiten(columns) for columns in gives)]
    )
    before = effect.T @ effect / max(fit.misfit, 1.0) ** 2 + planning.prior(sought, model)[0]
    noise = dict(planning.NOISE)
    for (kind, _), spread in zip(seen.keys, seen.noise, strict=True):
        noise[kind] = max(spread, 1e-9)
    offers = planning.offers(mechanism, friction, sought, given, seen.keys, noise, fit.theta)
    lines = []
    for i, (one, reason) in enumerate(zip(sought, reasons, strict=True)):
        best, words = np.inf, ""
        for gain, text in offers if reason and one.sought else ():
            half = planning.half_widths(sought, before + gain)[i]
            if half < 0.8 * best:  # the simpler comes first
                best, words = half, text
        limit = planning.enough(one, fit.theta[i])
        if best <= limit:
            lines.append(f"would tell, to +- {one.shown(best)}: {words}")
        elif words and best < 0.5 * fit.half_width[i] and best < 4.0 * limit:
            times = int(np.ceil((best / limit) ** 2))
            lines.append(f"would tell if done about {times} times: {words}")
        else:
            lines.append("")
    return tuple(lines)


# What an identification found, as a table, CSV and plain data.


LARGE = 3.0
"""Times the records' scatter from which on what the model leaves is said to be large."""


@dataclass(frozen=True)
class Identification:
    """What a measurement says of p unknowns; SI units."""

    unknowns: tuple[Parameter, ...]
    value: np.ndarray
    """Shape (p,)."""
    half_width: np.ndarray
    """Of the 95 % intervals; infinite where nothing is told, shape (p,)."""
    reasons: tuple[str, ...]
    """Why an unknown cannot be told, empty where it can."""
    advice: tuple[str, ...]
    """Which measurement would tell it, empty where none is needed or known."""
    mechanism: Mechanism
    """With what was found; unknowns that cannot be told as in the scenario."""
    visits: Visits
    observed: Observed
    error: np.ndarray
    """Standard errors of the means that counted, nan where none did, (n, keys) [SI]."""
    predicted: np.ndarray
    """By the static model with what was found, offsets included, shape (n, keys) [SI]."""
    nuisances: np.ndarray
    """Effect of what is not sought: offsets, drift, what friction holds anywhere, compliances,
    shape (n, keys, columns)."""
    misfit: float
    """RMS of what the model leaves, in standard errors, which are as large as that demands."""
    reference: str
    notes: tuple[str, ...]
    measured: Measurement
    restitutions: tuple[Restitution, ...] = ()
    """Of the joints' impacts, where there is a signal that shows them."""
    excess: float = np.nan
    """RMS of what the model leaves, by the scatter of the records alone."""
    elasticity: tuple[Elasticity, ...] = ()
    """Compliances of the joints that were accounted for."""

    @property
    def told(self) -> np.ndarray:
        """Which unknowns can be told, shape (p,)."""
        return np.array([not reason for reason in self.reasons])

    def __getitem__(self, label: str) -> tuple[float, float]:
        """Value and half width by label, such as ``"elbow radial clearance"``."""
        for i, one in enumerate(self.unknowns):
            if one.label == label:
                return float(self.value[i]), float(self.half_width[i])
        raise MissingName("unknown", label, [one.label for one in self.unknowns])

    def interval(self, i: int) -> tuple[float, float]:
        """95 % interval of the i-th unknown within what can be."""
        value, half = self.value[i], self.half_width[i]
        return max(value - half, 0.0), min(value + half, self.unknowns[i].most)

    def __str__(self) -> str:
        """The table, and why what cannot be told cannot."""
        lines = [f"{'unknown':<34} {'scenario':>12} {'found':>12}  95 % interval"]
        for i, one in enumerate(self.unknowns):
            if not one.sought:
                continue
            head = f"{one.label:<34} {one.shown(one.nominal):>12}"
            if self.reasons[i]:
                lines.append(f"{head} {'-':>12}  this measurement cannot tell")
            else:
                low, high = self.interval(i)
                interval = f"{one.shown(low)} to {one.shown(high)}"
                lines.append(f"{head} {one.shown(self.value[i]):>12}  {interval}")
        lines += [str(one) for one in self.elasticity if one.told]
        lines += [str(one) for one in self.restitutions]
        for i, one in enumerate(self.unknowns):
            if one.sought and self.reasons[i]:
                lines.append(f"{one.label}: {self.reasons[i]}")
                if self.advice[i]:
                    lines.append(f"  {self.advice[i]}")
        lines += [f"{r.joint} restitution: {r.reason}" for r in self.restitutions if r.reason]
        if not self.unknowns:
            return "\n".join([*self.notes, *lines])
        dark = [one.label for one in self.elasticity if not one.told]
        if dark:
            lines.append(f"compliances accounted for, but not told: {', '.join(dark)}, tool")
        used = np.isfinite(self.error)
        at = used.any(axis=1)
        lines.append(
            f"statistical, static model; {int(at.sum())} visits "
            f"({int((self.visits.stopped & at).sum())} stops) of "
            f"{len(np.unique(self.visits.cell[at]))} places, {int(used.sum())} means; "
            f"left over: {self.excess:.2g} times what the records' scatter explains (RMS)"
        )
        if self.excess > LARGE:
            lines.append(
                "the model does not explain all of that: errors were enlarged, intervals with them"
            )
        return "\n".join([*self.notes, *lines])

    def csv(self) -> str:
        """A row for each unknown [SI]."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["joint", "unknown", "unit", "scenario", "found", "low", "high", "why_not"])
        for i, one in enumerate(self.unknowns):
            if one.sought:
                low, high = self.interval(i)
                numbers = [one.nominal, *(("", "", "") if self.reasons[i] else ())]
                if not self.reasons[i]:
                    numbers += [f"{x:.9g}" for x in (self.value[i], low, high)]
                writer.writerow([one.joint, one.name, one.unit, *numbers, self.reasons[i]])
        for other in self.restitutions:
            ends = [other.value, *other.interval]
            numbers = ["", "", ""] if other.reason else [f"{x:.9g}" for x in ends]
            writer.writerow([other.joint, "restitution", "", "", *numbers, other.reason])
        return out.getvalue()

    def describe(self) -> dict[str, Any]:
        """As plain data [SI]."""
        found = []
        row: dict[str, Any]
        for i, one in enumerate(self.unknowns):
            if one.sought:
                row = {"joint": one.joint, "unknown": one.name, "unit": one.unit}
                row |= {"scenario": one.nominal, "why_not": self.reasons[i]}
                low, high = self.interval(i)
                told: dict[str, Any] = {
                    "found": float(self.value[i]),
                    "low": float(low),
                    "high": float(high),
                }
                found.append(row | ({} if self.reasons[i] else told))
        for other in self.restitutions:
            row = {"joint": other.joint, "unknown": "restitution", "unit": ""}
            row |= {"why_not": other.reason, "evidence": other.evidence}
            low, high = other.interval
            told = {"found": other.value, "low": low, "high": high}
            if not np.isnan(other.nominal):
                told["nominal"] = other.nominal
            found.append(row | ({} if other.reason else told))
        misfit = None if np.isnan(self.misfit) else float(self.misfit)
        excess = None if np.isnan(self.excess) else float(self.excess)
        gives = [{**vars(one), "told": one.told} for one in self.elasticity]
        for row in gives:
            row["half_width"] = float(row["half_width"]) if np.isfinite(row["half_width"]) else None
        return {
            "unknowns": found,
            "compliances": gives,
            "misfit": misfit,
            "excess": excess,
            "notes": list(self.notes),
        }


_NORMAL = 1.96
"""Half of a 95 % interval in standard deviations."""


def identify(
    machine: Simulation | Mechanism,
    measured: Measurement | str | Path,
    *,
    motion: Motion | None = None,
    reference: str = "place",
    noise: Mapping[str, float] | None = None,
    joint_friction: Mapping[str, JointFriction] | None = None,
    also: Sequence[str] = (),
    known: Sequence[str] = (),
    stiffness: Given | None = None,
    drift: int = DRIFT,
    runs: int = 0,
    jobs: int | None = None,
    progress: bool = False,
) -> Identification:
    """Clearances, friction, play of gears and restitution from measured signals.

    Means over stops and slow stretches are compared with the static model, impacts by their
    statistics, never single records.

    Args:
        machine: the scenario's simulation or the mechanism, with the play that is expected.
        measured: signals, or the file that has them.
        motion: reference, if the machine has none of its own; for joints without encoder.
        reference: what is known of the tool's ideal place, one of `fit.REFERENCES`: ``place``
            (nothing, but the same at each visit), ``frame`` (all but where the tracker's frame
            lies), ``ideal`` (all: the geometry is calibrated).
        noise: standard deviation of a record by kind of signal [SI]; else from the records.
        joint_friction: of joints besides their bearings'; None takes the simulation's or URDF's.
        also: of `parameters.ALSO`: dry ``friction`` behind all gears, not only those with some.
        known: labels or names of unknowns that are taken from the scenario.
        stiffness: what is known of the machine's stiffness, by label: ``"elbow torsional"`` (of its
            gear, if it has one), ``"elbow tilt"`` [N m/rad], ``"elbow radial"``, ``"elbow axial"``,
            ``"tool"`` [N/m], alone or with its relative standard deviation; ``inf`` is rigid, and
            ``{"all": inf}`` are all but gears. What is not said is unknown.
        drift: degree of the polynomial in time by which readings may drift; 0: they do not.
        runs: simulations by which restitution is sought where flights do not tell it; 0: none.
        jobs: processes for them; None takes one for each core.
        progress: show a bar for them.

    Raises:
        JointplayError: bad data (see `Measurement`); loops, unless impacts show; nothing has play;
            a motion that never reverses; fewer means than unknowns; see also `by_simulation`.
    """
    mechanism, motion, friction = _inputs(machine, motion, joint_friction)
    if reference not in REFERENCES:
        raise MissingName("reference", reference, REFERENCES)
    measured = _read(measured, mechanism, noise)
    bounced = by_flights(mechanism, measured)
    if drift < 0:
        raise JointplayError(f"the degree of the drift must not be negative, got {drift}")
    given = compliances(mechanism, stiffness or {})
    try:
        found = _by_means(
            mechanism, measured, motion, reference, friction, also, known, given, drift
        )
    except TooLittle as error:
        if not bounced or not any(measured.has(kind) for kind in IMPACT_KINDS):
            raise
        note = f"clearance and friction: this measurement cannot tell: {error}"
        found = _impacts_only(mechanism, measured, reference, note)
    if runs and channels(measured) and any(one.reason for one in bounced):
        if not isinstance(machine, Simulation):
            raise JointplayError(
                "restitution by simulated impacts needs the scenario (.toml) that was measured"
            )
        own = replace(machine, mechanism=found.mechanism, motion=motion)
        told = by_simulation(own, measured, spreads(found), runs=runs, jobs=jobs, progress=progress)
        pairs = zip(bounced, told, strict=True)
        bounced = tuple(other if one.reason else one for one, other in pairs)
    return replace(found, restitutions=bounced, mechanism=with_restitution(found, bounced))


def _by_means(
    mechanism: Mechanism,
    measured: Measurement,
    motion: Motion | None,
    reference: str,
    friction: Mapping[str, JointFriction],
    also: Sequence[str],
    known: Sequence[str],
    given: Mapping[str, Compliance],
    drift: int,
) -> Identification:
    """Everything but restitution."""
    if mechanism.loops:
        raise TooLittle(
            f"loop {next(iter(mechanism.loops))!r}: identify is for robots without closed loops"
        )
    links = set(measured.has("link")) & set(mechanism.gears)
    if not (measured.has("tool") or measured.has("torque") or links):
        raise TooLittle(
            f"{measured.source} has nothing that play would show in: tool x (y, z), JOINT link of "
            "a gear with play, or JOINT torque is needed beside the motors' encoders"
        )
    made, seen = visits(mechanism, measured, motion)
    torqued = [name for kind, name in seen.keys if kind == "torque"]
    stops = bool(made.stopped.any()) and any(kind == "tool" for kind, _ in seen.keys)
    sought = unknowns(mechanism, friction, torqued, stops, also, known, given)
    model = StaticModel(mechanism, made, seen.keys, friction, sought, given)
    usable = np.isfinite(seen.mean) & model.certain[:, None]
    _check(measured, made, seen.keys, usable, reference)
    error = np.where(usable, _errors(seen), np.nan)
    records = error.copy()
    problem = _problem(mechanism, model, made, seen, error, reference, drift)
    problem, fit = _fitted(problem, seen, error, measured.source)
    reasons = tuple(reason(i, fit, problem, made, model) for i in range(len(sought)))
    words = advice(mechanism, friction, given, fit, problem, seen, model, reasons)
    predicted = model.predict(fit.theta) + _offsets(problem, fit.theta, error)
    left = (seen.mean - predicted)[np.isfinite(error)] / records[np.isfinite(error)]
    excess = float(np.sqrt(np.square(left).sum() / fit.freedom))
    *_, unseen = positions(mechanism, measured, motion)
    return Identification(
        sought,
        fit.theta,
        fit.half_width,
        reasons,
        words,
        apply(mechanism, sought, fit.theta, reasons),
        made,
        seen,
        error,
        predicted,
        nuisances(mechanism, model, made, seen, reference, drift)[0],
        fit.misfit,
        reference,
        (
            *_assumed(mechanism, friction, sought, given, measured, seen, reference, drift),
            *_notes(unseen),
        ),
        measured,
        excess=excess,
        elasticity=elasticity(problem, fit, model.elastic),
    )


def spreads(found: Identification) -> dict[str, dict[str, float]]:
    """Standard deviations of the clearances and friction that are told, by joint and name."""
    known: dict[str, dict[str, float]] = {}
    for i, one in enumerate(found.unknowns):
        if one.joint in found.mechanism.clearance and not found.reasons[i]:
            known.setdefault(one.joint, {})[one.name] = float(found.half_width[i]) / _NORMAL
    return known


def with_restitution(found: Identification, told: Sequence[Restitution]) -> Mechanism:
    """The mechanism with the restitutions that are told and that its laws can deliver."""
    joints = dict(found.mechanism.clearance)
    for one in told:
        if not one.reason and np.isfinite(one.nominal):
            joints[one.joint] = replace(joints[one.joint], restitution=one.nominal)
    return found.mechanism.with_clearance(joints) if joints else found.mechanism


def _inputs(
    machine: Simulation | Mechanism,
    motion: Motion | None,
    joint_friction: Mapping[str, JointFriction] | None,
) -> tuple[Mechanism, Motion | None, dict[str, JointFriction]]:
    """Mechanism, reference, and friction of the joints besides their bearings'."""
    mechanism = machine.mechanism if isinstance(machine, Simulation) else machine
    friction = planning.urdf_friction(mechanism)
    if isinstance(machine, Simulation):
        motion = motion or machine.motion
        if machine.payloads:
            raise JointplayError(
                "payloads that are picked up are not known to identify; put them into the URDF"
            )
        friction |= dict(machine.joint_friction or {})
    return mechanism, motion, friction | dict(joint_friction or {})


def _fitted(
    problem: LeastSquares, seen: Observed, error: np.ndarray, source: str
) -> tuple[LeastSquares, Fit]:
    """The search from the scenario's values; writes the errors that it ends with into `error`."""
    start = np.array([one.nominal or 0.5 * one.scale for one in problem.unknowns])
    names = [kind for kind, _ in seen.keys]
    numbers = np.broadcast_to([names.index(kind) for kind in names], error.shape)
    kinds = np.full(len(problem.seen), -1)
    count = int(np.isfinite(error).sum())
    kinds[:count] = numbers[np.isfinite(error)]
    problem, fit = search(problem, start, kinds)
    error[np.isfinite(error)] = problem.error[:count]
    if fit.freedom < 1:
        raise TooLittle(
            f"{source}: {count} means at {len(error)} visits are too few for "
            f"{len(start)} unknowns and {problem.offsets} offsets, drifts and compliances; visit "
            "places more often, from both sides"
        )
    return problem, fit


def _impacts_only(
    mechanism: Mechanism, measured: Measurement, reference: str, note: str
) -> Identification:
    """Where means say nothing."""
    made, seen = no_visits()
    none, nothing = np.zeros((0, 0)), np.zeros(0)
    return Identification(
        (), nothing, nothing, (), (), mechanism, made, seen, none, none, none[..., None], np.nan,
        reference, (note,), measured,
    )  # fmt: skip


def _read(
    measured: Measurement | str | Path, mechanism: Mechanism, noise: Mapping[str, float] | None
) -> Measurement:
    if not isinstance(measured, Measurement):
        entries = mechanism.description.joints
        slides = {name: entries[name].slides for name in moving(mechanism)}
        slides = dict.fromkeys(mechanism.clearance, False) | slides
        return Measurement.from_csv(measured, slides, noise)
    return replace(measured, noise={**measured.noise, **(noise or {})})


def _check(
    measured: Measurement,
    made: Visits,
    keys: Sequence[Key],
    usable: np.ndarray,
    reference: str,
) -> None:
    """Raise if no place is visited in two ways."""
    at = usable.any(axis=1)
    if not at.any():
        raise TooLittle(
            f"{measured.source}: no visit counts: at none it is known on which side teeth and "
            "journals lie; each gear must cross its play before, by a reversal or a push, and each "
            "bearing be pressed: push the tool"
        )
    if reference != "place":
        return
    ways = np.column_stack([made.cell, made.direction, np.round(made.force, 3)])[at]
    places = np.unique(ways, axis=0)[:, 0]
    if len(np.unique(places)) == len(places) and not {k for k, _ in keys} & {"torque"}:
        raise TooLittle(
            f"{measured.source}: the motion never reverses: no place is visited from two sides or "
            "under two forces, so that no play shows; measure the way back, too (if the robot's "
            "geometry is calibrated, say so with the reference 'ideal')"
        )


def _errors(seen: Observed) -> np.ndarray:
    """Standard errors of the means by the records' scatter; none is zero."""
    smallest = np.array([1e-12 + 1e-9 * np.nanmax(np.abs(row), initial=0.0) for row in seen.mean.T])
    return np.maximum(seen.error, smallest)


def nuisances(
    mechanism: Mechanism,
    model: StaticModel,
    made: Visits,
    seen: Observed,
    reference: str,
    drift: int,
) -> tuple[np.ndarray, tuple[str, ...]]:
    """What moves the signals and is not sought: its effect (n, keys, columns).

    Offsets, drift, what friction holds anywhere, and last the compliances, by their labels.
    """
    tool = tool_positions(mechanism, made.joints, made.position)
    parts = [
        offsets(seen.keys, made.cell, made.position, tool, reference),
        drifts(seen.keys, made.time.mean(axis=1), drift),
        model.loose(),
    ]
    labels: list[str] = []
    for one in model.elastic:
        parts.append(one.effect)
        labels += [one.label] * one.effect.shape[2]
    return np.concatenate(parts, axis=2), tuple(labels)


def _problem(
    mechanism: Mechanism,
    model: StaticModel,
    made: Visits,
    seen: Observed,
    error: np.ndarray,
    reference: str,
    drift: int,
) -> LeastSquares:
    use = np.isfinite(error).ravel()
    free, labels = nuisances(mechanism, model, made, seen, reference, drift)
    free = free.reshape(use.size, free.shape[2])[use]
    first = free.shape[1] - len(labels)
    columns = {
        label: first + np.flatnonzero([one == label for one in labels])
        for label in dict.fromkeys(labels)
    }
    # What was known before counts like means: of unknowns, then of compliances.
    stated = [i for i, one in enumerate(model.unknowns) if np.isfinite(one.spread)]
    soft = [one for one in model.elastic if np.isfinite(one.known.spread)]
    rows = [(k, one.known.spread) for one in soft for k in columns[one.label]]
    more = np.zeros((len(stated) + len(rows), free.shape[1]))
    for row, (k, _) in enumerate(rows, len(stated)):
        more[row, k] = 1.0
    every = np.arange(len(seen.keys))
    number = made.cell[:, None] * len(seen.keys) + every
    strength = max(float(np.abs(made.force).max()), 1e-12)
    loads = np.column_stack([made.direction, made.stopped, np.round(4.0 * made.force / strength)])
    _, load = np.unique(loads, axis=0, return_inverse=True)
    states = np.ravel(load)[:, None] * len(seen.keys) + every
    alone = -1 - np.arange(len(more))
    return LeastSquares(
        model.unknowns,
        lambda theta: np.concatenate(
            [model.predict(theta).ravel()[use], theta[stated], np.zeros(len(rows))]
        ),
        np.concatenate(
            [
                seen.mean.ravel()[use],
                [model.unknowns[i].nominal for i in stated],
                np.zeros(len(rows)),
            ]
        ),
        np.concatenate(
            [
                error.ravel()[use],
                [model.unknowns[i].spread for i in stated],
                [spread for _, spread in rows],
            ]
        ),
        np.concatenate([free, more]),
        tuple(np.concatenate([g.ravel()[use], alone]) for g in (number, states)),
        columns,
    )


def _offsets(problem: LeastSquares, theta: np.ndarray, error: np.ndarray) -> np.ndarray:
    """What offsets, drift and compliances do, shape (n, keys); zero where nothing counted."""
    left = (problem.seen - problem.predict(theta)) / problem.error
    fitted = np.linalg.lstsq(problem.free / problem.error[:, None], left, rcond=1e-9)[0]
    shifts = np.zeros(error.size)
    use = np.isfinite(error).ravel()
    shifts[use] = (problem.free @ fitted)[: int(use.sum())]
    return shifts.reshape(error.shape)


def apply(
    mechanism: Mechanism,
    sought: Sequence[Parameter],
    theta: np.ndarray,
    reasons: Sequence[str],
) -> Mechanism:
    """The mechanism with those values that are told."""
    joints, gears = dict(mechanism.clearance), dict(mechanism.gears)
    for one, value, why_not in zip(sought, theta, reasons, strict=True):
        if why_not or not one.joint:
            continue
        if one.name == "gear_play":
            gears[one.joint] = replace(gears[one.joint], play=float(value))
        elif one.name == "gear_compliance":
            gears[one.joint] = replace(gears[one.joint], stiffness=1.0 / max(float(value), 1e-12))
        elif one.name not in ("dry_friction", "torsional_compliance"):
            joints[one.joint] = with_clearance(joints[one.joint], {one.name: float(value)})
    return mechanism.with_clearance(joints, gears)


def _assumed(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    sought: Sequence[Parameter],
    given: Mapping[str, Compliance],
    measured: Measurement,
    seen: Observed,
    reference: str,
    drift: int,
) -> tuple[str, ...]:
    """All that was taken for granted, a line each."""
    ideal = {
        "place": "the tool's ideal place is the same at each visit of a place",
        "frame": "the tool's ideal place is known but for the tracker's frame",
        "ideal": "the tool's ideal place is known",
    }
    lines = [f"assumed (--reference {reference}): {ideal[reference]}"]
    stated, weak = [], []
    for label, one in given.items():
        unit = "N*m/rad" if label.endswith(("torsional", "tilt", "link")) else "N/m"
        if not one.value and one.spread:
            if label.removesuffix(" link") in winds(mechanism, friction, given):
                weak.append(f"{label} 0 +- {1e6 * one.spread:.3g} urad/(N m)")
        elif not one.value:
            stated.append(f"{label} rigid")
        else:
            part = f" +- {100.0 * one.spread / one.value:.3g} %" if one.spread else ""
            stated.append(f"{label} {1.0 / one.value:.4g} {unit}{part}")
    if all(word.endswith(" rigid") for word in stated) and "tool rigid" in stated:
        stated = ["everything rigid but gears"]
    lines.append(
        f"assumed (--stiffness): {', '.join(stated) or 'nothing'}; other compliances are unknown"
    )
    softest = [f"{one.label} at most {one.shown(one.most)}" for one in sought if one.name in WOUND]
    if weak or softest:
        lines.append(f"assumed (--stiffness) of compliances: {', '.join([*softest, *weak])}")
    words = f"like a polynomial in time of degree {drift}" if drift else "not at all"
    lines.append(f"assumed (--drift {drift}): readings drift {words}")
    scales = {"m": (1e6, "um"), "rad": (1e6, "urad"), "N*m": (1.0, "N m"), "N": (1.0, "N")}
    units = {"tool": "m", "link": "rad", "torque": "N*m"}
    deviations = {}
    for (kind, name), spread in zip(seen.keys, seen.noise, strict=True):
        factor, unit = scales[units[kind]]
        source = "given" if kind in measured.noise else "of the records"
        deviations[f"{kind} {name}"] = f"{kind} {name} {factor * spread:.3g} {unit} ({source})"
    lines.append(f"noise of a record (--noise): {', '.join(deviations.values())}")
    asked = {(one.joint, one.name) for one in sought}
    taken = []
    for joint, bearing in mechanism.clearance.items():
        if (joint, "friction") not in asked:
            value = friction_of(bearing)
            taken.append(
                f"{joint} bearing {'no law of friction known' if value is None else f'{value:g}'}"
            )
        for name, size in bearing.clearances.items():
            if (joint, name) not in asked:
                taken.append(f"{joint} {name.replace('_', ' ')} {1e6 * size:.4g} um")
    for joint in mechanism.joints:
        own = friction.get(joint, JointFriction())
        if (joint, "dry_friction") not in asked:
            taken.append(f"{joint} dry friction {own.coulomb:g} N m")
        if own.viscous:
            taken.append(f"{joint} viscous friction {own.viscous:g} N m s/rad")
    for joint, gear in mechanism.gears.items():
        if (joint, "gear_play") not in asked:
            taken.append(f"{joint} gear play {1e3 * gear.play:.4g} mrad")
        if (joint, "gear_compliance") not in asked and f"{joint} torsional" not in given:
            taken.append(f"{joint} gear stiffness {gear.stiffness:.4g} N m/rad")
    if taken:
        lines.append(f"taken from the scenario: {', '.join(taken)}")
    if mechanism.clearance:
        lines.append("assumed: contacts give way by the scenario's law, beside the compliances")
    return tuple(lines)


def _notes(unseen: Sequence[str]) -> tuple[str, ...]:
    lines = []
    if unseen:
        lines.append(
            f"note: no encoder of {', '.join(unseen)}: taken where the reference says (or at rest)"
            "; what the drives lag counts as play"
        )
    return tuple(lines)
