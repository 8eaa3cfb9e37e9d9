"""Standard output and error as they are: closed, full, or in an encoding that knows no Greek."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

_MOST_NOISE = 10_000
"""Bytes of what a library prints that are kept."""


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


@contextmanager
def caught_stderr(lines: list[str]) -> Iterator[None]:
    """Put into `lines` what libraries in C++ print on standard error in the block."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # there is none
        yield
        return
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            said.seek(0)
            lines += said.read(_MOST_NOISE).decode("utf-8", "replace").splitlines()


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
    """Have what is left in a stream go nowhere: the end of the process does not complain then."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
