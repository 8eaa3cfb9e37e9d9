"""The one exception users meet: what is wrong, the offending value, and what to do."""

from __future__ import annotations

import math
from collections.abc import Iterable


class JointplayError(ValueError):
    """Wrong input. The message is one line that names the value and the valid choices."""


class MissingName(JointplayError):
    """A name that does not exist; the message lists those that do."""

    def __init__(self, kind: str, name: str, choices: Iterable[str], hint: str = "") -> None:
        """Say that `name` is no `kind`, list the `choices`, and append an optional `hint`."""
        self._parts = kind, name, tuple(choices), hint
        listed = ", ".join(self._parts[2]) or "none"
        super().__init__(f"no {kind} {name!r}; available: {listed}{hint}")

    def __reduce__(self) -> tuple[type, tuple[str, str, tuple[str, ...], str]]:
        """Travel whole between processes: an exception is otherwise rebuilt from its message."""
        return MissingName, self._parts


def require_positive(name: str, value: float, unit: str) -> float:
    """Return `value` as float if it is finite and > 0, else raise naming it with its `unit`."""
    value = require_finite(name, value, unit)
    if value <= 0.0:
        raise JointplayError(f"{name} must be greater than zero, got {value:g} {unit}".rstrip())
    return value


def require_non_negative(name: str, value: float, unit: str) -> float:
    """Return `value` as float if it is finite and >= 0, else raise naming it with its `unit`."""
    value = require_finite(name, value, unit)
    if value < 0.0:
        raise JointplayError(f"{name} must not be negative, got {value:g} {unit}".rstrip())
    return value


def require_finite(name: str, value: float, unit: str) -> float:
    """Return `value` as float if it is a finite number, else raise naming it with its `unit`."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise JointplayError(f"{name} must be a number ({unit}), got {value!r}") from None
    if not math.isfinite(number):
        raise JointplayError(f"{name} must be finite, got {number} {unit}".rstrip())
    return number
