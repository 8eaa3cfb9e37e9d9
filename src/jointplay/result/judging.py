"""From when on a run is judged."""

from __future__ import annotations

STARTS = ("rest", "centred")
"""Where journals begin: where they lie under load, or in the middle of their bearings."""

START_UP = 0.15
"""Start of a run that is not judged, while released journals fall into their bearings [s]."""


def after_start_up(duration: float, falls: bool) -> float:
    """When to judge from if nobody said so [s].

    Args:
        duration: of the run [s].
        falls: whether journals start away from where they would rest.

    Returns:
        `START_UP` if journals fall and the run is more than twice as long, else 0.
    """
    return START_UP if falls and duration > 2.0 * START_UP else 0.0
