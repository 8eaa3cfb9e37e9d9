"""`jointplay identify`: clearance and friction from measurements, or what to measure.

Identify clearances, friction and gear play from measured signals, with 95 % confidence intervals,
or state that this measurement cannot determine a value and which further measurement would. Means
over stops and slow stretches are compared with the static model; readings of a dial gauge tell the
play of single joints. With --plan: the most informative poses and motions; with --against: what has
changed since an earlier measurement. docs/identify.md lists the columns of a measurement.

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
from jointplay.base.errors import JointplayError
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
    is_scenario,
    named_joints,
    posed_machine,
)
from jointplay.cli.options import FORCE, REPEATED, Parser, quantity

if TYPE_CHECKING:
    from jointplay.estimate import Identification
    from jointplay.estimate.gauge import Gauged
    from jointplay.estimate.least_squares import LeastSquares
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.presets import Preset

OF_MOTIONS = (
    *("known", "also", "known_stiffness", "lag", "signal", "source", "map", "episode", "world"),
)
"""Options that readings of a dial gauge have no use for."""
OUTPUTS = ("write_preset", "urdf", "mjcf")
TABLES = ("identified.csv", "identified.json")
FIGURE, LOOPS = "identified.png", "loops.png"


class _Motion:
    """A measurement in motion: a table, a bag or a dataset."""

    words = "a measurement in motion"
    plans, figures = ("plan.txt",), (FIGURE, LOOPS)

    def __init__(self, options: argparse.Namespace) -> None:
        self.options, paths = options, filter(None, (options.against, options.data))
        self.recordings = [_recording(options, path) for path in paths]
        self.posed = posed_machine(options)
        noise, lag = _noise(options), options.lag
        self.lag = None if lag is None else _size(lag, "s", "--lag")
        self.about: dict[str, Any] = {
            "noise": noise,
            "also": options.also,
            "known": options.known,
            "stiffness": _stiffness(options.known_stiffness),
        }

    def plan(self) -> tuple[object, dict[str, str]]:
        """Poses and motions to measure; further files."""
        from jointplay.estimate import plan_measurement

        options, simulation = self.options, self.posed.simulation
        plan = plan_measurement(
            self.posed.mechanism,
            signals=options.signal or ["tool"],
            count=options.count,
            joint_friction=None if simulation is None else simulation.joint_friction,
            **given(options, "push"),
            **self.about,
        )
        return plan, {}

    def _measured(self) -> tuple[Any, dict[str, Any]]:
        """The machine, and what is known of how it was measured."""
        options, simulation = self.options, self.posed.simulation
        machine: Any = self.posed.mechanism
        if simulation is not None:
            machine = replace(simulation, mechanism=machine)
        shared = {"motion": self.posed.motion, "reference": options.reference}
        more = {"drift": options.drift, "lag": self.lag, "progress": not options.quiet}
        return machine, {**shared, **more, **self.about}

    def problems(self) -> list[list[LeastSquares]]:
        """Least squares of each measurement."""
        from jointplay.estimate.identification import identify_problem

        machine, about = self._measured()
        return [[identify_problem(machine, one, **about)] for one in self.recordings]

    def identify(self) -> Identification:
        from jointplay.estimate import identify

        machine, about = self._measured()
        fit = identify(machine, self.recordings[-1], **about)
        if self.options.gear and self.posed.simulation is None:
            self.posed.notes.append(
                "note: gears of --gear have no stiffness of their own; unless --known-stiffness "
                "gives it, it is sought from that of the rule on"
            )
        return fit

    def identified(self, fit: Identification) -> tuple[Preset, Mechanism]:
        """The robot with what was found."""
        return fit.preset(_place(self.options), self.posed.simulation), fit.mechanism


class _Dial:
    """Readings of a dial gauge, by single joints."""

    words = "a table of a dial gauge"
    plans, figures = ("plan.txt", "dial.csv"), (LOOPS,)

    def __init__(self, options: argparse.Namespace) -> None:
        for name in OF_MOTIONS:
            if getattr(options, name) not in (None, []):
                option = f"--{name.replace('_', '-')}"
                raise JointplayError(f"{option} is not for a dial gauge, which tells single joints")
        self.options = options
        self.noise = _noise(options, "tool", "link")
        options.pose = [options.pose or ""] if options.pose or not options.motion else []
        self.posed = posed_machine(options)
        pose = self.posed.poses.positions() if any(options.pose) else None
        self.about: dict[str, Any] = {"noise": self.noise, "pose": pose}

    def plan(self) -> tuple[object, dict[str, str]]:
        """Where to set the gauge and how to push; the table to fill in."""
        from jointplay.estimate.gauge import plan_gauge

        mechanism = self.posed.mechanism
        joints = list(dict.fromkeys([*mechanism.gears, *named_joints(self.options)]))
        plan = plan_gauge(mechanism, joints, noise=self.noise, **given(self.options, "push"))
        return plan, {"dial.csv": plan.csv()}

    def problems(self) -> list[list[LeastSquares]]:
        from jointplay.estimate.gauge import gauge_problems

        paths = self.options.against, self.options.data
        return [gauge_problems(self.posed.mechanism, path, **self.about) for path in paths]

    def identify(self) -> Gauged:
        from jointplay.estimate.gauge import identify_gauged

        return identify_gauged(self.posed.mechanism, self.options.data, **self.about)

    def identified(self, fit: Gauged) -> tuple[Preset, Mechanism]:
        preset = fit.preset(_place(self.options))
        return preset, preset.mechanism(tool=fit.mechanism.tool)


INSTRUMENTS: dict[str, Any] = {"motion": _Motion, "dial": _Dial}


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
        "motion, poses and motions of the robot; dial, where to set a dial gauge and how to push")
    add("--signal", choices=("tool", "link", "torque"), **REPEATED, help="signal that can be "
        "measured besides the motors' encoders; by default tool")
    add("--count", metavar="N", type=int, default=6, help="number of experiments to choose")
    add("--push", **FORCE, help="force with which the tool can be pushed; 0: none (default: 20)")
    add("--out", metavar="DIR", help="folder for the tables (CSV, JSON) and the figure")
    add("--write-preset", metavar="FILE", help="write the robot's joints with what was identified, "
        "for --preset FILE of every command")
    add("--urdf", metavar="FILE", help="write its URDF with the clearance of bearings as chains of "
        "joints")
    add("--mjcf", metavar="FILE", help="write it as MJCF, play as dead bands and tilts (export "
        "simulator has more)")
    parser.share("--json", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    _refuse(options)
    made = _instrument(options)
    names = [*TABLES, *made.figures]
    if options.against:
        names = ["changes.csv", "changes.json"]
    elif options.plan:
        names = [*made.plans]
    out = Outputs(options.out, names)
    instrument = made(options)
    out.claim()
    notes, contents = instrument.posed.notes, {}
    if options.plan:
        plan, contents = instrument.plan()
        print_answer("", plan, notes, options, data=lambda: {"plan": f"{plan}".splitlines()})
        contents = {"plan.txt": f"{plan}\n", **contents}
    else:
        if options.against:
            from jointplay.estimate.changes import changes

            fit: Any = changes(*instrument.problems())
        else:
            fit = instrument.identify()
        values = {} if options.against else {"values": instrument.posed.values}
        answer = replace(fit, notes=())
        notes = [*fit.notes, *notes]
        print_answer(fit.sentence, answer, notes, options, data=lambda: fit.describe() | values)
        said = json.dumps(fit.describe(), indent=1) + "\n"
        contents = dict(zip(names, (fit.data.csv(), said), strict=False))
    if not (options.plan or options.against):
        if any(getattr(options, name) is not None for name in OUTPUTS):
            _write_robot(options, *instrument.identified(fit))
        if options.out:
            from jointplay.show.plots.design import identification, reversal_loops

            if FIGURE in names:
                contents[FIGURE] = identification(fit)
            if fit.loops:
                contents[LOOPS] = reversal_loops(fit.loops, fit.estimates)
    if options.out:
        out.write(contents)
    return 0


def _refuse(options: argparse.Namespace) -> None:
    """Raise if options do not go together."""
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


def _instrument(options: argparse.Namespace) -> Any:
    """With what was measured, or will be: as the plan says, or as the files' columns do."""
    from jointplay.estimate.columns import is_readings

    if options.plan:
        if options.plan not in INSTRUMENTS:
            raise JointplayError(one_of("--plan", options.plan, INSTRUMENTS))
        return INSTRUMENTS[options.plan]
    paths = [path for path in (options.against, options.data) if path]
    for path in paths[: -1 if len(paths) == 1 else None]:
        if not Path(path).exists():
            raise JointplayError(f"there is no file {path!r}")
    kinds = [_Dial if is_readings(path) else _Motion for path in paths]
    if len(set(kinds)) > 1:
        words = [f"{path} is {kind.words}" for path, kind in zip(paths, kinds, strict=True)]
        raise JointplayError(", and ".join(words))
    return kinds[0]


def _noise(options: argparse.Namespace, *kinds: str) -> dict[str, float]:
    """Standard deviations of records of these kinds of signal, or of all [SI]."""
    from jointplay.estimate.measurement import JOINT_UNITS, TOOL_UNITS

    units = TOOL_UNITS | {kind: units[0] for kind, units in JOINT_UNITS.items()}
    known = {kind: units[kind] for kind in kinds or units}
    return numbers_by_name(options.noise, "--noise SIGNAL=X", known)


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
