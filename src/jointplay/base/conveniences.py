"""What lower layers get from upper ones, by name: `jointplay.conveniences` says where it is.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies.
"""

from importlib import import_module
from typing import Any

places: dict[str, tuple[str, str]] = {}
"""Module and name of each, filled in by the package itself, which is above all layers."""


def provided(name: str) -> Any:
    """What an upper layer has under this name, imported when it is first needed."""
    module, attribute = places[name]
    return getattr(import_module(module), attribute)
