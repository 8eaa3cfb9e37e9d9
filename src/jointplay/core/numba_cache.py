"""Where numba keeps what it has compiled: somewhere, even if nothing here can be written to.

numba refuses to compile for a cache that has no place, and to start with one that is damaged. Here
the first is kept in a folder of this process alone, and the second is thrown away and made anew.
Compiled modules take `njit` from here, so that this is seen to before they compile.
"""

from __future__ import annotations

import atexit
import hashlib
import warnings
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba import njit
from numba.core import caching

from jointplay.core.files import temporary

__all__ = ["NO_PLACE", "ensure", "fingerprint", "njit", "stamp"]

NO_PLACE = (
    "compiled code cannot be kept, so every start compiles anew (half a minute): neither the "
    "package's folder nor the user's cache can be written to; name a folder in NUMBA_CACHE_DIR"
)
"""What a user without a place for the cache is told."""


def ensure() -> None:
    """Have a place for compiled functions, and no damaged file among them stop anyone."""
    _forgive()
    if numba.config.CACHE_DIR:
        return
    try:
        caching.CompileResultCacheImpl(ensure)
    except RuntimeError:  # "no locator available"
        folder = temporary("numba")
        atexit.register(folder.cleanup)
        numba.config.CACHE_DIR = folder.name
        warnings.warn(NO_PLACE, RuntimeWarning, stacklevel=2)


def fingerprint(sources: Iterable[Path]) -> str:
    """Hash of what these files say."""
    digest = hashlib.sha256()
    for source in sources:
        digest.update(source.read_bytes())
    return digest.hexdigest()


def stamp(dispatcher: Any, sources: Iterable[Path]) -> None:
    """Let the cache of a compiled function be valid for exactly these sources.

    numba compiles again when the file of the function changed - that file only, not those of the
    functions that it calls. The attributes are numba's own and private; a test guards them. With
    NUMBA_DISABLE_JIT nothing is compiled and nothing kept.
    """
    if numba.config.DISABLE_JIT:
        return
    dispatcher._cache._cache_file._source_stamp = fingerprint(sources)


def _forgive() -> None:
    """Have numba delete a damaged cache and compile, instead of raising what it stumbled over."""
    kind = caching.IndexDataCacheFile
    if getattr(kind.load, "forgiving", False):
        return
    load = kind.load

    def forgiving(self: Any, key: Any) -> Any:
        try:
            return load(self, key)
        except Exception:  # pickle raises whatever the bytes make it do
            with suppress(OSError):
                index = Path(self._index_path)
                for file in index.parent.glob(f"{index.stem}.*"):
                    file.unlink()
            return None

    forgiving.forgiving = True  # type: ignore[attr-defined]
    kind.load = forgiving


ensure()
