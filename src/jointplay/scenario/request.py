"""Requests: a machine described by the options of a command, made into a scenario.

A request names a scenario's file or a robot, the play of joints, a preset. Options for many joints
at once, such as a clearance of all that move the tool, or a key of every gear, become settings of
each (`reading.Setting`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.origins import ASSUMED
from jointplay.base.pairs import ALL, misread, number, numbers_by_name, quantity
from jointplay.base.schema import fields_of
from jointplay.base.tables import few
from jointplay.model import robots
from jointplay.model.inertias import ALL as ALL_LINKS
from jointplay.model.urdf import Description
from jointplay.physics.joints import Clearance, replacing
from jointplay.physics.joints.bearings import bearing_kind, is_catalogued
from jointplay.physics.joints.fits import is_fit
from jointplay.scenario.reading import (
    Scenario,
    Setting,
    description_of,
    merge,
    settings_beyond,
    tree,
)
from jointplay.scenario.robot import (
    SCARA_JOINT,
    assumed_joint,
    class_of_joint,
    kind_of_joint,
    robot_place,
    robot_scenario,
)
from jointplay.simulation.loads.drive import DRIVES, ComputedTorque, Servo

if TYPE_CHECKING:
    from jointplay.scenario.presets import Preset

EACH = "*"
"""Part of a key that stands for each joint, or each gear."""
CLEARANCE = ("joints", EACH, "clearance")
"""Key that stands for the first of `clearance_fields` of each kind of joint."""
_OF_FIT = ("clearance", "axial_clearance", "bearing_radius", "journal_radius")
"""Sizes that a fit or a catalogued bearing gives: as keys for many joints they leave out such."""
_LINEAR = ("linear-spring", "kelvin-voigt", "anagnostopoulos")
"""Laws with a stiffness of their own, in N/m; elsewhere ``stiffness`` is the joint's."""


@dataclass(kw_only=True)
class Request:
    """A machine as options describe it; of `preset`, `keys` and `settings` the later counts."""

    place: str | None = None
    """A scenario's file, or a robot as `robot_scenario` takes it; None: the SCARA."""
    case: str | None = None
    """Case of the file, whose tool counts."""
    joints: Mapping[str, str | None] = field(default_factory=dict)
    """Joints with clearance, each with its size, fit, or bearing, such as ``6010/C3``, or None."""
    gears: Mapping[str, str | None] = field(default_factory=dict)
    """Play of gears by joint, as text with its unit; ``all``: the joints that move the tool."""
    every: bool = False
    """Whether ``all`` are all joints that move, whether they move the tool or not."""
    keys: Sequence[Setting] = ()
    """Settings for many: ``joints.*`` stands for each of `joints`, ``gears.*`` for each of `gears`,
    or else for all there are; a key of the drive for all drives. Each is set where the kind of
    joint, gear or drive has such a key."""
    payload: float | None = None
    """Mass held at the tool, besides payloads of the file [kg]."""
    registers: Sequence[str] = ()
    """Gains of servos as values of their registers: ``P=16,D=32``, ``JOINT:P=16``."""
    preset: Preset | None = None
    """Joints, gears and drives as they are publicly known, or were measured."""
    settings: Sequence[Setting] = ()
    """Settings of single keys of the scenario."""
    ideal: bool = False
    """Whether a robot has neither clearance nor play in its gears."""
    inertia: bool = True
    """Whether inertias matter, so that those that no rigid body has are refused."""
    relative_to: str | None = None
    """Link or frame against which the tool's motion counts; None: the world."""
    whole: bool = False
    """Whether encoders of gears matter even if no gear has play."""

    def __post_init__(self) -> None:
        self._chosen_tool: list[Setting] = []
        self._of_registers: list[str] = []
        self.file = None
        if self.of_file:
            _refuse_misspelt_robot(str(self.place))
            self.file = Scenario.load(str(self.place))
        elif self.case:
            raise JointplayError("--case needs a scenario (.toml)")
        if self.file is not None and self.ideal:
            raise JointplayError("--ideal is for a robot; here use --set joints.NAME.ideal=true")
        allowed = "allow_unphysical" in tree(self.settings).get("robot", {})
        if self.file is None and not (self.inertia or allowed):
            why = "inertia does not matter where nothing moves"
            key = ("robot", "allow_unphysical")
            self.settings = [*self.settings, Setting(key, [ALL_LINKS], why, ASSUMED)]

    @property
    def of_file(self) -> bool:
        """Whether the machine is a scenario's file rather than a robot."""
        return self.place is not None and not robots.is_robot(self.place)

    @property
    def journals(self) -> list[Setting]:
        """Those of `keys` for joints with clearance."""
        return [setting for setting in self.keys if setting.key[0] == "joints"]

    def scenario(self, moves: bool = True) -> Scenario:
        """The scenario of the request.

        Args:
            moves: whether a robot without a motion gets one; where nothing moves, it needs no play
                either.

        Raises:
            JointplayError: options contradict each other, or name something that is not there.
        """
        asked = self.joints or self.gears or self.keys or self.settings or self.registers
        if self.file is not None and not (asked or self.payload or self.preset):
            return self.file
        names = list(self.joints)
        if self.place is None and not names and not self.ideal:
            names = [SCARA_JOINT]
        names += [] if self.ideal else self._loosened()
        # Of two settings for one key the later counts: from the preset to single keys.
        settings = [*self._preset_settings(), *self._sized]
        beyond = []
        if self.file is None and self.place is not None:
            beyond = settings_beyond(self.description, self.ideal)
        # Tables of joints, gears and drives in the file, the preset or settings.
        known = merge(self._tables, tree([*beyond, *settings, *self.settings]))
        settings += self._joint_settings(names, known.get("joints", {}))
        gears = self._gear_settings(known.get("gears", {}))
        settings += gears
        if self.ideal:
            geared = dict.fromkeys([*known.get("gears", {}), *(gear.key[1] for gear in gears)])
            settings += [Setting(("gears", name, "play"), 0.0, "--ideal") for name in geared]
            loose = tree(self.settings).get("joints", {})
            settings += [Setting(("joints", name, "ideal"), True, "--ideal") for name in loose]
        settings += [*self._other_settings(known), *self._chosen_tool, *self.settings]
        if self.file is None:
            scenario = robot_scenario(self.place, names, settings, self.ideal, moves)
        else:
            scenario = Scenario.load(str(self.place), settings)
        scenario.assumptions += dict.fromkeys(self._of_registers)
        if self.preset is not None:
            about, *origins = (
                f"preset {self.preset.name}: {line}"
                for line in (self.preset.description, *self.preset.origins)
            )
            scenario.assumptions[:] = [about, *scenario.assumptions, *origins]
        return scenario

    @cached_property
    def description(self) -> Description:
        """The robot, or the linkage, of the request."""
        if self.file is None:
            return description_of(robot_place(self.place), self.settings)
        case = self.case or self.file.cases[0]
        robot = self.file.model(case).robot
        if not robot.urdf:  # a linkage
            return self.file.mechanism(case).description
        return description_of(robot.urdf, self.settings, self.file.path.parent)

    @cached_property
    def _tables(self) -> dict[str, dict[str, Any]]:
        """Tables of single joints in any case of the file, by the table's name and the joint."""
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
        """Joints that move the tool of the ideal robot, and can have play.

        If its tool has to be chosen, that choice is kept for the scenario (`_chosen_tool`).
        """
        if self.file is not None:
            mechanism = self.file.mechanism(self.case)
        else:
            robot = [
                setting for setting in (*self.keys, *self.settings) if setting.key[0] == "robot"
            ]
            mechanism = robot_scenario(self.place, (), robot, moves=False).mechanism()
        mechanism = mechanism.ideal()
        if mechanism.tool_reason and not any(
            setting.key == ("robot", "tool") for setting in self.keys
        ):
            tool = Setting(("robot", "tool"), mechanism.tool, mechanism.tool_reason, ASSUMED)
            self._chosen_tool = [tool]
        kinds = {name: entry.kind for name, entry in mechanism.description.joints.items()}
        movers = mechanism.movers(self.relative_to)
        return [name for name in movers if name not in kinds or replacing(kinds[name])]

    def _loosened(self) -> list[str]:
        """Joints that a clearance without a joint is for: all that move the tool and are not named.

        None if `joints` names some without a size, for which it is then, or the file has joints.
        """
        sized = any(
            setting.key[2:] in (("clearance",), ("axial_clearance",)) for setting in self.journals
        )
        bare = None in self.joints.values() or self.place is None
        if not sized or bare or self._tables.get("joints"):
            return []
        return [name for name in self._movers if name not in self.joints]

    def _preset_settings(self) -> list[Setting]:
        """Settings of the preset, without tables that the file has, and joints with a fit."""
        if self.preset is None:
            return []
        settings = self.preset.settings(self.description)
        left = {table: [*joints] for table, joints in self._tables.items()}
        fitted = [setting.key[1] for setting in self._sized if setting.key[2] == "fit"]
        left["joints"] = [*left.get("joints", ()), *fitted]
        if self.ideal:
            left["joints"] = [setting.key[1] for setting in settings]
        return [s for s in settings if s.key[1] not in left.get(s.key[0], ())]

    @cached_property
    def _sized(self) -> list[Setting]:
        """Settings of the bearings and fits of joints that `joints` names with one."""
        settings = []
        for name, text in self.joints.items():
            table: dict[str, str] = {}
            if text is not None and is_fit(text) and not is_catalogued(text):
                table = {"fit": text}
            elif text is not None and (kind := bearing_kind(text)) is not None:
                table = {"kind": kind, "designation": text}
            for key, value in table.items():
                settings.append(Setting(("joints", name, key), value, f"--joint {name}={text}"))
        return settings

    def _joint_settings(self, names: Sequence[str], known: Mapping[str, Any]) -> list[Setting]:
        """Settings of the joints `names`, or of all if none is named, by the keys of their kinds.

        `known`: tables of joints in the file, the preset and `settings`.

        Raises:
            JointplayError: there is a key for joints, and no joint.
        """
        if not (names or self.journals):
            return []
        joints = list(names) or [*known]
        if not joints:
            raise JointplayError(
                f"{self.journals[0].source} is for a joint with clearance: name it by --joint"
            )
        settings, kinds = [], {}
        for name in joints:
            table = known.get(name, {})
            kinds[name] = class_of_joint(kind_of_joint(name, self.description, table))
            if self.file is not None and name not in known:
                settings.append(assumed_joint(name, self.description, table))
        # Joints with a fit, or a catalogued bearing, have their sizes by that.
        fitted = [
            name
            for name in joints
            if not {"fit", "designation"}.isdisjoint(known.get(name, {}))
            and self.joints.get(name, "") is not None
        ]
        for setting in self.journals:
            able = [name for name, kind in kinds.items() if _has(kind, setting.key)]
            if setting.key[2] in _OF_FIT:
                able = [name for name in able if name not in fitted] or able
            for name in able or joints:
                path = self._path(setting.key, name, kinds[name])
                settings.append(replace(setting, key=path))
        sized = {setting.key[1] for setting in self._sized}
        for name, text in self.joints.items():
            if text is not None and name not in sized:
                path = self._path(CLEARANCE, name, kinds[name])
                settings.append(Setting(path, number(text), f"--joint {name}={text}"))
        if self.file is not None:  # a joint that is named shall have play, even if a case has none
            settings += [Setting(("joints", name, "ideal"), False, "--joint") for name in names]
        return settings

    def _path(self, key: Sequence[str], joint: str, kind: type[Clearance]) -> tuple[str, ...]:
        """The key of one joint for a key of many, with the names that its kind and law have."""
        below = tuple(key[2:])
        if below == CLEARANCE[2:]:
            below = (next(iter(kind.clearance_fields), "clearance"),)
        elif below == ("stiffness",):
            law = [setting.value for setting in self.keys if setting.key[2:] == ("normal", "law")]
            below = ("normal", "stiffness") if law and law[0] in _LINEAR else below
        return ("joints", joint, *below)

    def _gear_settings(self, known: Mapping[str, Any]) -> list[Setting]:
        """Settings of gears: of those in `gears`, or else of all that are `known`."""
        plays: dict[str, float] = {}
        if self.gears:
            joints = self.description.joints
            units = {name: joint.unit for name, joint in joints.items() if joint.kind != "fixed"}
            if ALL in self.gears:
                free = [name for name in units if joints[name].mimic is None]
                # Followers have no gears of their own; `every` counts joints off the tool, too.
                movers = [n for n in (free if self.every else self._movers) if n in units]
                plays = _play_of_each(self.gears[ALL], {name: units[name] for name in movers})
            texts = [n if x is None else f"{n}={x}" for n, x in self.gears.items() if n != ALL]
            plays |= numbers_by_name(texts, "--gear JOINT=PLAY", units)
        encoders = [entry for entry in self.keys if entry.key == ("drive", "encoder")]
        of_gears = [entry for entry in self.keys if entry.key[0] == "gears"]
        if not (plays or known) and (idle := of_gears or ([] if self.whole else encoders)):
            raise JointplayError(
                f"{idle[0].source} is for gears; no joint has one; add it with --gear"
            )
        settings = [Setting(("gears", n, "play"), x, f"--gear {n}") for n, x in plays.items()]
        return settings + [
            replace(setting, key=("gears", name, *setting.key[2:]))
            for setting in of_gears
            for name in plays or known
        ]

    def _other_settings(self, known: Mapping[str, Any]) -> list[Setting]:
        """Settings of drives, payloads and others; `known`: tables in file, preset, `settings`."""
        settings = []
        for setting in self.keys:
            if setting.key[0] == "drive":
                settings += _of_each_drive(setting, known)
            elif setting.key[0] not in ("joints", "gears"):
                settings.append(setting)
        if self.payload:
            held = [*known.get("payloads", ()), {"mass": self.payload}]
            settings.append(Setting(("payloads",), held, "--payload"))
        return settings + self._register_settings(known.get("drives", {}))

    def _register_settings(self, drives: Mapping[str, Any]) -> list[Setting]:
        """Settings of gains by `registers`, for the servos that they name, or all in `drives`."""
        able = {
            name: table
            for name, table in drives.items()
            if isinstance(table, Mapping) and table.get("catalogue")
        }
        settings: list[Setting] = []
        for text in self.registers:
            joint, colon, registers = text.rpartition(":")
            pairs = [pair.partition("=")[::2] for pair in registers.split(",")]
            values = {name.strip(): number(value.strip()) for name, value in pairs}
            if not all(isinstance(value, int | float) for value in values.values()):
                raise misread(text, "--registers P=16,D=32,I=0")
            if not able:
                raise JointplayError(
                    "--registers is of servos in the catalogue, and there is none: give --preset, "
                    'or --set \'drives.JOINT={kind="servo", catalogue="STS3215", ...}\''
                )
            if colon:
                require_known("servo", joint, able)
            for name in [joint] if colon else able:
                supply = quantity(able[name]["voltage"], "V", f"drives.{name}.voltage")
                gains, notes = Servo.gains_of(able[name]["catalogue"], supply, values)
                settings += [
                    Setting(("drives", name, gain), value, "--registers")
                    for gain, value in gains.items()
                ]
                self._of_registers += notes
        return settings


def _has(kind: type[Clearance], key: Sequence[str]) -> bool:
    """Whether joints of a kind have the field that a key of many is for."""
    return bool(kind.clearance_fields) if key == CLEARANCE else key[2] in fields_of(kind)


def _play_of_each(text: str | None, units: Mapping[str, str]) -> dict[str, float]:
    """A play for each joint with the play's unit, by joint.

    Raises:
        JointplayError: no play is given, or no joint has its unit.
    """
    if text is None:
        raise misread(ALL, f"--gear {ALL}=PLAY")
    plays: dict[str, float] = {}
    errors: list[JointplayError] = []
    for name, unit in units.items():
        try:
            plays[name] = quantity(text, unit, f"--gear {ALL}")
        except JointplayError as error:
            errors.append(error)
    if errors and not plays:
        raise errors[0]
    return plays


def _of_each_drive(setting: Setting, known: Mapping[str, Any]) -> list[Setting]:
    """A setting for the common drive, and for each joint's own, where they have the key.

    Raises:
        JointplayError: no drive has it.
    """
    drives, key = known.get("drives", {}), setting.key[1]
    kinds = {name: _kind_of_drive(table) for name, table in drives.items()}
    common = _kind_of_drive(known.get("drive", {}))
    able = [name for name, kind in kinds.items() if _takes(kind, key)]
    settings = [replace(setting, key=("drives", name, key)) for name in able]
    if _takes(common, key) and (able or not drives):
        settings.append(setting)
    if not settings:
        which = f"{', '.join(sorted({*kinds.values()}))} of {few(list(drives))}"
        raise JointplayError(
            f"{setting.source} has no meaning for the drives there are: "
            f"{which if drives else common}"
        )
    return settings


def _kind_of_drive(table: Any) -> str:
    return str(table if isinstance(table, str) else table.get("kind", ComputedTorque.kind))


def _takes(kind: str, key: str) -> bool:
    """Whether a kind of drive has a key; an unknown kind is refused later."""
    return kind not in DRIVES or key in fields_of(DRIVES[kind])


def _refuse_misspelt_robot(place: str) -> None:
    """Refuse a place that is neither a file nor looks like one: a robot's name gone wrong."""
    if files.is_file(Path(place)) or Path(place).suffix or "/" in place or ":" in place:
        return
    try:
        robots.with_package(place)
    except JointplayError as error:
        text = f"{place!r} is neither a file nor a robot: {error}; see jointplay robots"
        raise JointplayError(text) from None
