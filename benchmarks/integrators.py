"""Error per CPU second of every integrator, and its observed order. See docs/integrators.md.

Contact makes the motion chaotic, so errors are measured where they mean something: in the first
0.1 s, before trajectories part, against a reference of a far smaller step; over the whole cycle
only the energy balance and the statistics of perturbed runs are compared.
"""

import time
from itertools import product

import numpy as np
from common import (
    COLOURS,
    JOINT,
    MARKERS,
    Benchmark,
    Case,
    ensembles,
    millimetres,
    new_figure,
    runs_as_rows,
    spread,
)
from tqdm import tqdm

import jointplay as jp
from jointplay.integrators import INTEGRATORS
from jointplay.result import assemble
from jointplay.simulation import Run

CLEARANCES = (0.2e-3, 0.5e-3)
STEPS = (4e-5, 2e-5, 1e-5, 5e-6, 2.5e-6)
REFERENCE = ("rk4", 5e-7)
WINDOW = 0.1
"""Length of the run whose error is measured [s]; it holds six or seven impacts."""
REPEATS = 3
CYCLE_EVALUATIONS = 3e6
"""Evaluations of the acceleration that a run of the whole cycle may cost."""

FREE, IMPACT, LASTING = "free flight", "one impact", "lasting contact"
ORDER_STEPS = {
    FREE: (2e-4, 1e-4, 5e-5, 2.5e-5),
    IMPACT: (4e-5, 2e-5, 1e-5, 5e-6, 2.5e-6),
    LASTING: (2e-5, 1e-5, 5e-6, 2.5e-6),
}


DURATION = {FREE: 0.02, IMPACT: 0.002, LASTING: 0.004}
"""Until when the order is measured [s]."""


def window(case, seed=0):
    """Tool and journal positions in the window [m], and CPU seconds of its time loop."""
    simulation = case.simulation(seed, duration=WINDOW)
    run = Run(simulation)
    started = time.process_time()
    status = run.loop()
    cpu = time.process_time() - started
    result = assemble(simulation, run.workspace, status, "", cpu)
    return result["tool_position"].values, result["journal_centre"].values[:, 0], cpu


def accuracy(cases, references, repeats):
    """Error in the window and CPU per simulated second, the least of interleaved repeats."""
    truth = {radial: window(case) for radial, case in references.items()}
    found = [{"cpu_s_per_s": np.inf} for _ in cases]
    for _ in range(repeats):
        for case, figures in zip(tqdm(cases, unit="window"), found, strict=True):
            *positions, cpu = window(case)
            figures["cpu_s_per_s"] = min(figures["cpu_s_per_s"], cpu / WINDOW)
            for name, position, true in zip(
                ("tool_error_um", "journal_error_um"), positions, truth[case.radial], strict=False
            ):
                figures[name] = 1e6 * np.linalg.norm(position - true, axis=1).max()
    return found


def settled(case):
    """State of the loaded robot, held until its journal has come to rest wedged."""
    run = Run(held(case, 0.5))
    run.loop()
    return run.workspace.q.copy(), np.zeros_like(run.workspace.v)


def held(case, duration):
    """Simulate `case` with a reference that stands still: no force but the drive's and contact."""
    base = case.simulation()
    stand = base.motion.positions[:1]
    return jp.Simulation(
        base.mechanism,
        jp.Motion(base.motion.joints, (0.0, 1.0), np.vstack([stand, stand])),
        duration=duration,
        step=case.step,
        integrator=case.integrator,
    )


def order_error(situation, method, step, state):
    """Position of the journal at the end of a short motion [m]."""
    case = Case(integrator=method, step=step, loaded=situation == LASTING)
    simulation = held(case, DURATION[situation])
    mechanism = simulation.mechanism
    if situation == FREE:  # room, and contacts so soft that a coarse step is accepted
        bearing = jp.ClearanceJoint(
            radial_clearance=2e-3, axial_clearance=2e-3, stiffness=1e3, bearing_length=60e-3
        )
        mechanism = mechanism.with_clearance({JOINT: bearing})
        simulation = jp.Simulation(
            mechanism,
            simulation.motion,
            duration=simulation.duration,
            step=step,
            integrator=method,
        )
    run = Run(simulation)
    q, v, first = run.workspace.q, run.workspace.v, mechanism.virtual_link(JOINT)
    if state is not None:
        q[:], v[:] = state
    if situation == IMPACT:  # tilted, so that one end strikes
        q[first + 4] = 5e-3
        v[first : first + 2] = 0.1, 0.03
    else:
        v[mechanism.coordinate("joint_a")] = 0.2
    run.loop()
    onsets = int(run.workspace.contact_statistics()["onsets"].sum())
    return run.workspace.q[first : first + 3].copy(), onsets


def orders(methods):
    """Errors of the journal's final position [m] by situation and method, over the step."""
    found = {}
    for situation, steps in ORDER_STEPS.items():
        state = settled(Case(loaded=True)) if situation == LASTING else None
        truth, onsets = order_error(situation, "rk4", steps[-1] / 16, state)
        for method in methods:
            ends = [order_error(situation, method, step, state) for step in steps]
            errors = np.array([np.linalg.norm(end - truth) for end, _ in ends])
            slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
            found[situation, method] = (steps, errors, slope, onsets)
    return found


def draw(cases, window_found, cycles, ensemble, order):
    figure, axes = new_figure(2, 3, 12.0, 7.2)
    methods = list(INTEGRATORS)
    cpu = {case: figures["cpu_s_per_s"] for case, figures in zip(cases, window_found, strict=True)}
    for index, (method, radial) in enumerate(product(methods, CLEARANCES)):
        style = {
            "color": COLOURS[index // len(CLEARANCES)],
            "marker": MARKERS[index % len(CLEARANCES)],
            "ls": ("-", "--")[index % len(CLEARANCES)],
            "label": f"{method}, {millimetres(radial)} mm",
            "ms": 5,
            "lw": 1.2,
        }

        def mine(case, method=method, radial=radial):
            return (case.integrator, case.radial) == (method, radial)

        short = [(case, f) for case, f in zip(cases, window_found, strict=True) if mine(case)]
        for panel, name in zip(axes[0, :2], ("journal_error_um", "tool_error_um"), strict=True):
            panel.loglog([cpu[case] for case, _ in short], [f[name] for _, f in short], **style)
        long = [(case, runs) for case, runs in zip(cycles, ensemble, strict=True) if mine(case)]
        for panel, name, x in (
            (axes[1, 0], "energy_residual_J", [3.0 * cpu[case] for case, _ in long]),
            (axes[1, 1], "peak_contact_N", [1e6 * case.step for case, _ in long]),
            (axes[1, 2], "impacts", [1e6 * case.step for case, _ in long]),
        ):
            groups = [runs[name] for _, runs in long]
            panel.errorbar(
                x,
                [group.mean() for group in groups],
                [group.std(ddof=1) for group in groups],
                capsize=3,
                **style,
            )
            panel.set_xscale("log")
    for index, ((situation, method), (steps, errors, slope, _)) in enumerate(order.items()):
        axes[0, 2].loglog(
            [1e6 * step for step in steps],
            1e6 * errors,
            color=COLOURS[methods.index(method)],
            marker=MARKERS[index // len(methods)],
            ls=("-", "--", ":")[index // len(methods)],
            lw=1.2,
            ms=5,
            label=f"{situation}, {method}: order {slope:.1f}",
        )
    axes[1, 0].set_yscale("log")
    for panel, x, y in zip(
        axes.flat,
        ("CPU time per simulated second [s]",) * 2
        + ("step [µs]", "CPU time of the 3 s cycle [s]", "step [µs]", "step [µs]"),
        (
            "largest journal error in 0.1 s [µm]",
            "largest tool error in 0.1 s [µm]",
            "journal error at the end [µm]",
            "largest energy residual [J]",
            "peak force of one contact [N]",
            "impacts in 3 s",
        ),
        strict=True,
    ):
        panel.set_xlabel(x)
        panel.set_ylabel(y)
    axes[0, 2].legend(fontsize=7, frameon=False)
    for panel in axes[1, 1:]:
        panel.set_ylim(bottom=0)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure


def main():
    benchmark = Benchmark("integrators", __doc__)
    args = benchmark.parse()
    steps = STEPS[:3] if args.quick else STEPS
    methods = list(INTEGRATORS)
    cases = [
        Case(radial, radial, integrator=method, step=step)
        for radial, method, step in product(CLEARANCES, methods, steps)
    ]
    references = {
        radial: Case(radial, radial, integrator=REFERENCE[0], step=REFERENCE[1])
        for radial in CLEARANCES
    }
    found = accuracy(cases, references, 1 if args.quick else REPEATS)
    order = orders(methods)
    cycles = [
        case
        for case in cases
        if 3.0 / case.step * INTEGRATORS[case.integrator].stages <= CYCLE_EVALUATIONS
    ]
    ensemble = dict(zip(cycles, ensembles(cycles, args.runs, args.jobs), strict=True))
    rows = []
    for case, figures in zip(cases, found, strict=True):
        runs = ensemble.get(case)
        names = ("energy_residual_J", "peak_contact_N", "peak_force_N", "impacts")
        rows.append(
            [
                millimetres(case.radial),
                case.integrator,
                f"{1e6 * case.step:g}",
                f"{figures['cpu_s_per_s']:.2f}",
                f"{figures['journal_error_um']:.2g}",
                f"{figures['tool_error_um']:.2g}",
                *("" if runs is None else spread(runs[name]) for name in names),
            ]
        )
    benchmark.finish(
        [
            "clearance [mm]",
            "integrator",
            "step [µs]",
            "CPU per simulated second [s]",
            "journal error [µm]",
            "tool error [µm]",
            "energy residual [J]",
            "peak force of one contact [N]",
            "peak joint force [N]",
            "impacts",
        ],
        rows,
        runs_as_rows(cycles, list(ensemble.values())),
        draw(cases, found, cycles, ensemble.values(), order),
    )
    for (situation, method), (_, _, slope, onsets) in order.items():
        print(f"observed order in {situation} ({onsets} contacts begun): {method} {slope:.2f}")


if __name__ == "__main__":
    main()
