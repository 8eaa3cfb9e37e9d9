"""Laws with Hertz's elastic part, F = k delta^(3/2), most of them with hysteresis damping.

A law F_n = k delta^(3/2) [1 + a ddelta/ddelta0] is given by its hysteresis factor a(c_e). With any
elastic part g the equation of motion m v dv/ddelta = -g(delta) (1 + a v/v0) separates, and equal
depth at both ends of the impact gives its restitution e (K. H. Hunt, F. R. E. Crossley, 1975;
Y. Zhang, I. Sharf, 2009)

    a (1 + e) = ln((1 + a)/(1 - a e)).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

from jointplay.base.errors import JointplayError
from jointplay.base.schema import OptionalQuantity, Quantity, quantity
from jointplay.physics.contact.law import ContactProperties, NormalForceLaw

CONTACT_WIDTH_LIMIT = 0.3
"""Contact radius over journal radius up to which Hertz's parabola approximates a circle.

The parabola's height is off by (a/R)^2/4, 2 % here.
"""
POINT_YIELD = 1.60
"""Peak pressure over yield strength at first yield of a point contact (von Mises, nu = 0.3).

K. L. Johnson, Contact Mechanics, Cambridge University Press, 1985, section 6.1.
"""
REFERENCE_PENETRATION_M = 1e-5
"""Depth at which laws with other units of stiffness agree with Hertz's."""
_TINY = 1e-6
"""Factor, or 1 - e, below which the equation of the restitution suffers from cancellation; its
first order, used instead, is exact to the square of this."""


def effective_restitution(factor: float) -> float:
    """Restitution e of an impact with the hysteresis factor a >= 0."""
    if factor < _TINY:
        return 1.0 - factor / 1.5

    def mismatch(e: float) -> float:
        return math.log1p(factor) - math.log1p(-factor * e) - factor * (1.0 + e)

    high = 1.0 if factor < 1.0 else (1.0 - 1e-15) / factor
    if mismatch(high) <= 0.0:  # 1 - a e is below the resolution of floating point
        return high
    return _root(mismatch, 0.0, high)


def exact_factor(restitution: float) -> float:
    """Hysteresis factor a that delivers the restitution e, 0 < e <= 1."""
    if 1.0 - restitution < _TINY:
        return 1.5 * (1.0 - restitution)
    inverse = 1.0 / restitution

    def mismatch(d: float) -> float:  # d = a e, between 0 and 1
        return math.log1p(d * inverse) - math.log1p(-d) - d * (1.0 + inverse)

    high = 1.0 - 1e-15
    if mismatch(high) <= 0.0:  # the limit of small e: a -> 1/e
        return inverse
    return _root(mismatch, 0.5 * (1.0 - restitution), high) * inverse


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """The root of a rising function, by bisection to the last bit.

    SciPy takes longer to import than a short run takes.
    """
    while low < (middle := 0.5 * (low + high)) < high:
        if function(middle) < 0.0:
            low = middle
        else:
            high = middle
    return high


def elastic_limits(
    law: str,
    contact: ContactProperties,
    depth: float,
    extent: tuple[str, float],
    pressure: float,
    yields: float,
) -> list[str]:
    """Warnings where a contact is too wide for its theory or no longer elastic, a line each.

    Args:
        law: name of the law.
        contact: the contact.
        depth: deepest penetration [m].
        extent: name of the contact's dimension ("radius", "half-width"), and its size there [m].
        pressure: peak pressure there [Pa].
        yields: peak pressure over yield strength at first yield.
    """
    lines, (dimension, size) = [], extent
    if size > CONTACT_WIDTH_LIMIT * contact.journal_radius:
        lines.append(
            f"{law} assumes a small contact: at the depth {depth:.3g} m its {dimension} is "
            f"{size / contact.journal_radius:.2g} of the journal's radius"
        )
    if pressure > yields * contact.yield_strength:
        lines.append(
            f"{law} is elastic: at the depth {depth:.3g} m its peak pressure {pressure:.3g} Pa "
            f"exceeds {yields:g} times the yield strength {contact.yield_strength:.3g} Pa"
        )
    return lines


@dataclass(frozen=True)
class PointContactLaw(NormalForceLaw):
    """Base of the laws with Hertz's elastic part, with its limits of validity."""

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        if not contact.radius:
            return []
        extent = "radius", math.sqrt(max_depth * contact.radius)
        pressure = 2.0 * contact.modulus / math.pi * math.sqrt(max_depth / contact.radius)
        return elastic_limits(self.name, contact, max_depth, extent, pressure, POINT_YIELD)


@dataclass(frozen=True)
class Hertz(PointContactLaw):
    """F_n = k delta^(3/2), with k of eq. 11 (eq. 15)."""

    name = "hertz"
    formula = r"F_n = k\delta^{3/2}"
    reference = "H. Hertz, J. reine angew. Math. 92 (1882) 156-171"
    validity = (
        "elastic contact whose radius is small against the bodies'; no loss, c_e does not enter"
    )

    @staticmethod
    def function(delta: float, ddelta: float, ddelta0: float, stiffness: float) -> float:
        return stiffness * delta * math.sqrt(delta)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        return (contact.stiffness,)

    def effective_restitution(self, restitution: float) -> float:
        return 1.0


@dataclass(frozen=True)
class HuntCrossley(PointContactLaw):
    """F_n = k delta^n + b delta^p sgn(ddelta) |ddelta|^q (eq. 10), all five parameters free.

    The paper's other laws are special cases: p = 0, q = 1 with n = 1 and a given b are eq. 17
    (`KelvinVoigt`), with b = 0 eqs 15 and 16. Eq. 18 has p = 0 as printed, but its b, eq. 14,
    contains delta^n: with a constant b that is n = p = 3/2, q = 1, the default, and is
    Lankarani-Nikravesh.

    k and b that are not given follow from the Hertz stiffness of eq. 11 and the damping of eq. 14,
    b delta^p = 3 k (1 - c_e^2) delta^n / (4 ddelta0), so that at the reference depth of 10 µm and
    at |ddelta| = ddelta0 both keep the proportion of eq. 14 whatever n, p and q are:

        k = k_Hertz d^(3/2 - n),  b = 3/4 (1 - c_e^2) k d^(n - p) / ddelta0^q,  d = 10 µm

    With p = 0 the force jumps to b ddelta^q at the first touch and would pull before separation,
    which the time loop cuts off: a contact never pulls.
    Hunt and Crossley's own factor of 1975, 3/2 (1 - c_e), is `HuntCrossley1975`.
    """

    name = "hunt-crossley"
    formula = r"F_n = k'\delta^n + b\,\delta^p\,\mathrm{sgn}(\dot\delta)\,|\dot\delta|^q"
    reference = "K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445"
    validity = "c_e above 0.8, as Lankarani-Nikravesh; away from 10 µm and n = p, q = 1 unproven"

    n: Quantity = quantity("", default=1.5, above=0.0, label="exponent n")
    """Exponent of the elastic part, >= 1."""
    p: Quantity = quantity("", default=1.5, least=0.0, label="exponent p")
    """Exponent of the penetration in the damping; with 0 the force jumps at the first touch."""
    q: Quantity = quantity("", default=1.0, above=0.0, label="exponent q")
    """Exponent of the penetration rate."""
    stiffness: OptionalQuantity = quantity("", default=None, above=0.0, label="stiffness k")
    """Stiffness k [N/m^n], a number without its unit; None: from the joint's Hertz stiffness."""
    damping: OptionalQuantity = quantity("", default=None, least=0.0, label="damping b")
    """Damping b [N s^q/m^(p+q)], a number without its unit; None: from c_e."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.n < 1.0:
            raise JointplayError(f"exponent n must be at least 1, got {self.n:g}", where=("n",))

    @staticmethod
    def function(
        delta: float,
        ddelta: float,
        ddelta0: float,
        stiffness: float,
        damping: float,
        exponent: float,
        depth_exponent: float,
        rate_exponent: float,
        onset: float,
    ) -> float:
        """Evaluate eq. 10; the rate counts in units of ddelta0 (eq. 14) if `onset` is 1, not 0."""
        elastic = stiffness * delta**exponent
        rate = abs(ddelta) / ddelta0 if onset != 0.0 else abs(ddelta)
        return elastic + math.copysign(
            damping * delta**depth_exponent * rate**rate_exponent, ddelta
        )

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        k = self.stiffness
        if k is None:
            k = contact.stiffness * REFERENCE_PENETRATION_M ** (1.5 - self.n)
        if self.damping is not None:
            return k, self.damping, self.n, self.p, self.q, 0.0
        scale = REFERENCE_PENETRATION_M ** (self.n - self.p)
        factor = 0.75 * (1.0 - contact.restitution**2) * k * scale
        return k, factor, self.n, self.p, self.q, 1.0

    def effective_restitution(self, restitution: float) -> float | None:
        """Restitution of Lankarani-Nikravesh if n = p, q = 1; 1 if b = 0; else None."""
        if self.damping is not None:
            return None if self.damping else 1.0
        if self.n != self.p or self.q != 1.0:
            return None
        return effective_restitution(0.75 * (1.0 - restitution**2))


def damped(factor: str, elastic: str = r"k\delta^{3/2}") -> str:
    """LaTeX of a force with hysteresis damping, from that of its factor and its elastic part."""
    return rf"F_n = {elastic}\left[1+{factor}\,\frac{{\dot\delta}}{{\dot\delta_0}}\right]"


def hysteresis(
    delta: float, ddelta: float, ddelta0: float, stiffness: float, factor: float
) -> float:
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0]: eq. 19 with the paper's factor a."""
    return stiffness * delta * math.sqrt(delta) * (1.0 + factor * ddelta / ddelta0)


@dataclass(frozen=True)
class HysteresisLaw(PointContactLaw):
    """F_n = k delta^(3/2) [1 + a ddelta/ddelta0]; laws of this family differ in a(c_e)."""

    family: ClassVar[str] = "F_n = k delta^(3/2) [1 + a ddelta/ddelta0]"
    """Formula of the family, as the docstrings of its laws begin."""
    varying: ClassVar[str] = "factor"
    """Name of the function in which laws of the family differ."""

    @staticmethod
    def factor(restitution: float) -> float:
        """Hysteresis factor a for the nominal restitution c_e."""
        raise NotImplementedError

    function: ClassVar[Callable[..., float]] = staticmethod(hysteresis)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        return contact.stiffness, self.factor(contact.restitution)

    def effective_restitution(self, restitution: float) -> float:
        """Restitution of a free impact, from a (1 + e) = ln((1 + a)/(1 - a e))."""
        return effective_restitution(self.factor(restitution))


L = TypeVar("L", bound=NormalForceLaw)


def law(
    base: type[L],
    name: str,
    function: Callable[[Any], float],
    formula: str,
    reference: str,
    validity: str,
    note: str = "",
) -> type[L]:
    """Make the class of a law, docstring included.

    Args:
        base: family of the law; its `varying` names the function in which its laws differ.
        name: name of the class, from which the word that selects the law follows.
        function: the law's own such function.
        formula, reference, validity: see `Law`.
        note: further paragraph of the docstring.
    """
    family: Any = base
    paragraphs = [f"{family.family}.", note, f"{reference}.", f"Good for {validity}."]
    entries = {
        "__doc__": "\n\n".join(part for part in paragraphs if part),
        "__module__": base.__module__,
        "name": re.sub("(?<=[a-z])(?<!Mc)(?=[A-Z0-9])", "-", name).lower(),
        "formula": formula,
        "reference": reference,
        "validity": validity,
        family.varying: staticmethod(function),
    }
    return dataclass(frozen=True)(type(name, (base,), entries))


LankaraniNikravesh = law(
    HysteresisLaw,
    "LankaraniNikravesh",
    lambda c: 0.75 * (1.0 - c**2),
    damped(r"\tfrac34(1-c_e^2)"),
    "H. M. Lankarani, P. E. Nikravesh, J. Mech. Design 112 (1990) 369-376",
    "c_e above 0.8: exact to first order as c_e -> 1, too elastic below",
    "The paper's own law (eqs 18, 19), derived for c_e close to 1.",
)
HuntCrossley1975 = law(
    HysteresisLaw,
    "HuntCrossley1975",
    lambda c: 1.5 * (1.0 - c),
    damped(r"\tfrac32(1-c_e)"),
    "K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445",
    "c_e above 0.8: exact to first order as c_e -> 1, too elastic below",
)
HerbertMcWhannell = law(
    HysteresisLaw,
    "HerbertMcWhannell",
    lambda c: 6.0 * (1.0 - c) / ((2.0 * c - 1.0) ** 2 + 3.0),
    damped(r"\frac{6(1-c_e)}{(2c_e-1)^2+3}"),
    "R. G. Herbert, D. C. McWhannell, J. Eng. Ind. 99 (1977)",
    "c_e above 0.7: exact to first order as c_e -> 1, too elastic below",
)
LeeWang = law(
    HysteresisLaw,
    "LeeWang",
    lambda c: 0.75 * (1.0 - c),
    damped(r"\tfrac34(1-c_e)"),
    "T. W. Lee, A. C. Wang, J. Mech. Transm. Autom. Des. 105 (1983)",
    "comparison with the literature only: too elastic for every c_e; even as c_e -> 1 it takes "
    "half of the energy it should",
)
Gonthier = law(
    HysteresisLaw,
    "Gonthier",
    lambda c: (1.0 - c**2) / c,
    damped(r"\frac{1-c_e^2}{c_e}"),
    "Y. Gonthier, J. McPhee, C. Lange, J.-C. Piedboeuf, Multibody Syst. Dyn. 11 (2004) 209-233",
    "every c_e, within 0.033; too plastic above 0.35",
    "The approximation d = 1 - c_e^2 of the exact d = a c_e; `ZhangSharf` solves for it.",
)
ZhangSharf = law(
    HysteresisLaw,
    "ZhangSharf",
    exact_factor,
    damped("a") + r",\quad a(1+c_e) = \ln\frac{1+a}{1-a c_e}",
    "Y. Zhang, I. Sharf, Proc. ASME DETC (2004); "
    "Y. Zhang, I. Sharf, J. Appl. Mech. 76 (2009) 051002",
    "every c_e: a free impact has exactly the restitution c_e",
    "The references write d = a c_e. The equation is solved once, when a run is prepared.",
)
QinLu = law(
    HysteresisLaw,
    "QinLu",
    lambda c: 0.75 * (1.0 - c**2) * math.exp(2.0 * (1.0 - c)),
    damped(r"\tfrac34(1-c_e^2)\,\mathrm e^{2(1-c_e)}"),
    "Z. Qin, Q. Lu, J. Dyn. Control 4 (2006) 294-298",
    "c_e above 0.25, within 0.05; exact to first order as c_e -> 1",
    "Lankarani-Nikravesh corrected for soft impacts.",
)
Flores = law(
    HysteresisLaw,
    "Flores",
    lambda c: 1.6 * (1.0 - c) / c,
    damped(r"\frac{8(1-c_e)}{5c_e}"),
    "P. Flores, M. Machado, M. T. Silva, J. M. Martins, Multibody Syst. Dyn. 25 (2011) 357-375",
    "every c_e, within 0.05; too plastic throughout",
)
HuGuo = law(
    HysteresisLaw,
    "HuGuo",
    lambda c: 1.5 * (1.0 - c) / c,
    damped(r"\frac{3(1-c_e)}{2c_e}"),
    "S. Hu, X. Guo, Multibody Syst. Dyn. 35 (2015) 131-151",
    "every c_e, within 0.035; exact to first order as c_e -> 1",
    """From the energies of both halves of the impact. The speed over the depth is taken as Hertz's,
    v0 sqrt(1 - x^(5/2)) in and c_e v0 sqrt(1 - x^(5/2)) out, x = delta/delta_max. With the stored
    energy U = 2/5 k delta_max^(5/2) the damping takes 2/3 a U in and 2/3 a c_e U out:

        1/2 m v0^2 = U (1 + 2 a/3),  1/2 m c_e^2 v0^2 = U (1 - 2 a c_e/3).

    Their quotient gives a. Half of it, which is in circulation (3/2 (1 - c_e)/(2 c_e) in the code
    of DyS), takes half of the energy as c_e -> 1 and cannot be meant. The paper itself was not
    seen.""",
)
CarvalhoMartins = law(
    HysteresisLaw,
    "CarvalhoMartins",
    lambda c: 1.5 * (1.0 - c) * (11.0 - c) / (1.0 + 9.0 * c),
    damped(r"\tfrac32\,\frac{(1-c_e)(11-c_e)}{1+9c_e}"),
    "A. S. Carvalho, J. M. Martins, Mech. Mach. Theory 139 (2019) 174-194, as Exudyn's manual "
    "has it",
    "c_e above 1/3, within 0.003; too elastic below; exact to first order as c_e -> 1",
    """Seen in the manual of Exudyn (ObjectContactSphereSphere, impact model 2), which takes it
    above c_e = 1/3 and Gonthier's below; there both are the same. The paper itself was not
    seen.""",
)
GharibHurmuzlu = law(
    HysteresisLaw,
    "GharibHurmuzlu",
    lambda c: 1.0 / c,
    damped(r"\frac{1}{c_e}"),
    "M. Gharib, Y. Hurmuzlu, J. Appl. Mech. 79 (2012) 064506 (from memory, no source seen)",
    "soft impacts, c_e up to 0.33 within 0.03; far too plastic above 0.5",
    """The limit of the exact a for c_e -> 0. It does not end at an elastic impact: at c_e = 1 an
    impact still has a restitution of 0.59.""",
)
