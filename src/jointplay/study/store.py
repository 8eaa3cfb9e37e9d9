"""The folder of a sweep: an SQLite file with a row for each case, and the cases' results, if kept.

The result of a finished case is written first, then its row, and only then the case is reported.
Damage is found by checksums, one in each row and one of each result in its row; the case then runs
again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import files
from jointplay.base.confined import MEMORY_SHARE, memory
from jointplay.base.errors import JointplayError, damaged, one_line, require_a, require_whole
from jointplay.study.database import FILE, KINDS, MOST_COLUMNS, Column, Rows, is_there

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from jointplay.simulation.result.result import Result
    from jointplay.study.sweep_plan import SweepPlan

NOT_RUN, DONE, FAILED = "not run", "done", "failed"
"""The states of a case."""
Index = tuple[int, ...]
"""Position of a case along each dimension of its sweep."""
RESULTS = "results"
"""Folder of the results of cases."""
OUTCOME_COLUMNS = (
    Column("status", "TEXT", text="done, or failed"),
    Column("error", "TEXT", text="error message of the case"),
    Column("result", "TEXT", text="checksum of the case's result"),
)
"""Columns of every sweep, besides those of values and measures."""
MOST_DIFFERENCES = 4
"""Most differences that a message names."""
MOST_CASES = 100_000_000
"""Most cases of a sweep: each takes a byte of memory (judged)."""
_ABOUT: dict[str, type] = {
    "sizes": dict, "labels": dict, "case": str, "sampling": str, "sampled": list, "inputs": dict,
    "versions": dict, "identity": dict, "title": str, "scenario": str, "scenario_file": str,
    "sweep": str,
}  # fmt: skip
"""Entries in which a store describes its sweep, with their types."""
_KINDS = {"f": "REAL", "i": "INTEGER", "u": "INTEGER", "b": "BOOLEAN"}
"""Types of columns, by the kind of an array."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case: its status, measures by name, error message, and the result's file."""

    index: Index
    status: str
    values: dict[str, float]
    error: str = ""
    result: bytes | None = None


class SweepStore:
    """The store of a sweep, open for writing.

    Args:
        path: its folder.
        plan: the sweep; an existing store must be of the same.
        resume: whether to continue an existing store.
        extend: whether an existing store may become larger: more samples, repeats, or values at
            the end of an axis.

    Attributes:
        ran: whether each case has been run.
        failed: number of cases that failed.

    Raises:
        JointplayError: the store exists (and `resume` is false), is of another study, or another
            process writes to it; it cannot be written.
    """

    recovery = "--resume continues"

    def __init__(
        self, path: str | Path, plan: SweepPlan, resume: bool = False, extend: bool = False
    ) -> None:
        self.path, self.plan = Path(path), plan
        present = is_there(self.path, resume or extend)
        files.claim(self.path, [])
        try:
            self.ran, self.failed = np.zeros(plan.shape, bool), 0
            if present:
                self._rows = Rows(self.path / FILE, write=True)
                self._reopen(extend)
            else:
                self._rows = Rows.make(self.path / FILE, self._about(), self._values())
        except BaseException:
            self.close()
            raise

    def _about(self) -> dict[str, Any]:
        """The entries `_ABOUT`, from the plan."""
        from jointplay.simulation.result.stored import versions

        plan, scenario = self.plan, self.plan.scenario
        labels = {
            name: {"values": values.tolist(), **about}
            for name, (along, values, about) in plan.coordinates.items()
            if name == along
        }
        return {
            "case": plan.case, "sampling": plan.sampling,
            "sampled": [axis.name for axis in plan.drawn], "inputs": plan.inputs,
            "title": scenario.title, "scenario": scenario.text,
            "scenario_file": scenario.path.name,
            "sweep": json.dumps(dict(plan.table), default=str),
            "identity": dict(plan.identity), "sizes": dict(plan.sizes), "labels": labels,
            "versions": versions(),
        }  # fmt: skip

    def _values(self) -> list[Column]:
        """Columns of the cases' values on the axes, and `OUTCOME_COLUMNS`."""
        columns = [
            Column(name, _KINDS.get(values.dtype.kind, "TEXT"), about["units"],
                   one_line(about["long_name"]))
            for name, (_, values, about) in self.plan.coordinates.items()
        ]  # fmt: skip
        return [*columns, *OUTCOME_COLUMNS]

    def _reopen(self, extend: bool) -> None:
        """Continue an existing store; damaged cases count as not run."""
        contents = Contents(self._rows)
        self._check_study(contents.about, extend)
        # A sweep may only have grown, along the same dimensions.
        sizes = contents.sizes
        if list(sizes) != list(self.plan.sizes) or np.any(
            np.array(list(sizes.values())) > self.plan.shape
        ):
            raise damaged(self._rows.path, "sweep", f"its sizes are {contents.sizes}")
        # A case has been run if its row is there and its result, if it has one, is intact.
        for index, values in contents.blocks():
            good = np.array([
                not sealed or _is_sealed(self.path / RESULTS / file_of(case), sealed)
                for case, sealed in zip(index.tolist(), values["result"], strict=True)
            ])  # fmt: skip
            self.ran[tuple(index[good].T)] = True
            self.failed += int(np.count_nonzero(values["status"][good] == FAILED))
            self._rows.intact &= bool(good.all())
        # Damaged rows, or other columns than the plan's, need a new file.
        columns = [*self._values(), *contents.measures]
        present = [*contents.values, *OUTCOME_COLUMNS, *contents.measures]
        if not self._rows.intact or columns != present:
            self._rows.rebuild(self._about(), columns, self._kept_rows(contents))
        else:
            self._rows.set_about(self._about())

    def _kept_rows(self, contents: Contents) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield the rows of the cases that have been run, with their axes' values by the plan."""
        for index, values in contents.blocks():
            for k, position in enumerate(map(tuple, index.tolist())):
                if self.ran[position]:
                    row = {name: column[k] for name, column in values.items()}
                    yield place_of(position), {**row, **self.plan.values(position)}

    def _check_study(self, about: Mapping[str, Any], extend: bool) -> None:
        """Raise a JointplayError if the store is of another study."""
        changes = differences(about["identity"], self.plan.identity)
        grown = self.plan.grown(about["identity"], list(about["sizes"]))
        conflicts = changes.keys() - grown
        current, stored = self._about()["versions"]["jointplay"], about["versions"].get("jointplay")
        if current != stored:
            changes["version"] = f"jointplay is {current} instead of {stored}"
            conflicts |= {"version"}
        if conflicts or (changes and not extend):
            messages = list(changes.values())[:MOST_DIFFERENCES]
            hidden = len(changes) - len(messages)
            messages += [f"and {hidden} more"] if hidden else []
            advice = (
                "choose another name for the store" if conflicts else "--extend adds the new cases"
            )
            raise JointplayError(
                f"{str(self.path)!r} belongs to another sweep: {'; '.join(messages)}; {advice}"
            )

    def grow(self, plan: SweepPlan) -> None:
        """Make room for the cases of a larger plan; the cases so far keep their indices.

        Raises:
            JointplayError: the store cannot be written.
        """
        self.plan, ran = plan, self.ran
        self.ran = np.zeros(plan.shape, bool)
        self.ran[tuple(map(slice, ran.shape))] = ran
        self._rows.set_about(self._about())

    # ---- Cases ----------------------------------------------------------------------------------

    def __contains__(self, index: Any) -> bool:
        return bool(self.ran[index])

    def keep(self, index: Any, outcome: Outcome) -> None:
        """Store a finished case: once this returns, it survives the end of the process.

        Raises:
            JointplayError: the disk is full; the cases before are kept.
        """
        outcome = self._fitted(outcome)
        names = {column.name for column in self._rows.columns}
        if new_names := [name for name in outcome.values if name not in names]:
            self._rows.add_columns([self._measure(name) for name in new_names])
        sealed = ""
        if outcome.result is not None:
            from jointplay.simulation.result import netcdf

            path = self.path / RESULTS / file_of(outcome.index)
            with files.system_errors(f"cannot write {str(path)!r}"):
                files.make_folder(path.parent)
            files.write(path, outcome.result, overwrite=True, announced=False)
            sealed = netcdf.seal_of(outcome.result)
        fields = {"status": outcome.status, "error": outcome.error, "result": sealed}
        values = self.plan.values(outcome.index)
        self._rows.add(place_of(outcome.index), {**outcome.values, **values, **fields})
        self.ran[outcome.index] = True
        self.failed += outcome.status == FAILED

    def _measure(self, name: str) -> Column:
        unit, text, origin = self.plan.meaning(name)
        return Column(name, "REAL", unit, one_line(text), origin)

    def _fitted(self, outcome: Outcome) -> Outcome:
        """The outcome; a failed one in its place if a measure's name cannot be that of a column."""
        reserved = {*self.plan.coordinates, *(column.name for column in OUTCOME_COLUMNS)}
        invalid = [name for name in outcome.values if name in reserved or not name.isprintable()]
        invalid += [name for name in outcome.values if not name]
        names = {column.name for column in self._rows.columns}
        reason = f"a measure cannot be called {min(invalid)!r}" if invalid else ""
        if len(names | outcome.values.keys()) > MOST_COLUMNS:
            reason = f"there are more than {MOST_COLUMNS} measures and values"
        if not reason:
            return outcome
        values = {name: x for name, x in outcome.values.items() if name in names - reserved}
        return Outcome(outcome.index, FAILED, values, reason)

    def column(self, name: str) -> np.ndarray:
        """A measure over the sweep, NaN where cases lack it, of the plan's shape.

        Raises:
            JointplayError: no case has it.
        """
        contents = Contents(self._rows)
        if name not in (measure.name for measure in contents.measures):
            names = ", ".join(measure.name for measure in contents.measures)
            raise JointplayError(f"no case has the measure {name!r}; there are: {names}")
        grid = np.full(self.plan.shape, np.nan)
        for index, values in contents.blocks():
            grid[tuple(index.T)] = values[name]
        return grid

    def close(self) -> None:
        """Close the store, and release its folder."""
        try:
            if hasattr(self, "_rows"):
                self._rows.close()
        finally:
            files.release(self.path)


def place_of(index: Index) -> str:
    """Index of a case as its row has it."""
    return " ".join(map(str, index))


def file_of(index: Any) -> str:
    """Name of the file with a case's result."""
    return f"{'-'.join(map(str, index))}.nc"


def _is_sealed(path: Path, sealed: str) -> bool:
    """Whether a file is there, intact, and has this checksum."""
    from jointplay.simulation.result import netcdf

    with suppress(JointplayError):
        return netcdf.checksum(path) == sealed
    return False


def differences(former: Mapping[str, str], present: Mapping[str, str]) -> dict[str, str]:
    """Differences between the identities of two studies, in words by key."""
    changes = {}
    for key in dict.fromkeys((*former, *present)):
        before, now = former.get(key, "not given"), present.get(key, "not given")
        if before != now:
            file = key.startswith("file ") and "not given" not in (before, now)
            text = "has changed" if file else f"is {_short(now)} instead of {_short(before)}"
            changes[key] = f"{key} {text}"
    return changes


def _short(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:60]}...{text[-15:]}"


# ---- Read ---------------------------------------------------------------------------------------


class Contents:
    """The content of a sweep's file, checked thoroughly, as files can come from anywhere.

    Attributes:
        about: entries that describe the sweep.
        sizes: sizes of its dimensions, by name.
        count: number of its cases.
        values: columns of the axes' values.
        measures: columns of the measures.

    Raises:
        JointplayError: not the rows of a sweep.
    """

    def __init__(self, rows: Rows) -> None:
        self.rows, self.about = rows, rows.about
        wrong = [
            name for name, kind in _ABOUT.items() if not isinstance(self.about.get(name), kind)
        ]
        if wrong:
            raise self._damaged(f"{wrong[0]} is {self.about.get(wrong[0])!r:.60}")
        # The description: sizes, inputs, and the values along each axis.
        self.sizes: dict[str, int] = self.about["sizes"]
        sizes, sampled = self.sizes.values(), self.about["sampled"]
        sound = bool(sizes) and all(type(size) is int and size > 0 for size in sizes)
        if not sound or math.prod(sizes) > MOST_CASES:
            raise self._damaged(f"its sizes are {self.sizes!r:.60}")
        self.count = math.prod(sizes)
        tables = [self.about[name].values() for name in ("identity", "versions", "inputs")]
        if not all(isinstance(text, str) for texts in tables for text in texts):
            raise self._damaged("its inputs are not text")
        for name, label in self.about["labels"].items():
            listed = label.get("values") if isinstance(label, dict) else None
            plain = isinstance(listed, list) and all(
                isinstance(x, int | float | str) for x in listed
            )
            values = np.array(listed if plain else None)
            if values.shape != (self.sizes.get(name),) or values.dtype.kind not in "fibU":
                raise self._damaged(f"its values of {name} are {label!r:.60}")
        # The columns: distinct names, the axes' values, the outcome, and measures.
        names = [column.name for column in rows.columns]
        of_cases = [*self.about["labels"], *sampled]
        if not all(isinstance(name, str) for name in of_cases) or len({*names}) < len(names):
            raise self._damaged("its columns do not have distinct names")
        if {*of_cases} - {*names} or (sampled and "sample" not in self.sizes):
            raise self._damaged(f"its values are of {of_cases!r:.60}")
        if [column for column in rows.columns if column in OUTCOME_COLUMNS] != [*OUTCOME_COLUMNS]:
            raise self._damaged("its columns are not those of a sweep")
        self.values = [column for column in rows.columns if column.name in of_cases]
        others = (*self.values, *OUTCOME_COLUMNS)
        self.measures = [column for column in rows.columns if column not in others]
        numbers = [*self.measures, *(column for column in self.values if column.name in sampled)]
        if any(column.kind != "REAL" for column in numbers):
            raise self._damaged("a measure is not a number")

    def _damaged(self, reason: str) -> JointplayError:
        return damaged(self.rows.path, "sweep", reason)

    def blocks(self) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
        """Yield the indices of some cases, shape (n, dimensions), and their values by column.

        Raises:
            JointplayError: a row is damaged, or of no case of the sweep.
        """
        shape = np.array(list(self.sizes.values()))
        for places, values in self.rows.blocks(self.count):
            try:
                index = np.array([list(map(int, place.split(" "))) for place in places], np.int64)
                good = index.shape[1] == len(shape)
            except (ValueError, OverflowError):
                good = False
            if not good or (index < 0).any() or (index >= shape).any():
                raise self._damaged("a row belongs to no case")
            if not {*values["status"]} <= {DONE, FAILED}:
                raise self._damaged("a case is neither done nor failed")
            yield index, values


class Sweep:
    """A sweep in a folder; every query reads the present state, of a running sweep too.

    Args:
        path: the folder.

    Attributes:
        sizes: sizes of its dimensions, by name.
        about: its description: scenario, inputs, versions, table [sweep].

    Raises:
        JointplayError: no such sweep, or a damaged one.
    """

    def __init__(self, path: str | Path) -> None:
        require_a("path", path, "str", "Path")
        self.path = Path(path)
        contents, _, _ = self._read(cases=False)
        self.about, self.sizes = contents.about, contents.sizes

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name}: {size}" for name, size in self.sizes.items())
        return f"<jointplay Sweep {str(self.path)!r}: {sizes}>"

    def _read(self, cases: bool = True) -> tuple[Contents, np.ndarray, dict[str, np.ndarray]]:
        """Read the file: its contents, the cases' numbers in the grid, which ascend, and their
        values by column; without `cases` only the contents.
        """
        if not files.is_file(self.path / FILE):
            raise JointplayError(f"no sweep {str(self.path)!r}")
        rows = Rows(self.path / FILE)
        try:
            contents = Contents(rows)
            if not cases:
                return contents, np.empty(0, np.int64), {}
            if 16.0 * contents.count * len(rows.columns) > MEMORY_SHARE * memory():
                raise JointplayError(f"{str(self.path)!r} needs more memory than this machine has")
            blocks = list(contents.blocks())
        finally:
            rows.close()
        shape = tuple(contents.sizes.values())
        empty: list[np.ndarray] = [np.empty(0, np.int64)]
        number = np.concatenate(
            empty + [np.ravel_multi_index(tuple(index.T), shape) for index, _ in blocks]
        )
        order = np.argsort(number, kind="stable")
        values = {
            column.name: np.concatenate([block[column.name] for _, block in blocks])[order]
            if blocks else np.empty(0, KINDS[column.kind])
            for column in rows.columns
        }  # fmt: skip
        return contents, number[order], values

    def table(self) -> pd.DataFrame:
        """Table with a row for each case that was run, in the order of the grid.

        Columns are the values of the axes, `status` (``done`` or ``failed``), `error` and the
        measures (docs/sweeps.md); ``attrs["units"]`` has their units. The index is the number of
        the case, for `result`.

        Raises:
            JointplayError: damaged.
        """
        import xarray as xr

        contents, number, values = self._read()
        columns = [*contents.values, *OUTCOME_COLUMNS[:2], *contents.measures]
        dataset = xr.Dataset({column.name: ("case", values[column.name]) for column in columns})
        frame: pd.DataFrame = dataset.assign_coords(case=number).to_dataframe()
        frame.attrs["units"] = {column.name: column.unit for column in columns}
        return frame

    def dataset(self) -> xr.Dataset:
        """All cases over the dimensions of the sweep.

        Variables are the measures (docs/sweeps.md), NaN where there is none, ``status`` and
        ``error``; coordinates the values of the axes.

        Raises:
            JointplayError: damaged.
        """
        import xarray as xr

        contents, number, values = self._read()
        dims, shape = tuple(contents.sizes), tuple(contents.sizes.values())
        about = {name: contents.about[name] for name in _ABOUT if name != "labels"}

        def spread(name: str, empty: Any, kind: Any = None) -> np.ndarray:
            grid = np.full(contents.count, empty, kind)
            grid[number] = values[name]
            return grid.reshape(shape)

        variables: dict[str, Any] = {
            column.name: (dims, spread(column.name, np.nan), _attributes(column))
            for column in contents.measures
        }
        variables["status"] = dims, spread("status", NOT_RUN, "U7"), {"units": ""}
        variables["error"] = dims, spread("error", "", object), {"units": ""}
        coordinates: dict[str, Any] = {}
        for column in contents.values:
            label = contents.about["labels"].get(column.name)
            if label is not None:
                along, labels = column.name, np.array(label["values"])
                labels = labels.astype(object) if labels.dtype.kind == "U" else labels
            else:  # sampled: known of the samples that were run
                along, labels = "sample", np.full(contents.sizes["sample"], np.nan)
                labels[np.unravel_index(number, shape)[dims.index("sample")]] = values[column.name]
            coordinates[column.name] = along, labels, _attributes(column)
        return xr.Dataset(variables, coordinates, about)

    def result(self, case: int) -> Result:
        """The result of a case, if the sweep keeps results (``results = true``).

        Args:
            case: number of the case, its index in `table`.

        Raises:
            JointplayError: there is none, or it is damaged.
        """
        from jointplay.simulation.result import netcdf
        from jointplay.simulation.result.result import Result

        wanted = require_whole("case", case, 0, math.prod(self.sizes.values()) - 1)
        contents, number, values = self._read()
        entry = {"status": NOT_RUN, "result": ""}
        if (at := int(np.searchsorted(number, wanted))) < len(number) and number[at] == wanted:
            entry = {name: str(values[name][at]) for name in entry}
        if not (sealed := entry["result"]):
            reasons = {NOT_RUN: "it was not run", FAILED: "it failed"}
            reason = reasons.get(entry["status"], "the sweep keeps none (results = true)")
            raise JointplayError(f"no result of case {wanted} in {str(self.path)!r}: {reason}")
        index = np.unravel_index(wanted, tuple(contents.sizes.values()))
        path = self.path / RESULTS / file_of(index)
        result = Result.load(path)
        if netcdf.checksum(path) != sealed:
            raise damaged(path, "result", "it is that of another case; --resume runs it again")
        return result


def _attributes(column: Column) -> dict[str, str]:
    attributes = {"units": column.unit, "long_name": column.text, "origin": column.origin}
    return {word: text for word, text in attributes.items() if text or word != "origin"}


def open_sweep(path: str | Path) -> Sweep:
    """Open the sweep in a folder; one that is running shows what has been written so far.

    Raises:
        JointplayError: no such sweep, or a damaged one.
    """
    return Sweep(path)
