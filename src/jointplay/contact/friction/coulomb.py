"""Coulomb friction, with the ramp through rest that a force needs to be a function of speed."""

from __future__ import annotations

from typing import Any

from jointplay.contact.law import FrictionLaw
from jointplay.errors import require_non_negative, require_positive


class Coulomb(FrictionLaw):
    """mu = mu_d for |v_t| >= v_t, mu_d |v_t|/v_t below.

    Coulomb's law itself jumps with the sign of the velocity at rest, which no fixed step follows.
    A ramp is the least that removes the jump. Under a normal force F_n it is a damper of
    mu_d F_n/v_t, which an explicit step h follows for mu_d F_n/v_t < 2 m/h: v_t can be as small
    as that allows.

    Args:
        mu_d: dynamic friction coefficient, >= 0.
        v_t: sliding speed at which the ramp ends, > 0 [m/s].
    """

    name = "coulomb"
    formula = r"\mu = \mu_d\min(|v_t|/v_t^*,\ 1)"
    reference = "C. A. de Coulomb, Theorie des machines simples (1785)"
    validity = "sliding; no sticking: a resting contact creeps below v_t"

    def __init__(self, mu_d: float = 0.1, v_t: float = 1e-3) -> None:
        """Check and keep coefficient and ramp."""
        self.mu_d = require_non_negative("friction coefficient", mu_d, "")
        self.v_t = require_positive("v_t", v_t, "m/s")

    @staticmethod
    def function(speed: float, p: Any) -> float:
        """Evaluate the law with p = (mu_d, v_t)."""
        return p[0] * min(speed / p[1], 1.0)

    def parameters(self) -> tuple[float, ...]:
        """mu_d, v_t [m/s]."""
        return self.mu_d, self.v_t
