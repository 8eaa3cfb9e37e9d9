"""Brown and McPhee's smooth friction with a Stribeck fall (2016)."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.law import FrictionLaw, require_static
from jointplay.errors import require_non_negative, require_positive


class BrownMcPhee(FrictionLaw):
    """mu = mu_d tanh(4 x) + (mu_s - mu_d) x/(x^2/4 + 3/4)^2, x = |v_t|/v_t.

    The reference adds a viscous force mu_v |v_t| tanh(4 F_n/F_nt) (from memory, no source seen),
    which tends to a plain damper mu_v |v_t| above the transition load F_nt. That is no multiple of
    the normal force, as `FrictionLaw` is, and is left out; a law with bristles and sigma2 has one
    that is.

    Args:
        mu_s: static friction coefficient, >= mu_d: the largest, near v_t.
        mu_d: dynamic friction coefficient, >= 0.
        v_t: transition speed, > 0 [m/s].
    """

    name = "brown-mcphee"
    formula = (
        r"\mu = \mu_d\tanh 4x+\frac{(\mu_s-\mu_d)\,x}{\left(\tfrac14x^2+\tfrac34\right)^2},\quad "
        r"x=\frac{|v_t|}{v_t^*}"
    )
    reference = "P. Brown, J. McPhee, J. Comput. Nonlinear Dyn. 11 (2016) 054502"
    validity = "sliding with a Stribeck fall; no sticking: a resting contact creeps below v_t"

    def __init__(self, mu_s: float = 0.15, mu_d: float = 0.1, v_t: float = 1e-3) -> None:
        """Check and keep coefficients and speed."""
        self.mu_d = require_non_negative("mu_d", mu_d, "")
        self.mu_s = require_static(mu_s, self.mu_d)
        self.v_t = require_positive("v_t", v_t, "m/s")

    @staticmethod
    def function(speed: float, p: Any) -> float:
        """Evaluate the law with p = (mu_s, mu_d, v_t)."""
        x = speed / p[2]
        fall = 0.25 * x * x + 0.75
        return p[1] * math.tanh(4.0 * x) + (p[0] - p[1]) * x / (fall * fall)

    def parameters(self) -> tuple[float, ...]:
        """mu_s, mu_d, v_t [m/s]."""
        return self.mu_s, self.mu_d, self.v_t
