"""What a sweep is going to run: its axes, its samples, and the changes of each case."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from jointplay.analysis.uncertainty import Until
from jointplay.core.files import is_file, read_text
from jointplay.mechanism.robots import resolve
from jointplay.scenario import Scenario
from jointplay.scenario.load import merge
from jointplay.scenario.places import Key, dotted
from jointplay.sweeps.axes import METHODS, Axis, points
from jointplay.sweeps.keys import put

Index = tuple[int, ...]

SAMPLE, REPEAT = "sample", "repeat"
"""Dimensions of samples of distributions, and of repeated runs."""

WORDS = ("axes", "case", "samples", "sampling", "seed", "repeats", "measures", "histories",
         "start", "tool_error", "until")  # fmt: skip
"""Keys of the table [sweep]."""


@dataclass(frozen=True)
class Plan:
    """The cases of a sweep, numbered along its dimensions.

    Attributes:
        scenario, case: what is changed.
        axes: dimensions of the grid.
        drawn: what is sampled from distributions, along one dimension.
        sampling, samples, seed: how.
        repeats: runs of each point with displaced journals, with `seed` and those that follow.
        measures: functions of a result, ``module:function``.
        histories: variables of results that are kept.
        start: measures leave out what is before [s]; None: as the scenario's runs are judged.
        tool_error: whether the tool is compared with the ideal mechanism's.
        until: the precision that ends the sweep.
    """

    scenario: Scenario
    case: str
    axes: tuple[Axis, ...] = ()
    drawn: tuple[Axis, ...] = ()
    sampling: str = METHODS[0]
    samples: int = 0
    seed: int = 0
    repeats: int = 1
    measures: tuple[str, ...] = ()
    histories: tuple[str, ...] = ()
    start: float | None = None
    tool_error: bool = True
    until: Until | None = None
    given: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def points(self) -> np.ndarray:
        """Samples in the unit cube, shape (rows, drawn axes)."""
        return points(self.sampling, self.samples, len(self.drawn), self.seed)

    @cached_property
    def drawn_values(self) -> np.ndarray:
        """Samples in SI, shape (rows, drawn axes)."""
        columns = [
            axis.quantile(self.points[:, k])
            for k, axis in enumerate(self.drawn)
            if axis.quantile is not None
        ]
        return np.column_stack(columns)

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Size of each dimension, in order."""
        sizes = {axis.name: len(axis.values) for axis in self.axes}
        if self.drawn:
            sizes[SAMPLE] = self.samples * (
                len(self.drawn) + 2 if self.sampling == "saltelli" else 1
            )
        if self.repeats > 1:
            sizes[REPEAT] = self.repeats
        return sizes

    @property
    def shape(self) -> Index:
        """Sizes of the dimensions."""
        return tuple(self.sizes.values())

    @property
    def count(self) -> int:
        """Number of cases."""
        return math.prod(self.shape)

    @property
    def words(self) -> str:
        """The dimensions in words: ``clearance 5 x repeat 4 = 20 cases``."""
        parts = " x ".join(f"{name} {size}" for name, size in self.sizes.items())
        return f"{parts} = {self.count} cases"

    @cached_property
    def base(self) -> dict[str, Any]:
        """The scenario's tables without the changes of the sweep."""
        return self.scenario.data(self.case)

    def changes(self, index: Index) -> dict[str, Any]:
        """What is different in a case, nested as in the file."""
        changes: dict[str, Any] = {}
        at = dict(zip(self.sizes, index, strict=True))
        for axis in self.axes:
            value = axis.values[at[axis.name]]
            if not axis.keys:
                changes = merge(changes, value)
            for key in axis.keys:
                put(changes, self.base, key, value)
        for k, axis in enumerate(self.drawn):
            for key in axis.keys:
                put(changes, self.base, key, float(self.drawn_values[at[SAMPLE], k]))
        if self.repeats > 1:
            put(changes, self.base, ("integration", "seed"), self.seed + at[REPEAT])
        return changes

    def values(self, index: Index) -> dict[str, Any]:
        """Coordinates of a case by name, for tables and messages."""
        at = dict(zip(self.sizes, index, strict=True))
        coordinates = {axis.name: axis.coordinate[at[axis.name]].item() for axis in self.axes}
        coordinates |= {
            axis.name: float(self.drawn_values[at[SAMPLE], k]) for k, axis in enumerate(self.drawn)
        }
        return coordinates | ({REPEAT: at[REPEAT]} if self.repeats > 1 else {})

    def indices(self) -> Iterator[Index]:
        """All cases in order."""
        return iter(np.ndindex(*self.shape))

    def with_samples(self, samples: int) -> Plan:
        """The same sweep with more samples, of which the first stay what they are."""
        return replace(self, samples=samples, given={**self.given, "samples": samples})

    @cached_property
    def identity(self) -> dict[str, str]:
        """All that decides what the cases are and give, by dotted key: equal or not the same."""
        base = {k: v for k, v in self.base.items() if k not in ("title", "output")}
        base["output"] = {"record_every": self.base.get("output", {}).get("record_every", 10)}
        entries = dict(_flat(base))
        table = {word: self.given[word] for word in WORDS if word in self.given}
        table.setdefault("seed", self.seed)
        entries |= {f"sweep.{key}": text for key, text in _flat(table)}
        for name, text in self.inputs.items():
            digest = hashlib.sha256(text.encode()).hexdigest()[:16]
            entries[f"file {name}"] = digest
        return entries

    @cached_property
    def inputs(self) -> dict[str, str]:
        """Text of the files that the cases need, by the names that the scenario gives them."""
        folder = self.scenario.path.parent
        named: set[tuple[str, str]] = set(_named(self.base))
        for axis in self.axes:
            for value in axis.values:
                named |= set(_named(value))
                for key in axis.keys:
                    if isinstance(value, str):
                        named |= set(_named({key[-1]: value}))
        named |= {("function", name) for name in self.measures}
        texts = {}
        for word, name in sorted(named):
            if word == "function":
                module = name.partition(":")[0].partition(".")[0]
                beside = folder / f"{module}.py"
                if is_file(beside):
                    texts[beside.name] = read_text(beside, "module")
                continue
            path = resolve(name, folder)
            texts[name] = read_text(path, "file")
        return texts


def _named(value: Any) -> Iterator[tuple[str, str]]:
    """Files and functions that tables of a scenario name: (kind, name)."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if key in ("urdf", "file", "function") and isinstance(inner, str):
                yield str(key), inner
            else:
                yield from _named(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _named(inner)


def _flat(value: Any, path: Key = ()) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from _flat(inner, (*path, str(key)))
    else:
        yield dotted(path), json.dumps(value, sort_keys=True, default=str)
