"""`jointplay dynamics`: bifurcations, Poincare maps, Lyapunov exponents, basins of attraction."""

from __future__ import annotations

import argparse
import io
import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from jointplay.commands import add_case, add_jobs, add_quiet, add_trust
from jointplay.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.study.dynamics import Study

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
    add_case(parser)
    parser.add_argument(
        "--vary", metavar="KEY=FROM:TO:COUNT", help="key of the scenario, its values, their unit"
    )
    parser.add_argument(
        "--of",
        action="append",
        default=[],
        metavar="NAME",
        help="quantity, such as guide.acceleration, crank_pin.moment, piston_pin.eccentricity "
        "(repeatable; a wrong name lists all)",
    )
    parser.add_argument("--settle", type=int, metavar="N", help="turns that are not looked at")
    parser.add_argument("--keep", type=int, metavar="N", help="turns that are looked at")
    parser.add_argument("--phase", type=float, default=0.25, help="of the section [turns] (0.25)")
    parser.add_argument("--records", type=int, default=1000, help="in a turn (default 1000)")
    parser.add_argument("--orders", type=float, default=20.0, help="of spectra, at most (20)")
    parser.add_argument("--window", type=int, default=8, help="runup: turns of a spectrum (8)")
    parser.add_argument("--threshold", type=float, default=0.1, help="of recurrence (0.1)")
    parser.add_argument("--joint", help="basin: the joint whose journal starts aside")
    parser.add_argument("--grid", type=int, default=21, help="basin: starts along x and y (21)")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
        help="another value for a key of the scenario (repeatable)",
    )  # fmt: skip
    add_jobs(parser)
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for table and figure")
    add_quiet(parser)
    add_trust(parser)
    parser.set_defaults(handler=run)


def run(options: argparse.Namespace) -> int:
    """Run what is missing, draw, print."""
    from jointplay.commands import dynamics_figures
    from jointplay.host import files

    study = _study(options)
    out = files.claim(options.out, [])
    jobs = options.jobs if options.jobs is not None else _cores()
    if jobs < 1:
        raise JointplayError(f"at least one process is needed, got {jobs}")
    draw = getattr(dynamics_figures, options.kind)
    figure = draw(dynamics_figures.Job(study, options, out, jobs))
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    path = files.write(out / f"{options.kind}.png", picture.getvalue(), overwrite=True)
    print(f"written to {options.out}: {options.kind}.csv, {path.name}")
    return 0


def _study(options: argparse.Namespace) -> Study:
    """Checks all before anything runs."""
    from jointplay.analysis import nonlinear, observables
    from jointplay.scenario import Scenario
    from jointplay.scenario.settings import parse
    from jointplay.study.dynamics import Study, Varied

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
        if name not in observables.names(mechanism):
            raise observables.unknown(name, mechanism)
    if not 0.0 <= options.phase < 1.0:
        raise JointplayError(f"--phase must be in [0, 1) turns, got {options.phase:g}")
    if options.kind == "runup":
        study = replace(study, window=options.window)
        assert varied is not None
        study.run_up().windows(len(varied.values), study.window)
    else:
        nonlinear.Turning.of(simulation, study.settle, study.keep, study.records)
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
    from jointplay.analysis.observables import usual

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


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
