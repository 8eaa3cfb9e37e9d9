"""Compilation of laws: each is compiled once, and called by address from the time loop.

The time loop gives every law the same arguments: its state, and a pointer to the parameters of this
contact. A law that names its parameters gets them by a wrapper made here, into which it is inlined:
it costs no more than one that reads ``p[0]``, ``p[1]`` itself. `calls` has the calls by address.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from jointplay.base.compiler import Compiled, Native
from jointplay.base.errors import JointplayError
from jointplay.physics.contact.functions import Absent

if TYPE_CHECKING:
    from jointplay.physics.contact.law import Law

MAX_PARAMETERS = 8
"""Most parameters of a law: the room that the time loop keeps for each contact."""
ARRAY = "p"
"""Name of the argument that takes all parameters at once, as an array."""


def parameter_names(function: Callable[..., Any], state: tuple[str, ...]) -> tuple[str, ...] | None:
    """Names of a law's parameters: its arguments after the `state`; None if it takes an array."""
    names = tuple(inspect.signature(function).parameters)[len(state) :]
    return None if names[:1] == (ARRAY,) else names


def check_signature(function: Callable[..., Any], state: tuple[str, ...], writes: bool) -> None:
    """Raise unless a function has the arguments of a law: those of `state`, then its parameters.

    With `writes`, a function that takes an array also takes ``out`` and writes its results there.

    Raises:
        JointplayError: it takes other arguments; the message names both.
    """
    try:
        names = tuple(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        names = ()
    expected = (*state, ARRAY, *(("out",) if writes else ()))
    parameters = names[len(state) :]
    takes_array = len(names) == len(expected) and parameters[:1] == (ARRAY,)
    takes_names = names[: len(state)] == state and ARRAY not in parameters
    if not (takes_array or takes_names):
        raise JointplayError(
            f"law {getattr(function, '__name__', function)!r} takes ({', '.join(names)}); "
            f"it must take ({', '.join(expected)}), or ({', '.join(state)}) and then its "
            "parameters by name"
        )


def check_parameters(values: tuple[float, ...], law: str) -> tuple[float, ...]:
    """Return `values` if a contact can hold them, else raise naming the `law`."""
    if len(values) > MAX_PARAMETERS:
        raise JointplayError(
            f"law {law!r} has {len(values)} parameters; at most {MAX_PARAMETERS} are allowed"
        )
    for value in values:
        if not math.isfinite(value):
            raise JointplayError(f"law {law!r} has the non-finite parameter {value}")
    return values


def address(law: Law) -> int:
    """Machine address of the law's compiled function.

    Raises:
        JointplayError: numba cannot compile it (the message carries numba's reason), or its
            function is not available.
    """
    return compiled_law(law).address


def compiled_law(law: Law) -> Native:
    """Compile the law's function: its `address`, and `ctypes` to call it from Python.

    Raises as `address` does.
    """
    if isinstance(law.function, Absent):
        raise JointplayError(law.function.reason)
    return _compiled(law.function, law.state, law.answers)


@cache
def _compiled(function: Callable[..., Any], state: tuple[str, ...], answers: int) -> Native:
    return compiled_function(_packed(function, state, answers), law_signature(state, answers))


def law_signature(state: tuple[str, ...], answers: int) -> str:
    """Signature of a compiled law in the letters of `base.compiler`.

    A law with several results, `answers` of them, writes them to its last argument.
    """
    letters = ",".join("d" * len(state))
    return f"v({letters},p,p)" if answers else f"d({letters},p)"


@cache
def compiled_touch(function: Callable[..., Any]) -> int:
    """Machine address of a joint kind's own contact geometry.

    Args:
        function: a function of (k, pose), index of the contact and pose of the journal
            (`geometry.contacts`), and then of the joint's dimensions by name. It returns the seven
            numbers of `geometry.touch`.

    Raises:
        JointplayError: numba cannot compile it; the message carries numba's reason.
    """
    from jointplay.physics.geometry.contacts import ANSWER

    packed = _packed(function, ("k", "pose"), ANSWER)
    return compiled_function(packed, "v(i,p,p,p)").address


@cache
def compiled_function(function: Callable[..., Any], signature: str) -> Native:
    """Compiled `function`: its `address`, and `ctypes` to call it from Python.

    Raises:
        JointplayError: numba cannot compile it; the message carries numba's reason.
    """
    try:
        return Compiled(function).native(signature)
    except Exception as error:  # numba raises whatever its own parts do
        name = getattr(function, "__name__", str(function))
        raise JointplayError(f"law {name!r} does not compile: {_reason(error)}") from error


_ESCAPES = re.compile(r"\x1b\[[0-9;]*m")
_FRAME = ("Failed in", "During", "File ")
"""Beginnings of the lines in which numba describes its own progress rather than the reason."""
_LINE = re.compile(r'(?:File ".*", line |Raised from .* \()(\d+)')


def _reason(error: Exception) -> str:
    """Reason why numba cannot compile a law, and its line, picked from numba's message."""
    text = _ESCAPES.sub("", str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    reason = next((line for line in lines if not line.startswith(_FRAME)), "no reason given")
    places = _LINE.findall(text)
    where = f" (line {places[-1]} of its file)" if places else ""
    return f"{reason.partition(' Raised from')[0].rstrip('. :')}{where}"


def _packed(function: Callable[..., Any], state: tuple[str, ...], answers: int) -> Any:
    """Wrap a law with named parameters in a function that takes them as an array.

    The wrapper claims the law's place in its file, so that its compiled code is kept, and compiled
    again when that file has changed.
    """
    names = parameter_names(function, state)
    if names is None:
        return function
    values = [f"{ARRAY}[{i}]" for i in range(len(names))]
    call = f"law({', '.join([*state, *values])})"
    lines = [f"    return {call}"]
    if answers:
        lines = [f"    answer = {call}", *(f"    out[{i}] = answer[{i}]" for i in range(answers))]
    head = f"def packed({', '.join([*state, ARRAY, *(['out'] if answers else [])])}):"
    space = {"law": Compiled(function), "__name__": function.__module__}
    exec(compile("\n".join([head, *lines]), function.__code__.co_filename, "exec"), space)
    packed: Any = space["packed"]
    packed.__qualname__ = f"{function.__qualname__}.packed"
    packed.__name__ = function.__name__
    line = function.__code__.co_firstlineno
    packed.__code__ = packed.__code__.replace(co_firstlineno=line)
    return packed
