"""Threlfall's friction (1978)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import FrictionLaw
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class Threlfall(FrictionLaw):
    """mu = mu_d (1 - exp(-3 |v_t|/v_r)) up to v_r, constant above.

    The constant is the value at v_r, (1 - e^-3) mu_d = 0.950 mu_d: with mu_d itself the
    coefficient would jump there.
    """

    name = "threlfall"
    formula = r"\mu = \mu_d\left(1-\mathrm e^{-3\min(|v_t|/v_r,\,1)}\right)"
    reference = "D. C. Threlfall, Mech. Mach. Theory 13 (1978) 475-483"
    validity = "sliding, where it is 0.95 mu_d; no sticking: a resting contact creeps below v_r"

    mu_d: float = quantity("", default=0.1, least=0.0, words="friction coefficient")
    """Friction coefficient."""
    v_r: float = quantity("m/s", default=1e-3, above=0.0)
    """Sliding speed at which the rise ends [m/s]."""

    @staticmethod
    def function(speed: float, mu_d: float, v_r: float) -> float:
        """Evaluate the law."""
        return mu_d * (1.0 - math.exp(-3.0 * min(speed / v_r, 1.0)))
