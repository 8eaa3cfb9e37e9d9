"""Wear of bearings by Archard's law, and how long a clearance takes to grow (docs/wear.md).

Where the journal slides under load it takes material off the bore, in proportion to normal force
and sliding distance (J. F. Archard, J. Appl. Phys. 24 (1953) 981-988): dV = (K/H) F_n ds, K being
the whole factor, without Archard's 1/3 for round asperities.

A run accumulates F_n ds by azimuth around bore and journal; times K/H that is the worn volume by
azimuth. Wear is extrapolated over blocks of many equal cycles: the journal grinds itself into the
bore where it presses, and the bore into the journal (`ground`). The next block's run is made with
the worn bore; wear of the journal enters it by its mean over the azimuths. The result is an
estimate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from jointplay.base.errors import (
    JointplayError,
    MissingName,
    require_a,
    require_positive,
    require_whole,
)
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Table, counted
from jointplay.base.units import readable
from jointplay.physics.joints import RollingBearing
from jointplay.physics.joints.base import WEARING_PARTS, Wear
from jointplay.physics.kernel import AZIMUTHS
from jointplay.simulation.analysis.uncertainty import standard_error
from jointplay.study.courses import MOST_RUNS, check_numbers
from jointplay.study.study import Measure, Study

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.simulation import Simulation

Depths = Mapping[str, np.ndarray]
"""Worn depths by joint, by part (`WEARING_PARTS`), end and azimuth, (2, ends, azimuths) [m]."""


def worn_depth(result: Result, joint: str, part: str = "bore") -> np.ndarray:
    """Depth by which a run has worn the bore of `joint`, or its journal, by end and azimuth [m].

    Returns:
        shape (2, n) for ends A and B, or (1, n) if the journal cannot tilt, at n equal azimuths
        from the x axis of the bearing, or of the journal.

    Raises:
        MissingName: no joint of that name whose wear the run calculated, or no such part.
    """
    if part not in WEARING_PARTS:
        raise MissingName("part that wears", part, WEARING_PARTS)
    wear = _wear(result.simulation, joint)
    contacts = result.simulation.mechanism.clearance[joint].contacts
    names = list(contacts[: len(wear.widths)])
    if "sliding_work" not in result.dataset or not set(names) <= set(result["contact"].values):
        raise JointplayError(f"the result has no wear of the joint {joint!r}: it is damaged")
    work = result["sliding_work"].sel(joint=joint, part=part, contact=names).values
    index = WEARING_PARTS.index(part)
    radius = (wear.radius, wear.journal_radius)[index]
    area = radius * (2.0 * math.pi / AZIMUTHS) * np.array(wear.widths)
    return wear.rates[index] * work / area[:, None]


def worn_depths(result: Result) -> Depths:
    """`worn_depth` of bore and journal of all joints that wear."""
    return {
        name: np.array([worn_depth(result, name, part) for part in WEARING_PARTS])
        for name in all_wearing(result.simulation)
    }


def all_wearing(simulation: Simulation) -> dict[str, Wear]:
    """Wear data of the joints that have a wear rate, by joint."""
    clearance = simulation.mechanism.clearance
    return {name: joint.wear for name, joint in clearance.items() if joint.wear is not None}


def _wear(simulation: Simulation, joint: str) -> Wear:
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
        if fitted is not None:
            raise JointplayError(
                f"joint {joint!r} has no wear rate: give --set "
                f"'joints.{joint}.wear_rate=\"1e-5 mm^3/(N*m)\"' with that of its materials"
            )
        raise MissingName("joint with a wear rate", joint, wearing)
    return wearing[joint]


def first_profile(wear: Wear) -> np.ndarray:
    """Worn depth of bore and journal at the start, by end and azimuth, (2, ends, AZIMUTHS) [m].

    A measured profile of the bore is interpolated to the azimuths; else all is zero.
    """
    profiles = np.zeros((2, len(wear.widths), AZIMUTHS))
    start = wear.profile
    if start is not None:
        azimuths = np.arange(AZIMUTHS) / AZIMUTHS
        measured = np.arange(start.shape[1]) / start.shape[1]
        profiles[0] = [np.interp(azimuths, measured, row, period=1.0) for row in start]
    return profiles


_SLICES = 8
"""Slices in which a block's wear is ground off: the depth at one azimuth changes how far the
journal sinks at the next. Eight put the deepest place 2 % shallower than 64 do (measured)."""


def ground(profile: np.ndarray, volume: np.ndarray, clearance: float) -> np.ndarray:
    """Profile of a bore, or of a journal, after the other has ground `volume` off it.

    A round journal that presses at an azimuth cuts its own shape into the bore: its centre sinks
    until the sickle between its circle and the bore, d cos(phi) - clearance beyond the bore's
    circle, has the volume. A bore that wears its journal does the same.

    Args:
        profile: depth at equal azimuths, shape (n,) [m].
        volume: volume worn off by contact at each azimuth, divided by that of 1 m of depth over one
            azimuth's width, shape (n,) [m]. The depths' sum grows by its sum.
        clearance: radial clearance of the round bore [m].
    """
    n = len(profile)
    depth, share = profile.copy(), volume / _SLICES
    reach = np.arange(-((n - 1) // 4), (n - 1) // 4 + 1)  # less than a quarter turn to each side
    cosine = np.cos(2.0 * math.pi * reach / n)
    pressed = np.flatnonzero(share > 0.0)
    for turn in range(_SLICES):
        for azimuth in pressed[:: 1 - 2 * (turn % 2)]:  # to and fro: the first sinks deepest
            near = (azimuth + reach) % n
            room = clearance + depth[near]
            # The sinking journal meets the azimuths in the order of room / cosine; between two of
            # them the volume is linear in its descent. The last whose descent is enough to reach
            # it is the last that is cut.
            order = np.argsort(room / cosine)
            descent = (share[azimuth] + np.cumsum(room[order])) / np.cumsum(cosine[order])
            last = np.flatnonzero(descent >= (room / cosine)[order])[-1]
            depth[near] += np.maximum(descent[last] * cosine - room, 0.0)
    return depth


def _ground_all(simulation: Simulation, worn: Depths, wear: Depths, cycles: float) -> Depths:
    """Profiles `worn` after further `cycles`, each of which wears the depths `wear`."""
    clearance = simulation.mechanism.clearance
    ground_profiles = {}
    for name, profile in worn.items():
        bearing = clearance[name].wear
        assert bearing is not None
        room = bearing.radius - bearing.journal_radius
        volumes = cycles * wear[name]
        ground_profiles[name] = np.array([
            [ground(*row, room) for row in zip(*part, strict=True)]
            for part in zip(profile, volumes, strict=True)
        ])  # fmt: skip
    return ground_profiles


def with_worn(simulation: Simulation, worn: Depths) -> Simulation:
    """The simulation with worn bores, each widened by the mean wear of its journal."""
    joints = dict(simulation.mechanism.clearance)
    for name, (bore, journal) in worn.items():
        joints[name] = joints[name].with_worn(bore + journal.mean(axis=-1, keepdims=True))
    return replace(simulation, mechanism=simulation.mechanism.with_clearance(joints))


@dataclass(frozen=True)
class WearLife:
    """Estimated wear of a joint over the cycles; the cycles of a block are taken to be equal."""

    joint: str
    cycles: np.ndarray
    """Cycles done after each block, the first entry 0, shape (blocks + 1,)."""
    profiles: np.ndarray
    """Worn depth after each block, by part (bore, journal), end and azimuth,
    shape (blocks + 1, 2, ends, n) [m]."""
    scatter: np.ndarray
    """Standard error of each block's wear over it, from perturbed runs; NaN with one run,
    shape (blocks + 1,)."""
    growth: float | None
    """Growth of the clearance that was asked for; None: a number of cycles was [m]."""
    reached: bool
    """Whether that growth, or that number of cycles, was reached; False: interrupted before."""

    @property
    def bore(self) -> np.ndarray:
        """Depth of the deepest place of the bore after each block [m]."""
        return self.profiles[:, 0].max(axis=(1, 2))

    @property
    def journal(self) -> np.ndarray:
        """Depth of the deepest place of the journal after each block [m]."""
        return self.profiles[:, 1].max(axis=(1, 2))

    @property
    def deepest(self) -> np.ndarray:
        """Growth of the clearance where the deepest places of bore and journal meet [m]."""
        return self.bore + self.journal

    @property
    def mean(self) -> np.ndarray:
        """Growth of the clearance averaged over ends and azimuths [m]."""
        return self.profiles.mean(axis=(2, 3)).sum(axis=1)

    @property
    def both_wear(self) -> bool:
        """Whether bore and journal wear."""
        return bool(self.bore[-1] > 0.0 and self.journal[-1] > 0.0)

    def _spread(self, values: np.ndarray) -> float:
        """Standard error of the last of `values`, from that of each block; zero: not known."""
        return float(np.sqrt(np.nansum((self.scatter[1:] * np.diff(values)) ** 2)))

    @property
    def table(self) -> Table:
        azimuths, parts = self.profiles.shape[3], self.profiles.max(axis=(0, 2, 3)) > 0.0
        rows = [
            (
                block, self.cycles[block], WEARING_PARTS[part], "AB"[end],
                2 * math.pi * azimuth / azimuths, depth,
            )
            for (block, part, end, azimuth), depth in np.ndenumerate(self.profiles)
            if parts[part]
        ]  # fmt: skip
        heads = (
            ("block", ""), ("cycles", ""), ("part", ""), ("end", ""), ("azimuth", "rad"),
            ("depth", "m"),
        )  # fmt: skip
        return Table.of(heads, rows)

    def __str__(self) -> str:
        if len(self.cycles) == 1:
            return f"Interrupted before anything was known of the wear of {self.joint!r}"
        last, blocks = self.cycles[-1], len(self.cycles) - 1
        deepest, mean = (readable(depth, "m", 3) for depth in (self.deepest[-1], self.mean[-1]))
        begins = "After" if self.reached else "Interrupted: after"
        if self.growth is None:
            after, worn = f"{last:.6g}", self._spread(self.deepest)
            deepest += f" +- {readable(worn, 'm', 2)}" if worn else ""
        else:
            spread = self._spread(self.cycles)
            after = f"about {last:.3g}" + (f" +- {spread:.2g}" if spread else "")
        parts = ""
        if self.both_wear:
            bore, journal = (readable(depths[-1], "m", 3) for depths in (self.bore, self.journal))
            parts = f"; bore {bore}, journal {journal}"
        target = ""
        if not self.reached and self.growth is not None:
            target = f", not yet by {readable(self.growth, 'm', 3)}"
        return (
            f"{begins} {after} cycles the clearance of {self.joint!r} has grown by {deepest} "
            f"where wear is deepest ({mean} in the mean{parts}){target}: an estimate, by "
            f"{counted(blocks, 'block')} of equal cycles, each wearing as the runs at its "
            "beginning do"
        )


def _count(
    simulation: Simulation, worn: Depths, wear: Depths, begun: np.ndarray, growth: float
) -> float:
    """Number of cycles after which the deepest places are `growth` deeper than `begun`."""
    (name,) = worn

    def shortfall(count: float) -> float:
        profiles = _ground_all(simulation, worn, wear, count)[name]
        return float((profiles - begun).max(axis=(1, 2)).sum()) - growth

    # Enough if each azimuth wore by itself; grinding spreads the volume, so it may take more.
    upper = float(growth / wear[name].max())
    while shortfall(upper) < 0.0:
        upper *= 2.0
    return float(brentq(shortfall, 0.0, upper, rtol=1e-9))


@known_keywords
def wear(
    simulation: Simulation,
    joint: str,
    growth: float | None = None,
    *,
    cycles: float | None = None,
    blocks: int = 10,
    cycles_per_run: float = 1.0,
    runs: int = 1,
    jobs: int | None = None,
    progress: bool = False,
) -> WearLife:
    """Estimate the cycles until a clearance has grown by `growth`, or its bore after `cycles`.

    For each of `blocks` blocks, equal in growth or in cycles, a run is made with the bores as worn
    so far, and its wear per cycle is taken for that of all the block's cycles. Other joints with a
    wear rate wear as well.

    Args:
        simulation: a run of one or a few cycles of the machine.
        joint: joint whose clearance is to grow; it must have a `wear_rate`.
        growth: depth at the most worn place [m]; or
        cycles: number of cycles after which the worn bore is wanted.
        blocks: how many times the bores' shapes are brought up to date; more are more exact.
        cycles_per_run: cycles of the machine in one run.
        runs: runs of each block, their starts perturbed by different seeds if there are several;
            their scatter gives the standard error of their mean.
        jobs: processes; None takes one for each core.
        progress: show a bar on standard error.

    Returns:
        The estimate; if interrupted by Ctrl-C, that of the blocks done so far.

    Raises:
        JointplayError: a value out of range, a run that fails, or a joint that does not wear.
    """
    require_a("simulation", simulation, "Simulation")
    if (growth is None) == (cycles is None):
        raise JointplayError("wear needs either a growth of the clearance or a number of cycles")
    if growth is not None:
        require_positive("growth", growth, "m")
    if cycles is not None:
        require_positive("cycles", cycles, "")
    check_numbers(runs, jobs)
    require_positive("cycles per run", cycles_per_run, "")
    require_whole("blocks", blocks, 1, MOST_RUNS)
    begun = first_profile(_wear(simulation, joint))
    worn: Depths = {name: first_profile(bore) for name, bore in all_wearing(simulation).items()}
    first = simulation.seed or 0
    seeds = [simulation.seed] if runs == 1 else range(first + 1, first + runs + 1)
    measure = Measure(worn_depths, "a run with worn joints", check_step=True)
    done, scatter, profiles = [0.0], [0.0], [begun]
    with ProgressBar(total=blocks * runs, disable=not progress, unit="run", desc="wear") as bar:
        for block in range(1, blocks + 1):
            machine = with_worn(simulation, worn)
            try:
                depths = Study([replace(machine, seed=s) for s in seeds], measure).run(jobs, bar)
                mean = {
                    name: np.mean([run[name] for run in depths], axis=0) / cycles_per_run
                    for name in worn
                }
                if mean[joint].max() <= 0.0:
                    raise JointplayError(
                        f"the journal of {joint!r} does not slide under load: its clearance does "
                        "not grow"
                    )
                # Cycles of this block: an equal part of them all, or until its part of the growth.
                if growth is None:
                    assert cycles is not None
                    count = cycles / blocks
                else:
                    single = {joint: worn[joint]}
                    count = _count(simulation, single, mean, begun, growth * block / blocks)
                worn = _ground_all(simulation, worn, mean, count)
            except KeyboardInterrupt:
                break
            totals = np.array([depth[joint].sum() for depth in depths])
            done.append(done[-1] + count)
            scatter.append(standard_error(totals) / totals.mean())
            profiles.append(worn[joint])
    return WearLife(
        joint,
        np.array(done),
        np.array(profiles) - begun,
        np.array(scatter),
        growth,
        len(done) > blocks,
    )
