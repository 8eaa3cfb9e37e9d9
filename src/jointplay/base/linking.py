"""Compilation of a function and everything that it calls into one object, by numba's public API.

By itself numba optimises and translates every function that it meets, together with all that this
calls, and once more in every caller: most of the time of a first start. Here each function is a
part: numba types and lowers it without optimising, and a caller only declares the parts that it
calls. `build` links the parts that a function needs, once each, optimises the whole and translates
it to machine code.

`compiler` imports this module when something is compiled.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import config, from_dtype, njit, types
from numba.core import cgutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.typing.templates import CallableTemplate
from numba.extending import lower_builtin

from jointplay.base.intrinsics import array_value, numba_type
from jointplay.base.objects import ENTRY, Target, Unresolved

__all__ = ["Part", "build"]

_parts: dict[str, tuple[Any, tuple[Any, ...]]] = {}
"""Lowered parts by symbol: dispatcher and argument types of each."""

_lowering_part = False
"""Whether numba is lowering a part, whose callees `build` will link; else numba must link them."""


class Part:
    """A function that numba types and lowers for given argument types, without optimising.

    Attributes:
        kind: numba's type of the function, for code that calls it.
    """

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        plain = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "no_rewrites": True}
        self._dispatcher = njit(**options, **plain)(function.py_func)

        def typer(*kinds: Any) -> Any:
            return self.lowered(kinds).signature.return_type

        typer.__signature__ = inspect.signature(function.py_func)  # type: ignore[attr-defined]
        members = {"key": function, "generic": lambda template: typer}
        self.kind = types.Function(type(function.__name__, (CallableTemplate,), members))
        lower_builtin(function, types.VarArg(types.Any))(self._call)

    def lowered(self, kinds: tuple[Any, ...]) -> Any:
        """numba's compilation result for these argument types."""
        if kinds not in self._dispatcher.overloads:
            with _as_part():
                self._dispatcher.compile(kinds)
            symbol = self._dispatcher.overloads[kinds].fndesc.llvm_func_name
            _parts[symbol] = self._dispatcher, kinds
        return self._dispatcher.overloads[kinds]

    def _call(self, context: Any, builder: Any, signature: Any, args: Any) -> Any:
        """Emit a call of the function; `build` or a library of numba's adds its code later."""
        callee = self.lowered(signature.args).fndesc
        status, answer = context.call_conv.call_function(
            builder,
            context.declare_function(builder.module, callee),
            callee.restype,
            callee.argtypes,
            args,
        )
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        if not _lowering_part:
            context.add_linking_libs([_library(callee.llvm_func_name)])
        return answer


@contextmanager
def _as_part() -> Iterator[None]:
    """Within the block numba does not optimise; nor is garbage collected, as there is none."""
    global _lowering_part
    _ = cpu_target.target_context  # first makes the code generator, at its usual optimisation
    config.reload_config()  # else numba does at its first compilation, and undoes what follows
    level, collects, within = config.OPT, gc.isenabled(), _lowering_part
    config.OPT, _lowering_part = type(level)(0), True
    gc.disable()
    try:
        yield
    finally:
        config.OPT, _lowering_part = level, within
        if collects:
            gc.enable()


def _linked(module: Any) -> Any:
    """Link a module with all parts that it declares, and those that these declare in turn."""
    missing = _declared(module)
    while missing:
        for name in missing:
            dispatcher, kinds = _parts[name]
            module.link_in(binding.parse_assembly(dispatcher.inspect_llvm(kinds)))
        missing = _declared(module)
    return module


def _declared(module: Any) -> list[str]:
    """Symbols of the parts that a module declares but does not define."""
    return [f.name for f in module.functions if f.is_declaration and f.name in _parts]


@cache
def _library(name: str) -> Any:
    """Library of a part with everything that it calls, which numba links into other functions."""
    dispatcher, kinds = _parts[name]
    library = cpu_target.target_context.codegen().create_library(name)
    library.add_llvm_module(_linked(binding.parse_assembly(dispatcher.inspect_llvm(kinds))))
    library.finalize()
    return library


def build(part: Part, signature: str, target: Target) -> tuple[Callable[[], bytes], str]:
    """Type, lower and link a function with everything that it calls.

    Args:
        part: the function.
        signature: types of its arguments, as `compiler.Compiled` writes them.
        target: processor and system to compile for.

    Returns:
        A function that does LLVM's part of the work and returns the object code; and a letter for
        the type of each number that the compiled function returns.

    Raises:
        Unresolved: from that function, if the code needs numba's own libraries.
    """
    with global_compiler_lock:
        kinds = tuple(_types(signature))
        code = part.lowered(kinds)
        context = cpu_target.target_context
        module = ir.Module(ENTRY)
        returns = _enter(context, module, code, kinds, signature[0])
        linked = _linked(binding.parse_assembly(cgutils.normalize_ir_text(str(module))))
        _add_runtime(linked)
    machine = _machine(target)
    linked.triple, linked.data_layout = target.triple, str(machine.target_data)
    for k, value in enumerate((*linked.functions, *linked.global_variables)):
        if not value.is_declaration and value.name != ENTRY:
            # numba's names count what it has compiled before; these make objects reproducible.
            value.linkage, value.name = "internal", f"part_{k}"

    def translate() -> bytes:
        tuning = binding.create_pipeline_tuning_options(speed_level=3)
        tuning.loop_vectorization, tuning.slp_vectorization = True, False  # as numba has them
        passes = binding.create_pass_builder(machine, tuning)
        passes.getModulePassManager().run(linked, passes)
        _check(linked)
        return machine.emit_object(linked)  # type: ignore[no-any-return]

    return translate, returns


_ALLOCATE = ("NRT_MemInfo_alloc_aligned", "NRT_MemInfo_alloc_safe_aligned")
_BEFORE, _DATA = 64, 24
"""Bytes of an allocated block before its data, and the offset in them of the data's address."""


def _add_runtime(linked: Any) -> None:
    """Add a runtime that allocates arrays, counts references and frees, as numba's needs numba.

    Where nothing is allocated, counting does nothing.
    """
    byte, word, size = ir.IntType(8).as_pointer(), ir.IntType(64), ir.IntType(32)
    module = ir.Module("runtime")
    used = [f.name for f in linked.functions if f.name in _ALLOCATE]

    def define(name: str, answer: Any, *arguments: Any) -> tuple[Any, Any]:
        function = ir.Function(module, ir.FunctionType(answer, arguments), name)
        return ir.IRBuilder(function.append_basic_block("entry")), function

    counting = [define(name, ir.VoidType(), byte) for name in ("NRT_incref", "NRT_decref")]
    if used:
        malloc = ir.Function(module, ir.FunctionType(byte, [word]), "malloc")
        free = ir.Function(module, ir.FunctionType(ir.VoidType(), [byte]), "free")
        for (builder, function), step in zip(counting, (1, -1), strict=True):
            (block,) = function.args
            with builder.if_then(builder.icmp_unsigned("!=", block, byte(None))):
                # No atomic counting: these arrays are made and freed within one call of one thread.
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
    linked.link_in(binding.parse_assembly(str(module)))


def _machine(target: Target) -> Any:
    """LLVM's machine for a target, with position-independent code."""
    if target.triple != binding.get_process_triple():
        binding.initialize_all_targets()
        binding.initialize_all_asmprinters()
    return binding.Target.from_triple(target.triple).create_target_machine(
        cpu=target.cpu, features=target.flags, opt=3, reloc="pic", codemodel="default"
    )


def _check(module: Any) -> None:
    """Check that all undefined symbols are the system's; else loading would fail silently.

    Raises:
        Unresolved: one is not.
    """
    system = ctypes.CDLL(None)
    used = [value for value in (*module.functions, *module.global_variables)
            if value.is_declaration and not value.name.startswith("llvm.")]  # fmt: skip
    missing = [value.name for value in used if not hasattr(system, value.name)]
    if missing:
        raise Unresolved(", ".join(missing))


def _types(signature: str) -> list[Any]:
    """Parse a signature into numba's types of its arguments."""
    text = signature[signature.index("(") + 1 : -1]
    kinds, remainder = _several(text)
    assert not remainder, signature
    return kinds


def _several(text: str) -> tuple[list[Any], str]:
    """Parse types up to a closing bracket; returns them and the remaining text."""
    kinds: list[Any] = []
    while text and not text.startswith(")"):
        kind, text = re.match(r"([^,()]*)(.*)", text).groups()  # type: ignore[union-attr]
        if text.startswith("("):
            inner, text = _several(text[1:])
            module, _, name = kind.partition(":")
            constructor: Any = importlib.import_module(module)
            for part_of_name in name.split("."):
                constructor = getattr(constructor, part_of_name)
            named = None if constructor is tuple else constructor
            kinds.append(types.BaseTuple.from_types(inner, named))
            text = text[1:]
        elif "." in kind:
            dtype, _, shape = kind.partition(".")
            kinds.append(types.Array(from_dtype(np.dtype(dtype)), int(shape[:-1]), shape[-1]))
        else:
            kinds.append(numba_type(kind))
        text = text.removeprefix(",")
    return kinds, text


def _enter(context: Any, module: Any, lowered: Any, kinds: tuple[Any, ...], answer: str) -> str:
    """Emit the entry function, which makes arrays and tuples of machine words and calls the code.

    It returns the function's result; or, where `answer` is no letter, numba's status, and writes
    the results to the address in its first argument. Returns the letters of the results.
    """
    word, double = ir.IntType(64), ir.DoubleType()
    letters = {types.float64: (double, "d"), types.none: (ir.VoidType(), "v")}
    parameters: list[Any] = []

    def take(kind: Any) -> None:
        if isinstance(kind, types.Array):
            parameters.extend([word] * (1 + 2 * kind.ndim))
        elif isinstance(kind, types.BaseTuple):
            for inner in kind.types:
                take(inner)
        else:
            parameters.append(context.get_value_type(kind))

    for kind in kinds:
        take(kind)
    returned = lowered.signature.return_type
    several = returned.types if isinstance(returned, types.BaseTuple) else (returned,)
    returns = "".join("d" if number == types.float64 else "i" for number in several)
    if returned == types.none:
        returns = ""
    if answer == "(":
        kind = ir.FunctionType(ir.IntType(32), [word, *parameters])
    else:
        native = letters.get(returned, (word, "i"))[0] if answer != "v" else ir.VoidType()
        kind = ir.FunctionType(native, parameters)
    function = ir.Function(module, kind, ENTRY)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    remaining = list(function.args)
    room = remaining.pop(0) if answer == "(" else None

    def value(kind: Any) -> Any:
        if isinstance(kind, types.Array):
            data = remaining.pop(0)
            shape = [remaining.pop(0) for _ in range(kind.ndim)]
            strides = [remaining.pop(0) for _ in range(kind.ndim)]
            return array_value(context, builder, kind, data, shape, strides)
        if isinstance(kind, types.BaseTuple):
            return context.make_tuple(builder, kind, [value(inner) for inner in kind.types])
        return remaining.pop(0)

    values = [value(kind) for kind in kinds]
    called = context.declare_function(module, lowered.fndesc)
    status, result = context.call_conv.call_function(
        builder, called, returned, lowered.signature.args, values
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
        for index, number in enumerate(several if returns else ()):
            component = builder.extract_value(result, index) if len(several) > 1 else result
            wanted = types.float64 if number == types.float64 else types.int64
            component = context.cast(builder, component, number, wanted)
            place = builder.add(room, word(8 * index))
            builder.store(component, builder.inttoptr(place, component.type.as_pointer()))
    builder.ret(builder.zext(status.is_error, ir.IntType(32)))
    return returns
