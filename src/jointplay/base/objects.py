"""Object code of compiled functions: kept in files, verified, and loaded without the compiler.

A file has a line of JSON (`Head`), the object as the compiler wrote it, and a hash of both. A file
that is damaged, of other sources, of other types or for another processor is ignored. Objects that
come with the package lie in its folder `FOLDER`; those compiled here in the first of these that can
be written to: NUMBA_CACHE_DIR, the package's own folder, the user's cache.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import platform
import stat
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from jointplay.base import locks, signals
from jointplay.base.errors import JointplayWarning
from jointplay.base.files import temporary

FOLDER = "objects"
"""Folder of the package for objects that came with it or were compiled where it lies."""

ENTRY = "jointplay_entry"
"""Symbol of the function through which an object is entered."""

NO_PLACE = (
    "compiled code cannot be kept, so every start compiles anew (half a minute or more): neither "
    "the package's folder nor the user's cache can be written to by this user alone; name a folder "
    "in NUMBA_CACHE_DIR"
)
"""Warning where no folder for compiled code can be written to."""

_PACKAGE = Path(__file__).parents[1]
_HASH_BYTES = hashlib.sha256().digest_size
_TELLS_S = 60.0
"""Wait after which the user is told of it [s]: twice the usual time to compile."""

_MOST_WAIT_S = 300.0
"""Longest wait for another process [s]: five times that. Objects are whole whoever writes last."""


@dataclass(frozen=True)
class Head:
    """Metadata of an object."""

    function: str
    """Qualified name of the function."""
    kinds: str
    """Types of its arguments."""
    fingerprint: str
    """Hash of the sources."""
    system: str
    """Architecture and operating system."""
    features: tuple[str, ...]
    """Features that the processor must have."""
    returns: str
    """Types of the results, a letter each."""


class Unresolved(Exception):
    """Code that needs numba's own libraries, which a process without numba does not have."""


class Target(NamedTuple):
    """Processor and system for which objects are compiled."""

    label: str
    """Label in file names."""
    system: str
    """Architecture and operating system."""
    features: tuple[str, ...]
    """Features that the processor must have."""
    triple: str
    """LLVM's name of the system."""
    cpu: str
    """LLVM's name of the processor."""
    flags: str
    """Processor features for LLVM."""


_LEVEL_3 = (
    *("avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf"),
    *("sse3", "ssse3", "sse4.1", "sse4.2", "xsave"),
)
_LINUX = "x86_64-unknown-linux-gnu"
RELEASED = (
    Target("x86-64-v3", "x86_64-linux", _LEVEL_3, _LINUX, "x86-64-v3", ""),
    Target("x86-64", "x86_64-linux", (), _LINUX, "x86-64", ""),
    Target("aarch64", "aarch64-linux", (), "aarch64-unknown-linux-gnu", "generic", ""),
    Target("macos-arm64", "arm64-darwin", (), "arm64-apple-macosx11.0.0", "apple-m1", ""),
)
"""Targets of which a wheel has objects. Those of the last two are cross-compiled and were never
run."""


@cache
def host() -> Target:
    """Target of this process: its processor and system."""
    from llvmlite import binding

    try:
        supported = binding.get_host_cpu_features()
        features = tuple(sorted(name for name, has in supported.items() if has))
        flags = supported.flatten()
    except RuntimeError:  # on some systems llvmlite does not know them
        features, flags = (), ""
    system, cpu = f"{platform.machine()}-{sys.platform}", binding.get_host_cpu_name()
    label = hashlib.sha256(repr((system, cpu, features)).encode()).hexdigest()[:8]
    return Target(label, system, features, binding.get_process_triple(), cpu, flags)


@cache
def folder() -> Path:
    """Folder for objects compiled here; a temporary one where no other can be written to."""
    # One folder per installation: in a common one each would discard the objects of the others.
    label = hashlib.sha256(str(_PACKAGE).encode()).hexdigest()[:12]
    named, home = os.environ.get("NUMBA_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME")
    with suppress(RuntimeError):  # no home
        home = home or str(
            Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
        )
    places = [Path(named) / f"jointplay_{label}"] if named else [_PACKAGE / FOLDER]
    if home and not named:
        places.append(Path(home) / "jointplay" / label)
    for place in places:
        with suppress(OSError):
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
            if os.access(place, os.W_OK) and _ours(place.stat()):
                return place
    warnings.warn(NO_PLACE, JointplayWarning, stacklevel=2)
    scratch = temporary("objects")
    atexit.register(scratch.cleanup)
    return Path(scratch.name)


def _ours(status: os.stat_result) -> bool:
    """Whether only this user, the system or the package's owner can have written a file."""
    if not hasattr(os, "geteuid"):  # Windows, where a user's folders are private
        return True
    user = os.geteuid()
    others = stat.S_IWOTH
    if status.st_gid != user:  # not the private group that many systems make for each user
        others |= stat.S_IWGRP
    owners = {user, 0, Path(__file__).stat().st_uid}
    return status.st_uid in owners and not status.st_mode & others


def _stem(function: str, kinds: str) -> str:
    """Beginning of the file names of a function's objects for these types."""
    plain = "".join(letter if letter.isalnum() or letter in "._" else "-" for letter in function)
    return f"{plain}-{hashlib.sha256(kinds.encode()).hexdigest()[:8]}"


def find(function: str, kinds: str, fingerprint: str) -> Iterator[tuple[Head, bytes]]:
    """Yield the objects of a function for these types that are whole and run here, best first."""
    stem = _stem(function, kinds)
    places = dict.fromkeys((folder(), _PACKAGE / FOLDER))
    labels = [host().label, *(target.label for target in RELEASED)]
    for place, label in product(filter(_safe, places), labels):
        stored = _read(place / f"{stem}.{label}.o")
        if stored is not None:
            head = stored[0]
            if (head.function, head.kinds, head.fingerprint) != (function, kinds, fingerprint):
                continue
            if head.system == host().system and {*host().features}.issuperset(head.features):
                yield stored


def loaded(function: str, kinds: str, fingerprint: str) -> tuple[int, str] | None:
    """Load the first object that the linker takes: its address, and its return types."""
    for head, code in find(function, kinds, fingerprint):
        with suppress(RuntimeError):
            return load(code), head.returns
    return None


def _safe(place: Path) -> bool:
    """Whether a folder exists that only trusted users can write to."""
    try:
        return _ours(place.stat())
    except OSError:
        return False


def _read(path: Path) -> tuple[Head, bytes] | None:
    """Read an object; None if it is missing, damaged, not to be trusted, or of another release."""
    try:
        with path.open("rb") as file:
            if not _ours(os.fstat(file.fileno())):
                return None
            content = file.read()
    except OSError:
        return None
    body, seal = content[:-_HASH_BYTES], content[-_HASH_BYTES:]
    if hashlib.sha256(body).digest() != seal:
        return None
    first, _, code = body.partition(b"\n")
    fields = json.loads(first)
    try:
        return Head(**fields | {"features": tuple(fields["features"])}), code
    except (KeyError, TypeError):  # of another release
        return None


def keep(head: Head, code: bytes, label: str) -> Path:
    """Write an object for a target of this label; readers see it whole or not at all."""
    body = json.dumps(asdict(head), sort_keys=True).encode() + b"\n" + code
    path = folder() / f"{_stem(head.function, head.kinds)}.{label}.o"
    part = path.with_suffix(f".{os.getpid()}.part")
    try:
        part.unlink(missing_ok=True)
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as file:
            file.write(body + hashlib.sha256(body).digest())
        part.replace(path)
    except OSError:  # a full disk: it is compiled again next time
        part.unlink(missing_ok=True)
    return path


def flat(signature: str) -> list[str]:
    """Types of the machine words that a signature's arguments make up, a letter each, in order."""
    letters: list[str] = []
    for kind in signature[signature.index("(") + 1 : -1].replace(")", "").split(","):
        kind = kind.rpartition("(")[2]
        if "." in kind:
            letters += "i" * (1 + 2 * int(kind.partition(".")[2][:-1]))
        elif kind:
            letters.append(kind)
    return letters


@contextmanager
def alone() -> Iterator[None]:
    """Let one process compile at a time, so that the others find its objects.

    They wait for at most `_MOST_WAIT_S`, as a suspended process holds the lock for ever.
    """
    try:
        descriptor = locks.opened(folder())
    except OSError:
        yield
        return
    try:
        if not locks.acquired(descriptor, _TELLS_S):
            signals.say(f"waiting for another process, which compiles for {str(folder())!r}")
            if not locks.acquired(descriptor, _MOST_WAIT_S - _TELLS_S):
                signals.say("the other process does not end: compiling without waiting for it")
        yield
    finally:
        os.close(descriptor)


_loaded: list[Any] = []
"""Loaded libraries, kept because they own their code."""


@cache
def _linker() -> Any:
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    # JITLink lays code and constants within reach of each other, and reports missing symbols.
    return binding.create_lljit_compiler(use_jit_link=True)


def load(code: bytes) -> int:
    """Load an object into this process; returns the address of its function."""
    from llvmlite import binding

    library = binding.JITLibraryBuilder().add_object_img(code).add_current_process()
    address = library.export_symbol(ENTRY).link(_linker(), f"jointplay_{len(_loaded)}")
    _loaded.append(address)
    return int(address[ENTRY])
