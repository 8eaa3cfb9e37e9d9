"""How functions are compiled that only kernels call: as parts of an entry, which is optimised once.

By itself numba optimises and translates every function it meets, with all that it calls, on its
own, and once more in every caller: most of what a first start takes. Parts are typed and lowered
only; code is made of them where an entry has linked them all. The attributes that are replaced here
are numba's own; a test guards that parts are left alone and that an entry still works.
"""

from __future__ import annotations

from typing import Any

from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import AnnotateTypes


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


internal = njit(
    error_model="numpy",
    no_cpython_wrapper=True,
    no_cfunc_wrapper=True,
    pipeline_class=PartCompiler,
)
"""For functions that only compiled code calls."""
