"""Hertz contact: no dissipation (eq. 15)."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.law import ContactProperties, NormalForceLaw


class Hertz(NormalForceLaw):
    """F_n = k delta^(3/2), with k of eq. 11 (eq. 15)."""

    name = "hertz"

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, p: Any) -> float:
        """Evaluate eq. 15 with p = (k,)."""
        return p[0] * delta * math.sqrt(delta)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m^1.5]."""
        return (contact.stiffness,)
