"""Does what a dial gauge reads tell a joint's play, with the intervals stated?

Joints by another model than the one that is fitted: teeth that stiffen under load, friction,
gravity that leans on one side, forces and levers that are off, gauges that scatter. Each is pushed
to both sides with two forces; what is told is compared with the truth. With `--encoder` the gauge
is the servo's own encoder on the output, of 4096 counts: pushes are four times softer, lest the
motor turn, and friction four times as much of them.
"""

from __future__ import annotations

import numpy as np
from common import Benchmark

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.estimate.gauge import GAUGE_M, Readings, identify_gauged

JOINT = "shoulder_lift"
COUNT, SOFTER, HALF = 2.0 * np.pi / 4096.0, 4.0, np.radians(0.5)


def joint(random: np.random.Generator, encoder: bool = False) -> tuple[float, Readings]:
    """A joint's play [rad], and what was read of it."""
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
    zero, off = 1e-2 * random.normal(), 1.0 + 0.01 * random.normal()
    turned = []
    for force in forces:
        torque = force * arm * (1.0 + 0.01 * random.normal()) + gravity
        wound = most / stiffness * (max(abs(torque) - friction, 0.0) / most) ** exponent
        pushed = np.sign(torque) * (play / 2.0 + wound)
        free = random.uniform(-1.0, 1.0) * play / 2.0
        turned.append(zero + (pushed if force else free) + GAUGE_M / lever * random.normal())
    n, seen, error = len(forces), off * np.array(turned), GAUGE_M / lever
    if encoder:
        seen, error = COUNT * np.round(seen / COUNT), COUNT / np.sqrt(12.0)
    push = arm * np.array(forces)
    return play, Readings((JOINT,) * n, ("",) * n, push, seen, np.full(n, error))


def main() -> None:
    benchmark = Benchmark(
        "gauge", __doc__, runs=0, joints=(600, "that are drawn"), seed=(1, "of them"),
        encoder=(False, "the servo's own instead, on the output"),
    )  # fmt: skip
    args = benchmark.parse()
    number = min(args.joints, 40) if args.quick else args.joints
    robot, random, rows = jp.Mechanism("so101"), np.random.default_rng(args.seed), []
    for _ in ProgressBar(range(number), "joints", unit="joint"):
        play, read = joint(random, args.encoder)
        told = identify_gauged(robot, read).estimates[0]
        low, high = told.interval if told.found else (0.0, told.upper)
        rows.append(
            {
                "play_deg": float(np.degrees(play)),
                "told": "interval" if told.found else "bound",
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
