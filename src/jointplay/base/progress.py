"""Progress of what takes longer than a moment: a bar in a terminal, now and then a line in a file.

Nothing of tqdm is made where nothing is shown: its bars share a lock between processes, and one
that was killed while it held the lock would never give it back.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm

LINE_EVERY_S = 10.0
"""Interval at which progress is said where there is no terminal [s]; `JOINTPLAY_PROGRESS_S` of the
environment replaces it."""

_EARLY_S, _EARLY = 60.0, 0.02
"""How long [s], and up to which part of the work, nothing is said of the time that is left."""

_LINE = "{desc} {percentage:3.0f} %, {n_fmt}/{total_fmt} {unit}{postfix}, {remaining} left"
_COUNT = "{desc} {n_fmt} {unit}{postfix}, {elapsed} gone"


class ProgressBar(tqdm):
    """A bar of tqdm's in a terminal; in a file or a pipe a line each `LINE_EVERY_S`.

    Arguments are tqdm's.
    """

    disable: bool
    _first: tuple[float, float] | None = None
    """When something was done first, and how much [s]: before, kernels are compiled or loaded."""

    def __init__(self, *args: Any, **options: Any) -> None:
        """Begin; standard error takes it, as with tqdm."""
        self._lines = not _terminal(options.get("file") or sys.stderr)
        if self._lines:
            layout = options.get("bar_format")
            if layout is None:
                known = options.get("total") is not None or args
                layout = _LINE if known else _COUNT
            options["bar_format"] = layout.replace("%|{bar}|", " %,")
            every = _interval()
            options |= {"mininterval": every, "maxinterval": max(every, 0.1), "miniters": 0}
            options["delay"] = max(options.get("delay", 0.0), every)
        super().__init__(*args, **options)

    @property
    def format_dict(self) -> dict[str, Any]:
        """What the bar shows; the speed is that since something was done first."""
        shown: dict[str, Any] = super().format_dict
        if self.disable:  # tqdm then has no clock
            return shown
        early = shown["elapsed"] < _EARLY_S and shown["n"] < _EARLY * (shown["total"] or 0.0)
        time, done = self._first or (math.inf, 0.0)
        span = self._time() - time
        shown["rate"] = 0.0  # tqdm then writes "?"
        if not early and span > 0.0:
            shown["rate"] = (shown["n"] - done) / span
        return shown

    def update(self, n: float | None = 1) -> bool | None:
        """So much more is done."""
        told: bool | None = super().update(n)
        if not self.disable and self._first is None and n:
            self._first = self._time(), self.n
        return told

    def close(self) -> None:
        """End it; a bar stays as it is, and of lines there is a last one if there was any."""
        if not self._lines or self.disable:
            super().close()
            return
        if self.last_print_t >= self.start_t + self.delay:
            self.display()
        self.disable = True
        self._decr_instances(self)

    @staticmethod
    def status_printer(file: Any) -> Callable[[str], None]:
        """What writes the bar, or a line."""
        if _terminal(file):
            return tqdm.status_printer(file)  # type: ignore[no-any-return]

        said = ""

        def write(text: str) -> None:
            nonlocal said
            if text.strip() and text.strip() != said:
                said = text.strip()
                file.write(f"{said}\n")
                file.flush()

        return write


def _interval() -> float:
    try:
        return max(float(os.environ.get("JOINTPLAY_PROGRESS_S", LINE_EVERY_S)), 0.0)
    except ValueError:
        return LINE_EVERY_S


def _terminal(stream: Any) -> bool:
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):  # none at all, or closed
        return False


class Whole:
    """One bar for a piece of work of several runs, by the time that they simulate [s].

    The bars of runs that begin in the meantime add to it instead of standing on their own.
    """

    def __init__(self, total: float) -> None:
        """`total` is what all runs simulate together [s]."""
        layout = (
            "{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s simulated{postfix}, {remaining} left"
        )
        self._bar = ProgressBar(total=total, bar_format=layout, mininterval=0.2, smoothing=0.0)
        self._words, self._started = "", time.perf_counter()

    def add(self, seconds: float) -> None:
        """So much more has been simulated [s]."""
        self._bar.total = max(self._bar.total, self._bar.n + seconds)
        speed = self._bar.n / max(time.perf_counter() - self._started, 1e-9)
        words = f"{self._words}, " if self._words else ""
        self._bar.set_postfix_str(f"{words}{speed:.2f} x real time", refresh=False)
        self._bar.update(max(seconds, 0.0))

    def say(self, words: str) -> None:
        """What is being done now."""
        self._words = words

    def close(self) -> None:
        """Leave the bar as it is."""
        self._bar.close()


_whole: Whole | None = None


def current() -> Whole | None:
    """The bar of the whole, within `whole`."""
    return _whole


@contextmanager
def whole(total: float, show: bool) -> Iterator[None]:
    """Within the block one bar is for all runs; `total` is what they simulate together [s]."""
    global _whole
    if not show or _whole is not None:
        yield
        return
    _whole = Whole(total)
    try:
        yield
    finally:
        bar, _whole = _whole, None
        bar.close()


@contextmanager
def printing() -> Iterator[None]:
    """Within the block text can be printed while bars are shown."""
    if _whole is None or not _terminal(sys.stderr):
        yield
        return
    with tqdm.external_write_mode(file=sys.stdout):
        yield
        sys.stdout.flush()
