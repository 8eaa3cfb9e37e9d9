"""What upper layers offer on objects of lower ones: loaded by name, when first asked for.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies: such
conveniences name their home instead of importing it.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def load_object(address: str) -> Any:
    """The object at "module:name" of this package, such as ``plots:Plots``."""
    module, _, name = address.partition(":")
    return getattr(importlib.import_module(f"jointplay.{module}"), name)


def offering(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """A package's `__getattr__` for names whose modules are loaded when they are first used.

    To check a scenario file needs words of many packages, but no compiler and no Pinocchio. No name
    may be that of a module of the package.

    Args:
        package: its full name.
        homes: module below it in which each name is.
    """

    def __getattr__(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            module = importlib.import_module(f"{package}.{homes[name]}")
        except AttributeError as error:  # would be taken for a name that is not there
            raise ImportError(f"{package}.{homes[name]} cannot be imported: {error}") from error
        value = getattr(module, name)
        setattr(sys.modules[package], name, value)
        return value

    return __getattr__
