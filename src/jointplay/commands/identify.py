"""`jointplay identify`: clearance and friction from measurements, and what to measure."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from jointplay.commands.playing import add_robot, quantity, task
from jointplay.errors import JointplayError

REFERENCES = ("place", "frame", "ideal")


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "identify",
        help="clearance and friction of each joint from measurements; or what to measure",
        description="Clearances, friction and play of gears from measured signals, with 95 % "
        "confidence intervals, or a plain 'this measurement cannot tell' and which further "
        "measurement would. Means over stops and slow stretches are compared with the static "
        "model. With --plan: poses and motions that would tell best. docs/decisions.md says which "
        "columns a measurement has.",
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
        choices=("compliance", "friction"),
        help="identify the compliance of the gears' teeth, or the dry friction behind them, too",
    )
    group.add_argument(
        "--verify", action="store_true", help="run the scenario with what was found, and compare"
    )
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
    parser.add_argument("--out", metavar="DIR", help="folder for the table and the figure")
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    parser.set_defaults(handler=run, pose=None, workspace=None)


def run(options: argparse.Namespace) -> int:
    """Identify or plan, print, draw."""
    from jointplay.host import files

    if options.plan and options.data is not None:
        raise JointplayError("give --plan or a measurement, not both")
    if not options.plan and options.data is None:
        raise JointplayError("give a measurement (CSV), or --plan to ask what to measure")
    names = ["plan.txt"] if options.plan else ["identified.csv", "identified.png"]
    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, names)
    work = task(options)
    noise = _noise(options.noise)
    out = files.claim(options.out, names) if options.out else None
    for note in work.notes:
        print(note)
    if options.plan:
        text = str(_plan(options, work, noise))
        print(text)
        if out is not None:
            files.write(out / "plan.txt", text + "\n")
    else:
        fit = _identify(options, work, noise)
        print(fit)
        if options.verify:
            from jointplay.analysis.identify.verification import verify

            if work.simulation is None:
                raise JointplayError("--verify needs a scenario (.toml) with the measured motion")
            print(verify(work.simulation, fit, progress=not options.quiet))
        if out is not None:
            from jointplay.plots.identify import identification

            files.write(out / "identified.csv", fit.csv())
            identification(fit).savefig(out / "identified.png")
    if out is not None:
        print(f"written to {options.out}: {', '.join(names)}")
    return 0


def _plan(options: argparse.Namespace, work: Any, noise: dict[str, float]) -> Any:
    from jointplay.analysis.identify import plan_measurement
    from jointplay.analysis.identify.planning import PUSH_N

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
    )


def _identify(options: argparse.Namespace, work: Any, noise: dict[str, float]) -> Any:
    from jointplay.analysis.identify import identify

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
    )


def _noise(entries: list[str]) -> dict[str, float]:
    """Standard deviations by kind of signal [SI]."""
    from jointplay.analysis.identify.reading import JOINT_UNITS, TOOL_UNITS

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
