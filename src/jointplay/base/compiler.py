"""How functions are compiled: what compiled modules take from numba, beside its types.

`njit` is for functions that Python calls, `internal` for those that only compiled code calls;
`calling` and `pointer_to` make calls and pointers of addresses. What of this reaches inside numba
is in `numba_inside`; where numba has other internals, the same code is compiled without it.
"""

import atexit
import hashlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr

from jointplay.base.files import temporary

NO_PLACE = (
    "compiled code cannot be kept, so every start compiles anew (half a minute): neither the "
    "package's folder nor the user's cache can be written to; name a folder in NUMBA_CACHE_DIR"
)
"""What a user without a place for the cache is told."""

MOVED = (
    "numba {} has internals that this package does not know ({}): results are the same, but "
    "compiled code cannot be kept, so every start compiles anew (a minute); install a version of "
    "numba that jointplay's requirements name"
)
"""What a user with another numba is told."""


def ensure() -> None:
    """Have a place for compiled functions: numba refuses to compile for a cache without one.

    Where nothing can be written to it is a folder of this process alone.
    """
    if numba.config.CACHE_DIR:
        return
    try:
        numba.njit(cache=True)(ensure)
    except RuntimeError:  # "no locator available"
        folder = temporary("numba")
        atexit.register(folder.cleanup)
        numba.config.CACHE_DIR = folder.name
        warnings.warn(NO_PLACE, RuntimeWarning, stacklevel=2)


def _insides() -> Any:
    """The module that uses numba's internals; None, with a warning, where those are others."""
    try:
        from jointplay.base import numba_inside
    except (ImportError, AttributeError) as error:
        warnings.warn(MOVED.format(numba.__version__, error), RuntimeWarning, stacklevel=2)
        return None
    return numba_inside


ensure()
_inside = _insides()

NumbaError: type[Exception] = _inside.NumbaError if _inside else Exception
"""What is raised of functions that cannot be compiled."""


def njit(**options: Any) -> Callable[..., Any]:
    """numba's decorator for functions that Python calls."""
    if _inside is None:  # what is kept could not be stamped, and would outlive its sources
        return numba.njit(**options | {"cache": False})  # type: ignore[no-any-return]
    if numba.config.DISABLE_JIT:
        return numba.njit(**options)  # type: ignore[no-any-return]
    return lambda function: _inside.sealed(numba.njit(**options)(function))


def cfunc(signature: Any, **options: Any) -> Callable[..., Any]:
    """numba's decorator for functions that are called by their address; compiled code is kept.

    Raises:
        RuntimeError: of the function: there is no place to keep it.
    """
    if _inside is None:
        return numba.cfunc(signature, **options)  # type: ignore[no-any-return]
    return _inside.sealed_cfunc(signature, **options)  # type: ignore[no-any-return]


_part = _inside.part if _inside else partial(njit, error_model="numpy")

internal = _part()
"""Decorator of functions that only compiled code calls."""

contracted = _part(fastmath={"contract"})
"""The same of those whose products and sums may be rounded once instead of twice."""


def fingerprint(sources: Iterable[Path]) -> str:
    """Hash of what these files say."""
    digest = hashlib.sha256()
    for source in sources:
        digest.update(source.read_bytes())
    return digest.hexdigest()


def stamp(dispatcher: Any, sources: Iterable[Path]) -> None:
    """Let the cache of a compiled function be valid for exactly these sources.

    numba compiles again when the file of the function changed - that file only, not those of the
    functions that it calls. With NUMBA_DISABLE_JIT nothing is compiled and nothing kept.
    """
    if _inside is not None and not numba.config.DISABLE_JIT:
        _inside.stamp(dispatcher, fingerprint(sources))


# Addresses: compiled code only can do what follows.

NUMBERS = types.CPointer(types.float64)
"""Type of a pointer to numbers."""


def pointer_to(element: Any) -> Any:
    """Function that takes an address for a pointer to an `element`."""

    @intrinsic
    def reinterpret(typingctx: Any, at: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return types.CPointer(element)(types.int64), codegen

    return reinterpret


pointer = pointer_to(types.float64)
"""An address taken for a pointer to numbers."""


@intrinsic
def address_of(typingctx: Any, array: Any) -> Any:
    """Pointer to the first element of an array of floats within a record."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.bitcast(value.data, context.get_value_type(NUMBERS))

    return NUMBERS(array), codegen


def open_arrays(
    record: Any, arrays: Mapping[str, tuple[Any, Sequence[tuple[int, str | None]]]]
) -> None:
    """Let compiled code find arrays where fields of a record hold the arrays' addresses.

    Args:
        record: numba's type of the record.
        arrays: by field, the type of the elements and the shape: of each dimension a factor, and
            the field that it multiplies, or None.
    """
    opened = {
        name: types.Array(element, len(shape), "C") for name, (element, shape) in arrays.items()
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
    """What numba calls to make code that opens an array."""

    def whole(builder: Any, value: Any, field: str) -> Any:
        kind = ir.IntType(64)
        there = builder.bitcast(value, ir.IntType(8).as_pointer())
        there = builder.gep(there, [ir.Constant(kind, record.offset(field))])
        return builder.load(builder.bitcast(there, kind.as_pointer()))

    def lowered(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        word = context.get_value_type(types.intp)
        sizes = []
        for factor, field in shape:
            size = ir.Constant(word, factor)
            sizes.append(size if field is None else builder.mul(size, whole(builder, value, field)))
        stride = ir.Constant(word, context.get_abi_sizeof(context.get_data_type(array.dtype)))
        made = context.make_array(array)(context, builder)
        made.itemsize = stride
        strides: list[Any] = []
        for size in reversed(sizes):
            strides.insert(0, stride)
            stride = builder.mul(stride, size)
        count = sizes[0]
        for size in sizes[1:]:
            count = builder.mul(count, size)
        made.nitems = count
        made.shape = context.make_tuple(builder, types.UniTuple(types.intp, len(sizes)), sizes)
        made.strides = context.make_tuple(builder, types.UniTuple(types.intp, len(sizes)), strides)
        pointer = context.get_value_type(types.CPointer(array.dtype))
        made.data = builder.inttoptr(whole(builder, value, name), pointer)
        made.meminfo = context.get_constant_null(types.MemInfoPointer(types.voidptr))
        made.parent = context.get_constant_null(types.pyobject)
        return made._getvalue()

    return lowered


def calling(signature: Any) -> Any:
    """Function of an address and a tuple of arguments: it calls what is compiled there."""

    @intrinsic
    def call(typingctx: Any, at: Any, arguments: Any) -> Any:
        def codegen(context: Any, builder: Any, _: Any, args: Any) -> Any:
            nothing = signature.return_type == types.void
            answer = ir.VoidType() if nothing else context.get_value_type(signature.return_type)
            kind = ir.FunctionType(answer, [context.get_value_type(one) for one in signature.args])
            values = [builder.extract_value(args[1], i) for i in range(len(signature.args))]
            made = builder.call(builder.inttoptr(args[0], kind.as_pointer()), values)
            return context.get_dummy_value() if nothing else made

        return signature.return_type(types.int64, types.Tuple(signature.args)), codegen

    return call


def calling_with_arrays(given: int, answers: int) -> Any:
    """Function `call(at, k, numbers, d, first)`, which calls what is compiled at an address.

    That gets k, the numbers of a tuple as an array, the array or pointer d from index `first` on,
    and an array for what it answers, which is returned as a tuple.
    """

    @intrinsic
    def call(typingctx: Any, at: Any, k: Any, numbers: Any, d: Any, first: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            double, whole = ir.DoubleType(), ir.IntType(64)
            array = double.as_pointer()
            with builder.goto_entry_block():
                there, out = (builder.alloca(double, whole(size)) for size in (given, answers))
            beyond = args[3]
            if isinstance(signature.args[3], types.Array):
                beyond = context.make_array(signature.args[3])(context, builder, beyond).data
            beyond = builder.gep(builder.bitcast(beyond, array), [args[4]])
            for i in range(given):
                number = builder.extract_value(args[2], i)
                builder.store(number, builder.gep(there, [whole(i)], inbounds=True))
            kind = ir.FunctionType(ir.VoidType(), [whole, array, array, array])
            function = builder.inttoptr(args[0], kind.as_pointer())
            builder.call(function, [args[1], there, beyond, out])
            found = [
                builder.load(builder.gep(out, [whole(i)], inbounds=True)) for i in range(answers)
            ]
            return context.make_tuple(builder, signature.return_type, found)

        answer, numbers = (types.UniTuple(types.float64, size) for size in (answers, given))
        return answer(types.int64, types.int64, numbers, d, types.int64), codegen

    return call
