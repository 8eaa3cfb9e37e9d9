"""What `jointplay dynamics` draws and prints, a function for each kind."""

import argparse
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jointplay.base.errors import JointplayError
from jointplay.show.plots import nonlinear as plots
from jointplay.study.nonlinear import lyapunov, poincare
from jointplay.study.nonlinear.observables import label
from jointplay.study.nonlinear.rows import Observation, Varied, rows
from jointplay.study.nonlinear.steady_motion import room, turn

SAME = 1e-2
"""Points of a section are the same if they are nearer than this part of all points' range."""
MOST_PLOTTED = 1500
"""Points of a recurrence plot."""


@dataclass(frozen=True)
class FigureJob:
    """What the makers of figures need."""

    study: Observation
    options: argparse.Namespace
    out: Path

    def rows(self, columns: list[str], work: Any, keys: list[tuple[float, ...]]) -> np.ndarray:
        """Numbers for each key, found or read; failures are said."""
        kind, options = self.options.kind, self.options
        asked = {"kind": kind, **self.study.asked()}
        table = self.out / f"{kind}.csv"
        found, done, failures = rows(
            table, asked, columns, work, keys, options.jobs, not options.quiet
        )
        print(f"{done} of {len(keys)} runs computed now, {len(keys) - done} earlier")
        failed = [key for key in keys if key in failures]
        for key in failed[:3]:
            at = f" at {', '.join(f'{x:g}' for x in key)}" if key else ""
            print(f"failed{at}: {failures[key]}")
        if len(failed) > 3:
            print(f"... and {len(failed) - 3} more, see {table}")
        if len(failed) == len(keys):
            raise JointplayError(f"no run was completed: {failures[keys[0]]}")
        return found

    @property
    def title(self) -> str:
        study, options = self.study, self.options
        case = f", case {options.case}" if options.case else ""
        case += " changed" if case and (options.vary or options.set) else ""
        return f"{self.file}{case}: turns {study.settle + 1} to {study.end}"

    @property
    def file(self) -> str:
        return Path(self.options.place.removeprefix("jointplay:")).stem

    @property
    def sampling(self) -> str:
        """How points were sampled, for a caption."""
        study, options = self.study, self.options
        base = f" Other keys as in case {options.case}." if options.case else ""
        given = f" Changed: {', '.join(options.set)}." if options.set else ""
        return (
            f"One point a turn (period of the motion), {study.phase:g} of a turn after its start: "
            f"turns {study.settle + 1} to {study.end} at each of {len(self.keys)} values, "
            f"{study.settle} turns of settling left out.{base}{given}"
        )

    @property
    def varied(self) -> Varied:
        assert self.study.varied is not None
        return self.study.varied

    @property
    def keys(self) -> list[tuple[float, ...]]:
        return [(value,) for value in self.varied.values]

    def labels(self) -> list[str]:
        first = None if self.study.varied is None else self.study.varied.values[0]
        mechanism = self.study.simulation(first).mechanism
        return [label(name, mechanism) for name in self.study.names]


def bifurcation(job: FigureJob) -> Figure:
    """A quantity once a turn over the values of a key."""
    study = job.study
    columns = [f"{study.names[0]} turn {study.settle + k + 1}" for k in range(study.keep)]
    samples = job.rows(columns, study.section, job.keys)
    near = SAME * float(np.nanmax(samples) - np.nanmin(samples))
    good = [row for row in samples if np.isfinite(row).all()]
    print(_repeats([poincare.repeats_after(row, near) for row in good], near))
    values = np.array(job.varied.values)
    up = f"{job.labels()[0]}, once a turn"
    title = f"{job.file}: {job.labels()[0].rpartition(' [')[0]} over the {job.varied.words}"
    return plots.bifurcation(values, samples, job.varied.label, up, title, job.sampling)


def _repeats(periods: list[int | None], near: float) -> str:
    counts = sorted(Counter(periods).items(), key=lambda item: (item[0] is None, item[0] or 0))
    parts = [
        f"{n} {'do not repeat' if p is None else f'repeat after {p} turn' + 's' * (p > 1)}"
        for p, n in counts
    ]
    return f"of {len(periods)} values {', '.join(parts)} (to {near:.3g}, {100 * SAME:g} % of all)"


def section(job: FigureJob) -> Figure:
    """Two quantities once a turn against each other."""
    study = job.study
    columns = [f"{name} turn {study.settle + k + 1}" for k in range(study.keep)
               for name in study.names]  # fmt: skip
    points = job.rows(columns, study.section, [()]).reshape(study.keep, 2)
    spread = np.ptp(points, axis=0)
    scaled = points / np.maximum(np.abs(points).max(axis=0), 1e-300)
    period = poincare.repeats_after(scaled, SAME)
    word = "does not repeat itself" if period is None else f"repeats itself after {period} turn(s)"
    print(f"the section {word} within {100 * SAME:g} %; it is {spread[0]:.3g} by {spread[1]:.3g}")
    return plots.poincare(points, job.labels(), job.title)


def exponents(job: FigureJob) -> Figure:
    """The largest exponent, or one for each value of a key."""
    study = job.study
    columns = [f"growth 1/s turn {study.settle + k + 1}" for k in range(study.keep)]
    keys: list[tuple[float, ...]] = [()] if study.varied is None else job.keys
    rows = job.rows(columns, study.growth, keys)
    found = [lyapunov.exponent(row, 1.0) if np.isfinite(row).all() else None for row in rows]
    if study.varied is None:
        (one,) = found
        assert one is not None
        print(f"{one} [1/s]")
        return plots.exponent(rows[0], one, turn(study.simulation().motion), job.title)
    counts = Counter(one.verdict for one in found if one is not None)
    print(", ".join(f"{number} {verdict}" for verdict, number in counts.items()))
    return plots.exponents(np.array(job.varied.values), found, job.varied.label, job.title)


def recurrence(job: FigureJob) -> Figure:
    """When the motion comes back to where it has been."""
    study = job.study
    every = max(-(-study.keep * study.records // MOST_PLOTTED), 1)
    study = replace(study, every=every)
    number = -(-study.keep * study.records // every)
    columns = [f"{name} record {every * k}" for k in range(number) for name in study.names]
    points = job.rows(columns, study.course, [()]).reshape(number, len(study.names))
    near = poincare.recurrence(points, job.options.threshold)
    share, lines = poincare.rate(near), poincare.determinism(near)
    print(f"recurrence rate {share:.4f}, determinism {lines:.4f} (of {number} points)")
    title = f"{job.title}\n{', '.join(study.names)}: rate {share:.3f}, determinism {lines:.3f}"
    return plots.recurrence(near, study.keep, title)


def turns(job: FigureJob) -> Figure:
    """Quantities over turns, beside the ideal mechanism's."""
    study = job.study
    number = study.keep * study.records + 1
    columns = [f"{what} {name} record {k}" for what in ("clearance", "ideal")
               for k in range(number) for name in study.names]  # fmt: skip
    both = job.rows(columns, study.beside_ideal, [()]).reshape(2, number, len(study.names))
    labels = job.labels()
    for name, history, plain in zip(labels, both[0].T, both[1].T, strict=True):
        ratio = np.abs(history).max() / max(np.abs(plain).max(), 1e-300)
        print(f"{name}: largest {np.abs(history).max():.4g}, {ratio:.3g} of the ideal's")
    angle = study.settle + np.arange(number) / study.records
    return plots.turns(angle, both[0], both[1], labels, job.title)


def waterfall(job: FigureJob) -> Figure:
    """Spectra over the values of a key."""
    study = job.study
    highest = min(study.highest, study.records / 2)
    order = np.arange(int(highest * study.keep + 1e-6) + 1) / study.keep
    columns = [f"{study.names[0]} order {one:.6g}" for one in order]
    amplitudes = job.rows(columns, study.spectrum, job.keys)
    values, label = np.array(job.varied.values), job.labels()[0]
    return plots.waterfall(values, order, amplitudes, job.varied.label, label, job.title)


def runup(job: FigureJob) -> Figure:
    """Spectra while the speed rises."""
    study = job.study
    highest, number = min(study.highest, study.records / 2), len(job.varied.values)
    order = np.arange(int(highest * study.window + 1e-6) + 1) / study.window
    columns = [
        f"{study.names[0]} window {k + 1} order {one:.6g}" for k in range(number) for one in order
    ]
    amplitudes = job.rows(columns, study.rising, [()]).reshape(number, len(order))
    rising = study.run_up()
    speeds = rising.speeds(number, study.window) * 60.0 / (2.0 * np.pi)
    k, at = np.unravel_index(int(amplitudes.argmax()), amplitudes.shape)
    print(
        f"{number} windows of {study.window} turns, {speeds[0]:.5g} to {speeds[-1]:.5g} rpm; "
        f"largest amplitude {amplitudes.max():.4g} at order {order[at]:g}, {speeds[k]:.5g} rpm"
    )
    across = f"speed of {rising.joint} while it rises [rpm]"
    title = f"{job.title}, window {study.window} turns"
    return plots.waterfall(speeds, order, amplitudes, across, job.labels()[0], title)


def basin(job: FigureJob) -> Figure:
    """On which orbit the motion ends, over where a journal starts."""
    study, grid = job.study, job.options.grid
    if grid < 1:
        raise JointplayError(f"--grid must be at least 1, got {grid}")
    reach = np.array(room(study.simulation(), study.joint))
    steps = (np.arange(grid) + 0.5) * 2.0 / grid - 1.0
    places = [(float(reach[0] * x), float(reach[1] * y)) for x in steps for y in steps
              if np.hypot(x, y) < 1.0]  # fmt: skip
    columns = [f"{name} m turn {study.settle + k + 1}" for k in range(study.keep)
               for name in study.names]  # fmt: skip
    rows = job.rows(columns, study.section_from, list(places))
    sections = rows.reshape(len(places), study.keep, 2)
    good = np.isfinite(rows).all(axis=1)
    labels = np.full(len(places), -2)
    labels[good], orbits = poincare.attractors(list(sections[good]), SAME * float(reach.max()))
    for k, orbit in enumerate(orbits):
        share = np.count_nonzero(labels == k) / len(places)
        print(f"orbit {k + 1}, period {len(orbit)}: from {100 * share:.3g} % of the starts")
    print(f"does not repeat itself: from {100 * np.mean(labels == -1):.3g} % of the starts")
    return plots.basin(
        np.array(places), labels, [len(one) for one in orbits], study.joint, job.title
    )


FIGURES = {
    "bifurcation": bifurcation,
    "poincare": section,
    "lyapunov": exponents,
    "recurrence": recurrence,
    "turns": turns,
    "waterfall": waterfall,
    "runup": runup,
    "basin": basin,
}
"""What draws each kind of study."""
