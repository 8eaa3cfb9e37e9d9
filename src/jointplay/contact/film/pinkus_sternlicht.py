"""The film of a long bearing with squeeze."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.contact.film.law import FilmForce, FilmLaw


def _film(
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
    rest = 1.0 - e * e
    root = math.sqrt(rest)
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
    along = -size * 6.0 / (wide * rest * root) * (4.0 * e * e * k_rate + wide * math.pi * rate)
    along *= share
    shear = 2.0 * math.pi * viscosity * spin * length * radius * radius * radius / (c * root)
    moment = -shear - 0.5 * e * c * across
    steepest = 4.0 * e * root + math.pi * wide if rate > 0.0 else math.pi * wide
    return FilmForce(along, across, moment, 12.0 * size / (c * wide * rest * root) * steepest)


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

    Raises:
        JointplayError: a value that is not positive.
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

    function = staticmethod(_film)
