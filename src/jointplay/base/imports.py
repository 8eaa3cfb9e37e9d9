"""Optional libraries, imported when they are needed, and imports that can be spared."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace

from jointplay.base.errors import JointplayError


def how_to_install(name: str) -> str:
    """Advice, for messages, how to install an extra: from a clone, as nothing is released yet."""
    return f"pip install '.[{name}]' in the clone of jointplay"


@contextmanager
def extra(name: str, package: str) -> Iterator[None]:
    """Turn a failing import in the block into an error that names the extra to install.

    Raises:
        JointplayError: the library is missing.
    """
    try:
        yield
    except ImportError as error:
        how = f"install it with {how_to_install(name)}"
        raise JointplayError(f"this needs {package} ({error}); {how}") from None


def spare_other_arrays() -> None:
    """Keep xarray from importing array libraries only to check whether an array is one of theirs.

    Only for processes of this package: xarray then takes arrays of a library that is imported later
    for numpy's.
    """
    from xarray.namedarray import pycompat

    none = SimpleNamespace(module=None, version=pycompat.Version("0"), type=(), available=False)
    with suppress(AttributeError):  # another version of xarray, which will import them
        known: dict[str, object] = pycompat._cached_duck_array_modules  # type: ignore[assignment]
        for name in {"dask", "pint", "cupy", "sparse", "cubed"} - sys.modules.keys():
            known.setdefault(name, none)
