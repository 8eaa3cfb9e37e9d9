"""Do dial gauge readings give a joint's play, and its growth, within the stated intervals?

Joints by another model than the one that is fitted: teeth that stiffen under load, friction,
gravity that leans on one side, forces and levers that are off, gauges that scatter. Each is pushed
to both sides with two forces; what is told is compared with the truth. With `--encoder` the gauge
is the servo's own encoder on the output, of 4096 counts: pushes are four times softer, lest the
motor turn, and friction four times as much of them. With `--changes` each joint is measured twice,
with other friction, stiffness and lever the second time; every other one has grown in between.
"""

from __future__ import annotations

import numpy as np
from common import Benchmark

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.estimate.changes import changes
from jointplay.estimate.gauge import GAUGE_M, Readings, gauge_problems, identify_gauged

JOINT, POSE = "shoulder_lift", "shoulder_lift=-0.54,elbow_flex=-0.64,wrist_flex=-0.48"
COUNT, SOFTER, HALF = 2.0 * np.pi / 4096.0, 4.0, np.radians(0.5)
GROWN = 0.25
"""Part by which play has grown: by 2 % a month in a year."""


def joint(
    random: np.random.Generator, encoder: bool = False, grown: float | None = None
) -> tuple[list[float], list[Readings]]:
    """A joint's play [rad], and what was read of it; with `grown` a second time, when it has grown
    by such a part."""
    play = float(np.radians(random.choice([0.0, *10.0 ** random.uniform(-2.0, 0.2, 9)])))
    stiffness, arm, lever = 10.0 ** random.uniform(1, 3), *random.uniform(0.05, 0.15, 2)
    large = random.uniform(2.0, 8.0) / (SOFTER if encoder else 1.0)
    small = large * random.uniform(0.2, 0.5)
    forces = [0.0, large, small, -large, -small]
    forces += [0.0] * (random.random() < 0.5)
    forces += [large, -large] * (random.random() < 0.3)
    exponent = 1.0 if random.random() < 0.5 else random.uniform(0.6, 1.0)
    least, most = small * arm, large * arm
    friction, gravity = random.uniform(0.0, 0.1) * least, random.uniform(-0.3, 0.3) * least
    friction *= SOFTER if encoder else 1.0
    n, error = len(forces), GAUGE_M / lever

    def readings(play: float, rubs: float, hard: float) -> Readings:
        zero, off = 1e-2 * random.normal(), 1.0 + 0.01 * random.normal()
        turned = []
        for force in forces:
            torque = force * arm * (1.0 + 0.01 * random.normal()) + gravity
            wound = (max(abs(torque) - rubs * friction, 0.0) / most) ** exponent
            pushed = np.sign(torque) * (play / 2.0 + most / (hard * stiffness) * wound)
            free = random.uniform(-1.0, 1.0) * play / 2.0
            turned.append(zero + (pushed if force else free) + error * random.normal())
        seen, deviation = off * np.array(turned), error
        if encoder:
            seen, deviation = COUNT * np.round(seen / COUNT), COUNT / np.sqrt(12.0)
        push = arm * np.array(forces)
        poses = (POSE,) * n
        return Readings((JOINT,) * n, ("",) * n, push, seen, np.full(n, deviation), pose=poses)

    plays, read = [play], [readings(play, 1.0, 1.0)]
    if grown is not None:
        plays.append(play * (1.0 + grown))
        differ = (1.0 + 0.2 * random.normal(), 1.0 + 0.03 * random.normal())
        read.append(readings(plays[1], *differ))
    return plays, read


def changed(number: int, seed: int, encoder: bool, benchmark: Benchmark) -> None:
    """How often a change's interval holds, and growth is told, beside what values alone tell."""
    robot, random, rows = jp.Mechanism("so101"), np.random.default_rng(seed), []
    for k in ProgressBar(range(number), "joints", unit="joint"):
        plays, read = joint(random, encoder, GROWN * (k % 2))
        told = changes(*(gauge_problems(robot, one) for one in read))[f"{JOINT} gear play change"]
        first, last = (identify_gauged(robot, one).estimates[0] for one in read)
        change = plays[1] - plays[0]
        rows.append(
            {
                "play_deg": float(np.degrees(plays[0])),
                "grown": bool(change > 0.0),
                "low_deg": float(np.degrees(told.low)),
                "high_deg": float(np.degrees(told.high)),
                "holds": bool(told.low <= change <= told.high),
                "growth told": bool(told.low > 0.0),
                "values part": bool(last.low > (first.upper if first.bounded else first.high)),
            }
        )
    table = []
    for what in (False, True):
        mine = [one for one in rows if one["grown"] == what]
        sums = (str(sum(one[k] for one in mine)) for k in ("holds", "growth told", "values part"))
        table.append([f"{100.0 * GROWN * what:g} %", str(len(mine)), *sums])
    header = ["growth of play", "joints", "hold the change", "growth told", "two values part"]
    benchmark.finish(header, table, rows)
    held = 100.0 * np.mean([one["holds"] for one in rows])
    print(f"joints {number} held {held:.1f} % growth told {table[1][3]} of {table[1][1]}")


def main() -> None:
    benchmark = Benchmark(
        "gauge", __doc__, runs=0, joints=(600, "that are drawn"), seed=(1, "of them"),
        encoder=(False, "the servo's own instead, on the output"),
        changes=(False, "each is measured twice, and the change is told"),
    )  # fmt: skip
    args = benchmark.parse()
    number = min(args.joints, 40) if args.quick else args.joints
    if args.changes:
        return changed(number, args.seed, args.encoder, benchmark)
    robot, random, rows = jp.Mechanism("so101"), np.random.default_rng(args.seed), []
    for _ in ProgressBar(range(number), "joints", unit="joint"):
        (play,), (read,) = joint(random, args.encoder)
        told = identify_gauged(robot, read).estimates[0]
        low, high = (0.0, told.upper) if told.bounded else told.interval
        rows.append(
            {
                "play_deg": float(np.degrees(play)),
                "told": "bound" if told.bounded else "interval",
                "low_deg": float(np.degrees(low)),
                "high_deg": float(np.degrees(high)),
                "holds": bool(low <= play <= high),
                "decided": bool(low >= HALF or high <= HALF),
                "wrong": bool((low >= HALF) > (play >= HALF) or (high <= HALF) > (play <= HALF)),
            }
        )
    table = []
    for what in ("interval", "bound"):
        mine = [one for one in rows if one["told"] == what]
        wide = [0.5 * (one["high_deg"] - one["low_deg"]) for one in mine] or [np.nan]
        hold = sum(one["holds"] for one in mine)
        table.append([what, str(len(mine)), str(hold), f"{np.median(wide):.3f}"])
    header = ["told", "joints", "hold the truth", "half width, median [deg]"]
    benchmark.finish(header, table, rows)
    held, decided, wrong = (
        100.0 * np.mean([one[what] for one in rows]) for what in ("holds", "decided", "wrong")
    )
    print(f"joints {number} held {held:.1f} % decided {decided:.1f} % wrong {wrong:.1f} %")


if __name__ == "__main__":
    main()
