"""LuGre friction: bristles that bend and slip, with the Stribeck effect."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.friction.bristle import Bristles, StribeckBristles


@dataclass(frozen=True)
class LuGre(StribeckBristles):
    """dz/dt = v - sigma0 |v| z / g(v),  F_t = -F_n (sigma0 z + sigma1 dz/dt + sigma2 v).

    g(v) = mu_d + (mu_s - mu_d) exp(-(v/v_s)^2), here per unit of normal force and with vectors in
    the plane of contact.

    Passive, at a constant normal force, if sigma2 >= sigma1 (mu_s - mu_d)/mu_d (`passive`): with
    the bristles' energy sigma0 z^2/2 and w = sigma0 z the power that is lost,

        (sigma1 + sigma2) v^2 - sigma1 v^2 w/g + w^2 v/g,

    is not negative, for w <= mu_s and g >= mu_d. (N. Barabanov, R. Ortega, IEEE Trans. Automatic
    Control 45 (2000) 830-832, show that it is necessary as well, by its title; not seen.) The
    defaults are not passive: at speeds far above v_s their bristles can feed energy while they let
    go.

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

    @property
    def passive(self) -> bool:
        """Whether the law can never feed energy, at a constant normal force."""
        return self.sigma2 * self.mu_d >= self.sigma1 * (self.mu_s - self.mu_d)

    @staticmethod
    def function(
        speed: float,
        normal: float,
        dwell: float,
        mu_d: float,
        mu_s: float,
        v_s: float,
        sigma0: float,
        sigma1: float,
        sigma2: float,
    ) -> Bristles:
        """Evaluate the law."""
        ratio = speed / v_s
        g = mu_d + (mu_s - mu_d) * math.exp(-ratio * ratio)
        return Bristles(
            bending=1.0,
            release=sigma0 * speed / g,
            stiffness=sigma0 * normal,
            damping=sigma1 * normal,
            viscous=sigma2 * normal,
            cap=math.inf,
            dwell_target=0.0,
            dwell_rate=0.0,
        )
