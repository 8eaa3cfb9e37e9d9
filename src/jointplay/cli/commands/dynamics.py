"""`jointplay dynamics`: bifurcations, Poincare maps, Lyapunov exponents, basins of attraction."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError
from jointplay.cli.commands import add_option, add_repeatable, add_shared, given
from jointplay.cli.commands.inputs import add_inputs, explain, scenario_of

if TYPE_CHECKING:
    from jointplay.study.nonlinear.rows import Observation


KINDS = {
    "turns": "quantities over the crank's angle, compared with the ideal mechanism",
    "bifurcation": "a quantity sampled once per turn, over the values of a key (--vary)",
    "poincare": "two quantities sampled once per turn, plotted against each other",
    "lyapunov": "largest Lyapunov exponent with its confidence interval; over a key with --vary",
    "recurrence": "when the journal, or a quantity given by --of, returns to an earlier state",
    "waterfall": "spectra over the values of a key, such as the crank's speed (--vary)",
    "runup": "spectra while the crank's speed rises evenly over the values of --vary",
    "basin": "the orbit on which the motion settles, over the journal's starting position",
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
        description=(
            "Let a periodically driven mechanism settle over many turns, then analyse it: "
        )
        + "; ".join(f"{name}: {text}" for name, text in KINDS.items())
        + ". Values run in parallel; finished ones are kept in the folder, and the "
        "same command continues from it. docs/nonlinear.md explains the figures.",
        epilog="Example: jointplay dynamics jointplay:slider_crank.toml bifurcation "
        '--case "0.5 mm" --vary "motion.speeds.crank_pin=500:5000:400 rpm" --out speeds',
        lazy=explain,
    )
    add_inputs(parser, ("robot",), needed=True)
    parser.add_argument("kind", metavar="WHAT", choices=KINDS, help=", ".join(KINDS))
    add_option(
        parser,
        "--vary KEY=FROM:TO:COUNT",
        "key of the scenario, its range of values, and their unit",
    )
    add_repeatable(
        parser,
        "--of NAME",
        "quantity, such as guide.acceleration, crank_pin.moment, piston_pin.eccentricity; an "
        "unknown name lists all of them",
    )
    add_option(parser, "--settle N", "turns left out at the start (default: depends on WHAT)")
    add_option(parser, "--keep N", "turns that are analysed (default: depends on WHAT)")
    add_option(parser, "--phase X", "phase of the section [turns]", 0.25)
    add_option(parser, "--records N", "records per turn", 1000)
    add_option(parser, "--orders X", "highest order of spectra", 20.0)
    add_option(parser, "--window N", "runup: turns per spectrum", 8)
    add_option(
        parser,
        "--threshold X",
        "recurrence: distance that counts as near, as a share of all distances",
        0.1,
    )
    add_option(parser, "--joint NAME", "basin: joint whose journal starts off centre")
    add_option(parser, "--grid N", "basin: number of starting positions along x and along y", 21)
    add_shared(parser, "--jobs")
    add_option(parser, "--out DIR", "folder for the table and the figure", required=True)
    add_shared(parser, "--quiet")


def run(options: argparse.Namespace) -> int:
    """Run what is missing, draw, print."""
    from jointplay.base import files, processes

    processes.number_of(options.jobs)
    study = _study(options)
    out, mark = files.claim(options.out, []), f"jointplay dynamics {options.kind}"
    path = out / f"{options.kind}.png"
    if path.exists() and not files.holds(path, mark):
        raise JointplayError(
            f"{str(path)!r} is not a figure of this command; choose another folder"
        )
    from jointplay.cli.commands.dynamics_figures import FIGURES, FigureJob

    figure = FIGURES[options.kind](FigureJob(study, options, out))
    files.picture(path, figure, mark=mark)
    print(f"written to {options.out}: {options.kind}.csv, {path.name}")
    return 0


def _study(options: argparse.Namespace) -> Observation:
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
        str(scenario.path), scenario.text, tuple(scenario.trust), scenario.settings, options.case,
        0, 1, options.records, options.phase, (), varied, options.orders, options.joint or "",
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
    """The joint whose journal starts aside."""
    clearance = simulation.mechanism.clearance
    if options.kind != "basin":
        return ""
    if options.joint is None and not clearance:
        raise JointplayError("a basin needs a joint with clearance")
    return str(options.joint or next(iter(clearance)))


def _names(options: argparse.Namespace, simulation: Any) -> tuple[str, ...]:
    """Quantities that are looked at."""
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
