"""Error per CPU second of every integrator. See docs/integrators.md.

Impacts magnify small differences, so errors are measured where they mean something: in the first
0.1 s, before trajectories part, against a reference of a far smaller step; over the whole cycle
only the energy balance and the statistics of perturbed runs are compared. How far the reference is
from one by the multi-rate method is said, for no method should judge alone.
"""

import time
from dataclasses import asdict, replace
from functools import partial
from itertools import product

import numpy as np
from common import (
    COLOURS,
    MARKERS,
    QUANTITIES,
    Benchmark,
    Case,
    ensembles,
    measure,
    millimetres,
    new_figure,
    runs_as_rows,
    spread,
)
from matplotlib.ticker import NullFormatter

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.physics.kernel.constants import DEFAULT, INTEGRATORS

CLEARANCES = (0.2e-3, 0.5e-3)
STEPS = (4e-5, 2e-5, 1e-5, 5e-6, 2.5e-6)
REFERENCE = ("rk4", 5e-7)
WINDOW = 0.1
"""Length of the run whose error is measured [s]; it holds eight to ten contacts."""
REPEATS = 3
CYCLE = (
    {"energy_residual_J": "energy residual [J]"}
    | {name: QUANTITIES[name] for name in ("peak_contact_N", "peak_force_N")}
    | {"impacts": "impacts in 3 s"}
)
"""What is measured over the whole cycle."""
CYCLE_EVALUATIONS = 3e6
"""Evaluations of the acceleration that a run of the whole cycle may cost."""

MACRO = 10
"""Steps of a macro step where the multi-rate method judges."""


def positions(case, **options):
    """Positions of the journal and of the tool in the window [m]."""
    result = case.simulation(0, duration=WINDOW, **options).run()
    return result["journal_centre"].values[:, 0], result["tool_position"].values


def cpu_time(case):
    """CPU seconds of the window's time loop."""
    run = jp.Run(case.simulation(0, duration=WINDOW))
    started = time.process_time()
    run.run_to_end()
    return time.process_time() - started


def accuracy(cases, references, repeats):
    """Error in the window, and CPU per simulated second: the least of interleaved repeats."""
    truth = {radial: positions(case) for radial, case in references.items()}
    for radial, case in references.items():
        other = positions(replace(case, integrator=DEFAULT), macro_step=MACRO * case.step)
        apart = 1e6 * np.linalg.norm(other[0] - truth[radial][0], axis=1).max()
        print(f"references by rk4 and multi-rate at {millimetres(radial)} mm: {apart:.2g} µm apart")
    found = [{"cpu_s_per_s": np.inf} for _ in cases]
    with ProgressBar(total=len(cases) * (repeats + 1), unit="windows") as bar:
        for case, figures in zip(cases, found, strict=True):
            pairs = zip(positions(case), truth[case.radial], strict=True)
            figures["journal_error_um"], figures["tool_error_um"] = (
                1e6 * np.linalg.norm(position - true, axis=1).max() for position, true in pairs
            )
            bar.update()
        for _, (case, figures) in product(range(repeats), zip(cases, found, strict=True)):
            figures["cpu_s_per_s"] = min(figures["cpu_s_per_s"], cpu_time(case) / WINDOW)
            bar.update()
    return found


def draw(cases, window_found, cycles, ensemble):
    figure, axes = new_figure(2, 3, 12.0, 7.2)
    axes[0, 2].set_visible(False)
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
            (axes[1, 1], "peak_force_N", [1e6 * case.step for case, _ in long]),
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
    axes[1, 0].set_yscale("log")
    per_second, step = "CPU time per simulated second [s]", "step [µs]"
    labels = (
        (per_second, "largest journal error in 0.1 s [µm]"),
        (per_second, "largest tool error in 0.1 s [µm]"),
        ("CPU time of the 3 s cycle [s]", "largest energy residual [J]"),
        (step, CYCLE["peak_force_N"]),
        (step, CYCLE["impacts"]),
    )
    for panel, (x, y) in zip((*axes[0, :2], *axes[1]), labels, strict=True):
        panel.set(xlabel=x, ylabel=y)
    axes[1, 0].xaxis.set_minor_formatter(NullFormatter())
    for panel in axes[1, 1:]:
        panel.set_ylim(bottom=0)
        panel.set_xticks([1e6 * step for step in STEPS], [f"{1e6 * step:g}" for step in STEPS])
        panel.minorticks_off()
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure


def report(benchmark, cases, found, cycles, ensemble):
    errors = dict(zip(cases, found, strict=True))
    runs = dict(zip(cycles, ensemble, strict=True))
    rows = [
        [
            millimetres(case.radial),
            case.integrator,
            f"{1e6 * case.step:g}",
            f"{figures['cpu_s_per_s']:.2f}",
            f"{figures['journal_error_um']:.2g}",
            f"{figures['tool_error_um']:.2g}",
            *(spread(runs[case][name]) if case in runs else "" for name in CYCLE),
        ]
        for case, figures in errors.items()
    ]
    data = [
        row | figures
        for case, figures in errors.items()
        for row in (runs_as_rows([case], [runs[case]]) if case in runs else [asdict(case)])
    ]
    benchmark.finish(
        [
            "clearance [mm]",
            "integrator",
            "step [µs]",
            "CPU per simulated second [s]",
            "journal error [µm]",
            "tool error [µm]",
            *CYCLE.values(),
        ],
        rows,
        data,
        draw(cases, found, cycles, ensemble),
    )
    usual = min((case.step for case in cases), key=lambda step: abs(step - jp.Simulation.step))
    said = [
        f"{case.integrator} {one['journal_error_um']:.2g} µm for {one['cpu_s_per_s']:.2f} s/s"
        for case, one in errors.items()
        if (case.step, case.radial) == (usual, cases[0].radial)
    ]
    print(f"steps of {1e6 * usual:g} µs: {', '.join(said)}")


def main():
    benchmark = Benchmark("integrators", __doc__)
    args = benchmark.parse()
    steps, radii = (STEPS[:2], CLEARANCES[:1]) if args.quick else (STEPS, CLEARANCES)
    methods = list(INTEGRATORS)
    cases = [
        Case(radial, radial, integrator=method, step=step)
        for radial, method, step in product(radii, methods, steps)
    ]
    references = {
        radial: Case(radial, radial, integrator=REFERENCE[0], step=REFERENCE[1]) for radial in radii
    }
    found = accuracy(cases, references, 1 if args.quick else REPEATS)
    cycles = [
        case
        for case in cases
        if 3.0 / case.step * INTEGRATORS[case.integrator].stages <= CYCLE_EVALUATIONS
    ]
    # The whole cycle, with the fall that all integrators must follow.
    whole = partial(measure, judge_from=0.0)
    runs = ensembles(cycles, args.runs, args.jobs, whole)
    report(benchmark, cases, found, cycles, runs)
