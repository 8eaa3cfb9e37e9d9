"""`jointplay identify`: clearance and friction from measurements, and what to measure."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from typing import Any

from jointplay.commands import add_jobs, add_quiet
from jointplay.commands.mechanism import add_robot, quantity, task
from jointplay.core.errors import JointplayError

REFERENCES = ("place", "frame", "ideal")
DRIFT = 3
RUNS = 40
VERIFYING = 6
"""Runs by which restitution is sought, and with which a measurement is compared."""


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "identify",
        help="clearance, friction, restitution of each joint from measurements; or what to measure",
        description="Clearances, friction, play of gears and restitution from measured signals, "
        "with 95 % confidence intervals, or a plain 'this measurement cannot tell' and which "
        "further measurement would. Means over stops and slow stretches are compared with the "
        "static model, impacts (of an accelerometer or of forces in bearings) by their statistics. "
        "With --plan: poses and motions that would tell best. docs/identify.md says which columns "
        "a measurement has.",
        epilog="Example: jointplay identify my_robot.toml measured.csv --out worn",
    )
    add_robot(parser)
    parser.add_argument(
        "data", nargs="?", metavar="CSV", help="columns such as 'time [s]', 'tool x [mm]'"
    )
    group = parser.add_argument_group("measurement")
    group.add_argument(
        "--motion", metavar="CSV", help="reference of the joints without encoder, if no scenario"
    )
    group.add_argument(
        "--reference",
        choices=REFERENCES,
        default=REFERENCES[0],
        help="what is known of the tool's ideal place: nothing, but the same at each visit of a "
        "place (default); all but where the tracker's frame lies; all (calibrated)",
    )
    group.add_argument(
        "--noise",
        action="append",
        default=[],
        metavar="SIGNAL=X",
        help='standard deviation of a record, "tool=20 um" (repeatable; default: of the records)',
    )
    group.add_argument(
        "--known",
        action="append",
        default=[],
        metavar="UNKNOWN",
        help='taken from the scenario, such as "friction" or "elbow radial clearance" (repeatable)',
    )
    group.add_argument(
        "--also",
        action="append",
        default=[],
        choices=("friction",),
        help="identify the dry friction behind all gears, not only where the scenario has some",
    )
    group.add_argument(
        "--stiffness",
        action="append",
        default=[],
        metavar="PART=X[+-Y%]",
        help='of what is known, such as "elbow=1e5 N*m/rad" (about its axis, of the gear if there '
        'is one), "elbow radial=2e8 N/m +- 20 %%", "tool=1e6 N/m", "elbow=inf" (rigid), "all=inf" '
        "(but gears); what is not given is unknown (repeatable)",
    )
    group.add_argument(
        "--drift",
        type=int,
        default=DRIFT,
        metavar="N",
        help="degree of the polynomial in time by which readings may drift (default "
        f"{DRIFT}; 0: they do not)",
    )
    _add_simulated(parser)
    _add_plan(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for tables (CSV, JSON) and figure")
    add_quiet(parser)
    parser.set_defaults(pose=None, workspace=None)


def _add_simulated(parser: Any) -> None:
    group = parser.add_argument_group("by simulated runs of the scenario")
    group.add_argument(
        "--restitution",
        type=int,
        nargs="?",
        const=RUNS,
        default=0,
        metavar="RUNS",
        help="where flights do not tell restitution: by the statistics of the impacts of so many "
        f"runs (default {RUNS})",
    )
    group.add_argument(
        "--verify",
        type=int,
        nargs="?",
        const=VERIFYING,
        default=0,
        metavar="RUNS",
        help="run the scenario with what was found, and say whether its statistics are those of "
        f"the measurement, within the scatter of so many runs (default {VERIFYING})",
    )
    add_jobs(group)


def _add_plan(parser: Any) -> None:
    group = parser.add_argument_group("plan")
    group.add_argument("--plan", action="store_true", help="say what to measure")
    group.add_argument(
        "--signal",
        action="append",
        choices=("tool", "link", "torque"),
        help="that can be measured besides the motors' encoders (repeatable; default: tool)",
    )
    group.add_argument(
        "--count", type=int, default=6, metavar="N", help="experiments to choose (default 6)"
    )
    group.add_argument(
        "--push", metavar="FORCE", help="with which the tool can be pushed (20 N; 0: not at all)"
    )


def run(options: argparse.Namespace) -> int:
    """Identify or plan, print, draw."""
    from jointplay.core import files, processes

    if options.plan and options.data is not None:
        raise JointplayError("give --plan or a measurement, not both")
    processes.number_of(options.jobs)
    if not options.plan and options.data is None:
        raise JointplayError("give a measurement (CSV), or --plan to ask what to measure")
    names = ["identified.csv", "identified.json", "identified.png"]
    names = ["plan.txt"] if options.plan else names
    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, names)
    work = task(options)
    if (options.verify or options.restitution) and work.simulation is None:
        option = "--verify" if options.verify else "--restitution"
        raise JointplayError(f"{option} needs a scenario (.toml) with the measured motion")
    noise = _noise(options.noise)
    out = files.claim(options.out, names) if options.out else None
    if options.plan:
        text = str(_plan(options, work, noise))
        print("\n".join([*work.notes, text]))
        if out is not None:
            files.write(out / "plan.txt", text + "\n")
    else:
        fit = _identify(options, work, noise)
        notes = list(work.notes)
        if options.gear and work.simulation is None:
            notes.append(
                "note: gears of --gear have no stiffness of their own; unless --stiffness gives "
                "it, it is sought from 1e+04 N m/rad on"
            )
        print("\n".join([*notes, str(fit)]))
        found = fit.describe()
        if options.verify and work.simulation is not None:
            from jointplay.identification.verification import verify

            checked = verify(
                work.simulation,
                fit,
                runs=options.verify,
                jobs=options.jobs,
                progress=not options.quiet,
            )
            print(checked)
            found["verification"] = checked.describe()
        if out is not None:
            from jointplay.plots.design import identification

            files.write(out / "identified.csv", fit.csv())
            files.write(out / "identified.json", json.dumps(found, indent=1) + "\n")
            files.picture(out / "identified.png", identification(fit))
    if out is not None:
        print(f"written to {options.out}: {', '.join(names)}")
    return 0


def _plan(options: argparse.Namespace, work: Any, noise: dict[str, float]) -> Any:
    from jointplay.identification import plan_measurement
    from jointplay.identification.planning import PUSH_N

    friction = None if work.simulation is None else work.simulation.joint_friction
    return plan_measurement(
        work.mechanism,
        signals=options.signal or ["tool"],
        noise=noise,
        count=options.count,
        push=PUSH_N if options.push is None else quantity(options.push, "N", "--push"),
        joint_friction=friction,
        also=options.also,
        known=options.known,
        stiffness=_stiffness(options.stiffness),
    )


def _identify(options: argparse.Namespace, work: Any, noise: dict[str, float]) -> Any:
    from jointplay.identification import identify

    machine = work.mechanism
    if work.simulation is not None:
        machine = replace(work.simulation, mechanism=work.mechanism)
    return identify(
        machine,
        options.data,
        motion=work.motion,
        reference=options.reference,
        noise=noise,
        also=options.also,
        known=options.known,
        stiffness=_stiffness(options.stiffness),
        drift=options.drift,
        runs=options.restitution,
        jobs=options.jobs,
        progress=not options.quiet,
    )


def _stiffness(entries: list[str]) -> dict[str, tuple[float, float]]:
    """Stiffness by label and its relative standard deviation [SI]."""
    given = {}
    for text in entries:
        label, equals, value = (part.strip() for part in text.partition("="))
        value, plus, part = (one.strip() for one in value.partition("+-"))
        try:
            deviation = float(part.removesuffix("%")) / 100.0 if plus else 0.0
        except ValueError:
            equals = ""
        if not equals or (plus and not part.endswith("%")):
            raise JointplayError(
                f'--stiffness must read PART=X or "PART=X +- Y %", such as "elbow=1e5 N*m/rad", '
                f"got {text!r}"
            )
        lengthwise = label.endswith((" radial", " axial")) or label == "tool"
        unit = "N/m" if lengthwise else "N*m/rad"
        size = math.inf if value == "inf" else quantity(value, unit, f"--stiffness {label}")
        given[label] = (size, deviation)
    return given


def _noise(entries: list[str]) -> dict[str, float]:
    """Standard deviations by kind of signal [SI]."""
    from jointplay.identification.measurement import JOINT_UNITS, TOOL_UNITS

    units = {**TOOL_UNITS, **{kind: units[0] for kind, units in JOINT_UNITS.items()}}
    deviations = {}
    for text in entries:
        kind, equals, value = text.partition("=")
        if not equals or kind not in units:
            raise JointplayError(
                f"--noise must read SIGNAL=X with a signal of {', '.join(units)}, got {text!r}"
            )
        deviations[kind] = quantity(value, units[kind], f"--noise {kind}")
    return deviations
