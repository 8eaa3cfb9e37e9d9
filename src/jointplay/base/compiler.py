"""Functions that are compiled: `compiled` has those that Python or compiled code calls.

What is called for the first time is taken from kept object code (`objects`), or compiled with all
that it calls into one object (`linking`) and kept; numba is imported for that alone. Where it
checks bounds, the same functions are compiled by its plain `njit`.

`calling` and `pointer_to` make calls and pointers of addresses.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jointplay.base import objects, progress, streams

_PACKAGE = Path(__file__).parents[1]


def _on(name: str) -> bool:
    """Whether one of numba's settings is on, which is not imported for that."""
    if (numba := sys.modules.get("numba")) is not None:
        return bool(getattr(numba.config, name))
    return os.environ.get(f"NUMBA_{name}", "0") not in ("", "0")


class Native(NamedTuple):
    """A function of the machine."""

    address: int
    ctypes: Any
    """It, to be called from Python."""


_TYPES = {
    "v": None,
    "i": ctypes.c_int64,
    "d": ctypes.c_double,
    "p": ctypes.POINTER(ctypes.c_double),
}
"""What letters of a signature stand for; p is an array of numbers."""

targets: list[objects.Target] = []
"""What is compiled is compiled for these, of which the first is run; none: for this processor."""

COMPILES = "compiling for this processor, once: some 15 s, more if it is busy"
"""What a user is told who waits for it (measured: docs/cost.md)."""

_turn = threading.RLock()
"""Of the threads, one compiles at a time."""

_beside: tuple[int, Any, Compiled] | None = None
"""This process, the one that it has end a function `ahead`, and that function."""


def _held(function: Compiled) -> bool:
    """Whether the lock is held for this process, which need not wait to compile `function`."""
    if _beside is None:
        return False
    parent, process, waiting = _beside
    return waiting is not function and parent == os.getpid() and process.is_alive()


class Compiled:
    """A function that is compiled when it is first called for.

    Called from Python it takes numbers, arrays, and named tuples of these, and returns nothing, a
    number, or a tuple of numbers.

    Attributes:
        py_func: the function itself.
        targetoptions: numba's.
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        self.py_func = function
        self.targetoptions = {"error_model": "numpy", **options}
        self.__doc__, self.__name__ = function.__doc__, function.__name__
        self.__module__, self.__wrapped__ = function.__module__, function
        self._name = f"{self.__module__}.{function.__qualname__}"
        self._calls: dict[str, tuple[Any, str]] = {}
        self._natives: dict[str, Native] = {}

    @cached_property
    def dispatcher(self) -> Any:
        """numba's own, where it checks bounds: errors are raised by its calls only."""
        import numba

        make_lazy()
        return numba.njit(**self.targetoptions)(self.py_func)

    @cached_property
    def part(self) -> Any:
        """What it is for those that call it, and for `linking.build`."""
        # numba writes thousands of errors while it types, in colours, and nobody reads them.
        os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
        from jointplay.base import linking

        make_lazy()
        return linking.Part(self, self.targetoptions)

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_ if _on("BOUNDSCHECK") else self.part.kind

    def __call__(self, *arguments: Any) -> Any:
        values: list[Any] = []
        signature = f"({','.join([_take(argument, values) for argument in arguments])})"
        call = self._calls.get(signature)
        if call is None:
            call = self._calls[signature] = self._callable(signature, len(values))
        function, returns = call
        if function is None:
            return self.dispatcher(*arguments)
        room = (ctypes.c_double * len(returns))()
        if function(ctypes.addressof(room), *values):
            raise MemoryError(self.__name__)
        if "i" in returns:
            integers = (ctypes.c_int64 * len(returns)).from_buffer(room)
            results = tuple((integers if x == "i" else room)[k] for k, x in enumerate(returns))
        else:
            results = tuple(room)
        return results if len(returns) > 1 else results[0] if results else None

    def _callable(self, signature: str, count: int) -> tuple[Any, str]:
        built = self._object(signature)
        if built is None:
            return None, ""
        address, returns = built
        kinds = objects.flat(signature)
        assert len(kinds) == count
        types = [ctypes.c_double if kind == "d" else ctypes.c_int64 for kind in kinds]
        return ctypes.PYFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, *types)(address), returns

    def native(self, signature: str) -> Native:
        """The function as machine code calls it, such as "d(d,i,p)": see `_TYPES`.

        Raises:
            Exception: of numba, which cannot compile it.
        """
        with _turn:
            if signature not in self._natives:
                try:
                    built = self._object(signature)
                except objects.Unresolved:
                    built = None
                if built is None:
                    import numba

                    from jointplay.base.intrinsics import numba_signature

                    plain = numba.cfunc(numba_signature(signature), error_model="numpy")
                    wrapper = plain(self.py_func)
                    self._natives[signature] = Native(wrapper.address, wrapper.ctypes)
                    self._wrapper = wrapper
                else:
                    kinds: list[Any] = [_TYPES[kind] for kind in objects.flat(signature)]
                    call = ctypes.PYFUNCTYPE(_TYPES[signature[0]], *kinds)(built[0])
                    self._natives[signature] = Native(built[0], call)
            return self._natives[signature]

    def caller(self, signature: str) -> Callable[..., Any]:
        """What Python calls fastest; the plain compiler's raises errors."""
        if _on("BOUNDSCHECK"):
            return self.dispatcher  # type: ignore[no-any-return]
        return self.native(signature).ctypes  # type: ignore[no-any-return]

    @property
    def ready(self) -> bool:
        """Whether it has been compiled or loaded in this process."""
        return bool(self._calls or self._natives)

    def ahead(self, signature: str) -> bool:
        """Begin to compile it, if it is not kept; returns whether another process goes on with it.

        That is a copy of this one, which ends when the code is kept: LLVM takes a third of the
        time, and this process can do something else. Where there is none, this one does it.
        """
        global _beside
        about = self._name, signature, self._fingerprint()

        def needless() -> bool:
            return any(objects.find(*about))

        with _turn:
            if self.ready or targets or not about[-1] or _on("BOUNDSCHECK") or needless():
                return False
            with progress.aside(), objects.alone():
                if needless():
                    return False
                from jointplay.base import processes

                with streams.saying_if_long(COMPILES):
                    end = self._begun(signature, objects.host())
                process = processes.beside(end)  # it holds the lock, too, by its descriptor
                if process is None:
                    end()
                else:
                    _beside = os.getpid(), process, self
                return process is not None

    def _object(self, signature: str) -> tuple[int, str] | None:
        """Address and returns (a letter each) of the object's function; None: compile plainly."""
        if _on("BOUNDSCHECK"):
            return None
        with _turn:
            if loaded := self._loaded(signature):
                return loaded
            compiling = streams.saying_if_long(COMPILES)
            with progress.aside(), nullcontext() if _held(self) else objects.alone(), compiling:
                if loaded := self._loaded(signature):
                    return loaded
                built = [self._begun(signature, target)() for target in targets or [objects.host()]]
            head, code = built[0]
            return objects.load(code, head.symbol), head.returns

    def _loaded(self, signature: str) -> tuple[int, str] | None:
        fingerprint = self._fingerprint()
        return objects.loaded(self._name, signature, fingerprint) if fingerprint else None

    def _begun(self, signature: str, target: objects.Target) -> Callable[[], tuple[Any, bytes]]:
        """Compile it as far as Python does; gives what does the rest, and keeps it."""
        from jointplay.base import linking

        translate, returns = linking.build(self.part, signature, target)
        about = self._name, signature, self._fingerprint(), target.system, target.features, returns
        head = objects.Head(*about)

        def end() -> tuple[objects.Head, bytes]:
            code = translate()
            if head.fingerprint:
                objects.keep(head, code, target.label)
            return head, code

        return end

    def _fingerprint(self) -> str:
        """Hash of all that goes into its code; none of what is not known by its file."""
        import marshal

        code = self.py_func.__code__
        file = Path(code.co_filename)
        if not file.is_file():
            return ""
        digest = hashlib.sha256(sources().encode())
        if file.parent not in _parts():
            digest.update(file.read_bytes())
        if not self.__module__.startswith("jointplay."):
            digest.update(marshal.dumps(code))
            for cell in self.py_func.__closure__ or ():
                content = cell.cell_contents
                if not isinstance(content, int | float | str | tuple):
                    return ""
                digest.update(repr(content).encode())
        return digest.hexdigest()


def _parts() -> list[Path]:
    physics = _PACKAGE / "physics"
    return [physics, *(physics / name for name in ("kernel", "geometry", "contact", "joints"))]


@cache
def sources() -> str:
    """Hash of the files in which code may be that is compiled.

    That are all of `physics`, and those of this package that make code. Not the compiler's version:
    what it made stays right, and a wheel's objects serve with every numba.
    """
    digest = hashlib.sha256()
    file = Path(__file__)
    files = [file, file.with_name("linking.py"), file.with_name("intrinsics.py")]
    for path in (*files, *(path for part in _parts() for path in sorted(part.glob("*.py")))):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _take(value: Any, values: list[Any]) -> str:
    """Kind of an argument, whose numbers are added to those that the machine gets."""
    if isinstance(value, np.ndarray):
        values.append(value.__array_interface__["data"][0])
        values.extend(value.shape)
        values.extend(value.strides)
        layout = "C" if value.flags.c_contiguous else "A"
        return f"{value.dtype.str[1:]}.{value.ndim}{layout}"
    if isinstance(value, float | np.floating):
        values.append(float(value))
        return "d"
    if isinstance(value, tuple):
        kind = type(value)
        kinds = ",".join([_take(item, values) for item in value])
        return f"{kind.__module__}:{kind.__qualname__}({kinds})"
    values.append(int(value))
    return "i"


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Decorator of functions that are compiled; with NUMBA_DISABLE_JIT they are what they are.

    Options are numba's.
    """
    if _on("DISABLE_JIT"):
        return function if function is not None else lambda decorated: decorated
    if function is None:
        return lambda decorated: Compiled(decorated, **options)
    return Compiled(function, **options)


contracted = compiled(fastmath={"contract"})
"""The same of those whose products and sums may be rounded once instead of twice."""

reordered = compiled(fastmath={"reassoc"})
"""The same of sums that are taken in any order: several terms at a time."""


class Lazy:
    """What compiled code takes from `intrinsics`, made when something is compiled."""

    def __init__(self, name: str, *arguments: Any) -> None:
        self._name, self._arguments = name, arguments
        _lazy.append(self)

    @cached_property
    def function(self) -> Any:
        from jointplay.base import intrinsics

        return getattr(intrinsics, self._name)(*self._arguments)

    def __call__(self, *arguments: Any) -> Any:
        """Call it, which compiled code alone can do."""
        return self.function(*arguments)

    @property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target

        return cpu_target.typing_context.resolve_value_type(self.function)


_lazy: list[Lazy] = []


def make_lazy() -> None:
    """Make what compiled code takes from numba: before a function is typed that uses it."""
    while _lazy:
        _ = _lazy.pop().function


# Addresses: compiled code only can do what follows.


def pointer_to(element: Any) -> Lazy:
    """Function that takes an address for a pointer to an `element`, a type of numpy."""
    return Lazy("pointer_to", element)


pointer = pointer_to(np.float64)
"""An address taken for a pointer to numbers."""

place_of = Lazy("place_of")
"""Where a record lies: its address as a whole number."""

address_of = Lazy("address_of")
"""Pointer to the first element of an array of floats within a record."""

carray = Lazy("carray")
"""numba's array at a pointer, of a shape."""


def open_arrays(
    record: np.dtype, arrays: Mapping[str, tuple[np.dtype, Sequence[tuple[int, str | None]]]]
) -> None:
    """Let compiled code find arrays where fields of a record hold the arrays' addresses.

    Args:
        record: type of the record.
        arrays: by field, the type of the elements and the shape: of each dimension a factor, and
            the field that it multiplies, or None.
    """
    Lazy("open_arrays", record, arrays)


def calling(signature: str) -> Lazy:
    """Function of an address and a tuple of arguments: it calls what is compiled there.

    The signature is one of `Compiled.native`.
    """
    return Lazy("calling", signature)


def calling_with_arrays(arguments: int, answers: int) -> Lazy:
    """Function `call(at, k, numbers, d, first)`, which calls what is compiled at an address.

    That gets k, the numbers of a tuple as an array, the array or pointer d from index `first` on,
    and an array for what it answers, which is returned as a tuple.
    """
    return Lazy("calling_with_arrays", arguments, answers)
