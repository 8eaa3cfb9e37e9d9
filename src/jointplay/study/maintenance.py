"""Cycles until wear makes the tool miss its tolerance, and which joint's wear it is.

Archard's law turns runs into worn bores (`wear`), the static budget turns worn bores into the
tool's worst-case error (`budget`, in which a worn bore counts as a round one as wide as its
deepest place). In each block the machine is run with the bores as they are, all joints with a wear
rate wear along, and as many cycles are taken for equal as bring the error a further part of the
way to the target. Worst case as to where the journals lie; an estimate as to the cycles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.poses import along_motion, start_of
from jointplay.base.errors import JointplayError, require_a, require_finite, require_positive
from jointplay.base.tables import Column, Table, counted
from jointplay.physics.joints import RollingBearing
from jointplay.simulation.analysis.uncertainty import standard_error
from jointplay.simulation.simulation import Simulation
from jointplay.study import wear

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
    reached: bool
    """Whether the target was reached; else the estimate was interrupted."""

    @property
    def life(self) -> float:
        return float(self.cycles[-1])

    @property
    def standard_error(self) -> float:
        """Of `life`, from the scatter of the runs; NaN with one run a block."""
        return float(np.linalg.norm(self.scatter[1:])) if len(self.scatter) > 1 else math.nan

    @property
    def spread(self) -> tuple[float, float]:
        """Cycles between which the life lies: two standard errors, and the wear rates' factor."""
        aside = 2.0 * self.standard_error if np.isfinite(self.standard_error) else 0.0
        return max(self.life - aside, 0.0) / self.factor, (self.life + aside) * self.factor

    @property
    def _answer(self) -> str:
        if not self.reached and len(self.cycles) == 1:
            return "Interrupted before anything was known of the wear"
        runs = " (scatter of the runs unknown: --runs 2 or more)"
        if np.isfinite(self.standard_error):
            runs = f" (+- {self.standard_error:.2g}, the standard error of the runs)"
        cycles, target = f"about {self.life:.3g} cycles{runs}", f"{1e3 * self.target:.4g} mm"
        if self.reached:
            return f"After {cycles} the tool may be more than its {target} off"
        return (
            f"Interrupted after the estimate of {cycles}, at which the tool may be "
            f"{1e3 * self.error[-1]:.4g} mm off, not yet its {target}"
        )

    @property
    def table(self) -> Table:
        shares = ", ".join(
            f"{name} {100 * part:.0f} %" for name, part in zip(self.joints, self.blame, strict=True)
        )
        low, high = self.spread
        known = f"{low:.2g} to {high:.2g} cycles if wear rates are known to a factor of "
        growth = zip(self.joints, self.growth.T, strict=True)
        return Table(
            (
                Column("cycles", self.cycles),
                Column("standard error of block", self.scatter, only="data"),
                Column("tool error", self.error, "m", "error_m", digits=4),
                *(
                    Column(name, depth, "m", f"growth_{name}_m", fine=True, digits=4)
                    for name, depth in growth
                ),
            ),
            notes=(
                f"growth of the error by joint: {shares}",
                self._answer,
                f"an estimate: {known}{self.factor:g}; tool error is the static worst case along "
                "the motion with each bore as wide as its deepest place; "
                f"{counted(len(self.cycles) - 1, 'block')} of equal cycles, each wearing as the "
                "runs at its beginning do",
            ),
        )

    def __str__(self) -> str:
        return str(self.table)


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
        blocks, runs, cycles_per_run, jobs, progress: see `wear_blocks`.
        factor: within which the wear rates are known; a handbook's are good to several.

    Returns:
        The estimate; interrupted by Ctrl-C, what is known so far.

    Raises:
        JointplayError: a value out of range; no joint wears, no motion; the target is missed
            already, or wear never leads to it; a run that fails.
    """
    require_a("simulation", simulation, "Simulation")
    require_positive("target", target, "m")
    wear.check_blocks(blocks, runs, cycles_per_run, jobs)
    if require_finite("the wear rates' factor", factor, "") < 1.0:
        raise JointplayError(f"the wear rates' factor must be >= 1, got {factor:g}")
    wearing = wear.all_wearing(simulation)
    if not wearing:
        joints = simulation.mechanism.clearance
        rolling = [name for name, one in joints.items() if isinstance(one, RollingBearing)]
        have = ", ".join(n for n, one in joints.items() if one.resultant is None) or "none"
        life = (
            f"; rolling bearings ({', '.join(rolling)}) have a rating life instead"
            if rolling
            else ""
        )
        raise JointplayError(
            f"no joint wears: give a joint with clearance (there is: {have}) a wear_rate{life}"
        )
    motion = simulation.motion
    if motion is None:
        raise JointplayError("nothing moves: the simulation has no motion, so nothing wears")
    poses = along_motion(simulation.mechanism, motion, _POSES, start_of(simulation))
    begun = {name: wear.first_profile(one) for name, one in wearing.items()}
    deepest = {name: _DEEPEST * one.journal_radius for name, one in wearing.items()}

    def error_of(worn: wear.Depths) -> float:
        mechanism = wear.with_worn(simulation, worn).mechanism
        return float(budget(mechanism, poses, driven=motion.joints).worst.max())

    first = error_of(begun)
    if first >= target:
        raise JointplayError(
            f"the tool's error can reach {1e3 * first:.4g} mm before anything wears: the target of "
            f"{1e3 * target:.4g} mm is exceeded already (jointplay budget shows by which joint)"
        )

    def cycles_until(part: float, worn: wear.Depths, rates: wear.Depths) -> float:
        """Cycles of this wear after which the tool's error is a part of the way to the target."""
        goal = first + (target - first) * part
        slides = [name for name in worn if rates[name].max() > 0.0]
        if not slides:
            raise JointplayError(
                f"no journal slides under load in {', '.join(worn)}: their clearances do not grow"
            )

        def missing(count: float) -> float:
            return error_of({name: worn[name] + count * rates[name] for name in worn}) - goal

        if missing(0.0) >= 0.0:
            return 0.0
        most = min((deepest[name] - worn[name].max()) / rates[name].max() for name in slides)
        high = min(1e-6 / max(rates[name].max() for name in slides), most)
        while missing(high) < 0.0:
            if high >= most:
                raise JointplayError(
                    f"wear does not lead to the target: a bore of {', '.join(slides)} is worn by "
                    f"{100 * _DEEPEST:g} % of its radius before the tool is off by "
                    f"{1e3 * goal:.4g} mm"
                )
            high = min(4.0 * high, most)
        return float(optimize.brentq(missing, 0.0, high, xtol=1e-4 * high, rtol=1e-4))

    done, whole = wear.wear_blocks(
        simulation, cycles_until, blocks, runs, cycles_per_run, jobs, progress
    )
    states = [begun, *(block.worn for block in done)]
    scatter = [0.0]
    for number, block in enumerate(done, 1):
        several = block.rates if runs > 1 else []
        each = [cycles_until(number / blocks, block.before, one) for one in several]
        scatter.append(standard_error(each))
    alone = np.array([error_of({**begun, name: states[-1][name]}) - first for name in begun])
    return Maintenance(
        tuple(begun),
        wear.cycles_after(done),
        np.array([[(worn[name] - begun[name]).max() for name in begun] for worn in states]),
        np.array([first, *map(error_of, states[1:])]),
        np.array(scatter),
        alone / alone.sum() if alone.sum() > 0.0 else alone,
        target,
        factor,
        whole,
    )
