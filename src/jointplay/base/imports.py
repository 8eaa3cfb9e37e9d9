"""Libraries that are extras, imported at the moment of need."""

from collections.abc import Iterator
from contextlib import contextmanager

from jointplay.base.errors import JointplayError


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
        how = f"install it with {how_to_install(name)}"
        raise JointplayError(f"this needs {package} ({error}); {how}") from None
