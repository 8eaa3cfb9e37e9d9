"""Options that say what a command looks at: a scenario file, or a robot, in the scenario's words.

`declare` has them, `scenario_of` makes of them the scenario that the command is about. An option
for a key of the scenario is only named there: what the key is, its unit, its choices and its
default come from the field that the scenario's tables have for it.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files, streams
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.origins import ASSUMED
from jointplay.base.pairs import misread, name_and_number
from jointplay.base.tables import few
from jointplay.cli import commands
from jointplay.cli.options import (
    BY_UNIT,
    FLAG,
    LISTS,
    MASS,
    REPEATED,
    SHARED,
    Parser,
    listed,
    quantity,
)
from jointplay.scenario.reading import Setting, parse, tree

if TYPE_CHECKING:
    from jointplay.accuracy.poses import Poses
    from jointplay.base.origins import Value
    from jointplay.base.schema import Field
    from jointplay.model.mechanism import Mechanism
    from jointplay.model.urdf import Description
    from jointplay.physics.joints import Clearance
    from jointplay.scenario import Scenario
    from jointplay.scenario.presets import Preset
    from jointplay.simulation.motion.reference import Motion
    from jointplay.simulation.simulation import Simulation

MOST_CHOICES = 9
"""Words that an option's help lists (judged: those that fit two lines)."""

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


def _option(name: str, **about: Any) -> tuple[str, dict[str, Any]]:
    return name, about


# fmt: off
OPTIONS: dict[str, tuple[tuple[str, dict[str, Any]], ...]] = {
    "": (
        _option("--set", **REPEATED, metavar="KEY=VALUE", help="any key of the scenario, such as "
            "joints.joint_b.radial_clearance=\"0.3 mm\"; docs/scenarios.md lists them"),
        _option("--case", **SHARED["--case"]),
        _option("--import", **SHARED["--import"]),
    ),
    "robot": (
        _option("--xacro", **REPEATED, metavar="NAME:=VALUE", help="argument of a robot that is "
            "written in xacro"),
        _option("--allow-unphysical", **LISTS | {"metavar": "LINK,..."}, help="accept these links' "
            "inertias although they are physically impossible, or all"),
        _option("--fix", **LISTS | {"metavar": "JOINT,..."}, help="hold these joints, at zero or "
            "in the middle of limits that exclude it; those that mimic them are held, too"),
    ),
    "joints with clearance": (
        _option("--joint", **REPEATED, metavar="NAME[=LENGTH|=FIT|=BEARING]", help="joint with "
            "clearance, optionally with its radial clearance, its fit by ISO 286-1, such as "
            'elbow="20H7/g6", or the designation of its rolling bearing, such as elbow="6010/C3"; '
            "the options of this group, of contacts and of impacts apply to these joints"),
        _option("--clearance", metavar="VALUE", type=number, help="radial clearance of these "
            "joints, or of all that move the tool; of sliders, that on each side [m]"),
        _option("--ideal", **FLAG, help="the robot without clearance and without play in gears"),
        _option("--preset", nargs="?", const="", metavar="NAME", help="joints, gears and drives as "
            "they are publicly known, or assumed for a class of robots (jointplay robots --presets "
            "lists them; without NAME that of ROBOT); what else is given counts more"),
    ),
    "gears": (
        _option("--gear", **REPEATED, metavar="JOINT=PLAY", help="total play of a joint's gear or "
            'screw, such as elbow="2 arcmin", lift="0.1 mm", or all="1 arcmin"; the options of '
            "this group apply to these gears, or to all"),
    ),
    "drive": (
        _option("--joint-friction", **REPEATED, metavar="JOINT=C,V", help="Coulomb [N m or N] and "
            "viscous [N m s/rad or N s/m] friction (default: from the URDF)"),
        _option("--payload", **MASS, help="mass held at the tool"),
        _option("--registers", metavar="P=N,...", help="gains of servos as their registers have "
            "them, such as P=16,D=32,I=0 of LeRobot, or elbow_flex:P=16 of one joint (repeatable); "
            "docs/drives.md has the units", **REPEATED),
    ),
    "poses": (
        _option("--pose", **REPEATED, metavar="JOINT=X,...", help="joint positions [rad or m, or "
            "with a unit]; other joints are at zero, or in the middle of limits that exclude it "
            "(default: along the motion, or one pose)"),
        _option("--poses", metavar="FILE", help="CSV with a pose in each line and the header "
            "<joint>,..., or name,<joint>,... to name them"),
        _option("--workspace", metavar="N", type=int, help="N poses spread over the limits of all "
            "joints"),
    ),
    "load": (
        _option("--force", metavar="FX,FY,FZ", help="force on the tool, world axes [N]"),
    ),
    "whole error": (
        _option("--whole", nargs="?", const="", metavar="CLASS", help="the whole error: besides "
            "play elasticity, sag, encoders, gears, geometry, heat, of a robot of this class where "
            "nothing else is known (calibrated-industrial, industrial, printed; without CLASS that "
            "of the scenario's [errors] or of the preset)"),
        _option("--causes", metavar="LIST", type=listed, help="causes that count in --whole, such "
            "as play,elasticity (default: all)"),
    ),
}
"""Options of their own, by group, as argparse takes them."""

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
"""Options that are names for keys of the scenario, by group: each is one setting, as if by ``--set
KEY=VALUE``, which the scenario's tables read and explain. ``JOINT`` stands for each joint of
--joint, ``GEAR`` for each of --gear."""

GROUPS = tuple(dict.fromkeys([*list(OPTIONS)[:4], *KEYS, *OPTIONS]))
STATIC = ("poses", "load", "whole error")
"""Groups that only commands have that ask for them."""


READERS: dict[str, Callable[[str], Any]] = {
    "tool": str, "gravity": gravity, "motion": as_local_path
}  # fmt: skip
"""From the text of the command line to a value of the scenario; other values are numbers."""


@dataclass(frozen=True)
class Flag:
    """An option that is a name for keys of a scenario."""

    name: str
    """As it is typed."""
    keys: tuple[tuple[str, ...], ...]

    @property
    def attribute(self) -> str:
        return self.name.removeprefix("--").replace("-", "_")

    @property
    def read(self) -> Callable[[str], Any]:
        """From the text of the command line to a value of the scenario."""
        return READERS.get(self.attribute, number)


FLAGS = tuple(
    Flag(name, tuple(tuple(key.split(".")) for key in keys.split()))
    for group in KEYS.values()
    for name, keys in group.items()
)


def declare(parser: Parser, *groups: str, required: bool = False) -> None:
    """Add the file or robot, and options of these groups, or single ones of groups; all but those
    of `STATIC` if none are named.
    """
    about = "scenario (.toml; jointplay init writes one), URDF, xacro, or name of a robot such as "
    about += "ur5; jointplay robots lists them"
    nargs = None if required else "?"
    parser.add_argument("place", nargs=nargs, metavar="FILE | ROBOT", help=about)
    flags = {flag.name: flag for flag in FLAGS}
    for title in GROUPS:
        every = title in ("", *groups) or not (groups or title in STATIC)
        group = [*OPTIONS.get(title, ()), *((name, {}) for name in KEYS.get(title, ()))]
        wanted = [option for option in group if every or option[0] in groups]
        section = parser.add_argument_group(title) if title and wanted else parser
        for name, declared in wanted:
            if name in flags:
                declared = {"type": flags[name].read, "metavar": "VALUE"}
            action = section.add_argument(name, **declared)
            if name in flags:
                parser.explained[action.dest] = partial(explanation, flags[name])
            if not title:
                parser.behind.add(action.dest)


def explanation(flag: Flag) -> tuple[str, str]:
    """What fields say of an option's key, with choices and default; and what stands for a value."""
    from jointplay.base.schema import fields_at, is_word
    from jointplay.scenario.declarations import Model

    fields = list(fields_at(Model, flag.keys[0]))
    text = next((text for _, text in fields if text), "")
    text = " ".join(text.split()).replace("`", "").rstrip(".")
    text = text if re.match(r"[A-Z](\w*'s|[A-Z])", text) else text[:1].lower() + text[1:]
    field = fields[0][0]
    words = [word for each, _ in fields if each.choices for word in each.choices[1]]
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
    metavar = BY_UNIT.get(field.units[0], "X")
    if is_word(field.hint):
        metavar = "WORD" if choices else flag.keys[0][-1].upper()
    return f"{text}: {'.'.join(flag.keys[0])}".removeprefix(": "), metavar


def default_of(key: Sequence[str]) -> str:
    """What holds for a bare robot of which a key is not given, as text; empty if nothing does."""
    from jointplay.base.schema import fields_at
    from jointplay.scenario.declarations import Model

    field: Field | None = next((each for each, _ in fields_at(Model, key, deep=False)), None)
    if field is None:
        return ""
    value, words = field.default, field.choices[1] if field.choices else ()
    if isinstance(words, Mapping) and not isinstance(value, str):
        value = next((word for word, stands_for in words.items() if stands_for == value), None)
    if isinstance(value, float | int):
        return f"{value:g}"
    return value if isinstance(value, str) else ""


_CLEARANCE = Flag("--clearance", (("joints", "JOINT", "clearance"),))
"""For which each kind of joint has a name of its own: the first of its ``clearance_fields``."""

_OF_FIT = (_CLEARANCE.name, "--axial-clearance", "--bearing-radius", "--journal-radius")
"""What joints with a fit, and bearings of a catalogue, have by that: these are for the others."""

ALL = "all"
"""Stands for all moving joints in --gear."""


def is_scenario(options: argparse.Namespace) -> bool:
    """Whether the options name a scenario file rather than a robot."""
    from jointplay.model.robots import is_robot

    return options.place is not None and not is_robot(options.place)


def scenario_of(options: argparse.Namespace, moves: bool = True, inertia: bool = True) -> Scenario:
    """The scenario that the options of `declare` describe.

    Args:
        options: those of the command.
        moves: whether a robot of which no motion is given is to have one; where nothing moves, it
            need not have play either.
        inertia: whether inertias matter: those that no rigid body has are refused.

    Raises:
        JointplayError: options that do not go together, or what they name is not there.
    """
    return _Inputs(options, inertia).scenario(moves)


class _Inputs:
    """What options say, as settings of a scenario.

    Of two settings for one key the later counts: those of the preset come first, then options,
    then --set.
    """

    def __init__(self, options: argparse.Namespace, inertia: bool) -> None:
        from jointplay.model.inertias import ALL
        from jointplay.scenario import Scenario

        self.options = options
        self.ideal = bool(_value(options, "ideal"))
        self.named = named_joints(options)
        self.tool: list[Setting] = []
        """The tool, if it was chosen by the joints that move it."""
        self.converted: list[str] = []
        """What --registers sets, and what of it is not known."""
        self.file: Scenario | None = None
        if is_scenario(options):
            _require_known(options.place)
            self.file = Scenario.load(options.place)
        if self.file is not None and self.ideal:
            raise JointplayError("--ideal is for a robot; here use --set joints.NAME.ideal=true")
        if self.file is None and options.case:
            raise JointplayError("--case needs a scenario (.toml)")
        xacro = xacro_arguments(_value(options, "xacro"))
        self.wanted = [
            *(Setting(("robot", "xacro", name), text, "--xacro") for name, text in xacro.items()),
            *(
                Setting(("robot", key), list(names), f"--{key.replace('_', '-')}")
                for key in ("fix", "allow_unphysical")
                if (names := _value(options, key))
            ),
            *map(parse, options.set),
        ]
        named = "allow_unphysical" in tree(self.wanted).get("robot", {})
        if self.file is None and not (inertia or named):
            why = "inertia does not matter where nothing moves"
            self.wanted.append(Setting(("robot", "allow_unphysical"), [ALL], why, ASSUMED))

    def scenario(self, moves: bool) -> Scenario:
        from jointplay.scenario import Scenario
        from jointplay.scenario.reading import merge, settings_beyond
        from jointplay.scenario.robot import SCARA_JOINT, robot_scenario

        options, preset = self.options, chosen_preset(self.options)
        if self.file is not None and not self._anything:
            return self.file
        names = list(self.named)
        if options.place is None and not names and not self.ideal:
            names = [SCARA_JOINT]
        names += [] if self.ideal else self._loosened()
        settings = [*([] if preset is None else self._of_preset(preset)), *self.sized]
        beyond = []
        if self.file is None and options.place is not None:
            beyond = settings_beyond(self.description, self.ideal)
        # What options speak of: joints and gears that file, preset or --set have.
        known = merge(self.tables, tree([*beyond, *settings, *self.wanted]))
        if names or for_joints(options):
            settings += self._of_joints(names, known.get("joints", {}))
        gears = self._of_gears(known.get("gears", {}))
        settings += gears
        if self.ideal:
            geared = dict.fromkeys([*known.get("gears", {}), *(gear.key[1] for gear in gears)])
            settings += [Setting(("gears", name, "play"), 0.0, "--ideal") for name in geared]
            loose = tree(self.wanted).get("joints", {})
            settings += [Setting(("joints", name, "ideal"), True, "--ideal") for name in loose]
        settings += [*self._others(known), *self.tool, *self.wanted]
        if self.file is None:
            scenario = robot_scenario(options.place, names, settings, self.ideal, moves)
        else:
            scenario = Scenario.load(options.place, settings)
        scenario.assumptions += dict.fromkeys(self.converted)
        if preset is not None:
            about, *origins = (
                f"preset {preset.name}: {line}" for line in (preset.words, *preset.origins)
            )
            scenario.assumptions[:] = [about, *scenario.assumptions, *origins]
        elif own_preset(options):
            scenario.assumptions.append(
                f"note: what is publicly known of the joints of {options.place} is left out; "
                "--preset takes it"
            )
        return scenario

    @property
    def _anything(self) -> bool:
        """Whether any option says anything of the machine."""
        words = ("gear", "payload", "joint_friction", "registers")
        others = (_value(self.options, name) for name in words)
        named = [*self.wanted, *self.named, *_given(self.options)]
        return bool(named or any(others) or _value(self.options, "preset") is not None)

    @cached_property
    def description(self) -> Description:
        from jointplay.scenario.reading import description_of
        from jointplay.scenario.robot import robot_place

        if self.file is None:
            return description_of(robot_place(self.options.place), self.wanted)
        robot = self.file.model(self._case or self.file.cases[0]).robot
        return description_of(robot.urdf, self.wanted, self.file.path.parent)

    @property
    def _case(self) -> str | None:
        case = self.options.case
        return case if isinstance(case, str) else None

    @cached_property
    def tables(self) -> dict[str, dict[str, Any]]:
        """What any case of the file says of single joints, by the name of the table."""
        if self.file is None:
            return {}
        tables: dict[str, dict[str, Any]] = {
            name: {} for name in ("joints", "gears", "drives", "joint_friction")
        }
        for model in map(self.file.model, self.file.cases):
            for table, joints in tables.items():
                for name, draft in getattr(model, table).items():
                    joints.setdefault(name, {"kind": draft.word, **draft.fields})
        return tables

    @cached_property
    def _movers(self) -> list[str]:
        """Joints that move the tool of the robot without play, which can have some.

        A tool that is chosen for that is the tool.
        """
        from jointplay.physics.joints import replacing
        from jointplay.scenario.robot import robot_scenario

        if self.file is not None:
            mechanism = self.file.mechanism(self._case)
        else:
            every = [*self._others({}), *self.wanted]
            about = [setting for setting in every if setting.key[0] == "robot"]
            mechanism = robot_scenario(self.options.place, (), about, moves=False).mechanism()
        mechanism = mechanism.ideal()
        if mechanism.tool_reason and _value(self.options, "tool") is None:
            chosen = Setting(("robot", "tool"), mechanism.tool, mechanism.tool_reason, ASSUMED)
            self.tool = [chosen]
        kinds = {name: entry.kind for name, entry in mechanism.description.joints.items()}
        movers = mechanism.movers(_value(self.options, "relative_to"))
        return [name for name in movers if name not in kinds or replacing(kinds[name])]

    def _loosened(self) -> list[str]:
        """Joints that --clearance is for beside those named: all others that move the tool.

        Unless --joint names some without a size, which it is for, or a file has some.
        """
        asked = any(
            _value(self.options, name) is not None for name in ("clearance", "axial_clearance")
        )
        bare = None in self.named.values() or self.options.place is None
        if not asked or bare or self.tables.get("joints"):
            return []
        return [name for name in self._movers if name not in self.named]

    def _of_preset(self, preset: Preset) -> list[Setting]:
        """What the preset says of joints of which neither the file nor a fit says it."""
        settings = preset.settings(self.description)
        left = {table: [*joints] for table, joints in self.tables.items()}
        fitted = [setting.key[1] for setting in self.sized if setting.key[2] == "fit"]
        left["joints"] = [*left.get("joints", ()), *fitted]
        if self.ideal:
            left["joints"] = [setting.key[1] for setting in settings]
        return [each for each in settings if each.key[1] not in left.get(each.key[0], ())]

    @cached_property
    def sized(self) -> list[Setting]:
        """Bearings and fits of joints given as NAME=BEARING or NAME=FIT."""
        from jointplay.physics.joints.bearings import bearing_kind, is_catalogued
        from jointplay.physics.joints.fits import is_fit

        settings = []
        for name, text in self.named.items():
            table: dict[str, str] = {}
            if text is not None and is_fit(text) and not is_catalogued(text):
                table = {"fit": text}
            elif text is not None and (kind := bearing_kind(text)) is not None:
                table = {"kind": kind, "designation": text}
            for key, value in table.items():
                settings.append(Setting(("joints", name, key), value, f"--joint {name}={text}"))
        return settings

    def _of_joints(self, names: Sequence[str], known: Mapping[str, Any]) -> list[Setting]:
        """What options say of joints, in the words of each joint's kind; of all if none are named.

        `known` is what the file, the preset, and --set say of them.

        Raises:
            JointplayError: an option for a joint, and no joint.
        """
        from jointplay.scenario.robot import assumed_joint, class_of_joint, kind_of_joint

        options, given = self.options, for_joints(self.options)
        joints = list(names) or [*known]
        if given and not joints:
            raise JointplayError(
                f"{given[0].name} is for a joint with clearance: name it by --joint"
            )
        settings, kinds = [], {}
        for name in joints:
            table = known.get(name, {})
            kinds[name] = class_of_joint(kind_of_joint(name, self.description, table))
            if self.file is not None and name not in known:
                settings.append(assumed_joint(name, self.description, table))
        # Joints with a fit, or a bearing of a catalogue, have their sizes by that.
        fitted = [
            name
            for name in joints
            if not {"fit", "designation"}.isdisjoint(known.get(name, {}))
            and self.named.get(name, "") is not None
        ]
        for flag in given:
            able = [name for name, kind in kinds.items() if _has(kind, flag)]
            if flag.name in _OF_FIT:
                able = [name for name in able if name not in fitted] or able
            for key in flag.keys:
                for name in able or joints:
                    path = _path(key, name, kinds[name], options)
                    settings.append(Setting(path, _value(options, flag.attribute), flag.name))
        sized = {setting.key[1] for setting in self.sized}
        for name, text in self.named.items():
            if text is not None and name not in sized:
                path = _path(_CLEARANCE.keys[0], name, kinds[name], options)
                settings.append(Setting(path, number(text), f"--joint {name}={text}"))
        if self.file is not None:  # who names a joint of one case wants its play
            settings += [Setting(("joints", name, "ideal"), False, "--joint") for name in names]
        return settings

    def _of_gears(self, known: Mapping[str, Any]) -> list[Setting]:
        """What options say of gears: those of --gear, or else all that are known."""
        plays: dict[str, float] = {}
        if entries := _value(self.options, "gear"):
            joints = self.description.joints
            units = {name: j.unit for name, j in joints.items() if j.kind != "fixed"}
            every = [text for text in entries if name_and_number(text)[0] == ALL]
            if every:
                free = [n for n in units if joints[n].mimic is None]
                # A file of the whole robot has the play of all; else that which moves the tool.
                of_all = free if _value(self.options, "all") else self._movers
                plays = _plays_of_all(every, {n: units[n] for n in of_all if n in units})
            each = [text for text in entries if text not in every]
            plays |= commands.numbers_by_name(each, "--gear JOINT=PLAY", units)
        idle = not (plays or known or _value(self.options, "whole"))
        if idle and _value(self.options, "encoder") is not None:
            raise JointplayError("--encoder is for gears; no joint has one; add it with --gear")
        settings = [Setting(("gears", n, "play"), x, f"--gear {n}") for n, x in plays.items()]
        for flag in (flag for flag in _given(self.options) if flag.keys[0][0] == "gears"):
            if not (plays or known):
                raise JointplayError(
                    f"{flag.name} is for gears; no joint has one; add it with --gear"
                )
            for name in plays or known:
                value = _value(self.options, flag.attribute)
                settings.append(Setting(("gears", name, flag.keys[0][2]), value, flag.name))
        return settings

    def _others(self, known: Mapping[str, Any]) -> list[Setting]:
        """Settings of neither joints nor gears; `known` is what file, preset and --set say."""
        options = self.options
        settings = [
            Setting(key, _value(options, flag.attribute), flag.name)
            for flag in _given(options)
            for key in flag.keys
            if key[0] not in ("joints", "gears")
        ]
        settings = _of_drives(settings, known)
        if mass := _value(options, "payload"):
            held = [*known.get("payloads", ()), {"mass": mass}]
            settings.append(Setting(("payloads",), held, "--payload"))
        for entry in _value(options, "joint_friction") or ():
            name, values = name_and_number(entry)
            parts = [number(value.strip()) for value in (values or "").split(",")]
            if len(parts) != 2:
                raise misread(entry, "--joint-friction JOINT=COULOMB,VISCOUS")
            for key, value in zip(("coulomb", "viscous"), parts, strict=True):
                settings.append(Setting(("joint_friction", name, key), value, "--joint-friction"))
        return settings + self._of_registers(known.get("drives", {}))

    def _of_registers(self, drives: Mapping[str, Any]) -> list[Setting]:
        """Gains that --registers sets, of the servos in the catalogue that it names, or all."""
        from jointplay.simulation.loads.drive import Servo

        able = {
            name: table
            for name, table in drives.items()
            if isinstance(table, Mapping) and table.get("catalogue")
        }
        settings: list[Setting] = []
        for entry in _value(self.options, "registers") or ():
            joint, colon, text = entry.rpartition(":")
            pairs = [pair.partition("=")[::2] for pair in text.split(",")]
            values = {name.strip(): number(value.strip()) for name, value in pairs}
            if not all(isinstance(value, int | float) for value in values.values()):
                raise misread(entry, "--registers P=16,D=32,I=0")
            if not able:
                raise JointplayError(
                    "--registers is of servos in the catalogue, and there is none: give --preset, "
                    'or --set \'drives.JOINT={kind="servo", catalogue="STS3215", ...}\''
                )
            if colon:
                require_known("servo", joint, able)
            for name in [joint] if colon else able:
                supply = quantity(able[name]["voltage"], "V", f"drives.{name}.voltage")
                gains, told = Servo.gains_of(able[name]["catalogue"], supply, values)
                settings += [
                    Setting(("drives", name, gain), value, "--registers")
                    for gain, value in gains.items()
                ]
                self.converted += told
        return settings


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
    arguments = {}
    for text in texts or ():
        name, sign, value = text.partition(":=")
        if not (sign and name.strip()):
            raise misread(text, "--xacro NAME:=VALUE")
        arguments[name.strip()] = value
    return arguments


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
    def values(self) -> list[Value]:
        """The values of which it is made, with their origins."""
        from jointplay.simulation.values import values

        machine = self.poses.machine
        if machine.motion is not None:  # which leads some of its drives
            machine = self.scenario.simulation(self.case)
        return values(machine, self.scenario.origins(self.case), merged=False)

    @property
    def simulation(self) -> Simulation | None:
        """As a run of a scenario file has it; None of a robot."""
        return self.scenario.simulation(self.case) if self.of_file else None


def posed_machine(
    options: argparse.Namespace, single: bool = False, inertia: bool = True
) -> PosedMachine:
    """The machine that the options describe, and the poses at which it is to be looked at.

    `single`: whether that is one, which does not follow a scenario's motion. `inertia`: whether
    inertias matter, see `scenario_of`.

    Raises:
        JointplayError: several poses where it is one; see `scenario_of`.
    """
    from jointplay.accuracy.poses import poses_of
    from jointplay.scenario import assumptions

    ways = {name: _value(options, name) for name in ("pose", "poses", "motion", "workspace")}
    chosen = [name for name, value in ways.items() if value not in (None, [])]
    if len(chosen) > 1:
        raise JointplayError(f"give one of --{' and --'.join(chosen)}")
    scenario = scenario_of(options, moves=False, inertia=inertia)
    case = options.case or scenario.cases[0]
    machine, named = scenario.simulation(options.case, still=True), named_joints(options)
    if single:
        require_one_pose(options)
    given = _given_poses(options, machine.mechanism)
    if single and not given and ways.get("motion") is None:
        given = {"": {}}
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


def require_one_pose(options: argparse.Namespace) -> None:
    if len(options.pose) > 1:
        raise JointplayError(f"give --pose once, got {len(options.pose)}")


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
    if twice := [name for name, count in Counter(header).items() if count > 1]:
        raise JointplayError(f"{file}: column {twice[0]!r} appears twice")
    poses: dict[str, dict[str, float]] = {}
    for number, row in rows:
        line, cells = f"{file}, line {number}", [cell.strip() for cell in row]
        name = cells[0] if named else str(len(poses) + 1)
        if name in poses:
            raise JointplayError(f"{line}: there are two poses {name!r}")
        pairs = [*zip(header, cells, strict=True)][named:]
        poses[name] = {
            joint: _position(mechanism, joint, cell, f"{line}, {joint}") for joint, cell in pairs
        }
    if not poses:
        raise JointplayError(f"{file} has no poses: give a line of joint positions for each")
    return poses


def positions(mechanism: Mechanism, text: str) -> dict[str, float]:
    """Positions of joints [rad or m] in text such as ``JOINT=X,JOINT=X``."""
    at = {}
    names = mechanism.description.joints
    longest = sorted(map(re.escape, names), key=len, reverse=True)
    ahead = f"(?=\\s*(?:{'|'.join(longest)})\\s*=)"  # a name may have commas of its own
    for part in re.split(f",{ahead}", text) if text else ():
        name, value = name_and_number(part.strip(), names)
        name = name if name in names else name.strip()
        if value is None:
            raise misread(part, "--pose JOINT=X,JOINT=X,...")
        at[name] = _position(mechanism, name, value, f"--pose {name}")
    return at


def _position(mechanism: Mechanism, joint: str, text: str, where: str) -> float:
    """Position of a joint [rad or m]; errors begin with `where`."""
    entry = mechanism.description.joints.get(joint)
    return quantity(text, "m" if entry is not None and entry.slides else "rad", where)


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
    classes = (options.whole, errors and errors.assumed, preset and preset.errors)
    kind = next(filter(None, classes), None)
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
    return [flag for flag in (_CLEARANCE, *FLAGS) if _value(options, flag.attribute) is not None]


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


def _value(options: argparse.Namespace, attribute: str) -> Any:
    """Value of an option; None also if the command does not have it."""
    return getattr(options, attribute, None)


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
                plays[name] = quantity(value, unit, "--gear all")
            except JointplayError as error:
                errors.append(error)
        if errors and not plays:
            raise errors[0]
    return plays


def _of_drives(settings: Sequence[Setting], known: Mapping[str, Any]) -> list[Setting]:
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

    drives, settled = known.get("drives", {}), []
    common = kind_of(known.get("drive", {}))
    for setting in settings:
        if setting.key[0] != "drive":
            settled.append(setting)
            continue
        kinds = {name: kind_of(table) for name, table in drives.items()}
        able = [name for name, kind in kinds.items() if takes(kind, setting.key[1])]
        settled += [replace(setting, key=("drives", name, setting.key[1])) for name in able]
        if takes(common, setting.key[1]) and (able or not drives):
            settled.append(setting)
        elif not able:
            there = f"{', '.join(sorted({*kinds.values()}))} of {few(list(drives))}"
            raise JointplayError(
                f"{setting.source} has no meaning for the drives there are: "
                f"{there if drives else common}"
            )
    return settled


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
