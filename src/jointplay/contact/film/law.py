"""Lubricating films: what the oil between journal and bore does to the journal.

A film law is a Python function

    def film(eccentricity, rate, whirl, spin, clearance, radius, length, viscosity, ...): ...

of the eccentricity ratio e/c in [0, 1), its rate [1/s], the whirl v_t/c of the journal's centre
[1/s], v_t being its speed across the line of centres, and the journal's spin [rad/s], all relative
to the bearing; of c, R, L [m] and the viscosity [Pa s]; and of the law's own parameters. It returns
`FilmForce`, for the whole film of a journal that does not tilt. Of a tilted one the film is taken
at two sections, each half of it, so placed that pressures of the law's axial shape give the exact
moment to first order in the tilt (Gauss points).

The film of a nearly touching journal is a damper far too stiff for an explicit step. The kernel
therefore lets the force follow the law with a lag that is nothing where the step resolves the
film, and else just long enough to be stable (docs/theory.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from jointplay.contact.law import FILM_NUMBERS, Law
from jointplay.core.errors import JointplayError
from jointplay.core.schema import quantity


class FilmForce(NamedTuple):
    """What a film does to the journal; compiled functions return one."""

    radial: float
    """F_r, force on the journal along the line of centres, outwards [N]."""
    tangential: float
    """F_t, across it, a quarter turn ahead [N]."""
    moment: float
    """T, on the journal about its centre [N m]."""
    damping: float
    """C, largest slope of the force with the centre's velocity [N s/m]."""


class FilmProperties(NamedTuple):
    """What the joint tells a film law."""

    clearance: float
    """c [m]."""
    radius: float
    """R [m]."""
    length: float
    """L [m]."""
    contacts: int
    """Dry contacts, from the joint's first, that lie where the film is."""

    @property
    def tilts(self) -> bool:
        """Whether the journal can tilt."""
        return self.contacts > 1


@dataclass(frozen=True)
class FilmLaw(Law):
    """Base of all film laws.

    Raises:
        JointplayError: a value that is not positive.
    """

    state = ("eccentricity", "rate", "whirl", "spin")
    answers = FILM_NUMBERS

    section: ClassVar[float]
    """Distance of the two sections from the middle, over the length."""

    slenderness: ClassVar[tuple[float, float]] = (0.0, math.inf)
    """Length over diameter, the range that the law is good for."""

    viscosity: float = quantity("Pa*s", above=0.0)
    """Dynamic viscosity of the lubricant [Pa s]."""
    hybrid: bool = True
    """Dry contact takes over where the journal touches the bore.

    The film then fades over the depth `transition`. Without it a journal that touches ends the run.
    """
    transition: float = quantity("m", default=1e-6, above=0.0)
    """Depth e_t of penetration at which nothing of the film is left [m]."""
    least_thickness: float = quantity("m", default=1e-6, above=0.0, words="least film thickness")
    """Thickness below which a film is no thinner, for the surfaces are rough [m]."""

    def parameters(self, film: FilmProperties) -> tuple[float, ...]:
        """Parameters of `function`: c [m], R [m], L [m], viscosity [Pa s], and the law's own."""
        return film.clearance, film.radius, film.length, self.viscosity

    def warnings(self, film: FilmProperties, *, thinnest: float) -> list[str]:
        """Say, in one line each, in what a run left the law's range of validity.

        Args:
            film: the film the law was used for.
            thinnest: smallest gap of the run [m].
        """
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
                f"{self.least_thickness:g} m the surfaces are too rough for a film"
            )
        return lines

    def thickest(self, clearance: float) -> float:
        """Eccentricity ratio at which the film is at its thinnest.

        Raises:
            JointplayError: the clearance leaves no room for a film.
        """
        if self.least_thickness >= clearance:
            raise JointplayError(
                f"the least film thickness {self.least_thickness:g} m must be smaller than the "
                f"radial clearance {clearance:g} m",
                where=("least_thickness",),
            )
        return 1.0 - self.least_thickness / clearance
