"""Intrinsics of compiled code for work with addresses; `compiler` declares and explains them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray as carray  # one of these intrinsics, too
from numba import from_dtype, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr

from jointplay.base import objects


def numba_type(letter: str) -> Any:
    """numba's type for a letter of a signature (`compiler.Compiled.native`)."""
    return {
        "v": types.void,
        "i": types.int64,
        "d": types.float64,
        "p": types.CPointer(types.float64),
    }[letter]


def numba_signature(signature: str) -> Any:
    """numba's signature for one in letters."""
    return numba_type(signature[0])(*map(numba_type, objects.flat(signature)))


def pointer_to(dtype: Any) -> Any:
    """See `compiler.pointer_to`."""
    element = from_dtype(np.dtype(dtype))

    @intrinsic
    def reinterpret(typingctx: Any, at: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return types.CPointer(element)(types.int64), codegen

    return reinterpret


NUMBERS = types.CPointer(types.float64)


@intrinsic
def place_of(typingctx: Any, record: Any) -> Any:
    """See `compiler.place_of`."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.ptrtoint(args[0], context.get_value_type(types.int64))

    return types.int64(record), codegen


@intrinsic
def address_of(typingctx: Any, array: Any) -> Any:
    """See `compiler.address_of`."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.bitcast(value.data, context.get_value_type(NUMBERS))

    return NUMBERS(array), codegen


def open_arrays(
    of: np.dtype, arrays: Mapping[str, tuple[np.dtype, Sequence[tuple[int, str | None]]]]
) -> None:
    """See `compiler.open_arrays`."""
    record = from_dtype(of)
    opened = {
        name: types.Array(from_dtype(element), len(shape), "C")
        for name, (element, shape) in arrays.items()
    }

    @infer_getattr
    class _(AttributeTemplate):  # type: ignore[misc]
        key = record

        def generic_resolve(self, record: Any, name: str) -> Any:
            return opened[name] if name in opened else record.typeof(name)

    for name, (_element, shape) in arrays.items():
        lower_getattr(record, name)(_opening(opened[name], record, name, shape))


def _opening(
    array: Any, record: Any, name: str, shape: Sequence[tuple[int, str | None]]
) -> Callable[..., Any]:
    """Code generator for numba that makes the array of a field from its address and shape."""

    def integer(builder: Any, value: Any, field: str) -> Any:
        kind = ir.IntType(64)
        address = builder.bitcast(value, ir.IntType(8).as_pointer())
        address = builder.gep(address, [ir.Constant(kind, record.offset(field))])
        return builder.load(builder.bitcast(address, kind.as_pointer()))

    def lowered(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        word = context.get_value_type(types.intp)
        sizes = []
        for factor, field in shape:
            size = ir.Constant(word, factor)
            if field is not None:
                size = builder.mul(size, integer(builder, value, field))
            sizes.append(size)
        return array_value(context, builder, array, integer(builder, value, name), sizes)

    return lowered


def array_value(
    context: Any, builder: Any, kind: Any, address: Any, shape: list[Any], strides: Any = ()
) -> Any:
    """Emit the value of an array at an address; it is contiguous unless `strides` are given."""
    word = context.get_value_type(types.intp)
    item = stride = ir.Constant(word, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    count = ir.Constant(word, 1)
    for size in shape:
        count = builder.mul(count, size)
    if not strides:
        for size in reversed(shape):
            strides = [stride, *strides]
            stride = builder.mul(stride, size)
    tuples = types.UniTuple(types.intp, len(shape))
    pointer = context.get_value_type(types.CPointer(kind.dtype))
    parts = {
        "meminfo": context.get_constant_null(types.MemInfoPointer(types.voidptr)),
        "parent": context.get_constant_null(types.pyobject),
        "nitems": count,
        "itemsize": item,
        "data": builder.inttoptr(address, pointer),
        "shape": context.make_tuple(builder, tuples, shape),
        "strides": context.make_tuple(builder, tuples, strides),
    }
    model = context.data_model_manager[kind]
    array = ir.Constant(model.get_value_type(), ir.Undefined)
    for part, content in parts.items():
        array = builder.insert_value(array, content, model.get_field_position(part))
    return array


def calling(letters: str) -> Any:
    """See `compiler.calling`."""
    signature = numba_signature(letters)

    @intrinsic
    def call(typingctx: Any, at: Any, arguments: Any) -> Any:
        def codegen(context: Any, builder: Any, _: Any, args: Any) -> Any:
            nothing = signature.return_type == types.void
            answer = ir.VoidType() if nothing else context.get_value_type(signature.return_type)
            kind = ir.FunctionType(answer, [context.get_value_type(k) for k in signature.args])
            values = [builder.extract_value(args[1], i) for i in range(len(signature.args))]
            result = builder.call(builder.inttoptr(args[0], kind.as_pointer()), values)
            return context.get_dummy_value() if nothing else result

        return signature.return_type(types.int64, types.Tuple(signature.args)), codegen

    return call


def calling_with_arrays(count: int, answers: int) -> Any:
    """See `compiler.calling_with_arrays`."""

    @intrinsic
    def call(typingctx: Any, at: Any, k: Any, numbers: Any, d: Any, first: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            double, integer = ir.DoubleType(), ir.IntType(64)
            array = double.as_pointer()
            with builder.goto_entry_block():
                inputs, out = (builder.alloca(double, integer(size)) for size in (count, answers))
            beyond = args[3]
            if isinstance(signature.args[3], types.Array):
                beyond = context.make_array(signature.args[3])(context, builder, beyond).data
            beyond = builder.gep(builder.bitcast(beyond, array), [args[4]])
            for i in range(count):
                number = builder.extract_value(args[2], i)
                builder.store(number, builder.gep(inputs, [integer(i)], inbounds=True))
            kind = ir.FunctionType(ir.VoidType(), [integer, array, array, array])
            function = builder.inttoptr(args[0], kind.as_pointer())
            builder.call(function, [args[1], inputs, beyond, out])
            results = [
                builder.load(builder.gep(out, [integer(i)], inbounds=True)) for i in range(answers)
            ]
            return context.make_tuple(builder, signature.return_type, results)

        answer, numbers = (types.UniTuple(types.float64, size) for size in (answers, count))
        return answer(types.int64, types.int64, numbers, d, types.int64), codegen

    return call
