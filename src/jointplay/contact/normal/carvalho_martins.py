"""Carvalho-Martins: hysteresis damping for hard and medium impacts (2019)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class CarvalhoMartins(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 3/2 (1 - c_e)(11 - c_e)/(1 + 9 c_e).

    Seen in the manual of Exudyn (ObjectContactSphereSphere, impact model 2), which takes it above
    c_e = 1/3 and Gonthier's below; there both are the same. The paper itself was not seen.
    """

    name = "carvalho-martins"
    formula = (
        r"F_n = k\delta^{3/2}\left[1+\tfrac32\,\frac{(1-c_e)(11-c_e)}{1+9c_e}\,"
        r"\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = (
        "A. S. Carvalho, J. M. Martins, Mech. Mach. Theory 139 (2019) 174-194, as Exudyn's manual "
        "has it"
    )
    validity = "c_e above 1/3, within 0.003; too elastic below; exact to first order as c_e -> 1"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 3/2 (1 - c_e)(11 - c_e)/(1 + 9 c_e)."""
        return 1.5 * (1.0 - restitution) * (11.0 - restitution) / (1.0 + 9.0 * restitution)
