"""`jointplay identify`: how large is my play? From measurements, or what to measure.

Identify clearances, friction and gear play from measured signals, with 95 % confidence intervals,
or state that this measurement cannot determine a value and which further measurement would. Means
over stops and slow stretches are compared with the static model; readings of a dial gauge tell the
play of single joints. With --plan: the most informative poses and motions; with --against: what has
changed since an earlier measurement. Axes of a printer or a mill moved back and forth under a dial
need no robot: jointplay identify stairs.csv. docs/identify.md lists the columns of a measurement.

Example: jointplay identify my_robot.toml measured.csv --out worn
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError
from jointplay.base.pairs import numbers_by_name, pairs, quantity
from jointplay.cli import commands
from jointplay.cli.commands import Outputs, given, inputs, print_answer
from jointplay.cli.commands.inputs import named_joints, posed_machine, robot_named
from jointplay.cli.options import FORCE, REPEATED, Parser, listed

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.posed import PosedMachine
    from jointplay.scenario.presets import Preset

OF_MOTIONS = (
    *("known", "also", "known_stiffness", "lag", "signal", "source", "map", "episode", "world"),
)
"""Options for measurements in motion, which readings of a dial gauge refuse."""
OF_AXES = (
    *("command", "path", "place", "data", "noise", "reference", "drift", "count"),
    *("formats", "out", "json", "detail", "quiet"),
)
"""Options for axes without a robot, and those that always have a value."""
LOOPS = "loops.png"


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", "joints with clearance", "gears", "drive", "motion",
        required=True)
    add = parser.add_argument
    add("data", metavar="DATA", nargs="?", help="measurement: CSV with columns such as 'time [s]', "
        "'tool x [mm]'; ROS 2 bag (.mcap or its folder); folder of a LeRobot dataset")
    add("--out", metavar="DIR", help="folder for the tables (CSV, JSON) and the figure")
    add = parser.add_argument_group("measurement").add_argument
    add("--against", metavar="OLD", help="earlier measurement of the same machine: states how each "
        "play has changed, both compared as one")
    add("--reference", choices=("place", "frame", "ideal"), default="place", help="what is known "
        "of the tool's ideal position: place: only that it is the same at each visit; frame: "
        "everything except the pose of the tracker's frame; ideal: everything, calibrated")
    add("--noise", metavar="SIGNAL=X", **REPEATED, help="standard deviation of a record, such as "
        '"tool=20 um"; by default estimated from the records')
    add("--known", metavar="UNKNOWN", **REPEATED, help="unknown to take from the scenario instead, "
        'such as "friction" or "elbow radial clearance"')
    add("--also", choices=("friction", "stiffness", "hysteresis"), **REPEATED, help="identify the "
        "dry friction on the joint's side of every gear, or its hysteresis, not only where the "
        "scenario has some; stiffness: of rolling bearings' elements, and of each piece of a "
        "gear's curve (K1, K2, K3)")
    add("--known-stiffness", metavar="PART=X[+-Y%]", **REPEATED, help='such as "elbow=1e5 N*m/rad" '
        '(about its axis, of the gear if there is one), "elbow radial=2e8 N/m +- 20 %", "tool=1e6 '
        'N/m", "elbow=inf" (rigid), "all=inf" (except gears); stiffnesses that are not given are '
        "unknown")
    add("--drift", metavar="N", type=int, default=3, help="degree of the polynomial in time by "
        "which readings may drift; 0: no drift")
    add("--lag", metavar="TIME|inf", help="about how late readings of the tool, and of links, may "
        "be behind the motors' encoders [s]; 0: simultaneous, inf: unknown (default: 0, of bags "
        "and datasets inf)")
    add("--pose", **REPEATED, metavar="JOINT=X,...", help="pose in which readings of a dial gauge "
        "were taken")
    add = parser.add_argument_group("bags and datasets").add_argument
    add("--source", metavar="SIGNAL=TOPIC", **REPEATED, help="topic of a bag that has a signal, or "
        'feature of a dataset and its unit: "motor=/joint_states", "tool=/tracker/pose", '
        '"link=observation.state [deg]"; signals are motor, link, torque, tool and force; without '
        "the option, the error lists what there is")
    add("--map", metavar="JOINT=NAME", **REPEATED, help="recorded name of a joint (or axis x, y, "
        'z), with a sign, factor and offset: "elbow=joint_3", "elbow=-elbow_flex.pos + 90 deg"')
    add("--episode", metavar="N", type=int, help="episode of a dataset, counted from 0")
    add("--world", metavar="FRAME", **REPEATED, help="frame of a bag whose axes are those of the "
        "robot's base")
    add = parser.add_argument_group("plan").add_argument
    add("--plan", nargs="?", metavar="KIND", const="motion", choices=("motion", "dial",
        "lost-motion"), help="propose what to measure: motion, poses and motions of the robot; "
        "dial, where to set a dial gauge and how to push; lost-motion, moves back and forth under "
        "a dial, without forces")
    add("--signal", choices=("tool", "link", "torque"), **REPEATED, help="signal that can be "
        "measured besides the motors' encoders; by default tool")
    add("--count", metavar="N", type=int, default=6, help="number of experiments to choose")
    add("--push", **FORCE, help="force with which the tool can be pushed; 0: none (default: 20)")
    parser.share("--write-preset", group="measured robot")
    add = parser.add_argument_group("measured robot").add_argument
    add("--formats", type=listed, metavar="LIST", help="lost motion, for firmware, in DIR: marlin, "
        "linuxcnc, grblhal, klipper, smoothieware")
    add("--urdf", metavar="FILE", help="write its URDF with the clearance of bearings as chains of "
        "joints")
    add("--mjcf", metavar="FILE", help="write it as MJCF, play as dead bands and tilts (export "
        "simulator has more)")
    parser.share("--json", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.estimate.columns import is_readings, is_stairs

    if not (options.plan or options.data) and options.place and is_readings(options.place):
        options.place, options.data = None, options.place
        if not is_stairs(options.data):
            raise JointplayError(
                f"{options.data} has forces, which bend a robot: name the robot before it"
            )
        for option in commands.typed(options, [x for x in vars(options) if x not in OF_AXES]):
            raise JointplayError(f"{option} is of a robot: name it before {options.data}")
        _readings(options, True)
        return 0
    if (options.plan is None) == (options.data is None):
        also = "; not both" if options.plan else ""
        if (options.preset or "").endswith(".csv"):
            also = f"; --preset took {options.preset!r}"
        raise JointplayError(
            f"give a measurement (CSV, bag or dataset), or --plan to ask what to measure{also}"
        )
    commands.check_measured(options, "a measurement")
    if options.against:
        _changes(options)
        return 0
    gauged = options.data is not None and is_readings(options.data)
    stairs = gauged and is_stairs(options.data)
    if options.formats and not stairs:
        raise JointplayError("--formats are of lost motion: moves under a dial, without forces")
    if options.plan:
        _plan(options)
    elif gauged:
        _readings(options, stairs)
    else:
        _motion(options)
    return 0


def _plan(options: argparse.Namespace) -> None:
    """Propose what to measure: motions, places of a dial gauge, or moves to and fro under one."""
    further = {"dial": ["dial.csv"], "lost-motion": ["lost_motion.csv", "lost_motion.gcode"]}
    out = Outputs(options.out, ["plan.txt", *further.get(options.plan, [])])
    posed, known = (
        (posed_machine(options), _known(options)) if options.plan == "motion" else _gauged(options)
    )
    out.claim()
    joints = list(dict.fromkeys([*posed.mechanism.gears, *named_joints(options)]))
    push, contents = given(options, "push"), {}
    plan: Any
    if options.plan == "motion":
        from jointplay.estimate import plan_measurement

        friction = None if posed.simulation is None else posed.simulation.joint_friction
        plan = plan_measurement(
            posed.mechanism, signals=options.signal or ["tool"], count=options.count,
            joint_friction=friction, **push, **known,
        )  # fmt: skip
    elif options.plan == "dial":
        from jointplay.estimate.gauge import plan_gauge

        plan = plan_gauge(posed.mechanism, joints, noise=known["noise"], **push)
        contents = {"dial.csv": plan.csv()}
    else:
        from jointplay.estimate.lost_motion import plan_lost_motion

        plan = plan_lost_motion(posed.mechanism, joints)
        contents = {"lost_motion.csv": plan.csv(), "lost_motion.gcode": plan.gcode()}
    print_answer("", plan, posed.notes, options, data=lambda: {"plan": f"{plan}".splitlines()})
    out.write({"plan.txt": f"{plan}\n", **contents})


def _motion(options: argparse.Namespace) -> None:
    """Identify from signals over time: a CSV, a bag or a dataset."""
    names = ["identified.csv", "identified.json", "identified.png", LOOPS]
    out = Outputs(options.out, names)
    data = _recording(options, options.data)
    posed = posed_machine(options)
    machine, known = _of_motion(options, posed)
    out.claim()
    from jointplay.estimate import identify

    fit = identify(machine, data, **known)
    notes = list(posed.notes)
    if options.gear and posed.simulation is None:
        notes.append(
            "note: gears of --gear have no stiffness of their own; unless --known-stiffness gives "
            "it, it is sought from that of the rule on"
        )
    _answer(fit, posed, notes, options)
    _write_robot(options, fit.preset(robot_named(options), posed.simulation), fit.mechanism)
    if options.out:
        from jointplay.show.plots.design import identification, reversal_loops

        contents = commands.describe("identified", fit) | {"identified.png": identification(fit)}
        loops = {LOOPS: reversal_loops(fit.loops, fit.estimates)} if fit.loops else {}
        out.write(contents | loops)


def _readings(options: argparse.Namespace, stairs: bool) -> None:
    """Identify from a dial gauge's readings, under forces or at reversals of a joint (`stairs`)."""
    from jointplay.bridges import backlash

    formats = options.formats or []
    backlash.refuse_unwritten(formats, backlash.FORMATS, options.out)
    out = Outputs(options.out, ["identified.csv", "identified.json", LOOPS])
    posed, known = _gauged(options) if options.place else (None, {"noise": _noise(options)})
    out.claim()
    fit: Any
    notes, further = [] if posed is None else list(posed.notes), dict[str, str]()
    if stairs:
        from jointplay.estimate.lost_motion import WEIGHTLESS, axes_of_table, identify_lost_motion

        mechanism = axes_of_table(options.data) if posed is None else posed.mechanism
        noise = known["noise"].get("tool", known["noise"].get("link"))
        fit = identify_lost_motion(mechanism, options.data, scatter=noise, pose=known.get("pose"))
        reversals = backlash.Reversals.of(fit.mechanism, fit.plays)
        further, lost = backlash.tables_of(reversals, formats)
        notes += [*([WEIGHTLESS] if posed is None else []), *lost]
    else:
        from jointplay.estimate.gauge import identify_gauged

        assert posed is not None
        fit = identify_gauged(posed.mechanism, options.data, progress=not options.quiet, **known)
    _answer(fit, posed, notes, options)
    if commands.typed(options, commands.MEASURED):
        preset = fit.preset(robot_named(options))
        _write_robot(options, preset, preset.mechanism(tool=fit.mechanism.tool))
    if options.out:
        from jointplay.show.plots.design import reversal_loops

        loops = {LOOPS: reversal_loops(fit.loops, fit.estimates)}
        out.write(commands.describe("identified", fit) | loops | further)


def _answer(
    fit: Any, posed: PosedMachine | None, notes: list[str], options: argparse.Namespace
) -> None:
    """Print what was identified."""
    print_answer(
        fit.sentence,
        replace(fit, notes=()),
        [*fit.notes, *notes],
        options,
        data=lambda: fit.describe() | {"values": [] if posed is None else posed.values},
    )


def _changes(options: argparse.Namespace) -> None:
    """Compare two measurements of the same machine."""
    from jointplay.estimate.changes import changes
    from jointplay.estimate.columns import is_readings

    for option in commands.typed(options, commands.MEASURED):
        raise JointplayError(f"{option} is of one measurement, --against of two")
    if options.plan:
        raise JointplayError("--plan is for a measurement to come, --against of two")
    paths = options.against, options.data
    for path in paths:
        if not Path(path).exists():
            raise JointplayError(f"there is no file {path!r}")
    gauged = [is_readings(path) for path in paths]
    if len(set(gauged)) > 1:
        kinds = {True: "a table of a dial gauge", False: "a measurement in motion"}
        kinds_given = [f"{path} is {kinds[kind]}" for path, kind in zip(paths, gauged, strict=True)]
        raise JointplayError(", and ".join(kinds_given))
    out = Outputs(options.out, ["changes.csv", "changes.json"])
    if gauged[0]:
        from jointplay.estimate.gauge import gauge_problems

        posed, known = _gauged(options)
        out.claim()
        old, new = (gauge_problems(posed.mechanism, path, **known) for path in paths)
    else:
        from jointplay.estimate.identification import identify_problem

        recordings = [_recording(options, path) for path in paths]
        posed = posed_machine(options)
        machine, known = _of_motion(options, posed)
        out.claim()
        old, new = ([identify_problem(machine, data, **known)] for data in recordings)
    changed = changes(old, new, progress=not options.quiet)
    notes = [*changed.notes, *posed.notes]
    print_answer(
        changed.sentence, replace(changed, notes=()), notes, options, data=changed.describe
    )
    out.write(commands.describe("changes", changed))


def _known(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of an identification on what is known: noise, parameters, stiffnesses."""
    from jointplay.estimate.identification import read_stiffness
    from jointplay.estimate.measurement import JOINT_UNITS, TOOL_UNITS

    units = TOOL_UNITS | {kind: units[0] for kind, units in JOINT_UNITS.items()}
    return {
        "noise": numbers_by_name(options.noise, "--noise SIGNAL=X", units),
        "also": options.also,
        "known": options.known,
        "stiffness": read_stiffness(options.known_stiffness),
    }


def _of_motion(options: argparse.Namespace, posed: PosedMachine) -> tuple[Any, dict[str, Any]]:
    """The machine that was measured in motion, and the further arguments of `identify`."""
    machine: Any = posed.mechanism
    if posed.simulation is not None:
        machine = replace(posed.simulation, mechanism=machine)
    lag = options.lag
    if lag is not None:
        lag = math.inf if lag == "inf" else quantity(lag, "s", "--lag")
    known = {"motion": posed.motion, "reference": options.reference, "drift": options.drift}
    return machine, {**known, "lag": lag, "progress": not options.quiet, **_known(options)}


def _noise(options: argparse.Namespace) -> dict[str, float]:
    """Standard deviations of a dial gauge's readings, by signal [m or rad]."""
    return numbers_by_name(options.noise, "--noise SIGNAL=X", {"tool": "m", "link": "rad"})


def _gauged(options: argparse.Namespace) -> tuple[PosedMachine, dict[str, Any]]:
    """The machine under a dial gauge, and the noise and pose of the readings."""
    for option in commands.typed(options, OF_MOTIONS):
        raise JointplayError(f"{option} is not for a dial gauge, which tells single joints")
    posed = posed_machine(options, single=True)
    return posed, {
        "noise": _noise(options),
        "pose": posed.poses.positions() if any(options.pose) else None,
    }


def _write_robot(options: argparse.Namespace, preset: Preset, mechanism: Mechanism) -> None:
    """Write the robot with its identified play, in each format as far as the format can hold it."""
    if options.write_preset is not None:
        commands.write_preset(options.write_preset, preset)
    if options.urdf is None and options.mjcf is None:
        return
    from jointplay.bridges.measured_robot import write_play_mjcf, write_play_urdf

    if options.urdf is not None:
        print(f"written: {options.urdf}{write_play_urdf(mechanism, Path(options.urdf))}")
    if options.mjcf is not None:
        has = write_play_mjcf(mechanism, Path(options.mjcf), not options.quiet)
        print(f"written: {options.mjcf}{has}")


def _recording(options: argparse.Namespace, path: str) -> Any:
    """The bag or dataset that was measured, or the path of a CSV."""
    from jointplay.estimate.recordings import Recording, is_recording

    about = (options.source, options.map, options.episode is not None, options.world)
    if not any(about) and not is_recording(path):
        return path
    sources = pairs(options.source, "--source SIGNAL=TOPIC, such as motor=/joint_states")
    names = pairs(options.map, "--map JOINT=NAME")
    return Recording(path, sources, names, options.episode, tuple(options.world))
