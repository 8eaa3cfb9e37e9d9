"""Many invalid inputs: python benchmarks fuzz --cases 20000 --jobs 2

Each case of tests/fuzz/generators.py is judged in a process of its own, a copy of one that has
imported the package and compiled the kernels, with limits of time and memory: it may crash or hang
without harm. What fails is said with the command that judges it again, and kept with its files.
The last line is `cases N traceback A hang B crash C silent D`; the exit status is 0 if all four
are. Interrupted, it says how to go on.
"""

import contextlib
import faulthandler
import importlib
import json
import multiprocessing
import os
import pkgutil
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

from common import ROOT, command

import jointplay as jp
from jointplay.base.files import temporary
from jointplay.base.processes import Pool, end_with_parent
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Table

TESTS = ROOT / "tests"
LIMIT_S = 120.0
"""A case that takes longer hangs."""
MEMORY = 6 << 30
"""What a case may have beyond what its process begins with [bytes]."""
FILES = 2 << 30
"""Largest file that a case may write [bytes]."""
QUICK = 20
"""Cases of a quick run, in which every kind comes."""
FAILURES = ("traceback", "hang", "crash", "silent")


def warm(folder: Path) -> None:
    """Have in memory what cases need, and in `folder` what they break."""
    folder.mkdir()
    import random

    import generators
    import materials
    import matplotlib as mpl
    import twins

    from jointplay.base import units

    mpl.use("Agg")
    if (pid := os.fork()) == 0:  # pools of processes begin there only
        materials.build(folder)
        os._exit(0)
    if os.waitpid(pid, 0)[1]:
        sys.exit("fuzz: cannot make what cases are made of")
    materials.use(folder)
    for module in pkgutil.walk_packages(jp.__path__, "jointplay."):
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
        try:
            _judge_here(seed, folder, said, errors.fileno())
        except BaseException:  # a copy that goes on would do its parent's work once more
            os.write(errors.fileno(), traceback.format_exc().encode())
        finally:
            os._exit(1)
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
    end_with_parent()
    multiprocessing.current_process().daemon = False  # the case may have processes of its own
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream, target in ((nothing, 0), (nothing, 1), (errors, 2)):
        os.dup2(stream, target)
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


def lost(seed: int) -> dict[str, Any]:
    """Of a case with which its worker ended."""
    return {"kind": "lost", "arguments": [], "seconds": 0.0, "outcome": f"crash: worker of {seed}"}


def main() -> int:
    """Judge all cases, say which failed, count."""
    parser = command(
        __doc__,
        "one case of each kind, and some more",
        cases=(20_000, "how many"),
        first=(1_000_000, "seed of the first"),
        jobs=(1, "processes"),
        kept=(f"{tempfile.gettempdir()}/jointplay-fuzz", "folder for files of cases that fail"),
    )
    parser.add_argument("--kind", action="append", default=[], help="only these (repeatable)")
    options = parser.parse_args()
    for number in (signal.SIGINT, signal.SIGTERM):  # also where the shell had them ignored
        signal.signal(number, signal.default_int_handler)
    if options.quick:
        options.cases, options.first = QUICK, 0
    sys.path[:0] = [str(TESTS / "fuzz"), str(TESTS)]
    from generators import ORDER

    chosen = range(options.first, options.first + options.cases)
    cases = {k: k for k in chosen if not options.kind or ORDER[k % len(ORDER)] in options.kind}
    failed: Counter[str] = Counter()
    kinds: dict[str, list[float]] = {}
    kept = Path(options.kept).resolve()
    with contextlib.ExitStack() as stack:
        place = Path(stack.enter_context(temporary("fuzz")))
        warm(place / "materials")
        judged = partial(judge, kept=str(kept), place=place)
        pool = stack.enter_context(contextlib.closing(Pool(judged, options.jobs, lost=lost)))
        bar = stack.enter_context(ProgressBar(total=len(cases), unit="cases"))
        stack.enter_context(contextlib.suppress(KeyboardInterrupt))
        for seed, found in jp.Study(dict(cases), judged).outcomes(progress=bar, workers=pool):
            del cases[seed]
            row = kinds.setdefault(found["kind"], [0, 0, 0, 0.0])
            row[0] += 1
            row[1] += bool(found.get("refused"))
            row[2] += bool(found["outcome"])
            row[3] += found["seconds"]
            if found["outcome"]:
                failed[found["outcome"].split(maxsplit=1)[0].rstrip(":")] += 1
                bar.clear()
                print(f"{seed} ({found['kind']}) {found['outcome']}")
                again = f"python benchmarks fuzz --first {seed} --cases 1"
                print(f"    {again}   # {found['arguments']}", flush=True)
            bar.postfix = f"{failed.total()} failed"
    rows = [
        (kind, str(number), str(refused), str(wrong), f"{seconds / number:.2f}")
        for kind, (number, refused, wrong, seconds) in sorted(kinds.items())
    ]
    print(Table.of_texts([("kind", "cases", "refused", "failed", "s/case"), *rows]))
    if failed:
        print(f"files of what failed: {kept}")
    if cases:
        begin = min(cases)
        print(f"interrupted; go on with --first {begin} --cases {max(cases) + 1 - begin}")
    counts = " ".join(f"{name} {failed[name]}" for name in FAILURES)
    print(f"cases {sum(row[0] for row in kinds.values())} {counts}")
    return int(bool(failed) or bool(cases))
