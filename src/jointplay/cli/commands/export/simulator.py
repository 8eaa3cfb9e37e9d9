"""`jointplay export simulator`: play as dead band and friction, for robot simulators.

Fit a hinge with dead band, stiffness, damping and friction to the full model of one joint's play,
by reversals about a pose, and write it as MJCF (MuJoCo), SDF (Gazebo), URDF and YAML (ROS), USD
(Newton, Isaac), a Python actuator for robots without play, JSON with ranges for domain
randomisation. The dead band about the axis comes from the gear; the bearing contributes friction
and tilt, which --tilt writes. --joint names the joint. With --all: the play of all joints in one
file of each format. See docs/simulator.md.

Example: jointplay export simulator ur5 --joint elbow_joint --clearance "0.05 mm" --gear
elbow_joint="2 arcmin" --gear-stiffness 2e4 --rotor-inertia 0.5 --out elbow
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jointplay.base import files, signals
from jointplay.base.errors import JointplayError, nothing_has_play, require_non_negative
from jointplay.base.pairs import name_and_number
from jointplay.bridges.reduced_formats import FORMATS, choose
from jointplay.cli.commands import Outputs, given, inputs, print_answer
from jointplay.cli.options import ANGLE, FLAG, REPEATED, TIME, Parser

DONE = "joints.runs"
"""File of the joints that are done, as long as others are not."""


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", "joints with clearance", "gears", "contacts",
        "--joint-friction", "--encoder", required=True)
    add = parser.add_argument
    add("--pose", **REPEATED, metavar="JOINT=X,...", help="pose about which the joint reverses")
    add("--tilt", **FLAG, help="let the axes tilt as well, which only MJCF and JSON can hold")
    add("--out", metavar="DIR", required=True, help="folder for the files")
    add = parser.add_argument_group("reversals").add_argument
    add("--amplitude", **ANGLE, help="amplitude of the reversals (default: 0.1)")
    add("--period", **TIME, help="period of a reversal, there and back (default: 2)")
    add = parser.add_argument_group("output").add_argument
    add("--for", choices=("mujoco", "newton", "genesis", "gazebo", "webots", "isaac"), help="what "
        "this simulator takes and nothing else; says which parts of the play it has, and what is "
        "lost")
    add("--format", choices=("mjcf", "sdf", "urdf", "json", "usd", "proto", "py"), **REPEATED,
        help="file format; by default all")
    add("--spread", metavar="SHARE", help="JSON: relative half width of ranges without measured "
        "values, such as 20% (default: 0.3)")
    add("--check", **FLAG, help="run the MJCF in MuJoCo and compare it with the full model; exit "
        "status 1 if it differs by more than is stated")
    add = parser.add_argument_group("whole robot").add_argument
    add("--all", **FLAG, help="write all joints with play into one file of each format")
    add("--plugin", metavar="NAME", help="URDF: hardware of ros2_control's tags (default: "
        "gz_ros2_control/GazeboSimSystem)")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    spread = None if options.spread is None else _share(options.spread)
    joint = None if options.all else _joint(options)
    stem = "robot" if joint is None else files.names_for([joint], "")[0]
    formats, notes = choose(options.format, options.tilt, getattr(options, "for"))
    if options.check and "mjcf" not in formats:
        raise JointplayError(
            "--check runs the MJCF in MuJoCo: it needs --format mjcf or --for mujoco, and mujoco"
        )
    endings = [ending for one in formats for ending in FORMATS[one]]
    names = [f"{stem}{ending}" for ending in endings] + ["reversals.png"] * (joint is not None)
    from jointplay.model.meshes import FOLDER

    out = Outputs(options.out, names + [FOLDER] * bool({"mjcf", "proto"}.intersection(formats)))
    from jointplay.bridges.reduced_robot import BEYOND, ReducedRobot, refuse_without_play
    from jointplay.bridges.reduction import is_own, reduce, reduce_all

    posed = inputs.posed_machine(options, single=True)
    mechanism, pose = posed.mechanism, posed.poses.positions()
    free = posed.scenario.mechanism(posed.case).free_base is not None
    if free and not is_own(mechanism.description):
        raise JointplayError(
            "--base free: the files hold the base, as a URDF does; export from an MJCF with a free "
            "joint, or add <freejoint/> to the MJCF's first body"
        )
    if not (joint is None or options.joint or posed.of_file or joint in mechanism.gears):
        raise nothing_has_play(mechanism.joints)
    play = [*mechanism.clearance, *mechanism.gears] if joint is None else [joint]
    refuse_without_play(mechanism, play, formats, options.tilt)
    out.claim()
    how = given(options, "amplitude", "period") | {"progress": not options.quiet}
    rubs = posed.poses.holding["joint_friction"] or {}
    if joint is None:
        store = Path(options.out) / DONE
        how |= {"jobs": options.jobs, "store": store}
        reductions, refused = reduce_all(mechanism, pose, joint_friction=rubs, **how)
        notes += [f"not reduced: {why}" for why in refused.values()]
    else:
        reductions = [reduce(mechanism, joint, pose, joint_friction=rubs.get(joint), **how)]
    more: dict[str, Any] = {} if spread is None else {"spread": spread}
    remade = "mjcf" in formats and not is_own(mechanism.description)
    more |= {"servos": _servos(posed) if remade else {}}
    if more["servos"]:
        notes.append(f"servos (MJCF): {', '.join(more['servos'])}")
    from jointplay.scenario.assumptions import by_rule

    more |= given(options, "plugin") | {"encoder": _encoder(posed, reductions)}
    notes += by_rule(mechanism, "rotor_inertia")
    robot = ReducedRobot(mechanism, reductions, pose, formats, options.tilt, **more)
    contents: dict[str, Any] = {**robot.files(stem)}
    shown: Any = robot.table()
    if joint is not None:
        shown, how_found = robot.stated()
        notes.append(how_found)
    sentence, *coverage = robot.coverage
    notes += coverage
    if joint is not None:
        from jointplay.show.plots.design import reversals

        contents["reversals.png"] = reversals(reductions[0])
    body = "\n".join([str(shown), *notes, *robot.notes])
    print_answer(f"{sentence[0].upper()}{sentence[1:]}", body, posed.notes, options)
    meshes = robot.meshes
    with signals.keeping(f"the files in {options.out}"):
        if meshes:
            (Path(options.out) / FOLDER).mkdir()
        for name, data in meshes.items():
            files.write(Path(options.out) / FOLDER / name, data)
        out.write(contents)
        if joint is None:
            store.unlink()
    if options.check:
        lines = [*robot.check()]
        print(*lines, sep="\n")
        return int(any(BEYOND in line for line in lines))
    return 0


def _share(text: str) -> float:
    """A part of one: 0.2, or 20%."""
    try:
        part = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        raise JointplayError(f"--spread must be a number or a percentage, got {text!r}") from None
    return require_non_negative("--spread", part, "")


def _joint(options: argparse.Namespace) -> str:
    """The one joint that is named, by its gear or else by --joint; if that has no clearance of its
    own, it is no option any more.
    """
    geared = list(dict.fromkeys(name_and_number(one)[0] for one in options.gear))
    if not options.joint and len(geared) == 1 and geared != [inputs.ALL]:
        return geared[0]
    if len(options.joint) != 1:
        number = len(options.joint) or "none"
        raise JointplayError(
            f"--joint or --gear must name one joint, got {number}; --all reduces every one"
        )
    ((joint, length),) = inputs.named_joints(options).items()
    known = joint in geared or options.preset is not None or inputs.is_scenario(options)
    if known and length is None and options.clearance is None:
        options.joint = []  # its play is the scenario's, or its gear's alone
    return joint


def _encoder(posed: inputs.PosedMachine, reductions: Sequence[Any]) -> str:
    """Where the encoders of these joints sit, if all sit alike."""
    from jointplay.simulation.loads.drive import ENCODERS

    drives = posed.poses.holding["drive"]
    own = {one.joint: getattr(drives.get(one.joint), "encoder", ENCODERS[0]) for one in reductions}
    if len({*own.values()}) > 1:
        words = ", ".join(f"of {name} on the {side}" for name, side in own.items())
        raise JointplayError(f"encoders sit {words}: --encoder says where all of the file are")
    return next(iter(own.values()), ENCODERS[0])


def _servos(posed: inputs.PosedMachine) -> dict[str, Any]:
    from jointplay.simulation.loads.drive import Servo

    held = posed.poses.holding["drive"].items()
    return {name: one for name, one in held if isinstance(one, Servo)}
