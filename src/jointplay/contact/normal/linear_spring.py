"""Linear spring (eq. 16)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.core.schema import quantity

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


def spring_and_dashpot(
    delta: float, ddelta: float, ddelta0: float, stiffness: float, damping: float
) -> float:
    """F_n = k delta + b ddelta."""
    return stiffness * delta + damping * ddelta


@dataclass(frozen=True)
class LinearSpring(NormalForceLaw):
    """F_n = k delta (eq. 16)."""

    name = "linear-spring"
    formula = r"F_n = k_l\delta"
    reference = "doi 10.3390/app13042211, eq. 16"
    validity = "rough estimates near the depth that the stiffness is chosen for; no loss"

    stiffness: float | None = quantity("N/m", default=None, above=0.0)
    """k [N/m]; None takes it from the joint's Hertz stiffness (`linear_stiffness`)."""

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, stiffness: float) -> float:
        """Evaluate eq. 16."""
        return stiffness * delta

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m]."""
        return (linear_stiffness(self.stiffness, contact),)

    def effective_restitution(self, restitution: float) -> float:
        """1, whatever c_e is."""
        return 1.0
