"""What upper layers offer on objects of lower ones: loaded by name, when first asked for.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies: such
conveniences name their home instead of importing it.
"""

from __future__ import annotations

import importlib
from typing import Any


def load_object(address: str) -> Any:
    """The object at "module:name" of this package, such as ``plots:Plots``."""
    module, _, name = address.partition(":")
    return getattr(importlib.import_module(f"jointplay.{module}"), name)
