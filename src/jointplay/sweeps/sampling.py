"""Points of the unit cube that samples of distributions are made of."""

from __future__ import annotations

import warnings

import numpy as np

from jointplay.codec import one_of
from jointplay.errors import JointplayError

METHODS = ("sobol", "latin-hypercube", "random", "saltelli")
"""`saltelli` is the design that Sobol indices are reckoned from: n (d + 2) points."""

GROWING = ("sobol", "random", "saltelli")
"""Methods whose first points stay when more are asked for."""

MOST_SAMPLES = 10_000_000

_INSIDE = 1e-12
"""No point is nearer to a face of the cube, where a normal distribution is infinite."""


def points(method: str, samples: int, dimensions: int, seed: int) -> np.ndarray:
    """Points in the unit cube, shape (rows, dimensions); the same for the same arguments.

    Args:
        method: see `METHODS`.
        samples: how many; of `saltelli`, of its base sample.
        dimensions: of the cube.
        seed: of the random numbers.

    Raises:
        JointplayError: no such method, or a number of samples that makes no sense.
    """
    if method not in METHODS:
        raise JointplayError(one_of("sampling", method, METHODS))
    if (
        not isinstance(samples, int)
        or isinstance(samples, bool)
        or not (1 <= samples <= MOST_SAMPLES)
    ):
        raise JointplayError(
            f"samples must be a whole number from 1 to {MOST_SAMPLES}, got {samples!r:.40}"
        )
    from scipy.stats import qmc  # which takes half a second that workers need not spend

    if method == "saltelli":
        design = _saltelli(samples, dimensions, seed)
    elif method == "random":
        design = np.random.default_rng(seed).random((samples, dimensions))
    elif method == "latin-hypercube":
        design = qmc.LatinHypercube(dimensions, seed=seed).random(samples)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of numbers that are no powers of two
            design = qmc.Sobol(dimensions, seed=seed).random(samples)
    return np.clip(design, _INSIDE, 1.0 - _INSIDE)


def _saltelli(samples: int, dimensions: int, seed: int) -> np.ndarray:
    """Blocks of d + 2 points: one of A, d with a column of B, one of B (Saltelli et al. 2010)."""
    if samples & (samples - 1):
        raise JointplayError(f"samples must be a power of two with saltelli, got {samples}")
    from scipy.stats import qmc

    design = qmc.Sobol(2 * dimensions, seed=seed).random(samples)
    a, b = design[:, :dimensions], design[:, dimensions:]
    blocks = np.repeat(a[:, None], dimensions + 2, axis=1)
    for k in range(dimensions):
        blocks[:, k + 1, k] = b[:, k]
    blocks[:, -1] = b
    return blocks.reshape(-1, dimensions)
