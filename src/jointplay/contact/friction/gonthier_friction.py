"""Friction of Gonthier et al.: bristles that remember for how long they have stuck."""

from __future__ import annotations

import math
from typing import Any

from jointplay.contact.friction.bristle import BristleLaw
from jointplay.errors import JointplayError, require_non_negative, require_positive


class GonthierFriction(BristleLaw):
    """Bristles that stick, slip, and stick the better the longer they have rested.

    With s = exp(-(v/v_s)^2), 1 when sticking and 0 when sliding, and the dwell s_d:

        dz/dt    = s v + (1 - s) (mu_d F_n / k * v/|v| - z) / tau,    tau = d/k
        ds_d/dt  = (s - s_d) / tau_d while s >= s_d, (s - s_d) / tau else
        F_t      = -(k z + d dz/dt), at most [mu_d + (mu_s - mu_d) s_d] F_n, and - c F_n v

    with k = sigma0 F_n and d = sigma1 F_n, here with a stiffness in proportion to the normal force.

    Args:
        mu_d, mu_s: dynamic and static friction coefficient, 0 < mu_d <= mu_s.
        v_s: speed over which sticking turns into sliding [m/s].
        sigma0: stiffness of the bristles per normal force [1/m].
        sigma1: their damping per normal force, > 0 [s/m].
        sigma2: viscous friction per normal force [s/m].
        dwell_time: time constant tau_d with which static friction grows [s].

    Raises:
        JointplayError: a value out of range.
    """

    name = "gonthier"
    formula = (
        r"\dot{\mathbf z} = s\mathbf v_t+(1-s)\frac1\tau"
        r"\left(\frac{\mu_d F_n}{k}\frac{\mathbf v_t}{|v_t|}-\mathbf z\right),\quad "
        r"\mathbf F_t = -(k\mathbf z+d\,\dot{\mathbf z}),\quad "
        r"s=\mathrm e^{-(v_t/v_s)^2},\ \tau=d/k"
    )
    reference = (
        "Y. Gonthier, J. McPhee, C. Lange, J.-C. Piedboeuf, Multibody Syst. Dyn. 11 (2004) 209-233"
    )
    validity = "sticking that grows with the time at rest, and sliding at mu_d"

    def __init__(
        self,
        mu_d: float = 0.1,
        mu_s: float = 0.15,
        v_s: float = 1e-3,
        sigma0: float = 1e5,
        sigma1: float = 10.0,
        sigma2: float = 0.0,
        dwell_time: float = 0.1,
    ) -> None:
        """Check and keep the parameters."""
        self.mu_d = require_positive("mu_d", mu_d, "")
        self.mu_s = require_positive("mu_s", mu_s, "")
        self.v_s = require_positive("v_s", v_s, "m/s")
        self.sigma0 = require_positive("sigma0", sigma0, "1/m")
        self.sigma1 = require_positive("sigma1", sigma1, "s/m")
        self.sigma2 = require_non_negative("sigma2", sigma2, "s/m")
        self.dwell_time = require_positive("dwell_time", dwell_time, "s")
        if self.mu_s < self.mu_d:
            raise JointplayError(
                f"mu_s must not be smaller than mu_d, got mu_s = {mu_s:g} and mu_d = {mu_d:g}"
            )

    @staticmethod
    def function(speed: float, normal: float, dwell: float, p: Any, out: Any) -> None:
        """Evaluate with p = (mu_d, mu_s, v_s, sigma0, sigma1, sigma2, tau_d)."""
        ratio = speed / p[2]
        stick = math.exp(-ratio * ratio)
        slide = (1.0 - stick) * p[3] / p[4]
        out[0] = stick
        if speed > 0.0:
            out[0] += slide * p[0] / p[3] / speed
        out[1] = slide
        out[2] = p[3] * normal
        out[3] = p[4] * normal
        out[4] = p[5] * normal
        out[5] = (p[0] + (p[1] - p[0]) * dwell) * normal
        out[6] = stick
        out[7] = 1.0 / p[6] if stick >= dwell else p[3] / p[4]

    def parameters(self) -> tuple[float, ...]:
        """mu_d, mu_s, v_s [m/s], sigma0 [1/m], sigma1 and sigma2 [s/m], tau_d [s]."""
        return (
            self.mu_d,
            self.mu_s,
            self.v_s,
            self.sigma0,
            self.sigma1,
            self.sigma2,
            self.dwell_time,
        )
