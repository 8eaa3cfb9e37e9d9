"""Friction of Gonthier et al.: bristles that remember for how long they have stuck."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.friction.bristle import Bristles, StribeckBristles
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class GonthierFriction(StribeckBristles):
    """Bristles that stick, slip, and stick the better the longer they have rested.

    With s = exp(-(v/v_s)^2), 1 when sticking and 0 when sliding, and the dwell s_d:

        dz/dt    = s v + (1 - s) (mu_d F_n / k * v/|v| - z) / tau,    tau = d/k
        ds_d/dt  = (s - s_d) / tau_d while s >= s_d, (s - s_d) / tau else
        F_t      = -(k z + d dz/dt), at most [mu_d + (mu_s - mu_d) s_d] F_n, and - c F_n v

    with k = sigma0 F_n and d = sigma1 F_n, here with a stiffness in proportion to the normal force.

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

    v_s: float = quantity("m/s", default=1e-3, above=0.0)
    """Speed over which sticking turns into sliding [m/s]."""
    sigma1: float = quantity("s/m", default=10.0, above=0.0)
    """Damping of the bristles per normal force, > 0 [s/m]."""
    dwell_time: float = quantity("s", default=0.1, above=0.0)
    """Time constant tau_d with which static friction grows [s]."""

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
        dwell_time: float,
    ) -> Bristles:
        """Evaluate the law."""
        ratio = speed / v_s
        stick = math.exp(-ratio * ratio)
        slide = (1.0 - stick) * sigma0 / sigma1
        bending = stick
        if speed > 0.0:
            bending += slide * mu_d / sigma0 / speed
        return Bristles(
            bending=bending,
            release=slide,
            stiffness=sigma0 * normal,
            damping=sigma1 * normal,
            viscous=sigma2 * normal,
            cap=(mu_d + (mu_s - mu_d) * dwell) * normal,
            dwell_target=stick,
            dwell_rate=1.0 / dwell_time if stick >= dwell else sigma0 / sigma1,
        )
