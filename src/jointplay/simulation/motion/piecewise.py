"""Piecewise polynomials, as `scipy.interpolate` has them, which takes half a second to import."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, perm

import numpy as np


@dataclass(frozen=True)
class Piecewise:
    """Polynomials of several values, piece by piece; beyond its ends the first and last go on.

    The numbers are those of `scipy.interpolate.PPoly`, bit for bit.
    """

    c: np.ndarray
    """Coefficients in powers of the distance from where a piece begins, the highest power first;
    shape (powers, pieces, values)."""
    ends: np.ndarray
    """Of the pieces, (pieces + 1,)."""

    @classmethod
    def rest_to_rest(cls, ends: np.ndarray, values: np.ndarray) -> Piecewise:
        """The quintics through `values` (pieces + 1, n) that begin and end with no slope and no
        curvature."""
        spans = np.diff(ends)[:, None]
        c = np.zeros((6, *values[1:].shape))
        for a, corner in enumerate([values[:-1]] * 3 + [values[1:]] * 3):  # Bernstein's form
            for power in range(a, 6):
                sign = comb(5 - a, power - a) * (-1) ** power
                c[5 - power] += (-1) ** a * comb(5, a) * corner * sign / spans**power
        return cls(c, ends)

    def derivative(self, order: int) -> Piecewise:
        powers = range(len(self.c) - 1, order - 1, -1)
        factors = np.array([float(perm(power, order)) for power in powers])
        c = self.c[: len(self.c) - order] * factors[:, None, None]
        return Piecewise(c if len(c) else np.zeros((1, *self.c.shape[1:])), self.ends)

    def __call__(self, at: np.ndarray) -> np.ndarray:
        """Values at places (m,), shape (m, n)."""
        piece = np.clip(np.searchsorted(self.ends, at, "right") - 1, 0, len(self.ends) - 2)
        along = (at - self.ends[piece])[:, None]
        power = np.ones_like(along)
        total = np.zeros((len(at), self.c.shape[2]))
        for one in self.c[::-1, piece]:
            total = total + one * power
            power = power * along
        return total
