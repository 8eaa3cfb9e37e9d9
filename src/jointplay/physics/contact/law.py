"""Base classes of contact laws: a short function of depth and rate, and its parameters.

A normal-force law is a Python function

    def force(delta, ddelta, ddelta0, stiffness, factor): ...    # -> F_n [N]

of the penetration delta > 0 [m], its rate ddelta [m/s] (positive while approaching), the approach
speed ddelta0 > 0 [m/s] memorised for this contact, and then of the law's own parameters, by name.
A friction law is a function

    def coefficient(speed, mu_d, v_t): ...                       # -> mu

of the sliding speed |v_t| >= 0 [m/s]. A single argument ``p`` in place of the parameters takes all
of them: p[0], p[1], ... All laws are compiled to C callbacks and called by address
(`machine_code`), so a user's law (`custom`) costs exactly what a built-in one costs, and the time
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
"""Number of results of a friction law with bristles; see `bristle.Bristles`."""
FILM_NUMBERS = 4
"""Number of results of a film law; see `film.FilmForce`."""
RESTITUTION_MARGIN = 0.05
"""Difference of an impact's restitution from c_e beyond which a run gets a warning."""
STATIC_RATIO = 1.5
"""Ratio of static to dynamic friction coefficient where only the dynamic one is given."""
WAVE_FRACTION = 1e-5
"""Approach speed, relative to that of elastic waves, up to which an impact is quasi-static.

A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity (1944); the criterion that
Lankarani and Nikravesh (1990) quote.
"""


class ContactProperties(NamedTuple):
    """Properties of a contact that its laws depend on.

    A property that is not known is zero or infinite, and nothing is checked against it.
    """

    stiffness: float
    """Hertz stiffness k of eq. 11 [N/m^1.5]."""
    restitution: float
    """Nominal coefficient of restitution c_e."""
    bearing_radius: float = 0.0
    """Radius R_i of the bearing, infinite for a plane [m]."""
    journal_radius: float = 0.0
    """Radius R_j of the journal [m]."""
    clearance: float = 0.0
    """Radial clearance C_r = R_i - R_j [m]."""
    journal_length: float = 0.0
    """Length L_j of the journal [m]."""
    contact_length: float = 0.0
    """Part of the journal's length that this contact stands for [m]; 0 if it is no line."""
    modulus: float = 0.0
    """Effective modulus E*, 1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j [Pa]."""
    wave_speed: float = math.inf
    """Larger sqrt(E/rho) of the two bodies [m/s]."""
    yield_strength: float = math.inf
    """Smaller yield strength of the two bodies [Pa]."""

    @property
    def radius(self) -> float:
        """Effective radius R = R_i R_j / C_r of eq. 13, R_j on a plane [m]; 0 if not known."""
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
    """Word that selects the law."""

    formula: ClassVar[str] = ""
    """The law in LaTeX."""

    reference: ClassVar[str] = ""
    """Where the law was published."""

    validity: ClassVar[str] = ""
    """Where the law is valid, and where it fails."""

    state: ClassVar[tuple[str, ...]]
    """Arguments of `function` that the time loop gives; the law's parameters follow."""

    answers: ClassVar[int] = 0
    """Number of results that `function` returns as a tuple; 0 if it returns a single number."""

    function: ClassVar[Callable[..., Any]]
    """The law itself, a static function compiled by numba: `state`, then parameters."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class NormalForceLaw(Law):
    """Base of all normal-force laws F_n(delta, ddelta, ddelta0, parameters)."""

    state: ClassVar[tuple[str, ...]] = ("delta", "ddelta", "ddelta0")

    line: ClassVar[bool] = False
    """Whether the law is one for line contact of a cylinder in a bore."""

    @abstractmethod
    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """Parameters of `function` for one contact, at most `MAX_PARAMETERS` of them."""

    def effective_restitution(self, restitution: float) -> float | None:
        """Restitution of a free impact at the nominal c_e; None if it depends on more than c_e."""
        return None

    def warnings(
        self, contact: ContactProperties, *, max_depth: float, max_speed: float
    ) -> list[str]:
        """Limits of validity that a run's depth [m] and approach [m/s] exceed, a line each."""
        lines = []
        delivered = self.effective_restitution(contact.restitution)
        # An elastic law, which delivers exactly 1, is chosen for it: no warning.
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
        """Limits of the law's own theory that a depth > 0 [m] exceeds, a line each."""
        return []


@dataclass(frozen=True)
class FrictionLaw(Law):
    """Base of all friction laws mu(speed, parameters); the force is -mu F_n v_t/|v_t| (eq. 20).

    A law with a static coefficient mu_s beside its mu_d must not have mu_s < mu_d. Where mu_s is
    None it becomes `STATIC_RATIO` mu_d, to 12 digits.
    """

    state: ClassVar[tuple[str, ...]] = ("speed",)

    bristles: ClassVar[bool] = False
    """Whether the law is a `bristle.BristleLaw`."""

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
        """Parameters of `function`, the fields that it names; at most `MAX_PARAMETERS` of them."""
        names = parameter_names(type(self).function, self.state) or ()
        return tuple(getattr(self, name) for name in names)

    @property
    def coefficients(self) -> dict[str, float]:
        """Coefficients of friction, by name: the fields whose names begin with mu."""
        names = [field.name for field in fields(self) if field.name.startswith("mu")]
        return {name: getattr(self, name) for name in names}

    def scaled(self, factor: float) -> Self:
        """Return the law with all its coefficients of friction multiplied by a factor."""
        factor = require_non_negative("factor", factor, "")
        changes: dict[str, Any] = {name: factor * mu for name, mu in self.coefficients.items()}
        return replace(self, **changes) if changes else self
