"""Hu-Guo: hysteresis damping for all restitutions (2015)."""

from __future__ import annotations

from jointplay.contact.hertzian import HysteresisLaw


class HuGuo(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 3 (1 - c_e)/(2 c_e)."""

    name = "hu-guo"
    formula = (
        r"F_n = k\delta^{3/2}\left[1+\frac{3(1-c_e)}{2c_e}\,\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = "S. Hu, X. Guo, Multibody Syst. Dyn. 35 (2015) 131-151"
    validity = "every c_e, within 0.035; exact to first order as c_e -> 1"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 3 (1 - c_e)/(2 c_e)."""
        return 1.5 * (1.0 - restitution) / restitution
