"""Line contacts: laws of a cylinder in a bore.

Johnson, Radzimovsky, Goldsmith, and Dubowsky and Freudenstein all write the depth as

    delta = F/(pi E* l) [ln(C/F) + c] = F/(pi E* l) ln(K/F),    K = C e^c

and differ in K. With u = ln(K/F) and s = pi E* l delta/K this is s = u e^-u, so that

    F = pi E* l delta/u,    u - ln(u) = -ln(s),    u > 1,

the lower branch of Lambert's W. The slope of the force over the depth is pi E* l/(u - 1): it grows
without bound as u falls to 1, where the logarithm has lost its meaning, and beyond that depth there
is no solution. The law is therefore continued along its tangent from u = 2 on, where its slope is
pi E* l: continuous with its first derivative, rising, finite for all depths.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from jointplay.base.errors import JointplayError
from jointplay.base.units import readable
from jointplay.physics.contact.hertzian import (
    HysteresisLaw,
    LankaraniNikravesh,
    damped,
    elastic_limits,
    law,
)
from jointplay.physics.contact.law import ContactProperties

LINE_YIELD = 1.79
"""Peak pressure over yield strength at first yield of a line contact (von Mises, nu = 0.3).

K. L. Johnson, Contact Mechanics, Cambridge University Press, 1985, section 6.1.
"""
LARGEST_S = 2.0 * math.exp(-2.0)
"""s at u = 2, beyond which the implicit laws are continued along their tangent."""


@dataclass(frozen=True)
class CylindricalLaw(HysteresisLaw):
    """Base of the laws of a cylinder in a bore.

    Each radial contact is one end of the journal and stands for half of its length (l = L_j/2),
    so that a journal with parallel axes, touching at both ends, has the force of its whole length.
    A rim on a flat end wall is no line: there, and wherever l is 0, the law is Hertz's with the
    joint's axial stiffness. The references have no damping; that of Lankarani-Nikravesh is added,
    for radial and axial contacts alike.
    """

    line = True

    point: ClassVar[float]
    """Value of the third parameter with which `function` is Hertz's law."""
    conformal: ClassVar[bool] = False
    """Whether the law is valid for wide (conformal) contacts."""

    @staticmethod
    def factor(restitution: float) -> float:
        return LankaraniNikravesh.factor(restitution)

    @abstractmethod
    def line_parameters(self, contact: ContactProperties) -> tuple[float, float]:
        """Stiffness, and third parameter of `function`, for a line contact."""

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """Stiffness, factor a, and the law's third parameter; Hertz's where it is no line."""
        stiffness, shape = contact.stiffness, self.point
        if contact.contact_length:
            stiffness, shape = self.line_parameters(contact)
        return stiffness, self.factor(contact.restitution), shape

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        if not contact.contact_length:
            return super()._limits(contact, max_depth)
        share = self.function(max_depth, 0.0, 1.0, *self.parameters(contact))
        share /= contact.contact_length
        half_width = math.sqrt(4.0 * share * contact.radius / (math.pi * contact.modulus))
        extent = "half-width", 0.0 if self.conformal else half_width
        pressure = math.sqrt(share * contact.modulus / (math.pi * contact.radius))
        return elastic_limits(self.name, contact, max_depth, extent, pressure, LINE_YIELD)


@dataclass(frozen=True)
class LineContactLaw(CylindricalLaw):
    """delta = F/(pi E* l) ln(K/F); laws of this family differ in the scale K."""

    point = 0.0
    family = "delta = F/(pi E* l) ln(K/F)"
    varying = "scale"

    @staticmethod
    def scale(contact: ContactProperties) -> float:
        """K [N]: the force at which the formula's depth would be zero again."""
        raise NotImplementedError

    @staticmethod
    def function(
        delta: float,
        ddelta: float,
        ddelta0: float,
        slope: float,
        factor: float,
        inverse_scale: float,
    ) -> float:
        s = inverse_scale * delta
        if s == 0.0:
            elastic = slope * delta * math.sqrt(delta)
        elif s >= LARGEST_S:
            elastic = slope * (delta - 0.5 * LARGEST_S / inverse_scale)
        else:
            # Solve u - ln(u) = level, which is convex and nearly linear here. The first guess is
            # the expansion about u = 1, within 5 % for s > 1e-40; three Newton steps then give u to
            # all digits for any s.
            level = -math.log(s)
            root = math.sqrt(2.0 * (level - 1.0))
            u = 1.0 + root * (1.0 + root * (1.0 / 3.0 + 0.01 * root))
            u *= (level + math.log(u) - 1.0) / (u - 1.0)
            u *= (level + math.log(u) - 1.0) / (u - 1.0)
            u *= (level + math.log(u) - 1.0) / (u - 1.0)
            elastic = slope * delta / u
        return elastic * (1.0 + factor * ddelta / ddelta0)

    def line_parameters(self, contact: ContactProperties) -> tuple[float, float]:
        slope = math.pi * contact.modulus * contact.contact_length
        return slope, slope / self.scale(contact)

    def depth(self, force: float, contact: ContactProperties) -> float:
        """Depth under a resting force [m], by the formula itself; the inverse of `function`.

        Meaningful up to K/e^2, beyond which `function` follows its tangent.
        """
        slope = math.pi * contact.modulus * contact.contact_length
        return force / slope * math.log(self.scale(contact) / force)

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        lines = super()._limits(contact, max_depth)
        limit = math.inf
        if contact.contact_length:
            limit = LARGEST_S / self.line_parameters(contact)[1]
        if max_depth <= limit:
            return lines
        beyond = (
            f"{self.name} holds to the depth {limit:.3g} m, above which it is continued along "
            f"its tangent; the deepest was {max_depth:.3g} m"
        )
        return [beyond, *lines]


def _depth(latex: str, where: str = r"f=\frac{F}{l}") -> str:
    """LaTeX of a law of this family, from that of delta pi E*/f."""
    return rf"\delta = \frac{{f}}{{\pi E^*}}\left[{latex}\right],\quad {where}"


def _line(contact: ContactProperties) -> float:
    """E* l [N/m]."""
    return contact.modulus * contact.contact_length


Johnson = law(
    LineContactLaw,
    "Johnson",
    lambda c: 4.0 * math.pi * _line(c) * c.clearance * math.exp(-1.0),
    _depth(r"\ln\frac{4\pi E^* C_r}{f} - 1"),
    "K. L. Johnson, Contact Mechanics, Cambridge University Press, 1985",
    "depth up to 0.40 C_r, parallel axes; continued along its tangent above",
    "K = 4 pi E* C_r l/e.",
)
Radzimovsky = law(
    LineContactLaw,
    "Radzimovsky",
    lambda c: 16.0 * _line(c) * c.clearance / (2.0 * 1.60**2) * math.exp(2.0 / 3.0),
    _depth(r"\tfrac23+\ln\frac{4R_i}{b}+\ln\frac{4R_j}{b}", r"b = 1.60\sqrt{\frac{2fR}{E^*}}"),
    "E. I. Radzimovsky, Univ. of Illinois Eng. Exp. Station Bulletin 408 (1953); "
    "W. C. Young, Roark's Formulas for Stress and Strain (1989)",
    "depth up to 0.52 C_r, parallel axes; continued along its tangent above",
    """K = 16 R_i R_j E* l/(1.60^2 2 R) e^(2/3), R_i R_j/R being C_r. b = 1.60 sqrt(f D/E*) with
    D = 2 R_i R_j/C_r, as Roark's Formulas for Stress and Strain have it: the *whole* width of the
    contact, Hertz's 2 sqrt(4 f R/(pi E*)) in three digits. Parts of the clearance literature write
    R for D, which would make the contact narrower than Hertz's.""",
)
Goldsmith = law(
    LineContactLaw,
    "Goldsmith",
    lambda c: math.pi * c.modulus * c.contact_length * math.e / c.radius,
    _depth(r"\ln\frac{\pi E^*\cdot 1\,\mathrm{m}^2}{f R}+1"),
    "W. Goldsmith, Impact, Edward Arnold, 1960",
    "comparison with the literature only: the exponent 1 of L makes it depend on the unit of "
    "length (metres here); several times softer than the others",
    """K = pi E* l e (1 m)^2/R. The clearance literature gives Goldsmith the exponent m = 1 of L
    where Dubowsky and Freudenstein have 3. The logarithm's argument then has the unit 1/m^2: the
    law depends on the unit of length. It is here, in metres, for comparison with that literature.
    Its sigma is (1 - nu^2)/(pi E), with its pi, as in `DubowskyFreudenstein`. As there, but with
    the force per length of the contact, f = F/l: pi E*/(f R).""",
)
DubowskyFreudenstein = law(
    LineContactLaw,
    "DubowskyFreudenstein",
    lambda c: math.pi * c.modulus * c.contact_length * c.journal_length**2 / c.radius * math.e,
    _depth(r"\ln\frac{\pi E^* L^2}{f R}+1"),
    "S. Dubowsky, F. Freudenstein, J. Eng. Ind. 93 (1971)",
    "journals about as long as thick: its depth grows with the logarithm of the length, which "
    "plane elasticity does not know; parallel axes",
    """K = pi E* L^2 l e/R. The references write sigma_i + sigma_j for 1/(pi E*), sigma =
    (1 - nu^2)/(pi E) of eq. 12, with its pi: without it (as in the code of DyS) the depth would be
    about pi times as large, and plane elasticity has 1/(pi E*) before the logarithm. They write
    L^m with m = 3, the only exponent that makes the logarithm's argument a number. Where a contact
    stands for a part l of the journal's length L, the force per length counts: pi E* L^2/(f R)
    with f = F/l, so that both ends together give the force of the whole.""",
)
Esdu78035 = law(
    LineContactLaw,
    "Esdu78035",
    lambda c: 4.0 * math.pi * _line(c) * c.clearance * math.e,
    _depth(r"\ln\frac{4\pi E^* C_r}{f} + 1"),
    "ESDU 78035, Contact phenomena I (1978), as DyS has it, less its factor pi^2",
    "comparison with the literature: the data item was not seen; parallel axes",
    """K = 4 pi E* C_r l e: Johnson's with +1 for -1. It was seen in the code of DyS
    (github.com/ladisk/DyS, the program of L. Skrinjar, J. Slavic, M. Boltezar, Nonlinear Dyn. 88
    (2017) 131-143), as pi f sigma [ln(4 C_r/(f sigma)) + 1] with sigma = (1 - nu_i^2)/E_i +
    (1 - nu_j^2)/E_j there. Plane elasticity knows one factor before the logarithm, f/(pi E*),
    which is 1/pi^2 of that one: it is taken here, and sigma = (1 - nu^2)/(pi E) of eq. 12 within.
    The data item itself was not seen.""",
)


NARROWEST_M, CHANGE_M, WIDEST_M = 0.005e-3, 0.34954e-3, 10e-3
"""Least and largest radial clearance of Pereira's fit, in between that at which the branch changes
[m]."""


def pereira_exponent(clearance_mm: float) -> float:
    """n = Y C_r^-0.005 for internal contact, C_r in mm."""
    if clearance_mm < 1e3 * CHANGE_M:
        y = 1.51 * math.log(1000.0 * clearance_mm) ** -0.151
    else:
        y = 0.0151 * clearance_mm + 1.151
    return y * clearance_mm**-0.005


@dataclass(frozen=True)
class Pereira(CylindricalLaw):
    """F = (0.965 C_r + 0.0965) l E*/C_r delta^n [1 + 3 (1 - c_e^2)/4 ddelta/ddelta0], mm and N.

    n = Y C_r^-0.005, Y = 1.51 ln(1000 C_r)^-0.151 below C_r = 0.34954 mm and 0.0151 C_r + 1.151
    above. A fit to Johnson's law without its iteration.

    Raises:
        JointplayError: from `parameters`, a clearance outside 0.005 to 10 mm, where there is no
            fit.
    """

    name = "pereira"
    formula = (
        damped(r"\tfrac34(1-c_e^2)", r"\frac{(0.965\,C_r+0.0965)\,l E^*}{C_r}\,\delta^n")
        + r"\ \text{(mm, N)}"
    )
    reference = "C. Pereira, A. Ramalho, J. Ambrosio, Multibody Syst. Dyn. 35 (2015) 277-298"
    validity = "C_r from 0.005 to 10 mm, parallel axes; c_e above 0.8"

    point = 1.5

    @staticmethod
    def function(
        delta: float, ddelta: float, ddelta0: float, stiffness: float, factor: float, power: float
    ) -> float:
        return stiffness * delta**power * (1.0 + factor * ddelta / ddelta0)

    def line_parameters(self, contact: ContactProperties) -> tuple[float, float]:
        if not NARROWEST_M <= contact.clearance <= WIDEST_M:
            low, high, clearance = (
                readable(size, "m") for size in (NARROWEST_M, WIDEST_M, contact.clearance)
            )
            raise JointplayError(
                f"law 'pereira' is fitted for radial clearances from {low} to {high}, got "
                f"{clearance}"
            )
        gap = 1e3 * contact.clearance  # mm
        n = pereira_exponent(gap)
        line = 1e-3 * contact.modulus * contact.contact_length  # MPa mm = N/mm
        return (0.965 * gap + 0.0965) * line / gap * 1e3**n, n


@dataclass(frozen=True)
class Liu(CylindricalLaw):
    """F = pi/2 l E* delta sqrt(delta/(2 (C_r + delta))) [1 + 3 (1 - c_e^2)/4 ddelta/ddelta0].

    A Winkler foundation under an elliptic pressure. For depths far below the clearance it is
    Hertz's exponent 3/2, for depths far above a linear spring. The formula was seen in the code of
    DyS (github.com/ladisk/DyS); the paper was not.
    """

    name = "liu"
    formula = damped(
        r"\tfrac34(1-c_e^2)", r"\tfrac{\pi}{2}\,l E^*\delta\sqrt{\frac{\delta}{2(C_r+\delta)}}"
    )
    reference = (
        "C.-S. Liu, K. Zhang, R. Yang, Mech. Mach. Theory 42 (2007) 183-197, as DyS has it; "
        "for spheres J. Comput. Nonlinear Dyn. 1 (2006) 160-167"
    )
    validity = (
        "conformal contact: depths of the order of C_r and above, parallel axes; several times "
        "softer than plane elasticity below; c_e above 0.8"
    )

    point = -1.0
    conformal = True

    @staticmethod
    def function(
        delta: float,
        ddelta: float,
        ddelta0: float,
        stiffness: float,
        factor: float,
        clearance: float,
    ) -> float:
        elastic = stiffness * delta * math.sqrt(delta)
        if clearance >= 0.0:
            elastic /= math.sqrt(2.0 * (clearance + delta))
        return elastic * (1.0 + factor * ddelta / ddelta0)

    def line_parameters(self, contact: ContactProperties) -> tuple[float, float]:
        line = contact.modulus * contact.contact_length
        return 0.5 * math.pi * line, contact.clearance
