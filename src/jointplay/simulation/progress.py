"""The progress bars of a run.

Nothing of tqdm is made where nothing is shown: its bars share a lock between processes, and one
that was killed while it held the lock would never give it back.
"""

from __future__ import annotations

import math
import time
from typing import Any

from tqdm import tqdm


class Bar:
    """Progress by simulated time: speed relative to real time, and time left."""

    def __init__(self, total: float, show: bool, label: str = "", begin: float = 0.0) -> None:
        """Show nothing unless `show`; `total` is the time to simulate, from `begin` on [s]."""
        layout = (
            "{desc}{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s simulated{postfix}, "
            "{remaining} left"
        )
        self._bar: Any = None
        if show:
            self._bar = tqdm(
                total=total,
                bar_format=layout,
                mininterval=0.2,
                desc=label or None,
                initial=begin,
            )
        self._begin = begin
        self._started = time.perf_counter()

    def update(self, now: float) -> None:
        """Say that the run has got to the time `now` [s]."""
        if self._bar is None or not math.isfinite(now):
            return
        speed = (now - self._begin) / max(time.perf_counter() - self._started, 1e-9)
        self._bar.set_postfix_str(f"{speed:.2f} x real time", refresh=False)
        self._bar.update(now - self._bar.n)

    def close(self) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.close()


class Writing:
    """Progress by records written."""

    def __init__(self, total: int, show: bool) -> None:
        """Show nothing unless `show`; `total` is how many there are."""
        layout = "writing the histories {percentage:3.0f}%|{bar}| {remaining} left"
        self._bar: Any = tqdm(total=total, bar_format=layout) if show else None

    def update(self, records: int) -> None:
        """Say that so many more are written."""
        if self._bar is not None:
            self._bar.update(records)

    def close(self) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.close()
