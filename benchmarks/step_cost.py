"""What a time step costs, measured against one bare `pin.aba` call on the same model.

The SCARA with 0.2 mm clearance in joint B goes through its whole 3 s cycle. After every 100 steps
of the real loop (drive, contact, ABA, integration, a record every 10 steps) each part is timed
alone in the state just reached, so that all of them meet the same machine. Times are CPU times.
The table gives the median and the quartiles over all these pieces of several cycles. The ratio
divides the whole step by the cheapest form of the bare call: the largest ratio of all forms.
"""

import sys
import time

import numpy as np
import pinocchio as pin
from common import COLOURS, Benchmark, Case, new_figure
from numba import njit
from tqdm import tqdm

from jointplay import kernel

CHUNK = CALLS = 100
"""Steps and calls timed at once: too few for the system to switch away often in between."""
STANDSTILL = 1e-15
"""A step so short that a kernel timed alone stays in the state it was put into [s]."""

STEP, IDEAL, RK4 = "whole step", "whole step, ideal robot", "whole step, rk4"
CALL = "empty compiled call in a Python loop"
ABA = ("aba(...)", "aba(..., LOCAL)", "aba(..., WORLD)", "aba(..., fext)", "aba(..., fext, WORLD)")

FAMILY = {STEP: 0, IDEAL: 0, RK4: 0} | dict.fromkeys(ABA, 1) | {CALL: 2}
"""The parts in the order of table and figure, and their colours; then come the kernel's."""
KERNEL_FAMILY = 2


@njit(cache=True)
def nothing(table) -> int:
    """Stand in for a kernel that does nothing."""
    return 0


class Stepper:
    """The real loop, to be run in pieces."""

    def __init__(self, case, **options):
        self.run = case.simulation(record_every=10, **options).prepare()
        self.workspace = self.run.workspace
        self.run.begin()

    def advance(self, steps):
        """Seconds per step over the next `steps` steps."""
        started = time.thread_time()
        if not self.run.advance(steps):
            raise SystemExit(self.run.message(self.workspace.status))
        return (time.thread_time() - started) / steps


def seconds_per_call(function, *arguments):
    """Seconds of `function(*arguments)`; a ready tuple makes the call as cheap as it can be."""
    started = time.thread_time()
    for _ in range(CALLS):
        function(*arguments)
    return (time.thread_time() - started) / CALLS


def bare_calls(stepper):
    """Time every form of the bare call in the current state."""
    w = stepper.workspace
    model, data = stepper.run.model, stepper.run.data
    forces = pin.StdVec_Force()
    for _ in range(model.njoints):
        forces.append(pin.Force.Zero())
    local, world = pin.Convention.LOCAL, pin.Convention.WORLD
    state = (model, data, w.q, w.v, w.tau)
    tails = ((), (local,), (world,), (forces,), (forces, world))
    # The last form is the loop's own, so that the motion goes on as if nothing had been timed.
    return {
        name: seconds_per_call(pin.aba, *state, *tail)
        for name, tail in zip(ABA, tails, strict=True)
    }


def cycle(duration, samples, bar):
    """Add to `samples` what every part costs along one cycle [s]."""
    main, ideal, rk4 = (
        Stepper(case, duration=duration)
        for case in (Case(), Case(radial=0.0), Case(integrator="rk4"))
    )
    pieces = main.run.steps // CHUNK
    euler, empty = kernel.compiled(kernel.semi_implicit_euler), kernel.compiled(nothing)
    probe = Stepper(Case(), step=STANDSTILL, duration=STANDSTILL * pieces * CALLS)

    def note(name, seconds):
        samples.setdefault(name, []).append(seconds)

    for _ in range(pieces):
        note(STEP, main.advance(CHUNK))
        for name, seconds in bare_calls(main).items():
            note(name, seconds)
        note(IDEAL, ideal.advance(CHUNK))
        note(RK4, rk4.advance(CHUNK // 4))
        note(CALL, seconds_per_call(empty, probe.workspace.table))
        probe.workspace.q[:], probe.workspace.v[:] = main.workspace.q, main.workspace.v
        seconds = seconds_per_call(euler, probe.workspace.table)
        touching = int(np.count_nonzero(probe.workspace.memory[0, :, kernel._NORMAL]))
        note(f"kernel alone, {touching or 'no'} contact{'s' * (touching != 1)}", seconds)
        bar.update()


def draw(costs, fastest, ratio):
    figure, axes = new_figure(1, 1, 8.0, 4.6)
    panel = axes[0, 0]
    names = list(costs)[::-1]
    low, middle, high = np.array([costs[name] for name in names]).T
    colours = [COLOURS[FAMILY.get(name, KERNEL_FAMILY)] for name in names]
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
    benchmark = Benchmark("step_cost", __doc__, runs=0)
    add = benchmark.parser.add_argument
    add("--repeats", type=int, default=5, metavar="N", help="cycles (default: %(default)s)")
    add("--check", type=float, metavar="LIMIT", help="exit with status 1 if the ratio is above")
    args = benchmark.parse()
    duration, repeats = (1.0, 2) if args.quick else (3.0, args.repeats)
    pieces = round(duration / Case().step) // CHUNK
    samples: dict[str, list[float]] = {}
    with tqdm(total=repeats * pieces, unit="piece") as bar:
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
    print(f"ratio {ratio:.2f}")
    if args.check is not None and ratio > args.check:
        sys.exit(1)


if __name__ == "__main__":
    main()
