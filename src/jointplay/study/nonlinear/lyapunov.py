"""Largest Lyapunov exponent: how fast neighbouring motions part.

G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Lyapunov characteristic exponents for smooth
dynamical systems, Meccanica 15 (1980) 9-20: two trajectories, put back to their first distance at
even intervals, in the direction in which they have parted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from jointplay.base.errors import JointplayError, require_positive, require_share, require_whole
from jointplay.model.loop import closing_rows
from jointplay.simulation.loads.drive import Prescribed
from jointplay.simulation.result.variables import unit_of
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.nonlinear.steady_motion import check_base

APART = 1e-9
"""Distance of the two trajectories at the start of an interval [m]."""
WEIGHT_OF_ANGLES = 1e-2
"""What an angle counts [m/rad]: a journal's radius."""
WEIGHT_OF_SPEEDS = 1e-3
"""What a speed counts [s]."""


@dataclass(frozen=True)
class Exponent:
    """An estimate of the largest exponent."""

    value: float
    """[1/s], or by the unit of the interval."""
    low: float
    high: float
    """Ends of the interval of confidence."""
    confidence: float
    """Its probability."""
    groups: int
    """Means that it was found from."""

    @property
    def verdict(self) -> str:
        if self.low > 0.0:
            return "chaotic"
        return "regular" if self.high < 0.0 else "undecided"

    def __str__(self) -> str:
        return (
            f"largest Lyapunov exponent {self.value:.4g}, {100 * self.confidence:g} % interval "
            f"{self.low:.4g} to {self.high:.4g}: {self.verdict}"
        )


def exponent(
    growths: np.ndarray, interval: float, confidence: float = 0.95, groups: int = 10
) -> Exponent:
    """The exponent, with Student's interval of the means of consecutive groups of growths.

    Growths that follow each other depend on each other; means of long groups hardly do.

    Args:
        growths: logarithm of the growth in each interval, settled, shape (n,).
        interval: its length [s].
        confidence: probability of the interval of confidence.
        groups: most groups.

    Raises:
        JointplayError: fewer than 3 growths, or numbers that make no sense.
    """
    from scipy import stats

    growths = np.asarray(growths, float).ravel()
    interval = require_positive("interval", interval, "s")
    confidence = require_share("confidence", confidence)
    groups = require_whole("groups", groups, 2)
    if len(growths) < 3:
        raise JointplayError(f"an exponent needs at least 3 growths, got {len(growths)}")
    means = [part.mean() / interval for part in np.array_split(growths, min(groups, len(growths)))]
    half = stats.t.ppf(0.5 + 0.5 * confidence, len(means) - 1) * np.std(means, ddof=1)
    half /= math.sqrt(len(means))
    value = float(growths.mean() / interval)
    return Exponent(value, value - float(half), value + float(half), confidence, len(means))


def growths(
    advance: Callable[[np.ndarray], np.ndarray],
    state: np.ndarray,
    number: int,
    distance: float = APART,
    seed: int = 0,
) -> np.ndarray:
    """Growth of a small difference in each interval, for a plain map or flow.

    Args:
        advance: from the state at the begin of an interval to that at its end.
        state: at the start, shape (d,).
        number: intervals.
        apart: distance at the start of an interval.
        seed: of the first direction.

    Returns:
        Logarithms, shape (number,).
    """
    number, seed = require_whole("number", number, 1), require_whole("seed", seed)
    distance = require_positive("apart", distance, "")
    first = np.atleast_1d(np.asarray(state, float))
    difference = np.random.default_rng(seed).normal(size=first.shape)
    logarithms = np.empty(number)
    for k in range(number):
        second = first + distance / np.linalg.norm(difference) * difference
        first, second = advance(first), advance(second)
        difference = second - first
        logarithms[k] = math.log(max(float(np.linalg.norm(difference)), 1e-300) / distance)
        if not difference.any():  # has died within rounding: any direction is as good
            difference = np.random.default_rng(k).normal(size=first.shape)
    return logarithms


def stretching(
    simulation: Simulation, interval: float, prepare: Callable[[Run], None] | None = None
) -> np.ndarray:
    """Logarithm of how far two runs part in each interval, shape (intervals,).

    The second is put back to the distance `APART` from the first after each interval; what its
    contacts remember of their approach is put back alike. Coordinates with prescribed motion have
    no neighbours, and ideal loops stay closed.

    Args:
        simulation: runs to its end.
        interval: a whole number of its steps [s].
        place: changes the state of each run before it begins.

    Raises:
        JointplayError: a run failed, or the base is free.
    """
    check_base(simulation.mechanism)
    runs = [Run(simulation) for _ in range(2)]
    for run in runs:
        if prepare is not None:
            prepare(run)
        run.begin()
    first, second = (run.workspace for run in runs)
    scale, free = _weights(runs[0])
    of_angles = np.tile(scale[: len(scale) // 2], 2)
    difference = np.random.default_rng(0).normal(size=len(scale)) / of_angles
    logarithms = []
    steps = round(interval / simulation.step)
    for _ in range(round(runs[0].total_steps / steps)):
        difference = _allowed(runs[0], free * difference)
        factor = APART / np.linalg.norm(scale * difference)
        state = np.concatenate([first.q, first.v]) + factor * difference
        second.q[:], second.v[:] = np.split(state, 2)
        contacts = first.contacts.copy()
        shared = (contacts["steps"] > 0) & (second.contacts["steps"] > 0)
        shift = second.contacts["ddelta0"] - contacts["ddelta0"]
        contacts["ddelta0"] += np.where(shared, factor * shift, 0.0)
        second.contacts[:] = contacts
        for run in runs:
            if not run.advance(steps):
                raise JointplayError(run.message(run.workspace.status))
            run.synchronize()
        difference = free * np.concatenate([second.q - first.q, second.v - first.v])
        logarithms.append(math.log(np.linalg.norm(scale * difference) / APART))
    return np.array(logarithms)


def _weights(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """What each part of a state counts, and 1 where it may have a neighbour, shape (2 nv,)."""
    mechanism, simulation = run.mechanism, run.simulation
    lengths = np.array([unit_of(mechanism, name) == "m" for name in mechanism.coordinates])
    weights = np.where(lengths, 1.0, WEIGHT_OF_ANGLES)
    free = np.ones(len(weights))
    driven = [] if simulation.motion is None else simulation.motion.joints
    for name in driven:
        drive = simulation.drive
        joint_drive = drive.get(name) if isinstance(drive, Mapping) else drive
        if isinstance(joint_drive, Prescribed):
            free[[mechanism.coordinate(name), mechanism.motor(name)]] = 0.0
    return np.concatenate([weights, WEIGHT_OF_SPEEDS * weights]), np.tile(free, 2)


def _allowed(run: Run, difference: np.ndarray) -> np.ndarray:
    """The part of a difference that keeps ideal loops closed."""
    mechanism = run.mechanism
    closed = set(mechanism.loops) - set(mechanism.clearance)
    if not closed and not mechanism.locks:
        return difference
    rows = closing_rows(mechanism, run.workspace.q, closed)
    rows = rows * np.tile(difference[: rows.shape[1]] != 0.0, (len(rows), 1))
    inverse = np.linalg.pinv(rows)
    return np.concatenate([part - inverse @ (rows @ part) for part in np.split(difference, 2)])
