"""Friction laws that are functions of the sliding speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.base.errors import JointplayError
from jointplay.base.schema import Quantity, quantity
from jointplay.physics.contact.law import FrictionLaw


@dataclass(frozen=True)
class Ambrosio(FrictionLaw):
    """No friction up to v0, a ramp to mu_d at v1, mu_d above (eq. 21).

    The paper prints 1 instead of mu_d in the last branch; mu_d is what makes it continuous.
    """

    name = "ambrosio"
    formula = (
        r"\mu = 0\ (|v_t|\le v_0),\quad \mu_d\frac{|v_t|-v_0}{v_1-v_0},\quad \mu_d\ (|v_t|\ge v_1)"
    )
    reference = (
        "J. A. C. Ambrosio, in Schiehlen, Valasek (eds), Virtual Nonlinear Multibody Systems, "
        "Kluwer, 2003, 57-81"
    )
    validity = "sliding; no sticking: a resting contact creeps below v1, freely below v0"

    mu_d: Quantity = quantity("", default=0.1, least=0.0, label="friction coefficient")
    """Dynamic friction coefficient."""
    v0: Quantity = quantity("m/s", default=1e-4, least=0.0)
    """Sliding speed at which the ramp begins [m/s]."""  # v0, v1: docs/assumptions.md
    v1: Quantity = quantity("m/s", default=1e-3, least=0.0)
    """Sliding speed at which it ends, > v0 [m/s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.v1 <= self.v0:
            raise JointplayError(
                f"v1 must be greater than v0, got v0 = {self.v0:g} and v1 = {self.v1:g} m/s",
                where=("v1",),
            )

    @staticmethod
    def function(speed: float, mu_d: float, v0: float, v1: float) -> float:
        if speed <= v0:
            return 0.0
        if speed >= v1:
            return mu_d
        return mu_d * (speed - v0) / (v1 - v0)


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """mu = mu_d for |v_t| >= v_t, mu_d |v_t|/v_t below.

    Coulomb's law itself jumps with the sign of the velocity at rest, which no fixed step follows.
    A ramp is the least that removes the jump. Under a normal force F_n it is a damper of
    mu_d F_n/v_t, which an explicit step h follows for mu_d F_n/v_t < 2 m/h: v_t can be as small
    as that allows.
    """

    name = "coulomb"
    formula = r"\mu = \mu_d\min(|v_t|/v_t^*,\ 1)"
    reference = "C. A. de Coulomb, Theorie des machines simples (1785)"
    validity = "sliding; no sticking: a resting contact creeps below v_t"

    mu_d: Quantity = quantity("", default=0.1, least=0.0, label="friction coefficient")
    """Dynamic friction coefficient."""
    v_t: Quantity = quantity("m/s", default=1e-3, above=0.0)
    """Sliding speed at which the ramp ends [m/s]."""

    @staticmethod
    def function(speed: float, mu_d: float, v_t: float) -> float:
        return mu_d * min(speed / v_t, 1.0)


@dataclass(frozen=True)
class Threlfall(FrictionLaw):
    """mu = mu_d (1 - exp(-3 |v_t|/v_r)) up to v_r, constant above.

    The constant is the value at v_r, (1 - e^-3) mu_d = 0.950 mu_d: with mu_d itself the
    coefficient would jump there.
    """

    name = "threlfall"
    formula = r"\mu = \mu_d\left(1-\mathrm e^{-3\min(|v_t|/v_r,\,1)}\right)"
    reference = "D. C. Threlfall, Mech. Mach. Theory 13 (1978) 475-483"
    validity = "sliding, where it is 0.95 mu_d; no sticking: a resting contact creeps below v_r"

    mu_d: Quantity = quantity("", default=0.1, least=0.0, label="friction coefficient")
    """Friction coefficient."""
    v_r: Quantity = quantity("m/s", default=1e-3, above=0.0)
    """Sliding speed at which the rise ends [m/s]."""

    @staticmethod
    def function(speed: float, mu_d: float, v_r: float) -> float:
        return mu_d * (1.0 - math.exp(-3.0 * min(speed / v_r, 1.0)))


@dataclass(frozen=True)
class BengisuAkay(FrictionLaw):
    """A parabola up to mu_s at v0, then an exponential fall from mu_s to mu_d.

    mu = mu_s (1 - (|v_t| - v0)^2/v0^2) below v0, mu_d + (mu_s - mu_d) exp(-xi (|v_t| - v0)) above.
    """

    name = "bengisu-akay"
    formula = (
        r"\mu = \mu_s\left[1-\frac{(|v_t|-v_0)^2}{v_0^2}\right]\ (|v_t|<v_0),\quad "
        r"\mu_d+(\mu_s-\mu_d)\,\mathrm e^{-\xi(|v_t|-v_0)}\ (|v_t|\ge v_0)"
    )
    reference = "M. T. Bengisu, A. Akay, J. Sound Vib. 171 (1994) 557-570"
    validity = "sliding with a Stribeck fall; no sticking: a resting contact creeps below v0"

    mu_s: Quantity = quantity("", default=None, least=0.0)
    """Static friction coefficient, >= mu_d; 1.5 mu_d if not given."""
    mu_d: Quantity = quantity("", default=0.1, least=0.0)
    """Dynamic friction coefficient."""
    v0: Quantity = quantity("m/s", default=1e-3, above=0.0)
    """Sliding speed of the largest friction [m/s]."""
    xi: Quantity = quantity("s/m", default=100.0, above=0.0)
    """Rate of the fall [s/m]."""

    @staticmethod
    def function(speed: float, mu_s: float, mu_d: float, v0: float, xi: float) -> float:
        if speed < v0:
            return mu_s * speed * (2.0 * v0 - speed) / (v0 * v0)
        return mu_d + (mu_s - mu_d) * math.exp(-xi * (speed - v0))


@dataclass(frozen=True)
class BrownMcPhee(FrictionLaw):
    """mu = mu_d tanh(4 x) + (mu_s - mu_d) x/(x^2/4 + 3/4)^2, x = |v_t|/v_t.

    The reference adds a viscous force mu_v |v_t| tanh(4 F_n/F_nt) (from memory, no source seen),
    which tends to a plain damper mu_v |v_t| above the transition load F_nt. That is no multiple of
    the normal force, as `FrictionLaw` is, and is left out; a law with bristles and sigma2 has one
    that is.
    """

    name = "brown-mcphee"
    formula = (
        r"\mu = \mu_d\tanh 4x+\frac{(\mu_s-\mu_d)\,x}{\left(\tfrac14x^2+\tfrac34\right)^2},\quad "
        r"x=\frac{|v_t|}{v_t^*}"
    )
    reference = "P. Brown, J. McPhee, J. Comput. Nonlinear Dyn. 11 (2016) 054502"
    validity = "sliding with a Stribeck fall; no sticking: a resting contact creeps below v_t"

    mu_s: Quantity = quantity("", default=None, least=0.0)
    """Static friction coefficient, >= mu_d: the largest, near v_t; 1.5 mu_d if not given."""
    mu_d: Quantity = quantity("", default=0.1, least=0.0)
    """Dynamic friction coefficient."""
    v_t: Quantity = quantity("m/s", default=1e-3, above=0.0)
    """Transition speed [m/s]."""

    @staticmethod
    def function(speed: float, mu_s: float, mu_d: float, v_t: float) -> float:
        x = speed / v_t
        fall = 0.25 * x * x + 0.75
        return mu_d * math.tanh(4.0 * x) + (mu_s - mu_d) * x / (fall * fall)
