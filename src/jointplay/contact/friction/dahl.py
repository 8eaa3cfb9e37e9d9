"""Dahl friction: bristles that bend and slip."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.friction.bristle import BristleLaw, Bristles
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class Dahl(BristleLaw):
    """dz/dt = v - sigma0 |v| z / mu_d,  F_t = -F_n sigma0 z.

    Dahl's curve with the exponent 1, here per unit of normal force and with vectors in the plane of
    contact.

    Raises:
        JointplayError: a value that is not positive.
    """

    name = "dahl"
    formula = (
        r"\dot{\mathbf z} = \mathbf v_t-\frac{\sigma_0|v_t|}{\mu_d}\mathbf z,\quad "
        r"\mathbf F_t = -F_n\sigma_0\mathbf z"
    )
    reference = "P. R. Dahl, Aerospace Corporation, TOR-0158(3107-18)-1 (1968)"
    validity = "sticking and sliding at one coefficient; no Stribeck fall, no growth at rest"

    mu_d: float = quantity("", default=0.1, above=0.0)
    """Friction coefficient."""
    sigma0: float = quantity("1/m", default=1e5, above=0.0)
    """Stiffness of the bristles per normal force [1/m]."""

    @staticmethod
    def function(speed: float, normal: float, dwell: float, mu_d: float, sigma0: float) -> Bristles:
        """Evaluate the law."""
        return Bristles(
            bending=1.0,
            release=sigma0 * speed / mu_d,
            stiffness=sigma0 * normal,
            damping=0.0,
            viscous=0.0,
            cap=math.inf,
            dwell_target=0.0,
            dwell_rate=0.0,
        )
