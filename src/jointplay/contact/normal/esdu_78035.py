"""ESDU 78035's cylinder in a bore."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.line_contact import LineContactLaw


@dataclass(frozen=True)
class Esdu78035(LineContactLaw):
    """delta = f/(pi E*) [ln(4 pi E* C_r/f) + 1], f = F/l; see `LineContactLaw`.

    Johnson's with +1 for -1. It was seen in the code of DyS (github.com/ladisk/DyS, the program of
    L. Skrinjar, J. Slavic, M. Boltezar, Nonlinear Dyn. 88 (2017) 131-143), as pi f sigma [ln(4 C_r/
    (f sigma)) + 1] with sigma = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j there. Plane elasticity knows
    one factor before the logarithm, f/(pi E*), which is 1/pi^2 of that one: it is taken here, and
    sigma = (1 - nu^2)/(pi E) of eq. 12 within. The data item itself was not seen.
    """

    name = "esdu-78035"
    formula = (
        r"\delta = \frac{f}{\pi E^*}\left[\ln\frac{4\pi E^* C_r}{f} + 1\right],\quad f=\frac{F}{l}"
    )
    reference = "ESDU 78035, Contact phenomena I (1978), as DyS has it, less its factor pi^2"
    validity = "comparison with the literature: the data item was not seen; parallel axes"

    @staticmethod
    def scale(contact: ContactProperties) -> float:
        """4 pi E* C_r l e [N]."""
        line = contact.modulus * contact.contact_length
        return 4.0 * math.pi * line * contact.clearance * math.e
