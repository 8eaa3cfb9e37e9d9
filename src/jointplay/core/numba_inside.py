"""What this package takes from inside numba, all of it: it moves from release to release.

Parts of kernels: by itself numba optimises and translates every function it meets, with all that it
calls, on its own, and once more in every caller: most of what a first start takes. Parts are typed
and lowered only; code is made of them where an entry has linked them all.

The cache: numba does not start with a damaged one, which is thrown away here and made anew, and
does not know of which files its code was made, which a stamp says here.

`compiler` imports this module; where numba lacks a name that is used here, importing fails.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import NumbaError
from numba.core.typed_passes import AnnotateTypes

__all__ = ["NumbaError", "part", "stamp"]

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
    IndexDataCacheFile: ("load",),
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


if not config.DISABLE_JIT:
    stamp(njit(cache=True)(stamp), "")


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
        """What made this."""
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


_load = IndexDataCacheFile.load


def _forgiving(self: Any, key: Any) -> Any:
    """What is kept under a key; a damaged cache is deleted, and functions compiled again."""
    try:
        return _load(self, key)
    except Exception:  # pickle raises whatever the bytes make it do
        with suppress(OSError):
            index = Path(self._index_path)
            for file in index.parent.glob(f"{index.stem}.*"):
                file.unlink()
        return None


IndexDataCacheFile.load = _forgiving
