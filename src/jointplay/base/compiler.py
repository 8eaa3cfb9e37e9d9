"""Compilation of Python functions by numba, with object code that is kept on disk.

`compiled` decorates a function. At its first call from Python its object code is loaded from disk
(`objects`); if there is none, the function is compiled with everything that it calls into one
object (`linking`), which is kept. Only then is numba imported. With NUMBA_BOUNDSCHECK the same
functions are compiled by numba's plain `njit`.

`calling`, `pointer_to` and their likes let compiled code call functions and read records and arrays
by address.
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


def _on(name: str) -> bool:
    """Whether one of numba's settings is on; does not import numba."""
    if (numba := sys.modules.get("numba")) is not None:
        return bool(getattr(numba.config, name))
    return os.environ.get(f"NUMBA_{name}", "0") not in ("", "0")


class Native(NamedTuple):
    """A function in machine code."""

    address: int
    ctypes: Any
    """Callable of it for Python."""


_TYPES = {
    "v": None,
    "i": ctypes.c_int64,
    "d": ctypes.c_double,
    "p": ctypes.POINTER(ctypes.c_double),
}
"""Types that the letters of a signature stand for; p is a pointer to floats."""

targets: list[objects.Target] = []
"""Processors and systems to compile for, the first of which runs the code; empty: for this one."""

COMPILES = "compiling for this processor, once: some 15 s, more if it is busy"
"""Message to a user who waits for it (measured: docs/cost.md)."""

_turn = threading.RLock()
"""Lock that lets one thread compile at a time."""

_beside: tuple[int, Any, Compiled] | None = None
"""Id of this process, the process that compiles a function `ahead` for it, and that function."""


def _held(function: Compiled) -> bool:
    """Whether a process working `ahead` for this one holds the lock; `function` need not wait."""
    if _beside is None:
        return False
    parent, process, waiting = _beside
    return waiting is not function and parent == os.getpid() and process.is_alive()


class Compiled:
    """A function that is compiled at its first call.

    Called from Python it takes numbers, arrays, and named tuples of these, and returns nothing, a
    number, or a tuple of numbers.

    Attributes:
        py_func: the Python function.
        targetoptions: options of numba.
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
        """numba's dispatcher, used where it checks bounds: only its calls raise errors."""
        import numba

        make_lazy()
        return numba.njit(**self.targetoptions)(self.py_func)

    @cached_property
    def part(self) -> Any:
        """The function as part of an object, for its callers and for `linking.build`."""
        # While it types, numba formats thousands of errors, in colours, that nobody reads.
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
        """Callable for Python, for arguments of these types, and the types that it returns."""
        built = self._object(signature)
        if built is None:
            return None, ""
        address, returns = built
        kinds = objects.flat(signature)
        assert len(kinds) == count
        types = [ctypes.c_double if kind == "d" else ctypes.c_int64 for kind in kinds]
        return ctypes.PYFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, *types)(address), returns

    def native(self, signature: str) -> Native:
        """Compile the function for machine code, with a signature such as "d(d,i,p)" (`_TYPES`).

        Raises:
            Exception: of numba, if it cannot compile it.
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
        """Callable with the least overhead in Python; with bounds checked, one that raises."""
        if _on("BOUNDSCHECK"):
            return self.dispatcher  # type: ignore[no-any-return]
        return self.native(signature).ctypes  # type: ignore[no-any-return]

    @property
    def ready(self) -> bool:
        """Whether the function has been compiled or loaded in this process."""
        return bool(self._calls or self._natives)

    def ahead(self, signature: str) -> bool:
        """Begin to compile, unless code is kept; returns whether another process finishes it.

        LLVM, a third of the work, runs in a fork of this process, which ends when the code is kept,
        while this one does something else. Where there can be no fork, this process finishes it.
        """
        global _beside
        about = self._name, signature, self._fingerprint()

        def kept() -> bool:
            return any(objects.find(*about))

        with _turn:
            if self.ready or targets or not about[-1] or _on("BOUNDSCHECK") or kept():
                return False
            with progress.aside(), objects.alone():
                if kept():  # meanwhile, by another process
                    return False
                from jointplay.base import processes

                with streams.saying_if_long(COMPILES):
                    finish = self._prepare(signature, objects.host())
                process = processes.beside(finish)  # it inherits the lock by its descriptor
                if process is None:
                    finish()
                else:
                    _beside = os.getpid(), process, self
                return process is not None

    def _object(self, signature: str) -> tuple[int, str] | None:
        """Load or compile the object; address and return types (a letter each) of its function.

        None where numba's plain compiler is to be used.
        """
        if _on("BOUNDSCHECK"):
            return None
        with _turn:
            if loaded := self._loaded(signature):
                return loaded
            compiling = streams.saying_if_long(COMPILES)
            with progress.aside(), nullcontext() if _held(self) else objects.alone(), compiling:
                if loaded := self._loaded(signature):
                    return loaded
                wanted = targets or [objects.host()]
                built = [self._prepare(signature, target)() for target in wanted]
            head, code = built[0]
            return objects.load(code), head.returns

    def _loaded(self, signature: str) -> tuple[int, str] | None:
        fingerprint = self._fingerprint()
        return objects.loaded(self._name, signature, fingerprint) if fingerprint else None

    def _prepare(self, signature: str, target: objects.Target) -> Callable[[], tuple[Any, bytes]]:
        """Do the part of compilation that runs in Python; returns a function for LLVM's part.

        That function keeps the code, and returns it.
        """
        from jointplay.base import linking

        translate, returns = linking.build(self.part, signature, target)
        about = self._name, signature, self._fingerprint(), target.system, target.features, returns
        head = objects.Head(*about)

        def finish() -> tuple[objects.Head, bytes]:
            code = translate()
            if head.fingerprint:
                objects.keep(head, code, target.label)
            return head, code

        return finish

    def _fingerprint(self) -> str:
        """Hash of everything that the code depends on; empty if that is not known from files."""
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
    physics = Path(__file__).parents[1] / "physics"
    return [physics, *(physics / name for name in ("kernel", "geometry", "contact", "joints"))]


@cache
def sources() -> str:
    """Hash of all files of the package that may contain compiled code: `physics`, and the compiler.

    The version of numba does not count: code that it made stays right, and the objects of a wheel
    serve with every numba.
    """
    digest = hashlib.sha256()
    file = Path(__file__)
    files = [file, file.with_name("linking.py"), file.with_name("intrinsics.py")]
    for path in (*files, *(path for part in _parts() for path in sorted(part.glob("*.py")))):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _take(value: Any, values: list[Any]) -> str:
    """Append an argument's machine words to `values`; returns its type in the signature."""
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
    """Decorate a function to be compiled; with NUMBA_DISABLE_JIT it is left as it is.

    Options are numba's.
    """
    if _on("DISABLE_JIT"):
        return function if function is not None else lambda decorated: decorated
    if function is None:
        return lambda decorated: Compiled(decorated, **options)
    return Compiled(function, **options)


contracted = compiled(fastmath={"contract"})
"""`compiled` with fused multiply-add allowed: product and sum are rounded once instead of twice."""

reordered = compiled(fastmath={"reassoc"})
"""`compiled` with sums in any order allowed, so that several terms are added at a time."""


class Lazy:
    """An intrinsic for compiled code, made by `intrinsics` when something is compiled.

    Without arguments it is the one of that name, else what the function of that name makes.
    """

    def __init__(self, name: str, *arguments: Any) -> None:
        self._name, self._arguments = name, arguments
        _lazy.append(self)

    @cached_property
    def function(self) -> Any:
        """numba's intrinsic."""
        from jointplay.base import intrinsics

        made = getattr(intrinsics, self._name)
        return made(*self._arguments) if self._arguments else made

    def __call__(self, *arguments: Any) -> Any:
        """Call the intrinsic, for type checkers: only compiled code can."""
        return self.function(*arguments)

    @property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target

        return cpu_target.typing_context.resolve_value_type(self.function)


_lazy: list[Lazy] = []


def make_lazy() -> None:
    """Make all intrinsics declared so far, before a function that uses them is typed."""
    while _lazy:
        _ = _lazy.pop().function


# Work with addresses, for compiled code only.


def pointer_to(element: Any) -> Lazy:
    """Function that turns an address into a pointer to an `element`, a numpy type."""
    return Lazy("pointer_to", element)


pointer = pointer_to(np.float64)
"""Function that turns an address into a pointer to floats."""

place_of = Lazy("place_of")
"""Address of a record, as a whole number."""

address_of = Lazy("address_of")
"""Pointer to the first element of an array of floats."""

carray = Lazy("carray")
"""numba's `carray`: the array of a given shape at a pointer."""


def open_arrays(
    record: np.dtype, arrays: Mapping[str, tuple[np.dtype, Sequence[tuple[int, str | None]]]]
) -> None:
    """Have compiled code see an array where a field of a record holds the array's address.

    Args:
        record: type of the record.
        arrays: by field, the type of the elements, and for each dimension a factor and the field
            that it multiplies, or None.
    """
    Lazy("open_arrays", record, arrays)


def calling(signature: str) -> Lazy:
    """Function of an address and a tuple of arguments, which calls the function at the address.

    Its signature is one of `Compiled.native`.
    """
    return Lazy("calling", signature)


def calling_with_arrays(arguments: int, answers: int) -> Lazy:
    """Function `call(at, k, numbers, d, first)`, which calls the function at the address `at`.

    That function gets k, an array with the numbers of a tuple, the array or pointer d from index
    `first` on, and an array for its results, which `call` returns as a tuple.
    """
    return Lazy("calling_with_arrays", arguments, answers)
