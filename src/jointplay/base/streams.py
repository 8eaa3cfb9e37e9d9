"""Standard output and error, robust when they are closed, full, or limited to ASCII."""

import os
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from jointplay.base.errors import one_line

_MOST_NOISE = 10_000
"""Most bytes of a library's output that are kept (judged: the first hundred lines suffice)."""

_SHOWN = {
    code: repr(chr(code))[1:-1]
    for code in (*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
    if chr(code) not in "\n\t"
}
"""Control characters of terminals, which names in untrusted files can hold, and their escapes."""

_BAR = re.compile(r"(\r|\x1b\[A)")
"""Cursor movements of progress bars."""


class _Plain:
    """A stream in which control characters of terminals are escaped."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write(text.translate(_SHOWN))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class _Output(_Plain):
    """Standard output whose failure ends no work: files are written even if printing fails."""

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self.failure: OSError | None = None  # the first one, after which nothing is printed

    def write(self, text: str) -> int:
        self._attempt(lambda: self._stream.write(text.translate(_SHOWN)))
        return len(text)

    def flush(self) -> None:
        self._attempt(self._stream.flush)

    def _attempt(self, act: Callable[[], Any]) -> None:
        if self.failure is None:
            try:
                act()
            except OSError as failure:
                self.failure = failure
                silence(self._stream)

    def finish(self) -> None:
        """Flush, then raise the failure, unless the reader (such as `head`) has just gone away."""
        self.flush()
        if self.failure is not None and not isinstance(self.failure, BrokenPipeError):
            raise self.failure


class _Forgiving(_Plain):
    """Standard error whose failures are ignored: no run is lost because a message is."""

    def write(self, text: str) -> int:
        parts = _BAR.split(text)
        parts[::2] = [part.translate(_SHOWN) for part in parts[::2]]
        with suppress(OSError, ValueError):
            self._stream.write("".join(parts))
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self._stream.flush()


@contextmanager
def forgiving() -> Iterator[_Output]:
    """Make both streams robust within the block: they take any character; yields the output."""
    _open()
    out, before = sys.stdout, sys.stderr
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    output = _Output(out)
    sys.stdout = output  # type: ignore[assignment]
    sys.stderr = _Forgiving(before)  # type: ignore[assignment]
    try:
        yield output
    finally:
        output.flush()
        try:
            before.flush()
        except (OSError, ValueError):
            if getattr(before, "buffer", None) is not None:
                silence(before)
        sys.stdout, sys.stderr = out, before


# Notes to the user beside a command's output are held back until the command begins its work: an
# error is to be one line, with nothing before it.
_held: list[str] = []
_quiet = False


@contextmanager
def noting(quiet: bool) -> Iterator[None]:
    """Hold back notes and Python's warnings in the block; an error drops them."""
    global _held, _quiet
    outer = _held, _quiet
    _held, _quiet = [], quiet
    try:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: note(f"note: {message}")
            yield
        release()
    finally:
        _held, _quiet = outer


def note(text: object) -> None:
    """Print a note once, when notes are released."""
    line = one_line(text)
    if line not in _held:
        _held.append(line)


def release() -> None:
    """Print the notes held back, as the work begins."""
    for line in [] if _quiet else _held:
        sys.stderr.write(f"{line}\n")
    _held.clear()


_LONG_S = 2.0
"""Time after which the user is told what takes so long [s] (judged: sooner, it ends while one
reads)."""

announced: set[str] = set()
"""Texts that need not be printed (again) by this process."""


@contextmanager
def saying_if_long(text: str) -> Iterator[None]:
    """Print a text once if the block takes long, unless the user asked for quiet."""

    def say() -> None:
        if text not in announced and not _quiet:
            announced.add(text)
            sys.stderr.write(f"{text}\n")
            sys.stderr.flush()

    timer = threading.Timer(_LONG_S, say)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def caught_stderr(lines: list[str]) -> Iterator[None]:
    """Append to `lines` what C++ libraries print on standard error in the block."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.flush()
    try:
        saved = os.dup(2)
    except OSError:  # there is none
        yield
        return
    with tempfile.TemporaryFile() as output:
        os.dup2(output.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            output.seek(0)
            lines += output.read(_MOST_NOISE).decode("utf-8", "replace").splitlines()


def _open() -> None:
    """Open standard descriptors that are closed: else the next file opened would become one."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened == number:
                os.set_inheritable(number, True)
            else:
                os.dup2(opened, number)
                os.close(opened)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, closefd=False))


def silence(stream: Any) -> None:
    """Redirect a stream to nowhere, so that flushing it at the end of the process does not fail."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
