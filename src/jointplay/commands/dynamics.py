"""`jointplay dynamics`: bifurcations, Poincare maps, Lyapunov exponents, basins of attraction."""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.commands import add_option, add_repeatable, add_shared
from jointplay.core.errors import JointplayError

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure

    from jointplay.nonlinear.rows import Study, Table


KINDS = {
    "turns": "quantities over the crank's angle, beside those of the ideal mechanism",
    "bifurcation": "a quantity once a turn, over the values of a key (--vary)",
    "poincare": "two quantities once a turn against each other",
    "lyapunov": "largest Lyapunov exponent with its confidence; over a key with --vary",
    "recurrence": "when the journal, or what is named, comes back to where it has been",
    "waterfall": "spectra over the values of a key, such as the crank's speed (--vary)",
    "runup": "spectra while the crank's speed rises evenly over the values of --vary",
    "basin": "on which orbit the motion ends, over where a journal starts",
}
TURNS = {
    "turns": (20, 2),
    "bifurcation": (60, 60),
    "poincare": (60, 200),
    "lyapunov": (30, 100),
    "recurrence": (60, 10),
    "waterfall": (30, 20),
    "runup": (10, 200),
    "basin": (60, 30),
}
"""Turns that settle, and turns that are looked at, by kind; motions other than cranks: `CYCLES`."""
CYCLES = (1, 8)


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "dynamics",
        help="nonlinear dynamics: bifurcations, Poincare maps, Lyapunov exponents, basins",
        description="Let a periodically driven mechanism settle over many turns, then look at it: "
        + "; ".join(f"{name}: {text}" for name, text in KINDS.items())
        + ". Values run side by side; what is done is kept in a CSV file in the folder, and the "
        "same command goes on with it. docs/nonlinear.md says what the figures mean.",
        epilog="Example: jointplay dynamics jointplay:slider_crank.toml bifurcation "
        '--case "0.5 mm" --vary "motion.speeds.crank_pin=500:5000:400 rpm" --out speeds',
    )
    parser.add_argument("file", metavar="FILE", help="scenario (TOML)")
    parser.add_argument("kind", metavar="WHAT", choices=KINDS, help=", ".join(KINDS))
    add_shared(parser, "--case")
    add_option(parser, "--vary KEY=FROM:TO:COUNT", "key of the scenario, its values, their unit")
    add_repeatable(
        parser,
        "--of NAME",
        "quantity, such as guide.acceleration, crank_pin.moment, piston_pin.eccentricity; a wrong "
        "name lists all",
    )
    add_option(parser, "--settle N", "turns that are not looked at (default: by what is asked)")
    add_option(parser, "--keep N", "turns that are looked at (default: by what is asked)")
    add_option(parser, "--phase X", "of the section [turns]", 0.25)
    add_option(parser, "--records N", "records in a turn", 1000)
    add_option(parser, "--orders X", "of spectra, at most", 20.0)
    add_option(parser, "--window N", "runup: turns of a spectrum", 8)
    add_option(
        parser, "--threshold X", "recurrence: distance that counts as near, of all distances", 0.1
    )
    add_option(parser, "--joint NAME", "basin: the joint whose journal starts off centre")
    add_option(parser, "--grid N", "basin: starts along x and y", 21)
    add_repeatable(
        parser, "--set KEY=VALUE", "another value for a key of the scenario", dest="changes"
    )
    add_shared(parser, "--jobs")
    add_option(parser, "--out DIR", "folder for table and figure", required=True)
    add_shared(parser, "--quiet", "--trust")


def run(options: argparse.Namespace) -> int:
    """Run what is missing, draw, print."""
    from jointplay.core import files, processes

    processes.number_of(options.jobs)
    study = _study(options)
    out, mark = files.claim(options.out, []), f"jointplay dynamics {options.kind}"
    path = out / f"{options.kind}.png"
    if path.exists() and not files.holds(path, mark):
        raise JointplayError(f"{str(path)!r} is no figure of this command; name another folder")
    figure = FIGURES[options.kind](FigureJob(study, options, out))
    files.picture(path, figure, mark=mark)
    print(f"written to {options.out}: {options.kind}.csv, {path.name}")
    return 0


def _study(options: argparse.Namespace) -> Study:
    """Checks all before anything runs."""
    from jointplay.nonlinear import observables, steady_motion
    from jointplay.nonlinear.rows import Study, Varied
    from jointplay.scenario import Scenario
    from jointplay.scenario.settings import parse

    settings = tuple(parse(text) for text in options.changes)
    scenario = Scenario.load(options.file, options.trust, settings)
    if options.kind in ("bifurcation", "waterfall", "runup") and not options.vary:
        raise JointplayError(f"{options.kind} needs --vary KEY=FROM:TO:COUNT")
    if options.vary and options.kind not in ("bifurcation", "waterfall", "lyapunov", "runup"):
        raise JointplayError(f"{options.kind} has no --vary; it is of one motion")
    varied = Varied.parse(options.vary) if options.vary else None
    study = Study(
        str(scenario.path), scenario.text, tuple(scenario.trust), settings, options.case,
        0, 1, options.records, options.phase, (), varied, options.orders, options.joint or "",
    )  # fmt: skip
    simulation = study.simulation(None if varied is None else varied.values[0])
    mechanism = simulation.mechanism
    crank = simulation.motion is not None and simulation.motion.interpolation == "constant-speed"
    settle, keep = TURNS[options.kind] if crank else CYCLES
    study = replace(
        study,
        settle=settle if options.settle is None else options.settle,
        keep=keep if options.keep is None else options.keep,
        joint=_joint(options, simulation),
        names=_names(options, simulation),
    )
    for name in study.names:
        observables.check(name, mechanism)
    if not 0.0 <= options.phase < 1.0:
        raise JointplayError(f"--phase must be in [0, 1) turns, got {options.phase:g}")
    if options.kind == "runup":
        study = replace(study, window=options.window)
        assert varied is not None
        study.run_up().windows(len(varied.values), study.window)
    else:
        steady_motion.Turning.of(simulation, study.settle, study.keep, study.records)
    return study


def _joint(options: argparse.Namespace, simulation: Any) -> str:
    """The joint whose journal starts aside."""
    clearance = simulation.mechanism.clearance
    if options.kind != "basin":
        return ""
    if options.joint is None and not clearance:
        raise JointplayError("a basin needs a joint with clearance")
    return str(options.joint or next(iter(clearance)))


def _names(options: argparse.Namespace, simulation: Any) -> tuple[str, ...]:
    """Quantities that are looked at."""
    from jointplay.nonlinear.observables import usual

    kind, given = options.kind, tuple(options.of)
    first = usual(simulation.mechanism)
    most = {"poincare": 2, "bifurcation": 1, "waterfall": 1, "runup": 1, "lyapunov": 0, "basin": 0}
    if len(given) > most.get(kind, len(given)):
        raise JointplayError(f"{kind} takes {most[kind] or 'no'} --of, got {len(given)}")
    if kind == "lyapunov":
        return ()
    if kind == "basin":
        joint = _joint(options, simulation)
        return f"{joint}.x", f"{joint}.y"
    if kind == "poincare" and len(given) < 2:
        thing, _, what = (given[0] if given else first).rpartition(".")
        pairs = {"acceleration": ("acceleration", "speed"), "position": ("position", "speed")}
        a, b = pairs.get(what, ("x", "y"))
        if thing not in simulation.mechanism.clearance and what not in pairs:
            raise JointplayError("name both quantities of the map: --of NAME --of NAME")
        return f"{thing}.{a}", f"{thing}.{b}"
    clearance = simulation.mechanism.clearance
    if kind == "recurrence" and not given and clearance:
        joint = next(iter(clearance))
        return f"{joint}.x", f"{joint}.y"
    if kind == "turns" and not given and simulation.motion is not None:
        return first, f"{simulation.motion.joints[0]}.moment"
    return given or (first,)


# What `jointplay dynamics` draws and says, a function for each kind.


SAME = 1e-2
"""Points of a section are the same if they are nearer than this part of all points' range."""
MOST_PLOTTED = 1500
"""Points of a recurrence plot."""


@dataclass(frozen=True)
class FigureJob:
    """What the makers of figures need."""

    study: Study
    options: argparse.Namespace
    out: Path

    def table(self, columns: list[str]) -> Table:
        """The table of this kind in the folder."""
        from jointplay.nonlinear.rows import Table

        kind = self.options.kind
        return Table(self.out / f"{kind}.csv", {"kind": kind, **self.study.asked()}, columns)

    def rows(self, columns: list[str], work: Any, keys: list[tuple[float, ...]]) -> np.ndarray:
        """Numbers for each key, found or read; failures are said."""
        table = self.table(columns)
        done = table.fill(work, keys, self.options.jobs, not self.options.quiet)
        print(f"{done} of {len(keys)} runs computed now, {len(keys) - done} from earlier")
        failed = [key for key in keys if key in table.failures]
        for key in failed[:3]:
            at = f" at {', '.join(f'{x:g}' for x in key)}" if key else ""
            print(f"failed{at}: {table.failures[key]}")
        if len(failed) > 3:
            print(f"... and {len(failed) - 3} more, see {table.path}")
        if len(failed) == len(keys):
            raise JointplayError(f"no run was completed: {table.failures[keys[0]]}")
        return table.values(keys)

    @property
    def title(self) -> str:
        """Says where the figure comes from."""
        study, options = self.study, self.options
        case = f", case {options.case}" if options.case else ""
        case += " changed" if case and (options.vary or options.changes) else ""
        file = Path(options.file.removeprefix("jointplay:")).stem
        return f"{file}{case}: turns {study.settle + 1} to {study.end}"


def _units(study: Study) -> dict[str, str]:
    """Label of each quantity, from its unit."""
    from jointplay.nonlinear.observables import label

    varied = study.varied
    mechanism = study.simulation(None if varied is None else varied.values[0]).mechanism
    return {name: label(name, mechanism) for name in study.names}


def _keys(study: Study) -> list[tuple[float, ...]]:
    assert study.varied is not None
    return [(value,) for value in study.varied.values]


def bifurcation(job: FigureJob) -> Figure:
    """A quantity once a turn over the values of a key."""
    import numpy as np

    from jointplay.nonlinear.poincare import repeats_after
    from jointplay.plots import nonlinear as plots

    study = job.study
    assert study.varied is not None
    keys = _keys(study)
    columns = [f"{study.names[0]} turn {study.settle + k + 1}" for k in range(study.keep)]
    samples = job.rows(columns, study.section, keys)
    near = SAME * float(np.nanmax(samples) - np.nanmin(samples))
    good = [row for row in samples if np.isfinite(row).all()]
    print(_repeats([repeats_after(row, near) for row in good], near))
    values = np.array(study.varied.values)
    up = f"{_units(study)[study.names[0]]}, once a turn"
    return plots.bifurcation(values, samples, study.varied.label, up, job.title)


def _repeats(periods: list[int | None], near: float) -> str:
    """How many values have which period."""
    counts = sorted(Counter(periods).items(), key=lambda item: (item[0] is None, item[0] or 0))
    parts = [
        f"{n} {'do not repeat' if p is None else f'repeat after {p} turn' + 's' * (p > 1)}"
        for p, n in counts
    ]
    return f"of {len(periods)} values {', '.join(parts)} (to {near:.3g}, {100 * SAME:g} % of all)"


def poincare(job: FigureJob) -> Figure:
    """Two quantities once a turn against each other."""
    import numpy as np

    from jointplay.nonlinear.poincare import repeats_after
    from jointplay.plots import nonlinear as plots

    study = job.study
    columns = [f"{name} turn {study.settle + k + 1}" for k in range(study.keep)
               for name in study.names]  # fmt: skip
    points = job.rows(columns, study.section, [()]).reshape(study.keep, 2)
    spread = np.ptp(points, axis=0)
    scaled = points / np.maximum(np.abs(points).max(axis=0), 1e-300)
    period = repeats_after(scaled, SAME)
    word = "does not repeat itself" if period is None else f"repeats itself after {period} turn(s)"
    print(f"the section {word} within {100 * SAME:g} %; it is {spread[0]:.3g} by {spread[1]:.3g}")
    labels = _units(study)
    return plots.poincare(points, [labels[name] for name in study.names], job.title)


def lyapunov(job: FigureJob) -> Figure:
    """The largest exponent, or one for each value of a key."""
    import numpy as np

    from jointplay.nonlinear import lyapunov
    from jointplay.nonlinear.steady_motion import turn
    from jointplay.plots import nonlinear as plots

    study = job.study
    columns = [f"growth 1/s turn {study.settle + k + 1}" for k in range(study.keep)]
    keys: list[tuple[float, ...]] = [()] if study.varied is None else _keys(study)
    rows = job.rows(columns, study.growth, keys)
    exponents = [lyapunov.exponent(row, 1.0) if np.isfinite(row).all() else None for row in rows]
    if study.varied is None:
        (one,) = exponents
        assert one is not None
        print(f"{one} [1/s]")
        return plots.exponent(rows[0], one, turn(study.simulation().motion), job.title)
    counts = Counter(one.verdict for one in exponents if one is not None)
    print(", ".join(f"{number} {verdict}" for verdict, number in counts.items()))
    return plots.exponents(np.array(study.varied.values), exponents, study.varied.label, job.title)


def recurrence(job: FigureJob) -> Figure:
    """When the motion comes back to where it has been."""
    from jointplay.nonlinear import poincare
    from jointplay.plots import nonlinear as plots

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
    import numpy as np

    from jointplay.plots import nonlinear as plots

    study = job.study
    number = study.keep * study.records + 1
    columns = [f"{what} {name} record {k}" for what in ("clearance", "ideal")
               for k in range(number) for name in study.names]  # fmt: skip
    both = job.rows(columns, study.beside_ideal, [()]).reshape(2, number, len(study.names))
    labels = _units(study)
    for name, history, plain in zip(study.names, both[0].T, both[1].T, strict=True):
        ratio = np.abs(history).max() / max(np.abs(plain).max(), 1e-300)
        print(f"{labels[name]}: largest {np.abs(history).max():.4g}, {ratio:.3g} of the ideal's")
    angle = study.settle + np.arange(number) / study.records
    return plots.turns(angle, both[0], both[1], [labels[name] for name in study.names], job.title)


def waterfall(job: FigureJob) -> Figure:
    """Spectra over the values of a key."""
    import numpy as np

    from jointplay.plots import nonlinear as plots

    study = job.study
    assert study.varied is not None
    highest = min(study.highest, study.records / 2)
    order = np.arange(int(highest * study.keep + 1e-6) + 1) / study.keep
    columns = [f"{study.names[0]} order {one:.6g}" for one in order]
    amplitudes = job.rows(columns, study.spectrum, _keys(study))
    values, label = np.array(study.varied.values), _units(study)[study.names[0]]
    return plots.waterfall(values, order, amplitudes, study.varied.label, label, job.title)


def runup(job: FigureJob) -> Figure:
    """Spectra while the speed rises."""
    import numpy as np

    from jointplay.plots import nonlinear as plots

    study = job.study
    assert study.varied is not None
    highest, number = min(study.highest, study.records / 2), len(study.varied.values)
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
    return plots.waterfall(speeds, order, amplitudes, across, _units(study)[study.names[0]], title)


def basin(job: FigureJob) -> Figure:
    """On which orbit the motion ends, over where a journal starts."""
    import numpy as np

    from jointplay.nonlinear.poincare import attractors
    from jointplay.nonlinear.steady_motion import room
    from jointplay.plots import nonlinear as plots

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
    labels[good], orbits = attractors(list(sections[good]), SAME * float(reach.max()))
    for k, orbit in enumerate(orbits):
        share = np.count_nonzero(labels == k) / len(places)
        print(f"orbit {k + 1}, period {len(orbit)}: from {100 * share:.3g} % of the starts")
    print(f"does not repeat itself: from {100 * np.mean(labels == -1):.3g} % of the starts")
    return plots.basin(
        np.array(places), labels, [len(one) for one in orbits], study.joint, job.title
    )


FIGURES = {
    "bifurcation": bifurcation,
    "poincare": poincare,
    "lyapunov": lyapunov,
    "recurrence": recurrence,
    "turns": turns,
    "waterfall": waterfall,
    "runup": runup,
    "basin": basin,
}
"""What draws each kind of study."""
