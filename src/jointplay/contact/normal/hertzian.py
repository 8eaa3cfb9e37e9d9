"""What all laws on Hertz's elastic part share: their damping, and where Hertz no longer holds."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.contact.normal.restitution import effective_restitution

CONTACT_WIDTH_LIMIT = 0.3
"""Contact radius over journal radius up to which Hertz's parabola stands for a circle.

The parabola's height is off by (a/R)^2/4, 2 % here.
"""

POINT_YIELD = 1.60
"""Peak pressure over yield strength at first yield of a point contact (von Mises, nu = 0.3).

K. L. Johnson, Contact Mechanics, Cambridge University Press, 1985, section 6.1.
"""


def hertz_warnings(law: str, contact: ContactProperties, max_depth: float) -> list[str]:
    """Say in what a point contact of `max_depth` > 0 [m] is too large or no longer elastic."""
    if not contact.radius:
        return []
    lines = []
    radius = math.sqrt(max_depth * contact.radius)
    if radius > CONTACT_WIDTH_LIMIT * contact.journal_radius:
        lines.append(
            f"{law} assumes a small contact: at the depth {max_depth:.3g} m its radius is "
            f"{radius / contact.journal_radius:.2g} of the journal's"
        )
    pressure = 2.0 * contact.modulus / math.pi * math.sqrt(max_depth / contact.radius)
    if pressure > POINT_YIELD * contact.yield_strength:
        lines.append(
            f"{law} is elastic: at the depth {max_depth:.3g} m its peak pressure {pressure:.3g} Pa "
            f"exceeds 1.6 times the yield strength {contact.yield_strength:.3g} Pa"
        )
    return lines


def hysteresis(
    delta: float, ddelta: float, ddelta0: float, stiffness: float, factor: float
) -> float:
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0]."""
    return stiffness * delta * math.sqrt(delta) * (1.0 + factor * ddelta / ddelta0)


@dataclass(frozen=True)
class HysteresisLaw(NormalForceLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0]; a law of this family is its factor a(c_e)."""

    @staticmethod
    @abstractmethod
    def factor(restitution: float) -> float:
        """Hysteresis factor a for the nominal restitution c_e."""

    function: ClassVar[Callable[..., float]] = staticmethod(hysteresis)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """k [N/m^1.5] and a."""
        return contact.stiffness, self.factor(contact.restitution)

    def effective_restitution(self, restitution: float) -> float:
        """Restitution of a free impact, from a (1 + e) = ln((1 + a)/(1 - a e))."""
        return effective_restitution(self.factor(restitution))

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        return hertz_warnings(self.name, contact, max_depth)
