"""How cost grows with steps, joints, contacts, cases and cores, in one figure.

CPU times but for the cores, which are wall time of the same cases by one worker and by two.
"""

import time
from pathlib import Path

import numpy as np
from common import COLOURS, Benchmark, Case, new_figure
from cost.mechanism_cost import arm_of
from cost.scale import LONG_S, SHORT_S, bookkeeping, gain, messages, pairs

import jointplay as jp
from jointplay.base.files import temporary
from jointplay.physics.kernel import Status

DURATIONS = (0.2, 0.5, 1.0, 2.0, 3.0)
JOINTS = (1, 2, 4, 8, 16, 32)
LOOSE = (0, 1, 2, 3, 4)
CASES = (10, 100, 1000, 10_000, 100_000)


def arm(joints, loose):
    """An arm of so many links, drifting freely, the last `loose` joints with clearance."""
    robot = arm_of(joints, range(joints - loose, joints))
    speeds = {name: (None, 0.5 / joints) for name in robot.joints}
    return jp.Simulation(robot, drive={}, state=speeds, duration=0.2, record_every=100)


def cost(simulation):
    """CPU seconds of the time loop, the better of two; without what numpy's own threads idle."""
    found = []
    for _ in range(2):
        run = jp.Run(simulation)
        began = time.thread_time()
        status = run.run_to_end()
        if status != Status.COMPLETED:
            raise SystemExit(run.message(status))
        found.append(time.thread_time() - began)
    return min(found)


def main():
    words = "leave out the wall times, on a busy machine"
    benchmark = Benchmark("growth", __doc__, runs=0, no_cores=(False, words))
    args = benchmark.parse()
    data = []
    few = slice(2) if args.quick else slice(None)
    durations, arms, loosened = DURATIONS[few], JOINTS[few], LOOSE[few]
    with temporary("growth") as folder:
        steps = [cost(Case().simulation(duration=one)) for one in durations]
        joints = [cost(arm(n, 1)) / 20_000 for n in arms]
        loose = [cost(arm(5, n)) / 20_000 for n in loosened]
        (_, bare, case), outcome = pairs(SHORT_S, 15 if args.quick else 200)
        kept, _ = bookkeeping(outcome, 2000, Path(folder))
    driver = kept + messages(100)
    ratio, seconds = 0.0, 0.0
    if not args.no_cores:
        ratio, _, seconds, *_ = gain(4 if args.quick else 24, 1 if args.quick else 3)
    figure, axes = new_figure(2, 3, 9.0, 5.2)
    panels = list(axes.flat)
    sweep = [n * (float(np.median(case)) + driver) for n in CASES]
    series = [
        ("simulated time [s]", durations, steps, "CPU time [s]", "steps: SCARA"),
        ("joints of the arm", arms, [1e6 * v for v in joints], "a step [µs]", "joints: arm"),
        (
            "joints with clearance of 5",
            loosened,
            [1e6 * v for v in loose],
            "a step [µs]",
            "contacts",
        ),
        ("cases", CASES, sweep, "CPU time [s]", f"cases of {SHORT_S:g} s (reckoned)"),
        ("workers", (1, 2), [1.0, ratio], "cases in a time", f"cores: cases of {LONG_S:g} s"),
    ]
    if args.no_cores:
        series.pop()
        panels.pop(-2).set_visible(False)
    rows = []
    for panel, (x, at, values, y, title) in zip(panels, series, strict=False):
        panel.plot(at, values, "o-", ms=4, color=COLOURS[0])
        panel.set(xlabel=x, ylabel=y)
        panel.set_title(title, fontsize=9)
        if at is CASES:
            panel.set(xscale="log", yscale="log")
        else:
            panel.set_ylim(bottom=0)
        for one, value in zip(at, values, strict=True):
            rows.append([title, f"{x}: {one:g}", f"{value:.3g}"])
            data.append({"what": title, "x": one, "value": value})
    parts = {"bare": np.median(bare), "built,\nmeasured": np.median(case - bare), "driver": driver}
    title = f"a case of {SHORT_S:g} s"
    panels[-1].bar(list(parts), [1e3 * float(v) for v in parts.values()], color=COLOURS[1])
    panels[-1].set_ylabel("CPU time [ms]")
    panels[-1].set_title(title, fontsize=9)
    rows += [[title, " ".join(name.split()), f"{1e3 * v:.3g} ms"] for name, v in parts.items()]
    if ratio:
        print(f"a case of {LONG_S:g} s with two workers: {seconds:.3g} s of wall time")
    benchmark.finish(["what", "at", "value"], rows, data, figure)
