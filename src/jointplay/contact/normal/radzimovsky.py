"""Radzimovsky's cylinder in a bore."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.line_contact import LineContactLaw


@dataclass(frozen=True)
class Radzimovsky(LineContactLaw):
    """delta = f/(pi E*) [2/3 + ln(4 R_i/b) + ln(4 R_j/b)], f = F/l; see `LineContactLaw`.

    b = 1.60 sqrt(f D/E*) with D = 2 R_i R_j/C_r, as Roark's Formulas for Stress and Strain have
    it: the *whole* width of the contact, Hertz's 2 sqrt(4 f R/(pi E*)) in three digits. Parts of
    the clearance literature write R for D, which would make the contact narrower than Hertz's.
    """

    name = "radzimovsky"
    formula = (
        r"\delta = \frac{f}{\pi E^*}"
        r"\left[\tfrac23+\ln\frac{4R_i}{b}+\ln\frac{4R_j}{b}\right],\quad "
        r"b = 1.60\sqrt{\frac{2fR}{E^*}}"
    )
    reference = (
        "E. I. Radzimovsky, Univ. of Illinois Eng. Exp. Station Bulletin 408 (1953); "
        "W. C. Young, Roark's Formulas for Stress and Strain (1989)"
    )
    validity = "depth up to 0.52 C_r, parallel axes; continued along its tangent above"

    @staticmethod
    def scale(contact: ContactProperties) -> float:
        """16 R_i R_j E* l/(1.60^2 2 R) e^(2/3) [N]; R_i R_j/R is C_r."""
        line = contact.modulus * contact.contact_length
        return 16.0 * line * contact.clearance / (2.0 * 1.60**2) * math.exp(2.0 / 3.0)
