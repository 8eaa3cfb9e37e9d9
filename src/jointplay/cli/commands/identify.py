"""`jointplay identify`: clearance and friction from measurements, or what to measure.

Identify clearances, friction, gear play and restitution from measured signals, with 95 % confidence
intervals, or state that this measurement cannot determine a value and which further measurement
would. Means over stops and slow stretches are compared with the static model, impacts (of an
accelerometer or of forces in bearings) by their statistics; readings of a dial gauge tell the play
of single joints. With --plan: the most informative poses and motions; with --against: what has
changed since earlier measurements. docs/identify.md lists the columns of a measurement.

Example: jointplay identify my_robot.toml measured.csv --out worn

    FILE | ROBOT  robot, joints with clearance, gears, motion
    [DATA]  measurement: CSV with columns such as 'time [s]', 'tool x [mm]'; ROS 2 bag (.mcap or its
        folder); folder of a LeRobot dataset
  measurement:
    --reference {place,frame,ideal}  what is known of the tool's ideal position: place: only that it
        is the same at each visit; frame: everything except the pose of the tracker's frame; ideal:
        everything, calibrated (default place)
    --noise SIGNAL=X ...  standard deviation of a record, such as "tool=20 um"; by default estimated
        from the records
    --known UNKNOWN ...  unknown to take from the scenario instead, such as "friction" or "elbow
        radial clearance"
    --also {friction,stiffness,hysteresis} ...  identify the dry friction on the joint's side of
        every gear, or its hysteresis, not only where the scenario has some; stiffness: of rolling
        bearings' elements, and of each piece of a gear's curve (K1, K2, K3)
    --stiffness PART=X[+-Y%] ...  known stiffness, such as "elbow=1e5 N*m/rad" (about its axis, of
        the gear if there is one), "elbow radial=2e8 N/m +- 20 %", "tool=1e6 N/m", "elbow=inf"
        (rigid), "all=inf" (except gears); stiffnesses that are not given are unknown
    --drift N  degree of the polynomial in time by which readings may drift; 0: no drift (default 3)
    --lag TIME|inf  about how late readings of the tool, and of links, may be behind the motors'
        encoders [s]; 0: simultaneous, inf: unknown (default: 0, of bags and datasets inf)
    --pose JOINT=X,...  readings of a dial gauge: pose in which they were taken
    --encoder {output,motor}  wiggle: the side of the gears on which the servos' encoders sit
        (default: where the preset says it)
  bags and datasets:
    --source SIGNAL=TOPIC ...  topic of a bag that has a signal, or feature of a dataset and its
        unit: "motor=/joint_states", "tool=/tracker/pose", "link=observation.state [deg]", "elbow
        reaction=/load_cell"; signals are motor, link, torque, tool, force, acceleration and, of one
        joint, reaction; of wiggled servos goal and position; without the option, the error lists
        what there is
    --map JOINT=NAME ...  recorded name of a joint (or axis x, y, z), with a sign, factor and
        offset: "elbow=joint_3", "elbow=-elbow_flex.pos + 90 deg"
    --episode N  episode of a dataset, counted from 0
    --world FRAME ...  frame of a bag whose axes are those of the robot's base
  watch:
    --against DATA ...  earlier measurements of the same machine, oldest first, or a folder of them;
        dates in their names count, such as elbow-2026-03-01.csv: states how each play changed
        and grows, all compared as one; exit status 3 is an alarm
    --limit PLAY=X ...  alarm if "elbow gear play=0.2 deg" or "elbow gear play change=0.1 deg" is
        surely exceeded (default: if any play has surely grown)
    --target LENGTH  largest error of the tool: alarm if play surely lets it be further off, in the
        pose or along the motion
    --ahead N  alarm also if a limit or the target is expected to be reached within N days, or
        recordings where names have no dates
  by simulated runs of the scenario:
    --runs [RUNS=40]  where flights do not determine restitution, fit the impact statistics with
        this many runs (40 if no number is given)
    --verify [RUNS=6]  run the scenario with the identified values and check that its statistics
        agree with the measurement's, within the scatter of this many runs (6 if no number is given)
    --jobs
  plan:
    --plan [KIND=motion]  propose what to measure: motion, poses and motions of the robot; dial,
        where to set a dial gauge and how to push; wiggle, a motion in which servos themselves tell
        the play of their joints, written by --out as CSV, for ROS 2 and for LeRobot's bus
    --signal {tool,link,torque} ...  signal that can be measured besides the motors' encoders; by
        default tool
    --count N  number of experiments to choose (default 6)
    --push FORCE  force with which the tool can be pushed; 0: none (default: 20)
    --out DIR  folder for the tables (CSV, JSON) and the figure
    --write-preset FILE  write the robot's joints with what was identified, for --preset FILE of
        every command
    --urdf FILE  write its URDF with the clearance of bearings as chains of joints
    --mjcf FILE  write it as MJCF, play as dead bands and tilts (export simulator has more)
    --detail
    --quiet
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import misread, pair
from jointplay.base.schema import one_of
from jointplay.base.tables import few
from jointplay.cli.commands import Outputs, given, numbers_by_name, print_answer, quantity
from jointplay.cli.commands.inputs import (
    PosedMachine,
    is_scenario,
    named_joints,
    posed_machine,
    write_preset,
    write_robot,
)

if TYPE_CHECKING:
    from jointplay.estimate.gauge import Gauged
    from jointplay.estimate.watch import Target
    from jointplay.estimate.wiggle_logs import Wiggled
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.presets import Preset
    from jointplay.simulation.loads.drive import Drive

PLANS = ("motion", "dial", "wiggle")
NOT_OF_A_WIGGLE = ("known", "also", "stiffness", "lag", "runs", "verify", "signal", "pose", "noise")
NOT_OF_A_GAUGE = (*NOT_OF_A_WIGGLE[:-2], "source", "map", "episode", "world", "encoder")
SIDES = {"output": "link", "motor": "motor"}
"""Where a servo's encoder sits, by what --encoder calls it."""
OUTPUTS = ("write_preset", "urdf", "mjcf")
LOOPS = "loops.png"
OF_JOINTS = ["identified.csv", "identified.json", LOOPS]
WATCHED = ("limit", "target", "ahead")
ALARM = 3
"""Exit status."""
DIAL, WIGGLE, MOTION = (
    *("a table of a dial gauge", "a servos' log of a wiggle", "a measurement in motion"),
)
"""What can be watched."""


def run(options: argparse.Namespace) -> int:
    from jointplay.base import processes
    from jointplay.estimate.columns import is_readings

    processes.number_of(options.jobs)
    if options.against:
        return _watch(options)
    for name in WATCHED:
        if getattr(options, name) not in (None, []):
            raise JointplayError(f"--{name} needs earlier measurements (--against)")
    if (options.plan is None) == (options.data is None):
        raise JointplayError(
            "give a measurement (CSV, bag or dataset), or --plan to ask what to measure"
            + ("; not both" if options.plan else "")
        )
    for name in OUTPUTS:
        if (path := getattr(options, name)) is not None:
            if options.plan:
                option = f"--{name.replace('_', '-')}"
                raise JointplayError(f"{option} needs a measurement, not --plan")
            files.check_new(Path(path))
    if options.plan:
        one_of("--plan", options.plan, PLANS)
    if options.plan == "dial" or (options.data is not None and is_readings(options.data)):
        return _gauge(options)
    if options.plan == "wiggle" or (options.data and _is_wiggle(options, options.data)):
        return _wiggle(options)
    if options.encoder is not None:
        raise JointplayError("--encoder is for --plan wiggle, and for logs of servos")
    data = options.data if options.plan else _recording(options)
    names = ["identified.csv", "identified.json", "identified.png", LOOPS]
    out = Outputs(options.out, ["plan.txt"] if options.plan else names)
    posed = posed_machine(options)
    for option in ("verify", "runs"):
        if getattr(options, option) and posed.simulation is None:
            raise JointplayError(f"--{option} needs a scenario (.toml) with the measured motion")
    shared, lag = _about(options)
    out.claim()
    from jointplay.estimate import identify, plan_measurement

    if options.plan:
        friction = None if posed.simulation is None else posed.simulation.joint_friction
        plan = plan_measurement(
            posed.mechanism,
            signals=options.signal or ["tool"],
            count=options.count,
            joint_friction=friction,
            **given(options, "push"),
            **shared,
        )
        print_answer("", plan, posed.notes, options.detail)
        if options.out:
            out.write({"plan.txt": f"{plan}\n"})
        return 0
    machine: Any = posed.mechanism
    if posed.simulation is not None:
        machine = replace(posed.simulation, mechanism=machine)
    shown = {"jobs": options.jobs, "progress": not options.quiet}
    about = {"motion": posed.motion, "reference": options.reference, "drift": options.drift}
    fit = identify(machine, data, lag=lag, runs=options.runs or 0, **about, **shown, **shared)
    notes = list(posed.notes)
    if options.gear and posed.simulation is None:
        notes.append(
            "note: gears of --gear have no stiffness of their own; unless --stiffness gives "
            "it, it is sought from 1e+04 N m/rad on"
        )
    body = replace(fit, notes=())
    print_answer(fit.sentence, body, [*fit.notes, *notes], options.detail)
    found = fit.describe()
    if options.verify and posed.simulation is not None:
        from jointplay.estimate.verification import verify

        checked = verify(posed.simulation, fit, runs=options.verify, **shown)
        print(checked)
        found["verification"] = checked.describe()
    _write_robot(options, fit.preset(_place(options), posed.simulation), fit.mechanism)
    if options.out:
        from jointplay.show.plots.design import identification, reversal_loops

        contents = [fit.data.csv(), json.dumps(found, indent=1) + "\n", identification(fit)]
        contents += [reversal_loops(fit.loops, fit.estimates)] if fit.loops else []
        out.write(dict(zip(names, contents, strict=False)))
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
        "stiffness": _stiffness(options.stiffness),
    }
    return shared, lag


def _is_wiggle(options: argparse.Namespace, path: str | Path) -> bool:
    """Whether a measurement is what servos logged of a wiggle."""
    from jointplay.estimate.columns import is_servo_log

    goals = any(text.partition("=")[0].split()[-1:] == ["goal"] for text in options.source)
    return goals or is_servo_log(path)


def _watch(options: argparse.Namespace) -> int:
    """Compare measurements of the same machine."""
    from jointplay.estimate.columns import is_readings
    from jointplay.estimate.watch import in_order, watch, watch_wiggled

    for name in ("plan", *OUTPUTS, "runs", "verify"):
        if getattr(options, name) is not None:
            option = f"--{name.replace('_', '-')}"
            raise JointplayError(f"{option} is of one measurement, --against of several")
    given = [*options.against, *([options.data] if options.data else [])]
    paths = in_order([path for one in given for path in _inside(Path(one))])
    out = Outputs(options.out, ["watch.csv", "watch.json", "watch.png"])
    for path in paths:
        if not path.exists():
            raise JointplayError(f"there is no file {str(path)!r}")
    kinds = [
        DIAL if is_readings(path) else WIGGLE if _is_wiggle(options, path) else MOTION
        for path in paths
    ]
    for path, kind in zip(paths, kinds, strict=True):
        if kind != kinds[0]:
            raise JointplayError(f"{path} is {kind}, and {paths[0]} is {kinds[0]}")
    limits = {}
    for text in options.limit:
        label, value = pair(text, '--limit PLAY=X, such as "elbow gear play=0.2 deg"')
        unit = "m" if "clearance" in label else "rad"
        limits[label] = quantity(value, unit, f"--limit {label}")
    posed = {DIAL: _gauged, WIGGLE: _with_servos, MOTION: posed_machine}[kinds[0]](options)
    told: Any = watch
    if kinds[0] == WIGGLE:
        _refuse(options, NOT_OF_A_WIGGLE, "a wiggle of servos")
        told = partial(watch_wiggled, posed.mechanism, _servos(options, posed))
    series = {DIAL: _gauge_series, WIGGLE: _wiggle_series, MOTION: _series}[kinds[0]]
    parts = series(options, posed, paths)
    out.claim()
    dates = [(path.name, next(parts)) for path in paths]
    found = told(dates, limits, options.ahead or 0.0, _target(options, posed))
    notes = [*found.notes, *([f"tool at: {posed.poses.words}"] if options.target else [])]
    print_answer(found.sentence, replace(found, notes=()), notes, options.detail)
    if options.out:
        from jointplay.show.plots.design import courses

        data = json.dumps(found.describe(), indent=1) + "\n"
        out.write({"watch.csv": found.data.csv(), "watch.json": data, "watch.png": courses(found)})
    return ALARM if found.alarms else 0


def _inside(path: Path) -> list[Path]:
    """The measurements in a folder, by their names; else the path, which is one."""
    from jointplay.estimate.recordings import is_recording

    if not files.is_folder(path) or is_recording(path):
        return [path]
    inside = [one for one in sorted(path.iterdir()) if one.suffix.lower() in (".csv", ".mcap")]
    if not inside:
        raise JointplayError(f"{path} holds no measurements (.csv, .mcap)")
    return inside


def _target(options: argparse.Namespace, posed: PosedMachine) -> Target | None:
    """How far off play may let the tool be at the robot's poses."""
    if options.target is None:
        return None
    import numpy as np

    from jointplay.accuracy.error_budget import budget
    from jointplay.estimate.machine import with_plays
    from jointplay.estimate.watch import Target

    if not options.target > 0.0:
        raise JointplayError(f"--target must be positive, got {options.target:g} m")
    poses = posed.poses

    def error(plays: Mapping[tuple[str, str], float]) -> float:
        mine = with_plays(posed.mechanism, plays)
        rows = [mine.configuration(poses.positions(k)) for k in range(len(poses.q))]
        return float(budget(mine, np.array(rows), driven=poses.driven).worst.max())

    return Target(options.target, error)


def _gauged(options: argparse.Namespace) -> PosedMachine:
    """The machine with the pose in which readings were taken."""
    options.pose = [options.pose or ""] if options.pose or not options.motion else []
    return posed_machine(options)


def _gauge_series(
    options: argparse.Namespace, posed: PosedMachine, paths: Sequence[Path]
) -> Iterator[Any]:
    """Least squares of each table of readings."""
    from jointplay.estimate.gauge import gauge_problems

    noise = numbers_by_name(options.noise, "--noise SIGNAL=X", {"tool": "m", "link": "rad"})
    pose = posed.poses.positions() if any(options.pose) else None
    return (gauge_problems(posed.mechanism, path, noise=noise, pose=pose) for path in paths)


def _series(
    options: argparse.Namespace, posed: PosedMachine, paths: Sequence[Path]
) -> Iterator[Any]:
    """Least squares of each measurement in motion."""
    from jointplay.estimate.identification import identify_problem

    shared, lag = _about(options)
    machine: Any = posed.mechanism
    if posed.simulation is not None:
        machine = replace(posed.simulation, mechanism=machine)
    about = {"motion": posed.motion, "reference": options.reference, "drift": options.drift}
    about |= {"lag": lag, "progress": not options.quiet}
    for path in paths:
        options.data = str(path)
        yield [identify_problem(machine, _recording(options), **about, **shared)]


def _wiggle_series(
    options: argparse.Namespace, posed: PosedMachine, paths: Sequence[Path]
) -> Iterator[Any]:
    """What servos logged at each date."""
    from jointplay.estimate.wiggle_logs import ServoSignals

    for path in paths:
        options.data = str(path)
        yield ServoSignals.of(_recording(options), posed.mechanism)


def _with_servos(options: argparse.Namespace) -> PosedMachine:
    """The machine, by default with what is known of the robot's servos."""
    if options.preset is None and not is_scenario(options):
        options.preset = _preset_with_servos(str(options.place))
    return posed_machine(options)


def _gauge(options: argparse.Namespace) -> int:
    """Plan or take readings of a dial gauge."""
    from jointplay.estimate.gauge import identify_gauged, plan_gauge

    _refuse(options, NOT_OF_A_GAUGE, "a dial gauge")
    out = Outputs(options.out, ["plan.txt", "dial.csv"] if options.plan else OF_JOINTS)
    noise = numbers_by_name(options.noise, "--noise SIGNAL=X", {"tool": "m", "link": "rad"})
    posed = _gauged(options)
    out.claim()
    if options.plan:
        joints = list(dict.fromkeys([*posed.mechanism.gears, *named_joints(options)]))
        plan = plan_gauge(posed.mechanism, joints, noise=noise, **given(options, "push"))
        print_answer("", plan, posed.notes, options.detail)
        if options.out:
            out.write({"plan.txt": f"{plan}\n", "dial.csv": plan.csv()})
        return 0
    pose = posed.poses.positions() if any(options.pose) else None
    fit = identify_gauged(posed.mechanism, options.data, noise=noise, pose=pose)
    return _answered(options, fit, posed, out)


def _wiggle(options: argparse.Namespace) -> int:
    """Plan a wiggle of servos, or take what they logged."""
    from jointplay.estimate.wiggle_logs import identify_wiggled
    from jointplay.estimate.wiggle_plan import plan_wiggle

    _refuse(options, NOT_OF_A_WIGGLE, "a wiggle of servos")
    planned = ["plan.txt", "wiggle.csv", "wiggle.yaml", "wiggle_lerobot.py"]
    out = Outputs(options.out, planned if options.plan else OF_JOINTS)
    posed = _with_servos(options)
    drives = _servos(options, posed)
    log = None if options.plan else _recording(options)
    out.claim()
    if log is None:
        joints = [pair(text, "--gear JOINT=ANGLE")[0] for text in options.gear or ()]
        plan = plan_wiggle(posed.mechanism, drives, joints)
        print_answer("", plan, posed.notes, options.detail)
        if options.out:
            from jointplay.bridges import trajectory

            motion = trajectory.Trajectory.through(plan.time, plan.joints, plan.position)
            shown = not options.quiet
            texts = [trajectory.content(motion, one, shown).decode() for one in (".csv", ".yaml")]
            bus = trajectory.lerobot_script(drives, plan.steps)
            contents = [f"{plan}\n", *texts, *([bus] if bus else [])]
            out.write(dict(zip(planned, contents, strict=False)))
        return 0
    fit = identify_wiggled(posed.mechanism, log, drives)
    return _answered(options, fit, posed, out)


def _answered(
    options: argparse.Namespace, fit: Gauged | Wiggled, posed: PosedMachine, out: Outputs
) -> int:
    """Print and write what a measurement of single joints tells."""
    print_answer(fit.sentence, replace(fit, notes=()), [*fit.notes, *posed.notes], options.detail)
    if any(getattr(options, name) is not None for name in OUTPUTS):
        preset = fit.preset(_place(options))
        _write_robot(options, preset, preset.mechanism(tool=fit.mechanism.tool))
    if options.out:
        from jointplay.show.plots.design import reversal_loops

        picture = reversal_loops(fit.loops, fit.estimates)
        contents = (fit.data.csv(), json.dumps(fit.describe(), indent=1) + "\n", picture)
        out.write(dict(zip(OF_JOINTS, contents, strict=True)))
    return 0


def _refuse(options: argparse.Namespace, names: Iterable[str], of: str) -> None:
    for name in names:
        if getattr(options, name) not in (None, []):
            raise JointplayError(f"--{name} is not for {of}, which tells single joints")


def _preset_with_servos(robot: str) -> str:
    """The name of the robot's preset.

    Raises:
        JointplayError: nothing is known of its servos.
    """
    from jointplay.scenario.presets import preset, preset_of, presets

    def servos(one: Preset) -> bool:
        tables = (one.every, *one.ordered, *one.named.values())
        return any(table.get("drive", {}).get("kind") == "servo" for table in tables)

    able = [name for name in presets() if servos(preset(name))]
    with suppress(JointplayError):
        if (name := preset_of(robot).name) in able:
            return name
    raise JointplayError(
        f"{robot}: a wiggle needs servos of which motor, gain and rotor are known, and here none "
        f"are; --preset with one of {', '.join(able)}, or with a file of your own (docs/robots.md)"
    )


def _servos(options: argparse.Namespace, posed: PosedMachine) -> dict[str, Drive]:
    """Drives by joint, with the encoders' side from --encoder or from who described the servos.

    Raises:
        JointplayError: neither says it.
    """
    from jointplay.base.schema import Draft
    from jointplay.scenario.build import made_by_joint
    from jointplay.simulation.loads.drive import Servo

    scenario = posed.scenario
    drafts: dict[str, Any] = dict(scenario.model(options.case or scenario.cases[0]).drives)
    servos = {name: one for name, one in drafts.items() if issubclass(one.kind, Servo)}
    if not servos:
        raise JointplayError(
            "a wiggle needs servos of which motor and gain are known: no [drives.JOINT] is of kind "
            "servo"
        )
    for name, one in servos.items():
        if options.encoder is not None:
            fields = {**one.fields, "encoder": SIDES[options.encoder]}
            servos[name] = Draft(one.kind, one.word, fields)
        elif "encoder" not in one.fields:
            raise JointplayError(
                f"on which side of its gear {name}'s encoder sits nobody says: --encoder output or "
                "--encoder motor; guessed wrong, answers are wrong and look right"
            )
    return made_by_joint(servos, posed.mechanism, "drives")


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
        from jointplay.bridges.own_mjcf import is_own
        from jointplay.bridges.reduced_robot import ReducedRobot, refuse_without_play
        from jointplay.bridges.reduction import reduce_all

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


def _recording(options: argparse.Namespace) -> Any:
    """The bag or dataset that is measured, or the path of a CSV."""
    from jointplay.estimate.recordings import Recording, is_recording

    about = (options.source, options.map, options.episode is not None, options.world)
    if not any(about) and not is_recording(options.data):
        return options.data
    sources = _pairs(options.source, "--source SIGNAL=TOPIC, such as motor=/joint_states")
    names = _pairs(options.map, "--map JOINT=NAME")
    return Recording(options.data, sources, names, options.episode, tuple(options.world))


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
    words = '--stiffness PART=X or "PART=X +- Y %", such as "elbow=1e5 N*m/rad"'
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
        given[label] = (_size(value, unit, f"--stiffness {label}"), deviation)
    return given
