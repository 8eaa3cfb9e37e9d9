"""Lankarani-Nikravesh: Hertz with hysteresis damping, the paper's own law (eqs 18, 19)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class LankaraniNikravesh(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + 3 (1 - c_e^2)/4 ddelta/ddelta0] (eq. 19).

    Derived for c_e close to 1; the effective restitution e of an impact follows from
    a = 3 (1 - c_e^2)/4 as a (1 + e) = ln((1 + a)/(1 - a e)) and exceeds c_e below that.
    """

    name = "lankarani-nikravesh"
    formula = (
        r"F_n = k\delta^{3/2}\left[1+\tfrac34(1-c_e^2)\,\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = "H. M. Lankarani, P. E. Nikravesh, J. Mech. Design 112 (1990) 369-376"
    validity = "c_e above 0.8: exact to first order as c_e -> 1, too elastic below"

    @staticmethod
    def factor(restitution: float) -> float:
        """3 (1 - c_e^2)/4 of eq. 19."""
        return 0.75 * (1.0 - restitution**2)
