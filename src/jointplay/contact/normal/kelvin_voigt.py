"""Kelvin-Voigt: linear spring and dashpot (eq. 17)."""

from __future__ import annotations

from typing import Any

from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.contact.normal.linear_spring import linear_stiffness
from jointplay.errors import require_non_negative, require_positive


class KelvinVoigt(NormalForceLaw):
    """F_n = k delta + b ddelta (eq. 17).

    The force jumps to b ddelta at the first touch and would pull before separation, which the
    time loop cuts off: a contact never pulls.

    Args:
        damping: b [N s/m].
        stiffness: k [N/m]; None takes it from the joint's Hertz stiffness (`linear_stiffness`).
    """

    name = "kelvin-voigt"
    formula = r"F_n = k_l\delta + b\dot\delta"
    reference = "doi 10.3390/app13042211, eq. 17"
    validity = "rough estimates: the force jumps at the first touch; c_e does not enter"

    def __init__(self, damping: float, stiffness: float | None = None) -> None:
        """Check and keep stiffness and damping."""
        self.damping = require_non_negative("damping", damping, "N s/m")
        self.stiffness = (
            None if stiffness is None else require_positive("stiffness", stiffness, "N/m")
        )

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, p: Any) -> float:
        """Evaluate eq. 17 with p = (k, b)."""
        return p[0] * delta + p[1] * ddelta

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m] and b [N s/m]."""
        return linear_stiffness(self.stiffness, contact), self.damping
