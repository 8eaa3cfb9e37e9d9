"""Johnson's cylinder in a bore."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.line_contact import LineContactLaw


@dataclass(frozen=True)
class Johnson(LineContactLaw):
    """delta = f/(pi E*) [ln(4 pi E* C_r/f) - 1], f = F/l; see `LineContactLaw`."""

    name = "johnson"
    formula = (
        r"\delta = \frac{f}{\pi E^*}\left[\ln\frac{4\pi E^* C_r}{f} - 1\right],\quad f=\frac{F}{l}"
    )
    reference = "K. L. Johnson, Contact Mechanics, Cambridge University Press, 1985"
    validity = "depth up to 0.40 C_r, parallel axes; continued along its tangent above"

    @staticmethod
    def scale(contact: ContactProperties) -> float:
        """4 pi E* C_r l/e [N]."""
        line = contact.modulus * contact.contact_length
        return 4.0 * math.pi * line * contact.clearance * math.exp(-1.0)
