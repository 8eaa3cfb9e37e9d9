"""Every input option changes the answer of every command that takes it, or is refused by name."""

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from functools import cache

import pytest
from test_command_inputs import CALLS

from jointplay import JointplayError
from jointplay.accuracy.poses import read_pose
from jointplay.cli import main, parser, parsers
from jointplay.cli.commands import inputs
from jointplay.cli.commands.study import hunting

STANDING = ("budget", "allocate", "export simulator", "identify")
"""Commands that evaluate poses."""
ANSWERS = {"budget": ["--payload", "0.2 kg"], "allocate": []}
"""Commands that are fast enough to compare their answers, and the arguments added for that."""
BODIES = ("calibrate", "export urdf")
"""Commands that take the robot alone, without a motion."""
MACHINES = {
    "journals": (["ur5", "--joint", "elbow_joint=0.05 mm"], "elbow_joint", "wrist_1_joint"),
    "gears": (["ar4", "--gear", "joint_2=1 deg"], "joint_2", "joint_3"),
    "file": (["jointplay:scara.toml", "--case", "0.2 mm"], "joint_b", "joint_a"),
}
"""Arguments that name a machine; its joint with play, unless an option removes it; a joint without.
"""
OPTIONS = {name for group in inputs.OPTIONS.values() for name in group} | {
    flag.name for flag in inputs.FLAGS
}
ELSEWHERE = {"--case": "of several", "--import": "of what a file names", "--xacro": "of xacro"}
"""Options that do not apply to these machines, and what they are for."""
OWN = {
    *("study wear --joint", "study dynamics --joint", "calibrate --payload"),
    "study hunting --poses",
}
"""Options that have another meaning in a command."""
SAID = {
    *(f"{command} --base" for command in STANDING),
    *(f"{command} --allow-unphysical" for command in ANSWERS),
}
"""Options without effect on a command, which its answer says or which have nothing to act on."""


def values(loose, tight, folder):
    """Arguments for each option: a value, and further options that it needs."""
    poses = folder / "poses.csv"
    poses.write_text(f"{tight}\n0.1\n0.2\n")
    motion = folder / "motion.csv"
    motion.write_text(f"time_s,{tight}\n0,0.3\n0.5,0.4\n1,0.4\n1.5,0.3\n2,0.3\n2.5,0.4\n")
    return {
        "--set": ["robot.gravity=[0, 0, -1]"], "--allow-unphysical": ["all"], "--fix": [tight],
        "--tool": ["base_link"], "--gravity": ["0,0,-2"], "--base": ["free"],
        "--joint": [f"{tight}=0.07 mm"], "--clearance": ["0.13 mm"], "--ideal": [],
        "--preset": ["ur-like"], "--axial-clearance": ["0.3 mm"], "--bearing-radius": ["12 mm"],
        "--bearing-length": ["33 mm"], "--journal-radius": ["9.9 mm"],
        "--journal-length": ["50 mm"], "--gear": [f"{tight}=0.5 deg"], "--gear-stiffness": ["4e4"],
        "--gear-damping": ["11"], "--rotor-inertia": ["0.07"], "--young": ["71 GPa"],
        "--poisson": ["0.23"], "--stiffness": ["3e9"], "--axial-stiffness": ["4e9"],
        "--law": ["flores"], "--restitution": ["0.61"],
        "--damping": ["17", "--law=kelvin-voigt", "--damping=16"],
        "--impact-mass": ["0.9", "--law=anagnostopoulos", "--impact-mass=0.8"],
        "--friction": ["0.27"],
        "--motion": [str(motion)], "--interpolation": ["spline", f"--motion={motion}"],
        "--joint-friction": [f"{loose}=0.7,0.2"], "--bandwidth": ["37"], "--damping-ratio": ["0.6"],
        "--encoder": ["link"], "--payload": ["0.5 kg"], "--seed": ["3"], "--start": ["rest"],
        "--settle": ["0.1 s"], "--judge-from": ["0.1 s"], "--step": ["21 us"],
        "--duration": ["1.7 s"], "--integrator": ["rk4"], "--macro-step": ["0.2 ms"],
        "--tolerance": ["0.01"], "--record-every": ["7"], "--pose": [f"{tight}=0.3 rad"],
        "--poses": [str(poses)], "--workspace": ["5"], "--force": ["0,0,-9"],
        "--whole": ["calibrated-industrial"],
        "--causes": ["play", "--whole=calibrated-industrial"],
        "--registers": ["P=16"],
    }  # fmt: skip


@cache
def looked_at(command, *words):
    """What the command makes of the options, as text: its answer, or its inputs."""
    if command in ANSWERS:
        with redirect_stdout(io.StringIO()) as answer, redirect_stderr(io.StringIO()) as error:
            failed = main([*words, "--detail"])
        if failed:
            raise JointplayError(error.getvalue())
        return answer.getvalue()
    options = parser().parse_args(words)
    if command == "study hunting":
        hunting.refuse_journals(options)
        simulation = inputs.scenario_of(options).simulation(options.case)
        held = read_pose(simulation.mechanism, "".join(options.pose))
        return json.dumps([simulation.describe(), repr(simulation.drive), held], default=str)
    if command in STANDING:
        posed = inputs.posed_machine(options, single=command == "export simulator")
        found = [posed.mechanism.describe(), posed.poses.q.tolist(), repr(posed.poses.holding)]
        return json.dumps(found, default=str)
    if isinstance(options.case, list):
        options.case = next(iter(options.case), None)  # runs take several
    scenario = inputs.scenario_of(options, moves=command not in BODIES)
    if command in BODIES:
        return json.dumps(scenario.mechanism(options.case).describe(), default=str)
    simulation = scenario.simulation(options.case)
    return json.dumps([simulation.describe(), repr(simulation.drive)], default=str)


def alike():
    """Commands, one for each group that takes the same options in the same way."""
    found = {}
    for command in CALLS:
        taken = {word for one in parsers()[command]._actions for word in one.option_strings}
        words = tuple(sorted(taken & OPTIONS))
        apart = command if command in ANSWERS else (command in STANDING, command in BODIES)
        found.setdefault((words, apart), command)
    return {command: words for (words, _), command in found.items()}


def line_of(command, machine, takes):
    """The command line for the machine, with play in one of its joints."""
    words, loose, _ = MACHINES[machine]
    more = [word for word in CALLS[command] if word not in ("--joint", "joint_b")]
    if command == "study wear":
        more += ["--joint", loose]
    if command == "study hunting" and machine == "journals":
        words = [words[0], "--gear", f"{loose}=1 deg"]
    if not takes.issuperset(words[1:2]):
        words = [words[0], "--set", f"joints.{loose}.radial_clearance=0.05 mm"]
    return [*command.split(), *words, *more, *ANSWERS.get(command, [])]


def outcome(command, line, option, value, *beside):
    """What is wrong with a command's answer to an option; None if it acts or is refused."""
    try:
        plain = looked_at(command, *line, *beside)
        given = [option, *[value][: bool(value)]]
        found = looked_at(command, *line, *beside, *given)
    except JointplayError as error:
        about = [
            option,
            *(one.partition("=")[0] for one in beside),
            *option.strip("-").split("-"),
            *value.partition("=")[:1],
        ]
        named = any(len(word) > 4 and word in str(error) for word in about)
        return None if named else f"{command} {option}: {error}"
    return f"{command} {option}" if found == plain else None


@pytest.mark.thorough
@pytest.mark.parametrize("machine", MACHINES)
def test_each_option_of_each_command_acts_or_is_refused_by_name(machine, tmp_path):
    idle = {"--bandwidth", "--interpolation"} if machine == "file" else set()  # gravity, joint_a
    given, silent = values(*MACHINES[machine][1:], tmp_path), []
    for command, takes in alike().items():
        known = {option for option in takes if f"{command} {option}" not in OWN}
        line = line_of(command, machine, known)
        for option in sorted(known - set(ELSEWHERE) - (idle if command in ANSWERS else set())):
            if f"{command} {option}" not in SAID:
                silent.append(outcome(command, line, option, *(given[option] or [""])))
    assert not any(silent), "\n".join(filter(None, silent))
