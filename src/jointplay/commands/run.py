"""`jointplay run`: simulate the cases of a scenario file, or one robot."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from jointplay.commands import add_jobs, add_quiet, add_trust, add_unphysical, flags
from jointplay.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.scenario.settings import Setting


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
    group.add_argument(
        "--resume",
        action="store_true",
        help="go on with the runs in DIR that were interrupted, bit for bit; finished ones stay",
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
        metavar="NAME[=LENGTH]",
        help="joint that has clearance, its own or that of --clearance, and that the options of "
        "this and the next group are for (repeatable)",
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
    from pathlib import Path

    from jointplay.commands import resuming, run_scenario
    from jointplay.scenario.robot import LABEL, is_robot

    target = options.urdf or options.target
    if not options.resume and (target is None or options.urdf or is_robot(target)):
        resuming.refuse(Path(options.out), {LABEL: f"{LABEL}.nc"})
    return run_scenario.run(scenario_of(options), options)


def scenario_of(options: argparse.Namespace) -> Scenario:
    """The scenario that the options of `add_inputs` describe.

    Raises:
        JointplayError: options that do not go together, or what they name is not there.
    """
    from jointplay.scenario import Scenario
    from jointplay.scenario.robot import is_robot
    from jointplay.scenario.settings import parse

    if options.target is not None and options.urdf is not None:
        raise JointplayError(f"--urdf {options.urdf} beside {options.target}: give one robot")
    given = [parse(text) for text in options.set]
    target = options.urdf or options.target
    if target is None or options.urdf or is_robot(target):
        scenario, told = _of_robot(options, target, given)
        if told:
            print(told, file=sys.stderr)
    else:
        _require_known(target)
        joints = options.joint or _joints(options.target, options.trust)
        settings = [*flags.settings(options, joints), *given]
        scenario = Scenario.load(options.target, options.trust, settings)
        if options.ideal:
            raise JointplayError(
                "--ideal is for a robot; of a scenario's joint say --set joints.NAME.ideal=true"
            )
    return scenario


def _of_robot(
    options: argparse.Namespace, target: str | None, given: list[Setting]
) -> tuple[Scenario, str]:
    """The scenario of a bare robot, and what the user must be told of it."""
    from jointplay.scenario.model import Integration, Output
    from jointplay.scenario.robot import robot_scenario, step_for
    from jointplay.scenario.settings import Setting

    joints, own = _with_lengths(options.joint)
    joints = joints or ([] if target is not None or options.ideal else ["joint_b"])
    for name in ("case", "jobs", "trust"):
        if getattr(options, name):
            raise JointplayError(f"--{name} needs a scenario: jointplay run FILE --{name} ...")
    settings = [*flags.settings(options, joints), *own, *given]
    scenario, told = robot_scenario(target, joints, settings, options.ideal)
    data = scenario.data(scenario.cases[0])
    chosen = target is not None and "step" not in data.get("integration", {})
    choice = step_for(scenario) if chosen else None
    if choice is None:
        return scenario, told
    step, reason = choice
    settings.append(Setting(("integration", "step"), step, "step chosen"))
    if "record_every" not in data.get("output", {}):  # records as far apart as usual
        every = round(Output.record_every * Integration.step / step)
        settings.append(Setting(("output", "record_every"), every, "step chosen"))
    scenario, told = robot_scenario(target, joints, settings, options.ideal)
    return scenario, f"{told}\nstep: {step:g} s (chosen: {reason}; --step takes another)"


def _with_lengths(entries: list[str]) -> tuple[list[str], list[Setting]]:
    """Names of joints, and the clearance of those that are given as NAME=LENGTH."""
    from jointplay.scenario.settings import Setting

    names, lengths = [], []
    for entry in entries:
        name, equals, length = entry.partition("=")
        names.append(name)
        if equals:
            key = ("joints", name, "clearance")
            lengths.append(Setting(key, flags.number(length), f"--joint {entry}"))
    return names, lengths


def _require_known(target: str) -> None:
    """Refuse what is neither a scenario file nor looks like one: perhaps a robot's name gone wrong.

    Raises:
        JointplayError: with the robots whose names resemble it.
    """
    import difflib
    from pathlib import Path

    from jointplay.host.files import is_file
    from jointplay.mechanism.robots import names

    if is_file(Path(target)) or Path(target).suffix or "/" in target or ":" in target:
        return
    try:
        known = names()
    except JointplayError as error:
        raise JointplayError(f"no file {target!r}, and {error}") from None
    near = [name for name in known if target.lower() in name] or difflib.get_close_matches(
        target.lower().replace("-", "_"), known
    )
    similar = f"; did you mean {', '.join(near)}?" if near else ""
    raise JointplayError(
        f"{target!r} is no file and no robot{similar} (jointplay robots lists all)"
    )


def _joints(path: str, trust: list[str]) -> list[str]:
    """Names of the joints with clearance, if the file has just one; none otherwise."""
    from jointplay.scenario import Scenario

    scenario = Scenario.load(path, trust)
    named = {name for case in scenario.cases for name in scenario.model(case).joints}
    return list(named) if len(named) == 1 else []
