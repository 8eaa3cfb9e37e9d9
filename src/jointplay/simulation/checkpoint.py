"""A run on disk, to be continued bit for bit in another process.

The file holds numbers and the simulation as plain data: no code. It is read by the version that
wrote it, for another may step otherwise.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.contact.trust import trusting
from jointplay.errors import JointplayError
from jointplay.host import files
from jointplay.kernel.sources import fingerprint
from jointplay.result.provenance import versions

if TYPE_CHECKING:
    from jointplay.simulation.run import Run

FORMAT = "jointplay checkpoint 2"
_STATISTICS = "unjudged."


def save(run: Run, path: Path) -> Path:
    """See `Run.checkpoint`."""
    memory = run.memory()
    on_disk = run.on_disk if run.on_disk is not None and run.on_disk.needed else None
    if on_disk is not None:
        on_disk.spill(sync=True)
    arrays = run.workspace.snapshot()
    for name, values in (memory.pop("unjudged") or {}).items():
        arrays[_STATISTICS + name] = values
    head = {
        "format": FORMAT,
        "simulation": run.simulation.describe(),
        "versions": versions(),
        "kernels": fingerprint(),
        "memory": memory,
        "records": None if on_disk is None else on_disk.path.name,
    }
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    out = io.BytesIO()
    np.savez(out, **arrays)  # type: ignore[arg-type]
    return files.write(path, out.getvalue(), overwrite=True)


def resume(path: Path, trust: Collection[str]) -> Run:
    """See `Simulation.resume`."""
    from jointplay.simulation.simulation import Simulation

    arrays, head = read(path)
    with _telling(path):
        records = None if head["records"] is None else path.with_name(head["records"])
        with trusting(trust):
            run = Simulation.from_description(head["simulation"]).prepare(records=records)
        _restore(run, arrays, head)
    return run


def continue_run(run: Run, path: Path) -> None:
    """Bring a run that was made ready to where a checkpoint of the same run stands.

    Raises:
        JointplayError: the checkpoint is damaged, of another version, or of another simulation,
            which is said.
    """
    arrays, head = read(path)
    was, now = head["simulation"], json.loads(json.dumps(run.simulation.describe()))
    if was != now:
        raise JointplayError(
            f"{str(path)!r} is of another run: {differing(was, now)}; name another folder, or "
            "change it back"
        )
    with _telling(path):
        _restore(run, arrays, head)


def differing(was: Any, now: Any, place: str = "") -> str:
    """The first thing in which two pieces of plain data differ, in a few words."""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in {**was, **now}:
            if was.get(key) != now.get(key):
                return differing(was.get(key), now.get(key), f"{place}.{key}" if place else key)
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        for k, (one, other) in enumerate(zip(was, now, strict=True)):
            if one != other:
                return differing(one, other, f"{place}[{k}]")
    return f"{place} is {_short(now)}, and was {_short(was)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:40]}...{text[-15:]}"


def _restore(run: Run, arrays: dict[str, np.ndarray], head: dict[str, Any]) -> None:
    unjudged = {
        name.removeprefix(_STATISTICS): values
        for name, values in arrays.items()
        if name.startswith(_STATISTICS)
    }
    run.workspace.restore(arrays)
    if run.workspace.kept_elsewhere:
        if run.on_disk is None:
            raise JointplayError("its records are on disk")
        run.on_disk.spill()
    run.recall(head["memory"] | {"unjudged": unjudged or None})


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """Say of errors in the block which checkpoint they are about."""
    try:
        yield
    except JointplayError as error:
        raise JointplayError(f"{str(path)!r} cannot be continued: {error}") from None
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise _damaged(path, error) from None


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays of a checkpoint, and what else it says.

    Raises:
        JointplayError: no such file, damaged, or written by another version.
    """
    arrays, head = _read(path)
    now = {"versions": versions(), "kernels": fingerprint()}
    for what, value in now.items():
        if head.get(what) != value:
            raise JointplayError(
                f"{str(path)!r} was written by another version "
                f"({_difference(head.get(what), value)}), which may step otherwise; continue it "
                "with that one"
            )
    return arrays, head


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    if not files.is_file(path):
        raise JointplayError(f"no checkpoint {str(path)!r}")
    try:
        with np.load(path, allow_pickle=False) as opened:
            arrays = {name: opened[name] for name in opened.files}
        head = json.loads(arrays.pop("head").tobytes())
    except (OSError, ValueError, LookupError, EOFError, zipfile.BadZipFile) as error:
        raise _damaged(path, error) from None
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise _damaged(path, ValueError(f"its format is not {FORMAT!r}"))
    return arrays, head


def _difference(theirs: Any, ours: Any) -> str:
    if isinstance(theirs, dict) and isinstance(ours, dict):
        names = [name for name in {**theirs, **ours} if theirs.get(name) != ours.get(name)]
        return ", ".join(f"{name} {theirs.get(name)}, here {ours.get(name)}" for name in names)
    return "its compiled kernels differ"


def _damaged(path: Path, error: Exception) -> JointplayError:
    return JointplayError(
        f"{str(path)!r} is damaged or no checkpoint: {' '.join(str(error).split())}"
    )
