"""`jointplay run --resume`: which runs in a folder are finished, and going on with the others."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.errors import JointplayError
from jointplay.host.files import refuse_present
from jointplay.simulation.unfinished import beside

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Run


def records(path: Path, certified: bool) -> Path | None:
    """Where the records of a run go whose result is `path`; certified, they stay in memory."""
    return None if certified else beside(path)[0]


def refuse_interrupted(out: Path, files: Mapping[str, str]) -> None:
    """Refuse a folder with an interrupted run, which would be lost.

    Raises:
        JointplayError: there is one.
    """
    for name in files.values():
        kept = beside(out / name)[1]
        if kept.exists():
            raise JointplayError(
                f"{str(out)!r} holds an interrupted run ({kept.name}); --resume goes on with it, "
                "or name another folder"
            )


def refuse(out: Path, files: Mapping[str, str], drawn: Iterable[str] = ()) -> None:
    """Refuse a folder that holds results of a run, or an interrupted one of it.

    Args:
        out: the folder.
        files: names of the results by case.
        drawn: names of the figures.

    Raises:
        JointplayError: there is one; of an interrupted run it says how to go on.
    """
    try:
        refuse_present(out, [*files.values(), *drawn])
    except JointplayError:
        refuse_interrupted(out, files)
        raise


def finished(out: Path, files: Mapping[str, str], given: Mapping[str, Any]) -> list[str]:
    """Cases whose results are there and whole.

    Args:
        out: the folder.
        files: their names by case.
        given: the simulations as they are now, as plain data, by case.

    Raises:
        JointplayError: a result is of another simulation, or was interrupted and left no
            checkpoint.
    """
    from jointplay.kernel import Status
    from jointplay.result.result import Result
    from jointplay.simulation.checkpoint import differing

    cases = []
    for case, name in files.items():
        path = out / name
        if beside(path)[1].exists() or not path.exists():
            continue
        result = Result.open(path)
        with result.dataset as dataset:
            was = json.loads(dataset.attrs["simulation"])
        now = json.loads(json.dumps(given[case]))
        if was != now:
            raise JointplayError(
                f"{str(path)!r} is of another run: {differing(was, now)}; name another folder, or "
                "change it back"
            )
        if result.status == Status.INTERRUPTED:
            raise JointplayError(
                f"{str(path)!r} was interrupted and has no checkpoint; delete it to begin anew, or "
                "name another folder"
            )
        cases.append(case)
    return cases


def go_on(run: Run, path: Path) -> bool:
    """Bring a run to its checkpoint, if there is one; returns whether there is."""
    kept = beside(path)[1]
    if not kept.exists():
        return False
    from jointplay.simulation.checkpoint import continue_run

    continue_run(run, kept)
    return True
