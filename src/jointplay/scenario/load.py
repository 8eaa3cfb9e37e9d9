"""A scenario file: read, its cases merged and checked, each ready to simulate."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from jointplay.contact.trust import trusting
from jointplay.errors import JointplayError, MissingName
from jointplay.scenario.build import MOTION_SOURCES, SHIPPED, Misplaced, build, locate
from jointplay.scenario.model import NOT_IN_A_CASE, Model
from jointplay.scenario.places import Key, dotted, line_of, lines
from jointplay.scenario.tables import unknown_key
from jointplay.simulation.simulation import Run, Simulation
from jointplay.units import shown

_EXPECTED = {
    "bool_type": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text in quotes",
    "list_type": "a list in brackets",
    "dict_type": "a table",
}
"""What pydantic's kinds of error expect."""

_BLAMED = {
    "integration": (
        *("step", "macro_step", "macro step", "tolerance"),
        *("duration", "integrator", "seed"),
    ),
    "output": ("record_every",),
    "motion": ("motion",),
    "start": ("start",),
}
"""Keys whose names begin messages of `Simulation`, by table."""

LONGEST = 5_000_000
"""Most characters of a scenario."""

DEEPEST = 50
"""Most parts of a key."""

_DEEP_KEY = re.compile(
    r"(?<![\w\"'-])(?:[\w\"'-]+[ \t]*\.[ \t]*){%d}" % DEEPEST  # noqa: UP031
)

_SELECTORS = ("kind", "law")


class Scenario:
    """A TOML file that describes one or several cases to simulate.

    Attributes:
        path, text: the file.
        trust: modules from which it may take laws.
        title: what it is about.
        cases: labels of its cases, in order; a file without cases has one, named like the file.
        figures: whether figures that compare the cases are wanted.
        sweep: the table [sweep] as it stands, empty if there is none; `jointplay.sweeps` reads it.
    """

    def __init__(self, text: str, path: str | Path, trust: Collection[str] = ()) -> None:
        """Check the scenario `text`, naming `path` in errors; see `load`."""
        self.path = Path(path)
        self.trust = tuple(trust)
        self.text = text
        data = self._parsed(text)
        cases = data.pop("cases", {})
        self.sweep = dict(self._table(data.pop("sweep", {}), ("sweep",)))
        self._base = data
        self._changes: dict[str, dict[str, Any]] = {}
        for label, changes in self._table(cases, ("cases",)).items():
            self._changes[label] = dict(self._table(changes, ("cases", label)))
        self._named = bool(self._changes)
        if not self._named:
            self._changes = {self.path.stem: {}}
        self.cases = tuple(self._changes)
        models = [self.model(case) for case in self.cases]
        self.title = models[0].title or self.path.stem
        self.figures = models[0].output.figures

    def _parsed(self, text: str) -> dict[str, Any]:
        if len(text) > LONGEST:
            raise JointplayError(
                f"{self.path}: {len(text) / 1e6:.3g} MB of text; a scenario has at most "
                f"{LONGEST / 1e6:g} MB"
            )
        deep = _DEEP_KEY.search(text)
        if deep:
            line = text.count("\n", 0, deep.start()) + 1
            raise JointplayError(f"{self.path}, line {line}: a key has at most {DEEPEST} parts")
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise JointplayError(f"{self.path}{_syntax(str(error))}") from None
        except RecursionError:
            raise JointplayError(f"{self.path}: lists or tables are nested too deeply") from None
        except ValueError as error:  # a whole number of too many digits
            raise JointplayError(f"{self.path}: {error}") from None

    @classmethod
    def load(cls, path: str | Path, trust: Collection[str] = ()) -> Scenario:
        """Read and check a scenario file; ``jointplay:scara.toml`` is one that ships.

        Args:
            path: the file.
            trust: modules from which it may take laws, besides those that lie beside it.

        Raises:
            JointplayError: the file cannot be read, is no TOML, or says what cannot be. The
                message has the file, the line, the key, its value and what is possible instead.
        """
        if str(path).startswith(SHIPPED):
            path = locate(str(path), Path())
        try:
            text = Path(path).read_text(encoding="utf-8-sig")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise JointplayError(f"cannot read the scenario {str(path)!r}: {reason}") from None
        return cls(text, path, trust)

    def simulation(
        self, case: str | None = None, changes: Mapping[str, Any] | None = None
    ) -> Simulation:
        """The simulation of a case.

        Args:
            case: its label; may be left out if there is only one.
            changes: further changes, nested as in the file, on top of those of the case.

        Raises:
            MissingName: no such case.
            JointplayError: what the file says cannot be built.
        """
        if case is None:
            if len(self.cases) > 1:
                raise JointplayError(f"{self.path}: choose a case: {', '.join(self.cases)}")
            (case,) = self.cases
        model = self.model(case, changes)
        try:
            with trusting(self.trust):
                return build(model, self.path.parent)
        except Misplaced as error:
            raise self._error(error.path, str(error), case, True) from None
        except JointplayError as error:
            raise self._in_case(case, model, error) from None

    def prepare(self, case: str | None = None) -> Run:
        """A case made ready to step; see `simulation` and `Simulation.prepare`."""
        simulation = self.simulation(case)
        case = self.cases[0] if case is None else case
        try:
            return simulation.prepare()
        except JointplayError as error:
            raise self._in_case(case, self.model(case), error) from None

    def _in_case(self, case: str, model: Model, error: JointplayError) -> JointplayError:
        """An error of a simulation, said of this file, case, and the key it names."""
        message = str(error)
        path: Key = ()
        for name in model.loops:
            if f"loop {name!r}" in message:
                path = ("loops", name)
        for table, keys in _BLAMED.items():
            for key in keys:
                if re.match(rf"(the )?{key}\b", message):
                    key = key.replace(" ", "_")
                    path = (table, key) if key != table else (table,)
        return self._error(path, message, case, True)

    def model(self, case: str, changes: Mapping[str, Any] | None = None) -> Model:
        """What the file says of a case, checked; see `simulation`."""
        if case not in self._changes:
            raise MissingName("case", case, self.cases)
        for key in NOT_IN_A_CASE:
            if key in self._changes[case]:
                message = unknown_key(
                    key, [k for k in Model.model_fields if k not in NOT_IN_A_CASE]
                )
                raise self._error(("cases", case, key), message)
        if "figures" in (self._changes[case].get("output") or {}):
            message = "figures compare all cases; give this in [output]"
            raise self._error(("cases", case, "output", "figures"), message)
        data = merge(self.data(case), changes or {})
        try:
            return Model.model_validate(data)
        except ValidationError as error:
            found = [_explain(data, one) for one in error.errors(include_url=False)]
        located = sorted(found, key=lambda one: self._line(self._place(one[0], case)) or 0)
        path, message = located[0]
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise self._error(path, message + more, case)

    def data(self, case: str) -> dict[str, Any]:
        """What the file says of a case, as TOML has it; see `model`."""
        return merge(self._base, self._changes[case])

    def error(self, path: Key, message: str) -> JointplayError:
        """An error of the key at `path`, with file and line."""
        return self._error(path, message)

    def _table(self, value: Any, path: Key) -> Mapping[str, Any]:
        if not isinstance(value, Mapping):
            raise self._error(path, f"{shown(value)} is no table")
        return value

    @cached_property
    def _lines(self) -> dict[Key, int]:
        return lines(self.text)

    def _line(self, path: Key) -> int | None:
        return line_of(self._lines, path)

    def _place(self, path: Key, case: str | None) -> Key:
        """Where the file has the key: in the case, if it is there that it has it."""
        if case is None or not self._named:
            return path
        inside: Key = ("cases", case, *path)
        for size in range(len(path), 0, -1):
            if inside[: size + 2] in self._lines:
                return inside
            if path[:size] in self._lines:
                return path
        return path

    def _error(
        self, path: Key, message: str, case: str | None = None, built: bool = False
    ) -> JointplayError:
        place = self._place(path, case)
        line = self._line(place)
        words = [str(self.path)]
        words += [] if line is None else [f"line {line}"]
        words += [dotted(place)] if place else []
        if built and self._named and place[:1] != ("cases",):
            words.append(f"case {shown(case)}")
        return JointplayError(f"{', '.join(words)}: {' '.join(message.split())}")


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with `changes`, tables merged key by key.

    A table that selects another law, kind or source of the motion replaces the one before.
    """
    merged = dict(base)
    for key, value in changes.items():
        before = merged.get(key)
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            other = any(
                value.get(word, before.get(word)) != before.get(word) for word in _SELECTORS
            )
            other |= (
                key == "motion"
                and not set(before).isdisjoint(MOTION_SOURCES)
                and any(source in value and source not in before for source in MOTION_SOURCES)
            )
            merged[key] = dict(value) if other else merge(before, value)
        else:
            merged[key] = value
    return merged


def _explain(data: Any, error: Mapping[str, Any]) -> tuple[Key, str]:
    """Path of the key, and what is wrong with it, of one of pydantic's errors."""
    path: list[str | int] = []
    here: Any = data
    for part in error["loc"]:
        # Pydantic's location also names the kinds of table it tried, which are no keys.
        inside = isinstance(here, Mapping) and part in here
        inside |= isinstance(here, Sequence) and isinstance(part, int) and not isinstance(here, str)
        if inside:
            path.append(part)
            here = here[part]
    if error["type"] == "scenario":
        key = error["ctx"]["key"]
        return (*path, *([] if key is None else [key])), error["ctx"]["text"]
    if error["type"] == "missing":
        return tuple(path), f"the key {error['loc'][-1]} is missing"
    wanted = _EXPECTED.get(error["type"])
    value = shown(error["input"])
    if wanted is None:
        return tuple(path), f"{value}: {error['msg']}"
    return tuple(path), f"expected {wanted}, got {value}"


def _syntax(message: str) -> str:
    """Tomllib's message, its place in front."""
    found = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", message)
    if found is None:
        return f": {message}"
    what, line, column = found.groups()
    place = f", line {line}, column {column}" if line else ", end of file"
    twice = re.match(r"Cannot (?:declare \((.*?),?\) twice|overwrite a value)", what)
    if twice:
        names = re.findall(r"'([^']*)'|\"([^\"]*)\"", twice[1] or "")
        key = dotted([a or b for a, b in names])
        what = f"{key or 'a key'} is given twice; each may have one entry"
    return f"{place}: {what}"
