"""Pereira et al.: an explicit law fitted to the cylindrical ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.hertzian import HysteresisLaw
from jointplay.contact.normal.line_contact import line_warnings
from jointplay.core.errors import JointplayError

NARROWEST_M, CHANGE_M, WIDEST_M = 0.005e-3, 0.34954e-3, 10e-3
"""Radial clearances between which the fit holds, and at which it changes its branch [m]."""


def exponent(clearance_mm: float) -> float:
    """n = Y C_r^-0.005 for internal contact, C_r in mm."""
    if clearance_mm < 1e3 * CHANGE_M:
        y = 1.51 * math.log(1000.0 * clearance_mm) ** -0.151
    else:
        y = 0.0151 * clearance_mm + 1.151
    return y * clearance_mm**-0.005


@dataclass(frozen=True)
class Pereira(HysteresisLaw):
    """F = (0.965 C_r + 0.0965) l E*/C_r delta^n [1 + 3 (1 - c_e^2)/4 ddelta/ddelta0], mm and N.

    n = Y C_r^-0.005, Y = 1.51 ln(1000 C_r)^-0.151 below C_r = 0.34954 mm and 0.0151 C_r + 1.151
    above. A fit to Johnson's law without its iteration. Lengths and axial contacts are treated as
    in `LineContactLaw`.

    Raises:
        JointplayError: from `parameters`, a clearance outside 0.005 to 10 mm, where there is no
            fit.
    """

    line = True

    name = "pereira"
    formula = (
        r"F_n = \frac{(0.965\,C_r+0.0965)\,l E^*}{C_r}\,\delta^n"
        r"\left[1+\tfrac34(1-c_e^2)\,\frac{\dot\delta}{\dot\delta_0}\right]\ \text{(mm, N)}"
    )
    reference = "C. Pereira, A. Ramalho, J. Ambrosio, Multibody Syst. Dyn. 35 (2015) 277-298"
    validity = "C_r from 0.005 to 10 mm, parallel axes; c_e above 0.8"

    @staticmethod
    def factor(restitution: float) -> float:
        """3 (1 - c_e^2)/4, as Lankarani-Nikravesh."""
        return 0.75 * (1.0 - restitution**2)

    @staticmethod
    def function(
        delta: float, ddelta: float, ddelta0: float, stiffness: float, factor: float, power: float
    ) -> float:
        """Evaluate the law, the stiffness in N/m^n."""
        return stiffness * delta**power * (1.0 + factor * ddelta / ddelta0)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m^n], a and n; Hertz's k and 3/2 where the contact is no line."""
        factor = self.factor(contact.restitution)
        if contact.contact_length == 0.0:
            return contact.stiffness, factor, 1.5
        if not NARROWEST_M <= contact.clearance <= WIDEST_M:
            raise JointplayError(
                f"law 'pereira' is fitted for radial clearances from {NARROWEST_M:g} to "
                f"{WIDEST_M:g} m, got {contact.clearance:g} m"
            )
        gap = 1e3 * contact.clearance  # mm
        n = exponent(gap)
        line = 1e-3 * contact.modulus * contact.contact_length  # MPa mm = N/mm
        return (0.965 * gap + 0.0965) * line / gap * 1e3**n, factor, n

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        if contact.contact_length == 0.0:
            return super()._limits(contact, max_depth)
        force = self.function(max_depth, 0.0, 1.0, *self.parameters(contact))
        return line_warnings(self.name, contact, force, max_depth)
