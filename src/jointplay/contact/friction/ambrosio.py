"""Ambrosio's modified Coulomb friction, the paper's own law (eqs 20, 21)."""

from __future__ import annotations

from typing import Any

from jointplay.contact.law import FrictionLaw
from jointplay.errors import JointplayError, require_non_negative


class Ambrosio(FrictionLaw):
    """No friction up to v0, a ramp to mu_d at v1, mu_d above (eq. 21).

    The paper prints 1 instead of mu_d in the last branch; mu_d is what makes it continuous.

    Args:
        mu_d: dynamic friction coefficient, >= 0.
        v0, v1: sliding speeds at which the ramp begins and ends, 0 <= v0 < v1 [m/s]. The paper
            gives none; 1e-4 and 1e-3 m/s are this project's choice.
    """

    name = "ambrosio"
    formula = (
        r"\mu = 0\ (|v_t|\le v_0),\quad \mu_d\frac{|v_t|-v_0}{v_1-v_0},\quad \mu_d\ (|v_t|\ge v_1)"
    )
    reference = "J. A. C. Ambrosio, Proc. Euromech 447 (2003)"
    validity = "sliding; no sticking: a resting contact creeps below v1, freely below v0"

    def __init__(self, mu_d: float = 0.1, v0: float = 1e-4, v1: float = 1e-3) -> None:
        """Check and keep the coefficient and the ramp."""
        self.mu_d = require_non_negative("friction coefficient", mu_d, "")
        self.v0 = require_non_negative("v0", v0, "m/s")
        self.v1 = require_non_negative("v1", v1, "m/s")
        if self.v1 <= self.v0:
            raise JointplayError(
                f"v1 must be greater than v0, got v0 = {self.v0:g} and v1 = {self.v1:g} m/s"
            )

    @staticmethod
    def function(speed: float, p: Any) -> float:
        """Evaluate eq. 21 with p = (mu_d, v0, v1)."""
        if speed <= p[1]:
            return 0.0
        if speed >= p[2]:
            return p[0]
        return p[0] * (speed - p[1]) / (p[2] - p[1])

    def parameters(self) -> tuple[float, ...]:
        """mu_d, v0 [m/s], v1 [m/s]."""
        return self.mu_d, self.v0, self.v1
