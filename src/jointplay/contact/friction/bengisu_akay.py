"""Bengisu and Akay's friction: up to the static coefficient, then down to the dynamic one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import FrictionLaw, require_static
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class BengisuAkay(FrictionLaw):
    """A parabola up to mu_s at v0, then an exponential fall from mu_s to mu_d.

    mu = mu_s (1 - (|v_t| - v0)^2/v0^2) below v0, mu_d + (mu_s - mu_d) exp(-xi (|v_t| - v0)) above.
    """

    name = "bengisu-akay"
    formula = (
        r"\mu = \mu_s\left[1-\frac{(|v_t|-v_0)^2}{v_0^2}\right]\ (|v_t|<v_0),\quad "
        r"\mu_d+(\mu_s-\mu_d)\,\mathrm e^{-\xi(|v_t|-v_0)}\ (|v_t|\ge v_0)"
    )
    reference = "M. T. Bengisu, A. Akay, J. Sound Vib. 171 (1994) 557-570"
    validity = "sliding with a Stribeck fall; no sticking: a resting contact creeps below v0"

    mu_s: float = quantity("", default=None, least=0.0)
    """Static friction coefficient, >= mu_d; 1.5 mu_d if not given."""
    mu_d: float = quantity("", default=0.1, least=0.0)
    """Dynamic friction coefficient."""
    v0: float = quantity("m/s", default=1e-3, above=0.0)
    """Sliding speed of the largest friction [m/s]."""
    xi: float = quantity("s/m", default=100.0, above=0.0)
    """Rate of the fall [s/m]."""

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_static(self)

    @staticmethod
    def function(speed: float, mu_s: float, mu_d: float, v0: float, xi: float) -> float:
        """Evaluate the law."""
        if speed < v0:
            return mu_s * speed * (2.0 * v0 - speed) / (v0 * v0)
        return mu_d + (mu_s - mu_d) * math.exp(-xi * (speed - v0))
