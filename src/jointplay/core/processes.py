"""Processes that work for this one, and end with it however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from jointplay.core.errors import JointplayError

# Processes that work for this one, and end with it however it ends.
#
# A pool's processes wait for work on a pipe that they keep open for each other: if the parent is
# killed, they wait for ever. So each watches its parent; on Linux the kernel tells it at once.


_WATCH_S = 1.0
"""Interval at which a process looks whether its parent is there."""

_PR_SET_PDEATHSIG = 1


def begin(orphaned: Callable[[], None] | None = None) -> None:
    """Set up a process of a pool: its `initializer`, or called by it.

    Ctrl-C and a closed terminal are the parent's, who ends its children.

    Args:
        orphaned: what to do, in a thread, before the process ends because its parent has.
    """
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if orphaned is None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        end_with_parent(signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
    threading.Thread(target=_watch, args=(orphaned, os.getppid()), daemon=True).start()


def end_with_parent(number: int) -> None:
    """Have Linux send this process a signal when its parent ends."""
    if sys.platform != "linux":
        return
    import ctypes

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number, 0, 0, 0)


def _watch(orphaned: Callable[[], None] | None, parent: int) -> None:
    """Wait for the parent to end, on any system; then end too."""
    from multiprocessing.connection import wait

    known = multiprocessing.parent_process()
    while os.getppid() == parent and (known is None or known.is_alive()):
        if known is None:
            threading.Event().wait(_WATCH_S)
        else:
            wait([known.sentinel], _WATCH_S)
    try:
        if orphaned is not None:
            orphaned()
    finally:
        os._exit(1)


def processes(pool: ProcessPoolExecutor) -> list[BaseProcess]:
    """The processes of a pool, which forgets them when it is shut down."""
    return list((pool._processes or {}).values())


def abandon(pool: ProcessPoolExecutor) -> None:
    """End a pool and its processes at once; nothing of what they do is kept."""
    ending = processes(pool)
    pool.shutdown(wait=False, cancel_futures=True)
    for process in ending:
        process.kill()


@contextmanager
def pool(
    jobs: int,
    kept: str,
    initializer: Callable[..., None] = begin,
    arguments: tuple[Any, ...] = (),
    wind_up: Callable[[ProcessPoolExecutor], None] = abandon,
) -> Iterator[ProcessPoolExecutor]:
    """Processes for the time of the block; what goes wrong in it ends them.

    Args:
        jobs: how many.
        kept: what is left of the work if a process is killed, in words.
        initializer: sets a process up, with `arguments`.
        arguments: see `initializer`.
        wind_up: ends the processes after an error or Ctrl-C in the block.

    Raises:
        JointplayError: a process was ended from outside.
    """
    executor = ProcessPoolExecutor(jobs, initializer=initializer, initargs=arguments)
    try:
        yield executor
    except BrokenExecutor:
        wind_up(executor)
        raise JointplayError(
            f"a process was ended from outside (too little memory?); {kept}"
        ) from None
    except BaseException:
        wind_up(executor)
        raise
    else:
        executor.shutdown()


# Work done beside this process, by a copy of it, where the system makes such copies at once.


Made = TypeVar("Made")


@contextmanager
def in_parallel(work: Callable[[], Made]) -> Iterator[Callable[[], Made]]:
    """Have `work` done while the block runs; gives a function that waits for what it returns.

    A forked process has all that this one has, and sends back what it made. Where processes cannot
    be forked (or there is one core), the work is done here, when the function is called.

    Args:
        work: is done once; what it returns or raises can be pickled.

    Raises:
        JointplayError: by the function: the process was ended from outside.
    """
    if not _forks():
        yield work
        return
    context: Any = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_do, args=(work, there), daemon=True)
    with warnings.catch_warnings():  # Python 3.12: libraries have threads, none at work here
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    there.close()

    def made() -> Made:
        try:
            failed, value = here.recv()
        except EOFError:
            raise JointplayError("a process was ended from outside (too little memory?)") from None
        if failed:
            raise value
        return value  # type: ignore[no-any-return]

    try:
        yield made
    finally:
        here.close()
        if process.is_alive():
            process.kill()
        process.join()


def _forks() -> bool:
    """Whether a copy of this process is safe, and has a core of its own."""
    if sys.platform != "linux" or multiprocessing.get_start_method() != "fork":
        return False
    return len(os.sched_getaffinity(0)) > 1 and not multiprocessing.current_process().daemon


def _do(work: Callable[[], Made], there: Any) -> None:
    """What the other process does."""
    begin()
    try:
        sent: tuple[bool, Any] = (False, work())
    except Exception as error:
        sent = (True, error)
    there.send(sent)
    there.close()
