"""Lankarani-Nikravesh: Hertz with hysteresis damping, the paper's own law (eqs 18, 19)."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.law import ContactProperties, NormalForceLaw


class LankaraniNikravesh(NormalForceLaw):
    """F_n = k delta^(3/2) [1 + 3 (1 - c_e^2)/4 ddelta/ddelta0] (eq. 19).

    Reference: H. M. Lankarani, P. E. Nikravesh, J. Mech. Design 112 (1990) 369-376. Derived for
    c_e close to 1; the effective restitution e of an impact follows from a = 3 (1 - c_e^2)/4 as
    a (1 + e) = ln((1 + a)/(1 - a e)) and exceeds c_e below that.
    """

    name = "lankarani-nikravesh"

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, p: Any) -> float:
        """Evaluate eq. 19 with p = (k, 3 (1 - c_e^2)/4)."""
        return p[0] * delta * math.sqrt(delta) * (1.0 + p[1] * ddelta / ddelta0)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m^1.5] and the hysteresis factor of eq. 19."""
        return contact.stiffness, 0.75 * (1.0 - contact.restitution**2)
