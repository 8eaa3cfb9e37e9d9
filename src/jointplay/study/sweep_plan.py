"""The plan of a sweep: its axes, its samples, and the changes of the scenario for each case."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from jointplay.base.errors import JointplayError, MissingName, require_non_negative, require_whole
from jointplay.base.files import read_text
from jointplay.base.modules import file_of, imported
from jointplay.base.schema import check, unknown_key
from jointplay.base.tables import counted
from jointplay.base.units import toml_text
from jointplay.model.formats import urdf_text
from jointplay.model.robots import resolve, source_of
from jointplay.scenario import Scenario
from jointplay.scenario.reading import Key, dotted, merge
from jointplay.simulation.analysis.uncertainty import Until, read_until
from jointplay.study.axes import GROWING, METHODS, Axis, points, read
from jointplay.study.keys import set_key
from jointplay.study.store import MOST_CASES, Index

SAMPLE, REPEAT = "sample", "repeat"
"""Names of the dimensions of samples from distributions, and of repeated runs."""
RESERVED = (SAMPLE, REPEAT, "status", "error", "result")
"""Names that no axis can have."""


@dataclass(frozen=True)
class SweepPlan:
    """The cases of a sweep, numbered along its dimensions."""

    scenario: Scenario
    case: str
    """Case of the scenario that is changed."""
    axes: tuple[Axis, ...] = ()
    """Dimensions of the grid."""
    drawn: tuple[Axis, ...] = ()
    """Quantities sampled from distributions, all along one dimension."""
    sampling: str = METHODS[0]
    samples: int = 0
    seed: int = 0
    repeats: int = 1
    """Runs of each point with displaced journals; their seeds are `seed` and those that follow."""
    measures: tuple[str, ...] = ()
    """Functions of a result, ``module:function``."""
    results: bool = False
    """Whether the results of cases are kept."""
    start: float | None = None
    """Time from which measures are taken [s]; None: from where the scenario's runs are judged."""
    tool_error: bool = True
    """Whether the tool is compared with the ideal mechanism's."""
    until: Until | None = None
    """The precision that ends the sweep."""
    table: Mapping[str, Any] = field(default_factory=dict)
    """The table [sweep]."""

    @cached_property
    def points(self) -> np.ndarray:
        """Samples in the unit cube, shape (rows, drawn axes)."""
        return points(self.sampling, self.samples, len(self.drawn), self.seed)

    @cached_property
    def drawn_values(self) -> np.ndarray:
        """Samples in SI, shape (rows, drawn axes)."""
        return np.column_stack(
            [axis.quantile(self.points[:, k]) for k, axis in enumerate(self.drawn)]
        )

    @cached_property
    def sizes(self) -> dict[str, int]:
        sizes = {axis.name: len(axis.values) for axis in self.axes}
        if self.drawn:
            block = len(self.drawn) + 2 if self.sampling == "saltelli" else 1
            sizes[SAMPLE] = self.samples * block
        if self.repeats > 1:
            sizes[REPEAT] = self.repeats
        return sizes

    @property
    def shape(self) -> Index:
        return tuple(self.sizes.values())

    @property
    def count(self) -> int:
        return math.prod(self.shape)

    @property
    def summary(self) -> str:
        """The dimensions in words: ``clearance 5 x repeat 4 = 20 cases``."""
        parts = " x ".join(f"{name} {size}" for name, size in self.sizes.items())
        return f"{parts} = {counted(self.count, 'case')}"

    @cached_property
    def base(self) -> dict[str, Any]:
        """The scenario's tables without the changes of the sweep."""
        return self.scenario.data(self.case)

    def changes(self, index: Index) -> dict[str, Any]:
        """Changes of the scenario's tables for a case."""
        changes: dict[str, Any] = {}
        position = dict(zip(self.sizes, index, strict=True))
        for axis in self.axes:
            changes = self.with_value(axis, axis.values[position[axis.name]], changes)
        for k, axis in enumerate(self.drawn):
            changes = self.with_value(axis, float(self.drawn_values[position[SAMPLE], k]), changes)
        if self.repeats > 1:
            set_key(changes, self.base, ("integration", "seed"), self.seed + position[REPEAT])
        return changes

    def with_value(
        self, axis: Axis, value: Any, changes: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """`changes` together with those that an axis makes for a value."""
        changed = dict(changes or {})
        if not axis.keys:
            return merge(changed, value)
        for key in axis.keys:
            set_key(changed, self.base, key, value)
        return changed

    def values(self, index: Index) -> dict[str, Any]:
        """Coordinates of a case, by name."""
        position = dict(zip(self.sizes, index, strict=True))
        coordinates = self.coordinates.items()
        values = {name: x[position[along]].item() for name, (along, x, _) in coordinates}
        return values | ({REPEAT: position[REPEAT]} if self.repeats > 1 else {})

    def with_samples(self, samples: int) -> SweepPlan:
        """The sweep with more samples, of which the first remain the same."""
        return replace(self, samples=samples, table={**self.table, "samples": samples})

    @cached_property
    def joints(self) -> list[str]:
        """Joints that have clearance in some case."""
        names = dict.fromkeys(str(name) for name in self.base.get("joints", {}))
        for axis in (*self.axes, *self.drawn):
            names |= {str(key[1]): None for key in axis.keys if key[0] == "joints" and len(key) > 1}
            for change in () if axis.keys else axis.values:
                names |= dict.fromkeys(str(name) for name in change.get("joints", {}))
        return list(names)

    @cached_property
    def coordinates(self) -> dict[str, tuple[str, np.ndarray, dict[str, str]]]:
        """By name: the dimension, the values along it, and their unit and meaning."""
        values = [(axis, axis.name, axis.coordinate) for axis in self.axes]
        columns = self.drawn_values.T if self.drawn else ()
        values += [(axis, SAMPLE, x) for axis, x in zip(self.drawn, columns, strict=True)]
        by_name = {}
        for axis, along, x in values:
            text = ", ".join(map(dotted, axis.keys))
            by_name[axis.name] = along, x, {"units": axis.unit, "long_name": text}
        if self.repeats > 1:
            text = "seed of the displacement of the journals"
            seeds = self.seed + np.arange(self.repeats)
            by_name[REPEAT] = REPEAT, seeds, {"units": "", "long_name": text}
        return by_name

    def meaning(self, measure: str) -> tuple[str, str, str]:
        """Unit, meaning and origin of a measure."""
        from jointplay.study.measures import NUMERICAL_ERROR, USER, shipped

        if measure.startswith(NUMERICAL_ERROR):
            figure = measure.removeprefix(NUMERICAL_ERROR).replace("_", " ")
            return "", f"numerical error of the {figure}, from refined runs", ""
        known = shipped(self.joints).get(measure)
        return (*known, "") if known else ("", measure.replace("_", " "), USER)

    def grown(self, identity: Mapping[str, str], sizes: Sequence[str]) -> set[str]:
        """Keys in which this plan extends another sweep of given identity and dimensions."""
        if list(sizes) != list(self.sizes):
            return set()
        keys = set()
        for key in (key for key in self.identity if key.startswith("sweep.")):
            # Lists may get values at their end; samples and repeats may become more.
            old, new = (json.loads(texts.get(key, "null")) for texts in (identity, self.identity))
            longer = isinstance(old, list) and isinstance(new, list) and new[: len(old)] == old
            grows = key == "sweep.repeats" or (key == "sweep.samples" and self.sampling in GROWING)
            if (key.startswith("sweep.axes.") and longer) or (grows and new >= (old or 1)):
                keys.add(key)
        return keys

    @cached_property
    def identity(self) -> dict[str, str]:
        """All that decides the cases and their results, as text by dotted key."""
        base = {k: v for k, v in self.base.items() if k not in ("title", "output")}
        base["output"] = {"record_every": self.base.get("output", {}).get("record_every", 10)}
        entries = dict(_flat(base))
        table = {option: self.table[option] for option in OPTIONS if option in self.table}
        table.setdefault("seed", self.seed)
        entries |= {f"sweep.{key}": text for key, text in _flat(table)}
        for name, text in self.inputs.items():
            entries[f"file {name}"] = hashlib.sha256(text.encode()).hexdigest()[:16]
        return entries

    @cached_property
    def inputs(self) -> dict[str, str]:
        """Texts of the files that the cases need, by their names in the scenario."""
        folder = self.scenario.path.parent
        references: set[tuple[str, str]] = set(_references(self.base))
        for axis in self.axes:
            for value in axis.values:
                references |= set(_references(value))
                references |= {x for key in axis.keys for x in _references({key[-1]: value})}
        references |= {("function", name) for name in self.measures}
        texts = {}
        for kind, name in sorted(references):
            if kind == "urdf":
                robot = self.base["robot"] if self.base["robot"]["urdf"] == name else {}
                texts[name] = urdf_text(source_of(name, folder), robot.get("xacro", {}))
            elif kind == "file":
                texts[name] = read_text(resolve(name, folder), "file")
            elif (module := imported.get(name.partition(":")[0])) and (file := file_of(module)):
                texts[file.name] = read_text(file, "module")
        return texts


@dataclass(frozen=True)
class Cases(Mapping[Index, tuple[Index, dict[str, Any]]]):
    """The cases of a plan by index, in order, as `run_case` takes them."""

    plan: SweepPlan

    def __len__(self) -> int:
        return self.plan.count

    def __iter__(self) -> Iterator[Index]:
        return iter(np.ndindex(*self.plan.shape))

    def __getitem__(self, index: Index) -> tuple[Index, dict[str, Any]]:
        return index, self.plan.changes(index)


def _references(value: Any) -> Iterator[tuple[str, str]]:
    """Yield kind and name of the files and functions that tables of a scenario refer to."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if key in ("urdf", "file", "function") and isinstance(inner, str):
                yield str(key), inner
            elif key != "xacro":  # arguments of xacro may have any name, `file` too
                yield from _references(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _references(inner)


def _flat(value: Any, path: Key = ()) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from _flat(inner, (*path, str(key)))
    else:
        yield dotted(path), json.dumps(value, sort_keys=True, default=str)


# Reading a plan from the table [sweep] of a scenario, or from arguments.


def plan_of(
    source: Scenario | str | Path,
    axes: Mapping[str, Any] | None = None,
    **options: Any,
) -> SweepPlan:
    """Read the plan of a sweep from the table [sweep] of a scenario and arguments, and check it.

    Args:
        source: a scenario or its file.
        axes: axes in place of the file's, by name; see docs/sweeps.md.
        options: other keys of the table [sweep], in place of the file's.

    Raises:
        JointplayError: an empty or contradictory sweep, keys that do not exist.
    """
    scenario = source if isinstance(source, Scenario) else Scenario.load(source)
    table = {**scenario.sweep, **{k: v for k, v in options.items() if v is not None}}
    if axes is not None:
        table["axes"] = dict(axes)
    for option in table:
        if option not in OPTIONS:
            raise scenario.error(("sweep", option), unknown_key(str(option), OPTIONS))
    path = () if axes is not None else ("sweep", "axes")
    all_axes = _axes(scenario, table.get("axes", {}), path)
    plan = SweepPlan(
        scenario,
        _case(scenario, table.get("case")),
        tuple(axis for axis in all_axes if not axis.sampled),
        tuple(axis for axis in all_axes if axis.sampled),
        table=table,
        **_numbers(scenario, table),
    )
    try:
        _check(plan)
    except JointplayError as error:
        raise scenario.error(("sweep",), str(error)) from None
    return plan


def _axes(scenario: Scenario, tables: Any, path: Key) -> list[Axis]:
    if not isinstance(tables, Mapping):
        message = f"{toml_text(tables)} is not a table of axes by name"
        raise scenario.error(("sweep", "axes"), message)
    axes: list[Axis] = []
    for name, table in tables.items():
        axis_path = (*path, name) if path else ()
        try:
            axis = read(str(name), table)
            names = [a.name for a in axes]
            if axis.name in names:
                axis = replace(axis, name=str(name).replace(".", "_"))
            if axis.name in RESERVED or not axis.name or not axis.name.isprintable():
                raise JointplayError(f"an axis cannot be called {toml_text(axis.name)}")
            axes.append(axis)
        except JointplayError as error:
            message = str(error) if path else f"axis {toml_text(str(name))}: {error}"
            raise scenario.error(axis_path, message) from None
    return axes


def _case(scenario: Scenario, case: Any) -> str:
    if case is None and len(scenario.cases) > 1:
        message = f"case is missing: choose the case to sweep ({', '.join(scenario.cases)})"
        raise scenario.error(("sweep",), message)
    case = scenario.cases[0] if case is None else case
    if case not in scenario.cases:
        raise scenario.error(("sweep", "case"), str(MissingName("case", case, scenario.cases)))
    return str(case)


def _integer(minimum: int) -> Callable[[Any], int]:
    return lambda value: require_whole("it", value, minimum, 2**62 - 1)


_READERS: dict[str, Callable[[Any], Any]] = {
    "samples": _integer(1),
    "seed": _integer(0),
    "repeats": _integer(1),
    "sampling": lambda value: check(Literal[METHODS], value),  # type: ignore[valid-type]
    "measures": lambda value: check(tuple[str, ...], [value] if isinstance(value, str) else value),
    "results": lambda value: check(bool, value),
    "start": lambda value: require_non_negative("it", check(float, value, ("s",)), "s"),
    "tool_error": lambda value: check(bool, value),
    "until": read_until,
}
"""Readers of the values of the table's keys, other than axes and case."""
OPTIONS = ("axes", "case", *_READERS)
"""Keys of the table [sweep]."""


def _numbers(scenario: Scenario, table: Mapping[str, Any]) -> dict[str, Any]:
    fields = {}
    for option, reader in _READERS.items():
        try:
            if option in table:
                fields[option] = reader(table[option])
        except JointplayError as error:
            raise scenario.error(("sweep", option), f"{option}: {error}") from None
    return fields


def _check(plan: SweepPlan) -> None:
    if not plan.axes and not plan.drawn and plan.repeats == 1:
        raise JointplayError(
            "the sweep is empty: give repeats, or [sweep.axes], such as clearance = { key = "
            '"joints.JOINT.radial_clearance", values = ["0.1 mm", "0.2 mm"] }'
        )
    if plan.drawn and not plan.samples:
        names = ", ".join(axis.name for axis in plan.drawn)
        raise JointplayError(f"samples is missing: how many, of the distribution of {names}?")
    if plan.samples and not plan.drawn:
        raise JointplayError("samples needs an axis with a distribution; there is none")
    _check_keys(plan)
    if plan.until is not None:
        if not plan.drawn:
            raise JointplayError("until needs an axis with a distribution; there is none")
        if plan.sampling not in GROWING:
            choice = " or ".join(GROWING)
            raise JointplayError(f"until adds samples, which {plan.sampling} cannot; take {choice}")
        if (limit := plan.until.most) < plan.samples:
            raise JointplayError(f"until stops at {limit} samples, but samples is {plan.samples}")
    if plan.count > MOST_CASES:
        raise JointplayError(f"{plan.summary}; at most {MOST_CASES} are possible")
    if plan.drawn:
        _ = plan.points
    for name in plan.measures:
        module, _, function = name.partition(":")
        if not function.isidentifier() or not all(p.isidentifier() for p in module.split(".")):
            raise JointplayError(f"a measure is named module:function, got {toml_text(name)}")


def _check_keys(plan: SweepPlan) -> None:
    """Raise a JointplayError if two axes set the same key, or one a part of the other's."""
    paths: dict[Key, str] = {}
    for axis in (*plan.axes, *plan.drawn):
        for key in axis.keys:
            for earlier, name in paths.items():
                size = min(len(key), len(earlier))
                if key[:size] == earlier[:size]:
                    raise JointplayError(
                        f"axes {toml_text(name)} and {toml_text(axis.name)} contradict each other: "
                        f"both set {dotted(min(key, earlier, key=len))}"
                    )
        paths |= dict.fromkeys(axis.keys, axis.name)
    seed: Key = ("integration", "seed")
    if plan.repeats > 1 and seed in paths:
        name = toml_text(paths[seed])
        raise JointplayError(f"repeats sets integration.seed, and so does axis {name}")
