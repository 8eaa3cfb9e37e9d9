"""The progress bars of a run."""

from __future__ import annotations

import math
import time
from typing import Any

from jointplay.base.progress import ProgressBar, current


class Bar:
    """Progress by simulated time: speed relative to real time, and time left."""

    def __init__(self, total: float, show: bool, label: str = "", begin: float = 0.0) -> None:
        layout = (
            "{desc}{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s simulated{postfix}, "
            "{remaining} left"
        )
        self._bar: Any = None
        self._whole = current() if show else None
        self._reached = begin
        if self._whole is not None:
            self._whole.say(label.strip())
        elif show:
            self._bar = ProgressBar(
                total=total,
                bar_format=layout,
                mininterval=0.2,
                desc=label or None,
                initial=begin,
            )
        self._begin = begin
        self._started = time.perf_counter()

    def update(self, now: float) -> None:
        if not math.isfinite(now):
            return
        if self._whole is not None:
            self._whole.add(now - self._reached)
            self._reached = now
        if self._bar is None:
            return
        speed = (now - self._begin) / max(time.perf_counter() - self._started, 1e-9)
        self._bar.set_postfix_str(f"{speed:.2f} x real time", refresh=False)
        self._bar.update(now - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


class Writing:
    """Progress by records written."""

    def __init__(self, total: int, show: bool) -> None:
        layout = "writing the histories {percentage:3.0f}%|{bar}| {remaining} left"
        self._bar: Any = ProgressBar(total=total, bar_format=layout) if show else None

    def update(self, records: int) -> None:
        if self._bar is not None:
            self._bar.update(records)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
