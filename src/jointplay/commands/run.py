"""`jointplay run`: simulate the cases of a scenario file, or one robot."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.commands import add_option, add_repeatable, add_shared, add_switch, name_and_value
from jointplay.commands.mechanism import robot_settings
from jointplay.core import streams
from jointplay.core.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.scenario.presets import Preset
    from jointplay.scenario.settings import Setting


def number(text: str) -> Any:
    """A number, or text with its unit, which the scenario reads or refuses."""
    from jointplay.core.units import plain_number

    with suppress(ValueError):
        value = plain_number(text)
        return int(text) if text.strip().lstrip("+-").isdecimal() else value
    return text


def gravity(text: str) -> Any:
    """A word, or three components."""
    parts = text.split(",")
    return text if len(parts) == 1 else [number(part.strip()) for part in parts]


def as_local_path(text: str) -> str:
    """A path as seen from here, where a scenario would take it for one as seen from its file."""
    return text if text.startswith("jointplay:") else str(Path(text).resolve())


_OPTIONS = {
    "robot": {
        "--tool FRAME": "robot.tool",
        "--gravity G": "robot.gravity",
        "--base WORD": "robot.base",
    },
    "clearance joint": {
        "--radial X": "joints.JOINT.radial_clearance",
        "--axial X": "joints.JOINT.axial_clearance",
        "--clearance X": "joints.JOINT.clearance",
        "--bearing-radius X": "joints.JOINT.bearing_radius",
        "--bearing-length X": "joints.JOINT.bearing_length",
        "--journal-radius X": "joints.JOINT.journal_radius",
        "--journal-length X": "joints.JOINT.journal_length",
        "--young X": "joints.JOINT.bearing_material.young joints.JOINT.journal_material.young",
        "--poisson X": "joints.JOINT.bearing_material.poisson "
        "joints.JOINT.journal_material.poisson",
        "--stiffness X": "joints.JOINT.stiffness",
        "--axial-stiffness X": "joints.JOINT.axial_stiffness",
    },
    "laws": {
        "--law LAW": "joints.JOINT.normal.law",
        "--restitution X": "joints.JOINT.restitution",
        "--damping X": "joints.JOINT.normal.damping",
        "--impact-mass X": "joints.JOINT.normal.mass",
        "--exponents N P Q": "joints.JOINT.normal.n joints.JOINT.normal.p joints.JOINT.normal.q",
        "--friction X": "joints.JOINT.friction.mu_d",
        "--friction-speeds V0 V1": "joints.JOINT.friction.v0 joints.JOINT.friction.v1",
    },
    "motion and drive": {
        "--motion FILE": "motion.file",
        "--interpolation WORD": "motion.interpolation",
        "--bandwidth X": "drive.bandwidth",
        "--damping-ratio X": "drive.damping_ratio",
        "--seed N": "integration.seed",
        "--start WORD": "integration.start",
        "--settle TIME": "integration.settle",
        "--judge-from X": "integration.judge_from",
    },
    "integration and output": {
        "--step X": "integration.step",
        "--duration X": "integration.duration",
        "--integrator WORD": "integration.integrator",
        "--macro-step X": "integration.macro_step",
        "--tolerance X": "integration.tolerance",
        "--record-every N": "output.record_every",
    },
}
"""Options that are names for keys of a scenario, by group, with what stands for their values.

Each is one setting, as if by ``--set KEY=VALUE``: the scenario's tables read its value, check it,
and say what it is. In a key, ``JOINT`` stands for each joint of ``--joint``. Where there are two
keys, one value is for both.
"""

_READERS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("FRAME", "LAW", "WORD"), str),
    "FILE": as_local_path,
    "G": gravity,
}
"""From the text of the command line to a value of the scenario; other values are numbers."""


@dataclass(frozen=True)
class Flag:
    """An option, and the keys that its value is for."""

    name: str
    metavar: tuple[str, ...]
    keys: tuple[str, ...]
    group: str

    @property
    def read(self) -> Callable[[str], Any]:
        """From the text of the command line to a value of the scenario."""
        return _READERS.get(self.metavar[0], number)

    @property
    def attribute(self) -> str:
        """Name of its value among the options."""
        return self.name.removeprefix("--").replace("-", "_")


FLAGS = tuple(
    Flag(words.split()[0], tuple(words.split()[1:]), tuple(keys.split()), group)
    for group, options in _OPTIONS.items()
    for words, keys in options.items()
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
        values = [flag.read(one) for one in (given if isinstance(given, list) else [given])]
        for index, key in enumerate(flag.keys):
            value = values[index if len(values) > 1 else 0]
            entries += [Setting(k, value, flag.name) for k in _keys(flag, key, joints, options)]
    if options.bandwidth is not None or options.damping_ratio is not None:
        entries.insert(0, Setting(("drive", "kind"), "computed-torque", "--bandwidth"))
    return [*entries, *robot_settings(options), *_friction(options.joint_friction)]


def _keys(flag: Flag, key: str, joints: Sequence[str], options: Any) -> list[tuple[str, ...]]:
    """The key of an option, for each joint if it is a joint's."""
    parts = tuple(key.split("."))
    if "JOINT" not in parts:
        return [parts]
    if flag.name == "--stiffness" and options.law in _LINEAR:
        parts = ("joints", "JOINT", "normal", "stiffness")
    if not joints:
        raise JointplayError(f"{flag.name} is for a joint with clearance; name it: --joint NAME")
    return [tuple(joint if part == "JOINT" else part for part in parts) for joint in joints]


def _friction(entries: Sequence[str]) -> list[Setting]:
    """Settings of the joints' friction."""
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


def explanation(flag: Flag, schema: Mapping[str, Any]) -> str:
    """What the JSON schema of scenarios says of an option's key, with choices and default."""
    found = list(_schemas_at(schema, schema, flag.keys[0].split(".")))
    text = next((one["description"] for one in found if one.get("description")), "")
    text = " ".join(text.split()).replace("`", "").rstrip(".")
    words = [word for one in found for word in (one.get("const"), *one.get("enum", ()))]
    choices = list(dict.fromkeys(word for word in words if isinstance(word, str)))
    if choices and len(choices) < MOST_CHOICES:
        text = f"{text}: {', '.join(choices)}" if text else ", ".join(choices)
    elif choices:
        text = f"{text or 'one'} of {len(choices)}, see docs/laws.md: {', '.join(choices[:3])} ..."
    known = [default for key in flag.keys if (default := default_of(key.split(".")))]
    default = f" (default {' '.join(dict.fromkeys(known))})" if known else ""
    return f"{text}{default}: {flag.keys[0]}".removeprefix(": ").replace("%", "%%")


def _schemas_at(
    schema: Mapping[str, Any], part: Mapping[str, Any], path: Sequence[str]
) -> Iterator[Mapping[str, Any]]:
    """What all tables that have the key at `path` within `part` of a JSON schema say of it."""
    if "$ref" in part:
        named = schema["$defs"][part["$ref"].rpartition("/")[2]]
        part = {**named, **{key: value for key, value in part.items() if key != "$ref"}}
    if not path:
        yield part
    else:
        inner = part.get("properties", {}).get(path[0], part.get("additionalProperties"))
        if isinstance(inner, Mapping):
            yield from _schemas_at(schema, inner, path[1:])
    for choice in (*part.get("anyOf", ()), *part.get("oneOf", ())):
        yield from _schemas_at(schema, choice, path)


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
        "joints named, and draw figures that compare the cases. Without FILE or "
        "ROBOT: the SCARA arm under gravity, 0.2 mm in joint B, 3 s. Options "
        "override FILE.",
        epilog="DIR receives result.nc, or a .nc for each case (read it with jointplay.Result.load "
        "or any NetCDF reader), and the figures as .png and .pdf.",
        lazy=explain,
    )
    add_option(run, "--out DIR", "folder for the results", required=True)
    group = add_inputs(run)["integration and output"]
    add_switch(
        group,
        "--certify",
        "repeat the run with finer steps to give the headline figures numerical error bounds; "
        "takes about two and a half times as long",
    )
    add_switch(
        group,
        "--no-error-estimate",
        "leave out the further run that estimates the numerical errors of the headline figures",
    )
    add_switch(
        group,
        "--resume",
        "continue the interrupted runs in DIR, bit for bit; finished ones are kept",
    )
    add_switch(group, "--no-figures", "do not draw figures")
    add_shared(group, "--quiet")


def add_inputs(run: Any) -> dict[str, Any]:
    """Add the options that say what is simulated; returns their groups."""
    run.add_argument(
        "target",
        nargs="?",
        metavar="FILE | ROBOT",
        help="scenario (TOML; see jointplay init, jointplay check), URDF, or name of a robot of "
        "example-robot-data such as ur5",
    )
    add_repeatable(
        run,
        "--set KEY=VALUE",
        'any key of the scenario, such as joints.joint_b.radial_clearance="0.3 mm"; '
        "docs/scenarios.md lists them",
    )
    group = run.add_argument_group("cases of FILE")
    add_repeatable(group, "--case NAME", "run only this case")
    add_shared(group, "--jobs", "--trust")
    groups: dict[str, Any] = {name: run.add_argument_group(name) for name in _OPTIONS}
    add_option(groups["robot"], "--urdf ROBOT", "another way to give ROBOT")
    add_switch(groups["robot"], "--ideal", "simulate the robot without clearance")
    add_shared(groups["robot"], "--allow-unphysical")
    add_shared(groups["robot"], "--fix")
    add_repeatable(
        groups["clearance joint"],
        "--joint NAME[=LENGTH|=BEARING]",
        "joint with clearance, optionally with its radial clearance or the designation of its "
        'rolling bearing, such as elbow="6010/C3"; the options of this group and the next apply to '
        "these joints",
    )
    groups["clearance joint"].add_argument(
        "--preset",
        metavar="NAME",
        nargs="?",
        const="",
        help="joints, gears and drives as they are publicly known, or assumed for a class of "
        "robots (jointplay presets lists them; without NAME that of ROBOT); other options count "
        "more",
    )
    for flag in FLAGS:
        several = len(flag.metavar) > 1
        groups[flag.group].add_argument(
            flag.name,
            metavar=flag.metavar if several else flag.metavar[0],
            nargs=len(flag.metavar) if several else None,
        )
    add_repeatable(
        groups["motion and drive"],
        "--joint-friction JOINT=C,V",
        "Coulomb [N m or N] and viscous [N m s/rad or N s/m] friction (default: from the URDF)",
    )
    return groups


def explain(parser: argparse.ArgumentParser) -> None:
    """Fill in what the scenario's tables say; only who asks for help waits for them."""
    from jointplay.scenario.schema import schema

    tables, known = schema(), {flag.name: flag for flag in FLAGS}
    for action in parser._actions:
        for name in action.option_strings:
            if name in known:
                action.help = explanation(known[name], tables)


def run(options: argparse.Namespace) -> int:
    """Make the scenario that the options describe, and run it."""
    from jointplay.commands import run_scenario
    from jointplay.mechanism.robots import is_robot
    from jointplay.scenario.robot import LABEL

    target = options.urdf or options.target
    if not options.resume and (target is None or options.urdf or is_robot(target)):
        run_scenario.check_output_folder(Path(options.out), [f"{LABEL}.nc"])
    return run_scenario.run(scenario_of(options), options)


def scenario_of(options: argparse.Namespace) -> Scenario:
    """The scenario that the options of `add_inputs` describe.

    Raises:
        JointplayError: options that do not go together, or what they name is not there.
    """
    from jointplay.mechanism.robots import is_robot
    from jointplay.scenario import Scenario
    from jointplay.scenario.settings import parse

    if options.target is not None and options.urdf is not None:
        raise JointplayError(f"--urdf {options.urdf} beside {options.target}: give one robot")
    given = [parse(text) for text in options.set]
    target = options.urdf or options.target
    if target is None or options.urdf or is_robot(target):
        scenario = _of_robot(options, target, given)
    else:
        _require_known(target)
        joints = options.joint or _joints(options.target, options.trust)
        settings = [*option_settings(options, joints), *given]
        scenario = Scenario.load(options.target, options.trust, settings)
        if options.ideal:
            raise JointplayError(
                "--ideal is for a robot; for a joint of a scenario use --set joints.NAME.ideal=true"
            )
    return scenario


def case_of(scenario: Scenario, options: argparse.Namespace) -> str:
    """The one case that the options choose.

    Raises:
        JointplayError: several, or none where there are several.
    """
    if len(options.case) > 1:
        raise JointplayError(f"one case at a time, got --case {', '.join(options.case)}")
    if not options.case and len(scenario.cases) > 1:
        raise JointplayError(f"choose a case with --case: {', '.join(scenario.cases)}")
    return options.case[0] if options.case else scenario.cases[0]


def simulation_of(options: argparse.Namespace) -> Any:
    """The one simulation that the options of `add_inputs` describe.

    Raises:
        JointplayError: several cases, or what `jointplay run` would refuse.
    """
    from jointplay.scenario.assumptions import decisive

    # There --jobs is about the cases of a scenario, here about runs of one case.
    scenario = scenario_of(argparse.Namespace(**{**vars(options), "jobs": None}))
    case = case_of(scenario, options)
    simulation = scenario.simulation(case)
    scenario.ready_run(case)  # says what cannot be, with its line
    for line in decisive(scenario, {case or scenario.cases[0]: simulation}):
        streams.note(line)
    motion = simulation.motion
    if motion is None:
        streams.note("no motion")
    else:
        streams.note(f"one cycle: {simulation.duration or motion.duration:g} s simulated")
    return simulation


def _of_robot(options: argparse.Namespace, target: str | None, given: list[Setting]) -> Scenario:
    """The scenario of a bare robot, of a preset if that is asked for."""
    if options.preset is None:
        return _asked(options, target, [], given)
    own = [*robot_settings(options), *given]
    chosen, settings = _of_preset(options.preset, target, own)
    scenario = _asked(options, target, settings, given)
    scenario.assumptions.append(f"preset {chosen.name}: {chosen.words}")
    scenario.assumptions.extend(f"preset {chosen.name}: {one}" for one in chosen.origins)
    return scenario


def _asked(
    options: argparse.Namespace,
    target: str | None,
    preset: Sequence[Setting],
    given: Sequence[Setting],
) -> Scenario:
    """The scenario of a bare robot, with what the options say of it."""
    from jointplay.scenario.robot import robot_scenario

    joints, own = _with_lengths(options.joint)
    joints = joints or ([] if target is not None or options.ideal else ["joint_b"])
    for name in ("case", "jobs", "trust"):
        if getattr(options, name):
            raise JointplayError(f"--{name} needs a scenario: jointplay run FILE --{name} ...")
    settings = [*preset, *option_settings(options, joints), *own, *given]
    return robot_scenario(target, joints, settings, options.ideal)


def _of_preset(
    name: str, target: str | None, given: Sequence[Setting]
) -> tuple[Preset, list[Setting]]:
    """A preset, by its name or that of the robot, and its tables as settings."""
    from jointplay.mechanism.robots import urdf_of
    from jointplay.scenario.presets import preset_for
    from jointplay.scenario.robot import SCARA, description_of, resolve
    from jointplay.scenario.settings import Setting

    place = SCARA if target is None else target
    chosen = preset_for("scara" if target is None else target, name)
    path = resolve(place) if ":" in place else urdf_of(place)
    return chosen, [
        Setting((table, joint, key), value, f"--preset {chosen.name}")
        for table, joints in chosen.tables(description_of(path, given)).items()
        for joint, keys in joints.items()
        for key, value in keys.items()
    ]


def _with_lengths(entries: list[str]) -> tuple[list[str], list[Setting]]:
    """Names of joints, and the clearance or bearing of those given as NAME=LENGTH or =BEARING."""
    from jointplay.joints.bearings import bearing_kind, is_designation
    from jointplay.scenario.settings import Setting

    names, lengths = [], []
    for entry in entries:
        name, length = name_and_value(entry, is_value=is_designation)
        names.append(name)
        if length is None:
            continue
        said = {"clearance": number(length)}
        if (kind := bearing_kind(length)) is not None:
            said = {"kind": kind, "designation": length}
        for key, value in said.items():
            lengths.append(Setting(("joints", name, key), value, f"--joint {entry}"))
    return names, lengths


def _require_known(target: str) -> None:
    """Refuse what is neither a scenario file nor looks like one: perhaps a robot's name gone wrong.

    Raises:
        JointplayError: with the robots whose names resemble it.
    """
    import difflib

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
        f"{target!r} is neither a file nor a robot{similar} (jointplay robots lists all)"
    )


def _joints(path: str, trust: list[str]) -> list[str]:
    """Names of the joints with clearance, if the file has just one; none otherwise."""
    from jointplay.scenario import Scenario

    scenario = Scenario.load(path, trust)
    named = {name for case in scenario.cases for name in scenario.model(case).joints}
    return list(named) if len(named) == 1 else []
