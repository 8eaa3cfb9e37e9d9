"""`jointplay run`: simulate the cases of a scenario file, or one robot."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from jointplay.commands import add_jobs, add_quiet, add_trust, add_unphysical, flags
from jointplay.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.scenario import Scenario


def add(commands: Any) -> None:
    """Add the command's parser."""
    run = commands.add_parser(
        "run",
        usage="jointplay run [FILE | ROBOT] --out DIR [--set KEY=VALUE ...] [options]",
        help="simulate the cases of a scenario file, or one robot",
        description="Simulate all cases of a scenario file, or one robot with clearance in the "
        "joints named, and draw figures that compare the cases. Without FILE or ROBOT: the SCARA "
        "arm under gravity, 0.2 mm in joint B, 3 s. Options count more than what FILE says.",
        epilog="DIR receives result.nc, or a .nc for each case (read it with jointplay.Result.load "
        "or any NetCDF reader), and the figures as .png and .pdf.",
        lazy=explain,
    )
    run.add_argument("--out", metavar="DIR", required=True, help="folder for the results")
    group = add_inputs(run)["integration and output"]
    group.add_argument(
        "--certify",
        action="store_true",
        help="run again more finely, and give the headline figures with their numerical errors; "
        "takes some ten times as long",
    )
    group.add_argument("--no-figures", action="store_true", help="write no figures")
    add_quiet(group)
    run.set_defaults(handler=execute)


def add_inputs(run: Any) -> dict[str, Any]:
    """Add the options that say what is simulated; returns their groups."""
    run.add_argument(
        "target",
        nargs="?",
        metavar="FILE | ROBOT",
        help="scenario (TOML; see jointplay init, jointplay check), URDF, or name of a robot of "
        "example-robot-data such as ur5",
    )
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help='any key of the scenario, such as joints.joint_b.radial_clearance="0.3 mm" '
        "(repeatable; keys: docs/scenarios.md)",
    )
    group = run.add_argument_group("cases of FILE")
    group.add_argument(
        "--case",
        action="append",
        default=[],
        metavar="NAME",
        help="run only this case (repeatable)",
    )
    add_jobs(group)
    add_trust(group)
    groups: dict[str, Any] = {"robot": run.add_argument_group("robot")}
    group = groups["robot"]
    group.add_argument("--urdf", metavar="ROBOT", help="the same as ROBOT")
    group.add_argument("--ideal", action="store_true", help="no clearance anywhere")
    add_unphysical(group)
    groups["clearance joint"] = run.add_argument_group("clearance joint")
    groups["clearance joint"].add_argument(
        "--joint",
        action="append",
        default=[],
        metavar="NAME",
        help="joint that has clearance, and that the options of this and the next group are for "
        "(repeatable)",
    )
    for flag in flags.FLAGS:
        if flag.group not in groups:
            groups[flag.group] = run.add_argument_group(flag.group)
        groups[flag.group].add_argument(
            flag.name,
            metavar=flag.metavar,
            nargs=len(flag.metavar) if isinstance(flag.metavar, tuple) else None,
        )
    groups["motion and drive"].add_argument(
        "--joint-friction",
        action="append",
        default=[],
        metavar="JOINT=C,V",
        help="Coulomb [N m or N] and viscous [N m s or N s/m] friction (repeatable; default: "
        "the URDF's)",
    )
    return groups


def explain(parser: argparse.ArgumentParser) -> None:
    """Fill in what the scenario's tables say; only who asks for help waits for them."""
    known = {flag.name: flag for flag in flags.FLAGS}
    for action in parser._actions:
        for name in action.option_strings:
            if name in known:
                action.help = flags.explanation(known[name])


def execute(options: argparse.Namespace) -> int:
    """Make the scenario that the options describe, and run it."""
    from jointplay.commands import run_scenario

    return run_scenario.run(scenario_of(options), options)


def scenario_of(options: argparse.Namespace) -> Scenario:
    """The scenario that the options of `add_inputs` describe.

    Raises:
        JointplayError: options that do not go together, or what they name is not there.
    """
    from jointplay.scenario import Scenario
    from jointplay.scenario.robot import is_robot, robot_scenario
    from jointplay.scenario.settings import parse

    if options.target is not None and options.urdf is not None:
        raise JointplayError(f"--urdf {options.urdf} beside {options.target}: give one robot")
    given = [parse(text) for text in options.set]
    target = options.urdf or options.target
    if target is None or options.urdf or is_robot(target):
        joints = options.joint or ([] if target is not None or options.ideal else ["joint_b"])
        for name in ("case", "jobs", "trust"):
            if getattr(options, name):
                raise JointplayError(f"--{name} needs a scenario: jointplay run FILE --{name} ...")
        settings = [*flags.settings(options, joints), *given]
        scenario, told = robot_scenario(target, joints, settings, options.ideal)
        if told:
            print(told, file=sys.stderr)
    else:
        joints = options.joint or _joints(options.target, options.trust)
        settings = [*flags.settings(options, joints), *given]
        scenario = Scenario.load(options.target, options.trust, settings)
        if options.ideal:
            raise JointplayError(
                "--ideal is for a robot; of a scenario's joint say --set joints.NAME.ideal=true"
            )
    return scenario


def _joints(path: str, trust: list[str]) -> list[str]:
    """Names of the joints with clearance, if the file has just one; none otherwise."""
    from jointplay.scenario import Scenario

    scenario = Scenario.load(path, trust)
    named = {name for case in scenario.cases for name in scenario.model(case).joints}
    return list(named) if len(named) == 1 else []
