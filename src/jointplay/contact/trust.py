"""Which laws of a user's own may be looked up by name: no file has jointplay import what it likes.

A result names such a law as ``module:function``. To import a module is to run it. So a name is
looked up among the laws that this process has made itself; else its module must have been named by
the user: ``--trust MODULE`` on the command line, ``trust=`` in Python, or lying beside the
scenario that is run.
"""

from __future__ import annotations

import importlib
import inspect
import sys
import textwrap
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jointplay.errors import JointplayError

Function = Callable[..., Any]

_known: dict[str, Function] = {}
"""Functions of which this process has made a law, by ``module:function``."""

_showing: ContextVar[bool] = ContextVar("showing", default=False)

_trusted: ContextVar[frozenset[str]] = ContextVar("trusted", default=frozenset())


@dataclass(frozen=True)
class Absent:
    """A law's function that a result names and that is not at hand.

    Its text can be shown; it is never run.
    """

    path: str
    """``module:function``."""
    source: str | None
    """Its text, if the result has it."""
    reason: str
    """Why it is not at hand, and what would help."""

    @property
    def __name__(self) -> str:
        """Name of the function."""
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


def know(function: Function) -> Function:
    """Remember a function of which a law is made here; returns it."""
    path = path_of(function)
    if "<" not in path:  # lambdas and nested functions share their names
        _known[path] = function
    return function


@contextmanager
def trusting(modules: Collection[str]) -> Iterator[None]:
    """Let the block import laws from `modules` and from what lies in them."""
    token = _trusted.set(_trusted.get() | set(modules))
    try:
        yield
    finally:
        _trusted.reset(token)


@contextmanager
def showing() -> Iterator[None]:
    """Let laws whose functions are not at hand be made in the block, to be shown and not run."""
    token = _showing.set(True)
    try:
        yield
    finally:
        _showing.reset(token)


def function_or_absent(path: str, source: str | None) -> Function | Absent:
    """The function that ``module:function`` names; within `showing`, its text will do.

    Raises:
        JointplayError: see `function_at`.
    """
    try:
        return function_at(path)
    except JointplayError as error:
        if not _showing.get():
            raise
        return Absent(path, source, str(error))


def function_at(path: str) -> Function:
    """The function that ``module:function`` names, if it is known or its module trusted.

    Raises:
        JointplayError: it is neither, or cannot be imported here.
    """
    module, _, name = path.partition(":") if isinstance(path, str) else ("", "", "")
    parts = module.split(".")
    if not all(part.isidentifier() for part in (*parts, *name.split("."))):
        raise JointplayError(f"a law of one's own is named module:function, got {path!r}")
    if path in _known:
        return _known[path]
    if module == "__main__":
        raise JointplayError(
            f"the law {path!r} was typed in a script or a notebook that is not this one; to run it "
            "again, define it here and make a law of it"
        )
    ways = {".".join(parts[:size]) for size in range(1, len(parts) + 1)}
    if ways.isdisjoint(_trusted.get()):
        raise JointplayError(
            f"the law {path!r} is code that no one here has named; if it is yours, trust its "
            f"module: --trust {module}, or trust=[{module!r}] in Python"
        )
    return imported(path)


def named(function: Function) -> str:
    """Return ``module:function``, by which another process finds the function.

    Raises:
        JointplayError: it would not find it: a lambda, a nested function, one typed at a prompt.
    """
    path = path_of(function)
    try:
        there: Any = imported(path)
    except JointplayError:
        there = None
    if getattr(there, "py_func", there) is not function:
        raise JointplayError(
            f"law {path!r} cannot be sent to another process: define it with def, at module level "
            "of an importable file"
        )
    return path


def imported(path: str) -> Function:
    """The function that ``module:function`` names, whatever it may be.

    Raises:
        JointplayError: it cannot be imported here.
    """
    module, _, name = path.partition(":")
    here = str(Path.cwd())
    sys.path.append(here)  # commands do not search where they are called
    try:
        function: Function = getattr(importlib.import_module(module), name)
        return function
    except (ImportError, AttributeError, ValueError, SyntaxError) as error:
        raise JointplayError(f"the law {path!r} cannot be imported here: {error}") from error
    finally:
        sys.path.remove(here)
