"""The store of a sweep: labelled Zarr arrays over its dimensions, and a journal of what is done."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
from zarr.core.sync import sync
from zarr.dtype import parse_dtype

from jointplay.core import files
from jointplay.core.errors import JointplayError
from jointplay.result.stored import versions
from jointplay.scenario.places import dotted
from jointplay.study import sealed
from jointplay.study.axes import GROWING
from jointplay.study.case import DONE, FAILED, Outcome, joints
from jointplay.study.dataset import FORMAT, check_format, quiet, reading
from jointplay.study.journal import JOURNAL, SYNC_S, Journal, entries, is_there, line
from jointplay.study.measures import USER, about
from jointplay.study.plan import REPEAT, SAMPLE, Index, Plan
from jointplay.study.sealed import (
    BEGUN,
    COMPRESSORS,
    METADATA,
    PARTIAL,
    ROOT,
    WRITTEN,
    SealedStore,
    array_name,
    plain_name,
)

GROWS = ("samples", "repeats")
"""Keys of a sweep that may grow."""

ROUNDING = 1e-9
"""Times that differ by less than this, relative to the last of them, are the same."""

SUFFIX = "_history"
"""What the names of arrays of time histories end with."""

CHUNK = 4096
"""Cases in a chunk, at most."""

REST_S = 10.0
"""How long is waited for chunks that are being written where one could not be [s]."""

FLUSH_S = 60.0
"""Interval at which the arrays are brought up to date, for readers [s]."""

MOST_DIFFERENCES = 4
"""Differences that a message names."""


def differences(old: Mapping[str, str], new: Mapping[str, str]) -> dict[str, str]:
    """In what two sweeps differ, in words by key."""
    changes = {}
    for key in dict.fromkeys((*old, *new)):
        was, now = old.get(key, "not given"), new.get(key, "not given")
        if was != now:
            file = key.startswith("file ") and "not given" not in (was, now)
            words = "has changed" if file else f"is {_short(now)} instead of {_short(was)}"
            changes[key] = f"{key} {words}"
    return changes


def _short(text: str) -> str:
    """A text without its middle, if it is long."""
    return text if len(text) <= 80 else f"{text[:60]}...{text[-15:]}"


def grown(attrs: Mapping[str, Any], plan: Plan) -> set[str]:
    """Keys in which the plan is the old one made larger."""
    old, new = attrs["identity"], plan.identity
    if list(attrs["sizes"]) != list(plan.sizes):
        return set()
    keys = set()
    for word in GROWS:
        key = f"sweep.{word}"
        grows = word != "samples" or plan.sampling in GROWING
        if grows and json.loads(new.get(key, "0")) >= json.loads(old.get(key, "1")):
            keys.add(key)
    for key in new:
        if key.startswith("sweep.axes.") and key in old:
            was, now = json.loads(old[key]), json.loads(new[key])
            if isinstance(was, list) and isinstance(now, list) and now[: len(was)] == was:
                keys.add(key)
    return keys


# A finished case is one line of the journal. The arrays are filled from it now and then, and at
# the end; filled again, they are what they were. So whatever is killed, and whenever, nothing
# that was finished is lost: the journal is emptied only when all that it says is in the arrays
# and on disk.
#
# What has changed since it was written is found by its checksum, what is gone by the list of
# chunks that the sweep has left, and runs again.


class Store:
    """A store that is being written.

    Args:
        path: its folder.
        plan: what is run; an old store must be of the same.
        resume: whether an old store is gone on with.
        extend: whether it may become larger: more samples, repeats, values at the end of an axis.

    Attributes:
        state: of every case; 0: not run, `DONE`, `FAILED`.
        new: whether it was made here.
        removed: whether it is there no more.

    Raises:
        JointplayError: the store exists (and `resume` is false), is of another sweep, or another
            process writes to it; it cannot be written.
    """

    def __init__(
        self, path: str | Path, plan: Plan, resume: bool = False, extend: bool = False
    ) -> None:
        """Open or make it, and take up what its journal has."""
        self.path = Path(path)
        there = is_there(self.path, resume or extend)
        self._folder_was_there = files.is_folder(self.path)
        files.claim(self.path, [])
        self.removed = False
        try:
            self.plan = plan
            self.group: Any  # zarr's own types know no group whose members are all arrays
            self.state = np.zeros(plan.shape, np.int8)
            self._pending: list[Outcome] = []
            self._synced = self._flushed = time.monotonic()
            with writing(self.path):
                if there:
                    with reading(self.path):
                        self._reopen(extend)
                else:
                    self._make()
                self.journal = Journal(self.path / JOURNAL)
                self._take_up()
            self.new = not there and not self.journal.found
        except BaseException:
            files.release(self.path)
            raise

    def _opened(self) -> Any:
        """The arrays of the store, for writing."""
        return zarr.open_group(SealedStore(self.path), mode="r+", use_consolidated=False)

    def _make(self) -> None:
        """Begin a new store."""
        files.empty(self.path)  # by zarr the folder itself would go, and with it its lock
        store = SealedStore(self.path)
        self.group = zarr.create_group(store, attributes={BEGUN: FORMAT}, zarr_format=3)
        self.array("state", "int8", 0, "0: not run, 1: done, 2: failed", "1")
        self.group["state"].update_attributes({"sweep": of_sweep(self.plan)})
        self.array("error", "string", "", "error message of the case", "")
        self._coordinates()
        # With these attributes it is a store; without, the rest of one that was not made.
        self.group.attrs.put(self._about())
        self._consolidate()

    def _about(self) -> dict[str, Any]:
        """Attributes of the store: which sweep it is of."""
        plan = self.plan
        return {
            "jointplay_sweep": FORMAT,
            "case": plan.case,
            "sampling": plan.sampling,
            "sampled": [axis.name for axis in plan.drawn],
            "inputs": plan.inputs,
            "versions": versions(),
            "identity": plan.identity,
            "sizes": plan.sizes,
            "title": plan.scenario.title,
            "scenario": plan.scenario.text,
            "scenario_file": plan.scenario.path.name,
            "sweep": json.dumps(dict(plan.given), default=str),
        }

    def _reopen(self, extend: bool) -> None:
        """Go on with an old store.

        Raises:
            JointplayError: it is of another sweep.
        """
        hurt = list(sealed.survey(self.path))
        if (ROOT, None) in hurt:
            self._identify_again()
        attrs = sealed.metadata(self.path, ROOT)["attributes"]
        if "jointplay_sweep" not in attrs:
            if BEGUN not in attrs:  # a store of someone else, which making ours would empty
                check_format(attrs, self.path)
            self._make()  # killed while it was made
            return
        check_format(attrs, self.path)
        changes = differences(attrs["identity"], self.plan.identity)
        beyond = changes.keys() - grown(attrs, self.plan)
        mine, theirs = versions()["jointplay"], attrs["versions"].get("jointplay")
        if mine != theirs:
            changes["version"] = f"jointplay is {mine} instead of {theirs}"
            beyond |= {"version"}
        if beyond or (changes and not extend):
            shown = list(changes.values())[:MOST_DIFFERENCES]
            if len(changes) > len(shown):
                shown.append(f"and {len(changes) - len(shown)} more")
            advice = (
                "--extend adds the new cases" if not beyond else "choose another name for the store"
            )
            raise JointplayError(
                f"{str(self.path)!r} belongs to another sweep: {'; '.join(shown)}; {advice}"
            )
        for rest in self.path.rglob(f"*{PARTIAL}"):  # of a process that was killed
            rest.unlink(missing_ok=True)
        if not self._mend(hurt, attrs):
            self._make()
            return
        if tuple(attrs["sizes"].values()) != self.plan.shape:
            self.grow(self.plan)
        self.state = np.asarray(self.group["state"][...], np.int8).copy()

    def _identify_again(self) -> None:
        """Write the metadata of the whole again, if the states are of the same sweep.

        Raises:
            JointplayError: they are not, or nothing tells.
        """
        if sweep_of_states(self.path) != of_sweep(self.plan):
            raise sealed.damaged(
                self.path,
                f"metadata of the whole {sealed.CHANGED}, and it cannot be verified that its "
                "states belong to this sweep; continue with the same scenario, or choose another "
                "name",
            )
        about = {"attributes": self._about(), "zarr_format": 3, "node_type": "group"}
        files.write(self.path / METADATA, sealed.write_metadata(about, ROOT), overwrite=True)
        self.group = self._opened()
        with suppress(JointplayError):  # metadata of an array are damaged as well
            self._consolidate()

    def _mend(self, hurt: Sequence[tuple[str, str | None]], attrs: Mapping[str, Any]) -> bool:
        """Have what is damaged written again, or the cases run again whose numbers it held.

        Killed at any moment it is done again: what is damaged goes only when the states on disk
        and the journal say that its cases have not been run. Returns whether that can be;
        otherwise all has to be made anew.
        """
        root = sealed.metadata(self.path, ROOT)
        arrays = (root.get("consolidated_metadata") or {}).get("metadata", {})
        journal = self.path / JOURNAL
        under_way = files.is_file(journal) and journal.stat().st_size > 0
        again = np.zeros(tuple(attrs["sizes"].values()), bool)
        coordinates = False
        gone = []
        for name, key in hurt:
            if name == ROOT:
                continue
            if name not in arrays:
                return False
            array = arrays[name]
            kind = sealed.kind(name, array, attrs)
            if key is None:
                if kind == "labels" or (under_way and len(array["shape"]) > again.ndim):
                    return False  # they may have grown since
                (self.path / name).mkdir(exist_ok=True)
                content = sealed.write_metadata(array, name)
                files.write(self.path / name / METADATA, content, overwrite=True)
            elif kind == "labels":
                return False
            else:
                gone.append((name != "state", name != "error", self.path / key))
                coordinates |= kind == "coordinate"
                if kind == "cases":
                    again[_region(key, name, array, again.ndim)] = True
        self.group = self._opened()
        if gone:
            self._forget(again, [path for *_, path in sorted(gone)], journal)
            self.group.update_attributes({WRITTEN: {}})  # chunks are listed again at the end
            self._consolidate()
        if coordinates:
            self._coordinates()
        return True

    def _forget(self, again: np.ndarray, gone: Sequence[Path], journal: Path) -> None:
        """Have cases count as not run, then delete the chunks in which they are damaged."""
        if files.is_file(journal):
            found = [e for e, _ in entries(journal.read_bytes())]
            kept = [e for e in found if (o := outcome_of(e, again.shape)) and not again[o.index]]
            files.write(journal, b"".join(map(line, kept)), overwrite=True)
        cells = list(zip(*np.nonzero(again), strict=True))
        for name, nothing in (("state", 0), ("error", "")):
            for path in gone:
                if path.is_relative_to(self.path / name):
                    path.unlink(missing_ok=True)
            if cells:
                _set(self.group[name], [(cell, nothing) for cell in cells])
            os.sync()
        for path in gone:
            path.unlink(missing_ok=True)

    def _take_up(self) -> None:
        """Fill the arrays with what the journal has; entries that are none are as good as changed.

        A checksum is no seal: a stranger's line can have the right one.
        """
        room = {n for n, a in self._arrays().items() if not self._of_measure(a)}
        room |= self._reserved()
        for entry in self.journal.found:
            outcome = outcome_of(entry, self.state.shape)
            if outcome is not None and not room & set(outcome.values):
                self._pending.append(outcome)
        for outcome in self._pending:
            self.state[outcome.index] = outcome.state
        if self._pending:
            self.flush()

    def _reserved(self) -> set[str]:
        """Names that arrays have which are no measures."""
        return {"state", "error", *self.plan.sizes, *(axis.name for axis in self.plan.drawn)}

    def _of_measure(self, array: Any) -> bool:
        """Whether an array has room for a number of each case."""
        return bool(array.shape == self.state.shape and array.dtype == np.float64)

    def grow(self, plan: Plan) -> None:
        """Make room for the cases of a larger plan; those there are stay what they are.

        Raises:
            JointplayError: the store cannot be written.
        """
        before = self.state
        self.plan = plan
        self.state = np.zeros(plan.shape, np.int8)
        self.state[tuple(slice(0, size) for size in before.shape)] = before
        dims = list(map(array_name, plan.sizes))
        with writing(self.path):
            for array in self._arrays().values():
                names = array.metadata.dimension_names or ()
                if tuple(names[: len(dims)]) == tuple(dims):
                    array.resize((*plan.shape, *array.shape[len(dims) :]))
            self._coordinates()
            self.group["state"].update_attributes({"sweep": of_sweep(plan)})
            self.group.update_attributes(self._about())
            self._consolidate()

    @quiet()
    def _consolidate(self) -> None:
        """Write into one file what the arrays are, so that a reader need not look for them."""
        zarr.consolidate_metadata(self.group.store)

    @quiet()
    def _folders(self) -> list[str]:
        """Folders of all arrays."""
        return list(self.group)

    @quiet()
    def _arrays(self) -> dict[str, Any]:
        """All arrays by their names."""
        return {plain_name(folder): array for folder, array in self.group.arrays()}

    def array(
        self,
        name: str,
        dtype: Any,
        fill: Any,
        text: str,
        unit: str,
        tail: Mapping[str, int] | None = None,
        origin: str = "",
    ) -> zarr.Array[Any]:
        """Make an array over the dimensions of the sweep and those of `tail`."""
        tail = tail or {}
        attributes = {"units": unit, "long_name": text} | ({"origin": origin} if origin else {})
        chunks = (1,) * len(self.plan.shape) if tail else _chunks(self.plan.shape)
        chunks = (*chunks, *(max(size, 1) for size in tail.values()))
        shape = (*self.plan.shape, *tail.values())
        return self._create(name, shape, chunks, dtype, fill, (*self.plan.sizes, *tail), attributes)

    @quiet()
    def _create(
        self,
        name: str,
        shape: Index,
        chunks: Index,
        dtype: Any,
        fill: Any,
        dimensions: Sequence[str],
        attributes: Mapping[str, Any],
    ) -> zarr.Array[Any]:
        """Make an array, in place of one of its name."""
        return self.group.create_array(
            array_name(name),
            shape=shape,
            chunks=chunks,
            dtype=dtype,
            fill_value=fill,
            compressors=COMPRESSORS,
            dimension_names=list(map(array_name, dimensions)),
            attributes=dict(attributes),
            overwrite=True,
        )

    def _coordinates(self) -> None:
        """Values of the dimensions, and of what is sampled."""
        plan = self.plan
        for k, axis in enumerate((*plan.axes, *plan.drawn)):
            sampled = k - len(plan.axes)
            values = axis.coordinate if sampled < 0 else plan.drawn_values[:, sampled]
            text = ", ".join(dotted(key) for key in axis.keys)
            dimension = axis.name if sampled < 0 else SAMPLE
            self.labels(axis.name, dimension, values, {"units": axis.unit, "long_name": text})
        if REPEAT in plan.sizes:
            text = "seed of the displacement of the journals"
            seeds = plan.seed + np.arange(plan.repeats)
            self.labels(REPEAT, REPEAT, seeds, {"units": "", "long_name": text})

    @quiet()
    def labels(
        self, name: str, dimension: str, values: np.ndarray, attrs: Mapping[str, Any]
    ) -> None:
        """Write the coordinate of a dimension.

        One that is there grows in place: whenever that ends, all its values are there, but for
        those that are new, which are NaN or empty until they are written.
        """
        text = values.dtype.kind in "UO"
        kind: Any = "string" if text else values.dtype
        array = self._arrays().get(name)
        if array is not None and array.metadata.data_type == parse_dtype(kind, zarr_format=3):
            if array.shape != values.shape:
                array.resize(values.shape)
            array.update_attributes(dict(attrs))
        else:
            fill = np.nan if values.dtype.kind == "f" else None
            chunks = (max(len(values), 1),)
            array = self._create(name, values.shape, chunks, kind, fill, (dimension,), attrs)
        array[:] = values.astype(object) if text else values

    def _write_history(self, name: str, index: Index, history: xr.DataArray) -> None:
        """Write a variable of a case over time: an array over the sweep, the time, and labels.

        Cases can differ in length and in joints: the array grows as needed, and what a case has not
        is NaN. A chunk is one case, so that writing it again, after a kill, gives what it was.

        Raises:
            JointplayError: it was recorded at other times than those of the cases before.
        """
        key = name + SUFFIX
        values = np.asarray(history.values, float)
        dims = list(map(str, history.dims))
        if key not in self.group:
            tail = dict(zip(dims, values.shape, strict=True))
            unit, text = (str(history.attrs.get(word, "")) for word in ("units", "long_name"))
            self.array(key, "float64", np.nan, text, unit, tail)
        array = self.group[key]
        places = [self._places(dimension, history) for dimension in dims]
        sizes = array.shape[len(index) :]
        needed = [max(int(p.max(initial=-1)) + 1, n) for p, n in zip(places, sizes, strict=True)]
        if tuple(needed) != tuple(sizes):
            array.resize((*array.shape[: len(index)], *needed))
        block = np.full(needed, np.nan)
        block[np.ix_(*places)] = values
        array[index] = block

    def _places(self, dimension: str, history: xr.DataArray) -> np.ndarray:
        """Positions of a case's labels along a dimension, to which new ones are added.

        All cases share one time axis: the longest one's.
        """
        own: list[Any] = history[dimension].values.tolist()
        known: list[Any] = []
        if dimension in self.group:
            known = np.asarray(self.group[dimension][...]).tolist()
            while known and (known[-1] in ("", None) or known[-1] != known[-1]):
                known.pop()  # there was no room to write it
        if dimension == "time":
            shared = min(len(own), len(known))
            ours, theirs = np.array(own[:shared], float), np.array(known[:shared], float)
            other = np.flatnonzero(np.abs(ours - theirs) > ROUNDING * theirs.max(initial=0.0))
            if other.size:
                k = int(other[0])
                raise JointplayError(
                    f"its record {k + 1} is at t = {ours[k]:.6g} s, that of earlier cases at "
                    f"{theirs[k]:.6g} s: histories of a sweep have one time axis; let all cases "
                    "end at one of their times, or leave out histories"
                )
            if len(own) > len(known):
                self.labels(dimension, dimension, np.asarray(own), {"units": "s"})
            return np.arange(len(own))
        new = [label for label in own if label not in known]
        if new:
            known += new
            self.labels(dimension, dimension, np.asarray(known), {})
        return np.array([known.index(label) for label in own], int)

    def keep(self, outcome: Outcome) -> None:
        """Keep a finished case: on return it survives this process.

        Raises:
            JointplayError: the disk is full; the cases before are kept.
        """
        taken = sorted(self._reserved() & set(outcome.values))
        if taken:
            values = {n: v for n, v in outcome.values.items() if n not in taken}
            said = f"a measure cannot be called {taken[0]!r}: the sweep has a measure of that name"
            outcome = Outcome(outcome.index, FAILED, values, said)
        with writing(self.path):
            try:
                for name, history in outcome.histories.items():
                    self._write_history(name, outcome.index, history)
            except JointplayError as error:  # it does not fit those of the cases before
                outcome = replace(outcome, state=FAILED, error=str(error))
        entry = {"i": list(map(int, outcome.index)), "s": outcome.state, "v": outcome.values}
        self.journal.add(entry | ({"e": outcome.error} if outcome.error else {}))
        self.state[outcome.index] = outcome.state
        self._pending.append(outcome)
        now = time.monotonic()
        if now - self._synced > SYNC_S:
            self.journal.sync()
            self._synced = time.monotonic()
        if now - self._flushed > FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Bring the arrays up to date.

        Raises:
            JointplayError: the disk is full; the journal has it all.
        """
        if self._pending:
            with writing(self.path):
                self._fill(self._pending)
        self._pending = []
        self._flushed = time.monotonic()

    def _fill(self, outcomes: Sequence[Outcome]) -> None:
        """Write finished cases into the arrays."""
        columns: dict[str, list[tuple[Index, float]]] = {}
        for outcome in outcomes:
            for name, value in outcome.values.items():
                columns.setdefault(name, []).append((outcome.index, value))
        known = self._arrays()
        before = len(known)
        for name, cells in columns.items():
            if name not in known:
                meaning = about(name, joints(self.plan))
                unit, text = meaning or ("", name.replace("_", " "))
                origin = "" if meaning else USER
                known[name] = self.array(name, "float64", np.nan, text, unit, origin=origin)
            _set(known[name], cells)
        texts = [(outcome.index, outcome.error) for outcome in outcomes if outcome.error]
        if texts:
            _set(known["error"], texts)
        # Last: what a reader sees as done is whole.
        _set(known["state"], [(outcome.index, outcome.state) for outcome in outcomes])
        if len(known) > before:
            self._consolidate()

    def column(self, name: str) -> np.ndarray:
        """A measure of all cases so far, NaN where there is none.

        Raises:
            JointplayError: no case has it.
        """
        self.flush()
        arrays = {n: a for n, a in self._arrays().items() if self._of_measure(a)}
        if name not in arrays:
            listed = ", ".join(arrays)
            raise JointplayError(f"no case has the measure {name!r}; there are: {listed}")
        return np.asarray(arrays[name][...], float)

    def close(self, whole: bool = True) -> None:
        """Bring the arrays up to date and let go of the store.

        Args:
            whole: have everything on disk, and empty the journal. Not after an interruption, which
                can have come anywhere: then the journal is what counts.

        Raises:
            JointplayError: the disk is full; the journal has it all.
        """
        try:
            self.flush()
            if whole:
                with writing(self.path):
                    listed = {n: sorted(sealed.chunks(self.path, n)) for n in self._folders()}
                    self.group.update_attributes({WRITTEN: listed})
                    self._consolidate()
                os.sync()
                self.journal.clear()
        finally:
            self.journal.close()
            files.release(self.path)

    def remove(self) -> None:
        """Delete it, of which nothing is worth keeping, and let go of it."""
        self.removed = True
        self.journal.close()
        with suppress(OSError):
            files.empty(self.path)
            if not self._folder_was_there:
                self.path.rmdir()
        files.release(self.path)


def outcome_of(entry: Any, shape: Index) -> Outcome | None:
    """A case of a sweep of this shape, as an entry of its journal says it; None if it is none."""
    if not isinstance(entry, dict) or not entry.keys() <= {"i", "s", "v", "e"}:
        return None
    index, state, values, error = (entry.get(k) for k in "isve")
    if not isinstance(index, list) or len(index) != len(shape):
        return None
    if not all(type(k) is int and 0 <= k < size for k, size in zip(index, shape, strict=True)):
        return None
    if type(state) is not int or state not in (DONE, FAILED):
        return None
    if not isinstance(values, dict) or not all(n and type(v) is float for n, v in values.items()):
        return None
    if not isinstance(error, str | None):
        return None
    return Outcome(tuple(index), state, values, error or "")


def _set(array: zarr.Array[Any], cells: Sequence[tuple[Index, Any]]) -> None:
    """Put values at their places."""
    at = tuple(np.array([index[k] for index, _ in cells]) for k in range(array.ndim))
    values = [value for _, value in cells]
    text = values and isinstance(values[0], str)
    array.vindex[at] = np.array(values, dtype=object if text else array.dtype)


def of_sweep(plan: Plan) -> str:
    """What tells that states are of this sweep, should the metadata of the store be damaged."""
    text = json.dumps([plan.identity, plan.sizes, versions()["jointplay"]], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def sweep_of_states(path: Path) -> str | None:
    """The same of the sweep that the states in a store are of; None if they do not tell."""
    try:
        found: str | None = sealed.metadata(path, "state")["attributes"].get("sweep")
    except (OSError, ValueError):
        return None
    return found


def _region(key: str, name: str, array: Mapping[str, Any], dims: int) -> tuple[slice, ...]:
    """Cases of a chunk."""
    sizes = array["chunk_grid"]["configuration"]["chunk_shape"]
    places = map(int, key.removeprefix(f"{name}/c/").split("/")[:dims])
    return tuple(slice(k * size, (k + 1) * size) for k, size in zip(places, sizes, strict=False))


def _chunks(shape: Index) -> Index:
    """Chunks of at most `CHUNK` cases, whole along the last dimensions."""
    left, chunks = CHUNK, []
    for size in reversed(shape):
        take = max(min(size, left), 1)
        chunks.append(take)
        left = max(left // take, 1)
    return tuple(reversed(chunks))


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say of errors of the file system in the block that the store cannot be written; once.

    zarr writes chunks side by side: where one fails the others go on, and asyncio logs failures
    that nobody waits for.
    """
    try:
        yield
    except OSError as error:
        with suppress(Exception):  # what comes of them is known
            sync(_others(), timeout=REST_S)
        raise files.cannot_write(path, error) from None


async def _others() -> None:
    """Wait for all that zarr has begun beside."""
    rest = asyncio.all_tasks() - {asyncio.current_task()}
    await asyncio.gather(*rest, return_exceptions=True)
