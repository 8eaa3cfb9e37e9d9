"""Coulomb friction, with the ramp through rest that a force needs to be a function of speed."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.law import FrictionLaw
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """mu = mu_d for |v_t| >= v_t, mu_d |v_t|/v_t below.

    Coulomb's law itself jumps with the sign of the velocity at rest, which no fixed step follows.
    A ramp is the least that removes the jump. Under a normal force F_n it is a damper of
    mu_d F_n/v_t, which an explicit step h follows for mu_d F_n/v_t < 2 m/h: v_t can be as small
    as that allows.
    """

    name = "coulomb"
    formula = r"\mu = \mu_d\min(|v_t|/v_t^*,\ 1)"
    reference = "C. A. de Coulomb, Theorie des machines simples (1785)"
    validity = "sliding; no sticking: a resting contact creeps below v_t"

    mu_d: float = quantity("", default=0.1, least=0.0, words="friction coefficient")
    """Dynamic friction coefficient."""
    v_t: float = quantity("m/s", default=1e-3, above=0.0)
    """Sliding speed at which the ramp ends [m/s]."""

    @staticmethod
    def function(speed: float, mu_d: float, v_t: float) -> float:
        """Evaluate the law."""
        return mu_d * min(speed / v_t, 1.0)
