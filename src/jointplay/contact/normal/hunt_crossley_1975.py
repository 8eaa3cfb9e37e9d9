"""Hunt and Crossley's own damping of 1975."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class HuntCrossley1975(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 3 (1 - c_e)/2."""

    name = "hunt-crossley-1975"
    formula = r"F_n = k\delta^{3/2}\left[1+\tfrac32(1-c_e)\,\frac{\dot\delta}{\dot\delta_0}\right]"
    reference = "K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445"
    validity = "c_e above 0.8: exact to first order as c_e -> 1, too elastic below"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 3 (1 - c_e)/2."""
        return 1.5 * (1.0 - restitution)
