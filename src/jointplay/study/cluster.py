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
"""Intended work of one task [s], beside which the scheduler's milliseconds are negligible, and the
most cases in it."""
AHEAD = 3
"""Tasks for each worker that the scheduler has at a time."""
CONNECT_S = 15
"""Longest wait for a scheduler, and then for its first worker [s]."""
TRIES = 5
"""Most attempts to start a client: on a busy machine its thread may not start within its 10 s."""
_LOGGERS = (
    "distributed",
    *(f"distributed.{part}" for part in ("client", "core", "comm", "batched", "utils", "worker")),
    "tornado.application",
    "asyncio",
)


def version() -> str:
    """Version of jointplay in the process that runs this."""
    return versions()["jointplay"]


def _timed(
    work: Callable[[Case], Value], items: Sequence[tuple[Any, Case]]
) -> list[tuple[float, Any, Value]]:
    """Do the work for some items; returns processor time [s], key and value of each."""
    results = []
    for key, item in items:
        began = time.process_time()
        value = work(item)
        results.append((time.process_time() - began, key, value))
    return results


class ClusterWorkers(Generic[Case, Value]):
    """The workers of a Dask cluster, in place of a `Pool`.

    Args:
        work: function of a case; it is sent with all that it needs: no file system is shared.
        address: address of the scheduler, such as ``tcp://10.0.0.1:8786``.
        lost: function that gives the value of a case that kills each worker it is given to.

    Raises:
        JointplayError: dask.distributed is not installed, no scheduler answers, it has no workers,
            or one of them has another version of jointplay.
    """

    def __init__(
        self, work: Callable[[Case], Value], address: str, lost: Callable[[Case], Value]
    ) -> None:
        with extra("cluster", "dask.distributed"):
            from distributed import Client
        for name in _LOGGERS:  # what matters of it is raised here as an error of one line
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
        """Yield key and value of each case as it finishes.

        If a worker dies, the scheduler gives its cases to others.

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
            while len(pending) < AHEAD * self.number:
                batch = list(islice(waiting, self._batch()))
                if not batch:
                    return
                submit(batch)

        feed()
        while pending:
            try:
                key = ended.get(timeout=1.0)
            except queue.Empty:
                if self.client.status != "running":  # the client has lost its scheduler
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
        """Yield the values of a finished task; one that killed its workers is submitted again, case
        by case, and the case that does so alone counts as lost.
        """
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
        cause: BaseException | None = None
        if future.status == "error":
            with suppress(Exception):
                cause = future.exception(timeout=CONNECT_S)
        if isinstance(cause, JointplayError):  # the sweep cannot be run there: see `run_case`
            raise cause
        if type(cause).__name__ != "KilledWorker":
            raise self._lost(cause) from cause
        if len(batch) > 1:
            for entry in batch:
                submit([entry])
            return
        key, item = batch[0]
        yield key, self.lost(item)

    def _batch(self) -> int:
        """Number of cases of the next task, by the mean time of the cases so far."""
        if not self._finished:
            return 1
        mean = max(self._seconds / self._finished, 1e-3)
        return int(min(max(BATCH_S / mean, 1.0), MOST_BATCH))

    def close(self) -> None:
        """Leave the cluster; its tasks for this study are abandoned."""
        with suppress(Exception):
            self.client.close(timeout=5)
