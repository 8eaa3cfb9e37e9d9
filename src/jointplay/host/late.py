"""What upper layers offer on objects of lower ones: loaded by name, when first asked for.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies: such
conveniences name their home instead of importing it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any


def late(address: str) -> Any:
    """The object at "module:name" of this package, such as ``plots:Plots``."""
    module, _, name = address.partition(":")
    return getattr(importlib.import_module(f"jointplay.{module}"), name)


def offering(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """A package's `__getattr__` for names whose modules are loaded when they are first used.

    Args:
        package: its full name.
        homes: module below it in which each name is.
    """

    def __getattr__(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(f"{package}.{homes[name]}"), name)

    return __getattr__
