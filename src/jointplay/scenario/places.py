"""TOML files of users, and where in them a key stands: errors name its line."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jointplay.base.errors import JointplayError
from jointplay.base.units import not_lost

LONGEST = 5_000_000
"""Most characters of a file (judged: a motion of 100,000 rows; longer ones are CSV)."""
DEEPEST = 50
"""Most parts of a key: those of scenarios have fewer than ten, and what reads them calls itself."""
_DEEP_KEY = re.compile(
    r"(?<![\w\"'-])(?:[\w\"'-]+[ \t]*\.[ \t]*){%d}" % DEEPEST  # noqa: UP031
)
Key = tuple[str | int, ...]
_TRIED = 30
"""Lines of a statement that is open at its end after which the rest is awaited."""
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def parsed(text: str, path: Path) -> dict[str, Any]:
    """What a TOML file says.

    Raises:
        JointplayError: it is no TOML, or too much; the message has the file and the line.
    """
    if len(text) > LONGEST:
        size, most = f"{len(text) / 1e6:.3g} MB", f"{LONGEST / 1e6:g} MB"
        raise JointplayError(f"{path}: {size} of text; at most {most} are read")
    deep = _DEEP_KEY.search(text)
    if deep:
        line = text.count("\n", 0, deep.start()) + 1
        raise JointplayError(f"{path}, line {line}: a key has at most {DEEPEST} parts")
    try:
        return tomllib.loads(text, parse_float=not_lost)
    except tomllib.TOMLDecodeError as error:
        raise JointplayError(f"{path}{_syntax(str(error))}") from None
    except RecursionError:
        raise JointplayError(f"{path}: lists or tables are nested too deeply") from None
    except ValueError as error:  # a whole number of too many digits
        raise JointplayError(f"{path}: {error}") from None


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


def said_at(path: Path, known: Mapping[Key, int], place: Sequence[str | int]) -> str:
    """File, line and key of what an error is about, as its message begins."""
    line = line_of(known, place)
    words = [str(path), *([] if line is None else [f"line {line}"])]
    return ", ".join([*words, *([dotted(place)] if place else [])])


def line_of(known: Mapping[Key, int], path: Sequence[str | int]) -> int | None:
    """Line of the key at `path`, or of the nearest table above it that the file has."""
    for size in range(len(path), 0, -1):
        if tuple(path[:size]) in known:
            return known[tuple(path[:size])]
    return None


def _syntax(message: str) -> str:
    """Tomllib's message, its place in front."""
    parts = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", message)
    if parts is None:
        return f": {message}"
    what, line, column = parts.groups()
    place = f", line {line}, column {column}" if line else ", end of file"
    twice = re.match(r"Cannot (?:declare \((.*?),?\) twice|overwrite a value)", what)
    if twice:
        names = re.findall(r"'([^']*)'|\"([^\"]*)\"", twice[1] or "")
        key = dotted([a or b for a, b in names])
        what = f"{key or 'a key'} is given twice; each may have one entry"
    return f"{place}: {what}"
