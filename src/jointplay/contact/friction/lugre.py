"""LuGre friction: bristles that bend and slip, with the Stribeck effect."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.friction.bristle import BristleLaw
from jointplay.errors import JointplayError, require_non_negative, require_positive


class LuGre(BristleLaw):
    """dz/dt = v - sigma0 |v| z / g(v),  F_t = -F_n (sigma0 z + sigma1 dz/dt + sigma2 v).

    g(v) = mu_d + (mu_s - mu_d) exp(-(v/v_s)^2), here per unit of normal force and with vectors in
    the plane of contact.

    Passive, at a constant normal force, if sigma2 >= sigma1 (mu_s - mu_d)/mu_d (`passive`): with
    the bristles' energy sigma0 z^2/2 and w = sigma0 z the power that is lost,

        (sigma1 + sigma2) v^2 - sigma1 v^2 w/g + w^2 v/g,

    is not negative, for w <= mu_s and g >= mu_d. (N. Barabanov, R. Ortega, IEEE Trans. Automatic
    Control 45 (2000), show that it is necessary as well: from memory, not seen.) The defaults are
    not passive: at speeds far above v_s their bristles can feed energy while they let go.

    Args:
        mu_d, mu_s: dynamic and static friction coefficient, 0 < mu_d <= mu_s.
        v_s: Stribeck speed [m/s].
        sigma0: stiffness of the bristles per normal force [1/m].
        sigma1: their damping per normal force [s/m].
        sigma2: viscous friction per normal force [s/m].

    Raises:
        JointplayError: a value out of range.
    """

    name = "lugre"
    formula = (
        r"\dot{\mathbf z} = \mathbf v_t-\frac{\sigma_0|v_t|}{g}\mathbf z,\quad "
        r"\mathbf F_t = -F_n(\sigma_0\mathbf z+\sigma_1\dot{\mathbf z}+\sigma_2\mathbf v_t),\quad "
        r"g = \mu_d+(\mu_s-\mu_d)\,\mathrm e^{-(v_t/v_s)^2}"
    )
    reference = (
        "C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control "
        "40 (1995) 419-425"
    )
    validity = (
        "sticking and sliding with a Stribeck fall; drifts slowly under an oscillating force below "
        "the static one; passive only if sigma2 >= sigma1 (mu_s - mu_d)/mu_d"
    )

    def __init__(
        self,
        mu_d: float = 0.1,
        mu_s: float = 0.15,
        v_s: float = 1e-2,
        sigma0: float = 1e5,
        sigma1: float = 10.0,
        sigma2: float = 0.0,
    ) -> None:
        """Check and keep the parameters."""
        self.mu_d = require_positive("mu_d", mu_d, "")
        self.mu_s = require_positive("mu_s", mu_s, "")
        self.v_s = require_positive("v_s", v_s, "m/s")
        self.sigma0 = require_positive("sigma0", sigma0, "1/m")
        self.sigma1 = require_non_negative("sigma1", sigma1, "s/m")
        self.sigma2 = require_non_negative("sigma2", sigma2, "s/m")
        if self.mu_s < self.mu_d:
            raise JointplayError(
                f"mu_s must not be smaller than mu_d, got mu_s = {mu_s:g} and mu_d = {mu_d:g}"
            )

    @property
    def passive(self) -> bool:
        """Whether the law can never feed energy, at a constant normal force."""
        return self.sigma2 * self.mu_d >= self.sigma1 * (self.mu_s - self.mu_d)

    @staticmethod
    def function(speed: float, normal: float, dwell: float, p: Any, out: Any) -> None:
        """Evaluate with p = (mu_d, mu_s, v_s, sigma0, sigma1, sigma2)."""
        ratio = speed / p[2]
        g = p[0] + (p[1] - p[0]) * math.exp(-ratio * ratio)
        out[0] = 1.0
        out[1] = p[3] * speed / g
        out[2] = p[3] * normal
        out[3] = p[4] * normal
        out[4] = p[5] * normal
        out[5] = math.inf
        out[6] = 0.0
        out[7] = 0.0

    def parameters(self) -> tuple[float, ...]:
        """mu_d, mu_s, v_s [m/s], sigma0 [1/m], sigma1 [s/m], sigma2 [s/m]."""
        return self.mu_d, self.mu_s, self.v_s, self.sigma0, self.sigma1, self.sigma2
