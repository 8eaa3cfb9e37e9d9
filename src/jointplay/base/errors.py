"""The exception for wrong input, whose message names the value and what to do, and input checks."""

from __future__ import annotations

import math
import re
from collections import abc
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise
from numbers import Integral
from typing import TYPE_CHECKING, Any

from jointplay.base.units import readable

if TYPE_CHECKING:
    import numpy as np

_LONGEST_WORD = 300
"""Most characters of a name or path in a message; the middle of a longer one is left out."""

_LONGEST_LIST = 200
"""Most characters of an array's numbers in a message; the middle of longer ones is left out."""

_LONGEST = 4000
"""Most characters of a message."""

_NUMBERS = re.compile(rf"\[[\s\[\],.\deE+\-infatrue]{{{_LONGEST_LIST},}}\]")
"""Numbers in brackets, the representation of arrays and lists."""

_WORD = re.compile(rf"\S{{{_LONGEST_WORD + 1},}}")

Where = tuple[str | int, ...]
"""Keys and indices that lead to a value, the outermost first."""


def one_line(text: object) -> str:
    """Turn a message into one printable line, whatever names, values and libraries put into it.

    White space becomes one space, control characters are escaped, and the middle of long words,
    arrays and messages is left out.
    """
    line = _shortened(" ".join(str(text).split()), 4 * _LONGEST)
    if not line.isprintable():
        line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)
    line = _NUMBERS.sub(lambda match: _shortened(match[0], _LONGEST_LIST), line)
    line = _WORD.sub(lambda match: _shortened(match[0], _LONGEST_WORD), line)
    return _shortened(line, _LONGEST)


def _shortened(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    return f"{text[: most * 2 // 3]}...{text[3 - most // 3 :]}"


class JointplayError(ValueError):
    """Wrong input. The message is one printable line that names the value and the valid choices.

    Attributes:
        where: the keys that lead to the value, as far as known, such as
            ``("joints", "joint_b", "radial_clearance")``; indices count from 0. Outer layers
            prepend their keys (`within`).
    """

    def __init__(self, message: str = "", where: Where = ()) -> None:
        super().__init__(one_line(message))
        self.where = where

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return type(self), (str(self), self.where)


class JointplayWarning(RuntimeWarning):
    """Reservation about a result or a machine, issued by `warnings`, never printed."""


def closest(word: Any, choices: Iterable[str], likeness: float = 0.6) -> str:
    """Ask "did you mean ...?" for the choice most like `word`; empty if none is alike enough."""
    import difflib  # seldom needed

    plain_words = {choice.lower().replace("-", "_"): choice for choice in choices}
    wanted = str(word).lower().replace("-", "_")
    near = difflib.get_close_matches(wanted, plain_words, 1, likeness)
    near = near or [word for word in plain_words if word.startswith(f"{wanted}_")]
    return f'did you mean "{plain_words[near[0]]}"? ' if near else ""


class MissingKey(JointplayError):
    """A key is missing in a table whose other keys are correct."""


class MissingName(JointplayError):
    """A name that does not exist; the message suggests the nearest and lists those that do."""

    def __init__(
        self, kind: str, name: str, choices: Iterable[str], hint: str = "", where: Where = ()
    ) -> None:
        self._parts = kind, name, tuple(choices), hint
        choices = self._parts[2]
        listed = ", ".join(choices) or "none"
        near = closest(name, choices)
        super().__init__(f"no {kind} {name!r}; {near}available: {listed}{hint}", where)

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return MissingName, (*self._parts, self.where)


class NothingHasPlay(JointplayError):
    """A computation about play was asked for, and no joint has any; `joints` could have some.

    Args:
        joints: their names.
        preset: name of the robot's own preset, if it has one.
        takes_play: whether the command has options for play; without, only --set gives some.
        where: as for all errors.
    """

    def __init__(
        self,
        joints: Iterable[str],
        preset: str = "",
        takes_play: bool = True,
        where: Where = (),
    ) -> None:
        self.joints = tuple(joints)
        public = f"--preset (what is publicly known of {preset}), " * bool(preset)
        options = (
            f'{public}--clearance "0.1 mm" (all joints that move the tool), '
            '--joint NAME="0.1 mm" or --gear NAME="2 arcmin", in Python clearance or gears'
            if takes_play
            else "--set 'joints.NAME.radial_clearance=\"0.1 mm\"'"
        )
        listed = ", ".join(self.joints) or "none"
        super().__init__(f"nothing has play: give {options}; joints: {listed}", where)
        self._given = preset, takes_play

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return NothingHasPlay, (self.joints, *self._given, self.where)


def require_known(
    kind: str, name: str, choices: Collection[str], hint: str = "", where: Where = ()
) -> None:
    """Raise `MissingName` unless `name` is one of the `choices`."""
    if name not in choices:
        raise MissingName(kind, name, choices, hint, where)


@contextmanager
def within(*place: str | int) -> Iterator[None]:
    """Prepend the keys `place` to the `where` of errors raised in the block."""
    try:
        yield
    except JointplayError as error:
        error.where = (*place, *error.where)
        raise


def require_a(name: str, value: Any, *kinds: str) -> None:
    """Raise unless the argument `name` is of one of the `kinds`, classes given by their names."""
    known = {kind.__name__ for kind in type(value).__mro__}
    known |= {kind for kind in ("Mapping", "Iterable") if isinstance(value, getattr(abc, kind))}
    # Text is iterable, but no list of anything.
    unwanted_text = known & {"str", "bytes"} and "str" not in kinds
    known |= {"Path"} if hasattr(type(value), "__fspath__") else set()
    if known.isdisjoint(kinds) or unwanted_text:
        wanted = " or ".join(
            _KINDS.get(kind, f"{'an' if kind[0] in 'AEIOU' else 'a'} {kind}") for kind in kinds
        )
        raise JointplayError(f"{name} must be {wanted}, not {value!r:.60}", where=(name,))


_KINDS = {"str": "text", "Mapping": "a mapping of names to them", "Iterable": "a list of them"}


LARGEST = 1e100
"""Largest magnitude of a quantity: products of three stay within the range of floats."""


def require_positive(name: str, value: float, unit: str, where: Where = ()) -> float:
    """Return `value` as float if it is finite and > 0, else raise with its name and unit."""
    value = require_finite(name, value, unit, where)
    if value <= 0.0:
        message = f"{name} must be greater than zero, got {readable(value, unit)}"
        raise JointplayError(message, where)
    if value < 1.0 / LARGEST:
        message = f"{name} must be at least {1.0 / LARGEST:g}, got {value:g} {unit}"
        raise JointplayError(message.rstrip(), where)
    return value


def require_non_negative(name: str, value: float, unit: str, where: Where = ()) -> float:
    """Return `value` as float if it is finite and >= 0, else raise with its name and unit."""
    value = require_finite(name, value, unit, where)
    if value < 0.0:
        message = f"{name} must not be negative, got {readable(value, unit)}"
        raise JointplayError(message, where)
    return value


def require_finite(name: str, value: float, unit: str, where: Where = ()) -> float:
    """Return `value` as float if it is a finite number, else raise with its name and unit.

    Booleans and text are refused, although Python would convert them.
    """
    kind = getattr(getattr(value, "dtype", None), "kind", "f")  # of numpy scalars and alike
    number = math.nan
    try:
        if isinstance(value, bool | str | bytes | bytearray) or kind not in "fiu":
            raise TypeError
        number = float(value)
    except (TypeError, ValueError):
        unit = f" ({unit})" if unit else ""
        raise JointplayError(f"{name} must be a number{unit}, got {value!r:.60}", where) from None
    except OverflowError:  # a whole number too large for a float
        number = math.inf
    if not math.isfinite(number):
        raise JointplayError(f"{name} must be finite, got {number} {unit}".rstrip(), where)
    if abs(number) > LARGEST:
        message = f"{name} must be no larger than {LARGEST:g}, got {number:g} {unit}"
        raise JointplayError(message.rstrip(), where)
    return number


def require_whole(
    name: str, value: object, least: int = 0, most: int | None = None, where: Where = ()
) -> int:
    """Return `value` as int if it is a whole number in a range, else raise with its name."""
    integral = isinstance(value, Integral) and not isinstance(value, bool)
    number = int(value) if integral else least - 1  # type: ignore[call-overload]
    if number < least or (most is not None and number > most):
        room = f">= {least}"
        if most is not None:  # 1e+12 rather than all its digits
            room = f"from {least} to {most if most < 10**7 else f'{most:.3g}'}"
        message = f"{name} must be a whole number {room}, got {value!r:.60}"
        raise JointplayError(message, where)
    return number


def require_share(name: str, value: float, where: Where = ()) -> float:
    """Return `value` as float if it lies between 0 and 1, neither included, else raise."""
    value = require_finite(name, value, "", where)
    if not 0.0 < value < 1.0:
        raise JointplayError(f"{name} must lie between 0 and 1, got {value:g}", where)
    return value


def require_numbers(name: str, values: Any, where: Where = ()) -> np.ndarray:
    """Return numbers as a new array of floats, else raise; they need not be finite.

    Booleans and text are refused here, too, even one among many numbers.
    """
    import numpy as np  # takes long to import

    try:
        stated = values if isinstance(values, np.ndarray) else np.asarray(values, object)
        if stated.dtype.kind not in "fiu":
            for item in stated.ravel():
                kind = getattr(getattr(item, "dtype", None), "kind", "f")
                if isinstance(item, bool | str | bytes) or kind not in "fiu":
                    raise JointplayError(f"{name} must be numbers, got {item!r:.60}", where)
        return np.array(values, float)
    except (TypeError, ValueError, OverflowError) as error:
        if isinstance(error, JointplayError):
            raise
        raise JointplayError(f"{name} must be numbers: {error}", where) from None


def require_names(name: str, values: object, noun: str, where: Where = ()) -> tuple[str, ...]:
    """Return a list of names as a tuple, else raise; a single text is refused."""
    if isinstance(values, Iterable) and not isinstance(values, str | bytes):
        names = tuple(values)
        if all(isinstance(n, str) for n in names):
            return tuple(map(str, names))
    raise JointplayError(f"{name} must be a list of {noun}, got {values!r:.60}", where)


def require_table(name: str, values: Any, form: str, where: Where = ()) -> dict[Any, Any]:
    """Return a mapping as a dictionary, an empty one for None, else raise with its `form`."""
    if not isinstance(values, Mapping | None):
        raise JointplayError(f"{name} must be a dictionary {form}, got {values!r:.60}", where)
    return dict(values or {})


def require_increasing(name: str, values: Sequence[float], unit: str, where: Where = ()) -> None:
    """Raise if numbers do not increase strictly, naming the first that does not."""
    for i, (before, after) in enumerate(pairwise(values), 1):
        if not after > before:
            text = f"{before:g} {unit} is followed by {after:g} {unit} (number {i + 1})"
            raise JointplayError(f"{name} must increase: {text}", (*where, i))


def require_vector(
    name: str, values: object, unit: str, where: Where = ()
) -> tuple[float, float, float]:
    """Return three finite components as floats, else raise with their name and unit."""
    text = isinstance(values, str | bytes)
    parts = () if text or not isinstance(values, Iterable) else tuple(values)
    if len(parts) != 3:
        raise JointplayError(f"{name} must have three components, got {values!r}", where)
    x, y, z = (require_finite(name, value, unit, where) for value in parts)
    return x, y, z


def damaged(path: object, kind: str, reason: object) -> JointplayError:
    """Error for a file that is not of its supposed kind, such as a result or a sweep."""
    text = getattr(reason, "strerror", None) or " ".join(str(reason).split())
    return JointplayError(
        f"{str(path)!r} is damaged or not a {kind}: {text or type(reason).__name__}"
    )
