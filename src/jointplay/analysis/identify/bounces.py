"""Restitution from an accelerometer: a bouncing journal's flights grow shorter by it.

Under a constant load the flight after an impact that leaves with the speed v lasts 2 v / a, and
the next begins with e v: the intervals between impacts are a geometric series with the ratio e,
whatever mass and load are. A. D. Bernstein, American Journal of Physics 45 (1977) 41-44, for balls.
Only intervals count, so the sensor need not be calibrated. Sequences in which intervals do not fall
steadily (rims that strike in turn) are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import t as student

from jointplay.analysis.identify.reading import Measurement
from jointplay.mechanism.mechanism import Mechanism

FEWEST_RATIOS = 4
"""Ratios of successive flights from which on restitution is stated."""
_SHORTEST = 8
"""Records that a flight must last."""
_ABOVE = 8.0
"""Spreads of the records above which there is an impact."""
_PART = 0.02
"""Part of the largest impact's that an impact must reach."""
_STEADY = 0.15
"""Largest change of the ratio from flight to flight within a sequence."""
_LEAST_FLIGHTS = 3
_FACTOR = 0.6745


@dataclass(frozen=True)
class Restitution:
    """Of a joint's impacts, with 95 % interval; or why it cannot be told."""

    joint: str
    value: float
    half_width: float
    ratios: int
    """Of successive flights, which it is the mean of."""
    reason: str

    def __str__(self) -> str:
        """One line, as in the table."""
        label = f"{self.joint} restitution"
        if self.reason:
            return f"{label:<34} {'':>12} {'-':>12}  this measurement cannot tell: {self.reason}"
        low, high = self.value - self.half_width, min(self.value + self.half_width, 1.0)
        return (
            f"{label:<34} {'':>12} {self.value:>12.4g}  {low:.4g} to {high:.4g} "
            f"({self.ratios} ratios of flights)"
        )


def restitutions(mechanism: Mechanism, measured: Measurement) -> tuple[Restitution, ...]:
    """Restitution of each joint with clearance; none if there is no accelerometer."""
    axes = measured.has("acceleration")
    if not axes or not mechanism.clearance:
        return ()
    if len(mechanism.clearance) > 1:
        names = ", ".join(mechanism.clearance)
        reason = f"an impact may be of any of {names}; let one joint reverse at a time, and give "
        reason += "the others no clearance"
        return tuple(Restitution(n, np.nan, np.inf, 0, reason) for n in mechanism.clearance)
    (name,) = mechanism.clearance
    table = np.column_stack([measured.signals["acceleration", axis] for axis in axes])
    good = np.isfinite(table).all(axis=1)
    time, table = measured.time[good], table[good]
    logarithms = np.array(
        [np.log(r) for flights in sequences(time, table) for r in flights[1:] / flights[:-1]]
    )
    if len(logarithms) < FEWEST_RATIOS:
        rate = 1.0 / np.median(np.diff(time)) if len(time) > 1 else 0.0
        reason = (
            f"{len(logarithms)} ratios of successive flights between impacts at {rate:.4g} records "
            f"a second, {FEWEST_RATIOS} are needed; drop the load more often, or record faster"
        )
        return (Restitution(name, np.nan, np.inf, len(logarithms), reason),)
    middle = float(np.exp(logarithms.mean()))
    error = float(logarithms.std(ddof=1) / np.sqrt(len(logarithms)))
    half = middle * error * float(student.ppf(0.975, len(logarithms) - 1))
    return (Restitution(name, middle, half, len(logarithms), ""),)


def impacts(time: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Times of the impacts in accelerations (n, axes), [s]."""
    steps = np.linalg.norm(np.diff(acceleration, axis=0), axis=1)
    noise = np.median(steps) / _FACTOR
    limit = max(_ABOVE * noise, _PART * float(steps.max(initial=0.0)), 1e-9)
    at, _ = find_peaks(np.concatenate([[0.0], steps, [0.0]]), height=limit, distance=3)
    return np.asarray(time[np.minimum(at, len(time) - 1)])


def sequences(time: np.ndarray, acceleration: np.ndarray) -> list[np.ndarray]:
    """Flights [s] of each sequence of impacts that dies away steadily."""
    shortest = _SHORTEST * float(np.median(np.diff(time)))
    gaps = np.diff(impacts(time, acceleration))
    flights: list[np.ndarray] = []
    mine: list[float] = []

    def close() -> None:
        if len(mine) >= _LEAST_FLIGHTS:
            flights.append(np.array(mine))
        mine.clear()

    for gap in gaps:
        if gap < shortest:
            close()
            continue
        if mine and not gap < mine[-1]:
            close()
        elif len(mine) > 1 and abs(gap / mine[-1] - mine[-1] / mine[-2]) > _STEADY:
            last = mine[-1]
            close()
            mine.append(last)
        mine.append(float(gap))
    close()
    return flights
