"""Do the intervals of `jointplay calibrate` contain the truth, and is existing play found?

Random robots of three to six joints whose encoders are off, whose joints give way in proportion to
their load and some of which have play and friction, whose links are longer or shorter than drawn,
stand at random poses; a tracker looks at them. What they do is computed by Pinocchio alone.
`jointplay.calibrate` is given the drawn robot, no friction and no transition of play, and its
default terms. Counted: intervals of coefficients and of play without the truth, bounds of play
below it, joints without play that are told to have some.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
import pinocchio as pin
from common import COLOURS, Benchmark, new_figure
from robots import serial
from scipy.spatial.transform import Rotation

import jointplay as jp
from jointplay.estimate import StaticPoses


@dataclass(frozen=True)
class Robot:
    """A robot as it was drawn, what it has in truth by label (SI), and poses seen of it."""

    drawn: jp.Mechanism
    truth: dict[str, float]
    poses: StaticPoses


def drawn(random: np.random.Generator) -> jp.Mechanism:
    """A robot whose joints turn about the axes of their frames, the first about the vertical."""
    links, way, before = [], np.array([0.0, 0.0, 0.3]), ""
    for i in range(int(random.integers(3, 7))):
        choices = [one for one in ("1 0 0", "0 1 0", "0 0 1") if i < 2 or one != before]
        axis = "0 0 1" if i == 0 else "0 1 0" if i == 1 else str(random.choice(choices))
        before = axis if i else ""
        at, way = way, random.uniform([0.1, -0.1, -0.1], [0.4, 0.1, 0.1])
        links.append(
            (f"joint{i}", axis, at.round(6), random.uniform(1.0, 5.0), (0.5 * way).round(6))
        )
    return serial(links, way.round(6), about=0.01)


def robot(seed: int) -> Robot:
    """One of the robots."""
    random = np.random.default_rng([17, seed])
    mechanism = drawn(random)
    names, model = mechanism.joints, mechanism.ideal().model.copy()
    n, count = int(random.integers(30, 81)), len(names)
    motor = random.uniform(-2.5, 2.5, (n, count))
    data = model.createData()
    load = -np.array([pin.computeGeneralizedGravity(model, data, q).copy() for q in motor])
    way = np.vstack([np.zeros(count), np.sign(np.diff(motor, axis=0))])
    true, truth = motor.copy(), {}
    waves, bends, grows = random.random(3) < (0.3, 0.7, 0.5)
    for j, name in enumerate(names):
        largest = float(np.abs(load[:, j]).max())
        offset = random.normal(0.0, 0.01)
        give = random.uniform(0.0, 1e-3) if bends else 0.0
        half = 10.0 ** random.uniform(-4.0, -2.3) if random.random() < 0.4 else 0.0
        sine, cosine = random.normal(0.0, 2e-3, 2) if waves else (0.0, 0.0)
        friction = largest * random.uniform(0.0, 0.4) * (random.random() < 0.5)
        width = max(largest * random.uniform(0.02, 0.3), 1e-9)
        lean = np.clip((load[:, j] - friction * way[:, j]) / width, -1.0, 1.0)
        if largest < 1e-6:
            half, lean = 0.0, np.zeros(n)
        true[:, j] += offset + give * load[:, j] + half * lean
        true[:, j] += sine * np.sin(motor[:, j]) + cosine * np.cos(motor[:, j])
        truth |= {f"{name} offset": offset, f"{name} gear compliance": give}
        truth |= {f"{name} gear play": 2.0 * half}
        truth |= {f"{name} eccentricity sin": sine, f"{name} eccentricity cos": cosine}
        if j and grows:
            moved = random.normal(0.0, 5e-4, 3)
            model.jointPlacements[j + 1].translation += moved
            truth |= {f"{name} placement along {a}": x for a, x in zip("xyz", moved, strict=True)}
    places = []
    data = model.createData()
    for q in true:
        pin.framesForwardKinematics(model, data, q)
        places.append(data.oMf[mechanism.ideal().tool_frame].copy())
    noise = 10.0 ** random.uniform(-4.7, -3.7)
    frame, at = Rotation.random(rng=random).as_matrix(), random.normal(size=3)
    position = np.array([at + frame @ p.translation for p in places])
    position += noise * random.normal(size=position.shape)
    turned = None
    if random.random() < 0.5:
        small = Rotation.from_rotvec(5.0 * noise * random.normal(size=position.shape)).as_matrix()
        turned = small @ frame @ np.array([p.rotation for p in places])
    poses = StaticPoses(names, motor, position=position, orientation=turned)
    return Robot(mechanism, truth, poses)


def case(seed: int) -> list[dict]:
    """A row for each interval that is told of a robot, and for each joint's play."""
    one = robot(seed)
    begin = perf_counter()
    fit = jp.calibrate(one.drawn, one.poses)
    common, rows = {"case": seed, "seconds": perf_counter() - begin}, []
    for told in (*fit.coefficients, *fit.play):
        play = told in fit.play
        low, high = (0.0, told.upper) if told.bounded else (told.low, told.high)
        kind = told.unknown.name.split()[0]
        if play:
            kind = "joint's bound" if told.bounded else "joint's play"
        truth = one.truth.get(told.label, 0.0)
        row = {
            "kind": kind, "label": told.joint if play else told.label, "truth": truth,
            "found": told.value, "low": low, "high": high, "told": not told.reason,
            "wrong": not low <= truth <= high,
        }  # fmt: skip
        rows.append(common | row)
    return rows


def main() -> None:
    options = {"robots": (60, "robots; --quick: 2"), "seed": (0, "number of the first of them")}
    benchmark = Benchmark("calibrate", __doc__ or "", runs=0, jobs=(1, "processes"), **options)
    args = benchmark.parse()
    numbers = range(args.seed, args.seed + (2 if args.quick else args.robots))
    found = jp.Study(numbers, case).run(args.jobs, progress=True, unit="robot")
    every = [row for one in found for row in one]
    table = []
    for kind in dict.fromkeys(row["kind"] for row in every):
        mine = [row for row in every if row["kind"] == kind]
        told = [row for row in mine if row["told"]]
        wrong = sum(row["wrong"] for row in told)
        none = sum(row["truth"] == 0.0 and row["low"] > 0.0 for row in told)
        table.append([kind, str(len(mine)), str(len(told)), str(wrong), str(none)])
    header = ("interval of", "number", "told", "without the truth", "of these: truth is none")
    figure, axes = new_figure(1, 1, 4.0, 3.4)
    for row in every:
        if row["kind"] == "joint's play" and row["told"]:
            low, high, middle = (1e3 * row[name] for name in ("low", "high", "found"))
            axes[0][0].errorbar(
                1e3 * row["truth"], middle, [[middle - low], [high - middle]],
                fmt="o", ms=3, lw=0.8, color=COLOURS[int(row["wrong"])],
            )  # fmt: skip
    axes[0][0].plot([0.0, 5.0], [0.0, 5.0], color="0.5", lw=0.7)
    axes[0][0].set_xlabel("true play [mrad]")
    axes[0][0].set_ylabel("found, 95 % interval [mrad]")
    benchmark.finish(header, table, every, figure)
    print(f"calibration: {np.median([rows[0]['seconds'] for rows in found]):.1f} s (median)")
