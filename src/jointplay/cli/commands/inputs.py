"""Input options of commands: a scenario file or a robot, and options for keys of the scenario.

`declare` adds them to a parser; `scenario_of`, `simulation_of` and `posed_machine` build what they
describe. An option for a key of the scenario is only named here (`KEYS`): explanation, unit,
choices and default come from the field of the scenario's tables.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import streams
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import misread, name_and_number, number, vector
from jointplay.cli import commands
from jointplay.cli.options import BY_UNIT, FLAG, LISTS, MASS, REPEATED, SHARED, Parser, listed

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.scenario.posed import PosedMachine
    from jointplay.scenario.presets import Preset
    from jointplay.scenario.reading import Setting
    from jointplay.scenario.request import Request
    from jointplay.simulation.simulation import Simulation


def gravity(text: str) -> Any:
    """The value of --gravity: a word, or three components [m/s^2]."""
    parts = text.split(",")
    return text if len(parts) == 1 else [number(part.strip()) for part in parts]


def as_local_path(text: str) -> str:
    """An absolute path: a scenario would take a relative one as relative to its own file."""
    return text if text.startswith("jointplay:") else str(Path(text).resolve())


# fmt: off
OPTIONS: dict[str, dict[str, dict[str, Any]]] = {
    "": {
        "--set": dict(**REPEATED, metavar="KEY=VALUE", help="any key of the scenario, such as "
            "joints.joint_b.radial_clearance=\"0.3 mm\"; docs/scenarios.md lists them"),
        "--case": SHARED["--case"],
        "--import": SHARED["--import"],
    },
    "robot": {
        "--xacro": SHARED["--xacro"],
        "--allow-unphysical": dict(LISTS, metavar="LINK,...", help="accept these links' "
            "inertias although they are physically impossible, or all"),
        "--fix": dict(LISTS, metavar="JOINT,...", help="hold these joints, at zero or "
            "in the middle of limits that exclude it; those that mimic them are held, too"),
    },
    "joints with clearance": {
        "--joint": dict(**REPEATED, metavar="NAME[=LENGTH|=FIT|=BEARING]", help="joint with "
            "clearance, optionally its radial clearance, ISO 286 fit or rolling bearing, such as "
            'elbow="0.1 mm", elbow="20H7/g6" or elbow="6010/C3"; the options of this group, of '
            "contacts and of impacts apply to these joints"),
        "--clearance": dict(metavar="VALUE", type=number, help="radial clearance of the "
            "joints of --joint, or of all that move the tool; of sliders, that on each side [m]"),
        "--ideal": dict(**FLAG, help="the robot without clearance and without play in gears"),
        "--preset": dict(nargs="?", const="", metavar="NAME", help="joints, gears and drives as "
            "publicly known of a robot, or assumed for a class of robots (jointplay robots "
            "--presets lists them; without NAME that of ROBOT); other options override it"),
    },
    "gears": {
        "--gear": dict(**REPEATED, metavar="JOINT=PLAY", help="total play of a joint's gear or "
            'screw, such as elbow="2 arcmin", lift="0.1 mm", or all="1 arcmin"; the options of '
            "this group apply to these gears, or to all"),
    },
    "drive": {
        "--joint-friction": dict(**REPEATED, metavar="JOINT=C,V", help="Coulomb [N m or N] and "
            "viscous [N m s/rad or N s/m] friction (default: from the URDF)"),
        "--payload": dict(**MASS, help="mass held at the tool"),
        "--registers": dict(metavar="P=N,...", help="gains of servos as their registers have "
            "them, such as P=16,D=32,I=0 of LeRobot, or elbow_flex:P=16 of one joint; "
            "docs/drives.md has the units", **REPEATED),
    },
    "poses": {
        "--pose": dict(**REPEATED, metavar="JOINT=X,...", help="joint positions [rad or m, or "
            "with a unit]; other joints are at zero, or in the middle of limits that exclude it "
            "(default: along the motion, or one pose)"),
        "--poses": dict(metavar="FILE", help="CSV with a pose in each line and the header "
            "<joint>,..., or name,<joint>,... to name them"),
        "--workspace": dict(metavar="N", type=int, help="N poses spread over the limits of all "
            "joints"),
    },
    "load": {
        "--force": dict(metavar="FX,FY,FZ", help="force on the tool, world axes [N]"),
    },
    "whole error": {
        "--whole": dict(nargs="?", const="", metavar="CLASS", help="the whole error: play, and "
            "elasticity, sag, encoders, gears, geometry, heat, those of this class of robots where "
            "nothing else is known (calibrated-industrial, industrial, printed; without CLASS that "
            "of the scenario's [errors] or of the preset)"),
        "--causes": dict(metavar="LIST", type=listed, help="causes that count in --whole, such "
            "as play,elasticity (default: all)"),
    },
}
"""Options that are not names for keys, by group, as arguments of argparse's ``add_argument``."""

KEYS: dict[str, dict[str, str]] = {
    "robot": {"--tool": "robot.tool", "--gravity": "robot.gravity", "--base": "robot.base"},
    "joints with clearance": {
        "--axial-clearance": "joints.JOINT.axial_clearance",
        "--bearing-radius": "joints.JOINT.bearing_radius",
        "--bearing-length": "joints.JOINT.bearing_length",
        "--journal-radius": "joints.JOINT.journal_radius",
        "--journal-length": "joints.JOINT.journal_length",
    },
    "gears": {
        "--gear-stiffness": "gears.GEAR.stiffness",
        "--gear-damping": "gears.GEAR.damping",
        "--rotor-inertia": "gears.GEAR.rotor_inertia",
    },
    "contacts": {
        "--young": "joints.JOINT.bearing_material.young joints.JOINT.journal_material.young",
        "--poisson": "joints.JOINT.bearing_material.poisson joints.JOINT.journal_material.poisson",
        "--stiffness": "joints.JOINT.stiffness",
        "--axial-stiffness": "joints.JOINT.axial_stiffness",
        "--law": "joints.JOINT.normal.law",
        "--friction": "joints.JOINT.friction.mu_d",
    },
    "impacts": {
        "--restitution": "joints.JOINT.restitution",
        "--damping": "joints.JOINT.normal.damping",
        "--impact-mass": "joints.JOINT.normal.mass",
    },
    "motion": {"--motion": "motion.file", "--interpolation": "motion.interpolation"},
    "drive": {
        "--bandwidth": "drive.bandwidth",
        "--damping-ratio": "drive.damping_ratio",
        "--encoder": "drive.encoder",
    },
    "start": {
        "--seed": "integration.seed",
        "--start": "integration.start",
        "--settle": "integration.settle",
        "--judge-from": "integration.judge_from",
    },
    "integration and output": {
        "--step": "integration.step",
        "--duration": "integration.duration",
        "--integrator": "integration.integrator",
        "--macro-step": "integration.macro_step",
        "--tolerance": "integration.tolerance",
        "--record-every": "output.record_every",
    },
}
# fmt: on
"""Options that are names for keys of the scenario, by group: each is a setting, as if by ``--set
KEY=VALUE``, which the scenario's tables read and explain. ``JOINT`` stands for each joint of
--joint, ``GEAR`` for each gear of --gear."""

GROUPS = tuple(dict.fromkeys([*list(OPTIONS)[:4], *KEYS, *OPTIONS]))  # in the order of the help
STATIC = ("poses", "load", "whole error")
"""Groups of static commands, which other commands do not have."""

READERS: dict[str, Callable[[str], Any]] = {
    "tool": str, "gravity": gravity, "motion": as_local_path
}  # fmt: skip
"""Converters from an option's text to the scenario's value; values of other options are numbers."""


@dataclass(frozen=True)
class Flag:
    """An option that is a name for one or more keys of a scenario."""

    name: str  # as it is typed
    keys: tuple[tuple[str, ...], ...]

    @property
    def attribute(self) -> str:
        return self.name.removeprefix("--").replace("-", "_")


FLAGS = tuple(
    Flag(name, tuple(tuple(key.split(".")) for key in keys.split()))
    for group in KEYS.values()
    for name, keys in group.items()
)


def declare(parser: Parser, *groups: str, required: bool = False) -> None:
    """Add the argument FILE | ROBOT and options: those of `groups` (names of groups or of single
    options), by default all but those of `STATIC`."""
    about = "scenario (.toml; jointplay init writes one), URDF, xacro, or name of a robot such as "
    about += "ur5; jointplay robots lists them"
    nargs = None if required else "?"
    parser.add_argument("place", nargs=nargs, metavar="FILE | ROBOT", help=about)
    flags = {flag.name: flag for flag in FLAGS}
    for title in GROUPS:
        complete = title in ("", *groups) or not (groups or title in STATIC)
        group = OPTIONS.get(title, {}) | {key: {} for key in KEYS.get(title, ())}
        wanted = {name: about for name, about in group.items() if complete or name in groups}
        section = parser.add_argument_group(title) if title and wanted else parser
        for name, declared in wanted.items():
            if name in flags:
                reader = READERS.get(flags[name].attribute, number)
                declared = {"type": reader, "metavar": "VALUE"}
            action = section.add_argument(name, **declared)
            if name in flags:
                # Only the help needs explanations, which load the scenario's tables.
                parser.explained[action.dest] = partial(explanation, flags[name])
            if not title:
                parser.behind.add(action.dest)


def explanation(flag: Flag) -> tuple[str, str]:
    """Help of an option for a key, with choices and default, and the placeholder of its value."""
    from jointplay.scenario.schema import explain

    text, unit, word = explain(flag.keys)
    metavar = word or BY_UNIT.get(unit, "X")
    return f"{text}: {'.'.join(flag.keys[0])}".removeprefix(": "), metavar


CLEARANCE = Flag("--clearance", (("joints", "JOINT", "clearance"),))
"""--clearance: kinds of joint call this size by different names, which `Request` resolves."""


def is_scenario(options: argparse.Namespace) -> bool:
    """Whether the options name a scenario file rather than a robot."""
    from jointplay.model.robots import is_robot

    return options.place is not None and not is_robot(options.place)


def robot_named(options: argparse.Namespace) -> str | None:
    """The robot as it was typed; None for a scenario's robot."""
    return None if is_scenario(options) else str(options.place)


def scenario_of(options: argparse.Namespace, moves: bool = True, inertia: bool = True) -> Scenario:
    """The scenario that the options of `declare` describe; see `Request.scenario`."""
    return _scenario(options, request_of(options, inertia), moves)


def _scenario(options: argparse.Namespace, request: Request, moves: bool) -> Scenario:
    """The scenario of a request, with a note if a preset is known for the robot and not used."""
    scenario = request.scenario(moves)
    if own_preset(options):
        scenario.assumptions.append(
            f"note: what is publicly known of the joints of {options.place} is left out; "
            "--preset takes it"
        )
    return scenario


def request_of(options: argparse.Namespace, inertia: bool = True) -> Request:
    """The options of `declare` as a `Request`; `inertia`: whether inertias matter."""
    from jointplay.model.xacro import read_arguments
    from jointplay.scenario.reading import Setting, parse
    from jointplay.scenario.request import Request

    has = partial(getattr, options)  # commands lack some of these options
    settings = [
        *(
            Setting(("robot", "xacro", name), text, "--xacro")
            for name, text in read_arguments(has("xacro", ())).items()
        ),
        *(
            Setting(("robot", key), list(names), f"--{key.replace('_', '-')}")
            for key in ("fix", "allow_unphysical")
            if (names := has(key, None))
        ),
        *map(parse, options.set),
    ]
    case = options.case
    return Request(
        place=options.place,
        case=(case[0] if case else None) if isinstance(case, list) else case,
        joints=named_joints(options),
        gears=dict(map(name_and_number, has("gear", ()))),
        every=has("all", False),
        keys=keys(options),
        payload=has("payload", None),
        registers=has("registers", ()),
        preset=chosen_preset(options),
        settings=settings,
        ideal=has("ideal", False),
        inertia=inertia,
        relative_to=has("relative_to", None),
        whole=has("whole", None) is not None,
    )


def keys(options: argparse.Namespace) -> list[Setting]:
    """Settings of the options that name keys; ``*`` in a key stands for each joint or gear."""
    from jointplay.scenario.reading import Setting

    settings = [
        Setting(tuple("*" if part in ("JOINT", "GEAR") else part for part in key), value, flag.name)
        for flag in (CLEARANCE, *FLAGS)
        if (value := getattr(options, flag.attribute, None)) is not None
        for key in flag.keys
    ]
    for text in getattr(options, "joint_friction", ()):
        name, values = name_and_number(text)
        parts = [number(value.strip()) for value in (values or "").split(",")]
        if len(parts) != 2:
            raise misread(text, "--joint-friction JOINT=COULOMB,VISCOUS")
        for key, value in zip(("coulomb", "viscous"), parts, strict=True):
            settings.append(Setting(("joint_friction", name, key), value, "--joint-friction"))
    return settings


def own_preset(options: argparse.Namespace) -> str:
    """Name of the preset that is known for the robot and not asked for; empty if none is."""
    from jointplay.scenario import presets

    if getattr(options, "preset", "") is not None or is_scenario(options) or not options.place:
        return ""
    return presets.own_preset(str(options.place))


def posed_machine(
    options: argparse.Namespace, single: bool = False, inertia: bool = True
) -> PosedMachine:
    """The machine that the options describe, with the poses to evaluate; see `PosedMachine.of`.

    `single`: only one pose is allowed; `inertia`: as in `Request`.
    """
    from jointplay.scenario.posed import PosedMachine

    chosen = commands.typed(options, ("pose", "poses", "motion", "workspace"))
    if len(chosen) > 1:
        raise JointplayError(f"give one of {' and '.join(chosen)}")
    request = request_of(options, inertia)
    scenario = _scenario(options, request, moves=False)
    if single:
        pose_of(options)
    poses, file, number = (getattr(options, n, None) for n in ("pose", "poses", "workspace"))
    return PosedMachine.of(request, scenario, poses or (), file, number, single)


def pose_of(options: argparse.Namespace) -> str:
    """The value of --pose where it may be given only once; empty without it."""
    if len(options.pose) > 1:
        raise JointplayError(f"give --pose once, got {len(options.pose)}")
    return "".join(options.pose)


def force_on_tool(options: argparse.Namespace) -> tuple[float, float, float]:
    """The force on the tool of --force, world axes [N]."""
    return vector(options.force or "0,0,0", "N", "--force")


def whole_errors(options: argparse.Namespace, scenario: Scenario) -> dict[str, Any]:
    """Arguments of budgets of the whole error: causes, known errors, class of the rest."""
    from jointplay.accuracy.causes import CAUSES

    errors, preset = scenario.robot_errors(options.case), chosen_preset(options)
    kind = options.whole or (errors and errors.assumed) or (preset and preset.errors) or None
    return {"causes": options.causes or CAUSES, "errors": errors, "kind": kind}


def simulation_of(
    options: argparse.Namespace, refuse: Callable[[Simulation], object] = lambda _: None
) -> tuple[Simulation, str]:
    """The single simulation that the options describe, and a clause on clearances that nobody gave;
    its notes are printed.

    Raises:
        JointplayError: several cases, or what `jointplay run` or `refuse` would refuse.
    """
    from jointplay.scenario.assumptions import assumed, assumed_clearances, decisive

    scenario = scenario_of(options)
    case = options.case or scenario.cases[0]
    simulation = scenario.simulation(options.case)
    scenario.ready_run(options.case)  # refuses what cannot run, with the line in the file
    refuse(simulation)
    lines = decisive(scenario, {case: simulation})
    for line in commands.first_notes(lines, getattr(options, "detail", True)):
        streams.note(line)
    time = simulation.duration or (simulation.motion and simulation.motion.duration)
    streams.note(f"one cycle: {time:g} s simulated" if simulation.motion else "no motion")
    return simulation, assumed(assumed_clearances(scenario, case, simulation.mechanism))


def named_joints(options: argparse.Namespace) -> dict[str, str | None]:
    """The joints of --joint, each with its clearance, fit or bearing if one is given."""
    from jointplay.physics.joints.bearings import is_designation

    if not isinstance(getattr(options, "joint", None), list):  # the command's own --joint
        return {}
    return dict(name_and_number(entry, is_number=is_designation) for entry in options.joint)


def of_journals(options: argparse.Namespace) -> list[str]:
    """The given options that are for joints with clearance."""
    return [setting.source for setting in keys(options) if setting.key[0] == "joints"]


def chosen_preset(options: argparse.Namespace) -> Preset | None:
    """The preset of --preset: by its name, or without a name the robot's.

    Raises:
        JointplayError: no preset of that name, or none for the robot.
    """
    name = getattr(options, "preset", None)
    if name is None:
        return None
    from jointplay.scenario.presets import preset, preset_of

    return preset(name) if name else preset_of(str(options.place or "scara"))
