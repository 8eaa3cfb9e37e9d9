"""Worker processes, which end with this one however it ends.

If their parent is killed, processes that wait for work would wait for ever. So each watches its
parent; on Linux the kernel ends it at once.
"""

import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from contextlib import closing, contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from jointplay.base import progress, signals
from jointplay.base.errors import JointplayError, require_whole
from jointplay.base.modules import import_module, imported_modules
from jointplay.base.signals import SIGNALS

_FORKS = sys.platform == "linux"
"""Whether workers are forked, which is fast; on other systems that is unsafe."""

_ROOT = Path("/")

_WATCH_S = 1.0
"""Interval at which a worker checks that its parent lives [s] (judged: elsewhere than on Linux an
orphan lives so much longer)."""

_PR_SET_PDEATHSIG = 1
"""Option of Linux's `prctl` for a signal at the parent's death."""

MOST_DEATHS = 3
"""Workers that may die on one item before it is lost (judged: one death may be by memory that
others took)."""

Item = TypeVar("Item")
Value = TypeVar("Value")


def cores() -> int:
    """Number of processors this process may use, by its affinity and its container's limits."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(math.ceil(min(available or 1, _quota())), 1)


def _quota() -> float:
    """Processor time per time that Linux's control groups (version 2) allow this process."""
    least, root = math.inf, _ROOT / "sys/fs/cgroup"
    with suppress(OSError, IndexError):  # another system
        path = (_ROOT / "proc/self/cgroup").read_text().split("0::/")[1].splitlines()[0]
        for folder in (root / path, *(root / path).parents):
            with suppress(OSError, ValueError):
                quota, period = (folder / "cpu.max").read_text().split()
                least = min(least, math.inf if quota == "max" else int(quota) / int(period))
            if folder == root:
                break
    return least


def number_of(jobs: int | None, items: object = None) -> int:
    """Number of workers for some items: `jobs`, or one per core; no more than there are items.

    Raises:
        JointplayError: `jobs` is not a whole number above zero.
    """
    number = cores() if jobs is None else require_whole("jobs", jobs, 1)
    if multiprocessing.current_process().daemon:  # a worker itself, which has one core
        return 1
    return max(min(number, len(items)), 1) if isinstance(items, Sized) else number


def copies(jobs: int | None = None, items: object = None) -> int:
    """Number of workers for work that cannot be pickled: 1 where processes cannot be forked."""
    return number_of(jobs, items) if _FORKS else 1


def begin(early: bool = False) -> None:
    """Set up a worker process: Ctrl-C and a closed terminal are left to its parent.

    With `early`, SIGTERM and the end of its parent stop it as Ctrl-C stops its parent: its work
    ends early and is saved.
    """
    signals.forget()
    for number in set(SIGNALS) - {signal.SIGTERM}:
        signal.signal(number, signal.SIG_IGN)
    if early:
        signal.signal(signal.SIGTERM, signals.stop)
    else:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        end_with_parent()
    threading.Thread(target=_watch, args=(early, os.getppid()), daemon=True).start()


def end_with_parent() -> None:
    """Have Linux kill this process when its parent ends."""
    if sys.platform != "linux":
        return
    import ctypes

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _watch(early: bool, parent: int) -> None:
    """Wait for the parent to end, on any system; then end this process, too."""
    known = multiprocessing.parent_process()
    assert known is not None
    while os.getppid() == parent and known.is_alive():
        wait([known.sentinel], _WATCH_S)
    if early:
        os.kill(os.getpid(), signal.SIGTERM)
        threading.main_thread().join()
    os._exit(1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit numerical libraries to one thread: the cores are taken by workers."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield


def _started(target: Callable[..., None], *arguments: Any) -> BaseProcess:
    """Start a process that calls `target`, with signals deferred until it is set up."""
    context: Any = multiprocessing.get_context("fork" if _FORKS else None)
    process: BaseProcess = context.Process(target=target, args=arguments, daemon=True)
    with warnings.catch_warnings():  # Python 3.12 warns of threads of libraries, which idle here
        warnings.simplefilter("ignore", DeprecationWarning)
        if not hasattr(signal, "pthread_sigmask"):  # Windows
            process.start()
            return process
        # Until it is set up the process has this one's signal handlers, which raise.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        try:
            process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return process


class Pool(Generic[Item, Value]):
    """Worker processes that do the same work for one item after the other.

    Each has a connection of its own, so that when one dies the item that it had is known.

    Args:
        work: function called for each item. Items, results and errors are pickled; the function
            itself is only where processes cannot be forked.
        number: how many processes.
        begin: function that sets each of them up.
        lost: function that gives the result of an item on which `MOST_DEATHS` processes have died;
            None: the first death raises.
        small: whether items are so small that each process may have one waiting.
        early: whether a process that is told to stop ends its work early and saves it.
        recovery: what is left of the work if a process is killed, for the message.
        name: name of the items, by which errors say which one they are about.
    """

    def __init__(
        self,
        work: Callable[[Item], Value],
        number: int,
        *,
        begin: Callable[..., None] = begin,
        lost: Callable[[Item], Value] | None = None,
        small: bool = False,
        early: bool = False,
        recovery: str = "nothing was kept",
        name: str = "",
    ) -> None:
        self._recovery, self._name, self._early = recovery, name, early
        setup = partial(begin, True) if early else begin
        reports = progress.current() is not None
        self._target = partial(_serve, work, setup, reports, () if _FORKS else imported_modules())
        self._number, self._lost, self._small = number, lost, small
        self.processes: dict[Connection, BaseProcess] = {}  # by connection
        self._queues: dict[Connection, deque[tuple[Any, Item]]] = {}
        self._items: Iterator[tuple[Any, Item]] = iter(())
        self._again: deque[tuple[Any, Item]] = deque()
        self._deaths: Counter[Any] = Counter()
        self._finished = 0
        self._closed = False
        for _ in range(number):
            self._start()

    def _start(self) -> None:
        mine, theirs = multiprocessing.Pipe()
        process = _started(self._target, theirs)
        theirs.close()
        self.processes[mine], self._queues[mine] = process, deque()
        if self._closed:  # meanwhile, by another thread
            process.kill()

    def start(self, items: Iterable[tuple[Any, Item]]) -> None:
        """Begin the work for items given by key; they are taken as they are needed."""
        self._items = iter(items)
        self._deaths.clear()
        for connection in self._queues:
            self._feed(connection)

    @property
    def busy(self) -> bool:
        """Whether any process has an item to work on."""
        return not self._closed and any(self._queues.values())

    def run(self, items: Iterable[tuple[Any, Item]]) -> Iterator[tuple[Any, Value]]:
        """Do the work for items given by key; yields key and result of each as it completes.

        Raises:
            JointplayError: a process was ended from outside, or an item cannot be pickled.
            BaseException: an error of the work.
        """
        self.start(items)
        while self.busy:
            yield from self.outcomes()

    def outcomes(self, timeout: float | None = None) -> Iterator[tuple[Any, Value]]:
        """Yield the results that come next, as in `run`; none if none comes within the time [s]."""
        for ready in wait([c for c, queue in self._queues.items() if queue], timeout):
            connection = cast(Connection, ready)
            try:
                answer = connection.recv()
            except (EOFError, OSError):
                if self._closed:
                    return
                yield from self._died(connection)
                continue
            if isinstance(answer, progress.Moved):
                answer.show()
                continue
            error, value = answer
            key, _ = self._queues[connection].popleft()
            self._finished += 1
            if error is not None:
                raise with_item(error, self._name, key)
            yield key, value  # first, lest the result be lost with an error of the next item
            self._feed(connection)

    def _feed(self, connection: Connection) -> None:
        """Send a process its next item; if items are small, one besides that it works on."""
        queue = self._queues[connection]
        while len(queue) < 1 + self._small:
            next_one = self._again.popleft() if self._again else next(self._items, None)
            if next_one is None:
                return
            queue.append(next_one)
            try:
                connection.send(next_one[1])
            except OSError:  # the process is dead, which `outcomes` finds
                return
            except (pickle.PicklingError, TypeError, AttributeError) as error:
                text = f"it cannot be sent to another process ({error}); jobs=1 needs none"
                raise with_item(JointplayError(text), self._name, next_one[0]) from error

    def _died(self, connection: Connection) -> Iterator[tuple[Any, Value]]:
        """Replace a dead process; the item on which it died is tried again, or lost."""
        queue = self._queues.pop(connection)
        self.processes.pop(connection).join()
        connection.close()
        key, item = queue.popleft()
        self._deaths[key] += 1
        self._again.extend(queue)
        if self._lost is None:
            text = f"a process was ended from outside (too little memory?); {self._recovery}"
            raise with_item(JointplayError(text), self._name, key)
        if self._finished == 0 and len(self._deaths) > 2 * self._number:
            raise JointplayError("the worker processes end before they have done any work")
        if self._deaths[key] >= MOST_DEATHS:
            yield key, self._lost(item)
        else:
            self._again.append((key, item))
        self._start()
        for idle, waiting in self._queues.items():
            if not waiting:
                self._feed(idle)

    def close(self) -> None:
        """End all processes; their work is discarded, or with `early` ended and saved.

        Raises:
            GivenUp: another request to stop came meanwhile.
        """
        left = [str(queue[0][0]) for queue in self._queues.values() if queue and self._early]
        self._closed = True
        ending = list(self.processes.values())
        try:
            if left:
                if signals.stop_requested():
                    signals.say(
                        "stopping; saving what was computed (interrupt again to discard it)"
                    )
                for process in ending:
                    process.terminate()
                for process in ending:
                    process.join()
        except KeyboardInterrupt:
            raise signals.GivenUp(f"discarded without saving: {', '.join(left)}") from None
        finally:
            for process in ending:
                process.kill()
            for process in ending:
                process.join()


class Serial(Generic[Item, Value]):
    """Stand-in for a `Pool` that does the work in this process."""

    def __init__(self, work: Callable[[Item], Value], *, name: str = "") -> None:
        self._work, self._name = work, name

    def run(self, items: Iterable[tuple[Any, Item]]) -> Iterator[tuple[Any, Value]]:
        for key, item in items:
            try:
                with one_thread():
                    value = self._work(item)
            except Exception as error:
                with_item(error, self._name, key)
                raise
            yield key, value

    def close(self) -> None:
        pass


def with_item(error: BaseException, name: str, key: Any) -> BaseException:
    """Have an error say which item it is about, if items have a name; returns it."""
    if name and isinstance(error, JointplayError):
        error.args = (f"{name}[{key}]: {error}",)
        error.where = (name, key, *error.where)
    elif name:
        error.add_note(f"{name}[{key}]")
    return error


def _serve(
    work: Callable[[Any], Any],
    begin: Callable[[], None],
    reports: bool,
    modules: Sequence[str],
    connection: Any,
) -> None:
    """Main function of a worker: do the work for each item that comes; send progress if asked."""
    ends = (EOFError, BrokenPipeError, ConnectionResetError, KeyboardInterrupt)
    with suppress(*ends):  # a request to stop may come at any time from here on
        begin()
        for module in modules:
            import_module(module)
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        bar = progress.tell_elsewhere(connection.send if reports else None)
        with one_thread():
            while not signals.stop_requested():
                content = connection.recv_bytes()
                try:
                    sent = ForkingPickler.dumps((None, work(pickle.loads(content))))
                except BaseException as error:  # noqa: BLE001
                    if signals.stop_requested():
                        return
                    sent = ForkingPickler.dumps((_portable(error), None))
                bar.tell()
                connection.send_bytes(sent)


def _portable(error: BaseException) -> BaseException:
    """Make an error that can be pickled, with its traceback as a note."""
    if isinstance(error, JointplayError | KeyboardInterrupt):
        return error
    error.add_note("".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def beside(work: Callable[[], object]) -> BaseProcess | None:
    """Do work in a fork of this process, if there is a core for it; returns the process, else None.

    It ends with this one. Result and errors are dropped.
    """
    if copies() == 1:
        return None

    def serve() -> None:
        begin()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        with suppress(Exception):
            work()

    return _started(serve)


@contextmanager
def in_parallel(work: Callable[[], Value]) -> Iterator[Callable[[], Value]]:
    """Do `work` in a fork while the block runs; yields a function that waits for its result.

    Where processes cannot be forked, or there is one core, the work is done here when the function
    is called.

    Raises:
        JointplayError: from the function, if the process was ended from outside.
    """
    if copies() == 1:
        yield work
        return
    with closing(Pool[None, Value](lambda _: work(), 1)) as pool:
        pool.start([(None, None)])
        yield lambda: next(pool.outcomes())[1]
