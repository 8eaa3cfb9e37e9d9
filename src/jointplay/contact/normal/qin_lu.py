"""Qin-Lu: Lankarani-Nikravesh corrected for soft impacts (2006)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class QinLu(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 3 (1 - c_e^2) exp(2 (1 - c_e))/4."""

    name = "qin-lu"
    formula = (
        r"F_n = k\delta^{3/2}"
        r"\left[1+\tfrac34(1-c_e^2)\,\mathrm e^{2(1-c_e)}\,\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = "Z. Qin, Q. Lu, J. Dyn. Control 4 (2006) 294-298"
    validity = "c_e above 0.25, within 0.05; exact to first order as c_e -> 1"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 3 (1 - c_e^2) exp(2 (1 - c_e))/4."""
        return 0.75 * (1.0 - restitution**2) * math.exp(2.0 * (1.0 - restitution))
