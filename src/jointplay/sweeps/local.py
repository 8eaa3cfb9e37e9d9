"""Processes of this machine that run the cases of a sweep.

One process imports jointplay and its compiled kernels once; the workers are its copies. Each has a
connection of its own, so that when one dies the case that it had is known.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any, cast

from jointplay.core import processes
from jointplay.core.errors import JointplayError
from jointplay.sweeps.case import COST, FAILED, Job, Outcome
from jointplay.sweeps.plan import Index

Case = tuple[Index, Mapping[str, Any]]

MOST_DEATHS = 3
"""Workers that a case may take with it before it counts as failed."""

AHEAD_S = 0.5
"""What a worker has waiting is work for about so long [s]."""

MOST_AHEAD = 64
"""And no more cases than this."""

_PROGRAM = "import sys; from jointplay.sweeps.local import nursery; nursery()"


class LocalWorkers:
    """Processes of this machine.

    Args:
        job: what they work on.
        number: of processes.
    """

    def __init__(self, job: Job, number: int) -> None:
        """Start them; they import while the sweep is made ready."""
        self.job, self.number = job, number
        self._groups: list[subprocess.Popen[bytes]] = []
        self._waiting: dict[Connection[Any, Any], deque[Case]] = {}
        self._deaths: dict[Index, int] = {}
        self._seconds = 0.0
        self._done = 0
        self._begin(number)

    def _begin(self, number: int) -> None:
        """Start a process that becomes `number` workers."""
        pairs = [socket.socketpair() for _ in range(number)]
        theirs = [pair[1].fileno() for pair in pairs]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            environment.setdefault(name, "1")  # the cores are taken by the workers
        process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            pass_fds=theirs,
            env=environment,
        )
        self._groups.append(process)
        assert process.stdin is not None
        with suppress(BrokenPipeError):
            pickle.dump((theirs, self.job), process.stdin)
            process.stdin.flush()
        for mine, other in pairs:
            other.close()
            self._waiting[Connection(mine.detach())] = deque()

    def run(self, cases: Iterator[Case]) -> Iterator[Outcome]:
        """Outcomes of the cases, as they come.

        Raises:
            JointplayError: the workers cannot begin.
        """
        left: deque[Case] = deque()

        def take() -> Case | None:
            return left.popleft() if left else next(cases, None)

        for connection in list(self._waiting):
            self._feed(connection, take)
        while any(self._waiting.values()):
            busy = [connection for connection, queue in self._waiting.items() if queue]
            for ready in wait(busy):
                connection = cast("Connection[Any, Any]", ready)
                try:
                    said = connection.recv()
                except (EOFError, OSError):
                    outcome = self._died(connection, left)
                    if outcome is not None:
                        yield outcome
                    for other in list(self._waiting):
                        self._feed(other, take)
                    continue
                if isinstance(said, BaseException):
                    raise said
                self._waiting[connection].popleft()
                self._done += 1
                self._seconds += said.values.get(COST, 0.0)
                self._feed(connection, take)
                yield said

    def _feed(self, connection: Connection[Any, Any], take: Any) -> None:
        """Have a worker's next cases wait for it, so that it need not wait for them."""
        mean = self._seconds / self._done if self._done else AHEAD_S
        ahead = int(min(max(AHEAD_S / max(mean, 1e-3), 1.0), MOST_AHEAD)) + 1
        queue = self._waiting.get(connection)
        while queue is not None and len(queue) < ahead:
            case = take()
            if case is None:
                return
            queue.append(case)
            try:
                connection.send(case)
            except OSError:  # it is dead, which `run` finds
                return

    def _died(self, connection: Connection[Any, Any], left: deque[Case]) -> Outcome | None:
        """Replace a dead worker; the case that it died of is tried again, or has failed."""
        queue = self._waiting.pop(connection)
        connection.close()
        index, changes = queue.popleft()
        self._deaths[index] = self._deaths.get(index, 0) + 1
        left.extend(queue)
        if self._done == 0 and len(self._deaths) > 2 * self.number:
            raise JointplayError("the workers end before they have done anything")
        self._begin(1)
        if self._deaths[index] >= MOST_DEATHS:
            text = f"{MOST_DEATHS} processes died of it (killed, out of memory, or crashed)"
            return Outcome(index, FAILED, {}, text)
        left.append((index, changes))
        return None

    def close(self) -> None:
        """End all processes; what they were doing is given up."""
        for connection in self._waiting:
            with suppress(OSError):
                connection.close()
        self._waiting = {}
        for process in self._groups:
            process.kill()  # and its children with it
            with suppress(OSError):
                assert process.stdin is not None
                process.stdin.close()
            process.wait()


def nursery() -> None:
    """Become the workers of a sweep: the main function of their parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        connections, job = pickle.load(sys.stdin.buffer)
    except EOFError:  # the sweep is over before it began
        return
    processes.begin()
    from jointplay import kernel

    with suppress(Exception):
        kernel.compiled()
    children = []
    for number, descriptor in enumerate(connections):
        child = os.fork()
        if child == 0:
            for other in connections[:number] + connections[number + 1 :]:
                os.close(other)
            _serve(Connection(descriptor), job)
            os._exit(0)
        children.append(child)
    for descriptor in connections:
        os.close(descriptor)
    for child in children:
        with suppress(ChildProcessError):
            os.waitpid(child, 0)


def _serve(connection: Connection[Any, Any], job: Job) -> None:
    """Run the cases that come, one after the other."""
    from jointplay.sweeps.case import run_cases

    processes.begin()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            case = connection.recv()
            try:
                (outcome,) = run_cases(job, [case])
            except JointplayError as error:  # not of the case: of the sweep
                connection.send(error)
                return
            connection.send(outcome)
