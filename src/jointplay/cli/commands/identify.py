"""`jointplay identify`: how large is my play? From measurements, or what to measure.

Identify clearances, friction and gear play from measured signals, with 95 % confidence intervals,
or state that this measurement cannot determine a value and which further measurement would. Means
over stops and slow stretches are compared with the static model; readings of a dial gauge tell the
play of single joints. With --plan: the most informative poses and motions; with --against: what has
changed since an earlier measurement. Axes of a printer or a mill moved forth and back under a dial
need no robot: jointplay identify stairs.csv. docs/identify.md lists the columns of a measurement.

Example: jointplay identify my_robot.toml measured.csv --out worn
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.pairs import misread, pair
from jointplay.base.schema import one_of
from jointplay.base.tables import few
from jointplay.cli.commands import (
    Outputs,
    given,
    inputs,
    numbers_by_name,
    print_answer,
    write_preset,
    write_robot,
)
from jointplay.cli.commands.inputs import (
    PosedMachine,
    is_scenario,
    named_joints,
    posed_machine,
)
from jointplay.cli.options import FORCE, REPEATED, Parser, listed, quantity

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.presets import Preset

PLANS = ("motion", "dial", "lost-motion")
OF_MOTIONS = (
    *("known", "also", "known_stiffness", "lag", "signal", "source", "map", "episode", "world"),
)
"""Options that readings of a dial gauge have no use for."""
OUTPUTS = ("write_preset", "urdf", "mjcf")
OF_AXES = (
    *("command", "path", "place", "data", "noise", "reference", "drift", "count"),
    *("formats", "out", "json", "detail", "quiet"),
)
"""Options of axes without a robot, and those that have a value in any case."""
LOOPS = "loops.png"
OF_JOINTS = ["identified.csv", "identified.json", LOOPS]
_KINDS = {True: "a table of a dial gauge", False: "a measurement in motion"}
"""What was measured, by whether it is readings."""


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", "joints with clearance", "gears", "drive", "motion",
        required=True)
    add = parser.add_argument
    add("data", metavar="DATA", nargs="?", help="measurement: CSV with columns such as 'time [s]', "
        "'tool x [mm]'; ROS 2 bag (.mcap or its folder); folder of a LeRobot dataset")
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
    add("--pose", **REPEATED, metavar="JOINT=X,...", help="readings of a dial gauge: pose in which "
        "they were taken")
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
    add("--plan", nargs="?", metavar="KIND", const="motion", help="propose what to measure: "
        "motion, poses and motions of the robot; dial, where to set a dial gauge and how to push; "
        "lost-motion, moves forth and back under a dial, without forces")
    add("--signal", choices=("tool", "link", "torque"), **REPEATED, help="signal that can be "
        "measured besides the motors' encoders; by default tool")
    add("--count", metavar="N", type=int, default=6, help="number of experiments to choose")
    add("--push", **FORCE, help="force with which the tool can be pushed; 0: none (default: 20)")
    add("--out", metavar="DIR", help="folder for the tables (CSV, JSON) and the figure")
    add("--write-preset", metavar="FILE", help="write the robot's joints with what was identified, "
        "for --preset FILE of every command")
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
        _refuse_robots_options(options)
        return _lost_motion(options)
    if (options.plan is None) == (options.data is None):
        raise JointplayError(
            "give a measurement (CSV, bag or dataset), or --plan to ask what to measure"
            + ("; not both" if options.plan else "")
        )
    for name in OUTPUTS:
        if (path := getattr(options, name)) is not None:
            option = f"--{name.replace('_', '-')}"
            if options.plan:
                raise JointplayError(f"{option} needs a measurement, not --plan")
            if options.against:
                raise JointplayError(f"{option} is of one measurement, --against of two")
            files.check_new(Path(path))
    if options.plan and options.against:
        raise JointplayError("--plan is for a measurement to come, --against of two")
    if options.plan and options.plan not in PLANS:
        raise JointplayError(one_of("--plan", options.plan, PLANS))
    if options.against:
        return _changes(options)
    if options.plan == "lost-motion":
        return _plan_lost_motion(options)
    if options.data is not None and is_readings(options.data) and is_stairs(options.data):
        return _lost_motion(options)
    if options.formats:
        raise JointplayError("--formats are of lost motion: moves under a dial, without forces")
    if options.plan == "dial" or (options.data is not None and is_readings(options.data)):
        return _gauge(options)
    if options.plan:
        return _plan(options)
    names = ["identified.csv", "identified.json", "identified.png", LOOPS]
    out = Outputs(options.out, names)
    data = _recording(options, options.data)
    posed = posed_machine(options)
    machine, about = _of_motion(options, posed)
    out.claim()
    from jointplay.estimate import identify

    fit = identify(machine, data, **about)
    notes = list(posed.notes)
    if options.gear and posed.simulation is None:
        notes.append(
            "note: gears of --gear have no stiffness of their own; unless --known-stiffness gives "
            "it, it is sought from that of the rule on"
        )
    notes = [*fit.notes, *notes]
    found = replace(fit, notes=())
    print_answer(
        fit.sentence, found, notes, options, data=lambda: fit.describe() | {"values": posed.values}
    )
    _write_robot(options, fit.preset(_place(options), posed.simulation), fit.mechanism)
    if options.out:
        from jointplay.show.plots.design import identification, reversal_loops

        said = json.dumps(fit.describe(), indent=1) + "\n"
        contents = [fit.data.csv(), said, identification(fit)]
        contents += [reversal_loops(fit.loops, fit.estimates)] if fit.loops else []
        out.write(dict(zip(names, contents, strict=False)))
    return 0


def _plan(options: argparse.Namespace) -> int:
    """Propose poses and motions to measure."""
    out = Outputs(options.out, ["plan.txt"])
    posed = posed_machine(options)
    shared, _ = _about(options)
    out.claim()
    from jointplay.estimate import plan_measurement

    friction = None if posed.simulation is None else posed.simulation.joint_friction
    plan = plan_measurement(
        posed.mechanism,
        signals=options.signal or ["tool"],
        count=options.count,
        joint_friction=friction,
        **given(options, "push"),
        **shared,
    )
    print_answer("", plan, posed.notes, options, data=lambda: {"plan": f"{plan}".splitlines()})
    if options.out:
        out.write({"plan.txt": f"{plan}\n"})
    return 0


def _of_motion(options: argparse.Namespace, posed: PosedMachine) -> tuple[Any, dict[str, Any]]:
    """The machine that was measured in motion, and what else `identify` is told."""
    shared, lag = _about(options)
    machine: Any = posed.mechanism
    if posed.simulation is not None:
        machine = replace(posed.simulation, mechanism=machine)
    about = {"motion": posed.motion, "reference": options.reference, "drift": options.drift}
    return machine, {**about, "lag": lag, "progress": not options.quiet, **shared}


def _changes(options: argparse.Namespace) -> int:
    """Compare two measurements of the same machine."""
    from jointplay.estimate.changes import changes
    from jointplay.estimate.columns import is_readings

    paths = options.against, options.data
    for path in paths:
        if not Path(path).exists():
            raise JointplayError(f"there is no file {path!r}")
    gauged = [is_readings(path) for path in paths]
    if len(set(gauged)) > 1:
        words = [f"{path} is {_KINDS[kind]}" for path, kind in zip(paths, gauged, strict=True)]
        raise JointplayError(", and ".join(words))
    out = Outputs(options.out, ["changes.csv", "changes.json"])
    if gauged[0]:
        from jointplay.estimate.gauge import gauge_problems

        posed, about = _gauged(options)
        out.claim()
        old, new = (gauge_problems(posed.mechanism, path, **about) for path in paths)
    else:
        from jointplay.estimate.identification import identify_problem

        data = [_recording(options, path) for path in paths]
        posed = posed_machine(options)
        machine, about = _of_motion(options, posed)
        out.claim()
        old, new = ([identify_problem(machine, one, **about)] for one in data)
    found = changes(old, new)
    notes = [*found.notes, *posed.notes]
    print_answer(found.sentence, replace(found, notes=()), notes, options, data=found.describe)
    if options.out:
        said = json.dumps(found.describe(), indent=1) + "\n"
        out.write({"changes.csv": found.data.csv(), "changes.json": said})
    return 0


def _about(options: argparse.Namespace) -> tuple[dict[str, Any], float | None]:
    """What is known of the signals and the machine; how late readings are [s]."""
    from jointplay.estimate.measurement import JOINT_UNITS, TOOL_UNITS

    units = TOOL_UNITS | {kind: units[0] for kind, units in JOINT_UNITS.items()}
    lag = None if options.lag is None else _size(options.lag, "s", "--lag")
    shared: dict[str, Any] = {
        "noise": numbers_by_name(options.noise, "--noise SIGNAL=X", units),
        "also": options.also,
        "known": options.known,
        "stiffness": _stiffness(options.known_stiffness),
    }
    return shared, lag


def _gauged(options: argparse.Namespace) -> tuple[PosedMachine, dict[str, Any]]:
    """The machine, and how readings were taken: noise and pose."""
    for name in OF_MOTIONS:
        if getattr(options, name) not in (None, []):
            option = f"--{name.replace('_', '-')}"
            raise JointplayError(f"{option} is not for a dial gauge, which tells single joints")
    noise = _noise(options)
    posed = posed_machine(options, single=True)
    return posed, {"noise": noise, "pose": posed.poses.positions() if any(options.pose) else None}


def _noise(options: argparse.Namespace) -> dict[str, float]:
    """Standard deviation of readings of a dial [m or rad]."""
    return numbers_by_name(options.noise, "--noise SIGNAL=X", {"tool": "m", "link": "rad"})


def _gauge(options: argparse.Namespace) -> int:
    """Plan or take readings of a dial gauge."""
    from jointplay.estimate.gauge import identify_gauged, plan_gauge

    out = Outputs(options.out, ["plan.txt", "dial.csv"] if options.plan else OF_JOINTS)
    posed, about = _gauged(options)
    out.claim()
    if options.plan:
        joints = list(dict.fromkeys([*posed.mechanism.gears, *named_joints(options)]))
        push = given(options, "push")
        plan = plan_gauge(posed.mechanism, joints, noise=about["noise"], **push)
        print_answer("", plan, posed.notes, options, data=lambda: {"plan": f"{plan}".splitlines()})
        if options.out:
            out.write({"plan.txt": f"{plan}\n", "dial.csv": plan.csv()})
        return 0
    fit = identify_gauged(posed.mechanism, options.data, **about)
    notes = [*fit.notes, *posed.notes]
    found = replace(fit, notes=())
    print_answer(
        fit.sentence, found, notes, options, data=lambda: fit.describe() | {"values": posed.values}
    )
    if any(getattr(options, name) is not None for name in OUTPUTS):
        preset = fit.preset(_place(options))
        _write_robot(options, preset, preset.mechanism(tool=fit.mechanism.tool))
    if options.out:
        from jointplay.show.plots.design import reversal_loops

        picture = reversal_loops(fit.loops, fit.estimates)
        contents = (fit.data.csv(), json.dumps(fit.describe(), indent=1) + "\n", picture)
        out.write(dict(zip(OF_JOINTS, contents, strict=True)))
    return 0


def _plan_lost_motion(options: argparse.Namespace) -> int:
    """Propose moves forth and back."""
    from jointplay.estimate.lost_motion import plan_lost_motion

    out = Outputs(options.out, ["plan.txt", "lost_motion.csv", "lost_motion.gcode"])
    posed, _ = _gauged(options)
    out.claim()
    joints = list(dict.fromkeys([*posed.mechanism.gears, *named_joints(options)]))
    plan = plan_lost_motion(posed.mechanism, joints)
    print_answer("", plan, posed.notes, options, data=lambda: {"plan": f"{plan}".splitlines()})
    if options.out:
        files_of = {"plan.txt": f"{plan}\n", "lost_motion.csv": plan.csv()}
        out.write({**files_of, "lost_motion.gcode": plan.gcode()})
    return 0


def _refuse_robots_options(options: argparse.Namespace) -> None:
    """Refuse what says something of a robot where none is named."""
    for name, value in vars(options).items():
        if name not in OF_AXES and value not in (None, [], False):
            option = f"--{name.replace('_', '-')}"
            raise JointplayError(f"{option} is of a robot: name it before {options.data}")


def _lost_motion(options: argparse.Namespace) -> int:
    """Take readings of moves forth and back."""
    from jointplay.bridges import backlash
    from jointplay.estimate.lost_motion import axes_of_table, identify_lost_motion

    wanted = options.formats or []
    for one in wanted:
        require_known("format", one, backlash.FORMATS)
    if wanted and not options.out:
        raise JointplayError("--formats are written into a folder: give --out DIR, too")
    out = Outputs(options.out, OF_JOINTS)
    noise, pose, values = _noise(options), None, []
    if options.place is None:
        mechanism = axes_of_table(options.data)
        more = [
            "note: without a robot weight is left out: where it exceeds friction, as of an axis "
            "without counterweight, it holds the teeth to one side and no play shows"
        ]
    else:
        posed, about = _gauged(options)
        mechanism, more, pose, values = posed.mechanism, posed.notes, about["pose"], posed.values
    out.claim()
    fit = identify_lost_motion(
        mechanism, options.data, scatter=noise.get("tool", noise.get("link")), pose=pose
    )
    notes = [*fit.notes, *more]
    contents: dict[str, str] = {}
    for one in wanted:
        try:
            reversals = backlash.Reversals.of(fit.mechanism, fit.plays)
            contents |= backlash.tables(reversals, one)
            notes.append(f"note: {one} cannot say {backlash.FORMATS[one].lost}")
        except JointplayError as error:
            notes.append(f"warning: no file for {one}: {error}")
    print_answer(
        fit.sentence,
        replace(fit, notes=()),
        notes,
        options,
        data=lambda: fit.describe() | {"values": values},
    )
    if any(getattr(options, name) is not None for name in OUTPUTS):
        preset = fit.preset(_place(options))
        _write_robot(options, preset, preset.mechanism(tool=fit.mechanism.tool))
    if options.out:
        from jointplay.show.plots.design import reversal_loops

        picture = reversal_loops(fit.loops, fit.estimates)
        said = json.dumps(fit.describe(), indent=1) + "\n"
        out.write(dict(zip(OF_JOINTS, (fit.data.csv(), said, picture), strict=True)) | contents)
    return 0


def _place(options: argparse.Namespace) -> str | None:
    """The robot as it was named; None: a scenario's."""
    return None if is_scenario(options) else str(options.place)


def _write_robot(options: argparse.Namespace, preset: Preset, mechanism: Mechanism) -> None:
    """Write the robot with what was found, as far as each format that is asked for can say it."""
    if options.write_preset is not None:
        write_preset(options.write_preset, preset)
    if options.urdf is not None:
        from jointplay.bridges.urdf import to_urdf

        if not mechanism.clearance:
            raise JointplayError(
                "--urdf: no bearing has clearance, and a URDF cannot say a gear's play: --mjcf and "
                "--write-preset can"
            )
        text = to_urdf(mechanism.with_clearance(mechanism.clearance, {}))
        gears = few(list(mechanism.gears))
        left = f"; not in it: play of gears ({gears})" if gears else ""
        write_robot(options.urdf, text, {}, left)
    if options.mjcf is not None:
        from jointplay.bridges.reduced_robot import ReducedRobot, refuse_without_play
        from jointplay.bridges.reduction import is_own, reduce_all

        tilt = bool(mechanism.clearance) and not is_own(mechanism.description)
        play = [*mechanism.clearance, *mechanism.gears]
        refuse_without_play(mechanism, play, ["mjcf"], tilt)
        reductions, refused = reduce_all(mechanism, progress=not options.quiet)
        robot = ReducedRobot(mechanism, reductions, {}, ["mjcf"], tilt)
        (text,) = robot.files(Path(options.mjcf).stem).values()
        left = f"; not in it: {'; '.join(refused.values())}" if refused else ""
        words = f": play of {few([one.joint for one in reductions])}{left}"
        write_robot(options.mjcf, text, robot.meshes, words)


def _size(text: str, unit: str, option: str) -> float:
    """A quantity [SI], or inf."""
    return math.inf if text == "inf" else quantity(text, unit, option)


def _recording(options: argparse.Namespace, path: str) -> Any:
    """The bag or dataset that was measured, or the path of a CSV."""
    from jointplay.estimate.recordings import Recording, is_recording

    about = (options.source, options.map, options.episode is not None, options.world)
    if not any(about) and not is_recording(path):
        return path
    sources = _pairs(options.source, "--source SIGNAL=TOPIC, such as motor=/joint_states")
    names = _pairs(options.map, "--map JOINT=NAME")
    return Recording(path, sources, names, options.episode, tuple(options.world))


def _pairs(entries: list[str], form: str) -> dict[str, str]:
    """What stands before and after the sign of equality of a repeatable option."""
    pairs: dict[str, str] = {}
    for text in entries:
        first, second = pair(text, form)
        if first in pairs:
            raise JointplayError(f"{form.partition(' ')[0]} {first!r} appears twice")
        pairs[first] = second
    return pairs


def _stiffness(entries: list[str]) -> dict[str, tuple[float, float]]:
    """Stiffness by label and its relative standard deviation [SI]."""
    words = '--known-stiffness PART=X or "PART=X +- Y %", such as "elbow=1e5 N*m/rad"'
    given = {}
    for text in entries:
        label, value = pair(text, words)
        value, plus, part = (one.strip() for one in value.partition("+-"))
        if plus and not part.endswith("%"):
            raise misread(text, words)
        try:
            deviation = float(part.removesuffix("%")) / 100.0 if plus else 0.0
        except ValueError:
            raise misread(text, words) from None
        lengthwise = label.endswith((" radial", " axial")) or label == "tool"
        unit = "N/m" if lengthwise else "N*m/rad"
        given[label] = (_size(value, unit, f"--known-stiffness {label}"), deviation)
    return given
