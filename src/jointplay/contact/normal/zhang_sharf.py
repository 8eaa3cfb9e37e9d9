"""Zhang-Sharf: hysteresis damping that delivers the restitution asked for (2004, 2009)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw
from jointplay.contact.normal.restitution import exact_factor


@dataclass(frozen=True)
class ZhangSharf(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a from a (1 + c_e) = ln((1 + a)/(1 - a c_e)).

    The references write d = a c_e. The equation is solved once, when a run is prepared.
    """

    name = "zhang-sharf"
    formula = (
        r"F_n = k\delta^{3/2}\left[1+a\,\frac{\dot\delta}{\dot\delta_0}\right],\quad "
        r"a(1+c_e) = \ln\frac{1+a}{1-a c_e}"
    )
    reference = (
        "Y. Zhang, I. Sharf, Proc. ASME DETC (2004); "
        "Y. Zhang, I. Sharf, J. Appl. Mech. 76 (2009) 051002"
    )
    validity = "every c_e: a free impact has exactly the restitution c_e"

    @staticmethod
    def factor(restitution: float) -> float:
        """a, the solution of the implicit equation."""
        return exact_factor(restitution)
