"""Lubricating films: hydrodynamic force of the oil between journal and bore.

A film law is a Python function

    def film(eccentricity, rate, whirl, spin, clearance, radius, length, viscosity, ...): ...

of the eccentricity ratio e/c in [0, 1), its rate [1/s], the whirl v_t/c of the journal's centre
[1/s], v_t being its speed across the line of centres, and the journal's spin [rad/s], all relative
to the bearing; of c, R, L [m] and the viscosity [Pa s]; and of the law's own parameters. It returns
`FilmForce`, for the whole film of a journal that does not tilt. The film of a tilted journal is
evaluated at two sections, each half of it, placed such that pressures of the law's axial shape give
the exact moment to first order in the tilt (Gauss points).

The film of a nearly touching journal is a damper far too stiff for an explicit step. In explicit
methods the kernel therefore lets the force follow the law with a lag, which is nothing where the
step resolves the film and else just long enough to be stable (docs/bearings.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from jointplay.base.errors import JointplayError
from jointplay.base.schema import Quantity, choice, quantity
from jointplay.base.units import readable
from jointplay.physics.contact.law import FILM_NUMBERS, Law


class FilmForce(NamedTuple):
    """Force and moment of a film on the journal; compiled functions return one."""

    radial: float
    """F_r, force along the line of centres, outwards [N]."""
    tangential: float
    """F_t, force across it, a quarter turn ahead [N]."""
    moment: float
    """T, moment about the journal's centre [N m]."""
    damping: float
    """C, largest derivative of the force by the centre's velocity [N s/m]."""


class FilmProperties(NamedTuple):
    """Properties of a joint that its film law depends on."""

    clearance: float
    """Radial clearance c [m]."""
    radius: float
    """Radius R [m]."""
    length: float
    """Length L [m]."""
    contacts: int
    """Number of dry contacts, from the joint's first, in the film's region."""

    @property
    def tilts(self) -> bool:
        """Whether the journal can tilt."""
        return self.contacts > 1


@dataclass(frozen=True)
class FilmLaw(Law):
    """Base of all film laws."""

    state = ("eccentricity", "rate", "whirl", "spin")
    answers = FILM_NUMBERS

    section: ClassVar[float]
    """Distance of the two sections from the middle, relative to the length."""

    slenderness: ClassVar[tuple[float, float]] = (0.0, math.inf)
    """Range of length over diameter for which the law is valid."""

    viscosity: Quantity = quantity("Pa*s", above=0.0)
    """Dynamic viscosity of the lubricant [Pa s]."""
    hybrid: bool = True
    """Dry contact takes over where the journal touches the bore.

    The film then fades over the depth `transition`. Without it a journal that touches ends the run.
    """
    transition: Quantity = quantity("m", default=1e-6, above=0.0)
    """Penetration depth e_t at which the film has vanished [m]."""
    least_thickness: Quantity = quantity("m", default=1e-6, above=0.0, label="least film thickness")
    """Smallest film thickness, because the surfaces are rough [m]."""

    def parameters(self, film: FilmProperties) -> tuple[float, ...]:
        """Parameters of `function`: c [m], R [m], L [m], viscosity [Pa s], and the law's own."""
        return film.clearance, film.radius, film.length, self.viscosity

    def warnings(self, film: FilmProperties, *, thinnest: float) -> list[str]:
        """Limits of validity that a run with a gap of `thinnest` [m] exceeded, a line each."""
        lines = []
        slenderness = film.length / (2.0 * film.radius)
        low, high = self.slenderness
        if not low <= slenderness <= high:
            limit = f"up to {high:g}" if slenderness > high else f"from {low:g}"
            lines.append(
                f"{self.name} is made for length/diameter {limit}, this bearing has "
                f"{slenderness:.3g}"
            )
        if thinnest < self.least_thickness:
            lines.append(
                f"{self.name}: the film got as thin as {max(thinnest, 0.0):.2g} m; below "
                f"{readable(self.least_thickness, 'm')} the surfaces are too rough for a film"
            )
        return lines

    def thickest(self, clearance: float) -> float:
        """Eccentricity ratio at which the film has its least thickness.

        Raises:
            JointplayError: the clearance leaves no room for a film.
        """
        if self.least_thickness >= clearance:
            raise JointplayError(
                f"the least film thickness {readable(self.least_thickness, 'm')} must be smaller "
                f"than the radial clearance {readable(clearance, 'm')}",
                where=("least_thickness",),
            )
        return 1.0 - self.least_thickness / clearance


CAVITATION = ("gumbel", "sommerfeld")
"""Boundary conditions of the pressure where the film would pull."""


@dataclass(frozen=True)
class ShortBearing(FilmLaw):
    """Film of a short bearing: Reynolds' equation without circumferential flow.

    F_r = K [(w e - 2 v_t/c) I_sc - 2 de/dt I_cc],  F_t = K [(w e - 2 v_t/c) I_ss - 2 de/dt I_sc],

    K = mu R L^3/(2 c^2), e the eccentricity ratio, w the spin, I_xy the integrals of
    sin or cos over (1 - e cos)^3 around the bore: in closed form by Sommerfeld's substitution
    (A. Sommerfeld, Z. Math. Phys. 50 (1904) 97-155). Turning steadily it is the solution of F. W.
    Ocvirk, NACA TN 2808 (1952). The moment is that of the whole film's shear.
    """

    name = "short-bearing"
    formula = (
        r"p = \frac{6\mu}{h^3}\left(\frac{L^2}{4}-z^2\right)"
        r"\left[\dot e\cos\alpha - \left(\tfrac{\omega}{2}-\dot\gamma\right)e\sin\alpha\right]"
    )
    reference = "F. W. Ocvirk, NACA Technical Note 2808 (1952)"
    validity = "bearings up to about as long as half their diameter"
    slenderness = (0.0, 0.5)
    section = 1.0 / (2.0 * math.sqrt(5.0))
    """Gauss points for the weight L^2/4 - z^2, the axial shape of the pressure."""

    cavitation: str = choice("cavitation", CAVITATION, default=CAVITATION[0])
    """``gumbel`` lets only positive pressure act; ``sommerfeld`` lets the oil pull."""

    @staticmethod
    def function(
        eccentricity: float,
        rate: float,
        whirl: float,
        spin: float,
        clearance: float,
        radius: float,
        length: float,
        viscosity: float,
        pulling: float,
    ) -> FilmForce:
        e, c = eccentricity, clearance
        complement = 1.0 - e * e
        root = math.sqrt(complement)
        size = viscosity * radius * length * length * length / (2.0 * c * c)
        squeeze = 2.0 * rate
        wedge = spin * e - 2.0 * whirl
        # In Sommerfeld's angle psi, counted from the thinnest film, the pressure is positive where
        # a cos(psi) - b sin(psi) > -a e.
        a, b = squeeze, wedge * root
        amplitude = math.sqrt(a * a + b * b)
        middle, half = 0.0, math.pi
        if pulling == 0.0 and amplitude > 0.0:
            middle = -math.atan2(b, a)
            half = math.acos(-a * e / amplitude)
        # Integrals over middle +- half of sin^2, sin (cos + e) and (cos + e)^2.
        wave = math.sin(half) * math.cos(half)
        first = 2.0 * math.sin(half)
        c1, s1 = math.cos(middle), math.sin(middle)
        c2, s2 = c1 * c1 - s1 * s1, 2.0 * s1 * c1
        sin_sin = half - wave * c2
        sin_cos = wave * s2 + e * first * s1
        cos_cos = half + wave * c2 + 2.0 * e * first * c1 + 2.0 * half * e * e
        sin_sin /= complement * root
        sin_cos /= complement * complement
        cos_cos /= complement * complement * root
        across = size * (wedge * sin_sin - squeeze * sin_cos)
        along = size * (wedge * sin_cos - squeeze * cos_cos)
        shear = 2.0 * math.pi * viscosity * spin * length * radius * radius * radius / (c * root)
        moment = -shear - 0.5 * e * c * across
        return FilmForce(along, across, moment, 2.0 * size / c * (sin_sin + cos_cos))

    def parameters(self, film: FilmProperties) -> tuple[float, ...]:
        return *super().parameters(film), float(CAVITATION.index(self.cavitation))


@dataclass(frozen=True)
class PinkusSternlicht(FilmLaw):
    """Film of a long bearing with squeeze, only positive pressure acting.

    F_r = -(mu L R^3/c^2) 6/((2 + e^2)(1 - e^2)^(3/2)) [4 k e^2 |e'| + (2 + e^2) pi e'] s
    F_t =  (mu L R^3/c^2) 6 pi e (w - 2 g')/((2 + e^2)(1 - e^2)^(1/2)) s
    s = (k + 3)/(k + 3/2) where the film is squeezed, e' > 0, else k/(k + 3/2)
    k^2 = (1 - e^2) [((w - 2 g')/(2 e'))^2 + 1/e^2]

    with the eccentricity ratio e, the spin w and the line of centres at g. Turning steadily this
    is half Sommerfeld's long bearing; a pure squeeze of a centred journal is carried by half the
    film, that of a nearly touching one by all of it. The sign of the first term is the one that
    makes both hold for e' < 0 too.
    """

    name = "pinkus-sternlicht"
    formula = (
        r"F_r = -\frac{\mu L R^3}{c^2}\frac{6}{(2+\epsilon^2)(1-\epsilon^2)^{3/2}}"
        r"\left[4k\epsilon^2|\dot\epsilon|+(2+\epsilon^2)\pi\dot\epsilon\right]s"
    )
    reference = (
        "O. Pinkus, B. Sternlicht, Theory of Hydrodynamic Lubrication (1961); P. Flores, "
        "H. M. Lankarani, J. Ambrosio, J. C. P. Claro, Proc. IMechE K 218 (2004) 183-190"
    )
    validity = (
        "bearings at least about twice as long as their diameter; a pure squeeze is up to 13 % "
        "above Reynolds' half film"
    )
    slenderness = (2.0, math.inf)
    section = 1.0 / (2.0 * math.sqrt(3.0))
    """Gauss points for a pressure that is constant along the axis."""

    @staticmethod
    def function(
        eccentricity: float,
        rate: float,
        whirl: float,
        spin: float,
        clearance: float,
        radius: float,
        length: float,
        viscosity: float,
    ) -> FilmForce:
        c = clearance
        # The line of centres has no direction at e = 0, where the formulas divide by e.
        e = max(eccentricity, 1e-6)
        complement = 1.0 - e * e
        root = math.sqrt(complement)
        size = viscosity * length * radius * radius * radius / (c * c)
        wedge = spin * e - 2.0 * whirl  # (w - 2 dgamma/dt) e
        pressing = abs(rate)
        # k |de/dt| stays finite where de/dt is zero.
        k_rate = root * math.sqrt(0.25 * wedge * wedge + rate * rate) / e
        if rate > 0.0:
            share = (k_rate + 3.0 * pressing) / (k_rate + 1.5 * pressing)
        else:
            share = k_rate / (k_rate + 1.5 * pressing) if k_rate > 0.0 else 1.0
        wide = 2.0 + e * e
        across = size * 6.0 * math.pi * wedge / (wide * root) * share
        pull = 4.0 * e * e * k_rate + wide * math.pi * rate
        along = -size * 6.0 / (wide * complement * root) * pull
        along *= share
        shear = 2.0 * math.pi * viscosity * spin * length * radius * radius * radius / (c * root)
        moment = -shear - 0.5 * e * c * across
        steepest = 4.0 * e * root + math.pi * wide if rate > 0.0 else math.pi * wide
        damping = 12.0 * size / (c * wide * complement * root) * steepest
        return FilmForce(along, across, moment, damping)
