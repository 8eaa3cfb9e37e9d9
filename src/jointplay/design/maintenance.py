"""Cycles until wear makes the tool miss its tolerance, and which joint's wear it is.

Archard's law turns runs into worn bores (`wear`), the static budget turns worn bores into the
tool's worst-case error (`budget`, in which a worn bore counts as a round one as wide as its
deepest place). In each block the machine is run with the bores as they are, all joints with a wear
rate wear along, and as many cycles are taken for equal as bring the error a further part of the
way to the target. Worst case as to where the journals lie; an estimate as to the cycles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import optimize
from tqdm import tqdm

from jointplay.analysis.runs import MOST_RUNS, check_numbers
from jointplay.analysis.uncertainty import standard_error
from jointplay.core.errors import JointplayError, require_finite, require_positive, require_whole
from jointplay.design.poses import along_motion, start_of
from jointplay.design.static_budget import budget
from jointplay.design.wear import all_wearing, first_profile, wear_of_runs, with_worn
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion
from jointplay.simulation.simulation import Simulation

Worn = Mapping[str, np.ndarray]

_DEEPEST = 0.09
"""Part of its journal's radius beyond which a bore is none any more."""
_POSES = 25
"""Poses along the motion at which the error is looked at."""


@dataclass(frozen=True)
class Maintenance:
    """Growth of clearances and of the tool's error with the cycles: an estimate."""

    joints: tuple[str, ...]
    """Joints that wear."""
    cycles: np.ndarray
    """Cycles done after each block, the first entry 0, shape (blocks + 1,)."""
    growth: np.ndarray
    """Growth of each clearance where it is worn most, shape (blocks + 1, joints) [m]."""
    error: np.ndarray
    """Worst-case error of the tool along the motion, static, shape (blocks + 1,) [m]."""
    scatter: np.ndarray
    """Standard error of each block's cycles, from perturbed runs; NaN with one, (blocks + 1,)."""
    blame: np.ndarray
    """Part of the error's growth that each joint's wear alone brings about, of the sum of all, at
    the end, shape (joints,)."""
    target: float
    """Tolerance of the tool [m]."""
    factor: float
    """Factor within which the wear rates are known."""
    cycles_per_run: float
    reached: bool
    """Whether the target was reached; else the estimate was interrupted."""

    @property
    def life(self) -> float:
        """Cycles until the tool misses its tolerance."""
        return float(self.cycles[-1])

    @property
    def standard_error(self) -> float:
        """Of `life`, from the scatter of the runs; NaN with one run a block."""
        known = self.scatter[1:]
        return float(np.sqrt((known**2).sum())) if len(known) else math.nan

    @property
    def spread(self) -> tuple[float, float]:
        """Cycles between which the life lies: two standard errors, and the wear rates' factor."""
        aside = 2.0 * self.standard_error if np.isfinite(self.standard_error) else 0.0
        return max(self.life - aside, 0.0) / self.factor, (self.life + aside) * self.factor

    def __str__(self) -> str:
        """Table and outcome, and that it is an estimate."""
        head = "cycles       tool error [mm]  " + "  ".join(f"{n} [um]" for n in self.joints)
        rows = [
            f"{count:<11.4g}  {1e3 * error:<15.4g}  "
            + "  ".join(
                f"{1e6 * depth:<{len(name) + 5}.4g}"
                for name, depth in zip(self.joints, depths, strict=True)
            )
            for count, error, depths in zip(self.cycles, self.error, self.growth, strict=True)
        ]
        shares = ", ".join(
            f"{name} {100 * part:.0f} %" for name, part in zip(self.joints, self.blame, strict=True)
        )
        what = "until" if self.reached else "interrupted, not until"
        runs = (
            f" +- {self.standard_error:.2g} (standard error of the runs)"
            if np.isfinite(self.standard_error)
            else " (scatter of the runs unknown: --runs 2 or more)"
        )
        low, high = self.spread
        known = f"{low:.2g} to {high:.2g} cycles if wear rates are known to a factor of "
        return "\n".join(
            [
                head,
                *rows,
                f"growth of the error by joint: {shares}",
                f"about {self.life:.3g}{runs} cycles {what} the tool can miss its "
                f"{1e3 * self.target:.4g} mm",
                f"an estimate: {known}{self.factor:g}; tool error is the static worst case along "
                "the motion with each bore as wide as its deepest place; cycles are simulated, and "
                f"extrapolated over {len(self.cycles) - 1} blocks",
            ]
        )

    def csv(self) -> str:
        """A row for each block [m]."""
        rows = [
            "cycles,standard_error_of_block,error_m,"
            + ",".join(f"growth_{n}_m" for n in self.joints)
        ]
        for count, known, error, depths in zip(
            self.cycles, self.scatter, self.error, self.growth, strict=True
        ):
            rows.append(",".join(f"{x:.8g}" for x in (count, known, error, *depths)))
        return "\n".join([*rows, ""])


def maintenance(
    simulation: Simulation,
    target: float,
    *,
    blocks: int = 5,
    runs: int = 2,
    cycles_per_run: float = 1.0,
    factor: float = 3.0,
    jobs: int | None = None,
    progress: bool = False,
) -> Maintenance:
    """Estimate the cycles until wear lets the tool be off by more than `target`.

    Args:
        simulation: one run, of one or a few cycles of the machine; joints have a `wear_rate`.
        target: tolerance of the tool's place [m].
        blocks: how many times the bores are brought up to date.
        runs: perturbed runs of each block, whose mean wear is taken.
        cycles_per_run: cycles that one run holds.
        factor: within which the wear rates are known; a handbook's are good to several.
        jobs: processes for the runs; None takes one for each core.
        progress: show a bar on standard error.

    Returns:
        The estimate; interrupted by Ctrl-C, what is known so far.

    Raises:
        JointplayError: a value out of range; no joint wears, no motion; the target is missed
            already, or wear never leads to it; a run that fails.
    """
    check_numbers(runs, jobs)
    worn, poses = _checked(simulation, target, blocks, cycles_per_run, factor)
    deepest = {name: _DEEPEST * one.journal_radius for name, one in all_wearing(simulation).items()}
    begun = {name: profile.copy() for name, profile in worn.items()}

    def error_of(profiles: Worn) -> float:
        mechanism = with_worn(simulation, dict(profiles)).mechanism
        return _worst(mechanism, poses, simulation.motion)

    first = error_of(worn)
    if first >= target:
        raise JointplayError(
            f"the tool can be off by {1e3 * first:.4g} mm before anything wears: the target of "
            f"{1e3 * target:.4g} mm is missed already (jointplay budget says by which joint)"
        )
    cycles, errors, scatter, growth = [0.0], [first], [0.0], [np.zeros(len(worn))]
    bar = tqdm(total=blocks * runs, disable=not progress, unit="run", desc="wear")
    reached = False
    try:
        for block in range(blocks):
            rates = _rates(simulation, worn, runs, cycles_per_run, jobs, bar)
            rate = {name: np.mean([one[name] for one in rates], axis=0) for name in worn}
            goal = first + (target - first) * (block + 1) / blocks
            count = _cycles_until(goal, worn, rate, error_of, deepest)
            before = worn
            worn = {name: worn[name] + count * rate[name] for name in worn}
            cycles.append(cycles[-1] + count)
            errors.append(error_of(worn))
            several = rates if runs > 1 else []
            each = [_cycles_until(goal, before, one, error_of, deepest) for one in several]
            scatter.append(standard_error(each))
            growth.append(np.array([(worn[n] - begun[n]).max() for n in worn]))
        reached = True
    except KeyboardInterrupt:
        pass
    finally:
        bar.close()
    return Maintenance(
        tuple(worn),
        np.array(cycles),
        np.array(growth),
        np.array(errors),
        np.array(scatter),
        _blame(begun, worn, first, error_of),
        target,
        factor,
        cycles_per_run,
        reached,
    )


def _worst(mechanism: Mechanism, poses: np.ndarray, motion: Motion | None) -> float:
    """Static worst case along the motion [m]."""
    driven = None if motion is None else motion.joints
    return float(budget(mechanism, poses, driven=driven).worst.max())


def _checked(
    simulation: Simulation,
    target: float,
    blocks: int,
    cycles_per_run: float,
    factor: float,
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Profiles to begin with, and the poses to look at."""
    require_positive("target", target, "m")
    require_positive("cycles per run", cycles_per_run, "")
    require_whole("blocks", blocks, 1, MOST_RUNS)
    if require_finite("the wear rates' factor", factor, "") < 1.0:
        raise JointplayError(f"the wear rates' factor must be >= 1, got {factor:g}")
    clearance = simulation.mechanism.clearance
    wearing = all_wearing(simulation)
    if not wearing:
        have = ", ".join(clearance) or "none"
        raise JointplayError(
            f"no joint wears: give a joint with clearance (there is: {have}) a wear_rate"
        )
    if simulation.motion is None:
        raise JointplayError("nothing moves: the simulation has no motion, so nothing wears")
    near = start_of(simulation)
    poses = along_motion(simulation.mechanism, simulation.motion, _POSES, near)
    return {name: first_profile(one) for name, one in wearing.items()}, poses


def _rates(
    simulation: Simulation,
    worn: Worn,
    runs: int,
    cycles_per_run: float,
    jobs: int | None,
    bar: tqdm,
) -> list[dict[str, np.ndarray]]:
    """Depth a cycle by joint [m], of each run."""
    found = wear_of_runs(with_worn(simulation, dict(worn)), runs, jobs, bar)
    if any(max(depth.max() for depth in depths.values()) <= 0.0 for depths in found):
        raise JointplayError(
            f"no journal slides under load in {', '.join(worn)}: their clearances last"
        )
    return [{name: depth / cycles_per_run for name, depth in depths.items()} for depths in found]


def _cycles_until(
    goal: float,
    worn: Worn,
    rate: Worn,
    error_of: Callable[[Worn], float],
    deepest: Mapping[str, float],
) -> float:
    """Cycles of this wear after which the tool's error is `goal`."""

    def missing(count: float) -> float:
        return float(error_of({n: worn[n] + count * rate[n] for n in worn}) - goal)

    if missing(0.0) >= 0.0:
        return 0.0
    wearing = [name for name in worn if rate[name].max() > 0.0]
    most = min(
        (deepest[name] - float(worn[name].max())) / float(rate[name].max()) for name in wearing
    )
    high = min(1e-6 / max(float(rate[name].max()) for name in wearing), most)
    while missing(high) < 0.0:
        if high >= most:
            raise JointplayError(
                f"the bore of one of {', '.join(wearing)} is worn by {100 * _DEEPEST:g} % of its "
                f"radius before the tool is off by {1e3 * goal:.4g} mm: wear does not lead to the "
                "target"
            )
        high = min(4.0 * high, most)
    return float(optimize.brentq(missing, 0.0, high, xtol=1e-4 * high, rtol=1e-4))


def _blame(begun: Worn, worn: Worn, first: float, error_of: Callable[[Worn], float]) -> np.ndarray:
    """What the wear of each joint alone adds to the error, of the sum, shape (joints,)."""
    alone = np.array([error_of({**begun, name: worn[name]}) - first for name in worn])
    return np.asarray(alone / alone.sum()) if alone.sum() > 0.0 else alone
