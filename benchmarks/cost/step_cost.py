"""What a time step costs, measured against one bare `pin.aba` call on the same model.

The SCARA with 0.2 mm clearance in joint B goes through its whole 3 s cycle. After every 200 steps
of the real loop (drive, contact, velocity solve, Pinocchio, integration, a record every 10 steps)
each part is timed alone in the state just reached, so that all of them meet the same machine. Times
are CPU times. The table gives the median and the quartiles over all these pieces of several cycles.
The ratio divides the whole step by the cheapest form of the bare call: the largest ratio of all
forms. Pinocchio's part of a multi-rate step is timed alone; compiled code is the rest. `cycle` is
the same for whole cycles of the error-controlled loop (tolerance 1e-3), uninterrupted, over as many
bare calls as there are steps of 10 µs in them. `joints` and `panda` are ratios of a UR5 with one to
six loose joints and of a Panda with seven (`mechanism_cost` has more of them); `first start` is the
CPU time of a short run of a package that has nothing compiled yet, `warm` that of the next.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
from common import COLOURS, Benchmark, Case, new_figure

import jointplay as jp
from jointplay.base.compiler import compiled
from jointplay.base.files import temporary
from jointplay.base.progress import ProgressBar
from jointplay.simulation.run import Run

CHUNK = 200
"""Steps timed at once: too few for the system to switch away often in between."""
WHOLE = 3
"""Whole error-controlled cycles, uninterrupted, after each of the others."""
CALLS = 100
"""Calls timed at once."""

STEP, IDEAL = "whole step", "whole step, ideal robot"
ADAPTIVE = "10 µs of the error-controlled loop"
TOLERANCE = 1e-3
"""Of the error-controlled loop."""
PINOCCHIO, COMPILED = "whole step: Pinocchio", "whole step: compiled code"
EULER, RK4 = "whole step, semi-implicit-euler", "whole step, rk4"
CALL = "empty compiled call in a Python loop"
ABA = ("aba(...)", "aba(..., LOCAL)", "aba(..., WORLD)", "aba(..., fext)", "aba(..., fext, WORLD)")

FAMILY = dict.fromkeys((STEP, PINOCCHIO, COMPILED, ADAPTIVE, IDEAL, EULER, RK4), 0)
FAMILY |= dict.fromkeys(ABA, 1) | {CALL: 2}
"""The parts in the order of table and figure, and their colours; then come steps by contacts."""


@compiled
def nothing(address) -> int:
    """Stand in for compiled code that does nothing."""
    return 0


class Stepper:
    """The real loop, to be run in pieces."""

    def __init__(self, simulation):
        self.run = Run(simulation)
        self.workspace = self.run.workspace
        self.run.begin()
        self.macros = 0.0

    def advance(self, steps):
        """Seconds per step over the next `steps` steps, or a few more: whole macro steps."""
        before, macros = self.workspace.steps, self.workspace.macro_steps
        started = time.thread_time()
        if not self.run.advance(steps):
            raise SystemExit(self.run.message(self.workspace.status))
        spent = time.thread_time() - started
        taken = max(self.workspace.steps - before, 1)
        self.macros = (self.workspace.macro_steps - macros) / taken
        return spent / taken

    def pinocchio(self):
        """Seconds of each of these steps that are Pinocchio's, timed alone in the state reached."""
        return inertia(self.run) * self.macros


def seconds_per_call(function, *arguments):
    """Seconds of `function(*arguments)`; a ready tuple makes the call as cheap as it can be."""
    started = time.thread_time()
    for _ in range(CALLS):
        function(*arguments)
    return (time.thread_time() - started) / CALLS


def bare_calls(run):
    """Time every form of the bare call in the current state, on data of its own."""
    forces = pin.StdVec_Force()
    for _ in range(run.model.njoints):
        forces.append(pin.Force.Zero())
    local, world = pin.Convention.LOCAL, pin.Convention.WORLD
    w = run.workspace
    state = (run.model, run.model.createData(), w.q, w.v, w.tau)
    tails = ((), (local,), (world,), (forces,), (forces, world))
    return {
        name: seconds_per_call(pin.aba, *state, *tail)
        for name, tail in zip(ABA, tails, strict=True)
    }


def inertia(run):
    """Seconds that Pinocchio takes for the inverse inertia and the bias of one state."""
    w, data = run.workspace, run.model.createData()
    state = (run.model, data, w.q, w.v, np.zeros(run.model.nv))
    return seconds_per_call(pin.aba, *state) + seconds_per_call(
        pin.computeMinverse, run.model, data
    )


def touching(workspace):
    """Contacts that carry at present."""
    return int(np.count_nonzero(workspace.contacts["normal"]))


def cycle(duration, samples, bar):
    """Add to `samples` what every part costs along one cycle [s]."""
    main, ideal, euler, rk4 = (
        Stepper(case.simulation(record_every=10, duration=duration))
        for case in (
            Case(),
            Case(radial=0.0),
            Case(integrator="semi-implicit-euler"),
            Case(integrator="rk4"),
        )
    )

    def note(name, seconds):
        samples.setdefault(name, []).append(seconds)

    empty = nothing.caller("i(i)")
    for _ in range(main.run.total_steps // CHUNK):
        before = touching(main.workspace)
        step = main.advance(CHUNK)
        pinocchio = main.pinocchio()
        note(STEP, step)
        note(PINOCCHIO, pinocchio)
        note(COMPILED, step - pinocchio)
        if before == touching(main.workspace):
            note(f"whole step, {before or 'no'} contact{'s' * (before != 1)}", step)
        for name, seconds in bare_calls(main.run).items():
            note(name, seconds)
        note(IDEAL, ideal.advance(CHUNK))
        note(EULER, euler.advance(CHUNK))
        note(RK4, rk4.advance(CHUNK // 4))
        note(CALL, seconds_per_call(empty, 0))
        bar.update()
    for _ in range(WHOLE):
        simulation = Case().simulation(record_every=10, duration=duration, tolerance=TOLERANCE)
        adaptive = Stepper(simulation)
        note(ADAPTIVE, adaptive.advance(adaptive.run.total_steps))


def starts():
    """CPU seconds of a run that finds nothing compiled, and of the next one."""
    with temporary("first_start") as folder:
        package = Path(jp.__file__).parent
        skipped = shutil.ignore_patterns("objects", "__pycache__")
        shutil.copytree(package, Path(folder) / "jointplay", ignore=skipped)
        robots = Path(jp.shipped("scara.urdf")).parent
        shutil.copytree(robots, Path(folder) / "jointplay/shipped", dirs_exist_ok=True)
        call = [*(sys.executable, "-m", "jointplay", "run", "scara", "--joint", "joint_b=0.1mm")]
        call += ["--duration", "0.05", "--quiet", "--out"]
        environment = {**os.environ, "PYTHONPATH": folder, "NUMBA_CACHE_DIR": f"{folder}/cache"}

        def spent(out):
            before = os.times()
            subprocess.run([*call, f"{folder}/{out}"], env=environment, check=True,
                           stdout=subprocess.DEVNULL)  # fmt: skip
            after = os.times()
            own, system = (after[k] - before[k] for k in (2, 3))
            return own + system

        return spent("first"), spent("warm")


def draw(costs, fastest, ratio):
    figure, axes = new_figure(1, 1, 8.0, 4.6)
    panel = axes[0, 0]
    names = list(costs)[::-1]
    low, middle, high = np.array([costs[name] for name in names]).T
    colours = [COLOURS[FAMILY.get(name, 0)] for name in names]
    panel.barh(names, middle, color=colours, xerr=(middle - low, high - middle), capsize=3)
    panel.axvline(costs[fastest][1], color="black", ls=":", lw=1)
    for row, (value, end) in enumerate(zip(middle, high, strict=True)):
        panel.text(end, row, f"  {value:.2f}", va="center", fontsize=8)
    panel.set_xlabel("cost [µs]: median, bars from quartile to quartile")
    panel.set_title(f"a step costs {ratio:.2f} times the cheapest bare aba call", fontsize=10)
    panel.grid(False, axis="y")
    panel.margins(x=0.1)
    return figure


def main():
    from cost import mechanism_cost  # it uses this module

    benchmark = Benchmark(
        "step_cost",
        __doc__,
        runs=0,
        repeats=(5, "cycles"),
        check=(np.inf, "exit with status 1 if the ratio is above"),
    )
    args = benchmark.parse()
    duration, repeats = (1.0, 1) if args.quick else (3.0, args.repeats)
    pieces = round(duration / Case().step) // CHUNK
    samples: dict[str, list[float]] = {}
    with ProgressBar(total=repeats * pieces, unit="piece") as bar:
        for _ in range(repeats):
            cycle(duration, samples, bar)
    order = [*FAMILY, *sorted(set(samples) - set(FAMILY))]
    costs = {name: np.percentile(samples[name], (25, 50, 75)) * 1e6 for name in order}
    fastest = min(ABA, key=lambda form: costs[form][1])
    ratio = costs[STEP][1] / costs[fastest][1]
    rows = [
        [
            f"{name} (cheapest)" if name == fastest else name,
            f"{middle:.2f}",
            f"{low:.2f} to {high:.2f}",
            f"{middle / costs[fastest][1]:.2f}",
        ]
        for name, (low, middle, high) in costs.items()
    ]
    data = [{"part": name, "cost_us": 1e6 * seconds} for name in order for seconds in samples[name]]
    benchmark.finish(
        ["part", "median [µs]", "quartiles [µs]", "relative to the cheapest aba"],
        rows,
        data,
        draw(costs, fastest, ratio),
    )
    setups = mechanism_cost.many_joints()
    many = mechanism_cost.medians(mechanism_cost.samples_of(setups, 20 if args.quick else 200))
    mechanism_cost.print_many({name: one["step"] / one["aba"] for name, one in many.items()})
    if not args.quick:  # it compiles all
        first, warm = starts()
        print(f"first start {first:.1f} CPU s, warm {warm:.1f}")
    print(f"cycle {costs[ADAPTIVE][1] / costs[fastest][1]:.2f}")
    print(f"ratio {ratio:.2f}")
    if ratio > args.check:
        sys.exit(1)
