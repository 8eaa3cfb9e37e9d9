"""Progress bars, drawn by tqdm.

In a terminal there is a bar, elsewhere now and then a line. Several runs, those of other processes
included, can move one bar. One-time work such as compiling counts neither in the speed nor in the
time left.
"""

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager, suppress
from functools import cache
from threading import RLock
from typing import Any, NamedTuple, Self, TypeVar

Item = TypeVar("Item")

LINE_EVERY_S = 10.0
"""Interval between lines where there is no terminal [s]; the environment's `JOINTPLAY_PROGRESS_S`
replaces it."""

_DRAWN_EVERY_S = 0.2
"""Least interval between drawings of a bar [s] (judged: faster cannot be read)."""

_OF_TOTAL = (
    "{desc}{percentage:3.0f}%|{bar}| {n:.10g}/{total:.10g} {unit}{postfix}, {remaining} left"
)
_COUNT = "{desc}{n:.10g} {unit}{postfix}, {elapsed} gone"
_SIMULATED = _OF_TOTAL.replace(":.10g", ":.3f").replace("{unit}", "s simulated")
_IN_ALL = _SIMULATED.replace("s simulated", "s simulated in all runs")

_aside_s = 0.0
"""Time spent within `aside` so far [s]."""


@contextmanager
def aside() -> Iterator[None]:
    """Within the block time stands still for bars: for one-time work such as compiling."""
    global _aside_s
    began, before = time.time(), _aside_s
    try:
        yield
    finally:
        _aside_s = before + time.time() - began


class _Output:
    """Standard error for bars: whole lines if it is no terminal, and failures are ignored."""

    def __init__(self, file: Any) -> None:
        self._file, self._last, self.terminal = file, "", False
        with suppress(AttributeError, ValueError):  # there is none, or it is closed
            self.terminal = bool(file.isatty())

    def write(self, text: str) -> None:
        if not self.terminal:
            text = text.strip()
            if text in ("", self._last):
                return
            self._last, text = text, f"{text}\n"
        with suppress(OSError, ValueError, AttributeError):  # closed, full, or none
            self._file.write(text)
            self._file.flush()

    def flush(self) -> None:
        """Do nothing: `write` flushes."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@cache
def _tqdm() -> Any:
    from tqdm import tqdm  # not needed by commands that are refused

    class Bar(tqdm):
        """A bar without tqdm's monitoring thread and process lock: only this process draws."""

        monitor_interval = 0

        def __str__(self) -> str:
            return str(super().__str__()).replace(", ? left", "")  # until something is done

    Bar.set_lock(RLock())
    return Bar


class ProgressBar:
    """A bar on standard error if that is a terminal; else a line every `LINE_EVERY_S`.

    Args:
        items: items to iterate over, each of which moves the bar by one; `update` moves it, too.
        desc: text before the bar.
        total: amount of work, if it is known; by default the number of items.
        disable: whether nothing is shown.
        delay: time for which nothing is shown at first [s].
        layout: tqdm's format of the bar, for a known total.
        shown: further arguments of tqdm: `unit`, `initial`, `leave`.
    """

    postfix = ""

    def __init__(
        self, items: Iterable[Any] = (), desc: str = "", *, total: float | None = None,
        disable: bool = False, delay: float = 0.0, layout: str = _OF_TOTAL, **shown: Any,
    ) -> None:  # fmt: skip
        self.items, self.n = items, shown.get("initial", 0.0)
        self.total = total or (len(items) if isinstance(items, Sized) else 0)
        self._aside, self._moved, self._bar = _aside_s, False, None
        if disable or isinstance(_overall, Elsewhere):
            return
        output, interval = _Output(sys.stderr), _DRAWN_EVERY_S
        layout = layout if self.total else _COUNT
        if not output.terminal:
            layout, interval = layout.replace("%|{bar}|", "%,"), LINE_EVERY_S
            with suppress(KeyError, ValueError):
                interval = float(os.environ["JOINTPLAY_PROGRESS_S"])
            delay = max(delay, interval, sys.float_info.min)  # 0: a line at the start
        self._bar = _tqdm()(
            desc=f"{desc.strip()} ".lstrip(), total=self.total or None, delay=delay, file=output,
            mininterval=interval, miniters=0, smoothing=0, bar_format=layout, dynamic_ncols=True,
            ascii=" #", position=0, **shown,
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Any]:
        with self:
            yield from self.passed(self.items)

    def passed(self, items: Iterable[Item], weight: float = 1) -> Iterator[Item]:
        """Yield further items; the bar moves by `weight` after each."""
        for item in items:
            yield item
            self.update(weight)

    def update(self, more: float = 1) -> None:
        """Move the bar."""
        self.n += more
        if (bar := self._bar) is None:
            return
        gone, self._aside = _aside_s - self._aside, _aside_s
        bar.start_t, bar.last_print_t = bar.start_t + gone, bar.last_print_t + gone
        # Beyond its total tqdm would drop it, which the layout needs.
        bar.total = max(self.total, self.n) if self.total else None
        bar.postfix = self.postfix
        if more and not self._moved:  # the clock starts here: before, kernels were loaded
            self._moved, bar.initial = True, self.n
            bar.unpause()
        bar.update(more)

    def refresh(self) -> None:
        if self._bar is not None:
            self._bar.refresh()

    def clear(self) -> None:
        if self._bar is not None:
            self._bar.clear()

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


class Simulated(ProgressBar):
    """Progress bar of a run by simulated time [s], with its speed relative to real time.

    Within `overall` it adds to the one bar of all runs instead.
    """

    def __init__(
        self, total: float, show: bool = True, desc: str = "", begin: float = 0.0,
        layout: str = _SIMULATED,
    ) -> None:  # fmt: skip
        self._overall = _overall if show else None
        shown = show and self._overall is None
        super().__init__(desc=desc, total=total, initial=begin, disable=not shown, layout=layout)
        self._text, self._reached = "", begin
        if self._overall is not None:
            self._overall.say(desc.strip())

    def reach(self, now: float) -> None:
        """Move the bar to the simulated time `now` [s]."""
        if now - now == 0.0:  # finite
            self.update(now - self._reached)
            self._reached = now

    def update(self, more: float = 0.0) -> None:
        """Move the bar by simulated time [s]."""
        if self._overall is not None:
            self._overall.update(more)
            return
        more = max(more, 0.0)
        self.total = max(self.total, self.n + more)
        speed = ""
        if self._bar is not None and self._moved:
            gone = self._bar.format_dict["elapsed"] - (_aside_s - self._aside)
            speed = f"{(self.n + more - self._bar.initial) / max(gone, 1e-9):.2f} x real time"
        self.postfix = ", ".join(filter(None, (self._text, speed)))
        super().update(more)

    def say(self, text: str) -> None:
        self._text = text


class Moved(NamedTuple):
    """Message from a worker that moves the overall bar of its parent."""

    more: float
    text: str

    def show(self) -> None:
        if _overall is not None:
            _overall.say(self.text)
            _overall.update(self.more)


class Elsewhere:
    """Stand-in for the overall bar in a worker: sends the progress of its runs to the parent."""

    def __init__(self, tell: Callable[[Moved], None] | None) -> None:
        self._tell, self._more, self._text, self._sent_at = tell, 0.0, "", 0.0

    def say(self, text: str) -> None:
        self._text = text

    def update(self, more: float = 0.0) -> None:
        self._more += more
        if time.monotonic() - self._sent_at > _DRAWN_EVERY_S:
            self.tell()

    def tell(self) -> None:
        if self._tell is not None and (self._more or self._text):
            with suppress(OSError):  # the other process has ended
                self._tell(Moved(self._more, self._text))
        self._more, self._sent_at = 0.0, time.monotonic()

    def clear(self) -> None:
        pass


_overall: Simulated | Elsewhere | None = None


def current() -> Simulated | Elsewhere | None:
    """Overall bar, within `overall`."""
    return _overall


def tell_elsewhere(tell: Callable[[Moved], None] | None) -> Elsewhere:
    """Make this process send its progress by `tell` to the one that has the overall bar."""
    global _overall
    _overall = Elsewhere(tell)
    return _overall


@contextmanager
def overall(total: float, show: bool) -> Iterator[None]:
    """Within the block one bar stands for all runs, whose simulated times add up to `total` [s]."""
    global _overall
    if not show or _overall is not None:
        yield
        return
    _overall = Simulated(total, layout=_IN_ALL)
    try:
        yield
    finally:
        bar, _overall = _overall, None
        bar.close()


@contextmanager
def printing() -> Iterator[None]:
    """Clear the bar for text that is printed in the block."""
    if _overall is not None:
        _overall.clear()
    yield
    sys.stdout.flush()
