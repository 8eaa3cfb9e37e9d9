"""Comparison of two runs: the inputs that differ, and their figures side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from jointplay.base.errors import JointplayError, require_a
from jointplay.base.schema import differences, known_keywords, short
from jointplay.base.tables import Column, Table
from jointplay.base.units import rounded
from jointplay.simulation.analysis.headline import headline_of
from jointplay.simulation.analysis.parts import AGAINST, counted_causes
from jointplay.simulation.analysis.tool_error import (
    compare_tools,
    difference,
    error_statistics,
    has_tool_error,
    ideal_tool,
)
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
        errors = self.first.error + self.second.error
        if not math.isfinite(errors):
            return None
        return abs(self.second.value - self.first.value) > errors


@dataclass(frozen=True)
class Comparison:
    """Two runs side by side; see `compare`."""

    labels: tuple[str, str]
    inputs: tuple[tuple[str, object, object], ...]
    """Inputs that differ: key, and value in each."""
    pairs: tuple[Pair, ...]
    apart: tuple[float, float] | None
    """Peak and RMS distance of the two tools at the same time [m]; None for different frames."""
    causes: tuple[str, ...] = ()
    """Causes in the tool error of each, as ``play and elasticity``; empty where it is unknown."""

    @property
    def table(self) -> Table:
        first, second = self.labels
        answers = {True: "yes", False: "no", None: "not known"}
        return Table(
            (
                Column("figure", [pair.name for pair in self.pairs]),
                Column(first, [_shown(pair.first) for pair in self.pairs]),
                Column(second, [_shown(pair.second) for pair in self.pairs]),
                Column("ratio", [pair.ratio for pair in self.pairs], digits=3),
                Column("beyond the errors", [answers[pair.beyond_errors] for pair in self.pairs]),
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
        heading = [f"tool errors are {self._by}, {AGAINST}:"] if self.causes else []
        lines = [self.answer, "", "inputs that differ:", inputs, "", *heading, str(self.table)]
        return "\n".join(lines)

    @property
    def _by(self) -> str:
        """The causes of the tool errors, in words."""
        if len(set(self.causes)) == 1:
            return f"by {self.causes[0]}"
        named = zip(self.causes, self.labels, strict=True)
        return " and ".join(f"by {cause} in {label}" for cause, label in named)

    @property
    def answer(self) -> str:
        """The main figure of both, and the distance of their tools, in a line."""
        first, second = self.labels
        pairs = {pair.name: pair for pair in self.pairs}
        forces = (name for name in pairs if name.startswith("peak joint force"))
        main = "peak tool error" if "peak tool error" in pairs else next(forces, None)
        answers = []
        if main is not None:
            pair = pairs[main]
            by = f" {self._by}:" if self.causes else ""
            sentence = f"{main}{by} {_shown(pair.second)} in {second}, "
            sentence += f"{_shown(pair.first)} in {first}"
            if math.isfinite(pair.ratio):
                sentence += f": {pair.ratio:.3g} times as much"
            if pair.beyond_errors is False:
                sentence += ", no more than the numerical errors"
            answers.append(sentence)
        if self.apart is not None:
            peak, rms = (rounded(distance, "m") for distance in self.apart)
            answers.append(f"the two tools are up to {peak} apart, RMS {rms}")
        return "; ".join(answers) or "no figure and no tool that both have"


def _shown(figure: CertifiedFigure) -> str:
    return str(figure) if math.isfinite(figure.error) else rounded(figure.value, figure.unit)


@known_keywords
def compare(results: Mapping[str, Result], progress: bool = False) -> Comparison:
    """Compare two runs: their inputs, headline figures with errors, rattle, and tool paths.

    Figures and errors are those that each run had when it was saved; those of a run without are
    computed here, without errors, against the ideal mechanism, which is the other run or simulated.

    Args:
        results: the two results, by label.
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
    for run, partner in ((a, b), (b, a)):
        if "tool_error" not in run.dataset and is_twin(run, partner):
            compare_tools(run, partner)
        has_tool_error(run, progress)
    tables = [_figures(run) for run in (a, b)]
    pairs = tuple(
        Pair(name, tables[0][name], tables[1][name]) for name in tables[0] if name in tables[1]
    )
    apart = None
    if a.simulation.mechanism.tool == b.simulation.mechanism.tool:
        off = error_statistics(difference(b, a), 0.0)
        apart = float(off.peak[-1]), float(off.rms[-1])
    causes: tuple[str, ...] = ()
    if any("tool error" in pair.name for pair in pairs):
        causes = tuple(map(counted_causes, (a, b)))
    inputs_apart = tuple(differences(inputs(a), inputs(b)))
    return Comparison((first, second), inputs_apart, pairs, apart, causes)


def _figures(result: Result) -> dict[str, CertifiedFigure]:
    """Headline figures by name, then those of rattle, whose errors are unknown."""
    if result.certificate is not None:
        certified = {figure.name: figure for figure in result.certificate.headline}
    else:
        certified = {
            name: CertifiedFigure(name, figure.value, math.inf, figure.unit)
            for name, figure in headline_of(result, ideal_tool(result), claims=False).items()
            if name.startswith(HEADLINE)
        }
    with suppress(JointplayError):  # nothing that rattles, or too few records
        noise = rattle(result)
        more = {
            "impacts a second": (noise.rate, "1/s"),
            "power lost in impacts": (noise.power, "W"),
            **{f"RMS acceleration, {band.range}": (band.rms, "m/s^2") for band in noise.bands},
        }
        for name, (value, unit) in more.items():
            certified[name] = CertifiedFigure(name, value, math.inf, unit)
    return certified
