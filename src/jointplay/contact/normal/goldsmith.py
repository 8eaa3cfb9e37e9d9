"""Goldsmith's cylinder in a bore, as the clearance literature prints it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.line_contact import LineContactLaw


@dataclass(frozen=True)
class Goldsmith(LineContactLaw):
    """delta = f/(pi E*) [ln(pi E* L/(F R)) + 1], f = F/L, lengths in metres; see `LineContactLaw`.

    The clearance literature gives Goldsmith the exponent m = 1 of L where Dubowsky and
    Freudenstein have 3. The logarithm's argument then has the unit 1/m^2: the law depends on the
    unit of length. It is here, in metres, for comparison with that literature. Its sigma is
    (1 - nu^2)/(pi E), with its pi, as in `DubowskyFreudenstein`. As there, but with
    the force per length of the contact, f = F/l: pi E*/(f R).
    """

    name = "goldsmith"
    formula = (
        r"\delta = \frac{f}{\pi E^*}"
        r"\left[\ln\frac{\pi E^*\cdot 1\,\mathrm{m}^2}{f R}+1\right],\quad f=\frac{F}{l}"
    )
    reference = "W. Goldsmith, Impact, Edward Arnold, 1960"
    validity = (
        "comparison with the literature only: the exponent 1 of L makes it depend on the unit of "
        "length (metres here); several times softer than the others"
    )

    @staticmethod
    def scale(contact: ContactProperties) -> float:
        """pi E* l e (1 m)^2/R [N]."""
        return math.pi * contact.modulus * contact.contact_length * math.e / contact.radius
