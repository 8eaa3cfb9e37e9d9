"""Where each quantity stands in the records that the kernels write."""

from __future__ import annotations

from collections.abc import Sequence

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
