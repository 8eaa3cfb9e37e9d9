"""Brown and McPhee's smooth friction with a Stribeck fall (2016)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.law import FrictionLaw, require_static
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class BrownMcPhee(FrictionLaw):
    """mu = mu_d tanh(4 x) + (mu_s - mu_d) x/(x^2/4 + 3/4)^2, x = |v_t|/v_t.

    The reference adds a viscous force mu_v |v_t| tanh(4 F_n/F_nt) (from memory, no source seen),
    which tends to a plain damper mu_v |v_t| above the transition load F_nt. That is no multiple of
    the normal force, as `FrictionLaw` is, and is left out; a law with bristles and sigma2 has one
    that is.
    """

    name = "brown-mcphee"
    formula = (
        r"\mu = \mu_d\tanh 4x+\frac{(\mu_s-\mu_d)\,x}{\left(\tfrac14x^2+\tfrac34\right)^2},\quad "
        r"x=\frac{|v_t|}{v_t^*}"
    )
    reference = "P. Brown, J. McPhee, J. Comput. Nonlinear Dyn. 11 (2016) 054502"
    validity = "sliding with a Stribeck fall; no sticking: a resting contact creeps below v_t"

    mu_s: float = quantity("", default=None, least=0.0)
    """Static friction coefficient, >= mu_d: the largest, near v_t; 1.5 mu_d if not given."""
    mu_d: float = quantity("", default=0.1, least=0.0)
    """Dynamic friction coefficient."""
    v_t: float = quantity("m/s", default=1e-3, above=0.0)
    """Transition speed [m/s]."""

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_static(self)

    @staticmethod
    def function(speed: float, mu_s: float, mu_d: float, v_t: float) -> float:
        """Evaluate the law."""
        x = speed / v_t
        fall = 0.25 * x * x + 0.75
        return mu_d * math.tanh(4.0 * x) + (mu_s - mu_d) * x / (fall * fall)
