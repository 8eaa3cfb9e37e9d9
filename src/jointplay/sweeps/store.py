"""The store of a sweep: labelled Zarr arrays over its dimensions, and a journal of what is done.

A finished case is one line of the journal. The arrays are filled from it now and then, and at the
end; filled again, they are what they were. So whatever is killed, and whenever, nothing that was
finished is lost: the journal is emptied only when all that it says is in the arrays and on disk.
"""

from __future__ import annotations

import asyncio
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.core.sync import sync

from jointplay.errors import JointplayError
from jointplay.host import files
from jointplay.result.provenance import versions
from jointplay.scenario.places import dotted
from jointplay.sweeps import histories
from jointplay.sweeps.case import Outcome
from jointplay.sweeps.differences import differences, grown
from jointplay.sweeps.journal import JOURNAL, SYNC_S, Journal, is_there
from jointplay.sweeps.measures import about
from jointplay.sweeps.opened import FORMAT, check_format, quiet
from jointplay.sweeps.plan import REPEAT, SAMPLE, Index, Plan

CHUNK = 4096
"""Cases in a chunk, at most."""

REST_S = 10.0
"""How long is waited for chunks that are being written where one could not be [s]."""

FLUSH_S = 60.0
"""Interval at which the arrays are brought up to date, for readers [s]."""

MOST_DIFFERENCES = 4
"""Differences that a message names."""


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
                    self._reopen(extend)
                else:
                    self._make()
                self.journal = Journal(self.path / JOURNAL)
                self._take_up()
            self.new = not there and not self.journal.found
        except BaseException:
            files.release(self.path)
            raise

    def _make(self) -> None:
        plan = self.plan
        files.empty(self.path)  # by zarr the folder itself would go, and with it its lock
        self.group = zarr.create_group(self.path, zarr_format=3)
        self.array("state", "int8", 0, "0: not run, 1: done, 2: failed", "1")
        self.array("error", "string", "", "what went wrong with the case", "")
        self._coordinates()
        # With these attributes it is a store; without, the rest of one that was not made.
        self.group.update_attributes(
            self._about()
            | {
                "jointplay_sweep": FORMAT,
                "case": plan.case,
                "sampling": plan.sampling,
                "sampled": [axis.name for axis in plan.drawn],
                "inputs": plan.inputs,
                "versions": versions(),
            }
        )
        self._consolidate()

    def _about(self) -> dict[str, Any]:
        """What of the attributes changes as the sweep grows."""
        plan = self.plan
        return {
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
        for rest in self.path.rglob("*.partial"):  # of a process that was killed
            rest.unlink(missing_ok=True)
        self.group = zarr.open_group(self.path, mode="r+", use_consolidated=False)
        attrs = dict(self.group.attrs)
        if "jointplay_sweep" not in attrs:  # killed while it was made
            self._make()
            return
        check_format(attrs, self.path)
        changes = differences(attrs["identity"], self.plan.identity)
        smaller = grown(attrs, self.plan)
        mine, theirs = versions()["jointplay"], attrs["versions"].get("jointplay")
        if mine != theirs:
            changes.append(("version", f"jointplay is {mine}, and was {theirs}"))
        beyond = [text for key, text in changes if key not in smaller]
        if beyond or (changes and not extend):
            shown = [text for _, text in changes][:MOST_DIFFERENCES]
            more = len(changes) - len(shown)
            advice = (
                "--extend adds the new cases" if not beyond else "choose another name for the store"
            )
            raise JointplayError(
                f"{str(self.path)!r} is of another sweep: {'; '.join(shown)}"
                f"{f'; and {more} more' if more > 0 else ''}; {advice}"
            )
        if tuple(attrs["sizes"].values()) != self.plan.shape:
            self.grow(self.plan)
        self.state = np.asarray(self.group["state"][...], np.int8).copy()

    def _take_up(self) -> None:
        """Fill the arrays with what the journal has."""
        for entry in self.journal.found:
            self._pending.append(
                Outcome(tuple(entry["i"]), entry["s"], entry["v"], entry.get("e", ""))
            )
        for outcome in self._pending:
            self.state[outcome.index] = outcome.state
        if self._pending:
            self.flush()

    def grow(self, plan: Plan) -> None:
        """Make room for the cases of a larger plan; those there are stay what they are.

        Raises:
            JointplayError: the store cannot be written.
        """
        before = self.state
        self.plan = plan
        self.state = np.zeros(plan.shape, np.int8)
        self.state[tuple(slice(0, size) for size in before.shape)] = before
        dims = list(plan.sizes)
        with writing(self.path):
            for array in self._arrays().values():
                names = array.metadata.dimension_names or ()
                if tuple(names[: len(dims)]) == tuple(dims):
                    array.resize((*plan.shape, *array.shape[len(dims) :]))
            self._coordinates()
            self.group.update_attributes(self._about())
            self._consolidate()

    def _consolidate(self) -> None:
        """Write into one file what the arrays are, so that a reader need not look for them."""
        with quiet():
            zarr.consolidate_metadata(self.group.store)

    def _arrays(self) -> dict[str, Any]:
        with quiet():
            return dict(self.group.arrays())

    def array(
        self,
        name: str,
        dtype: Any,
        fill: Any,
        text: str,
        unit: str,
        tail: Mapping[str, int] | None = None,
    ) -> zarr.Array[Any]:
        """Make an array over the dimensions of the sweep and those of `tail`."""
        tail = tail or {}
        chunks = _chunks(self.plan.shape) if not tail else (1,) * len(self.plan.shape)
        with quiet():
            return self.group.create_array(
                name,
                shape=(*self.plan.shape, *tail.values()),
                chunks=(*chunks, *(max(size, 1) for size in tail.values())),
                dtype=dtype,
                fill_value=fill,
                dimension_names=[*self.plan.sizes, *tail],
                attributes={"units": unit, "long_name": text},
                overwrite=True,
            )

    def _coordinates(self) -> None:
        """Values of the dimensions, and of what is sampled."""
        plan = self.plan
        coordinates: dict[str, tuple[str, Any, str, str]] = {}
        for axis in plan.axes:
            text = ", ".join(dotted(key) for key in axis.keys)
            coordinates[axis.name] = (axis.name, axis.coordinate, axis.unit, text)
        for k, axis in enumerate(plan.drawn):
            text = ", ".join(dotted(key) for key in axis.keys)
            coordinates[axis.name] = (SAMPLE, plan.drawn_values[:, k], axis.unit, text)
        if REPEAT in plan.sizes:
            seeds = plan.seed + np.arange(plan.repeats)
            coordinates[REPEAT] = (REPEAT, seeds, "", "seed of the displacement of the journals")
        for name, (dimension, values, unit, text) in coordinates.items():
            self.labels(name, dimension, np.asarray(values), {"units": unit, "long_name": text})

    def labels(
        self, name: str, dimension: str, values: np.ndarray, attrs: Mapping[str, Any]
    ) -> None:
        """Write the coordinate of a dimension."""
        whole = values.astype(object) if values.dtype.kind in "UO" else values
        with quiet():
            array = self.group.create_array(
                name,
                shape=values.shape,
                chunks=(max(len(values), 1),),
                dtype="string" if values.dtype.kind in "UO" else values.dtype,
                dimension_names=[dimension],
                attributes=dict(attrs),
                overwrite=True,
            )
            array[:] = whole

    def keep(self, outcome: Outcome) -> None:
        """Keep a finished case: on return it survives this process.

        Raises:
            JointplayError: the disk is full; the cases before are kept.
        """
        with writing(self.path):
            for name, history in outcome.histories.items():
                histories.write(self, name, outcome.index, history)
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
        columns: dict[str, list[tuple[Index, float]]] = {}
        for outcome in outcomes:
            for name, value in outcome.values.items():
                columns.setdefault(name, []).append((outcome.index, value))
        known = self._arrays()
        before = len(known)
        for name, cells in columns.items():
            if name not in known:
                unit, text = about(name)
                known[name] = self.array(name, "float64", np.nan, text, unit)
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
        if name not in self.group:
            known = [n for n, a in self._arrays().items() if a.dtype.kind == "f"]
            raise JointplayError(f"no case has the measure {name!r}; there are: {', '.join(known)}")
        return np.asarray(self.group[name][...], float)

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


def _set(array: zarr.Array[Any], cells: Sequence[tuple[Index, Any]]) -> None:
    """Put values at their places."""
    at = tuple(np.array([index[k] for index, _ in cells]) for k in range(array.ndim))
    values = [value for _, value in cells]
    text = values and isinstance(values[0], str)
    array.vindex[at] = np.array(values, dtype=object if text else array.dtype)


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
