"""Cylindrical (line) contacts whose depth is a function of the force: one inverse for all of them.

Johnson, Radzimovsky, Goldsmith, and Dubowsky and Freudenstein all write the depth of a cylinder
in a bore as

    delta = F/(pi E* l) [ln(C/F) + c] = F/(pi E* l) ln(K/F),    K = C e^c

and differ in K. With u = ln(K/F) and s = pi E* l delta/K this is s = u e^-u, so that

    F = pi E* l delta/u,    u - ln(u) = -ln(s),    u > 1,

the lower branch of Lambert's W. The force as a function of the depth has the slope
pi E* l/(u - 1): it stiffens without bound as u falls to 1, where the logarithm has lost its
meaning, and has no force for greater depths. It is therefore left at u = 2, where its slope is
pi E* l, along the tangent: continuous with its first derivative, rising, finite for all depths.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties
from jointplay.contact.normal.hertzian import CONTACT_WIDTH_LIMIT, HysteresisLaw

LINE_YIELD = 1.79
"""Peak pressure over yield strength at first yield of a line contact (von Mises, nu = 0.3).

K. L. Johnson, Contact Mechanics, Cambridge University Press, 1985, section 6.1.
"""

LARGEST_S = 2.0 * math.exp(-2.0)
"""s at u = 2, beyond which the law is continued along its tangent."""


def line_warnings(
    law: str, contact: ContactProperties, force: float, max_depth: float
) -> list[str]:
    """Say in what a line contact under `force` [N] is no longer small or no longer elastic."""
    lines = []
    share = force / contact.contact_length
    half_width = math.sqrt(4.0 * share * contact.radius / (math.pi * contact.modulus))
    if half_width > CONTACT_WIDTH_LIMIT * contact.journal_radius:
        lines.append(
            f"{law} assumes a small contact: at the depth {max_depth:.3g} m its half-width is "
            f"{half_width / contact.journal_radius:.2g} of the journal's radius"
        )
    pressure = math.sqrt(share * contact.modulus / (math.pi * contact.radius))
    if pressure > LINE_YIELD * contact.yield_strength:
        lines.append(
            f"{law} is elastic: at the depth {max_depth:.3g} m its peak pressure {pressure:.3g} Pa "
            f"exceeds 1.79 times the yield strength {contact.yield_strength:.3g} Pa"
        )
    return lines


@dataclass(frozen=True)
class LineContactLaw(HysteresisLaw):
    """Base of the laws delta = F/(pi E* l) ln(K/F), which differ in K.

    Each radial contact is one end of the journal and stands for half of its length (l = L_j/2),
    so that a journal with parallel axes, touching at both ends, has the force of its whole length.
    A rim on a flat end wall is no line: there, and wherever l is 0, the law is Hertz's with the
    joint's axial stiffness. The references have no loss; the damping is that of
    Lankarani-Nikravesh, a = 3 (1 - c_e^2)/4, for radial and axial contacts alike.
    """

    line = True

    @staticmethod
    def factor(restitution: float) -> float:
        """3 (1 - c_e^2)/4, as Lankarani-Nikravesh."""
        return 0.75 * (1.0 - restitution**2)

    @staticmethod
    @abstractmethod
    def scale(contact: ContactProperties) -> float:
        """K [N]: the force at which the formula's depth would be zero again."""

    @staticmethod
    def function(
        delta: float,
        ddelta: float,
        ddelta0: float,
        slope: float,
        factor: float,
        inverse_scale: float,
    ) -> float:
        """Evaluate with pi E* l, a and pi E* l/K, or with Hertz's k, a and 0."""
        s = inverse_scale * delta
        if s == 0.0:
            elastic = slope * delta * math.sqrt(delta)
        elif s >= LARGEST_S:
            elastic = slope * (delta - 0.5 * LARGEST_S / inverse_scale)
        else:
            # u - ln(u) is convex, and nearly linear here. The start is its expansion about u = 1,
            # within 5 % for s > 1e-40; three Newton steps then give u in all digits for any s.
            level = -math.log(s)
            root = math.sqrt(2.0 * (level - 1.0))
            u = 1.0 + root * (1.0 + root * (1.0 / 3.0 + 0.01 * root))
            u *= (level + math.log(u) - 1.0) / (u - 1.0)
            u *= (level + math.log(u) - 1.0) / (u - 1.0)
            u *= (level + math.log(u) - 1.0) / (u - 1.0)
            elastic = slope * delta / u
        return elastic * (1.0 + factor * ddelta / ddelta0)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """pi E* l [N/m], a and pi E* l/K [1/m]; k, a and 0 where the contact is no line."""
        factor = self.factor(contact.restitution)
        if contact.contact_length == 0.0:
            return contact.stiffness, factor, 0.0
        slope = math.pi * contact.modulus * contact.contact_length
        return slope, factor, slope / self.scale(contact)

    def depth(self, force: float, contact: ContactProperties) -> float:
        """Depth under a resting force [m], by the formula itself; the inverse of `function`.

        Meaningful up to K/e^2, beyond which `function` follows its tangent.
        """
        slope = math.pi * contact.modulus * contact.contact_length
        return force / slope * math.log(self.scale(contact) / force)

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        if contact.contact_length == 0.0:
            return super()._limits(contact, max_depth)
        lines = []
        slope, factor, inverse_scale = self.parameters(contact)
        limit = LARGEST_S / inverse_scale
        if max_depth > limit:
            lines.append(
                f"{self.name} holds to the depth {limit:.3g} m, above which it is continued along "
                f"its tangent; the deepest was {max_depth:.3g} m"
            )
        force = self.function(max_depth, 0.0, 1.0, slope, factor, inverse_scale)
        return lines + line_warnings(self.name, contact, force, max_depth)
