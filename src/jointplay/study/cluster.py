"""Workers of a Dask cluster that run the cases of a study."""

from __future__ import annotations

import gc
import logging
import queue
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import islice
from typing import Any, Generic

from jointplay.base.errors import JointplayError, one_line
from jointplay.base.imports import extra
from jointplay.simulation.result.stored import versions
from jointplay.study.study import Case, Value

BATCH_S, MOST_BATCH = 2.0, 256
"""Work of one task: the scheduler's own milliseconds are then nothing [s]; and its items."""
AHEAD = 3
"""Tasks for each thread of a worker that the scheduler has at a time."""
CONNECT_S = 15
"""How long a scheduler, and then its first worker, is waited for [s]."""
TRIES = 5
"""Clients begun: on a busy machine the thread of one may not start within its 10 s."""
_LOGGERS = (
    "distributed",
    *(f"distributed.{part}" for part in ("client", "core", "comm", "batched", "utils", "worker")),
    "tornado.application",
    "asyncio",
)


def version() -> str:
    """The version of jointplay where this runs."""
    return versions()["jointplay"]


def _timed(
    work: Callable[[Case], Value], items: Sequence[tuple[Any, Case]]
) -> list[tuple[float, Any, Value]]:
    """Do the work for some items: processor time [s], key and what came of each."""
    results = []
    for key, item in items:
        began = time.process_time()
        value = work(item)
        results.append((time.process_time() - began, key, value))
    return results


class ClusterWorkers(Generic[Case, Value]):
    """Workers of a Dask cluster; otherwise as a `Pool`.

    Args:
        work: done for each item; what it needs travels with it: they need not share a file system.
        address: of the scheduler, such as ``tcp://10.0.0.1:8786``.
        lost: what came of an item that ends the workers that it is given to.

    Raises:
        JointplayError: dask.distributed is not installed, no scheduler answers, it has no workers,
            or one of them has another version of jointplay.
    """

    def __init__(
        self, work: Callable[[Case], Value], address: str, lost: Callable[[Case], Value]
    ) -> None:
        with extra("cluster", "dask.distributed"):
            from distributed import Client
        for name in _LOGGERS:  # what they log is said here in a line, or is of no consequence
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        self.work, self.address, self.lost = work, address, lost
        self.client: Any = self._connect(Client)
        try:
            self._check()
        except BaseException:
            self.close()
            raise
        self._seconds, self._finished = 0.0, 0

    def _connect(self, client: Any) -> Any:
        """A client of the scheduler.

        distributed asserts that the thread of a client's event loop has started. One that starts
        later than that idles, without a connection, and ends with the program.
        """
        reason = ""
        for _ in range(TRIES):
            try:
                return client(self.address, timeout=CONNECT_S, set_as_default=False)
            except AssertionError:
                gc.collect()  # see below
                reason = f"its client could not start, {TRIES} times: the machine is too busy"
            except (OSError, ValueError, TypeError, ImportError) as error:
                reason = one_line(error) or type(error).__name__
                break
        # What is left of clients that failed closes itself when it is collected; within the start
        # of the next one, which holds the same lock, it would wait for ever.
        gc.collect()
        raise JointplayError(f"no Dask scheduler answers at {self.address!r}: {reason}")

    def _check(self) -> None:
        deadline = time.monotonic() + CONNECT_S
        while not (threads := self.client.nthreads()):
            if time.monotonic() > deadline:
                raise JointplayError(f"the scheduler at {self.address!r} has no workers")
            time.sleep(0.1)
        self.number = len(threads)
        try:
            answers = self.client.run(version, on_error="return")
        except Exception as error:  # noqa: BLE001
            text = f"the workers of {self.address!r} do not answer: {error}"
            raise JointplayError(text) from None
        for worker, answer in answers.items():
            if isinstance(answer, BaseException):
                raise JointplayError(f"worker {worker} cannot use jointplay: {answer}")
            if answer != version():
                raise JointplayError(
                    f"worker {worker} has jointplay {answer}, here is {version()}; install the "
                    "same version everywhere"
                )

    def run(self, items: Iterable[tuple[Any, Case]]) -> Iterator[tuple[Any, Value]]:
        """Keys of items and what came of them, as they come.

        A worker that dies is of no consequence: the scheduler gives its items to others.

        Raises:
            JointplayError: the scheduler was lost.
        """
        waiting = iter(items)
        pending: dict[Any, tuple[Any, Sequence[tuple[Any, Case]]]] = {}
        ended: queue.SimpleQueue[Any] = queue.SimpleQueue()

        def submit(batch: Sequence[tuple[Any, Case]]) -> None:
            future = self.client.submit(_timed, self.work, batch, pure=False)
            pending[future.key] = future, batch
            future.add_done_callback(lambda f: ended.put(f.key))

        def feed() -> None:
            while len(pending) < AHEAD * max(self.number, 1):
                batch = list(islice(waiting, self._batch()))
                if not batch:
                    return
                submit(batch)

        feed()
        while pending:
            try:
                key = ended.get(timeout=1.0)
            except queue.Empty:
                if self.client.status != "running":  # it is looking for its scheduler, in vain
                    raise self._lost() from None
                continue
            yield from self._outcomes(*pending.pop(key), submit)
            feed()

    def _lost(self, error: BaseException | None = None) -> JointplayError:
        reason = f": {type(error).__name__}: {one_line(error)}" if error is not None else ""
        return JointplayError(f"the scheduler at {self.address!r} was lost{reason}")

    def _outcomes(
        self, future: Any, batch: Sequence[tuple[Any, Case]], submit: Any
    ) -> Iterator[tuple[Any, Value]]:
        """What a task gave; one that took its workers with it is taken apart."""
        if future.status == "finished":
            try:
                outcomes = future.result()
            except Exception as error:
                raise self._lost(error) from error
            future.release()
            for seconds, key, value in outcomes:
                self._finished += 1
                self._seconds += seconds
                yield key, value
            return
        cause = self._error(future)
        if isinstance(cause, JointplayError):  # what no item can do about
            raise cause
        if type(cause).__name__ != "KilledWorker":
            raise self._lost(cause) from cause
        if len(batch) > 1:
            for entry in batch:
                submit([entry])
            return
        key, item = batch[0]
        yield key, self.lost(item)

    def _error(self, future: Any) -> BaseException | None:
        if future.status == "error":
            with suppress(Exception):
                return future.exception(timeout=CONNECT_S)
        return None

    def _batch(self) -> int:
        if not self._finished:
            return 1
        mean = max(self._seconds / self._finished, 1e-3)
        return int(min(max(BATCH_S / mean, 1.0), MOST_BATCH))

    def close(self) -> None:
        """Leave the cluster; what it was doing for this study is given up."""
        with suppress(Exception):
            self.client.close(timeout=5)
