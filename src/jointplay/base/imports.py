"""What lower layers get from upper ones, and libraries that are extras.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies: the
package itself, which is above all layers, provides such `conveniences`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from jointplay.base.errors import JointplayError

_provided: dict[str, Callable[[], Any]] = {}


def provide(import_it: Callable[[], Any]) -> None:
    """Have lower layers find by the function's name what it imports when it is first needed."""
    _provided[import_it.__name__] = import_it


def provided(name: str) -> Any:
    """What an upper layer has under this name."""
    return _provided[name]()


def how_to_install(name: str) -> str:
    """How one gets an extra, as a message says it: from a clone, as nothing is released yet."""
    return f"pip install '.[{name}]' in the clone of jointplay"


@contextmanager
def extra(name: str, package: str) -> Iterator[None]:
    """Say of a library that the block cannot import which extra brings it.

    Raises:
        JointplayError: it is missing.
    """
    try:
        yield
    except ImportError as error:
        raise JointplayError(
            f"this needs {package} ({error}); install it with {how_to_install(name)}"
        ) from None
