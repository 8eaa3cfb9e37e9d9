"""Is restitution found from what an accelerometer feels, with the intervals stated?

Machines with several true restitutions are run, an accelerometer on the tool looks at them, and
`jointplay.identify` is given the scenario with another restitution. A hanging arm whose load turns
round bounces freely, and flights tell; the others are compared with simulated runs. Hostile: noise
as large as the impacts, a rate that resolves none, a machine that stands still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from common import COLOURS, ROOT, Benchmark, new_figure
from robots import serial

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.estimate import Measurement, identify

LAW = jp.contact.ZhangSharf()
"""Delivers the restitution asked for, whatever it is."""
TRUE = (0.25, 0.5, 0.8)
GUESS = 0.9
UR5 = ROOT / "docs/gallery/ur5_elbow.toml"


def bearing(restitution: float) -> jp.RevoluteClearance:
    return jp.RevoluteClearance(
        radial_clearance=1e-4, axial_clearance=1e-4, restitution=restitution, normal=LAW
    )


def arm(angle: float, bearing: jp.Clearance, end: float = 1.6) -> jp.Simulation:
    """An arm held at an angle [rad], whose load turns round; one joint with clearance."""
    link = ("j", "0 1 0", (0, 0, 0), 3.0, (0.2, 0, 0))
    mechanism = serial([link], (0.3, 0, 0), {"j": bearing}, about=0.01)
    times, forces, now = [0.0], [(0.0, 0.0, 0.0)], 0.0
    for time in np.arange(0.1, end, 0.15):
        times += [float(time), float(time) + 1e-4]
        forces += [(0.0, 0.0, now), (0.0, 0.0, 60.0 - now)]
        now = 60.0 - now
    push = jp.loads.WrenchOverTime(frame="tool", times=tuple(times), forces=tuple(forces))
    motion = jp.Motion(["j"], [0.0, end], [[angle], [angle]])
    return jp.Simulation(mechanism, motion, loads={"push": push}, limits="ignore")


def shipped(path: Path | str, case: str, restitution: float, **changes) -> jp.Simulation:
    """A scenario's case with another restitution."""
    from jointplay.scenario import Scenario

    made = Scenario.load(str(path)).simulation(case)
    joints = {
        name: replace(joint, restitution=restitution, normal=LAW)
        for name, joint in made.mechanism.clearance.items()
    }
    return replace(made, mechanism=made.mechanism.with_clearance(joints), **changes)


@dataclass(frozen=True)
class Machine:
    """A machine, and the accelerometer on its tool."""

    name: str
    make: Callable[[float], jp.Simulation]
    rate: float
    """Records a second [Hz]."""
    noise: float
    """Standard deviation of a record [m/s^2]."""


_SCARA, _CRANK = jp.shipped("scara.toml"), jp.shipped("slider_crank.toml")
MACHINES = (
    Machine("hanging arm, load turns round", lambda e: arm(np.pi / 2, bearing(e)), 20e3, 1.0),
    Machine("level arm, load turns round", lambda e: arm(0.0, bearing(e)), 20e3, 1.0),
    Machine("UR5, elbow", lambda e: shipped(UR5, "0.1 mm", e), 10e3, 0.1),
    Machine("SCARA, joint B", lambda e: shipped(_SCARA, "0.2 mm", e), 10e3, 0.1),
    Machine("slider-crank, 5000 rpm, 40 turns",
            lambda e: shipped(_CRANK, "0.1 mm", e, duration=0.48), 50e3, 30.0),
)  # fmt: skip


def look(one: Machine, restitution: float, seed: int) -> Measurement:
    """What the accelerometer feels of a run."""
    made = one.make(restitution)
    every = max(int(0.5 / (one.rate * made.step)), 1)
    result = replace(made, record_every=every, seed=1000 + seed).run(check_step=False)
    kinds, noise = ("acceleration",), {"acceleration": one.noise}
    return Measurement.from_result(result, rate=one.rate, noise=noise, kinds=kinds, seed=seed)


def hostile(one: Machine, measured: Measurement) -> dict[str, Measurement]:
    """The same measurement made worse."""
    random = np.random.default_rng(0)
    every = slice(None, None, max(round(one.rate / 50.0), 1))
    size = max(float(np.abs(values).max()) for values in measured.signals.values())

    def changed(how: Callable[[np.ndarray], np.ndarray], time=measured.time) -> Measurement:
        signals = {key: how(values) for key, values in measured.signals.items()}
        return replace(measured, time=time, signals=signals)

    return {
        "noise as large as the impacts": changed(
            lambda v: v + size * random.standard_normal(len(v))
        ),
        "50 records a second": changed(lambda v: v[every], measured.time[every]),
        "nothing hits": changed(lambda v: one.noise * random.standard_normal(len(v))),
    }


def row(one: Machine, measured: Measurement, kind: str, true: float, runs: int, seed: int) -> dict:
    """What is found."""
    (found,) = identify(one.make(GUESS), measured, runs=runs).restitutions
    return {
        "machine": one.name,
        "measurement": kind,
        "seed": seed,
        "true": true,
        "found": found.value,
        "half_width": found.half_width,
        "told": not found.reason,
        "covered": abs(found.value - true) <= found.half_width,
        "evidence": found.note,
        "why_not": found.reason,
    }


def main() -> None:
    benchmark = Benchmark(
        "restitution",
        __doc__ or "",
        runs=0,
        seeds=(1, "measurements of each"),
        machine=("", "only those whose name has it"),
    )
    benchmark.parser.add_argument("--runs", type=int, default=40, help="simulated, each")
    args = benchmark.parse()
    machines = [one for one in MACHINES if args.machine in one.name]
    seeds, trues = args.seeds, TRUE
    if args.quick:  # one measurement of one machine, with as few runs as will do
        machines, seeds, trues, args.runs = machines[:1], 1, TRUE[:1], 20
    work = [(one, e, seed) for one in machines for e in trues for seed in range(seeds)]
    rows = []
    bar = ProgressBar(work, unit="measurements")
    for one, true, seed in bar:
        measured = look(one, true, seed)
        kinds = {"as measured": measured}
        if true == TRUE[1] and seed == 0:
            kinds |= hostile(one, measured)
        for kind, seen in kinds.items():
            rows.append(row(one, seen, kind, true, args.runs, seed))
            bar.clear()
            print(*rows[-1].values(), sep=", ")
    header = ("machine", "true", "found, 95 % interval", "by")
    table = [
        [
            one["machine"],
            f"{one['true']:g}" if one["measurement"] == "as measured" else one["measurement"],
            f"{one['found']:.3f} ± {one['half_width']:.3f}" if one["told"] else "cannot tell",
            one["evidence"] or one["why_not"],
        ]
        for one in rows
    ]
    told = [one for one in rows if one["told"]]
    figure, axes = new_figure(1, 1, 4.0, 3.6)
    for number, one in enumerate(machines):
        mine = [row for row in told if row["machine"] == one.name]
        if mine:
            axes[0][0].errorbar(
                [row["true"] + 0.008 * (number - 2) for row in mine],
                [row["found"] for row in mine],
                [row["half_width"] for row in mine],
                fmt="o", ms=3, lw=0.8, color=COLOURS[number], label=one.name,
            )  # fmt: skip
    axes[0][0].plot([0, 1], [0, 1], color="0.5", lw=0.7)
    axes[0][0].set_xlabel("true restitution")
    axes[0][0].set_ylabel("identified, 95 % interval (simulated measurements)")
    axes[0][0].legend(fontsize=6)
    benchmark.finish(header, table, rows, figure)
    held = sum(one["covered"] for one in told)
    print(f"{held} of {len(told)} intervals hold the truth; {len(rows) - len(told)} cannot tell")
