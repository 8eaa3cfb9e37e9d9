"""A run on disk, to be continued bit for bit in another process.

The file holds numbers and the simulation as plain data: no code. It is read by the version that
wrote it, for another may step otherwise.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Collection
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

FORMAT = "jointplay checkpoint 1"
_STATISTICS = "unjudged."


def save(run: Run, path: Path) -> Path:
    """See `Run.checkpoint`."""
    arrays = run.workspace.snapshot()
    memory = run.memory()
    for name, values in (memory.pop("unjudged") or {}).items():
        arrays[_STATISTICS + name] = values
    head = {
        "format": FORMAT,
        "simulation": run.simulation.describe(),
        "versions": versions(),
        "kernels": fingerprint(),
        "memory": memory,
    }
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    out = io.BytesIO()
    np.savez(out, **arrays)  # type: ignore[arg-type]
    return files.write(path, out.getvalue(), overwrite=True)


def resume(path: Path, trust: Collection[str]) -> Run:
    """See `Simulation.resume`."""
    from jointplay.simulation.simulation import Simulation

    arrays, head = _read(path)
    now = {"versions": versions(), "kernels": fingerprint()}
    for what, value in now.items():
        if head.get(what) != value:
            raise JointplayError(
                f"{str(path)!r} was written by another version "
                f"({_difference(head.get(what), value)}), which may step otherwise; continue it "
                "with that one"
            )
    try:
        with trusting(trust):
            run = Simulation.from_description(head["simulation"]).prepare()
        unjudged = {
            name.removeprefix(_STATISTICS): values
            for name, values in arrays.items()
            if name.startswith(_STATISTICS)
        }
        run.workspace.restore(arrays)
        run.recall(head["memory"] | {"unjudged": unjudged or None})
    except JointplayError as error:
        raise JointplayError(f"{str(path)!r} cannot be continued: {error}") from None
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise _damaged(path, error) from None
    return run


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
