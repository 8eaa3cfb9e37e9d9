"""Bristle models of friction: surfaces hold each other by bristles that bend before they slide.

The bristles' deflection z is a vector in the tangent plane that lasts as long as the contact:

    dz/dt = A v - r z,    F_t = -(k z + d dz/dt + c v), of magnitude up to a cap

with the sliding velocity v and coefficients A, r, k, d, c, cap that the law gives. z is advanced
from the middle of one time step to that of the next, exactly for a constant v, that of the state
between them (`kernel.contact`): second order, and stiff bristles need no smaller step. It follows
the tangent plane as that turns, and is zero when the contact begins.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from jointplay.base.schema import Quantity, quantity
from jointplay.physics.contact.law import BRISTLE_NUMBERS, FrictionLaw
from jointplay.physics.contact.machine_code import MAX_PARAMETERS, compiled_law


class Bristles(NamedTuple):
    """Coefficients of a bristle law at a state; compiled functions return one."""

    bending: float
    """A, part of the sliding that bends the bristles."""
    release: float
    """r, rate at which they let go [1/s]."""
    stiffness: float
    """k, stiffness of the bristles [N/m]."""
    damping: float
    """d, damping of the bristles [N s/m]."""
    viscous: float
    """c, viscous friction [N s/m]."""
    cap: float
    """Largest force of the bristles [N], or infinity."""
    dwell_target: float
    """Value that the dwell tends to."""
    dwell_rate: float
    """Rate at which the dwell approaches it [1/s]."""


@dataclass(frozen=True)
class BristleLaw(FrictionLaw):
    """Base of friction laws with bristles.

    The compiled `function(speed, normal, dwell, parameters)` has the sliding speed [m/s], the
    normal force [N], the dwell (a second state, 0 at the onset) and the law's parameters, and
    returns `Bristles`.
    """

    state = ("speed", "normal", "dwell")
    answers = BRISTLE_NUMBERS
    bristles: ClassVar[bool] = True

    def stiffness(self, normal: float) -> tuple[float, float]:
        """Stiffness k [N/m] and damping d + c [N s/m] at rest under a normal force [N]."""
        out = (ctypes.c_double * BRISTLE_NUMBERS)()
        parameters = (ctypes.c_double * MAX_PARAMETERS)(*self.parameters())
        compiled_law(self).ctypes(0.0, normal, 0.0, parameters, out)
        return out[2], out[3] + out[4]


@dataclass(frozen=True)
class StribeckBristles(BristleLaw):
    """Base of bristle laws whose friction coefficient falls with speed from static to dynamic."""

    mu_d: Quantity = quantity("", default=0.1, above=0.0)
    """Dynamic friction coefficient."""
    mu_s: Quantity = quantity("", default=None, above=0.0)
    """Static friction coefficient, >= mu_d; 1.5 mu_d if not given."""
    v_s: Quantity = quantity("m/s", default=1e-2, above=0.0)
    """Speed over which the friction falls from static to dynamic [m/s]."""
    sigma0: Quantity = quantity("1/m", default=1e5, above=0.0)
    """Stiffness of the bristles per normal force [1/m]."""
    sigma1: Quantity = quantity("s/m", default=10.0, least=0.0)
    """Damping of the bristles per normal force [s/m]."""
    sigma2: Quantity = quantity("s/m", default=0.0, least=0.0)
    """Viscous friction per normal force [s/m]."""


@dataclass(frozen=True)
class Dahl(BristleLaw):
    """dz/dt = v - sigma0 |v| z / mu_d,  F_t = -F_n sigma0 z.

    Dahl's curve with the exponent 1, here per unit of normal force and with vectors in the plane of
    contact.
    """

    name = "dahl"
    formula = (
        r"\dot{\mathbf z} = \mathbf v_t-\frac{\sigma_0|v_t|}{\mu_d}\mathbf z,\quad "
        r"\mathbf F_t = -F_n\sigma_0\mathbf z"
    )
    reference = "P. R. Dahl, Aerospace Corporation, TOR-0158(3107-18)-1 (1968)"
    validity = "sticking and sliding at one coefficient; no Stribeck fall, no growth at rest"

    mu_d: Quantity = quantity("", default=0.1, above=0.0)
    """Friction coefficient."""
    sigma0: Quantity = quantity("1/m", default=1e5, above=0.0)
    """Stiffness of the bristles per normal force [1/m]."""

    @staticmethod
    def function(speed: float, normal: float, dwell: float, mu_d: float, sigma0: float) -> Bristles:
        return Bristles(
            bending=1.0,
            release=sigma0 * speed / mu_d,
            stiffness=sigma0 * normal,
            damping=0.0,
            viscous=0.0,
            cap=math.inf,
            dwell_target=0.0,
            dwell_rate=0.0,
        )


@dataclass(frozen=True)
class LuGre(StribeckBristles):
    """dz/dt = v - sigma0 |v| z / g(v),  F_t = -F_n (sigma0 z + sigma1 dz/dt + sigma2 v).

    g(v) = mu_d + (mu_s - mu_d) exp(-(v/v_s)^2), here per unit of normal force and with vectors in
    the plane of contact.

    Passive, at a constant normal force, if sigma2 >= sigma1 (mu_s - mu_d)/mu_d (`passive`): with
    the bristles' energy sigma0 z^2/2 and w = sigma0 z the power dissipated,

        (sigma1 + sigma2) v^2 - sigma1 v^2 w/g + w^2 v/g,

    is not negative, for w <= mu_s and g >= mu_d. (N. Barabanov, R. Ortega, IEEE Trans. Automatic
    Control 45 (2000) 830-832, show that it is necessary as well, by its title; not seen.) The
    defaults are not passive: at speeds far above v_s the bristles can supply energy while they let
    go.
    """

    name = "lugre"
    formula = (
        r"\dot{\mathbf z} = \mathbf v_t-\frac{\sigma_0|v_t|}{g}\mathbf z,\quad "
        r"\mathbf F_t = -F_n(\sigma_0\mathbf z+\sigma_1\dot{\mathbf z}+\sigma_2\mathbf v_t),\quad "
        r"g = \mu_d+(\mu_s-\mu_d)\,\mathrm e^{-(v_t/v_s)^2}"
    )
    reference = (
        "C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control "
        "40 (1995) 419-425"
    )
    validity = (
        "sticking and sliding with a Stribeck fall; drifts slowly under an oscillating force below "
        "the static one; passive only if sigma2 >= sigma1 (mu_s - mu_d)/mu_d"
    )

    @property
    def passive(self) -> bool:
        """Whether the law can never feed energy, at a constant normal force."""
        return self.sigma2 * self.mu_d >= self.sigma1 * (self.mu_s - self.mu_d)

    @staticmethod
    def function(
        speed: float,
        normal: float,
        dwell: float,
        mu_d: float,
        mu_s: float,
        v_s: float,
        sigma0: float,
        sigma1: float,
        sigma2: float,
    ) -> Bristles:
        ratio = speed / v_s
        g = mu_d + (mu_s - mu_d) * math.exp(-ratio * ratio)
        return Bristles(
            bending=1.0,
            release=sigma0 * speed / g,
            stiffness=sigma0 * normal,
            damping=sigma1 * normal,
            viscous=sigma2 * normal,
            cap=math.inf,
            dwell_target=0.0,
            dwell_rate=0.0,
        )


@dataclass(frozen=True)
class GonthierFriction(StribeckBristles):
    """Bristles that stick, slip, and stick more strongly the longer they have been at rest.

    With s = exp(-(v/v_s)^2), 1 when sticking and 0 when sliding, and the dwell s_d:

        dz/dt    = s v + (1 - s) (mu_d F_n / k * v/|v| - z) / tau,    tau = d/k
        ds_d/dt  = (s - s_d) / tau_d while s >= s_d, (s - s_d) / tau else
        F_t      = -(k z + d dz/dt), at most [mu_d + (mu_s - mu_d) s_d] F_n, and - c F_n v

    with k = sigma0 F_n and d = sigma1 F_n, here with a stiffness in proportion to the normal force.
    """

    name = "gonthier"
    formula = (
        r"\dot{\mathbf z} = s\mathbf v_t+(1-s)\frac1\tau"
        r"\left(\frac{\mu_d F_n}{k}\frac{\mathbf v_t}{|v_t|}-\mathbf z\right),\quad "
        r"\mathbf F_t = -(k\mathbf z+d\,\dot{\mathbf z}),\quad "
        r"s=\mathrm e^{-(v_t/v_s)^2},\ \tau=d/k"
    )
    reference = (
        "Y. Gonthier, J. McPhee, C. Lange, J.-C. Piedboeuf, Multibody Syst. Dyn. 11 (2004) 209-233"
    )
    validity = "sticking that grows with the time at rest, and sliding at mu_d"

    v_s: Quantity = quantity("m/s", default=1e-3, above=0.0)
    """Speed over which sticking turns into sliding [m/s]."""
    sigma1: Quantity = quantity("s/m", default=10.0, above=0.0)
    """Damping of the bristles per normal force, > 0 [s/m]."""
    dwell_time: Quantity = quantity("s", default=0.1, above=0.0)
    """Time constant tau_d with which static friction grows [s]."""

    @staticmethod
    def function(
        speed: float,
        normal: float,
        dwell: float,
        mu_d: float,
        mu_s: float,
        v_s: float,
        sigma0: float,
        sigma1: float,
        sigma2: float,
        dwell_time: float,
    ) -> Bristles:
        ratio = speed / v_s
        stick = math.exp(-ratio * ratio)
        slide = (1.0 - stick) * sigma0 / sigma1
        bending = stick
        if speed > 0.0:
            bending += slide * mu_d / sigma0 / speed
        return Bristles(
            bending=bending,
            release=slide,
            stiffness=sigma0 * normal,
            damping=sigma1 * normal,
            viscous=sigma2 * normal,
            cap=(mu_d + (mu_s - mu_d) * dwell) * normal,
            dwell_target=stick,
            dwell_rate=1.0 / dwell_time if stick >= dwell else sigma0 / sigma1,
        )
