"""Libraries that are extras, imported at the moment of need, and those that are not needed."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace

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


def spare_other_arrays() -> None:
    """Have xarray import no library of arrays only to ask whether an array is one of its own.

    That is for processes of our own: xarray takes arrays of a library that is imported later for
    numpy's.
    """
    from xarray.namedarray import pycompat

    none = SimpleNamespace(module=None, version=pycompat.Version("0"), type=(), available=False)
    with suppress(AttributeError):  # another xarray, which imports them
        known: dict[str, object] = pycompat._cached_duck_array_modules  # type: ignore[assignment]
        for name in {"dask", "pint", "cupy", "sparse", "cubed"} - sys.modules.keys():
            known.setdefault(name, none)
