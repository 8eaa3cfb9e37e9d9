"""Many inputs that no one should give: python benchmarks/fuzz.py --cases 10000

Each case of tests/fuzz/generators.py is one call of the command line, in a process that may crash
or hang without harm. The last line is `cases N traceback A hang B crash C silent D`; the exit
status is 0 if all four are.
"""

from __future__ import annotations

import argparse
import faulthandler
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

GENERATORS = Path(__file__).parents[1] / "tests" / "fuzz"
LIMIT_S = 120.0
"""A case that takes longer hangs."""
KINDS = ("traceback", "hang", "crash", "silent")


def work() -> None:
    """Judge the seeds that standard input names, one a line."""
    sys.path.insert(0, str(GENERATORS))
    from generators import judge, make

    faulthandler.enable()
    # What is said of cases goes where nothing else is printed.
    say = os.fdopen(os.dup(1), "w", buffering=1)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    say.write("ready\n")
    for line in sys.stdin:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            case = make(int(line), Path(folder))
            outcome = " ".join(judge(case).split())
            os.chdir("/")
        say.write(f"{outcome or 'good'}\t{case.kind}\t{' '.join(case.arguments)!r}\n")


class Worker:
    """A process that judges cases, and what it says."""

    def __init__(self) -> None:
        command = [sys.executable, __file__, "--work"]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            text=True, errors="replace",
        )  # fmt: skip
        self.lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.answer(300.0)

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line)
        self.lines.put("")

    def answer(self, limit: float) -> str:
        """The next line; empty if the process has ended, "hang" if there is none in time."""
        try:
            return self.lines.get(timeout=limit)
        except queue.Empty:
            return "hang"

    def ask(self, seed: int) -> str:
        """What became of the case."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{seed}\n")
        self.process.stdin.flush()
        said = self.answer(LIMIT_S)
        if said == "":
            return f"crash: ended with {self.process.wait()}"
        return said.rstrip("\n")

    def end(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.wait()


def main() -> int:
    """Judge all cases, say which failed, count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=10_000, metavar="N", help="default 10000")
    parser.add_argument("--first", type=int, default=1_000_000, metavar="SEED", help="of the first")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work()
        return 0
    seeds: queue.Queue[int] = queue.Queue()
    for seed in range(options.first, options.first + options.cases):
        seeds.put(seed)
    counts, kinds, lock = Counter[str](), Counter[str](), threading.Lock()

    def judge_some() -> None:
        worker = Worker()
        while True:
            try:
                seed = seeds.get_nowait()
            except queue.Empty:
                worker.end()
                return
            said = worker.ask(seed)
            kind = said.split(maxsplit=1)[0].rstrip(":")
            with lock:
                counts[kind] += 1
                kinds[said.split("\t")[1] if "\t" in said else kind] += 1
                if kind != "good":
                    print(f"{seed}: {said}", flush=True)
            if kind in ("hang", "crash"):
                worker.end()
                worker = Worker()

    started = time.perf_counter()
    threads = [threading.Thread(target=judge_some) for _ in range(options.jobs)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print(f"{time.perf_counter() - started:.0f} s; of each kind: {dict(kinds)}")
    print(f"cases {options.cases} {' '.join(f'{kind} {counts[kind]}' for kind in KINDS)}")
    return int(any(counts[kind] for kind in KINDS))


if __name__ == "__main__":
    sys.exit(main())
