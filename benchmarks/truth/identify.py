"""Does identification find the true values within its intervals, and say when it cannot?

Random arms by static solvers of their own; `jointplay.identify` is given no stiffness but of some.
Elastic ones (`elastic.py`): joints, gears, links and tools give way, with stiction, thermal drift,
offsets of encoders and geometry that is off. With parts (`parts.py`): rolling bearings, seats and
gears. Counted: machines with an interval that misses the truth, and machines of which a play cannot
be told. With `--real`: what measurements of real machines say (benchmarks/truth/validation/data,
sources on top of each file).
"""

from __future__ import annotations

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


def rows_of(one: Machine, seed: int) -> list[dict]:
    """A row for each unknown that is asked of a machine."""
    begin = perf_counter()
    found = identify(one.believed, one.measured, **one.options)
    common = {"case": seed, "kind": one.kind, "sizes": one.sizes}
    common["seconds"] = perf_counter() - begin
    rows = []
    for estimate in found.sought:
        unknown, truth = estimate.unknown, one.truth[estimate.label]
        row = {
            "unknown": unknown.label,
            "name": unknown.name,
            "play": unknown.name in ("radial_clearance", "gear_play"),
            "truth": truth,
            "expected": unknown.nominal,
            "found": estimate.value,
            "half_width": estimate.half_width,
            "told": estimate.known,
            "wrong": estimate.known and not estimate.low <= truth <= estimate.high,
            "excess": found.excess,
            "why_not": estimate.reason,
        }
        rows.append(common | row)
    return rows


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
    random: np.random.Generator, arm: elastic.Arm, strength: float, count: int
) -> Measurement:
    """What instruments see of an arm that is pushed with so many sizes of force [N]; about half of
    the gears with play have an encoder behind them."""
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
        if arm.joints[k].play and random.random() < 0.5:
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


def case(number: tuple[Callable[[int], Machine], int], cell: float) -> list[dict]:
    """What is found of a machine, whose load cell is off by a factor."""
    make, seed = number
    one = make(seed)
    pairs = one.measured.signals.items()
    signals = {key: cell * values if key[0] == "force" else values for key, values in pairs}
    return rows_of(replace(one, measured=replace(one.measured, signals=signals)), seed)


def main() -> None:
    benchmark = Benchmark(
        "identify",
        __doc__ or "",
        runs=0,
        machines=(100, "elastic machines; --quick: 5"),
        parts=(40, "machines with rolling bearings, seats and gears; --quick: 2"),
        seed=(0, "number of the first of each"),
        jobs=(1, "processes"),
        cell=(1.0, "factor by which load cells are off"),
        real=(False, "measurements of real machines in their place"),
    )
    args = benchmark.parse()
    if args.real:
        return real()
    numbers = list[tuple[Callable[[int], Machine], int]]()
    for make, asked, few in ((elastic_machine, args.machines, 5), (part_machine, args.parts, 2)):
        count = min(asked, few) if args.quick else asked
        numbers += [(make, args.seed + k) for k in range(count)]
    study = jp.Study(numbers, partial(case, cell=args.cell))
    found = study.run(args.jobs, progress=True, unit="machine")
    groups: dict[str, list[list[dict]]] = {}
    for rows in found:
        kind, sizes = rows[0]["kind"], rows[0]["sizes"]
        for name in (kind, f"pushes of {sizes} sizes", "all"):
            groups.setdefault(name, []).append(rows)
    table = []
    for name in sorted(groups, key=lambda one: (one == "all", one)):
        rows = [row for one in groups[name] for row in one]
        plays = [row["half_width"] / row["found"] for row in rows if row["play"] and row["told"]]
        wrong, silent = counts(groups[name])
        told, missed = (sum(row[what] for row in rows) for what in ("told", "wrong"))
        table.append(
            [
                name, str(len(groups[name])), str(wrong), str(silent), f"{told} of {len(rows)}",
                str(missed), f"{100 * np.median(plays):.2g} %" if plays else "-",
            ]
        )  # fmt: skip
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
