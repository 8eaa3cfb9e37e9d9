"""What play lets the tool do at rest, as the track of an ellipsoid about the ideal tool."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jointplay.analysis.error_ellipsoid import ellipsoids
from jointplay.analysis.levers import sources
from jointplay.mechanism.mechanism import Mechanism
from jointplay.playback.tracks import Packer

MOMENTS = 61
"""At which the set is reckoned; between them the ellipsoid is interpolated."""
_QUANTUM = 1e-8
_PLACES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def static_error(
    mechanism: Mechanism,
    time: np.ndarray,
    q: np.ndarray,
    driven: Sequence[str] | None,
    packer: Packer,
) -> dict[str, Any]:
    """Pack the static error set of a run's tool.

    Args:
        mechanism: with play.
        time: of the records, shape (n,) [s].
        q: configurations there, shape (n, nq); journals count as centred.
        driven: joints that the motion moves, which stand in closed loops.
        packer: receives the tables.

    Returns:
        `time` [s], and `set`: the matrix that makes a unit sphere the ellipsoid, its six numbers,
        and the worst and the RMS distance [m].

    Raises:
        JointplayError: see `levers.sources`.
    """
    moments = np.linspace(time[0], time[-1], MOMENTS)
    poses = np.column_stack([np.interp(moments, time, column) for column in q.T])
    for name, joint in mechanism.clearance.items():
        if name in mechanism.loops:
            continue
        for part in joint.freedoms:
            if part not in joint.ideal_freedoms:
                poses[:, mechanism.coordinates.index(f"{name}.{part}")] = 0.0
    found = ellipsoids(sources(mechanism, poses, driven=driven, loops=True))
    rows = [found.root[:, i, k] for i, k in _PLACES] + [found.worst, found.rms]
    return {
        "time": packer.table(moments, 1e-7),
        "set": packer.table(np.column_stack(rows), _QUANTUM),
    }
