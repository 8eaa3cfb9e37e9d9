"""Calls by address of compiled laws, for compiled code (`compiled` has the laws)."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_NUMBERS = types.CPointer(types.float64)
_DOUBLE = ir.DoubleType()


@intrinsic
def pointer(typingctx: Any, at: Any) -> Any:
    """Reinterpret an integer address as a pointer to doubles (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.PointerType(_DOUBLE))

    return _NUMBERS(types.int64), codegen


@intrinsic
def call_normal(typingctx: Any, at: Any, delta: Any, ddelta: Any, ddelta0: Any, p: Any) -> Any:
    """Call the normal-force law at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(_DOUBLE, [_DOUBLE, _DOUBLE, _DOUBLE, ir.PointerType(_DOUBLE)])
        function = builder.inttoptr(args[0], kind.as_pointer())
        return builder.call(function, args[1:])

    arguments = (types.int64, types.float64, types.float64, types.float64, _NUMBERS)
    return types.float64(*arguments), codegen


@intrinsic
def call_friction(typingctx: Any, at: Any, speed: Any, p: Any) -> Any:
    """Call the friction law at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(_DOUBLE, [_DOUBLE, ir.PointerType(_DOUBLE)])
        function = builder.inttoptr(args[0], kind.as_pointer())
        return builder.call(function, args[1:])

    return types.float64(types.int64, types.float64, _NUMBERS), codegen


@intrinsic
def call_bristle(
    typingctx: Any, at: Any, speed: Any, normal: Any, dwell: Any, p: Any, out: Any
) -> Any:
    """Call the friction law with bristles at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = ir.PointerType(_DOUBLE)
        kind = ir.FunctionType(ir.VoidType(), [_DOUBLE, _DOUBLE, _DOUBLE, array, array])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    arguments = (types.int64, *(types.float64,) * 3, _NUMBERS, _NUMBERS)
    return types.none(*arguments), codegen


@intrinsic
def call_film(
    typingctx: Any, at: Any, eccentricity: Any, rate: Any, whirl: Any, spin: Any, p: Any, out: Any
) -> Any:
    """Call the film law at address `at` (compiled code only)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = ir.PointerType(_DOUBLE)
        kind = ir.FunctionType(ir.VoidType(), [_DOUBLE] * 4 + [array] * 2)
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    arguments = (types.int64, *(types.float64,) * 4, _NUMBERS, _NUMBERS)
    return types.none(*arguments), codegen
