"""Kelvin-Voigt: linear spring and dashpot (eq. 17)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.contact.normal.linear_spring import linear_stiffness, spring_and_dashpot
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class KelvinVoigt(NormalForceLaw):
    """F_n = k delta + b ddelta (eq. 17).

    The force jumps to b ddelta at the first touch and would pull before separation, which the
    time loop cuts off: a contact never pulls.
    """

    name = "kelvin-voigt"
    formula = r"F_n = k_l\delta + b\dot\delta"
    reference = "doi 10.3390/app13042211, eq. 17"
    validity = "rough estimates: the force jumps at the first touch; c_e does not enter"

    damping: float = quantity("N*s/m", least=0.0)
    """b [N s/m]."""
    stiffness: float | None = quantity("N/m", default=None, above=0.0)
    """k [N/m]; None takes it from the joint's Hertz stiffness (`linear_stiffness`)."""

    function = staticmethod(spring_and_dashpot)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m] and b [N s/m]."""
        return linear_stiffness(self.stiffness, contact), self.damping
