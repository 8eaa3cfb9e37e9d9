"""Contacts of a result: how many, how long, how hard, and the shares of time in each mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from jointplay.base.errors import require_finite, require_known
from jointplay.physics.geometry import Form, Mode
from jointplay.simulation.analysis.twins import places
from jointplay.simulation.result.result import Result


@dataclass(frozen=True)
class Contacts:
    """Contacts at one place of one joint, in the order in which they began.

    Records cannot tell contacts apart that follow each other within one record interval, nor time
    them better than to about one interval; peaks are exact.
    """

    joint: str
    contact: str
    start: np.ndarray
    """Record before the contact (n,) [s]."""
    duration: np.ndarray
    """Record intervals touched less one, the unbiased estimate; at least half an interval [s]."""
    peak: np.ndarray
    """Largest normal force (n,) [N]."""
    peak_time: np.ndarray
    """Record at which it was held (n,) [s]."""
    share: float
    """Fraction of the records with a normal force."""


def contacts(result: Result, start: float | None = None) -> list[Contacts]:
    """Contacts of every place of every clearance joint that began from `start` [s] on.

    None: from when on the run is judged. A contact lasts from the first to the last of consecutive
    records that hold a normal force.
    """
    time = result.time
    if not result.joints:
        return []
    start = result.judge_from if start is None else require_finite("start", start, "s")
    later = np.diff(time, prepend=time[0])
    judged = time >= start
    statistics = []
    for joint in result.joints:
        for contact in places(result, joint):
            at = {"joint": joint, "contact": contact}
            force = result["normal_force_peak"].sel(at).values
            edges = np.diff(np.concatenate([[False], force > 0.0, [False]]).astype(int))
            first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
            kept = time[first] >= start
            first, last = first[kept], last[kept]
            top = [f + int(force[f : t + 1].argmax()) for f, t in zip(first, last, strict=True)]
            spacing = later[first]
            normal = result["normal_force"].sel(at).values[judged]
            statistics.append(
                Contacts(
                    joint,
                    contact,
                    time[first] - spacing,
                    np.maximum(time[last] - time[first], 0.5 * spacing),
                    force[top],
                    time[top],
                    float(np.mean(normal > 0.0)) if normal.size else 0.0,
                )
            )
    return statistics


def time_fractions(
    result: Result, joint: str, of: str = "mode", start: float | None = None
) -> dict[str, float]:
    """Fractions of the time from `start` [s] on that `joint` spends in each ``mode`` or ``form``.

    None: from when on the run is judged. By name, in the order of the enumeration; they sum to 1.
    Nothing for the forms of a joint that Figure 2 does not show.
    """
    require_known("clearance joint", joint, result.joints)
    kinds: dict[str, Any] = {"mode": Mode, "form": Form}
    require_known("state", of, kinds)
    start = result.judge_from if start is None else require_finite("start", start, "s")
    values = result[of].sel(joint=joint).values[result.time >= start]
    if len(values) and values.min() < 0:
        return {}
    counts = np.bincount(values, minlength=len(kinds[of]))
    total = max(len(values), 1)
    return {member.name.lower(): float(counts[member] / total) for member in kinds[of]}
