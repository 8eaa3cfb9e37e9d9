"""Linear spring (eq. 16)."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.errors import require_positive

REFERENCE_PENETRATION_M = 1e-5
"""Depth at which a derived linear stiffness stores the energy of Hertz's law."""


def linear_stiffness(given: float | None, contact: ContactProperties) -> float:
    """Linear stiffness [N/m]: the given one, or the Hertz contact's.

    Eq. 11 gives N/m^1.5. Derived, k is the spring that stores Hertz's energy at 10 um:
    k delta^2 / 2 = 2/5 k_Hertz delta^(5/2).
    """
    if given is not None:
        return given
    return 0.8 * contact.stiffness * math.sqrt(REFERENCE_PENETRATION_M)


class LinearSpring(NormalForceLaw):
    """F_n = k delta (eq. 16).

    Args:
        stiffness: k [N/m]; None takes it from the joint's Hertz stiffness (`linear_stiffness`).
    """

    name = "linear-spring"
    formula = r"F_n = k_l\delta"
    reference = "doi 10.3390/app13042211, eq. 16"
    validity = "rough estimates near the depth that the stiffness is chosen for; no loss"

    def __init__(self, stiffness: float | None = None) -> None:
        """Check and keep the stiffness."""
        self.stiffness = (
            None if stiffness is None else require_positive("stiffness", stiffness, "N/m")
        )

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, p: Any) -> float:
        """Evaluate eq. 16 with p = (k,)."""
        return p[0] * delta

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m]."""
        return (linear_stiffness(self.stiffness, contact),)

    def effective_restitution(self, restitution: float) -> float:
        """1, whatever c_e is."""
        return 1.0
