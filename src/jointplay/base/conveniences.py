"""What lower layers get from upper ones, by name; it imports nothing.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies: the
package itself, which is above all layers, provides such `jointplay.conveniences`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_provided: dict[str, Callable[[], Any]] = {}


def provide(import_it: Callable[[], Any]) -> None:
    """Have lower layers find by the function's name what it imports when it is first needed."""
    _provided[import_it.__name__] = import_it


def provided(name: str) -> Any:
    """What an upper layer has under this name."""
    return _provided[name]()
