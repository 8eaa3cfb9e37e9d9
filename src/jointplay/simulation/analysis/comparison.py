"""Two runs side by side: what was put in, and what came out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from jointplay.base.errors import JointplayError, require_a
from jointplay.base.schema import differences, short
from jointplay.base.tables import Column, Table
from jointplay.base.units import told
from jointplay.simulation.analysis.headline import figures, reference
from jointplay.simulation.analysis.tool_error import difference, error_statistics
from jointplay.simulation.analysis.twins import inputs, is_twin
from jointplay.simulation.analysis.vibration import rattle
from jointplay.simulation.result.certificate import HEADLINE, CertifiedFigure
from jointplay.simulation.result.result import Result

_TEXTS = ("mechanism.urdf_text",)
"""Inputs too long to be printed."""


@dataclass(frozen=True)
class Pair:
    """A figure of both runs."""

    name: str
    first: CertifiedFigure
    second: CertifiedFigure

    @property
    def ratio(self) -> float:
        """Second over first; NaN where the first is zero."""
        return self.second.value / self.first.value if self.first.value else math.nan

    @property
    def beyond_errors(self) -> bool | None:
        """Whether they differ by more than their numerical errors together; None: not known."""
        both = self.first.error + self.second.error
        if not math.isfinite(both):
            return None
        return abs(self.second.value - self.first.value) > both


@dataclass(frozen=True)
class Comparison:
    """Two runs side by side; see `compare`."""

    labels: tuple[str, str]
    inputs: tuple[tuple[str, object, object], ...]
    """Inputs that differ: where, and what stands there in each."""
    pairs: tuple[Pair, ...]
    apart: tuple[float, float] | None
    """Peak and RMS distance of the two tools at the same time [m]; None: of different frames."""

    @property
    def table(self) -> Table:
        first, second = self.labels
        words = {True: "yes", False: "no", None: "not known"}
        return Table(
            (
                Column("figure", [one.name for one in self.pairs]),
                Column(first, [_shown(one.first) for one in self.pairs]),
                Column(second, [_shown(one.second) for one in self.pairs]),
                Column("ratio", [one.ratio for one in self.pairs], digits=3),
                Column("beyond the errors", [words[one.beyond_errors] for one in self.pairs]),
            )
        )

    @property
    def inputs_table(self) -> Table:
        rows = [
            (place, "a", "another") if place in _TEXTS else (place, short(was), short(now))
            for place, was, now in self.inputs
        ]
        return Table.of([(head, "") for head in ("input", *self.labels)], rows)

    def __str__(self) -> str:
        inputs = str(self.inputs_table) if self.inputs else "none"
        return "\n".join([self.answer, "", "inputs that differ:", inputs, "", str(self.table)])

    @property
    def answer(self) -> str:
        first, second = self.labels
        wanted = [one for one in self.pairs if one.name == "peak tool error"] or [
            one for one in self.pairs if one.name.startswith("peak joint force")
        ]
        answers = []
        if wanted:
            (one, *_) = wanted
            words = f"{one.name} {_shown(one.second)} in {second}, {_shown(one.first)} in {first}"
            if math.isfinite(one.ratio):
                words += f": {one.ratio:.3g} times as much"
            if one.beyond_errors is False:
                words += ", no more than the numerical errors"
            answers.append(words)
        if self.apart is not None:
            peak, rms = (told(one, "m") for one in self.apart)
            answers.append(f"the two tools are up to {peak} apart, RMS {rms}")
        return "; ".join(answers) or "no figure and no tool that both have"


def _shown(figure: CertifiedFigure) -> str:
    return str(figure) if math.isfinite(figure.error) else told(figure.value, figure.unit)


def compare(results: Mapping[str, Result], progress: bool = False) -> Comparison:
    """What differs between two runs: inputs, headline figures with errors, rattle, tool paths.

    The errors are those that each run had when it was saved; a run without them gets its figures
    here, against the ideal mechanism, which is one of the two or simulated.

    Args:
        results: the two, by label.
        progress: show bars on standard error.

    Raises:
        JointplayError: not two runs, or one without records.
    """
    require_a("results", results, "Mapping")
    if len(results) != 2:
        raise JointplayError(f"compare two runs, got {len(results)}: {', '.join(results)}")
    for label, result in results.items():
        if len(result.time) < 2:
            raise JointplayError(f"{label} has {len(result.time)} record; nothing can be compared")
    (first, a), (second, b) = results.items()
    found = [
        _figures(one, other if is_twin(one, other) else reference(one, progress))
        for one, other in ((a, b), (b, a))
    ]
    pairs = tuple(
        Pair(name, found[0][name], found[1][name]) for name in found[0] if name in found[1]
    )
    apart = None
    if a.simulation.mechanism.tool == b.simulation.mechanism.tool:
        off = error_statistics(difference(b, a), 0.0)
        apart = float(off.peak[-1]), float(off.rms[-1])
    return Comparison((first, second), tuple(differences(inputs(a), inputs(b))), pairs, apart)


def _figures(result: Result, ideal: Result | None) -> dict[str, CertifiedFigure]:
    """Headline figures by name, then those of rattle, whose errors nobody knows."""
    if result.certificate is not None:
        found = {one.name: one for one in result.certificate.headline}
    else:
        found = {
            name: CertifiedFigure(name, value, math.inf, unit)
            for name, (value, unit) in figures(result, ideal).items()
            if name.startswith(HEADLINE)
        }
    with suppress(JointplayError):  # nothing that rattles, or too few records
        noise = rattle(result, ideal)
        more = {
            "impacts a second": (noise.rate, "1/s"),
            "power lost in impacts": (noise.power, "W"),
            **{f"RMS acceleration, {one.range}": (one.rms, "m/s^2") for one in noise.bands},
        }
        for name, (value, unit) in more.items():
            found[name] = CertifiedFigure(name, value, math.inf, unit)
    return found
