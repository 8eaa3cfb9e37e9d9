"""What builders of scenarios share: laws beside the file, units of a joint's values."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jointplay.codec import Draft
from jointplay.contact.trust import trusting
from jointplay.errors import JointplayError, MissingName
from jointplay.host.files import is_file
from jointplay.joints import VIRTUAL_LINK
from jointplay.mechanism.mechanism import Mechanism
from jointplay.units import WORDS, Measured, expected, shown


def drafts(table: Any) -> dict[str, Draft]:
    """Objects that the file describes, checked but not yet made, by name."""
    drafts: dict[str, Draft] = dict(table)
    return drafts


@contextmanager
def beside(folder: Path, function: str) -> Iterator[None]:
    """Let a law of the user's own be found beside the scenario that names it."""
    module = function.partition(":")[0].partition(".")[0]
    own = folder / f"{module}.py", folder / module / "__init__.py"
    if not module.isidentifier() or not any(is_file(path) for path in own):
        yield
        return
    place = str(folder.resolve())
    sys.path.insert(0, place)
    try:
        with trusting({module}):
            yield
    finally:
        sys.path.remove(place)


def fit(
    mechanism: Mechanism,
    joint: str,
    value: float,
    units: tuple[str, str],
    path: tuple[str | int, ...],
) -> float:
    """`value` as float, if its unit is one for this joint: units are (revolute's, prismatic's)."""
    kind = f"a {path[0]} of a journal"
    if joint in mechanism.joints:
        entry = mechanism.description.joints[joint]
        kind, unit = entry.kind, units[entry.slides]
    elif path[0] in ("start", "start_speed") and joint in mechanism.coordinates:
        unit = units[joint.rpartition(".")[2] in VIRTUAL_LINK[:3]]
    else:
        raise MissingName("moving joint", joint, mechanism.joints, where=path)
    if isinstance(value, Measured) and value.unit not in ("", unit):
        raise JointplayError(
            f"{shown(value.text)} is no {WORDS[unit][0]}, but joint {joint!r} is {kind}; "
            f"expected {expected(unit)}",
            where=path,
        )
    return float(value)
