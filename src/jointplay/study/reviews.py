"""Robustness of a run, as a reviewer asks for it: other steps, other contact laws, other starts.

`convergence` runs a simulation with coarser and finer steps, `laws` with other normal-force laws,
`spread` with perturbed starts. Each has a table here, and a chart in `show.plots.reviews`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, require_known, require_whole
from jointplay.base.tables import Column, Table
from jointplay.base.units import displayed, rounded
from jointplay.physics.contact import NORMAL_LAWS
from jointplay.simulation.analysis.headline import headline_of
from jointplay.simulation.analysis.tool_error import ideal_tool
from jointplay.simulation.result.certificate import COUNTS, HEADLINE
from jointplay.simulation.result.result import Result
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.certification import certify
from jointplay.study.ensemble import ensemble

FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
"""Steps or tolerances of the runs, relative to the simulation's own."""
FINEST = 0.125
"""Step or tolerance of the reference run, relative to the simulation's own."""
BAND = (5.0, 95.0)
"""Percentiles that bound the band of perturbed starts (a convention)."""

Figures = dict[str, tuple[float, str]]
"""Headline figures by name: value [SI] and unit."""


def _figures(result: Result) -> Figures:
    measured = headline_of(result, ideal_tool(result), claims=False)
    return {
        name: (figure.value, figure.unit)
        for name, figure in measured.items()
        if name.startswith(HEADLINE) and name not in COUNTS and figure.value
    }


def _or_reason(result: Result) -> Figures | str:
    """Figures of a run, or the reason why it has none: coarse steps may break down."""
    try:
        return _figures(result.completed("the run"))
    except JointplayError as error:
        return str(error)


@dataclass(frozen=True)
class Convergence:
    """Figures over the step or the tolerance; see `convergence`."""

    of: str
    """The parameter that was varied: ``step`` or ``tolerance``."""
    sizes: tuple[float, ...]
    """Its values that could be run, coarse to fine [s or 1]."""
    finest: float
    """Its value in the reference run."""
    chosen: float
    """Its value in the simulation itself."""
    units: Mapping[str, str]
    values: Mapping[str, np.ndarray]
    """Each figure at the sizes."""
    truth: Mapping[str, float]
    """Each figure in the reference run."""
    stated: Mapping[str, float]
    """The numerical error that is estimated for each figure of the simulation itself."""
    refused: tuple[str, ...]
    """Sizes that could not be run, and why."""

    def distance(self, name: str) -> np.ndarray:
        """Relative distance of a figure from its value in the reference run, at the sizes."""
        size = abs(self.truth[name])
        difference: np.ndarray = np.abs(self.values[name] - self.truth[name])
        return difference / size if size else np.full(len(difference), np.nan)

    def order(self, name: str) -> float:
        """Observed order of convergence: the slope of a line through the logarithms of distance
        over size; NaN with fewer than three points.
        """
        distance = self.distance(name)
        measured = np.isfinite(distance) & (distance > 0.0)
        if np.count_nonzero(measured) < 3:
            return math.nan
        sizes = np.array(self.sizes)[measured]
        return float(np.polyfit(np.log(sizes), np.log(distance[measured]), 1)[0])

    @property
    def table(self) -> Table:
        scale, unit = (1e6, "µs") if self.of == "step" else (1.0, "")
        columns = [Column(self.of, [scale * x for x in (*self.sizes, self.finest)], unit)]
        for name in self.values:
            column = [*self.values[name], self.truth[name]]
            columns.append(Column(name, column, self.units[name], digits=6))
        stated = [self.stated.get(name) for name in self.values]
        return Table(columns, totals=[("stated error", *stated)])

    def __str__(self) -> str:
        lines = []
        row = self.sizes.index(self.chosen) if self.chosen in self.sizes else None
        for name in self.values:
            if row is None:
                break
            distance = abs(float(self.values[name][row]) - self.truth[name])
            error = self.stated.get(name, math.nan)
            relation = "within" if distance <= error else "beyond"
            order = self.order(name)
            order_text = "" if math.isnan(order) else f"; order {order:.2g}"
            lines.append(
                f"{name}: {rounded(distance, self.units[name], 2)} from the finest run, {relation} "
                f"the stated error {rounded(error, self.units[name], 2)}{order_text}"
            )
        return "\n".join([*lines, "", str(self.table), *self.refused])


def convergence(
    simulation: Simulation, *, jobs: int | None = None, progress: bool = False
) -> Convergence:
    """Headline figures over the step, or over the tolerance where the step is adaptive.

    The reference is a run with an eighth of it. In a chaotic motion figures do not converge, as one
    start is one draw of many: `spread` shows how far apart they are.

    Raises:
        JointplayError: the simulation itself, or the reference run, cannot be run.
    """
    parameter = "step" if simulation.tolerance is None else "tolerance"
    nominal = float(getattr(simulation, parameter))
    factors = [factor for factor in FACTORS if parameter == "step" or factor * nominal <= 1.0]
    # Steps that a run refuses, or that break down, are left out; not so the run's own and the
    # finest, which all is compared with.
    runs, refused = {}, []
    for factor in (*factors, FINEST):
        size: dict[str, Any] = {parameter: factor * nominal}
        run = replace(simulation, **size)
        if parameter == "step":  # the same time between records
            run = replace(run, record_every=max(round(simulation.record_every / factor), 1))
        try:
            Run(run)
        except JointplayError as error:
            if factor in (1.0, FINEST):
                raise
            refused.append(f"{parameter} {factor * nominal:g}: {error}")
            continue
        runs[factor] = run
    outcomes = ensemble([*runs.values()], jobs=jobs, keep=_or_reason, progress=progress)
    figures: dict[float, Figures] = {}
    for factor, outcome in zip(runs, outcomes, strict=True):
        if isinstance(outcome, str):
            if factor in (1.0, FINEST):
                raise JointplayError(outcome)
            refused.append(f"{parameter} {factor * nominal:g}: {outcome}")
        else:
            figures[factor] = outcome
    truth = figures.pop(FINEST)
    stated = certify(simulation, progress=progress, strict=False, jobs=jobs)
    return Convergence(
        parameter,
        tuple(factor * nominal for factor in figures),
        FINEST * nominal,
        nominal,
        {name: unit for name, (_, unit) in truth.items()},
        {name: np.array([run.get(name, (0.0,))[0] for run in figures.values()]) for name in truth},
        {name: value for name, (value, _) in truth.items()},
        {figure.name: figure.error for figure in stated.headline},
        tuple(refused),
    )


@dataclass(frozen=True)
class LawComparison:
    """One run with several normal-force laws; see `laws`."""

    figures: Mapping[str, Figures]
    """Figures by law."""
    curves: Mapping[str, tuple[np.ndarray, np.ndarray]]
    """Times [s] and force [N] of `joint`, by law."""
    joint: str
    """The first joint with clearance."""

    @property
    def table(self) -> Table:
        names = next(iter(self.figures.values()))
        columns = [Column("law", list(self.figures))]
        for name, (_, unit) in names.items():
            column = [figures.get(name, (0.0,))[0] for figures in self.figures.values()]
            columns.append(Column(name, column, unit, digits=5))
        return Table(columns)

    def __str__(self) -> str:
        forces = {
            law: value
            for law, figures in self.figures.items()
            for name, (value, _) in figures.items()
            if name.startswith("peak joint force")
        }
        low, high = (choose(forces, key=lambda law: forces[law]) for choose in (min, max))
        return (
            f"peak joint force {rounded(forces[low], 'N')} ({low}) to {rounded(forces[high], 'N')} "
            f"({high})\n\n{self.table}"
        )


def require_laws(names: Sequence[str]) -> None:
    """Raise a JointplayError if `laws` cannot compare these laws; see there."""
    if len(dict.fromkeys(names)) < 2:
        raise JointplayError(f"give two laws or more, got {', '.join(names) or 'none'}")
    for name in names:
        require_known("normal-force law", name, NORMAL_LAWS)
        try:
            NORMAL_LAWS[name]()
        except (TypeError, JointplayError):
            raise JointplayError(
                f"law {name!r} has parameters that must be given: run it as a case of a scenario"
            ) from None


def laws(
    simulation: Simulation,
    names: Sequence[str],
    *,
    jobs: int | None = None,
    progress: bool = False,
) -> LawComparison:
    """Compare normal-force laws: one run with each, in all joints with clearance.

    Raises:
        MissingName: no such law.
        JointplayError: fewer than two laws, a law that does not fit a joint or needs parameters; no
            joint has clearance; a run that did not complete.
    """
    require_laws(names)
    mechanism = simulation.mechanism
    joints = [name for name, joint in mechanism.clearance.items() if hasattr(joint, "normal")]
    if not joints:
        raise JointplayError("no joint has a contact with a normal-force law to exchange")
    runs = {}
    for name in dict.fromkeys(names):
        law = NORMAL_LAWS[name]()
        replaced = {joint: replace(mechanism.clearance[joint], normal=law) for joint in joints}
        runs[name] = replace(
            simulation, mechanism=mechanism.with_clearance(mechanism.given_joints | replaced)
        )
    keep = partial(_figures_and_force, joint=joints[0])
    outcomes = dict(
        zip(runs, ensemble([*runs.values()], jobs=jobs, keep=keep, progress=progress), strict=True)
    )
    return LawComparison(
        {name: figures for name, (figures, _) in outcomes.items()},
        {name: curve for name, (_, curve) in outcomes.items()},
        joints[0],
    )


def _figures_and_force(result: Result, joint: str) -> tuple[Figures, tuple[np.ndarray, np.ndarray]]:
    force = result["joint_force"].sel(joint=joint).values
    size: np.ndarray = np.linalg.norm(force, axis=1)
    return _figures(result.completed("the run")), (result.time, size)


@dataclass(frozen=True)
class Spread:
    """One run with perturbed starts; see `spread`."""

    figures: Mapping[str, np.ndarray]
    """Figures by name, with a value for each run [SI]."""
    units: Mapping[str, str]
    times: np.ndarray
    curves: Mapping[str, np.ndarray]
    """``tool error``, ``tool turn``, and the force of each joint, by name, (runs, times)."""
    curve_units: Mapping[str, str]

    @property
    def table(self) -> Table:
        rows = []
        for name, values in self.figures.items():
            factor, unit = displayed(self.units[name])
            low, high = np.percentile(values, BAND)
            row = [values.mean(), values.std(ddof=1), low, high]
            rows.append([f"{name} [{unit}]", *(f"{factor * value:.5g}" for value in row)])
        heads = ("figure", "mean", "standard deviation", f"{BAND[0]:g} %", f"{BAND[1]:g} %")
        return Table.of_texts([heads, *rows])

    def __str__(self) -> str:
        count = len(next(iter(self.figures.values())))
        since = float(self.times[0])
        return (
            f"{count} perturbed starts, judged from {since:.4g} s on, when no journal falls any "
            f"more\n\n{self.table}"
        )


def spread(
    simulation: Simulation, runs: int, *, jobs: int | None = None, progress: bool = False
) -> Spread:
    """Repeat a run with perturbed starts, to show how far apart its figures and curves are.

    Raises:
        JointplayError: fewer than two runs, or one that did not complete.
    """
    require_whole("the number of runs", runs, 2)
    starts = [replace(simulation, seed=seed) for seed in range(runs)]
    results = ensemble(starts, jobs=jobs, keep=_figures_and_curves, progress=progress)
    figures, all_times, curves, judged_from = zip(*results, strict=True)
    count = min(map(len, all_times))
    times = all_times[0][:count]
    judged = times >= max(judged_from)  # when no journal falls any more
    return Spread(
        {name: np.array([run.get(name, (0.0,))[0] for run in figures]) for name in figures[0]},
        {name: unit for name, (_, unit) in figures[0].items()},
        times[judged],
        {name: np.array([run[name][0][:count][judged] for run in curves]) for name in curves[0]},
        {name: unit for name, (_, unit) in curves[0].items()},
    )


def _figures_and_curves(
    result: Result,
) -> tuple[Figures, np.ndarray, dict[str, tuple[np.ndarray, str]], float]:
    """Figures, times, curves with their units, and the time from which the run is judged."""
    error = result.completed("the run").tool_error
    curves: dict[str, tuple[np.ndarray, str]] = {}
    for name, history, unit in (
        ("tool error", error.distance, "m"),
        ("tool turn", error.turn, "rad"),
    ):
        if float(history.max()) > 0.0:
            curves[name] = history.values, unit
    for joint in result.joints:
        force = result["joint_force"].sel(joint=joint).values
        curves[f"force in {joint}"] = np.linalg.norm(force, axis=1), "N"
    return _figures(result), result.time, curves, result.judge_from
