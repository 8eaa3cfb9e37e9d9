"""Hu-Guo: hysteresis damping for all restitutions (2015)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class HuGuo(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 3 (1 - c_e)/(2 c_e).

    From the energies of both halves of the impact, the speed over the depth taken as Hertz's,
    v0 sqrt(1 - x^(5/2)) in and c_e v0 sqrt(1 - x^(5/2)) out, x = delta/delta_max. With the stored
    energy U = 2/5 k delta_max^(5/2) the damping takes 2/3 a U in and 2/3 a c_e U out:

        1/2 m v0^2 = U (1 + 2 a/3),  1/2 m c_e^2 v0^2 = U (1 - 2 a c_e/3).

    Their quotient gives the a above. Half of it, which is in circulation (3/2 (1 - c_e)/(2 c_e) in
    the code of DyS), takes half of the energy as c_e -> 1 and cannot be meant. The paper itself
    was not seen.
    """

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
