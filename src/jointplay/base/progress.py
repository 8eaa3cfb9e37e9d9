"""Progress of what takes longer than a moment: a bar in a terminal, at times a line in a file."""

import os
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager, suppress
from datetime import timedelta
from typing import Any, NamedTuple, Self

LINE_EVERY_S = 10.0
"""Interval at which progress is said where there is no terminal [s]; `JOINTPLAY_PROGRESS_S` of the
environment replaces it."""

_DRAWN_EVERY_S = 0.2
"""Interval at which a bar is drawn at most [s]."""

_EARLY_S, _EARLY = 60.0, 0.02
"""How long [s], and up to which part of the work, nothing is said of the time that is left."""

_OF_TOTAL = "{desc} {part:4.0%}|{bar}| {n:.10g}/{total:.10g} {unit}{postfix}, {left} left"
_COUNT = "{desc} {n:.10g} {unit}{postfix}, {gone} gone"
_SIMULATED = "{desc} {part:4.0%}|{bar}| {n:.3f}/{total:.3f} s simulated{postfix}, {left} left"
_IN_ALL = _SIMULATED.replace("s simulated", "s simulated in all runs")


_aside_s = 0.0
"""What `aside` took so far [s]."""


@contextmanager
def aside() -> Iterator[None]:
    """Within the block time stands still for bars: it comes once, as to compile, and would be
    reckoned into every speed and into the time that is left.
    """
    global _aside_s
    began, before = time.perf_counter(), _aside_s
    try:
        yield
    finally:
        _aside_s = before + time.perf_counter() - began


class ProgressBar:
    """A bar on standard error if that is a terminal; else a line each `LINE_EVERY_S`.

    Args:
        items: that are gone through, each of which moves the bar by one; `update` moves it, too.
        desc: what is being done.
        total: how much there is to do, if it is known; by default the number of items.
        unit: what is counted.
        initial: how much has been done before.
        delay: time for which nothing is shown [s].
        leave: whether the bar stays when all is done.
    """

    def __init__(
        self,
        items: Iterable[Any] = (),
        desc: str = "",
        *,
        total: float | None = None,
        unit: str = "it",
        disable: bool = False,
        initial: float = 0.0,
        delay: float = 0.0,
        leave: bool = True,
        layout: str = _OF_TOTAL,
        file: Any = None,
    ) -> None:
        self.items, self.desc, self.unit, self.n = items, desc, unit, initial
        self.total = total or (len(items) if isinstance(items, Sized) else 0)
        self.disable, self.postfix = disable or isinstance(_whole, Elsewhere), ""
        self._leave, self._layout = leave, layout if self.total else _COUNT
        self._file = sys.stderr if file is None else file
        self._drawn, self._every = _is_terminal(self._file), _DRAWN_EVERY_S
        if not self._drawn:
            self._layout, self._every = self._layout.replace("%}|{bar}|", "%},"), LINE_EVERY_S
            with suppress(KeyError, ValueError):
                self._every = float(os.environ["JOINTPLAY_PROGRESS_S"])
            delay = max(delay, self._every)
        self._start = self._clock()
        self._next = self._start + delay
        self._first: tuple[float, float] | None = None  # before, kernels are loaded
        self._said, self._shown = "", False

    @staticmethod
    def _clock() -> float:
        return time.perf_counter() - _aside_s

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Any]:
        with self:
            for one in self.items:
                yield one
                self.update()

    def update(self, more: float = 1) -> None:
        self.n += more
        if not self.disable and self._clock() >= self._next:
            self.refresh()
        if self._first is None and more:
            self._first = self._clock(), self.n

    def refresh(self) -> None:
        text = "" if self.disable else self._text()
        self._next = self._clock() + self._every
        if text != self._said:
            self._write(f"\r{text:<{len(self._said)}}" if self._drawn else f"{text}\n")
            self._said, self._shown = text, True

    def close(self) -> None:
        """End it; a bar stays as it is, and of lines there is a last one if there was any."""
        if self._shown and not self._leave:
            self.clear()
        elif self._shown:  # again if text was printed since
            self.refresh()
            self._write("\n" if self._drawn else "")
        self.disable, self._said, self._shown = True, "", False

    def clear(self) -> None:
        if self._drawn and self._said:
            self._write(f"\r{' ' * len(self._said)}\r")
            self._said = ""

    def _write(self, text: str) -> None:
        with suppress(OSError, ValueError, AttributeError):  # closed, full, or none
            self._file.write(text)
            self._file.flush()

    def _text(self) -> str:
        now, part = self._clock(), min(self.n / self.total, 1.0) if self.total else 0.0
        since, done = self._first or (now, self.n)
        left = "?"
        if self.n > done and now > since and (now - self._start > _EARLY_S or part > _EARLY):
            left = _words((self.total - self.n) * (now - since) / (self.n - done))
        postfix = f", {self.postfix}" if self.postfix else ""
        about = vars(self) | {"part": part, "postfix": postfix, "left": left, "bar": ""}
        about["gone"] = _words(now - self._start)
        plain = self._layout.format(**about).strip()
        if not self._drawn:
            return plain
        room = shutil.get_terminal_size().columns - 1
        width = max(room - len(plain), 0)
        about["bar"] = f"{'#' * round(width * part):<{width}}"
        return self._layout.format(**about).strip()[:room]


def _is_terminal(stream: Any) -> bool:
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):  # none at all, or closed
        return False


def _words(seconds: float) -> str:
    return str(timedelta(seconds=round(max(seconds, 0.0))))


class Simulated(ProgressBar):
    """Progress by simulated time [s]: its speed relative to real time, and the time left.

    Within `whole`, one bar is for all runs, and those that begin there add to it.
    """

    def __init__(
        self,
        total: float,
        show: bool = True,
        desc: str = "",
        begin: float = 0.0,
        layout: str = _SIMULATED,
    ) -> None:
        self._whole = _whole if show else None
        shown = show and self._whole is None
        super().__init__(desc=desc, total=total, initial=begin, disable=not shown, layout=layout)
        self._words, self._reached = "", begin
        if self._whole is not None:
            self._whole.say(desc.strip())

    def reach(self, now: float) -> None:
        """The run has got to the time `now` [s]."""
        if now - now == 0.0:  # it is finite
            self.update(now - self._reached)
            self._reached = now

    def update(self, more: float = 0.0) -> None:
        """So much more has been simulated [s]."""
        if self._whole is not None:
            self._whole.update(more)
            return
        self.total = max(self.total, self.n + more)
        self.postfix = self._words.removesuffix(", ")
        if self._first is not None:
            since, done = self._first
            speed = (self.n + more - done) / max(self._clock() - since, 1e-9)
            self.postfix = f"{self._words}{speed:.2f} x real time"
        super().update(max(more, 0.0))

    def say(self, words: str) -> None:
        self._words = f"{words}, " if words else ""


class Moved(NamedTuple):
    """What moves the bar of the whole in another process."""

    more: float
    words: str

    def show(self) -> None:
        if _whole is not None:
            _whole.say(self.words)
            _whole.update(self.more)


class Elsewhere:
    """The bar of the whole, which another process has: it is told at times how far runs are."""

    def __init__(self, tell: Callable[[Moved], None] | None) -> None:
        self._tell, self._more, self._words, self._told = tell, 0.0, "", 0.0

    def say(self, words: str) -> None:
        self._words = words

    def update(self, more: float = 0.0) -> None:
        self._more += more
        if time.monotonic() - self._told > _DRAWN_EVERY_S:
            self.tell()

    def tell(self) -> None:
        if self._tell is not None and (self._more or self._words):
            with suppress(OSError):  # the other process has ended
                self._tell(Moved(self._more, self._words))
        self._more, self._told = 0.0, time.monotonic()

    def clear(self) -> None:
        pass


_whole: Simulated | Elsewhere | None = None


def current() -> Simulated | Elsewhere | None:
    """The bar of the whole, within `whole`."""
    return _whole


def tell_elsewhere(tell: Callable[[Moved], None] | None) -> Elsewhere:
    """From now on the bar of the whole is that of another process, which is told of it."""
    global _whole
    _whole = Elsewhere(tell)
    return _whole


@contextmanager
def whole(total: float, show: bool) -> Iterator[None]:
    """Within the block one bar is for all runs; `total` is what they simulate together [s]."""
    global _whole
    if not show or _whole is not None:
        yield
        return
    _whole = Simulated(total, layout=_IN_ALL)
    try:
        yield
    finally:
        bar, _whole = _whole, None
        bar.close()


@contextmanager
def printing() -> Iterator[None]:
    """Within the block text can be printed while bars are shown."""
    if _whole is not None:
        _whole.clear()
    yield
    sys.stdout.flush()
