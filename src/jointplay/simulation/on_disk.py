"""Runs of any length in bounded memory: their records go to disk while they run.

The result file is made of them at the end, portion by portion. Until then they are plain numbers:
a NetCDF file that its process was killed over cannot be read any more.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.host import files, stopping
from jointplay.kernel import Status
from jointplay.kernel.workspace import Workspace
from jointplay.result.histories import Histories
from jointplay.result.result import Result
from jointplay.simulation import checkpoint
from jointplay.simulation.progress import Writing
from jointplay.simulation.spool import Spool
from jointplay.simulation.unfinished import beside

if TYPE_CHECKING:
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation

MOST_BYTES = 32 << 20
"""A run whose records take more has them on disk, if it may [bytes]."""

RECORD_BYTES = 4 << 20
"""Of such a run so much is in memory [bytes]."""

CHECKPOINT_S = 60.0
"""Interval between the checkpoints of a run whose records go to disk [s]."""


class OnDisk:
    """Where a run's records go when memory has no more room for them.

    Args:
        path: a file for them; it is made when the first ones go there.
        workspace: of the run.
        records: that the whole run makes.
        most: records of a stretch, at most.

    Attributes:
        path: as given.
    """

    def __init__(self, path: Path, workspace: Workspace, records: int, most: int) -> None:
        """Make room in memory for some."""
        self.path, self._workspace, self._most = path, workspace, most
        self._spool: Spool | None = None
        size = workspace.record.strides[0]
        room = max(RECORD_BYTES // size, 2 * most)
        self.needed = records * size > MOST_BYTES and records > room
        """Whether the run makes more than memory is to hold."""
        workspace.make_room(room if self.needed else records)

    def before_stretch(self) -> None:
        """Make room for the records of a stretch."""
        w = self._workspace
        if self.needed and int(w.run["rows"][0]) - w.rows < self._most:
            self.spill()

    def spill(self, sync: bool = False) -> Spool:
        """Put all records on disk; `sync`: so that they survive a power failure.

        Raises:
            JointplayError: they cannot be written.
        """
        w = self._workspace
        if self._spool is None:
            self._spool = Spool(self.path, w.record.shape[1], w.kept_elsewhere)
        if w.rows > w.kept_elsewhere:
            self._spool.take(w.record[: w.rows - w.kept_elsewhere])
            w.give_records()
        if sync:
            self._spool.sync()
        return self._spool

    def remove(self) -> None:
        """Delete the records on disk."""
        if self._spool is not None:
            self._spool.remove()
        self._spool = None


def checkpoints(run: Run, path: Path) -> Callable[[], bool]:
    """What writes a checkpoint now and then, to be called between the stretches of a run."""
    last = time.monotonic()

    def look() -> bool:
        nonlocal last
        if time.monotonic() - last >= CHECKPOINT_S:
            run.checkpoint(path)
            last = time.monotonic()
        return False

    return look


def run_to(simulation: Simulation, path: Path, progress: bool, resume: bool) -> Result:
    """See `Simulation.run_to`."""
    records, kept = beside(path)
    resume = resume and kept.exists()
    if not resume:
        files.check_new(path)
        files.check_new(kept)
    run = simulation.prepare(progress, records)
    if resume:
        checkpoint.continue_run(run, kept)
    run.between.append(checkpoints(run, kept))
    with stopping.listening(), stopping.keeping(str(path)):
        status, message = stopping.stoppable(run).complete(progress)
        if status == Status.INTERRUPTED:
            run.checkpoint(kept)
        save(run, path, status, message, overwrite=resume, progress=progress)
    if status != Status.INTERRUPTED:
        forget(run, path)
    return Result.open(path)


def forget(run: Run, path: Path) -> None:
    """Delete what was kept to continue the run whose result is in `path`."""
    assert run.on_disk is not None
    run.on_disk.remove()
    for name in beside(path):
        name.unlink(missing_ok=True)


def save(
    run: Run,
    path: Path,
    status: Status,
    message: str,
    notes: Mapping[str, Any] | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> None:
    """Write the result of a run whose records are on disk, a portion in memory at a time.

    Args:
        run: to its end, or as far as it came.
        path: the file.
        status, message: what `Run.complete` said.
        notes: further attributes of the file.
        overwrite: whether a file of that name is replaced.
        progress: show a bar.

    Raises:
        JointplayError: it cannot be written.
    """
    assert run.on_disk is not None
    w, loads = run.workspace, run.simulation.loads
    spool = run.on_disk.spill()
    made = Histories(run.mechanism, run.simulation.describe(), run.friction, run.judged_from, loads)
    portions = spool.portions(w.fields, w.contacts.shape[1])
    bar = Writing(spool.rows, progress)
    with closing(bar), files.writing(path, overwrite=overwrite) as file:
        whole, records = made.whole(w), next(portions)
        first = made.portion(records, run.phases).assign(whole)
        bar.update(records.rows)
        from jointplay.result.growing import Growing  # takes long to import

        with closing(Growing(file, first)) as growing:
            for records in portions:
                growing.append(made.portion(records, run.phases))
                bar.update(records.rows)
            end = (status, message, run.elapsed, run.judgement())
            growing.finish({**made.attributes(w, *end), **(notes or {})}, whole)
