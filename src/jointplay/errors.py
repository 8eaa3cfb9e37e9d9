"""The one exception users meet: what is wrong, the offending value, and what to do."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

Where = tuple[str | int, ...]
"""Keys and indices that lead to a value, the outermost first."""


class JointplayError(ValueError):
    """Wrong input. The message is one line that names the value and the valid choices.

    Attributes:
        where: the keys that lead to the value, as far as known; outer layers prepend theirs
            (`within`). ``("joints", "joint_b", "radial_clearance")``; indices count from 0.
    """

    def __init__(self, message: str = "", where: Where = ()) -> None:
        """Say what is wrong, and at which key."""
        super().__init__(message)
        self.where = where

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Travel whole between processes."""
        return type(self), (str(self), self.where)


class MissingName(JointplayError):
    """A name that does not exist; the message lists those that do."""

    def __init__(
        self, kind: str, name: str, choices: Iterable[str], hint: str = "", where: Where = ()
    ) -> None:
        """Say that `name` is no `kind`, list the `choices`, and append an optional `hint`."""
        self._parts = kind, name, tuple(choices), hint
        listed = ", ".join(self._parts[2]) or "none"
        super().__init__(f"no {kind} {name!r}; available: {listed}{hint}", where)

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Travel whole between processes: an exception is otherwise rebuilt from its message."""
        return MissingName, (*self._parts, self.where)


@contextmanager
def within(*place: str | int) -> Iterator[None]:
    """Say of errors in the block that what they are about lies at the key `place`."""
    try:
        yield
    except JointplayError as error:
        error.where = (*place, *error.where)
        raise


def require_positive(name: str, value: float, unit: str, where: Where = ()) -> float:
    """Return `value` as float if it is finite and > 0, else raise naming it with its `unit`."""
    value = require_finite(name, value, unit, where)
    if value <= 0.0:
        message = f"{name} must be greater than zero, got {value:g} {unit}".rstrip()
        raise JointplayError(message, where)
    return value


def require_non_negative(name: str, value: float, unit: str, where: Where = ()) -> float:
    """Return `value` as float if it is finite and >= 0, else raise naming it with its `unit`."""
    value = require_finite(name, value, unit, where)
    if value < 0.0:
        message = f"{name} must not be negative, got {value:g} {unit}".rstrip()
        raise JointplayError(message, where)
    return value


def require_finite(name: str, value: float, unit: str, where: Where = ()) -> float:
    """Return `value` as float if it is a finite number, else raise naming it with its `unit`."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise JointplayError(f"{name} must be a number ({unit}), got {value!r}", where) from None
    if not math.isfinite(number):
        raise JointplayError(f"{name} must be finite, got {number} {unit}".rstrip(), where)
    return number


def require_vector(
    name: str, values: object, unit: str, where: Where = ()
) -> tuple[float, float, float]:
    """Return three finite components as floats, else raise naming them with their `unit`."""
    parts = () if isinstance(values, str) or not isinstance(values, Iterable) else tuple(values)
    if len(parts) != 3:
        raise JointplayError(f"{name} must have three components, got {values!r}", where)
    x, y, z = (require_finite(name, value, unit, where) for value in parts)
    return x, y, z
