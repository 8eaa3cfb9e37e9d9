"""Dahl friction: bristles that bend and slip."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.friction.bristle import BristleLaw
from jointplay.errors import require_positive


class Dahl(BristleLaw):
    """dz/dt = v - sigma0 |v| z / mu_d,  F_t = -F_n sigma0 z.

    Dahl's curve with the exponent 1, here per unit of normal force and with vectors in the plane of
    contact.

    Args:
        mu_d: friction coefficient, > 0.
        sigma0: stiffness of the bristles per normal force [1/m].

    Raises:
        JointplayError: a value that is not positive.
    """

    name = "dahl"
    formula = (
        r"\dot{\mathbf z} = \mathbf v_t-\frac{\sigma_0|v_t|}{\mu_d}\mathbf z,\quad "
        r"\mathbf F_t = -F_n\sigma_0\mathbf z"
    )
    reference = "P. R. Dahl, Aerospace Corporation, TOR-0158(3107-18)-1 (1968)"
    validity = "sticking and sliding at one coefficient; no Stribeck fall, no growth at rest"

    def __init__(self, mu_d: float = 0.1, sigma0: float = 1e5) -> None:
        """Check and keep the parameters."""
        self.mu_d = require_positive("mu_d", mu_d, "")
        self.sigma0 = require_positive("sigma0", sigma0, "1/m")

    @staticmethod
    def function(speed: float, normal: float, dwell: float, p: Any, out: Any) -> None:
        """Evaluate with p = (mu_d, sigma0)."""
        out[0] = 1.0
        out[1] = p[1] * speed / p[0]
        out[2] = p[1] * normal
        out[3] = 0.0
        out[4] = 0.0
        out[5] = math.inf
        out[6] = 0.0
        out[7] = 0.0

    def parameters(self) -> tuple[float, ...]:
        """mu_d, sigma0 [1/m]."""
        return self.mu_d, self.sigma0
