"""User-defined laws: any function with the arguments of a law.

    def force(delta, ddelta, ddelta0, stiffness, alpha):
        return stiffness * delta**1.5 * (1.0 + alpha * ddelta)

    law = jp.contact.CustomNormalForce(force, {"stiffness": 1e11, "alpha": 0.08})

A function at module level of an importable file is named by results and scenarios as
``module:function``, and found again in other processes. One typed in a script or a notebook works
as well: its text is kept in the result, where it is shown and never run. Without the function a
result can be plotted, played and reported; only a rerun needs it, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from jointplay.base.errors import JointplayError
from jointplay.base.schema import Quantity, quantity
from jointplay.physics.contact.bristle import BristleLaw
from jointplay.physics.contact.film import FilmLaw
from jointplay.physics.contact.functions import Absent, FunctionDescription, OfFunction
from jointplay.physics.contact.law import ContactProperties, FrictionLaw, Law, NormalForceLaw
from jointplay.physics.contact.machine_code import (
    check_parameters,
    check_signature,
    parameter_names,
)

Parameters = Sequence[float] | Mapping[str, float]
"""Parameters of a law in the order of its arguments, or by name."""
_DEPTHS, _SPEEDS = (1e-7, 1e-5), (1e-3, 1.0, 3.0)
"""Depths [m] and approach speeds [m/s] at which a law's elastic force is checked."""


@dataclass(frozen=True, kw_only=True)
class FilmDescription(FunctionDescription):
    """Description, in files, of a user's film law; see docs/bearings.md."""

    viscosity: Quantity = quantity("Pa*s", default=1.0)
    """Dynamic viscosity."""
    hybrid: bool = True
    """Dry contact takes over where the journal touches the bore."""
    transition: Quantity = quantity("m", default=1e-6)
    """Penetration depth at which the film has vanished."""
    least_thickness: Quantity = quantity("m", default=1e-6)
    """Smallest film thickness."""


@dataclass(frozen=True, init=False, repr=False, kw_only=True)
class Custom(OfFunction, Law):
    """Base of user-defined laws of all kinds."""

    written = FunctionDescription

    reference = "the user"
    validity = "as stated by its author"

    function: Callable[..., Any]  # type: ignore[misc]
    """The law: a function of the arguments of its kind."""
    values: tuple[float, ...]
    """Parameters of the function, in the order of its arguments."""

    def __init__(self, function: Callable[..., Any], parameters: Parameters = ()) -> None:
        self._keep(function, parameters)

    def _keep(self, function: Callable[..., Any], parameters: Parameters, before: int = 0) -> None:
        """Keep function and parameters; the first `before` arguments come from the joint."""
        self._keep_function(function)
        values = _in_order(self.function, self.state, parameters, before)
        check_parameters((0.0,) * before + values, self.function.__name__)
        object.__setattr__(self, "values", values)

    def _check_arguments(self, function: Callable[..., Any]) -> None:
        check_signature(function, self.state, bool(self.answers))

    def parameters(self, *joint: Any) -> tuple[float, ...]:
        """Return the user's parameters; properties of the joint do not enter."""
        return self.values

    def _further_arguments(self) -> dict[str, Any]:
        arguments = super()._further_arguments()
        return {"parameters": arguments.pop("values"), **arguments}

    def describe(self) -> dict[str, Any]:
        described = super().describe()
        described["parameters"] = described.pop("values")
        return described

    def __repr__(self) -> str:
        arguments = self._further_arguments()
        more = [f"{name}={value!r}" for name, value in arguments.items() if name != "parameters"]
        text = ", ".join([self.function.__name__, repr(self.values), *more])
        return f"{type(self).__name__}({text})"


@dataclass(frozen=True, init=False, repr=False)
class CustomNormalForce(Custom, NormalForceLaw):
    """A user-defined normal-force law.

    Args:
        function: ``f(delta, ddelta, ddelta0, ...)`` returning F_n [N].
        parameters: its further arguments, at most `MAX_PARAMETERS` numbers, in order or by name; an
            argument called ``p`` takes all of them.

    Raises:
        JointplayError: the function takes other arguments, a parameter is missing or not finite,
            or the force at ddelta = 0 depends on ddelta0. Whether it compiles is known only when
            a run is prepared.
    """

    name = "custom"
    formula = r"F_n = f(\delta, \dot\delta, \dot\delta_0)"

    def __init__(self, function: Callable[..., float], parameters: Parameters = ()) -> None:
        self._keep(function, parameters)
        if not isinstance(self.function, Absent):
            self._check_elastic()

    def _check_elastic(self) -> None:
        """Raise if the force at zero rate depends on the approach speed."""
        named = parameter_names(self.function, self.state) is not None
        arguments = self.values if named else (self.values,)
        for depth in _DEPTHS:
            try:
                first, *others = (self.function(depth, 0.0, speed, *arguments) for speed in _SPEEDS)
                same = all(math.isclose(first, force, rel_tol=1e-9) for force in others)
                finite = math.isfinite(first)
            except Exception:  # noqa: BLE001 - it may be one that runs compiled only
                return
            if finite and not same:
                raise JointplayError(
                    f"law {self.function.__name__!r}: the force at ddelta = 0 is {first:g} N after "
                    f"an approach at {_SPEEDS[0]:g} m/s and {others[-1]:g} N after one at "
                    f"{_SPEEDS[-1]:g} m/s; it must not depend on ddelta0, for it defines the "
                    "energy stored"
                )

    def warnings(
        self, contact: ContactProperties, *, max_depth: float, max_speed: float
    ) -> list[str]:
        return []


@dataclass(frozen=True, init=False, repr=False)
class CustomFriction(Custom, FrictionLaw):
    """A user-defined law ``f(speed, ...)`` of the friction coefficient; see `CustomNormalForce`."""

    name = "custom"
    formula = r"\mu = f(|v_t|)"


@dataclass(frozen=True, init=False, repr=False)
class CustomBristle(Custom, BristleLaw):
    """A user-defined friction law ``f(speed, normal, dwell, ...)`` with bristles.

    Args:
        function: returns `bristle.Bristles`, or any tuple of its eight numbers; one that takes
            ``(speed, normal, dwell, p, out)`` writes them into `out`.
        parameters: see `CustomNormalForce`.

    Raises:
        JointplayError: the function takes other arguments, or a parameter is missing or not finite.
    """

    name = "custom-bristle"
    formula = (
        r"\dot{\mathbf z} = A\mathbf v_t-r\mathbf z,\quad "
        r"\mathbf F_t = -(k\mathbf z+d\,\dot{\mathbf z}+c\,\mathbf v_t)"
    )


@dataclass(frozen=True, init=False, repr=False)
class CustomFilm(Custom, FilmLaw):
    """A user-defined film law ``f(eccentricity, rate, whirl, spin, ...)``.

    Args:
        function: takes the joint's clearance c, radius R and length L, the viscosity, and then its
            own parameters; it returns `contact.film.FilmForce`, or any tuple of its four numbers.
            One that takes ``(eccentricity, rate, whirl, spin, p, out)`` writes them into `out`.
        parameters: its own, at most 4; see `CustomNormalForce`.
        viscosity, hybrid, transition, least_thickness: see `FilmLaw`.

    The film of a tilted journal is evaluated at the sections for a pressure constant along the
    axis.

    Raises:
        JointplayError: the function takes other arguments, or a parameter is missing or not finite.
    """

    name = "custom-film"
    section = 1.0 / (2.0 * math.sqrt(3.0))
    written = FilmDescription

    def __init__(
        self,
        function: Callable[..., Any],
        parameters: Parameters = (),
        viscosity: float = 1.0,
        hybrid: bool = True,
        transition: float = 1e-6,
        least_thickness: float = 1e-6,
    ) -> None:
        self._keep(function, parameters, before=4)
        values = viscosity, bool(hybrid), transition, least_thickness
        for field, value in zip(fields(FilmLaw), values, strict=True):
            object.__setattr__(self, field.name, value)
        self.__post_init__()

    def parameters(self, *joint: Any) -> tuple[float, ...]:
        return *FilmLaw.parameters(self, *joint), *self.values


def _in_order(
    function: Any, state: tuple[str, ...], parameters: Parameters, before: int
) -> tuple[float, ...]:
    """Put the parameters in the order of the function's arguments, the first `before` left out."""
    name = function.__name__
    names = None if isinstance(function, Absent) else parameter_names(function, state)
    if names is not None:
        names = names[before:]
    if isinstance(parameters, Mapping):
        if names is None:
            raise JointplayError(f"law {name!r} takes its parameters as an array; give a list")
        for key in parameters:
            if key not in names:
                raise JointplayError(
                    f"law {name!r} has no parameter {key!r}; its own are: {', '.join(names)}"
                )
        for key in names:
            if key not in parameters:
                raise JointplayError(f"law {name!r} needs the parameter {key!r}")
        parameters = [parameters[key] for key in names]
    values = tuple(float(value) for value in parameters)
    if names is not None and len(values) != len(names):
        raise JointplayError(
            f"law {name!r} takes {len(names)} parameters ({', '.join(names) or 'none'}), "
            f"got {len(values)}"
        )
    return values
