"""`jointplay run`: simulate the cases of a scenario file, or one robot."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.commands import add_jobs, add_quiet, add_trust, add_unphysical, name_and_value
from jointplay.core import streams
from jointplay.core.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.scenario.settings import Setting


# Options of `jointplay run` that are names for keys of a scenario.
#
# Each is one setting, as if by ``--set KEY=VALUE``: the scenario's tables read its value, check
# it, and say what it is. In a key, ``JOINT`` stands for each joint of ``--joint``.


@dataclass(frozen=True)
class Flag:
    """An option, and the keys that its value is for."""

    name: str
    keys: tuple[str, ...]
    group: str
    metavar: str | tuple[str, ...] = "X"
    read: Callable[[str], Any] | None = None
    """From the text of the command line to a value of the scenario; None reads numbers."""

    @property
    def attribute(self) -> str:
        """Name of its value among the options."""
        return self.name.removeprefix("--").replace("-", "_")


def number(text: str) -> Any:
    """A number, or text with its unit, which the scenario reads."""
    try:
        return float(text)
    except ValueError:
        return text


def whole(text: str) -> Any:
    """A whole number, or what the scenario refuses."""
    try:
        return int(text)
    except ValueError:
        return text


def gravity(text: str) -> Any:
    """A word, or three components."""
    parts = text.split(",")
    return text if len(parts) == 1 else [number(part.strip()) for part in parts]


def as_local_path(text: str) -> str:
    """A path as seen from here, where a scenario would take it for one as seen from its file."""
    return text if text.startswith("jointplay:") else str(Path(text).resolve())


_JOINT = "joints.JOINT."

FLAGS = (
    Flag("--tool", ("robot.tool",), "robot", "FRAME", str),
    Flag("--gravity", ("robot.gravity",), "robot", "G", gravity),
    Flag("--radial", (f"{_JOINT}radial_clearance",), "clearance joint"),
    Flag("--axial", (f"{_JOINT}axial_clearance",), "clearance joint"),
    Flag("--clearance", (f"{_JOINT}clearance",), "clearance joint"),
    Flag("--bearing-radius", (f"{_JOINT}bearing_radius",), "clearance joint"),
    Flag("--bearing-length", (f"{_JOINT}bearing_length",), "clearance joint"),
    Flag("--journal-radius", (f"{_JOINT}journal_radius",), "clearance joint"),
    Flag("--journal-length", (f"{_JOINT}journal_length",), "clearance joint"),
    Flag(
        "--young",
        (f"{_JOINT}bearing_material.young", f"{_JOINT}journal_material.young"),
        "clearance joint",
    ),
    Flag(
        "--poisson",
        (f"{_JOINT}bearing_material.poisson", f"{_JOINT}journal_material.poisson"),
        "clearance joint",
    ),
    Flag("--stiffness", (f"{_JOINT}stiffness",), "clearance joint"),
    Flag("--axial-stiffness", (f"{_JOINT}axial_stiffness",), "clearance joint"),
    Flag("--law", (f"{_JOINT}normal.law",), "laws", "LAW", str),
    Flag("--restitution", (f"{_JOINT}restitution",), "laws"),
    Flag("--damping", (f"{_JOINT}normal.damping",), "laws"),
    Flag("--impact-mass", (f"{_JOINT}normal.mass",), "laws"),
    Flag(
        "--exponents",
        (f"{_JOINT}normal.n", f"{_JOINT}normal.p", f"{_JOINT}normal.q"),
        "laws",
        ("N", "P", "Q"),
    ),
    Flag("--friction", (f"{_JOINT}friction.mu_d",), "laws"),
    Flag(
        "--friction-speeds",
        (f"{_JOINT}friction.v0", f"{_JOINT}friction.v1"),
        "laws",
        ("V0", "V1"),
    ),
    Flag("--motion", ("motion.file",), "motion and drive", "FILE", as_local_path),
    Flag("--interpolation", ("motion.interpolation",), "motion and drive", "WORD", str),
    Flag("--bandwidth", ("drive.bandwidth",), "motion and drive"),
    Flag("--damping-ratio", ("drive.damping_ratio",), "motion and drive"),
    Flag("--seed", ("integration.seed",), "motion and drive", "N", whole),
    Flag("--start", ("integration.start",), "motion and drive", "WORD", str),
    Flag("--settle", ("integration.settle",), "motion and drive", "TIME"),
    Flag("--judge-from", ("integration.judge_from",), "motion and drive"),
    Flag("--step", ("integration.step",), "integration and output"),
    Flag("--duration", ("integration.duration",), "integration and output"),
    Flag("--integrator", ("integration.integrator",), "integration and output", "WORD", str),
    Flag("--macro-step", ("integration.macro_step",), "integration and output"),
    Flag("--tolerance", ("integration.tolerance",), "integration and output"),
    Flag("--record-every", ("output.record_every",), "integration and output", "N", whole),
)

MOST_CHOICES = 9
"""Words that an option's help lists."""

_LINEAR = ("linear-spring", "kelvin-voigt", "anagnostopoulos")
"""Laws whose stiffness is in N/m, and therefore their own."""


def option_settings(options: Any, joints: Sequence[str]) -> list[Setting]:
    """What the options say, as settings for all `joints`.

    Raises:
        JointplayError: one for a joint, and no joint; or friction of a joint that reads wrong.
    """
    from jointplay.scenario.settings import Setting

    entries = []
    for flag in FLAGS:
        given = getattr(options, flag.attribute)
        if given is None:
            continue
        read = flag.read or number
        values = [read(one) for one in (given if isinstance(given, list) else [given])]
        for index, key in enumerate(flag.keys):
            value = values[index if len(values) > 1 else 0]
            entries += [Setting(k, value, flag.name) for k in _keys(flag, key, joints, options)]
    if "drive.bandwidth" in {".".join(s.key) for s in entries} or options.damping_ratio is not None:
        entries.insert(0, Setting(("drive", "kind"), "computed-torque", "--bandwidth"))
    if options.allow_unphysical:
        entries.append(
            Setting(
                ("robot", "allow_unphysical"), list(options.allow_unphysical), "--allow-unphysical"
            )
        )
    return [*entries, *_friction(options.joint_friction)]


def _keys(flag: Flag, key: str, joints: Sequence[str], options: Any) -> list[tuple[str, ...]]:
    parts = tuple(key.split("."))
    if "JOINT" not in parts:
        return [parts]
    if flag.name == "--stiffness" and options.law in _LINEAR:
        parts = ("joints", "JOINT", "normal", "stiffness")
    if not joints:
        raise JointplayError(f"{flag.name} is for a joint with clearance; name it: --joint NAME")
    return [tuple(joint if part == "JOINT" else part for part in parts) for joint in joints]


def _friction(entries: Sequence[str]) -> list[Setting]:
    from jointplay.scenario.settings import Setting

    coefficients = []
    for entry in entries:
        name, _, values = entry.rpartition("=")
        parts = [number(value.strip()) for value in values.split(",")]
        if not name or len(parts) != 2:
            raise JointplayError(f"--joint-friction must read JOINT=COULOMB,VISCOUS, got {entry!r}")
        for key, value in zip(("coulomb", "viscous"), parts, strict=True):
            coefficients.append(Setting(("joint_friction", name, key), value, "--joint-friction"))
    return coefficients


@cache
def _schema() -> dict[str, Any]:
    from jointplay.scenario.schema import schema

    return schema()


def explanation(flag: Flag) -> str:
    """What the scenario's tables say of an option's key, with unit, choices and default."""
    parts = flag.keys[0].split(".")
    text = " ".join((_described(_schema(), _schema(), parts) or "").split())
    choices = _choices(_schema(), _schema(), parts)
    text = text.replace("``", "").replace("`", "").rstrip(".")
    if choices and len(choices) < MOST_CHOICES:
        text = f"{text}: {', '.join(choices)}" if text else ", ".join(choices)
    elif choices:
        text = f"{text or 'one'} of {len(choices)}, see docs/laws.md: {', '.join(choices[:3])} ..."
    known = [default for key in flag.keys if (default := default_of(key.split(".")))]
    default = f" (default {' '.join(dict.fromkeys(known))})" if known else ""
    return f"{text}{default}: {flag.keys[0]}".removeprefix(": ").replace("%", "%%")


def default_of(key: Sequence[str]) -> str:
    """What holds for a bare robot of which a key is not given, as text; empty if nothing does."""
    from jointplay.core.schema import default_at
    from jointplay.scenario.model import Model
    from jointplay.scenario.robot import JOINTS

    if key[0] == "joints":
        taken = {**JOINTS["prismatic"], **JOINTS["revolute"]}.get(key[2])
        if taken is not None:
            return f"{taken:g}"
    value = default_at(Model, key)
    if isinstance(value, float | int):
        return f"{value:g}"
    return value if isinstance(value, str) else ""


def _choices(whole_schema: dict[str, Any], part: Any, path: Sequence[str]) -> list[str]:
    """Words that the key at `path` can be, in all tables that have it."""
    if "$ref" in part:
        return _choices(whole_schema, whole_schema["$defs"][part["$ref"].rpartition("/")[2]], path)
    if not path:
        words = [part["const"]] if "const" in part else part.get("enum", [])
        choices = [word for word in words if isinstance(word, str)]
    else:
        choices = []
        inner = part.get("properties", {}).get(path[0])
        if inner is None and isinstance(part.get("additionalProperties"), dict):
            inner = part["additionalProperties"]
        if inner is not None:
            choices = _choices(whole_schema, inner, path[1:])
    for choice in (*part.get("anyOf", ()), *part.get("oneOf", ())):
        choices += [word for word in _choices(whole_schema, choice, path) if word not in choices]
    return choices


def _described(whole_schema: dict[str, Any], part: Any, path: Sequence[str]) -> str | None:
    """Description of the key at `path` within `part` of a JSON schema; None if it has none."""
    while "$ref" in part:
        part = whole_schema["$defs"][part["$ref"].rpartition("/")[2]] | {
            key: value for key, value in part.items() if key != "$ref"
        }
    if not path:
        return str(part.get("description", "")) or None
    inner = part.get("properties", {}).get(path[0])
    if inner is None and isinstance(part.get("additionalProperties"), dict):
        inner = part["additionalProperties"]
    if inner is not None:
        return _described(whole_schema, inner, path[1:])
    for choice in (*part.get("anyOf", ()), *part.get("oneOf", ()), *part.get("allOf", ())):
        text = _described(whole_schema, choice, path)
        if text is not None:
            return text
    return None


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
    for flag in FLAGS:
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
    known = {flag.name: flag for flag in FLAGS}
    for action in parser._actions:
        for name in action.option_strings:
            if name in known:
                action.help = explanation(known[name])


def run(options: argparse.Namespace) -> int:
    """Make the scenario that the options describe, and run it."""
    from pathlib import Path

    from jointplay.commands import run_scenario
    from jointplay.scenario.robot import LABEL, is_robot

    target = options.urdf or options.target
    if not options.resume and (target is None or options.urdf or is_robot(target)):
        run_scenario.check_output_folder(Path(options.out), {LABEL: f"{LABEL}.nc"})
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
        scenario = _of_robot(options, target, given)
        for line in scenario.assumptions:
            streams.note(line)
    else:
        _require_known(target)
        joints = options.joint or _joints(options.target, options.trust)
        settings = [*option_settings(options, joints), *given]
        scenario = Scenario.load(options.target, options.trust, settings)
        if options.ideal:
            raise JointplayError(
                "--ideal is for a robot; of a scenario's joint say --set joints.NAME.ideal=true"
            )
    return scenario


def _of_robot(options: argparse.Namespace, target: str | None, given: list[Setting]) -> Scenario:
    """The scenario of a bare robot."""
    from jointplay.result.settings import Integration, Recording
    from jointplay.scenario.robot import robot_scenario, step_for
    from jointplay.scenario.settings import Setting

    joints, own = _with_lengths(options.joint)
    joints = joints or ([] if target is not None or options.ideal else ["joint_b"])
    for name in ("case", "jobs", "trust"):
        if getattr(options, name):
            raise JointplayError(f"--{name} needs a scenario: jointplay run FILE --{name} ...")
    settings = [*option_settings(options, joints), *own, *given]
    scenario = robot_scenario(target, joints, settings, options.ideal)
    data = scenario.data(scenario.cases[0])
    chosen = target is not None and "step" not in data.get("integration", {})
    choice = step_for(scenario) if chosen else None
    if choice is None:
        return scenario
    step, reason = choice
    settings.append(Setting(("integration", "step"), step, "step chosen"))
    if "record_every" not in data.get("output", {}):  # records as far apart as usual
        every = round(Recording.record_every * Integration.step / step)
        settings.append(Setting(("output", "record_every"), every, "step chosen"))
    scenario = robot_scenario(target, joints, settings, options.ideal)
    scenario.assumptions.append(f"step: {step:g} s (chosen: {reason}; --step takes another)")
    return scenario


def _with_lengths(entries: list[str]) -> tuple[list[str], list[Setting]]:
    """Names of joints, and the clearance of those that are given as NAME=LENGTH."""
    from jointplay.scenario.settings import Setting

    names, lengths = [], []
    for entry in entries:
        name, length = name_and_value(entry)
        names.append(name)
        if length is not None:
            key = ("joints", name, "clearance")
            lengths.append(Setting(key, number(length), f"--joint {entry}"))
    return names, lengths


def _require_known(target: str) -> None:
    """Refuse what is neither a scenario file nor looks like one: perhaps a robot's name gone wrong.

    Raises:
        JointplayError: with the robots whose names resemble it.
    """
    import difflib
    from pathlib import Path

    from jointplay.core.files import is_file
    from jointplay.mechanism.robots import robots

    if is_file(Path(target)) or Path(target).suffix or "/" in target or ":" in target:
        return
    try:
        known = robots()
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
