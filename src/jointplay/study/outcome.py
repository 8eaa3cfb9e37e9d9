"""What a case of a sweep gave."""

from __future__ import annotations

from dataclasses import dataclass

NOT_RUN, DONE, FAILED = "not run", "done", "failed"
"""What a case's status can be."""

Index = tuple[int, ...]
"""Where a case is along each dimension of its sweep."""


@dataclass(frozen=True)
class Outcome:
    """What a case gave: its status, measures by name, an error, its result as a file has it."""

    index: Index
    status: str
    values: dict[str, float]
    error: str = ""
    result: bytes | None = None
