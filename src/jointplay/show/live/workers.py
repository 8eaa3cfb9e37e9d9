"""Two processes that answer the live page: one quickly, then one in full.

Each has its own `Machine`, built once. A newer question ends the answer to an older one. The
processes end with this one, however it ends.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from jointplay.base import processes
from jointplay.base.errors import JointplayError
from jointplay.show.live.answer import Machine, Superseded
from jointplay.show.live.state import State

Receive = Callable[[dict[str, Any], bytes], None]
"""Receives a part of an answer, in a thread of `Workers`."""

_METHOD = "fork" if sys.platform == "linux" else "spawn"
ROUNDS = ("quick", "fine")  # methods of `Machine`; each has a process


class Workers:
    """The processes that answer questions on one state: always the newest question only."""

    def __init__(self, state: State) -> None:
        self.state = state
        context: Any = multiprocessing.get_context(_METHOD)
        self._context = context
        self._newest = context.Value("Q", 0)
        self._lock = threading.Lock()
        self._receive: Receive = lambda head, block: None
        self._values: dict[str, float] = {}
        self._open = False
        self._closed = False
        self.processes: dict[str, Any] = {}
        self._connections: dict[str, Any] = {}
        for kind in ROUNDS:
            self._start(kind)

    def _start(self, kind: str) -> None:
        """Start the process of a round, and a thread that reads its answers."""
        mine, theirs = self._context.Pipe()
        process = self._context.Process(
            target=_serve, args=(self.state, kind, theirs, self._newest), daemon=True
        )
        with warnings.catch_warnings():  # of forks beside threads: libraries' threads are idle here
            warnings.simplefilter("ignore", DeprecationWarning)
            process.start()
        theirs.close()
        self.processes[kind], self._connections[kind] = process, mine
        threading.Thread(target=self._read, args=(kind, mine), daemon=True).start()

    def ask(self, values: Mapping[str, float], receive: Receive) -> int:
        """Ask a question, which ends the answers to earlier ones.

        `receive` gets each part of the answer, the last one of the kind ``end``. Returns the
        question's number, which is in all parts.
        """
        with self._lock:
            before, self._receive = self._receive, receive
            unanswered, self._open = self._open, True
            number = int(self._newest.value) + 1
            self._newest.value, self._values = number, dict(values)
            self._send(ROUNDS[0])
        if unanswered:
            before({"kind": "end", "question": number - 1, "superseded": True}, b"")
        return number

    def _send(self, kind: str) -> None:
        with suppress(OSError):  # the process is dead: `_read` notices and starts another
            self._connections[kind].send((int(self._newest.value), self._values))

    def _read(self, kind: str, connection: Any) -> None:
        """Hand on a process's answers until it ends; if it was killed, start another."""
        with suppress(EOFError, OSError):
            while True:
                head, block = connection.recv()
                self._hand_on(kind, head, block)
        with self._lock:
            if self._closed:
                return
            number = int(self._newest.value)
            self._start(kind)
        text = "a process was ended from outside (too little memory?); ask again"
        self._hand_on(kind, {"kind": "error", "question": number, "error": text, "at": None}, b"")
        self._hand_on(kind, {"kind": "done", "question": number, "refused": True}, b"")

    def _hand_on(self, kind: str, head: dict[str, Any], block: bytes) -> None:
        """Give a part of an answer to the asker, if it answers the newest question."""
        with self._lock:
            if head["question"] != self._newest.value:
                return
            receive = self._receive
            if head["kind"] == "done":
                if kind == ROUNDS[0] and not head.get("refused"):
                    self._send(ROUNDS[1])  # not before: it would slow down the quick round
                    return
                self._open = False
                head = {"kind": "end", "question": head["question"], "superseded": False}
            receive(head, block)

    def close(self) -> None:
        """Kill the processes, whatever they compute."""
        with self._lock:
            self._closed = True
        for process in self.processes.values():
            process.kill()
        for process in self.processes.values():
            process.join()


def _serve(state: State, kind: str, connection: Any, newest: Any) -> None:
    """A process: answer one question after the other, each in the round `kind`."""
    processes.begin()
    os.nice(5)  # the browser, which draws, goes first
    machine = Machine(state)
    with processes.one_thread(), suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            number, values = connection.recv()
            while connection.poll():  # skip questions that newer ones have replaced
                number, values = connection.recv()
            machine.superseded = lambda number=number: bool(newest.value != number)  # type: ignore[misc]
            _answer(machine, kind, values, connection, number)


def _answer(
    machine: Machine, kind: str, values: Mapping[str, float], connection: Any, number: int
) -> None:
    """Answer one question; an error is sent with the control that caused it."""
    began, refused = time.process_time(), True

    def send(head: dict[str, Any], block: bytes = b"") -> None:
        took = {"question": number, "cpu_s": time.process_time() - began}
        connection.send((head | took, block))

    try:
        for head, block in getattr(machine, kind)(values):
            send(head, block)
        refused = False
    except Superseded:
        return
    except JointplayError as error:
        send({"kind": "error", "error": str(error), "at": machine.state.control_at(error.where)})
    except (ArithmeticError, ValueError, MemoryError) as error:
        reason = f"these numbers cannot be computed with: {error or type(error).__name__}"
        send({"kind": "error", "error": reason, "at": None})
    except Exception as error:  # noqa: BLE001
        traceback.print_exc()
        send({"kind": "error", "error": f"{type(error).__name__}: {error}", "at": None})
    send({"kind": "done", "refused": refused})
