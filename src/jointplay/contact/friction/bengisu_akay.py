"""Bengisu and Akay's friction: up to the static coefficient, then down to the dynamic one."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.law import FrictionLaw, require_static
from jointplay.errors import require_non_negative, require_positive


class BengisuAkay(FrictionLaw):
    """A parabola up to mu_s at v0, then an exponential fall from mu_s to mu_d.

    mu = mu_s (1 - (|v_t| - v0)^2/v0^2) below v0, mu_d + (mu_s - mu_d) exp(-xi (|v_t| - v0)) above.

    Args:
        mu_s: static friction coefficient, >= mu_d.
        mu_d: dynamic friction coefficient, >= 0.
        v0: sliding speed of the largest friction, > 0 [m/s].
        xi: rate of the fall, > 0 [s/m].
    """

    name = "bengisu-akay"
    formula = (
        r"\mu = \mu_s\left[1-\frac{(|v_t|-v_0)^2}{v_0^2}\right]\ (|v_t|<v_0),\quad "
        r"\mu_d+(\mu_s-\mu_d)\,\mathrm e^{-\xi(|v_t|-v_0)}\ (|v_t|\ge v_0)"
    )
    reference = "M. T. Bengisu, A. Akay, J. Sound Vib. 171 (1994) 557-570"
    validity = "sliding with a Stribeck fall; no sticking: a resting contact creeps below v0"

    def __init__(
        self, mu_s: float = 0.15, mu_d: float = 0.1, v0: float = 1e-3, xi: float = 100.0
    ) -> None:
        """Check and keep coefficients, speed and rate."""
        self.mu_d = require_non_negative("mu_d", mu_d, "")
        self.mu_s = require_static(mu_s, self.mu_d)
        self.v0 = require_positive("v0", v0, "m/s")
        self.xi = require_positive("xi", xi, "s/m")

    @staticmethod
    def function(speed: float, p: Any) -> float:
        """Evaluate the law with p = (mu_s, mu_d, v0, xi)."""
        if speed < p[2]:
            return p[0] * speed * (2.0 * p[2] - speed) / (p[2] * p[2])
        return p[1] + (p[0] - p[1]) * math.exp(-p[3] * (speed - p[2]))

    def parameters(self) -> tuple[float, ...]:
        """mu_s, mu_d, v0 [m/s], xi [s/m]."""
        return self.mu_s, self.mu_d, self.v0, self.xi
