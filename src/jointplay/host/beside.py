"""Work done beside this process, by a copy of it, where the system makes such copies at once."""

from __future__ import annotations

import multiprocessing
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from jointplay.errors import JointplayError
from jointplay.host import workers

Made = TypeVar("Made")


@contextmanager
def beside(work: Callable[[], Made]) -> Iterator[Callable[[], Made]]:
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
    workers.begin()
    try:
        sent: tuple[bool, Any] = (False, work())
    except Exception as error:
        sent = (True, error)
    there.send(sent)
    there.close()
