"""The six claims of the paper (Section 5), tested on ensembles of perturbed runs.

Impacts magnify small differences, and nobody knows where a journal rests at the start, so no claim
is decided by one run. `measure` reduces a run to a few numbers; `judge` compares the ensembles of
the two clearances.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from jointplay.physics.geometry import Mode
from jointplay.simulation.result.certificate import plus_minus
from jointplay.simulation.result.result import AXES, Result

CONFIDENCE = 0.95
"""Level of the confidence interval (Welch) that must exclude zero for a difference to count."""
PEAK_LEVEL = 0.2
"""Force of a peak, at least, relative to the run's largest."""
ISOLATED = 0.05
"""Fraction of the time that peaks fill below which they are isolated."""
APART_M = 1e-9
"""Distance below which points of a path count as one [m]: a search among the thousands that a tool
at rest leaves takes four times as long."""

Measures = dict[str, float]


def _path(points: np.ndarray) -> np.ndarray:
    """Points (n, 2) along a path [m], those where it stands still left out."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.asarray(points[np.unique(np.floor(length / APART_M), return_index=True)[1]])


def can_be_measured(result: Result) -> bool:
    """Whether `measure` can be applied: settled, one joint with play, and mostly judged."""
    if "tool_error" not in result.dataset or len(result.joints) != 1:
        return False
    settled = result.judge_from > 0.0 or result.audit.start == "rest"
    longer = float(result.time[-1]) > 2.0 * result.judge_from
    whole = bool(np.isfinite(result["tool_error"].values[-1]))
    return settled and longer and whole


def measure(result: Result) -> Measures:
    """Reduce a run to the measures that the claims are about.

    Args:
        result: a run with one clearance joint, judged from `Result.judge_from` on.

    Returns:
        deviation_mm, path_mm, speed_mm_s: RMS over time of the tool's fluctuation about its mean
        deviation from the ideal robot, of its distance from the ideal path in the XOY plane, of
        its velocity deviation. free, continuous, penetration: fractions of time in each mode.
        fx, fy, fz: largest contact force along each world axis [N]. busy: fraction of time in
        which the force exceeds `PEAK_LEVEL` of its largest. peak_time: time of the largest force
        [s]. rate: impacts per second. impulse: mean normal impulse of an impact [N s]. crossings:
        sign changes per second of the tool's velocity deviation. swing_mm: mean excursion of the
        tool's deviation between two of its turning points.
    """
    from scipy.spatial import cKDTree  # takes long to import

    judged = slice(int(np.searchsorted(result.time, result.judge_from)), len(result.time))
    time = result.time[judged]
    position = result["tool_position"].values[judged]
    away = position - result["ideal_tool_position"].values[judged]
    speed = result["tool_velocity"].values[judged] - result["ideal_tool_velocity"].values[judged]
    distance, _ = cKDTree(_path(result["ideal_tool_position"].values[:, :2])).query(position[:, :2])
    mode = result["mode"].values[judged, 0]
    force = result["joint_force_peak"].values[judged, 0]
    magnitude = np.linalg.norm(force, axis=1)
    largest = float(magnitude.max())
    span = float(time[-1] - time[0])
    turns = [np.flatnonzero(np.diff(np.signbit(speed[:, axis]))) for axis in range(3)]
    swings = np.concatenate(
        [np.abs(np.diff(away[turn, axis])) for axis, turn in enumerate(turns)] + [np.zeros(0)]
    )
    audit = result.audit
    begun, impulse = audit.judged_impacts, audit.judged_impulse
    return {
        "deviation_mm": 1e3 * _rms(away - away.mean(axis=0)),
        "path_mm": 1e3 * _rms(distance[:, None]),
        "speed_mm_s": 1e3 * _rms(speed),
        "free": float(np.mean(mode == Mode.FREE_FLIGHT)),
        "continuous": float(np.mean(mode == Mode.CONTINUOUS_CONTACT)),
        "penetration": float(np.mean(mode == Mode.PSEUDO_PENETRATION)),
        **{f"f{axis}": float(np.abs(force[:, k]).max()) for k, axis in enumerate(AXES)},
        "busy": float(np.mean(magnitude > PEAK_LEVEL * largest)),
        "peak_time": float(time[magnitude.argmax()]),
        "rate": begun / (float(result.time[-1]) - result.judge_from),
        "impulse": impulse / begun if begun else 0.0,
        "crossings": sum(map(len, turns)) / 3 / span,
        "swing_mm": 1e3 * float(swings.mean()) if swings.size else 0.0,
    }


def _rms(vectors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


@dataclass(frozen=True)
class Verdict:
    """The verdict on one claim under one condition."""

    claim: int
    subject: str
    condition: str
    statement: str
    holds: str
    """yes, no, or undecided."""
    numbers: str

    def row(self) -> tuple[str, ...]:
        return str(self.claim), self.statement, self.condition, self.holds, self.numbers


CLAIM_COLUMNS = ("claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm")
"""Headings of the table of verdicts, whose rows are `Verdict.row`."""

Ensemble = Sequence[Measures]
Check = Callable[[Ensemble, Ensemble], tuple[str, str]]
"""Compares the ensembles of small and large clearance: the verdict, and the numbers in words."""


def _values(ensemble: Ensemble, key: str) -> np.ndarray:
    return np.array([run[key] for run in ensemble])


def _spread(values: np.ndarray) -> str:
    return plus_minus(float(values.mean()), float(values.std(ddof=1)))


def _greater(
    small: Ensemble, large: Ensemble, key: str, unit: str, name: str = "RMS"
) -> tuple[str, str]:
    """Whether `key` is greater at the large clearance, by Welch's interval of the difference."""
    a, b = _values(small, key), _values(large, key)
    text = f"{name} {_spread(a)} → {_spread(b)} {unit}"
    squares = np.array([a.var(ddof=1) / a.size, b.var(ddof=1) / b.size])
    total = squares.sum()
    margin = 0.0
    if total > 0.0:
        from scipy.special import stdtrit  # takes long to import

        # Degrees of freedom by Welch and Satterthwaite.
        freedom = total**2 / (squares**2 / (np.array([a.size, b.size]) - 1)).sum()
        margin = float(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE) * np.sqrt(total))
    difference = float(b.mean() - a.mean())
    if difference > margin:
        return "yes", text
    return ("no" if difference < -margin else "undecided"), text


def _all(parts: Sequence[tuple[str, str]]) -> tuple[str, str]:
    """The verdict on a claim of several parts, each of which must hold."""
    verdicts = [verdict for verdict, _ in parts]
    verdict = "no" if "no" in verdicts else "undecided" if "undecided" in verdicts else "yes"
    return verdict, "; ".join(text for _, text in parts)


def _modes(small: Ensemble, large: Ensemble) -> tuple[str, str]:
    keys = ("free", "continuous", "penetration")
    parts = []
    visited = True
    for ensemble in (small, large):
        shares = [_values(ensemble, key) for key in keys]
        visited = visited and all(bool((share > 0.0).all()) for share in shares)
        parts.append(" / ".join(f"{100 * share.mean():.1f}" for share in shares))
    return ("yes" if visited else "no"), (
        f"free / continuous / penetration, % of time: {' → '.join(parts)}"
    )


def _peaks(small: Ensemble, large: Ensemble) -> tuple[str, str]:
    parts = [_greater(small, large, f"f{axis}", "N", f"max |F{axis}|") for axis in AXES]
    busy = [_values(ensemble, "busy").mean() for ensemble in (small, large)]
    text = f"above {100 * PEAK_LEVEL:.0f} % of the peak for "
    text += f"{100 * busy[0]:.3g} → {100 * busy[1]:.3g} % of the time"
    return _all([*parts, ("yes" if max(busy) < ISOLATED else "no", text)])


def _frequency(small: Ensemble, large: Ensemble) -> tuple[str, str]:
    rarer, often = _greater(large, small, "crossings", "1/s", "")
    rate, impulse = (
        [_values(ensemble, key).mean() for ensemble in (small, large)]
        for key in ("rate", "impulse")
    )
    reverse = " → ".join(reversed(often.strip().removesuffix(" 1/s").split(" → ")))
    struck = f"(for the joint: {rate[0]:.3g} → {rate[1]:.3g} impacts/s of "
    struck += f"{impulse[0]:.3g} → {impulse[1]:.3g} N s)"
    return _all(
        [
            (rarer, f"turning points of the tool's deviation {reverse} 1/s"),
            _greater(small, large, "swing_mm", "mm", "mean excursion between them"),
            ("yes", struck),
        ]
    )


CLAIMS: Mapping[int, tuple[str, str, Check]] = {
    1: (
        "displacement",
        "displacement fluctuates more at the larger clearance",
        partial(_greater, key="deviation_mm", unit="mm"),
    ),
    2: (
        "velocity",
        "velocity fluctuates more at the larger clearance",
        partial(_greater, key="speed_mm_s", unit="mm/s"),
    ),
    3: (
        "XOY path",
        "the XOY path deviates more at the larger clearance",
        partial(_greater, key="path_mm", unit="mm"),
    ),
    4: ("three modes", "the journal passes through all three modes in both cases", _modes),
    5: (
        "force peaks",
        "force peaks are isolated in time, and larger at the larger clearance",
        _peaks,
    ),
    6: ("frequency", "smaller clearance: more frequent, smaller fluctuation", _frequency),
}


def judge(small: Ensemble, large: Ensemble, condition: str) -> list[Verdict]:
    """Decide all claims under one condition, which is named for the table.

    `small` and `large` are the measures of each run at the smaller and the larger clearance, at
    least two runs each.
    """
    return [
        Verdict(number, subject, condition, statement, *check(small, large))
        for number, (subject, statement, check) in CLAIMS.items()
    ]
