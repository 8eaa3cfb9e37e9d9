"""Reading scenario files: TOML with the line of every error, settings on top, cases merged.

A value of a case overrides one of the file's own tables, a setting (`Setting`, as by
``--set KEY=VALUE``) both; all override what the robot's own file says beyond a URDF.
`Scenario` merges these into a checked `declarations.Model` for each case; `build` makes simulations
of it.
"""

from __future__ import annotations

import copy
import json
import re
import tomllib
from collections import OrderedDict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError, MissingName, require_a
from jointplay.base.files import is_file, read_text
from jointplay.base.origins import ASSUMED, FILE, GIVEN
from jointplay.base.pairs import divided
from jointplay.base.schema import ask_scales, check, fields_of, known_keywords, make, unknown_key
from jointplay.base.tables import Overview, few
from jointplay.base.units import not_lost, toml_text
from jointplay.model.robots import SHIPPED, is_robot, resolve
from jointplay.scenario.declarations import (
    MOTION_SOURCES,
    NOT_IN_A_CASE,
    IntegrationTable,
    Model,
    Output,
    require_machine,
)
from jointplay.simulation.loads.drive import ComputedTorque

if TYPE_CHECKING:
    from jointplay.accuracy.robot_errors import RobotErrors
    from jointplay.model.mechanism import Mechanism
    from jointplay.model.urdf import Description
    from jointplay.scenario.build import Built
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation


# TOML files of users, and the lines of their keys, which errors name.

LONGEST = 5_000_000
"""Most characters of a file (judged: a motion of 100,000 rows; longer ones are CSV)."""
DEEPEST = 50
"""Most parts of a key: scenarios have fewer than ten, and readers of keys are recursive."""
_DEEP_KEY = re.compile(
    r"(?<![\w\"'-])(?:[\w\"'-]+[ \t]*\.[ \t]*){%d}" % DEEPEST  # noqa: UP031
)
Key = tuple[str | int, ...]
"""Path of a key: names of tables and keys, and indices of lists."""
_TRIED = 30
"""Lines of an open statement after which it is parsed again only once its brackets are closed."""
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def parsed(text: str, path: Path) -> dict[str, Any]:
    """Parse a TOML file.

    Raises:
        JointplayError: the text is no TOML, or too long or deep; the message has the file and the
            line.
    """
    if len(text) > LONGEST:
        size, most = f"{len(text) / 1e6:.3g} MB", f"{LONGEST / 1e6:g} MB"
        raise JointplayError(f"{path}: {size} of text; at most {most} are read")
    deep = _DEEP_KEY.search(text)
    if deep:
        line = text.count("\n", 0, deep.start()) + 1
        raise JointplayError(f"{path}, line {line}: a key has at most {DEEPEST} parts")
    try:
        return tomllib.loads(text, parse_float=not_lost)
    except tomllib.TOMLDecodeError as error:
        raise JointplayError(f"{path}{_syntax(str(error))}") from None
    except RecursionError:
        raise JointplayError(f"{path}: lists or tables are nested too deeply") from None
    except ValueError as error:  # a whole number of too many digits
        raise JointplayError(f"{path}: {error}") from None


def dotted(path: Sequence[str | int]) -> str:
    """A key's path as TOML writes it, with elements of lists in brackets, counted from 1."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            shown = part if _BARE.fullmatch(part) else json.dumps(part, ensure_ascii=False)
            text += f".{shown}" if text else shown
    return text


def lines(text: str) -> dict[Key, int]:
    """Line of each key in a well-formed TOML text; that of a table is its header's.

    tomllib keeps no positions. So lines are collected until they parse by themselves: then they are
    one statement, whose keys are on its first line.
    """
    known: dict[Key, int] = {}
    counts: dict[Key, int] = {}
    table: Key = ()
    chunk: list[str] = []
    opened = 0
    for number, line in enumerate(text.splitlines(), 1):
        chunk.append(line)
        # Brackets may stand in text, so this is a guess; but to try each line of a long list would
        # be slow.
        opened += sum(line.count(c) for c in "[{") - sum(line.count(c) for c in "]}")
        if opened > 0 and len(chunk) > _TRIED:
            continue
        try:  # a statement may go on over several lines
            parsed = tomllib.loads("\n".join(chunk))
        except tomllib.TOMLDecodeError:
            continue
        start = number - len(chunk) + 1
        header = chunk[0].lstrip().startswith("[")
        chunk, opened = [], 0
        if header:
            table = _header(parsed, counts)
        for path in [()] if header else _paths(parsed):
            key = (*table, *path)
            for size in range(1, len(key) + 1):  # and of the tables above it that have none yet
                known.setdefault(key[:size], start)
    return known


def _header(parsed: Any, counts: dict[Key, int]) -> Key:
    """Path that a header ``[a.b]`` or ``[[a.b]]`` opens, with indices of arrays of tables."""
    path: Key = ()
    while parsed:
        if isinstance(parsed, list):  # [[...]]: a new element
            counts[path] = counts.get(path, -1) + 1
            return (*path, counts[path])
        ((key, parsed),) = parsed.items()
        path = (*path, key)
        if isinstance(parsed, dict) and path in counts:  # a table within the last element
            path = (*path, counts[path])
    return path


def _paths(parsed: Any) -> list[Key]:
    """Paths of a value and of all values in it."""
    if isinstance(parsed, dict):
        items: Any = parsed.items()
    elif isinstance(parsed, list):
        items = enumerate(parsed)
    else:
        return [()]
    return [()] + [(key, *rest) for key, value in items for rest in _paths(value)]


def said_at(path: Path, known: Mapping[Key, int], place: Sequence[str | int]) -> str:
    """Beginning of an error's message: file, line and key.

    The line (of `known`, see `lines`) is that of the key at `place`, or of the nearest table above
    it that the file has.
    """
    above = (tuple(place[:size]) for size in range(len(place), 0, -1))
    line = next((known[key] for key in above if key in known), None)
    parts = [str(path), *([] if line is None else [f"line {line}"])]
    return ", ".join([*parts, *([dotted(place)] if place else [])])


def _syntax(message: str) -> str:
    """Tomllib's message, with the place in front."""
    parts = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", message)
    if parts is None:
        return f": {message}"
    reason, line, column = parts.groups()
    place = f", line {line}, column {column}" if line else ", end of file"
    twice = re.match(r"Cannot (?:declare \((.*?),?\) twice|overwrite a value)", reason)
    if twice:
        names = re.findall(r"'([^']*)'|\"([^\"]*)\"", twice[1] or "")
        key = dotted([a or b for a, b in names])
        reason = f"{key or 'a key'} is given twice; each may have one entry"
    return f"{place}: {reason}"


# Settings: single keys of a scenario given on top of its file, as by ``--set KEY=VALUE``.


@dataclass(frozen=True)
class Setting:
    """A key of a scenario, its value, and where that comes from."""

    key: tuple[str, ...]
    value: Any
    """Value as TOML has it."""
    source: str
    """The option that gave the value, as errors name it."""
    origin: str = GIVEN
    """Origin of the value: ``given``; ``file``, of the robot; ``measured``, ``seen`` or
    ``estimated``, of a preset; ``assumed`` if nobody gave it."""

    why: str = ""
    """Where the value was seen, or why it was chosen."""

    @property
    def assumed(self) -> bool:
        return self.origin == ASSUMED


def parse(text: str) -> Setting:
    """Read a setting written as ``KEY=VALUE``: a dotted key, and its value as in a scenario file.

    Text needs no quotes, for shells take them away: ``drive.kind=prescribed``.

    Raises:
        JointplayError: there is no key, or no value.
    """
    name, value = divided(text)
    if "\n" in name or not name.strip() or value is None or not value.strip():
        raise JointplayError(
            f"--set {toml_text(text)}: give KEY=VALUE, such as "
            'joints.joint_b.radial_clearance="0.3 mm" or integration.step=5e-6'
        )
    name, value = name.strip(), value.strip()
    try:
        table = tomllib.loads(f"{name} = 0")
    except (tomllib.TOMLDecodeError, RecursionError):
        raise JointplayError(
            f"--set {toml_text(text)}: {toml_text(name)} is not a key; parts are joined by dots, "
            "and quoted where they have other signs than letters, digits, - and _; the shell needs "
            "quotes of its own around that: --set 'joints.\"left elbow\".restitution=0.8'"
        ) from None
    key = []
    here: Any = table
    while isinstance(here, dict):
        ((part, here),) = here.items()
        key.append(part)
    return Setting(tuple(key), _value(value), f"--set {name}")


def with_names(settings: Iterable[Setting], names: Collection[str]) -> list[Setting]:
    """Settings with names that contain dots put together again in their keys.

    Shells take quotes away: ``joints."joint_0.0".ideal`` comes as ``joints.joint_0.0.ideal``. Parts
    of a key that together spell one of `names` become that name.
    """
    spelled = {tuple(name.split(".")): name for name in names if "." in name}
    renamed = []
    for setting in settings:
        key: list[str] = []
        rest = setting.key
        while rest:
            fits = [parts for parts in spelled if rest[: len(parts)] == parts]
            parts = max(fits, key=len, default=rest[:1]) if key else rest[:1]
            key.append(spelled.get(parts, parts[0]))
            rest = rest[len(parts) :]
        renamed.append(replace(setting, key=tuple(key)))
    return renamed


def _value(text: str) -> Any:
    """A value as TOML reads it, or else the text itself."""
    for written in (text, json.dumps(text, ensure_ascii=False)):
        try:
            table = tomllib.loads(f"value = {written}", parse_float=not_lost)
        except (ValueError, RecursionError):
            continue
        if set(table) == {"value"}:
            return table["value"]
    return text


def tree(settings: Iterable[Setting]) -> dict[str, Any]:
    """Settings as nested tables; of two for one key the later counts."""
    root: dict[str, Any] = {}
    for setting in settings:
        here = root
        for part in setting.key[:-1]:
            below = here.get(part)
            if not isinstance(below, dict):
                below = here[part] = {}
            here = below
        here[setting.key[-1]] = copy.deepcopy(setting.value)  # later settings may reach into it
    return root


def given_by(settings: Iterable[Setting], path: Key) -> str | None:
    """Source of the last setting that gave the key at `path`; None if none did."""
    sources = [
        setting.source
        for setting in settings
        if setting.key and path[: len(setting.key)] == setting.key
    ]
    return sources[-1] if sources else None


def setting_texts(settings: Iterable[Setting]) -> list[str]:
    """Settings as texts that `parse` reads, to be kept with a result."""
    return [f"{dotted(s.key)}={inline(s.value)}" for s in settings]


def as_toml(data: Mapping[str, Any]) -> str:
    """Text of a TOML file: single keys first, then a section for each table."""
    lines: list[str] = []
    _section((), data, lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def _section(path: Key, table: Mapping[str, Any], lines: list[str]) -> None:
    values = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    if path and (values or not table):
        lines += ["", f"[{dotted(path)}]"]
    lines += [f"{dotted((key,))} = {inline(value)}" for key, value in values.items()]
    for key, value in table.items():
        if isinstance(value, Mapping):
            _section((*path, key), value, lines)


def inline(value: Any) -> str:
    """A value as TOML writes it in one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(inline, value))}]"
    if isinstance(value, float):
        return repr(float(value))  # NumPy's floats, too
    return json.dumps(value, ensure_ascii=False, default=str)


# The robot's own file, read with the settings that concern it.


def description_of(place: str, settings: Sequence[Setting], folder: Path = Path()) -> Description:
    """A robot read with the settings that concern its file: `allow_unphysical`, `fix`, `xacro`."""
    robot = tree(settings).get("robot", {})
    names = {key: robot.get(key) for key in ("allow_unphysical", "fix")}
    allowed, fix = (value if isinstance(value, list) else [] for value in names.values())
    arguments = robot.get("xacro")
    arguments = arguments if isinstance(arguments, dict) else {}
    from jointplay.model.fixing import with_fixed  # imports Pinocchio
    from jointplay.model.formats import read

    return with_fixed(read(place, allowed, folder, arguments), fix)


def settings_beyond(description: Description, ideal: bool) -> list[Setting]:
    """Settings from what a robot's file says beyond a URDF, for joints that move.

    If it is `ideal`, gears have no play.
    """
    settings = []
    for table, rows in description.beyond.tables.items():
        for name, row in rows.items():
            if table == "robot":
                settings.append(Setting((table, name), row, "the MJCF", FILE))
                continue
            if row.get("joint", name) not in description.moving:
                continue
            if table == "gears" and ideal:
                row = row | {"play": 0.0}
            settings.append(Setting((table, name), row, "the MJCF", FILE))
    return settings


TOLERANCE = 1e-3
"""Tolerance of the steps if nothing is said of them: on random robots as good as equal steps of
10 us, at two thirds of their cost (docs/integrators.md)."""
BY_ERROR = f"steps: by their own error, tolerance {TOLERANCE:g} (--step makes them equal)"
"""Line that says so among the assumptions."""
_SELECTORS = ("kind", "law")
"""Keys that select another class for the rest of their table."""
_TABLES = {
    **{field.name: "integration" for field in fields(IntegrationTable)},
    **{field.name: "output" for field in fields(Output)},
}
"""Table of a scenario with each input of a simulation, by the input's name."""
_WORDS = {"normal": "law", "friction": "law", "lubricant": "law", "drive": "kind"}
"""Keys whose bare word stands for a table with this one key."""


@known_keywords
class Scenario(Overview):
    """A TOML file that describes one or several cases to simulate.

    Attributes:
        path, text: the file.
        settings: single keys that override the file and each of its cases.
        title: the scenario's title.
        cases: labels of its cases, in order; a file without cases has one, named like the file.
        figures: whether figures that compare the cases are wanted.
        sweep: the table [sweep] as it stands, empty if there is none; `jointplay.study` reads it.
        assumptions: lines on what was chosen because nobody gave it.
        notes: lines on what was added when simulations were built.
    """

    def __init__(
        self, text: str, path: str | Path, settings: Sequence[Setting] = (), label: str = ""
    ) -> None:
        """Check the scenario `text` of the file `path`; see `load`.

        `label` names the only case of a file without cases; by default it is the file's name.
        """
        require_a("text", text, "str")
        require_a("path", path, "str", "Path")
        require_a("settings", settings, "Iterable")
        for setting in settings:
            require_a("a setting", setting, "Setting")
        self.path = Path(path)
        self.settings = tuple(settings)
        self.text = text
        self.notes: list[str] = []
        self.assumptions: list[str] = []
        self._built: Built = OrderedDict()
        self._read: dict[str, list[Setting]] = {}
        data = parsed(text, self.path)
        cases = data.pop("cases", {})
        self.sweep = dict(self._table(data.pop("sweep", {}), ("sweep",)))
        self._base = data
        self._changes: dict[str, dict[str, Any]] = {}
        for label, changes in self._table(cases, ("cases",)).items():
            self._changes[label] = dict(self._table(changes, ("cases", label)))
        self.settings = tuple(with_names(settings, [*_keys(data), *_keys(self._changes)]))
        self._set = tree(self.settings)
        self._named = bool(self._changes)
        if not self._named:
            self._changes = {label or self.path.stem: {}}
        self.cases = tuple(self._changes)
        models = [self.model(case) for case in self.cases]
        self.title = models[0].title or self.path.stem
        self.figures = models[0].output.figures

    def __reduce__(self) -> tuple[Any, ...]:
        label = "" if self._named else self.cases[0]
        return Scenario, (self.text, self.path, self.settings, label)

    def facts(self) -> tuple[str, dict[str, str]]:
        """File and title; robot, cases, settings, and assumptions."""
        robot = self.model(self.cases[0]).robot.urdf or "[linkage]"
        facts = {"robot": robot, "cases": few(list(self.cases))}
        if self.settings:
            facts["settings"] = few([dotted(setting.key) for setting in self.settings])
        if self.sweep:
            facts["sweep"] = few(list(self.sweep))
        for number, line in enumerate(self.assumptions, 1):
            facts[f"assumed {number}"] = line
        return f"{self.path.name}, {self.title}", facts

    @classmethod
    def load(cls, path: str | Path, settings: Sequence[Setting] = ()) -> Scenario:
        """Read and check a scenario file; ``jointplay:scara.toml`` is one that ships.

        Args:
            path: the file.
            settings: keys that override the file's; see `parse`.

        Raises:
            JointplayError: the file cannot be read, is no TOML, or says what cannot be. The
                message has the file, the line, the key, its value and what is possible instead.
        """
        require_a("path", path, "str", "Path")
        if str(path).startswith(SHIPPED):
            path = resolve(str(path), Path())
        elif not is_file(Path(path)) and is_robot(str(path)):
            raise JointplayError(
                f"{str(path)!r} is a robot; a scenario is needed, a file (.toml) that says besides "
                "which joints have play and how it moves: jointplay init writes one to start from"
            )
        scenario = cls(read_text(Path(path), "scenario"), path, settings)
        for case in (None, *scenario._changes):
            try:
                ask_scales(Model, scenario._base if case is None else scenario._changes[case])
            except JointplayError as error:
                raise scenario.error(error.where, str(error), case) from None
        return scenario

    def simulation(
        self, case: str | None = None, changes: Mapping[str, Any] | None = None, still: bool = False
    ) -> Simulation:
        """The simulation of a case.

        Args:
            case: label of the case; may be left out if there is only one.
            changes: further changes, nested as in the file, on top of those of the case.
            still: whether the machine stands: then the drives of all joints hold it, also those
                that no motion leads.

        Raises:
            MissingName: no such case.
            JointplayError: what the file says cannot be built.
        """
        case = self._chosen(case)
        model = self.model(case, changes)
        from jointplay.scenario.build import build  # slow to import; a check does without

        with self._building(case):
            simulation, notes = build(model, self.path.parent, self._built, still)
        self.notes += [line for line in notes if line not in self.notes]
        return simulation

    def mechanism(self, case: str | None = None) -> Mechanism:
        """The mechanism of a case; see `simulation`."""
        case = self._chosen(case)
        model = self.model(case)
        from jointplay.scenario.build import mechanism_of

        with self._building(case):
            return mechanism_of(model, self.path.parent, self._built)

    def _chosen(self, case: str | None) -> str:
        """The case, or the only one if none is named."""
        if case is None and len(self.cases) > 1:
            raise JointplayError(f"{self.path}: choose a case: {', '.join(self.cases)} (--case)")
        return self.cases[0] if case is None else case

    @contextmanager
    def _building(self, case: str) -> Iterator[None]:
        """Add the place in the file to errors in the block."""
        try:
            yield
        except JointplayError as error:
            raise self.error(error.where, str(error), case, True) from None

    def robot_errors(self, case: str | None = None) -> RobotErrors | None:
        """Errors besides play of a case's robot; None if the file has none. See `simulation`."""
        mechanism = self.mechanism(case)
        from jointplay.scenario.build import errors_of

        case = self._chosen(case)
        with self._building(case):
            return errors_of(self.model(case), mechanism)

    def ready_run(
        self,
        case: str | None = None,
        progress: bool = False,
        records: Path | None = None,
        ahead: bool = False,
    ) -> Run:
        """A run of a case, ready to step; see `simulation` and `Run`."""
        case = self._chosen(case)
        simulation = self.simulation(case)
        from jointplay.simulation.run import Run  # slow to import; a check does without

        try:
            return Run(simulation, progress, records, ahead=ahead)
        except JointplayError as error:
            where = error.where  # an input of `Simulation`, or a key of the scenario
            if where and where[0] in _TABLES:
                where = (_TABLES[str(where[0])], *where)
            raise self.error(where, str(error), case, True) from None

    def model(self, case: str, changes: Mapping[str, Any] | None = None) -> Model:
        """The checked tables of a case; see `simulation`."""
        if case not in self._changes:
            raise MissingName("case", case, self.cases)
        changed = self._changes[case]
        for key in NOT_IN_A_CASE:
            if key in changed:
                keys = [name for name in fields_of(Model) if name not in NOT_IN_A_CASE]
                raise self.error(("cases", case, key), unknown_key(key, keys))
            if key in self._set and key != "title":
                source = next(setting.source for setting in self.settings if setting.key[0] == key)
                raise JointplayError(f"{source}: settings apply to all cases; leave out the case")
        if "figures" in (changed.get("output") or {}):
            message = "figures compare all cases; give this in [output]"
            raise self.error(("cases", case, "output", "figures"), message)
        data = merge(self.data(case), changes or {})
        try:
            model: Model = make(check(Model, data), objects=False)
            require_machine(model)
            return model
        except JointplayError as error:
            raise self.error(error.where, str(error), case) from None

    def data(self, case: str) -> dict[str, Any]:
        """The tables of a case as TOML has them, merged, unchecked; see `model`."""
        table = merge(merge(self._base, self._changes[case]), self._set)
        if isinstance(drive := table.get("drive"), Mapping):
            table["drive"] = {"kind": ComputedTorque.kind, **drive}
        return merge(self._beneath(table), table)

    def _beneath(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """Tables that lie beneath the scenario's: what the robot's file says beyond a URDF.

        A scenario with its robot's name was made by `robot_scenario`, and has these as settings.
        """
        if isinstance(table.get("linkage"), Mapping):
            return self._beneath_linkage(table)
        from jointplay.model import formats

        robot = table.get("robot")
        place = robot.get("urdf") if isinstance(robot, Mapping) else None
        if not isinstance(place, str) or Path(place).name == self.path.name:
            return {}
        held = [Setting(("robot",), robot, "the scenario")]
        key = repr(robot)
        if key not in self._read:
            settings: list[Setting] = []
            with suppress(JointplayError):  # it comes up again when the robot is built
                if formats.says_more(place, self.path.parent):
                    description = description_of(place, held, self.path.parent)
                    settings = settings_beyond(description, ideal=False)
                    for note in description.beyond.notes:
                        self._assume(note)
            self._read[key] = settings
        drives = "motion" in table and "drive" not in table
        return tree(entry for entry in self._read[key] if drives or entry.key[0] != "drives")

    def _beneath_linkage(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """Tables that lie beneath a linkage's: planar play, cranks that keep speed, steps by error.

        Each becomes an assumption, as do links of round steel rods.
        """
        beneath: dict[str, Any] = {}
        if "speeds" in table.get("motion", ()) and not {"drive", "drives"} & table.keys():
            beneath["drive"] = {"kind": "prescribed"}
            self._assume('motors keep the given speeds: drive.kind = "prescribed"')
        points, joints = table["linkage"].get("points"), table.get("joints")
        planar = isinstance(points, Mapping) and all(
            isinstance(place, list) and len(place) == 2 for place in points.values()
        )
        if planar and isinstance(joints, Mapping):
            kinds = {"kind": "planar"}
            beneath["joints"] = {
                name: kinds
                for name, joint in joints.items()
                if isinstance(joint, Mapping) and "kind" not in joint
            }
            if plane := [*beneath["joints"]]:
                self._assume(f'{few(plane)}: play in the plane, no tilt: kind = "planar"')
        links = table["linkage"].get("links")
        rods = [
            name
            for name, link in (links.items() if isinstance(links, Mapping) else ())
            if isinstance(link, Mapping)
            and len(link.get("points", ())) > 1
            and not {"inertia", "section"} & link.keys()
        ]
        if rods:
            self._assume(
                f"inertia of {few(rods)}: of round steel rods (linkage.links.NAME.inertia)"
            )
        integration = table.get("integration", {})
        steps = {"step", "tolerance", "integrator", "macro_step"}
        if isinstance(integration, Mapping) and not steps & integration.keys():
            beneath["integration"] = {"tolerance": TOLERANCE}
            self._assume(BY_ERROR)
        return beneath

    def _assume(self, line: str) -> None:
        if line not in self.assumptions:
            self.assumptions.append(line)

    def origins(self, case: str) -> dict[tuple[str, ...], tuple[str, str]]:
        """Origin and source of each value of a case, by key: the file, or the last setting."""
        data = merge(self._base, self._changes[case])
        if Path(str(data.get("robot", {}).get("urdf"))).name == self.path.name:
            data = {key: entry for key, entry in data.items() if key not in ("title", "robot")}
        origins = dict.fromkeys(_leaves(data), (FILE, self.path.name))
        for entry in (*self._read.get(repr(self.data(case).get("robot")), ()), *self.settings):
            for key in _leaves(entry.value, entry.key):
                origins[key] = (
                    entry.origin,
                    f"{entry.source}: {entry.why}" if entry.why else entry.source,
                )
        return origins

    def _table(self, value: Any, path: Key) -> Mapping[str, Any]:
        """A value that must be a table."""
        if not isinstance(value, Mapping):
            raise self.error(path, f"{toml_text(value)} is not a table")
        return value

    @cached_property
    def _lines(self) -> dict[Key, int]:
        return lines(self.text)

    def _place(self, path: Key, case: str | None) -> Key:
        """Path of a key of a case in the file: in the case's tables, if these have it."""
        if case is None or not self._named:
            return path
        inside: Key = ("cases", case, *path)
        for size in range(len(path), 0, -1):
            if inside[: size + 2] in self._lines:
                return inside
            if path[:size] in self._lines:
                return path
        return path

    def error(
        self, path: Key, message: str, case: str | None = None, built: bool = False
    ) -> JointplayError:
        """An error about the key at `path`, with the file and line, or the setting that gave it.

        `built`: whether it came up when the case was built, which the message then names.
        """
        source = given_by(self.settings, path)
        if source is not None:
            return JointplayError(f"{source}: {' '.join(message.split())}", where=path)
        place = self._place(path, case)
        of_case = built and self._named and place[:1] != ("cases",)
        where = said_at(self.path, self._lines, place) + (f", case {toml_text(case)}" * of_case)
        return JointplayError(f"{where}: {' '.join(message.split())}", where=path)


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Merge `changes` into a copy of `base`, tables key by key.

    A table that selects another law, kind or source of the motion replaces the one before; another
    robot takes none of the xacro arguments of the one before.
    """
    merged = dict(base)
    if "urdf" in changes and changes["urdf"] != base.get("urdf"):
        merged.pop("xacro", None)
    for key, value in changes.items():
        before = merged.get(key)
        if isinstance(before, str) and isinstance(value, Mapping) and key in _WORDS:
            before = {_WORDS[key]: before}  # friction = "coulomb", then friction.mu_d = 0.2
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            replaced = any(word in value and value[word] != before.get(word) for word in _SELECTORS)
            if key == "motion" and before.keys() & MOTION_SOURCES.keys():
                replaced |= bool((value.keys() & MOTION_SOURCES.keys()) - before.keys())
            merged[key] = dict(value) if replaced else merge(before, value)
        else:
            merged[key] = value
    return merged


def _leaves(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Paths of all single values in a table."""
    if not isinstance(value, Mapping):
        yield path
        return
    for key, item in value.items():
        yield from _leaves(item, (*path, key))


def _keys(table: Mapping[str, Any]) -> Iterator[str]:
    """All keys in a table and in the tables in it."""
    for key, value in table.items():
        yield key
        if isinstance(value, Mapping):
            yield from _keys(value)
