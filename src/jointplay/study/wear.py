"""Wear of bearings by Archard's law, and how long a clearance takes to grow (docs/wear.md).

Where the journal slides under load it takes material off the bore, in proportion to normal force
and way (J. F. Archard, J. Appl. Phys. 24 (1953) 981-988): dV = (K/H) F_n ds, K being the whole
factor, without Archard's 1/3 of round asperities.

A run counts F_n ds around the bore; over the length that a contact stands for it is a depth, and
the worn bore is what the journal meets in the next run. Wear is extrapolated over blocks of many
equal cycles, between which the bore's shape is brought up to date; the outcome is an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import (
    JointplayError,
    MissingName,
    require_a,
    require_positive,
    require_whole,
)
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Table, counted
from jointplay.base.units import readable
from jointplay.physics.joints import RollingBearing
from jointplay.physics.joints.base import BoreWear
from jointplay.physics.kernel import AZIMUTHS
from jointplay.simulation.analysis.uncertainty import standard_error
from jointplay.study.courses import MOST_RUNS, check_numbers
from jointplay.study.study import Measure, Study

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.simulation import Simulation

Depths = Mapping[str, np.ndarray]
"""Worn depths by joint, each by end of the bore and azimuth, (ends, azimuths) [m]."""


def worn_depth(result: Result, joint: str) -> np.ndarray:
    """Depth by which a run has worn the bore of `joint`, by end and azimuth [m].

    Returns:
        shape (2, n) for ends A and B of the bore, or (1, n) if the journal cannot tilt, at n equal
        azimuths from the bearing's x axis.

    Raises:
        MissingName: no joint of that name whose wear the run calculated.
    """
    bore = _bore(result.simulation, joint)
    contacts = result.simulation.mechanism.clearance[joint].contacts
    names = list(contacts[: len(bore.widths)])
    if "sliding_work" not in result.dataset or not set(names) <= set(result["contact"].values):
        raise JointplayError(f"the result has no wear of the joint {joint!r}: it is damaged")
    work = result["sliding_work"].sel(joint=joint, contact=names).values
    area = bore.radius * (2.0 * math.pi / AZIMUTHS) * np.array(bore.widths)
    return bore.rate * work / area[:, None]


def worn_depths(result: Result) -> Depths:
    """The `worn_depth` of all joints that wear."""
    return {name: worn_depth(result, name) for name in all_wearing(result.simulation)}


def all_wearing(simulation: Simulation) -> dict[str, BoreWear]:
    """The bores that have a wear rate, by joint."""
    clearance = simulation.mechanism.clearance
    return {name: joint.wear for name, joint in clearance.items() if joint.wear is not None}


def _bore(simulation: Simulation, joint: str) -> BoreWear:
    wearing = all_wearing(simulation)
    if joint not in wearing:
        fitted = simulation.mechanism.clearance.get(joint)
        if isinstance(fitted, RollingBearing):
            raise JointplayError(
                f"joint {joint!r} has a rolling bearing, which has no wear rate but a rating life "
                "L10: see jointplay run or jointplay report"
            )
        if fitted is None and joint in simulation.mechanism.joints:
            raise JointplayError(
                f"joint {joint!r} has no clearance, and wear is of bores, not of the teeth of "
                f"gears: give --set joints.{joint}.radial_clearance=LENGTH and its wear_rate"
            )
        raise MissingName("joint with a wear rate", joint, wearing)
    return wearing[joint]


def first_profile(bore: BoreWear) -> np.ndarray:
    """Profile that a bore begins with, at `AZIMUTHS` azimuths, shape (ends, AZIMUTHS) [m]."""
    start = bore.profile
    if start is None:
        return np.zeros((len(bore.widths), AZIMUTHS))
    places, measured = np.arange(AZIMUTHS) / AZIMUTHS, np.arange(start.shape[1]) / start.shape[1]
    return np.array([np.interp(places, measured, row, period=1.0) for row in start])


def with_worn(simulation: Simulation, worn: Depths) -> Simulation:
    """The simulation with worn bores."""
    joints = dict(simulation.mechanism.clearance)
    joints |= {name: joints[name].with_worn(profile) for name, profile in worn.items()}
    return replace(simulation, mechanism=simulation.mechanism.with_clearance(joints))


@dataclass(frozen=True)
class WearLife:
    """How a bore wears with the cycles: an estimate, for each block is taken for equal cycles."""

    joint: str
    cycles: np.ndarray
    """Cycles done after each block, the first entry 0, shape (blocks + 1,)."""
    profiles: np.ndarray
    """Worn depth after each block, by end and azimuth, shape (blocks + 1, ends, n) [m]."""
    scatter: np.ndarray
    """Standard error of each block's cycles, from perturbed runs; NaN with one, (blocks + 1,)."""
    growth: float
    """Growth of the clearance that was asked for [m]."""
    reached: bool
    """Whether it was reached; else the estimate was interrupted."""

    @property
    def deepest(self) -> np.ndarray:
        return self.profiles.max(axis=(1, 2))

    @property
    def mean(self) -> np.ndarray:
        return self.profiles.mean(axis=(1, 2))

    @property
    def table(self) -> Table:
        azimuths = self.profiles.shape[2]
        rows = [
            (block, self.cycles[block], "AB"[end], 2 * math.pi * at / azimuths, depth)
            for (block, end, at), depth in np.ndenumerate(self.profiles)
        ]
        heads = (("block", ""), ("cycles", ""), ("end", ""), ("azimuth", "rad"), ("depth", "m"))
        return Table.of(heads, rows)

    def __str__(self) -> str:
        if len(self.cycles) == 1:
            return f"Interrupted before anything was known of the wear of {self.joint!r}"
        last, blocks = self.cycles[-1], len(self.cycles) - 1
        total = float(np.sqrt(np.nansum(self.scatter**2)))
        spread = f" +- {total:.2g}" if np.isfinite(self.scatter[1:]).any() else ""
        deepest, mean, growth = (
            readable(depth, "m", 3) for depth in (self.deepest[-1], self.mean[-1], self.growth)
        )
        begins = "After" if self.reached else "Interrupted: after"
        ends = "" if self.reached else f", not yet by {growth}"
        return (
            f"{begins} about {last:.3g}{spread} cycles the clearance of {self.joint!r} has grown "
            f"by {deepest} where wear is deepest ({mean} in the mean){ends}: an estimate, by "
            f"{counted(blocks, 'block')} of equal cycles, each wearing as the runs at its "
            "beginning do"
        )


def wear(
    simulation: Simulation,
    joint: str,
    growth: float,
    *,
    blocks: int = 10,
    cycles_per_run: float = 1.0,
    runs: int = 1,
    jobs: int | None = None,
    progress: bool = False,
) -> WearLife:
    """Estimate the cycles until the clearance of `joint` has grown by `growth`.

    As many cycles are taken together as wear the deepest place by a further 1/`blocks` of `growth`;
    each block is run with the bores as they are, and its wear taken for that of all its cycles.
    Other joints with a wear rate wear along.

    Args:
        simulation: one run, of one or a few cycles of the machine.
        joint: whose clearance is to grow; it must have a `wear_rate`.
        growth: depth at the most worn place [m].
        blocks: how many times the bores' shapes are brought up to date; more are more exact.
        cycles_per_run: cycles that one run holds.
        runs: of each block, perturbed at the start by different seeds if there are several; their
            scatter tells how well their mean is known.
        jobs: processes; None takes one for each core.
        progress: show a bar on standard error.

    Returns:
        The estimate; interrupted by Ctrl-C, what is known so far.

    Raises:
        JointplayError: a value out of range, a run that fails, or a joint that does not wear.
    """
    require_a("simulation", simulation, "Simulation")
    require_positive("growth", growth, "m")
    check_numbers(runs, jobs)
    require_positive("cycles per run", cycles_per_run, "")
    require_whole("blocks", blocks, 1, MOST_RUNS)
    begun = first_profile(_bore(simulation, joint))
    worn: Depths = {name: first_profile(bore) for name, bore in all_wearing(simulation).items()}
    first = simulation.seed or 0
    seeds = [simulation.seed] if runs == 1 else range(first + 1, first + runs + 1)
    measure = Measure(worn_depths, "a run with worn bores", check_step=True)
    cycles, scatter, profiles = [0.0], [0.0], [begun]
    with ProgressBar(total=blocks * runs, disable=not progress, unit="run", desc="wear") as bar:
        for block in range(1, blocks + 1):
            machine = with_worn(simulation, worn)
            try:
                depths = Study([replace(machine, seed=s) for s in seeds], measure).run(jobs, bar)
            except KeyboardInterrupt:
                break
            mean = {
                name: np.mean([run[name] for run in depths], axis=0) / cycles_per_run
                for name in worn
            }
            rate = mean[joint]
            if rate.max() <= 0.0:
                raise JointplayError(
                    f"the journal of {joint!r} does not slide under load: its clearance does not "
                    "grow"
                )
            wears = rate > 0.0
            left = growth * block / blocks - (worn[joint] - begun)
            count = float((left[wears] / rate[wears]).min())
            worn = {name: worn[name] + count * mean[name] for name in worn}
            totals = np.array([depth[joint].sum() for depth in depths])
            cycles.append(cycles[-1] + count)
            scatter.append(standard_error(totals) / totals.mean() * count)
            profiles.append(worn[joint])
    return WearLife(
        joint,
        np.array(cycles),
        np.array(profiles) - begun,
        np.array(scatter),
        growth,
        len(cycles) > blocks,
    )
