"""Unknowns and estimates: what a measurement of any kind is asked, and what it answers.

Which estimates count as known is decided in `known`.
"""

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

CONFIDENCE = 0.95
"""Probability that an interval (two-sided) or a bound (one-sided) holds the truth: as is usual."""
TWO_SIDED = 0.5 + CONFIDENCE / 2.0
"""Quantile at which an interval ends; a bound ends at `CONFIDENCE`."""
NORMAL_QUANTILE = float(norm.ppf(TWO_SIDED))
"""Half width of an interval in standard deviations, if these are exact."""
STEP_DEVIATION = float(uniform.std())
"""Standard deviation of the rounding to steps, as a part of a step: 1/sqrt(12)."""
ROUNDING = 1e-9
"""Part of a number below which differences count as rounding: sums over thousands of numbers of 16
digits, squared, keep nine."""
TINY = float(np.finfo(float).tiny)
"""Smallest normal number: keeps divisions by what may be zero finite."""
MODEL_ERROR = 0.02
"""Relative error of static models, loads and levers: judged."""
FRICTION_MODEL_ERROR = 0.1
"""Relative error of laws of friction and hysteresis, which are rougher: judged. With both larger by
half, intervals of 11 machines of benchmarks/truth/identify.py are wider by 16 % (median), and the
same values are told."""
EXPECTATION_FACTOR = 3.0
"""Factor by which the expected value of an unknown may be wrong: judged."""
MINOR = 0.1
"""Part of the largest below which something is minor, and left out of texts and figures: judged."""
FARTHEST_M = 10.0
"""Length beyond any robot's reach, which is at most half of it [m]."""
PLAYS = ("gear_play", "radial_clearance")
"""Names of unknowns that are a joint's play."""


@dataclass(frozen=True)
class Unknown:
    """A parameter that is estimated, with its prior and its bounds; SI units."""

    joint: str
    """The joint that it belongs to; empty for one of all joints."""
    name: str
    """``radial_clearance``, ``friction``, ``gear_play`` and so on."""
    unit: str = ""
    """SI; empty for a pure number."""
    nominal: float = 0.0
    """Expected value, the scenario's, and mean of the prior; nan if nothing is expected."""
    scale: float = 1.0
    """Size that matters; steps and thresholds are relative to it."""
    most: float = math.inf
    """Largest possible value."""
    sought: bool = True
    """Whether it is asked for, and not estimated only because others depend on it."""
    spread: float = math.inf
    """Standard deviation of the prior; infinite: nothing is known before, zero: the nominal value
    is exact."""
    least: float = 0.0
    """Smallest possible value."""
    fine: bool = True
    """Whether it is as small as a clearance, and shown in such units."""
    model_error: float = MODEL_ERROR
    """Part of the value by which the model itself is off, see benchmarks/truth/identify.py."""

    @property
    def label(self) -> str:
        """Name in tables: ``elbow radial clearance``."""
        return " ".join(filter(None, [self.joint, self.name.replace("_", " ")]))

    def shown(self, value: float) -> str:
        """Text of a value, in the unit of tables; empty for nan."""
        if math.isnan(value):
            return ""
        return rounded(value, self.unit, fine=self.fine)


@dataclass(frozen=True)
class Estimate:
    """What a measurement says of an unknown; SI units."""

    unknown: Unknown
    value: float = math.nan
    half_width: float = math.inf
    """Half width of the 95 % interval; infinite where nothing is known."""
    reason: str = ""
    """Why the measurement cannot tell; empty if it can."""
    advice: str = ""
    """Which measurement would tell; empty where none is needed or known."""
    note: str = ""
    """What the value rests on, or with which other unknown it acts together."""
    ends: tuple[float, float] | None = None
    """Ends of the 95 % interval; None: `half_width` to both sides of the value."""
    upper: float = math.inf
    """Upper bound, one-sided 95 %, where one is stated."""
    bounded: bool = False
    """Whether the value may be zero, so that only the upper bound is stated."""

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval, cut to the possible values."""
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
        """Whether it is the estimate of this joint's play."""
        return self.joint == joint and self.unknown.name in PLAYS

    @property
    def known(self) -> bool:
        """Whether the value is established, by the criteria of `jointplay.estimate.known`."""
        return not self.reason and not self.bounded

    @property
    def span(self) -> str:
        """Text of the interval, or of the only bound there is."""
        shown, (low, high) = self.unknown.shown, self.interval
        if self.bounded:
            return f"at most {shown(self.upper)}"
        return f"{shown(low)} to {shown(high)}" if high < math.inf else f"at least {shown(low)}"

    def cells(self) -> tuple[str, str]:
        """Texts of the value and of the interval, for tables."""
        if self.reason:
            return "-", "this measurement cannot tell"
        if self.bounded:
            return "-", f"none told; {self.span}"
        note = f" ({self.note})" if self.note else ""
        return self.unknown.shown(self.value), f"{self.span}{note}"

    def __str__(self) -> str:
        value, interval = self.cells()
        return f"{self.label}: " + ": ".join(filter(None, [value, interval, self.reason]))

    def describe(self) -> dict[str, Any]:
        """The estimate as plain data [SI]; without numbers where the measurement cannot tell."""
        unknown, numbers = self.unknown, {"expected": self.unknown.nominal}
        if not self.reason:
            low, high = self.interval
            numbers |= {"found": self.value, "low": low, "high": high, "upper": self.upper}
        row: dict[str, Any] = {"joint": unknown.joint, "quantity": unknown.name}
        row |= {"unit": unknown.unit, "reason": self.reason, "note": self.note}
        return row | {name: float(x) for name, x in numbers.items() if np.isfinite(x)}


@dataclass(frozen=True)
class Loop:
    """A reversal loop: n deviations of a joint from its motor, measured and fitted.

    Play shows as the step between its two branches.
    """

    joint: str
    x: np.ndarray
    """Abscissa: a push, a load or a position, shape (n,) [SI]."""
    x_name: str
    x_unit: str
    measured: np.ndarray
    """Measured deviations, shape (n,) [SI]; nan where there is the fit alone."""
    fitted: np.ndarray
    """Fitted deviations, shape (n,) [SI]; nan where the fit says nothing."""
    unit: str
    """Unit of the deviations, ``rad`` or ``m``."""
    branch: np.ndarray
    """Which way the joint went or was pushed, -1 or 1; 0: neither, shape (n,)."""

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
        """The loop of a joint that shows only in k other signals: partial residuals.

        All else stays as it was fitted; the residuals of the signals, projected on what the joint
        does to them, are added to its fitted deviation.

        Args:
            joint, over, fitted, unit, branch: see the class; `over` is x with its name and unit.
            effect: change of the signals by a deviation of one, in standard errors, shape (n, k).
            residual: measured less fitted, in standard errors, shape (n, k).
        """
        size = np.sum(effect**2, axis=1)
        use = size > MINOR**2 * size.max(initial=0.0)  # elsewhere it would be noise alone
        measured = fitted[use] + np.sum(effect * residual, axis=1)[use] / size[use]
        x, name, its_unit = over
        return cls(joint, x[use], name, its_unit, measured, fitted[use], unit, branch[use])


def listed(
    estimates: Sequence[Estimate], head: str = "", vague: str = "", expected: bool = False
) -> str:
    """Text of estimates: a table with a row for each, and below it why the others cannot be told.

    Args:
        estimates: the rows.
        head: title of a single column of labels, in place of columns of joints and quantities.
        vague: begin of a line that names what cannot be told, except plays, in place of its rows;
            empty: there is none.
        expected: whether there is a column of expected values.
    """
    hidden = [
        estimate for estimate in estimates
        if vague and estimate.reason and estimate.unknown.name not in PLAYS
    ]  # fmt: skip
    shown = [estimate for estimate in estimates if estimate not in hidden]
    heads = [head] if head else ["joint", "quantity"]
    rows = [[*heads, *(["expected"] if expected else []), "found", "95 % interval"]]
    for estimate in shown:
        names = [estimate.joint or "all", estimate.unknown.name.replace("_", " ")]
        names = [estimate.label] if head else names
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


_HEADS = "joint", "quantity", "unit", "expected", "found", "low", "high", "upper", "reason", "note"
"""Columns of `data`: keys of `Estimate.describe`."""


def data(estimates: Sequence[Estimate]) -> Table:
    """Table with a row for each estimate [SI]."""
    rows = [estimate.describe() for estimate in estimates]
    return Table.of([(head, "") for head in _HEADS], [[row.get(k) for k in _HEADS] for row in rows])


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Estimates of a measurement with their notes, as text, table and plain data."""

    estimates: tuple[Estimate, ...]
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([*self.notes, listed(self.estimates)])

    @property
    def data(self) -> Table:
        """Table with a row for each estimate [SI]."""
        return data(self.estimates)

    def describe(self) -> dict[str, Any]:
        """The answer as plain data [SI]."""
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
