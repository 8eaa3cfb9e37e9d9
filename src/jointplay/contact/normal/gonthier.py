"""Gonthier et al.: hysteresis damping for all restitutions, approximate (2004)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class Gonthier(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = (1 - c_e^2)/c_e.

    The approximation d = 1 - c_e^2 of the exact d = a c_e; `ZhangSharf` solves for it.
    """

    name = "gonthier"
    formula = (
        r"F_n = k\delta^{3/2}\left[1+\frac{1-c_e^2}{c_e}\,\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = (
        "Y. Gonthier, J. McPhee, C. Lange, J.-C. Piedboeuf, Multibody Syst. Dyn. 11 (2004) 209-233"
    )
    validity = "every c_e, within 0.033; too plastic above 0.35"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = (1 - c_e^2)/c_e."""
        return (1.0 - restitution**2) / restitution
