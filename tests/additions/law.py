"""A contact law of one's own: half of Hunt and Crossley's damping."""

from dataclasses import dataclass

from jointplay.base.schema import add
from jointplay.physics.contact import NormalForceLaw
from jointplay.physics.contact.hertzian import HysteresisLaw


@dataclass(frozen=True)
class HalfDamped(HysteresisLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0], a = 3 (1 - c_e)/4."""

    name = "half-damped"
    formula = r"F_n = k\delta^{3/2}\left[1+\frac{3(1-c_e)}{4}\frac{\dot\delta}{\dot\delta_0}\right]"
    reference = "made up for this test"
    validity = "near c_e = 1"

    @staticmethod
    def factor(restitution):
        return 0.75 * (1.0 - restitution)


add(NormalForceLaw, HalfDamped)
