"""Hunt-Crossley form with free exponents (eqs 10, 14)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.contact.normal.hertzian import hertz_warnings
from jointplay.contact.normal.linear_spring import REFERENCE_PENETRATION_M
from jointplay.contact.normal.restitution import effective_restitution
from jointplay.core.errors import JointplayError
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class HuntCrossley(NormalForceLaw):
    """F_n = k delta^n + b delta^p sgn(ddelta) |ddelta|^q (eq. 10).

    The damping is that of eq. 14, b delta^p = 3 k (1 - c_e^2) delta^n / (4 ddelta0), written for
    any exponents so that at the reference depth of 10 um and at |ddelta| = ddelta0 stiffness and
    damping keep the proportion of eq. 14 whatever n, p and q are:

        k = k_Hertz d^(3/2 - n),  b = 3/4 (1 - c_e^2) k d^(n - p) / ddelta0^q,  d = 10 um

    With n = p = 3/2, q = 1 this is Lankarani-Nikravesh, as eq. 18 is a case of eq. 10.
    Hunt and Crossley's own factor of 1975, 3/2 (1 - c_e), is `HuntCrossley1975`.
    """

    name = "hunt-crossley"
    formula = r"F_n = k'\delta^n + b\,\delta^p\,\mathrm{sgn}(\dot\delta)\,|\dot\delta|^q"
    reference = "K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445"
    validity = "c_e above 0.8, as Lankarani-Nikravesh; away from 10 um and n = p, q = 1 unproven"

    n: float = quantity("", default=1.5, above=0.0, words="exponent n")
    """Exponent of the elastic part, >= 1."""
    p: float = quantity("", default=1.5, above=0.0, words="exponent p")
    """Exponent of the penetration in the damping part; 0 would make the force jump."""
    q: float = quantity("", default=1.0, above=0.0, words="exponent q")
    """Exponent of the penetration rate."""

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        if self.n < 1.0:
            raise JointplayError(f"exponent n must be at least 1, got {self.n:g}", where=("n",))

    @staticmethod
    def function(
        delta: float,
        ddelta: float,
        ddelta0: float,
        stiffness: float,
        damping: float,
        exponent: float,
        depth_exponent: float,
        rate_exponent: float,
    ) -> float:
        """Evaluate eqs 10 and 14."""
        elastic = stiffness * delta**exponent
        ratio = abs(ddelta) / ddelta0
        return elastic + math.copysign(
            damping * delta**depth_exponent * ratio**rate_exponent, ddelta
        )

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """Stiffness, damping factor and the three exponents."""
        k = contact.stiffness * REFERENCE_PENETRATION_M ** (1.5 - self.n)
        scale = REFERENCE_PENETRATION_M ** (self.n - self.p)
        factor = 0.75 * (1.0 - contact.restitution**2) * k * scale
        return k, factor, self.n, self.p, self.q

    def effective_restitution(self, restitution: float) -> float | None:
        """That of Lankarani-Nikravesh if n = p and q = 1; no closed form otherwise."""
        if self.n != self.p or self.q != 1.0:
            return None
        return effective_restitution(0.75 * (1.0 - restitution**2))

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        return hertz_warnings(self.name, contact, max_depth)
