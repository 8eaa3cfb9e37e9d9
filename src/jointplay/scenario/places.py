"""Where in a TOML file a key stands: errors name its line."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Sequence
from typing import Any

Key = tuple[str | int, ...]
_TRIED = 30
"""Lines of a statement that is open at its end after which the rest is awaited."""
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def dotted(path: Sequence[str | int]) -> str:
    """A key's path as TOML writes it, elements of lists in brackets from 1."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            shown = part if _BARE.fullmatch(part) else json.dumps(part, ensure_ascii=False)
            text += f".{shown}" if text else shown
    return text


def lines(text: str) -> dict[Key, int]:
    """Line at which each key of a well-formed TOML text stands, tables at their header."""
    known: dict[Key, int] = {}
    counts: dict[Key, int] = {}
    table: Key = ()
    chunk: list[str] = []
    opened = 0
    for number, line in enumerate(text.splitlines(), 1):
        chunk.append(line)
        # Brackets may stand in text, so this is a guess; to try each line of a long list is slow.
        opened += sum(line.count(c) for c in "[{") - sum(line.count(c) for c in "]}")
        if opened > 0 and len(chunk) > _TRIED:
            continue
        try:  # a statement may go on over several lines
            parsed = tomllib.loads("\n".join(chunk))
        except tomllib.TOMLDecodeError:
            continue
        start = number - len(chunk) + 1
        header = chunk[0].lstrip().startswith("[")
        chunk, opened = [], 0
        if header:
            table = _header(parsed, counts)
            _note(known, table, start)
        else:
            for path in _paths(parsed):
                _note(known, (*table, *path), start)
    return known


def _note(known: dict[Key, int], path: Key, line: int) -> None:
    for size in range(1, len(path) + 1):
        known.setdefault(path[:size], line)


def _header(parsed: Any, counts: dict[Key, int]) -> Key:
    """Path that ``[a.b]`` or ``[[a.b]]`` opens, with indices of arrays of tables."""
    path: Key = ()
    while parsed:
        if isinstance(parsed, list):  # [[...]]: a new element
            counts[path] = counts.get(path, -1) + 1
            return (*path, counts[path])
        ((key, parsed),) = parsed.items()
        path = (*path, key)
        if isinstance(parsed, dict) and path in counts:  # a table within the last element
            path = (*path, counts[path])
    return path


def _paths(parsed: Any) -> list[Key]:
    if isinstance(parsed, dict):
        items: Any = parsed.items()
    elif isinstance(parsed, list):
        items = enumerate(parsed)
    else:
        return [()]
    return [()] + [(key, *rest) for key, value in items for rest in _paths(value)]


def line_of(known: dict[Key, int], path: Sequence[str | int]) -> int | None:
    """Line of the key at `path`, or of the nearest table above it that the file has."""
    for size in range(len(path), 0, -1):
        if tuple(path[:size]) in known:
            return known[tuple(path[:size])]
    return None
