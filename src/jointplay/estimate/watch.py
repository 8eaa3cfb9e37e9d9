"""What has changed between measurements of the same machine, and when a limit is reached.

All dates are one least squares: the play of the first is an unknown, and how each later one differs
from it. Compliances and friction are the machine's, the same at all dates but for a little that is
stated (`SAME`); offsets, drift and whatever else belongs to a date is its own. What the model is
off by it is off by at each date alike, so a change is told earlier than a value.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy.optimize import brentq

from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.tables import counted, few
from jointplay.estimate.least_squares import CONFIDENCE, Fit, LeastSquares, search
from jointplay.estimate.unknowns import PLAYS, Answer, Estimate, Unknown
from jointplay.estimate.wiggle import Untold
from jointplay.estimate.wiggle_logs import (
    ServoSignals,
    Wiggle,
    change_of,
    told_of,
    unknown_of,
    wiggles,
)
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import Drive

T = TypeVar("T")
SAME = {"friction": 0.3, "": 0.1}
"""By how much friction, and all else but play, differs between dates: standard deviations, as parts
of their sizes. An assumption."""
_REMEMBERED = 64
"""Predictions of a date that are kept: differences move one date at a time."""
_DATE = re.compile(r"(?<!\d)(\d{4})[-_]?(\d\d)[-_]?(\d\d)(?!\d)")
_SEEN = 100.0
"""Times the series' length up to which it is told when a target is missed."""
TOOL = Unknown("", "error of the tool", "m", fine=False)


@dataclass(frozen=True)
class Target:
    """How far off play may let the tool be."""

    limit: float
    """[m]."""
    error: Callable[[Mapping[tuple[str, str], float]], float]
    """Of the tool at most [m], with plays by joint and name."""

    def time(self, at: Mapping[tuple[str, str], tuple[float, float]], most: float) -> float:
        """When the tool's error reaches the limit, up to `most`; plays are value and growth."""

        def left(time: float) -> float:
            plays = {k: max(value + time * rate, 0.0) for k, (value, rate) in at.items()}
            return self.error(plays) - self.limit

        if left(0.0) >= 0.0:
            return 0.0
        if left(most) < 0.0:
            return np.inf
        return float(brentq(left, 0.0, most, xtol=1e-3 * most, rtol=1e-3))


@dataclass(frozen=True, kw_only=True)
class Watch(Answer):
    """How the plays of a machine changed over a series of measurements; SI units.

    Estimates are of each play: its value in the newest, its change since the first, and its growth.
    """

    dates: tuple[str, ...]
    """Names of the measurements, oldest first."""
    times: np.ndarray
    """Of these, counted from the first [unit]."""
    unit: str
    """``day``, or ``recording`` where nothing says when they were taken."""
    courses: Mapping[str, Course]
    """By the label of a play."""
    alarms: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The answer in plain words."""
        if self.alarms:
            return f"Alarm: {'; '.join(self.alarms)}"
        grown = [one for one in self.estimates if one.label.endswith(" change")]
        of = counted(len(grown), "joint")
        sure = [one.joint for one in grown if one.interval[0] > 0.0]
        words = f"; it may have grown in {few(sure)}" if sure else ""
        if untold := [one.joint for one in grown if one.reason]:
            words += f"; of {few(untold)} no change can be told"
        return f"No alarm: the play of {of} over {len(self.dates)} measurements{words}"

    def describe(self) -> dict[str, Any]:
        """As plain data [SI]."""
        courses = {
            label: {"times": one.times.tolist(), "changes": [e.describe() for e in one.changes]}
            for label, one in self.courses.items()
        }
        return {
            "dates": list(self.dates), "times": self.times.tolist(), "unit": self.unit,
            "alarms": list(self.alarms), "unknowns": [one.describe() for one in self.estimates],
            "courses": courses, "notes": list(self.notes),
        }  # fmt: skip


def watch(
    dates: Sequence[tuple[str, Sequence[LeastSquares]]],
    limits: Mapping[str, float] | None = None,
    ahead: float = 0.0,
    target: Target | None = None,
) -> Watch:
    """How plays changed over a series of measurements of one machine.

    Without limits a change that is sure to be a growth is an alarm, with a false one in at most one
    of forty series. With limits an alarm is a play, or its change, that is surely above its own,
    and one that is expected to be there before long, if it goes on as on average.

    Args:
        dates: name and least squares of each measurement, oldest first; dates in the names count.
        limits: by label, ``"elbow gear play"`` or ``"elbow gear play change"`` [SI].
        ahead: how long before a limit or target is reached is alarmed [days, or recordings].
        target: of the tool; alarmed like a limit.

    Raises:
        JointplayError: fewer than two measurements; none of a play in two of them.
        MissingName: a limit of no play.
    """
    names = tuple(name for name, _ in dates)
    times, unit = _times(names)
    by_labels = [
        {", ".join(unknown.label for unknown in one.unknowns): one for one in problems}
        for _, problems in dates
    ]
    known, once = _series(times, by_labels)
    labels = [
        some[0][1].unknowns[i].label for some in known.values() for i in _plays(some[0][1].unknowns)
    ]
    _require_plays(names, labels, limits)
    sure, courses = 1.0 - (1.0 - CONFIDENCE) / len(labels), list[Course]()
    for some in known.values():
        when, problems = np.array([time for time, _ in some]), [one for _, one in some]
        free = search(*_stacked(problems, np.eye(len(some))[:, 1:], ["change"] * (len(some) - 1)))
        grown = _stacked(problems, (when - when[-1])[:, None], [f"per {unit}"])
        steady = search(*grown)
        last = search(problems[-1], np.array([_begin(one) for one in problems[-1].unknowns]))
        wider = free.half_widths(sure) / np.maximum(free.half_widths(), 1e-300)
        count = len(problems[0].unknowns)
        for j, i in enumerate(_plays(problems[0].unknowns)):
            at = [count + j * (len(some) - 1) + k for k in range(len(some) - 1)]
            changes = tuple(_told(free, k) for k in at)
            value, rate = replace(_told(last, i), reason=""), _told(steady, count + j)
            least = changes[-1].value - wider[at[-1]] * changes[-1].half_width
            courses.append(Course(value, when[1:], changes, least, rate))
    note = (
        f"assumed: between measurements compliances differ by {100.0 * SAME['']:g} %, friction by "
        f"{100.0 * SAME['friction']:g} % (standard deviations); growth: if it is steady"
    )
    return _answer(names, times, unit, courses, once, [note], limits, ahead, target)


def watch_wiggled(
    mechanism: Mechanism,
    drives: Mapping[str, Drive],
    dates: Sequence[tuple[str, ServoSignals]],
    limits: Mapping[str, float] | None = None,
    ahead: float = 0.0,
    target: Target | None = None,
) -> Watch:
    """As `watch`, by what servos logged while their joints were wiggled.

    A change, and so growth, is told by the first log of a joint and a later one together.

    Args:
        mechanism, drives: see `identify_wiggled`.
        dates: name and log of each date, oldest first; dates in the names count.
        limits, ahead, target: see `watch`.

    Raises:
        JointplayError: fewer than two logs; no joint was wiggled twice; see `wiggles`.
        MissingName: a limit of no play.
    """
    names = tuple(name for name, _ in dates)
    times, unit = _times(names)
    parts, said = zip(*(wiggles(mechanism, log, drives) for _, log in dates), strict=True)
    known, once = _series(times, parts)
    _require_plays(names, [unknown_of(joint).label for joint in known], limits)
    courses = [_course(joint, some, unit, 1.0 / len(known)) for joint, some in known.items()]
    note = (
        f"assumed: between logs friction differs by {100.0 * SAME['friction']:g} %, stiffness and "
        f"load by {100.0 * SAME['']:g} % (standard deviations); growth: if it is steady"
    )
    notes = [*dict.fromkeys(one for some in said for one in some), note]
    return _answer(names, times, unit, courses, once, notes, limits, ahead, target)


@dataclass(frozen=True)
class Course:
    """What a series tells of one play."""

    value: Estimate
    """In the newest measurement."""
    times: np.ndarray
    """Of the measurements of it after the first, as those of `Watch`."""
    changes: tuple[Estimate, ...]
    """Since the first, at each of them."""
    least: float
    """Which the last of them surely is at least, of all plays of the machine [SI]; below `low` of
    it, or above, where growth is told earlier than its size."""
    rate: Estimate
    """Growth by unit of time."""


def _course(joint: str, some: Sequence[tuple[float, Wiggle]], unit: str, part: float) -> Course:
    """Of one joint by its wiggles and their times, with a part of false alarms."""
    (begin, first), (end, last) = some[0], some[-1]
    value, least = told_of(last)[0], -np.inf
    changes, unknown = list[Estimate](), replace(value.unknown, least=-np.inf, nominal=0.0)
    grown = replace(unknown, name=f"{unknown.name} change")
    for _, one in some[1:]:
        try:
            low, high, least = change_of(first, one, part)
        except Untold as reason:
            changes.append(Estimate(grown, reason=str(reason)))
            continue
        changes.append(Estimate(grown, 0.5 * (low + high), 0.5 * (high - low)))
    long, newest = end - begin, changes[-1]
    rate = replace(
        newest, unknown=replace(unknown, name=f"{unknown.name} per {unit}"),
        value=newest.value / long, half_width=newest.half_width / long,
    )  # fmt: skip
    times, least = np.array([time for time, _ in some[1:]]), -np.inf if newest.reason else least
    return Course(value, times, tuple(changes), least, rate)


def _series(
    times: np.ndarray, dates: Sequence[Mapping[str, T]]
) -> tuple[dict[str, list[tuple[float, T]]], list[str]]:
    """Times and parts of what has some at several dates, by its name; names of all else."""
    pairs = list(zip(map(float, times), dates, strict=True))
    every = {
        name: [(time, some[name]) for time, some in pairs if name in some]
        for name in dict.fromkeys(name for some in dates for name in some)
    }
    known = {name: some for name, some in every.items() if len(some) > 1}
    return known, [name for name in every if name not in known]


def _require_plays(
    names: Sequence[str], labels: Sequence[str], limits: Mapping[str, float] | None
) -> None:
    if len(names) < 2:
        raise JointplayError(f"a change needs at least two measurements, got {len(names)}")
    if not labels:
        raise JointplayError(f"no play was measured twice in {', '.join(names)}")
    for label in limits or {}:
        if label.removesuffix(" change") not in labels:
            raise MissingName("play", label, [*labels, *(f"{one} change" for one in labels)])


def _answer(
    names: tuple[str, ...],
    times: np.ndarray,
    unit: str,
    courses: Sequence[Course],
    once: Sequence[str],
    said: Sequence[str],
    limits: Mapping[str, float] | None,
    ahead: float,
    target: Target | None,
) -> Watch:
    """What the courses of plays say; `once` were measured once, `said` is what was assumed."""
    notes = [f"note: {few(one.split(', '))}: measured once, no change is told" for one in once]
    alarms = list[str]()
    for one in courses:
        alarms += _alarms(one, limits, target is not None, ahead, unit, notes)
    if target is not None:
        alarms += _missed(courses, target, _SEEN * times[-1], ahead, unit, notes)
    return Watch(
        estimates=tuple(e for one in courses for e in (one.value, one.changes[-1], one.rate)),
        notes=(*notes, *said), dates=names, times=times, unit=unit,
        courses={one.value.label: one for one in courses}, alarms=tuple(alarms),
    )  # fmt: skip


def _plays(unknowns: Sequence[Unknown]) -> list[int]:
    return [i for i, one in enumerate(unknowns) if one.name in PLAYS]


def _told(fit: Fit, i: int) -> Estimate:
    half = float(fit.half_width[i])
    reason = "" if np.isfinite(half) else fit.why_not(i) or "nothing that was measured tells it"
    return Estimate(fit.least.unknowns[i], float(fit.theta[i]), half, reason)


def _alarms(
    course: Course,
    limits: Mapping[str, float] | None,
    tolerated: bool,
    ahead: float,
    unit: str,
    notes: list[str],
) -> list[str]:
    """Of one play; notes are added."""
    value, change, least, rate = course.value, course.changes[-1], course.least, course.rate
    if not limits:
        grown = change.span if change.low > 0.0 else f"at most {change.unknown.shown(change.high)}"
        words = f"{value.label} has grown by {grown}"
        return [words] if least > 0.0 and not tolerated else []
    made = list[str]()
    for one, low in ((value, value.low), (change, min(least, change.low))):
        limit = limits.get(one.label)
        if limit is None or np.isnan(one.value):
            continue
        times = tuple(
            _until(limit - x, growth)
            for x, growth in ((one.high, rate.high), (one.value, rate.value), (one.low, rate.low))
        )
        alarmed, words = _forecast(one, limit, low, times, ahead, unit)
        (made if alarmed else notes).append(words)
    return made


def _missed(
    courses: Sequence[Course],
    target: Target,
    most: float,
    ahead: float,
    unit: str,
    notes: list[str],
) -> list[str]:
    """Of the tool, by values and growth of all plays that are told; notes are added."""
    known = [(one.value, one.rate) for one in courses if np.isfinite(one.value.high)]
    if untold := [one.value.label for one in courses if not np.isfinite(one.value.high)]:
        notes.append(f"note: not in the error of the tool, as they cannot be told: {few(untold)}")
    keys = [(value.joint, value.unknown.name) for value, _ in known]
    ends, times = list[float](), list[float]()
    for side in ("high", "value", "low"):
        at = [(getattr(value, side), getattr(rate, side)) for value, rate in known]
        pairs = dict(zip(keys, at, strict=True))
        ends.append(target.error({k: max(value, 0.0) for k, (value, _) in pairs.items()}))
        times.append(target.time(pairs, most))
    tool = Estimate(TOOL, ends[1], ends=(ends[2], ends[0]))
    alarmed, words = _forecast(tool, target.limit, ends[2], tuple(times), ahead, unit)
    words = words if tool.low > target.limit else f"{words}; now {tool.span}"
    if not alarmed:
        notes.append(words)
    return [words] if alarmed else []


def _forecast(
    one: Estimate, limit: float, low: float, times: tuple[float, ...], ahead: float, unit: str
) -> tuple[bool, str]:
    """Whether a limit is alarmed, and what is said of it.

    Args:
        one: what is limited.
        limit: above which it is alarmed [SI].
        low: what it surely is at least [SI].
        times: in which it is reached: first, expected, last.
        ahead: how long before that it is alarmed.
        unit: of times.
    """
    first, expected, latest = times
    bound = one.unknown.shown(limit)
    if low > limit:
        return True, f"{one.label} is above {bound}: {one.span}"
    soonest = f"{first:.3g} {unit}s or later"
    if one.value > limit:
        words = f"{one.label} may be above {bound} already"
    elif np.isfinite(latest):
        words = f"{one.label} reaches {bound} in about {expected:.3g} {unit}s"
        words += f" ({first:.3g} to {latest:.3g} {unit}s)"
    elif np.isfinite(expected):
        words = f"{one.label} reaches {bound} in about {expected:.3g} {unit}s ({soonest})"
    elif np.isfinite(first):
        words = f"{one.label} may reach {bound} in {soonest}"
    else:
        words = f"{one.label} does not reach {bound}"
    words += ", if it goes on like this"
    return expected <= ahead and ahead > 0.0, words


def _until(left: float, rate: float) -> float:
    """Time until what is left has grown at a rate; infinite if it does not grow."""
    return 0.0 if left <= 0.0 else left / rate if rate > 0.0 else np.inf


def _times(names: Sequence[str]) -> tuple[np.ndarray, str]:
    """By dates in the names of files [days], or their order."""
    found = [_DATE.findall(Path(name).name) for name in names]
    try:
        days = np.array([date(*map(int, one[-1])).toordinal() for one in found if one], float)
    except ValueError:
        days = np.zeros(0)
    if len(days) < len(names) or (np.diff(days) <= 0.0).any():
        return np.arange(len(names), dtype=float), "recording"
    return days - days[0], "day"


def in_order(paths: Sequence[Path]) -> list[Path]:
    """By dates in their names if all have one, else as they are."""
    found = [_DATE.findall(path.name) for path in paths]
    if not all(found):
        return list(paths)
    return [path for _, path in sorted(zip(found, paths, strict=True), key=lambda one: one[0][-1])]


def _stacked(
    problems: Sequence[LeastSquares], moves: np.ndarray, names: Sequence[str]
) -> tuple[LeastSquares, np.ndarray]:
    """All dates as one problem, and where to start from.

    Its unknowns are those of a date, then of each play columns of `moves` (dates, columns), with
    their names, and of each other what it differs by at dates but the first.
    """
    first, n = problems[0], len(problems)
    low, high = first.limits
    unknowns, start = list(first.unknowns), [_begin(one) for one in first.unknowns]
    shift = np.zeros((n, len(unknowns), 0))

    def add(i: int, columns: np.ndarray, words: Sequence[str], spread: float) -> None:
        nonlocal shift
        own, size = np.zeros((n, len(first.unknowns), columns.shape[1])), np.abs(columns).max(0)
        own[:, i] = columns
        shift = np.concatenate([shift, own], axis=2)
        one = first.unknowns[i]
        for word, most in zip(words, size, strict=True):
            changed = replace(
                one, name=f"{one.name} {word}", nominal=0.0, scale=one.scale / most, sought=False,
                spread=spread, least=-np.inf, most=np.inf,
            )  # fmt: skip
            unknowns.append(changed)
            start.append(0.0)

    plays = _plays(first.unknowns)
    for i in plays:
        add(i, moves, names, np.inf)
    for i, one in enumerate(first.unknowns):
        if i not in plays and one.spread != 0.0:
            part = SAME["friction" if "friction" in one.name else ""]
            add(i, np.eye(n)[:, 1:], [f"at {k}" for k in range(1, n)], part * one.scale)
    p = len(first.unknowns)
    kept: list[dict[bytes, np.ndarray]] = [{} for _ in problems]

    def predicted(theta: np.ndarray) -> np.ndarray:
        values = np.clip(theta[:p] + shift @ theta[p:], low, high)
        parts = []
        for one, mine, value in zip(problems, kept, values, strict=True):
            key = value.tobytes()
            if key not in mine:
                if len(mine) >= _REMEMBERED:
                    del mine[next(iter(mine))]
                mine[key] = one.predict(value)
            parts.append(mine[key])
        return np.concatenate(parts)

    nuisance, spread = _nuisances(problems)
    kinds = [one.kinds for one in problems]
    softening = {
        joint: np.concatenate([one.softening[joint] for one in problems])
        for joint in first.softening
    }
    whole = replace(
        first,
        unknowns=tuple(unknowns),
        predict=predicted,
        measured=np.concatenate([one.measured for one in problems]),
        error=np.concatenate([one.error for one in problems]),
        nuisance=nuisance,
        spread=spread,
        groups=tuple(
            _numbered(some) for some in zip(*(one.groups for one in problems), strict=True)
        ),
        kinds=None if kinds[0] is None else np.concatenate(kinds),  # type: ignore[arg-type]
        jacobian=None,
        softening=softening,
    )
    return whole, np.array(start)


def _begin(one: Unknown) -> float:
    return one.nominal if np.isfinite(one.nominal) and one.nominal else 0.5 * one.scale


def _numbered(groups: Sequence[np.ndarray]) -> np.ndarray:
    """Numbers of groups that differ between dates, (m,)."""
    made, most = [], 0
    for one in groups:
        _, numbers = np.unique(one, return_inverse=True)
        made.append(np.ravel(numbers) + most)
        most += int(numbers.max(initial=-1)) + 1
    return np.concatenate(made)


def _nuisances(problems: Sequence[LeastSquares]) -> tuple[np.ndarray, np.ndarray]:
    """Effects (m, k) and spreads (k,): those of a date, what those of the machine, which have
    labels, differ by, and these themselves."""
    rows = np.repeat(np.arange(len(problems)), [len(one.measured) for one in problems])
    m, own, differ, known = len(rows), list[np.ndarray](), list[np.ndarray](), list[float]()
    spreads: list[float] = []
    labels = problems[0].labels
    shared = np.zeros((m, len(labels)))
    for k, one in enumerate(problems):
        if one.labels != labels:
            raise JointplayError(
                "the measurements differ in what they measure: watch likes of each"
            )
        if one.nuisance is None:
            continue
        count = one.nuisance.shape[1]
        wide = np.full(count, np.inf) if one.spread is None else one.spread
        for j in range(count):
            column = np.zeros(m)
            column[rows == k] = one.nuisance[:, j]
            if j < count - len(labels):
                own.append(column)
                spreads.append(float(wide[j]))
                continue
            shared[:, j - count + len(labels)] += column
            if k and np.isfinite(wide[j]):
                differ.append(column)
                known.append(SAME[""] * float(wide[j]))
        last = wide[count - len(labels) :]
    columns = np.column_stack([np.zeros((m, 0)), *own, *differ, shared])
    return columns, np.array([*spreads, *known, *(last if labels else ())])
