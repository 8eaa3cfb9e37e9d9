"""Loads of a function of the user's own: how files name it, and what travels with results.

As with contact laws (`contact.custom`): a function of an importable file is named
``module:function``; its text goes with the result, where it is shown and never run.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from jointplay.contact.trust import (
    Absent,
    function_or_absent,
    imported,
    know,
    named,
    path_of,
    source_of,
)
from jointplay.errors import JointplayError, require_finite
from jointplay.fields import quantity
from jointplay.loads.base import Load


@dataclass(frozen=True, kw_only=True)
class WrittenFunction:
    """What files say of a function of one's own."""

    function: str
    """``module:function`` of a module beside the scenario; of another with ``--trust MODULE``."""
    parameters: tuple[float, ...] = quantity("", default=())
    """Numbers for the function."""
    source: str | None = None
    """Text of the function, in results; it is shown, and never run."""


class OfFunction(Load):
    """What loads of a user's own function have in common; `written` has `WrittenFunction`."""

    written: ClassVar[type | None] = WrittenFunction

    function: Callable[..., Any]
    parameters: tuple[float, ...]

    def _keep(self, expected: tuple[str, ...], may_be_class: bool = False) -> None:
        """Check function and parameters, and remember the function.

        Raises:
            JointplayError: it takes other arguments than `expected`, or a number is not finite.
        """
        function = getattr(self.function, "py_func", self.function)  # numba's own wrapping
        if not isinstance(function, Absent):
            if not (may_be_class and inspect.isclass(function)):
                _check_arguments(function, expected)
            know(function)
        checked = tuple(
            require_finite("parameter", one, "", ("parameters",)) for one in self.parameters
        )
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "parameters", checked)

    def describe(self) -> dict[str, Any]:
        """Kind and fields; the function by its ``module:function``, and its text."""
        source = source_of(self.function)
        text = {} if source is None else {"source": source}
        return {**super().describe(), "function": path_of(self.function), **text}

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Self:
        """Build the load from what `describe` said of it.

        Raises:
            JointplayError: the function is neither known here nor of a trusted module (see
                `contact.trust`); within `trust.showing` the load is then one to be shown, not run.
        """
        rest = {name: value for name, value in fields.items() if name != "source"}
        rest["function"] = function_or_absent(fields["function"], fields.get("source"))
        return cls(**rest)

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to another process by the name of its function, as to a file."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}  # type: ignore[arg-type]
        function = fields.pop("function")
        place = function if isinstance(function, Absent) else named(function)
        return _restored, (type(self), place, fields)


def _check_arguments(function: Any, expected: tuple[str, ...]) -> None:
    if not callable(function):
        raise JointplayError(f"a law must be a function, got {function!r}", where=("function",))
    try:
        names = tuple(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        names = ()
    if len(names) != len(expected):
        raise JointplayError(
            f"function {getattr(function, '__name__', function)!r} takes ({', '.join(names)}); "
            f"it must take ({', '.join(expected)})",
            where=("function",),
        )


def _restored(kind: Any, place: str | Absent, fields: dict[str, Any]) -> Any:
    function: Any = place if isinstance(place, Absent) else imported(place)
    return kind(function=function, **fields)
