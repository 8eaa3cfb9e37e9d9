"""Changes of play between two measurements of the same machine.

Both are solved as one least squares, whose unknowns are the plays of the first measurement and how
those of the second differ. Compliances and friction belong to the machine: they are the same both
times, but for a little that is stated (`SAME`). Offsets, drift and whatever else belongs to a
measurement are separate. Errors of the model are the same both times and cancel, so a change is
told earlier than a value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.tables import counted, few
from jointplay.estimate.least_squares import Fit, LeastSquares, first_guess, search
from jointplay.estimate.unknowns import PLAYS, Answer, Estimate, Unknown

SAME = {"friction": 0.3, "": 0.1}
"""Standard deviations by which friction, and all else but play, differs between measurements, as
parts of their scales: judged, and stated with every answer."""


@dataclass(frozen=True, kw_only=True)
class Changes(Answer):
    """Changes of a machine's plays from one measurement to another; SI units.

    There are two estimates of each play: its value in the second, and its change since the first.
    """

    @property
    def sentence(self) -> str:
        """The answer in plain words."""
        changes = [estimate for estimate in self.estimates if estimate.label.endswith(" change")]
        known = [estimate for estimate in changes if estimate.known]
        sure = {
            "grown": [f"{change.joint} by {change.span}" for change in known if change.low > 0.0],
            "become less": [
                f"{change.joint} by {change.span}" for change in known if change.high < 0.0
            ],
        }
        parts = [f"has {how} in {few(changed)}" for how, changed in sure.items() if changed]
        unchanged = len(known) - sum(map(len, sure.values()))
        if unchanged:
            parts.append(f"may be as it was in {unchanged} of {counted(len(changes), 'joint')}")
        if untold := [change.joint for change in changes if not change.known]:
            parts.append(f"of {few(untold)} no change can be told")
        return f"Play {'; '.join(parts)}"


def changes(
    first: Sequence[LeastSquares], second: Sequence[LeastSquares], progress: bool = False
) -> Changes:
    """Estimate how plays changed from one measurement of a machine to another.

    Args:
        first, second: least squares of each measurement; those with the same unknowns are compared.
        progress: show a bar where a fit takes longer than 2 s.

    Raises:
        JointplayError: no play was measured both times; signals of other kinds.
    """
    before, after = (
        {", ".join(unknown.label for unknown in problem.unknowns): problem for problem in problems}
        for problems in (first, second)
    )
    both = [label for label in before if label in after]
    if not any(_plays(before[label].unknowns) for label in both):
        raise JointplayError("no play was measured both times")
    estimates = list[Estimate]()
    for label in both:
        pair = before[label], after[label]
        fit = search(*_stacked(*pair), progress)
        last = search(pair[1], progress=progress)
        for j, i in enumerate(_plays(pair[1].unknowns)):
            estimates += [_estimate(last, i), _estimate(fit, len(pair[0].unknowns) + j)]
    once = [label for label in {**before, **after} if label not in both]
    notes = [f"note: {label}: measured once, no change is told" for label in once]
    notes.append(
        f"assumed: between the measurements compliances differ by {100.0 * SAME['']:g} %, friction "
        f"by {100.0 * SAME['friction']:g} % (standard deviations)"
    )
    return Changes(estimates=tuple(estimates), notes=tuple(notes))


def _plays(unknowns: Sequence[Unknown]) -> list[int]:
    """Indices of the unknowns that are plays."""
    return [i for i, unknown in enumerate(unknowns) if unknown.name in PLAYS]


def _estimate(fit: Fit, i: int) -> Estimate:
    """Estimate of the i-th unknown, with any finite interval: a change may be none."""
    half = float(fit.half_width[i])
    reason = "" if np.isfinite(half) else fit.why_not(i) or "nothing that was measured tells it"
    return Estimate(fit.least.unknowns[i], float(fit.theta[i]), half, reason)


def _stacked(first: LeastSquares, second: LeastSquares) -> tuple[LeastSquares, np.ndarray]:
    """Both measurements as one problem, and where its search begins.

    Its unknowns are those of the first, then the difference of the second in each play, and in each
    other unknown that is not known exactly.
    """
    unknowns, (low, high) = first.unknowns, first.limits
    plays = _plays(unknowns)
    differing = [
        i for i, unknown in enumerate(unknowns) if i not in plays and unknown.spread != 0.0
    ]
    p, at = len(unknowns), [*plays, *differing]

    def moved(i: int) -> Unknown:
        unknown = unknowns[i]
        part = np.inf if i in plays else SAME["friction" if "friction" in unknown.name else ""]
        return replace(
            unknown, name=f"{unknown.name} change", nominal=0.0, sought=False,
            spread=part * unknown.scale, least=-np.inf, most=np.inf,
        )  # fmt: skip

    @lru_cache  # differences in the second leave the first's predictions
    def of_first(values: bytes) -> np.ndarray:
        return first.predict(np.frombuffer(values))

    def predicted(theta: np.ndarray) -> np.ndarray:
        later = theta[:p].copy()
        later[at] += theta[p:]
        later = np.clip(later, low, high)
        return np.concatenate([of_first(theta[:p].tobytes()), second.predict(later)])

    def one_after_other(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Groups of both measurements, numbered so that none of the second is one of the first."""
        return np.concatenate([a, b + 1 + a.max(initial=0) - b.min(initial=0)])

    nuisance, spread = _nuisances(first, second)
    kinds = first.kinds, second.kinds
    stacked = replace(
        first,
        unknowns=(*unknowns, *map(moved, at)),
        predict=predicted,
        measured=np.concatenate([first.measured, second.measured]),
        error=np.concatenate([first.error, second.error]),
        nuisance=nuisance,
        spread=spread,
        groups=tuple(map(one_after_other, first.groups, second.groups)),
        kinds=None if kinds[0] is None else np.concatenate(kinds),  # type: ignore[arg-type]
        jacobian=None,
        softening={
            joint: np.concatenate([softening, second.softening[joint]])
            for joint, softening in first.softening.items()
        },
    )
    return stacked, np.concatenate([first_guess(unknowns), np.zeros(len(at))])


def _nuisances(first: LeastSquares, second: LeastSquares) -> tuple[np.ndarray, np.ndarray]:
    """Effects (m, k) and prior deviations (k,) of both measurements' nuisances.

    First those of each measurement, which have no labels; then the differences in the second of
    those of the machine, which have labels and are not free; last these themselves.
    """
    if first.labels != second.labels:
        raise JointplayError("the measurements differ in what they measure: compare likes")
    m, n, count = len(first.measured), len(second.measured), len(first.labels)
    effects, wide = [], []
    for problem in (first, second):
        effect = (
            np.zeros((len(problem.measured), 0)) if problem.nuisance is None else problem.nuisance
        )
        effects.append(effect)
        wide.append(np.full(effect.shape[1], np.inf) if problem.spread is None else problem.spread)
    (a, b), (before, after) = effects, wide
    i, j = a.shape[1] - count, b.shape[1] - count
    differ = np.flatnonzero(np.isfinite(after[j:]))
    columns = np.zeros((m + n, i + j + len(differ) + count))
    columns[:m, :i], columns[m:, i : i + j] = a[:, :i], b[:, :j]
    columns[m:, i + j : i + j + len(differ)] = b[:, j + differ]
    columns[:, i + j + len(differ) :] = np.concatenate([a[:, i:], b[:, j:]])
    spread = [before[:i], after[:j], SAME[""] * after[j + differ], after[j:]]
    return columns, np.concatenate(spread)
