"""Flores et al.: hysteresis damping for all restitutions (2011)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class Flores(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 8 (1 - c_e)/(5 c_e)."""

    name = "flores"
    formula = (
        r"F_n = k\delta^{3/2}\left[1+\frac{8(1-c_e)}{5c_e}\,\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = (
        "P. Flores, M. Machado, M. T. Silva, J. M. Martins, Multibody Syst. Dyn. 25 (2011) 357-375"
    )
    validity = "every c_e, within 0.05; too plastic throughout"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 8 (1 - c_e)/(5 c_e)."""
        return 1.6 * (1.0 - restitution) / restitution
