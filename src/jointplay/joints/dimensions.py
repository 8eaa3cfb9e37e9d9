"""Dimensions that belong together: a clearance, and what it leaves of bearing and journal."""

from __future__ import annotations

import math

from jointplay.errors import JointplayError, require_positive


def close(a: float, b: float) -> bool:
    """Whether two lengths [m] agree but for rounding."""
    return math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-9)


def complete(
    play: float | None, outer: float, inner: float | None, factor: float, words: tuple[str, str]
) -> tuple[float, float]:
    """Derive clearance from dimensions or dimensions from clearance: outer - inner = factor play.

    Args:
        play: clearance [m], or None.
        outer: dimension of the bearing [m].
        inner: dimension of the journal [m], or None.
        factor: clearances between outer and inner.
        words: names of the clearance and of the dimension, for errors.

    Returns:
        play and inner [m].

    Raises:
        JointplayError: neither given, or values that are not positive or contradict each other.
    """
    clearance, dimension = words
    at_play, at_inner = (f"{clearance}_clearance",), (f"journal_{dimension}",)
    if play is None and inner is None:
        raise JointplayError(f"give the {clearance} clearance or the journal {dimension}")
    if play is not None:
        require_positive(f"{clearance} clearance", play, "m", at_play)
    if inner is not None:
        require_positive(f"journal {dimension}", inner, "m", at_inner)
        if inner >= outer:
            raise JointplayError(
                f"journal {dimension} {inner:g} m does not fit into the bearing's {outer:g} m",
                where=at_inner,
            )
        if play is not None and not close(outer - inner, factor * play):
            raise JointplayError(
                f"{clearance} clearance {play:g} m contradicts the dimensions: bearing "
                f"{outer:g} m and journal {inner:g} m give {(outer - inner) / factor:g} m",
                where=at_play,
            )
    if play is None:
        assert inner is not None
        play = (outer - inner) / factor
    if inner is None:
        inner = outer - factor * play
    if inner <= 0.0:
        raise JointplayError(
            f"{clearance} clearance {play:g} m leaves no journal in a bearing of "
            f"{dimension} {outer:g} m",
            where=at_play,
        )
    return float(play), float(inner)
