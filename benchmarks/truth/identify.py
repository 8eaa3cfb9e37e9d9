"""Does identification find what is there, with the intervals stated, and say when it cannot?

Elastic machines: random arms whose joints, gears, links and tools give way, with stiction, thermal
drift, offsets of encoders and geometry that is off, by a static solver of their own (`elastic.py`);
`jointplay.identify` is given no stiffness but of some. Counted: machines with an interval that
misses the truth, and machines of which a play cannot be told.

Dynamic machines (`--cases`) are run by the full dynamic model (contacts, friction, drives), and
instruments with noise look at them; identification knows their stiffness and that nothing drifts,
but neither the values (the scenario's are off by up to a factor of 2.5) nor where the robot's
geometry is off. Some are measured badly, too (drowned in noise, one way only, never pushed, slow,
full of holes, with a load cell that is off). Then measurements of real machines
(benchmarks/truth/validation/data, sources on top of each file).
"""

from __future__ import annotations

import argparse
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from common import COLOURS, Benchmark, new_figure
from robots import serial
from truth import elastic, parts

import jointplay as jp
from jointplay.estimate import Measurement
from jointplay.estimate.identification import identify

DATA = Path(__file__).parent / "validation" / "data"
SPEED = 0.4
"""At which joints pass [rad/s]."""
PUSH_S = 0.8
"""For which a push holds [s]."""
KINDS = ("lying", "standing", "two", "geared")
"""A joint about y, about z, one of each, one about z with a gear."""
PLAIN = "as measured"


@dataclass(frozen=True)
class Machine:
    """A machine, what is believed of it before the measurement, and its measurement."""

    kind: str
    truth: dict[str, float]
    """By label of what is sought."""
    believed: jp.Simulation | jp.Mechanism
    measured: Measurement
    options: dict = field(default_factory=dict)
    """For `identify`."""
    sizes: int = 0
    """Of its pushes."""


def rows_of(one: Machine, seed: int, measurement: str = PLAIN) -> list[dict]:
    """A row for each unknown that is asked of a machine."""
    begin, error = perf_counter(), ""
    try:
        found = identify(one.believed, one.measured, **one.options)
        told = [estimate for estimate in found.estimates if estimate.unknown.sought]
    except jp.JointplayError as refused:
        if measurement == PLAIN:
            raise
        told, error = [], str(refused)
    common = {"case": seed, "measurement": measurement, "kind": one.kind, "sizes": one.sizes}
    common["seconds"] = perf_counter() - begin
    rows = []
    for estimate in told:
        unknown, truth = estimate.unknown, one.truth[estimate.label]
        row = {
            "unknown": unknown.label,
            "name": unknown.name,
            "play": unknown.name in ("radial_clearance", "gear_play"),
            "truth": truth,
            "expected": unknown.nominal,
            "found": estimate.value,
            "half_width": estimate.half_width,
            "told": estimate.identified,
            "wrong": estimate.identified and not estimate.low <= truth <= estimate.high,
            "excess": found.excess,
            "why_not": estimate.reason,
        }
        rows.append(common | row)
    if error:
        names = ("unknown", "name", "play", "truth", "told", "wrong", "why_not")
        for label, truth in one.truth.items():
            row = (label, "", False, truth, False, False, error)
            rows.append(common | dict(zip(names, row, strict=True)))
    return rows


def bearing(random: np.random.Generator) -> jp.RevoluteClearance:
    radial = random.uniform(2e-5, 1.5e-4)
    return jp.RevoluteClearance(
        bearing_radius=random.uniform(8e-3, 20e-3),
        bearing_length=random.uniform(30e-3, 60e-3),
        radial_clearance=radial,
        axial_clearance=radial * random.uniform(0.7, 2.0),
        friction=jp.contact.Ambrosio(random.uniform(0.05, 0.25)),
        restitution=random.uniform(0.3, 0.8),
    )


def guess(random: np.random.Generator, joint: jp.RevoluteClearance) -> jp.RevoluteClearance:
    """What somebody expects before the measurement."""
    off = random.uniform(0.4, 2.5, 3)
    return replace(
        joint,
        radial_clearance=joint.cr * off[0],
        journal_radius=None,
        axial_clearance=joint.ca * off[1],
        journal_length=None,
        friction=jp.contact.Ambrosio(joint.friction.mu_d * off[2]),
    )


def course(
    random: np.random.Generator, joints: list[str], mass: float
) -> tuple[jp.Motion, jp.loads.WrenchOverTime]:
    """There and back twice; once under a push and once under its opposite; pushes at two poses."""
    ends = random.uniform(0.3, 0.6, len(joints))
    centre = random.uniform(-0.3, 0.3, len(joints))
    leg = 2.0 * float(ends.max()) / SPEED
    strength = random.uniform(1.5, 2.5) * 9.81 * mass
    times, places = [0.0, 0.3], [centre - ends, centre - ends]
    push_times, pushes = [0.0], [np.zeros(3)]

    def push(begin: float, end: float, force: np.ndarray) -> None:
        push_times.extend([begin, begin + 0.1, end - 0.1, end])
        pushes.extend([np.zeros(3), force, force, np.zeros(3)])

    def pass_by() -> None:
        for way in (1.0, -1.0):
            times.extend([times[-1] + leg, times[-1] + leg + 0.1])
            places.extend([centre + way * ends] * 2)

    pass_by()
    pass_by()
    axis = np.eye(3)[random.integers(3)]
    for side in (1.0, -1.0):
        times[-1] += 0.6
        begin = times[-1] - 0.5
        pass_by()
        push(begin, times[-1], side * strength * axis)
    for part in (-0.4, 0.5):
        place = centre + part * ends
        begin = times[-1] + 1.7
        times += [times[-1] + 1.0, begin]
        places += [place, place]
        for axis in np.eye(3):
            for side in (1.0, -1.0):
                push(begin, begin + PUSH_S, side * strength * axis)
                begin += PUSH_S + 0.2
        times[-1] = begin
    motion = jp.Motion(joints, times, places)
    rows = tuple(tuple(float(x) for x in row) for row in pushes)
    wrench = jp.loads.WrenchOverTime(frame="tool", times=tuple(push_times), forces=rows)
    return motion, wrench


def off(random: np.random.Generator, measured: Measurement) -> Measurement:
    """Geometry that is wrong: a smooth distortion of the tool's place by up to a millimetre."""
    signals = dict(measured.signals)
    motors = [values for (kind, _), values in signals.items() if kind == "motor"]
    for key in signals:
        if key[0] == "tool":
            for values in motors:
                a, b = random.uniform(-1e-3, 1e-3, 2)
                signals[key] = signals[key] + a * np.sin(values) + b * np.cos(values)
    return Measurement(measured.time, signals, source="the simulated measurement")


def dynamic_machine(seed: int) -> tuple[Machine, jp.Simulation]:
    """One of the dynamic machines, and the run that was measured."""
    random = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    axes = {"lying": ["0 1 0"], "two": ["0 0 1", "0 1 0"]}.get(kind, ["0 0 1"])
    links, reach = [], 0.0
    for i, axis in enumerate(axes):
        centre, mass = random.uniform(0.1, 0.3), random.uniform(2, 6)
        links.append((f"j{i}", axis, (reach, 0, 0), mass, (centre, 0, 0)))
        reach = random.uniform(0.2, 0.4)
    joints, tip = [link[0] for link in links], (reach, 0, 0)
    true = {name: bearing(random) for name in joints}
    believed = {name: guess(random, joint) for name, joint in true.items()}
    gears, truth = {}, {}
    if kind == "geared":
        play = random.uniform(0.3e-3, 3e-3)
        gears = {"j0": jp.Gear(play, rotor_inertia=0.3, stiffness=2e4, damping=20.0)}
        truth = {"j0 gear play": play, "j0 dry friction": 0.5}
    guessed = {n: replace(g, play=g.play * random.uniform(0.4, 2.5)) for n, g in gears.items()}
    for name, joint in true.items():
        truth |= {f"{name} radial clearance": joint.cr, f"{name} axial clearance": joint.ca}
        truth[f"{name} friction"] = joint.friction.mu_d
    motion, wrench = course(random, joints, 4.0 * len(joints))
    simulation = jp.Simulation(
        serial(links, tip, true, gears=gears),
        motion,
        jp.loads.ComputedTorque(encoder="motor"),
        loads={"push": wrench},
        record_every=500,
        joint_friction={name: jp.loads.JointFriction(coulomb=0.5) for name in gears},
        limits="ignore",
    )
    noise = {"tool": 10 ** random.uniform(-6.0, -4.6), "motor": 1e-5, "link": 1e-5}
    link = ("link",) if gears and random.random() < 0.5 else ()
    kinds = ("tool", "motor", "force", *link)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        result = simulation.run()
    measured = Measurement.from_result(result, noise=noise, kinds=kinds, seed=seed)
    stiffness = {"all": math.inf} | {name: gear.stiffness for name, gear in gears.items()}
    theirs = replace(simulation, mechanism=serial(links, tip, believed, gears=guessed))
    measured = off(np.random.default_rng(seed), measured)
    options = {"stiffness": stiffness, "drift": 0}
    return Machine(kind, truth, theirs, measured, options), simulation


def dynamic_case(seed: int, worsened: range) -> list[dict]:
    """What is found of one machine, by its measurement and, if `worsened`, by hostile ones."""
    one, simulation = dynamic_machine(seed)
    rows = rows_of(one, seed)
    if seed in worsened:
        for name, worse in hostile(one.measured, seed, float(simulation.motion.times[2])).items():
            rows += rows_of(replace(one, measured=worse), seed, name)
    return rows


def hostile(measured: Measurement, seed: int, leg: float) -> dict[str, Measurement]:
    """The same measurement made worse, by name; the motion first turns at `leg` [s]."""
    random = np.random.default_rng(seed)
    time, signals = measured.time, measured.signals
    pushed = np.any([signals["force", axis] != 0.0 for axis in "xyz"], axis=0)
    first = time[pushed][0] - 0.3

    def changed(kind: str, how: Callable[[np.ndarray], np.ndarray]) -> Measurement:
        return replace(
            measured, signals={key: how(v) if key[0] == kind else v for key, v in signals.items()}
        )

    def kept(chosen: np.ndarray) -> Measurement:
        return Measurement(time[chosen], {key: v[chosen] for key, v in signals.items()})

    return {
        "noise of 0.3 mm": changed("tool", lambda v: v + 3e-4 * random.standard_normal(len(v))),
        "one way only": kept(time < leg),
        "never pushed": kept(time < first),
        "10 records a second": kept(np.arange(len(time)) % 10 == 0),
        "half of the records lost": changed(
            "tool", lambda v: np.where(random.random(len(v)) < 0.5, np.nan, v)
        ),
        "load cell off by 30 %": changed("force", lambda v: 1.3 * v),
    }


RAMP_S = 0.3
"""In which the elastic machines start and stop [s]."""
RATE = 50.0
"""Records a second of the elastic machines [Hz]."""
PLAY_KINDS = ("shoulder", "elbow", "both", "gear", "gears", "gear and bearing")
SIZES = (1.0, 0.6, 0.3)
"""Of pushes."""
FEWER = 5
"""Each such machine is pushed with fewer than three sizes."""


def elastic_arm(random: np.random.Generator, kind: str) -> elastic.Arm:
    """Stiffness 2e4 to 1e7 N m/rad, 0.05 to 2 µm/N at the tool."""

    def log(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    turned = random.uniform(0.0, np.pi)
    axes = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    tool = axes @ np.diag([log(0.05e-6, 2e-6), log(0.05e-6, 2e-6)]) @ axes.T
    joints = []
    for k, name in enumerate(("shoulder", "elbow")):
        geared = kind == "gears" or (kind.startswith("gear") and k == 0)
        loose = kind in (name, "both") or (kind == "gear and bearing" and k == 1)
        length = random.uniform(0.3, 0.6)
        dry = log(0.2, 5.0) if (geared and random.random() < 0.7) or random.random() < 0.2 else 0.0
        joints.append(
            elastic.Joint(
                length,
                random.uniform(2.0, 8.0),
                random.uniform(0.3, 0.6) * length,
                inertia=0.03,
                clearance=log(1e-6, 1.5e-4) if loose else 0.0,
                friction=random.uniform(0.03, 0.2) if loose and random.random() < 0.6 else 0.0,
                radius=random.uniform(8e-3, 20e-3),
                sinks=log(0.1e-6, 1e-6),
                radial=log(1e-9, 2e-8),
                torsional=1.0 / log(2e4, 1e7),
                play=log(0.1e-3, 3e-3) if geared else 0.0,
                dry=dry,
                sticks=random.uniform(1.0, 1.4),
                bends=log(0.02e-6, 0.5e-6),
            )
        )
    return elastic.Arm(tuple(joints), bool(random.random() < 0.5), tool)


def slow_course(
    random: np.random.Generator, strength: float, count: int, axes: np.ndarray | None = None
) -> tuple:
    """Positions (n, 2), forces along k axes (k, d), and whether it moves (n,), at `RATE`.

    Forces (n, d) are in a plane, along axes of which the random ones are made, unless some are
    given.
    """
    ends = random.uniform(0.3, 0.6, 2)
    centre = np.array([random.uniform(-0.5, 0.5), random.uniform(0.5, 1.2)])
    rows: list[np.ndarray] = []
    turned = random.uniform(0.0, np.pi / 2.0)
    if axes is None:
        axes = np.array([[np.cos(turned), np.sin(turned)], [-np.sin(turned), np.cos(turned)]])

    def stay(seconds: float, force: np.ndarray) -> None:
        last = rows[-1][-1, :2] if rows else centre - ends
        rows.append(np.tile([*last, *force, 0.0], (round(seconds * RATE), 1)))

    def go(goal: np.ndarray, force: np.ndarray) -> None:
        last = rows[-1][-1, :2]
        n = round((float(np.abs(goal - last).max()) / SPEED + RAMP_S) * RATE)
        ramp = round(RAMP_S * RATE)
        speed = np.convolve(np.ones(n - ramp), np.hanning(ramp + 2)[1:-1])[:n]
        part = (np.cumsum(speed) / np.sum(speed))[:, None]
        n = len(part)
        rows.append(np.column_stack([last + part * (goal - last), np.tile([*force, 1.0], (n, 1))]))

    none = np.zeros(axes.shape[1])
    stay(0.4, none)
    for force in (none, strength * axes[0], -strength * axes[0], none):
        go(centre + ends, force)
        go(centre - ends, force)
    for part in (-0.4, 0.5, 0.1):
        go(centre + part * ends, none)
        stay(0.8, none)
        for size in SIZES[:count]:
            for axis in axes:
                for side in (1.0, -1.0):
                    stay(0.6, side * size * strength * axis)
                    stay(0.3, none)
    table = np.concatenate(rows)
    return table[:, :2], table[:, 2:-1], table[:, -1] > 0.0


def elastic_machine(seed: int) -> Machine:
    """One of the elastic machines."""
    random = np.random.default_rng([7, seed])
    kind = PLAY_KINDS[seed % len(PLAY_KINDS)]
    arm = elastic_arm(random, kind)
    count = 3 if seed % FEWER else int(random.integers(0, 3))
    strength = random.uniform(1.2, 2.5) * 9.81 * sum(one.mass for one in arm.joints)
    seen = elastic_seen(random, arm, strength, count)
    believed, friction, truth = belief(random, arm)
    options: dict = {"joint_friction": friction}
    if random.random() < 0.1:
        options["stiffness"] = {"shoulder torsional": (0.9 / arm.joints[0].torsional, 0.2)}
    return Machine(kind, truth, believed, seen, options, count)


def elastic_seen(
    random: np.random.Generator,
    arm: elastic.Arm,
    strength: float,
    count: int,
    links: tuple[str, ...] | None = None,
) -> Measurement:
    """What instruments see of an arm that is pushed with so many sizes of force [N].

    `links` have an encoder behind their gear; by default about half of those with play.
    """
    motor, force, moves = slow_course(random, strength, count)
    rate = np.sign(np.round(np.gradient(motor, axis=0), 9))
    way = np.zeros_like(rate)
    kept, now = np.ones(2), np.zeros(2)
    for i in range(len(way)):
        if moves[i]:
            kept, now = np.ones(2), rate[i]
        elif (force[i] != force[max(i - 1, 0)]).any():
            kept = random.uniform(0.0, 1.0, 2)  # a push lets some of what friction holds go
        way[i] = kept * now
    time = np.arange(len(motor)) / RATE
    tool, twist = elastic.statics(arm, motor, force, way, time)
    noise = 10 ** random.uniform(-6.0, -4.6)
    warm = time / time[-1]
    walk = np.cumsum(random.standard_normal((len(time), 3)), axis=0) / np.sqrt(len(time))
    drift = random.uniform(-30e-6, 30e-6, 3) * warm[:, None] + random.uniform(0.0, 5e-6) * walk
    columns = (0, 2) if arm.vertical else (0, 1)
    position, pushes = np.zeros((len(time), 3)), np.zeros((len(time), 3))
    position[:, columns], pushes[:, columns] = tool, force
    offset = random.uniform(-1e-3, 1e-3, 2)
    signals = {}
    for i, axis in enumerate("xyz"):
        error = drift[:, i] + noise * random.standard_normal(len(time))
        signals["tool", axis] = position[:, i] + error
        signals["force", axis] = pushes[:, i]
    for k, name in enumerate(("shoulder", "elbow")):
        records = motor[:, k] + offset[k] + 1e-6 * random.standard_normal(len(time))
        signals["motor", name] = records
        has = arm.joints[k].play and random.random() < 0.5 if links is None else name in links
        if has:
            records = motor[:, k] + twist[:, k] + 1e-5 * random.standard_normal(len(time))
            signals["link", name] = records + random.uniform(-1e-3, 1e-3)
    return off(random, Measurement(time, signals))


def belief(random: np.random.Generator, arm: elastic.Arm) -> tuple:
    """The mechanism and the friction that somebody expects, and the truth by label."""
    bearings, gears, friction, truth = {}, {}, {}, {}
    axis = "0 1 0" if arm.vertical else "0 0 1"
    links, reach = [], 0.0
    for name, one in zip(("shoulder", "elbow"), arm.joints, strict=True):
        links.append((name, axis, (reach, 0, 0), one.mass, (one.centre, 0, 0)))
        reach = one.length
        off = random.uniform(0.4, 2.5, 4)
        if one.clearance:
            expected = max(one.clearance, 2e-5) * off[0]
            truth[f"{name} radial clearance"] = one.clearance
            law = jp.contact.Ambrosio(one.friction * off[1])
            if one.friction:
                truth[f"{name} friction"] = one.friction
            bearings[name] = jp.RevoluteClearance.planar(
                radial_clearance=expected, bearing_radius=one.radius, friction=law
            )
        if one.play:
            gears[name] = jp.Gear(one.play * off[2], 0.1, off[1] ** 2 / one.torsional)
            truth[f"{name} gear play"] = one.play
            truth[f"{name} gear compliance"] = one.torsional
        if one.dry:
            truth[f"{name} dry friction"] = one.dry
            friction[name] = jp.loads.JointFriction(coulomb=one.dry * off[3])
            if not one.play:
                truth[f"{name} torsional compliance"] = one.torsional
    return serial(links, (reach, 0, 0), bearings, gears=gears), friction, truth


def part_machine(seed: int) -> Machine:
    """One of the machines with rolling bearings, seats and gears; loads are read wrong, too."""
    random = np.random.default_rng([11, seed])
    kind = parts.KINDS[seed % len(parts.KINDS)]
    joints, reach, bearings, gears, truth = parts.arm(random, kind)
    tool = np.diag([parts.log(random, 0.05e-6, 1e-6) for _ in range(3)])
    strength = random.uniform(1.5, 3.0) * 9.81 * sum(one.mass for one in joints)
    axes = np.eye(3)[[0, 2]] if "ball" in kind else np.eye(3)  # one row bears no such moment
    motor, force, _ = slow_course(random, strength, 3, axes)
    time = np.arange(len(motor)) / RATE
    before = random.uniform(-1.0, 1.0, 4)
    place, twist = parts.statics(joints, reach, tool, motor, force, time, before)
    noise = 10 ** random.uniform(-6.0, -5.0)
    drift = random.uniform(-20e-6, 20e-6, 3) * (time / time[-1])[:, None]
    cell = 1.0 + 0.02 * random.standard_normal()
    signals = {}
    for i, axis in enumerate("xyz"):
        signals["tool", axis] = (
            place[:, i] + drift[:, i] + noise * random.standard_normal(len(time))
        )
        signals["force", axis] = cell * force[:, i]
    for k, name in enumerate(("shoulder", "elbow")):
        signals["motor", name] = motor[:, k] + 1e-6 * random.standard_normal(len(time))
        if name in gears and random.random() < 0.5:
            records = motor[:, k] + twist[:, k] + 5e-6 * random.standard_normal(len(time))
            signals["link", name] = records + random.uniform(-1e-3, 1e-3)
    seen = off(random, Measurement(time, signals))
    links = [
        (name, " ".join(map(str, one.axis)), (one.at, 0, 0), one.mass, (one.centre, 0, 0))
        for name, one in zip(("shoulder", "elbow"), joints, strict=True)
    ]
    believed = serial(links, (reach, 0, 0), bearings, gears=gears)
    asked = kind.endswith("piece") or (bearings and random.random() < 0.5)
    options: dict = {"also": ["stiffness"] if asked else []}
    return Machine(kind, truth, believed, seen, options, 3)


def part_case(seed: int) -> list[dict]:
    return rows_of(part_machine(seed), seed)


def elastic_case(seed: int) -> list[dict]:
    return rows_of(elastic_machine(seed), seed)


def main() -> None:
    benchmark = Benchmark(
        "identify",
        __doc__ or "",
        runs=0,
        machines=(100, "elastic machines; --quick: 5"),
        cases=(0, "in their place, machines that are run by the full dynamic model, and the real "
               "ones, minutes each; --quick: at most 4"),
        parts=(0, "in their place, machines with rolling bearings, seats and gears; --quick: 2"),
        seed=(0, "number of the first of them"),
        jobs=(1, "processes"),
        hostile=(8, "machines that are measured badly, too"),
    )  # fmt: skip
    args = benchmark.parse()
    if args.cases:
        benchmark.name = "identify_dynamic"
        dynamic(benchmark, args)
        real()
    elif args.parts:
        benchmark.name = "identify_parts"
        elastic_machines(
            benchmark, args, part_case, min(args.parts, 2 if args.quick else args.parts)
        )
    else:
        elastic_machines(benchmark, args, elastic_case, 5 if args.quick else args.machines)


def elastic_machines(
    benchmark: Benchmark,
    args: argparse.Namespace,
    case: Callable[[int], list[dict]],
    count: int,
) -> None:
    """How many intervals miss, and where nothing can be told, by kind of machine and of pushes."""
    numbers = range(args.seed, args.seed + count)
    found = jp.Study(numbers, case).run(args.jobs, progress=True, unit="machine")
    groups: dict[str, list[list[dict]]] = {}
    for rows in found:
        kind, sizes = rows[0]["kind"], rows[0]["sizes"]
        names = [f"play in: {kind}", f"pushes of {sizes} sizes", "all"]
        for name in names + ([f"of three sizes: {kind}"] if sizes == 3 else []):
            groups.setdefault(name, []).append(rows)
    table = []
    for name in sorted(groups, key=lambda one: (one == "all", one)):
        rows = [row for one in groups[name] for row in one]
        plays = [row["half_width"] / row["found"] for row in rows if row["play"] and row["told"]]
        wrong, silent = counts(groups[name])
        table.append(
            [
                name,
                str(len(groups[name])),
                str(wrong),
                str(silent),
                f"{sum(row['told'] for row in rows)} of {len(rows)}",
                str(sum(row["wrong"] for row in rows)),
                f"{100 * np.median(plays):.2g} %" if plays else "-",
            ]
        )
    header = (
        "machines", "number", "wrong: an interval without the truth",
        "cannot tell: a play that is not told", "unknowns told", "intervals without the truth",
        "half width of plays (median)",
    )  # fmt: skip
    every = [row for one in found for row in one]
    benchmark.finish(header, table, every, drawn(every, ["radial_clearance", "gear_play"]))
    seconds = [rows[0]["seconds"] for rows in found]
    print(f"identification: {np.median(seconds):.1f} s (median), {max(seconds):.1f} s (longest)")
    print("machines {} wrong {} cannot tell {}".format(len(found), *counts(found)))


def counts(machines: list[list[dict]]) -> tuple[int, int]:
    """Machines with an interval that misses the truth, and those with a play that is not told."""
    wrong = sum(any(row["wrong"] for row in rows) for rows in machines)
    return wrong, sum(any(r["play"] and not r["told"] for r in rows) for rows in machines)


def drawn(rows: list[dict], names: list[str]):
    """What was found of unknowns over their truth, those red whose interval misses it."""
    figure, axes = new_figure(1, len(names), 3.4 * len(names), 3.2)
    for panel, name in zip(axes[0], names, strict=True):
        scale, unit = {
            "friction": (1.0, ""), "gear_play": (1e3, " [mrad]"), "dry_friction": (1.0, " [N m]"),
        }.get(name, (1e6, " [µm]"))  # fmt: skip
        told = [row for row in rows if row["name"] == name and row["told"]]
        for row in told:
            truth, found, half = (scale * row[n] for n in ("truth", "found", "half_width"))
            colour = COLOURS[int(row["wrong"])]
            panel.errorbar(truth, found, half, fmt="o", ms=3, lw=0.8, color=colour)
        most = max((scale * row["truth"] for row in told), default=1.0)
        panel.plot([0.0, most], [0.0, most], color="0.5", lw=0.7)
        panel.set_xlabel(f"true {name.replace('_', ' ')}{unit}")
    axes[0][0].set_ylabel("identified, 95 % interval")
    return figure


def dynamic(benchmark: Benchmark, args: argparse.Namespace) -> None:
    """Machines that are run by the full dynamic model; rigid but for contacts and known gears."""
    numbers = range(args.seed, args.seed + min(args.cases, 4 if args.quick else args.cases))
    measure = partial(dynamic_case, worsened=range(args.seed, args.seed + args.hostile))
    found = jp.Study(numbers, measure).run(args.jobs, progress=True, unit="machine")
    every = [row for one in found for row in one]
    plain = [row for row in every if row["measurement"] == PLAIN]
    names = list(dict.fromkeys(row["name"] for row in plain))
    groups = {name.replace("_", " "): [r for r in plain if r["name"] == name] for name in names}
    groups["all"] = plain
    for row in every:
        if row["measurement"] != PLAIN:
            groups.setdefault(row["measurement"], []).append(row)
            groups["all, hostile included"] = every
    table = []
    for name, mine in groups.items():
        told = [row for row in mine if row["told"]]
        right = sum(not row["wrong"] for row in told)
        off_by = [abs(row["found"] - row["truth"]) / row["truth"] for row in told]
        wide = [row["half_width"] / row["truth"] for row in told]
        said = (
            [
                f"{right} ({100 * right / len(told):.0f} %)",
                f"{100 * np.median(wide):.2g} %",
                f"{100 * np.median(off_by):.2g} %",
            ]
            if told
            else ["-"] * 3
        )
        table.append([name, str(len(mine)), str(len(told)), *said])
    header = (
        "unknown", "sought", "told", "truth within the 95 % interval", "half width (median)",
        "off by (median)",
    )  # fmt: skip
    benchmark.finish(header, table, every, drawn(plain, names))


def lever(joint: str, gear: jp.Gear) -> jp.Mechanism:
    """A lever of 0.1 m; its mass does not matter, for its axis is vertical."""
    link = (joint, "0 0 1", (0, 0, 0), 0.03, (0.05, 0, 0))
    return serial([link], (0.1, 0, 0), gears={joint: gear})


def real() -> None:
    """What measurements of real machines say: servos, and a band-brake damper."""
    stand = lever("servo", jp.Gear(play=10e-3, rotor_inertia=1e-3, stiffness=20.0))
    for name in ("sts3215", "sts3250"):
        for words, also in (("neglected", []), ("sought", ["friction"])):
            print(f"\n{name}: dry friction of the output shaft {words}")
            print(identify(stand, DATA / f"backlash_{name}.csv", also=also))
    drum = lever("drum", jp.Gear(play=2e-3, rotor_inertia=1e-3, stiffness=2e6))
    friction = {"drum": jp.loads.JointFriction(4e3)}
    for tension in (20, 35, 80):
        print(f"\ndamper, band tension {tension} lb (radius 1 m: rad are m, N m are N)")
        print(identify(drum, DATA / f"backlash_damper_{tension}lb.csv", joint_friction=friction))
