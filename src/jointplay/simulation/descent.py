"""Downhill in a few coordinates: where a potential with corners is lowest."""

from __future__ import annotations

from dataclasses import dataclass

import eigenpy
import numpy as np

_ROUNDING = 1e-14
"""Part of an energy that rounding blurs."""


@dataclass(frozen=True)
class Place:
    """A state that was tried, in the coordinates of the search."""

    q: np.ndarray
    height: float
    slope: np.ndarray
    bend: np.ndarray
    load: float

    def gain(self, other: Place, expected: float) -> float:
        """Part of the expected gain that another place brings.

        Where the gain drowns in rounding, 1 if it is less steep there, else 0.
        """
        if expected < _ROUNDING * max(abs(self.height), expected):
            return float(np.linalg.norm(other.slope) < np.linalg.norm(self.slope))
        return (self.height - other.height) / expected


def step_within(slope: np.ndarray, bend: np.ndarray, radius: float) -> tuple[np.ndarray, float]:
    """Step to the lowest point of a quadratic within a ball, and how much lower that is."""
    step = lowest(slope, bend, radius)
    return step, -float(slope @ step + 0.5 * step @ bend @ step)


def lowest(slope: np.ndarray, bend: np.ndarray, radius: float) -> np.ndarray:
    """Where a quadratic is lowest within a ball about the origin."""
    # Eigen's, for on a busy machine the threads of numpy's wait for each other.
    spectrum = eigenpy.SelfAdjointEigenSolver(0.5 * (bend + bend.T))
    sizes, axes = spectrum.eigenvalues(), spectrum.eigenvectors()
    along = axes.T @ slope
    least = 1e-13 * max(float(np.abs(sizes).max()), 1e-30)
    low = max(0.0, -float(sizes.min())) + least
    if sizes.min() > least and np.linalg.norm(along / sizes) <= radius:
        return -axes @ (along / sizes)
    if np.linalg.norm(along / (sizes + low)) <= radius:
        return -axes @ (along / (sizes + low))
    high = low + float(np.linalg.norm(along)) / radius
    for _ in range(100):
        middle = np.sqrt(low * high)
        if np.linalg.norm(along / (sizes + middle)) > radius:
            low = middle
        else:
            high = middle
        if high < 1.01 * low:
            break
    return -axes @ (along / (sizes + high))
