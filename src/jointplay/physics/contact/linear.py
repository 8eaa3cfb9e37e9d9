"""Laws with a linear spring, F = k delta, alone (eq. 16) or with a dashpot (eq. 17)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.base.errors import JointplayError
from jointplay.base.schema import OptionalQuantity, Quantity, quantity
from jointplay.physics.contact.hertzian import REFERENCE_PENETRATION_M
from jointplay.physics.contact.law import ContactProperties, NormalForceLaw


def linear_stiffness(stiffness: float | None, contact: ContactProperties) -> float:
    """Linear stiffness [N/m]: the one given, or one derived from the Hertz contact.

    Eq. 11 gives N/m^1.5. The derived k stores the energy of Hertz's contact at the depth of 10 µm:
    k delta^2 / 2 = 2/5 k_Hertz delta^(5/2).
    """
    if stiffness is not None:
        return stiffness
    return 0.8 * contact.stiffness * math.sqrt(REFERENCE_PENETRATION_M)


def spring_and_dashpot(
    delta: float, ddelta: float, ddelta0: float, stiffness: float, damping: float
) -> float:
    """F_n = k delta + b ddelta."""
    return stiffness * delta + damping * ddelta


@dataclass(frozen=True)
class LinearSpring(NormalForceLaw):
    """F_n = k delta (eq. 16)."""

    name = "linear-spring"
    formula = r"F_n = k_l\delta"
    reference = "doi 10.3390/app13042211, eq. 16"
    validity = "rough estimates near the depth that the stiffness is chosen for; no loss"

    stiffness: OptionalQuantity = quantity("N/m", default=None, above=0.0)
    """Stiffness k [N/m]; None derives it from the joint's Hertz stiffness (`linear_stiffness`)."""

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, stiffness: float) -> float:
        return stiffness * delta

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        return (linear_stiffness(self.stiffness, contact),)

    def effective_restitution(self, restitution: float) -> float:
        return 1.0


@dataclass(frozen=True)
class KelvinVoigt(NormalForceLaw):
    """F_n = k delta + b ddelta (eq. 17).

    The force jumps to b ddelta at the first touch and would pull before separation, which the
    time loop cuts off: a contact never pulls.
    """

    name = "kelvin-voigt"
    formula = r"F_n = k_l\delta + b\dot\delta"
    reference = "doi 10.3390/app13042211, eq. 17"
    validity = "rough estimates: the force jumps at the first touch; c_e does not enter"

    damping: Quantity = quantity("N*s/m", least=0.0)
    """Damping coefficient b [N s/m]."""
    stiffness: OptionalQuantity = quantity("N/m", default=None, above=0.0)
    """Stiffness k [N/m]; None derives it from the joint's Hertz stiffness (`linear_stiffness`)."""

    function = staticmethod(spring_and_dashpot)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        return linear_stiffness(self.stiffness, contact), self.damping


def damping_ratio(restitution: float) -> float:
    """Damping ratio for the restitution c_e of a linear contact that ends at delta = 0."""
    logarithm = math.log(restitution)
    return -logarithm / math.hypot(math.pi, logarithm)


@dataclass(frozen=True)
class Anagnostopoulos(NormalForceLaw):
    """F_n = k delta + b ddelta, b = 2 zeta sqrt(k m), zeta = -ln c_e / sqrt(pi^2 + ln^2 c_e).

    The linear dashpot cannot deliver a given restitution without the mass m that it stops. The
    formula includes the pull of the dashpot before delta = 0, which a dry contact does not have
    and the time loop cuts off: see `effective_restitution`.

    Raises:
        JointplayError: no mass, or one that is not positive.
    """

    name = "anagnostopoulos"
    formula = (
        r"F_n = k_l\delta + 2\zeta\sqrt{k_l m}\,\dot\delta,\quad "
        r"\zeta = \frac{-\ln c_e}{\sqrt{\pi^2+\ln^2 c_e}}"
    )
    reference = (
        "S. A. Anagnostopoulos, Earthquake Eng. Struct. Dyn. 16 (1988) 443-456, 33 (2004) 897-902"
    )
    validity = (
        "impacts of one known mass; the force jumps at the first touch; without the dashpot's pull "
        "at the end too elastic below c_e = 0.5"
    )

    mass: OptionalQuantity = quantity("kg", default=None, above=0.0)
    """Effective mass m of the impact [kg], m_1 m_2/(m_1 + m_2) for two free bodies. The law
    anagnostopoulos needs it; `jointplay.model.impact.effective_mass` computes it for a mechanism.
    """
    stiffness: OptionalQuantity = quantity("N/m", default=None, above=0.0)
    """Stiffness k [N/m]; None derives it from the joint's Hertz stiffness (`linear_stiffness`)."""

    def __post_init__(self) -> None:
        if self.mass is None:
            raise JointplayError(
                "law 'anagnostopoulos' needs mass, the effective mass of the impact [kg], such as "
                "jointplay.model.impact.effective_mass gives",
                where=("mass",),
            )
        super().__post_init__()

    function = staticmethod(spring_and_dashpot)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        assert self.mass is not None
        k = linear_stiffness(self.stiffness, contact)
        return k, 2.0 * damping_ratio(contact.restitution) * math.sqrt(k * self.mass)

    def effective_restitution(self, restitution: float) -> float:
        """Restitution with the pull cut off: exp(-2 phi cot(phi)), phi = arccos(zeta).

        T. Schwager, T. Poeschel, Granular Matter 9 (2007) 465-469.
        """
        zeta = damping_ratio(restitution)
        phi = math.acos(zeta)
        return math.exp(-2.0 * phi * zeta / math.sin(phi))
