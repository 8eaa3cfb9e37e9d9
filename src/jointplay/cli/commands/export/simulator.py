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

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from jointplay.base import files, signals
from jointplay.base.errors import JointplayError, NothingHasPlay, require_non_negative
from jointplay.base.pairs import ALL, name_and_number
from jointplay.bridges.reduced_formats import FORMATS, choose
from jointplay.cli.commands import Outputs, given, inputs, print_answer
from jointplay.cli.options import ANGLE, FLAG, REPEATED, TIME, Number, Parser

DONE = "joints.runs"
"""File of the finished joints, until all are."""


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
    add("--spread", metavar="SHARE", type=Number(""), help="JSON: relative half width of ranges "
        "without measured values, such as 20% (default: 0.3)")
    add("--check", **FLAG, help="run the MJCF in MuJoCo and compare it with the full model; exit "
        "status 1 if it differs by more than is stated")
    add = parser.add_argument_group("whole robot").add_argument
    add("--all", **FLAG, help="write all joints with play into one file of each format")
    add("--plugin", metavar="NAME", help="URDF: hardware of ros2_control's tags (default: "
        "gz_ros2_control/GazeboSimSystem)")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    require_non_negative("--spread", options.spread or 0.0, "")
    joint = None if options.all else _joint(options)
    stem = "robot" if joint is None else files.names_for([joint], "")[0]
    formats, notes = choose(options.format, options.tilt, getattr(options, "for"))
    if options.check and "mjcf" not in formats:
        raise JointplayError(
            "--check runs the MJCF in MuJoCo: it needs --format mjcf or --for mujoco, and mujoco"
        )
    endings = [ending for kind in formats for ending in FORMATS[kind]]
    names = [f"{stem}{ending}" for ending in endings] + ["reversals.png"] * (joint is not None)
    from jointplay.model.meshes import FOLDER, write_meshes

    out = Outputs(options.out, names + [FOLDER] * bool({"mjcf", "proto"}.intersection(formats)))
    from jointplay.bridges.reduced_robot import EXCEEDS, ReducedRobot, refuse_without_play
    from jointplay.bridges.reduction import from_mjcf_file

    posed = inputs.posed_machine(options, single=True)
    mechanism = posed.mechanism
    free = posed.scenario.mechanism(posed.case).free_base is not None
    if free and not from_mjcf_file(mechanism.description):
        raise JointplayError(
            "--base free: the files hold the base, as a URDF does; export from an MJCF with a free "
            "joint, or add <freejoint/> to the MJCF's first body"
        )
    if not (joint is None or options.joint or posed.of_file or joint in mechanism.gears):
        raise NothingHasPlay(mechanism.joints)
    play = [*mechanism.clearance, *mechanism.gears] if joint is None else [joint]
    refuse_without_play(mechanism, play, formats, options.tilt)
    out.claim()
    store = Path(options.out) / DONE
    reversal = given(options, "amplitude", "period") | {"progress": not options.quiet}
    reversal |= {"jobs": options.jobs, "store": store} if joint is None else {}
    robot, further = ReducedRobot.of(
        posed, joint, formats, options.tilt, reversals=reversal,
        **given(options, "plugin", "spread"),
    )  # fmt: skip
    notes += further
    contents: dict[str, Any] = {**robot.files(stem)}
    shown: Any = robot.table()
    if joint is not None:
        shown, how_found = robot.stated()
        notes.append(how_found)
    sentence, *coverage = robot.coverage
    notes += coverage
    if joint is not None:
        from jointplay.show.plots.design import reversals

        contents["reversals.png"] = reversals(robot.reductions[0])
    body = "\n".join([str(shown), *notes, *robot.notes])
    print_answer(f"{sentence[0].upper()}{sentence[1:]}", body, posed.notes, options)
    meshes = robot.meshes
    with signals.keeping(f"the files in {options.out}"):
        write_meshes(Path(options.out), meshes)
        out.write(contents)
        if joint is None:
            store.unlink()
    if options.check:
        lines = [*robot.check()]
        print(*lines, sep="\n")
        return int(any(EXCEEDS in line for line in lines))
    return 0


def _joint(options: argparse.Namespace) -> str:
    """The joint to reduce, named by its --gear or else by --joint; a --joint that only names it,
    without a clearance, is removed from the options."""
    geared = list(dict.fromkeys(name_and_number(text)[0] for text in options.gear))
    if not options.joint and len(geared) == 1 and geared != [ALL]:
        return geared[0]
    if len(options.joint) != 1:
        number = len(options.joint) or "none"
        raise JointplayError(
            f"--joint or --gear must name one joint, got {number}; --all reduces every one"
        )
    ((joint, length),) = inputs.named_joints(options).items()
    known = joint in geared or options.preset is not None or inputs.is_scenario(options)
    if known and length is None and options.clearance is None:
        options.joint = []  # its play is the scenario's or the gear's
    return joint
