"""Liu, Zhang and Yang's conformal pin in a bore: explicit, for any depth."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.hertzian import HysteresisLaw
from jointplay.contact.normal.line_contact import line_warnings


@dataclass(frozen=True)
class Liu(HysteresisLaw):
    """F = pi/2 l E* delta sqrt(delta/(2 (C_r + delta))) [1 + 3 (1 - c_e^2)/4 ddelta/ddelta0].

    A Winkler foundation under an elliptic pressure. For depths far below the clearance it is
    Hertz's exponent 3/2, for depths far above a linear spring. The formula was seen in the code of
    DyS (github.com/ladisk/DyS); the paper was not. Lengths, axial contacts and damping are treated
    as in `LineContactLaw`.
    """

    line = True

    name = "liu"
    formula = (
        r"F_n = \tfrac{\pi}{2}\,l E^*\delta\sqrt{\frac{\delta}{2(C_r+\delta)}}"
        r"\left[1+\tfrac34(1-c_e^2)\,\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = (
        "C.-S. Liu, K. Zhang, R. Yang, Mech. Mach. Theory 42 (2007) 183-197, as DyS has it; "
        "for spheres J. Comput. Nonlinear Dyn. 1 (2006) 160-167"
    )
    validity = (
        "conformal contact: depths of the order of C_r and above, parallel axes; several times "
        "softer than plane elasticity below; c_e above 0.8"
    )

    @staticmethod
    def factor(restitution: float) -> float:
        """3 (1 - c_e^2)/4, as Lankarani-Nikravesh."""
        return 0.75 * (1.0 - restitution**2)

    @staticmethod
    def function(
        delta: float,
        ddelta: float,
        ddelta0: float,
        stiffness: float,
        factor: float,
        clearance: float,
    ) -> float:
        """Evaluate with pi/2 l E*, a and C_r, or with Hertz's k, a and -1."""
        elastic = stiffness * delta * math.sqrt(delta)
        if clearance >= 0.0:
            elastic /= math.sqrt(2.0 * (clearance + delta))
        return elastic * (1.0 + factor * ddelta / ddelta0)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """pi/2 l E* [N/m], a and C_r [m]; k, a and -1 where the contact is no line."""
        factor = self.factor(contact.restitution)
        if contact.contact_length == 0.0:
            return contact.stiffness, factor, -1.0
        line = contact.modulus * contact.contact_length
        return 0.5 * math.pi * line, factor, contact.clearance

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        if contact.contact_length == 0.0:
            return super()._limits(contact, max_depth)
        force = self.function(max_depth, 0.0, 1.0, *self.parameters(contact))
        # A wide contact is what this law is for.
        return [
            line
            for line in line_warnings(self.name, contact, force, max_depth)
            if "small contact" not in line
        ]
