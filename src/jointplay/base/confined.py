"""Confined processes: they deal with an untrusted file in place of this one, within limits.

A crash, full memory or an endless loop happens there. Within `closed` such a process can open
nothing more: no file, no connection.
"""

import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path

from jointplay.base.errors import JointplayError

try:
    import resource
except ImportError:  # Windows: the parent's time limit holds alone
    resource = None  # type: ignore[assignment]

WAITS = 20.0
"""Limit of elapsed time over that of processor time, so that a busy machine refuses no file."""

MEMORY_SHARE = 0.8
"""Part of this machine's memory that reading a file may take."""

_BEGIN = (
    "import sys; sys.path.append(sys.argv[1])\n"
    "from jointplay.base.confined import _serve; _serve(*sys.argv[2:])"
)


@contextmanager
def process(
    module: str, path: Path, time_s: float, room: float
) -> Iterator[subprocess.Popen[bytes]]:
    """Start a process that calls a module's `serve` with a path; it is killed when the block ends.

    Args:
        module: name of the module; nothing but it and its imports is loaded.
        path: the file to be examined.
        time_s: limit of processor time [s]; `WAITS` times that is the limit of elapsed time.
        room: limit of memory [bytes].

    Raises:
        JointplayError: it cannot be started.
    """
    root = str(Path(__file__).parents[2])
    limits = [str(math.ceil(time_s)), str(room)]
    try:
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", _BEGIN, root, module, str(path.absolute()), *limits],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except OSError as error:
        reason = error.strerror or error
        raise JointplayError(
            f"{str(path)!r} is not read, because the process that would check it cannot be "
            f"started: {reason}"
        ) from None
    clock = threading.Timer(WAITS * time_s, child.kill)
    clock.daemon = True
    clock.start()
    try:
        yield child
    finally:
        clock.cancel()
        child.kill()
        with suppress(BrokenPipeError):  # input that it has not read
            child.communicate()


def ended(child: subprocess.Popen[bytes], time_s: float) -> str:
    """Reason why a process that has ended, or is about to, failed."""
    status = child.wait()
    if status == -getattr(signal, "SIGXCPU", 0):
        return f"did not end within {time_s:.0f} s of processor time"
    if status in (-signal.SIGKILL, -getattr(signal, "SIGALRM", 0)):
        return f"did not end within {WAITS * time_s:.0f} s, or was killed from outside"
    return f"crashed ({status})"


def memory() -> float:
    """Memory of this machine [bytes]; infinite if it does not tell."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return math.inf


def _serve(module: str, path: str, time_s: str, room: str) -> None:
    """Main function of the process: set the limits, then call the module's `serve`."""
    if resource:
        resource.setrlimit(resource.RLIMIT_CPU, (int(time_s), int(time_s) + 5))
        signal.alarm(int(WAITS * int(time_s)) + 5)  # in case the parent has ended
        if math.isfinite(float(room)):
            with suppress(ValueError, OSError):  # a system that keeps no such limit
                resource.setrlimit(resource.RLIMIT_AS, (int(float(room)), int(float(room))))
    import_module(module).serve(path)


@contextmanager
def closed() -> Iterator[None]:
    """Within the block this process can open nothing: no file, folder, pipe or connection."""
    if not resource:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
