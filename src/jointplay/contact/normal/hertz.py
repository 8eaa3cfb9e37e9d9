"""Hertz contact: no dissipation (eq. 15)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.contact.normal.hertzian import hertz_warnings


@dataclass(frozen=True)
class Hertz(NormalForceLaw):
    """F_n = k delta^(3/2), with k of eq. 11 (eq. 15)."""

    name = "hertz"
    formula = r"F_n = k\delta^{3/2}"
    reference = "H. Hertz, J. reine angew. Math. 92 (1882) 156-171"
    validity = (
        "elastic contact whose radius is small against the bodies'; no loss, c_e does not enter"
    )

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, stiffness: float) -> float:
        """Evaluate eq. 15."""
        return stiffness * delta * math.sqrt(delta)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m^1.5]."""
        return (contact.stiffness,)

    def effective_restitution(self, restitution: float) -> float:
        """1, whatever c_e is."""
        return 1.0

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        return hertz_warnings(self.name, contact, max_depth)
