"""Objects of upper layers that methods of lower ones use, by name; see `jointplay.conveniences`.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies.
"""

from importlib import import_module
from typing import Any

places: dict[str, tuple[str, str]] = {}
"""Module and attribute of each, filled in by the package itself, which is above all layers."""


def provided(name: str) -> Any:
    """Object of an upper layer under this name, imported when it is first needed."""
    module, attribute = places[name]
    return getattr(import_module(module), attribute)
