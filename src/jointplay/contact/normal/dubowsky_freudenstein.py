"""Dubowsky and Freudenstein's pin in a cylinder."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.line_contact import LineContactLaw


@dataclass(frozen=True)
class DubowskyFreudenstein(LineContactLaw):
    """delta = f/(pi E*) [ln(pi E* L^3/(F R)) + 1], f = F/L; see `LineContactLaw`.

    The references write sigma_i + sigma_j for 1/(pi E*), sigma = (1 - nu^2)/(pi E) of eq. 12, with
    its pi: without it (as in the code of DyS) the depth would be about pi times as large, and plane
    elasticity has 1/(pi E*) before the logarithm. They write L^m with m = 3, the only exponent
    that makes the logarithm's argument a number. Where a contact stands for a part l of the
    journal's length L, the force per length counts: pi E* L^2/(f R) with f = F/l, so that both
    ends together give the force of the whole.
    """

    name = "dubowsky-freudenstein"
    formula = (
        r"\delta = \frac{f}{\pi E^*}\left[\ln\frac{\pi E^* L^2}{f R}+1\right],\quad f=\frac{F}{l}"
    )
    reference = "S. Dubowsky, F. Freudenstein, J. Eng. Ind. 93 (1971)"
    validity = (
        "journals about as long as thick: its depth grows with the logarithm of the length, which "
        "plane elasticity does not know; parallel axes"
    )

    @staticmethod
    def scale(contact: ContactProperties) -> float:
        """pi E* L^2 l e/R [N]."""
        line = math.pi * contact.modulus * contact.contact_length
        return line * contact.journal_length**2 / contact.radius * math.e
