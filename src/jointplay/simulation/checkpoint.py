"""Checkpoints: a run on disk, to be continued bit for bit in another process.

The file holds numbers and the simulation as plain data: no code. Only the version that wrote it
reads it, for another may step otherwise.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import compiler, files
from jointplay.base.errors import JointplayError, damaged
from jointplay.base.schema import differences, short
from jointplay.simulation.result.stored import versions
from jointplay.simulation.working_files import CHECKPOINT

if TYPE_CHECKING:
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation

_STATISTICS = "unjudged."
"""Prefix of the arrays of `Judging.unjudged`."""


def save(run: Run, path: Path) -> Path:
    """Write the state of `run`, from which `continue_run` goes on bit for bit."""
    files.check_own(path, CHECKPOINT, "checkpoint")
    memory = run.memory()
    on_disk = run.on_disk if run.on_disk is not None and run.on_disk.needed else None
    records = None
    if on_disk is not None:
        on_disk.write_to_disk(sync=True)
        records = {"file": on_disk.path.name, "run": on_disk.name}
    arrays = run.workspace.snapshot()
    for name, values in (memory.pop("unjudged") or {}).items():
        arrays[_STATISTICS + name] = values
    head = {
        "simulation": run.simulation.describe(),
        "versions": _versions(),
        "memory": memory,
        "records": records,
    }
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    out = io.BytesIO()
    out.write(CHECKPOINT)
    np.savez(out, **arrays)  # type: ignore[arg-type]
    return files.write(path, out.getvalue(), overwrite=True, announced=False)


def resume(path: Path, build: Callable[[dict[str, Any], Path | None], Run]) -> Run:
    """Make a run as it was left; see `Simulation.resume`.

    `build`: makes the run of a simulation that is described, with the path of its records if these
    are on disk.
    """
    arrays, head = read(path)
    with _naming_checkpoint(path):
        # A checkpoint names a file beside it, which must hold records of this very run: nothing
        # else is read, written or deleted because a checkpoint says so.
        records = None if head["records"] is None else path.with_name(head["records"]["file"])
        run = build(head["simulation"], records)
        _restore(run, arrays, head)
    return run


def check_replaceable(path: Path) -> None:
    """Refuse to continue a run that would replace another result than its own interrupted one."""
    from jointplay.physics.kernel import Status
    from jointplay.simulation.result.result import Result

    if not os.path.lexists(path):
        return
    with suppress(JointplayError):
        result = Result.open(path)
        result.dataset.close()
        if result.status == Status.INTERRUPTED:
            return
    raise JointplayError(
        f"{str(path)!r} is not the result of an interrupted run, which would be replaced; move it"
    )


def continue_run(run: Run, path: Path) -> None:
    """Bring a prepared run to the state of a checkpoint of the same run.

    Raises:
        JointplayError: the checkpoint is damaged, of another version, or of another simulation; the
            message says which.
    """
    arrays, head = read(path)
    require_same(path, head["simulation"], run.simulation)
    with _naming_checkpoint(path):
        _restore(run, arrays, head)


def require_same(path: Path, was: Any, simulation: Simulation) -> None:
    """Refuse a file whose simulation, described as `was`, is another.

    Raises:
        JointplayError: the two differ; the message has the first input that does.
    """
    now = json.loads(json.dumps(simulation.describe()))
    for place, before, after in differences(was, now):
        raise JointplayError(
            f"{str(path)!r} belongs to another run: {place} is {short(after)} instead of "
            f"{short(before)}; choose another folder, or undo the change"
        )


def _restore(run: Run, arrays: dict[str, np.ndarray], head: dict[str, Any]) -> None:
    unjudged = {
        name.removeprefix(_STATISTICS): values
        for name, values in arrays.items()
        if name.startswith(_STATISTICS)
    }
    run.workspace.restore(arrays)
    if run.workspace.kept_elsewhere:
        if run.on_disk is None:
            raise JointplayError("its records are on disk already")
        run.on_disk.name = head["records"]["run"]
        run.on_disk.write_to_disk()
    run.recall(head["memory"] | {"unjudged": unjudged or None})


@contextmanager
def _naming_checkpoint(path: Path) -> Iterator[None]:
    try:
        yield
    except JointplayError as error:
        raise JointplayError(f"{str(path)!r} cannot be continued: {error}") from None
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise damaged(path, "checkpoint", error) from None


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays of a checkpoint, and its plain data; refused if another version wrote it."""
    files.require_file(path, "checkpoint")
    try:
        with path.open("rb") as file:
            if file.read(len(CHECKPOINT)) != CHECKPOINT:
                raise ValueError(f"it does not begin with {CHECKPOINT.decode().strip()!r}")
            arrays = files.arrays(file)
        head = json.loads(arrays.pop("head").tobytes())
    except (OSError, ValueError, LookupError, RecursionError) as error:
        raise damaged(path, "checkpoint", error) from None
    if not isinstance(head, dict):
        raise damaged(path, "checkpoint", "its head is not a table")
    others = ", ".join(
        f"{name} {was}, here {now}"
        for name, was, now in differences(head.get("versions"), _versions())
    )
    if others:
        raise JointplayError(
            f"{str(path)!r} was written by another version ({others}), which may compute different "
            "steps; continue it with that version"
        )
    return arrays, head


def _versions() -> dict[str, str]:
    return {**versions(), "kernels": compiler.sources()}
