"""The list of robots: their joints, and what is not as it should be.

Each robot is loaded for it, which takes seconds for all: the list is kept in the user's cache until
a robot's file, this package or Pinocchio changes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.model import robots

_PACKAGE = Path(__file__).parents[1]


def listed(names: Iterable[str]) -> str:
    """Text on the robots with these names: arms, then others; see `Survey.brief`."""
    places = [robots.with_package(name) for name in names]
    kept = files.cache_folder() / "robots.txt"
    state = _state([robots.source_of(place).path for place in places])
    with suppress(OSError, ValueError):  # no list there, or a damaged one
        seal, _, text = files.read_plain(kept, files.MOST_TEXT).decode().partition("\n")
        if seal == _seal(state, text):
            return text
    text = _listed(places)
    with suppress(OSError, RuntimeError, JointplayError):  # the cache cannot be written
        kept.parent.mkdir(parents=True, exist_ok=True)
        files.write(kept, f"{_seal(state, text)}\n{text}", overwrite=True, announced=False)
    return text


def _listed(places: Iterable[str]) -> str:
    from jointplay.model.survey import survey  # takes long to import

    surveys = [survey(place) for place in places]
    return "\n".join([
        "ARMS (revolute joints on one path)",
        *(robot.brief for robot in surveys if robot.serial),
        "OTHERS (the base is held fast, unless it is run with --base free)",
        *(robot.brief for robot in surveys if not robot.serial),
    ])  # fmt: skip


def _state(paths: Iterable[Path]) -> str:
    """Size and time of all files on which the list depends."""
    pinocchio = find_spec("pinocchio")
    libraries = [Path(pinocchio.origin)] if pinocchio and pinocchio.origin else []
    sources = [*paths, *sorted(_PACKAGE.rglob("*.py")), *libraries]
    looked = [(str(path), path.stat()) for path in sources]
    return repr([(path, status.st_size, status.st_mtime_ns) for path, status in looked])


def _seal(state: str, text: str) -> str:
    """Checksum of a list and of the state of the files it was made from."""
    return hashlib.sha256(f"{state}\n{text}".encode()).hexdigest()
