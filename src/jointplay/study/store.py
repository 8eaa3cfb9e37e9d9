"""The store of a study: labelled Zarr arrays over its dimensions, and a journal of what is done.

Of a plan a store needs its `sizes`, `coordinates`, `histories`, `identity` and `about`, the
`meaning` of measures, and in what it has `grown`.

A finished case is one line of the journal. The arrays are filled from it now and then, and at the
end; filled again, they are what they were. The store's own metadata, written last and replaced at
once, say which arrays and chunks there are, and how large: what they do not know of is filled
again. The journal is emptied only when all that it says is in the arrays and on disk. So whatever
is killed, and whenever, nothing that was finished is lost.

What has changed since it was written is found by its seal, what is gone by the list of chunks
(`sealed`); its cases run again.
"""

from __future__ import annotations

import math
import os
import secrets
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_a
from jointplay.simulation.result.stored import versions
from jointplay.study import sealed
from jointplay.study.journal import FAILED, JOURNAL, History, Index, Journal, Outcome, is_there
from jointplay.study.sealed import COPY, METADATA, Array, Contents, array_name, plain_name

if TYPE_CHECKING:
    from jointplay.study.sweep_plan import SweepPlan

ROUNDING = 1e-9
"""Times that differ by less than this, relative to the last of them, are the same."""
SUFFIX = "_history"
"""What the names of arrays of time histories end with."""
CHUNK = 1 << 12
"""Cases in a chunk, at most."""
HISTORY_CHUNK = 1 << 17
"""Numbers in a chunk of histories, at most: a megabyte."""
SYNC_S = 1.0
"""What a power failure can take is no older than this [s]."""
FLUSH_S = 60.0
"""Interval at which the arrays are brought up to date, for readers [s]."""
FLUSH_BYTES = 1 << 26
"""Size of the journal at which that is done as well, and the journal emptied [bytes]."""
MOST_DIFFERENCES = 4
"""Differences that a message names."""


class SweepStore:
    """A store that is being written.

    Args:
        path: its folder.
        plan: what is run; an old store must be of the same.
        resume: whether an old store is gone on with.
        extend: whether it may become larger: more samples, repeats, values at the end of an axis.

    Attributes:
        state: of every case; 0: not run, `DONE`, `FAILED`.

    Raises:
        JointplayError: the store exists (and `resume` is false), is of another study, or another
            process writes to it; it cannot be written.
    """

    def __init__(
        self, path: str | Path, plan: SweepPlan, resume: bool = False, extend: bool = False
    ) -> None:
        self.path = Path(path)
        there = is_there(self.path, resume or extend)
        files.claim(self.path, [])
        try:
            self.plan = plan
            self.state = np.zeros(self._shape, np.int8)
            self._pending: list[Outcome] = []
            self._labels: dict[str, list[Any]] = {}
            self._written: dict[str, bytes] = {}  # metadata by file, as they are on disk
            self._synced = self._flushed = time.monotonic()
            with writing(self.path):
                if there:
                    self._reopen(extend)
                else:
                    self._make()
                self._take_up()
        except BaseException:
            files.release(self.path)
            raise

    @property
    def _shape(self) -> Index:
        return tuple(self.plan.sizes.values())

    # ---- Made, and gone on with -----------------------------------------------------------------

    def _about(self, store: str) -> dict[str, Any]:
        """Attributes of the store: of which study it is."""
        mine = {"identity": dict(self.plan.identity), "sizes": dict(self.plan.sizes)}
        own = {"jointplay_sweep": sealed.FORMAT, "store": store, "versions": versions()}
        return {**self.plan.attributes, **mine, **own}

    def _make(self) -> None:
        """Begin a new store; what there was in the folder was of an older one."""
        for one in self.path.iterdir():
            if one.is_dir() and not one.is_symlink():
                shutil.rmtree(one)
            elif one.name not in (METADATA, COPY):  # by which a killed process is gone on with
                one.unlink()
        self.contents = Contents(self.path, self._about(secrets.token_hex(16)))
        for name, kind, unit, text in (
            ("state", "int8", "1", "0: not run, 1: done, 2: failed"),
            ("error", "string", "", "error message of the case"),
        ):
            self._add(name, self._of_cases(kind, {"units": unit, "long_name": text}))
        self._commit(coordinates=True)
        self.journal = Journal(self.path / JOURNAL, self.contents.store)

    def _reopen(self, extend: bool) -> None:
        """Go on with an old store."""
        contents = sealed.contents_of(self.path, copy=True)
        self._check_study(contents.attributes, extend)
        for rest in self.path.rglob(f"*{sealed.PARTIAL}"):  # of a process that was killed
            rest.unlink(missing_ok=True)
        hurt = list(contents.survey())
        if any(contents.kind(name) == "labels" for name, _ in hurt):
            self._make()
            return
        self.contents = contents
        self._mend(hurt)
        self.journal = Journal(self.path / JOURNAL, contents.store)
        self.state = contents.values("state")
        self._labels = {
            plain_name(name): contents.values(name).tolist()
            for name in contents.arrays
            if contents.kind(name) == "labels"
        }
        if self.state.shape != self._shape:
            self.grow(self.plan)
        else:
            self._commit(coordinates=True)

    def _check_study(self, attributes: Mapping[str, Any], extend: bool) -> None:
        """Refuse a store of another study."""
        changes = differences(attributes["identity"], self.plan.identity)
        grown = self.plan.grown(attributes["identity"], list(attributes["sizes"]))
        beyond = changes.keys() - grown
        mine, theirs = versions()["jointplay"], attributes["versions"].get("jointplay")
        if mine != theirs:
            changes["version"] = f"jointplay is {mine} instead of {theirs}"
            beyond |= {"version"}
        if beyond or (changes and not extend):
            shown = list(changes.values())[:MOST_DIFFERENCES]
            more = len(changes) - len(shown)
            shown += [f"and {more} more"] if more else []
            advice = (
                "choose another name for the store" if beyond else "--extend adds the new cases"
            )
            raise JointplayError(
                f"{str(self.path)!r} belongs to another sweep: {'; '.join(shown)}; {advice}"
            )

    def _mend(self, hurt: Sequence[tuple[str, str]]) -> None:
        """Have the cases count as not run whose numbers were in damaged chunks, and delete these.

        What the journal has of them is filled in again. Killed at any moment it is done again: what
        is damaged goes only when the states on disk say that its cases have not been run.
        """
        again = np.zeros(self.contents.arrays["state"].shape, bool)
        for name, chunk in hurt:
            listed = chunk in self.contents.chunks.get(name, ())  # else the journal has its cases
            if listed and self.contents.kind(name) in ("measure", "cases"):
                sizes = self.contents.arrays[name].chunks[: again.ndim]
                at = zip(map(int, chunk.split("/")), sizes, strict=False)
                again[tuple(slice(k * size, (k + 1) * size) for k, size in at)] = True
            if name == "state":
                self.contents.delete(name, chunk)
        if again.any():
            state = self.contents.values("state")
            state[again] = 0
            self.contents.write("state", state)
            os.sync()
        for name, chunk in hurt:
            self.contents.delete(name, chunk)

    def _take_up(self) -> None:
        """Fill the arrays with what the journal has; entries that are none are as good as changed.

        A seal does not tell who made it: a stranger's line can have the right one.
        """
        for entry in self.journal.found:
            outcome = Outcome.read(entry, self._shape)
            if outcome is not None and not self._taken(outcome):
                self._pending.append(self._fitted(outcome))
                self.state[outcome.index] = self._pending[-1].state
        self.flush()

    def _taken(self, outcome: Outcome) -> list[str]:
        """What an outcome has for which there is no array, nor can be: its names are others'."""
        arrays, kind = self.contents.arrays, self.contents.kind
        taken = [name for name in outcome.values if kind(array_name(name), "measure") != "measure"]
        for name, history in outcome.histories.items():
            own = tuple(map(array_name, history.labels))
            known = arrays.get(array_name(name + SUFFIX))
            other = known is not None and known.dims[len(self._shape) :] != own
            labels = all(kind(one, "labels") == "labels" for one in own)
            if other or not labels or name not in self.plan.histories:
                taken.append(name)
        return taken

    def grow(self, plan: SweepPlan) -> None:
        """Make room for the cases of a larger plan; those there are stay what they are.

        Raises:
            JointplayError: the store cannot be written.
        """
        self.plan, before = plan, self.state
        self.state = np.zeros(self._shape, np.int8)
        self.state[tuple(map(slice, before.shape))] = before
        arrays = self.contents.arrays
        with writing(self.path):
            for name in arrays:
                if self.contents.kind(name) in ("measure", "cases"):
                    shape = (*self._shape, *arrays[name].shape[before.ndim :])
                    arrays[name] = replace(arrays[name], shape=shape)
            self.contents.attributes = self._about(self.contents.store)
            self._commit(coordinates=True)

    # ---- Arrays ---------------------------------------------------------------------------------

    def _of_cases(
        self, dtype: str, attributes: Mapping[str, str], tail: Mapping[str, int] | None = None
    ) -> Array:
        tail = tail or {}
        shape = (*self._shape, *tail.values())
        chunks = _chunks(shape, HISTORY_CHUNK if tail else CHUNK)
        dims = tuple(map(array_name, (*self.plan.sizes, *tail)))
        return Array(dtype, dims, shape, chunks, attributes)

    def _add(self, name: str, array: Array) -> None:
        """Have an array, in place of what a killed process, or another kind, has left there."""
        if (self.path / name).is_dir():
            shutil.rmtree(self.path / name)
        self._written.pop(f"{name}/{METADATA}", None)
        self.contents.arrays[name] = array
        self.contents.chunks.pop(name, None)

    def _write_labels(
        self, name: str, dimension: str, values: np.ndarray, attributes: Mapping[str, str]
    ) -> None:
        folder = array_name(name)
        text = values.dtype.kind in "UO"
        dtype = "string" if text else str(values.dtype)
        array = self.contents.arrays.get(folder)
        if array is None or array.dtype != dtype:
            chunks = (max(len(values), 1),)
            self._add(folder, Array(dtype, (array_name(dimension),), values.shape, chunks))
        array = self.contents.arrays[folder]
        self.contents.arrays[folder] = replace(array, shape=values.shape, attributes=attributes)
        self.contents.write(folder, values.astype(object) if text else values)

    def _write(self, name: str, cells: Iterable[tuple[Index, Any, Sequence[np.ndarray]]]) -> None:
        """Write values of cases into an array, each chunk once.

        Args:
            name: the array.
            cells: index of each case, its value, and the places of that along the array's other
                dimensions, where all else becomes NaN.
        """
        array, number = self.contents.arrays[name], len(self._shape)
        sizes, tail = array.chunks[:number], array.shape[number:]
        inside: dict[Index, list[tuple[Index, Any]]] = {}
        for index, value, places in cells:
            row = value
            if tail:
                row = array.empty(tail)
                row[np.ix_(*places)] = value
            chunk, at = zip(*map(divmod, index, sizes), strict=True)
            inside.setdefault(chunk, []).append((at, row))
        for chunk, given in inside.items():
            for more, place, within in sealed.pieces(sealed.whole(tail), array.chunks[number:]):
                block = self.contents.load(name, (*chunk, *more))
                for at, row in given:
                    inner: Any = (*at, *within)
                    block[inner] = row[place] if tail else row
                self.contents.save(name, (*chunk, *more), block)

    def _commit(self, coordinates: bool = False) -> None:
        """Have the metadata say what there is now; values of the dimensions are written before."""
        for name, about in self.plan.coordinates.items() if coordinates else ():
            self._write_labels(name, *about)
        content = self.contents.file
        for name in (COPY, METADATA):  # the copy is never the older one
            if self._written.get(name) != content:
                files.write(self.path / name, content, overwrite=True, announced=False)
                self._written[name] = content
        for folder, array in self.contents.arrays.items():
            name, content = f"{folder}/{METADATA}", sealed.encoded(array.metadata)
            if self._written.get(name) != content:
                sealed.write_whole(self.path / name, content)
                self._written[name] = content

    # ---- Cases ----------------------------------------------------------------------------------

    def _fitted(self, outcome: Outcome) -> Outcome:
        values, said = outcome.values, ""
        if taken := self._taken(outcome):
            values = {name: value for name, value in values.items() if name not in taken}
            said = (
                f"a measure cannot be called {min(taken)!r}: the sweep has something of that name"
            )
        try:
            for history in () if taken else outcome.histories.values():
                self._join(history)
        except JointplayError as error:  # it does not fit those of the cases before
            said = str(error)
        return Outcome(outcome.index, FAILED, values, said) if said else outcome

    def _join(self, history: History) -> None:
        """Have the labels of a history among those of all cases, which share one time axis."""
        for dimension, given in history.labels.items():
            known, own = self._labels.setdefault(dimension, []), given.tolist()
            if dimension != "time":
                known += [label for label in own if label not in known]
                continue
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
            known += own[shared:]

    recovery = "--resume continues"

    def __contains__(self, index: Any) -> bool:
        return bool(self.state[index])

    def keep(self, index: Any, outcome: Outcome) -> None:
        """Keep a finished case: on return it survives this process.

        Raises:
            JointplayError: the disk is full; the cases before are kept.
        """
        outcome = self._fitted(outcome)
        self.journal.add(outcome.entry)
        self.state[outcome.index] = outcome.state
        self._pending.append(outcome)
        now = time.monotonic()
        if now - self._synced > SYNC_S:
            self.journal.sync()
            self._synced = time.monotonic()
        if now - self._flushed > FLUSH_S or self.journal.size > FLUSH_BYTES:
            self.flush()

    def flush(self) -> None:
        """Bring the arrays up to date.

        Raises:
            JointplayError: the disk is full; the journal has it all.
        """
        if self._pending:
            with writing(self.path):
                self._fill(self._pending)
                if self.journal.size > FLUSH_BYTES:
                    os.sync()
                    self.journal.clear()
        self._pending = []
        self._flushed = time.monotonic()

    def _fill(self, outcomes: Sequence[Outcome]) -> None:
        arrays = self.contents.arrays
        for name in dict.fromkeys(name for outcome in outcomes for name in outcome.values):
            if array_name(name) not in arrays:
                about = zip(sealed.WORDS, self.plan.meaning(name), strict=True)
                kept = {word: text for word, text in about if text or word != "origin"}
                self._add(array_name(name), self._of_cases("float64", kept))
        for name in list(arrays):
            if self.contents.kind(name) == "measure":
                plain = plain_name(name)
                self._write(name, [(o.index, o.values.get(plain, np.nan), ()) for o in outcomes])
        self._write("error", [(o.index, o.error, ()) for o in outcomes])
        self._fill_histories(outcomes)
        self._commit()
        # Last: what a reader sees as done is whole.
        self._write("state", [(o.index, o.state, ()) for o in outcomes])

    def _fill_histories(self, outcomes: Sequence[Outcome]) -> None:
        """Write histories, and the labels that they share."""
        having: dict[str, list[tuple[Index, History]]] = {}
        for outcome in outcomes:
            for name, history in outcome.histories.items():
                having.setdefault(name, []).append((outcome.index, history))
        places = {
            dimension: {label: k for k, label in enumerate(known)}
            for dimension, known in self._labels.items()
        }
        for dimension, known in self._labels.items():
            array = self.contents.arrays.get(array_name(dimension))
            if array is None or array.shape != (len(known),):
                units = {"units": "s"} if dimension == "time" else {}
                self._write_labels(dimension, dimension, np.asarray(known), units)
        for name, cases in having.items():
            folder = array_name(name + SUFFIX)
            tail = {dimension: len(self._labels[dimension]) for dimension in cases[0][1].labels}
            if folder not in self.contents.arrays:
                about = {"units": cases[0][1].unit, "long_name": cases[0][1].text}
                self._add(folder, self._of_cases("float64", about, tail))
            array = self.contents.arrays[folder]
            self.contents.arrays[folder] = replace(array, shape=(*self._shape, *tail.values()))
            cells = []
            for index, history in cases:
                own = [
                    np.arange(len(given))
                    if dimension == "time"
                    else np.array([places[dimension][one] for one in given.tolist()], int)
                    for dimension, given in history.labels.items()
                ]
                cells.append((index, history.values, own))
            self._write(folder, cells)

    def column(self, name: str) -> np.ndarray:
        """A measure of all cases so far, NaN where there is none.

        Raises:
            JointplayError: no case has it.
        """
        self.flush()
        listed = [one for one in self.contents.arrays if self.contents.kind(one) == "measure"]
        if array_name(name) not in listed:
            known = ", ".join(map(plain_name, listed))
            raise JointplayError(f"no case has the measure {name!r}; there are: {known}")
        return self.contents.values(array_name(name))

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
                    self._commit()
                os.sync()
                self.journal.clear()
        finally:
            self.journal.close()
            files.release(self.path)


def differences(old: Mapping[str, str], new: Mapping[str, str]) -> dict[str, str]:
    """In what two studies differ, in words by key."""
    changes = {}
    for key in dict.fromkeys((*old, *new)):
        was, now = old.get(key, "not given"), new.get(key, "not given")
        if was != now:
            file = key.startswith("file ") and "not given" not in (was, now)
            words = "has changed" if file else f"is {_short(now)} instead of {_short(was)}"
            changes[key] = f"{key} {words}"
    return changes


def _short(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:60]}...{text[-15:]}"


def sizes_of(path: Path) -> dict[str, int] | None:
    """Sizes of the dimensions of the cases of a store; None if nothing tells."""
    with suppress(JointplayError):
        return dict(sealed.contents_of(path, copy=True).attributes["sizes"])
    return None


def _chunks(shape: Index, most: int) -> Index:
    """Chunks of at most so many values, whole along the last dimensions."""
    chunks: list[int] = []
    for size in reversed(shape):
        chunks.insert(0, max(min(size, most // math.prod(chunks)), 1))
    return tuple(chunks)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say of errors of the file system in the block that the store cannot be written."""
    try:
        yield
    except OSError as error:
        raise files.cannot_write(path, error) from None


# ---- Read ---------------------------------------------------------------------------------------


def open_sweep(path: str | Path) -> xr.Dataset:
    """The store of a sweep as one dataset over its dimensions, read when it is looked at.

    Variables are the measures (docs/sweeps.md), ``state`` (0: not run, 1: done, 2: failed) and
    ``error``. Of a sweep that is under way it shows what has been written so far. What has changed
    since it was written, or is gone, is refused when it is looked at, naming array and chunk.

    Raises:
        JointplayError: no such store, none of a sweep, or a damaged one.
    """
    require_a("path", path, "str", "Path")
    path = Path(path)
    if not files.is_file(path / METADATA):
        raise JointplayError(f"no sweep {str(path)!r}")
    return xr.open_dataset(path, engine=sealed.Reader)
