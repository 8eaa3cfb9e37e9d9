"""User-defined functions behind laws and loads, and how files name them.

A result names such a function as ``module:function``. It is looked up among the functions of which
this process itself has made a law or load, and in modules that the user has had imported
(`base.modules`): no file can make jointplay run arbitrary code.
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
"""Functions of which this process has made a law, by ``module:function`` and then by source text;
the last one made comes last."""

_showing: ContextVar[bool] = ContextVar("showing", default=False)


@dataclass(frozen=True)
class Absent:
    """Placeholder for a law's function that is not available: it can be shown, never run."""

    path: str
    """``module:function``."""
    source: str | None
    """Source text of the function, if the result has it."""
    reason: str
    """Why it is not available, and what would help."""

    @property
    def __name__(self) -> str:
        return self.path.rpartition(":")[2]


def path_of(function: Function | Absent) -> str:
    """Name ``module:function`` by which files refer to a law's function."""
    if isinstance(function, Absent):
        return function.path
    return f"{function.__module__}:{function.__qualname__}"


def source_of(function: Function | Absent) -> str | None:
    """Source text of a law's function; None where Python does not know it."""
    if isinstance(function, Absent):
        return function.source
    try:
        return textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError):
        return None


@contextmanager
def showing() -> Iterator[None]:
    """Within the block, laws whose functions are not available can be made, to be shown only."""
    token = _showing.set(True)
    try:
        yield
    finally:
        _showing.reset(token)


def function_at(path: str, source: str | None = None, how: str = "") -> Function:
    """Look up the function that ``module:function`` names.

    Of several functions of that name of which laws were made, the one with the text `source`, else
    the last, is returned; failing these, the one in an imported module. A function typed in a
    script or notebook may be found by its name in any module that was imported.

    `how`: the expression that makes a law of it, for the error.

    Raises:
        JointplayError: no law was made of it, and its module was not imported or has no such
            function.
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
    """Signature of a function as far as its source text tells; else its name."""
    with suppress(SyntaxError, ValueError, RecursionError):
        for node in ast.walk(ast.parse(source or "")):
            if isinstance(node, ast.FunctionDef) and node.name == name:
                return f"{name}({ast.unparse(node.args)})"
    return name


# Laws and loads made of such a function.


@dataclass(frozen=True, kw_only=True)
class FunctionDescription:
    """Description, in files, of a law or load made of a user's function."""

    function: str
    """``module:function``, of a module that ``--import MODULE`` names."""
    parameters: tuple[float, ...] | dict[str, float] = quantity("", default=())
    """Parameters of the function, in the order of its arguments or by name."""
    source: str | None = None
    """Source text of the function, in results; it is shown and never run."""


class OfFunction(Described):
    """Base of laws and loads made of a user's function; a dataclass with the field `function`."""

    function: Any

    def _keep_function(self, function: Any) -> None:
        """Check a function, unwrap numba's decorator, and register it for `function_at`."""
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
        """Raise if the function does not take the arguments of its kind."""
        raise NotImplementedError

    def _further_arguments(self) -> dict[str, Any]:
        """Arguments of the constructor besides the function, by name."""
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return {name: getattr(self, name) for name in names if name != "function"}

    @property
    def source(self) -> str | None:
        """Source text of the function; None where Python does not know it."""
        return source_of(self.function)

    def describe(self) -> dict[str, Any]:
        text = {} if self.source is None else {"source": self.source}
        return {**super().describe(), "function": path_of(self.function), **text}

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Self:
        """Build the law or load from its description (`describe`).

        Raises:
            JointplayError: see `function_at`; within `showing`, a law to be shown is made instead.
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
        """Pickle by the function's name; refuse one that is not found by it, such as a lambda."""
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
    """Unpickle a law or load from the name of its function."""
    return kind(function=path if isinstance(path, Absent) else named(path), **arguments)
