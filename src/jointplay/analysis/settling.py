"""How the tool comes to rest at a stop (ISO 9283:1998, clauses 7.4 and 7.5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointplay.analysis.traces import Trace


@dataclass(frozen=True)
class Settling:
    """How the tool comes to rest at a stop (clauses 7.4, 7.5), over the cycles."""

    band: float
    """Limit band [m]."""
    time: float
    """Position stabilization time, mean [s]."""
    longest: float
    """The longest [s]."""
    overshoot: float
    """Position overshoot OV, the largest [m]."""
    settled: int
    """Cycles in which the tool had settled before half of the dwell was over."""


def settling(
    runs: Sequence[Trace],
    window: tuple[np.ndarray, np.ndarray, np.ndarray],
    time: np.ndarray,
    band: float,
) -> Settling | None:
    """How the tool comes to rest in the window (from leaving on, dwelling, until the end)."""
    after, dwelling, before = window
    if (dwelling & before).sum() < 3:
        return None
    inside = after & before
    moments = time[inside]
    half = 0.5 * (time[dwelling & before][0] + time[dwelling & before][-1])
    took, over, settled = [], [], 0
    for run in runs:
        course = run.position[inside]
        distance = np.linalg.norm(course - course[-1], axis=1)
        outside = np.flatnonzero(distance > band)
        if not len(outside):  # never left: nothing to settle
            took.append(0.0)
            over.append(0.0)
            settled += 1
            continue
        first = int(np.flatnonzero((distance <= band) & (np.arange(len(distance)) > outside[0]))[0])
        last = int(outside[-1]) + 1
        took.append(float(moments[max(last, first)] - moments[first]))
        beyond = distance[first:].max()
        over.append(float(beyond) if beyond > band else 0.0)
        settled += int(moments[max(last, first)] <= half)
    return Settling(band, float(np.mean(took)), max(took), max(over), settled)


def settling_words(how: Settling | None, cycles: int) -> list[str]:
    """What is printed of it."""
    if how is None:
        return ["  stabilization, overshoot: the motion does not dwell here"]
    band = f"limit band {1e3 * how.band:.4g} mm"
    if how.settled < cycles:
        return [
            f"  stabilization, overshoot: still outside the {band} at half of the dwell in "
            f"{cycles - how.settled} of {cycles} cycles: a longer dwell tells"
        ]
    return [
        f"  position stabilization time {1e3 * how.time:.4g} ms in the mean, longest "
        f"{1e3 * how.longest:.4g} ms ({band})",
        f"  OV    position overshoot  {1e3 * how.overshoot:.4g} mm, the largest",
    ]
