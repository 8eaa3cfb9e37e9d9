"""What this package takes from inside numba, all of it: it moves from release to release.

By itself numba optimises and translates every function it meets, with all that it calls, on its
own, and once more in every caller: most of what a first start takes. Here parts are typed and
lowered only; `build` links what a function needs once, optimises that as a whole and translates it.

`compiler` imports this module; where numba lacks a name that is used here, importing fails.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import operator
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any, cast

from llvmlite import binding, ir
from numba import from_dtype, njit, types
from numba.core.base import BaseContext
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.typed_passes import AnnotateTypes
from numba.core.types.functions import BaseFunction

from jointplay.base.intrinsics import numba_type
from jointplay.base.objects import Target, Unresolved

__all__ = ["build", "part"]

USED = {
    CPUCodeLibrary: ("_optimize_final_module", "_get_module_for_linking"),
    JITCodeLibrary: (
        "codegen",
        "get_pointer_to_function",
        "add_ir_module",
        "create_ir_module",
        "finalize",
        "_ensure_finalized",
        "_optimize_functions",
    ),
    CompilerBase: ("define_pipelines",),
    DefaultPassBuilder: ("define_nopython_pipeline",),
    BaseContext: ("get_abi_sizeof",),
    BaseFunction: ("get_call_type",),
}
"""Attributes of numba's classes that are called or replaced here."""

for _kind, _names in USED.items():
    for _name in _names:
        getattr(_kind, _name)


class _NoCode:
    """A code generator without machine code: there is nowhere to write an environment to."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing."""


class PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Intermediate code of one function, neither linked, optimised nor translated."""

    @property
    def codegen(self) -> Any:
        return _NoCode(self._codegen)

    def get_pointer_to_function(self, name: str) -> int:
        """No function has an address."""
        self._ensure_finalized()
        return 0

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Nothing is linked yet."""
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """For libraries of numba's own that call this one: with all that it calls."""
        if self._shared_module is None:
            whole: Any = _linked(self, self._final_module.name)
            for function in whole.functions:
                if not function.is_declaration and function.linkage == binding.Linkage.external:
                    function.linkage = "linkonce_odr"
            self._shared_module: Any = whole
        return self._shared_module


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
        passes.passes = [one for one in passes.passes if one[0].__name__ not in self.needless()]
        passes.finalize()
        return [passes]

    def needless(self) -> Collection[str]:
        """Names of passes that are left out."""
        return ()


class PlainCompiler(PartCompiler):
    """The same for this package's own functions: no closures, no comprehensions, no literals.

    What a pass does for speed the optimiser does once more.
    """

    def needless(self) -> Collection[str]:
        """Names of passes that find nothing."""
        return _NEEDLESS


_NEEDLESS = (
    *("WithLifting", "InlineClosureLikes", "RewriteDynamicRaises", "MakeFunctionToJitFunction"),
    *("InlineInlinables", "DeadBranchPrune", "FindLiterallyCalls", "LiteralUnroll"),
    *("LiteralPropagationSubPipelinePass", "InlineOverloads", "NopythonRewrites"),
)


def part(own: bool, **options: Any) -> Any:
    """Decorator of functions that are parts of objects; `own`: of this package."""
    pipeline = PlainCompiler if own else PartCompiler
    return njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=pipeline, **options)


_ENTRY = "jointplay_entry"
"""Name of the function that an object is made for."""


@contextmanager
def _without_collection() -> Iterator[None]:
    """Garbage collection goes through all that typing leaves, and finds nothing."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


_OPERATORS = frozenset(one for one in vars(operator).values() if callable(one))


@contextmanager
def _remembering() -> Iterator[None]:
    """Within the block numba is asked once how an operator takes some types, and how large a type
    is: it tries dozens of ways each time, and writes and parses a module to find a size.
    """
    functions, contexts = cast(Any, BaseFunction), cast(Any, BaseContext)
    ask_call, ask_size = functions.get_call_type, contexts.get_abi_sizeof
    calls: dict[Any, Any] = {}
    sizes: dict[str, int] = {}

    def call_type(function: Any, context: Any, given: Any, named: Any) -> Any:
        if named or function.typing_key not in _OPERATORS:
            return ask_call(function, context, given, named)
        asked = function, given
        if asked not in calls:
            calls[asked] = ask_call(function, context, given, named)
        return calls[asked]

    def size(context: Any, kind: Any) -> int:
        words = str(kind)
        if words not in sizes:
            sizes[words] = ask_size(context, kind)
        return sizes[words]

    functions.get_call_type, contexts.get_abi_sizeof = call_type, size
    try:
        yield
    finally:
        functions.get_call_type, contexts.get_abi_sizeof = ask_call, ask_size


def build(dispatcher: Any, signature: str, target: Target) -> tuple[bytes, str]:
    """Object code of a function, and a letter for each number that it returns.

    Args:
        dispatcher: of a `part`.
        signature: types of arguments, as `compiler.Compiled` writes them.
        target: the processor and system that it is made for.

    Raises:
        Unresolved: it needs numba's own libraries.
    """
    with _without_collection(), global_compiler_lock, _remembering():
        kinds = _types(signature)
        dispatcher.compile(tuple(kinds))
        made = dispatcher.overloads[tuple(kinds)]
        context = cpu_target.target_context
        library = PartLibrary(context.codegen(), _ENTRY)
        module = library.create_ir_module(_ENTRY)
        returns = _enter(context, module, made, kinds, signature[0])
        library.add_ir_module(module)
        library.add_linking_library(made.library)
        whole = _linked(library, _ENTRY)
        _add_runtime(whole, library)
        for value in (*whole.functions, *whole.global_variables):
            if not value.is_declaration and value.name != _ENTRY:
                value.linkage = "internal"
        machine = _machine(target)
        whole.triple, whole.data_layout = target.triple, str(machine.target_data)
        library._final_module = whole
        with _optimising_for(library._codegen, machine):
            CPUCodeLibrary._optimize_final_module(library)
        _check(library._final_module)
        return machine.emit_object(library._final_module), returns


@contextmanager
def _optimising_for(codegen: Any, machine: Any) -> Iterator[None]:
    own, codegen._tm = codegen._tm, machine
    try:
        yield
    finally:
        codegen._tm = own


def _linked(library: Any, name: str) -> Any:
    """One module of a library and all that it calls, but for numba's own runtime."""
    empty = library._codegen._create_empty_module(name)
    whole = binding.parse_assembly(str(empty))
    seen, waiting = {rtsys.library}, [library]
    while waiting:
        one = waiting.pop(0)
        if one in seen:
            continue
        seen.add(one)
        if isinstance(one, PartLibrary):
            whole.link_in(one._final_module, preserve=True)
            waiting += one._linking_libraries
        else:
            whole.link_in(one._get_module_for_linking(), preserve=True)
    return whole


_ALLOCATE = ("NRT_MemInfo_alloc_aligned", "NRT_MemInfo_alloc_safe_aligned")
_BEFORE, _DATA = 64, 24
"""Bytes of a block before its numbers, and where among them lies the address of the numbers."""


def _add_runtime(whole: Any, library: Any) -> None:
    """Add what counts references to arrays and frees them: numba's own needs numba.

    Where nothing is allocated there is nothing to count.
    """
    byte, word, size = ir.IntType(8).as_pointer(), ir.IntType(64), ir.IntType(32)
    module = ir.Module("runtime")
    module.triple, module.data_layout = whole.triple, library._codegen._data_layout
    used = [one.name for one in whole.functions if one.name in _ALLOCATE]

    def define(name: str, answer: Any, *given: Any) -> tuple[Any, Any]:
        function = ir.Function(module, ir.FunctionType(answer, given), name)
        return ir.IRBuilder(function.append_basic_block("entry")), function

    counting = [define(name, ir.VoidType(), byte) for name in ("NRT_incref", "NRT_decref")]
    if used:
        malloc = ir.Function(module, ir.FunctionType(byte, [word]), "malloc")
        free = ir.Function(module, ir.FunctionType(ir.VoidType(), [byte]), "free")
        for (builder, function), step in zip(counting, (1, -1), strict=True):
            (block,) = function.args
            with builder.if_then(builder.icmp_unsigned("!=", block, byte(None))):
                # No other thread has these arrays: they are made and freed within one call.
                count = builder.bitcast(block, word.as_pointer())
                left = builder.add(builder.load(count), word(step))
                builder.store(left, count)
                if step < 0:
                    with builder.if_then(builder.icmp_unsigned("==", left, word(0))):
                        builder.call(free, [block])
        for name in used:
            builder, function = define(name, byte, word, size)
            align = builder.zext(function.args[1], word)
            most = builder.add(align, word(_BEFORE))
            block = builder.call(malloc, [builder.add(function.args[0], most)])
            with builder.if_then(builder.icmp_unsigned("!=", block, byte(None))):
                start = builder.add(builder.ptrtoint(block, word), most)
                start = builder.sub(start, builder.urem(start, align))
                builder.store(word(1), builder.bitcast(block, word.as_pointer()))
                place = builder.bitcast(builder.gep(block, [word(_DATA)]), word.as_pointer())
                builder.store(start, place)
            builder.ret(block)
        builder, function = define("NRT_MemInfo_data_fast", byte, byte)
        place = builder.gep(function.args[0], [word(_DATA)])
        builder.ret(builder.load(builder.bitcast(place, byte.as_pointer())))
    for builder, _ in counting:
        builder.ret_void()
    whole.link_in(binding.parse_assembly(str(module)))


def _machine(target: Target) -> Any:
    """What translates for a target, into code that may lie anywhere."""
    if target.triple != binding.get_process_triple():
        binding.initialize_all_targets()
        binding.initialize_all_asmprinters()
    return binding.Target.from_triple(target.triple).create_target_machine(
        cpu=target.cpu, features=target.flags, opt=3, reloc="pic", codemodel="default"
    )


def _check(module: Any) -> None:
    """One symbol that is not found would leave all without addresses, without a word.

    Raises:
        Unresolved: one is not the system's.
    """
    system = ctypes.CDLL(None)
    used = [value for value in (*module.functions, *module.global_variables)
            if value.is_declaration and not value.name.startswith("llvm.")]  # fmt: skip
    missing = [value.name for value in used if not hasattr(system, value.name)]
    if missing:
        raise Unresolved(", ".join(missing))


def _types(signature: str) -> list[Any]:
    """numba's types of the arguments of a signature."""
    text = signature[signature.index("(") + 1 : -1]
    found, rest = _several(text)
    assert not rest, signature
    return found


def _several(text: str) -> tuple[list[Any], str]:
    """Types until a closing bracket, and what comes after them."""
    found: list[Any] = []
    while text and not text.startswith(")"):
        kind, text = re.match(r"([^,()]*)(.*)", text).groups()  # type: ignore[union-attr]
        if text.startswith("("):
            inner, text = _several(text[1:])
            module, _, name = kind.partition(":")
            made: Any = importlib.import_module(module)
            for part_of_name in name.split("."):
                made = getattr(made, part_of_name)
            found.append(types.BaseTuple.from_types(inner, made if made is not tuple else None))
            text = text[1:]
        elif "." in kind:
            dtype, _, shape = kind.partition(".")
            found.append(types.Array(from_dtype(_dtype(dtype)), int(shape[:-1]), shape[-1]))
        else:
            found.append(numba_type(kind))
        text = text.removeprefix(",")
    return found, text


def _dtype(name: str) -> Any:
    import numpy as np

    return np.dtype(name)


def _enter(context: Any, module: Any, made: Any, kinds: list[Any], answer: str) -> str:
    """Write the function that enters the code: it makes arrays of what the machine gives.

    It returns what the function does, or where `answer` is no letter, numba's status: what the
    function returns is written to the address that comes first.
    """
    word, double = ir.IntType(64), ir.DoubleType()
    letters = {types.float64: (double, "d"), types.none: (ir.VoidType(), "v")}
    given: list[Any] = []

    def take(kind: Any) -> None:
        if isinstance(kind, types.Array):
            given.extend([word] * (1 + 2 * kind.ndim))
        elif isinstance(kind, types.BaseTuple):
            for one in kind.types:
                take(one)
        else:
            given.append(context.get_value_type(kind))

    for kind in kinds:
        take(kind)
    returned = made.signature.return_type
    several = returned.types if isinstance(returned, types.BaseTuple) else (returned,)
    returns = "".join("d" if one == types.float64 else "i" for one in several)
    if returned == types.none:
        returns = ""
    if answer == "(":
        kind = ir.FunctionType(ir.IntType(32), [word, *given])
    else:
        native = letters.get(returned, (word, "i"))[0] if answer != "v" else ir.VoidType()
        kind = ir.FunctionType(native, given)
    function = ir.Function(module, kind, _ENTRY)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    rest = list(function.args)
    room = rest.pop(0) if answer == "(" else None

    def value(kind: Any) -> Any:
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder)
            pointer = context.get_value_type(types.CPointer(kind.dtype))
            data = builder.inttoptr(rest.pop(0), pointer)
            shape = [rest.pop(0) for _ in range(kind.ndim)]
            strides = [rest.pop(0) for _ in range(kind.ndim)]
            count = word(1)
            for size in shape:
                count = builder.mul(count, size)
            array.data, array.nitems = data, count
            array.itemsize = word(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
            pair = types.UniTuple(types.intp, kind.ndim)
            array.shape = context.make_tuple(builder, pair, shape)
            array.strides = context.make_tuple(builder, pair, strides)
            array.meminfo = context.get_constant_null(types.MemInfoPointer(types.voidptr))
            array.parent = context.get_constant_null(types.pyobject)
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            return context.make_tuple(builder, kind, [value(one) for one in kind.types])
        return rest.pop(0)

    values = [value(kind) for kind in kinds]
    called = context.declare_function(module, made.fndesc)
    status, result = context.call_conv.call_function(
        builder, called, returned, made.signature.args, values
    )
    if answer == "v":
        builder.ret_void()
        return returns
    if answer != "(":
        native = kind.return_type
        if native == word:
            result = context.cast(builder, result, returned, types.int64)
        builder.ret(builder.select(status.is_ok, result, ir.Constant(native, 0)))
        return returns
    with builder.if_then(status.is_ok):
        for index, one in enumerate(several if returns else ()):
            own = builder.extract_value(result, index) if len(several) > 1 else result
            wanted = types.float64 if one == types.float64 else types.int64
            own = context.cast(builder, own, one, wanted)
            place = builder.add(room, word(8 * index))
            builder.store(own, builder.inttoptr(place, own.type.as_pointer()))
    builder.ret(builder.zext(status.is_error, ir.IntType(32)))
    return returns
