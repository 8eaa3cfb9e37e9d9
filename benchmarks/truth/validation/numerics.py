"""Numerics: order, work, step size, energy, chaos, ensembles."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from common import COLOURS, MARKERS, Case, completed, new_figure
from robots import FREE, body, flying, joint, urdf
from scipy import stats
from scipy.optimize import brentq
from truth.validation import Outcome, Rows, case, off
from truth.validation.pendulum import ARM, GRAVITY, INERTIA, MASS, Pendulum, resting

import jointplay as jp
from jointplay.study.nonlinear.lyapunov import exponent, stretching

METHODS = ("multi-rate", "semi-implicit-euler", "rk4")
MACRO = 4
"""Steps of a macro step where the order of the multi-rate method is measured."""
WRONG_GRAVITY = 9.80665


def plain_ticks(panel, values) -> None:
    """Ticks of a logarithmic x axis at `values` alone."""
    panel.set_xticks(values, [f"{value:g}" for value in values])
    panel.set_xticks([], minor=True)


# --- order of convergence -----------------------------------------------------------------


@dataclass(frozen=True)
class Situation:
    """Short motions whose error falls with the step."""

    pendulum: Pendulum
    duration: float
    steps: tuple[float, ...]
    orders: tuple[float, float, float]
    """Expected of `METHODS`."""

    def starts(self, number: int) -> list[tuple[np.ndarray, float]]:
        """States, and approach speeds of contacts that have begun already."""
        phases = (np.arange(number) + 0.5) / number
        play = self.pendulum.play
        if play > 1e-3:
            return [(np.array([0.0, 0.0, 0.3 + p, 0.1, -0.2, 10.0]), 0.0) for p in phases]
        if self.duration < 3e-3:  # strikes after 50 to 90 µs
            away = play - 5e-6 - 4e-6 * phases
            return [(np.array([x, 0.0, 0.4, 0.1, 0.03, -0.5]), 0.0) for x in away]
        rest = resting(self.pendulum, 0.4)
        return [(rest + np.array([0, 0, 0, 2e-3, 0, -0.4 * p]), 2e-3) for p in phases]


SITUATIONS = {
    "free flight": Situation(
        Pendulum(stiffness=1e3, play=0.5, bore=1.0), 0.1, (4e-3, 2e-3, 1e-3, 5e-4), (2.0, 1.0, 4.0)
    ),
    "through one impact": Situation(
        Pendulum(mu=0.0), 2e-3, (4e-5, 2e-5, 1e-5, 5e-6, 2.5e-6), (2.0, 1.0, 2.5)
    ),
    "lasting contact, smooth": Situation(
        Pendulum(mu=0.0), 4e-3, (4e-5, 2e-5, 1e-5, 5e-6), (2.0, 1.0, 4.0)
    ),
    "lasting contact, friction": Situation(
        Pendulum(mu=0.1), 4e-3, (4e-5, 2e-5, 1e-5, 5e-6, 2.5e-6), (2.0, 1.0, 2.0)
    ),
}


@case(
    origin="integrator",
    title="Order of convergence",
    compared="Journal of a pendulum at the end of a short motion against scipy's DOP853 with "
    "touches located as events, as the step tends to zero: free flight, one impact "
    "(Lankarani-Nikravesh), lasting contact without friction and with that of eq. 21, "
    "whose corners the sliding speed crosses. Expected are 2 for multi-rate, 1 for "
    "semi-implicit Euler; for rk4 4 where the force is smooth, 2.5 where it begins as "
    "delta^1.5 between two steps, 2 at corners.",
    measures="largest shortfall of an observed order",
    wrong="the reference has g = 9.80665 m/s^2",
)
def order(quick: bool = False, wrong: bool = False) -> Outcome:
    number = 2 if quick else 8
    rows = Rows("situation", "integrator", "order expected|g", "observed|.2f",
                "error at finest step [µm]|.2g")  # fmt: skip
    figure, axes = new_figure(1, 4, 11.0, 3.4)
    for panel, (title, situation) in zip(axes.flat, SITUATIONS.items(), strict=True):
        pendulum = situation.pendulum
        truth = replace(pendulum, gravity=WRONG_GRAVITY) if wrong else pendulum
        starts = situation.starts(number)
        ends = [
            truth.solve(state, situation.duration, "DOP853", 1e-12, approach=approach).states[0]
            for state, approach in starts
        ]
        for method, expected, colour, marker in zip(
            METHODS, situation.orders, COLOURS, MARKERS, strict=False
        ):
            errors = []
            for step in situation.steps:
                squares = []
                for (state, approach), end in zip(starts, ends, strict=True):
                    macro = {"macro_step": MACRO * step} if method == METHODS[0] else {}
                    run = pendulum.run(state, situation.duration, step, method, **macro)
                    run.workspace.contacts["ddelta0"] = approach
                    run.workspace.contacts["steps"] = float(approach > 0.0)
                    run.run_to_end()
                    squares.append(np.sum((run.workspace.q[:2] - end[:2]) ** 2))
                errors.append(math.sqrt(np.mean(squares)))
            observed = np.polyfit(np.log(situation.steps), np.log(errors), 1)[0]
            short = (expected - observed,)
            rows.add(title, method, expected, observed, 1e6 * errors[-1], errors=short)
            panel.loglog(
                1e6 * np.array(situation.steps), 1e6 * np.array(errors), marker + "-", ms=4, lw=1,
                color=colour, label=f"{method}: {observed:.2f}",
            )  # fmt: skip
        panel.set(xlabel="step [µs]", title=title)
        plain_ticks(panel, 1e6 * np.array(situation.steps))
        panel.title.set_fontsize(9)
        panel.legend(fontsize=7)
    axes[0, 0].set_ylabel("error of the journal's place [µm]")
    return rows.outcome(0.3, figure)


# --- error per work -----------------------------------------------------------------------

BOUNCING = np.array([0.5e-4, -1e-4, 0.4, 0.02, 0.03, -0.5])
TIED = 50
"""Steps of a macro step where both are refined together: then neither error is the larger."""
EQUAL_UM = (0.1, 0.01, 0.001)
"""Errors at which costs are compared [µm]."""
ROWS = {
    "multi-rate": ("multi-rate", 1, (4e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6)),
    f"multi-rate, {TIED} steps a macro step": (
        "multi-rate", TIED, (1e-5, 5e-6, 2e-6, 1e-6, 5e-7, 2.5e-7),
    ),
    "semi-implicit-euler": ("semi-implicit-euler", 1, (4e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6)),
    "rk4": ("rk4", 1, (4e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6)),
}  # fmt: skip
"""Integrator, steps of a macro step (1: its own choice), and steps [s]."""
SCIPY = {"DOP853": (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10), "Radau": (1e-3, 1e-5, 1e-7, 1e-10)}


def bounces(number: int) -> list[np.ndarray]:
    """Starts within 2 % of `BOUNCING`, the first at it: where in a step touches fall is chance."""
    random = np.random.default_rng(1)
    others = [BOUNCING * (1.0 + random.uniform(-0.02, 0.02, 6)) for _ in range(number - 1)]
    return [BOUNCING, *others]


def distances(ends: Sequence[np.ndarray], true: Sequence[np.ndarray]) -> float:
    """RMS of the distances of journals [m]."""
    away = [np.linalg.norm(end[:2] - other[:2]) for end, other in zip(ends, true, strict=True)]
    return float(np.sqrt(np.mean(np.square(away))))


def stepped(
    pendulum: Pendulum, starts: list, duration: float, step: float, row: str
) -> tuple[list[np.ndarray], int, float]:
    """Ends of runs from all starts, evaluations of the forces in one, least CPU time [s]."""
    method, tied, _ = ROWS[row]
    options = {"macro_step": tied * step} if tied > 1 else {}
    ends, spent, calls = [], [], 0
    for start in starts:
        run = pendulum.run(start, duration, step, method, **options)
        begun = time.process_time()
        run.run_to_end()
        spent.append(time.process_time() - begun)
        calls = run.total_steps * max(run.method.stages, 1)
        ends.append(run.workspace.q.copy())
    return ends, calls, min(spent)


def cost_at(error: float, points: list[tuple[float, float, float]]) -> float | None:
    """CPU time of the cheapest way to an error, between its measured points; None outside."""
    best = None
    for (e1, _, t1), (e2, _, t2) in pairwise(points):
        if min(e1, e2) <= error <= max(e1, e2) and e1 != e2:
            part = math.log(error / e1) / math.log(e2 / e1)
            cost = t1 * (t2 / t1) ** part
            best = cost if best is None else min(best, cost)
    return best


def compare_costs(points: dict[str, list]) -> str:
    """How many times as much DOP853 takes at equal error."""
    found = []
    for error in EQUAL_UM:
        own = [cost_at(1e-6 * error, points[row]) for row in ROWS if row.startswith("multi-rate")]
        other = cost_at(1e-6 * error, points["scipy DOP853"])
        known = [cost for cost in own if cost is not None]
        if known and other is not None:
            found.append(f"{other / min(known):.1f} times at {error:g} µm")
    return "CPU time of DOP853 over that of multi-rate at equal error: " + ", ".join(found) + "."


@case(
    origin="integrator",
    title="Error per CPU second",
    compared="A pendulum whose pin bounces five times in its bore in 30 ms, from eight starts: "
    "fixed steps against scipy's DOP853 at rtol 1e-12, with touches and the growth of "
    "the approach speed located as events, and Radau at 1e-10; scipy's own errors and "
    "times at coarser tolerances are shown for comparison. Errors are RMS over the "
    "starts, times the minimum.",
    measures="distance of the journal from DOP853's, rk4 with 1 µs and Radau, over the clearance",
    wrong="the reference has g = 9.80665 m/s^2",
)
def work_precision(quick: bool = False, wrong: bool = False) -> Outcome:
    pendulum, duration = Pendulum(), 0.03
    starts = bounces(1 if quick else 8)
    truth = replace(pendulum, gravity=WRONG_GRAVITY) if wrong else pendulum
    ends = [truth.solve(start, duration, "DOP853", 1e-12).states[0] for start in starts]
    rows = Rows("method", "step or rtol", "error [µm]|.2g", "evaluations|d",
                "CPU [s] per simulated s|.2g")  # fmt: skip
    points: dict[str, list[tuple[float, int, float]]] = {}

    def add(row: str, setting: str, ends_there: list, calls: int, cpu: float) -> tuple[float]:
        error = distances(ends_there, ends)
        points.setdefault(row, []).append((error, calls, cpu / duration))
        rows.add(row, setting, 1e6 * error, calls, cpu / duration)
        return (error / pendulum.play,)

    for row, (method, _, steps) in ROWS.items():
        for step in (1e-5, 1e-6) if quick else steps:
            found = stepped(pendulum, starts, duration, step, row)
            error = add(row, f"{1e6 * step:g} µs", *found)
        if method == "rk4":
            rows.errors += error
    for method, tolerances in SCIPY.items():
        for tolerance in tolerances[-1:] if quick else tolerances:
            solved = [pendulum.solve(start, duration, method, tolerance) for start in starts]
            found = [one.states[0] for one in solved]
            calls = round(np.mean([one.calls for one in solved]))
            cpu = min(one.cpu for one in solved)
            error = add(f"scipy {method}", f"{tolerance:g}", found, calls, cpu)
        if method == "Radau":
            rows.errors += error
    notes = (compare_costs(points),) if not quick else ()
    note = (
        "CPU times of scipy are those of a right-hand side in Python, of the program those of "
        "its compiled loop with Pinocchio called from Python; evaluations compare the methods, "
        "times compare the programs."
    )
    return rows.outcome(1e-5, None, *notes, note)


# --- step size ----------------------------------------------------------------------------


def impact_time(mass: float, stiffness: float, speed: float) -> float:
    """Duration of an elastic impact under Hertz's law [s]: 2.943 (5/4)^(2/5) = 3.218."""
    return 3.218 * (mass**2 / (stiffness**2 * speed)) ** 0.2


IMPACTS = ((2.0, 1e10, 0.1), (0.2, 1e10, 0.5), (2.0, 1e11, 1.0), (50.0, 1e9, 0.2))
"""Mass [kg], stiffness [N/m^1.5], speed [m/s]."""


def bounce(mass, stiffness, speed, step, method, phase, c_e) -> float:
    """Restitution of a free body that strikes its bore; `phase` places the touch in a step."""
    bearing = jp.RevoluteClearance.planar(
        radial_clearance=1e-2, bearing_radius=50e-3, stiffness=stiffness, restitution=c_e,
        friction=jp.contact.Ambrosio(0.0),
    )  # fmt: skip
    lasts = 2.0 * impact_time(mass, stiffness, speed) + 3.0 * step
    run = flying(
        bearing, mass, phase * step * speed, speed, 10.0, duration=lasts, step=step,
        integrator=method, record_every=10**9,
    )  # fmt: skip
    run.run_to_end()
    return -float(run.workspace.v[0]) / speed


@case(
    origin="theory",
    title="Step size for impacts",
    compared="Restitution of single impacts (Lankarani-Nikravesh, c_e = 0.9: closed form 0.9132) "
    "of four masses, stiffnesses and speeds, with N = T/dt steps per impact, T = 3.218 "
    "(m^2/(k^2 v))^(1/5), and the touch anywhere in its step. If T is right, the error "
    "depends on N alone; docs/integrators.md derives a rule from it.",
    measures="largest relative difference between the largest errors of different impacts at the "
    "same N",
    wrong="the speed is left out of T",
)
def step_size(quick: bool = False, wrong: bool = False) -> Outcome:
    counts = (10, 20) if quick else (4, 5, 7, 10, 14, 20, 40, 80)
    impacts = IMPACTS[:2] if quick else IMPACTS
    phases = (np.arange(4 if quick else 10) + 0.5) / (4 if quick else 10)
    asked = (0.9,) if quick else (0.9, 0.5)
    heads = [f"{m}, c_e = {c:g}|.2g" for c in asked for m in METHODS]
    rows, worst, apart = Rows("steps per impact|d", *heads), {}, []
    for c_e, method in product(asked, METHODS):
        a = 0.75 * (1.0 - c_e**2)
        theory = brentq(lambda e, a=a: a * (1 + e) - math.log((1 + a) / (1 - a * e)), 0.1, 1.0)
        lines = []
        for mass, stiffness, speed in impacts:
            lasts = impact_time(mass, stiffness, 0.1 if wrong else speed)
            errors = [
                max(
                    abs(bounce(mass, stiffness, speed, lasts / n, method, p, c_e) - theory)
                    for p in phases
                )
                for n in counts
            ]
            lines.append(errors)
        for n, errors in zip(counts, np.transpose(lines), strict=True):
            apart.append(errors.max() / errors.min() - 1.0)
            worst[method, c_e, n] = errors.max()
    for n in counts:
        rows.add(n, *(worst[m, c, n] for c in asked for m in METHODS))
    rows.errors = apart
    note = "Largest error of the restitution over ten places of the touch within its step."
    return rows.outcome(0.02, None, note)


@case(
    origin="itself",
    title="Largest step that a run accepts",
    compared="The largest step that the program accepts, found by bisection, against a quarter of "
    "the duration of an impact at 0.1 m/s: 3.218 (m^2/(k^2 v))^(1/5) under Hertz's law, pi sqrt("
    "m/k) of a linear spring; m = 1/(1/m + l^2/I) of a pendulum whose pin strikes across its arm.",
    measures="largest relative error of the step",
    wrong="m is the whole mass of the pendulum",
)
def step_check(quick: bool = False, wrong: bool = False) -> Outcome:
    mass = MASS if wrong else 1.0 / (1.0 / MASS + ARM**2 / INERTIA)
    path = urdf(body("arm", MASS, f"{ARM} 0 0", INERTIA), joint("pin", "base", "arm"))
    rows = Rows("law", "stiffness", "largest step accepted [µs]|.3f", "formula [µs]|.3f",
                "relative error|.1e")  # fmt: skip
    for law, stiffness in [
        *((jp.contact.Hertz(), k) for k in (1e8, 1e10, 1e12)),
        *((jp.contact.LinearSpring(k), k) for k in (1e6, 1e8)),
    ]:
        hertz = law.name == "hertz"
        spring = math.pi * math.sqrt(mass / stiffness)
        theory = (impact_time(mass, stiffness, 0.1) if hertz else spring) / 4.0
        bearing = jp.RevoluteClearance.planar(
            radial_clearance=1e-3, normal=law, stiffness=stiffness if hertz else 1e10
        )
        robot = jp.Mechanism(path, {"pin": bearing})

        def accepts(step, robot=robot):
            try:
                jp.Run(jp.Simulation(robot, duration=0.1, step=step, **FREE))
            except jp.JointplayError:
                return False
            return True

        low, high = 0.5 * theory, 4.0 * theory
        for _ in range(8 if quick else 14):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if accepts(middle) else (low, middle)
        error, size = off(low, theory), f"{stiffness:.0e} {'N/m^1.5' if hertz else 'N/m'}"
        rows.add(f"`{law.name}`", size, 1e6 * low, 1e6 * theory, error, errors=(error,))
    note = (
        "The program uses 3 depth/speed for every law; the exact factor is 2.943 for Hertz and "
        "pi for a linear spring."
    )
    return rows.outcome(0.06, None, note)


# --- energy -------------------------------------------------------------------------------


def repeated(motion: jp.Motion, cycles: int) -> jp.Motion:
    """A cycle that ends where it begins, so many times."""
    starts = np.arange(cycles)[:, None] * motion.duration
    times = np.append((starts + motion.times[:-1]).ravel(), cycles * motion.duration)
    places = np.vstack([np.tile(motion.positions[:-1], (cycles, 1)), motion.positions[:1]])
    return jp.Motion(motion.joints, times, places, motion.interpolation)


def swing(job: tuple[str, float, bool]) -> tuple[str, np.ndarray, np.ndarray, float]:
    """Times, error of the balance [J] and largest kinetic energy [J] of a run, losses counted.

    The energies of the pendulum are its own formulas; those of the SCARA the program's.
    """
    name, duration, wrong = job
    if name.startswith("SCARA"):
        base = Case().simulation()
        cycles = round(duration / base.motion.duration)
        result = replace(base, motion=repeated(base.motion, cycles), record_every=1000).run()
        top = float(result["kinetic_energy"].max())
        return name, result.time, result["energy_residual"].values, top
    elastic = "elastic" in name
    pendulum = Pendulum(restitution=1.0, mu=0.0) if elastic else Pendulum()
    state = resting(pendulum, 1.0)
    result = pendulum.run(state, duration, 1e-5, METHODS[0], record_every=100).finish()
    x, y, angle = result["q"].values.T
    vx, vy, turning = result["v"].values.T
    wx, wy = vx - ARM * turning * np.sin(angle), vy + ARM * turning * np.cos(angle)
    kinetic = 0.5 * MASS * (wx**2 + wy**2) + 0.5 * INERTIA * turning**2
    potential = -MASS * (9.7 if wrong else GRAVITY) * (x + ARM * np.cos(angle))
    depth = np.maximum(np.hypot(x, y) - pendulum.play, 0.0)
    stored = 0.4 * pendulum.stiffness * depth**2.5
    lost = result["normal_dissipation"].values + result["friction_dissipation"].values
    total = kinetic + potential + stored + lost
    return name, result.time, total - total[0], float(kinetic.max())


@case(
    origin="theory",
    title="Energy over a minute",
    compared="Kinetic, potential and elastic energy (2/5 k delta^(5/2)) of a swinging pendulum "
    "with clearance, from formulas written for this case, plus the losses in impacts "
    "and friction, against their value at the start; for the SCARA (0.2 mm, 20 cycles) "
    "from the program's own energy balance. Semi-implicit Euler, 10 µs.",
    measures="largest error of the balance over the largest kinetic energy",
    wrong="g is 9.7 m/s^2 in the potential energy",
)
def energy(quick: bool = False, wrong: bool = False) -> Outcome:
    duration = 1.2 if quick else 60.0
    jobs = [
        ("pendulum, damped, friction", duration, wrong),
        ("pendulum, elastic", min(duration, 6.0), wrong),
    ]
    if not quick:
        jobs.insert(0, ("SCARA, 0.2 mm", duration, wrong))
    runs = jp.Study(jobs, swing).run(jobs=1 if quick else None)
    rows = Rows("mechanism", "duration [s]|g", "largest error [J]|.2g",
                "largest kinetic energy [J]|.3g", "relative|.1e", "drift [J/s]|.1e")  # fmt: skip
    figure, axes = new_figure(len(runs), 1, 7.0, 1.9 * len(runs))
    for panel, (name, times, balance, exchanged), colour in zip(
        axes.flat, runs, COLOURS, strict=False
    ):
        worst = float(np.abs(balance).max())
        drift, error = np.polyfit(times, balance, 1)[0], worst / exchanged
        rows.add(name, times[-1], worst, exchanged, error, drift, errors=(error,))
        panel.plot(times, 1e3 * balance, color=colour, lw=0.7)
        panel.set(ylabel="error [mJ]", title=f"{name}: kinetic energy up to {exchanged:.3g} J")
        panel.title.set_fontsize(9)
    axes[-1, 0].set_xlabel("time [s]")
    note = (
        "The SCARA's error grows evenly with the cycles: it comes from friction in a jammed "
        "journal, which the step does not resolve (docs/integrators.md). The pendulum's rises "
        "and falls with its speed and does not grow."
    )
    return rows.outcome(2e-3 if quick else 2e-2, figure, *(() if quick else (note,)))


# --- chaos --------------------------------------------------------------------------------


def toppling(upright: float) -> jp.Simulation:
    """A pendulum without clearance, gravity along -x, and so upright at the angle zero."""
    path = urdf(body("arm", MASS, f"{ARM} 0 0", INERTIA), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, gravity=(-GRAVITY * upright, 0, 0))
    return jp.Simulation(
        robot, duration=8.0, step=1e-4, integrator="rk4", record_every=10**9, **FREE
    )


def scara_stretching(job: tuple[float, int]) -> np.ndarray:
    """Growth in every cycle of 3 s [1/s], shape (cycles,)."""
    play, cycles = job
    base = replace(Case(radial=play, axial=play).simulation(), record_every=10**9)
    duration = cycles * base.motion.duration
    simulation = replace(base, motion=repeated(base.motion, cycles), duration=duration)
    growth = stretching(simulation, 0.01)
    return growth.reshape(cycles, -1)


@case(
    origin="theory",
    title="Largest Lyapunov exponent",
    compared="Benettin's method (G. Benettin et al., Meccanica 15 (1980) 9-20): two "
    "trajectories, 1 nm apart, rescaled to that distance every 10 ms. A pendulum "
    "balanced upright has the exponent sqrt(m g l/(I + m l^2)), which the method must "
    "find. Then the paper's SCARA, weight balanced, over six cycles after the first.",
    measures="relative error of the upright pendulum's exponent",
    wrong="the square root is left out",
)
def lyapunov(quick: bool = False, wrong: bool = False) -> Outcome:
    square = MASS * GRAVITY * ARM / (INERTIA + MASS * ARM**2)
    theory = square if wrong else math.sqrt(square)
    growth = stretching(toppling(1.0), 0.01)
    found = growth[len(growth) // 4 :].mean() / 0.01
    rows = Rows("mechanism", "largest exponent [1/s]|.5f", "95 % interval", "theory|.5f")
    rows.add("upright pendulum", found, "", theory, errors=(off(found, theory),))
    figure, notes = None, []
    if not quick:
        cycles = 7
        figure, axes = new_figure(1, 2, 9.0, 3.4)
        plays = (0.2e-3, 0.5e-3)
        for play, growths, colour in zip(
            plays,
            jp.Study([(play, cycles) for play in plays], scara_stretching).run(),
            COLOURS,
            strict=False,
        ):
            found_here = exponent(growths[1:].sum(axis=1), 3.0)
            half = found_here.high - found_here.value
            label = f"{1e3 * play:g} mm"
            mean = found_here.value
            interval = f"{mean - half:.1f} to {mean + half:.1f}"
            rows.add(f"SCARA, {label}", f"{mean:.1f}", interval, "")
            grown = np.cumsum(growths[1:].ravel()) / (0.01 * np.arange(1, growths[1:].size + 1))
            at = 0.01 * np.arange(1, grown.size + 1)
            axes[0, 0].plot(at, grown, color=colour, lw=1, label=label)
            axes[0, 1].plot(
                0.01 * np.arange(growths.shape[1]), growths[1:].mean(axis=0) / 0.01, color=colour,
                lw=0.8, label=label,
            )  # fmt: skip
            notes.append(
                f"SCARA, {label}: {mean:.1f} per second. A difference grows tenfold in "
                f"{1e3 * math.log(10) / mean:.0f} ms on the average; rounding (1e-16 of a metre) "
                f"has grown to 1 µm after about {math.log(1e10) / mean:.1f} s."
                if mean - half > 0
                else f"SCARA, {label}: {mean:.1f} per second; the interval includes zero or less: "
                "each stroke wedges the journal again, which removes at least as much of a "
                "difference as impacts add."
            )
        axes[0, 0].set(xlabel="time averaged over [s]", ylabel="mean growth [1/s]")
        axes[0, 1].set(xlabel="time in the cycle [s]", ylabel="growth, mean of the cycles [1/s]")
        axes[0, 0].legend(title="clearance")
        axes[0, 1].axhline(0.0, color="0.5", lw=0.6)
        notes.append(
            "Intervals are Student's, from the six cycles after the first, assumed independent. "
            "Locally the growth is very uneven, as the right-hand figure shows."
        )
    return rows.outcome(1e-3, figure, *notes)


# --- ensembles ----------------------------------------------------------------------------

FIGURES = {
    "peak joint force [N]": lambda r: np.linalg.norm(r["joint_force_peak"][:, 0], axis=1).max(),
    "rms eccentricity [µm]": lambda r: (
        1e6 * math.sqrt(float((r["journal_centre"][:, 0, :2] ** 2).sum("axis").mean()))
    ),
    "lost in impacts [mJ]": lambda r: 1e3 * float(r["normal_dissipation"][-1]),
    "lost in friction [mJ]": lambda r: 1e3 * float(r["friction_dissipation"][-1]),
    "impacts": lambda r: r.audit.impacts,
}


def figures_of(job: tuple[int, float, float]) -> list[float]:
    """Run the SCARA once: seed, clearance [m], duration [s]."""
    seed, play, duration = job
    result = completed(Case(radial=play, axial=play).simulation(seed, duration=duration).run())
    return [float(function(result)) for function in FIGURES.values()]


def mean_and_interval(values: np.ndarray) -> tuple[float, float]:
    half = stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    return float(values.mean()), float(half)


@case(
    origin="itself",
    title="Ensembles",
    compared="Figures of the SCARA's cycle from two disjoint sets of random starts (journal "
    "displaced by up to half of its clearances). Single runs cannot be compared, but "
    "means can: the sets must agree within their scatter (Welch's t).",
    measures="largest |t| of a figure between the two sets; 4.1 is exceeded once in a thousand "
    "by chance (14 degrees of freedom)",
    wrong="the second set has another clearance",
)
def ensembles(quick: bool = False, wrong: bool = False) -> Outcome:
    runs, duration = (4, 0.2) if quick else (8, 3.0)
    plays = (0.5e-3,) if quick else (0.2e-3, 0.5e-3)
    rows = Rows("clearance [mm]|g", "figure", "set 1", "set 2", "t|.1f")
    jobs: list[tuple[int, float, float]] = []
    for play in plays:
        other = (0.2e-3 if play > 0.3e-3 else 0.5e-3) if wrong else play
        jobs += [(seed, play if seed < runs else other, duration) for seed in range(2 * runs)]
    found = np.array(jp.Study(jobs, figures_of).run(jobs=1 if quick else None))
    for play, pair in zip(plays, found.reshape(len(plays), 2, runs, -1), strict=True):
        for k, name in enumerate(FIGURES):
            t = abs(stats.ttest_ind(*pair[:, :, k], equal_var=False).statistic)
            texts = ["{:.4g} ± {:.2g}".format(*mean_and_interval(group)) for group in pair[:, :, k]]
            rows.add(1e3 * play, name, *texts, t, errors=(t,))
    note = "Means with Student's 95 % interval of the mean."
    return rows.outcome(5.0 if quick else 4.1, None, note)
