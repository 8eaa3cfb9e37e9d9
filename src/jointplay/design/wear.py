"""Wear of bearings by Archard's law, and how long a clearance takes to grow.

Where the journal slides under load it takes material off the bore, in proportion to normal force
and way (J. F. Archard, J. Appl. Phys. 24 (1953) 981-988):

    dV = (K/H) F_n ds

K is the whole factor, without Archard's 1/3 of round asperities: of a K that belongs to
V = K F_n s/(3 H), take a third. Which of both a table means has to be found out: Wikipedia's "Wear
coefficient" prints Archard and Hirst's K, which is the whole factor, beside 3 H.

A run counts F_n ds around the bore. Spread over the length that a contact stands for, it is a
depth, and the worn bore is what the journal meets in the next run. Since a cycle wears nanometres,
wear is extrapolated over blocks of many equal cycles, between which the bore's shape is brought up
to date; the outcome is an estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from jointplay.analysis.runs import MOST_RUNS, check_numbers
from jointplay.analysis.uncertainty import standard_error
from jointplay.core import files
from jointplay.core.errors import JointplayError, MissingName, require_positive, require_whole
from jointplay.joints.base import BoreWear
from jointplay.kernel import AZIMUTHS
from jointplay.simulation.ensemble import run_in_order

if TYPE_CHECKING:
    from jointplay.result.result import Result
    from jointplay.simulation.simulation import Simulation


def worn_depth(result: Result, joint: str) -> np.ndarray:
    """Depth by which a run has worn the bore of `joint`, by end and azimuth [m].

    Returns:
        shape (2, n) for ends A and B of the bore, or (1, n) if the journal cannot tilt, at n equal
        azimuths from the bearing's x axis.

    Raises:
        MissingName: no joint of that name whose wear the run reckoned.
    """
    return depth_of(_wearing(result.simulation, joint), result, joint)


def _wearing(simulation: Simulation, joint: str) -> BoreWear:
    wearing = all_wearing(simulation)
    if joint not in wearing:
        raise MissingName("joint with a wear rate", joint, wearing)
    return wearing[joint]


def depth_of(bore: BoreWear, result: Result, joint: str) -> np.ndarray:
    """See `worn_depth`; of a joint that is known to wear."""
    contacts = result.simulation.mechanism.clearance[joint].contacts
    names = list(contacts[: len(bore.widths)])
    if "sliding_work" not in result.dataset or not set(names) <= set(result["contact"].values):
        raise JointplayError(f"the result has no wear of the joint {joint!r}: it is damaged")
    work = result["sliding_work"].sel(joint=joint, contact=names).values
    area = bore.radius * (2.0 * math.pi / AZIMUTHS) * np.array(bore.widths)
    return bore.rate * work / area[:, None]


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
        """Largest depth after each block [m]."""
        return self.profiles.max(axis=(1, 2))

    @property
    def mean(self) -> np.ndarray:
        """Depth after each block, mean over the bore [m]."""
        return self.profiles.mean(axis=(1, 2))

    def save(self, path: str | Path) -> None:
        """Write a CSV file: a row per block, end and azimuth.

        Raises:
            JointplayError: the file exists or cannot be written.
        """
        blocks, ends, azimuths = self.profiles.shape
        lines = ["block,cycles,end,azimuth_rad,depth_m"]
        lines += [
            f"{block},{self.cycles[block]:.8g},{'AB'[end]},"
            f"{2.0 * math.pi * at / azimuths:.6f},{self.profiles[block, end, at]:.6g}"
            for block, end, at in np.ndindex(blocks, ends, azimuths)
        ]
        files.write(path, "\n".join([*lines, ""]))

    def __str__(self) -> str:
        """Say the outcome in words, and that it is an estimate."""
        last, blocks = self.cycles[-1], len(self.cycles) - 1
        total = float(np.sqrt(np.nansum(self.scatter**2)))
        spread = f" +- {total:.2g}" if np.isfinite(self.scatter[1:]).any() else ""
        what = "until" if self.reached else "interrupted, not until"
        return (
            f"about {last:.3g}{spread} cycles {what} the clearance of {self.joint!r} has grown by "
            f"{self.growth:.3g} m where it is worn most (by {self.mean[-1]:.2g} m in the mean): an "
            f"estimate, extrapolated over {blocks} blocks of equal cycles"
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

    In each block the simulation is run with the bore as it is, its wear is taken for that of every
    cycle, and as many cycles are taken together as wear the deepest place by a further
    1/`blocks` of `growth`. Other joints with a wear rate wear along.

    Args:
        simulation: one run, of one or a few cycles of the machine.
        joint: the joint that is to grow; it must have a `wear_rate`.
        growth: depth at the most worn place [m].
        blocks: how many times the bore's shape is brought up to date; more is more exact.
        cycles_per_run: cycles that one run holds.
        runs: runs of each block, their journals perturbed at the start by different seeds; the
            mean of their wear is taken, and their scatter tells how well it is known.
        jobs: processes for them; None takes one for each core.
        progress: show a bar on standard error.

    Returns:
        The estimate; interrupted by Ctrl-C, what is known so far.

    Raises:
        JointplayError: a value out of range, a run that fails, or a joint that does not wear.
    """
    require_positive("growth", growth, "m")
    require_positive("cycles per run", cycles_per_run, "")
    check_numbers(runs, jobs)
    require_whole("blocks", blocks, 1, MOST_RUNS)
    _wearing(simulation, joint)
    worn = {name: first_profile(one) for name, one in all_wearing(simulation).items()}
    begun = worn[joint].copy()
    cycles, profiles, scatter = [0.0], [begun - begun], [0.0]
    bar = tqdm(total=blocks * runs, disable=not progress, unit="run", desc=f"wear of {joint}")
    reached = False
    try:
        for block in range(blocks):
            wear, known = _block(with_worn(simulation, worn), joint, runs, jobs, bar)
            wear = {name: depth / cycles_per_run for name, depth in wear.items()}
            if wear[joint].max() <= 0.0:
                raise JointplayError(
                    f"the journal of {joint!r} does not slide under load: its clearance lasts"
                )
            goal = growth * (block + 1) / blocks
            left = goal - (worn[joint] - begun)
            slow = wear[joint] <= 0.0
            count = float(np.min(np.where(slow, np.inf, left / np.where(slow, 1.0, wear[joint]))))
            for name in worn:
                worn[name] = worn[name] + count * wear[name]
            cycles.append(cycles[-1] + count)
            profiles.append(worn[joint] - begun)
            scatter.append(known * count)
        reached = True
    except KeyboardInterrupt:
        pass
    finally:
        bar.close()
    return WearLife(joint, np.array(cycles), np.array(profiles), np.array(scatter), growth, reached)


def all_wearing(simulation: Simulation) -> dict[str, BoreWear]:
    """The bores that have a wear rate, by joint."""
    clearance = simulation.mechanism.clearance
    return {name: one.wear for name, one in clearance.items() if one.wear is not None}


def first_profile(bore: BoreWear) -> np.ndarray:
    """Profile that a bore begins with, at `AZIMUTHS` azimuths, shape (ends, AZIMUTHS) [m]."""
    given = bore.profile
    if given is None:
        return np.zeros((len(bore.widths), AZIMUTHS))
    places, own = np.arange(AZIMUTHS) / AZIMUTHS, np.arange(given.shape[1]) / given.shape[1]
    return np.array([np.interp(places, own, row, period=1.0) for row in given])


def with_worn(simulation: Simulation, worn: dict[str, np.ndarray]) -> Simulation:
    """The simulation with worn bores."""
    joints = dict(simulation.mechanism.clearance)
    for name, profile in worn.items():
        joints[name] = joints[name].with_worn(profile)
    return replace(simulation, mechanism=simulation.mechanism.with_clearance(joints))


def wear_of_runs(
    simulation: Simulation, runs: int, jobs: int | None, bar: tqdm
) -> list[dict[str, np.ndarray]]:
    """Depths that each run wears off by joint [m], with seeds of their own if there are several.

    Raises:
        JointplayError: one fails.
        KeyboardInterrupt: one is interrupted.
    """
    first = simulation.seed or 0
    seeds = [simulation.seed] if runs == 1 else range(first + 1, first + runs + 1)
    drawn = [replace(simulation, seed=seed) for seed in seeds]
    return run_in_order(_depths, drawn, jobs, bar)


def _depths(simulation: Simulation) -> dict[str, np.ndarray]:
    result = simulation.run().completed("a run with worn bores")
    return {name: depth_of(one, result, name) for name, one in all_wearing(simulation).items()}


def _block(
    simulation: Simulation, joint: str, runs: int, jobs: int | None, bar: tqdm
) -> tuple[dict[str, np.ndarray], float]:
    """Mean wear of the runs of one block by joint [m], and its relative standard error."""
    depths = wear_of_runs(simulation, runs, jobs, bar)
    mean = {name: np.mean([one[name] for one in depths], axis=0) for name in depths[0]}
    total = np.array([one[joint].sum() for one in depths])
    return mean, standard_error(total) / total.mean() if total.mean() else math.nan
