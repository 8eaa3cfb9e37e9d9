"""Texts that read ``NAME=VALUE``, as options of commands do; a name may stand in double quotes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection
from contextlib import suppress

from jointplay.base.errors import JointplayError

_KEY = re.compile(r"""(?:"(?:[^"\\]|\\.)*"|'[^']*'|[^="'])*""")
_QUOTED = re.compile(r'("(?:[^"\\]|\\.)*")(?:=(.*))?')


def divided(text: str) -> tuple[str, str | None]:
    """Key and value of ``KEY=VALUE``; what is quoted in the key may have such a sign.

    The value is None if there is no sign.
    """
    opening = _KEY.match(text)
    end = 0 if opening is None else opening.end()
    if text[end : end + 1] != "=":  # a quote that is not closed
        end = text.find("=")
    return (text[:end], text[end + 1 :]) if end >= 0 else (text, None)


def name_and_number(
    text: str, names: Collection[str] = (), is_number: Callable[[str], object] | None = None
) -> tuple[str, str | None]:
    """Name and number of ``NAME=NUMBER``; None if there is no number.

    What `is_number` is true for counts as one, too. Names may have signs of equality of their own:
    the number comes after the last one. One that would be mistaken needs quotes.
    """
    if text in names:
        return text, None
    if quoted := _QUOTED.fullmatch(text):
        with suppress(ValueError):
            return str(json.loads(quoted[1])), quoted[2]
    name, equals, value = text.rpartition("=")
    numeric = re.match(r"\s*[+-]?\.?\d", value) or (is_number is not None and is_number(value))
    return (name, value) if equals and (name in names or numeric) else (text, None)


def pair(text: str, usage: str) -> tuple[str, str]:
    """Both sides of ``NAME=VALUE``, neither empty: of the first sign that is not in quotes.

    `usage` are the option and how it must read, for the error.
    """
    name, value = divided(text)
    if not name.strip() or not (value or "").strip():
        raise misread(text, usage)
    return name.strip(), str(value).strip()


def misread(text: str, usage: str) -> JointplayError:
    """The error of an option's text that does not read as it must."""
    option, _, form = usage.partition(" ")
    return JointplayError(f"{option} must read {form}, got {text!r}")
