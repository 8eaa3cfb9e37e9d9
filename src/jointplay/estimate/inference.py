"""Inference after selection: intervals of coefficients and of every joint's play.

1. All candidates and every joint's play are fitted together, so that where one cause does what
   another does the interval of neither rests on the other's absence (`_full_model`).
2. Friction and transition of play, which are not linear, are refined about the best of their table
   (`_refined`).
3. Intervals are those of the linearised fit, wider by the excess of held-back errors
   (`Selection.excess`), and hold for all frictions and transitions that the likelihood ratio does
   not reject, the other unknowns fitted anew (`_likelihood_region`).
4. A play is known if its cause predicts held-back poses (`Selection`) and its interval excludes
   zero (`known`); else there is an upper bound and the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from jointplay.estimate.kinematic_model import FRICTIONS, TRANSITIONS, Column, Term
from jointplay.estimate.known import excludes_zero
from jointplay.estimate.pose_problem import Fitted
from jointplay.estimate.selection import Selection, Step
from jointplay.estimate.unknowns import CONFIDENCE, EXPECTATION_FACTOR, MINOR, TWO_SIDED, Estimate

SMOOTHINGS = (1.0 / EXPECTATION_FACTOR, 1.0, EXPECTATION_FACTOR)
"""Factors of a given transition for which a bound must hold: it is as uncertain as all that is
expected (`EXPECTATION_FACTOR`)."""
_HALVINGS = 5
"""Most halvings of the steps between frictions and transitions (measured on 49 random robots,
benchmarks/truth/calibrate.py: with none 8 of 36 intervals of play and 4 of 103 of gear compliance
missed the truth, with five 1 and 1, before the table's own region was added)."""


class Inference(NamedTuple):
    """Estimates with all candidates and every joint's play free."""

    coefficients: tuple[Estimate, ...]
    """Coefficients of the terms that were kept, except play."""
    play: tuple[Estimate, ...]
    """Play of every joint."""
    full: Fitted
    """The fit of all candidates and plays, from which both follow."""


def infer(selection: Selection, selected: Step, candidates: Sequence[Term]) -> Inference:
    """Estimates of the selected model's coefficients, and of every joint's play."""
    table, chosen = selection.fit(_full_model(selection, selected, candidates), selection.rows)
    full = _refined(selection, table, chosen)
    ends, plays = _likelihood_region(selection, full)
    # A refined best may be one of several that are nearly as good: the table's counts, too.
    rough_ends, rough_plays = _likelihood_region(selection, table)
    ends = np.stack([np.minimum(ends, rough_ends)[0], np.maximum(ends, rough_ends)[1]])
    plays = {i: np.concatenate([values, rough_plays[i]]) for i, values in plays.items()}
    half = selection.excess * full.half_widths()
    coefficients, first = [], len(selection.start)
    for i, column in enumerate(full.problem.columns):
        if column.term.kind != "play" and column.term in selected.terms:
            k = first + i
            partner = full.informed(k)[2]
            interval = float(ends[0, k]) - float(half[k]), float(ends[1, k]) + float(half[k])
            coefficients.append(
                Estimate(
                    column.unknown, float(full.theta[k]), float(half[k]), full.why_not(k),
                    note=partner and f"acts together with {partner}", ends=interval,
                )
            )  # fmt: skip
    predictive = {c.joint for c in selected.fitted.problem.columns if c.term.kind == "play"}
    number = {c.joint: i for i, c in enumerate(full.problem.columns) if c.term.kind == "play"}
    play = []
    for joint in selection.joints:
        if joint in number:
            play.append(_play(selection, full, number[joint], plays, joint in predictive))
        else:
            (column,) = selection.base.poses.columns(Term("play", (joint,)))
            reason = "gravity does not load this joint"
            play.append(Estimate(column.unknown, 0.0, reason=reason, bounded=True))
    return Inference(tuple(coefficients), tuple(play), full)


def _full_model(selection: Selection, selected: Step, candidates: Sequence[Term]) -> list[Term]:
    """All selected terms and candidates, then play of every joint that gravity loads."""
    poses = selection.base.poses
    terms = [*selected.terms, *(term for term in candidates if term not in selected.terms)]
    plays = [term for term in terms if term.kind == "play"]
    named = {column.joint for term in plays for column in poses.columns(term)}
    unnamed = tuple(n for n in selection.joints if n not in named and poses.loaded(n))
    others = [term for term in terms if term.kind != "play"]
    return [*others, *plays, *([Term("play", unnamed)] if unnamed else [])]


def _refined(selection: Selection, full: Fitted, chosen: Mapping[int, int]) -> Fitted:
    """Refine frictions and transitions of play between those of the table.

    Where poses are precise the best of a table fits badly, and its interval is too narrow: so the
    steps about the best are halved as long as the cost falls by more than one squared standard
    error. The columns then have all that was tried as their options.
    """
    sought = [i for i in chosen if full.problem.columns[i].term.kind == "play"]
    best = {i: full.problem.columns[i].choices[k] for i, k in chosen.items() if i in sought}
    for halved in range(_HALVINGS if sought else 0):
        columns, theta = list(full.problem.columns), full.theta
        for i in sought:
            column = columns[i]
            table = column.choices
            near = _about(selection, column, best[i], halved)
            poses = selection.base.poses
            options = 0.5 * poses.leaning(column.joint, *np.transpose(near))
            local = replace(column, choices=near, options=options)
            problem = full.problem.having([*columns[:i], local, *columns[i + 1 :]])
            gains, *_ = selection.gains(problem, i, theta, selection.rows)
            k = int(gains.argmax())
            best[i] = near[k]
            assert column.options is not None
            columns[i] = replace(
                column, feature=options[:, k], choices=[*table, *near],
                options=np.column_stack([column.options, options]),
            )  # fmt: skip
        finer = full.problem.having(columns).fit(selection.rows, theta)
        fall = full.least.cost(full.theta) - finer.least.cost(finer.theta)
        full = finer
        if fall < (selection.excess * full.stretch) ** 2:
            break
    return full


def _about(
    selection: Selection, column: Column, best: tuple[float, ...], halved: int
) -> list[tuple[float, ...]]:
    """Pairs of friction and transition about the best of a play, by steps that were `halved` so
    often [N m]; what is given stays as it is."""
    term, friction, transition = column.term, *best
    largest = float(np.abs(selection.base.poses.load[:, column.index]).max())
    steps = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]) / 2.0**halved
    frictions, transitions = [friction], [transition]
    if term.friction is None and selection.base.poses.measured.ordered:
        around = friction + FRICTIONS[1] * largest * steps
        frictions = np.unique(np.clip(around, 0.0, FRICTIONS[-1] * largest)).tolist()
    if term.transition is None:
        around = transition * (TRANSITIONS[1] / TRANSITIONS[0]) ** steps
        # Beyond the table play is a compliance, or a jump between two poses.
        limits = TRANSITIONS[0] * largest, TRANSITIONS[-1] * largest
        transitions = np.unique(np.clip(around, *limits)).tolist()
    return list(product(frictions, transitions))


def _likelihood_region(
    selection: Selection, full: Fitted
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """Values over all frictions and transitions of play that a likelihood ratio does not reject.

    By the theorem of Wilks: the cost of friction and transition, two unknowns, may exceed the least
    by the quantile of chi-square with two degrees of freedom. All unknowns follow to first order.

    Returns:
        Least and largest value of each unknown, (2, p): other causes make up for play; and the
        values of each play, by the number of its column.
    """
    ends, plays = np.stack([full.theta, full.theta]), dict[int, np.ndarray]()
    allowed = chi2.ppf(CONFIDENCE, 2) * (selection.excess * full.stretch) ** 2
    for i, column in enumerate(full.problem.columns):
        if column.options is not None and column.term.kind == "play":
            gains, values, theta = selection.gains(full.problem, i, full.theta, selection.rows)
            near = gains >= gains.max() - allowed
            plays[i], theta = values[near], theta[:, near]
            ends[0] = np.minimum(ends[0], theta.min(axis=1))
            ends[1] = np.maximum(ends[1], theta.max(axis=1))
    return ends, plays


def _play(
    selection: Selection, full: Fitted, i: int, plays: dict[int, np.ndarray], predictive: bool
) -> Estimate:
    """Estimate of the play of the i-th column; `predictive`: it predicts held-back poses."""
    k, column, value = len(selection.start) + i, full.problem.columns[i], full.coefficients[i]
    half, side = (
        selection.excess * full.half_widths(quantile)[k] for quantile in (TWO_SIDED, CONFIDENCE)
    )
    value = float(value)
    low, high = value - half, value + half
    upper = max(value, 0.0) + side
    if column.options is not None:
        near = plays[i]
        low, high = float(near.min()) - half, float(near.max()) + half
        upper = max(upper, max(high - half, 0.0) + side)
    else:
        upper = max(upper, _smoothed(selection, full, i))
    known = predictive and excludes_zero(low)
    reason = "" if known else _why_not(full, i)
    return Estimate(
        column.unknown, value, reason=reason, ends=(low, high), upper=upper, bounded=not known
    )


def _smoothed(selection: Selection, full: Fitted, i: int) -> float:
    """Largest upper bound of a play over the transitions that may be meant by a given one."""
    columns, largest = list(full.problem.columns), 0.0
    column = columns[i]
    friction, transition = column.term.friction or 0.0, column.term.transition or 0.0
    for factor in SMOOTHINGS:
        lean = selection.base.poses.leaning(column.joint, friction, factor * transition)
        columns[i] = replace(column, feature=0.5 * lean)
        fitted = full.problem.having(columns).fit(full.rows, full.theta)
        side = selection.excess * fitted.half_widths(CONFIDENCE)
        bound = max(float(fitted.coefficients[i]), 0.0) + side[len(selection.start) + i]
        largest = max(largest, bound)
    return largest


def _why_not(fitted: Fitted, i: int) -> str:
    """Why the play of the i-th column cannot be told; empty if nothing speaks against it."""
    poses, column = fitted.problem.poses, fitted.problem.columns[i]
    load = poses.load[:, column.index]
    largest, friction = np.abs(load).max(), column.term.friction
    if friction and largest < friction:
        effort = "N m" if poses.turns[column.index] else "N"
        return (
            f"its load, at most {largest:.2g} {effort}, is smaller than the friction of "
            f"{friction:.2g} {effort}"
        )
    transition = column.term.transition or TRANSITIONS[0] * largest
    side = np.round(poses.leaning(column.joint, 0.0, transition))
    rarer = int(min((side > 0).sum(), (side < 0).sum()))
    # It is not known in any case; this only chooses the words.
    if rarer < max((1.0 - CONFIDENCE) * len(side), 2.0):
        times = "never" if not rarer else f"in only {rarer} of {len(side)} poses"
        return f"its load is on the other side {times}"
    return fitted.why_not(len(fitted.problem.frame) + i)


def notes(selection: Selection, selected: Step) -> list[str]:
    """Notes on the selected model: errors that it does not explain, and chosen features."""
    lines = []
    if selection.excess > 1.0 + MINOR:
        lines.append(
            f"note: held-back errors are {selection.excess:.1f} times as large as the fits "
            "predict: these causes do not explain all of it; intervals and bounds are enlarged "
            "accordingly"
        )
    for i, choice in selected.chosen.items():
        column = selected.fitted.problem.columns[i]
        numbers = column.choices[choice]
        text = f"jump at {numbers[0]:.3g} rad"
        if column.term.kind == "play":
            text = "friction {:.2g}, transition {:.2g} N m".format(*numbers)
        lines.append(f"{column.term.kind} {column.joint}: {text}, chosen by the fit of each fold")
    return lines
