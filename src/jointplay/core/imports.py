"""Imports at the moment of need: of upper layers by lower ones, and of libraries that are extras.

Nothing imports upward, yet `result.plot` draws and `simulation.run(certify=True)` certifies: such
conveniences name their home instead of importing it.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from jointplay.core.errors import JointplayError


def load_object(address: str) -> Any:
    """The object at "module:name" of this package, such as ``plots:Plots``."""
    module, _, name = address.partition(":")
    return getattr(importlib.import_module(f"jointplay.{module}"), name)


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
