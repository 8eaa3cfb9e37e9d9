"""Do moves back and forth under a dial gauge give the lost motion within the stated intervals?

Axes by another model than the one that is fitted: links held by friction that creeps before it
slides (Dahl's), teeth that stiffen, screws and dials that are off in scale, machines that warm up
exponentially, dials that are read in steps, stops that scatter, and a slip of the pen now and then.
What is told is compared with the motion that is lost on a long way there and back.
"""

from __future__ import annotations

import numpy as np
from common import Benchmark

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.estimate.lost_motion import Stairs, identify_lost_motion, plan_lost_motion


def axis(
    random: np.random.Generator, moves: list[tuple[float, bool]], warms: tuple[float, float]
) -> tuple[Stairs, float]:
    """Readings of an axis along the plan's moves [m], and its lost motion.

    `warms`: least and most moves in which it warms up.
    """
    play = float(random.choice([0.0, *10.0 ** random.uniform(-5.0, -3.3, 9)]))
    give, exponent = 10.0 ** random.uniform(-6.5, -4.5), random.uniform(0.6, 1.0)
    rest = 10.0 ** random.uniform(-6.5, -4.7)  # by which friction yields before it slides [m]
    motor = np.array([place for place, _ in moves])
    motor = motor[0] + (motor - motor[0]) * 10.0 ** random.uniform(-0.3, 0.7)

    def lag(way: np.ndarray) -> np.ndarray:
        """How far the link is behind along a way in fine steps: the teeth carry its friction."""
        friction, link, behind = 0.0, float(way[0]), []
        for target in way:
            low, high = min(link, target) - play - give, max(link, target) + play + give
            for _ in range(50):  # where the teeth carry just what friction holds
                new = 0.5 * (low + high)
                by = new - link
                holds = np.clip(friction + (by - abs(by) * friction) / rest, -1.0, 1.0)
                wound = np.sign(holds) * (0.5 * play + give * abs(holds) ** exponent)
                low, high = (new, high) if target - new > wound else (low, new)
            link, friction = new, float(holds)
            behind.append(target - link)
        return np.array(behind)

    fine, at = [motor[0]], [0]
    for target in motor[1:]:
        fine += list(np.linspace(fine[-1], target, 40)[1:])
        at.append(len(fine) - 1)
    behind = lag(np.array(fine))
    far = 20.0 * (play + give + 1e-5)
    long = np.concatenate([np.linspace(0, far, 400), np.linspace(far, 0, 400)])
    way = lag(long)
    lost = float(way[399] - way[-1])
    link = np.array(fine)[at] - behind[at]
    n, step = len(motor), float(random.choice([1e-6, 1e-5]))
    scatter = 10.0 ** random.uniform(-6.3, -5.3)
    warm = 1e-5 * random.normal() * (1.0 - np.exp(-np.arange(n) / random.uniform(*warms)))
    read = 1e-3 * random.normal() + (1.0 + 0.02 * random.normal()) * link + warm
    read += scatter * random.normal(size=n)
    if random.random() < 0.1:
        read[random.integers(n)] += 1e-4 * random.normal()
    read = step * np.round(read / step)
    read[[not one for _, one in moves]] = np.nan
    return Stairs(("x",) * n, ("x, ",) * n, motor, read, step=step), lost  # as a file tells it


SLOWLY, QUICKLY = (5.0, 50.0), (1.0, 5.0)
"""Moves in which machines warm up."""


def measured(number: int, seed: int, warms: tuple[float, float] = SLOWLY) -> list[dict]:
    """What is told of so many axes, beside the truth, a row each."""
    robot, random = jp.Mechanism(jp.shipped("gantry.urdf")), np.random.default_rng(seed)
    moves, rows = plan_lost_motion(robot, ["x"]).moves("x"), []
    for _ in ProgressBar(range(number), "axes", unit="axis"):
        stairs, lost = axis(random, moves, warms)
        told = identify_lost_motion(robot, stairs).estimates[0]
        low, high = (0.0, told.upper) if told.bounded else told.interval
        rows.append(
            {
                "lost_um": 1e6 * lost,
                "told": "cannot tell" if told.reason else "bound" if told.bounded else "interval",
                "low_um": 1e6 * low,
                "high_um": 1e6 * high,
                "holds": bool(low <= lost <= high),
            }
        )
    return rows


def held(number: int, seed: int) -> float:
    """Part of the intervals and bounds that hold the truth [%]."""
    rows = measured(number, seed)
    return 100.0 * float(np.mean([one["holds"] for one in rows if one["told"] != "cannot tell"]))


def main() -> None:
    benchmark = Benchmark(
        "lost_motion", __doc__, runs=0, axes=(400, "that are drawn"), seed=(1, "of them"),
        quickly=(0, "1: all warm up within the first moves"),
    )  # fmt: skip
    args = benchmark.parse()
    number = min(args.axes, 12) if args.quick else args.axes
    rows = measured(number, args.seed, QUICKLY if args.quickly else SLOWLY)
    table = []
    for what in ("interval", "bound", "cannot tell"):
        mine = [one for one in rows if one["told"] == what]
        wide = [0.5 * (one["high_um"] - one["low_um"]) for one in mine] or [np.nan]
        hold = sum(one["holds"] for one in mine)
        table.append([what, str(len(mine)), str(hold), f"{np.median(wide):.2f}"])
    benchmark.finish(["told", "axes", "hold the truth", "half width, median [µm]"], table, rows)
    told = [one["holds"] for one in rows if one["told"] != "cannot tell"]
    print(f"axes {len(rows)} held {100.0 * np.mean(told):.1f} %")


if __name__ == "__main__":
    main()
