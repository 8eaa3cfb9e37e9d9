"""Standard output and error as they are: closed, full, or in an encoding that knows no Greek."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any


class _Forgiving:
    """Standard error that nothing fails for: no run is lost because no one can be told of it."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def forgiving() -> Iterator[None]:
    """Within the block standard error takes everything, and both streams any character."""
    _open()
    before = sys.stderr
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    sys.stderr = _Forgiving(before)  # type: ignore[assignment]
    try:
        yield
    finally:
        with suppress(OSError, ValueError):
            before.flush()
        if getattr(before, "buffer", None) is not None and _full(before):
            silence(before)
        sys.stderr = before


def _full(stream: Any) -> bool:
    """Whether what is left in the stream cannot be written."""
    try:
        stream.flush()
    except (OSError, ValueError):
        return True
    return False


def _open() -> None:
    """Have the standard descriptors lead somewhere: else the next file opened would be one."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, closefd=False))


def silence(stream: Any) -> None:
    """Have what is left in a stream go nowhere, so that the end of the process does not complain."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
