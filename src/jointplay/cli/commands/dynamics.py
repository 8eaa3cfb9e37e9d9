"""`jointplay dynamics`: bifurcations, Poincare maps, Lyapunov exponents, basins of attraction.

Let a periodically driven mechanism settle over many turns, then analyse it: turns: quantities over
the crank's angle, compared with the ideal mechanism; bifurcation: a quantity sampled once per turn,
over the values of a key (--vary); poincare: two quantities sampled once per turn, plotted against
each other; lyapunov: largest Lyapunov exponent with its confidence interval, over a key with
--vary; recurrence: when the journal, or a quantity given by --of, returns to an earlier state;
waterfall: spectra over the values of a key, such as the crank's speed (--vary); runup: spectra
while the crank's speed rises evenly over the values of --vary; basin: the orbit on which the motion
settles, over the journal's starting position. Values run in parallel; finished ones are kept in the
folder, and the same command continues from it. docs/nonlinear.md explains the figures.

Example: jointplay dynamics jointplay:slider_crank.toml bifurcation --case "0.5 mm" --vary
"motion.speeds.crank_pin=500:5000:400 rpm" --out speeds

    FILE | ROBOT  robot
    KIND  turns, bifurcation, poincare, lyapunov, recurrence, waterfall, runup or basin
    --vary KEY=FROM:TO:COUNT  key of the scenario, its range of values, and their unit
    --of NAME ...  quantity, such as guide.acceleration, crank_pin.moment, piston_pin.eccentricity;
        an unknown name lists all of them
    --settle N  turns left out at the start (default: depends on KIND)
    --keep N  turns that are analysed (default: depends on KIND)
    --phase X  phase of the section [turns] (default 0.25)
    --records N  records per turn (default 1000)
    --orders X  highest order of spectra (default 20)
    --window N  runup: turns per spectrum (default 8)
    --threshold X  recurrence: distance that counts as near, as a share of all distances (default
        0.1)
    --joint NAME  basin: joint whose journal starts off centre
    --grid N  basin: number of starting positions along x and along y (default 21)
    --jobs
    --out DIR  folder for the table and the figure (required)
    --quiet
"""

import argparse
from dataclasses import replace
from typing import Any

from jointplay.base.errors import JointplayError, MissingName
from jointplay.cli.commands import given
from jointplay.cli.commands.inputs import scenario_of

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


def run(options: argparse.Namespace) -> int:
    from jointplay.base import files, processes

    processes.number_of(options.jobs)
    if options.kind not in TURNS:
        raise MissingName("kind of study", options.kind, TURNS)
    study = _study(options)
    out, mark = files.claim(options.out, []), f"jointplay dynamics {options.kind}"
    path = out / f"{options.kind}.png"
    if path.exists() and not files.holds(path, mark):
        raise JointplayError(f"{str(path)!r} is no figure of this command; choose another folder")
    from jointplay.cli.commands.dynamics_figures import FIGURES, FigureJob

    figure = FIGURES[options.kind](FigureJob(study, options, out))
    files.picture(path, figure, mark=mark)
    print(f"written to {options.out}: {options.kind}.csv, {path.name}")
    return 0


def _study(options: argparse.Namespace) -> Any:
    """Checks all before anything runs."""
    from jointplay.study.nonlinear import observables, steady_motion
    from jointplay.study.nonlinear.rows import Observation, Varied

    scenario = scenario_of(options)
    if options.kind in ("bifurcation", "waterfall", "runup") and not options.vary:
        raise JointplayError(f"{options.kind} needs --vary KEY=FROM:TO:COUNT")
    if options.vary and options.kind not in ("bifurcation", "waterfall", "lyapunov", "runup"):
        raise JointplayError(f"{options.kind} takes no --vary: it analyses a single motion")
    varied = Varied.parse(options.vary) if options.vary else None
    study = Observation(
        scenario, options.case, 0, 1, options.records, options.phase, (), varied, options.orders,
        options.joint or "",
    )  # fmt: skip
    simulation = study.simulation(None if varied is None else varied.values[0])
    mechanism = simulation.mechanism
    crank = simulation.motion is not None and simulation.motion.interpolation == "constant-speed"
    settle, keep = TURNS[options.kind] if crank else CYCLES
    study = replace(
        study,
        **{"settle": settle, "keep": keep} | given(options, "settle", "keep"),
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
    clearance = simulation.mechanism.clearance
    if options.kind != "basin":
        return ""
    if options.joint is None and not clearance:
        raise JointplayError("a basin needs a joint with clearance")
    return str(options.joint or next(iter(clearance)))


def _names(options: argparse.Namespace, simulation: Any) -> tuple[str, ...]:
    from jointplay.study.nonlinear.observables import usual

    kind, asked = options.kind, tuple(options.of)
    first = usual(simulation.mechanism)
    most = {"poincare": 2, "bifurcation": 1, "waterfall": 1, "runup": 1, "lyapunov": 0, "basin": 0}
    if len(asked) > most.get(kind, len(asked)):
        raise JointplayError(f"{kind} takes {most[kind] or 'no'} --of, got {len(asked)}")
    if kind == "lyapunov":
        return ()
    if kind == "basin":
        joint = _joint(options, simulation)
        return f"{joint}.x", f"{joint}.y"
    if kind == "poincare" and len(asked) < 2:
        thing, _, what = (asked[0] if asked else first).rpartition(".")
        pairs = {"acceleration": ("acceleration", "speed"), "position": ("position", "speed")}
        a, b = pairs.get(what, ("x", "y"))
        if thing not in simulation.mechanism.clearance and what not in pairs:
            raise JointplayError("give both quantities of the map: --of NAME --of NAME")
        return f"{thing}.{a}", f"{thing}.{b}"
    clearance = simulation.mechanism.clearance
    if kind == "recurrence" and not asked and clearance:
        joint = next(iter(clearance))
        return f"{joint}.x", f"{joint}.y"
    if kind == "turns" and not asked and simulation.motion is not None:
        return first, f"{simulation.motion.joints[0]}.moment"
    return asked or (first,)
