"""What an identification found, as a table, CSV and plain data."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointplay.analysis.identify.parameters import Parameter
from jointplay.analysis.identify.reading import Measurement
from jointplay.analysis.identify.restitution import Restitution
from jointplay.analysis.identify.visits import Observed, Visits
from jointplay.errors import MissingName
from jointplay.mechanism.mechanism import Mechanism


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
    loose: np.ndarray
    """What friction may hold anywhere at stops, see `StaticModel.loose`."""
    misfit: float
    """RMS of what the model leaves, in standard errors."""
    reference: str
    notes: tuple[str, ...]
    measured: Measurement
    restitutions: tuple[Restitution, ...] = ()
    """Of the joints' impacts, where there is a signal that shows them."""

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
        lines += [str(one) for one in self.restitutions]
        for i, one in enumerate(self.unknowns):
            if one.sought and self.reasons[i]:
                lines.append(f"{one.label}: {self.reasons[i]}")
                if self.advice[i]:
                    lines.append(f"  {self.advice[i]}")
        lines += [f"{r.joint} restitution: {r.reason}" for r in self.restitutions if r.reason]
        if not self.unknowns:
            return "\n".join([*self.notes, *lines])
        used = np.isfinite(self.error)
        at = used.any(axis=1)
        lines.append(
            f"statistical, static model; {int(at.sum())} visits "
            f"({int((self.visits.stopped & at).sum())} stops) of "
            f"{len(np.unique(self.visits.cell[at]))} places, {int(used.sum())} means; "
            f"left over: {self.misfit:.2g} standard errors (RMS; 1 is what noise explains)"
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
        return {"unknowns": found, "misfit": misfit, "notes": list(self.notes)}
