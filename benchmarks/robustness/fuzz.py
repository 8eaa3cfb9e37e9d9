"""Many inputs that no one should give: python benchmarks fuzz --cases 20000 --jobs 2

Each case of tests/fuzz/generators.py is judged in a process of its own, a copy of one that has
imported the package and compiled the kernels, with limits of time and memory: it may crash or hang
without harm. What fails is said with the command that judges it again, and kept with its files.
The last line is `cases N traceback A hang B crash C silent D`; the exit status is 0 if all four
are. Interrupted, it says how to go on.
"""

import argparse
import contextlib
import faulthandler
import importlib
import json
import os
import pkgutil
import queue
import resource
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from common import ROOT

from jointplay.base.files import temporary
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Table

TESTS = ROOT / "tests"
LIMIT_S = 120.0
"""A case that takes longer hangs."""
START_S = 900.0
"""Longest time for a worker to begin; with nothing compiled it takes a minute."""
MEMORY = 6 << 30
"""What a case may have beyond what its process begins with [bytes]."""
FILES = 2 << 30
"""Largest file that a case may write [bytes]."""
QUICK = 20
"""Cases of a quick run, in which every kind comes."""
FAILURES = ("traceback", "hang", "crash", "silent")


def work() -> None:
    """Judge the seeds that standard input names, one a line; answer with a line of JSON."""
    sys.path[:0] = [str(TESTS / "fuzz"), str(TESTS)]
    say = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    with temporary("fuzz") as made:
        warm(Path(made) / "materials")
        say.write("ready\n")
        for line in sys.stdin:
            seed, _, kept = line.rstrip("\n").partition("\t")
            say.write(json.dumps(judge(int(seed), kept, Path(made))) + "\n")


def warm(folder: Path) -> None:
    """Have in memory what cases need, and in `folder` what they break."""
    folder.mkdir()
    import random

    import generators
    import materials
    import matplotlib as mpl
    import twins

    import jointplay
    from jointplay.base import units

    mpl.use("Agg")
    if (pid := os.fork()) == 0:  # zarr and pools of processes begin there only
        materials.build(folder)
        os._exit(0)
    if os.waitpid(pid, 0)[1]:
        sys.exit("fuzz: cannot make what cases are made of")
    materials.use(folder)
    for module in pkgutil.walk_packages(jointplay.__path__, "jointplay."):
        importlib.import_module(module.name)  # with what each needs: no case waits for it again
    for name in ("dask.array", "distributed", "h5netcdf"):
        importlib.import_module(name)
    units.convert("1 mm*s/s", "m")
    generators.short_run()
    with temporary("fuzz") as place:
        for seed in range(5):
            with contextlib.suppress(ValueError):
                twins.first_run(random.Random(seed), Path(place))


def judge(seed: int, kept: str, place: Path | None = None) -> dict[str, Any]:
    """What became of a case, judged in a copy of this process.

    Args:
        seed: of the case.
        kept: folder for the files of a case that fails; empty for none.
        place: in which the case gets a folder; None: that of temporary files.
    """
    folder = (place or Path(tempfile.gettempdir())) / f"fuzz-case-{os.getpid()}-{seed}"
    folder.mkdir()
    answer, said = os.pipe()
    errors = tempfile.TemporaryFile()  # noqa: SIM115
    began = time.perf_counter()
    pid = os.fork()
    if pid == 0:
        os.close(answer)
        _judge_here(seed, folder, said, errors.fileno())
    os.close(said)
    found: dict[str, Any] = {"kind": "unmade", "arguments": [], "outcome": ""}
    with os.fdopen(answer, "rb") as pipe:
        data, hangs = b"", False
        while True:
            left = LIMIT_S - (time.perf_counter() - began)
            if left <= 0.0 or not select.select([pipe], [], [], left)[0]:
                hangs = True
                break
            piece = os.read(pipe.fileno(), 1 << 16)
            if not piece:
                break
            data += piece
    for line in data.splitlines():
        found |= json.loads(line)
    if hangs:
        _kill(pid)
    status = os.waitpid(pid, 0)[1]
    if hangs:
        found["outcome"] = f"hang: no end within {LIMIT_S:.0f} s"
    elif status:
        errors.seek(0)
        last = errors.read().decode(errors="replace").split("\n\n")[0].splitlines()[-4:]
        why = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else f"exit {status >> 8}"
        found["outcome"] = f"crash: {why}: {' | '.join(last)[-300:]}"
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU:
            found["outcome"] = f"hang: {LIMIT_S:.0f} s of processor time"
    elif not found["outcome"] and _left(pid):
        found["outcome"] = "silent: leaves a process"
    _kill(pid)
    errors.close()
    if found["outcome"] and kept:
        with contextlib.suppress(OSError, shutil.Error):
            place = Path(kept) / str(seed)
            _copy(folder, place)
            (place / "CASE.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    shutil.rmtree(folder, ignore_errors=True)
    found["seconds"] = time.perf_counter() - began
    return found


def _judge_here(seed: int, folder: Path, said: int, errors: int) -> None:
    """In the copy: judge, say it, end."""
    os.setsid()
    os.dup2(errors, 2)
    faulthandler.enable()
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    for limit, most in (
        (resource.RLIMIT_AS, used + MEMORY),
        (resource.RLIMIT_CPU, int(LIMIT_S)),
        (resource.RLIMIT_FSIZE, FILES),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(limit, (most, most))
    os.chdir(folder)
    import generators

    def say(**words: Any) -> None:
        os.write(said, json.dumps(words).encode() + b"\n")

    status = 1
    try:
        case = generators.make(seed, folder)
        say(kind=case.kind, arguments=case.arguments)
        outcome = " ".join(generators.judge(case, folder).split())
        say(outcome=outcome, refused=case.refused)
        status = 0
    except BaseException as error:  # of the generators themselves
        import traceback

        traceback.print_exc()
        say(outcome=f"crash: the generator: {type(error).__name__}: {error}", refused=False)
        status = 0
    finally:
        os._exit(status)


def _left(group: int) -> bool:
    """Whether processes of the case live on; those that are ending are waited for."""
    for _ in range(200):
        try:
            os.killpg(group, 0)
        except (ProcessLookupError, PermissionError):
            return False
        time.sleep(0.05)
    return True


def _kill(group: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def _copy(folder: Path, to: Path) -> None:
    """Copy what is a file, a folder or a link."""

    def odd(place: str, names: list[str]) -> list[str]:
        paths = [Path(place) / name for name in names]
        return [p.name for p in paths if not (p.is_symlink() or p.is_file() or p.is_dir())]

    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(folder, to, symlinks=True, ignore=odd)


class Worker:
    """A process whose copies judge cases, and what it says."""

    def __init__(self) -> None:
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")}
        self.process = subprocess.Popen(
            [sys.executable, ROOT / "benchmarks", "fuzz", "--work"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, **threads}, start_new_session=True,
        )  # fmt: skip
        self.lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        if self.answer(START_S) != "ready":
            self.end()
            raise SystemExit("fuzz: a worker does not begin")

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line.rstrip("\n"))
        self.lines.put("")

    def answer(self, limit: float) -> str:
        """The next line; empty if the process has ended, or there is none in time."""
        try:
            return self.lines.get(timeout=limit)
        except queue.Empty:
            return ""

    def ask(self, seed: int, kept: Path) -> dict[str, Any]:
        """What became of the case."""
        assert self.process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.write(f"{seed}\t{kept}\n")
            self.process.stdin.flush()
        said = self.answer(3.0 * LIMIT_S)
        if said:
            return dict(json.loads(said))
        return {"kind": "lost", "arguments": [], "seconds": 0.0, "outcome": "crash: of the worker"}

    def end(self) -> None:
        """End the process."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


class Tally:
    """What has been found so far, and what is said of it."""

    def __init__(self, seeds: Sequence[int], kept: Path) -> None:
        self.cases, self.kept = len(seeds), kept
        self.failed: Counter[str] = Counter()
        self.kinds: dict[str, list[float]] = {}
        self.open = set(seeds)
        self.lock = threading.Lock()
        self.bar = ProgressBar(total=len(seeds), unit="cases")

    def add(self, seed: int, found: dict[str, Any]) -> None:
        """Count a case; say if it failed."""
        with self.lock:
            self.open.discard(seed)
            row = self.kinds.setdefault(found["kind"], [0, 0, 0, 0.0])
            row[0] += 1
            row[1] += bool(found.get("refused"))
            row[3] += found["seconds"]
            if found["outcome"]:
                failure = found["outcome"].split(maxsplit=1)[0].rstrip(":")
                self.failed[failure] += 1
                row[2] += 1
                again = f"python benchmarks fuzz --first {seed} --cases 1"
                self.bar.clear()
                print(f"{seed} ({found['kind']}) {found['outcome']}")
                print(f"    {again}   # {found['arguments']}", flush=True)
            self.bar.postfix = f"{sum(self.failed.values())} failed"
            self.bar.update()

    def end(self) -> int:
        """Say what was found; returns the exit status."""
        self.bar.close()
        done = self.cases - len(self.open)
        rows = [
            (kind, str(cases), str(refused), str(failed), f"{seconds / cases:.2f}")
            for kind, (cases, refused, failed, seconds) in sorted(self.kinds.items())
        ]
        print(Table.of_texts([("kind", "cases", "refused", "failed", "s/case"), *rows]))
        if self.failed:
            print(f"files of what failed: {self.kept}")
        if self.open:
            begin = min(self.open)
            left = max(self.open) + 1 - begin
            print(f"interrupted; go on with --first {begin} --cases {left}")
        counts = " ".join(f"{name} {self.failed[name]}" for name in FAILURES)
        print(f"cases {done} {counts}")
        return int(bool(self.failed) or bool(self.open))


def main() -> int:
    """Judge all cases, say which failed, count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=20_000, metavar="N", help="default 20000")
    parser.add_argument("--first", type=int, default=1_000_000, metavar="SEED", help="of the first")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (default 1)")
    parser.add_argument("--kind", action="append", default=[], help="only these (repeatable)")
    parser.add_argument(
        "--kept", type=Path, default=Path(tempfile.gettempdir()) / "jointplay-fuzz", metavar="DIR",
        help="where the files of cases that fail are kept (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="one case of each kind, and some more")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work()
        return 0
    for number in (signal.SIGINT, signal.SIGTERM):  # also where the shell had them ignored
        signal.signal(number, signal.default_int_handler)
    if options.quick:
        options.cases, options.first = QUICK, 0
    chosen: Sequence[int] = range(options.first, options.first + options.cases)
    if options.kind:
        sys.path[:0] = [str(TESTS / "fuzz"), str(TESTS)]
        from generators import ORDER

        chosen = [seed for seed in chosen if ORDER[seed % len(ORDER)] in options.kind]
    seeds: queue.Queue[int] = queue.Queue()
    for seed in chosen:
        seeds.put(seed)
    kept = options.kept.resolve()
    tally, stop = Tally(chosen, kept), threading.Event()

    def judge_some() -> None:
        worker = Worker()
        while not stop.is_set():
            try:
                seed = seeds.get_nowait()
            except queue.Empty:
                break
            found = worker.ask(seed, kept)
            if stop.is_set():
                break
            tally.add(seed, found)
            if found["kind"] == "lost":
                worker.end()
                worker = Worker()
        worker.end()

    threads = [threading.Thread(target=judge_some) for _ in range(options.jobs)]
    for thread in threads:
        thread.start()
    try:
        for thread in threads:
            thread.join()
    except KeyboardInterrupt:
        stop.set()
        for thread in threads:
            thread.join()
    return tally.end()
