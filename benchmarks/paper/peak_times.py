"""Timings of the SCARA's cycle that would put its force peaks where the paper has them.

The paper gives six times of force peaks at joint B and its motion only as a sketch. Its timings
(stroke, swings, dwells, and where the cycle begins) are searched: draws at random, then the best
ones are varied. A motion counts by how far the two largest peaks along each axis are from the two
printed times. The best are then judged on further perturbed runs, which the search has not seen,
and so are the paper's claims with the best of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from common import Benchmark, new_figure

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.paper.cases import CASES, scara
from jointplay.paper.page import PRINTED_PEAKS, largest_peaks
from jointplay.simulation.analysis.claims import Verdict, judge, measure
from jointplay.simulation.analysis.tool_error import measured_against

PRINTED = np.concatenate(list(PRINTED_PEAKS.values()))
CYCLE = 3.0
JOINTS = ("joint_a", "joint_b", "stroke", "joint_c")
THERE, BACK = np.array([-0.30, 0.90, 0.0, 0.0]), np.array([0.70, -0.50, 0.0, 0.50])
DOWN = np.array([0.0, 0.0, -0.12, 0.0])
PHASES = ("down", "dwell", "up", "swing", "down", "dwell", "up", "swing")
SEARCHED, JUDGED = (0, 1), range(2, 10)
"""Seeds of the runs of the search, and of those that judge its best."""


@dataclass(frozen=True)
class Timings:
    """A cycle; its phases take these parts of it, in proportion."""

    first: int  # index of the phase that it begins with
    stroke: float
    swings: tuple[float, float]
    dwells: tuple[float, float]

    def motion(self) -> jp.Motion:
        """The cycle, its waypoints and directions as in the shipped motion."""
        parts = [self.stroke, self.dwells[0], self.stroke, self.swings[0]]
        parts += [self.stroke, self.dwells[1], self.stroke, self.swings[1]]
        place, low, begun = THERE, False, []
        for kind in PHASES:
            begun.append((place, low))
            low = {"down": True, "up": False}.get(kind, low)
            if kind == "swing":
                place = BACK if place is THERE else THERE
        order = [(self.first + k) % len(PHASES) for k in range(len(PHASES))]
        lengths = np.array(parts)[order] * CYCLE / sum(parts)
        times = np.concatenate([[0.0], np.cumsum(lengths)])
        ends = [begun[k] for k in (*order, order[0])]
        return jp.Motion(JOINTS, times, [at + (DOWN if deep else 0.0) for at, deep in ends])

    def varied(self, random: np.random.Generator, size: float) -> Timings:
        parts = (self.stroke, *self.swings, *self.dwells)
        stroke, *others = (part * np.exp(size * random.normal()) for part in parts)
        return Timings(self.first, stroke, tuple(others[:2]), tuple(others[2:]))


def draw(random: np.random.Generator) -> Timings:
    swing, dwell = random.uniform(0.3, 1.0), random.uniform(0.02, 0.4)
    swings = swing * np.exp(0.3 * random.normal(size=2))
    dwells = dwell * np.exp(0.5 * random.normal(size=2))
    first = int(random.integers(len(PHASES)))
    return Timings(first, random.uniform(0.15, 0.5), tuple(swings), tuple(dwells))


def moved(motion: jp.Motion | None, label: str, seed: int | None) -> jp.Result:
    """One run of a case; None: shipped motion."""
    simulation = scara(CASES[label], record_every=50, seed=seed)
    if motion is not None:
        simulation = replace(simulation, motion=motion)
    return simulation.run(estimate=False)


def peaks(case: tuple[jp.Motion | None, str, int]) -> list[float]:
    """Times of the six peaks of one run, in the order of `PRINTED` [s]."""
    result = moved(*case)
    return [time for axis in PRINTED_PEAKS for time, _ in largest_peaks(result, axis)]


LABELS = [label for label, clearance in CASES.items() if clearance is not None]


def misses(jobs: int, motions: list[jp.Motion | None], seeds, bar: ProgressBar) -> np.ndarray:
    """Differences of peak times from the printed ones, (motions, clearances, seeds, 6) [s]."""
    found = jp.Study(list(product(motions, LABELS, seeds)), peaks).run(jobs, bar)
    shape = (len(motions), len(LABELS), len(seeds), 6)
    return np.reshape(found, shape) - PRINTED


def claims(motion: jp.Motion, seeds: Iterable[int]) -> list[Verdict]:
    """The paper's claims with this motion, weight balanced, consistent inertias."""
    ideal = moved(motion, next(label for label in CASES if label not in LABELS), None)
    found = [
        [measure(measured_against(moved(motion, label, seed), ideal)) for seed in seeds]
        for label in LABELS
    ]
    return judge(*found, "balanced, consistent")


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    benchmark = Benchmark("peak_times", __doc__, runs=0, jobs=(2, "processes"))
    args = benchmark.parse()
    drawn, generations, parents = (2, 1, 1) if args.quick else (200, 6, 10)
    children, finalists = (1, 1) if args.quick else (24, 4)
    judged_by = JUDGED[:2] if args.quick else JUDGED
    random = np.random.default_rng(2211)
    each = len(LABELS) * len(SEARCHED)
    total = each * (drawn + generations * children)
    total += len(LABELS) * len(judged_by) * (finalists + 1)
    known: list[tuple[float, Timings]] = []
    with ProgressBar(total=total, unit="run") as bar:

        def judge(candidates: list[Timings]) -> None:
            found = misses(args.jobs, [one.motion() for one in candidates], SEARCHED, bar)
            known.extend(zip(map(rms, found), candidates, strict=True))
            known.sort(key=lambda item: item[0])

        judge([draw(random) for _ in range(drawn)])
        at_random = np.array([miss for miss, _ in known])
        for generation in range(generations):
            best = [one for _, one in known[:parents]]
            size = 0.15 * 0.7**generation
            judge([best[random.integers(len(best))].varied(random, size) for _ in range(children)])
        chosen = [one for _, one in known[:finalists]]
        found = misses(args.jobs, [None, *(one.motion() for one in chosen)], judged_by, bar)
    names = ["shipped", *(f"found {k + 1}" for k in range(len(chosen)))]
    header = ["motion", "searched RMS [s]", "judged RMS [s]", "largest [s]"]
    header += [f"{axis} near {at:g} s" for axis, times in PRINTED_PEAKS.items() for at in times]
    rows, data = [], []
    for k, name in enumerate(names):
        off = found[k]
        first = "-" if k == 0 else f"{known[k - 1][0]:.2f}"
        by_peak = off.reshape(-1, 6)
        spread = zip(by_peak.mean(0), by_peak.std(0), strict=True)
        cells = [f"{mean:+.2f} ± {deviation:.2f}" for mean, deviation in spread]
        rows.append([name, first, f"{rms(off):.2f}", f"{abs(off).max():.2f}", *cells])
        timings = vars(chosen[k - 1]) if k else dict.fromkeys(vars(chosen[0]), "")
        data += [
            {"motion": name, **timings, "clearance": label, "seed": seed}
            | {column: float(miss) for column, miss in zip(header[4:], off[c, s], strict=True)}
            for c, label in enumerate(LABELS)
            for s, seed in enumerate(judged_by)
        ]
    figure, panels = new_figure(1, 1, 7.0, 3.6)
    panel = panels[0, 0]
    panel.hist(at_random, bins=30, color="0.7", label="cycles drawn at random")
    for k, name in enumerate(names):
        panel.axvline(rms(found[k]), color=f"C{k}", lw=1.2, label=f"{name}, on other runs")
    panel.set(xlabel="RMS difference of the six peak times [s]", ylabel="cycles")
    panel.legend(fontsize=7, frameon=False)
    benchmark.finish(header, rows, data, figure)
    for name, one in zip(names[1:], chosen, strict=True):
        parts = ", ".join(f"{part:.2f}" for part in (one.stroke, *one.swings, *one.dwells))
        print(f"{name}: from '{PHASES[one.first]}' on; stroke, swings, dwells in the ratio {parts}")
    best = min(range(1, len(names)), key=lambda k: rms(found[k]))
    print(f"\nthe paper's claims with {names[best]}:")
    for verdict in claims(chosen[best - 1].motion(), judged_by):
        print(f"  {verdict.claim} {verdict.subject}: {verdict.holds}; {verdict.numbers}")
    numbers = np.random.default_rng(0).uniform(0.15, CYCLE, (20000, 3, 2))
    chance = np.sort(numbers, axis=2).reshape(-1, 6) - PRINTED
    print(
        f"peak times: shipped motion {rms(found[0]):.2f} s, best of {len(known)} cycles "
        f"{rms(found[best]):.2f} s RMS from the printed ones, with 5 free numbers for 6; six times "
        f"at random {rms(chance):.2f} s"
    )
