"""What a contact law is: a short function of penetration and rate, and its parameters.

A normal-force law is a Python function

    def force(delta, ddelta, ddelta0, stiffness, factor): ...    # -> F_n [N]

of the penetration delta > 0 [m], its rate ddelta [m/s] (positive while approaching), the approach
speed ddelta0 > 0 [m/s] memorised for this contact, and then of the law's own parameters, by name.
A friction law is a function

    def coefficient(speed, mu_d, v_t): ...                       # -> mu

of the sliding speed |v_t| >= 0 [m/s]. An argument called ``p`` in the place of the parameters has
all of them: p[0], p[1], ... All laws are compiled to C callbacks and called by address
(`machine_code`), so a user's law (`custom`) costs exactly what a built-in one costs and the time
loop is compiled once for all.

The force at ddelta = 0 must not depend on ddelta0: it defines the energy stored.

Laws are values: frozen, equal when their fields are, and shown as one would write them.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple, Self

from jointplay.base.errors import JointplayError, require_non_negative
from jointplay.base.schema import Described, check_fields
from jointplay.physics.contact.machine_code import parameter_names

BRISTLE_NUMBERS = 8
"""What a friction law with bristles tells; see `bristle.Bristles`."""
FILM_NUMBERS = 4
"""What a film law tells; see `film.FilmForce`."""
RESTITUTION_MARGIN = 0.05
"""A run is warned of if an impact delivers a restitution further than this from c_e."""
STATIC_RATIO = 1.5
"""Static over dynamic friction coefficient, where only the dynamic one is given."""
WAVE_FRACTION = 1e-5
"""Fraction of the waves' speed up to which an impact counts as quasi-static.

A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity (1944); the criterion that
Lankarani and Nikravesh (1990) quote.
"""


class ContactProperties(NamedTuple):
    """What the joint tells a law about the contact it is used in.

    Zero or infinity stands for what is not known, and then nothing is checked against it.
    """

    stiffness: float
    """Hertz stiffness k of eq. 11 [N/m^1.5]."""
    restitution: float
    """Nominal coefficient of restitution c_e."""
    bearing_radius: float = 0.0
    """R_i, infinite for a plane [m]."""
    journal_radius: float = 0.0
    """R_j [m]."""
    clearance: float = 0.0
    """C_r = R_i - R_j [m]."""
    journal_length: float = 0.0
    """L_j [m]."""
    contact_length: float = 0.0
    """Part of the journal's length that this contact stands for [m]; 0 if it is no line."""
    modulus: float = 0.0
    """E*, of 1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j [Pa]."""
    wave_speed: float = math.inf
    """The larger sqrt(E/rho) of both bodies [m/s]."""
    yield_strength: float = math.inf
    """The smaller one of both bodies [Pa]."""

    @property
    def radius(self) -> float:
        """R = R_i R_j / C_r of eq. 13, R_j on a plane [m]; 0 if not known."""
        if math.isinf(self.bearing_radius):
            return self.journal_radius
        return self.bearing_radius * self.journal_radius / self.clearance if self.clearance else 0.0


@dataclass(frozen=True)
class Law(Described, ABC):
    """A function of the contact state and the parameters it is called with.

    Raises:
        JointplayError: a field out of its range.
    """

    selector = ("law", "name")

    name: ClassVar[str]
    """The one word that selects the law."""

    formula: ClassVar[str] = ""
    """The law in LaTeX."""

    reference: ClassVar[str] = ""
    """Where the law was published."""

    validity: ClassVar[str] = ""
    """What the law is good for, and where it fails."""

    state: ClassVar[tuple[str, ...]]
    """Arguments of `function` that the time loop gives; the law's parameters follow."""

    answers: ClassVar[int] = 0
    """How many numbers `function` returns as a tuple; 0 for a single one."""

    function: ClassVar[Callable[..., Any]]
    """The law itself, a static function compiled by numba; the module's text has its arguments."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class NormalForceLaw(Law):
    """Base of all normal-force laws F_n(delta, ddelta, ddelta0, parameters)."""

    state: ClassVar[tuple[str, ...]] = ("delta", "ddelta", "ddelta0")

    line: ClassVar[bool] = False
    """Whether the law is one of a cylinder in a bore."""

    @abstractmethod
    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """Parameters of `function` for one contact, at most `MAX_PARAMETERS` of them."""

    def effective_restitution(self, restitution: float) -> float | None:
        """Restitution of a free impact at the nominal c_e; None if not closed in c_e alone."""
        return None

    def warnings(
        self, contact: ContactProperties, *, max_depth: float, max_speed: float
    ) -> list[str]:
        """In what a run to a depth [m] and approach [m/s] left the valid range, a line each."""
        lines = []
        delivered = self.effective_restitution(contact.restitution)
        # An elastic law (exactly 1) is chosen for that; there is nothing to warn of.
        if (
            delivered is not None
            and delivered < 1.0
            and abs(delivered - contact.restitution) > RESTITUTION_MARGIN
        ):
            lines.append(
                f"{self.name} delivers a restitution of {delivered:.3f} instead of the nominal "
                f"{contact.restitution:g}"
            )
        limit = WAVE_FRACTION * contact.wave_speed
        if max_speed > limit:
            lines.append(
                f"{self.name} is quasi-static: an approach at {max_speed:.3g} m/s is above "
                f"1e-5 sqrt(E/rho) = {limit:.3g} m/s"
            )
        return lines + (self._limits(contact, max_depth) if max_depth > 0.0 else [])

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        """In what a depth > 0 [m] exceeds the limits of the law's own theory."""
        return []


@dataclass(frozen=True)
class FrictionLaw(Law):
    """Base of all friction laws mu(speed, parameters); the force is -mu F_n v_t/|v_t| (eq. 20).

    A law with a static coefficient mu_s beside its mu_d must not have mu_s < mu_d. Where mu_s is
    None it is `STATIC_RATIO` mu_d, to 12 digits: what one law says of sliding holds in another.
    """

    state: ClassVar[tuple[str, ...]] = ("speed",)

    bristles: ClassVar[bool] = False
    """Whether the law is one of `bristle.BristleLaw`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        coefficients = self.coefficients
        if not {"mu_s", "mu_d"} <= set(coefficients):
            return
        mu_s, mu_d = coefficients["mu_s"], coefficients["mu_d"]
        if mu_s is None:
            object.__setattr__(self, "mu_s", float(f"{STATIC_RATIO * mu_d:.12g}"))
        elif mu_s < mu_d:
            raise JointplayError(
                f"mu_s must be at least mu_d = {mu_d:g}, got {mu_s:g}", where=("mu_s",)
            )

    def parameters(self) -> tuple[float, ...]:
        """Parameters of `function`, at most `MAX_PARAMETERS` of them: the fields it names."""
        names = parameter_names(type(self).function, self.state) or ()
        return tuple(getattr(self, name) for name in names)

    @property
    def coefficients(self) -> dict[str, float]:
        """Its coefficients of friction by the names of their fields: those that begin with mu."""
        names = [field.name for field in fields(self) if field.name.startswith("mu")]
        return {name: getattr(self, name) for name in names}

    def scaled(self, factor: float) -> Self:
        """The law with all its coefficients of friction multiplied."""
        factor = require_non_negative("factor", factor, "")
        changes: dict[str, Any] = {name: factor * mu for name, mu in self.coefficients.items()}
        return replace(self, **changes) if changes else self
