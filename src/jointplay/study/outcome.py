"""Outcome of one case of a sweep."""

from __future__ import annotations

from dataclasses import dataclass

NOT_RUN, DONE, FAILED = "not run", "done", "failed"
"""The states of a case."""

Index = tuple[int, ...]
"""Position of a case along each dimension of its sweep."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case: its status, measures by name, error message, and the result's file."""

    index: Index
    status: str
    values: dict[str, float]
    error: str = ""
    result: bytes | None = None
