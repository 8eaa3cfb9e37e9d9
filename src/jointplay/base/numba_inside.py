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
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from llvmlite import binding, ir
from numba import from_dtype, njit, types
from numba.core import base, cgutils, errors, event
from numba.core import ir as numba_ir
from numba.core.analysis import compute_cfg_from_blocks, compute_use_defs, must_use_alloca
from numba.core.base import BaseContext
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.lowering import Lower
from numba.core.postproc import PostProcessor, VariableLifetime
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.transforms import canonicalize_cfg
from numba.core.typed_passes import AnnotateTypes
from numba.core.types.functions import BaseFunction
from numba.np import arrayobj

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
    BaseContext: ("get_abi_sizeof", "refresh"),
    BaseFunction: ("get_call_type",),
    Lower: ("_find_singly_assigned_variable",),
    PostProcessor: ("run",),
    types.Record: ("__repr__",),
    numba_ir.Inst: ("_rec_list_vars",),
    cgutils: ("alloca_once",),
    cgutils._StructProxy: ("__init__", "__getitem__", "__getattr__", "_getvalue", "_make_refs"),
    arrayobj: ("make_array",),
    base: ("_has_loc",),
    errors: ("termcolor",),
    event: ("broadcast",),
}
"""Attributes of numba's classes and modules that are called or replaced here."""

_NUMBA: dict[tuple[Any, str], Any] = {
    (owner, name): getattr(owner, name) for owner, names in USED.items() for name in names
}
"""What they are by themselves."""


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

    counts = True
    """Whether the function counts references to arrays."""

    def create_ir_module(self, name: str) -> Any:
        """One that says whether references are counted in it."""
        module = super().create_ir_module(name)
        module.counts = self.counts
        return module

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


_LOOKS = ("getitem", "static_getitem", "getiter", "iternext", "pair_first", "pair_second")
"""Operations that find what is in an array that is there already."""


def _owns_arrays(state: Any) -> bool:
    """Whether a function that has been typed makes arrays, or has them made.

    One that does not has no references to count: all its arrays are lent to it.
    """
    models = state.targetctx.data_model_manager

    def counted(kind: Any) -> bool:
        return bool(models[kind].contains_nrt_meminfo())

    for made, signature in state.calltypes.items():
        if signature is None or not counted(signature.return_type):
            continue
        if getattr(made, "op", "") not in _LOOKS or any(map(counted, signature.args[1:])):
            return True
    return counted(state.return_type)


@register_pass(mutates_CFG=False, analysis_only=True)
class _IntoPart(AnalysisPass):  # type: ignore[misc]
    """Has the function lowered into a `PartLibrary`."""

    _name = "jointplay_into_part"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        if not _owns_arrays(state):
            state.library.counts = state.targetctx.enable_nrt = False
            for block in state.func_ir.blocks.values():
                block.body = [one for one in block.body if not isinstance(one, numba_ir.Del)]
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
    """Garbage collection goes through all that typing leaves, and finds nothing: nor later."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if was:
            gc.enable()


@contextmanager
def _replaced(changes: dict[tuple[Any, str], Any]) -> Iterator[None]:
    """Within the block attributes have other values."""
    own = {place: getattr(*place) for place in changes}
    for place, value in changes.items():
        setattr(*place, value)
    try:
        yield
    finally:
        for place, value in own.items():
            setattr(*place, value)


_OPERATORS = frozenset(one for one in vars(operator).values() if callable(one))


def _remembering() -> dict[tuple[Any, str], Any]:
    """What has numba find once how an operator takes some types, how large a type is, and what is
    registered: it tries dozens of ways each time, and writes and parses a module to find a size.
    """
    ask_call, ask_size = (
        _NUMBA[BaseFunction, "get_call_type"],
        _NUMBA[BaseContext, "get_abi_sizeof"],
    )
    calls: dict[Any, Any] = {}
    sizes: dict[str, int] = {}
    registered = 0

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

    def refresh(context: Any) -> None:
        nonlocal registered
        loaders = {**context._registries, **context.typing_context._registries}
        now = sum(
            len(getattr(registry, name))
            for registry, loader in loaders.items()
            for name in loader.registry_items
        )
        if now != registered:
            registered = now
            _NUMBA[BaseContext, "refresh"](context)

    return {
        (BaseFunction, "get_call_type"): call_type,
        (BaseContext, "get_abi_sizeof"): size,
        (BaseContext, "refresh"): refresh,
        (base, "_has_loc"): cache(_NUMBA[base, "_has_loc"]),
    }


_PLAIN = frozenset({str, int, float, bool, type(None), numba_ir.Loc})


def _variables(instruction: Any, value: Any) -> list[Any]:
    """Variables in a part of an instruction: most parts are words."""
    if type(value) is numba_ir.Var:
        return [value]
    if type(value) is dict:
        parts = [one for one in value.values() if type(one) not in _PLAIN]
        return [found for one in parts for found in _variables(instruction, one)]
    return _NUMBA[numba_ir.Inst, "_rec_list_vars"](instruction, value)  # type: ignore[no-any-return]


class _NoColours:
    """What marks texts of errors, thousands of which typing raises and nobody reads."""

    def __getattr__(self, name: str) -> Callable[[str], str]:
        return str


def _post_process(processor: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Where nothing is deleted yet, lifetimes are found when they are asked for."""
    code = processor.func_ir
    if emit_dels or code.is_generator:
        _NUMBA[PostProcessor, "run"](processor, emit_dels, extend_lifetimes)
        return
    code.blocks = canonicalize_cfg(code.blocks)
    code.variable_lifetime, code.generator_info = VariableLifetime(code.blocks), None


def _find_values(lower: Any) -> None:
    """Variables that are no more than names of values: they need no memory.

    By itself numba finds those of one block. Without references to count these are all that are
    assigned once, before each use.
    """
    _NUMBA[Lower, "_find_singly_assigned_variable"](lower)
    if lower.context.enable_nrt:
        return
    places: dict[str, list[int]] = {}
    for offset, block in lower.blocks.items():
        for one in block.find_insts(numba_ir.Assign):
            places.setdefault(one.target.name, []).append(offset)
    once = {name: own[0] for name, own in places.items() if len(own) == 1}
    for name in must_use_alloca(lower.blocks):
        once.pop(name, None)
    dominators = compute_cfg_from_blocks(lower.blocks).dominators()
    for offset, names in compute_use_defs(lower.blocks).usemap.items():
        for name in names & once.keys():
            if once[name] >= offset or once[name] not in dominators[offset]:
                del once[name]
    lower._singly_assigned_vars |= once.keys()


def _counts(builder: Any) -> bool:
    return getattr(builder.module, "counts", True)


def _room(builder: Any, kind: Any, size: Any = None, name: str = "", zfill: bool = False) -> Any:
    """Memory for a value, which is cleared on entry for the sake of references only."""
    if zfill or _counts(builder):
        return _NUMBA[cgutils, "alloca_once"](builder, kind, size, name, zfill)
    with builder.goto_entry_block():
        return builder.alloca(kind, size=size, name=name)


_Proxy = cgutils._StructProxy


def _hold(proxy: Any, context: Any, builder: Any, value: Any = None, ref: Any = None) -> None:
    """Have a structure that is a value be read as one: numba writes it to memory first."""
    own = isinstance(proxy, cgutils.ValueStructProxy) and proxy._make_refs.__func__ is _MAKE
    if value is None or ref is not None or _counts(builder) or not own:
        _NUMBA[_Proxy, "__init__"](proxy, context, builder, value, ref)
        return
    proxy._context, proxy._builder = context, builder
    proxy._datamodel = context.data_model_manager[proxy._fe_type]
    proxy._be_type = proxy._get_be_type(proxy._datamodel)
    proxy._given, proxy._block = value, builder.block


_MAKE = _NUMBA[_Proxy, "_make_refs"]


def _in_memory(proxy: Any) -> bool:
    return "_value" in vars(proxy)


def _field(proxy: Any, index: int) -> Any:
    if _in_memory(proxy):
        return _NUMBA[_Proxy, "__getitem__"](proxy, index)
    return proxy._builder.extract_value(proxy._given, index)


def _whole(proxy: Any) -> Any:
    return _NUMBA[_Proxy, "_getvalue"](proxy) if _in_memory(proxy) else proxy._given


def _attribute(proxy: Any, name: str) -> Any:
    """A field, or the memory of a structure, which is written to when it is asked for."""
    if name not in ("_value", "_outer_ref"):
        return _NUMBA[_Proxy, "__getattr__"](proxy, name)
    place = cgutils.alloca_once(proxy._builder, proxy._be_type)
    with proxy._builder.goto_block(proxy._block):
        proxy._builder.store(proxy._given, place)
    proxy._value = proxy._outer_ref = place
    return place


@cache
def _array_structure(kind: Any) -> Any:
    """numba's class of proxies for arrays of a type, whose shape need not be in memory."""
    numbas = _NUMBA[arrayobj, "make_array"](kind)
    if type(kind) is not types.Array:
        return numbas

    def shape(proxy: Any) -> Any:
        if _in_memory(proxy):
            return numbas.shape.fget(proxy)
        return proxy._builder.extract_value(
            proxy._given, proxy._datamodel.get_field_position("shape")
        )

    return type(numbas.__name__, (numbas,), {"_make_refs": _MAKE, "shape": property(shape)})


_QUICKER = {
    (errors, "termcolor"): _NoColours,
    (event, "broadcast"): lambda happened: None,
    (types.Record, "__repr__"): lambda record: record.name,
    (numba_ir.Inst, "_rec_list_vars"): _variables,
    (PostProcessor, "run"): _post_process,
    (Lower, "_find_singly_assigned_variable"): _find_values,
    (cgutils, "alloca_once"): _room,
    (_Proxy, "__init__"): _hold,
    (_Proxy, "__getitem__"): _field,
    (_Proxy, "__getattr__"): _attribute,
    (_Proxy, "_getvalue"): _whole,
    (arrayobj, "make_array"): _array_structure,
}
"""What does less than numba's own, to the same end: a third of what compiling takes."""


def build(dispatcher: Any, signature: str, target: Target) -> tuple[Callable[[], bytes], str]:
    """What makes object code of a function, and a letter for each number that it returns.

    What it makes it of is typed, lowered and linked: what is left is LLVM's work.

    Args:
        dispatcher: of a `part`.
        signature: types of arguments, as `compiler.Compiled` writes them.
        target: the processor and system that it is made for.

    Raises:
        Unresolved: by what makes it: it needs numba's own libraries.
    """
    quicker = _replaced(_remembering() | _QUICKER)
    with _without_collection(), global_compiler_lock, quicker:
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

    def translate() -> bytes:
        with _replaced({(library._codegen, "_tm"): machine}):
            CPUCodeLibrary._optimize_final_module(library)
        _check(library._final_module)
        return machine.emit_object(library._final_module)  # type: ignore[no-any-return]

    return translate, returns


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
