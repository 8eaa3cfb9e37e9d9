"""Options that say what a command looks at: a scenario file, or a robot, in the scenario's words.

`entries` has them, `scenario_of` makes of them the scenario that the command is about. An option
for a key of the scenario is only named there: what the key is, its unit, its choices and its
default come from the field that the scenario's tables have for it.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files, streams
from jointplay.base.errors import JointplayError
from jointplay.base.origins import ASSUMED
from jointplay.base.pairs import misread, name_and_number
from jointplay.base.tables import few
from jointplay.cli import commands
from jointplay.scenario.overrides import Setting, parse, tree

if TYPE_CHECKING:
    from jointplay.accuracy.poses import Poses
    from jointplay.base.schema import Field
    from jointplay.model.mechanism import Mechanism
    from jointplay.model.urdf import Description
    from jointplay.physics.joints import Clearance
    from jointplay.scenario import Scenario
    from jointplay.scenario.presets import Preset
    from jointplay.simulation.motion.reference import Motion
    from jointplay.simulation.simulation import Simulation

MOST_CHOICES = 9
"""Words that an option's help lists."""

_LINEAR = ("linear-spring", "kelvin-voigt", "anagnostopoulos")
"""Laws whose stiffness is in N/m, and therefore their own."""


def number(text: str) -> Any:
    """A number, or text with its unit, which the scenario reads or refuses."""
    from jointplay.base.units import plain_number

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


_READERS: dict[str, Callable[[str], Any]] = {
    "tool": str,
    "gravity": gravity,
    "motion": as_local_path,
}
"""From the text of the command line to a value of the scenario; other values are numbers."""


@dataclass(frozen=True)
class Flag:
    """An option that is a name for keys of a scenario."""

    name: str
    """As it is typed."""
    keys: tuple[tuple[str, ...], ...]
    group: str

    @property
    def attribute(self) -> str:
        return self.name.removeprefix("--").replace("-", "_")

    def read(self, text: Any) -> Any:
        return _READERS.get(self.attribute, number)(text) if isinstance(text, str) else text


ABOUT = (
    "scenario (.toml; jointplay init writes one), URDF, xacro, or name of a robot such as ur5; "
    "jointplay robots lists them"
)
"""What is said of the file or robot."""

HELP = """
    --set KEY=VALUE ...  any key of the scenario, such as
        joints.joint_b.radial_clearance="0.3 mm"; docs/scenarios.md lists them
    --case
    --import
  robot:
    --xacro NAME:=VALUE ...  argument of a robot that is written in xacro
    --allow-unphysical LINK,... ...  accept these links' inertias although they are physically
        impossible, or all
    --fix JOINT,... ...  hold these joints, at zero or in the middle of limits that exclude it;
        those that mimic them are held, too
    --tool  = robot.tool
    --gravity  = robot.gravity
    --base  = robot.base
  joints with clearance:
    --joint NAME[=LENGTH|=FIT|=BEARING] ...  joint with clearance, optionally with its radial
        clearance, its fit by ISO 286-1, such as elbow="20H7/g6", or the designation of its rolling
        bearing, such as elbow="6010/C3"; the options of this group, of contacts and of impacts
        apply to these joints
    --clearance VALUE  radial clearance of these joints, or of all that move the tool; of sliders,
        that on each side [m]
    --ideal  the robot without clearance and without play in gears
    --preset [NAME]  joints, gears and drives as they are publicly known, or assumed for a class of
        robots (jointplay robots --presets lists them; without NAME that of ROBOT); what else is
        given counts more
    --axial-clearance  = joints.JOINT.axial_clearance
    --bearing-radius  = joints.JOINT.bearing_radius
    --bearing-length  = joints.JOINT.bearing_length
    --journal-radius  = joints.JOINT.journal_radius
    --journal-length  = joints.JOINT.journal_length
  gears:
    --gear JOINT=PLAY ...  total play of a joint's gear or screw, such as elbow="2 arcmin",
        lift="0.1 mm", or all="1 arcmin"; the options of this group apply to these gears, or to all
    --gear-stiffness  = gears.GEAR.stiffness
    --gear-damping  = gears.GEAR.damping
    --rotor-inertia  = gears.GEAR.rotor_inertia
  contacts:
    --young  = joints.JOINT.bearing_material.young + joints.JOINT.journal_material.young
    --poisson  = joints.JOINT.bearing_material.poisson + joints.JOINT.journal_material.poisson
    --stiffness  = joints.JOINT.stiffness
    --axial-stiffness  = joints.JOINT.axial_stiffness
    --law  = joints.JOINT.normal.law
    --friction  = joints.JOINT.friction.mu_d
  impacts:
    --restitution  = joints.JOINT.restitution
    --damping  = joints.JOINT.normal.damping
    --impact-mass  = joints.JOINT.normal.mass
  motion:
    --motion  = motion.file
    --interpolation  = motion.interpolation
  drive:
    --joint-friction JOINT=C,V ...  Coulomb [N m or N] and viscous [N m s/rad or N s/m] friction
        (default: from the URDF)
    --bandwidth  = drive.bandwidth
    --damping-ratio  = drive.damping_ratio
    --encoder  = drive.encoder
    --payload MASS  mass held at the tool
  start:
    --seed  = integration.seed
    --start  = integration.start
    --settle  = integration.settle
    --judge-from  = integration.judge_from
  integration and output:
    --step  = integration.step
    --duration  = integration.duration
    --integrator  = integration.integrator
    --macro-step  = integration.macro_step
    --tolerance  = integration.tolerance
    --record-every  = output.record_every
  poses:
    --pose JOINT=X,... ...  joint positions [rad or m, or with a unit]; other joints are at zero, or
        in the middle of limits that exclude it (default: along the motion, or one pose)
    --poses FILE  CSV with a pose in each line and the header <joint>,..., or name,<joint>,... to
        name them
    --workspace N  N poses spread over the limits of all joints
  load:
    --force FX,FY,FZ  force on the tool, world axes [N]
  whole error:
    --whole [CLASS]  the whole error: besides play elasticity, sag, encoders, gears, geometry, heat,
        of a robot of this class where nothing else is known (calibrated-industrial, industrial,
        printed; without CLASS that of the scenario's [errors] or of the preset)
    --causes LIST  causes that count in --whole, such as play,elasticity (default: all)
"""
"""The options by group. One that is followed by = is a name for the keys of the scenario behind it:
each is one setting, as if by ``--set KEY=VALUE``, which the scenario's tables read and explain.
``JOINT`` stands for each joint of --joint, ``GEAR`` for each of --gear."""

ENTRIES = commands.read_help(HELP)[1]
FLAGS = tuple(
    Flag(name, tuple(tuple(key.split(".")) for key in about[2:].split(" + ")), group)
    for name, about, group in ENTRIES
    if about.startswith("= ")
)
FRONT_OPTIONS = (
    *("--set", "--case", "--joint", "--clearance", "--preset", "--gear", "--friction", "--motion"),
    *("--duration", "--pose", "--workspace", "--payload", "--tool", "--detail", "--tilt"),
)
"""What the short help shows of them."""
INPUT_OPTIONS = {one.partition(" ")[0].strip("-").replace("-", "_") for one, *_ in ENTRIES}
STATIC = ("poses", "load", "whole error")
"""Groups that only commands have that ask for them."""


def entries(parser: argparse.ArgumentParser, about: str) -> Iterator[commands.Entry]:
    """The options that say what a command looks at, of these groups, and single ones; all but
    those of `STATIC` if none are named.
    """
    every = dict.fromkeys(group for *_, group in ENTRIES if group not in STATIC)
    groups = about.split(", ") if about else list(every)
    for name, said, group in ENTRIES:
        if group in ("", *groups) or name.partition(" ")[0] in groups:
            key = said.startswith("= ")
            yield (f"{name} VALUE", "", group) if key else (name, said, group)


def explain(parser: argparse.ArgumentParser) -> None:
    """Fill in what the scenario's tables say; only who asks for help waits for them."""
    known = {flag.name: flag for flag in FLAGS}
    for action in parser._actions:
        for name in action.option_strings:
            if name in known and not action.help:
                action.help, action.metavar = explanation(known[name])


def explanation(flag: Flag) -> tuple[str, str]:
    """What fields say of an option's key, with choices and default; and what stands for a value."""
    from jointplay.base.schema import fields_at, is_word
    from jointplay.scenario.declarations import Model

    found = list(fields_at(Model, flag.keys[0]))
    text = next((text for _, text in found if text), "")
    text = " ".join(text.split()).replace("`", "").rstrip(".")
    text = text if re.match(r"[A-Z](\w*'s|[A-Z])", text) else text[:1].lower() + text[1:]
    field = found[0][0]
    words = [word for one, _ in found if one.choices for word in one.choices[1]]
    choices = list(dict.fromkeys(words))
    if choices and len(choices) < MOST_CHOICES:
        text = f"{text}: {', '.join(choices)}" if text else ", ".join(choices)
    elif choices:
        text = f"{text or 'one'} of {len(choices)}, see docs/laws.md: {', '.join(choices[:3])} ..."
    units = [unit.replace("*", " ") for unit in field.units if unit]
    if units and "[" not in text:
        text += f" [{' or '.join(units)}]"
    known = [default for key in flag.keys if (default := default_of(key))]
    text += f" (default {' '.join(dict.fromkeys(known))})" if known else ""
    by_unit = {unit: word for word, unit in commands.UNITS.items()}
    metavar = by_unit.get(field.units[0], "X") if field.units != ("",) else "X"
    if is_word(field.hint):
        metavar = "WORD" if choices else flag.keys[0][-1].upper()
    return f"{text}: {'.'.join(flag.keys[0])}".removeprefix(": ").replace("%", "%%"), metavar


def default_of(key: Sequence[str]) -> str:
    """What holds for a bare robot of which a key is not given, as text; empty if nothing does."""
    from jointplay.base.schema import fields_at
    from jointplay.scenario.declarations import Model

    field: Field | None = next((one for one, _ in fields_at(Model, key, every=False)), None)
    if field is None:
        return ""
    value, words = field.default, field.choices[1] if field.choices else ()
    if isinstance(words, Mapping) and not isinstance(value, str):
        value = next((word for word, stands_for in words.items() if stands_for == value), None)
    if isinstance(value, float | int):
        return f"{value:g}"
    return value if isinstance(value, str) else ""


_CLEARANCE = Flag("--clearance", (("joints", "JOINT", "clearance"),), "joints with clearance")
"""For which each kind of joint has a name of its own: the first of its ``clearance_fields``."""

_OF_FIT = (_CLEARANCE.name, "--axial-clearance", "--bearing-radius", "--journal-radius")
"""What joints with a fit, and bearings of a catalogue, have by that: these are for the others."""

ALL = "all"
"""Stands for all moving joints in --gear."""

SCARA_JOINT = "joint_b"
"""Joint of the SCARA that has clearance where nothing is named."""


def is_scenario(options: argparse.Namespace) -> bool:
    """Whether the options name a scenario file rather than a robot."""
    from jointplay.model.robots import is_robot

    return options.place is not None and not is_robot(options.place)


def scenario_of(options: argparse.Namespace, moves: bool = True) -> Scenario:
    """The scenario that the options of `entries` describe.

    Args:
        options: those of the command.
        moves: whether a robot of which no motion is given is to have one; where nothing moves, it
            need not have play either.

    Raises:
        JointplayError: options that do not go together, or what they name is not there.
    """
    from jointplay.scenario import Scenario
    from jointplay.scenario.described import settings_beyond
    from jointplay.scenario.reading import merge
    from jointplay.scenario.robot import robot_scenario

    ideal, file = bool(_value(options, "ideal")), None
    wanted = [parse(text) for text in options.set]
    for key in ("fix", "allow_unphysical"):
        if names := _value(options, key):
            wanted.insert(0, Setting(("robot", key), list(names), f"--{key.replace('_', '-')}"))
    for name, text in xacro_arguments(_value(options, "xacro")).items():
        wanted.insert(0, Setting(("robot", "xacro", name), text, "--xacro"))
    if is_scenario(options):
        _require_known(options.place)
        file = Scenario.load(options.place)
    if file is not None and ideal:
        raise JointplayError("--ideal is for a robot; here use --set joints.NAME.ideal=true")
    if file is None and options.case:
        raise JointplayError("--case needs a scenario (.toml)")
    of_file = {} if file is None else _tables(file)
    preset, settings = chosen_preset(options), []
    if preset is not None:
        said = preset.settings(_description(options, wanted, file))
        left = {**of_file, "joints": [one.key[1] for one in said]} if ideal else of_file
        settings = [one for one in said if one.key[1] not in left.get(one.key[0], {})]
    names = list(named_joints(options))
    if options.place is None and not names and not ideal:
        names = [SCARA_JOINT]
    if not ideal:
        loose, tool = _loosened(options, names, file, wanted)
        names, wanted = [*names, *loose], [*tool, *wanted]
    whole, lengths = _of_joints(options)
    fitted = [one.key[1] for one in whole if one.key[2] == "fit"]  # which a preset's bearing is not
    settings = [one for one in settings if one.key[0] != "joints" or one.key[1] not in fitted]
    settings += whole
    beyond = []
    if file is None and options.place is not None:
        beyond = settings_beyond(_description(options, wanted, None), ideal)
    tables = merge(of_file, tree([*beyond, *settings, *wanted]))
    if names or for_joints(options):
        settings += _joint_settings(options, names, lengths, tables, file, wanted)
        if file is not None:  # who names a joint of one case wants its play
            settings += [Setting(("joints", name, "ideal"), False, "--joint") for name in names]
    geared = _gear_settings(options, tables, file, wanted)
    settings += geared
    idle = not (geared or tables.get("gears") or _value(options, "whole"))
    if idle and _value(options, "encoder") is not None:
        raise JointplayError("--encoder is for gears; no joint has one; add it with --gear")
    if ideal:
        of_gears = [one.key[1] for one in geared if one.key[0] == "gears"]
        known = dict.fromkeys([*tables.get("gears", {}), *of_gears])
        settings += [Setting(("gears", name, "play"), 0.0, "--ideal") for name in known]
        loose = tree(wanted).get("joints", {})
        settings += [Setting(("joints", name, "ideal"), True, "--ideal") for name in loose]
    settings += [*_other_settings(options, tables), *wanted]
    if file is None:
        scenario = robot_scenario(options.place, names, settings, ideal, moves)
    elif not settings:
        return file
    else:
        scenario = Scenario.load(options.place, settings)
    if preset is not None:
        words, *origins = (
            f"preset {preset.name}: {one}" for one in (preset.words, *preset.origins)
        )
        scenario.assumptions[:] = [words, *scenario.assumptions, *origins]
    elif own_preset(options):
        scenario.assumptions.append(
            f"note: what is publicly known of the joints of {options.place} is left out; --preset "
            "takes it"
        )
    return scenario


def own_preset(options: argparse.Namespace) -> str:
    """Name of the preset with what is publicly known of the robot, if nobody asked for it."""
    from jointplay.scenario import presets

    if not hasattr(options, "preset") or options.preset is not None:
        return ""
    if is_scenario(options) or not options.place:
        return ""
    return presets.own_preset(str(options.place))


def xacro_arguments(texts: Sequence[str] | None) -> dict[str, str]:
    """Arguments of --xacro, by name."""
    found = {}
    for text in texts or ():
        name, sign, value = text.partition(":=")
        if not (sign and name.strip()):
            raise misread(text, "--xacro NAME:=VALUE")
        found[name.strip()] = value
    return found


def _movers(
    options: argparse.Namespace, file: Scenario | None, wanted: Sequence[Setting]
) -> tuple[list[str], list[Setting]]:
    """Joints that move the tool of the robot without play, which can have some.

    Returns:
        The joints; the tool, if it was chosen.
    """
    from jointplay.physics.joints import replacing
    from jointplay.scenario.robot import robot_scenario

    if file is not None:
        mechanism = file.mechanism(options.case if isinstance(options.case, str) else None)
    else:
        about = [*_other_settings(options, {}), *wanted]
        about = [one for one in about if one.key[0] == "robot"]
        mechanism = robot_scenario(options.place, (), about, moves=False).mechanism()
    mechanism, entries = mechanism.ideal(), mechanism.description.joints
    movers = mechanism.movers(_value(options, "relative_to"))
    able = [name for name in movers if name not in entries or replacing(entries[name].kind)]
    if _value(options, "tool") is not None or not mechanism.tool_reason:
        return able, []
    return able, [Setting(("robot", "tool"), mechanism.tool, mechanism.tool_reason, ASSUMED)]


def _loosened(
    options: argparse.Namespace,
    named: Sequence[str],
    file: Scenario | None,
    wanted: Sequence[Setting],
) -> tuple[list[str], list[Setting]]:
    """Joints that --clearance is for beside those `named`: all others that move the tool.

    Unless --joint names some without a size, which it is for, or a file has some. See `_movers`.
    """
    if all(_value(options, one) is None for one in ("clearance", "axial_clearance")):
        return [], []
    if None in named_joints(options).values() or options.place is None:
        return [], []
    if file is not None and _tables(file)["joints"]:
        return [], []
    movers, tool = _movers(options, file, wanted)
    return [name for name in movers if name not in named], tool


@dataclass(frozen=True)
class PosedMachine:
    """What the options say of a machine that stands."""

    scenario: Scenario
    case: str
    of_file: bool
    """Whether the scenario is one of a file, and not of a robot."""
    poses: Poses
    notes: list[str]
    """What was chosen for the user, a line each."""

    def undecided(self, force: bool) -> str:
        """What decides where it rests and nobody gave, to add to a sentence.

        `force`: whether one is on the tool.
        """
        from jointplay.scenario.assumptions import undecided_at_rest

        machine = self.poses.machine
        loaded = bool(machine.payloads or machine.loads) or force
        words = undecided_at_rest(self.scenario, self.case, self.mechanism, loaded)
        return f"; assumed: {', '.join(words)}" if words else ""

    @property
    def mechanism(self) -> Mechanism:
        return self.poses.mechanism

    @property
    def motion(self) -> Motion | None:
        return self.poses.machine.motion

    @property
    def simulation(self) -> Simulation | None:
        """As a run of a scenario file has it; None of a robot."""
        return self.scenario.simulation(self.case) if self.of_file else None


def posed_machine(options: argparse.Namespace) -> PosedMachine:
    """The machine that the options describe, and the poses at which it is to be looked at.

    Raises:
        JointplayError: see `scenario_of`.
    """
    from jointplay.accuracy.poses import poses_of
    from jointplay.scenario import assumptions

    ways = {name: _value(options, name) for name in ("pose", "poses", "motion", "workspace")}
    chosen = [name for name, value in ways.items() if value not in (None, [])]
    if len(chosen) > 1:
        raise JointplayError(f"give one of --{' and --'.join(chosen)}")
    scenario = scenario_of(options, moves=False)
    case = options.case or scenario.cases[0]
    machine, named = scenario.simulation(options.case, still=True), named_joints(options)
    given = _given_poses(options, machine.mechanism)
    poses = poses_of(machine, given, ways["workspace"])
    notes = assumptions.notes_at_poses(
        scenario,
        case,
        poses,
        named=named,
        play=bool(named or for_joints(options)),
        relative_to=_value(options, "relative_to"),
    )
    return PosedMachine(scenario, case, is_scenario(options), poses, notes)


def _given_poses(
    options: argparse.Namespace, mechanism: Mechanism
) -> dict[str, dict[str, float]] | None:
    """Joint positions of the poses that are given one by one, by name; None if none are."""
    file, texts = _value(options, "poses"), _value(options, "pose")
    if file is None:
        several = len(texts or ()) > 1  # else its name need not be said
        return {text * several: positions(mechanism, text) for text in texts or ()} or None
    (_, header), *rows = files.csv_rows(Path(file), "poses")
    header = [cell.strip() for cell in header]
    named = header[0] == "name"
    if twice := [one for one, count in Counter(header).items() if count > 1]:
        raise JointplayError(f"{file}: column {twice[0]!r} appears twice")
    found: dict[str, dict[str, float]] = {}
    for number, row in rows:
        line, cells = f"{file}, line {number}", [cell.strip() for cell in row]
        name = cells[0] if named else str(len(found) + 1)
        if name in found:
            raise JointplayError(f"{line}: there are two poses {name!r}")
        pairs = [*zip(header, cells, strict=True)][named:]
        found[name] = {
            joint: _position(mechanism, joint, cell, f"{line}, {joint}") for joint, cell in pairs
        }
    if not found:
        raise JointplayError(f"{file} has no poses: give a line of joint positions for each")
    return found


def positions(mechanism: Mechanism, text: str, option: str = "--pose") -> dict[str, float]:
    """Positions of joints [rad or m] in text such as ``JOINT=X,JOINT=X``."""
    found = {}
    names = mechanism.description.joints
    longest = sorted(map(re.escape, names), key=len, reverse=True)
    ahead = f"(?=\\s*(?:{'|'.join(longest)})\\s*=)"  # a name may have commas of its own
    for part in re.split(f",{ahead}", text) if text else ():
        name, value = name_and_number(part.strip(), names)
        name = name if name in names else name.strip()
        if value is None:
            raise misread(part, f"{option} JOINT=X,JOINT=X,...")
        found[name] = _position(mechanism, name, value, f"{option} {name}")
    return found


def _position(mechanism: Mechanism, joint: str, text: str, where: str) -> float:
    """Position of a joint [rad or m]; errors begin with `where`."""
    entry = mechanism.description.joints.get(joint)
    return commands.quantity(text, "m" if entry is not None and entry.slides else "rad", where)


IN_MOTION = (
    *("drive.damping_ratio", "drives.*.damping_ratio", "gears.*.damping", "joints.*.restitution"),
    *("integration", "output"),
)
"""Keys that say nothing of a machine that stands."""
OF_CONTACTS = tuple(
    f"joints.*.{key}"
    for key in (
        *("friction", "normal", "stiffness", "axial_stiffness"),
        *("bearing_material", "journal_material"),
    )
)
AT_REST = (
    *("drive", "drives", "joint_friction", "payloads", "loads", "robot.gravity"),
    *("gears.*.stiffness", "gears.*.rotor_inertia", *OF_CONTACTS),
)
"""Keys that say where a machine rests, and not how far its play lets it go."""


def refuse_idle(scenario: Scenario, patterns: Sequence[str], why: str) -> None:
    """Refuse options for keys that would act on nothing; `*` stands for any name."""
    for one in scenario.settings:
        for parts in (pattern.split(".") for pattern in patterns):
            known = zip(parts, one.key, strict=False)
            fits = len(parts) <= len(one.key) and all(a in (b, "*") for a, b in known)
            if fits and one.source.startswith("--") and not one.source.startswith("--preset"):
                raise JointplayError(f"{one.source} {why}")


def refuse_idle_friction(options: argparse.Namespace, posed: PosedMachine) -> None:
    """Refuse friction that holds nothing where a machine rests."""
    if options.whole is not None:
        why = "acts on where the machine rests, which --whole does not ask"
        refuse_idle(posed.scenario, ("joint_friction", "joints.*.friction"), why)
    for one in posed.scenario.settings:
        if one.source == "--joint-friction" and one.key[1] not in posed.mechanism.gears:
            why = f"acts at rest on the teeth of a gear, and {one.key[1]!r} has none"
            raise JointplayError(f"{one.source} {why}")


def force_on_tool(options: argparse.Namespace) -> tuple[float, float, float]:
    """What --force says, world axes [N]."""
    if options.force is None:
        return (0.0, 0.0, 0.0)
    return commands.vector(options.force, "N", "--force")


def whole_errors(options: argparse.Namespace, scenario: Scenario) -> dict[str, Any]:
    """What whole budgets take: their causes, errors that are known, class of the rest."""
    from jointplay.accuracy.causes import CAUSES

    errors, preset = scenario.robot_errors(options.case), chosen_preset(options)
    said = (options.whole, errors and errors.assumed, preset and preset.errors)
    kind = next(filter(None, said), None)
    return {"causes": options.causes or CAUSES, "errors": errors, "kind": kind}


def simulation_of(options: argparse.Namespace) -> Simulation:
    """The one simulation that these options describe.

    Raises:
        JointplayError: several cases, or what `jointplay run` would refuse.
    """
    from jointplay.scenario.assumptions import decisive

    scenario = scenario_of(options)
    simulation = scenario.simulation(options.case)
    scenario.ready_run(options.case)  # says what cannot be, with its line
    lines = decisive(scenario, {options.case or scenario.cases[0]: simulation})
    for line in commands.first_notes(lines, getattr(options, "detail", True)):
        streams.note(line)
    time = simulation.duration or (simulation.motion and simulation.motion.duration)
    moves = simulation.motion is not None
    streams.note(f"one cycle: {time:g} s simulated" if moves else "no motion")
    return simulation


def named_joints(options: argparse.Namespace) -> dict[str, str | None]:
    """Joints of --joint, each with its clearance, fit or bearing if it has one."""
    from jointplay.physics.joints.bearings import is_designation

    if not hasattr(options, "clearance"):  # a command's own --joint is another
        return {}
    return dict(name_and_number(entry, is_number=is_designation) for entry in options.joint)


def for_joints(options: argparse.Namespace) -> list[Flag]:
    """Options that were given for joints with clearance."""
    return [flag for flag in _given(options) if flag.keys[0][0] == "joints"]


def _given(options: argparse.Namespace) -> list[Flag]:
    return [one for one in (_CLEARANCE, *FLAGS) if _value(options, one.attribute) is not None]


def chosen_preset(options: argparse.Namespace) -> Preset | None:
    """What --preset selects: by its name, or without one that of the robot.

    Raises:
        JointplayError: there is none of that name, or none is known for the robot.
    """
    from jointplay.scenario.presets import preset, preset_of

    name = _value(options, "preset")
    if name is None:
        return None
    return preset(name) if name else preset_of(str(options.place or "scara"))


def write_preset(path: str, preset: Preset) -> None:
    """Write a preset of one's own, and say how to use it."""
    files.write(Path(path), preset.text)
    print(f"written: {path}; every command takes it as --preset {path}")


def write_robot(path: str, text: str, meshes: Mapping[str, bytes], words: str) -> None:
    """Write a robot's file, and beside it its meshes; and say so."""
    from jointplay.model.meshes import FOLDER

    folder = Path(path).parent / FOLDER
    files.write(Path(path), text)
    if meshes:
        folder.mkdir(exist_ok=True)
    for name, content in meshes.items():
        files.write(folder / name, content, overwrite=True)
    print(f"written: {path}{words}")


def _value(options: argparse.Namespace, attribute: str) -> Any:
    """Value of an option; None also if the command does not have it."""
    return getattr(options, attribute, None)


def _tables(file: Scenario) -> dict[str, dict[str, Any]]:
    """What any case of a file says of single joints, by the name of the table."""
    found: dict[str, dict[str, Any]] = {
        name: {} for name in ("joints", "gears", "drives", "joint_friction")
    }
    for case in file.cases:
        model = file.model(case)
        for table, joints in found.items():
            for name, draft in getattr(model, table).items():
                joints.setdefault(name, {"kind": draft.word, **draft.fields})
    return found


def _description(
    options: argparse.Namespace, wanted: Sequence[Setting], file: Scenario | None
) -> Description:
    from jointplay.scenario.described import description_of
    from jointplay.scenario.robot import robot_place

    if file is None:
        return description_of(robot_place(options.place), wanted)
    case = options.case if isinstance(options.case, str) else None
    robot = file.model(case or file.cases[0]).robot
    return description_of(robot.urdf, wanted, file.path.parent)


def _of_joints(options: argparse.Namespace) -> tuple[list[Setting], dict[str, str]]:
    """Bearings and fits of joints given as NAME=BEARING or NAME=FIT, and clearances of others."""
    from jointplay.physics.joints.bearings import bearing_kind, is_catalogued
    from jointplay.physics.joints.fits import is_fit

    whole, lengths = [], {}
    for name, text in named_joints(options).items():
        if text is None:
            continue
        keys: dict[str, str] = {}
        if is_fit(text) and not is_catalogued(text):
            keys = {"fit": text}
        elif (kind := bearing_kind(text)) is not None:
            keys = {"kind": kind, "designation": text}
        else:
            lengths[name] = text
        for key, value in keys.items():
            whole.append(Setting(("joints", name, key), value, f"--joint {name}={text}"))
    return whole, lengths


def _joint_settings(
    options: argparse.Namespace,
    names: Sequence[str],
    lengths: Mapping[str, str],
    said: Mapping[str, Any],
    file: Scenario | None,
    wanted: Sequence[Setting],
) -> list[Setting]:
    """What options say of joints, in the words of each joint's kind; of all if none are named.

    `said` is what the file, the preset, and --set say of them.

    Raises:
        JointplayError: an option for a joint, and no joint.
    """
    from jointplay.scenario.robot import assumed_joint, class_of_joint, kind_of_joint

    tables = said.get("joints", {})
    given = for_joints(options)
    joints = list(names) or [*tables]
    if given and not joints:
        raise JointplayError(f"{given[0].name} is for a joint with clearance: name it by --joint")
    description = _description(options, wanted, file)
    settings, kinds = [], {}
    bare = [name for name, size in named_joints(options).items() if size is None]
    for name in joints:
        own = tables.get(name, {})
        kinds[name] = class_of_joint(kind_of_joint(name, description, own))
        if file is not None and name not in tables:
            settings.append(assumed_joint(name, description, own))
    for flag in given:
        value = flag.read(_value(options, flag.attribute))
        able = [name for name, kind in kinds.items() if _has(kind, flag)]
        own = [name for name in able if flag.name in _OF_FIT and _is_sized(tables.get(name, {}))]
        own = [name for name in own if name not in bare]
        able = [name for name in able if name not in own] or able or joints
        for key in flag.keys:
            for name in able:
                path = _path(key, name, kinds[name], options)
                settings.append(Setting(path, value, flag.name))
    for name, text in lengths.items():
        path = _path(_CLEARANCE.keys[0], name, kinds[name], options)
        settings.append(Setting(path, number(text), f"--joint {name}={text}"))
    return settings


def _is_sized(table: Mapping[str, Any]) -> bool:
    """Whether a joint has its clearance by a fit, or is a bearing of a catalogue."""
    return not {"fit", "designation"}.isdisjoint(table)


def _has(kind: type[Clearance], flag: Flag) -> bool:
    """Whether joints of a kind have what an option is for."""
    from jointplay.base.schema import fields_of

    own = fields_of(kind)
    return bool(kind.clearance_fields) if flag == _CLEARANCE else flag.keys[0][2] in own


def _path(
    key: Sequence[str], joint: str, kind: type[Clearance], options: argparse.Namespace
) -> tuple[str, ...]:
    """The key of a joint's option: the name that its kind has for a clearance, its law's own."""
    rest = tuple(key[2:])
    if rest == ("clearance",):
        rest = (next(iter(kind.clearance_fields), "clearance"),)
    elif rest == ("stiffness",) and _value(options, "law") in _LINEAR:
        rest = ("normal", "stiffness")
    return ("joints", joint, *rest)


def _gear_settings(
    options: argparse.Namespace,
    said: Mapping[str, Any],
    file: Scenario | None,
    wanted: Sequence[Setting],
) -> list[Setting]:
    """What options say of gears: those of --gear, or else all."""
    entries, plays = _value(options, "gear") or (), dict[str, float]()
    known, settings = said.get("gears", {}), list[Setting]()
    if entries:
        description = _description(options, wanted, file)
        units = {name: one.unit for name, one in description.joints.items() if one.kind != "fixed"}
        every = [text for text in entries if name_and_number(text)[0] == ALL]
        if every:
            movers, tool = _movers(options, file, wanted)
            settings += tool
            plays = _plays_of_all(every, {n: units[n] for n in movers if n in units})
        each = [text for text in entries if text not in every]
        plays |= commands.numbers_by_name(each, "--gear JOINT=PLAY", units)
    for name, angle in plays.items():
        settings.append(Setting(("gears", name, "play"), angle, f"--gear {name}"))
    for flag in (one for one in _given(options) if one.keys[0][0] == "gears"):
        if not (plays or known):
            raise JointplayError(f"{flag.name} is for gears; no joint has one; add it with --gear")
        for name in plays or known:
            value = flag.read(_value(options, flag.attribute))
            settings.append(Setting(("gears", name, flag.keys[0][2]), value, flag.name))
    return settings


def _plays_of_all(entries: Sequence[str], units: Mapping[str, str]) -> dict[str, float]:
    """Plays of --gear all=PLAY, by joint of which it has the unit."""
    plays: dict[str, float] = {}
    for text in entries:
        value = name_and_number(text)[1]
        if value is None:
            raise misread(text, "--gear all=PLAY")
        errors: list[JointplayError] = []
        for name, unit in units.items():
            try:
                plays[name] = commands.quantity(value, unit, "--gear all")
            except JointplayError as error:
                errors.append(error)
        if errors and not plays:
            raise errors[0]
    return plays


def _other_settings(options: argparse.Namespace, said: Mapping[str, Any]) -> list[Setting]:
    """Settings of neither joints nor gears; `said` is what file, preset and --set say."""
    settings = [
        Setting(key, flag.read(_value(options, flag.attribute)), flag.name)
        for flag in _given(options)
        for key in flag.keys
        if key[0] not in ("joints", "gears")
    ]
    settings = _of_drives(settings, said)
    if mass := _value(options, "payload"):
        held = [*said.get("payloads", ()), {"mass": mass}]
        settings.append(Setting(("payloads",), held, "--payload"))
    for entry in _value(options, "joint_friction") or ():
        name, values = name_and_number(entry)
        parts = [number(value.strip()) for value in (values or "").split(",")]
        if len(parts) != 2:
            raise misread(entry, "--joint-friction JOINT=COULOMB,VISCOUS")
        for key, value in zip(("coulomb", "viscous"), parts, strict=True):
            settings.append(Setting(("joint_friction", name, key), value, "--joint-friction"))
    return settings


def _of_drives(settings: Sequence[Setting], said: Mapping[str, Any]) -> list[Setting]:
    """Settings, those of drives for each drive that file or preset have, where it has their key.

    Raises:
        JointplayError: none of the drives has it.
    """
    from jointplay.base.schema import fields_of
    from jointplay.simulation.loads.drive import DRIVES, ComputedTorque

    def kind_of(table: Any) -> str:
        word = table if isinstance(table, str) else table.get("kind", ComputedTorque.kind)
        return str(word)

    def takes(kind: str, key: str) -> bool:
        return kind not in DRIVES or key in fields_of(DRIVES[kind])  # of none: refused later

    drives, found = said.get("drives", {}), []
    common = kind_of(said.get("drive", {}))
    for one in settings:
        if one.key[0] != "drive":
            found.append(one)
            continue
        kinds = {name: kind_of(table) for name, table in drives.items()}
        able = [name for name, kind in kinds.items() if takes(kind, one.key[1])]
        found += [replace(one, key=("drives", name, one.key[1])) for name in able]
        if takes(common, one.key[1]) and (able or not drives):
            found.append(one)
        elif not able:
            own = f"{', '.join(sorted({*kinds.values()}))} of {few(list(drives))}"
            raise JointplayError(
                f"{one.source} has no meaning for the drives there are: {own if drives else common}"
            )
    return found


def _require_known(target: str) -> None:
    """Refuse what is no scenario file and no name of one: perhaps a robot's name gone wrong."""
    from jointplay.base.files import is_file
    from jointplay.model.robots import with_package

    if is_file(Path(target)) or Path(target).suffix or "/" in target or ":" in target:
        return
    try:
        with_package(target)
    except JointplayError as error:
        words = f"{target!r} is neither a file nor a robot: {error}; see jointplay robots"
        raise JointplayError(words) from None
