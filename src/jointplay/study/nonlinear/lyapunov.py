"""Largest Lyapunov exponent: the rate at which neighbouring motions part.

G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Lyapunov characteristic exponents for smooth
dynamical systems, Meccanica 15 (1980) 9-20: two trajectories are followed; at even intervals the
second is put back to the initial distance from the first, in the direction in which it has parted.
The exponent is the mean logarithm of the growth of the distance, over the interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jointplay.base.errors import JointplayError, require_positive, require_share, require_whole
from jointplay.model.loop import closing_rows
from jointplay.simulation.loads.drive import Prescribed, assign
from jointplay.simulation.result.variables import unit_of
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.nonlinear.steady_motion import check_base

APART = 1e-9
"""Distance of the two trajectories at the start of an interval, in the norm of `_weights` [m]."""
WEIGHT_OF_ANGLES = 1e-2
"""Weight of an angle in the norm of states: a journal's radius [m/rad]."""
WEIGHT_OF_SPEEDS = 1e-3
"""Weight of a speed in the norm of states [s]."""


@dataclass(frozen=True)
class Exponent:
    """Estimate of the largest exponent, with its confidence interval."""

    value: float
    """The exponent [1/s], or per unit of the interval."""
    low: float
    high: float
    """Ends of the confidence interval."""
    confidence: float
    """Confidence level of the interval."""
    groups: int
    """Number of group means from which the interval is found."""

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
    """The exponent, with Student's confidence interval from means of consecutive groups of growths.

    Successive growths are correlated; the means of long groups hardly are (batch means).

    Args:
        growths: logarithm of the growth in each interval, settled, shape (n,).
        interval: length of an interval [s].
        confidence: confidence level.
        groups: most groups.

    Raises:
        JointplayError: fewer than 3 growths, or numbers out of range.
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
    """Logarithm of the growth of a small difference in each interval, for any map or flow.

    Args:
        advance: function of the state at the beginning of an interval that returns that at its end.
        state: state at the start, shape (d,).
        number: number of intervals.
        distance: distance of the two trajectories at the start of an interval.
        seed: seed of the first direction.

    Returns:
        shape (number,).
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
        if not difference.any():  # died within rounding: any direction is as good
            difference = np.random.default_rng(k).normal(size=first.shape)
    return logarithms


def stretching(simulation: Simulation, interval: float) -> np.ndarray:
    """Logarithm of the growth of the distance between two runs in each interval, (intervals,).

    After each interval the second run is put back to the distance `APART` from the first, and the
    approach speeds that its contacts remember likewise. Coordinates with prescribed motion do not
    differ, and ideal loops stay closed.

    Args:
        simulation: the simulation, run to its end.
        interval: length of an interval, a whole number of steps [s].

    Raises:
        JointplayError: a run failed, or the base is free.
    """
    check_base(simulation.mechanism)
    runs = [Run(simulation) for _ in range(2)]
    for run in runs:
        run.begin()
    first, second = (run.workspace for run in runs)
    scale, free = _weights(runs[0])
    of_positions = np.tile(scale[: len(scale) // 2], 2)
    difference = np.random.default_rng(0).normal(size=len(scale)) / of_positions
    logarithms = []
    steps = round(interval / simulation.step)
    for _ in range(round(runs[0].total_steps / steps)):
        difference = _allowed(runs[0], free * difference)
        factor = APART / np.linalg.norm(scale * difference)
        state = np.concatenate([first.q, first.v]) + factor * difference
        second.q[:], second.v[:] = np.split(state, 2)
        # Contacts that touch in both runs keep their part of the difference in approach speed;
        # all else that they remember is that of the first run.
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
    """Weights of the state's components in its norm, and 1 where they are free, else 0; (2 nv,)."""
    mechanism, simulation = run.mechanism, run.simulation
    lengths = np.array([unit_of(mechanism, name) == "m" for name in mechanism.coordinates])
    weights = np.where(lengths, 1.0, WEIGHT_OF_ANGLES)
    free = np.ones(len(weights))
    for name, drive in assign(mechanism, simulation.motion, simulation.drive).items():
        if isinstance(drive, Prescribed):
            free[[mechanism.coordinate(name), mechanism.motor(name)]] = 0.0
    return np.concatenate([weights, WEIGHT_OF_SPEEDS * weights]), np.tile(free, 2)


def _allowed(run: Run, difference: np.ndarray) -> np.ndarray:
    """Projection of a difference of states onto those that keep ideal loops closed."""
    mechanism = run.mechanism
    closed = set(mechanism.loops) - set(mechanism.clearance)
    if not closed and not mechanism.locks:
        return difference
    rows = closing_rows(mechanism, run.workspace.q, closed)
    rows = rows * np.tile(difference[: rows.shape[1]] != 0.0, (len(rows), 1))
    inverse = np.linalg.pinv(rows)
    return np.concatenate([part - inverse @ (rows @ part) for part in np.split(difference, 2)])
