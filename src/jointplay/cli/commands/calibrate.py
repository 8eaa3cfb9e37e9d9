"""`jointplay calibrate`: tell play, compliance, offsets and encoder errors apart by static poses.

Fit offsets, lengths, compliance, encoder errors and play of a robot's joints to static poses in
which its tool was measured, or was at the same unknown point several times; base and tool may be
anywhere. A cause is kept only if it improves the prediction of poses that the fit has not seen.
Each joint's play gets an interval, an upper bound, or the reason why this measurement cannot tell
it. Columns of the CSV: JOINT motor [rad], JOINT link [rad], tool x [m] (y, z), tool rx [rad] (ry,
rz: rotation vector), or marker NAME x [m], or point (names), and group (names); rows in the order
of approach.

With --plan: the most informative poses.

Example: jointplay calibrate my_robot.urdf poses.csv --tool flange --out found
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError
from jointplay.base.pairs import number, quantity, vector
from jointplay.cli import commands
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.commands.inputs import robot_named, scenario_of
from jointplay.cli.options import FLAG, MASS, REPEATED, Parser

if TYPE_CHECKING:
    from jointplay.estimate import Calibration

TABLES = ("calibration.csv", "calibration.json", "residuals.csv", "calibration.png")
ENCODERS, LOOPS = "encoders.csv", "loops.png"  # of joints with two encoders; of hysteresis loops


def _folds(text: str) -> int | str:
    folds = number(text)
    if isinstance(folds, int) or folds in ("rows", "groups", "points"):
        return folds
    raise argparse.ArgumentTypeError(f"must be a number, rows, groups or points, got {text!r}")


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", required=True)
    add = parser.add_argument
    add("csv", metavar="CSV", nargs="?", help="table of the poses")
    add("--out", metavar="DIR", help="folder for the tables (CSV, JSON) and the figure")
    add = parser.add_argument_group("robot").add_argument
    add("--point", metavar="X,Y,Z", help="nominal place of the measured point in the tool's frame, "
        'such as "0,0,0.24" [m]')
    add("--payload", **MASS, help="body that the tool carried all the time, at the measured point")
    add = parser.add_argument_group("causes").add_argument
    add("--term", metavar="TERM", **REPEATED, help='cause to try, such as "compliance", "play '
        'elbow,wrist", "rail shoulder by lift" (default: offset, placement, compliance, '
        "eccentricity, play; others: second-harmonic, sawtooth, ratio, hysteresis, link-encoder, "
        "rail, suspension; gear, bearing, seat where the scenario has one)")
    add("--always", metavar="TERM", **REPEATED, help="cause that is in every model")
    add("--link", metavar="JOINT", **REPEATED, help="joint whose encoder on the link's side is "
        "read instead of the motor's")
    add = parser.add_argument_group("fit").add_argument
    add("--folds", metavar="K", type=_folds, default="3", help="hold back every K-th row in turn, "
        "or each of the: rows, groups, points")
    add("--scatter", metavar="LENGTH[,ANGLE]", help="scatter of positions and orientations about "
        'the model, such as "2 mm, 5 mrad" (default: estimated from the residuals)')
    add = parser.add_argument_group("plan").add_argument
    add("--plan", **FLAG, help="propose in which poses to measure")
    add("--count", metavar="N", type=int, default=20, help="number of poses to choose")
    add = parser.add_argument_group("corrected robot").add_argument
    add("--urdf", metavar="FILE", help="write the robot's URDF with joints where the kept model "
        "has them")
    add("--mjcf", metavar="FILE", help="write it as MJCF; of a robot that was read of one, that "
        "one with bodies put right")
    parser.share("--write-preset", group="corrected robot")
    parser.share("--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    if options.plan == (options.csv is not None):
        message = "a table of poses (CSV), or --plan to ask where to measure"
        raise JointplayError(f"give {message}{'; not both' if options.plan else ''}")
    out = Outputs(options.out, ["plan.txt"] if options.plan else [*TABLES, ENCODERS, LOOPS])
    commands.check_measured(options, "measured poses")
    from jointplay.estimate.columns import is_readings

    if options.csv is not None and is_readings(options.csv):
        raise JointplayError(
            f"{options.csv} has readings of single joints: jointplay identify {options.place} "
            f"{options.csv}"
        )
    scatter = _scatter(options.scatter)
    point = vector(options.point or "0,0,0", "m", "--point")
    out.claim()
    from jointplay.estimate import Term, calibrate, encoder_differences, plan_calibration
    from jointplay.estimate.calibration import TERMS, read_poses
    from jointplay.estimate.unknowns import data
    from jointplay.model.payload import Payload

    terms = [Term.parse(text) for text in options.term or TERMS]
    always = [Term.parse(text) for text in options.always]
    mechanism = scenario_of(options, moves=False).mechanism(options.case)
    payloads = []
    if options.payload is not None:
        payloads = [Payload(mechanism.tool, options.payload, centre=point)]
    arguments: dict[str, Any] = {"payloads": payloads, "point": point}
    arguments |= {} if scatter is None else {"error": scatter}
    notes = []
    if mechanism.tool_reason:
        notes.append(f"tool: {mechanism.tool!r} (chosen: {mechanism.tool_reason}; see --tool)")
    if options.plan:
        plan = plan_calibration(mechanism, [*always, *terms], count=options.count, **arguments)
        print_answer("", plan, notes, options)
        out.write({"plan.txt": f"{plan}\n"})
        return 0
    contents: dict[str, Any] = {}
    fits: list[Calibration] = []
    poses = read_poses(mechanism, options.csv)
    if poses.link is not None:  # joints with two encoders: fit link less motor
        chosen = [*always, *terms] if options.term or options.always else None
        fits += encoder_differences(mechanism, poses, payloads, chosen)
        notes = [*(f"link less motor, {fit}\n" for fit in fits), *notes]
        contents[ENCODERS] = data([row for fit in fits for row in fit.rows]).csv(6)
        poses = poses.read_by_link(*options.link)
    elif options.link:
        (joint, *_) = options.link
        raise JointplayError(f"--link {joint}: {options.csv} has no column '{joint} link'")
    measured = poses.position is not None or poses.point is not None
    if not measured and not contents:
        raise JointplayError(
            f"{options.csv}: nothing measured: columns such as 'tool x [m]', "
            "'marker NAME x [m]', 'point' or 'JOINT link [rad]' are needed"
        )
    if notes and (options.detail or not measured or poses.link is not None):
        print("\n".join(notes))
        notes = []
    if measured:  # the tool's positions, or that it was at the same point
        progress = not options.quiet
        arguments |= {"always": always, "folds": options.folds, "progress": progress}
        fit = calibrate(mechanism, poses, terms, **arguments)
        if options.detail:
            print(f"{fit.sentence}\n{fit}")
        else:
            print_answer(fit.sentence, fit.brief(), [*fit.notes, *notes], options, more=True)
        if options.out:
            from jointplay.show.plots.design import calibration

            contents |= commands.describe("calibration", fit)
            contents["calibration.csv"] = fit.data.csv(6)
            contents |= {"residuals.csv": fit.residuals.csv(6), "calibration.png": calibration(fit)}
        fits.append(fit)
        _write_robot(fit, options)
    elif commands.typed(options, commands.MEASURED):
        message = "--urdf, --mjcf and --write-preset need positions of the tool, or points"
        raise JointplayError(message)
    if options.out:
        from jointplay.show.plots.design import reversal_loops

        # Where a joint has two encoders their difference shows the loop best: later entries win.
        loops = {loop.joint: (loop, fit.play) for fit in fits[::-1] for loop in fit.loops}
        if loops:
            plays = [p for loop, play in loops.values() for p in play if p.plays(loop.joint)]
            contents[LOOPS] = reversal_loops([loop for loop, _ in loops.values()], plays)
        out.write(contents)
    return 0


def _write_robot(fit: Calibration, options: argparse.Namespace) -> None:
    """Write the files of the corrected robot that are asked for, and print what each contains."""
    for path in filter(None, (options.urdf, options.mjcf)):
        from jointplay.bridges.measured_robot import write_corrected

        print(f"written: {path}{write_corrected(fit, Path(path), path == options.mjcf)}")
    if options.write_preset is not None:
        commands.write_preset(options.write_preset, fit.preset(robot_named(options)))


def _scatter(text: str | None) -> tuple[float, float] | None:
    """Scatter of positions [m] and orientations [rad], of --scatter; None: to be estimated."""
    if text is None:
        return None
    length, _, angle = text.partition(",")
    sizes = quantity(length.strip(), "m", "--scatter"), 1.0
    if angle:
        sizes = sizes[0], quantity(angle.strip(), "rad", "--scatter")
    if min(sizes) <= 0.0:
        raise JointplayError(f"--scatter must be positive, got {text!r}")
    return sizes
