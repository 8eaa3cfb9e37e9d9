"""Lubricating films: what the oil between journal and bore does to the journal.

A film law is a Python function

    def film(eccentricity, rate, whirl, spin, p, out): ...

of the eccentricity ratio e/c in [0, 1), its rate [1/s], the whirl v_t/c of the journal's centre
[1/s], v_t being its speed across the line of centres, and the journal's spin [rad/s], all relative
to the bearing. It writes into `out`

    out[0]  F_r [N]      force on the journal along the line of centres, outwards
    out[1]  F_t [N]      across it, a quarter turn ahead
    out[2]  T [N m]      moment on the journal about its centre
    out[3]  C [N s/m]    damping: largest slope of the force with the centre's velocity

for the whole film of a journal that does not tilt. Of a tilted one the film is taken at two
sections, each half of it, so placed that pressures of the law's axial shape give the exact moment
to first order in the tilt (Gauss points).

The film of a nearly touching journal is a damper far too stiff for an explicit step. The kernel
therefore lets the force follow the law with a lag that is nothing where the step resolves the
film, and else just long enough to be stable (docs/theory.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

from jointplay.contact.law import Law, check_parameters, describe_custom, plain
from jointplay.errors import JointplayError, require_positive


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


class FilmLaw(Law):
    """Base of all film laws.

    Args:
        viscosity: dynamic viscosity of the lubricant [Pa s].
        hybrid: dry contact takes over where the journal touches the bore; the film then fades over
            the depth `transition`. Without it a journal that touches ends the run.
        transition: depth e_t of penetration at which nothing of the film is left [m].
        least_thickness: thickness below which a film is no thinner, for the surfaces are rough [m].

    Raises:
        JointplayError: a value that is not positive.
    """

    section: ClassVar[float]
    """Distance of the two sections from the middle, over the length."""

    slenderness: ClassVar[tuple[float, float]] = (0.0, math.inf)
    """Length over diameter, the range that the law is good for."""

    def __init__(
        self,
        viscosity: float,
        hybrid: bool = True,
        transition: float = 1e-6,
        least_thickness: float = 1e-6,
    ) -> None:
        """Check and keep the parameters."""
        self.viscosity = require_positive("viscosity", viscosity, "Pa s")
        self.hybrid = bool(hybrid)
        self.transition = require_positive("transition", transition, "m")
        self.least_thickness = require_positive("least film thickness", least_thickness, "m")

    def parameters(self, film: FilmProperties) -> tuple[float, ...]:
        """Parameters p of `function`: c [m], R [m], L [m], viscosity [Pa s], and the law's own."""
        return film.clearance, film.radius, film.length, self.viscosity

    def describe(self) -> dict[str, Any]:
        """Name and fields of the law."""
        return {"law": self.name, **vars(self)}

    def warnings(self, film: FilmProperties, *, thinnest: float) -> list[str]:
        """Say, in one line each, in what a run left the law's range of validity.

        Args:
            film: the film the law was used for.
            thinnest: smallest gap of the run [m].
        """
        found = []
        slenderness = film.length / (2.0 * film.radius)
        low, high = self.slenderness
        if not low <= slenderness <= high:
            limit = f"up to {high:g}" if slenderness > high else f"from {low:g}"
            found.append(
                f"{self.name} is made for length/diameter {limit}, this bearing has "
                f"{slenderness:.3g}"
            )
        if thinnest < self.least_thickness:
            found.append(
                f"{self.name}: the film got as thin as {max(thinnest, 0.0):.2g} m; below "
                f"{self.least_thickness:g} m the surfaces are too rough for a film"
            )
        return found

    def thickest(self, clearance: float) -> float:
        """Eccentricity ratio at which the film is at its thinnest.

        Raises:
            JointplayError: the clearance leaves no room for a film.
        """
        if self.least_thickness >= clearance:
            raise JointplayError(
                f"the least film thickness {self.least_thickness:g} m must be smaller than the "
                f"radial clearance {clearance:g} m"
            )
        return 1.0 - self.least_thickness / clearance


class CustomFilm(FilmLaw):
    """A user's own film law ``f(eccentricity, rate, whirl, spin, p, out)``.

    Args:
        function: writes the four numbers of this module's text into `out`; at module level of an
            importable file (a result file then names it as ``module:function``).
        parameters: numbers the function finds in p after c, R, L and the viscosity; at most 4.
        viscosity, hybrid, transition, least_thickness: see `FilmLaw`.

    The film of a tilted journal is taken where a pressure constant along the axis wants it.

    Raises:
        JointplayError: the function takes other arguments, or a parameter is not finite.
    """

    name = "custom-film"
    section = 1.0 / (2.0 * math.sqrt(3.0))

    def __init__(
        self,
        function: Callable[..., None],
        parameters: tuple[float, ...] = (),
        viscosity: float = 1.0,
        hybrid: bool = True,
        transition: float = 1e-6,
        least_thickness: float = 1e-6,
    ) -> None:
        """Check the function's signature and keep its parameters."""
        super().__init__(viscosity, hybrid, transition, least_thickness)
        expected = ("eccentricity", "rate", "whirl", "spin", "p", "out")
        self.function = plain(function, expected)
        self.values = tuple(float(value) for value in parameters)
        check_parameters((0.0,) * 4 + self.values, self.function.__name__)

    def parameters(self, film: FilmProperties) -> tuple[float, ...]:
        """c [m], R [m], L [m], viscosity [Pa s], and the user's own numbers."""
        return *super().parameters(film), *self.values

    def describe(self) -> dict[str, Any]:
        """Import path of the function, and all parameters."""
        fields = {key: value for key, value in vars(self).items() if key != "function"}
        del fields["values"]
        return {**describe_custom(self.name, self.function, self.values), **fields}
