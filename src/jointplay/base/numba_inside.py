"""What this package takes from inside numba, all of it: it moves from release to release.

Parts of kernels: by itself numba optimises and translates every function it meets, with all that it
calls, on its own, and once more in every caller: most of what a first start takes. Parts are typed
and lowered only; code is made of them where an entry has linked them all.

The cache: numba runs what it holds, also after a bit has flipped there, so here each file ends with
a hash; and it does not know of which files its code was made, which a stamp says here.

`compiler` imports this module; where numba lacks a name that is used here, importing fails.
"""

import hashlib
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core.caching import IndexDataCacheFile
from numba.core.ccallback import CFunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import NumbaError
from numba.core.sigutils import normalize_signature
from numba.core.typed_passes import AnnotateTypes

__all__ = ["NumbaError", "part", "sealed", "sealed_cfunc", "stamp"]

USED = {
    JITCodeLibrary: (
        "codegen",
        "get_pointer_to_function",
        "_ensure_finalized",
        "_finalized",
        "_optimize_functions",
        "_optimize_final_module",
        "_finalize_final_module",
        "_finalize_dynamic_globals",
    ),
    CompilerBase: ("define_pipelines",),
    DefaultPassBuilder: ("define_nopython_pipeline",),
    IndexDataCacheFile: ("_load_index", "_load_data", "_data_path", "_open_for_write"),
    CFunc: ("enable_caching", "compile"),
}
"""Attributes of numba's classes that are called or replaced here."""

for _kind, _names in USED.items():
    for _name in _names:
        getattr(_kind, _name)


def stamp(dispatcher: Any, mark: str) -> None:
    """Let the cache of a compiled function be valid for exactly this mark of its sources."""
    file = dispatcher._cache._cache_file
    file._source_stamp  # noqa: B018  # to be replaced, it must be there
    file._source_stamp = mark


class SealedCacheFile(IndexDataCacheFile):  # type: ignore[misc]
    """Compiled code in files that end with a hash; what does not match is compiled again.

    The hash is also of the file's name and of the stamp: code of another function, or of older
    sources, is none.
    """

    def _load_index(self) -> Any:
        return super()._load_index() if self._whole(self._index_path) else {}

    def _load_data(self, name: str) -> Any:
        return super()._load_data(name) if self._whole(self._data_path(name)) else None

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[io.BytesIO]:
        content = io.BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(content.getvalue() + self._hash(filepath, content.getvalue()))

    def _whole(self, path: str) -> bool:
        try:
            content = memoryview(Path(path).read_bytes())
        except OSError:
            return False
        return self._hash(path, content[:-_HASH_BYTES]) == content[-_HASH_BYTES:]

    def _hash(self, path: str, content: bytes | memoryview) -> bytes:
        digest = hashlib.sha256(repr((Path(path).name, self._source_stamp)).encode())
        digest.update(content)
        return digest.digest()


_HASH_BYTES = hashlib.sha256().digest_size


def sealed(compiled: Any) -> Any:
    """A compiled function whose cache, where it has one, is a `SealedCacheFile`."""
    cache = compiled._cache
    if (plain := getattr(cache, "_cache_file", None)) is not None:
        base = plain._index_name.removesuffix(".nbi")
        cache._cache_file = SealedCacheFile(plain._cache_path, base, plain._source_stamp)
    return compiled


class _SealedCFunc(CFunc):  # type: ignore[misc]
    """A function for C with such a cache, which it reads as soon as it is made."""

    def enable_caching(self) -> None:
        super().enable_caching()
        sealed(self)


def sealed_cfunc(signature: Any, **options: Any) -> Callable[..., Any]:
    """numba's `cfunc` with such a cache.

    Raises:
        RuntimeError: of the function: there is no place for a cache.
    """

    def made(function: Callable[..., Any]) -> Any:
        compiled = _SealedCFunc(function, normalize_signature(signature), {}, options)
        compiled.enable_caching()
        compiled.compile()
        return compiled

    return made


if not config.DISABLE_JIT:
    stamp(sealed(njit(cache=True)(stamp)), "")


class _NoCode:
    """A code generator without machine code: there is nowhere to write an environment to."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing."""


class PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Intermediate code of one function and what it calls, neither optimised nor translated."""

    @property
    def codegen(self) -> Any:
        return _NoCode(self._codegen)

    def get_pointer_to_function(self, name: str) -> int:
        """No function has an address."""
        self._ensure_finalized()
        return 0

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=False, analysis_only=True)
class _IntoPart(AnalysisPass):  # type: ignore[misc]
    """Has the function lowered into a `PartLibrary`."""

    _name = "jointplay_into_part"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return False


class PartCompiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler, up to the intermediate code."""

    def define_pipelines(self) -> list[Any]:
        """numba's own passes, and one before the code is lowered."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_IntoPart, AnnotateTypes)
        passes.finalize()
        return [passes]


def part(**options: Any) -> Any:
    """Decorator of functions that only compiled code calls."""
    return njit(
        error_model="numpy",
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=PartCompiler,
        **options,
    )
