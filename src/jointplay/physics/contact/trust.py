"""Which laws of a user's own may be looked up by name: no file has jointplay import what it likes.

A result names such a law as ``module:function``. To import a module is to run it. So a name is
looked up among the laws that this process has made itself; else its module must have been named by
the user: ``--trust MODULE`` on the command line, ``trust=`` in Python, or lying beside the
scenario that is run.

Modules beside a scenario are known by their file and what it says, not by their name: of two
scenarios in different folders each has its own ``my_laws``. They are not in `sys.modules`.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import inspect
import linecache
import sys
import textwrap
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields
from pathlib import Path
from types import ModuleType
from typing import Any, Self
from weakref import WeakKeyDictionary

from jointplay.base.errors import JointplayError
from jointplay.base.files import is_file
from jointplay.base.schema import Described, quantity

Function = Callable[..., Any]

_known: dict[str, dict[str | None, Function]] = {}
"""Functions of which this process has made a law, by ``module:function`` and by their text; the
last one made comes last."""

_loaded: dict[tuple[Path, str], tuple[dict[Path, bytes], dict[str, ModuleType]]] = {}
"""By folder and module: digests of the files that were read, and the modules that they made."""

_beside: WeakKeyDictionary[Any, tuple[Path, str | None, dict[Path, bytes]]] = WeakKeyDictionary()
"""Of functions that lie beside a scenario folder, text, and digests of the files that were read."""

_folder: ContextVar[Path | None] = ContextVar("folder", default=None)

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
    if function in _beside:
        return _beside[function][1]
    try:
        return textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError):
        return None


def remember(function: Function) -> Function:
    """Remember a function of which a law is made here; returns it."""
    path = path_of(function)
    if "<" not in path:  # lambdas and nested functions share their names
        known = _known.setdefault(path, {})
        source = source_of(function)
        known.pop(source, None)
        known[source] = function
    return function


def trusting(modules: Collection[str]) -> AbstractContextManager[None]:
    """Let the block import laws from `modules` and from what lies in them."""
    return _during(_trusted, _trusted.get() | set(modules))


def looking_in(folder: Path) -> AbstractContextManager[None]:
    """Let the block take laws from modules in `folder` first, where a scenario lies."""
    return _during(_folder, folder.resolve())


def showing() -> AbstractContextManager[None]:
    """Let laws whose functions are not at hand be made in the block, to be shown and not run."""
    return _during(_showing, True)


@contextmanager
def _during(variable: ContextVar[Any], value: Any) -> Iterator[None]:
    """Have a context variable at a value in the block."""
    token = variable.set(value)
    try:
        yield
    finally:
        variable.reset(token)


def function_or_absent(path: str, source: str | None, made: str = "") -> Function | Absent:
    """The function that ``module:function`` names; within `showing`, its text will do.

    Raises:
        JointplayError: see `function_at`.
    """
    try:
        return function_at(path, source, made)
    except JointplayError as error:
        if not _showing.get():
            raise
        return Absent(path, source, str(error))


def function_at(path: str, source: str | None = None, made: str = "") -> Function:
    """The function that ``module:function`` names, if it is known or its module trusted.

    Of several known ones of that name, in modules of different folders, the one with the text
    `source`, else the last that was made a law. One that was typed in a script or a notebook may
    lie in any trusted module under its name; `made` is how a law is made of it, for errors.

    Raises:
        JointplayError: it is neither, or cannot be imported here.
    """
    module, _, name = path.partition(":") if isinstance(path, str) else ("", "", "")
    parts = module.split(".")
    if not all(part.isidentifier() for part in (*parts, *name.split("."))):
        raise JointplayError(f"a user's law must be named module:function, got {path!r}")
    folder = _folder.get()
    if folder is not None and is_beside(folder, module):
        return function_in_folder(folder, path)
    known = _known.get(path)
    if known:
        return known[source] if source in known else list(known.values())[-1]
    if module == "__main__":
        return _typed(name, source, made)
    ways = {".".join(parts[:size]) for size in range(1, len(parts) + 1)}
    if ways.isdisjoint(_trusted.get()):
        raise JointplayError(
            f"the law {path!r} is code of a module that is not trusted; if you know it, trust it: "
            f"--trust {module}, or trust=[{module!r}] in Python"
        )
    return imported(path)


def _typed(name: str, source: str | None, made: str) -> Function:
    """A function that was typed in another script or notebook, from a trusted module.

    Raises:
        JointplayError: no trusted module has it; the message says what to define.
    """
    reasons = []
    for module in sorted(_trusted.get() - {"__main__"}):
        try:
            return imported(f"{module}:{name}")
        except JointplayError as error:
            reasons.append(f"; {error}")
    raise JointplayError(
        f"the law {_signature(name, source)!r} was typed in another script or notebook; to run it "
        f"again, define it here and make {made or 'a law of it'}, or put it into a file, such as "
        f"laws.py, and trust that: --trust laws, or trust=['laws'] in Python{''.join(reasons)}"
    )


def _signature(name: str, source: str | None) -> str:
    """A function as it is called, as far as its text says."""
    with suppress(SyntaxError, ValueError, RecursionError):
        for node in ast.walk(ast.parse(source or "")):
            if isinstance(node, ast.FunctionDef) and node.name == name:
                return f"{name}({ast.unparse(node.args)})"
    return name


def is_beside(folder: Path, module: str) -> bool:
    """Whether a module, or the package that it is of, lies in a folder."""
    top = module.partition(".")[0]
    places = (folder / f"{top}.py", folder / top / "__init__.py")
    return top.isidentifier() and any(is_file(place) for place in places)


def function_in_folder(folder: Path, path: str) -> Function:
    """The function that ``module:function`` names in a folder, as its files are now.

    Raises:
        JointplayError: it cannot be imported.
    """
    folder = folder.resolve()
    module, _, name = path.partition(":")
    made = _loaded.get((folder, module))
    if made is None or any(_digest(file) != digest for file, digest in made[0].items()):
        made = _loaded[folder, module] = _load(folder, module, path)
    try:
        function: Function = getattr(made[1][module], name)
    except AttributeError as error:
        raise JointplayError(f"the law {path!r} cannot be imported here: {error}") from None
    if function not in _beside:
        with _installed(made[1]):
            _beside[function] = folder, source_of(function), made[0]
    return function


def files_of(function: Any) -> dict[str, str]:
    """Files that a function beside a scenario was read from, and digests of what they said."""
    if not callable(function) or function not in _beside:
        return {}
    return {str(file): digest.hex() for file, digest in _beside[function][2].items()}


def _digest(file: Path) -> bytes | None:
    """Of what a file says; None if there is none any more."""
    try:
        return hashlib.sha256(file.read_bytes()).digest()
    except OSError:
        return None


def _load(folder: Path, module: str, path: str) -> tuple[dict[Path, bytes], dict[str, ModuleType]]:
    """Import a module and what it takes from its folder, for nobody else to find."""
    here, own = str(folder), folder.iterdir()
    mine = {file.stem for file in own if file.suffix == ".py" or (file / "__init__.py").is_file()}
    mine -= {"jointplay", *sys.stdlib_module_names}
    aside = {
        name: one
        for name, one in sys.modules.items()
        if name.partition(".")[0] in mine and not _installed_for_all(one)
    }
    for name in aside:
        del sys.modules[name]
    linecache.checkcache()
    importlib.invalidate_caches()
    sys.path.insert(0, here)
    before, writes = set(sys.modules), sys.dont_write_bytecode
    sys.dont_write_bytecode = True  # a file changed within a second would pass for old
    try:
        importlib.import_module(module)
    except Exception as error:  # a module of the user's own can raise anything
        words = " ".join(str(error).split()) or type(error).__name__
        raise JointplayError(f"the law {path!r} cannot be imported here: {words}") from error
    finally:
        sys.dont_write_bytecode = writes
        sys.path.remove(here)
        made = {
            name: sys.modules.pop(name)
            for name in set(sys.modules) - before
            if Path(getattr(sys.modules[name], "__file__", None) or "/").is_relative_to(folder)
        }
        sys.modules.update(aside)
    files = (Path(str(one.__file__)) for one in made.values())
    return {file: _digest(file) or b"" for file in files}, made


def _installed_for_all(module: ModuleType) -> bool:
    """Whether a module belongs to Python or to its installed packages."""
    file = getattr(module, "__file__", None)
    return file is None or Path(file).is_relative_to(Path(inspect.__file__).parent)


@contextmanager
def _installed(modules: Mapping[str, ModuleType]) -> Iterator[None]:
    """Have modules where Python looks for them, for the time of the block."""
    before = {name: sys.modules.get(name) for name in modules}
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name, one in before.items():
            sys.modules.pop(name)
            if one is not None:
                sys.modules[name] = one


Place = Absent | tuple[str | None, str]
"""Folder of a function beside a scenario, None for another one, and ``module:function``."""


def function_of(place: Place) -> Function | Absent:
    """The function that `place_of` described in another process.

    Raises:
        JointplayError: it cannot be imported here.
    """
    if isinstance(place, Absent):
        return place
    folder, path = place
    return imported(path) if folder is None else function_in_folder(Path(folder), path)


def place_of(function: Function | Absent) -> Place:
    """By what another process finds the function; one that is not at hand goes as it is.

    Raises:
        JointplayError: it would not find it: a lambda, a nested function, one typed at a prompt.
    """
    if isinstance(function, Absent):
        return function
    path = path_of(function)
    if function in _beside:
        return str(_beside[function][0]), path
    try:
        there: Any = imported(path)
    except JointplayError:
        there = None
    if getattr(there, "py_func", there) is not function:
        raise JointplayError(
            f"law {path!r} cannot be sent to another process: define it with def, at module level "
            "of an importable file"
        )
    return None, path


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


# Laws and loads that are made of such a function.


@dataclass(frozen=True, kw_only=True)
class FunctionDescription:
    """How files describe a law or load that is made of a user's function."""

    function: str
    """``module:function`` of a module in the scenario's folder, or of another one with ``--trust
    MODULE``."""
    parameters: tuple[float, ...] | dict[str, float] = quantity("", default=())
    """Parameters of the function, in the order of its arguments or by name."""
    source: str | None = None
    """Source text of the function, in results; it is shown and never run."""


class OfFunction(Described):
    """A law or load that is made of a user's function; a dataclass with the field `function`."""

    function: Any

    def _keep_function(self, function: Any) -> None:
        """Keep a function, without numba's wrapping, if its arguments are right.

        Raises:
            JointplayError: it is no function, or takes other arguments than it should.
        """
        function = getattr(function, "py_func", function)
        if not isinstance(function, Absent):
            if not callable(function):
                raise JointplayError(f"a law must be a function, got {function!r}", ("function",))
            self._check_arguments(function)
            remember(function)
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
            JointplayError: the function is neither known here nor in a trusted module (see
                `function_at`); within `showing`, the law is then made to be shown, not run.
        """
        arguments = dict(fields)
        path, source = arguments.pop("function"), arguments.pop("source", None)
        numbers = arguments.get("parameters", ())
        made = f"{cls.__name__}({str(path).rpartition(':')[2]}, {numbers!r})"
        function = function_or_absent(path, source, made)
        if source is not None and source_of(function) not in (None, source):
            warnings.warn(
                f"the function {path!r} here differs from the one in the result; a rerun uses the "
                "one that is here",
                RuntimeWarning,
                stacklevel=2,
            )
        return cls(function=function, **arguments)  # type: ignore[call-arg]

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), place_of(self.function), self._further_arguments())


def _restored(kind: type[Any], place: Place, arguments: dict[str, Any]) -> Any:
    """Build a law or load again from the name of its function."""
    return kind(function=function_of(place), **arguments)
