"""Standard output and error as they are: closed, full, or in an encoding that knows no Greek."""

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
"""Bytes of what a library prints that are kept (judged: the first hundred lines say it)."""

_SHOWN = {
    code: repr(chr(code))[1:-1]
    for code in (*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
    if chr(code) not in "\n\t"
}
"""Characters that steer a terminal, which names in files of others can hold, and how they look."""

_BAR = re.compile(r"(\r|\x1b\[A)")
"""What bars move the cursor with."""


class _Plain:
    """A stream to which no character is written that steers a terminal."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write(text.translate(_SHOWN))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class _Output(_Plain):
    """Standard output that ends no work: files are written whether or not it can be printed on."""

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self.failure: OSError | None = None  # after which nothing is printed

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
        """Print what is left; raise what failed, unless the reader, such as `head`, went away."""
        self.flush()
        if self.failure is not None and not isinstance(self.failure, BrokenPipeError):
            raise self.failure


class _Forgiving(_Plain):
    """Standard error that nothing fails for: no run is lost because no one can be told of it."""

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
    """Within the block both streams take everything, and any character; gives standard output."""
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
        with suppress(OSError, ValueError):
            before.flush()
        if getattr(before, "buffer", None) is not None and full(before):
            silence(before)
        sys.stdout, sys.stderr = out, before


# Remarks for the user beside what a command prints are held back until it is clear that the command
# does something: an error is to be one line, with nothing before it.
_held: list[str] = []
_quiet = False


@contextmanager
def noting(quiet: bool) -> Iterator[None]:
    """Hold remarks and Python's warnings back in the block; after an error they are dropped."""
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
    """Say something to the user once, as soon as it is clear that all goes well."""
    line = one_line(text)
    if line not in _held:
        _held.append(line)


def release() -> None:
    """Say what was held back: the work begins."""
    for line in [] if _quiet else _held:
        sys.stderr.write(f"{line}\n")
    _held.clear()


_LONG_S = 2.0
"""After which it is said what takes so long (judged: sooner, it ends while one reads)."""

announced: set[str] = set()
"""What need not be said again in this process."""


@contextmanager
def saying_if_long(text: str) -> Iterator[None]:
    """Say once what is done in the block, if it takes long and the user is not to be left alone."""

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


def full(stream: Any) -> bool:
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
    """Have the standard descriptors lead somewhere: else the next file opened would be one."""
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
    """Have what is left in a stream go nowhere: the end of the process does not complain then."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
