"""What a sweep costs beyond its bare compute, and how it grows with cores and cases.

Bare compute is `Simulation.run` on simulations that are built already, one after the other in one
process; the integration alone is what of it the time loop takes. Overheads are CPU times: each case
is run bare and as a case of a sweep (built from the scenario, run, compared with the ideal
mechanism, measured) in turn, in one process, so that both meet the same machine; to the median of
the pairs comes what driver and workers take for messages and rows, and the start of the
workers, spread over the cases. Only the gain by a second core is wall time, of the same cases with
one and two workers in turn, workers warm: it wants a machine that does nothing else. Beside it is
what the CPU times of these cases allow, as workers never wait for the driver. Memory is the most
that a worker takes, and by how much that grows with each case.
"""

import json
import os
import subprocess
import sys
import time
from collections import deque
from contextlib import ExitStack, closing
from itertools import islice
from pathlib import Path

import numpy as np
from common import command

import jointplay as jp
from jointplay.base.files import temporary
from jointplay.base.tables import Table
from jointplay.study import open_sweep, plan_of
from jointplay.study.case import Bench, job
from jointplay.study.measures import COST
from jointplay.study.store import DONE, Outcome, SweepStore
from jointplay.study.sweep_plan import Cases
from jointplay.study.sweeps import workers_for

CLEARANCES = ["joints.joint_b.radial_clearance", "joints.joint_b.axial_clearance"]
LONG_S, SHORT_S = 3.0, 0.05
STUDY, SHORT = 1000, 1000
"""Cases of the study that is reckoned, and of the one with short cases."""
STORED, MILLION, WORKERS = 10_000, 1_000_000, 100
LIMITS = {"cores": 1.85, "overhead": 0.02, "short": 1.5, "open": 2.0}


def scenario(duration):
    """The paper's SCARA for so long [s]."""
    text = jp.Scenario.load("jointplay:scara.toml").text
    text = text.replace('step = "10 us"', f'step = "10 us"\nduration = {duration}')
    return jp.Scenario(text, jp.shipped("scara.toml"))


def planned(duration, number):
    """A study of so many clearances."""
    axis = {"keys": CLEARANCES, "from": "0.1 mm", "to": "0.5 mm", "number": number}
    return plan_of(scenario(duration), {"clearance": axis}, case="0.2 mm")


def pairs(duration, number, rounds=1):
    """CPU seconds of cases integrated alone, run bare, and as cases of a sweep: three arrays.

    Of `rounds` in turn the fastest counts: what else the machine does only takes time.
    """
    made = planned(duration, number)
    bench = Bench(job(made))
    bench.run((0,), made.changes((0,)))
    found = np.full((number, 3), np.inf)
    for best, index in zip(found, Cases(made), strict=True):
        simulation = bench.simulation(made.changes(index))
        for _ in range(rounds):
            run = jp.Run(simulation)
            times = [time.process_time()]
            run.run_to_end()
            times.append(time.process_time())
            simulation.run(estimate=False)  # as cases of a sweep are run
            times.append(time.process_time())
            outcome = bench.run(index, made.changes(index))
            times.append(time.process_time())
            if outcome.status != DONE:
                raise SystemExit(outcome.error)
            best[:] = np.minimum(best, np.diff(times))
    return found.T, outcome


def bookkeeping(outcome, number, folder):
    """CPU seconds of the driver for each of `number` cases, and seconds to open them."""
    made = planned(SHORT_S, number)
    store = SweepStore(folder / "stored", made)
    began = time.process_time()
    for index in Cases(made):
        made.changes(index)
        store.keep(index, Outcome(index, DONE, outcome.values))
    took = (time.process_time() - began) / number
    store.close()
    began = time.perf_counter()
    found = open_sweep(folder / "stored").dataset()
    assert float(found["peak_force"].mean()) > 0.0
    return took, time.perf_counter() - began


def start():
    """CPU seconds that the start of the workers takes, imports and compiled kernels included."""
    before = os.times()
    program = "import jointplay.study.case, jointplay.physics.kernel as k; k.caller_of()"
    subprocess.run([sys.executable, "-c", program], check=True)
    after = os.times()
    return after.children_user + after.children_system - sum(before[2:4])


def messages(number):
    """CPU seconds of the driver for messages to and from workers, by case."""
    made = planned(SHORT_S, number)
    with closing(workers_for(made, 1)) as workers:
        began = time.process_time()
        deque(workers.run(Cases(made).items()), 0)
        return (time.process_time() - began) / number


def gain(number, rounds):
    """How much faster two workers are than one, what their CPU times allow, the wall seconds of a
    case with two, and a worker's largest memory and its growth by case [bytes].
    """
    made = planned(LONG_S, number)
    times, spent = {1: [], 2: []}, {1: [], 2: []}
    with ExitStack() as stack:
        crews = {n: stack.enter_context(closing(workers_for(made, n))) for n in times}
        for crew in crews.values():
            deque(crew.run(islice(Cases(made).items(), 4)), 0)
        (worker,) = crews[1].processes.values()
        before = memory(worker.pid)
        for _ in range(rounds):
            for workers, crew in crews.items():
                began = time.perf_counter()
                for _, outcome in crew.run(Cases(made).items()):
                    if outcome.status != DONE:
                        raise SystemExit(outcome.error)
                    spent[workers].append(outcome.values[COST])
                times[workers].append(time.perf_counter() - began)
        largest = memory(worker.pid)
    allowed = 2.0 * np.median(spent[1]) / np.median(spent[2])
    growth = (largest - before) / (number * rounds)
    return min(times[1]) / min(times[2]), allowed, min(times[2]) / number, largest, growth


def memory(process):
    """The most that a process has taken so far [bytes]; nan where Linux does not tell."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return np.nan
    return next((1024.0 * float(one.split()[1]) for one in lines if one[:6] == "VmHWM:"), np.nan)


def measure(quick=False):
    """All ratios and what is reckoned from them, by name."""
    with temporary("scale") as folder:
        (_, short_bare, short_case), outcome = pairs(SHORT_S, 15 if quick else 200)
        (long_alone, long_bare, long_case), _ = pairs(LONG_S, *((2, 3) if quick else (8, 5)))
        kept, opened = bookkeeping(outcome, STORED, Path(folder))
        told = messages(30 if quick else 300)
        begun = start()
        cores, allowed, seconds, largest, growth = gain(4 if quick else 24, 1 if quick else 3)
    driver = kept + told
    bare = float(np.median(long_bare))
    overhead = float(np.median(long_case - long_bare)) + driver
    short = float(np.median(short_case)) + driver + begun / SHORT
    return {
        "cores": cores,
        "cores_allowed": allowed / (1.0 + driver / bare),
        "alone": (bare + overhead) / float(np.median(long_alone)),
        "memory_bytes": largest,
        "growth_bytes": growth,
        "overhead": overhead / bare,
        "short": short / float(np.median(short_bare)),
        "open": opened,
        "driver_over_case": driver / bare,
        "study_s": STUDY * seconds + begun,
        "million_s": max(MILLION * (bare + overhead) / WORKERS, MILLION * driver),
        "million_driver_s": MILLION * driver,
        "bare_s": bare,
        "driver_s": driver,
        "start_s": begun,
    }


def main():
    parser = command(__doc__, check=(False, "exit with status 1 beyond a limit"))
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there as well")
    args = parser.parse_args()
    found = measure(args.quick)
    million, busy = (found[name] / 3600 for name in ("million_s", "million_driver_s"))
    rows = (
        (f"bare compute of the {LONG_S:g} s cycle, CPU", f"{found['bare_s']:.3f} s"),
        ("driver, for each case, CPU", f"{1e3 * found['driver_s']:.2f} ms"),
        ("start of the workers, CPU, once", f"{found['start_s']:.2f} s"),
        (f"{STORED} stored cases open in", f"{found['open']:.2f} s"),
        (f"{STUDY} cases of {LONG_S:g} s on two cores, reckoned from those run",
         f"{found['study_s'] / 60:.1f} min"),
        (f"{MILLION} cases of {LONG_S:g} s on {WORKERS} workers, reckoned",
         f"{million:.2f} h, of which the driver is busy {busy:.2f} h"),
    )  # fmt: skip
    print(Table.of_texts((("what", "value"), *rows)).markdown())
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")
    cores, overhead, short = (found[name] for name in ("cores", "overhead", "short"))
    most, growth = found["memory_bytes"] / 1e6, found["growth_bytes"] / 1e3
    print(
        f"cases {STUDY}, CPU a case {1 + overhead:.3f} of a bare run, {found['alone']:.2f} of "
        f"its integration alone, {short:.2f} if short; two cores {cores:.2f} times one, by CPU "
        f"times {found['cores_allowed']:.2f}; memory {most:.0f} MB + {growth:.1f} kB a case"
    )
    good = cores >= LIMITS["cores"] and all(
        found[name] <= LIMITS[name] for name in ("overhead", "short", "open")
    )
    if args.check and not good:
        sys.exit(1)
