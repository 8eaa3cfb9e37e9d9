"""What it costs to make time histories of a run's records, in microseconds per record.

Each mechanism runs for 20 000 steps with a record at every one; then its records are turned into a
result again and again. The parts are timed alone: the motion of the bodies with its energies and
poses, and the forces in the joints, which only ideal mechanisms need. What a result costs even if
it has a single record is a column of its own. Times are CPU times; the table gives medians.
"""

import dataclasses
import sys
import time

import numpy as np
from common import Benchmark
from cost.mechanism_cost import scara, slider_crank

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.physics.kernel import Status
from jointplay.simulation.result import histories, variables

WHOLE, MOTION, FORCES = "whole result", "motion of the bodies", "forces in the joints"


def simulations(records):
    """Every mechanism's simulation by name, a record at each of its steps."""
    options = {"duration": 1e-5 * records, "record_every": 1}
    built = {
        "SCARA, ideal": scara(),
        "SCARA, B": scara("joint_b"),
        "SCARA, A and B": scara("joint_a", "joint_b"),
        "slider-crank, ideal": slider_crank(None),
        "slider-crank, planar": slider_crank(jp.RevoluteClearance.planar(radial_clearance=0.5e-3)),
    }
    found = {
        name: jp.Simulation(mechanism, motion, **{"start": "centred"} | more, **options)
        for name, (mechanism, motion, more) in built.items()
    }
    scenario = jp.Scenario.load("jointplay:four_bar.toml")
    for case in ("ideal", "0.2 mm"):
        simulation = scenario.simulation(case)
        short = {"duration": simulation.step * records, "record_every": 1}
        found[f"four-bar, {case}"] = dataclasses.replace(simulation, **short)
    return found


def seconds(function, *arguments):
    started = time.thread_time()
    function(*arguments)
    return time.thread_time() - started


def measure(simulation, repeats, bar):
    """CPU seconds per record of each part, and of a result of one record, (repeats,) each."""
    run = jp.Run(simulation)
    first = jp.Run(simulation)
    first.begin()
    first.advance(1)
    if run.run_to_end() != Status.COMPLETED:
        raise SystemExit(run.message(run.workspace.status))
    mechanism, w = run.mechanism, run.workspace
    rows = w.rows
    q, v = (np.ascontiguousarray(w.recorded(name)) for name in ("q", "v"))
    records = histories.records_of(w)
    stretches = variables.phase_stretches(run.phases, 0, rows)
    samples = {WHOLE: [], MOTION: [], FORCES: [], "one record": []}
    for turn in range(repeats + 1):
        costs = {
            WHOLE: seconds(histories.histories, run, Status.COMPLETED) / rows,
            MOTION: seconds(variables.kinematics, mechanism, q, v, stretches, {}, {}) / rows,
            "one record": seconds(histories.histories, first, Status.COMPLETED),
        }
        if not mechanism.clearance:
            held = [mechanism.constraints(q[first], 0.0) for first, _, _ in stretches]
            ideal = (mechanism, q, v, records.recorded("drive"), stretches, held)
            costs[FORCES] = seconds(variables.reactions, *ideal, (), np.zeros((rows, 0, 6))) / rows
        if turn:  # the first one loads compiled code
            for part, cost in costs.items():
                samples[part].append(cost)
        bar.update()
    return rows, samples


def main():
    words = "exit with status 1 if a cost is above [µs]"
    benchmark = Benchmark("histories", __doc__, runs=0, check=(np.inf, words))
    args = benchmark.parse()
    records, repeats = (5000, 5) if args.quick else (20_000, 25)
    setups = simulations(records)
    rows, data, costs = [], [], {}
    with ProgressBar(total=len(setups) * (repeats + 1), unit="result") as bar:
        for name, simulation in setups.items():
            count, samples = measure(simulation, repeats, bar)
            middle = {part: 1e6 * float(np.median(s)) for part, s in samples.items() if s}
            parts = [f"{middle[p]:.2f}" if p in middle else "" for p in (WHOLE, MOTION, FORCES)]
            rows.append([name, str(count), *parts, f"{1e-3 * middle['one record']:.1f}"])
            costs[name] = middle
            data += [
                {"mechanism": name, "part": part, "cost_us": 1e6 * cost}
                for part, values in samples.items()
                for cost in values
            ]
    header = ["mechanism", "records", *(f"{p} [µs]" for p in (WHOLE, MOTION, FORCES))]
    benchmark.finish([*header, "result of one record [ms]"], rows, data)
    worst = max(costs, key=lambda name: costs[name][WHOLE])
    print(f"largest cost {costs[worst][WHOLE]:.2f} µs per record ({worst})")
    if costs[worst][WHOLE] > args.check:
        sys.exit(1)
