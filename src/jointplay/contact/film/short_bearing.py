"""The film of a short bearing, with the conditions of Gumbel or Sommerfeld."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.film.law import FilmForce, FilmLaw, FilmProperties
from jointplay.core.errors import MissingName

CAVITATION = ("gumbel", "sommerfeld")


def _film(
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
    rest = 1.0 - e * e
    root = math.sqrt(rest)
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
    sin_sin /= rest * root
    sin_cos /= rest * rest
    cos_cos /= rest * rest * root
    across = size * (wedge * sin_sin - squeeze * sin_cos)
    along = size * (wedge * sin_cos - squeeze * cos_cos)
    shear = 2.0 * math.pi * viscosity * spin * length * radius * radius * radius / (c * root)
    moment = -shear - 0.5 * e * c * across
    return FilmForce(along, across, moment, 2.0 * size / c * (sin_sin + cos_cos))


@dataclass(frozen=True)
class ShortBearing(FilmLaw):
    """Film of a short bearing, the pressure of Reynolds' equation without its flow around the bore.

    F_r = K [(w e - 2 v_t/c) I_sc - 2 de/dt I_cc],  F_t = K [(w e - 2 v_t/c) I_ss - 2 de/dt I_sc],

    K = mu R L^3/(2 c^2), e the eccentricity ratio, w the spin, I_xy the integrals of
    sin or cos over (1 - e cos)^3 around the bore: in closed form by Sommerfeld's substitution
    (A. Sommerfeld, Z. Math. Phys. 50 (1904) 97-155). Turning steadily it is the solution of F. W.
    Ocvirk, NACA TN 2808 (1952). The moment is that of the whole film's shear.

    Raises:
        JointplayError: a value out of range.
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
    """Gauss points for the weight L^2/4 - z^2, the pressure's shape along the axis."""

    function = staticmethod(_film)

    cavitation: str = "gumbel"
    """``gumbel`` lets only positive pressure act; ``sommerfeld`` lets the oil pull."""

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        if self.cavitation not in CAVITATION:
            raise MissingName("cavitation", self.cavitation, CAVITATION, where=("cavitation",))

    def parameters(self, film: FilmProperties) -> tuple[float, ...]:
        """c [m], R [m], L [m], viscosity [Pa s]; 0 for Gumbel's, 1 for Sommerfeld's condition."""
        return *super().parameters(film), float(CAVITATION.index(self.cavitation))
