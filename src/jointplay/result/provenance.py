"""With what a result was made."""

from __future__ import annotations

from functools import cache


def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries that enter a result."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """The same, looked up once: that takes milliseconds."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    software = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("jointplay", "pin", "numpy", "numba", "scipy"):
        try:
            software[name] = version(name)
        except PackageNotFoundError:  # run from a source tree that is not installed
            software[name] = "unknown"
    return software
