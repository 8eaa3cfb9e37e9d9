"""Herbert-McWhannell: hysteresis damping of 1977."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class HerbertMcWhannell(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 6 (1 - c_e)/((2 c_e - 1)^2 + 3)."""

    name = "herbert-mcwhannell"
    formula = (
        r"F_n = k\delta^{3/2}"
        r"\left[1+\frac{6(1-c_e)}{(2c_e-1)^2+3}\,\frac{\dot\delta}{\dot\delta_0}\right]"
    )
    reference = "R. G. Herbert, D. C. McWhannell, J. Eng. Ind. 99 (1977)"
    validity = "c_e above 0.7: exact to first order as c_e -> 1, too elastic below"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 6 (1 - c_e)/((2 c_e - 1)^2 + 3)."""
        return 6.0 * (1.0 - restitution) / ((2.0 * restitution - 1.0) ** 2 + 3.0)
