"""An unknown of a measurement, and what the measurement says of it: the same of every kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm, uniform

from jointplay.base.errors import MissingName
from jointplay.base.tables import Table
from jointplay.base.units import rounded

CANNOT_TELL = "this measurement cannot tell"
CONFIDENCE = 0.95
"""Of all intervals, two-sided, and of all bounds, one-sided."""
TWO_SIDED = 0.5 + CONFIDENCE / 2.0
"""Quantile at which an interval ends; a bound ends at `CONFIDENCE`."""
NORMAL = float(norm.ppf(TWO_SIDED))
"""Half of an interval in standard deviations."""
UNIFORM = float(uniform.std())
"""Standard deviation of what steps leave open, by their width."""
ROUNDING = 1e-9
"""Part of a number below which differences count as rounding: sums over thousands of numbers of 16
digits, squared, keep nine."""
TINY = float(np.finfo(float).tiny)
"""Keeps divisions by what may be zero finite."""
MODEL_ERROR = 0.02
"""Part by which static models, loads and levers are off: judged."""
ROUGH = 0.1
"""The same of friction and hysteresis, whose laws are rougher: judged."""
MISJUDGED = 3.0
"""Factor by which what is expected of a machine may be wrong: judged."""
MINOR = 0.1
"""Part of the largest below which words and figures leave something out."""
FARTHEST_M = 10.0
"""Beyond any robot's reach: the largest reach half as far [m]."""

# When a value is known: of a recording, whose machine is expected to have it, if its interval is
# narrow; of poses and readings, which may show that there is none, if its interval excludes zero.

LARGEST_SHARE, SMALL = 0.5, 0.25
"""`identify`: half of the interval is at most `LARGEST_SHARE` of the value; values below `SMALL` of
the scale count as this much. Judged: a choice of what is worth reporting, intervals stay. With 0.5,
5 more values are told of 153 machines of benchmarks/truth/identify.py: the interval of one misses
the truth, another is twice the truth."""


def narrow(unknown: Unknown, value: float, half_width: float) -> bool:
    """Whether a value is known by the rule of recordings."""
    return bool(half_width <= unknown.widest(value))


def excludes_zero(low: float, predicts: bool = True) -> bool:
    """Whether a play is known by the rule of poses and readings, by the low end of its interval; of
    poses its cause must predict those held back better than chance, too (`selection.improves`)."""
    return bool(predicts and low > 0.0)


PLAYS = ("gear_play", "radial_clearance")
"""Unknowns that are a joint's play."""


@dataclass(frozen=True)
class Unknown:
    """One number that is sought, or that others depend on; SI units."""

    joint: str
    """Whose it is; empty for one of all joints."""
    name: str
    """``radial_clearance``, ``friction``, ``gear_play`` and so on."""
    unit: str = ""
    """SI; empty for a pure number."""
    nominal: float = 0.0
    """Of the scenario: what it is expected to be; nan if nothing is."""
    scale: float = 1.0
    """Size that matters; steps and thresholds are relative to it."""
    most: float = math.inf
    """Largest possible value."""
    sought: bool = True
    """Not if it is estimated only because others depend on it."""
    spread: float = math.inf
    """Standard deviation with which the nominal value was known before; infinite: not at all, zero:
    exactly."""
    least: float = 0.0
    """Smallest possible value."""
    fine: bool = True
    """Whether it is as small as a clearance, and shown in such units."""
    model_error: float = MODEL_ERROR
    """Part of its value by which the model itself is off, see benchmarks/truth/identify.py."""

    @property
    def label(self) -> str:
        """As tables have it: ``elbow radial clearance``."""
        return " ".join(filter(None, [self.joint, self.name.replace("_", " ")]))

    def shown(self, value: float) -> str:
        """A value in the unit of tables."""
        if math.isnan(value):
            return ""
        return rounded(value, self.unit, fine=self.fine)

    def widest(self, value: float) -> float:
        """Largest half width of an interval about `value` with which it is known [SI]."""
        return LARGEST_SHARE * max(abs(value), SMALL * self.scale)


@dataclass(frozen=True)
class Estimate:
    """What a measurement says of an unknown; SI units."""

    unknown: Unknown
    value: float = math.nan
    half_width: float = math.inf
    """Of the 95 % interval; infinite where nothing is known."""
    reason: str = ""
    """Why the measurement cannot tell; empty if it can."""
    advice: str = ""
    """Which measurement would tell, empty where none is needed or known."""
    note: str = ""
    """What it rests on, or acts together with, in words."""
    ends: tuple[float, float] | None = None
    """Of the 95 % interval, where it is not about the value."""
    upper: float = math.inf
    """Upper bound, one-sided 95 %, where one is stated."""
    bounded: bool = False
    """Whether it may be zero, and the upper bound is all that is known."""

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval within what can be."""
        middle = 0.0 if math.isnan(self.value) else self.value
        low, high = self.ends or (middle - self.half_width, middle + self.half_width)
        return max(low, self.unknown.least), min(high, self.unknown.most)

    @property
    def low(self) -> float:
        return self.interval[0]

    @property
    def high(self) -> float:
        return self.interval[1]

    @property
    def label(self) -> str:
        return self.unknown.label

    @property
    def joint(self) -> str:
        return self.unknown.joint

    def plays(self, joint: str) -> bool:
        """Whether it is of a joint's play."""
        return self.joint == joint and self.unknown.name in PLAYS

    @property
    def deviation(self) -> float:
        """Standard deviation by the interval."""
        return self.half_width / NORMAL

    @property
    def known(self) -> bool:
        """Whether the value is, within its interval; see `narrow` and `excludes_zero`."""
        return not self.reason and not self.bounded

    @property
    def span(self) -> str:
        """The interval, or the only bound there is, in words."""
        shown, (low, high) = self.unknown.shown, self.interval
        if self.bounded:
            return f"at most {shown(self.upper)}"
        return f"{shown(low)} to {shown(high)}" if high < math.inf else f"at least {shown(low)}"

    def cells(self) -> tuple[str, str]:
        """Value and interval as tables have them."""
        if self.reason:
            return "-", CANNOT_TELL
        if self.bounded:
            return "-", f"none told; {self.span}"
        note = f" ({self.note})" if self.note else ""
        return self.unknown.shown(self.value), f"{self.span}{note}"

    def __str__(self) -> str:
        value, interval = self.cells()
        return f"{self.label}: " + ": ".join(filter(None, [value, interval, self.reason]))

    def describe(self) -> dict[str, Any]:
        """As plain data [SI]; without numbers where the measurement cannot tell."""
        unknown, numbers = self.unknown, {"expected": self.unknown.nominal}
        if not self.reason:
            numbers |= {"found": self.value, "low": self.low, "high": self.high}
            numbers |= {"upper": self.upper}
        row: dict[str, Any] = {"joint": unknown.joint, "quantity": unknown.name}
        row |= {"unit": unknown.unit, "reason": self.reason, "note": self.note}
        return row | {name: float(x) for name, x in numbers.items() if np.isfinite(x)}


@dataclass(frozen=True)
class Loop:
    """How far a joint was turned from where its motor had it, n times, and what was fitted: a
    reversal loop, which shows play as the step between its branches."""

    joint: str
    x: np.ndarray
    """What it is drawn over, shape (n,) [SI]."""
    x_name: str
    x_unit: str
    measured: np.ndarray
    """Shape (n,) [SI]; nan where there is the fit alone."""
    fitted: np.ndarray
    """Shape (n,) [SI]; nan where the fit says nothing."""
    unit: str
    """``rad`` or ``m``."""
    branch: np.ndarray
    """-1 or 1: which way it went or was pushed; 0: neither, shape (n,)."""

    @classmethod
    def beside(
        cls,
        joint: str,
        over: tuple[np.ndarray, str, str],
        fitted: np.ndarray,
        unit: str,
        branch: np.ndarray,
        effect: np.ndarray,
        residual: np.ndarray,
    ) -> Loop:
        """With all else as it was fitted: what is left of k signals is added to the joint's own.

        Args:
            joint, over, fitted, unit, branch: see the class; `over` is x with its name and unit.
            effect: of the joint's motion by one on the signals, in standard errors, shape (n, k).
            residual: measured less fitted, in standard errors, shape (n, k).
        """
        size = np.sum(effect**2, axis=1)
        use = size > MINOR**2 * size.max(initial=0.0)
        measured = fitted[use] + np.sum(effect * residual, axis=1)[use] / size[use]
        x, name, its_unit = over
        return cls(joint, x[use], name, its_unit, measured, fitted[use], unit, branch[use])


def listed(
    estimates: Sequence[Estimate], head: str = "", vague: str = "", expected: bool = False
) -> str:
    """Estimates as a table, a row for each joint and quantity, and why what cannot be told cannot.

    With a head, which those of no joint stand under, labels are not taken apart; with `vague`,
    unknowns but plays that have no interval are named in a line that begins so; with `expected`
    there is a column of what was.
    """
    hidden = [
        estimate
        for estimate in estimates
        if vague and estimate.reason and not estimate.plays(estimate.joint)
    ]
    shown = [estimate for estimate in estimates if estimate not in hidden]
    heads = [head] if head else ["joint", "quantity"]
    rows = [[*heads, *(["expected"] if expected else []), "found", "95 % interval"]]
    for estimate in shown:
        names = (
            [estimate.label]
            if head
            else [estimate.joint or "all", estimate.unknown.name.replace("_", " ")]
        )
        before = [estimate.unknown.shown(estimate.unknown.nominal)] if expected else []
        rows.append([*names, *before, *estimate.cells()])
    lines = [str(Table.of_texts(rows))] if shown else []
    if hidden:
        lines.append(f"{vague}: {', '.join(estimate.label for estimate in hidden)}")
    for estimate in shown:
        if estimate.reason:
            lines.append(f"{estimate.label}: {estimate.reason}")
            lines += [f"  {estimate.advice}"] if estimate.advice else []
    return "\n".join(lines)


_HEADS = (
    *("joint", "quantity", "unit", "expected", "found", "low", "high", "upper", "reason", "note"),
)


def data(estimates: Sequence[Estimate]) -> Table:
    """A row for each estimate [SI]."""
    rows = [estimate.describe() for estimate in estimates]
    return Table.of([(head, "") for head in _HEADS], [[row.get(k) for k in _HEADS] for row in rows])


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What measurements say, as text and as a table."""

    estimates: tuple[Estimate, ...]
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([*self.notes, listed(self.estimates)])

    @property
    def data(self) -> Table:
        """A row for each estimate [SI]."""
        return data(self.estimates)

    def describe(self) -> dict[str, Any]:
        """As plain data [SI]."""
        rows = [estimate.describe() for estimate in self.estimates]
        return {"unknowns": rows, "notes": list(self.notes)}

    def __getitem__(self, label: str) -> Estimate:
        return by_label(self.estimates, label)


def by_label(estimates: Sequence[Estimate], label: str) -> Estimate:
    """The estimate of an unknown, by its label such as ``"elbow radial clearance"``.

    Raises:
        MissingName: there is none.
    """
    for estimate in estimates:
        if estimate.label == label:
            return estimate
    raise MissingName("unknown", label, [estimate.label for estimate in estimates])
