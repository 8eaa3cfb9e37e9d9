"""Nuisances of a recording: offsets, drift and lateness, which enter linearly and are not sought.

Offsets are the place of the tracker's frame, the error of the robot's geometry at a place, and the
zeros of encoders; readings drift as the machine warms up, and may be late.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial.legendre import legvander

from jointplay.estimate.columns import Key
from jointplay.estimate.measurement import READINGS
from jointplay.estimate.model import StaticModel
from jointplay.estimate.unknowns import TINY
from jointplay.estimate.visits import Observed, signal_effect, stacked, tool_effect, tool_positions

REFERENCES = ("place", "frame", "ideal")
"""Knowledge of the tool's ideal place: that it is the same at each visit of a place (``place``);
all but where the tracker's frame lies (``frame``); all (``ideal``)."""
POLYNOMIAL_DEGREE = 3
"""Degree of the polynomials in time by which readings may drift, unless `identify` is given
another, and of those in each joint's position by which the geometry's error changes at a place
(judged: with 4 the same is told of 11 machines of benchmarks/truth/identify.py)."""


def nuisances(
    model: StaticModel, observed: Observed, reference: str, drift: int, late: bool
) -> tuple[np.ndarray, list[str]]:
    """Effect of all nuisances on the signals, (n, keys, columns), and labels of the last columns.

    In this order: lateness of each kind of reading, offsets, drift, places where friction may hold
    journals, and the compliances, which have the labels.
    """
    visits, keys = model.visits, model.keys
    tool = tool_positions(model.mechanism, visits.joints, visits.position)
    parts = [
        lags(observed) if late else stacked([], len(visits), keys),
        offsets(keys, visits.cell, visits.position, tool, reference),
        drifts(keys, visits.time.mean(axis=1), drift),
        model.loose(),
        *(soft.effect for soft in model.elastic),
    ]
    labels = [soft.label for soft in model.elastic for _ in range(soft.effect.shape[2])]
    return np.concatenate(parts, axis=2), labels


def offsets(
    keys: Sequence[Key], cell: np.ndarray, position: np.ndarray, tool: np.ndarray, reference: str
) -> np.ndarray:
    """Effect of unknown offsets on the signals, shape (n, keys, offsets).

    Visits of a place are not quite at the same one: beside an offset for each place, the geometry's
    error is a polynomial of the joints' positions.

    Args:
        keys: the signals.
        cell: number of the place of each visit, shape (n,).
        position: of the joints, shape (n, j) [rad or m].
        tool: position of the ideal tool, shape (n, 3) [m].
        reference: of `REFERENCES`.
    """
    n, columns = len(cell), []
    axes = [key for key in keys if key[0] == "tool"]
    if reference == "place":
        courses = [cell == number for number in np.unique(cell)] + _within(cell, position)
        columns += [signal_effect(keys, axis, course) for axis in axes for course in courses]
    elif reference == "frame" and axes:
        columns += [signal_effect(keys, axis, np.ones(n)) for axis in axes]
        arm = tool - tool.mean(axis=0)
        columns += [tool_effect(keys, np.cross(about, arm)) for about in np.eye(3)]
    columns += [signal_effect(keys, key, np.ones(n)) for key in keys if key not in axes]
    return stacked(columns, n, keys)


def _within(cell: np.ndarray, position: np.ndarray) -> list[np.ndarray]:
    """Powers of the joints' positions, less their means over the visits of a place, (n,) each."""
    powers = []
    for values in position.T:
        span = np.ptp(values)
        if span > 0.0:
            even = (values - values.mean()) / span
            for power in range(1, POLYNOMIAL_DEGREE + 1):
                moved = even**power
                for number in np.unique(cell):
                    moved[cell == number] -= moved[cell == number].mean()
                powers.append(moved)
    return powers


def drifts(keys: Sequence[Key], time: np.ndarray, degree: int) -> np.ndarray:
    """Effect of a slow drift at times (n,) on readings of tool and links, (n, keys, columns).

    Legendre polynomials up to a degree; 0: none.
    """
    middle, half = 0.5 * (time.min() + time.max()), max(0.5 * float(np.ptp(time)), TINY)
    shapes = legvander((time - middle) / half, degree)[:, 1:]
    columns = [
        signal_effect(keys, key, shape) for key in keys if key[0] in READINGS for shape in shapes.T
    ]
    return stacked(columns, len(time), keys)


def lags(observed: Observed) -> np.ndarray:
    """Effect of readings of tool and links that are late by a second, (n, keys, columns).

    A column for each kind of reading: its instrument has a clock of its own. The speed is that of
    the readings, not the ideal mechanism's: errors of its geometry would count as play.
    """
    kinds = np.array([kind for kind, _ in observed.keys])
    columns = [
        np.where(kinds == reading, -observed.rate, 0.0) for reading in READINGS if reading in kinds
    ]
    return stacked(columns, len(observed.rate), observed.keys)
