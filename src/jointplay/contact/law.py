"""What a contact law is: a short function of penetration and rate, and its parameters.

A normal-force law is a Python function

    def force(delta, ddelta, ddelta0, p): ...    # -> F_n [N]

of the penetration delta > 0 [m], its rate ddelta [m/s] (positive while approaching), the approach
speed ddelta0 > 0 [m/s] memorised for this contact, and the law's own parameters p[0], p[1], ...
A friction law is a function

    def coefficient(speed, p): ...               # -> mu

of the sliding speed |v_t| >= 0 [m/s]. Both are compiled to C callbacks and called by address, so
a user's law costs exactly what a built-in one costs and the time loop is compiled once for all.

The force at ddelta = 0 must not depend on ddelta0: it defines the energy stored.
"""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from jointplay.contact.trust import imported, know, path_of
from jointplay.errors import JointplayError, require_finite

MAX_PARAMETERS = 8
"""Numbers a law can take: the room that the time loop keeps for each contact."""

BRISTLE_NUMBERS = 8
"""What a friction law with bristles tells; see `bristle.BristleLaw`."""

FILM_NUMBERS = 4
"""What a film law tells; see `film`."""

_PARAMETERS = types.CPointer(types.float64)
_NORMAL = types.float64(types.float64, types.float64, types.float64, _PARAMETERS)
_FRICTION = types.float64(types.float64, _PARAMETERS)
_BRISTLE = types.void(types.float64, types.float64, types.float64, _PARAMETERS, _PARAMETERS)
_FILM = types.void(*(types.float64,) * 4, _PARAMETERS, _PARAMETERS)
_DOUBLE = ir.DoubleType()


RESTITUTION_MARGIN = 0.05
"""A run is warned of if an impact delivers a restitution further than this from c_e."""

WAVE_FRACTION = 1e-5
"""Fraction of the waves' speed up to which an impact counts as quasi-static.

A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity; the criterion that Lankarani
and Nikravesh (1990) quote.
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


class Law(ABC):
    """A function of the contact state and the parameters it is called with."""

    name: ClassVar[str]
    """The one word that selects the law."""

    formula: ClassVar[str] = ""
    """The law in LaTeX."""

    reference: ClassVar[str] = ""
    """Where the law was published."""

    validity: ClassVar[str] = ""
    """What the law is good for, and where it stops to be."""

    function: Callable[..., Any]
    """The law itself, a static function compiled by numba; the module's text has its arguments."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Everything needed to build this law again, as plain data."""


class NormalForceLaw(Law):
    """Base of all normal-force laws F_n(delta, ddelta, ddelta0, p)."""

    line: ClassVar[bool] = False
    """Whether the law is one of a cylinder in a bore."""

    @abstractmethod
    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """Parameters p of `function` for one contact, at most `MAX_PARAMETERS` of them."""

    def effective_restitution(self, restitution: float) -> float | None:
        """Restitution of a single free impact; None if it has no closed form in c_e alone.

        Args:
            restitution: the nominal one, c_e.
        """
        return None

    def warnings(
        self, contact: ContactProperties, *, max_depth: float, max_speed: float
    ) -> list[str]:
        """Say, in one line each, in what a run left the law's range of validity.

        Args:
            contact: the contact the law was used in.
            max_depth: deepest penetration of the run [m].
            max_speed: fastest approach of the run [m/s].
        """
        found = []
        delivered = self.effective_restitution(contact.restitution)
        # An elastic law (exactly 1) is chosen for that; there is nothing to warn of.
        if (
            delivered is not None
            and delivered < 1.0
            and abs(delivered - contact.restitution) > RESTITUTION_MARGIN
        ):
            found.append(
                f"{self.name} delivers a restitution of {delivered:.3f} where "
                f"{contact.restitution:g} is asked for"
            )
        limit = WAVE_FRACTION * contact.wave_speed
        if max_speed > limit:
            found.append(
                f"{self.name} is quasi-static: an approach at {max_speed:.3g} m/s is above "
                f"1e-5 sqrt(E/rho) = {limit:.3g} m/s"
            )
        return found + (self._limits(contact, max_depth) if max_depth > 0.0 else [])

    def _limits(self, contact: ContactProperties, max_depth: float) -> list[str]:
        """Say in what a depth > 0 [m] exceeds the limits of the law's own theory."""
        return []

    def describe(self) -> dict[str, Any]:
        """Name and fields of the law."""
        return {"law": self.name, **vars(self)}


class FrictionLaw(Law):
    """Base of all friction laws mu(speed, p); the force is -mu F_n v_t / |v_t| (eq. 20)."""

    bristles: ClassVar[bool] = False
    """Whether the law is one of `bristle.BristleLaw`."""

    @abstractmethod
    def parameters(self) -> tuple[float, ...]:
        """Parameters p of `function`, at most `MAX_PARAMETERS` of them."""

    def describe(self) -> dict[str, Any]:
        """Name and fields of the law."""
        return {"law": self.name, **vars(self)}


def require_static(mu_s: float, mu_d: float) -> float:
    """Return the static friction coefficient if it is not below the dynamic one, else raise."""
    mu_s = require_finite("mu_s", mu_s, "")
    if mu_s < mu_d:
        raise JointplayError(f"mu_s must be at least mu_d = {mu_d:g}, got {mu_s:g}")
    return mu_s


def plain(function: Callable[..., Any], expected: tuple[str, ...]) -> Callable[..., Any]:
    """Return the Python function, if it takes the `expected` arguments; files may name it now."""
    function = getattr(function, "py_func", function)  # numba's own wrapping is not needed
    if not callable(function):
        raise JointplayError(f"a law must be a function, got {function!r}")
    try:
        names = tuple(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        names = ()
    if len(names) != len(expected):
        raise JointplayError(
            f"law {getattr(function, '__name__', function)!r} takes ({', '.join(names)}); "
            f"it must take ({', '.join(expected)})"
        )
    return know(function)


class CustomNormalForce(NormalForceLaw):
    """A user's own normal-force law.

    Args:
        function: ``f(delta, ddelta, ddelta0, p)`` returning F_n [N], at module level of an
            importable file (a result file then names it as ``module:function``).
        parameters: numbers the function finds in p, at most `MAX_PARAMETERS`.

    Raises:
        JointplayError: the function takes other arguments, or a parameter is not finite. Whether
            it compiles is found out when a run is prepared.
    """

    name = "custom"
    formula = r"F_n = f(\delta, \dot\delta, \dot\delta_0)"
    reference = "the user"
    validity = "what its author says"

    def __init__(self, function: Callable[..., float], parameters: tuple[float, ...] = ()) -> None:
        """Check the function's signature and keep its parameters."""
        self.function = plain(function, ("delta", "ddelta", "ddelta0", "p"))
        self.values = tuple(float(value) for value in parameters)
        check_parameters(self.values, self.function.__name__)

    def parameters(self, contact: ContactProperties) -> tuple[float, ...]:
        """Return the user's own numbers; stiffness and restitution of the joint do not enter."""
        return self.values

    def warnings(
        self, contact: ContactProperties, *, max_depth: float, max_speed: float
    ) -> list[str]:
        """Say nothing: only its author knows the law's range."""
        return []

    def describe(self) -> dict[str, Any]:
        """Import path of the function, and its parameters."""
        return describe_custom(self.name, self.function, self.values)

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to another process by name, as to a file."""
        return restored, (type(self), named(self.function), self.values)


class CustomFriction(FrictionLaw):
    """A user's own friction law ``f(speed, p)`` returning the friction coefficient.

    See `CustomNormalForce`.
    """

    name = "custom"
    formula = r"\mu = f(|v_t|)"
    reference = "the user"
    validity = "what its author says"

    def __init__(self, function: Callable[..., float], parameters: tuple[float, ...] = ()) -> None:
        """Check the function's signature and keep its parameters."""
        self.function = plain(function, ("speed", "p"))
        self.values = tuple(float(value) for value in parameters)
        check_parameters(self.values, self.function.__name__)

    def parameters(self) -> tuple[float, ...]:
        """Return the user's own numbers."""
        return self.values

    def describe(self) -> dict[str, Any]:
        """Import path of the function, and its parameters."""
        return describe_custom(self.name, self.function, self.values)

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to another process by name, as to a file."""
        return restored, (type(self), named(self.function), self.values)


def describe_custom(
    name: str, function: Callable[..., Any], values: tuple[float, ...]
) -> dict[str, Any]:
    """Description of a user's own law: its kind, import path and parameters."""
    return {"law": name, "function": path_of(function), "parameters": list(values)}


def named(function: Callable[..., Any]) -> str:
    """Return ``module:function``, by which another process finds the function.

    Raises:
        JointplayError: it would not find it: a lambda, a nested function, one typed at a prompt.
    """
    path = path_of(function)
    try:
        found = imported(path)
    except JointplayError:
        found = None
    if getattr(found, "py_func", found) is not function:
        raise JointplayError(
            f"law {path!r} cannot be sent to another process: define it with def, at module level "
            "of an importable file"
        )
    return path


def restored(kind: type, path: str, values: tuple[float, ...]) -> Any:
    """Build a user's own law again from the name of its function."""
    return kind(imported(path), values)


def check_parameters(values: tuple[float, ...], law: str) -> tuple[float, ...]:
    """Return `values` if a contact can hold them, else raise naming the `law`."""
    if len(values) > MAX_PARAMETERS:
        raise JointplayError(
            f"law {law!r} has {len(values)} parameters; at most {MAX_PARAMETERS} are possible"
        )
    for value in values:
        if not math.isfinite(value):
            raise JointplayError(f"law {law!r} has the non-finite parameter {value}")
    return values


def address(law: Law) -> int:
    """Machine address of the law's compiled function.

    Raises:
        JointplayError: numba cannot compile it; the message carries numba's reason.
    """
    return int(compiled_law(law).address)


def compiled_law(law: Law) -> Any:
    """Compiled function of the law: its `address`, and `ctypes` to call it from Python.

    Raises:
        JointplayError: numba cannot compile it; the message carries numba's reason.
    """
    if isinstance(law, NormalForceLaw):
        return _compiled(law.function, _NORMAL)
    if isinstance(law, FrictionLaw):
        return _compiled(law.function, _BRISTLE if law.bristles else _FRICTION)
    return _compiled(law.function, _FILM)


@cache
def _compiled(function: Callable[..., Any], signature: Any) -> Any:
    try:
        try:
            return numba.cfunc(signature, cache=True, error_model="numpy")(function)
        except RuntimeError:  # typed at a prompt: numba finds no file to keep its cache beside
            return numba.cfunc(signature, error_model="numpy")(function)
    except numba.core.errors.NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        reason = next((line for line in lines if not line.startswith("Failed in")), "no reason")
        name = getattr(function, "__name__", str(function))
        raise JointplayError(f"law {name!r} does not compile: {reason}") from error


@intrinsic
def pointer(typingctx: Any, at: Any) -> Any:
    """Reinterpret an integer address as a pointer to doubles (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.PointerType(_DOUBLE))

    return _PARAMETERS(types.int64), codegen


@intrinsic
def call_normal(typingctx: Any, at: Any, delta: Any, ddelta: Any, ddelta0: Any, p: Any) -> Any:
    """Call the normal-force law at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(_DOUBLE, [_DOUBLE, _DOUBLE, _DOUBLE, ir.PointerType(_DOUBLE)])
        function = builder.inttoptr(args[0], kind.as_pointer())
        return builder.call(function, args[1:])

    arguments = (types.int64, types.float64, types.float64, types.float64, _PARAMETERS)
    return types.float64(*arguments), codegen


@intrinsic
def call_friction(typingctx: Any, at: Any, speed: Any, p: Any) -> Any:
    """Call the friction law at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(_DOUBLE, [_DOUBLE, ir.PointerType(_DOUBLE)])
        function = builder.inttoptr(args[0], kind.as_pointer())
        return builder.call(function, args[1:])

    return types.float64(types.int64, types.float64, _PARAMETERS), codegen


@intrinsic
def call_bristle(
    typingctx: Any, at: Any, speed: Any, normal: Any, dwell: Any, p: Any, out: Any
) -> Any:
    """Call the friction law with bristles at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = ir.PointerType(_DOUBLE)
        kind = ir.FunctionType(ir.VoidType(), [_DOUBLE, _DOUBLE, _DOUBLE, array, array])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    arguments = (types.int64, *(types.float64,) * 3, _PARAMETERS, _PARAMETERS)
    return types.none(*arguments), codegen


@intrinsic
def call_film(
    typingctx: Any, at: Any, eccentricity: Any, rate: Any, whirl: Any, spin: Any, p: Any, out: Any
) -> Any:
    """Call the film law at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = ir.PointerType(_DOUBLE)
        kind = ir.FunctionType(ir.VoidType(), [_DOUBLE] * 4 + [array] * 2)
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    arguments = (types.int64, *(types.float64,) * 4, _PARAMETERS, _PARAMETERS)
    return types.none(*arguments), codegen


__all__ = [
    "ContactProperties",
    "CustomFriction",
    "CustomNormalForce",
    "FrictionLaw",
    "NormalForceLaw",
    "address",
    "call_bristle",
    "call_film",
    "call_friction",
    "call_normal",
    "compiled_law",
    "named",
    "pointer",
]
