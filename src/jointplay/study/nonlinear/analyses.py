"""Analyses of settled motion, by kind: bifurcation diagram, Poincaré map, exponents, basin, ..."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, require_known, require_whole
from jointplay.base.tables import counted
from jointplay.scenario import Scenario
from jointplay.scenario.reading import setting_texts
from jointplay.simulation.simulation import Simulation
from jointplay.study.nonlinear import lyapunov, observables, poincare
from jointplay.study.nonlinear.rows import Key, Observation, Varied, rows
from jointplay.study.nonlinear.steady_motion import RECORDS, Turning, start_travel, turn

CYCLES = (1, 8)
"""Settling and observed turns of motions other than cranks at constant speed, by default."""
NEAR = 1e-2
"""Points of a section count as the same if nearer than this part of the range of all points."""
MOST_PLOTTED = 1500
"""Most points of a recurrence plot."""


@dataclass(frozen=True)
class Findings:
    """The result of an analysis, as arguments of a figure of `show.plots.nonlinear`."""

    figure: str
    """Name of the function that draws it."""
    data: dict[str, Any]
    """Its arguments."""


@dataclass(frozen=True)
class Analysis:
    """An analysis of a case of a scenario, checked before anything runs; see `of`."""

    kind: str
    study: Observation
    threshold: float = 0.1
    grid: int = 21

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        kind: str,
        case: str | None = None,
        varied: Varied | None = None,
        names: Sequence[str] = (),
        *,
        leave_out: int | None = None,
        keep: int | None = None,
        phase: float = 0.25,
        records: int = RECORDS,
        orders: float = 20.0,
        window: int = 8,
        threshold: float = 0.1,
        joint: str | None = None,
        grid: int = 21,
    ) -> Analysis:
        """Plan an analysis, and check that it can be made.

        Args:
            scenario, case: the scenario and its case.
            kind: one of `KINDS`.
            varied: a key and its values, for kinds that vary one.
            names: quantities, see `observables.names`; none: those usual for the kind.
            leave_out, keep: settling turns at the start, and turns that are observed.
            phase: phase of the section in the turn, in turns.
            records: records in a turn.
            orders: largest order of spectra.
            window: turns of each spectrum in a run-up.
            threshold: distance that counts as near in a recurrence plot, relative to the largest.
            joint: joint whose journal starts off centre, for a basin.
            grid: starting positions of a basin along each of x and y.

        Raises:
            JointplayError: arguments that do not go together, or a motion that does not repeat.
            MissingName: no such kind, case, joint or quantity.
        """
        require_known("kind of study", kind, KINDS)
        if KINDS[kind].varies and varied is None:
            raise JointplayError(f"{kind} needs --vary KEY=FROM:TO:COUNT")
        if varied is not None and not KINDS[kind].varies and kind != "lyapunov":
            raise JointplayError(f"{kind} takes no --vary: it analyses a single motion")
        # A provisional observation, whose simulation tells what is usual for it.
        study = Observation(scenario, case, 0, 1, records, phase, (), varied, orders, joint or "")
        simulation = study.simulation(None if varied is None else varied.values[0])
        mechanism, motion = simulation.mechanism, simulation.motion
        crank = motion is not None and motion.interpolation == "constant-speed"
        usual = KINDS[kind].turns if crank else CYCLES
        if kind == "basin" and not joint and not mechanism.clearance:
            raise JointplayError("a basin needs a joint with clearance")
        joint = (joint or next(iter(mechanism.clearance))) if kind == "basin" else ""
        study = replace(
            study,
            leave_out=usual[0] if leave_out is None else leave_out,
            keep=usual[1] if keep is None else keep,
            joint=joint,
            names=_names(kind, tuple(names), simulation, joint),
        )
        for name in study.names:
            observables.check(name, mechanism)
        if not 0.0 <= phase < 1.0:
            raise JointplayError(f"--phase must be in [0, 1) turns, got {phase:g}")
        # What else may be wrong arises where the runs are planned.
        if varied is not None and kind == "runup":
            study = replace(study, window=window)
            study.run_up().windows(len(varied.values), study.window)
        else:
            Turning.of(simulation, study.leave_out, study.keep, study.records)
        return cls(kind, study, threshold, require_whole("--grid", grid, 1))

    def run(
        self,
        folder: Path,
        jobs: int | None = None,
        progress: bool = False,
        say: Callable[[str], object] = print,
    ) -> Findings:
        """Compute the rows that the folder lacks, write their table ``KIND.csv``, and evaluate it.

        Args:
            folder, jobs, progress: see `rows.rows`.
            say: called with each line that tells the findings.

        Raises:
            JointplayError: see `rows.rows`.
        """
        inputs = {"kind": self.kind, **self.study.inputs()}
        compute = partial(rows, folder / f"{self.kind}.csv", inputs, jobs, progress, say)
        return KINDS[self.kind].evaluate(self, compute, say)

    @property
    def title(self) -> str:
        study = self.study
        case = f", case {study.case}" if study.case else ""
        case += " changed" if case and (study.varied or study.scenario.settings) else ""
        return f"{self.file}{case}: turns {study.leave_out + 1} to {study.end}"

    @property
    def file(self) -> str:
        return Path(str(self.study.scenario.path).rpartition(":")[2]).stem

    @property
    def sampling(self) -> str:
        """How points were sampled: a caption."""
        study = self.study
        base = f" Other keys as in case {study.case}." if study.case else ""
        changed = ", ".join(setting_texts(study.scenario.settings))
        settings = f" Changed: {changed}." if changed else ""
        return (
            f"One point a turn (period of the motion), {study.phase:g} of a turn after its start: "
            f"turns {study.leave_out + 1} to {study.end} at each of {len(self.keys)} values, "
            f"{study.leave_out} turns of settling left out.{base}{settings}"
        )

    @property
    def varied(self) -> Varied:
        assert self.study.varied is not None
        return self.study.varied

    @property
    def keys(self) -> list[Key]:
        return [()] if self.study.varied is None else [(x,) for x in self.varied.values]

    @property
    def labels(self) -> list[str]:
        first = None if self.study.varied is None else self.study.varied.values[0]
        mechanism = self.study.simulation(first).mechanism
        return [observables.label(name, mechanism) for name in self.study.names]

    def per_turn(self, *names: str) -> list[str]:
        """Names of columns: these quantities in each observed turn."""
        first, end = self.study.leave_out + 1, self.study.end
        return [f"{name} turn {k}" for k in range(first, end + 1) for name in names]


def _names(
    kind: str, requested: tuple[str, ...], simulation: Simulation, joint: str
) -> tuple[str, ...]:
    """Quantities to observe: those requested, or those usual for the kind."""
    if len(requested) > (limit := KINDS[kind].most_names):
        raise JointplayError(f"{kind} takes {limit or 'no'} --of, got {len(requested)}")
    clearance, first = simulation.mechanism.clearance, observables.usual(simulation.mechanism)
    if kind == "lyapunov":
        return ()
    if kind == "basin":
        return f"{joint}.x", f"{joint}.y"
    if kind == "poincare" and len(requested) < 2:
        subject, _, quantity = (requested[0] if requested else first).rpartition(".")
        pairs = {"acceleration": ("acceleration", "speed"), "position": ("position", "speed")}
        a, b = pairs.get(quantity, ("x", "y"))
        if subject not in clearance and quantity not in pairs:
            raise JointplayError("give both quantities of the map: --of NAME --of NAME")
        return f"{subject}.{a}", f"{subject}.{b}"
    if kind == "recurrence" and not requested and clearance:
        joint = next(iter(clearance))
        return f"{joint}.x", f"{joint}.y"
    if kind == "turns" and not requested and simulation.motion is not None:
        return first, f"{simulation.motion.joints[0]}.moment"
    return requested or (first,)


Rows = Callable[[Sequence[str], Callable[[Key], np.ndarray], Sequence[Key]], np.ndarray]
"""Function of column names, the function that computes a row, and keys, which returns the rows,
shape (keys, columns): `rows.rows`."""
Say = Callable[[str], object]


def _bifurcation(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Bifurcation diagram: a quantity once a turn over the values of a key."""
    samples = rows(job.per_turn(job.study.names[0]), job.study.section, job.keys)
    near = NEAR * float(np.nanmax(samples) - np.nanmin(samples))
    good = [row for row in samples if np.isfinite(row).all()]
    periods = Counter(poincare.repeats_after(row, near) for row in good)
    counts = sorted(periods.items(), key=lambda pair: (pair[0] is None, pair[0] or 0))
    parts = [
        f"{n} {'do not repeat' if p is None else f'repeat after {p} turn' + 's' * (p > 1)}"
        for p, n in counts
    ]
    say(f"of {len(good)} values {', '.join(parts)} (to {near:.3g}, {100 * NEAR:g} % of all)")
    (label,) = job.labels
    data = {
        "values": np.array(job.varied.values),
        "samples": samples,
        "across": job.varied.label,
        "up": f"{label}, once a turn",
        "title": f"{job.file}: {label.rpartition(' [')[0]} over the {job.varied.quantity}",
        "caption": job.sampling,
    }
    return Findings("bifurcation", data)


def _section(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Poincaré map: two quantities once a turn against each other."""
    points = rows(job.per_turn(*job.study.names), job.study.section, [()]).reshape(-1, 2)
    spread = np.ptp(points, axis=0)
    scaled = points / np.maximum(np.abs(points).max(axis=0), 1e-300)
    period = poincare.repeats_after(scaled, NEAR)
    verdict = (
        "does not repeat itself"
        if period is None
        else f"repeats itself after {counted(period, 'turn')}"
    )
    sizes = [f"{size:.3g} in {label}" for size, label in zip(spread, job.labels, strict=True)]
    say(f"the section {verdict} within {100 * NEAR:g} %; it spans {' and '.join(sizes)}")
    return Findings("poincare", {"points": points, "labels": job.labels, "title": job.title})


def _exponents(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Largest Lyapunov exponent, for each value of a key if one varies."""
    growths = rows(job.per_turn("growth 1/s"), job.study.growth, job.keys)
    estimates = [lyapunov.exponent(row, 1.0) if np.isfinite(row).all() else None for row in growths]
    if job.study.varied is None:
        (estimate,) = estimates
        assert estimate is not None
        say(f"{estimate} [1/s]")
        period = turn(job.study.simulation().motion)
        data = {"growths": growths[0], "estimate": estimate, "turn": period}
        return Findings("exponent", {**data, "title": job.title})
    counts = Counter(e.verdict for e in estimates if e is not None)
    say(", ".join(f"{number} {verdict}" for verdict, number in counts.items()))
    varied = job.varied
    data = {"values": np.array(varied.values), "estimates": estimates, "across": varied.label}
    return Findings("exponents", {**data, "title": job.title})


def _recurrence(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Recurrence plot: the times at which the motion comes back to where it has been."""
    stride = max(-(-job.study.keep * job.study.records // MOST_PLOTTED), 1)
    study = replace(job.study, every=stride)
    number = -(-study.keep * study.records // stride)
    columns = [f"{name} record {stride * k}" for k in range(number) for name in study.names]
    points = rows(columns, study.course, [()]).reshape(number, len(study.names))
    near = poincare.recurrence(points, job.threshold)
    share, lines = poincare.rate(near), poincare.determinism(near)
    say(f"recurrence rate {share:.4f}, determinism {lines:.4f} (of {number} points)")
    title = f"{job.title}\n{', '.join(study.names)}: rate {share:.3f}, determinism {lines:.3f}"
    return Findings("recurrence", {"near": near, "span": study.keep, "title": title})


def _turns(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Histories of quantities over turns, beside those of the ideal mechanism."""
    study = job.study
    number = study.keep * study.records + 1
    columns = [f"{machine} {name} record {k}" for machine in ("clearance", "ideal")
               for k in range(number) for name in study.names]  # fmt: skip
    values, ideal = rows(columns, study.beside_ideal, [()]).reshape(2, number, len(study.names))
    labels = job.labels
    for name, history, reference in zip(labels, values.T, ideal.T, strict=True):
        ratio = np.abs(history).max() / max(np.abs(reference).max(), 1e-300)
        say(f"{name}: largest {np.abs(history).max():.4g}, {ratio:.3g} of the ideal's")
    angle = study.leave_out + np.arange(number) / study.records
    data = {"angle": angle, "values": values, "ideal": ideal, "labels": labels}
    return Findings("turns", {**data, "title": job.title})


def _waterfall(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Waterfall diagram: order spectra over the values of a key."""
    study = job.study
    order = study.orders(study.keep)
    columns = [f"{study.names[0]} order {value:.6g}" for value in order]
    data = {
        "values": np.array(job.varied.values),
        "order": order,
        "amplitudes": rows(columns, study.spectrum, job.keys),
        "across": job.varied.label,
        "up": job.labels[0],
        "title": job.title,
    }
    return Findings("waterfall", data)


def _run_up(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Run-up: order spectra while the speed rises."""
    study, number = job.study, len(job.varied.values)
    order = study.orders(study.window)
    columns = [
        f"{study.names[0]} window {k + 1} order {value:.6g}"
        for k in range(number)
        for value in order
    ]
    amplitudes = rows(columns, study.rising, [()]).reshape(number, len(order))
    rising = study.run_up()
    speeds = rising.speeds(number, study.window) * 60.0 / (2.0 * np.pi)
    k, peak = np.unravel_index(int(amplitudes.argmax()), amplitudes.shape)
    say(
        f"{number} windows of {study.window} turns, {speeds[0]:.5g} to {speeds[-1]:.5g} rpm; "
        f"largest amplitude {amplitudes.max():.4g} at order {order[peak]:g}, {speeds[k]:.5g} rpm"
    )
    data = {
        "values": speeds,
        "order": order,
        "amplitudes": amplitudes,
        "across": f"speed of {rising.joint} while it rises [rpm]",
        "up": job.labels[0],
        "title": f"{job.title}, window {study.window} turns",
    }
    return Findings("waterfall", data)


def _basin(job: Analysis, rows: Rows, say: Say) -> Findings:
    """Basins of attraction: the orbit on which the motion ends, over the journal's start."""
    study = job.study
    # Starts on a square grid, within the ellipse that the journal can reach.
    reach = np.array(start_travel(study.simulation(), study.joint))
    steps = (np.arange(job.grid) + 0.5) * 2.0 / job.grid - 1.0
    starts = [(float(reach[0] * x), float(reach[1] * y)) for x in steps for y in steps
              if np.hypot(x, y) < 1.0]  # fmt: skip
    points = rows(job.per_turn(*(f"{name} m" for name in study.names)), study.section_from, starts)
    sections = points.reshape(len(starts), study.keep, 2)
    good = np.isfinite(points).all(axis=1)
    labels = np.full(len(starts), -2)  # failed runs; -1: does not repeat itself
    labels[good], orbits = poincare.attractors(list(sections[good]), NEAR * float(reach.max()))
    for k, orbit in enumerate(orbits):
        share = np.count_nonzero(labels == k) / len(starts)
        say(f"orbit {k + 1}, period {len(orbit)}: from {100 * share:.3g} % of the starts")
    say(f"does not repeat itself: from {100 * np.mean(labels == -1):.3g} % of the starts")
    data = {"places": np.array(starts), "labels": labels, "periods": list(map(len, orbits))}
    return Findings("basin", {**data, "joint": study.joint, "title": job.title})


@dataclass(frozen=True)
class Kind:
    """A kind of analysis, and what it takes."""

    evaluate: Callable[[Analysis, Rows, Say], Findings]
    turns: tuple[int, int]
    """Settling and observed turns of cranks at constant speed, by default."""
    most_names: float = math.inf
    """Most quantities that it takes."""
    varies: bool = False
    """Whether it needs several values of a key; a Lyapunov exponent may have them."""


KINDS = {
    "turns": Kind(_turns, (20, 2)),
    "bifurcation": Kind(_bifurcation, (60, 60), 1, varies=True),
    "poincare": Kind(_section, (60, 200), 2),
    "lyapunov": Kind(_exponents, (30, 100), 0),
    "recurrence": Kind(_recurrence, (60, 10)),
    "waterfall": Kind(_waterfall, (30, 20), 1, varies=True),
    "runup": Kind(_run_up, (10, 200), 1, varies=True),
    "basin": Kind(_basin, (60, 30), 0),
}
