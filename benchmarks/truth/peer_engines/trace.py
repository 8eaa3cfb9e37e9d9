"""What an engine gives back, and the impacts in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from truth.peer_engines.common import Problem


@dataclass(frozen=True)
class Trace:
    """What an engine computed."""

    time: np.ndarray
    """[s], shape (n,)."""
    q: np.ndarray
    """Coordinates in jointplay's order, shape (n, nv)."""
    v: np.ndarray
    force: np.ndarray
    """Magnitude of the resultant contact force, shape (n,) [N]."""
    seconds: float
    """CPU time of the time loop [s]."""
    steps: int

    def at(self, times: np.ndarray) -> np.ndarray:
        """Coordinates at other times, shape (m, nv)."""
        return CubicHermiteSpline(self.time, self.q, self.v)(times)


def offset(task: Problem, q: np.ndarray) -> np.ndarray:
    """Journal's centre in the bearing, shape (n, 3) [m]: world axes if planar, else bearing's."""
    if not task.planar:
        first = task.journal[0] - 5
        return q[:, first : first + 3]
    (_, at), rod = task.bearing, task.links[task.bearing[0]]
    a, b = q[:, 0], q[:, 0] + q[:, 1]
    x = rod.offset[0] * np.cos(a) + at[0] * np.cos(b)
    y = rod.offset[0] * np.sin(a) + at[0] * np.sin(b)
    return np.column_stack([q[:, 2] - x, -y, np.zeros(len(q))])


@dataclass(frozen=True)
class Impact:
    """One contact from touch to release."""

    time: float
    """When the gap vanished [s]."""
    duration: float
    impulse: float
    """[N s]."""


def impacts(trace: Trace, task: Problem, rigid: bool = False) -> list[Impact]:
    """Contacts of a planar trace with a record at every step, in order; open ones left out.

    Without penetration (`rigid`) a contact is a row of steps with an impulse.
    """
    gap = task.clearance - np.linalg.norm(offset(task, trace.q)[:, :2], axis=1)
    touching = trace.force > 0.0 if rigid else gap < 0.0
    inside = np.concatenate([[False], touching, [False]])
    starts, ends = (np.flatnonzero(np.diff(inside.astype(int)) == way) for way in (1, -1))
    found = []
    for first, last in zip(starts, ends, strict=True):
        if first == 0 or last >= len(gap):
            continue

        def crossing(k: int) -> float:
            part = gap[k - 1] / (gap[k - 1] - gap[k])
            return float(trace.time[k - 1] + part * (trace.time[k] - trace.time[k - 1]))

        if rigid:
            step = float(trace.time[1] - trace.time[0])
            impulse = step * float(np.sum(trace.force[first:last]))
            found.append(Impact(float(trace.time[first]), step * (last - first), impulse))
            continue
        begin, end = crossing(first), crossing(last)
        force, times = trace.force[first - 1 : last + 1], trace.time[first - 1 : last + 1]
        found.append(Impact(begin, end - begin, float(np.trapezoid(force, times))))
    return found
