"""Lee-Wang: hysteresis damping of 1983."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class LeeWang(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 3 (1 - c_e)/4."""

    name = "lee-wang"
    formula = r"F_n = k\delta^{3/2}\left[1+\tfrac34(1-c_e)\,\frac{\dot\delta}{\dot\delta_0}\right]"
    reference = "T. W. Lee, A. C. Wang, J. Mech. Transm. Autom. Des. 105 (1983)"
    validity = (
        "comparison with the literature only: too elastic for every c_e; even as c_e -> 1 it takes "
        "half of the energy it should"
    )

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 3 (1 - c_e)/4."""
        return 0.75 * (1.0 - restitution)
