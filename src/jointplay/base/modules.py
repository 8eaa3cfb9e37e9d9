"""The user's own modules, whose functions files may name; none is imported unless the user says so.

Importing a module runs it. So a function that a file names, ``module:function``, is looked up only
in modules that the user has had imported: by ``--import MODULE`` on the command line, or by
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
"""Imported modules by name."""

_came_with: dict[str, dict[str, Path]] = {}
"""For each module imported by its file: the files of all modules that came from its folder with it,
by their names."""


def import_module(module: str | Path) -> ModuleType:
    """Import a module of the user's, so that files may name functions in it.

    Args:
        module: its name, as Python finds it or in the current folder; or its file, which ends with
            ``.py`` and is read anew each time.

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
    """Import a module by name, which may lie in a folder."""
    importlib.invalidate_caches()
    sys.path.append(str(folder))
    # Cached bytecode is matched by size and time in seconds, which a rewritten file may share.
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(folder))
        sys.dont_write_bytecode = before


def file_of(module: ModuleType | None) -> Path | None:
    """File by which a module can be imported, if there is one."""
    file, name = (Path(getattr(module, "__file__", None) or ""), getattr(module, "__name__", ""))
    return file.resolve() if file.name == f"{name}.py" else None


def files_with(name: str) -> list[Path]:
    """Files of a module and of what it imported from its own folder, if it was imported by file."""
    file = file_of(sys.modules.get(name))
    return sorted(_came_with.get(name, {"": file} if file else {}).values())


def imported_modules() -> tuple[str, ...]:
    """Arguments of `import_module` that give another process the same modules."""
    return tuple(str(file_of(module) or name) for name, module in imported.items())


def how_to_import(module: str) -> str:
    """Advice, for messages, how to have a module imported."""
    return f"if you know it: --import {module}, or jointplay.import_module({module!r}) in Python"


def named(name: str) -> Callable[..., Any]:
    """Import the function ``module:function``, which runs its module.

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
