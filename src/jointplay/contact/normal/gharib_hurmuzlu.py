"""Gharib-Hurmuzlu: hysteresis damping for soft impacts (2012)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.normal.hertzian import HysteresisLaw


@dataclass(frozen=True)
class GharibHurmuzlu(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 1/c_e.

    The limit of the exact a for c_e -> 0. It does not end at an elastic impact: at c_e = 1 an
    impact still has a restitution of 0.59. Written from memory; no source was seen.
    """

    name = "gharib-hurmuzlu"
    formula = r"F_n = k\delta^{3/2}\left[1+\frac{1}{c_e}\,\frac{\dot\delta}{\dot\delta_0}\right]"
    reference = (
        "M. Gharib, Y. Hurmuzlu, J. Appl. Mech. 79 (2012) 064506 (from memory, no source seen)"
    )
    validity = "soft impacts, c_e up to 0.33 within 0.03; far too plastic above 0.5"

    @staticmethod
    def factor(restitution: float) -> float:
        """a = 1/c_e."""
        return 1.0 / restitution
