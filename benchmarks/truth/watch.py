"""Is a change of play told truly over months, and does nothing raise a false alarm?

Series of measurements of joints that wear by 2 % a month, or do not, by other models than the one
that is fitted. Dial gauge: teeth that stiffen, friction and stiffness that differ from month to
month, levers and forces that are off each time. In motion (`--machines`): the elastic arms of
`identify`, measured anew each time. Counted: intervals of the change since the first month that
hold the truth, series without wear that raise an alarm, and when those with wear do, beside the
month in which the plays' own intervals part.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from common import Benchmark
from truth import identify as arms

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.estimate.gauge import GAUGE_M, Readings, gauge_problems
from jointplay.estimate.identification import identify_problem
from jointplay.estimate.watch import Watch, watch

JOINT = "shoulder_lift"
WEAR = 0.02
"""A month."""


def names(count: int) -> list[str]:
    """Of measurements, one a month."""
    return [f"{2026 + k // 12}-{k % 12 + 1:02d}-01" for k in range(count)]


def read(random: np.random.Generator, plays: list[float]) -> list[Readings]:
    """A joint's readings in each month."""
    stiffness, arm, lever = 10.0 ** random.uniform(1, 3), *random.uniform(0.05, 0.15, 2)
    large = random.uniform(2.0, 8.0)
    small = large * random.uniform(0.2, 0.5)
    forces = np.array([0.0, large, small, -large, -small])
    exponent = 1.0 if random.random() < 0.5 else random.uniform(0.6, 1.0)
    least, most = small * arm, large * arm
    friction, gravity = random.uniform(0.0, 0.1) * least, random.uniform(-0.3, 0.3) * least
    found, n = [], len(forces)
    for play in plays:
        zero, off = 1e-2 * random.normal(), 1.0 + 0.01 * random.normal()
        rubs, hard = friction * (1.0 + 0.2 * random.normal()), 1.0 + 0.03 * random.normal()
        torque = forces * arm * (1.0 + 0.01 * random.normal(size=n)) + gravity
        bent = most / (hard * stiffness) * (np.maximum(abs(torque) - rubs, 0.0) / most) ** exponent
        turned = np.sign(torque) * (play / 2.0 + bent)
        turned[0] = random.uniform(-0.5, 0.5) * play
        turned += zero + GAUGE_M / lever * random.normal(size=n)
        error = np.full(n, GAUGE_M / lever)
        found.append(Readings((JOINT,) * n, ("",) * n, arm * forces, off * turned, error))
    return found


def gauge_case(seed: int, months: int) -> list[dict]:
    """Of one joint, that wears or not."""
    random, robot = np.random.default_rng([11, seed]), jp.Mechanism("so101")
    wear, play = WEAR * (seed % 2), float(np.radians(10.0 ** random.uniform(-1.5, 0.2)))
    plays = [play * (1.0 + wear) ** k for k in range(months)]
    problems = [gauge_problems(robot, one) for one in read(random, plays)]
    dates = list(zip(names(months), problems, strict=True))
    truth = {f"{JOINT} gear play": plays}
    alarmed = parted = months
    if wear:
        first = watch(dates[:2]).estimates[0]
        for k in range(2, months):
            now = watch(dates[: k + 1])
            if now.alarms:
                alarmed = min(alarmed, k)
            if now.estimates[0].low > first.high:
                parted = min(parted, k)
    return rows_of(seed, watch(dates), truth, {"alarmed": alarmed, "parted": parted})


def motion_case(seed: int, months: int) -> list[dict]:
    """Of the plays of one arm."""
    random, wear = np.random.default_rng([7, seed]), WEAR * (seed % 2)
    arm = arms.elastic_arm(random, arms.PLAY_KINDS[seed % len(arms.PLAY_KINDS)])
    strength = random.uniform(1.2, 2.5) * 9.81 * sum(one.mass for one in arm.joints)
    believed, friction, _ = arms.belief(random, arm)
    pairs = zip(("shoulder", "elbow"), arm.joints, strict=True)
    links = tuple(name for name, one in pairs if one.play)
    dates, truth = [], dict[str, list[float]]()
    for k, name in enumerate(names(12)[:: 12 // months]):
        factor = (1.0 + wear) ** (k * 12 // months)
        worn = tuple(
            replace(one, clearance=factor * one.clearance, play=factor * one.play)
            for one in arm.joints
        )
        for joint, one in zip(("shoulder", "elbow"), worn, strict=True):
            truth.setdefault(f"{joint} radial clearance", []).append(one.clearance)
            truth.setdefault(f"{joint} gear play", []).append(one.play)
        seen = arms.elastic_seen(random, replace(arm, joints=worn), strength, 3, links)
        dates.append((name, [identify_problem(believed, seen, joint_friction=friction)]))
    return rows_of(seed, watch(dates), truth, {})


def rows_of(seed: int, found: Watch, truth: dict[str, list[float]], more: dict) -> list[dict]:
    """A row for each play."""
    return [
        {
            "case": seed, "label": label, "worn": bool(seed % 2), "alarm": bool(found.alarms),
            "change": (change := truth[label][-1] - truth[label][0]), "low": last.low,
            "high": last.high, "holds": last.low <= change <= last.high,
            "play": truth[label][0], **more,
        }
        for label, course in found.courses.items()
        for last in [course.changes[-1]]
    ]  # fmt: skip


def main() -> None:
    benchmark = Benchmark(
        "watch", __doc__ or "", runs=0, joints=(200, "with a dial gauge; --quick: 20"),
        machines=(0, "in their place, arms in motion, some seconds each; --quick: 1"),
        months=(12, "of each series; in motion a quarter of them are measured"),
    )  # fmt: skip
    args = benchmark.parse()
    if args.machines:
        benchmark.name = "watch_motion"
        count = 1 if args.quick else args.machines
        bar = ProgressBar(range(count), "arms", unit="arm")
        every = [motion_case(seed, 3 if args.quick else max(args.months // 4, 2)) for seed in bar]
    else:
        count = min(args.joints, 20) if args.quick else args.joints
        bar = ProgressBar(range(count), "joints", unit="joint")
        every = [gauge_case(seed, args.months) for seed in bar]
    rows, table = [row for some in every for row in some], []
    for worn in (False, True):
        mine = [row for row in rows if row["worn"] == worn]
        alarms = len({row["case"] for row in mine if row["alarm"]})
        wide = [0.5 * (row["high"] - row["low"]) / row["play"] for row in mine if row["play"]]
        first = [f"{np.median([r[k] for r in mine]):g}" if k in mine[0] and worn else "-"
                 for k in ("alarmed", "parted")]  # fmt: skip
        cases = len({row["case"] for row in mine})
        held = f"{sum(row['holds'] for row in mine)} of {len(mine)}"
        table.append([f"{100 * WEAR * worn:g} % a month", str(cases), held, str(alarms),
                      f"{100 * np.median(wide):.2g} %", *first])  # fmt: skip
    header = ["wear", "series", "changes held", "alarms", "half width by the play, median",
              "month of the alarm, median", "month in which values part, median"]  # fmt: skip
    benchmark.finish(header, table, rows)
    held, false = sum(row["holds"] for row in rows), int(table[0][3])
    print(f"changes {len(rows)} held {100.0 * held / len(rows):.1f} % false alarms {false} of "
          f"{table[0][1]}")  # fmt: skip


if __name__ == "__main__":
    main()
