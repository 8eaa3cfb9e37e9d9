"""Bridges to other programs: results as tables and bags, mechanisms for simulators and firmware.

Each kind of result file is an `ExportKind` with one function that turns a result into bytes;
`export` chooses the kind, thins the records, and writes the file whole or not at all. Libraries
that only one kind needs are extras, imported when that kind is written. Writers of results compute
nothing; what a simulator gets is fitted in `reduction`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_a, require_known
from jointplay.base.schema import known_keywords

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result

Maker = Callable[..., bytes]
"""Function of a result, the file's suffix, and whether to show progress: returns the content."""


@dataclass(frozen=True)
class ExportKind:
    """A kind of file to which results are written."""

    maker: str
    """Its `Maker`, as ``module:function``."""
    suffixes: tuple[str, ...]
    about: str
    """What it holds, for help texts."""


EXPORT_KINDS = {
    "csv": ExportKind("table:csv", (".csv",), "all histories as a table, one row a record"),
    "parquet": ExportKind("table:parquet", (".parquet",), "the same table, typed and compressed"),
    "mat": ExportKind("table:mat", (".mat",), "the same table for MATLAB and Octave"),
    "trajectory": ExportKind(
        "trajectory:trajectory",
        (".yaml", ".yml", ".csv"),
        "joint positions: ROS 2 JointTrajectory (YAML), or a CSV that is a motion",
    ),
    "mcap": ExportKind("bag:mcap", (".mcap",), "ROS 2 bag: joint states, trajectory, tool, forces"),
}


@known_keywords
def export(
    result: Result,
    path: str | Path,
    to: str | None = None,
    *,
    every: int = 1,
    overwrite: bool = False,
    progress: bool = False,
) -> Path:
    """Write a result for other programs; returns the file's path.

    Args:
        path: the file; its ending must be one of the kind's.
        to: one of `EXPORT_KINDS`; None: by the file's ending (.csv is the table).
        every: write only each n-th record and the last; peaks still cover what lies between.

    Raises:
        JointplayError: no such kind, a wrong ending, the file exists or cannot be written, or a
            library of an extra is missing.
    """
    require_a("result", result, "Result")
    kind = check(path, to, overwrite)
    module, _, name = EXPORT_KINDS[kind].maker.partition(":")
    maker: Maker = getattr(import_module(f"jointplay.bridges.{module}"), name)
    content = maker(result.thinned(every), Path(path).suffix.lower(), progress)
    return files.write(path, content, overwrite=overwrite)


def check(path: str | Path, to: str | None = None, overwrite: bool = False) -> str:
    """Kind of file that `path` will be; raises an error, before any work, if it cannot be written.

    Arguments and errors are those of `export`.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if to is None:
        to = next((name for name, kind in EXPORT_KINDS.items() if suffix in kind.suffixes), None)
        if to is None:
            endings = dict.fromkeys(s for kind in EXPORT_KINDS.values() for s in kind.suffixes)
            raise JointplayError(
                f"the name of the file must end in one of {', '.join(endings)}, got {path.name!r}"
            )
    require_known("kind of export", to, EXPORT_KINDS)
    if suffix not in EXPORT_KINDS[to].suffixes:
        choices = " or ".join(EXPORT_KINDS[to].suffixes)
        raise JointplayError(f"the name of a {to} file must end in {choices}, got {path.name!r}")
    if not overwrite:
        files.check_new(path)
    return to


def in_blocks(number: int, size: int, label: str, progress: bool) -> Iterator[slice]:
    """Yield slices of `size` records that cover `number` of them, with a progress bar."""
    from jointplay.base.progress import ProgressBar

    with ProgressBar(desc=label, total=number, disable=not progress, unit="record") as bar:
        for first in range(0, max(number, 1), size):
            yield slice(first, first + size)
            bar.update(min(size, number - first))
