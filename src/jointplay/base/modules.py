"""Modules of the user's own: files name functions in them, and none is loaded that nobody named.

To import a module is to run it. So a function that a file names, ``module:function``, is looked for
only in modules that the user has had imported: ``--import MODULE`` on the command line,
`import_module` in Python.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from jointplay.base.errors import JointplayError, require_a

imported: dict[str, ModuleType] = {}
"""By name."""

_came_with: dict[str, dict[str, Path]] = {}
"""Files of a module that was imported by its file and of what it took from its folder, by name."""


def import_module(module: str | Path) -> ModuleType:
    """Import a module of the user's own; files may then name functions in it.

    Args:
        module: its name, as Python finds it or in the current folder, or its file, which ends with
            ``.py`` and is read again each time.

    Raises:
        JointplayError: it cannot be imported, or another module has its name.
    """
    require_a("module", module, "str", "Path")
    file = Path(module).resolve() if str(module).endswith(".py") else None
    name, folder = (str(module), Path.cwd()) if file is None else (file.stem, file.parent)
    if file is not None:
        for stale in _came_with.pop(name, ()):
            sys.modules.pop(stale, None)
    before = set(sys.modules)
    try:
        loaded = _from(folder, name)
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise JointplayError(f"module {str(module)!r} cannot be imported: {reason}") from error
    if file is not None and file_of(loaded) != file:
        raise JointplayError(f"another module is called {name!r}: {loaded}; rename {str(file)!r}")
    if file is not None:
        paths = {n: Path(getattr(sys.modules[n], "__file__", None) or "/") for n in sys.modules}
        new = {n: path for n, path in paths.items() if n not in before}
        _came_with[name] = {n: at for n, at in new.items() if at.is_relative_to(folder)}
    imported[name] = loaded
    return loaded


def _from(folder: Path, name: str) -> ModuleType:
    """The module of this name, which may lie in a folder."""
    importlib.invalidate_caches()
    sys.path.append(str(folder))
    # Bytecode counts for a file of the same size and second: one written anew may have both.
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(folder))
        sys.dont_write_bytecode = before


def file_of(module: ModuleType | None) -> Path | None:
    """The file of a module that can be imported by it."""
    file, name = (Path(getattr(module, "__file__", None) or ""), getattr(module, "__name__", ""))
    return file.resolve() if file.name == f"{name}.py" else None


def files_with(name: str) -> list[Path]:
    """The file of a module, and those of what it took from its folder if it was imported by it."""
    file = file_of(sys.modules.get(name))
    return sorted(_came_with.get(name, {"": file} if file else {}).values())


def imported_modules() -> tuple[str, ...]:
    """What `import_module` takes in another process to have the same."""
    return tuple(str(file_of(module) or name) for name, module in imported.items())


def how_to_import(module: str) -> str:
    """What to do for a module, as a message says it."""
    return f"if you know it: --import {module}, or jointplay.import_module({module!r}) in Python"


def named(name: str) -> Callable[..., Any]:
    """The function ``module:function``, whatever it may be: this runs its module.

    Raises:
        JointplayError: it cannot be imported here.
    """
    module, _, function = name.partition(":")
    try:
        law: Callable[..., Any] = getattr(
            imported.get(module) or _from(Path.cwd(), module), function
        )
    except (ImportError, AttributeError, ValueError, SyntaxError) as error:
        raise JointplayError(f"the law {name!r} cannot be imported here: {error}") from error
    return law
