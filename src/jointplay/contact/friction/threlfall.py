"""Threlfall's friction (1978)."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.law import FrictionLaw
from jointplay.errors import require_non_negative, require_positive


class Threlfall(FrictionLaw):
    """mu = mu_d (1 - exp(-3 |v_t|/v_r)) up to v_r, constant above.

    The constant is the value at v_r, (1 - e^-3) mu_d = 0.950 mu_d: with mu_d itself the
    coefficient would jump there.

    Args:
        mu_d: friction coefficient, >= 0.
        v_r: sliding speed at which the rise ends, > 0 [m/s].
    """

    name = "threlfall"
    formula = r"\mu = \mu_d\left(1-\mathrm e^{-3\min(|v_t|/v_r,\,1)}\right)"
    reference = "D. C. Threlfall, Mech. Mach. Theory 13 (1978) 475-483"
    validity = "sliding, where it is 0.95 mu_d; no sticking: a resting contact creeps below v_r"

    def __init__(self, mu_d: float = 0.1, v_r: float = 1e-3) -> None:
        """Check and keep coefficient and speed."""
        self.mu_d = require_non_negative("friction coefficient", mu_d, "")
        self.v_r = require_positive("v_r", v_r, "m/s")

    @staticmethod
    def function(speed: float, p: Any) -> float:
        """Evaluate the law with p = (mu_d, v_r)."""
        return p[0] * (1.0 - math.exp(-3.0 * min(speed / p[1], 1.0)))

    def parameters(self) -> tuple[float, ...]:
        """mu_d, v_r [m/s]."""
        return self.mu_d, self.v_r
