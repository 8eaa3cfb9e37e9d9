"""Functions of a user's own, of which laws and loads are made, and how files name them.

A result names such a function as ``module:function``. It is looked up among those of which this
process has made a law or load itself, and in modules that the user has had imported
(`base.modules`): no file has jointplay run what it likes.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields
from typing import Any, Self

from jointplay.base.errors import JointplayError, JointplayWarning
from jointplay.base.modules import how_to_import, imported, named
from jointplay.base.schema import Described, quantity

Function = Callable[..., Any]

_known: dict[str, dict[str | None, Function]] = {}
"""Functions of which this process has made a law, by ``module:function`` and by their text; the
last one made comes last."""

_showing: ContextVar[bool] = ContextVar("showing", default=False)


@dataclass(frozen=True)
class Absent:
    """A law's function that a result names and that is not at hand: to be shown, never run."""

    path: str
    """``module:function``."""
    source: str | None
    """Its text, if the result has it."""
    reason: str
    """Why it is not at hand, and what would help."""

    @property
    def __name__(self) -> str:
        return self.path.rpartition(":")[2]


def path_of(function: Function | Absent) -> str:
    """``module:function``, by which files name a law."""
    if isinstance(function, Absent):
        return function.path
    return f"{function.__module__}:{function.__qualname__}"


def source_of(function: Function | Absent) -> str | None:
    """Text of a law's function; None where Python does not know it."""
    if isinstance(function, Absent):
        return function.source
    try:
        return textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError):
        return None


@contextmanager
def showing() -> Iterator[None]:
    """Let laws whose functions are not at hand be made in the block, to be shown and not run."""
    token = _showing.set(True)
    try:
        yield
    finally:
        _showing.reset(token)


def function_at(path: str, source: str | None = None, how: str = "") -> Function:
    """The function that ``module:function`` names, if it is known or its module was imported.

    Of several known ones of that name the one with the text `source`, else the last that was made a
    law. One that was typed in a script or a notebook may lie in any module that was imported, under
    its name; `how` is how a law is made of it, for errors.

    Raises:
        JointplayError: it is neither.
    """
    module, _, name = path.partition(":") if isinstance(path, str) else ("", "", "")
    if not all(part.isidentifier() for part in (*module.split("."), *name.split("."))):
        raise JointplayError(f"a user's law must be named module:function, got {path!r}")
    known = _known.get(path, {})
    if source is not None and source in known:
        return known[source]
    places = imported if module == "__main__" else {module} & imported.keys()
    for place in places:
        if hasattr(imported[place], name):
            function: Function = getattr(imported[place], name)
            return function
    if known:
        return list(known.values())[-1]
    if module == "__main__":
        raise JointplayError(
            f"the law {_signature(name, source)!r} was typed in another script or notebook; to run "
            f"it again, define it here and make {how or 'a law of it'}, or put it into a file, "
            f"such as laws.py, and {how_to_import('laws')}"
        )
    if places:
        raise JointplayError(f"the law {path!r} does not exist: its module has no such function")
    raise JointplayError(
        f"the law {path!r} is code of a module that was not imported; {how_to_import(module)}"
    )


def _signature(name: str, source: str | None) -> str:
    """A function as it is called, as far as its text says."""
    with suppress(SyntaxError, ValueError, RecursionError):
        for node in ast.walk(ast.parse(source or "")):
            if isinstance(node, ast.FunctionDef) and node.name == name:
                return f"{name}({ast.unparse(node.args)})"
    return name


# Laws and loads that are made of such a function.


@dataclass(frozen=True, kw_only=True)
class FunctionDescription:
    """How files describe a law or load that is made of a user's function."""

    function: str
    """``module:function``, of a module that ``--import MODULE`` names."""
    parameters: tuple[float, ...] | dict[str, float] = quantity("", default=())
    """Parameters of the function, in the order of its arguments or by name."""
    source: str | None = None
    """Source text of the function, in results; it is shown and never run."""


class OfFunction(Described):
    """A law or load that is made of a user's function; a dataclass with the field `function`."""

    function: Any

    def _keep_function(self, function: Any) -> None:
        """Keep a function, without numba's wrapping; refuse one that takes other arguments."""
        function = getattr(function, "py_func", function)
        if not isinstance(function, Absent):
            if not callable(function):
                raise JointplayError(f"a law must be a function, got {function!r}", ("function",))
            self._check_arguments(function)
            path = path_of(function)
            if "<" not in path:  # lambdas and nested functions share their names
                known, source = _known.setdefault(path, {}), source_of(function)
                known.pop(source, None)
                known[source] = function
        object.__setattr__(self, "function", function)

    def _check_arguments(self, function: Function) -> None:
        """Raise if the function takes other arguments than it should."""
        raise NotImplementedError

    def _further_arguments(self) -> dict[str, Any]:
        """What the constructor takes besides the function, by name."""
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return {name: getattr(self, name) for name in names if name != "function"}

    @property
    def source(self) -> str | None:
        """Text of the function; None where Python does not know it."""
        return source_of(self.function)

    def describe(self) -> dict[str, Any]:
        text = {} if self.source is None else {"source": self.source}
        return {**super().describe(), "function": path_of(self.function), **text}

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Self:
        """Build the law or load from what `describe` returned.

        Raises:
            JointplayError: see `function_at`; within `showing`, the law is then made to be shown,
                not run.
        """
        arguments = dict(fields)
        path, source = arguments.pop("function"), arguments.pop("source", None)
        numbers = arguments.get("parameters", ())
        how = f"{cls.__name__}({str(path).rpartition(':')[2]}, {numbers!r})"
        function: Function | Absent
        try:
            function = function_at(path, source, how)
        except JointplayError as error:
            if not _showing.get():
                raise
            function = Absent(path, source, str(error))
        if source is not None and source_of(function) not in (None, source):
            warnings.warn(
                f"the function {path!r} here differs from the one in the result; a rerun uses the "
                "one that is here",
                JointplayWarning,
                stacklevel=2,
            )
        return cls(function=function, **arguments)  # type: ignore[call-arg]

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to another process by the function's name; refuse what it does not find, a lambda."""
        function = self.function
        if not isinstance(function, Absent):
            path, importable = path_of(function), None
            with suppress(JointplayError):
                importable = named(path)
            if getattr(importable, "py_func", importable) is not function:
                raise JointplayError(
                    f"law {path!r} cannot be sent to another process: define it with def, at "
                    "module level of an importable file"
                )
            function = path
        return _restored, (type(self), function, self._further_arguments())


def _restored(kind: type[Any], path: str | Absent, arguments: dict[str, Any]) -> Any:
    """Build a law or load again from the name of its function."""
    return kind(function=path if isinstance(path, Absent) else named(path), **arguments)
