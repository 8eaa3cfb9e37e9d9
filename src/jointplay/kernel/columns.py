"""Where each quantity stands in what the kernels write."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jointplay.kernel.sites import LoadSite
from jointplay.kernel.words import POWERS


def columns_of(
    nv: int, nj: int, width: int, loads: Sequence[LoadSite]
) -> tuple[dict[str, slice], int]:
    """Columns of a record by name, and their number.

    Args:
        nv: number of coordinates.
        nj: number of joints with clearance.
        width: contacts of a joint at most.
        loads: what else acts.
    """
    widths = {
        "time": 1,
        "q": nv,
        "v": nv,
        "drive": nv,
        "work": len(POWERS),
        "force": 3 * nj,
        "force_peak": 3 * nj,
        "film_force": 3 * nj,
        "normal": width * nj,
        "tangential": width * nj,
        "normal_peak": width * nj,
        "gap_min": width * nj,
        "load_force": sum(load.size for load in loads),
        "load_work": len(loads),
    }
    fields, at = {}, 0
    for name, size in widths.items():
        fields[name] = slice(at, at + size)
        at += size
    return fields, at


def statistics_of(contacts: np.ndarray) -> dict[str, np.ndarray]:
    """What records of contacts (nj, width) have counted, of the same shape.

    Counts, steps, impulses [N s], smallest gap [m], fastest approach [m/s].
    """
    names = {
        "onsets": "onsets",
        "ended": "ended",
        "shortest_steps": "shortest",
        "under_resolved": "under",
        "impulse": "impulse",
        "under_resolved_impulse": "impulse_under",
        "smallest_gap": "deepest",
    }
    statistics = {name: contacts[field].copy() for name, field in names.items()}
    # A contact that has not ended keeps its approach to itself.
    fastest = np.maximum(contacts["fastest"], contacts["ddelta0"])
    return statistics | {"fastest_approach": fastest}
