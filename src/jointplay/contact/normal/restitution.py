"""Restitution of an impact under F = g(delta) [1 + a ddelta/ddelta0], and the a for a restitution.

With any elastic part g the equation of motion m v dv/ddelta = -g(delta) (1 + a v/v0) separates,
and equal depth at both ends of the impact gives (K. H. Hunt, F. R. E. Crossley, 1975; Y. Zhang,
I. Sharf, 2009)

    a (1 + e) = ln((1 + a)/(1 - a e)).
"""

from __future__ import annotations

import math
from collections.abc import Callable

_TINY = 1e-6
"""Below this the equation cancels, and its first-order solution is exact to its square."""


def effective_restitution(factor: float) -> float:
    """Restitution e of an impact with the hysteresis factor a >= 0."""
    if factor < _TINY:
        return 1.0 - factor / 1.5

    def mismatch(e: float) -> float:
        return math.log1p(factor) - math.log1p(-factor * e) - factor * (1.0 + e)

    high = 1.0 if factor < 1.0 else (1.0 - 1e-15) / factor
    if mismatch(high) <= 0.0:  # 1 - a e is smaller than numbers can tell
        return high
    return _root(mismatch, 0.0, high)


def exact_factor(restitution: float) -> float:
    """Hysteresis factor a that delivers the restitution e, 0 < e <= 1."""
    if 1.0 - restitution < _TINY:
        return 1.5 * (1.0 - restitution)
    inverse = 1.0 / restitution

    def mismatch(d: float) -> float:  # d = a e, between 0 and 1
        return math.log1p(d * inverse) - math.log1p(-d) - d * (1.0 + inverse)

    high = 1.0 - 1e-15
    if mismatch(high) <= 0.0:  # a soft impact ends with all but no force
        return inverse
    return _root(mismatch, 0.5 * (1.0 - restitution), high) * inverse


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(function, low, high, xtol=1e-15))
