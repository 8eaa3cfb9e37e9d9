"""A sweep that is killed again and again: does it lose a finished case, or give another number?

A small sweep of the SCARA, with its cases' results, runs by the command in a process of its own, a
copy of this one, which gets SIGKILL at a random moment: while it makes its folder, keeps cases, or
closes. Then --resume goes on, and is killed. What was finished before a kill must be there after
it, to the bit, its processor time included, which another run of the case would not give; and what
has come to its end must be what an uninterrupted sweep gives. Then the next sweep begins. The last
line counts.
"""

import multiprocessing
import os
import random
import shutil
import sys
import time
from contextlib import suppress
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
from common import command

import jointplay as jp
from jointplay.base.files import temporary
from jointplay.base.progress import ProgressBar
from jointplay.cli import main as main_of_command
from jointplay.study.database import FILE

KILLS, QUICK = 200, 2
SCENARIO = """
[robot]
urdf = "jointplay:scara.urdf"
tool = "suction_cup"

[joints.joint_b]
radial_clearance = "0.2 mm"
axial_clearance = "0.2 mm"

[motion]
file = "jointplay:scara_motion.csv"

[integration]
duration = "4 ms"

[sweep]
results = true
repeats = 4

[sweep.axes]
clearance = { key = "joints.joint_b.radial_clearance", values = ["0.1 mm", "1 nm", "0.2 mm"] }
friction = { key = "joints.joint_b.friction.mu_d", from = 0.0, to = 0.2, number = 4 }
"""
"""48 cases, of which those of 1 nm fail."""


def start(path: Path, store: Path) -> BaseProcess:
    words = ["study", "sweep", path, "--out", store, "--resume", "--quiet", "--jobs", "2"]
    process = multiprocessing.get_context("fork").Process(target=command_line, args=(words,))
    process.start()
    return process


def command_line(words: list) -> None:
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    sys.exit(main_of_command([str(word) for word in words]))


def ended(process: BaseProcess) -> None:
    process.join()
    if process.exitcode:
        raise SystemExit(f"a sweep ended with {process.exitcode}")


def finished(store: Path) -> dict[int, tuple]:
    """All numbers and words of the cases that are finished."""
    if not (store / FILE).exists():
        return {}
    table = jp.open_sweep(store).table()
    return {
        case: tuple(row) for case, row in zip(table.index, table.fillna("").values, strict=True)
    }


def wait(process: BaseProcess, rng: random.Random, lasts: float) -> bool:
    """Wait for a random moment of the command's life; whether it lives then."""
    process.join(rng.uniform(0.0, 0.8 * lasts))
    return process.is_alive()


def same(store: Path, reference: dict[int, tuple], cost: int) -> int:
    """Cases that differ from an uninterrupted sweep's, or whose result cannot be read."""
    sweep, wrong = jp.open_sweep(store), 0
    for case, row in finished(store).items():
        was = reference.get(case)
        wrong += was is None or row[:cost] + row[cost + 1 :] != was[:cost] + was[cost + 1 :]
        if "done" in row:
            with suppress(jp.JointplayError):
                wrong += not np.isfinite(sweep.result(case)["tool_position"].values).all()
                continue
            wrong += 1
    return wrong + len(reference) - len(finished(store))


def main() -> int:
    parser = command(__doc__, seed=(1, "of the moments"))
    parser.add_argument("--kills", type=int, metavar="N", help=f"(default: {KILLS})")
    args = parser.parse_args()
    kills = args.kills or (QUICK if args.quick else KILLS)
    rng = random.Random(args.seed)
    lost = wrong = sweeps = done = kept = 0
    with temporary("kills") as folder:
        path, store = Path(folder) / "study.toml", Path(folder) / "whole"
        path.write_text(SCENARIO)
        jp.sweep(path, store, jobs=2)  # here: copies of this process have all that it takes
        reference, cost = finished(store), list(jp.open_sweep(store).table()).index("cost")
        began = time.monotonic()
        ended(start(path, Path(folder) / "timed"))
        lasts = time.monotonic() - began
        before: dict[int, tuple] = {}
        with ProgressBar(total=kills, unit="kills") as bar:
            while True:
                store = Path(folder) / f"s{sweeps}"
                process = start(path, store)
                if done < kills and wait(process, rng, lasts):
                    process.kill()
                    process.join()
                    done += 1
                    bar.update()
                    now = finished(store)
                    lost += sum(now.get(case) != row for case, row in before.items())
                    kept, before = kept + len(now), now
                    continue
                ended(process)
                now = finished(store)
                lost += sum(now.get(case) != row for case, row in before.items())
                wrong += same(store, reference, cost)
                shutil.rmtree(store)
                sweeps, before = sweeps + 1, {}
                if done >= kills:
                    break
    print(f"kills {done} in {sweeps} sweeps, finished cases found after them {kept}; "
          f"lost {lost}, wrong {wrong}")  # fmt: skip
    return 1 if lost or wrong else 0
